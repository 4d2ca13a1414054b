"""Any output against its parameters: the data given are the data drawn."""

import io
import json

import numpy as np
import pandas as pd
import planted
import pytest
import toy
import xarray as xr
from curves import register

from mdr_dask import aggregation, execute
from mdr_dask.campaign import loads
from mdr_dask.errors import DataError
from mdr_dask.models.base import Status
from mdr_dask.plots import curves, page
from mdr_dask.plots.labels import chosen_units, printed_unit, symbols
from mdr_dask.plots.labels import label as axis_label
from mdr_dask.plots.render import render
from mdr_dask.plots.view import View, draw, figure_of
from mdr_dask.store import datasets

F = "  normal_force: {geometric: [10 mN, 100 N, 5]}\n"
V = "  velocity: {geometric: [0.01 mm/s, 10 m/s, 9]}\n"
MU = "friction_coefficient"


@pytest.fixture(scope="module")
def groups(tmp_path_factory):
    return planted.make(tmp_path_factory.mktemp("view"), planted.SLIDING + F + V + "  hurst: [0.3, 0.7]\n")


def described(groups, *arguments, **view):
    return figure_of(groups, *arguments, **view).describe(groups)


def rows(figure, what="data"):
    table = figure.table()
    return table[table.what == what]


def test_curves_are_the_means_with_their_intervals(groups):
    figure = described(groups, MU, "velocity", by="normal_force")
    data = groups[""].isel(hurst=1)
    drawn = rows(figure).set_index(["normal_force", "velocity"]).sort_index()
    mean, low, high = (
        each.to_series() for each in aggregation.mean_and_ends(data[MU], aggregation.companion(data, MU))
    )
    for column, values in (("y", mean), ("y_low", low), ("y_high", high)):
        np.testing.assert_allclose(drawn[column], values.reindex(drawn.index), rtol=1e-12)
    np.testing.assert_allclose(drawn.x, drawn.index.get_level_values("velocity"), rtol=1e-12)
    assert "1 of 2 values of hurst (drawn: $H$ = 0.7)" in figure.left_out
    assert "$H$ = 0.7" in figure.fixed
    assert len(figure.panels[0].traces) == 10  # five curves and their laws
    assert {key.label for key in figure.panels[0].keys} >= {"law (eq. 3.18)", "$F_N$ = 1 N"}


def test_pure_numbers_and_profiles_have_linear_axes(groups):
    data = groups[""]
    force = data.assign({MU: data[MU].assign_attrs(units="N")})
    profile = force.assign(status=data["status"].isel(velocity=0, drop=True))
    for drawn, axes in ((data, (True, False)), (force, (True, True)), (profile, (False, False))):
        panel = described({"": drawn}, MU, "velocity").panels[0]
        assert (panel.x.log, panel.y.log) == axes
    assert described(groups, MU, "velocity", log="xy").panels[0].y.log


def test_without_by_the_longest_axis_has_colours(groups):
    figure = described(groups, MU, "velocity")
    assert len(rows(figure).groupby("normal_force")) == len(figure.panels[0].keys) - 1 == 5  # and the law
    assert figure.left_out == ["1 of 2 values of hurst (drawn: $H$ = 0.7)"]


def test_the_unit_of_the_campaign_or_of_the_user_is_shown(groups):
    figure = described(groups, MU, "normal_force", by="velocity")
    assert figure.panels[0].x.label.endswith("[N]")
    with page.drawing_for(page.requested(units={"velocity": "km/h"})):
        figure = described(groups, MU, "velocity", by="normal_force")
    assert figure.panels[0].x.label == "velocity $v$ [km/h]"
    drawn = rows(figure)
    np.testing.assert_allclose(drawn.x, 3.6 * drawn.velocity)


