import numpy as np
import pytest
from friction_store import store

from mdr_dask.errors import DataError, FitError
from mdr_dask.plots.friction import PLOTS
from mdr_dask.plots.style import DATA, left_out

DRAW = {plot.name: plot.draw for plot in PLOTS}
PLANE = ("regions", "velocity", "force", "zone_one", "plateau")


@pytest.fixture(scope="module")
def forces():
    axes = {
        "hurst": [0.1, 0.4, 0.7],
        "normal_force": np.geomspace(1e-3, 1e2, 12),
        "velocity": np.geomspace(1e-4, 1e3, 15),
    }
    return store(axes, realisations=6)


@pytest.fixture(scope="module")
def cone():
    shape = {"shape": "cone", "angle": 0.17}
    return store({"velocity": np.geomspace(1e-4, 1, 9)}, 4, rms_roughness=5e-6, shear_modulus=1e6, indenter=shape)


def check(figure, tmp_path):
    axes = figure.axes[0]
    assert axes.get_xlabel()
    assert axes.get_ylabel()
    assert axes.get_legend() is not None
    assert max(len(line.get_xdata()) for line in axes.get_lines()) > 2
    figure.savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000


@pytest.mark.parametrize("name", PLANE)
def test_a_figure_is_labelled_and_drawn(name, forces, tmp_path):
    check(DRAW[name]({"": forces}), tmp_path)


def test_the_figure_of_indenters_is_labelled_and_drawn(cone, tmp_path):
    check(DRAW["indenter"]({"cone": cone}), tmp_path)


def test_the_figure_of_indenters_names_the_series_that_are_none(cone, forces):
    figure = DRAW["indenter"]({"cone": cone, "plane": forces})
    told = left_out(figure).replace("\n", " ")
    assert "plane: expected a store with an indenter" in told
    assert told.count("expected") == 1


def test_curves_hold_the_mean_over_realisations(forces):
    axes = DRAW["force"]({"": forces}).axes[0]
    expected = (forces.friction_coefficient / forces.rms_slope).mean("realisation")
    drawn = np.array([line.get_ydata() for line in axes.get_lines() if line.get_gid() == DATA])
    assert np.sort(drawn, axis=0) == pytest.approx(np.sort(expected.values.reshape(-1, 15), axis=0))


def test_the_law_is_drawn_through_every_curve_of_planes_and_no_other(forces, cone):
    """A curve has its own force and Hurst exponent; the law lies within 45 % of it, up to the plateau."""
    figure = DRAW["velocity"]({"": forces.isel(normal_force=[6, 9])})
    table = figure.table()
    table = table.assign(kind=[what.partition(" ")[0] for what in table["what"]])
    cases = ["hurst", "normal_force"]
    of_data = dict(list(table[table.kind == "data"].groupby(cases)))
    of_laws = dict(list(table[table.kind == "law"].groupby(cases)))
    assert of_laws.keys() == of_data.keys()
    assert len(of_laws) == 6
    for case, law in of_laws.items():
        data = of_data[case]
        assert law.x.min() == pytest.approx(data.x.min())
        assert law.x.max() == pytest.approx(data.x.max())
        there = np.exp(np.interp(np.log(data.x), np.log(law.x), np.log(law.y)))
        np.testing.assert_allclose(there[:11], data.y[:11], rtol=0.45)
    of_a_cone = DRAW["velocity"]({"cone": cone})
    assert set(of_a_cone.table()["what"]) == {"data"}
    assert len(of_a_cone.axes[0].get_lines()) > 0


def test_every_region_of_the_law_has_its_number(forces):
    """From the lowest velocity on, also where it is below one in the unit shown."""
    one = forces.isel(hurst=1, normal_force=6)
    axes = DRAW["regions"]({"": one}).axes[0]
    assert axes.get_xlim()[0] < 1
    places = {text.get_text(): text.get_position()[0] for text in axes.texts if set(text.get_text()) <= {"I", "V"}}
    assert sorted(places, key=places.get) == ["I", "II", "III", "IV"]


def test_a_fixed_hurst_exponent_is_a_point_at_its_value(forces):
    axes = DRAW["plateau"]({"": forces.isel(hurst=1)}).axes[0]
    drawn = [line.get_xdata() for line in axes.get_lines() if line.get_gid() == DATA]
    assert drawn
    assert all(list(x) == [0.4] for x in drawn)


def test_a_store_that_does_not_fit_the_figure_is_refused(forces):
    with pytest.raises(DataError, match="no series of the store holds friction_coefficient over velocity"):
        DRAW["velocity"]({"": forces.isel(velocity=0)})
    with pytest.raises(FitError, match="expected a store with an indenter"):
        DRAW["indenter"]({"": forces})
