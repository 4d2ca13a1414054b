"""Sliding friction through the model, from one point to full contact over 15 decades: an answer or a sentence."""

import numpy as np
import pytest
from friction_store import relative_error
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mdr_dask.models.base import Block, Status
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction
from mdr_dask.physics.solids import complex_modulus, prony
from mdr_dask.physics.surfaces import roughness
from mdr_dask.units import to_si

ALL = MODEL.with_companions([output.name for output in MODEL.outputs])
LINE = {"length": 0.02, "points": 64, "rms_roughness": 5e-7}
KELVIN = {"shear_modulus": 1e7, "relaxation_time": 1e-3}
LOAD = {"normal_force": 1.5, "velocity": 0.1}
SOLID = {"standard_solid": {"static_modulus": 1e7, "glass_modulus": 5e8, "relaxation_time": 1e-3}}
BODIES = [
    {"shape": "plane"},
    {"shape": "cone", "angle": 0.2},
    {"shape": "parabola", "radius": 0.01},
    {"shape": "power", "exponent": 4.0, "coefficient": 1e3},
]
fifteen_decades = st.floats(-7.5, 7.5)


def solved(parameters, columns=None, realisations=(0,), accuracy=None):
    columns = {name: np.asarray(values) for name, values in (columns or {}).items()}
    cases = len(next(iter(columns.values()))) if columns else 1
    block = Block(SlidingFriction.model_validate(parameters), columns, cases, realisations, 7, ALL, accuracy)
    return MODEL.compute(block)


def assert_answers_or_says_why(result):
    """Every result is a state with bounds that any state obeys, or a status with a sentence and no numbers."""
    for place in np.ndindex(result.status.shape):
        found = {name: result.values[name][place] for name in ALL}
        if result.status[place] != Status.DONE:
            assert result.messages[place]
            assert np.all(np.isnan(list(found.values())))
            continue
        assert all(np.isfinite(value) for name, value in found.items() if not name.endswith("_error"))
        assert found["friction_coefficient"] >= -found["friction_coefficient_error"]
        assert 0 <= found["contact_fraction"] <= 1 + 1e-9
        assert all(found[name] >= 0 for name in found if name.endswith("_error"))


@settings(max_examples=60, deadline=None)
@example(0.0, -6.0, 3.0, 4.0, 6.0, BODIES[1], 1, "hermite", False)  # the load is lost in the rounding of the line
@example(0.0, 0.0, 4.0, 7.0, 7.0, BODIES[0], "auto", "hermite", True)  # as friction is
@given(
    hurst=st.floats(0, 1),
    force=fifteen_decades,
    velocity=fifteen_decades,
    modulus=fifteen_decades,
    rms=fifteen_decades,
    body=st.sampled_from(BODIES),
    grid=st.sampled_from([1, 4, "auto"]),
    scheme=st.sampled_from(["hermite", "backward_euler"]),
    general=st.booleans(),
)
def test_fifteen_decades_of_everything(hurst, force, velocity, modulus, rms, body, grid, scheme, general):
    numbers = {"normal_force": 10**force, "velocity": 0.1 * 10**velocity, "rms_roughness": 5e-7 * 10**rms}
    if general:
        scaled = {
            name: value * 10**modulus if name != "relaxation_time" else value
            for name, value in SOLID["standard_solid"].items()
        }
        material = {"material": {"standard_solid": scaled}}
        grid = 4 if grid == 1 else grid
    else:
        material = KELVIN | {"shear_modulus": 1e7 * 10**modulus}
    parameters = LINE | numbers | material | {"hurst": hurst, "indenter": body, "oversampling": grid, "scheme": scheme}
    assert_answers_or_says_why(solved(parameters, realisations=(0, 5)))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 0.0, -1.0])
@pytest.mark.parametrize(
    "name", ["normal_force", "velocity", "shear_modulus", "relaxation_time", "rms_roughness", "length"]
)
@pytest.mark.parametrize("body", BODIES[::3], ids=["plane", "power"])
def test_a_number_that_is_none_fails_alone(name, value, body):
    """Campaign files refuse such numbers; should one come by another way, its neighbours keep their bits."""
    parameters = LINE | KELVIN | LOAD | {"indenter": body}
    good = float(parameters[name])
    result = solved(parameters, {name: [good, value, good]})
    assert_answers_or_says_why(result)
    alone = solved(parameters)
    for output in ALL:
        assert result.values[output][0].tobytes() == alone.values[output][0].tobytes()
    if name == "rms_roughness" and value == 0:
        assert result.status[1, 0] == Status.DONE  # smooth
    else:
        assert result.status[1, 0] != Status.DONE


