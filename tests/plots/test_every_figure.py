"""Every figure of every model on stores of every shape that can hold it: labels, and what is drawn against the store.

Stores are laid out by the project and filled with planted numbers. A figure is drawn, or it says in one sentence why
this store cannot hold it; which of the two is known beforehand, in `TABLE`. What is drawn has to be what the store
holds, and what is not drawn has to be named.
"""

from __future__ import annotations

import contextlib
import io
import re

import numpy as np
import planted
import pytest
import xarray as xr
from drawn import LAST, check_colours, check_laws, check_limits, check_picture, check_words, expected, mismatches

from mdr_dask import aggregation, fits, models
from mdr_dask.errors import DataError, FitError
from mdr_dask.plots import available, curves, drawing, page, scaling, style

V = "  velocity: {geometric: [0.001 mm/s, 1 km/s, 8]}\n"
FEW_V = "  velocity: {geometric: [0.01 mm/s, 1 m/s, 9]}\n"  # one of them just above v tau q_max = 1
F = "  normal_force: {geometric: [1 mN, 100 N, 8]}\n"
OPERATION = (
    "  normal_force: [200 N, 800 N]\n  rotation_speed: {geometric: [10 rpm, 1000 rpm, 4]}\n"
    "  temperature: [40 degC, 60 degC]\n"
)
W = "  material_parameter: 5000\n  load_parameter: 2e-5\n"
DIMENSIONAL_FILM = (
    "  line_load: [1e5 N/m, 2e5 N/m]\n  mean_velocity: 1 m/s\n  pressure_viscosity: 2e-8 1/Pa\n  radius: 20 mm\n"
    "  viscosity: 0.1 Pa s\n"
)
FRETTING = (
    "  indenter: {shape: parabola, radius: 10 mm}\n  contact_modulus: 115 GPa\n  effective_shear_modulus: 90 GPa\n"
    "  friction: 0.6\n  normal_force: 50 N\n"
    "  hardness: 2 GPa\n  wear_coefficient: 1e-4\n  cycles: {geometric: [1e3, 1e5, 4]}\n"
)
RULES = f"  {planted.RULE}: [exact, fast, limit]\n"
CONE = "  indenter: {shape: cone, angle: 10 deg}\n"
DMA = "  material: {prony: {shear_modulus: 1 MPa, terms: [[1 MPa, 1 ms]]}}\n"
LHS = "sampling: {latin_hypercube: 12}\n"

LAWS = {"regions", "velocity", "force", "zone_one", "plateau", "collapse", "contact_growth"}
JUMPS = {
    *("jump_trace", "jump_velocities", "jump_fit", "jump_height", "jump_law"),
    *("relaxation_rate", "relaxation_power", "relaxation_course"),
}
FILMS = {"film_profile", "film_formula", "film_regimes", "regime_map"}
SHAPES = {"wear_development", "wear_profiles", "wear_growth"}

