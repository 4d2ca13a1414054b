"""Curves that are to be one: their points, the cells of the spline, and what is known of shifts without them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.superposition.least_squares import SETTINGS, Knots, Points, Prior

RATIOS = np.geomspace(0.03, 2.0, 12)
"""Scatters considered of steps about their mean with vertical factors, in widths and in heights of a curve."""


class Common(NamedTuple):
    """Mean and scatter of the steps between neighbours."""

    mean: float
    scatter: float


@dataclass(frozen=True)
class ShiftProblem:
    """Points of all curves, ascending in x within each.

    Parameters
    ----------
    points : Points
    curves : int
    width, height : float
        Of a curve, the median.
    grid : Knots
    windows : array, shape (curves - 1, 2)
        Least and largest step with which a curve overlaps the one before it.
    """

    points: Points
    curves: int
    width: float
    height: float
    grid: Knots
    windows: FloatArray

    @classmethod
    def of(cls, curves: list[tuple[FloatArray, FloatArray]]) -> ShiftProblem:
        """Put curves, ascending in x and in their groups, in one row."""
        member = np.repeat(np.arange(len(curves)), [x.size for x, _ in curves])
        points = Points(np.concatenate([x for x, _ in curves]), np.concatenate([y for _, y in curves]), member)
        width = float(np.median([np.ptp(x) for x, _ in curves]))
        height = float(np.median([np.ptp(y) for _, y in curves])) or 1.0
        density = points.x.size / (len(curves) * SETTINGS.cells)
        grid = Knots(width / SETTINGS.cells, density * np.logspace(*SETTINGS.smoothing))
        windows = np.array([[one[0] - other[-1], one[-1] - other[0]] for (one, _), (other, _) in pairwise(curves)])
        return cls(points, len(curves), width, height, grid, windows)

    def from_own_origin(self) -> tuple[ShiftProblem, float]:
        """Return the problem with its first point where cells begin, and by how much it was moved.

        The cells of the spline stand where they are, so that a unit of the abscissa would be seen in the shifts.
        """
        origin = float(self.points.x[0])
        return replace(self, points=self.points._replace(x=self.points.x - origin)), origin

    def lifted(self, along: FloatArray) -> ShiftProblem:
        """Return the same problem with curves moved along the ordinate."""
        return replace(self, points=self.points._replace(y=self.points.y + along[self.points.member]))

    def between(self, first: int, last: int) -> Points:
        """Return the points of some neighbours, the first of which is number zero."""
        low, high = np.searchsorted(self.points.member, [first, last + 1])
        x, y, member = self.points
        return Points(x[low:high], y[low:high], np.asarray(member[low:high] - first, dtype=np.intp))

    def first_guess(self) -> FloatArray:
        """Return the step that brings each curve onto the one before it."""
        pairs = (self.between(k, k + 1) for k in range(self.curves - 1))
        parts = ((pair, int(np.searchsorted(pair.member, 1))) for pair in pairs)
        return np.array([_pair_shift(p.x[:end], p.y[:end], p.x[end:], p.y[end:]) for p, end in parts])

    def prior(self, common: Common) -> Prior:
        """Return what is known of horizontal shifts whose steps scatter about a mean."""
        rows = differences(self.curves - 1)
        return Prior(common.mean * np.arange(1.0, self.curves), rows.T @ rows / common.scatter**2)

    def priors(self, mean: float) -> list[Prior]:
        """Return priors of both kinds of shifts, one for each ratio.

        Steps scatter about a common mean by an unknown part of width and height; the mean is known as well as if each
        were within a width of the usual one, and within a height of none.
        """
        size = self.curves - 1
        rows, usual = differences(size), np.append(mean * np.arange(1.0, self.curves), np.zeros(size))
        scales = np.diag([1 / self.width**2, 1 / self.height**2])
        about = np.eye(size) - 1 / size
        steps = [about / ratio**2 + np.eye(size) for ratio in RATIOS]
        return [Prior(usual, np.kron(scales, rows.T @ inner @ rows)) for inner in steps]

    def rises(self, scatter: float, curves: int) -> FloatArray:
        """Return the precision of the vertical shifts of some neighbours but the first, whose steps scatter; none
        where they do not.
        """
        rows = differences(curves - 1)
        return np.asarray(rows.T @ rows / scatter**2, dtype=np.float64) if scatter else np.empty((0, 0))


def differences(size: int) -> FloatArray:
    """Return the matrix that makes steps of shifts."""
    return np.eye(size) - np.eye(size, k=-1)


@jit
def _pair_shift(x: FloatArray, y: FloatArray, other_x: FloatArray, other_y: FloatArray) -> float:  # pragma: no cover
    """Return the shift of a curve onto its neighbour of least mean square difference over an overlap of a sixth or
    more.
    """
    shorter = min(np.ptp(x), np.ptp(other_x))
    low, high = x[0] - other_x[-1] + shorter / 6, x[-1] - other_x[0] - shorter / 6
    least, best = np.inf, 0.0
    for shift in np.linspace(low, high, 61):
        moved = other_x + shift
        inside, own = (moved >= x[0]) & (moved <= x[-1]), (x >= moved[0]) & (x <= moved[-1])
        count = np.sum(inside) + np.sum(own)
        if count < 2:
            continue
        squares = np.sum((np.interp(moved[inside], x, y) - other_y[inside]) ** 2)
        squares += np.sum((y[own] - np.interp(x[own], moved, other_y)) ** 2)
        overlap = min(moved[-1], x[-1]) - max(moved[0], x[0])
        score = squares / count * (1 + 0.1 * shorter / overlap)
        if score < least:
            least, best = score, shift
    return best
