from __future__ import annotations

import math

import pytest

from mdr_dask.campaign.document import parse
from mdr_dask.campaign.problems import Place
from mdr_dask.errors import CampaignError


def read(text):
    document = parse(text, "a.yaml")
    document.problems.raise_if_any()
    return document


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("1e-6", 1e-6),
        ("1E5", 1e5),
        ("1.e3", 1e3),
        (".5", 0.5),
        ("+3", 3),
        ("-0x10", -16),
        ("0o17", 15),
        ("012", 12),
        ("1_000", 1000),
        ("1 mm", "1 mm"),
        ("1 %", "1 %"),
        ('"5"', "5"),
        ("on", "on"),
        ("yes", "yes"),
        ("true", True),
        ("False", False),
        ("~", None),
        ("", None),
        ("2026-01-01", "2026-01-01"),
        ("5:30", "5:30"),
        ("-.inf", -math.inf),
        ("[1, a, {b: 2}]", [1, "a", {"b": 2}]),
    ],
)
def test_scalars_are_those_of_yaml_1_2(written, value):
    data = read(f"key: {written}\n").data["key"]
    assert data == value
    assert type(data) is type(value)


def test_not_a_number_is_read():
    assert math.isnan(read("key: .nan").data["key"])


def test_places_count_from_one_and_fall_back_to_what_is_above():
    document = read("# comment\na:\n  b: [1, {c: 2}]\n")
    assert document.place(("a", "b", 1, "c")) == Place("a.yaml", 3, 14)
    assert document.key_place(("a", "b")) == Place("a.yaml", 3, 3)
    assert document.place(("a", "b", 7)) == Place("a.yaml", 3, 6)
    assert document.place(()) == Place("a.yaml", 2, 1)


def test_flow_keeps_scalars_as_written():
    document = read("a:\n  - shape: cone\n    angle: 10.0 deg\n    n: [1e3, 0x10]\n")
    assert document.flow(("a", 0)) == "{shape: cone, angle: 10.0 deg, n: [1e3, 0x10]}"


def test_an_alias_is_its_anchor():
    document = read("a: &x {b: 1}\nc: *x\n")
    assert document.data == {"a": {"b": 1}, "c": {"b": 1}}


def test_aliases_of_aliases_do_not_fill_the_memory():
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 9)]
    with pytest.raises(CampaignError, match="too deeply nested, too many values, or an alias that contains itself"):
        read("\n".join(lines))


def test_every_duplicate_is_reported():
    with pytest.raises(CampaignError, match=r"a\.yaml:2:1: a: this key was already given in line 1") as caught:
        read("a: 1\na: 2\nb:\n  c: 1\n  c: 2\n")
    assert len(caught.value.args) == 2
