"""What values on ever finer grids tend to, and how far they are from it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray


class Trust(NamedTuple):
    """When a limit is trusted and how far, chosen with ``python -m benchmarks ehl honesty``.

    Parameters
    ----------
    lowest_order, highest_order : float
        Observed orders of convergence between which values are extrapolated; the scheme is of second order.
    third : float
        The error of an extrapolated value over what the third order moved it, at an observed order of two; two and
        a half times that at one and a half, so that it covers every pure power.
    floor : float
        Least error over what the second order moved a value.
    moved : float
        Least error over what the second order would leave of the change of an extrapolated value by the finest grid.
    slowest : float
        Least ratio of successive changes, on halved spacings, that bounds the error of a value not extrapolated.
    """

    lowest_order: float = 1.5
    highest_order: float = 2.6
    third: float = 1.25
    floor: float = 0.03
    moved: float = 0.8
    slowest: float = 1.2


TRUST = Trust()


class Limit(NamedTuple):
    """What values on nested grids tend to, its estimated absolute error, and the order of convergence observed.

    Each is a number or an array; the order is NaN where the values do not approach anything steadily.
    """

    value: FloatArray
    error: FloatArray
    order: FloatArray

    def scaled(self, factor: float) -> Limit:
        """Return the estimate in another unit."""
        return Limit(self.value * factor, self.error * factor, self.order)


def extrapolate(
    values: FloatArray,
    spacing: Sequence[float] | FloatArray,
    least: float = TRUST.floor,
    trust: Trust = TRUST,
) -> Limit:
    """Return what values on ever finer grids tend to.

    Where the changes from grid to grid shrink at about second order, the limit takes away what goes like the square and
    the cube of the spacing, and the error is a multiple of what the cube did. Elsewhere the limit is the finest value,
    and the error its last change, the sum of those to come where they shrink slowly, or what the change before leaves
    at first order where the last one is small by chance.

    Parameters
    ----------
    values : array, shape (k, ...)
        From the coarsest grid to the finest: three give the limit and its error; one before them tells what the limit
        changed by.
    spacing : array, shape (k,)
        Of the grids.
    least : float
        Least error over what the second order moved an extrapolated value.
    trust : Trust
        The orders that are trusted, and the shares.

    Returns
    -------
    Limit
        Elementwise; an error is infinite where a coarser grid has no value.
    """
    coarse, middle, fine = np.asarray(values[-3:], dtype=np.float64)
    h = np.asarray(spacing, dtype=np.float64)[-3:] / spacing[-1]
    before, last = middle - coarse, fine - middle
    squares, cubes = -np.diff(h**2), -np.diff(h**3)
    logarithms = np.diff(h**2 * np.log(h)) / np.diff(h**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where((last == 0) & np.isfinite(before), 1.0, before / last * (squares[1] / squares[0]))
        shrinks = 2 + np.log(np.abs(ratio)) / (logarithms[0] - logarithms[1])  # exact on spacings of one ratio
    order = np.where(ratio > 0, shrinks, np.nan)
    second, earlier = fine + last / squares[1], middle + before * (h[1] ** 2 / squares[0])
    # the cube's share of both second-order limits is known, so that their difference tells it
    of_limit = 1.0 - cubes[1] / squares[1]
    of_earlier = h[1] ** 3 - cubes[0] * h[1] ** 2 / squares[0]
    cube = (earlier - second) * of_limit / (of_earlier - of_limit)
    third = trust.third * (1 + 3 * np.maximum(2 - order, 0.0))
    trusted = np.maximum(third * np.abs(cube), least * np.abs(second - fine))
    is_trusted = (order >= trust.lowest_order) & (order <= trust.highest_order)
    to_come = 1 / (h[1] ** np.maximum(np.nan_to_num(shrinks), np.log2(trust.slowest)) - 1)
    elsewhere = np.maximum(np.abs(last) * np.maximum(1.0, to_come), np.abs(before) * (h[1] / squares[0]))
    value = np.where(is_trusted, second - cube, fine)
    error = np.where(is_trusted, trusted, elsewhere)
    if len(values) > 3:
        before_finest = extrapolate(values[:-1], spacing[:-1], least, trust).value
        error = np.fmax(error, trust.moved / (h[1] ** 2 - 1) * np.abs(value - before_finest))
    return Limit(value, np.where(np.isnan(error) & ~np.isnan(fine), np.inf, error), order)
