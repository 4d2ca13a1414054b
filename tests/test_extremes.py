"""Invariants of every solver, checked by hypothesis, and single bad numbers among good cases."""

import contextlib

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError
from schemes import on_line, viscous_state

from mdr_dask.errors import FitError
from mdr_dask.models import load
from mdr_dask.models.base import Block, Status
from mdr_dask.physics.lubrication.line_contact import LineContact, solve_film
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.solids import prony
from mdr_dask.physics.superposition.master_curve import superpose
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.surfaces.waves import waves_of

SCHEMES = ("hermite", "backward_euler")
NODES = (2, 3, 16, 17, 255, 1024)
LINES = ("flat", "spike", "steps", "clipped", "noise", "waves")


def line(kind, nodes, seed):
    """Return heights of about one and slopes of some kind of line, on two grid points for each node; the mean is 0."""
    random = np.random.default_rng(seed)
    place = np.arange(nodes) / nodes
    waves = np.sin(2 * np.pi * (place + random.uniform())) + 0.3 * np.sin(6 * np.pi * (place + random.uniform()))
    height = {
        "flat": np.zeros(nodes),
        "spike": np.where(np.arange(nodes) == random.integers(nodes), 1.0, 0.0),
        "steps": np.repeat(random.standard_normal(-(-nodes // 8)), 8)[:nodes],
        "clipped": np.minimum(waves, 0.2),
        "noise": random.standard_normal(nodes),
        "waves": waves,
    }[kind]
    waves = waves_of(height - height.mean())
    return waves.heights(2 * nodes), waves.slopes(2 * nodes)


ANY_LINE = {"kind": st.sampled_from(LINES), "nodes": st.sampled_from(NODES), "seed": st.integers(0, 10**6)}


@settings(max_examples=30, deadline=None)
@example("clipped", 2, 454, 0.125, "hermite")
@example("clipped", 255, 44, 0.0, "hermite")
@given(**ANY_LINE, deborah=st.floats(-5, 2), scheme=st.sampled_from(SCHEMES))
def test_depth_and_contact_grow_with_the_load(kind, nodes, seed, deborah, scheme):
    """Depth and length in contact never fall with the load, over eight decades of it."""
    height, slope = line(kind, nodes, seed)
    loads = np.geomspace(1e-4, 1e4, 17)
    found = on_line(height, slope, np.full(17, 10**deborah), loads, scheme)
    good = found.status == Outcome.CONVERGED
    assert np.all(np.diff(found.depth[good]) >= -1e-9 * (np.ptp(height) + loads[good][1:]))
    assert np.all(np.diff(found.contact_fraction[good]) >= -1e-6)
    # the error of a few nodes of a kinked line may take friction below zero, by little of the steepest slope
    least = -2e-3 * (np.abs(slope).max() + np.ptp(height)) * loads[good]
    assert np.all((found.drag[good] >= least) & (found.contact_fraction[good] <= 1 + 1e-9))


@settings(max_examples=40, deadline=None)
@example("spike", 16, 1, -1.0, 0.0, 1)  # the highest point is a node
@given(**ANY_LINE, deborah=st.floats(-5, 0), force=st.floats(-3, 3), turn=st.integers(1, 2000))
def test_where_a_periodic_line_begins_does_not_matter(kind, nodes, seed, deborah, force, turn):
    height, slope = line(kind, nodes, seed)
    assume(kind == "flat" or np.sum(height > height.max() - 1e-9) == 1)  # of two tops the first one begins the period
    case, load = np.array([10**deborah]), np.array([10**force])
    one = on_line(height, slope, case, load)
    two = on_line(np.roll(height, turn), np.roll(slope, turn), case, load)
    assert one.status[0] == two.status[0] == Outcome.CONVERGED
    scale = np.ptp(height) + load[0]
    assert two.depth[0] == pytest.approx(one.depth[0], rel=1e-9, abs=1e-9 * scale)
    assert two.drag[0] == pytest.approx(one.drag[0], rel=1e-7, abs=1e-9 * np.ptp(height) * load[0])


@settings(max_examples=40, deadline=None)
@given(kind=st.sampled_from(LINES), seed=st.integers(0, 10**6), deborah=st.floats(-4, 0))
def test_a_mirrored_line_has_the_same_friction_in_full_contact_and_at_rest(kind, seed, deborah):
    """In full contact friction is a sum over waves; at v -> 0 it is that of statics, whichever way it goes."""
    height, slope = line(kind, 64, seed)
    mirrored, mirrored_slope = height[::-1].copy(), -slope[::-1].copy()
    for pace, force in ((10**deborah, 1e4), (1e-9, 0.3)):
        one = on_line(height, slope, np.array([pace]), np.array([force]))
        two = on_line(mirrored, mirrored_slope, np.array([pace]), np.array([force]))
        assert two.depth[0] == pytest.approx(one.depth[0], rel=1e-6)
        assert two.drag[0] == pytest.approx(one.drag[0], rel=1e-5, abs=1e-12)


def prony_terms(seed, count):
    random = np.random.default_rng(seed)
    return 10 ** random.uniform(-2, 2, count), 10 ** random.uniform(-6, 2, count)


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.sampled_from([1, 2, 5, 50]),
    force=st.floats(-3, 2),
    dashpot=st.sampled_from([0.0, 1e-3]),
)
def test_terms_have_no_order_and_equal_ones_are_one(seed, count, force, dashpot):
    """Prony terms in another order, and one term split in two, are the same solid."""
    moduli, times = prony_terms(seed, count)
    height, _ = line("waves", 64, seed)
    found = [
        viscous_state(periodic_line(height, None), prony(1.0, some, at, dashpot), 10**force)
        for some, at in (
            (moduli, times),
            (moduli[::-1], times[::-1]),
            (np.append(moduli, 0.5 * moduli[0]) * np.append([0.5], np.ones(count)), np.append(times, times[0])),
        )
    ]
    values, errors, status = found[0]
    assert {other for _, _, other in found} == {status}
    if status == Outcome.CONVERGED:
        for other, _, _ in found[1:]:
            assert np.all(np.abs(other - values) <= np.maximum(errors, 1e-7 * np.abs(values) + 1e-9))
        assert values[0] >= -errors[0]


@settings(max_examples=12, deadline=None)
@given(load=st.floats(-3, 3), liquid=st.floats(0, 25))
def test_films_from_rigid_and_isoviscous_to_heavy_and_piezoviscous(load, liquid):
    """The pressure carries the load and is nowhere negative, the film is open, and thinnest behind the middle."""
    found = solve_film(LineContact(10**load, liquid))
    if found.outcome != Outcome.CONVERGED:
        assert found.reason
        return
    grid = found.finest
    assert np.trapezoid(found.finest.pressure, found.finest.nodes) == pytest.approx(np.pi / 2, rel=1e-9)
    assert grid.pressure.min() >= 0
    assert grid.film.min() > 0
    assert found.minimum_film.value <= found.central_film.value * (1 + 1e-6)
    assert 0 < found.central_film.error < 0.05 * found.central_film.value
    thicker = solve_film(LineContact(10**load, liquid + 1.0))
    if thicker.outcome == Outcome.CONVERGED:
        slack = found.central_film.error + thicker.central_film.error
        assert thicker.central_film.value >= found.central_film.value - slack


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "rounding"), [("hermite", 1e-12), ("backward_euler", 1e-6)])
def test_a_line_of_ten_million_nodes_is_solved(scheme, rounding):
    """Full contact with one wave: the drag is v tau times the mean square of the slope, a time step beside it."""
    place = np.arange(10**7) / 10**7
    height, slope = np.sin(2 * np.pi * place), 2 * np.pi * np.cos(2 * np.pi * place)
    found = on_line(height, slope, np.array([0.1]), np.array([1e3]), scheme)
    assert found.status[0] == Outcome.CONVERGED
    assert found.drag[0] == pytest.approx(0.1 * 2 * np.pi**2, rel=rounding)
    assert found.contact_fraction[0] == 1


