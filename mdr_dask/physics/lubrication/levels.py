"""Solutions of a lubricated line contact on a first grid, on finer ones, and what their films tend to.

Hertz units, see :mod:`mdr_dask.physics.lubrication.line_contact`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.lubrication import grids as ehl_grid
from mdr_dask.physics.lubrication.blocks import film_of, newton_by_blocks
from mdr_dask.physics.lubrication.deformation import influence_matrix
from mdr_dask.physics.lubrication.film_formulas import limiting_films
from mdr_dask.physics.lubrication.line_kernel import line_kernel
from mdr_dask.physics.lubrication.newton import CONVERGED, TOO_MANY_STEPS, newton, nodal_film

if TYPE_CHECKING:
    from mdr_dask.physics.lubrication.line_contact import LineContact

_Films = Callable[[FloatArray, float, FloatArray], None]
_Iterate = Callable[[FloatArray, float, float, float, int], tuple[int, int, float, FloatArray]]

#: Least ratio of successive changes that an error estimate believes in.
_SLOWEST = 1.2
#: Ways to the first solution, in this order: factor on the expected film, its upper limit over the square of the
#: inlet's distance (starvation), greatest change of pressure, nodes.
_ATTEMPTS = (
    (1.5, 0.2, 0.12, 121),
    (2.5, 0.4, 0.12, 121),
    (1.5, 0.1, 0.04, 121),
    (4.0, 0.2, 0.05, 121),
    (1.5, 0.2, 0.05, 361),
)
#: Ways from one grid to another: greatest change of pressure in a step, greatest number of steps.
PACES = ((0.12, 30), (0.05, 80), (0.02, 250))
#: Numbers of nodes: of the grids that are placed by a solution, and of those whose films are compared.
ADAPTED_NODES = 121
NODES = (41, 81, 161, 321, 641, 1281, 2561, 5121, 10241)
#: From this number of nodes on the Newton equations are solved by blocks, below it by dense elimination.
BLOCK_NODES = 600
#: Rounds of placing the nodes by the solution before the grids are compared.
_ADAPTATIONS = 2
_TOLERANCE = 1e-8
_FIRST_STEPS = 80


class GridSolution(NamedTuple):
    """Pressure (in p0) and film (in ``a^2/R``) at the nodes of one grid, the film at ``X = 0``, and the steps taken."""

    nodes: FloatArray
    pressure: FloatArray
    film: FloatArray
    central: float
    steps: int


class Levels(NamedTuple):
    """What the nested grids of one case gave.

    Parameters
    ----------
    status : int
        CONVERGED, or what stopped the iteration on the grid `fine`.
    source : GridSolution
        The solution that placed the nodes.
    counts : tuple of int
        Nodes of the grids compared, from the coarsest.
    films : array, shape (k, 2)
        Central and minimum film in ``a^2/R`` on each of them.
    fine, coarse : GridSolution
        On the finest of them and on the one before.
    limit : array, shape (2,)
        The two films that the grids tend to.
    error : float
        Estimated relative error of the worse one.
    steps : int
        Newton steps on all grids together.
    """

    status: int
    source: GridSolution
    counts: tuple[int, ...]
    films: FloatArray
    fine: GridSolution
    coarse: GridSolution
    limit: FloatArray
    error: float
    steps: int


def expected_film(M: float, L: float) -> float:
    """Return the film in ``a^2/R`` that the four limiting regimes let expect; good for a first guess."""
    rigid_iso, rigid_piezo, elastic_iso, elastic_piezo = limiting_films(M, 0.5, L) * np.pi / (8 * M)
    return float(max(min(rigid_piezo, elastic_piezo), max(rigid_iso, elastic_iso)))


def solve_on(
    case: LineContact, nodes: FloatArray, pressure: FloatArray, central: float, paces: tuple[tuple[float, int], ...]
) -> tuple[int, GridSolution]:
    """Solve on one grid from a guess of the pressure at its nodes, at the first pace that converges."""
    films, iterate = _by_blocks(case, nodes) if nodes.size >= BLOCK_NODES else _by_elimination(case, nodes)
    gap = np.empty_like(nodes)
    status, total, state = TOO_MANY_STEPS, 0, GridSolution(nodes, pressure, pressure, central, 0)
    for clip, most in paces:
        trial = pressure.copy()
        trial[0] = trial[-1] = 0.0
        # a guess that leaves no film has no Newton step
        films(trial, central, gap)
        lift = max(0.0, 0.1 * central - float(gap.min()))
        status, steps, found, film = iterate(trial, central + lift, clip, _TOLERANCE, most)
        total += steps
        state = GridSolution(nodes, trial, film, found, total)
        if status == CONVERGED:
            break
    return status, state


def _by_elimination(case: LineContact, nodes: FloatArray) -> tuple[_Films, _Iterate]:
    """Return what fills the films at the nodes, and the Newton iteration, with a dense matrix."""
    width = np.diff(nodes)
    weights = np.zeros_like(nodes)
    weights[:-1] += width / 2
    weights[1:] += width / 2
    matrix = influence_matrix(nodes, nodes)
    return partial(nodal_film, nodes, matrix), partial(newton, nodes, matrix, weights, case.liquid, case.film_number)


def _by_blocks(case: LineContact, nodes: FloatArray) -> tuple[_Films, _Iterate]:
    """Return what fills the films at the nodes, and the Newton iteration, in blocks of low rank."""
    kernel = line_kernel(nodes)
    return partial(film_of, kernel), partial(newton_by_blocks, kernel, case.liquid, case.film_number)


def _first_pressure(nodes: FloatArray, central: float) -> FloatArray:
    """Return half an ellipse: Hertz' pressure, or a wider and flatter one upstream for a thick film."""
    reach = float(np.sqrt(2 * central))
    width, centre = (1.0, 0.0) if reach < 1 else (max(1.0, 0.8 * reach), -0.4 * reach)
    return np.sqrt(np.maximum(1 - ((nodes - centre) / width) ** 2, 0.0)) / width


