"""Error of a relaxation against run time: the graded march beside fixed steps from rest, in one run.

    python -m benchmarks kinetics work_precision [FIGURE]

One realisation of the case of Fig. 4.3 at a tenth of its length (500 Nyquist points); error is the largest difference
of mu - mu_2 at 20 moments over mu_2. The truth owes nothing to the march: every element is followed from rest on two
fine grids, and the two results are extrapolated at second order.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numba import njit

from benchmarks.measures import draw_errors, print_table, timed
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients.elements.steps import Schedule
from mdr_dask.physics.transients.velocity_jump import Transient, velocity_jump

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from references.followed_kelvin import follow_kelvin

POINTS, DEBORAH, CHANGE, LOAD, RUN_IN = 500, 0.05, 0.2, 0.3, 10.0
TIMES = np.geomspace(0.01, 3, 20)
FINEST = 16


def line(oversampling: int) -> tuple[np.ndarray, np.ndarray]:
    amplitude = roughness.amplitudes(POINTS // 2, 0.7)
    phase = roughness.phases(2014, 0, POINTS // 2)
    nodes = POINTS * oversampling
    return roughness.line(amplitude, phase, nodes), roughness.line(amplitude, phase, nodes, 1)


def march(oversampling: int, per_decade: float) -> np.ndarray:
    asked = Transient(TIMES, np.pi * POINTS, per_decade)
    found = velocity_jump(periodic_line(*line(oversampling)), LOAD, (DEBORAH, DEBORAH * (1 + CHANGE)), asked)
    return (found.trace - found.after) / found.after


def steps(nodes: int) -> tuple[np.ndarray, int]:
    """Return moments of fixed steps of one cell at v_2, from rest to the last time, and the number before the jump."""
    step = 1 / nodes / (DEBORAH * (1 + CHANGE))
    before, after = int(RUN_IN / step), int(RUN_IN / step)
    return step * np.arange(before + after + 1), before


def followed(oversampling: int) -> np.ndarray:
    """Follow every element, pressed at rest, at v_1 for 10 tau and at v_2 for 10 tau."""
    height, slope = line(oversampling)
    moments, before = steps(height.size)
    jump, deborah = moments[before], DEBORAH * (1 + CHANGE)
    deborahs = np.where(moments <= jump, DEBORAH, deborah)
    travels = np.minimum(moments, jump) * DEBORAH + np.maximum(moments - jump, 0) * deborah
    depth = rest_depth(height)
    pressed = np.maximum(height + depth, 0)
    state = follow_kelvin(
        height, slope, Schedule(moments, travels, deborahs, np.full(moments.size, LOAD)), pressed, depth
    )
    return at_times(moments - jump, state.drag)


def at_times(moments: np.ndarray, drag: np.ndarray) -> np.ndarray:
    return (np.interp(TIMES, moments, drag) - drag[-1]) / drag[-1]


def rest_depth(height: np.ndarray) -> float:
    """Return the depth at which the line at rest carries the load."""
    sinks = np.sort(-height)
    carried = (np.arange(1, sinks.size + 1) * sinks - np.cumsum(sinks)) / sinks.size
    return float(np.interp(LOAD, carried, sinks))


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


def papers(oversampling: int) -> np.ndarray:
    """March from rest at v_1 for 10 tau and at v_2 for 10 tau, with steps of one cell."""
    height, _ = line(oversampling)
    n, deborah = height.size, DEBORAH * (1 + CHANGE)
    before, after = int(RUN_IN * DEBORAH * n), int(RUN_IN * deborah * n)
    ratios = np.repeat([DEBORAH * n, deborah * n], [before, after])
    drag = np.empty(ratios.size)
    backward_euler(height, ratios, rest_depth(height), LOAD, drag)
    return at_times((np.arange(ratios.size) - before + 1) / (deborah * n), drag)


def main() -> None:
    march(2, 12), followed(1), papers(1)
    rows = []
    ladder = {}
    for oversampling in (2, 4, 8, 16, FINEST):
        ladder[oversampling] = timed(followed, oversampling)
    finest, half = ladder[FINEST][0], ladder[FINEST // 2][0]
    truth = (4 * finest - half) / 3
    for arguments in ((2, 8), (4, 8), (4, 12), (8, 24), (16, 48)):
        trace, seconds = timed(march, *arguments, calls=5)
        rows.append(("march", *arguments, np.max(np.abs(trace - truth)), seconds))
    for oversampling in (2, 4, 8, 16):
        trace, seconds = ladder[oversampling]
        rows.append(("every element followed", oversampling, 0, np.max(np.abs(trace - truth)), seconds))
    for oversampling in (1, 4, 16, 32):
        trace, seconds = timed(papers, oversampling)
        rows.append(("backward Euler", oversampling, 0, np.max(np.abs(trace - truth)), seconds))
    print(f"truth: the two finest grids differ by {np.max(np.abs(finest - half)):.1e}")
    print_table(
        ("method", "oversampling", "steps", "error", "seconds"),
        [(*row[:2], row[2] or "cells", f"{row[3]:.2e}", f"{row[4]:.4f}") for row in rows],
    )
    if len(sys.argv) > 1:
        curves = {}
        for method in dict.fromkeys(row[0] for row in rows):
            errors, seconds = zip(*(row[3:] for row in rows if row[0] == method), strict=True)
            curves[method] = seconds, errors
        draw_errors({"": curves}, r"largest error of the trace over $\mu_2$", sys.argv[1])


if __name__ == "__main__":
    main()