def factors(groups, curves, vertical):
    """Return a superposition, None if it is refused."""
    with contextlib.suppress(FitError):
        return superpose(groups, curves, "free" if vertical else "none")
    return None


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    points=st.sampled_from([4, 12]),
    noise=st.sampled_from([1e-4, 1e-2, 0.1]),
    along=st.floats(-9, 9),
    up=st.floats(-12, 12),
    vertical=st.booleans(),
)
@example(seed=0, points=4, noise=1e-4, along=0.0, up=5.0, vertical=True)
@example(seed=3158, points=4, noise=1e-4, along=0.0, up=0.0, vertical=True)  # a scan without a scatter
@example(seed=18638, points=4, noise=1e-4, along=0.0, up=0.25, vertical=True)
def test_master_curves_do_not_depend_on_units_and_order(seed, points, noise, along, up, vertical):
    """All curves moved along both axes, their points and the curves themselves in another order: the same factors."""
    random = np.random.default_rng(seed)
    shifts = np.cumsum(random.uniform(0.2, 0.6, 5))
    x = np.linspace(-1, 1, points)
    curves = [(x, np.tanh(x + shift - 1) + noise * random.standard_normal(points)) for shift in shifts]
    groups = np.arange(5.0)
    order, rows = random.permutation(5), random.permutation(points)
    moved = [(curves[k][0][rows] + along, curves[k][1][rows] + up) for k in order]
    one = factors(groups, curves, vertical)
    two = factors(groups[order], moved, vertical)
    if one is None or two is None:
        assert one is two
        return
    assert np.array_equal(two.groups, one.groups)
    # rounding may lead to other draws: the means of 480 draws then differ by some tenths of the stated error, and more
    # if the chains wander along a plateau
    close = (1.0 if one.undetermined else 0.3) * np.maximum(one.horizontal_error, 1e-6) + 1e-7
    assert np.all(np.abs(two.horizontal - one.horizontal) <= close)
    assert np.all(np.abs(two.vertical - one.vertical) <= close)


