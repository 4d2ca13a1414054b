"""Compiled normal equations of shifted curves on one uniform cubic spline.

Systems are a few dozen unknowns wide, where the threads of a linear algebra library cost more than they save.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from mdr_dask.arrays import FloatArray, IntArray


@njit(nogil=True, cache=True, error_model="numpy")
def spline_rows(
    x: FloatArray, low: float, step: float, cells: int, first: IntArray, value: FloatArray, slope: FloatArray
) -> None:  # pragma: no cover
    """Fill the number of the first of the four cubic B-splines at each x, their values and derivatives.

    Parameters
    ----------
    x : array, shape (points,)
    low, step, cells
        The spline's range begins at `low`; points beyond its last cell count to that.
    first : array of int, shape (points,), output
    value, slope : array, shape (points, 4), output
    """
    for i in range(x.size):
        place = (x[i] - low) / step
        cell = min(max(int(np.floor(place)), 0), cells - 1)
        t = place - cell
        first[i] = cell
        value[i, 0] = (1 - t) ** 3 / 6
        value[i, 1] = (3 * t**3 - 6 * t**2 + 4) / 6
        value[i, 2] = (-3 * t**3 + 3 * t**2 + 3 * t + 1) / 6
        value[i, 3] = t**3 / 6
        slope[i, 0] = -((1 - t) ** 2) / (2 * step)
        slope[i, 1] = (3 * t**2 - 4 * t) / (2 * step)
        slope[i, 2] = (-3 * t**2 + 2 * t + 1) / (2 * step)
        slope[i, 3] = t**2 / (2 * step)


@njit(nogil=True, cache=True, error_model="numpy")
def normal_equations(
    first: IntArray,
    value: FloatArray,
    steepness: FloatArray,
    member: IntArray,
    curves: int,
    splines: int,
    vertical: bool,
    target: FloatArray,
    normal: FloatArray,
    right: FloatArray,
) -> None:  # pragma: no cover
    """Fill the products of the design with itself and with the target.

    Parameters
    ----------
    first, value
        See `spline_rows`.
    steepness : array, shape (points,)
        Slope of the curve at each point, by which a horizontal shift moves it.
    member : array of int, shape (points,)
        Curve of each point; curve 0 has no shifts.
    curves, splines, vertical
        Unknown are spline coefficients, horizontal shifts of the other curves, and perhaps vertical ones.
    target : array, shape (points,)
    normal, right : arrays, shape (unknowns, unknowns) and (unknowns,), output
    """
    normal[:] = 0.0
    right[:] = 0.0
    place, entry = np.empty(6, np.intp), np.empty(6)
    for i in range(target.size):
        count = 4
        for k in range(4):
            place[k], entry[k] = first[i] + k, value[i, k]
        if member[i] > 0:
            place[4], entry[4] = splines + member[i] - 1, steepness[i]
            place[5], entry[5] = splines + curves - 1 + member[i] - 1, -1.0
            count = 6 if vertical else 5
        for a in range(count):
            right[place[a]] += entry[a] * target[i]
            for b in range(count):
                normal[place[a], place[b]] += entry[a] * entry[b]


@njit(nogil=True, cache=True, error_model="numpy")
def factorise(matrix: FloatArray) -> None:  # pragma: no cover
    """Overwrite the lower triangle of a positive matrix by its Cholesky factor; what is lost to rounding becomes tiny.

    Pivots are kept above 1e-13 of the largest diagonal, as if the matrix had been that much heavier there.
    """
    size = matrix.shape[0]
    least = 0.0
    for j in range(size):
        least = max(least, 1e-13 * matrix[j, j])
    for j in range(size):
        for i in range(j, size):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if i == j:
                matrix[j, j] = np.sqrt(max(total, least))
            else:
                matrix[i, j] = total / matrix[j, j]


@njit(nogil=True, cache=True, error_model="numpy")
def solve(factor: FloatArray, right: FloatArray) -> FloatArray:  # pragma: no cover
    """Return the solution of a system whose matrix `factorise` has factorised."""
    size = right.size
    found = right.copy()
    for i in range(size):
        for k in range(i):
            found[i] -= factor[i, k] * found[k]
        found[i] /= factor[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            found[i] -= factor[k, i] * found[k]
        found[i] /= factor[i, i]
    return found


@njit(nogil=True, cache=True, error_model="numpy")
def inverse(factor: FloatArray) -> FloatArray:  # pragma: no cover
    """Return the inverse of a matrix that `factorise` has factorised."""
    size = factor.shape[0]
    found, unit = np.empty((size, size)), np.zeros(size)
    for j in range(size):
        unit[j] = 1.0
        found[j] = solve(factor, unit)
        unit[j] = 0.0
    return found


@njit(nogil=True, cache=True, error_model="numpy")
def likelihoods(
    normal: FloatArray,
    penalty: FloatArray,
    right: FloatArray,
    total: float,
    points: int,
    rank: int,
    weights: FloatArray,
) -> FloatArray:  # pragma: no cover
    """Return twice the negative logarithm of the restricted likelihood of each weight of the penalty.

    Parameters
    ----------
    normal, penalty, right
        Normal equations and the quadratic form of the smoothness.
    total : float
        Sum of squares of the target.
    points, rank : int
        Number of points, and rank of the penalty.
    weights : array, shape (weights,)
    """
    found = np.empty(weights.size)
    fixed = right.size - rank
    for i in range(weights.size):
        matrix = normal + weights[i] * penalty
        factorise(matrix)
        misfit = max(total - float(np.sum(right * solve(matrix, right))), 1e-14 * total + 1e-300)
        volume = -float(rank * np.log(weights[i]))
        for j in range(right.size):
            volume += 2 * np.log(matrix[j, j])
        found[i] = volume + (points - fixed) * np.log(misfit)
    return found
