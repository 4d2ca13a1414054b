"""Every figure of every model on stores of every shape that can hold it: labels, and what is drawn against the store.

Stores are laid out by the project and filled with planted numbers. A figure is drawn, or it says in one sentence why
this store cannot hold it; which of the two is known beforehand, in `TABLE`. What is drawn has to be what the store
holds, and what is not drawn has to be named.
"""

from __future__ import annotations

import io
import re

import numpy as np
import planted
import pytest

from mdr_dask import aggregation
from mdr_dask.errors import DataError, FitError
from mdr_dask.fits.friction import spectral_slope
from mdr_dask.plots import available, curves, style

V = "  velocity: {geometric: [0.001 mm/s, 1 km/s, 11]}\n"
FEW_V = "  velocity: {geometric: [0.01 mm/s, 1 m/s, 8]}\n"
F = "  normal_force: {geometric: [1 mN, 100 N, 10]}\n"
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
    "  indenter: {shape: parabola, radius: 10 mm}\n  contact_modulus: 115 GPa\n  shear_modulus: 90 GPa\n"
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
SHAPES = {"wear_development", "wear_profiles", "wear_volume"}

#: Shape of a study: model and parameters, what is special, and the figures that it can hold.
TABLE: dict[str, tuple[str, dict[str, object], set[str]]] = {
    "hurst, force, velocity": (planted.SLIDING + F + V + "  hurst: {linear: [0.2, 0.8, 3]}\n", {}, LAWS),
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
        planted.SLIDING + V + "  indenter: {shape: cone, angle: {linear: [5 deg, 30 deg, 9]}}\n  normal_force: 1 N\n",
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
    "wear: latin hypercube": (
        planted.FRETTING + "  stick_radius: {linear: [0.1, 0.9]}\n  cycles: {geometric: [0.1, 10]}\n" + LHS,
        {},
        {"wear_profiles", "wear_volume"},
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
            made[shape] = planted.make(tmp_path_factory.mktemp("store"), text, **special)
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
    drawn = drawn_values(figure)
    assert drawn.size, "nothing of the store is drawn"
    if (name, model_of(text)) in EXPECTED:
        compare(figure, name, model_of(text), groups)
    if shape == RENDERED[name, model_of(text)]:
        figure.savefig(io.BytesIO(), dpi=20)


def drawn_values(figure) -> np.ndarray:
    """Return the finite ordinates of all data of a figure."""
    found = []
    for axes in figure.axes:
        found += [np.ravel(line.get_ydata()) for line in axes.lines if line.get_gid() == style.DATA]
        for collection in axes.collections:
            if collection.get_gid() == style.DATA:
                offsets = np.asarray(collection.get_offsets())
                values = collection.get_array() if offsets.shape[0] < 2 and collection.get_array() is not None else None
                found.append(np.ravel(values if values is not None else offsets[:, 1]).astype(float))
    values = np.concatenate([np.asarray(each, dtype=float) for each in found]) if found else np.zeros(0)
    return values[np.isfinite(values)]


def drawn_ends(figure) -> np.ndarray:
    """Return the ordinates of the ends of all bars and bands."""
    found = []
    for axes in figure.axes:
        for collection in axes.collections:
            if collection.get_gid() == style.BAND:
                found += [path.vertices[:, 1] for path in collection.get_paths()]
                segments = getattr(collection, "get_segments", list)()
                found += [segment[:, 1] for segment in segments if segment.ndim == 2]
    values = np.concatenate(found) if found else np.zeros(0)
    return values[np.isfinite(values)]


def stored(data, name, factor=1.0):
    """Mean and ends of the interval of an output, from the store alone: what figures have to draw."""
    values = data[name] * factor
    error = data[f"{name}_error"] * factor if f"{name}_error" in data else None
    middle = values.mean("realisation")
    low, high = (aggregation.interval(values, error).isel(bound=k, drop=True) for k in (0, 1))
    if error is not None:
        half = abs(error).mean("realisation")
        low, high = low.fillna(middle - half), high.fillna(middle + half)
    return curves.Mean(middle, low, high)


def over_slope(output, factor=1.0):
    return lambda data: stored(data, output, factor / spectral_slope(data))


def friction(factor):
    def value(data):
        from mdr_dask.plots.friction import is_plane, on_generated_line

        plane = is_plane(data) if factor != 1.0 else on_generated_line(data)
        if plane:
            return stored(data, "friction_coefficient", factor / spectral_slope(data))
        return stored(data, "friction_coefficient", 1 / spectral_slope(data))

    return value


def output(name, factor=1.0):
    return lambda data: stored(data, name, factor)


def of_film(name, factor=1.0):
    return lambda data: stored(data.isel(realisation=[0]), name, factor)


def share(data):
    return stored(data, "contact_length", 50 / data["contact_half_width"])


def volume(data):
    values = data["wear_volume"]
    if values.sizes["realisation"] < 2:
        return stored(data, "wear_volume")
    known = values.notnull().any("realisation")
    ends = [values.where(known, 0.0).quantile(q, "realisation").where(known) for q in (0.025, 0.5, 0.975)]
    return curves.Mean(ends[1], ends[0], ends[2])


ROLLING = [
    *(output("friction_coefficient"), share, output("film_ratio")),
    *(output(name, 100.0) for name in ("breakthrough_probability", "asperity_load_share")),
]
#: What a figure draws of every case: means and ends of intervals, by the name of the figure and its model.
EXPECTED = {
    ("regions", "sliding_friction"): [friction(1.0)],
    ("velocity", "sliding_friction"): [friction(2**-0.5)],
    ("force", "sliding_friction"): [friction(1.0)],
    ("collapse", "sliding_friction"): [friction(2**-0.5)],
    ("contact_growth", "sliding_friction"): [output("contact_fraction"), over_slope("contact_slope")],
    ("jump_height", "velocity_jump"): [],
    ("temperature", "mixed_lubrication"): [output("breakthrough_probability", 100.0)],
    ("sensitivity", "mixed_lubrication"): [output("breakthrough_probability", 100.0)],
    ("stribeck", "mixed_lubrication"): ROLLING,
    ("film_profile", "ehl_line"): [of_film("pressure", 1e-9), of_film("film")],
    ("starvation", "ehl_line"): [of_film("central_film"), of_film("minimum_film")],
    ("traction", "ehl_line"): [of_film("traction_coefficient")],
    ("wear_development", "fretting_wear"): [output("worn_profile"), output("worn_image")],
    ("wear_profiles", "fretting_wear"): [output("worn_profile"), output("worn_image")],
    ("wear_volume", "fretting_wear"): [volume],
}


def compare(figure, name, model, groups):
    """What is drawn is in the store; all of it, where the figure says nothing of being left out; bars too."""
    means, ends = [], []
    for data in groups.values():
        for value in EXPECTED[name, model]:
            try:
                found = value(data)
            except KeyError:
                continue
            means.append(np.ravel(found.value))
            ends += [np.ravel(found.low), np.ravel(found.high)]
    if not means:
        return
    drawn = drawn_values(figure)
    assert_among(drawn, np.concatenate(means))
    assert_among(drawn_ends(figure), np.concatenate([*ends, *means, np.zeros(1)]))
    told = style.left_out(figure)
    if "values of" not in told and "series" not in told and "cases" not in told and len(groups) == 1:
        wanted = np.concatenate(means)
        wanted = wanted[np.isfinite(wanted)]
        positive = name in ("collapse",)
        assert_among(wanted[wanted > 0] if positive else wanted, drawn)


def assert_among(values, known):
    """Every value is one of those known, to rounding."""
    known = np.sort(known[np.isfinite(known)])
    place = np.clip(np.searchsorted(known, values), 1, max(known.size - 1, 1))
    near = np.minimum(abs(known[place - 1] - values), abs(known[np.minimum(place, known.size - 1)] - values))
    np.testing.assert_array_less(near, 1e-9 * np.maximum(abs(values), 1e-300) + 1e-12 * np.max(abs(known)))


def test_bars_are_intervals_of_scatter_and_grid(stores):
    data = next(iter(stores("velocity").values()))
    assert aggregation.companion(data, "friction_coefficient") is not None or "discretisation_error" in data
    value = curves.measured(data, "friction_coefficient")
    half = 0.5 * (value.high - value.low)
    assert np.all(half > aggregation.standard_error(data["friction_coefficient"]))
