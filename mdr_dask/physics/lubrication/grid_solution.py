"""The film of a line contact on one grid, and quantities interpolated between the nodes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.lubrication.deformation import film as film_at
from mdr_dask.physics.lubrication.grids import adapted_density

_SPIKE = 0.01  # least height of a spike above the pressure minimum upstream, divided by the maximum pressure


@dataclass(frozen=True)
class GridSolution:
    """Pressure in units of p0, and film in units of ``a^2/R``, at the nodes of one grid.

    `central` is the film at ``X = 0``. `spacing` is the distance between two neighbouring nodes times the density of
    nodes between them. This product is the same everywhere on the grid. It is NaN if the grid does not come from
    `grids.aligned`. The film under a piecewise linear pressure is slightly too thin between the nodes.
    :meth:`film_between` therefore interpolates the films at the nodes.
    """

    nodes: FloatArray
    pressure: FloatArray
    film: FloatArray
    central: float
    spacing: float = np.nan

    def film_between(self, positions: FloatArray) -> FloatArray:
        """Return the film in units of ``a^2/R`` at positions in half widths, or NaN upstream of the first node."""
        film = _between(self.nodes, self.film, positions, 2)
        behind = positions > self.nodes[-1]
        film[behind] = film_at(positions[behind], self.nodes, self.pressure, self.central)
        return np.where(positions < self.nodes[0], np.nan, film)

    def pressure_between(self, positions: FloatArray) -> FloatArray:
        """Return the pressure in units of p0 at positions in half widths, or zero outside the grid."""
        inside = (positions > self.nodes[0]) & (positions < self.nodes[-1])
        return np.where(inside, np.maximum(_between(self.nodes, self.pressure, positions, 2), 0.0), 0.0)

    @cached_property
    def density(self) -> FloatArray:
        """Suitable density of nodes for this solution, at each node."""
        return adapted_density(self.nodes, self.pressure, self.film, self.central)

    @cached_property
    def central_film(self) -> float:
        """Film at ``X = 0`` in units of ``a^2/R``, interpolated between nodes."""
        return float(_between(self.nodes, self.film, np.zeros(1), 2)[0])

    @cached_property
    def minimum(self) -> float:
        """Minimum film in units of ``a^2/R``, interpolated around the node with the thinnest film."""
        i = int(np.clip(np.argmin(self.film), 1, self.film.size - 2))
        low, high = float(self.nodes[i - 1]), float(self.nodes[i + 1])
        # fifth order, because the interpolation error of a cubic would exceed the discretisation error
        found = minimize_scalar(
            lambda x: _between(self.nodes, self.film, np.array([x]), 3)[0],
            bounds=(low, high),
            options={"xatol": 1e-6 * (high - low)},
        )
        return float(found.fun)

    @cached_property
    def spike(self) -> float:
        """Position of the spike (a second pressure maximum near the outlet), or NaN without a spike."""
        peak, _ = self._spike
        return float(self.nodes[peak]) if peak else float("nan")

    @cached_property
    def _spike(self) -> tuple[int, float]:
        """Index of the node of the spike, and lowest pressure between the last two maxima; (0, 0) without a spike."""
        P = self.pressure
        peaks = np.flatnonzero((P[1:-1] > P[:-2]) & (P[1:-1] >= P[2:])) + 1
        if peaks.size < 2:
            return 0, 0.0
        last, lowest = int(peaks[-1]), float(P[peaks[-2] : peaks[-1]].min())
        return (last, lowest) if P[last] - lowest >= _SPIKE * P.max() else (0, 0.0)

    @cached_property
    def rupture(self) -> float:
        """Position where the film ends, extrapolated from the last four positive pressures.

        If the extrapolation is impossible, the position of the first node without pressure downstream is returned.
        """
        last = int(np.flatnonzero(self.pressure)[-1])
        behind = self.nodes[min(last + 1, self.nodes.size - 1)]
        # the square root of the pressure falls to zero almost linearly
        x, root = self.nodes[max(last - 3, 0) : last + 1], np.sqrt(self.pressure[max(last - 3, 0) : last + 1])
        if not (root.size == 4 and np.all(np.diff(root) < 0)):
            return float(behind)
        cell = behind - self.nodes[last]
        end = _between(root[::-1].copy(), x[::-1].copy(), np.zeros(1), 2)[0]
        return float(np.clip(end, x[2], behind + cell))


def cell_around(nodes: FloatArray, position: float) -> FloatArray:
    """Return the last node upstream of a position, and the first node at or beyond this position.

    If the position is outside the grid, the first or the last two nodes are returned.
    """
    after = int(np.clip(np.searchsorted(nodes, position), 1, nodes.size - 1))
    return nodes[after - 1 : after + 1]


def expected(
    before: Sequence[GridSolution], reading: Callable[[GridSolution], float | FloatArray], spacing: float
) -> FloatArray:
    """Predict the result of `reading` on a grid with a given spacing from the results on one or two earlier grids.

    With one grid, its result is returned. With two grids, the error of the result is assumed to be proportional to the
    square of the spacing.
    """
    last = np.asarray(reading(before[-1]))
    if len(before) == 1:
        return last
    coarse, fine = before[-2].spacing ** 2, before[-1].spacing ** 2
    return np.asarray(last + (fine - spacing**2) / (coarse - fine) * (last - reading(before[-2])))


@jit
def _between(nodes: FloatArray, values: FloatArray, positions: FloatArray, sides: int) -> FloatArray:
    """Interpolate at each position by the polynomial through `sides` nodes on each side of the position.

    Near or beyond an end of the grid, the polynomial goes through the first or the last ``2 * sides`` nodes.
    """
    result = np.empty(positions.size)
    for k in range(positions.size):
        low, high = sides, nodes.size - sides  # bisection for the first node at or beyond the position
        while low < high:
            middle = (low + high) // 2
            if nodes[middle] < positions[k]:
                low = middle + 1
            else:
                high = middle
        total = 0.0
        for i in range(low - sides, low + sides):
            share = values[i]
            for j in range(low - sides, low + sides):
                if j != i:
                    share *= (positions[k] - nodes[j]) / (nodes[i] - nodes[j])
            total += share
        result[k] = total
    return result
