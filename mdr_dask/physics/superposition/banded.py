"""Fit several splines with common offsets by least squares, with banded Cholesky factors.

The unknowns are the spline coefficients m_c of each channel c, followed by the offsets v. Their precision matrix is

    [ A_c   B_c ]
    [ B_c^T  D  ],

where A_c is banded (half bandwidth 3). The blocks between two channels are zero. The Cholesky factor of the precision
matrix consists of the banded factors L_c of A_c, the borders W_c = L_c^-1 B_c, and the factor of the corner S = D -
sum_c W_c^T W_c. Lower and symmetric matrices are stored by diagonals: ``band[i, d]`` is M[i, i - d]. There is one
precision matrix for each row of parameters (shifts and scales).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit

ORDER = 4
"""Number of cubic B-splines that overlap at a point, and of stored diagonals of a band."""

EPS = float(np.finfo(np.float64).eps)


class Factors(NamedTuple):
    """Cholesky factors for each row of parameters: L_c, W_c and the factor of the corner.

    L_c and the factor of the corner are stored by diagonals.
    """

    band: FloatArray
    border: FloatArray
    corner: FloatArray


class Linear(NamedTuple):
    """Means and covariances of the unknowns for each row of parameters.

    `mean` contains the spline coefficients, channel by channel, then the offsets. `fitted` is the mean of the curve
    minus the mean of the offset at each point, and `slope` is the mean slope of the curve per cell of the spline.
    `variance` is the variance of `fitted`, and `tilt` is the covariance of `fitted` and `slope`. `rough` is the mean
    square of each second difference of the coefficients. `offsets` is the covariance of the offsets.
    """

    mean: FloatArray
    log_determinant: FloatArray
    fitted: FloatArray
    slope: FloatArray
    variance: FloatArray
    tilt: FloatArray
    rough: FloatArray
    offsets: FloatArray


def solve_rows(
    first: IntArray,
    value: FloatArray,
    slope: FloatArray,
    member: IntArray,
    y: FloatArray,
    weight: FloatArray,
    stiffness: FloatArray,
    tied: FloatArray,
) -> tuple[Factors, Linear]:
    """Return the Cholesky factors of the precision matrix, and the means and covariances of the unknowns.

    At each point, `first` is the index of the first of the four splines that overlap there; `value` and `slope` are the
    values and derivatives of these four splines. `member` is the index of the offset of each point. `weight` is the
    precision of the ordinates y. `stiffness` is the prior precision of the second differences, and `tied` is the prior
    precision of the offsets. Without offsets, `tied` has the shape (rows, 0, 0).
    """
    (rows, points), (channels, splines), offsets = first.shape, stiffness.shape[1:], tied.shape[1]
    splines += 2
    factors = Factors(
        np.zeros((rows, channels, splines, ORDER)),
        np.zeros((rows, channels, splines, offsets)),
        np.zeros((rows, offsets, offsets)),
    )
    linear = Linear(
        np.zeros((rows, channels * splines + offsets)),
        np.zeros(rows),
        np.zeros((rows, channels, points)),
        np.zeros((rows, channels, points)),
        np.zeros((rows, channels, points)),
        np.zeros((rows, channels, points)),
        np.zeros((rows, channels, splines - 2)),
        np.zeros((rows, offsets, offsets)),
    )
    _factorise(first, value, member, y, weight, stiffness, tied, *factors, linear.mean, linear.log_determinant)
    _select(first, value, slope, member, *factors, *linear)
    return factors, linear


def drawn(factors: Factors, normal: FloatArray) -> FloatArray:
    """Transform standard normal numbers, shape (rows, unknowns), into random deviations of the unknowns."""
    found = normal.copy()
    _back_substitute(*factors, found)
    return found


@jit
def _factorise(
    first: IntArray,
    value: FloatArray,
    member: IntArray,
    y: FloatArray,
    weight: FloatArray,
    stiffness: FloatArray,
    tied: FloatArray,
    band: FloatArray,
    border: FloatArray,
    corner: FloatArray,
    mean: FloatArray,
    log_determinant: FloatArray,
) -> None:
    """For each row, build and factorise the precision matrix, and solve for the mean of the unknowns."""
    rows, channels, splines, offsets = border.shape
    begin = channels * splines
    for r in range(rows):
        for i in range(offsets):
            for j in range(i + 1):
                corner[r, i, i - j] = tied[r, i, j]
        for c in range(channels):
            own, side, right = band[r, c], border[r, c], mean[r, c * splines : (c + 1) * splines]
            _add_bending(stiffness[r, c], own)
            _add_points(first[r], value[r], y[c], weight[r, c], own, right)
            if offsets:
                _add_ties(first[r], value[r], member, y[c], weight[r, c], side, corner[r], mean[r, begin:])
            log_determinant[r] += _cholesky(own)
            _forward(own, mean[r : r + 1, c * splines : (c + 1) * splines].T)
            _forward(own, side)
            for i in range(splines):
                for k in range(offsets):
                    mean[r, begin + k] -= side[i, k] * right[i]
                    for j in range(k + 1):
                        corner[r, k, k - j] -= side[i, k] * side[i, j]
        log_determinant[r] += _cholesky(corner[r])
        _forward(corner[r], mean[r : r + 1, begin:].T)
    _back_substitute(band, border, corner, mean)


@jit
def _add_bending(stiffness: FloatArray, band: FloatArray) -> None:
    """Add the prior precision of the second differences to the band of the precision matrix."""
    second = (1.0, -2.0, 1.0)
    for j in range(stiffness.size):
        for a in range(3):
            for b in range(a + 1):
                band[j + a, a - b] += stiffness[j] * second[a] * second[b]


@jit
def _add_points(
    first: IntArray, value: FloatArray, y: FloatArray, weight: float, band: FloatArray, right: FloatArray
) -> None:
    """Add the points of a channel to the band and to the right-hand side of the channel."""
    for p in range(first.size):
        at = first[p]
        for a in range(ORDER):
            weighted = weight * value[p, a]
            right[at + a] += weighted * y[p]
            for b in range(a + 1):
                band[at + a, a - b] += weighted * value[p, b]


@jit
def _add_ties(
    first: IntArray,
    value: FloatArray,
    member: IntArray,
    y: FloatArray,
    weight: float,
    border: FloatArray,
    corner: FloatArray,
    right: FloatArray,
) -> None:
    """Add the points of a channel to the border, to the corner and to the right-hand side of the offsets."""
    for p in range(first.size):
        k = member[p]
        corner[k, 0] += weight
        right[k] -= weight * y[p]  # negative, because offsets are subtracted from the spline
        for a in range(ORDER):
            border[first[p] + a, k] -= weight * value[p, a]


@jit
def _select(
    first: IntArray,
    value: FloatArray,
    slope: FloatArray,
    member: IntArray,
    band: FloatArray,
    border: FloatArray,
    corner: FloatArray,
    mean: FloatArray,
    log_determinant: FloatArray,
    fitted: FloatArray,
    tangent: FloatArray,
    variance: FloatArray,
    tilt: FloatArray,
    rough: FloatArray,
    covariance: FloatArray,
) -> None:
    """Compute the results in `Linear` and the entries of the covariance matrix that these results need."""
    rows, channels, splines, offsets = border.shape
    begin = channels * splines
    within = np.empty((splines, ORDER))  # the band of the covariance of a channel
    inner = np.empty((offsets, offsets))
    gain = np.empty((splines, offsets))  # G = A^-1 B
    cross = np.empty((splines, offsets))  # G S^-1: covariance of coefficients and offsets, with the opposite sign
    for r in range(rows):
        _inverse_band(corner[r], inner)
        for i in range(offsets):
            for j in range(i + 1):
                covariance[r, i, j] = covariance[r, j, i] = inner[i, i - j]
        for c in range(channels):
            own = mean[r, c * splines : (c + 1) * splines]
            _inverse_band(band[r, c], within)
            _add_border(band[r, c], border[r, c], corner[r], within, gain, cross)
            for j in range(splines - 2):
                bend = own[j] - 2 * own[j + 1] + own[j + 2]
                square = within[j, 0] + 4 * within[j + 1, 0] + within[j + 2, 0]
                rough[r, c, j] = bend**2 + square - 4 * (within[j + 1, 1] + within[j + 2, 1]) + 2 * within[j + 2, 2]
            _at_points(
                first[r], value[r], slope[r], own, within, fitted[r, c], tangent[r, c], variance[r, c], tilt[r, c]
            )
            for p in range(member.size if offsets else 0):
                at, k = first[r, p], member[p]
                fitted[r, c, p] -= mean[r, begin + k]
                variance[r, c, p] += covariance[r, k, k]
                for a in range(ORDER):
                    variance[r, c, p] += 2 * value[r, p, a] * cross[at + a, k]
                    tilt[r, c, p] += slope[r, p, a] * cross[at + a, k]


@jit
def _add_border(
    band: FloatArray, border: FloatArray, corner: FloatArray, within: FloatArray, gain: FloatArray, cross: FloatArray
) -> None:
    """Write G = A^-1 B to `gain`, and G S^-1 to `cross`; add G S^-1 G^T to the band of the covariance of a channel."""
    splines, offsets = border.shape
    gain[:] = border
    _backward(band, gain)
    cross[:] = gain
    _forward(corner, cross.T)
    _backward(corner, cross.T)
    for i in range(splines):
        for d in range(min(i + 1, ORDER)):
            for k in range(offsets):
                within[i, d] += cross[i, k] * gain[i - d, k]


@jit
def _at_points(
    first: IntArray,
    value: FloatArray,
    slope: FloatArray,
    mean: FloatArray,
    within: FloatArray,
    fitted: FloatArray,
    tangent: FloatArray,
    variance: FloatArray,
    tilt: FloatArray,
) -> None:
    for p in range(first.size):
        at = first[p]
        for a in range(ORDER):
            spread = 0.0  # covariance of a coefficient and the curve
            for b in range(ORDER):
                spread += within[at + max(a, b), abs(a - b)] * value[p, b]
            fitted[p] += value[p, a] * mean[at + a]
            tangent[p] += slope[p, a] * mean[at + a]
            variance[p] += value[p, a] * spread
            tilt[p] += slope[p, a] * spread


@jit
def _back_substitute(band: FloatArray, border: FloatArray, corner: FloatArray, right: FloatArray) -> None:
    """Replace each row of `right`, shape (rows, unknowns), by the solution x of L^T x = row."""
    rows, channels, splines, offsets = border.shape
    begin = channels * splines
    for r in range(rows):
        _backward(corner[r], right[r : r + 1, begin:].T)
        for c in range(channels):
            for i in range(splines):
                for k in range(offsets):
                    right[r, c * splines + i] -= border[r, c, i, k] * right[r, begin + k]
            _backward(band[r, c], right[r : r + 1, c * splines : (c + 1) * splines].T)


@jit
def _cholesky(band: FloatArray) -> float:
    """Replace a symmetric matrix by its lower Cholesky factor, and return the log determinant of the matrix.

    A pivot that is not positive because of rounding is replaced by the rounding error of the diagonal.
    """
    size, width = band.shape
    log_determinant = 0.0
    for i in range(size):
        low, diagonal = max(i - width + 1, 0), band[i, 0]
        for j in range(low, i + 1):
            rest = band[i, i - j]
            for k in range(low, j):
                rest -= band[i, i - k] * band[j, j - k]
            band[i, i - j] = np.sqrt(max(rest, EPS * diagonal)) if i == j else rest / band[j, 0]
        log_determinant += 2 * np.log(band[i, 0])
    return log_determinant


@jit
def _forward(band: FloatArray, right: FloatArray) -> None:
    """Replace each column of `right` by the solution x of L x = column."""
    (size, width), columns = band.shape, right.shape[1]
    for i in range(size):
        for j in range(max(i - width + 1, 0), i):
            for m in range(columns):
                right[i, m] -= band[i, i - j] * right[j, m]
        for m in range(columns):
            right[i, m] /= band[i, 0]


@jit
def _backward(band: FloatArray, right: FloatArray) -> None:
    """Replace each column of `right` by the solution x of L^T x = column."""
    (size, width), columns = band.shape, right.shape[1]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, min(i + width, size)):
            for m in range(columns):
                right[i, m] -= band[j, j - i] * right[j, m]
        for m in range(columns):
            right[i, m] /= band[i, 0]


@jit
def _inverse_band(band: FloatArray, inverse: FloatArray) -> None:
    """Write the entries of the inverse of L L^T that lie in the band (recursion of Takahashi, Fagan and Chin, 1973)."""
    size, width = band.shape
    for j in range(size - 1, -1, -1):
        last = min(j + width, size) - 1
        for i in range(last, j - 1, -1):
            rest = 1 / band[j, 0] if i == j else 0.0
            for k in range(j + 1, last + 1):
                rest -= inverse[max(i, k), abs(i - k)] * band[k, k - j]
            inverse[i, i - j] = rest / band[j, 0]