#: Shape of a study: model and parameters, what is special, and the figures that it can hold.
TABLE: dict[str, tuple[str, dict[str, object], set[str]]] = {
    "force, velocity": (planted.SLIDING + F + V, {}, LAWS),
    "velocity": (planted.SLIDING + V + "  normal_force: 1 N\n", {}, {"regions", "velocity", "plateau", "collapse"}),
    "force, velocity, roughness": (
        planted.SLIDING.replace("rms_roughness: 0.5 um", "rms_roughness: [0.2 um, 0.5 um]") + F + V,
        {},
        LAWS,
    ),
    "ten hurst, one realisation": (
        planted.SLIDING + F + V + "  hurst: {linear: [0.0, 0.9, 10]}\n",
        {"realisations": 1},
        LAWS,
    ),
    "some cases failed": (planted.SLIDING + F + V + "  hurst: [0.3, 0.7]\n", {"failed": True}, LAWS),
    "latin hypercube": (
        planted.SLIDING
        + "  normal_force: {geometric: [1 mN, 100 N]}\n  velocity: {geometric: [0.001 mm/s, 1 km/s]}\n"
        + "  hurst: {linear: [0.2, 0.8]}\n"
        + LHS,
        {},
        {"velocity", "force", "collapse", "contact_growth"},
    ),
    "series": (
        planted.SLIDING + V + "  normal_force: 1 N\nseries:\n  force: {normal_force: {geometric: [1 mN, 100 N, 10]}}\n"
        "  modulus: {shear_modulus: {geometric: [1 MPa, 100 MPa, 9]}}\n  one: {velocity: 1 m/s}\n",
        {},
        LAWS,
    ),
    "cone": (
        planted.SLIDING + V + CONE + "  normal_force: [0.1 N, 1 N]\n",
        {},
        {"velocity", "force", "indenter", "plateau"},
    ),
    "angles of a cone": (
        planted.SLIDING
        + V
        + "  indenter: {shape: cone, angle: {geometric: [0.1 deg, 30 deg, 9]}}\n  normal_force: 1 N\n",
        {},
        {"velocity", "indenter", "plateau"},
    ),
    "jumps: hurst, velocity": (planted.JUMP + FEW_V + "  hurst: [0.3, 0.7]\n  normal_force: 1 N\n", {}, JUMPS),
    "jumps: velocity": (planted.JUMP + FEW_V + "  hurst: 0.6\n  normal_force: 1 N\n", {}, JUMPS),
    "jumps: up and down": (
        planted.JUMP + FEW_V + "  hurst: 0.6\n  velocity_change: [-0.2, 0.2]\n  normal_force: 1 N\n",
        {},
        JUMPS,
    ),
    "jumps: series, one of them an example": (
        planted.JUMP + "  normal_force: 1 N\n"
        "series:\n  many: {velocity: {geometric: [0.01 mm/s, 1 m/s, 9]}, hurst: [0.2, 0.3, 0.7]}\n"
        "  example: {velocity: 0.01 m/s, velocity_change: [-0.3, -0.2, 0.1, 0.2, 0.4]}\n",
        {},
        JUMPS,
    ),
    "jumps: one case": (
        planted.JUMP + "  velocity: 0.05 m/s\n  normal_force: 1 N\n",
        {},
        JUMPS - {"jump_law", "relaxation_power"},
    ),
    "jumps: one realisation": (
        planted.JUMP + FEW_V + "  normal_force: 1 N\n",
        {"realisations": 1},
        {"jump_trace", "jump_velocities", "relaxation_course"},
    ),
    "jumps: some failed": (
        planted.JUMP + FEW_V + "  hurst: [0.3, 0.7]\n  normal_force: 1 N\n",
        {"failed": True},
        JUMPS,
    ),
    "jumps: Prony series": (
        "model: velocity_jump\nparameters:\n  length: 20 mm\n  points: 500\n  rms_roughness: 0.5 um\n"
        + "  material: {prony: {static_modulus: 1 MPa, moduli: [1 MPa], times: [1 ms]}}\n  normal_force: 1 N\n"
        + FEW_V,
        {},
        {"jump_trace", "jump_velocities", "jump_height", "jump_law"},
    ),
    "jumps: latin hypercube": (
        planted.JUMP
        + "  velocity: {geometric: [0.01 mm/s, 1 m/s]}\n  hurst: {linear: [0.2, 0.8]}\n  normal_force: 1 N\n"
        + LHS,
        {},
        JUMPS - {"relaxation_power"},
    ),
    "rollers: operation": (planted.ROLLERS + OPERATION, {}, {"temperature", "stribeck"}),
    "rollers: speed": (
        planted.ROLLERS + "  normal_force: 200 N\n  rotation_speed: {geometric: [10 rpm, 1000 rpm, 9]}\n"
        "  temperature: 60 degC\n",
        {"realisations": 1},
        {"stribeck"},
    ),
    "rollers: many speeds": (
        planted.ROLLERS + "  normal_force: 200 N\n  rotation_speed: {geometric: [10 rpm, 1000 rpm, 14]}\n"
        "  temperature: [40 degC, 60 degC]\n",
        {},
        {"temperature", "stribeck"},
    ),
    "rollers: creep too": (
        planted.ROLLERS + OPERATION + "  slide_roll_ratio: [0.0, 0.05, 0.1]\n",
        {"failed": True},
        {"temperature", "stribeck", "sensitivity"},
    ),
    "rollers: surfaces": (
        planted.ROLLERS.replace("asperity_load_share", "upper_profile, lower_profile, contact_length_trace")
        + OPERATION
        + "  trace_points: 40\n",
        {},
        {"temperature", "stribeck", "profiles", "trace"},
    ),
    "rollers: latin hypercube": (
        planted.ROLLERS
        + "  normal_force: {linear: [200 N, 800 N]}\n  rotation_speed: {geometric: [10 rpm, 1000 rpm]}\n"
        "  temperature: {linear: [40 degC, 60 degC]}\n  layer_thickness: {geometric: [1 nm, 9 nm]}\n" + LHS,
        {},
        {"temperature", "stribeck", "sensitivity"},
    ),
    "film: one case": (planted.NUMBERS + W + "  speed_parameter: 1e-11\n", {}, FILMS),
    "film: map": (
        planted.NUMBERS + "  speed_parameter: {geometric: [1e-12, 1e-10, 9]}\n  load_parameter: [1e-6, 1e-5, 1e-4]\n"
        "  material_parameter: [2500, 5000]\n",
        {"failed": True},
        FILMS,
    ),
    "film: inlet": (
        planted.NUMBERS
        + W
        + "  speed_parameter: [1e-12, 1e-11]\n  inlet: [-20, -10, -4, -2, -1.5, -1.2, -1.1, -1.05]\n",
        {},
        FILMS | {"starvation"},
    ),
    "film: units": (
        planted.NUMBERS + DIMENSIONAL_FILM + "  slide_roll_ratio: {geometric: [1e-4, 1, 9]}\n",
        {},
        FILMS | {"traction"},
    ),
    "film: series and latin hypercube": (
        planted.NUMBERS + W + "  slide_roll_ratio: {linear: [0, 1]}\n  speed_parameter: {geometric: [1e-12, 1e-10]}\n"
        "series:\n  barus: {}\n  roelands: {viscosity_law: roelands, viscosity: 0.1 Pa s}\n" + LHS,
        {},
        FILMS | {"traction"},
    ),
    "wear: rules": (planted.FRETTING + RULES + "  stick_radius: [0.4, 0.6]\n  cycles: [0.5, 1, 2, 4]\n", {}, SHAPES),
    "wear: one axis": (planted.FRETTING + "  stick_radius: 0.5\n  cycles: [0.5, 1, 2, 4]\n", {"failed": True}, SHAPES),
    "wear: many": (
        planted.FRETTING + "  stick_radius: {linear: [0.1, 0.9, 9]}\n  cycles: {geometric: [0.1, 10, 9]}\n"
        "  hold: [depth, force]\n",
        {"realisations": 1},
        SHAPES,
    ),
    "wear: units": (
        planted.FRETTING + RULES + FRETTING + "  amplitude: [0.5 um, 1 um]\n",
        {},
        SHAPES,
    ),
    "wear: gross slip": (
        planted.FRETTING + "  wear_rule: exact\n  path: {linear: [0, 40, 5]}\n  hold: [depth, force]\n",
        {},
        {"wear_growth", "wear_profiles"},
    ),
    "wear: gross slip in units": (
        planted.FRETTING + "  wear_rule: exact\n  path: {geometric: [1 m, 100 m, 3]}\n"
        "  indenter: {shape: parabola, radius: 10 mm}\n  contact_modulus: 115 GPa\n  normal_force: 50 N\n"
        "  hardness: 2 GPa\n  wear_coefficient: 1e-4\n",
        {},
        {"wear_growth", "wear_profiles"},
    ),
    "wear: latin hypercube": (
        planted.FRETTING + "  stick_radius: {linear: [0.1, 0.9]}\n  cycles: {geometric: [0.1, 10]}\n" + LHS,
        {},
        {"wear_profiles", "wear_growth"},
    ),
    "wear: error of the fast rule": (
        planted.FRETTING + "  stick_radius: {linear: [0.1, 0.9, 3]}\n  cycles: {geometric: [0.1, 10, 4]}\nseries:\n"
        f"  exact: {{{planted.RULE}: exact}}\n"
        f"  fast: {{{planted.RULE}: fast, hold: [depth, force], xi: {{linear: [0.5, 1.2, 5]}}}}\n",
        {},
        SHAPES | {"fast_wear_error"},
    ),
}
#: Figures whose data come from what the surfaces of one solution are, not from planted numbers.
SOLVED = {"contact", "lines", "master_curve"}


