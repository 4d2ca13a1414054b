"""Sweeps with and without neighbours: ``python -m benchmarks.sweep_ehl``.

Processor time of both in one run, the lattice emptied before each sweep, and the true errors of a part of the points
against solutions on finer grids. Takes about two minutes.
"""

from __future__ import annotations

import numpy as np

from benchmarks.measures import timed
from mdr_dask.physics.lubrication import lattice as ehl_lattice
from mdr_dask.physics.lubrication.lattice import solve_beside_lattice
from mdr_dask.physics.lubrication.line_contact import line_contact, solve

E_STAR = 115.385e9
ROELANDS = {"viscosity_law": "roelands", "viscosity": 0.08}
CHECKED_POINTS = 25


def sweeps():
    for count in (50, 100, 400):
        speeds, loads = np.geomspace(1e-13, 1e-9, count), np.geomspace(2e-6, 5e-4, count)
        yield "speed, Barus", [line_contact(2e-5, U, 5000.0, E_STAR) for U in speeds]
        yield "speed, Roelands", [line_contact(2e-5, U, 5000.0, E_STAR, **ROELANDS) for U in speeds]
        yield "load, Barus", [line_contact(W, 1e-11, 5000.0, E_STAR) for W in loads]
    yield "material parameter", [line_contact(1e-4, 1e-11, G, E_STAR) for G in np.geomspace(500, 8000, 100)]
    speeds, loads = np.geomspace(1e-13, 1e-9, 20), np.geomspace(2e-6, 5e-4, 20)
    yield "load and speed, 20 x 20", [line_contact(W, U, 5000.0, E_STAR) for W in loads for U in speeds]


def solved(solver, cases):
    return [solver(case) for case in cases]


def true_errors(cases, found):
    """Return the error of every few points, and the share that lies within the estimates."""
    errors, within = [], 0
    chosen = np.linspace(0, len(cases) - 1, CHECKED_POINTS).astype(int)
    for index in chosen:
        exact, film = solve(cases[index], 2e-5), found[index]
        error = max(abs(film.central_film / exact.central_film - 1), abs(film.minimum_film / exact.minimum_film - 1))
        errors.append(error)
        within += error <= film.error + exact.error
    return max(errors), within / chosen.size


def main():
    solve_beside_lattice(line_contact(2e-5, 1e-11, 5000.0, E_STAR))
    print("| sweep | points | lattice | alone [s] | with neighbours [s] | gain | largest error | within the estimate |")
    print("|---|---|---|---|---|---|---|---|")
    for name, cases in sweeps():
        points = len({ehl_lattice.lattice_point(case) for case in cases})
        ehl_lattice._levels.cache_clear()
        _, alone = timed(solved, solve, cases)
        found, beside = timed(solved, solve_beside_lattice, cases)
        worst, within = true_errors(cases, found)
        print(
            f"| {name} | {len(cases)} | {points} | {alone:.2f} | {beside:.2f} | {alone / beside:.2f} "
            f"| {worst:.1e} | {100 * within:.0f} % |",
            flush=True,
        )


if __name__ == "__main__":
    main()