#: What is no number or of the wrong sign, of which campaigns let little through, and the ends of what a number can be.
POISON = np.array([np.nan, np.inf, -np.inf, -1.0, 0.0, 5e-324, 1e-300, 1.001e-30, 1e-15, 1e15, 0.999e30, 1e300])
LINE = {"length": 0.02, "points": 64, "rms_roughness": 5e-7, "normal_force": 1.5, "velocity": 0.1}
KELVIN = {"shear_modulus": 1e7, "relaxation_time": 1e-3}
STEEL = {"contact_modulus": 115e9, "effective_shear_modulus": 90e9, "friction": 0.6, "hardness": 2e9}
BALL = {"indenter": {"shape": "parabola", "radius": 0.01}, "normal_force": 50.0}
WEAR = STEEL | {"amplitude": 5e-7, "wear_coefficient": 1e-4, "cycles": 2e4}
FILM = {"radius": 0.01, "line_load": 1e5, "mean_velocity": 1.0, "viscosity": 0.08, "pressure_viscosity": 2e-8}
ROLLERS = {"rms_roughness": 2e-7, "roller_radius": 1e-3, "normal_force": 100.0, "rotation_speed": 10.0}
ROLLERS |= {"temperature": 333.15, "cutoff_force": 100.0, "layer_thickness": 5e-9}
JUMP = LINE | {"oversampling": 2, "relaxation_times": (0.0, 0.1, 1.0)}
MODELS = {
    "friction": ("sliding_friction", LINE | KELVIN | {"hurst": 0.7}),
    "rolled off": ("sliding_friction", LINE | KELVIN | {"rolloff_wavelength": 0.01, "longest_wavelength": 0.015}),
    "jump": ("velocity_jump", JUMP | KELVIN | {"velocity_change": 0.2}),
    "wear": ("fretting_wear", WEAR | BALL | {"xi": 0.8, "points": 5, "wear_rule": "fast"}),
    "worn exactly": ("fretting_wear", {"stick_radius": 0.5, "cycles": 1.0, "points": 5}),
    "film": ("ehl_line", FILM | {"slide_roll_ratio": 0.1, "contact_modulus": 115e9, "profile_points": 5}),
    "rollers": (
        "mixed_lubrication",
        ROLLERS
        | {"points": 2000, "roller_width": 0.01, "slide_roll_ratio": 0.0, "trace_points": 10, "eyring_stress": 5e6}
        | {"layer_shear_strength": 1e6, "contact_modulus": 115e9, "boundary_friction": 0.1, "hurst": 0.7}
        | {"longest_wavelength": 2e-4},
    ),
}
POISONED = [
    (row, name)
    for row, (_, parameters) in MODELS.items()
    for name, value in parameters.items()
    if isinstance(value, float) and name != "accuracy"
]


