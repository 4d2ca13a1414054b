"""Error against run time of the film, and a stress suite: ``python -m benchmarks.work_precision_ehl [figure.png]``.

In one run: graded grids with extrapolation (`solve`), the same graded grids without, and uniform grids, each against
a solution on the finest grids. Then some hundred random points of the whole box, each law, flooded and starved.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.measures import draw_errors, print_table, timed
from mdr_dask.physics.lubrication import grids as ehl_grid
from mdr_dask.physics.lubrication import line_contact
from mdr_dask.physics.lubrication.deformation import influence_matrix
from mdr_dask.physics.lubrication.levels import expected_film
from mdr_dask.physics.lubrication.newton import CONVERGED, newton

E_STAR = 115.385e9
CASES = {
    "checked figure": (2.0452e-5, 1e-11, 5007.0),
    "soft": (2e-5, 1e-12, 1000.0),
    "heavy": (2e-4, 1e-11, 5000.0),
}
BOX = ((2e-6, 5e-4), (1e-13, 1e-9), (500.0, 8000.0))
STRESS = 100


def extrapolated(case, accuracy):
    found = line_contact.solve(case, accuracy)
    return found.central_film, found.minimum_film, found.nodes.size


def finest_grid(case, accuracy):
    """The same run, but the films of its finest grid alone."""
    found = line_contact.solve(case, accuracy)
    return found.fine.central, float(found.film.min()), found.nodes.size


def uniform(case, count):
    """Equal spacing from the first guess of the pressure: what the literature's Newton solvers do."""
    guess = 1.5 * expected_film(case.M, case.L)
    start, end = max(ehl_grid.inlet_position(guess), -20 * np.sqrt(2 * guess) - 1), 1.5
    nodes = np.linspace(start, end, count)
    weights = np.full(count, nodes[1] - nodes[0])
    P = np.sqrt(np.maximum(1 - nodes**2, 0))
    matrix = influence_matrix(nodes, nodes)
    status, _, central, film = newton(nodes, matrix, weights, case.liquid, case.film_number, P, guess, 0.12, 1e-8, 200)
    return (central, float(film.min()), count) if status == CONVERGED else (np.nan, np.nan, count)


METHODS = (
    ("graded, extrapolated", extrapolated, (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)),
    ("graded, finest grid", finest_grid, (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)),
    ("uniform", uniform, (201, 401, 801, 1601)),
)


def measure():
    """Return rows of case, method, nodes, error of the central and the minimum film, seconds."""
    rows = []
    for name, numbers in CASES.items():
        case = line_contact.line_contact(*numbers, E_STAR)
        exact = line_contact.solve(case, 1e-6)
        for method, function, settings in METHODS:
            function(case, settings[0])
            for setting in settings:
                (central, minimum, nodes), seconds = timed(function, case, setting)
                if nodes == exact.nodes.size and function is not uniform:
                    continue  # the exact solution itself
                errors = abs(central / exact.central_film - 1), abs(minimum / exact.minimum_film - 1)
                rows.append((name, method, nodes, *errors, seconds))
    return rows


def stress():
    """Solve random points of the box; return rows of what, number, failed, inaccurate, and quantiles of the time."""
    rows = []
    for number, (what, options) in enumerate(
        {
            "barus": {},
            "barus, incompressible": {"compressible": False},
            "roelands": {"viscosity_law": "roelands", "viscosity": 0.08},
            "barus, inlet -1.2 a": {"inlet": -1.2},
        }.items()
    ):
        random = np.random.default_rng(number)
        seconds, failed, missed = [], 0, 0
        for _ in range(STRESS):
            numbers = (float(np.exp(random.uniform(np.log(low), np.log(high)))) for low, high in BOX)
            found, duration = timed(line_contact.solve, line_contact.line_contact(*numbers, E_STAR, **options))
            seconds.append(duration)
            failed += found.status != CONVERGED
            missed += found.status == CONVERGED and found.reason != ""
        rows.append((what, STRESS, failed, missed, *np.quantile(seconds, [0.5, 0.95, 1.0])))
    return rows


def main():
    rows = measure()
    print_table(
        ("case", "method", "nodes", "error h_c", "error h_min", "time [ms]"),
        [(*row[:3], f"{row[3]:.1e}", f"{row[4]:.1e}", f"{1e3 * row[5]:.1f}") for row in rows],
    )
    print()
    print_table(
        ("random points", "cases", "failed", "over 0.1 %", "median [ms]", "95 %", "longest"),
        [(*row[:4], *(f"{1e3 * t:.1f}" for t in row[4:])) for row in stress()],
    )
    if len(sys.argv) > 1:
        draw(rows, sys.argv[1])


def draw(rows, path):
    panels = {case: {} for case in CASES}
    for case, panel in panels.items():
        for method, *_ in METHODS:
            chosen = [row for row in rows if row[0] == case and row[1] == method]
            panel[method] = [row[5] for row in chosen], [max(row[3], row[4]) for row in chosen]
    draw_errors(panels, "relative error of the worse film", path, goal=1e-3)


if __name__ == "__main__":
    main()
