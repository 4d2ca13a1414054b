"""Error against run time of the breakthrough probability: ``python -m benchmarks mixed work_precision [figure.png]``.

One realisation at a fixed shortest wavelength, on ever finer grids, by sliding sums and window by window in one run;
the error is that against the finest grid. A realisation's own scatter, far larger, is the last line.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.measures import draw_errors, print_table, timed
from mdr_dask.physics.lubrication import breakthrough as bt
from mdr_dask.physics.lubrication.clusters import excursions, find_clusters
from mdr_dask.physics.surfaces import roughness

CASES = {"800 N 40 C": (945, 1.0431e-6), "800 N 60 C": (945, 0.5317e-6), "800 N 80 C": (945, 0.3080e-6)}
STRENGTH = float(bt.layer_strength(1e6, 115.385e9, 5e-9))
PERIMETER = 2 * np.pi * 0.05
MILLION = 10**6


def lines(points, realisation=0):
    amplitude = 0.2e-6 * roughness.amplitudes(100_000, 0.7, longest=748.0)
    phase = roughness.phases(2013, realisation, 200_000).reshape(-1, 2)
    return [roughness.line(amplitude, phase[:, roller], points) for roller in (0, 1)]


def sliding(pair, window, level):
    spacing = PERIMETER / pair[0].size
    clusters = find_clusters(excursions(pair[0] + pair[1], level), level, spacing, STRENGTH)
    return float(np.mean(bt.contact_points(clusters, window) > 0))


def every_window(pair, window, level):
    points = pair[0].size
    positions = (np.arange(points), np.arange(points))
    found = bt.judge_windows(bt.Pair(*pair, level, PERIMETER / points, STRENGTH), window, positions)
    return float(np.mean(found > 0))


def measure():
    """Return rows of case, points, method, probability, error, seconds."""
    finest = lines(8 * MILLION)
    rows = []
    for points in (MILLION // 4, MILLION // 2, MILLION, 2 * MILLION, 4 * MILLION):
        pair = [line[:: 8 * MILLION // points].copy() for line in finest]
        for case, (window, level) in CASES.items():
            exact = sliding(finest, window * 8, level)
            here = round(window * points / MILLION)
            for method in (sliding, every_window) if points <= MILLION else (sliding,):
                method(pair, here, level)  # the compiler's time is not counted
                probability, seconds = timed(method, pair, here, level)
                rows.append((case, points, method.__name__, probability, abs(probability - exact), seconds))
    return rows


def main():
    rows = measure()
    print_table(
        ("case", "points", "method", "P [%]", "error [points]", "time [ms]"),
        [(*row[:3], f"{100 * row[3]:.3f}", f"{100 * row[4]:.3f}", f"{1e3 * row[5]:.2f}") for row in rows],
    )
    for case in CASES:
        times = {row[2]: row[5] for row in rows if row[0] == case and row[1] == MILLION}
        print(
            f"{case}: sliding sums are {times['every_window'] / times['sliding']:.0f} times faster at a million points"
        )
    scatter = np.std([sliding(lines(MILLION, r), *CASES["800 N 60 C"]) for r in range(8)], ddof=1)
    print(f"800 N 60 C: one turn scatters by {100 * scatter:.2f} points about the mean")
    if len(sys.argv) > 1:
        draw(rows, sys.argv[1])


def draw(rows, path):
    panels = {case: {} for case in CASES}
    for case, panel in panels.items():
        for method in ("sliding", "every_window"):
            chosen = [row for row in rows if row[0] == case and row[2] == method]
            panel[method] = [row[5] for row in chosen], [100 * row[4] for row in chosen]
    draw_errors(panels, "error of the probability [points]", path)


if __name__ == "__main__":
    main()
