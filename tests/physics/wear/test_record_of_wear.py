"""Whole worn contacts on record, by every rule and evolution: values, stated errors, steps, what is refused."""

import itertools

import numpy as np
import record
from flattened import flat

from mdr_dask.physics.mdr.half_integrals import graded_panels
from mdr_dask.physics.mdr.revolution import PowerProfile, from_table
from mdr_dask.physics.wear import approach, evolution, forced, remembered, rules
from mdr_dask.physics.wear.exact import (
    _fretted,
    _resolution,
    _sharpness,
    _slid,
    _slid_under_force,
    exact,
    limit_under_force,
)
from mdr_dask.physics.wear.forced_rule import _depth_stages, fast_forced
from mdr_dask.physics.wear.forced_slip import forced_slip
from mdr_dask.physics.wear.history import LoadBlock, history
from mdr_dask.physics.wear.slip import GrossSlip, partial_slip

NUMBERS = ("contact_radius", "stick_border", "depth", "normal_force", "wear_volume", "worn_depth", "energy_volume")
FURTHER = ("steps", "slowness", "second", "least_edge_error", "edge_step", "relative_error")
#: Numbers of a resolution.
PARTS = ("accuracy", "wider", "fewer", "thinned", "step", "first", "newton", "slowness", "second")
PLACES = np.array([0.0, 0.11, 0.34, 0.451, 0.4561, 0.52, 0.67, 0.83, 0.95, 0.99, 1.013, 1.09, 1.21, 1.47])
RADII = np.linspace(0.0, 3.1, 45)
TABLE = from_table(1e-3 * RADII, 1e-4 * (RADII**2.3 + 0.04 * RADII**4), 0.9e-4)
SHORT = from_table(1e-3 * RADII[:17], 1e-4 * RADII[:17] ** 2, 1.5e-4)
BODIES = {"parabola": PowerProfile(2.0), "sharp": PowerProfile(0.7), "blunt": PowerProfile(4.6), "table": TABLE}


def told(contacts, pressed=0):
    """Numbers and functions of contacts, with their errors, a row each; pressures, which take long, of some alone."""
    found = {name: [getattr(one, name) for one in contacts] for name in FURTHER}
    found |= {"rougher": [float(one.steps) for contact in contacts for one in contact.rougher]}
    for name in (*NUMBERS, "worn_profile", "worn_image"):
        found |= {name: [one.value(name, PLACES) for one in contacts]}
        found |= {f"{name} error": [one.error(name, PLACES) for one in contacts]}
    found |= {"pressure": [contacts[pressed].value("pressure", PLACES)]}
    found |= {"pressure error": [contacts[pressed].error("pressure", PLACES[::3])]}
    return {name: np.array(values).ravel() for name, values in found.items()}


def why(function, *arguments, **named):
    """The sentence with which something is refused, or nothing."""
    try:
        function(*arguments, **named)
    except (ValueError, ArithmeticError) as error:
        return f"{type(error).__name__}: {error}"
    return "taken"


def test_rules(dataframe_regression):
    found = {}
    for name, body in BODIES.items():
        cases = [(0.0, 0.8), (1e-3, 0.93), (0.7, 0.8), (9.0, 1.1), (400.0, 0.8)]
        stick = (0.23, 0.97) if name == "table" else (0.07, 0.4561, 0.97)
        contacts = [rules.fast(body, c, *case) for c, case in itertools.product(stick, cases)]
        found |= {f"{name} limit": told([rules.limit(body, c) for c in stick]), name: told(contacts, 2)}
    grid = np.meshgrid([0.3, 1.0, 2.0, 7.5], [1e-3, 0.31, 0.88, 0.9999], [0.0, 0.02, 1.3, 70.0])
    n, c, cycles = (part.ravel() for part in grid)
    limits = rules.limit_cases(n, c)
    found |= {"limits": limits, "fast": rules.fast_cases(n, c, cycles, 0.9, limits[0])}
    found |= {"refused": [why(rules.limit, TABLE, c) for c in (1e-3, 0.0, 1.0)]}
    record.check(dataframe_regression, flat("", found))


def test_fast_rule_under_force(dataframe_regression):
    contacts, depths = [], []
    for (name, body), c in itertools.product(BODIES.items(), (0.4561, 0.9)):
        cases = ((0.03, 0.8), (1.3, 0.95), (0.0, 0.8), (700.0, 0.8))[: 2 if name != "blunt" else 4]
        contacts += [fast_forced(body, c, cycles, xi) for cycles, xi in cases]
        step, stages, load = _depth_stages(body, c, float(body.rise(np.array(1 - c), c)), 1.234)
        depths += [step, load, *stages.ravel()]
    record.check(dataframe_regression, flat("", {"contacts": told(contacts, 1), "depths": np.array(depths)}))


