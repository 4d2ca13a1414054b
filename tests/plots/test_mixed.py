"""Figures of mixed lubrication, drawn from stores made by hand: what stands on the axes is what is in the data."""

import numpy as np
import pytest
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.plots.mixed import PLOTS
from mdr_dask.plots.style import DATA, left_out

DRAW = {plot.name: plot.draw for plot in PLOTS}
REALISATIONS = 4


def dataset(axes, outputs, extra=None):
    """A group with values that grow along every axis, fixed operating conditions where no axis is."""
    coords = dict(axes) | {"realisation": np.arange(REALISATIONS)}
    fixed = {"normal_force": 800.0, "rotation_speed": 10.0, "temperature": 333.15}
    shape = [len(values) for values in coords.values()]
    generator = np.random.default_rng(0)
    base = sum(np.indices(shape)) / (1 + sum(shape)) + 0.01 * generator.random(shape)
    variables = {name: (list(coords), base) for name in outputs}
    for name, (dim, values) in (extra or {}).items():
        coords[dim] = values
        variables[name] = ([*axes, "realisation", dim], base[..., None] * np.cos(7 * values))
    return xr.Dataset(variables, coords | {k: v for k, v in fixed.items() if k not in axes})


OPERATION = {
    "normal_force": [100.0, 800.0],
    "rotation_speed": [9.0, 10.0, 20.0],
    "temperature": [313.15, 333.15, 353.15],
}


def lines_of(panel):
    return [line for line in panel.get_lines() if len(line.get_xdata()) > 2]


def data_of(panel):
    return [line for line in panel.get_lines() if line.get_gid() == DATA]


def test_temperature_shows_celsius_per_cent_and_one_line_a_load():
    data = dataset(OPERATION, ["breakthrough_probability"])
    figure = DRAW["temperature"]({"operation": data})
    assert len(figure.axes) == 3
    lines = data_of(figure.axes[0])
    assert len(lines) == 2
    np.testing.assert_allclose(lines[0].get_xdata(), [40, 60, 80])
    expected = 100 * data["breakthrough_probability"].isel(normal_force=0, rotation_speed=0).mean("realisation")
    np.testing.assert_allclose(lines[0].get_ydata(), expected)
    assert figure.axes[0].get_xlabel() == "temperature [°C]"
    assert "95 % intervals" in figure.get_suptitle()


def test_realisations_that_were_not_needed_do_not_count():
    data = dataset({"temperature": [313.15, 333.15]}, ["breakthrough_probability"])
    data["breakthrough_probability"][0, 1:] = np.nan
    figure = DRAW["temperature"]({"": data})
    y = data_of(figure.axes[0])[0].get_ydata()
    assert y[0] == pytest.approx(100 * float(data["breakthrough_probability"][0, 0]))


def test_sensitivity_has_a_panel_for_every_series_that_varies_something():
    groups = {
        "operation": dataset(OPERATION, ["breakthrough_probability"]),
        "rms": dataset(
            {"temperature": [313.15, 333.15], "rms_roughness": [1e-7, 2e-7, 4e-7]}, ["breakthrough_probability"]
        ),
        "hurst": dataset({"hurst": [0.5, 0.7]}, ["breakthrough_probability"]),
    }
    figure = DRAW["sensitivity"](groups)
    labels = [panel.get_xlabel() for panel in figure.axes if panel.get_visible()]
    assert labels == ["rms height $h$ [µm]", "Hurst exponent $H$"]
    np.testing.assert_allclose(data_of(figure.axes[0])[0].get_xdata(), [0.1, 0.2, 0.4])


def test_trace_is_over_the_time_of_a_turn():
    angle = np.linspace(0, 2 * np.pi, 50, endpoint=False)
    data = dataset({"temperature": [313.15, 333.15]}, [], {"contact_length_trace": ("angle", angle)})
    figure = DRAW["trace"]({"temperature": data})
    titles = [panel.get_title() for panel in figure.axes]
    assert ["temperature = 40 °C" in title for title in titles] == [True, False]
    assert ["temperature = 60 °C" in title for title in titles] == [False, True]
    np.testing.assert_allclose(figure.axes[0].get_lines()[0].get_xdata(), angle / 10.0 * 1e3)


def test_profiles_show_both_surfaces():
    place = np.linspace(-1.5, 1.5, 31)
    extra = {"upper_profile": ("position", place), "lower_profile": ("position", place)}
    data = dataset({"temperature": [313.15, 333.15]}, ["film"], extra)
    figure = DRAW["profiles"]({"": data})
    assert [len(lines_of(panel)) for panel in figure.axes] == [2, 2]


def test_stribeck_has_four_panels_and_a_line_a_load():
    outputs = ["friction_coefficient", "breakthrough_probability", "contact_length", "contact_half_width", "film_ratio"]
    axes = {"normal_force": [200.0, 800.0], "rotation_speed": [1.0, 10.0, 100.0]}
    data = dataset(axes, outputs) + 0.1
    figure = DRAW["stribeck"]({"": data})
    assert [len(lines_of(panel)) for panel in figure.axes] == [2, 2, 2, 2]
    np.testing.assert_allclose(lines_of(figure.axes[0])[0].get_xdata(), np.array([1, 10, 100]) * 30 / np.pi)


@pytest.mark.parametrize(("least", "bottom", "cut"), [(1e-3, 5e-4, ""), (1e-9, 1e-7, "values below 1e-07")])
def test_logarithmic_rows_end_at_their_data(least, bottom, cut):
    """They ended at a ten-millionth of the largest value, whatever there was to see."""
    data = dataset({"rotation_speed": [1.0, 10.0, 100.0]}, ["friction_coefficient"])
    data["friction_coefficient"][...] = np.array([1.0, 0.1, least])[:, None]
    figure = DRAW["stribeck"]({"": data})
    assert figure.axes[0].get_ylim() == pytest.approx((bottom, 2.0))
    assert (cut in left_out(figure)) if cut else (left_out(figure) == "")


def test_what_is_left_out_is_named_with_its_series():
    forces, heights = np.arange(1.0, 21.0), [1e-7, 2e-7, 3e-7]
    axes = {"temperature": np.arange(300.0, 309.0), "normal_force": forces, "rms_roughness": heights}
    data = dataset(axes, ["breakthrough_probability"])
    told = "19 of 20 values of normal_force (drawn: $F_N$ = 11 N)"
    assert left_out(DRAW["sensitivity"]({"": data})) == told
    assert left_out(DRAW["sensitivity"]({"a": data, "b": data})) == f"a: {told}; b: {told}"


@pytest.mark.parametrize("name", sorted(DRAW))
def test_a_store_without_the_outputs_is_told_what_is_missing(name):
    with pytest.raises(DataError, match="no series of the store"):
        DRAW[name]({"": dataset({"normal_force": [1.0, 2.0]}, ["asperity_load_share"])})


def test_figures_can_be_saved(tmp_path):
    DRAW["temperature"]({"": dataset(OPERATION, ["breakthrough_probability"])}).savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 1000