def test_units_have_readable_prefixes(tmp_path):
    text = (
        planted.SLIDING.replace("0.5 um", "[2e-7, 5e-7]") + F.replace("10 mN, 100 N", "0.01, 100") + "  velocity: 1\n"
    )
    figure = described(planted.make(tmp_path, text), "contact_fraction", "rms_roughness")
    assert figure.panels[0].x.label == "rms height $h$ [nm]"
    np.testing.assert_allclose(np.unique(rows(figure).x), [200, 500])


@pytest.mark.parametrize(
    ("length", "label"), [(4e13, "distance [m]"), (4e-7, "distance [nm]"), (4e-20, "distance [m]")]
)
def test_a_size_beyond_common_prefixes_has_none(length, label):
    data = xr.Dataset({"distance": ("case", [length], {"units": "m"})})
    with page.with_labels(chosen_units({"": data}), {}):
        assert axis_label("distance", data["distance"]) == label


@pytest.mark.parametrize(
    ("model", "label"), [("fretting_wear", "amplitude $U_0$ [m]"), ("mine:MODEL", "amplitude [m]")]
)
def test_symbols_belong_to_the_models_of_this_package(model, label):
    data = xr.Dataset(coords={"amplitude": ("amplitude", [1.0], {"units": "m"})}, attrs={"model": model})
    with page.with_labels({}, symbols({"": data})):
        assert axis_label("amplitude", data["amplitude"]) == label
    output = xr.DataArray([1.0], attrs={"units": "V", "long_name": "amplitude of the signal"})
    assert axis_label("amplitude", output) == "amplitude of the signal [V]"


def test_powers_of_units_are_raised():
    assert printed_unit("s N^-0.8 um^2") == "s N$^{-0.8}$ µm$^{2}$"


def test_many_curves_have_a_colour_bar(groups):
    figure = described(groups, MU, "normal_force", by="velocity")
    panel = figure.panels[0]
    assert (panel.bar.label, panel.bar.log) == ("velocity $v$ [m/s]", True)
    assert panel.bar.low == pytest.approx(1e-5)
    assert len({trace.colour for trace in panel.traces}) == 9
    assert not panel.keys


def test_panels_are_values_of_an_axis(groups):
    figure = described(groups, MU, "velocity", by="normal_force", panels="hurst")
    assert [panel.title for panel in figure.panels] == ["$H$ = 0.3", "$H$ = 0.7"]
    drawn = rows(figure)
    for k, hurst in enumerate((0.3, 0.7)):
        assert set(drawn[drawn.panel == k + 1].hurst) == {hurst}


def test_a_map_has_the_mean_of_every_case(groups):
    figure = described(groups, MU, ("velocity", "normal_force"))
    drawn = rows(figure).set_index(["velocity", "normal_force"]).value
    mean = aggregation.mean(groups[""][MU].isel(hurst=1)).transpose("velocity", "normal_force").to_series()
    np.testing.assert_allclose(drawn, mean.reindex(drawn.index), rtol=1e-12)
    assert figure.panels[0].bar.log
    assert "at most ±" in figure.bars


def test_a_sampled_study_is_drawn_as_points(tmp_path):
    lhs = "  normal_force: {geometric: [1 mN, 100 N]}\n  velocity: {geometric: [0.01 mm/s, 1 m/s]}\n"
    lhs += "sampling: {latin_hypercube: 24}\n"
    groups = planted.make(tmp_path, planted.SLIDING + lhs)
    mean = aggregation.mean(groups[""][MU])
    figure = described(groups, MU, "velocity", by="normal_force")
    drawn = rows(figure).sort_values("velocity")
    np.testing.assert_allclose(drawn.y, mean.sortby("velocity"), rtol=1e-12)
    np.testing.assert_allclose(drawn.value, drawn.normal_force)
    assert [trace.kind for trace in figure.panels[0].traces] == ["dots"]
    assert "also varying: normal force" in [key.label for key in described(groups, MU, "velocity").panels[0].keys]
    assert {trace.kind for trace in described(groups, MU, ("velocity", "normal_force")).panels[0].traces} == {"dots"}
    assert described(groups, MU).panels[0].x.quantity == "normal_force"


