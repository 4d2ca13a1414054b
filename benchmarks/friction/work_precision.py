"""Error against kernel time of steady friction: ``python -m benchmarks friction work_precision [FIGURE.png]``.

Easy, typical and hard cases on ten lines each, every scheme on finer and finer grids; the reference is the cubic sweep
at oversampling 128. Time is that of the solution alone, per case, in processor time of this process.
"""

import sys

import numpy as np

from benchmarks.measures import draw_errors, print_table, timed
from mdr_dask.physics.sliding import steady as sliding
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line

SCHEMES = {"backward_euler": "thesis: backward Euler", "piecewise_linear": "straight cells", "hermite": "cubic cells"}
#: name: (Hurst exponent, force number F_N / (G h L), v tau slope / h)
CASES = {
    "easy: full contact": (0.7, 30.0, 1.0),
    "typical: transition": (0.7, 1.0, 1.0),
    "hard: rough, low load": (0.3, 0.01, 1.0),
}
GRIDS = (1, 2, 4, 8, 16, 32)
LINES, POINTS, REPEATS = 10, 1000, 3


def by_scheme(height, slope, deborah, load, scheme):
    solve = sliding.stepped_sliding if scheme == "backward_euler" else sliding.steady_sliding
    return solve(periodic_line(height, slope if scheme == "hermite" else None), deborah, load)


def measure(hurst, force, velocity):
    """Return {scheme: [(oversampling, rms relative error, seconds a case)]}."""
    amplitude = roughness.amplitudes(POINTS // 2, hurst)
    deborah = np.array([velocity / roughness.spectral_slope(amplitude)])
    load = np.array([force / 4])

    def solve(realisation, grid, scheme):
        phase = roughness.phases(0, realisation, POINTS // 2)
        height, slope = (roughness.line(amplitude, phase, POINTS * grid, order) for order in (0, 1))
        found, seconds = timed(by_scheme, height, slope, deborah, load, scheme, calls=REPEATS)
        return found.drag[0], seconds

    exact = np.array([solve(line, 128, "hermite")[0] for line in range(LINES)])
    table = {}
    for scheme in SCHEMES:
        solve(0, 1, scheme)
        rows = []
        for grid in GRIDS:
            drags, times = np.array([solve(line, grid, scheme) for line in range(LINES)]).T
            rows.append((grid, float(np.sqrt(np.mean((drags / exact - 1) ** 2))), float(np.mean(times))))
        table[scheme] = rows
    return table


def main(path=None):
    tables = {case: measure(*numbers) for case, numbers in CASES.items()}
    for case, table in tables.items():
        print(case)
        print_table(
            ("scheme", "oversampling", "rms error of μ", "µs a case"),
            [
                (SCHEMES[scheme], grid, f"{error:.1e}", f"{seconds * 1e6:.0f}")
                for scheme, rows in table.items()
                for grid, error, seconds in rows
            ],
        )
    if path:
        panels = {case: {} for case in tables}
        for case, table in tables.items():
            for scheme, rows in table.items():
                _, errors, seconds = zip(*rows, strict=True)
                panels[case][SCHEMES[scheme]] = seconds, errors
        draw_errors(panels, "rms relative error of μ", path)


if __name__ == "__main__":
    main(*sys.argv[1:])