@pytest.mark.parametrize("value", [np.nan, np.inf, 0.0, -1.0])
@pytest.mark.parametrize("name", ["normal_force", "velocity", "rms_roughness", "length"])
def test_a_number_that_is_none_fails_alone_with_any_material(name, value):
    parameters = LINE | LOAD | {"material": SOLID}
    good = float(parameters[name])
    result = solved(parameters, {name: [good, value]})
    assert_answers_or_says_why(result)
    assert result.status[0, 0] == Status.DONE
    assert (result.status[1, 0] == Status.DONE) == (name == "rms_roughness" and value == 0)


QUANTITIES = {
    "length": ("m", ("mm", 1e3), ("um", 1e6)),
    "rms_roughness": ("m", ("um", 1e6), ("nm", 1e9)),
    "shear_modulus": ("Pa", ("MPa", 1e-6), ("GPa", 1e-9)),
    "relaxation_time": ("s", ("ms", 1e3), ("us", 1e6)),
    "normal_force": ("N", ("mN", 1e3), ("kN", 1e-3)),
    "velocity": ("m/s", ("mm/s", 1e3), ("um/s", 1e6)),
}


@settings(max_examples=25, deadline=None)
@given(data=st.data(), body=st.sampled_from(BODIES), general=st.booleans())
def test_units_do_not_matter(data, body, general):
    """One case in metres, millimetres or micrometres: the same to rounding, and the same bits of the same numbers."""
    plain, other = {}, {}
    for name, (unit, *others) in QUANTITIES.items():
        value = (LINE | KELVIN | LOAD)[name] * 10 ** data.draw(st.floats(-1, 1))
        chosen, factor = data.draw(st.sampled_from(others))
        plain[name] = value
        other[name] = to_si(f"{value * factor!r} {chosen}", unit)
        assert other[name] == pytest.approx(value, rel=1e-15)
    is_same, found = plain == other, []
    for numbers in (plain, other):
        modulus, time = numbers.pop("shear_modulus"), numbers.pop("relaxation_time")
        solid = {"standard_solid": {"static_modulus": modulus, "glass_modulus": 50 * modulus, "relaxation_time": time}}
        kelvin = {"shear_modulus": modulus, "relaxation_time": time}
        material = {"material": solid} if general else kelvin
        found.append(solved(numbers | material | {"points": 64, "indenter": body, "oversampling": 4}))
    one, two = found
    assert np.array_equal(one.status, two.status)
    for name in ALL:
        assert two.values[name] == pytest.approx(one.values[name], rel=1e-12, nan_ok=True)
        if is_same:
            assert two.values[name].tobytes() == one.values[name].tobytes()


@settings(max_examples=40, deadline=None)
@given(
    kind=st.sampled_from(["spikes", "steps", "needle", "saw", "flat", "noise"]),
    seed=st.integers(0, 1000),
    height=st.floats(-9, 0),
    force=st.floats(-6, 6),
    velocity=st.floats(-6, 3),
    options=st.sampled_from([{}, {"detrend": "line", "taper": 0.1}, {"shortest_wavelength": 1e-4}]),
    general=st.booleans(),
)
def test_spikes_and_steps_of_a_measured_file(tmp_path_factory, kind, seed, height, force, velocity, options, general):
    random, x = np.random.default_rng(seed), np.arange(200) * 1e-5
    z = {
        "spikes": np.where(random.uniform(size=200) < 0.03, random.exponential(10, 200), 0.0),
        "steps": np.repeat(random.standard_normal(8), 25),
        "needle": np.where(np.arange(200) == seed % 200, 1.0, 0.0),
        "saw": (np.arange(200) % 20) / 20,
        "flat": np.zeros(200),
        "noise": random.standard_normal(200),
    }[kind] * 10**height
    path = tmp_path_factory.mktemp("line") / "line.csv"
    np.savetxt(path, np.column_stack([x, z]), delimiter=",", header="x [m],z [m]", comments="")
    surface = {"profile": {"file": str(path), **options}}
    material = {"material": SOLID} if general else KELVIN
    result = solved(material | {"normal_force": 10**force, "velocity": 10**velocity, "surface": surface}, accuracy=0.05)
    assert_answers_or_says_why(result)
    if kind == "flat" and result.status[0, 0] == Status.DONE:
        assert result.values["friction_coefficient"][0, 0] == pytest.approx(0, abs=1e-12)


