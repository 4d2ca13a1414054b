"""Where the time of a film goes on grids for tight accuracies: ``python -m benchmarks.kernel_ehl``.

Processor time of `solve` over the accuracy asked for, and of it the share that fills the deformation kernels; then one
filling, one product and one Newton step over the number of nodes, with the dense matrix and by blocks. Takes about
half a minute, most of it in the dense steps.
"""

from __future__ import annotations

import numpy as np

from benchmarks.measures import print_table, timed
from mdr_dask.physics.lubrication import grids as ehl_grid
from mdr_dask.physics.lubrication import levels as ehl_levels
from mdr_dask.physics.lubrication.blocks import newton_by_blocks
from mdr_dask.physics.lubrication.deformation import influence_matrix
from mdr_dask.physics.lubrication.line_contact import line_contact, solve
from mdr_dask.physics.lubrication.line_kernel import deform, line_kernel
from mdr_dask.physics.lubrication.newton import newton, nodal_film

E_STAR = 115.385e9
CASES = {
    "checked figure": (2.0452e-5, 1e-11, 5007.0),
    "thinnest film": (5e-4, 1e-13, 8000.0),
    "soft and thin": (5e-4, 1e-13, 500.0),
    "rigid": (2e-6, 1e-9, 500.0),
}
#: Nodes of the largest dense matrix.
DENSE = 5121


def shares():
    """Print error, nodes, time and share of the kernel over cases and accuracies."""
    spent = [0.0]

    def clocked(fill):
        def clock(*arguments):
            kernel, seconds = timed(fill, *arguments)
            spent[0] += seconds
            return kernel

        return clock

    ehl_levels.influence_matrix = clocked(influence_matrix)
    ehl_levels.line_kernel = clocked(line_kernel)
    solve(line_contact(*CASES["rigid"], E_STAR), 1e-5)
    rows = []
    for name, numbers in CASES.items():
        for accuracy in (1e-3, 1e-4, 1e-5, 1e-6):
            spent[0] = 0.0
            found, total = timed(solve, line_contact(*numbers, E_STAR), accuracy)
            end = f"{found.order:.2f}", f"{total:.3f}", f"{spent[0] / total:.0%}"
            rows.append((name, f"{accuracy:.0e}", f"{found.error:.1e}", found.nodes.size, *end))
    print_table(("case", "accuracy asked", "estimated error", "nodes", "order", "time [s]", "kernel"), rows)


def parts():
    """Print the time of each part, dense and by blocks, and how far a Newton step of both differs."""
    case = line_contact(*CASES["checked figure"], E_STAR)
    state = solve(case).fine
    density = ehl_grid.adapted_density(state.nodes, state.pressure, state.film, state.central)
    print("\n| nodes | filling [ms] | | product [ms] | | Newton step [ms] | | gain | difference |")
    print("|---|---|---|---|---|---|---|---|---|\n| | dense | blocks | dense | blocks | dense | blocks | | |")
    for count in (161, 321, 641, 1281, 2561, 5121, 10241):
        nodes, film = ehl_grid.sample(state.nodes, density, count), np.empty(count)
        guess = np.interp(nodes, state.nodes, state.pressure)
        guess[[0, -1]] = 0.0
        rest = (case.liquid, case.film_number)
        kernel, block_fill = timed(line_kernel, nodes)
        _, block_product = timed(deform, kernel, guess, film)
        P = guess.copy()
        _, block_step = timed(newton_by_blocks, kernel, *rest, P, state.central, 0.12, 1e-8, 1)
        if count > DENSE:
            print(
                f"| {count} | | {1e3 * block_fill:.0f} | | {1e3 * block_product:.2f} | | {1e3 * block_step:.1f} | | |"
            )
            continue
        matrix, fill = timed(influence_matrix, nodes, nodes)
        _, product = timed(nodal_film, nodes, matrix, guess, state.central, film)
        Q = guess.copy()
        _, step = timed(newton, nodes, matrix, kernel.weights, *rest, Q, state.central, 0.12, 1e-8, 1)
        times = (fill, block_fill, product, block_product, step, block_step)
        line = " | ".join(f"{1e3 * value:.3g}" for value in times)
        print(f"| {count} | {line} | {step / block_step:.1f} | {np.max(np.abs(P - Q)):.0e} |")


if __name__ == "__main__":
    shares()
    parts()
