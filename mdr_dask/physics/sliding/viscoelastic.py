"""Steady sliding of any linear viscoelastic foundation along a rough line or under an indenter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import Solution, refine
from mdr_dask.physics.sliding.viscoelastic_newton import solve_sliding, static_depth
from mdr_dask.physics.sliding.viscoelastic_sweep import Travelling
from mdr_dask.physics.solids import LinearSolid, recovery
from mdr_dask.physics.surfaces.cubic_line import CubicLine

TOLERANCE = 1e-11  # last step of Newton's method relative to the depth; larger than rounding errors
SHORTEST = 1e-9  # cells: Prony terms with a smaller tau v are added to the dashpot, a term with a tenth of this tau v
BALANCE = 1e-3  # largest relative error of the carried load in a converged solution
RESOLVED = 0.5  # a result is extrapolated if its relative change between two grids is at most this
ORDER = 2.0  # order of convergence without extrapolation; extrapolation raises it unless few cells are in contact

DRAG, DEPTH, FRACTION, SLOPE = range(4)


@dataclass(frozen=True)
class ViscoelasticSteady:
    """A steady state; all values are NaN if it did not converge.

    Parameters
    ----------
    values : array, shape (4,)
        The columns of a `Steady`: F_x / (4 G_inf) in the unit of height squared; penetration of the mean line, or of z
        = 0 under an indenter; fraction of the line in contact; rms slope of the part of the line in contact.
    errors : array, shape (4,)
        Estimated absolute discretisation errors of the values.
    status : Outcome
        How the solver ended.
    sweeps : int
        Number of sweeps on the finest line.
    """

    values: FloatArray
    errors: FloatArray
    status: Outcome
    sweeps: int


def steady_viscoelastic_sliding(line: CubicLine, solid: LinearSolid, load: float) -> ViscoelasticSteady:
    """Return the steady state of a foundation of independent elements that slides along a line.

    The force on an element of width dx is f = 4 dx [G_inf u + sum G_m (u - a_m) + eta v u'], where a_m is the strain of
    the dashpot of Prony term m (thesis 3.3.3 for any linear rheology). An element that has travelled the distance s is
    either in contact, with u = w(s) = d + h(s), or free, with f = 0.

    Parameters
    ----------
    line : CubicLine
        The line, of which only the heights at the nodes are used, with straight lines between them. The number of cells
        must be a multiple of four, so that every fourth node describes the same line.
    solid : LinearSolid
        The material. Its relaxation times are in units of L / v: they are the Deborah numbers tau_m v / L.
    load : float
        F_N / (4 G_inf L), in the unit of height.

    Raises
    ------
    ValueError
        If a height or the load is not valid, or if the number of cells is not allowed.

    Notes
    -----
    The sweep of a line with straight cells is exact. The result is extrapolated from the results on all nodes and on
    every second node. Its error is estimated from the difference to the extrapolated result on half as many nodes.
    """
    cells = line.enter.size
    if not np.all(np.isfinite(line.height)):
        raise ValueError("the heights must be finite")
    if cells < 8 or cells % 4:
        raise ValueError(f"a line needs a multiple of four cells and at least eight, got {cells}")
    case = ViscoelasticCase(solid, load)
    top = int(np.argmax(line.height[:cells])) if line.periodic else 0
    height = np.append(np.roll(line.height[:cells], -top), line.height[top]) if line.periodic else line.height

    def solve(level: int, _: IntArray) -> Solution:
        return case.on(height[:: cells // level], line.periodic)

    case.on(height[::4], line.periodic)
    found = refine(solve, 1, (cells // 2, cells), np.inf, ORDER, floors=np.array([0.0, np.std(height), 0.0, 0.0]))
    values = np.concatenate(found.values)
    values[DEPTH] += (line.height[:cells].mean() - height[:-1].mean()) if line.periodic else 0.0
    return ViscoelasticSteady(values, found.errors[:, 0], Outcome(int(found.outcome[0])), case.sweeps)


class ViscoelasticCase:
    """One case, solved on finer and finer lines; each line has twice as many cells as the previous one.

    Parameters
    ----------
    solid, load
        As in :func:`steady_viscoelastic_sliding`.
    """

    def __init__(self, solid: LinearSolid, load: float) -> None:
        if not (np.isfinite(load) and load > 0):
            raise ValueError(f"the load must be positive and finite, got {load!r}")
        self._solid, self._load = solid, load
        self._state: FloatArray | None = (
            None  # stretches of the Prony terms at the first node, then depth of the summit
        )
        self._before: FloatArray | None = None  # results on the previous grid
        self.sweeps = 0

    def on(self, height: FloatArray, periodic: bool) -> Solution:
        """Solve the case on the next finer grid; extrapolate from the previous grid, if there is one.

        Parameters
        ----------
        height : array, shape (nodes,)
            Heights; a periodic line begins at its highest node, which all grids share, and repeats it at the end.
        periodic : bool
            Whether the line is periodic.

        Returns
        -------
        Solution
            The four results of the case.
        """
        cells = height.size - 1
        summit = float(np.max(height))
        below, load = np.ascontiguousarray(height - summit), self._load * cells
        travelling = _travelling(self._solid, 1 / cells)
        outcome, values = Outcome.DEPTH_NOT_FOUND, np.full(4, np.nan)
        for start in (self._state, None) if self._state is not None else (None,):
            outcome, state, values = self._solve(below, load, travelling, periodic, start)
            if outcome != Outcome.DEPTH_NOT_FOUND:
                break
        self._state = state if outcome == Outcome.CONVERGED else None
        mean = float(np.mean(below[:-1])) if periodic else -summit
        values[DEPTH] += mean
        result = values.copy()
        if self._before is not None:
            change = values - self._before
            extrapolated = np.abs(change) <= RESOLVED * np.abs(values)
            result[extrapolated] += change[extrapolated] / 3
            result[FRACTION] = min(max(result[FRACTION], 0.0), 1.0)
        self._before = values
        return Solution(list(result[:, None]), np.array([outcome], np.int8))

    def _solve(
        self, below: FloatArray, load: float, solid: Travelling, periodic: bool, start: FloatArray | None
    ) -> tuple[Outcome, FloatArray, FloatArray]:
        """Solve the case on one grid; return the outcome, the state and the four results.

        The search starts from `start`, the state on the previous grid, or from a static contact if `start` is None. The
        computed depth is the penetration of the summit.
        """
        terms, cells = solid.moduli.size, below.size - 1
        if start is None or start.size != terms + 1:
            inner = below[:-1] if periodic else below
            depth = static_depth(inner, load)
            start = np.append(np.full(terms, depth - load / inner.size), depth)
        unknown, totals = start.copy(), np.empty(6)
        converged, self.sweeps, inside = solve_sliding(below, load, periodic, solid, TOLERANCE, unknown, totals)
        imbalance = abs(float(totals[1]) / load - 1)
        good = converged and imbalance < BALANCE and unknown[-1] > 0
        outcome = Outcome.CONVERGED if good else Outcome.DEPTH_NOT_FOUND
        slope = cells * np.sqrt(totals[4] / totals[3]) if totals[3] > 0 else 0.0
        values = np.array([totals[2], unknown[-1], totals[3] / cells, slope])
        return (outcome if inside else Outcome.OUTSIDE_LINE), unknown, values


def _travelling(solid: LinearSolid, cell: float) -> Travelling:
    """Return a solid with lengths in cells and stresses divided by the static modulus.

    The dashpot, and Prony terms that relax within a very small fraction of a cell, are replaced by one term.
    """
    static = solid.static_modulus
    fast = solid.times < SHORTEST * cell
    moduli, deborah = solid.moduli[~fast] / static, solid.times[~fast] / cell
    viscosity = (solid.viscosity + solid.moduli[fast] @ solid.times[fast]) / static
    if viscosity > 0:
        shortest = SHORTEST / 10
        moduli = np.append(viscosity / cell / shortest, moduli)
        deborah = np.append(shortest, deborah)
    modes = recovery(moduli, deborah)
    return Travelling(moduli, deborah, modes.times, modes.stretch.T.copy(), modes.amplitude.T.copy())
