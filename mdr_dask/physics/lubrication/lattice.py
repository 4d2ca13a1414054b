"""Sweeps of lubricated line contacts beside the points of a fixed lattice, which lend them grids and fine solutions.

What costs time is the finest grids, and what they tell is nearly the same for neighbours: how far the films of the
coarser grids are off. So a case is solved on two coarse grids only, placed by a solution that starts from the lattice
point's, and corrected by the factor by which the lattice point's fine grids changed its own coarse ones. A lattice
point depends on nothing but the case, so a value does not depend on which cases are solved beside it.
"""

from __future__ import annotations

from functools import lru_cache
from math import log10, sqrt
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.lubrication import grids as ehl_grid
from mdr_dask.physics.lubrication.levels import (
    ADAPTED_NODES,
    PACES,
    GridSolution,
    Levels,
    expected_film,
    minimum,
    refine,
    solve_levels,
    solve_on,
)
from mdr_dask.physics.lubrication.line_contact import LineContact, LineSolution, solution, solve
from mdr_dask.physics.lubrication.newton import CONVERGED
from mdr_dask.physics.lubrication.oil import DENSITY_RISE, DENSITY_SATURATION, ROELANDS_PRESSURE

#: Lattice points in a decade of load, speed or material parameter, and of what matters less: pressure and exponent.
_PER_DECADE = 3
_PRESSURES_PER_DECADE = 2
_EXPONENTS_PER_DECADE = 8
#: The error of a lattice point, over the accuracy asked for.
_SHARE = 0.6
#: The error of a corrected film is this many times the correction, or a part of what the coarse grids extrapolate by.
_CORRECTIONS = 2.0
_PART_OF_EXTRAPOLATION = 1 / 10
#: Neighbours whose grids differ alike: by this share of the difference, and this share of the accuracy.
_ALIKE = 0.5
_ALIKE_ACCURACY = 0.25


def _rounded(value: float, per_decade: float) -> float:
    return 10 ** (round(log10(value) * per_decade) / per_decade) if value > 0 else 0.0


def lattice_point(case: LineContact) -> LineContact:
    """Return the point of the lattice that lends its solution to a case.

    Its axes are L, which goes with the speed alone, and ``M L^2``, which goes with the load alone at a given material
    parameter, so that a sweep of one of them runs along the lattice; the inlet is that of the case.
    """
    L = _rounded(case.L, 4 * _PER_DECADE)
    M = _rounded(case.M * case.L**2, _PER_DECADE) / L**2 if L > 0 else _rounded(case.M, _PER_DECADE)
    load, lattice_load = (case.M * case.L**2, M * L**2) if L > 0 else (case.M, M)
    point = case._replace(M=M, L=L)
    if case.density_rise > 0 or case.pole > 0:
        p0 = case.density_rise / DENSITY_RISE if case.density_rise > 0 else ROELANDS_PRESSURE / case.pole
        p0 = _rounded(p0 / sqrt(load), _PRESSURES_PER_DECADE) * sqrt(lattice_load)
        if case.density_rise > 0:
            point = point._replace(density_rise=DENSITY_RISE * p0, density_saturation=DENSITY_SATURATION * p0)
        if case.pole > 0:
            exponent = _rounded(case.exponent, _EXPONENTS_PER_DECADE)
            point = point._replace(pole=ROELANDS_PRESSURE / p0, exponent=exponent)
    return point


class _Loan(NamedTuple):
    """The pair of coarse grids that does for a neighbour, the factors on its films, and the error that remains."""

    level: int
    factors: FloatArray
    error: float


@lru_cache(maxsize=512)
def _levels(point: LineContact, accuracy: float) -> Levels:
    return solve_levels(point, accuracy)


def _loan(levels: Levels, accuracy: float) -> _Loan | None:
    """Return what a lattice point lends, by the coarsest pair of grids that keeps the accuracy; None if none does."""
    for level in range(1, len(levels.counts)):
        limit = _extrapolated(levels.films[level - 1 : level + 1])
        factors = levels.limit / limit
        correction = _CORRECTIONS * float(np.max(np.abs(factors - 1)))
        extrapolation = _PART_OF_EXTRAPOLATION * float(np.max(np.abs(levels.films[level] / limit - 1)))
        error = max(correction, extrapolation) + levels.error
        if error <= accuracy:
            return _Loan(level, factors, error)
    return None


def _extrapolated(films: FloatArray) -> FloatArray:
    return np.asarray((4 * films[1] - films[0]) / 3)


def _placed(case: LineContact, point: LineContact, lent: GridSolution) -> tuple[int, GridSolution]:
    """Return the solution that places the nodes of a case, from the lattice point's, scaled by the expected films."""
    ratio = expected_film(case.M, case.L) / expected_film(point.M, point.L)
    central = lent.central * ratio
    stretch = max(1.0, sqrt(2 * central)) / max(1.0, sqrt(2 * lent.central))
    nodes, pressure = lent.nodes * stretch, lent.pressure / stretch
    if case.inlet is not None:
        nodes = np.concatenate([[case.inlet], nodes[nodes > case.inlet]])
        pressure = pressure[-nodes.size :]
    density = ehl_grid.adapted_density(nodes, pressure, lent.film[-nodes.size :] * ratio, central)
    placed = ehl_grid.sample(nodes, density, ADAPTED_NODES)
    return solve_on(case, placed, np.interp(placed, nodes, pressure), central, PACES[:1])


def solve_beside_lattice(case: LineContact, accuracy: float = 1e-3) -> LineSolution:
    """Return the film and pressure of a line contact with the help of the lattice point next to it.

    Parameters
    ----------
    case : LineContact
        The case.
    accuracy : float
        Relative error allowed for the central and the minimum film.

    Returns
    -------
    LineSolution
        As of `line_contact.solve`, within the accuracy, on coarser grids; the very result of
        it where the lattice point is no help (no solution there, or grids that differ otherwise).
    """
    point = lattice_point(case)
    lent = _levels(point, _SHARE * accuracy)
    loan = _loan(lent, accuracy) if lent.status == CONVERGED else None
    own = None if loan is None else _borrowed(case, point, lent, loan, accuracy)
    return solve(case, accuracy) if own is None else solution(case, own, accuracy)


def _borrowed(case: LineContact, point: LineContact, lent: Levels, loan: _Loan, accuracy: float) -> Levels | None:
    """Return the corrected levels of a case, None if the lattice point is not like it."""
    status, source = _placed(case, point, lent.source)
    states, steps = [source], source.steps
    for count in lent.counts[loan.level - 1 : loan.level + 1]:
        if status != CONVERGED:
            return None
        status, state = refine(case, states[-1], source, count)
        states.append(state)
        steps += state.steps
    if status != CONVERGED:
        return None
    films = np.array([(state.central, minimum(state)[1]) for state in states[1:]])
    change, lent_change = films[1] / films[0] - 1, lent.films[loan.level] / lent.films[loan.level - 1] - 1
    if np.any(np.abs(change - lent_change) > _ALIKE * np.abs(lent_change) + _ALIKE_ACCURACY * accuracy):
        return None
    counts = lent.counts[loan.level - 1 : loan.level + 1]
    limit = loan.factors * _extrapolated(films)
    return Levels(CONVERGED, source, counts, films, states[2], states[1], limit, loan.error, steps)
