"""Steady states of a Kelvin solid to a given accuracy: the choice of the grid for each case.

Cases on a plane are solved by `node_to_node` first, which is fastest. Sweeps over cubic cells (`steady`) solve all
cases under an indenter, the cases for which `node_to_node` does not reach the accuracy, and all cases if the accuracy
is below the error of its arithmetic. Both use :func:`mdr_dask.physics.refine.refine`, which estimates the errors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import Refined, Solution, refine
from mdr_dask.physics.sliding import full_contact
from mdr_dask.physics.sliding import steady as sliding
from mdr_dask.physics.sliding.cases import Cases, Scheme, Steady, valid
from mdr_dask.physics.sliding.node_to_node import NodeToNode
from mdr_dask.physics.surfaces.rough_line import RoughLine

FLOORS = (0.0, 1.0, 0.0, 0.0)
"""Floors of drag, depth, contact fraction and contact slope: an error is relative to the floor if the value is smaller.

The floor of the depth is the unit of height, which is the rms height.
"""
ORDER = 3.0  # order of convergence of `node_to_node`: four in cubic cells, lower at contact edges; measured: 3.3
ORDER_OF_CELLS = 2.0  # order of convergence of sweeps over cubic cells if contacts are shorter than a cell
ORDER_OF_STEPS = 1.0  # order of convergence of backward Euler, and of the place of contact edges on straight cells
SEARCH = 0.1  # allowed error due to the search for the depth, as a fraction of the accuracy
NODE_ERROR = 5e-5  # relative error of the arithmetic of `node_to_node` on any grid
NODE_LEVELS = tuple(2**k for k in range(12))  # nodes per Nyquist point; above 2 only where contact begins or ends
CELL_LEVELS = tuple(2**k for k in range(1, 7))
REFERENCE = 0.01  # relative accuracy of the solution with which results of time steps are compared


@dataclass(frozen=True)
class KelvinCases:
    """Cases of a Kelvin solid on one line.

    Parameters
    ----------
    line : RoughLine
        The line.
    scheme : {"hermite", "piecewise_linear", "backward_euler"}
        Cubic cells, straight cells, or the time steps of the papers.
    deborah, loads : array, shape (cases,)
        v tau / L and F_N / (4 G L), in the unit of height.
    contact : bool
        Whether contact fraction and contact slope are requested. Only with time steps do they take extra time.
    """

    line: RoughLine
    scheme: Scheme
    deborah: FloatArray
    loads: FloatArray
    contact: bool = True

    def only(self, cases: NDArray[Any]) -> KelvinCases:
        """Return the selected cases."""
        return replace(self, deborah=self.deborah[cases], loads=self.loads[cases])

    def on_grid(self, oversampling: int) -> Steady:
        """Solve the cases on a grid with the given number of nodes per Nyquist point, without estimated errors."""
        return self._on_grid(oversampling, None)

    def _on_grid(self, oversampling: int, depths: FloatArray | None) -> Steady:
        """Solve the cases on a grid; the search starts from the given depths, which come from another grid."""
        nodes = self.line.points * oversampling
        if self.scheme == "hermite":
            return sliding.steady_sliding(self.line.cubic(nodes), self.deborah, self.loads, depths)
        line = self.line.straight(nodes)
        if self.scheme == "backward_euler":
            return sliding.stepped_sliding(line, self.deborah, self.loads, self.contact)
        return sliding.steady_sliding(line, self.deborah, self.loads, depths)

    def with_errors(self, oversampling: int) -> tuple[Steady, FloatArray]:
        """Solve the cases on a grid and estimate their errors.

        For cubic and straight cells, the errors are estimated by a second solution on cells of twice the length.
        Results of time steps, and results on the coarsest grid, are compared with the default scheme at an accuracy of
        1 %, because time steps converge too slowly for an estimate from two grids.

        Returns
        -------
        Steady
        array, shape (4, cases)
            Estimated absolute errors of `Steady.columns`.
        """
        if self.scheme != "backward_euler" and oversampling > 1:
            found = self._swept((oversampling // 2, oversampling), np.inf)
            return Steady.of(np.array(found.values), found.outcome), found.errors
        steady = self.on_grid(oversampling)
        exact, errors = replace(self, scheme="hermite").to_accuracy(REFERENCE)
        errors = np.abs(steady.columns - exact.columns) + errors
        return steady, np.where(np.isnan(errors), np.inf, errors)

    def to_accuracy(self, accuracy: float) -> tuple[Steady, FloatArray]:
        """Solve every case on the coarsest grid that meets a relative accuracy.

        All results of a case have to meet the accuracy, because the drag (or another single result) may agree on two
        grids by chance. The error of a depth that is smaller than the rms height is relative to the rms height.

        Returns
        -------
        Steady, array
            As in `with_errors`. A case that misses the accuracy on the finest grid keeps its results and errors.
        """
        cases = self.loads.size
        columns, errors = np.full((4, cases), np.nan), np.full((4, cases), np.inf)
        status = np.full(cases, Outcome.INVALID, np.int8)
        left = np.arange(cases)
        on_plane = self.scheme == "hermite" and self.line.body is None
        if on_plane:
            nodes = nodes_of(self.line)
            steady = full_contact.steady_full_contact(self.line.roughness, (), nodes, self.deborah, self.loads)
            if steady is not None:
                columns, status = steady.columns, steady.status
                errors = full_contact.ROUNDING * np.abs(columns)
            left = np.flatnonzero((status != Outcome.CONVERGED) & valid(self.deborah, self.loads))
        levels = CELL_LEVELS if self.scheme == "hermite" else (1, *CELL_LEVELS)
        if on_plane and left.size and accuracy > 2 * NODE_ERROR:
            search = NodeToNode(*nodes, Cases(self.deborah[left], self.loads[left]), SEARCH * accuracy)
            allowed = accuracy - NODE_ERROR
            found = refine(search.solve, left.size, NODE_LEVELS, allowed, ORDER, floors=FLOORS)
            _write((columns, errors, status), left, found, NODE_ERROR)
            left = left[~found.met]
        if left.size:
            found = self.only(left)._swept(levels, accuracy)
            _write((columns, errors, status), left, found, 0.0)
        return Steady.of(columns, status), errors

    def _swept(self, levels: tuple[int, ...], accuracy: float) -> Refined:
        """Solve the cases by sweeps over whole lines; a search starts from the depth on the previous grid."""
        depths = np.full(self.loads.size, np.nan)

        def solve(level: int, cases: IntArray) -> Solution:
            found = self.only(cases)._on_grid(level, depths[cases])
            depths[cases] = found.depth
            return Solution(found.columns, found.status)

        # with one node per Nyquist point, cubic cells do not converge at their order
        order = ORDER_OF_CELLS if self.scheme == "hermite" and levels[0] > 1 else ORDER_OF_STEPS
        return refine(solve, self.loads.size, levels, accuracy, order, floors=FLOORS)


def _write(
    results: tuple[FloatArray, FloatArray, NDArray[np.int8]], cases: IntArray, found: Refined, least: float
) -> None:
    """Replace the results of the given cases by refined results, unless the errors of the old results are smaller."""
    columns, errors, status = results
    values = np.array(found.values)
    known = found.errors + least * np.maximum(np.abs(values), np.array(FLOORS)[:, None])
    known[np.isnan(known)] = np.inf
    better = (status[cases] != Outcome.CONVERGED) | (known[0] < errors[0, cases])
    some = cases[better]
    columns[:, some], errors[:, some], status[some] = values[:, better], known[:, better], found.outcome[better]


def nodes_of(line: RoughLine) -> tuple[FloatArray, FloatArray]:
    """Return heights and slopes at two nodes per Nyquist point, as `full_contact` and `NodeToNode` need them."""
    nodes = full_contact.OVERSAMPLING * line.points
    return line.heights(nodes), line.slopes(nodes)