def first_solution(case: LineContact) -> tuple[int, GridSolution]:
    """Return the solution on a first grid, by the first of the known ways that leads there."""
    for factor, starved, clip, count in _ATTEMPTS:
        guess = factor * expected_film(case.M, case.L)
        inlet = ehl_grid.inlet_position(guess) if case.inlet is None else case.inlet
        guess = min(guess, starved * inlet**2)
        nodes = ehl_grid.first_grid(guess, inlet, count)
        status, state = solve_on(case, nodes, _first_pressure(nodes, guess), guess, ((clip, _FIRST_STEPS),))
        if status == CONVERGED:
            break
    return status, state


def refine(case: LineContact, state: GridSolution, source: GridSolution, count: int) -> tuple[int, GridSolution]:
    """Solve on `count` nodes placed as the solution `source` asks for, starting from `state`."""
    density = ehl_grid.adapted_density(source.nodes, source.pressure, source.film, source.central)
    nodes = ehl_grid.sample(source.nodes, density, count)
    guess = np.interp(nodes, state.nodes, state.pressure)
    return solve_on(case, nodes, guess, state.central, PACES)


def minimum(state: GridSolution) -> tuple[float, float]:
    """Return position and height of the lowest film: the vertex of the parabola through the lowest three nodes."""
    i = int(np.clip(np.argmin(state.film), 1, state.film.size - 2))
    x, h = state.nodes[i - 1 : i + 2], state.film[i - 1 : i + 2]
    left, right = (h[1] - h[0]) / (x[1] - x[0]), (h[2] - h[1]) / (x[2] - x[1])
    curvature = (right - left) / (x[2] - x[0])
    if not curvature > 0:
        return float(x[1]), float(h[1])
    slope = left + curvature * (x[1] - x[0])
    offset = -slope / (2 * curvature)
    return float(x[1] + offset), float(h[1] + 0.5 * slope * offset)


def extrapolate(values: FloatArray) -> tuple[float, float]:
    """Return the limit of values on grids of halved spacing, to second order, and its estimated error.

    Parameters
    ----------
    values : array, shape (k,)
        From the coarsest grid to the finest, at least three.

    Returns
    -------
    limit, error : float
        Richardson's limit from the last two grids; its change against the limit from the two grids before, more where
        the values change slower than to first order (a spike at the very place), and never below a fiftieth of the
        correction to the finest value.
    """
    coarse, middle, fine = (float(value) for value in values[-3:])
    limit, earlier = (4 * fine - middle) / 3, (4 * middle - coarse) / 3
    change = abs(fine - middle)
    ratio = max(_SLOWEST, abs(middle - coarse) / change) if change > 0 else np.inf
    return limit, max(abs(limit - earlier) * max(1.0, 1 / (ratio - 1)), abs(limit - fine) / 50)


def solve_levels(case: LineContact, accuracy: float) -> Levels:
    """Solve a case from a guess of its own on nested grids, until the estimate of the error meets the accuracy."""
    status, state = first_solution(case)
    steps, films = state.steps, np.empty((0, 2))
    counts: list[int] = []
    limit, error, failure = np.full(2, np.nan), np.inf, (status, state)
    for _ in range(_ADAPTATIONS if status == CONVERGED else 0):
        status, adapted = refine(case, state, state, ADAPTED_NODES)
        steps += adapted.steps
        if status == CONVERGED:
            state = adapted
    source = coarser = state
    for count in NODES if failure[0] == CONVERGED else ():
        status, finer = refine(case, state, source, count)
        steps += finer.steps
        if status != CONVERGED:
            failure = status, finer
            if counts:
                break
            continue  # too coarse for this film
        coarser, state = state, finer
        counts.append(count)
        films = np.vstack([films, (state.central, minimum(state)[1])])
        if len(counts) > 2:
            limits = np.array([extrapolate(column) for column in films.T])
            limit, error = limits[:, 0], float(np.max(limits[:, 1] / limits[:, 0]))
            if error <= accuracy:
                break
    if not np.isfinite(error):
        status, state = failure if failure[0] != CONVERGED else (TOO_MANY_STEPS, state)
        return Levels(status, source, tuple(counts), films, state, coarser, limit, error, steps)
    return Levels(CONVERGED, source, tuple(counts), films, state, coarser, limit, error, steps)