def test_approach(dataframe_regression):
    """From the first cycles that are late enough, and where the bound is too wide."""
    found, cycles = {}, [0.5, 3.0, 9.0, 27.0, 60.0, 81.0, 2e3]
    for (name, body), c in itertools.product(BODIES.items(), (0.4561, 0.97)):
        near = [approach.nearly_limit(body, c, cycles, accuracy) for accuracy in (1e-1, 1e-3, 1e-5)]
        found |= {f"{name} {c}": [str(list(each)) for each in near]}
        bounds = [approach._bound(body, rules.limit(body, c), number) for number in cycles]
        found |= {f"{name} {c} bound": np.log(bounds)}
    found |= {"contact": told(list(approach.nearly_limit(TABLE, 0.4561, [99.0], 1e-3).values()))}
    record.check(dataframe_regression, flat("", found))


def test_exact_at_constant_depth(dataframe_regression):
    cycles, found = [0.0, 3e-3, 1.3, 0.4, 6.0, 90.0], {}
    scenes = {"coarse": (("parabola", 0.4561, 1e-2), ("sharp", 0.13, 3e-3), ("blunt", 0.983, 1e-3))}
    scenes |= {"fine": (("parabola", 0.4561, 3e-4), ("table", 0.7, 1e-3))}
    for scene, cases in scenes.items():
        contacts = [one for name, c, accuracy in cases for one in exact(BODIES[name], c, cycles, accuracy)]
        found |= {scene: told(contacts, 3)}
    found |= {"alone": told(exact(PowerProfile(1.4), 0.4561, [0.8], 1e-2, errors=False))}
    record.check(dataframe_regression, flat("", found))


def test_exact_under_force(dataframe_regression):
    scenes = (("parabola", 0.4561), ("parabola", 0.9999999), ("sharp", 0.8), ("table", 0.6))
    contacts, ends = [], []
    for name, c in scenes:
        contacts += exact(BODIES[name], c, [0.0, 0.01, 1.1, 9.0], 1e-2, constant_force=True)
        ends.append(limit_under_force(BODIES[name], c, 1e-2))
    ends.append(limit_under_force(PowerProfile(0.7), 0.2, 1e-2, errors=False))
    refused = [why(limit_under_force, SHORT, c, 1e-2) for c in (0.4, 0.7, 0.0, 1.0)]
    found = {"contacts": told(contacts, 2), "ends": told(ends, -1), "refused": refused}
    found |= {"exact": why(exact, SHORT, 0.4, [0.1], 1e-2, constant_force=True)}
    record.check(dataframe_regression, flat("", found))


def test_sliding(dataframe_regression):
    found = {}
    for force in (False, True):
        scenes = itertools.product(("parabola", "sharp", "table"), (1e-2, 2e-3))
        paths = [0.0, 1e-3, 0.4, 1.2]
        contacts = []
        for name, accuracy in scenes:
            contacts += exact(BODIES[name], 0.0, paths, accuracy, constant_force=force)
        found |= {f"force {force}": told(contacts, 2)}
    found |= {"sharpness": [_sharpness(body) for body in BODIES.values()]}
    found |= {"refused": [why(exact, TABLE, 0.0, [80.0], 1e-2), why(exact, TABLE, 0.05, [5.0], 1e-2)]}
    record.check(dataframe_regression, flat("", found))


def test_histories(dataframe_regression):
    blocks = [
        LoadBlock(0.3, 0.61, depth=1.0),
        LoadBlock(0.2, 0.37, depth=1.13),
        LoadBlock(0.11, 1.4, depth=0.9),
        LoadBlock(0.05, np.inf, depth=1.0),
        LoadBlock(0.4, 0.2, force=1.1),
        LoadBlock(0.0, 0.5, force=1.7),
    ]
    found = {name: told(history(BODIES[name], blocks, cells=46, reach=1.93)) for name in ("parabola", "table")}
    found |= {"alone": told(history(PowerProfile(1.0), blocks[:2], cells=31, reach=2.4, errors=False))}
    found |= {"refused": why(history, PowerProfile(2.0), [LoadBlock(0.1, 0.5, depth=4.0)], cells=20, reach=1.3)}
    for given in ((1.0, 0.5), (1.0, 0.5, 1.0, 1.0), (-1.0, 0.5, 1.0), (1.0, 0.0, 1.0)):
        found |= {f"block {given}": why(LoadBlock, *given)}
    record.check(dataframe_regression, flat("", found))


