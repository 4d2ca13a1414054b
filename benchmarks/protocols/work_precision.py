"""Error of a protocol against run time: the solver of this package beside fixed steps of backward Euler, in one run.

    python -m benchmarks protocols work_precision [FIGURE]

A line of 100 Nyquist points starts from rest, slides at one speed for 1 tau, and at a speed 20 % higher for another.
Error is the largest difference of the drag at 20 moments from the solver on a finer grid, over the largest drag;
backward Euler passes one cell in a step, as the thesis does, and takes the exact slope of the line.
"""

from __future__ import annotations

import sys

import numpy as np
from numba import njit

from benchmarks.measures import draw_errors, print_table, timed
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients.elements.edges import depth_for
from mdr_dask.physics.transients.elements.follow import follow_line, steady_start
from mdr_dask.physics.transients.elements.foundation import KELVIN, foundation
from mdr_dask.physics.transients.elements.steps import Schedule

POINTS, DEBORAH, CHANGE, LOAD = 100, 0.1, 0.2, 0.3
TIMES = np.concatenate([np.geomspace(0.05, 0.95, 10), 1 + np.geomspace(0.05, 0.95, 10)])
SOLIDS = {
    "Kelvin": KELVIN,
    "standard solid": foundation([3.0], [1.0], 0.0),
    "three arms, dashpot": foundation([3.0, 2.0, 1.0], [0.03, 0.1, 1.0], 0.01),
}


def line(oversampling: int):
    amplitude, phase = roughness.amplitudes(POINTS // 2, 0.7), roughness.phases(2014, 0, POINTS // 2)
    nodes = POINTS * oversampling
    return periodic_line(roughness.line(amplitude, phase, nodes), roughness.line(amplitude, phase, nodes, 1))


def phase_moments(begin: float, speed: float, nodes: int, cells: float) -> np.ndarray:
    """Return moments of one phase of 1 tau, which begin finely and hold those wanted."""
    step = cells / nodes / speed
    grown = step * np.cumsum(np.geomspace(1e-3, 1, 30))
    late = np.arange(grown[-1] + step, 1.0, step)
    moments = np.concatenate([[0.0], grown, late, TIMES - begin, [1.0]])
    return begin + np.unique(moments[(moments >= 0) & (moments <= 1)])


def followed(under, solid, cells: float) -> np.ndarray:
    """Return the drag at `TIMES` by the solver of this package."""
    nodes = under.height.size - 1
    state, depth, _ = steady_start(under, solid, 0.0, LOAD)
    travel, drags = 0.0, []
    for begin, speed in ((0.0, DEBORAH), (1.0, DEBORAH * (1 + CHANGE))):
        moments = phase_moments(begin, speed, nodes, cells)
        one, wanted = np.ones(moments.size), TIMES[(begin < TIMES) & (begin + 1 > TIMES)]
        way = travel + speed * (moments - begin)
        found = follow_line(under, solid, Schedule(moments, way, speed * one, LOAD * one), state, depth)
        drags.append(found.drag[np.searchsorted(moments, wanted)])
        state, depth, travel = found.state, float(found.depth[-1]), float(way[-1])
    return np.concatenate(drags)


@njit
def _euler(height, slope, moduli, times, viscosity, load, deborahs, moments, drags):
    """Take steps of one cell: forces are linear in u_new, and a_new = (a + b u) / (1 + b) with b = dt / tau."""
    n = height.size
    depth, now, travel = 0.0, 0.0, 0
    start = np.maximum(height + depth_for(height, np.zeros(n), load, 0.0)[0], 0.0)
    u, arms = start.copy(), np.empty((n, moduli.size))
    for m in range(moduli.size):
        arms[:, m] = start
    under, grade, free = np.empty(n), np.empty(n), np.empty(n)
    for speed in deborahs:
        step = 1 / (n * speed)
        b = step / times
        stiff = 1 + viscosity / step + (moduli / (1 + b)).sum()
        for _ in range(round(n * speed)):
            travel += 1
            now += step
            mean = load / stiff
            for j in range(n):
                under[j], grade[j] = height[(j + travel) % n], slope[(j + travel) % n]
                pull = viscosity / step * u[j]
                for m in range(moduli.size):
                    pull += moduli[m] * arms[j, m] / (1 + b[m])
                free[j] = pull / stiff
                mean += free[j] / n
            depth = depth_for(under, free, mean, depth)[0]
            drag = 0.0
            for j in range(n):
                u[j] = max(depth + under[j], free[j])
                drag += stiff * (u[j] - free[j]) * grade[j] / n
                for m in range(moduli.size):
                    arms[j, m] = (arms[j, m] + b[m] * u[j]) / (1 + b[m])
            moments[travel - 1], drags[travel - 1] = now, drag
    return travel


def backward_euler(under, solid) -> np.ndarray:
    """Return the drag at `TIMES` by backward Euler in steps of one cell."""
    deborahs = np.array([DEBORAH, DEBORAH * (1 + CHANGE)])
    moments, drags = np.empty((2, under.height.size))
    slope = under.enter * under.enter.size
    count = _euler(under.height[:-1], slope, solid.moduli, solid.times, solid.viscosity, LOAD, deborahs, moments, drags)
    first = moments[:count] <= 1 + 1e-9
    parts = [(first, TIMES < 1), (~first, TIMES > 1)]
    return np.concatenate([np.interp(TIMES[t], moments[:count][rows], drags[:count][rows]) for rows, t in parts])


def measured(solid) -> list[tuple[str, str, float, float]]:
    """Return method, grid, error and seconds of every run."""
    followed(line(2), solid, 1.0), backward_euler(line(2), solid)
    truth = followed(line(40), solid, 0.25)
    rows = []
    for oversampling, cells in ((2, 1.0), (4, 1.0), (4, 0.5), (8, 0.5), (16, 0.5)):
        drag, seconds = timed(followed, line(oversampling), solid, cells, calls=3)
        rows.append(("followed", f"{oversampling}, {cells:g}", np.max(np.abs(drag - truth)) / truth.max(), seconds))
    for oversampling in (4, 16, 64):
        drag, seconds = timed(backward_euler, line(oversampling), solid, calls=3)
        rows.append(("backward Euler", f"{oversampling}, 1", np.max(np.abs(drag - truth)) / truth.max(), seconds))
    return rows


def main() -> None:
    found = {name: measured(solid) for name, solid in SOLIDS.items()}
    print_table(
        ("solid", "method", "oversampling, cells in a step", "error", "seconds"),
        [(name, *row[:2], f"{row[2]:.1e}", f"{row[3]:.3f}") for name, rows in found.items() for row in rows],
    )
    if len(sys.argv) > 1:
        panels = {name: {} for name in found}
        for name, rows in found.items():
            for method in dict.fromkeys(row[0] for row in rows):
                errors, seconds = zip(*(row[2:] for row in rows if row[0] == method), strict=True)
                panels[name][method] = seconds, errors
        draw_errors(panels, "largest error of the drag over the largest drag", sys.argv[1])


if __name__ == "__main__":
    main()