def test_several_series_share_a_panel_or_have_their_own(tmp_path):
    text = (
        planted.SLIDING
        + V
        + "  normal_force: 1 N\nseries:\n  a: {}\n  b: {hurst: 0.3}\n  c: {normal_force: [1 N, 2 N]}\n"
    )
    figure = described(planted.make(tmp_path, text), MU, "velocity")
    labels = [key.label for key in figure.panels[0].keys]
    assert labels[:4] == ["a", "b", "c, $F_N$ = 1 N", "c, $F_N$ = 2 N"]
    many = text.replace("[1 N, 2 N]", "{linear: [1 N, 9 N, 9]}")
    (tmp_path / "many").mkdir()
    figure = described(planted.make(tmp_path / "many", many), MU, "velocity")
    assert [panel.title for panel in figure.panels] == ["series a", "series b"]
    assert "series c, whose curves differ in other parameters (--series draws them)" in figure.left_out


def test_words_are_ticks_and_cases_without_value_are_marked(tmp_path, monkeypatch):
    register(monkeypatch)
    text = "name: words\nmodel: curves\nparameters:\n  x: {geometric: [1, 100, 5]}\n  shape: [smooth, gap]\n"
    url = str(tmp_path / "words.zarr")
    execute.run(loads(text, "words.yaml", "."), url, execute.Resources(threads=1), lambda _: None)
    figure = described(datasets(url), "y", "shape", by="x")
    assert [name for _, name in figure.panels[0].x.ticks] == ["smooth", "gap"]
    figure = described(datasets(url), "y", "x")
    absent = rows(figure, "failed")
    assert set(absent["shape"]) == {"gap"}
    np.testing.assert_allclose(np.sort(absent.x), [10**0.5, 10])


@pytest.mark.parametrize(
    ("view", "message"),
    [
        (View("friction", "velocity"), "this study has no output 'friction'"),
        (View(MU, "velocty"), "did you mean 'velocity'"),
        (View(MU, "rms_roughness"), "is fixed"),
        (View(MU, "velocity", by="velocity"), "requested twice"),
        (View(MU, ("velocity", "hurst"), by="normal_force"), "without .by."),
        (View(MU, ()), "varies with a parameter"),
    ],
)
def test_what_cannot_be_drawn_is_refused_with_the_reason(groups, view, message):
    with pytest.raises(DataError, match=message):
        draw(groups, view)


def test_the_figure_and_its_table_are_written(groups, tmp_path):
    drawn = figure_of(groups, MU, "velocity", "normal_force").figure(groups)
    drawn.save(tmp_path / "mu.svg")
    text = (tmp_path / "mu.csv").read_text()
    read = pd.read_csv(io.StringIO(text), comment="#")
    assert list(read.columns) == ["panel", "curve", "what", "normal_force", "velocity", "x", "y", "y_low", "y_high"]
    pd.testing.assert_frame_equal(read, drawn.table(), check_dtype=False, check_exact=False)
    head = "".join(line for line in text.splitlines(True) if line.startswith("#"))
    for part in ("# study: campaign study, sha256", "hurst = 0.7", "shear_modulus = 10 MPa", "velocity [m/s]"):
        assert part in head
    drawn.save(tmp_path / "mu.svg")  # its own table may be replaced
    (tmp_path / "mine.csv").write_text("a,b\n1,2\n")
    with pytest.raises(DataError, match=r"mine\.csv exists"):
        drawn.save(tmp_path / "mine.png")