def test_resolutions(dataframe_regression):
    found, accuracies = {}, (1e-1, 1e-2, 2.1e-3, 2e-3, 6e-4, 5e-4, 2.1e-4, 1.9e-4, 4e-5, 2e-5, 1e-5)
    ways = {"fretted": _fretted, "slid": _slid, "forced": forced.forced_contacts, "slid under force": _slid_under_force}
    for name, way in ways.items():
        pairs = [[_resolution(way, c, accuracy) for c in (0.3, 0.93)] for accuracy in accuracies]
        rough = [one for pair in pairs for one in (*pair[0].rougher(), pair[1].finer(2.0), pair[1].halfway_to(pair[0]))]
        every = [*itertools.chain(*pairs), *rough]
        found |= {f"{name} {part}": np.array([getattr(one, part) for one in every]) for part in PARTS}
        found |= {f"{name} order": [str(one.order) for one in every]}
        found |= {f"{name} rough": np.array([one.rough for one in every])}
        some = [pairs[1][0], pairs[3][1], rough[12], pairs[7][0], pairs[8][0]]
        panels = [one.panels(*shape) for one in some for shape in ((3, 2.0, 1.0), (5, 3.0, 2.3))]
        panels += [one.panels_of_a_punch(sharp) for one in some for sharp in (1.0, 3.7)]
        found |= {f"{name} edges": np.array([one.mesh.edges.size for one in panels])}
        found |= {f"{name} nodes": np.array([one.nodes.size for one in panels])}
        found |= {f"{name} first": np.log([one.mesh.edges[1] for one in panels])}
    found |= {"moves": [str(forced.border_moves(c, 1e-2)) for c in (0.5, 0.99979, 0.99981)]}
    found |= {"least": [forced.least_edge_error(c, a) for c in (0.5, 0.99) for a in (1e-2, 1e-4)]}
    found |= {"farthest": [forced.farthest_contact(body, c) for body in BODIES.values() for c in (0.03, 0.4, 0.9)]}
    record.check(dataframe_regression, flat("", found))


def test_memory_of_a_border(dataframe_regression):
    """Along a path on which it goes out, and stands: what the plateau rose, what was left frozen, what is known."""
    problem = forced_slip(PowerProfile(2.0), 0.4561, graded_panels(4, 3, 4), 2.1)
    path = np.array([[0.0, 0.013, 0.05, 0.0501, 0.11], [0.0, 0.01, 0.04, 0.1, 0.13]])
    places = np.array([-0.01, 0.0, 0.004, 0.03, 0.05, 0.09, 0.11])
    found = {"rise": problem.plateau_rise(path, np.array([0.11, 0.13, 0.4, 1.1]))}
    found |= {"frozen": problem.frozen_depth(path, places)}
    angles = itertools.product((0.0, 0.2, 0.9), (0.0, 0.199, 0.8, 0.93))
    found |= {"angles": [remembered._mean_angle(0.9, 0.8, first, last) for first, last in angles]}
    moving, start = problem.move(evolution.settled(problem))
    unknowns = np.append(start.unknowns[:-3], [1.07, 0.02, 0.015])
    moment = moving.moment(0.3, unknowns, 0.25, moving.memory([start], np.ones(1))(unknowns), [start])
    standing, stood = moving.stand(moment)
    for name, one, past in (("moving", moving, [moment, start]), ("standing", standing, [stood])):
        here = past[0].unknowns * 1.01
        known = one.memory(past, np.array([1.3, -0.3])[: len(past)])(here)
        after = one.moment(0.5, here, 0.2, known, past)
        found |= {f"{name} known": known, f"{name} residual": one.residual(here, 0.2, known), f"{name} after": after}
        found |= {f"{name} jacobian": one.jacobian(here, 0.2), f"{name} rate": one.wear_rate(here)}
        found |= {f"{name} frozen": one.frozen, f"{name} holds": str(one.holds(-here))}
        found |= {f"{name} worn": one.worn_depth(after, np.array([0.016, 0.1, 0.7, 1.2]))}
        found |= {f"{name} loads": (one.sticking_load(past[0], one.place(here)), one.slipping_load(here))}
    record.check(dataframe_regression, flat("", found))


def test_equations_of_fixed_borders(dataframe_regression):
    panels, body, found = graded_panels(3, 2, 4), PowerProfile(1.7), {}
    problems = {"partial": partial_slip(body, 0.37, panels, 1.9)}
    problems |= {"gross": GrossSlip(body, panels), "forced": GrossSlip(body, panels, 1.23)}
    for name, one in problems.items():
        start = evolution.settled(one)
        here = start.unknowns * (1 + 0.02 * np.sin(np.arange(start.unknowns.size)))
        known = one.memory([start], np.ones(1))(here) + 0.01
        after = one.moment(0.3, here, 0.11, known, [start])
        found |= {f"{name} start": start.unknowns, f"{name} after": after.gathered}
        found |= {f"{name} known": one.memory([after, start], np.array([1.4, -0.4]))(here)}
        found |= {f"{name} residual": one.residual(here, 0.11, known), f"{name} jacobian": one.jacobian(here, 0.11)}
        found |= {f"{name} worn": one.worn(here), f"{name} rate": one.wear_rate(here)}
        dense = evolution.Dense(evolution.march(one, 0.6, 2e-4, 1e-3))
        rates = [one.wear_rate(moment.unknowns) for moment in dense.history]
        energy = evolution.integral_along(dense.history, rates)
        found |= {f"{name} times": dense.times, f"{name} last": dense.history[-1].gathered, f"{name} energy": energy}
        found |= {f"{name} between": np.array([dense.number(time, energy) for time in (0.0, 1e-4, 0.02, 0.31, 0.6)])}
        found |= {f"{name} unknowns": dense.unknowns(0.47), f"{name} gathered": dense.gathered(0.47)}
        found |= {f"{name} steps": dense.steps(0.3)}
    table = problems["partial"].virgin_slip
    found |= {"table": (table.first, table.step, table(np.geomspace(1e-5, 4.0, 9)))}
    record.check(dataframe_regression, flat("", found))
