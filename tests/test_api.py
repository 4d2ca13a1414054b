"""docs/api.md follows from the docstrings, and every example in a docstring runs."""

import doctest
import sys
from importlib import import_module
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
sys.path.insert(0, str(DOCS))
from make_api import PUBLIC, api_page  # noqa: E402

ROOMS = sorted({module for rooms in PUBLIC.values() for module in rooms})


def test_the_page_is_up_to_date():
    assert (DOCS / "api.md").read_text() == api_page()


def test_every_subject_has_an_example():
    for subject, rooms in PUBLIC.items():
        things = [getattr(import_module(module), name) for module, names in rooms.items() for name in names.split()]
        assert all(thing.__doc__ for thing in things), subject
        assert any(">>>" in thing.__doc__ for thing in things), subject


@pytest.mark.parametrize("module", ROOMS)
def test_examples_run_as_they_stand(module):
    found = doctest.testmod(import_module(module), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert found.failed == 0
