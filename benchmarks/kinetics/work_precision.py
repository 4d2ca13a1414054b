"""Error of a relaxation against run time: the graded march beside fixed steps from rest, in one run.

    python -m benchmarks kinetics work_precision [FIGURE]

One realisation of the case of Fig. 4.3 at a tenth of its length (500 Nyquist points), one under a heavy load, and a
fall of the velocity to a fifth under a light one; error is the largest difference of mu - mu_2 at 20 moments over mu_2.
The truth owes nothing to the march: every element is followed from rest on two fine grids, and the two results are
extrapolated at second order.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numba import njit

from benchmarks.measures import draw_errors, print_table, timed
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import Waves
from mdr_dask.physics.transients.accuracy import JumpProblem, JumpRequest, solve_jumps
from mdr_dask.physics.transients.elements.steps import Schedule
from mdr_dask.physics.transients.velocity_jump import MarchRequest

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from references.followed_kelvin import follow_kelvin

POINTS, RUN_IN = 500, 10.0
TIMES = np.geomspace(0.01, 3, 20)
FINEST = 16
WAVES = Waves(0.5 * roughness.amplitudes(POINTS // 2, 0.7) * roughness.phase_factors(2014, 0, POINTS // 2), POINTS)


class Case(NamedTuple):
    """v tau / L before and after, and F_N / (4 G L h)."""

    before: float
    after: float
    load: float


CASES = {
    "easy: heavy": Case(0.05, 0.06, 3.0),
    "typical: fig. 4.3": Case(0.05, 0.06, 0.3),
    "hard: light, to a fifth": Case(0.1, 0.02, 0.01),
}


def line(oversampling: int) -> tuple[np.ndarray, np.ndarray]:
    amplitude = roughness.amplitudes(POINTS // 2, 0.7)
    phase = roughness.phases(2014, 0, POINTS // 2)
    nodes = POINTS * oversampling
    return roughness.line(amplitude, phase, nodes), roughness.line(amplitude, phase, nodes, 1)


def march(case: Case, oversampling: int, per_decade: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the course of friction and its stated errors."""
    problem = JumpProblem(RoughLine(WAVES), np.array([case.load]), np.array([[case.before, case.after]]))
    asked = MarchRequest(TIMES, np.pi * POINTS, per_decade)
    found = solve_jumps(problem, JumpRequest(1.0, oversampling, asked, True))
    last = found.levels.after
    return ((found.trace[0] - last) / last, found.trace_error[0] / last)


def steps(case: Case, nodes: int) -> tuple[np.ndarray, int]:
    """Return moments from rest on, one cell apart at the faster velocity, and the number before the jump."""
    step = 1 / nodes / max(case.before, case.after)
    number = int(RUN_IN / step)
    return step * np.arange(2 * number + 1), number


def followed(case: Case, oversampling: int) -> np.ndarray:
    """Follow every element, pressed at rest, at v_1 for 10 tau and at v_2 for 10 tau."""
    height, slope = line(oversampling)
    moments, before = steps(case, height.size)
    jump = moments[before]
    deborahs = np.where(moments <= jump, case.before, case.after)
    travels = np.minimum(moments, jump) * case.before + np.maximum(moments - jump, 0) * case.after
    depth = rest_depth(height, case.load)
    pressed = np.maximum(height + depth, 0)
    loads = np.full(moments.size, case.load)
    state = follow_kelvin(height, slope, Schedule(moments, travels, deborahs, loads), pressed, depth)
    return at_times(moments - jump, state.drag)


def at_times(moments: np.ndarray, drag: np.ndarray) -> np.ndarray:
    return (np.interp(TIMES, moments, drag) - drag[-1]) / drag[-1]


def rest_depth(height: np.ndarray, load: float) -> float:
    """Return the depth at which the line at rest carries the load."""
    sinks = np.sort(-height)
    carried = (np.arange(1, sinks.size + 1) * sinks - np.cumsum(sinks)) / sinks.size
    return float(np.interp(load, carried, sinks))


@njit(cache=True)
def backward_euler(height: np.ndarray, ratios: np.ndarray, depth: float, load: float, drag: np.ndarray) -> None:
    """March by the papers' backward Euler: in every step each element moves on by one cell.

    The depth carries the load, sum of max(0, w (1 + r) - r u_old) with r = tau / dt, found by Newton; drag by central
    differences of the height.
    """
    n = height.size
    u, old = np.maximum(height + depth, 0.0), np.empty(n)
    for k in range(drag.size):
        r = ratios[k]
        old[0] = u[n - 1]
        old[1:] = u[: n - 1]
        for _ in range(50):
            carried, touching = 0.0, 0
            for i in range(n):
                force = (depth + height[i]) * (1 + r) - r * old[i]
                if force > 0:
                    carried += force
                    touching += 1
            shift = (load * n - carried) / (touching * (1 + r))
            depth += shift
            if abs(shift) < 1e-13 * abs(depth):
                break
        total = 0.0
        for i in range(n):
            force = (depth + height[i]) * (1 + r) - r * old[i]
            u[i] = depth + height[i] if force > 0 else old[i] * r / (1 + r)
            if force > 0:
                total += force * 0.5 * (height[(i + 1) % n] - height[i - 1])
        drag[k] = total


def papers(case: Case, oversampling: int) -> np.ndarray:
    """March from rest at v_1 for 10 tau and at v_2 for 10 tau, with steps of one cell."""
    height, _ = line(oversampling)
    n = height.size
    before, after = int(RUN_IN * case.before * n), int(RUN_IN * case.after * n)
    ratios = np.repeat([case.before * n, case.after * n], [before, after])
    drag = np.empty(ratios.size)
    backward_euler(height, ratios, rest_depth(height, case.load), case.load, drag)
    return at_times((np.arange(ratios.size) - before + 1) / (case.after * n), drag)


def main() -> None:
    curves = {}
    for name, case in CASES.items():
        march(case, 2, 12), followed(case, 1), papers(case, 1)
        rows, ladder = [], {grid: timed(followed, case, grid) for grid in (2, 4, 8, FINEST)}
        finest, half = ladder[FINEST][0], ladder[FINEST // 2][0]
        truth = (4 * finest - half) / 3
        for arguments in ((2, 8), (4, 8), (4, 12), (8, 24), (16, 48)):
            (trace, _), seconds = timed(march, case, *arguments, calls=5)
            rows.append(("march", *arguments, np.max(np.abs(trace - truth)), seconds))
        for grid, (trace, seconds) in ladder.items():
            rows.append(("every element followed", grid, 0, np.max(np.abs(trace - truth)), seconds))
        for grid in (1, 4, 16, 32):
            trace, seconds = timed(papers, case, grid)
            rows.append(("backward Euler", grid, 0, np.max(np.abs(trace - truth)), seconds))
        print(f"\n{name}; truth: the two finest grids differ by {np.max(np.abs(finest - half)):.1e}")
        print_table(
            ("method", "oversampling", "steps", "error", "seconds"),
            [(*row[:2], row[2] or "cells", f"{row[3]:.2e}", f"{row[4]:.4f}") for row in rows],
        )
        curves[name] = {
            method: tuple(zip(*((row[4], row[3]) for row in rows if row[0] == method), strict=True))
            for method in dict.fromkeys(row[0] for row in rows)
        }
    if len(sys.argv) > 1:
        draw_errors(curves, r"largest error of the trace over $\mu_2$", sys.argv[1])


if __name__ == "__main__":
    main()
