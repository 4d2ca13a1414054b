"""Error against run time of the film, and a stress suite: ``python -m benchmarks ehl work_precision [figure.png]``.

In one run: graded grids with extrapolation (`solve_film`), the same graded grids without, and uniform grids, each
against the solution to 1e-6. Then some hundred random points of the whole box: each law, flooded and
starved.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.measures import draw_errors, print_table, timed
from mdr_dask.physics.lubrication import film_formulas, line_contact
from mdr_dask.physics.lubrication import grids as ehl_grid
from mdr_dask.physics.lubrication.newton import Grid, Pace, newton
from mdr_dask.physics.outcome import Outcome

E_STAR = 115.385e9
CASES = {
    "checked figure": (2.0452e-5, 1e-11, 5007.0),
    "soft": (2e-5, 1e-12, 1000.0),
    "heavy": (2e-4, 1e-11, 5000.0),
}
BOX = ((2e-6, 5e-4), (1e-13, 1e-9), (500.0, 8000.0))
STRESS = 100


def extrapolated(case, accuracy):
    found = line_contact.solve_film(case, accuracy)
    return float(found.central_film.value), float(found.minimum_film.value), found.finest.nodes.size


def finest_grid(case, accuracy):
    """The same run, but the films of its finest grid alone."""
    found = line_contact.solve_film(case, accuracy)
    return found.finest.central_film, found.finest.minimum[1], found.finest.nodes.size


def uniform(case, count):
    """Equal spacing from the first guess of the pressure: what the literature's Newton solvers do."""
    guess = 1.5 * film_formulas.expected_film(case.M, case.L)
    start, end = max(ehl_grid.inlet_position(guess), -20 * np.sqrt(2 * guess) - 1), 1.5
    grid = Grid.of(np.linspace(start, end, count))
    P = np.sqrt(np.maximum(1 - grid.nodes**2, 0))
    found = newton(grid, case.liquid, case.film_number, P, guess, Pace(0.12, 200))
    if found.outcome != Outcome.CONVERGED:
        return np.nan, np.nan, count
    return found.central, float(found.film.min()), count


METHODS = (
    ("graded, extrapolated", extrapolated, (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)),
    ("graded, finest grid", finest_grid, (1e-2, 3e-3, 1e-3, 3e-4, 1e-4)),
    ("uniform", uniform, (201, 401, 801)),
)


def measure():
    """Return rows of case, method, nodes, error of the central and the minimum film, seconds."""
    rows = []
    for name, numbers in CASES.items():
        case = line_contact.line_contact(numbers, E_STAR)
        exact = line_contact.solve_film(case, 1e-6)
        for method, function, settings in METHODS:
            function(case, settings[0])
            for setting in settings:
                (central, minimum, nodes), seconds = timed(function, case, setting)
                errors = abs(central / exact.central_film.value - 1), abs(minimum / exact.minimum_film.value - 1)
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
            found, duration = timed(line_contact.solve_film, line_contact.line_contact(numbers, E_STAR, **options))
            seconds.append(duration)
            failed += found.outcome != Outcome.CONVERGED
            missed += found.error > 1e-3
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
