"""Ranges, lists and structures become axes; series become groups."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mdr_dask.campaign import loads
from mdr_dask.campaign.variation import Spread, spaced
from mdr_dask.errors import CampaignError

HEAD = "name: a\nmodel: rubbing\nparameters:\n  length: 20 mm\n"


def read(parameters="  normal_force: 1 N\n", rest=""):
    return loads(HEAD + parameters + rest, "a.yaml", ".")


def axes(*arguments):
    [series] = read(*arguments).series
    return {axis.path: axis for axis in series.axes}


def test_plain_values_make_no_axis():
    [series] = read().series
    assert (series.name, series.axes, series.sizes) == ("", (), {})
    assert series.parameters.length == 0.02
    assert series.parameters.velocity == 1.0


@pytest.mark.parametrize(
    "written", ["[1 mN, 10 N, 3]", "{values: [1 mN, 10 N, 3]}", "\n    - 1 mN\n    - 10 N\n    - 3"]
)
def test_lists_are_axes_in_the_order_of_the_file(written):
    axis = axes(f"  normal_force: {written}\n")["normal_force"]
    assert axis.values == (1e-3, 10.0, 3.0)
    assert (axis.name, axis.dim, axis.labels, axis.unit) == ("normal_force", "normal_force", None, "N")
    assert axis.long_name == "normal force"


def test_decades_are_decades():
    axis = axes("  velocity: 1 nm/s\n  normal_force: {geometric: [1 uN, 1 MN, 13]}\n")["normal_force"]
    assert axis.values == tuple(float(f"1e{power}") for power in range(-6, 7))


def test_whole_numbers_are_rounded_each_once():
    axis = axes("  normal_force: 1\n  points: {geometric: [2, 10, 20]}\n")["points"]
    assert axis.values == (2, 3, 4, 5, 6, 7, 8, 9, 10)
    assert all(type(value) is int for value in axis.values)


def test_a_list_is_one_value_of_a_parameter_that_is_a_list():
    [series] = read("  normal_force: 1\n  moduli: [1 MPa, 2e6, 3 GPa]\n").series
    assert series.parameters.moduli == (1e6, 2e6, 3e9)
    assert series.axes == ()


def test_lists_of_lists_are_varied_by_values():
    axis = axes("  normal_force: 1\n  moduli: {values: [[1 MPa], [1 MPa, 2 MPa]]}\n")["moduli"]
    assert axis.values == ((1e6,), (1e6, 2e6))
    assert axis.labels == ("[1 MPa]", "[1 MPa, 2 MPa]")
    assert axis.unit is None


def test_an_entry_of_a_structure_varies_under_its_dotted_path():
    [series] = read("  normal_force: 1\n  indenter: {shape: cone, angle: {linear: [0.1, 1.3, 7]}}\n").series
    [axis] = series.axes
    assert (axis.path, axis.name, axis.unit) == ("indenter.angle", "indenter_angle", "rad")
    assert axis.values == (0.1, 0.3, 0.5, 0.7, 0.9, 1.1, 1.3)
    assert series.parameters.indenter.angle == 0.1


def test_whole_structures_are_labelled_as_written():
    axis = axes("  normal_force: 1\n  indenter: [{shape: cone,  angle: 10 deg}, {shape: plane}]\n")["indenter"]
    assert axis.labels == ("{shape: cone, angle: 10 deg}", "{shape: plane}")
    assert [value.shape for value in axis.values] == ["cone", "plane"]
    assert axis.values[0].angle == math.radians(10)


@pytest.mark.parametrize(
    ("key", "written", "values", "labels"),
    [
        ("scheme", "[euler, exact]", ("euler", "exact"), ("euler", "exact")),
        ("oversampling", "[auto, 1, 2]", ("auto", 1, 2), ("auto", "1", "2")),
        ("oversampling", "[1, 2]", (1, 2), None),
        ("depth", "[~, 1 mm]", (None, 0.001), ("~", "1 mm")),
        ("shift", "[true, false]", (True, False), ("true", "false")),
    ],
)
def test_names_have_labels_and_numbers_have_none(key, written, values, labels):
    axis = axes(f"  normal_force: 1\n  {key}: {written}\n")[key]
    assert (axis.values, axis.labels) == (values, labels)


def test_files_are_values_with_their_names(tmp_path):
    (tmp_path / "one.txt").write_text("1")
    (tmp_path / "two.txt").write_text("2")
    text = HEAD + "  normal_force: 1\n  profile: [one.txt, two.txt]\n"
    [series] = loads(text, "a.yaml", str(tmp_path)).series
    [axis] = series.axes
    assert axis.labels == ("one.txt", "two.txt")
    assert [value.read_text() for value in axis.values] == ["1", "2"]


def test_a_series_replaces_parameters_wholly():
    campaign = read(
        "  normal_force: [1, 2]\n  hurst: 0.5\n  indenter: {shape: cone, angle: {linear: [0.1, 0.2, 2]}}\n",
        "series:\n  rough: {hurst: [0.1, 0.9]}\n  flat: {normal_force: 3, indenter: {shape: plane}}\n",
    )
    rough, flat = campaign.series
    assert rough.name == "rough"
    assert list(rough.sizes.items()) == [("normal_force", 2), ("hurst", 2), ("indenter_angle", 2)]
    assert flat.name == "flat"
    assert flat.sizes == {}
    assert (flat.parameters.normal_force, flat.parameters.indenter.shape) == (3.0, "plane")


def test_a_problem_of_the_base_is_reported_once():
    with pytest.raises(CampaignError, match=r"a\.yaml:5:17: parameters\.normal_force") as caught:
        read("  normal_force: -1\n", "series:\n  a: {hurst: 0.1}\n  b: {hurst: 0.2}\n")
    assert len(caught.value.args) == 1


def test_values_that_only_fit_together_are_checked_together():
    pairs = "  normal_force: [1 N, 10 N]\n  velocity: [1000, 10000]\n"
    [series] = read(pairs, "sampling: zip\n").series
    assert series.sizes == {"case": 2}
    with pytest.raises(CampaignError, match="expected a velocity of at most 1000 m/s a newton"):
        read(pairs)


finite = st.floats(1e-6, 1e6)


@given(finite, finite, st.integers(2, 200), st.booleans())
def test_ranges_have_exact_ends_and_even_steps(low, high, count, geometric):
    assume(abs(high - low) > 1e-6 * max(high, low))
    values = spaced(Spread(low, high, geometric, whole=False), count)
    assert (values[0], values[-1], len(values)) == (low, high, count)
    measure = math.log if geometric else float
    steps = [measure(b) - measure(a) for a, b in pairwise(values)]
    scale = abs(measure(low)) + abs(measure(high)) + 1.0
    # each value is rounded to 14 digits, so a step is off by two such roundings
    assert steps == pytest.approx([(measure(high) - measure(low)) / (count - 1)] * (count - 1), abs=1e-12 * scale)


@given(st.integers(1, 10**6), st.integers(1, 10**6), st.integers(2, 60), st.booleans())
def test_whole_ranges_are_strictly_monotonic(low, high, count, geometric):
    assume(low != high)
    values = spaced(Spread(low, high, geometric, whole=True), count)
    assert (values[0], values[-1]) == (low, high)
    assert all((b - a) * (high - low) > 0 for a, b in pairwise(values))
    assert len(values) <= min(count, abs(high - low) + 1)