STEPS = {"shape": "steps", "times": (0.0,), "velocities": (0.12,)}
#: Solvers whose numbers are not made bad one by one.
MORE = {
    "papers' steps": ("sliding_friction", LINE | KELVIN | {"scheme": "backward_euler", "oversampling": 4}),
    "steps of velocity": ("velocity_jump", JUMP | KELVIN | {"protocol": STEPS}),
}


@pytest.mark.parametrize("row", MODELS | MORE)
def test_a_value_depends_on_its_case_and_realisation_alone(row):
    """Bit by bit, a whole block and each of its results alone."""
    model_name, parameters = (MODELS | MORE)[row]
    model = load(model_name)
    name = next(name for name, value in parameters.items() if isinstance(value, float))
    outputs = model.with_companions([output.name for output in model.outputs if output.default])
    columns = {name: parameters[name] * np.array([1.0, 1.2])}
    whole = Block(model.parameters.model_validate(parameters), columns, 2, (0, 3), 5, outputs, 0.05)
    together = model.compute(whole)
    assert np.all(together.status == Status.DONE)
    for index, position in np.ndindex(2, 2):
        alone = model.compute(whole.part(index, whole.realisations[position]))
        for output in outputs:
            assert alone.values[output][0, 0].tobytes() == together.values[output][index, position].tobytes(), output


def is_valid(model, parameters):
    """Return whether a campaign lets parameters through."""
    with contextlib.suppress(ValidationError):
        model.parameters.model_validate(parameters)
        return True
    return False


@pytest.mark.parametrize(("row", "name"), POISONED)
def test_a_bad_number_fails_alone_with_a_message(row, name):
    """Among good cases of one block, for every number of every model; finite values where it is done after all."""
    model_name, parameters = MODELS[row]
    model = load(model_name)
    outputs = model.with_companions([output.name for output in model.outputs if output.default])
    good = float(parameters[name])
    kept = model.parameters.model_validate(parameters)
    let_through = [value for value in POISON.tolist() if is_valid(model, parameters | {name: value})]
    assert np.all(np.isfinite(let_through))
    assert max(np.abs(let_through), default=0) < 1e30
    column = np.array([good, *let_through, good])
    found = model.compute(Block(kept, {name: column}, column.size, (1,), 5, outputs))
    alone = model.compute(Block(kept, {name: column[:1]}, 1, (1,), 5, outputs))
    assert alone.status[0, 0] == Status.DONE
    for k in (0, column.size - 1):
        for output in outputs:
            assert found.values[output][k].tobytes() == alone.values[output][0].tobytes(), output
    for k, value in enumerate(column):
        if found.status[k, 0] != Status.DONE:
            assert found.messages.get((k, 0)), f"{name} = {value:g} has the status {found.status[k, 0]} and no message"
            assert all(np.all(np.isnan(found.values[output][k])) for output in outputs)
            continue
        for output in outputs:
            if not output.endswith("_error"):
                assert np.all(np.isfinite(found.values[output][k])), f"{output} at {name} = {value:g}"
