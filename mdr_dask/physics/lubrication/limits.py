"""What values on ever finer grids tend to, and how far they are from it."""

from __future__ import annotations

from collections.abc import Sequence
from math import log
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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
    least: float | FloatArray = TRUST.floor,
    fourth: float | None = None,
    trust: Trust = TRUST,
) -> Limit:
    """Return what values on ever finer grids tend to.

    Where the changes from grid to grid shrink at about second order, the limit takes away what goes like the square and
    the cube of the spacing, and the error is a multiple of what the cube did, or what they leave of a fourth power.
    Elsewhere the limit is the finest value, and the error its last change, the sum of those to come where they shrink
    slowly, or what the change before leaves at first order where the last one is small by chance.

    Parameters
    ----------
    values : array, shape (k, ...)
        From the coarsest grid to the finest: three give the limit and its error; one before them tells what the limit
        changed by.
    spacing : array, shape (k,)
        Of the grids, in lengths over which the solution changes.
    least : float or array
        Least error over what the second order moved an extrapolated value.
    fourth : float, optional
        Where whole powers are known to follow: the error over what is left of a fourth order that is as large as the
        third one at a spacing of one.
    trust : Trust
        The orders that are trusted, and the shares.

    Returns
    -------
    Limit
        Elementwise; an error is infinite where a coarser grid has no value.
    """
    here, a, b = _powers(values[-3:], spacing[-3:], trust), *(float(h / spacing[-1]) for h in spacing[-3:-1])
    left = spacing[-1] * (a * b) ** 2 / (a * b + a + b)  # of a fourth power, in cubes of the finest spacing
    third = (trust.third if fourth is None else fourth * left) * (1 + 3 * np.maximum(2 - here.order, 0.0))
    trusted = np.maximum(third * np.abs(here.cube), least * np.abs(here.square))
    to_come = 1 / (b ** np.maximum(np.nan_to_num(here.shrinks), np.log2(trust.slowest)) - 1)
    before, last = np.diff(values[-3:], axis=0)
    elsewhere = np.maximum(np.abs(last) * np.maximum(1.0, to_come), np.abs(before) * (b / (a**2 - b**2)))
    error = np.where(here.is_trusted, trusted, elsewhere)
    if len(values) > 3:
        moved = here.limit - _powers(values[-4:-1], spacing[-4:-1], trust).limit
        error = np.fmax(error, trust.moved / (b**2 - 1) * np.abs(moved))
    return Limit(here.limit, np.where(np.isnan(error) & ~np.isnan(values[-1]), np.inf, error), here.order)


class _Powers(NamedTuple):
    """What goes like the square and the cube of the spacing in the finest of three values, and what is left of it.

    `shrinks` is the order of convergence whether or not the values approach their limit from one side.
    """

    limit: FloatArray
    square: FloatArray
    cube: FloatArray
    shrinks: FloatArray
    order: FloatArray
    is_trusted: NDArray[np.bool_]


def _powers(values: FloatArray, spacing: Sequence[float] | FloatArray, trust: Trust) -> _Powers:
    """Return the powers of the spacing in three values; where their order is not trusted, the limit is the finest."""
    coarse, middle, fine = np.asarray(values, dtype=np.float64)
    a, b = (float(h / spacing[-1]) for h in spacing[:2])
    before, last = middle - coarse, fine - middle
    squares, cubes = (a**2 - b**2, b**2 - 1), (a**3 - b**3, b**3 - 1)
    logarithms = (a**2 * log(a) - b**2 * log(b)) / squares[0] - b**2 * log(b) / squares[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where((last == 0) & np.isfinite(before), 1.0, before / last * (squares[1] / squares[0]))
        shrinks = 2 + np.log(np.abs(ratio)) / logarithms  # exact on spacings of one ratio
    order = np.where(ratio > 0, shrinks, np.nan)
    second, earlier = fine + last / squares[1], middle + before * (b**2 / squares[0])
    # the cube's share of both second-order limits is known, so that their difference tells it
    of_limit = 1.0 - cubes[1] / squares[1]
    of_earlier = b**3 - cubes[0] * b**2 / squares[0]
    cube = (earlier - second) * (of_limit / (of_earlier - of_limit))
    is_trusted = (order >= trust.lowest_order) & (order <= trust.highest_order)
    return _Powers(np.where(is_trusted, second - cube, fine), second - fine, cube, shrinks, order, is_trusted)
