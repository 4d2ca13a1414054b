"""Find the maximum of friction against velocity."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.fits.base import DOUBTFUL

#: A parabola is fitted to the points that are below the maximum by at most this fraction of the maximum. The fraction
#: is halved until scatter and errors explain the residuals, or until three points are left. Chosen by trial: with a
#: larger fraction, the scatter of a few lines hides that the curve is no parabola.
TOP = 0.3


def smoothed(mean: FloatArray) -> FloatArray:
    """Return a smoothed curve, which is used only to select points."""
    smooth = mean.copy()
    for _ in range(2):
        smooth[1:-1] = (smooth[:-2] + 2 * smooth[1:-1] + smooth[2:]) / 4
    return smooth


class Top(NamedTuple):
    """The maximum of a parabola near the largest friction, fitted to every row of a stack.

    `height` is the maximum, corrected for its bias. It has additional rows, shifted by the residuals, which make its
    interval wider. `place` is ln(velocity) at the maximum. `rise` is d ln(friction) / d ln(velocity) at the maximum.
    `rise` is 0 unless the maximum is at an end of the fitted range.
    """

    height: FloatArray
    place: FloatArray
    rise: FloatArray


def highest(x: FloatArray, stack: FloatArray, count: int) -> Top:
    """Fit a parabola near the largest friction to a stack of friction at ascending x = ln(velocity)."""
    drop = TOP
    while True:  # ends at the latest when three points are left
        near = _about_the_top(stack[0], drop)
        top, at, rise, left = _parabola(x[near], stack[:, near])
        if left.shape[1] <= 3 or bootstrap.chance(left, count) >= DOUBTFUL:
            break
        drop /= 2
    resamples = top[1 : 1 + bootstrap.RESAMPLES]  # a resample that contains only failed lines is NaN
    unbiased = top[0] + np.nanmean(top[0] - resamples) if count > 1 else top[0]
    if left.shape[1] > 3:
        errors = _parabola(x[near], bootstrap.moved(stack[0, near], left[0]))[0]
    # a parabola through three points has no residuals; the error is then the difference between the maximum of the
    # parabola and the highest of the three points
    else:
        errors = bootstrap.moved(top[:1], top[:1] - stack[0, near].max()).ravel()
    return Top(np.concatenate([top, errors]) + (unbiased - top[0]), at, rise)


def _about_the_top(mean: FloatArray, drop: float) -> slice:
    """Return the range of points, at least three, that are below the maximum by at most the fraction `drop`."""
    smooth = smoothed(mean)
    at = int(np.argmax(smooth))
    low = np.flatnonzero(smooth[at:] <= (1 - drop) * smooth[at])
    right = at + int(low[0]) if low.size else mean.size
    low = np.flatnonzero(smooth[:at] <= (1 - drop) * smooth[at])
    left = int(low[-1]) + 1 if low.size else 0
    middle = min(max(at, 1), mean.size - 2)
    return slice(min(left, middle - 1), max(right, middle + 2))


def _parabola(x: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Fit a parabola to every row; return maximum, position of the maximum, relative slope there, and residuals."""
    centre, half = x.mean(), np.ptp(x) / 2
    u = (x - centre) / half
    design = np.vstack([np.ones_like(u), u, u**2])
    constants = rows @ np.linalg.pinv(design)
    level, tilt, bend = constants.T
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = np.where(bend < 0, -tilt / (2 * bend), np.copysign(np.inf, tilt))
        at = np.clip(inside, u.min(), u.max())
        top = level + tilt * at + bend * at**2
        slope = (tilt + 2 * bend * at) / (half * top)
    return top, centre + half * at, slope, rows - constants @ design
