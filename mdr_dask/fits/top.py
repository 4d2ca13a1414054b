"""Height and place of the maximum of friction against velocity, from stacks of `mdr_dask.bootstrap`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.fits.base import DOUBTFUL
from mdr_dask.fits.interpolation import Scale, cubic

TOPS = (0.3, 0.2, 0.1, 0.05)  # points at most this fraction below the maximum; the first range that a parabola fits
FLAT = 0.05  # points at most this fraction below the maximum count as plateau
UPPER = 0.5  # the cubic for the place of the maximum is fitted to points above this fraction of the maximum
PLACES = 96  # number of points, evenly spaced in the logarithm of velocity, to which the cubic is fitted


def smoothed(mean: FloatArray) -> FloatArray:
    """Return a smoothed curve, which is used only to choose the points that are fitted."""
    smooth = mean.copy()
    for _ in range(2):
        smooth[1:-1] = (smooth[:-2] + 2 * smooth[1:-1] + smooth[2:]) / 4
    return smooth


class Top(NamedTuple):
    """The maximum of a parabola that is fitted to the points about the largest friction.

    Attributes
    ----------
    height : array, shape (rows,)
        Stack of the maximum, corrected for its bias; residuals of the parabola count as an error.
    place, rise : array, shape (rows,)
        Logarithm of the velocity of the maximum, and d ln(friction) / d ln(velocity) there. This slope is not 0 if the
        maximum is at an end of the velocities.
    """

    height: FloatArray
    place: FloatArray
    rise: FloatArray


def highest(x: FloatArray, stack: FloatArray, count: int) -> Top:
    """Fit a parabola to as many points about the largest friction as scatter and errors allow.

    Parameters
    ----------
    x : array, shape (velocities,)
        Logarithms of velocity, ascending.
    stack : array, shape (rows, velocities)
        Friction.
    count : int
        Realisations.
    """
    for drop in TOPS:
        near = _about_the_top(stack[0], drop)
        top, at, rise, left = _parabola(x[near], stack[:, near])
        if left.shape[1] > 3 and not bootstrap.chance(left, count) >= DOUBTFUL:
            continue
        break
    resamples = top[1 : 1 + bootstrap.RESAMPLES]  # NaN for resamples that contain only failed lines
    unbiased = top[0] + np.nanmean(top[0] - resamples) if count > 1 else top[0]
    if left.shape[1] > 3:
        errors = _parabola(x[near], bootstrap.moved(stack[0, near], left[0]))[0]
    else:  # a parabola through three points has no residuals; the error is its maximum minus the highest point
        errors = bootstrap.moved(top[:1], top[:1] - stack[0, near].max()).ravel()
    return Top(np.concatenate([top, errors]) + (unbiased - top[0]), at, rise)


def _about_the_top(mean: FloatArray, drop: float) -> slice:
    """Return the points about the maximum that are at most the share `drop` below it; at least three."""
    smooth = smoothed(mean)
    at = int(np.argmax(smooth))
    low = np.flatnonzero(smooth[at:] <= (1 - drop) * smooth[at])
    right = at + int(low[0]) if low.size else mean.size
    low = np.flatnonzero(smooth[:at] <= (1 - drop) * smooth[at])
    left = int(low[-1]) + 1 if low.size else 0
    middle = min(max(at, 1), mean.size - 2)
    return slice(min(left, middle - 1), max(right, middle + 2))


def _parabola(x: FloatArray, rows: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return for every row the maximum of its parabola, its place, the logarithmic slope there, and the residuals."""
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


def place(x: FloatArray, stack: FloatArray) -> FloatArray:
    """Return a stack of ln(velocity) of the maximum of friction; infinite if it lies outside the velocities.

    It is the maximum of a cubic polynomial fitted to ln(friction) in the upper half of the curve. The polynomial is
    fitted at evenly spaced places on a monotone cubic through the points, so that the result does not depend on the
    spacing of the points. The last two rows hold the error: the difference from a polynomial of degree four.

    Parameters
    ----------
    x, stack
        As for `highest`.
    """
    x, stack = _joined(x, stack)
    whole = np.linspace(x[0], x[-1], 20 * PLACES)
    curve = _curve(x, stack[:1], whole)[0]
    top, high = int(np.argmax(curve)), np.flatnonzero(curve > UPPER * curve.max())
    if curve[top] <= 0 or curve[[0, -1]].max() > (1 - FLAT) * curve[top]:
        return np.full(len(stack), np.inf if curve[-1] > curve[0] else -np.inf)
    parts = np.split(high, np.flatnonzero(np.diff(high) > 1) + 1)
    first, last = next((part[0], part[-1]) for part in parts if part[0] <= top <= part[-1])
    near = np.linspace(whole[first], whole[last], PLACES)
    known = np.isfinite(stack).all(axis=1)  # with one realisation, all resamples are NaN
    rows = np.log(np.maximum(_curve(x, stack[known], near), np.finfo(float).tiny))
    own = float(np.clip(whole[top], near[0], near[-1]))
    places = np.full(len(stack), np.nan)
    places[known] = _maximum(near, rows, 3, own)
    if np.isinf(places[0]):
        return places
    other = float(_maximum(near, rows[:1], 4, own)[0])
    shape = abs(other - places[0]) if np.isfinite(other) else np.ptp(near) / 2
    found: FloatArray = np.concatenate([places, places[0] + shape * np.array([1.0, -1.0])])
    return found


def _joined(x: FloatArray, stack: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a stack in which points at the same place (equal v tau from different v and tau) are averaged."""
    places, group = np.unique(np.round(x, 9), return_inverse=True)
    member = np.equal.outer(group, np.arange(places.size)).astype(np.float64)
    return places, stack @ (member / member.sum(axis=0))


def _maximum(near: FloatArray, rows: FloatArray, degree: int, own: float) -> FloatArray:
    """Fit a polynomial to each row and return the place of its maximum nearest to `own`; infinite without a maximum."""
    even, fine = np.linspace(-1.0, 1.0, near.size), np.linspace(-1.0, 1.0, 24 * near.size + 1)
    curves = rows @ np.linalg.pinv(np.vander(even, degree + 1)).T @ np.vander(fine, degree + 1).T
    left, middle, right = curves[:, :-2], curves[:, 1:-1], curves[:, 2:]
    places = (near[0] + near[-1]) / 2 + (near[-1] - near[0]) / 2 * fine[1:-1]
    away = np.where((middle > left) & (middle >= right), np.abs(places - own), np.inf)
    at = np.argmin(away, axis=1)
    end = np.where(curves[:, -1] > curves[:, 0], np.inf, -np.inf)
    found: FloatArray = np.where(np.isfinite(away.min(axis=1)), places[at], end)
    return found


def _curve(x: FloatArray, rows: FloatArray, places: FloatArray) -> FloatArray:
    return cubic(x, rows, places, 1, Scale(False))
