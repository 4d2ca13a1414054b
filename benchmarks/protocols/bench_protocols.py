"""Run times of protocols: every element followed through a start from rest and a jump."""

import pytest

from benchmarks.protocols.work_precision import SOLIDS, followed, line


@pytest.mark.parametrize("name", list(SOLIDS))
def test_bench_protocol(benchmark, name):
    trace = benchmark(followed, line(8), SOLIDS[name], 0.5)
    assert (trace > 0).all()
