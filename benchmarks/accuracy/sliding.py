"""Steady sliding against one element that is followed along a fine line step by step, until three grids agree."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.accuracy.points import Point, neighbours
from benchmarks.measures import timed_in_turns
from mdr_dask.physics.sliding.problem import PronyTerms, Request, solve
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.shapes import PowerLaw
from mdr_dask.physics.surfaces.waves import Waves

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from references import slow_friction as slow

MODES = 64
#: Hurst exponent, depth in rms heights, v tau / L: full contact, the transition, few peaks.
CASES = {
    "easy: full contact": (0.7, 8.0, 0.01),
    "typical: transition": (0.7, 0.3, 0.003),
    "hard: peaks": (0.3, -2.0, 0.003),
}
SCHEMES = {
    "backward_euler": "time steps of a cell (thesis)",
    "piecewise_linear": "straight cells",
    "hermite": "cubic cells",
}
SOLIDS = {
    "one arm": PronyTerms((9.0,), (0.01,)),
    "five arms": PronyTerms((1.0, 2.0, 4.0, 8.0, 16.0), (1.0, 0.1, 1e-2, 1e-3, 1e-4)),
    "fifty arms, 20 decades": PronyTerms(tuple(np.geomspace(0.1, 10, 50)), tuple(np.geomspace(1e-16, 1e4, 50))),
}
#: Exponent and coefficient of bodies under no roughness, over the line's length.
BODIES = {"parabola": (2.0, 5.0), "cone": (1.0, 1.0), "flat: n = 6": (6.0, 500.0)}


def exact(line, depth: float, body: slow.Body, periodic: bool, short: bool) -> slow.Reference:
    """Return the state at a depth, to five digits and more unless it is to be short."""
    agreed, work = slow.AGREED, slow.WORK
    slow.AGREED, slow.WORK = (1e-4, 2**17) if short else (2e-7, 2**23)
    try:
        found = slow.reference(line, depth, body, periodic)
    finally:
        slow.AGREED, slow.WORK = agreed, work
    if found is None:
        raise RuntimeError("the reference found no steady state")
    return found


def rough(hurst: float, realisation: int = 1):
    """Return a line as waves, and as a function of its nodes for the reference."""
    amplitude, phase = roughness.amplitudes(MODES, hurst), roughness.phases(0, realisation, MODES)
    factors = roughness.phase_factors(0, realisation, MODES)
    return RoughLine(Waves(0.5 * amplitude * factors, 2 * MODES)), slow.waves(amplitude, phase)


def ladder(
    line, arms, deborah: float, truth, grids, scheme="hermite", repeats=15
) -> Iterator[tuple[str, float, float, float]]:
    """Yield setting, processor time, error of the friction and its stated error, for every grid or accuracy."""
    case = np.array([deborah]), np.array([truth.load])
    aims = [Request(0.01, grid, scheme) if isinstance(grid, int) else Request(grid, "auto", scheme) for grid in grids]
    solved = timed_in_turns([partial(solve, line, arms, *case, aim) for aim in aims], repeats)
    for grid, ((steady, errors), seconds) in zip(grids, solved, strict=True):
        friction, stated = steady.drag[0] / truth.load, float(errors[0][0] / steady.drag[0])
        setting = f"grid {grid}" if isinstance(grid, int) else f"auto, {grid:g}"
        # below its own doubt the reference cannot judge
        error = max(float(abs(friction / truth.friction - 1)), truth.doubt)
        yield setting, seconds, error, stated if stated > 3 * truth.doubt else np.nan


def kelvin(short: bool) -> Iterator[Point]:
    """Yield every scheme on finer and finer grids, with its error estimate, and what `accuracy` picks, on ten lines."""
    grids = (2, 8) if short else (1, 2, 4, 8, 16, 32, 64)
    for case, (hurst, depth, slowest) in CASES.items():
        for number, higher, faster in neighbours(short):
            line, reference = rough(hurst, 1 + number)
            deborah, deep = slowest * 1.5**faster, depth + 0.1 * higher
            truth = exact(reference, deep, slow.Body(np.empty(0), np.empty(0), deborah), True, short)
            for scheme, name in SCHEMES.items():
                for found in ladder(line, None, deborah, truth, grids, scheme):
                    yield Point("steady friction", case, name, *found)
            for found in ladder(line, None, deborah, truth, (0.1, 0.01, 0.001, 1e-4)[: 2 if short else 4]):
                yield Point("steady friction", case, "accuracy: auto", *found)


def solids(short: bool) -> Iterator[Point]:
    """Yield solids of one to fifty arms at the transition, on ten lines."""
    hurst, depth, _ = CASES["typical: transition"]
    for case, solid in SOLIDS.items():
        if short and len(solid.moduli) > 1:
            continue
        for number, higher, faster in neighbours(short):
            line, reference = rough(hurst, 1 + number)
            arms = PronyTerms(solid.moduli, tuple(1.5**faster * each for each in solid.deborah))
            body = slow.Body(np.array(arms.moduli), np.array(arms.deborah), 0.0)
            truth = exact(reference, depth + 0.1 * higher, body, True, short)
            tried = (4, 16, 0.05) if short else (4, 8, 16, 32, 64, 0.05, 0.01, 0.001)
            for found in ladder(line, arms, 0.0, truth, tried):
                asked = found[0].startswith("auto")
                method = "accuracy: auto" if asked else "straight cells, extrapolated"
                yield Point("general solids", case, method, *found)


def indenters(short: bool) -> Iterator[Point]:
    """Yield smooth bodies: their closed form, and cubic cells under a roughness that is none."""
    for case, (exponent, coefficient) in BODIES.items():

        def reference(nodes, exponent=exponent, coefficient=coefficient):
            return -coefficient * np.abs(np.linspace(-0.5, 0.5, nodes)) ** exponent

        depth = 0.4 * coefficient * 0.25**exponent
        truth = exact(reference, depth, slow.Body(np.empty(0), np.empty(0), 0.02), False, short)
        for roughly, name in ((0.0, "closed form"), (1e-9, "cubic cells")):
            amplitude = roughly * roughness.amplitudes(MODES, 0.7)
            line = RoughLine(
                Waves(0.5 * amplitude * roughness.phase_factors(0, 0, MODES), 2 * MODES),
                PowerLaw(coefficient, exponent),
            )
            for found in ladder(
                line, None, 0.02, truth, (4,) if not roughly else (2, 8) if short else (1, 2, 4, 8, 16, 32)
            ):
                yield Point("indenters", case, name, *found)
