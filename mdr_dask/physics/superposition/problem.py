"""Curves in one row, what shifts act on them, and what is expected of the shifts before any fit."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray

DEGREE = 3
CELLS_PER_CURVE = 8
"""Spline cells along a curve of median width; smoothing decides how many of them count."""

MOST_CELLS = 120
EXPECTED_SHIFT = 1.0
"""Standard deviation, in widths of a curve, that shifts between neighbours are expected to have about the usual one.

It decides only where the curves do not: on a plateau, or along a straight line with vertical factors.
"""


@dataclass(frozen=True)
class Problem:
    """All points in one row, and which shifts act on which; the first curve is held in place."""

    x: FloatArray
    y: FloatArray
    member: NDArray[np.intp]
    curves: int
    vertical: bool
    width: float
    usual: float = 0.0

    @classmethod
    def of(cls, values: FloatArray, curves: list[tuple[FloatArray, FloatArray]]) -> Problem:
        """Put curves, ascending in x and in their groups, in one row."""
        member = np.repeat(np.arange(values.size), [x.size for x, _ in curves])
        x, y = np.concatenate([x for x, _ in curves]), np.concatenate([y for _, y in curves])
        return cls(x, y, member, values.size, False, float(np.median([np.ptp(x) for x, _ in curves])))

    @property
    def free(self) -> int:
        """Number of shifts to be found."""
        return (self.curves - 1) * (2 if self.vertical else 1)

    def split(self, shifts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return horizontal and vertical shifts of all curves."""
        horizontal, vertical = np.zeros(self.curves), np.zeros(self.curves)
        horizontal[1:] = shifts[: self.curves - 1]
        if self.vertical:
            vertical[1:] = shifts[self.curves - 1 :]
        return horizontal, vertical

    def first_guess(self, curves: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
        """Shift each curve onto the one before it."""
        pairs = [_pair_shift(*one, *other) for one, other in pairwise(curves)]
        return np.cumsum(np.array(pairs))

    def cells(self, x: FloatArray) -> tuple[float, float, int]:
        """Return where the spline begins, the width of its cells and their number."""
        cells = int(np.clip(np.ceil(CELLS_PER_CURVE * np.ptp(x) / self.width), 2 * DEGREE, MOST_CELLS))
        return float(x.min()), float(np.ptp(x)) / cells, cells

    def expected(self) -> tuple[FloatArray, FloatArray]:
        """Return rows and targets of what is expected of the shifts: neighbours lie `usual` apart, within a width."""
        rows = np.zeros((self.curves - 1, self.free))
        rows[:, : self.curves - 1] = np.eye(self.curves - 1) - np.eye(self.curves - 1, k=-1)
        scale = EXPECTED_SHIFT * self.width
        return rows / scale, np.full(self.curves - 1, self.usual / scale)


@njit(nogil=True, cache=True, error_model="numpy")
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
