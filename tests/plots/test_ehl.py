"""Figures of the line contact, drawn from Datasets made by the model itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.models.base import Block
from mdr_dask.models.ehl_line.declaration import MODEL, STEEL, EhlLineParameters, coordinates
from mdr_dask.models.ehl_line.solve import compute
from mdr_dask.physics.lubrication.film_formulas import REGIMES
from mdr_dask.plots.ehl import PLOTS, _apart
from mdr_dask.plots.style import DATA

CONTACT = {"load_parameter": 2.0452e-5, "speed_parameter": 1e-11, "material_parameter": 5007.0}
DRAW = {plot.name: plot.draw for plot in PLOTS}


def series(outputs: tuple[str, ...], axes: dict[str, Any] | None = None, **given: Any) -> xr.Dataset:
    """Return what a store holds of a grid of cases."""
    axes = axes or {}
    parameters = EhlLineParameters(**({} if given.pop("only", False) else CONTACT), **given)
    sizes = [len(values) for values in axes.values()]
    columns = {
        name: np.ravel(array) for name, array in zip(axes, np.meshgrid(*axes.values(), indexing="ij"), strict=True)
    }
    block = Block(parameters, columns, int(np.prod(sizes)), (0,), 1, outputs)
    result = compute(block)
    data = {
        name: ((*axes, "realisation", *MODEL.output(name).dims), values.reshape(*sizes, *values.shape[1:]))
        for name, values in result.values.items()
    }
    scalars = {
        name: value
        for name, value in parameters.model_dump().items()
        if isinstance(value, float | int) and not isinstance(value, bool) and name not in axes
    }
    positions = {"position": coordinates(parameters)["position"].values}
    return xr.Dataset(data, coords=scalars | axes | positions)


def test_profile_shows_both_curves_and_the_dry_contact() -> None:
    figure = DRAW["film_profile"]({"": series(("film", "pressure"))})
    pressure_axes, film_axes = figure.axes
    assert [len(axes.lines) for axes in figure.axes] == [2, 1]
    assert np.nanmin(film_axes.lines[0].get_ydata()) == pytest.approx(2.138e-5, rel=0.01)
    assert "[GPa]" in pressure_axes.get_ylabel()
    assert pressure_axes.lines[1].get_ydata().max() == pytest.approx(2e-9 * STEEL * np.sqrt(2.0452e-5 / (2 * np.pi)))


def test_profiles_along_an_axis_and_equal_ones_once() -> None:
    starved = series(("film", "pressure"), {"inlet": np.array([-4.0, -1.5])})
    sliding = series(("film", "pressure"), {"slide_roll_ratio": np.array([0.01, 0.1])})
    figure = DRAW["film_profile"]({"starved": starved, "sliding": sliding})
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert [title.split(",")[0] for title in titles] == ["starved", "sliding"]
    data = [[line for line in axes.lines if line.get_gid() == DATA] for axes in figure.axes]
    assert [len(lines) for lines in data] == [2, 1, 2, 1] or [len(lines) for lines in data] == [2, 2, 2, 2]


def test_formula_ratio_is_the_same_in_numbers_and_in_units() -> None:
    speeds = np.array([1e-12, 1e-11])
    numbers = series(("central_film", "minimum_film"), {"speed_parameter": speeds})
    units = series(
        ("central_film", "minimum_film"),
        {"mean_velocity": speeds * 2 * STEEL * 0.02 / 0.1},
        only=True,
        line_load=2.0452e-5 * 2 * STEEL * 0.02,
        mean_velocity=1.0,
        pressure_viscosity=5007 / (2 * STEEL),
        radius=0.02,
        viscosity=0.1,
    )
    figure = DRAW["film_formula"]({"numbers": numbers, "units": units})
    for axes in figure.axes:
        first, second = axes.lines[:2]
        np.testing.assert_allclose(first.get_xydata(), second.get_xydata(), rtol=1e-8)
        assert np.all(first.get_ydata() > 0.9)


def test_regimes_start_from_the_rigid_limit() -> None:
    loads = np.array([1e-8, 1e-7])
    data = series(("minimum_film",), {"load_parameter": loads}, compressible=False)
    axes = DRAW["film_regimes"]({"": data}).axes[0]
    points = np.asarray(axes.collections[0].get_offsets())
    np.testing.assert_allclose(points[:, 1] * points[:, 0], 4.894968 / 2, rtol=0.02)  # W/sqrt(2U) = 0.02 at most
    low, high = axes.get_ylim()
    assert 0.01 * points[:, 1].min() < low < points[:, 1].min() < points[:, 1].max() < high


def test_starvation_and_traction_follow_their_axes() -> None:
    starved = series(("central_film", "minimum_film"), {"inlet": np.array([-4.0, -2.0, -1.2])})
    lines = [line for line in DRAW["starvation"]({"": starved}).axes[0].lines if line.get_gid() == DATA]
    assert len(lines) == 2
    assert np.all(np.diff(lines[0].get_ydata()) < 0)
    sliding = series(("traction_coefficient",), {"slide_roll_ratio": np.array([0.001, 0.01])}, shear_law="eyring")
    line = DRAW["traction"]({"": sliding}).axes[0].lines[0]
    assert np.all(np.diff(line.get_ydata()) > 0)


def test_labels_of_inlets_stand_a_twenty_fifth_of_their_axis_apart() -> None:
    shown = _apart(np.array([-20.0, -10.0, -9.3, -8.9, -2.0]))
    assert shown.tolist() == [-20.0, -10.0, -8.9, -2.0]


@pytest.mark.parametrize("name", list(DRAW))
def test_what_is_missing_is_said(name: str) -> None:
    with pytest.raises(DataError, match="no series of the store holds"):
        DRAW[name]({"other": xr.Dataset()})


def test_regime_map_names_all_regimes_and_places_the_films_in_them() -> None:
    """Points deep inside each regime lie under its name: the film found is that of the limit, to what a limit is."""
    points = {"load_parameter": np.array([1e-8, 2e-4]), "material_parameter": np.array([1.0, 5000.0])}
    axes = DRAW["regime_map"]({"": series(("minimum_film",), points)}).axes[0]
    assert {text.get_text().replace("\n", " ") for text in axes.texts} == set(REGIMES)
    dots = axes.collections[-1]
    ratio = np.asarray(dots.get_array())
    assert np.all((ratio > 0.7) & (ratio < 2))
    assert np.asarray(dots.get_offsets()).shape == (4, 2)


def test_a_map_of_fully_flooded_films_leaves_out_the_starved_and_says_so() -> None:
    outputs = ("central_film", "minimum_film")
    loads = series(outputs, {"load_parameter": np.array([1e-5, 1e-4])})
    starved = series(outputs, {"load_parameter": np.array([1e-5, 1e-4]), "inlet": np.array([-4.0, -1.5])})
    sliding = series(outputs, {"slide_roll_ratio": np.array([0.01, 0.1])})
    figure = DRAW["film_formula"]({"loads": loads, "starved": starved, "sliding": sliding})
    drawn = {str(line.get_label()).split(",")[0] for axes in figure.axes for line in axes.lines[:-1]}
    assert drawn == {"loads"}
    told = " ".join(text.get_text() for text in figure.texts).replace("\n", " ")
    assert "series starved, sliding, which do not vary W, U or G alone" in told