def test_an_output_with_its_own_dimension_is_drawn_against_it(tmp_path, monkeypatch):
    toy.register(monkeypatch)
    text = "name: own\nmodel: toy\noutputs: [trace]\nparameters:\n  position: [1 m, 2 m]\n"
    url = str(tmp_path / "own.zarr")
    execute.run(loads(text, "own.yaml", "."), url, execute.Resources(threads=1), lambda _: None)
    figure = described(datasets(url), "trace", "multiple")
    mean = aggregation.mean(datasets(url)[""]["trace"])
    np.testing.assert_allclose(rows(figure).y.to_numpy().reshape(2, 3), mean.transpose("position", "multiple"))
    with pytest.raises(DataError, match="over multiple"):
        described(datasets(url), "trace", "position")


def test_figures_do_not_change_the_study(groups):
    before = {name: data.copy(deep=True) for name, data in groups.items()}
    described(groups, MU, "velocity")
    for name, data in groups.items():
        xr.testing.assert_identical(data, before[name])


def test_means_without_failed_realisations_are_marked_and_counted(groups):
    data = groups[""].isel(hurst=0).load()
    bad = {"normal_force": 1, "velocity": 3, "realisation": 0}
    status, values = data["status"].copy(), data[MU].copy()
    status[bad], values[bad] = Status.FAILED.value, np.nan
    figure = described({"": data.assign({"status": status, MU: values})}, MU, "velocity", by="normal_force")
    (marked,) = rows(figure, "mean without realisations that failed").itertuples()
    assert (marked.normal_force, marked.velocity) == (float(data.normal_force[1]), float(data.velocity[3]))
    counts = rows(figure).set_index(["normal_force", "velocity"])["realisations"]
    most = data.sizes["realisation"]
    assert counts.min() == counts[marked.normal_force, marked.velocity] == most - 1
    assert counts.max() == most


@pytest.mark.parametrize("over", ["velocity", ("velocity", "normal_force")])
def test_failed_results_of_cases_that_are_not_drawn_are_not_counted(groups, over):
    data = groups[""].load()
    status = data["status"].copy()
    status[{"normal_force": 1, "velocity": 3, "hurst": [0, 1], "realisation": 0}] = Status.FAILED.value
    view = {"by": "normal_force"} if over == "velocity" else {}
    figure = described({"": data.assign(status=status)}, MU, over, **view)
    text = f"1 of {status.size // 2} results, because they failed; means over the other realisations of these cases"
    assert any(each.startswith(text) for each in figure.left_out)


def test_warnings_of_results_are_in_figure_and_table(groups):
    figure = described(groups, MU, "velocity")
    figure.warnings = ["3 results of the store: outside the range tested"]
    assert "warning: 3 results" in render(figure).get_suptitle()
    assert "warning: 3 results of the store: outside the range tested" in figure.head({})


@pytest.mark.parametrize("over", ["velocity", ("velocity", "normal_force")])
def test_intervals_of_means_are_called_so(groups, over):
    few = {"": groups[""].isel(realisation=[0])}
    for data, is_mean in ((groups, True), (few, False)):
        bars = described(data, MU, over).bars
        assert "95 % intervals" in bars
        assert ("95 % intervals of the mean" in bars) == is_mean


@pytest.mark.parametrize(("rule", "named"), [("exact", False), ("fast", True)])
def test_a_title_leaves_out_a_parameter_without_effect(rule, named):
    attrs = {"model": "fretting_wear", "parameters": json.dumps({"wear_rule": rule})}
    assert ("xi" in curves.scalars(xr.Dataset(coords={"xi": 0.8, "stick_radius": 0.5}, attrs=attrs))) == named
    varied = {"wear_rule": ("wear_rule", ["exact", "fast"]), "xi": 0.8}
    assert "xi" in curves.scalars(xr.Dataset(coords=varied, attrs=attrs))


def test_unused_defaults_are_not_mentioned():
    attrs = {"model": "fretting_wear", "parameters": "{}"}
    coords = {"cells": 200, "points": 50, "friction_scatter": 0.0, "amplitude_scatter": 0.1, "stick_radius": 0.5}
    assert set(curves.scalars(xr.Dataset(coords=coords, attrs=attrs))) == {
        "points",
        "amplitude_scatter",
        "stick_radius",
    }
