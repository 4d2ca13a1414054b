"""Named figures: each is drawn from a store that holds its data, and the numbers drawn are those of the store."""

import functools

import numpy as np
import planted
import pytest
from matplotlib.figure import Figure
from overlaps import problems

from mdr_dask import aggregation
from mdr_dask.errors import DataError
from mdr_dask.plots import available, history, page
from mdr_dask.plots.named import FILM_RATIOS
from mdr_dask.units import conversion

V = "  velocity: {geometric: [0.01 mm/s, 10 m/s, 8]}\n"
F = "  normal_force: [10 mN, 1 N, 100 N]\n"
FRETTING = (
    "  indenter: {shape: parabola, radius: 10 mm}\n  contact_modulus: 115 GPa\n  effective_shear_modulus: 90 GPa\n"
    "  friction: 0.6\n  amplitude: [0.2 um, 0.4 um]\n  normal_force: 50 N\n"
    "  hardness: 2 GPa\n  wear_coefficient: 1e-4\n  cycles: {geometric: [1e3, 1e5, 4]}\n"
)
ROLLERS = planted.ROLLERS + (
    "  normal_force: [200 N, 800 N]\n  rotation_speed: {geometric: [10 rpm, 1000 rpm, 4]}\n"
    "  temperature: [40 degC, 60 degC]\n"
)
FILM = planted.NUMBERS + "  material_parameter: 5000\n  load_parameter: 2e-5\n  speed_parameter: 1e-11\n"
JUMP = planted.JUMP + "  normal_force: 1 N\n  velocity: [0.01 m/s, 0.1 m/s]\n  velocity_change: [-0.5, 1]\n"
PROFILES = ROLLERS.replace(
    "friction_coefficient]", "friction_coefficient, upper_profile, lower_profile, contact_length_trace]"
)
#: A campaign for each figure, and the outputs that its panels show.
FIGURES = {
    "velocity": (planted.SLIDING + F + V, ["friction_coefficient"]),
    "force": (planted.SLIDING + F + V, ["friction_coefficient"]),
    "contact_growth": (
        planted.SLIDING.replace("parameters:", "outputs: [contact_fraction, contact_slope, rms_slope]\nparameters:")
        + F
        + V,
        ["contact_fraction", "contact_slope"],
    ),
    "stribeck": (
        ROLLERS,
        ["friction_coefficient", "asperity_load_share", "contact_length", "breakthrough_probability", "film_ratio"],
    ),
    "temperature": (ROLLERS, ["breakthrough_probability"]),
    "profiles": (PROFILES, ["upper_profile", "lower_profile"]),
    "trace": (PROFILES, ["contact_length_trace"]),
    "film_profile": (FILM + "  inlet: [-4, -2]\n", ["pressure", "film"]),
    "starvation": (FILM + "  inlet: [-4, -2, -1.5]\n", ["central_film", "minimum_film"]),
    "traction": (FILM + "  slide_roll_ratio: [0.01, 0.1, 0.2]\n", ["traction_coefficient"]),
    "wear_profiles": (planted.FRETTING + FRETTING, ["worn_profile", "worn_image"]),
    "wear_growth": (planted.FRETTING + FRETTING, ["wear_volume"]),
}


@pytest.fixture(scope="module")
def stores(tmp_path_factory):
    """Return a function that makes the store of a campaign once."""
    return functools.cache(lambda text: planted.make(tmp_path_factory.mktemp("named"), text))


@pytest.mark.parametrize("name", FIGURES)
def test_what_is_drawn_is_what_the_store_holds(name, stores):
    text, outputs = FIGURES[name]
    groups = stores(text)
    (data,) = groups.values()
    figure = available(data.attrs["model"])[name].describe(groups)
    assert [panel.y.quantity for panel in figure.panels] == outputs
    table = figure.table()
    for k, (panel, output) in enumerate(zip(figure.panels, outputs, strict=True)):
        assert panel.traces
        drawn = table[(table.panel == k + 1) & (table.what == "data")]
        single = name in ("profiles", "trace")
        values = data[output].isel(realisation=0) if single else aggregation.mean(data[output])
        factor, _ = conversion(_unit(panel.y.label), data[output].attrs["units"])
        known = np.sort(np.ravel(values.values)) / factor
        nearest = known[np.clip(np.searchsorted(known, drawn.y), 1, known.size - 1)]
        below = known[np.clip(np.searchsorted(known, drawn.y) - 1, 0, known.size - 1)]
        np.testing.assert_allclose(
            np.minimum(abs(drawn.y - nearest), abs(drawn.y - below)), 0, atol=1e-9 * abs(known).max()
        )
        assert len(drawn) >= data[panel.x.quantity].size if panel.x.quantity in data.coords else len(drawn)


