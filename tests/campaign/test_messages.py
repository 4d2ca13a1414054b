"""Unions of structures are explained by the structure that the value claims to be."""

from __future__ import annotations

from typing import Literal

import pytest
from pydantic import Field, ValidationError

from mdr_dask.campaign.messages import report_errors
from mdr_dask.campaign.problems import dotted
from mdr_dask.models.base import Parameters, quantity


class Sphere(Parameters):
    shape: Literal["sphere"]
    radius: float = quantity("m", "radius", gt=0)


class Wedge(Parameters):
    shape: Literal["wedge"]
    slope: float = quantity("1", "slope", gt=0)


class Undiscriminated(Parameters):
    body: Sphere | Wedge = Field(description="body")
    counts: tuple[int, int] = Field((1, 1), strict=False, description="numbers of waves")


def problems(data):
    found = []
    with pytest.raises(ValidationError, match="Undiscriminated") as caught:
        Undiscriminated.model_validate(data)
    report_errors(caught.value, Undiscriminated, data, lambda path, what, key: found.append(f"{dotted(path)}: {what}"))
    return found


def test_only_the_branch_that_is_meant_is_explained():
    assert problems({"body": {"shape": "wedge", "slope": -1.0}}) == ["body.slope: expected a number above 0, got -1.0"]


def test_a_missing_entry_of_that_branch_is_named():
    assert problems({"body": {"shape": "sphere"}}) == [
        "body.radius: missing, expected a length (such as '20 mm'): radius"
    ]


def test_an_unknown_branch_names_the_known_ones():
    found = problems({"body": {"shape": "cube"}})
    assert "body.shape: expected 'sphere' or 'wedge', got 'cube'" in found


def test_entries_of_lists_have_their_index():
    assert problems({"body": {"shape": "wedge", "slope": 1.0}, "counts": [1, 2.5]}) == [
        "counts[1]: expected a whole number, got 2.5"
    ]