def model_of(text: str) -> str:
    found = re.search(r"model: (\w+)", text)
    assert found
    return found[1]


@pytest.fixture(scope="module")
def stores(tmp_path_factory):
    made = {}

    def of(shape):
        if shape not in made:
            text, special, _ = TABLE[shape]
            groups = planted.make(tmp_path_factory.mktemp("store"), text, **special)
            made[shape] = {series: data.load() for series, data in groups.items()}
        return made[shape]

    return of


CASES = [
    (shape, name)
    for shape, (text, _, _) in TABLE.items()
    for name in available(model_of(text))
    if name not in SOLVED | {"protocols"}
]


#: The last shape that holds a figure, on which it is rendered too: that takes longer than all else.
RENDERED = {(name, model_of(text)): shape for shape, (text, _, holds) in TABLE.items() for name in holds}


@pytest.mark.parametrize(("shape", "name"), CASES)
def test_every_figure_is_drawn_or_says_why_not(shape, name, stores):
    text, _, holds = TABLE[shape]
    plot, groups = available(model_of(text))[name], stores(shape)
    if name not in holds:
        with pytest.raises((DataError, FitError)) as refused:
            plot.figure(groups)
        assert refused.value.__cause__ is None, "a fault of the figure, not a sentence about the store"
        return
    figure = plot.figure(groups)
    panels = [axes for axes in figure.axes if axes.has_data() and axes.get_label() != "<colorbar>"]
    assert panels
    assert figure.get_suptitle()
    for axes in panels:
        texts = [axes.get_xlabel(), axes.get_ylabel()]
        assert all(texts) or len(panels) > 1
        assert not any(re.search(r"\((m|m/s|N|Pa|s)\)", text) for text in texts), "units stand in [ ]"
    check_picture(figure)
    check_laws(name, figure)
    check_limits(name, figure)
    check_words(name, figure)
    check_colours(figure)
    table = figure.table()
    data = table[table["what"] == "data"]
    assert len(data), "nothing of the store is drawn"
    known = expected(name, groups)
    assert mismatches(data, known).empty
    if name in OF_CASES:
        axes = [{axis["name"] for axis in each.attrs["axes"]} for each in groups.values()]
        assert data[sorted(set.intersection(*axes) - {*table.attrs["held"]})].notna().all(axis=None)
    told = style.left_out(figure)
    if len(groups) == 1 and not re.search("values of|series|cases|not known", told) and name not in PARTLY:
        assert mismatches(known, data).empty
    if name == "indenter":  # of those beyond the law some cannot stand on logarithmic axes
        within = known[known["y_low"].notna()]
        assert mismatches(within, data).empty
        assert len(within) or shape == "cone"
    if len(groups) == 1:
        (one,) = groups.values()
        cut = [axis for axis in data.columns.intersection(list(one.dims)) if 1 < data[axis].nunique() < one[axis].size]
        assert told or not cut, f"values of {cut} are left out without a word"
    for column in data.columns.intersection(LAST):
        moved = data.tail(1).assign(
            **{column: 1.001 * data[column].tail(1) + 1e-3 * data[column].abs().max() * (data[column].tail(1) == 0)}
        )
        if data[column].tail(1).notna().all() and data[column].abs().max() > 0:
            assert len(mismatches(moved, known)) == 1, f"a change of {column} by 0.1 % is not seen"
    if shape == RENDERED[name, model_of(text)]:
        figure.savefig(io.BytesIO(), dpi=20)