#: Figures of the default run, each with panels, curves or labels of another kind.
QUICK = {"velocity", "stribeck", "wear_profiles", "history"}


@pytest.mark.parametrize("size", ["85mm", pytest.param("170mm", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n not in QUICK)) for n in (*FIGURES, "history")]
)
def test_nothing_overlaps_and_no_panel_is_empty(name, size, stores):
    text, _ = FIGURES.get(name, (JUMP, []))
    groups = stores(text)
    (data,) = groups.values()
    with page.drawing_for(page.requested(size)):
        figure = available(data.attrs["model"])[name].figure(groups)
        assert not list(problems(figure))
    assert all(axes.has_data() for axes in figure.axes)


def _unit(label: str) -> str:
    unit = label.rpartition("[")[2].rstrip("]") if "[" in label else "1"
    return unit.replace("µ", "u").replace("$^{", "^").replace("}$", "")


def test_every_named_figure_is_tested_here():
    models = ("sliding_friction", "velocity_jump", "mixed_lubrication", "ehl_line", "fretting_wear")
    known = {name for model in models for name in available(model)}
    assert known == {*FIGURES, "history", "calibration", "measured", "master_curve"}


def test_a_film_ratio_below_one_is_not_called_boundary_lubrication():
    """In this model, the asperities carry less than a tenth of the load at half this film ratio."""
    assert [*FILM_RATIOS] == [0.5, 3.0]


def test_a_missing_output_is_named_and_leaves_no_empty_panel(tmp_path):
    text = planted.FRETTING.replace("worn_image", "stick_border") + FRETTING
    groups = planted.make(tmp_path, text)
    figure = available("fretting_wear")["wear_profiles"].describe(groups)
    assert [panel.y.quantity for panel in figure.panels] == ["worn_profile"]
    assert "this study has no output 'worn_image'" in " ".join(figure.left_out)
    with pytest.raises(DataError, match="wear_volume"):
        available("fretting_wear")["wear_growth"].describe({"": groups[""].drop_vars("wear_volume")})


def test_a_history_shows_friction_velocity_and_force_as_prescribed(tmp_path):
    steps = "  protocol: {shape: steps, times: [0 s, 2 ms], velocities: [0.1 m/s, 0.05 m/s], forces: [0.2 N, 0.1 N]}\n"
    text = planted.JUMP + "  normal_force: 0.1 N\n  velocity: 0.05 m/s\n" + steps
    groups = planted.make(tmp_path, text)
    figure = available("velocity_jump")["history"].describe(groups)
    friction, velocity, force = (panel.traces[0] for panel in figure.panels)
    time = groups[""]["relaxation_times"].values
    mean = aggregation.mean(groups[""]["friction_coefficient"]).values.ravel()
    np.testing.assert_allclose(friction.column("y")[3:], mean)
    np.testing.assert_allclose(friction.column("x")[3:], time)
    scale = [1e3 if "mm/s" in figure.panels[1].y.label else 1, 1e3 if "mN" in figure.panels[2].y.label else 1]
    for trace, steps_of, factor in ((velocity, (0.05, 0.1, 0.05), scale[0]), (force, (0.1, 0.2, 0.1), scale[1])):
        x, y = trace.column("x"), trace.column("y") / factor
        for at, value in zip((-0.01, 1.0, 2.5), steps_of, strict=True):
            if at <= time[-1]:
                assert np.interp(at, x, y) == pytest.approx(value)


def test_a_jump_is_a_history_of_one_step(stores):
    groups = stores(JUMP)
    figure = available("velocity_jump")["history"].describe(groups)
    data = groups[""]
    assert len(figure.panels[0].traces) == 8  # four curves and their steady states
    one = figure.panels[0].traces[0]
    case = data.isel(velocity=0, velocity_change=0)
    before = float(aggregation.mean(case[history.BEFORE]))
    at_once = float(aggregation.mean(case[history.BEFORE] + case[history.JUMP]))
    np.testing.assert_allclose(one.column("y")[:3], [before, before, at_once])


def test_a_master_curve_has_the_units_of_the_other_figures(stores):
    groups = stores(planted.SLIDING + F.replace("10 mN, 1 N, 100 N", "10 mN, 1000 mN, 100000 mN") + V)
    known = available("sliding_friction")
    figure = known["master_curve"].figure(groups)
    assert isinstance(figure, Figure)
    measured, merged, factors = figure.description.panels
    assert all(panel.traces for panel in (measured, merged, factors))
    assert measured.x.label == known["force"].describe(groups).panels[0].x.label == "normal force $F_N$ [mN]"
    assert factors.x.label == known["velocity"].describe(groups).panels[0].x.label
    drawn = np.unique(np.concatenate([trace.column("x") for trace in measured.traces]).round(6))
    np.testing.assert_allclose(drawn, [10, 1000, 100000])
