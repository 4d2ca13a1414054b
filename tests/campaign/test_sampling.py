"""Cases that are not a grid: zipped, drawn, or read from a table."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mdr_dask.campaign import loads
from mdr_dask.errors import CampaignError

HEAD = "name: a\nmodel: rubbing\nparameters:\n  length: 20 mm\n"
RANGES = "  normal_force: {geometric: [1 mN, 1 kN]}\n  velocity: {linear: [1 mm/s, 3 mm/s]}\n"


def read(parameters, rest, directory="."):
    [series] = loads(HEAD + parameters + rest, "a.yaml", str(directory)).series
    return series


def values(series, path):
    return next(axis.values for axis in series.axes if axis.path == path)


def test_zip_takes_values_together():
    series = read("  normal_force: [1, 2, 3]\n  velocity: {geometric: [1, 100, 3]}\n", "sampling: zip\n")
    assert series.sizes == {"case": 3}
    assert values(series, "velocity") == (1.0, 10.0, 100.0)


@pytest.mark.parametrize("design", ["sobol", "latin_hypercube"])
def test_drawn_cases_fill_their_ranges(design):
    number = 64
    series = read(RANGES, f"sampling: {{{design}: {number}}}\n")
    assert series.sizes == {"case": number}
    force = np.log10(values(series, "normal_force"))
    speed = np.array(values(series, "velocity"))
    for share in ((force + 3) / 6, (speed - 1e-3) / 2e-3):
        # 64 points of either design have exactly one in each 64th of each range
        assert sorted(np.floor(share * number)) == list(range(number))


def test_more_sobol_points_keep_the_first():
    few, many = (read(RANGES, f"sampling: {{sobol: {number}}}\n") for number in (5, 100))
    assert values(many, "velocity")[:5] == values(few, "velocity")


@pytest.mark.parametrize("design", ["sobol", "latin_hypercube"])
def test_drawn_cases_depend_on_the_seed_and_nothing_else(design):
    text = HEAD + RANGES + f"sampling: {{{design}: 8}}\n"
    first, again, other = (loads(text + seed, "a.yaml", ".").series for seed in ("seed: 1", "seed: 1", "seed: 2"))
    assert first == again
    assert values(first[0], "velocity") != values(other[0], "velocity")


def test_drawn_whole_numbers_are_whole():
    series = read("  normal_force: 1\n  points: {geometric: [2, 1000]}\n", "sampling: {sobol: 16}\n")
    assert all(type(value) is int and 2 <= value <= 1000 for value in values(series, "points"))


def test_a_table_gives_the_cases(tmp_path):
    (tmp_path / "cases.csv").write_text(
        "normal_force [mN],indenter.angle [deg],oversampling,points\n1,10,auto,100\n\n2.5,20,2,200\n3000,30,4,300\n"
    )
    series = read("  indenter: {shape: cone}\n", "sampling: {table: cases.csv}\n", tmp_path)
    assert series.sizes == {"case": 3}
    assert values(series, "normal_force") == (0.001, 0.0025, 3.0)
    assert values(series, "indenter.angle") == pytest.approx([math.radians(a) for a in (10, 20, 30)])
    assert values(series, "points") == (100, 200, 300)
    labelled = next(axis for axis in series.axes if axis.path == "oversampling")
    assert (labelled.values, labelled.labels) == (("auto", 2, 4), ("auto", "2", "4"))
    assert series.parameters.indenter.angle == values(series, "indenter.angle")[0]


@pytest.mark.parametrize(
    ("column", "message"),
    [
        ("indenter.angle", "expected indenter: {shape: cone} in the campaign file"),
        ("indenter.exponent", "expected indenter: {shape: power, radius: ...} in the campaign file"),
        ("finish.trace", "expected finish: {} in the campaign file"),
        ("indenter.angel", "no such parameter"),
        ("velocty", r"no such parameter \(did you mean 'velocity'\?\)"),
    ],
)
def test_a_column_within_a_parameter_says_what_the_file_lacks(tmp_path, column, message):
    (tmp_path / "cases.csv").write_text(f"normal_force [N],{column}\n1,0.5\n2,0.6\n")
    with pytest.raises(CampaignError, match=f"cases.csv:1: {column}: {message}"):
        read("", "sampling: {table: cases.csv}\n", tmp_path)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_a_table_of_cases_is_read_like_any_other(encoding, tmp_path):
    text = "Plan of \u00b5 tests\nnormal_force;velocity;Pr\u00fcfer\n[N];[mm/s];\n1;100;a\n5;500,5;b\n20;9000\n"
    (tmp_path / "plan.csv").write_bytes(text.encode(encoding))
    campaign = loads(HEAD + "sampling: {table: plan.csv}\n", "a.yaml", str(tmp_path))
    assert values(campaign.series[0], "velocity") == (0.1, 0.5005, 9.0)
    assert campaign.remarks == ("table plan.csv: not used: Pr\u00fcfer",)
