"""Where the time of a film goes on grids for tight accuracies: ``python -m benchmarks.kernel_ehl``.

Processor time of `solve` over the accuracy asked for, and of it the share that fills the deformation matrices; then one
filling, one product and one elimination over the number of nodes. Takes about a quarter of a minute.
"""

from __future__ import annotations

import time

import numpy as np

from mdr_dask.physics import ehl_levels
from mdr_dask.physics.deformation import influence_matrix
from mdr_dask.physics.ehl_newton import nodal_film, solve_linear
from mdr_dask.physics.line_contact import line_contact, solve

E_STAR = 115.385e9
CASES = {
    "checked figure": (2.0452e-5, 1e-11, 5007.0),
    "thinnest film": (5e-4, 1e-13, 8000.0),
    "soft and thin": (5e-4, 1e-13, 500.0),
    "rigid": (2e-6, 1e-9, 500.0),
}


def seconds(function, *arguments):
    function(*arguments)
    begin = time.process_time()
    function(*arguments)
    return time.process_time() - begin


def shares():
    """Print error, nodes, time and share of the kernel over cases and accuracies."""
    spent = [0.0]

    def clocked(*arguments):
        begin = time.process_time()
        matrix = influence_matrix(*arguments)
        spent[0] += time.process_time() - begin
        return matrix

    ehl_levels.influence_matrix = clocked
    print("| case | accuracy asked | estimated error | nodes | time [s] | kernel |\n|---|---|---|---|---|---|")
    for name, numbers in CASES.items():
        case = line_contact(*numbers, E_STAR)
        solve(case)
        for accuracy in (1e-3, 1e-4, 1e-5, 1e-6):
            spent[0], begin = 0.0, time.process_time()
            found = solve(case, accuracy)
            total = time.process_time() - begin
            share = f"{100 * spent[0] / total:.0f} %"
            print(f"| {name} | {accuracy:.0e} | {found.error:.1e} | {found.nodes.size} | {total:.3f} | {share} |")


def parts():
    """Print the time of each part of a Newton step over the number of nodes."""
    print("\n| nodes | filling [ms] | product [ms] | elimination [ms] |\n|---|---|---|---|")
    random = np.random.default_rng(0)
    for count in (161, 321, 641, 1281):
        nodes, film = np.linspace(-4, 1.5, count), np.empty(count)
        matrix = influence_matrix(nodes, nodes)
        pressure = np.sqrt(np.maximum(1 - nodes**2, 0))
        system = random.normal(size=(count, count))
        filling = seconds(influence_matrix, nodes, nodes)
        product = seconds(nodal_film, nodes, matrix, pressure, 1.0, film)
        elimination = seconds(lambda A=system: solve_linear(A.copy(), np.ones(A.shape[0]), A.shape[0]))
        print(f"| {count} | {1e3 * filling:.2f} | {1e3 * product:.3f} | {1e3 * elimination:.1f} |")


if __name__ == "__main__":
    shares()
    parts()
