"""Measured points in figures: in the figure of a calibration, and beside any curves."""

import numpy as np
import planted
import pytest

from mdr_dask.errors import DataError
from mdr_dask.fits.calibration import calibrate, measured_of, sentence, with_table
from mdr_dask.plots import available
from mdr_dask.plots.measured import with_points
from mdr_dask.plots.render import render

CAMPAIGN = planted.SLIDING + "  normal_force: [100 mN, 1 N]\n  velocity: {geometric: [0.01 mm/s, 10 m/s, 9]}\n"


@pytest.fixture
def groups(tmp_path):
    return planted.make(tmp_path, CAMPAIGN)


def drawn(groups, tmp_path, table, name="velocity"):
    path = tmp_path / "rig.csv"
    path.write_text(table)
    figures = {name: available("sliding_friction")[name]}
    given, figures = with_points(groups, figures, str(path))
    return figures[name].describe(given)


def test_points_have_the_colour_of_their_curve_and_their_error_bars(groups, tmp_path):
    table = "velocity [mm/s],normal_force [N],friction_coefficient,standard error\n1,0.1,2e-3,1e-4\n100,1,5e-3,2e-4\n"
    figure = drawn(groups, tmp_path, table)
    panel = figure.panels[0]
    curves = {trace.label: trace.colour for trace in panel.traces if trace.what == "data"}
    points = [trace for trace in panel.traces if trace.what == "measured"]
    assert [trace.label.removeprefix("measured, ") for trace in points] == list(curves)
    assert [trace.colour for trace in points] == list(curves.values())
    rows = figure.table().query("what == 'measured'")
    np.testing.assert_allclose(rows.y, [2e-3, 5e-3])
    np.testing.assert_allclose(rows.x, [1e-3, 0.1] if "[m/s]" in panel.x.label else [1, 100])
    np.testing.assert_allclose(rows.y_high - rows.y, [1.96e-4, 3.92e-4], rtol=1e-4)
    assert "measured, 95 %" in [key.label for key in panel.keys]


def test_points_without_the_parameter_of_the_curves_are_black(groups, tmp_path):
    figure = drawn(groups, tmp_path, "velocity [m/s],friction_coefficient\n0.01,2e-3\n0.02,5e-3\n")
    (points,) = (trace for trace in figure.panels[0].traces if trace.what == "measured")
    assert (points.colour, points.label, points.data["y"].size) == ("#000000", "measured", 2)
    assert "measured" in [key.label for key in figure.panels[0].keys]


def test_a_column_that_may_contain_the_axis_of_a_selection_is_refused(groups, tmp_path):
    groups = {"": groups[""].isel(normal_force=[0])}
    with pytest.raises(DataError, match="column 'w' is not used, but may contain 'normal_force'"):
        drawn(groups, tmp_path, "velocity [m/s],w [N],friction_coefficient\n0.01,0.1,2e-3\n0.02,1,5e-3\n")


def test_points_that_belong_to_curves_of_several_series_are_black(tmp_path):
    cycles = "  cycles: {geometric: [1, 8, 4]}\n  stick_radius: 0.5\n"
    series = "series: {depth: {hold: depth}, force: {hold: force}}\n"
    groups = planted.make(tmp_path, planted.FRETTING + cycles + series)
    (tmp_path / "rig.csv").write_text("cycles,wear_volume\n1,1.1\n8,1.2\n")
    figures = {"wear_growth": available("fretting_wear")["wear_growth"]}
    given, figures = with_points(groups, figures, tmp_path / "rig.csv")
    panel = figures["wear_growth"].describe(given).panels[0]
    assert len([trace for trace in panel.traces if trace.what == "data"]) == 2
    (points,) = (trace for trace in panel.traces if trace.what == "measured")
    assert (points.colour, points.label, points.data["y"].size) == ("#000000", "measured", 2)


def test_points_without_a_curve_are_counted_with_their_condition(groups, tmp_path):
    table = "velocity [m/s],normal_force [N],friction_coefficient\n0.01,0.1,2e-3\n0.01,7,5e-3\n"
    figure = drawn(groups, tmp_path, table)
    assert "1 of 2 measured points: no curve has their normal_force" in figure.left_out


def test_the_points_of_a_campaign_have_a_figure_with_a_reason_for_each_missing_point(groups, tmp_path):
    table = "velocity [m/s],normal_force [N],friction_coefficient\n0.01,0.1,2e-3\n0.02,1,5e-3\n0.03,1,6e-3\n"
    (tmp_path / "rig.csv").write_text(table)
    given = with_table(groups, str(tmp_path / "rig.csv"))
    figure = available("sliding_friction")["measured"].describe(given)
    assert sum(trace.data["y"].size for trace in figure.panels[0].traces if trace.what == "measured") == 3
    one = {key: data.isel(normal_force=[1]) for key, data in given.items()}
    assert add_points_of(one) == ["1 of 3 measured points: no curve has their normal_force"]
    with pytest.raises(DataError, match="expected a table of measurements"):
        available("sliding_friction")["measured"].describe(groups)


def add_points_of(groups):
    left_out = available("sliding_friction")["measured"].describe(groups).left_out
    return [text for text in left_out if "measured points" in text]


