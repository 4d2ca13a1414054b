"""Made-up files of strangers, a few of each kind; ``python -m benchmarks runner fuzz`` looks for new ones."""

import fuzzing
import hypothesis
import pytest
import toy
from hypothesis import HealthCheck, given


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        toy.register(patch)
        yield fuzzing.sound_store(tmp_path_factory.mktemp("whole"))


@pytest.mark.parametrize("kind", fuzzing.CASES)
def test_what_strangers_send_is_run_or_refused_in_a_sentence(kind, whole):
    @hypothesis.settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(fuzzing.CASES[kind])
    def holds(case):
        fuzzing.examine(case, whole)

    holds()