#: Figures with a point for each case, whose tables have all its parameters.
OF_CASES = {"collapse", "indenter", "film_formula", "film_regimes", "regime_map", "jump_law", "relaxation_rate"}
#: Figures of which a store may hold rows that they do not draw: of one moment, of one case, or as another quantity.
PARTLY = {
    "collapse",
    "indenter",
    "jump_trace",
    "jump_velocities",
    "jump_fit",
    "relaxation_course",
    "trace",
    "sensitivity",
    "stribeck",
    "temperature",
    "wear_profiles",
    "wear_development",
    "wear_growth",
}


@pytest.mark.parametrize(
    ("shape", "name", "quantity", "unit", "column", "factor"),
    [
        ("force, velocity", "regions", "velocity", "km/h", "x", 3.6),
        ("force, velocity", "force", "velocity", "mm/s", "x", 1e3),
        ("jumps: velocity", "jump_velocities", "velocity", "mm/s", "x", 1e3),
        ("rollers: operation", "stribeck", "rotation_speed", "rad/s", "x", np.pi / 30),
        ("film: units", "film_profile", "pressure", "MPa", "y", 1e3),
        ("wear: units", "wear_growth", "wear_volume", "mm^3", "y", 1e9),
    ],
)
def test_named_figures_take_units(shape, name, quantity, unit, column, factor, stores):
    plot = available(model_of(TABLE[shape][0]))[name]
    usual = plot.figure(stores(shape)).table()
    asked = page.Page(units={quantity: unit})
    with page.drawing_for(asked):
        figure = plot.figure(stores(shape))
    assert quantity in asked.used
    assert any(f"[{unit.replace('^3', '$^{3}$')}]" in axes.get_xlabel() + axes.get_ylabel() for axes in figure.axes)
    changed = figure.table()[column] / usual[column]
    moved = np.isclose(changed, factor, rtol=1e-9) | (usual[column] == 0)
    assert moved[usual["panel"] == 1].any()
    assert np.all(moved | np.isclose(changed, 1.0) | usual[column].isna())