def test_measured_conditions_scatter_around_the_values_of_the_curves(groups, tmp_path):
    table = "velocity [m/s],normal_force [N],friction_coefficient\n0.01,0.0997,2e-3\n0.01,1.003,5e-3\n0.01,1.1,5e-3\n"
    figure = drawn(groups, tmp_path, table)
    curves = {trace.label: trace.colour for trace in figure.panels[0].traces if trace.what == "data"}
    points = [trace for trace in figure.panels[0].traces if trace.what == "measured"]
    assert [trace.colour for trace in points] == list(curves.values())
    assert "1 of 3 measured points: no curve has their normal_force" in figure.left_out
    assert any("2 of 3 points differ in normal_force by up to 0.3 %" in text for text in figure.notes)


@pytest.mark.parametrize(("row", "is_drawn"), [("1e9,4e-3", 1), ("0.01,4e6", 1), ("0,4e-3", 0)])
def test_points_are_drawn_wherever_the_axes_can_show_them(groups, tmp_path, row, is_drawn):
    figure = drawn(groups, tmp_path, f"velocity [m/s],friction_coefficient\n0.01,2e-3\n{row}\n")
    (points,) = (trace for trace in figure.panels[0].traces if trace.what == "measured")
    assert points.column("y").size == 1 + is_drawn
    assert any(text.startswith("1 of 2 measured points") for text in figure.left_out) == (not is_drawn)


def test_a_figure_takes_its_output_and_names_what_is_not_used(groups, tmp_path):
    rows = "1;0,002;0,5;0;9\n2;0,003;0,6;1e-4;9\n"
    table = f"velocity [mm/s];CoF;indentation depth [um];error of mu;Temp\n{rows}end of test;;;;\n"
    figure = drawn(groups, tmp_path, table)
    (points,) = (trace for trace in figure.panels[0].traces if trace.what == "measured")
    assert points.column("y").tolist() == [2e-3, 3e-3]
    notes = " ".join(figure.notes)
    for text in ("'error of mu' taken as one standard error", "Temp", "indentation depth", "end of test"):
        assert text in notes


def test_figures_of_other_quantities_are_refused(groups, tmp_path):
    table = "velocity [m/s],friction_coefficient\n0.01,2e-3\n0.02,5e-3\n"
    with pytest.raises(DataError, match=r"rig.csv contains friction_coefficient against velocity"):
        drawn(groups, tmp_path, table, "force")


def test_calibration_shows_what_the_fit_found(tmp_path):
    text = CAMPAIGN.replace("[100 mN, 1 N]", "{geometric: [100 mN, 10000 mN, 5]}")
    groups = planted.make(tmp_path, text)
    rows = [f"{v},{4e-3 * v**0.5:.6g},{1e-5:g}" for v in np.geomspace(1e-4, 1, 8)]
    path = tmp_path / "rig.csv"
    path.write_text("\n".join(["velocity [m/s],friction_coefficient,standard error", *rows]) + "\n")
    given = with_table(groups, path)
    found = calibrate(given[""], measured_of(given[""]))
    figure = available("sliding_friction")["calibration"].describe(given)
    assert figure.subject == f"calibration: {sentence(found)}"
    assert found.law_holds.startswith("no")
    assert "the errors do not explain the residuals" in render(figure).get_suptitle().replace("\n", " ")
    data = [trace for trace in figure.panels[0].traces if trace.kind == "curve"]
    np.testing.assert_allclose(np.sort(np.concatenate([t.column("y") for t in data])), np.sort(found.measured.values))
    residuals = [trace for trace in figure.panels[1].traces if trace.kind == "curve"]
    np.testing.assert_allclose(np.sort(residuals[0].column("y")), np.sort(found.residuals.scaled))
    density = figure.panels[2]
    assert density.x.label == "normal force $F_N$ [mN]"
    shades = [trace for trace in density.traces if trace.kind == "band"]
    assert bool(shades) != (density.title == "not determined")


def test_calibration_is_drawn_against_the_condition_with_the_most_set_values(tmp_path):
    """The two loads of the study have eight measured values, because an instrument does not meet them exactly."""
    groups = planted.make(tmp_path, CAMPAIGN + "  hurst: {linear: [0.5, 0.9, 5]}\n")
    rows = [f"{v},{f * (1 + k / 1e3)},{4e-3 * v**0.3}" for f in (0.1, 1) for k, v in enumerate((1e-3, 1e-2, 0.1, 1))]
    path = tmp_path / "rig.csv"
    path.write_text("\n".join(["velocity [m/s],normal_force [N],friction_coefficient", *rows]) + "\n")
    panel = available("sliding_friction")["calibration"].describe(with_table(groups, path)).panels[0]
    assert panel.x.quantity == "velocity"
    assert [trace.column("x").size for trace in panel.traces if trace.kind == "curve"] == [4, 4]


@pytest.mark.parametrize(("factor", "warnings"), [(1, 0), (1000, 1)])
def test_points_far_from_all_results_are_questioned(groups, tmp_path, factor, warnings):
    figure = drawn(
        groups, tmp_path, f"velocity [m/s],friction_coefficient\n0.01,{2e-3 * factor}\n0.02,{5e-3 * factor}\n"
    )
    assert sum("is the unit of the table right?" in each for each in figure.warnings) == warnings
