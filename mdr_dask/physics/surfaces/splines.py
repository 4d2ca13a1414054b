"""A closed line as a cubic spline with one coefficient for each of its equidistant nodes.

Between two nodes, with t from 0 to 1, the line is ``a0 + a1 t + a2 t^2 + a3 t^3``. It lies between the smallest and the
largest of the four spline coefficients used by `piece` (de Boor, *A Practical Guide to Splines*, 1978, chapter IX).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.refine import CLOSE, MOST_ITERATIONS
from mdr_dask.physics.surfaces.waves import series

Piece = tuple[float, float, float, float]


def closest(waves: NDArray[np.complex128], nodes: int) -> FloatArray:
    """Return the coefficients of the least-squares spline of a sum of waves, with two or more nodes per shortest wave.

    `waves` contains half of the complex amplitude of every wave. Each amplitude is multiplied by a factor: the Fourier
    transform of the B-spline, divided by the sum of the squares of this transform over all aliases of the wave (Unser,
    IEEE Signal Process. Mag. 16 (1999) 22).
    """
    return series(waves * _closest(waves.size, nodes), nodes)


def through_heights(height: FloatArray) -> FloatArray:
    """Return the coefficients, shape (nodes,), of the spline through the heights of a closed line, shape (nodes,)."""
    phase = 2 * np.pi * np.arange(height.size // 2 + 1) / height.size
    at_nodes = (2 + np.cos(phase)) / 3  # Fourier transform of 1/6, 4/6, 1/6, the values of the B-spline at the nodes
    return np.asarray(fft.irfft(fft.rfft(height) / at_nodes, height.size), dtype=np.float64)


def heights(spline: FloatArray) -> FloatArray:
    """Return the heights of a spline at its nodes, shape (nodes,)."""
    return np.asarray((np.roll(spline, 1) + 4 * spline + np.roll(spline, -1)) / 6)


@lru_cache(maxsize=8)
def _closest(modes: int, nodes: int) -> FloatArray:
    """Return the factors that convert the waves to the coefficients of the least-squares spline."""
    phase = 2 * np.pi * np.arange(1, modes + 1) / nodes  # change of phase from one node to the next
    cosine = np.cos(phase)
    transform = np.sinc(phase / (2 * np.pi)) ** 4
    images = (2416 + 2382 * cosine + 240 * (2 * cosine**2 - 1) + 2 * (4 * cosine**3 - 3 * cosine)) / 5040
    return np.asarray(transform / images)


@jit
def piece(spline: FloatArray, k: int) -> Piece:
    """Return the polynomial between the nodes k + 1 and k + 2, from the four coefficients k to k + 3."""
    c0, c1, c2, c3 = spline[k], spline[k + 1], spline[k + 2], spline[k + 3]
    return (c0 + 4 * c1 + c2) / 6, (c2 - c0) / 2, (c0 - 2 * c1 + c2) / 2, (c3 - 3 * c2 + 3 * c1 - c0) / 6


@jit
def value(of: Piece, t: float) -> float:
    """Return the value of a piece at t."""
    return of[0] + t * (of[1] + t * (of[2] + t * of[3]))


@jit
def integral(of: Piece, t: float) -> float:
    """Return the integral of a piece from 0 to t."""
    return t * (of[0] + t * (of[1] / 2 + t * (of[2] / 3 + t * of[3] / 4)))


@jit
def shares(t: float) -> Piece:
    """Return four weights: the integral of a piece from 0 to t is the weighted sum of its four coefficients."""
    square = t * t
    second, third = t * (4 - 2 * square + 0.75 * t * square) / 6, t * (1 + 1.5 * t + square - 0.75 * t * square) / 6
    return (1 - (1 - t) ** 4) / 24, second, third, square * square / 24


@jit
def zeros(spline: FloatArray, k: int, found: FloatArray, count: int) -> int:
    """Append k + t to `found` for each t from 0 to 1 at which piece k changes sign; return the new count.

    A piece changes sign at most three times. A piece does not change sign if all four coefficients have the same sign.
    """
    of = piece(spline, k)
    # the formula by which `piece` computes the first height of the next piece, so that adjacent pieces agree
    end = (spline[k + 1] + 4 * spline[k + 2] + spline[k + 3]) / 6
    t_before, before = 0.0, of[0]
    first, second = _extremes(of)
    for number in range(3):
        t = first if number == 0 else second if number == 1 else 1.0
        if t <= t_before:
            continue
        here = end if number == 2 else value(of, t)
        if (here > 0) != (before > 0):
            found[count] = k + _zero(of, t_before, before, t, here)
            count += 1
        t_before, before = t, here
    return count


@jit
def _extremes(of: Piece) -> tuple[float, float]:
    """Return the positions of the extremes of a piece, ascending; an extreme that is missing or outside 0 to 1 is 0."""
    a, b, c = 3 * of[3], of[2], of[1]  # the slope is a t^2 + 2 b t + c
    root = b * b - a * c
    if root <= 0:
        return 0.0, 0.0
    larger = -(b + np.copysign(np.sqrt(root), b))
    one = c / larger if larger != 0 else 0.0
    other = larger / a if a != 0 else 0.0
    one = one if 0 < one < 1 else 0.0
    other = other if 0 < other < 1 else 0.0
    return min(one, other), max(one, other)


@jit
def _zero(of: Piece, low: float, at_low: float, high: float, at_high: float) -> float:
    """Return the zero of a piece between `low` and `high`; the piece is monotonic and changes sign in this interval."""
    t = low + (high - low) * at_low / (at_low - at_high)
    for _ in range(MOST_ITERATIONS):
        here = value(of, t)
        if (here > 0) == (at_low > 0):
            low = t
        else:
            high = t
        slope = of[1] + t * (2 * of[2] + t * 3 * of[3])
        following = t - here / slope if slope != 0 else low
        if not low < following < high:
            following = (low + high) / 2
        if abs(following - t) <= CLOSE:
            return following
        t = following
    return t
