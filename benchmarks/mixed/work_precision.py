"""Error against run time of the breakthrough probability: ``python -m benchmarks mixed work_precision [figure.png]``.

One realisation of the same waves on ever more points, by splines and as the thesis counts, point by point and window by
window, in one run; the error is that against splines on two million. A realisation's own scatter, far larger, is the
last line.
"""

from __future__ import annotations

import sys

import numba
import numpy as np

from benchmarks.measures import draw_errors, print_table, timed
from mdr_dask.physics.lubrication import breakthrough as bt
from mdr_dask.physics.lubrication.clusters import find_clusters
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.splines import closest
from mdr_dask.physics.surfaces.waves import series

CASES = {"800 N 40 C": (945.4, 1.0431e-6), "800 N 60 C": (945.4, 0.5317e-6), "800 N 80 C": (945.4, 0.3080e-6)}
STRENGTH = float(bt.layer_strength(1e6, 115.385e9, 5e-9))
PERIMETER = 2 * np.pi * 0.05
MILLION = 10**6


def waves_together(realisation):
    """The waves of both rollers together; the shortest is 3.14 um long."""
    amplitude = 0.2e-6 * roughness.amplitudes(100_000, 0.7, longest=748.0)
    factors = roughness.phase_factors(2013, realisation, 200_000).reshape(-1, 2)
    return 0.5 * amplitude * factors.sum(axis=1)


def splines(points, window, level, realisation=0):
    """The probability from splines of the line on so many points, their transform included."""
    waves = waves_together(realisation)
    clusters = find_clusters(closest(waves, points), level, PERIMETER / points, STRENGTH)
    return float(np.mean(bt.contact_lengths(clusters, window * points / MILLION) > 0))


def points_of_windows(points, window, level):
    """The probability as the thesis counts it: window by window, a cluster is a run of points."""
    line = series(waves_together(0), points)
    width = round(window * points / MILLION)
    return _touching(line - level, width, STRENGTH * (PERIMETER / points) ** 2) / points


@numba.njit
def _touching(overlap, width, limit):
    points, found = overlap.size, 0
    for p in range(points):
        n, total, touches = 0, 0.0, False
        for k in range(p, p + width):
            here = overlap[k if k < points else k - points]
            if here > 0:
                n, total = n + 1, total + here
            if n and (here <= 0 or k == p + width - 1):
                touches = touches or total > limit * n**3
                n, total = 0, 0.0
        found += touches
    return found


def measure():
    """Return rows of case, points, method, probability, error, seconds."""
    rows = []
    exact = {case: splines(2 * MILLION, *each) for case, each in CASES.items()}
    for points in (220_000, 250_000, 300_000, 400_000, 500_000, MILLION):
        for case, each in CASES.items():
            for method in (splines, points_of_windows):
                method(points, *each)  # the compiler's time is not counted
                probability, seconds = timed(method, points, *each)
                rows.append((case, points, method.__name__, probability, abs(probability - exact[case]), seconds))
    return rows


def main():
    rows = measure()
    print_table(
        ("case", "points", "method", "P [%]", "error [points]", "time [ms]"),
        [(*row[:3], f"{100 * row[3]:.3f}", f"{100 * row[4]:.3f}", f"{1e3 * row[5]:.2f}") for row in rows],
    )
    scatter = np.std([splines(MILLION // 4, *CASES["800 N 60 C"], r) for r in range(8)], ddof=1)
    print(f"800 N 60 C: one turn scatters by {100 * scatter:.2f} points about the mean")
    if len(sys.argv) > 1:
        draw(rows, sys.argv[1])


def draw(rows, path):
    panels = {case: {} for case in CASES}
    for case, panel in panels.items():
        for method in ("splines", "points_of_windows"):
            chosen = [row for row in rows if row[0] == case and row[2] == method]
            panel[method] = [row[5] for row in chosen], [100 * row[4] for row in chosen]
    draw_errors(panels, "error of the probability [points]", path)


if __name__ == "__main__":
    main()