def fifty_arms(seed):
    random = np.random.default_rng(seed)
    return {
        "static_modulus": 1e6,
        "moduli": tuple(10 ** random.uniform(3, 10, 50)),
        "times": tuple(np.geomspace(1e-12, 1e8, 50)),
        "viscosity": float(random.choice([0.0, 10.0])),
    }


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 100), force=st.floats(-7, 7), velocity=st.floats(-9, 6), body=st.sampled_from(BODIES))
def test_fifty_arms_over_twenty_decades(seed, force, velocity, body):
    parameters = LINE | {"material": {"prony": fifty_arms(seed)}, "indenter": body, "oversampling": 8}
    assert_answers_or_says_why(solved(parameters | {"normal_force": 10**force, "velocity": 10**velocity}))


@pytest.mark.parametrize("velocity", [1e-6, 1e-2, 10.0])
def test_full_contact_of_fifty_arms_is_the_sum_over_waves(velocity):
    """F_x = 2 L sum A_k^2 q_k G''(q_k v): thesis eq. 3.14 for any rheology."""
    arms = fifty_arms(3) | {"viscosity": 0.0}
    result = solved(LINE | {"material": {"prony": arms}, "normal_force": 1e9, "velocity": velocity}, accuracy=1e-3)
    amplitude = LINE["rms_roughness"] * roughness.amplitudes(LINE["points"] // 2, 0.7)
    q = 2 * np.pi * np.arange(1, amplitude.size + 1) / LINE["length"]
    loss = complex_modulus(prony(arms["static_modulus"], arms["moduli"], arms["times"]), q * velocity).imag
    exact = 2 * LINE["length"] * np.sum(amplitude**2 * q * loss) / 1e9
    assert result.values["contact_fraction"][0, 0] == 1
    error = relative_error(result.values)[0, 0]
    assert error <= 1e-3
    assert result.values["friction_coefficient"][0, 0] == pytest.approx(exact, rel=error)


@pytest.mark.parametrize("material", [KELVIN, {"material": SOLID}], ids=["kelvin", "solid"])
def test_extremes_are_right_to_their_own_estimates(material):
    """Loads from one point to full contact, speeds over 12 decades: errors below their estimate in nine of ten."""
    force, velocity = (grid.ravel() for grid in np.meshgrid(np.geomspace(1e-7, 1e4, 12), np.geomspace(1e-8, 1e4, 13)))
    columns = {"normal_force": force, "velocity": velocity}
    found = solved(LINE | LOAD | material, columns, accuracy=0.01)
    exact = solved(LINE | LOAD | material | {"oversampling": 64}, columns)
    known = (found.status == Status.DONE) & (exact.status == Status.DONE)
    assert np.mean(known) > 0.99
    miss = np.abs(found.values["friction_coefficient"] / exact.values["friction_coefficient"] - 1)[known]
    estimate = (relative_error(found.values) + relative_error(exact.values))[known]
    assert np.mean(miss <= estimate + 1e-9) >= 0.9
    assert np.max(miss / (estimate + 1e-9)) < 20


def test_a_peak_between_nodes_that_holds_an_element_above_the_highest_node():
    """On this line the highest node is not on the highest peak, which a fast element still feels when it gets there."""
    parameters = LINE | KELVIN | {"points": 500, "hurst": 0.5, "length": 1.0, "rms_roughness": 1.0}
    columns = {"velocity": np.array([3e3, 1e4, 3e4]), "normal_force": 4e7 * np.array([0.5, 1.0, 2.0])}

    def friction(oversampling):
        case = SlidingFriction.model_validate(parameters | LOAD | {"oversampling": oversampling})
        return MODEL.compute(Block(case, columns, 3, (112,), 3, ALL, 0.01)).values

    found, exact = friction("auto"), friction(64)["friction_coefficient"]
    miss = np.abs(found["friction_coefficient"] / exact - 1)
    assert np.all(miss <= relative_error(found))


@pytest.mark.parametrize("realisation", range(4))
def test_the_error_covers_a_peak_between_two_nodes(realisation):
    """A contact shorter than a cell: drag depends on the curvature of one cubic only, and two grids may agree on it."""
    columns = {"velocity": np.geomspace(2e4, 1e8, 6), "normal_force": np.geomspace(1e4, 1e8, 6)}
    parameters = LINE | KELVIN | LOAD | {"length": 1.0, "rms_roughness": 1.0, "hurst": 0.3}

    def friction(oversampling):
        case = SlidingFriction.model_validate(parameters | {"oversampling": oversampling})
        return MODEL.compute(Block(case, columns, 6, (realisation,), 9, ALL, 0.01)).values

    exact = friction(64)["friction_coefficient"]
    for oversampling in (2, 4, 16):
        found = friction(oversampling)
        miss = np.abs(found["friction_coefficient"] / exact - 1)
        assert np.all(found["contact_fraction"] * LINE["points"] * oversampling < 2)
        assert np.all(miss <= relative_error(found))