def test_worn_volumes_that_grow_by_a_factor_stand_on_a_logarithmic_axis(stores):
    draw = available("fretting_wear")["wear_growth"].figure
    for shape, scale in (("wear: units", "log"), ("wear: rules", "linear")):
        groups = {
            name: data.assign(wear_volume=data["wear_volume"] * data["cycles"]) for name, data in stores(shape).items()
        }
        assert {axes.get_yscale() for axes in draw(groups).axes} == {scale}


def test_parameters_have_the_units_in_which_they_are_written(tmp_path):
    text = planted.ROLLERS + "  normal_force: [0.2 kN, 0.8 kN]\n  temperature: 60 degC\n"
    groups = planted.make(tmp_path, text + "  rotation_speed: {geometric: [1 rev/s, 100 rev/s, 4]}\n")
    figure = available("mixed_lubrication")["stribeck"].figure(groups)
    assert [axes.get_xlabel() for axes in figure.axes if axes.get_xlabel()] == ["rotation speed [rev/s]"]
    assert figure.axes[0].get_legend().get_texts()[1].get_text() == "$F_N$ = 0.8 kN"
    assert "temperature = 60 °C" in figure.get_suptitle()


def test_bars_are_intervals_of_scatter_and_grid(stores):
    data = next(iter(stores("velocity").values()))
    assert aggregation.companion(data, "friction_coefficient") is not None
    value = curves.measured(data, "friction_coefficient")
    half = 0.5 * (value.high - value.low)
    assert np.all(half > aggregation.standard_error(data["friction_coefficient"]))


def test_bars_are_said_to_mean_what_a_series_has(stores):
    data = next(iter(stores("velocity").values()))
    without_errors = data.drop_vars([name for name in data.data_vars if str(name).endswith("_error")])
    one = data.isel(realisation=0)
    for groups, said in (
        ([data], "bars: 95 % intervals, scatter of up to 4 realisations and error of the grid"),
        ([one, data.isel(realisation=slice(2))], "bars: 95 % intervals, scatter of up to 2 realisations and error"),
        ([one], "bars: 95 % intervals, error of the grid"),
        ([without_errors], "bars: 95 % intervals, scatter of up to 4 realisations"),
        ([without_errors.isel(realisation=0)], "one realisation: no bars"),
        ([without_errors.isel(realisation=[0])], "one realisation: no bars"),
    ):
        assert curves.meaning_of_bars(*groups, outputs=["friction_coefficient"]).startswith(said)
    assert curves.meaning_of_bars(outputs=["friction_coefficient"]) == "one realisation: no bars"
    assert curves.meaning_of_bars(without_errors, outputs=[]).endswith("4 realisations")


SAMPLED = [shape for shape, (text, _, _) in TABLE.items() if LHS in text and "series" not in text]


@pytest.mark.parametrize("shape", SAMPLED)
def test_laws_are_fitted_to_a_sampled_study_or_say_why_not(shape, stores):
    for law in fits.available(model_of(TABLE[shape][0])).values():
        with contextlib.suppress(DataError, FitError):
            assert all("law_holds" in each for each in law.results(stores(shape)).values())


def test_no_figure_is_called_like_an_output():
    for name in models.names():
        assert not {output.name for output in models.load(name).outputs} & set(available(name))


def test_a_law_ends_where_its_loads_did_not_converge():
    _, (axes,) = drawing.panels(1)
    curve = drawing.Curve(xr.Dataset(coords={"hurst": 1.0}), "", "k", "-", "o")
    scaling._draw_growth(axes, curve, np.array([1e-30, 0.1, 0.4]), np.array([np.nan, 0.1, 0.3]))
    (law,) = axes.lines
    np.testing.assert_allclose(law.get_xydata(), [[0.1, 0.1], [0.4, 0.2]])
