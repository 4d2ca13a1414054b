"""Compiled parts of sampling by importance: points of Student's t, their density, and weighted moments."""

from __future__ import annotations

import numpy as np
from numba import njit

from mdr_dask.arrays import FloatArray

TAIL = 6.0
"""Degrees of freedom of Student's t: wide enough for tails, near enough to a normal distribution."""


@njit(nogil=True, cache=True, error_model="numpy")
def placed(
    mean: FloatArray, factor: FloatArray, normals: FloatArray, squares: FloatArray
) -> FloatArray:  # pragma: no cover
    """Return points of Student's t.

    Parameters
    ----------
    mean, factor : arrays, shapes (unknowns,) and (unknowns, unknowns)
        Middle and lower triangle of the shape.
    normals, squares : arrays, shapes (points, unknowns) and (points,)
        Random numbers, normal and of chi-squared with `TAIL` degrees of freedom.
    """
    points = np.empty_like(normals)
    for i in range(normals.shape[0]):
        stretch = np.sqrt(TAIL / squares[i])
        for a in range(mean.size):
            moved = 0.0
            for b in range(a + 1):
                moved += factor[a, b] * normals[i, b]
            points[i, a] = mean[a] + stretch * moved
    return points


@njit(nogil=True, cache=True, error_model="numpy")
def add_density(
    points: FloatArray, mean: FloatArray, factor: FloatArray, log_scale: float, total: FloatArray
) -> None:  # pragma: no cover
    """Add the density of points under Student's t, but for a constant factor and exp(-log_scale), to `total`."""
    size, apart = mean.size, np.empty(mean.size)
    volume = log_scale
    for a in range(size):
        volume += np.log(factor[a, a])
    for i in range(points.shape[0]):
        distance = 0.0
        for a in range(size):
            found = points[i, a] - mean[a]
            for b in range(a):
                found -= factor[a, b] * apart[b]
            apart[a] = found / factor[a, a]
            distance += apart[a] ** 2
        total[i] += np.exp(-volume - 0.5 * (TAIL + size) * np.log1p(distance / TAIL))


@njit(nogil=True, cache=True, error_model="numpy")
def moments(points: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:  # pragma: no cover
    """Return mean and covariance of points, shape (points, unknowns), whose weights sum to one."""
    size = points.shape[1]
    mean, spread, apart = np.zeros(size), np.zeros((size, size)), np.empty(size)
    for i in range(points.shape[0]):
        mean += weights[i] * points[i]
    for i in range(points.shape[0]):
        apart[:] = points[i] - mean
        for a in range(size):
            for b in range(a + 1):
                spread[a, b] += weights[i] * apart[a] * apart[b]
    for a in range(size):
        for b in range(a):
            spread[b, a] = spread[a, b]
    return mean, spread
