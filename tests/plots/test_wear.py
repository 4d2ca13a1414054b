import json

import numpy as np
import pytest
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.models.base import Block
from mdr_dask.models.fretting_wear import MODEL
from mdr_dask.models.fretting_wear.declaration import FrettingWear
from mdr_dask.plots import wear

RADIUS = np.linspace(0, 1.6, 41)


def study(rule, cycles, xi=None, sticks=(0.5, 0.7), realisations=(0,)):
    """A series over stick radius, cycles and perhaps xi, as a store would hand it out."""
    axes = {"stick_radius": np.array(sticks), "cycles": np.array(cycles)}
    if xi is not None:
        axes["xi"] = np.array(xi)
    mesh = np.meshgrid(*axes.values(), indexing="ij")
    columns = {name: part.ravel() for name, part in zip(axes, mesh, strict=True)}
    outputs = ("wear_volume", "worn_profile", "worn_image")
    parameters = FrettingWear(
        stick_radius=0.5, wear_rule=rule, points=41, amplitude_scatter=0.1 * (len(realisations) > 1)
    )
    values = MODEL.compute(Block(parameters, columns, mesh[0].size, realisations, 0, outputs)).values
    shape = (*mesh[0].shape, len(realisations))
    dims = (*axes, "realisation")
    place = {"wear_volume": (), "worn_profile": ("radius",), "worn_image": ("position",)}
    return xr.Dataset(
        {n: ((*dims, *place[n]), v.reshape(*shape, *v.shape[2:])) for n, v in values.items()},
        coords={**axes, "radius": RADIUS, "position": RADIUS, "realisation": list(realisations)},
    )


@pytest.fixture(scope="module")
def methods():
    cycles = [0.5, 2.0]
    return xr.concat(
        [study(m, cycles) for m in ("exact", "fast", "limit")], xr.Variable("wear_rule", ["exact", "fast", "limit"])
    )


def test_development_draws_every_cycle_and_the_limit(methods):
    figure = wear.draw_development({"development": methods.isel(wear_rule=0), "all": methods})
    left, right = figure.axes
    assert len(left.lines) == len(right.lines) == 3
    assert left.lines[-1].get_linestyle() == ":"
    assert "a_0" in left.get_xlabel()
    figure.savefig(__import__("io").BytesIO())


@pytest.mark.parametrize(("sticks", "drawn"), [((0.5, 0.7), True), ((0.52, 0.72), False)])
def test_a_limit_is_drawn_of_the_same_case_only(sticks, drawn):
    limit = study("limit", [8.0], sticks=sticks).expand_dims(wear_rule=["limit"])
    figure = wear.draw_development({"development": study("exact", [0.5, 2.0]), "long": limit})
    dotted = [line for line in figure.axes[0].lines if line.get_linestyle() == ":"]
    assert len(dotted) == drawn
    for line in dotted:
        same = limit.worn_profile.isel(wear_rule=0, cycles=0, realisation=0)
        shown = [np.allclose(line.get_ydata(), one) for one in same.transpose("stick_radius", "radius").to_numpy()]
        assert sum(shown) == 1


def test_profiles_draw_exact_dashed_fast_full_and_the_limit_dotted(methods):
    figure = wear.draw_profiles({"parabola": methods})
    assert len(figure.axes) == 4
    styles = [line.get_linestyle() for line in figure.axes[0].lines]
    assert styles[:1] + styles[-1:] == ["--", ":"]


def test_every_stick_radius_has_its_own_row_of_profiles():
    sticks = (0.3, 0.5, 0.7, 0.8)
    data = study("fast", [2.0], sticks=sticks)
    figure = wear.draw_profiles({"": data})
    assert len(figure.axes) == 2 * len(sticks)
    for output, panels in (("worn_profile", figure.axes[::2]), ("worn_image", figure.axes[1::2])):
        for number, axes in enumerate(panels):
            drawn = [line.get_ydata() for line in axes.lines if len(line.get_ydata()) == RADIUS.size]
            worn = data[output].isel(stick_radius=number, cycles=0, realisation=0).values
            assert any(np.allclose(line, worn) for line in drawn)


@pytest.mark.parametrize(("rule", "style"), [("exact", "--"), ("fast", "-"), ("limit", ":")])
def test_a_rule_that_is_fixed_has_its_own_line(rule, style):
    data = study(rule, [2.0]).assign_attrs(parameters=json.dumps({"wear_rule": rule, "hold": "depth"}))
    axes, *_ = wear.draw_profiles({"": data}).axes
    assert style in {line.get_linestyle() for line in axes.lines}


def test_volume_has_a_band():
    figure = wear.draw_volume({"": study("fast", [0.5, 2.0], realisations=(0, 1, 2))})
    assert len(figure.axes[0].lines) == 2
    assert len(figure.axes[0].collections) == 2
    assert "95 %" in figure.get_suptitle()


def test_error_map_finds_the_better_xi():
    groups = {"exact": study("exact", [1.0, 4.0]), "fast": study("fast", [1.0, 4.0], xi=[0.2, 0.8, 0.95])}
    error, volume, _ = wear.compare(groups)
    assert error["rms"].sel(xi=0.95).mean() < error["rms"].sel(xi=0.8).mean() < error["rms"].sel(xi=0.2).mean()
    assert volume.sel(xi=0.2).max() < 0
    assert len(wear.draw_fast_error(groups).axes) == 7  # four panels and three colour bars


@pytest.mark.parametrize("draw", [plot.draw for plot in wear.PLOTS])
def test_a_study_that_holds_too_little(draw):
    with pytest.raises(DataError, match="series"):
        draw({"": xr.Dataset()})


def test_one_number_of_cycles_is_no_growth():
    with pytest.raises(DataError, match="no series holds wear_volume over cycles or path"):
        wear.draw_volume({"": study("limit", [2.0])})
