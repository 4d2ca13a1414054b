"""Compiled posterior of horizontal shifts, with vertical shifts, curve and scatter integrated out in closed form."""

from __future__ import annotations

import numpy as np
from numba import njit

from mdr_dask.arrays import FloatArray, IntArray

ALIKE = 0.05
"""Scatter of the steps between neighbours, in widths and heights of a curve, below which it is no news that they are
alike."""


@njit(nogil=True, cache=True, error_model="numpy")
def _sums(
    shifts: FloatArray,
    x: FloatArray,
    y: FloatArray,
    member: IntArray,
    low: float,
    step: float,
    band: FloatArray,
    right: FloatArray,
    cross: FloatArray,
    schur: FloatArray,
    heights: FloatArray,
    first: IntArray,
) -> float:  # pragma: no cover
    """Fill the normal equations of spline (band, right) and vertical shifts; return the sum of squares of y, or -1.

    -1 tells that a point has left the spline's range.
    """
    splines, total = right.size, 0.0
    band[:] = 0.0
    right[:] = 0.0
    cross[:] = 0.0
    schur[:] = 0.0
    heights[:] = 0.0
    first[:] = splines
    value = np.empty(4)
    for i in range(x.size):
        k, target = member[i] - 1, y[i]
        place = (x[i] + (shifts[k] if k >= 0 else 0.0) - low) / step
        cell = int(np.floor(place))
        if cell < 0 or cell > splines - 4:
            return -1.0
        t = place - cell
        value[0] = (1 - t) ** 3 / 6
        value[1] = (t * t * (3 * t - 6) + 4) / 6
        value[3] = t**3 / 6
        value[2] = 1 - value[0] - value[1] - value[3]
        total += target * target
        for a in range(4):
            right[cell + a] += value[a] * target
            for b in range(a + 1):
                band[cell + a, a - b] += value[a] * value[b]
        if k >= 0:
            first[k] = min(first[k], cell)
            schur[k, k] += 1.0
            heights[k] -= target
            for a in range(4):
                cross[k, cell + a] -= value[a]
    return total


@njit(nogil=True, cache=True, error_model="numpy")
def _expect(
    shifts: FloatArray, ratio: float, usual: float, width: float, height: float, schur: FloatArray
) -> tuple[float, float]:  # pragma: no cover
    """Add what is expected of the vertical steps; return squares of the horizontal ones about each other, and usual."""
    curves, before, scatter, expected = shifts.size, 0.0, ALIKE**2, 0.0
    alike, mean = 1 / (height**2 * ratio), shifts[-1] / shifts.size
    for k in range(curves):
        schur[k, k] += alike * (2.0 if k < curves - 1 else 1.0)
        if k > 0:
            schur[k, k - 1] -= alike
        scatter += ((shifts[k] - before - mean) / width) ** 2
        expected += ((shifts[k] - before - usual) / width) ** 2
        before = shifts[k]
    schur[-1, -1] -= alike / curves
    return scatter / ratio, expected


@njit(nogil=True, cache=True, error_model="numpy")
def _eliminate_curve(
    weight: float,
    band: FloatArray,
    right: FloatArray,
    cross: FloatArray,
    schur: FloatArray,
    heights: FloatArray,
    first: IntArray,
) -> tuple[float, float]:  # pragma: no cover
    """Factorise the spline with its curvature and take it out of the rest; return log determinant and squares."""
    splines, volume, explained = right.size, 0.0, 0.0
    for i in range(splines - 2):
        band[i, 0] += weight
        band[i + 1, 0] += 4 * weight
        band[i + 2, 0] += weight
        band[i + 1, 1] -= 2 * weight
        band[i + 2, 1] -= 2 * weight
        band[i + 2, 2] += weight
    for i in range(splines):
        for back in range(min(i, 3), -1, -1):
            j = i - back
            found = band[i, back]
            for k in range(max(0, i - 3), j):
                found -= band[i, i - k] * band[j, j - k]
            band[i, back] = found / band[j, 0] if back else np.sqrt(max(found, 1e-13 * weight))
        for k in range(max(0, i - 3), i):
            right[i] -= band[i, i - k] * right[k]
        right[i] /= band[i, 0]
        explained += right[i] ** 2
        volume += 2 * np.log(band[i, 0])
    for k in range(heights.size):
        for i in range(first[k], splines):
            found = cross[k, i]
            for j in range(max(first[k], i - 3), i):
                found -= band[i, i - j] * cross[k, j]
            cross[k, i] = found / band[i, 0]
            heights[k] -= cross[k, i] * right[i]
        for other in range(k + 1):
            for i in range(max(first[k], first[other]), splines):
                schur[k, other] -= cross[k, i] * cross[other, i]
    return volume, explained


@njit(nogil=True, cache=True, error_model="numpy")
def _solve_heights(schur: FloatArray, heights: FloatArray) -> tuple[float, float]:  # pragma: no cover
    """Overwrite by Cholesky's factor and by the likeliest vertical shifts; return log determinant and squares."""
    size, volume, explained = heights.size, 0.0, 0.0
    for i in range(size):
        for j in range(i + 1):
            found = schur[i, j]
            for k in range(j):
                found -= schur[i, k] * schur[j, k]
            schur[i, j] = found / schur[j, j] if i > j else np.sqrt(max(found, 1e-12))
        for k in range(i):
            heights[i] -= schur[i, k] * heights[k]
        heights[i] /= schur[i, i]
        explained += heights[i] ** 2
        volume += 2 * np.log(schur[i, i])
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            heights[i] -= schur[k, i] * heights[k]
        heights[i] /= schur[i, i]
    return volume, explained


@njit(nogil=True, cache=True, error_model="numpy")
def log_posterior(
    point: FloatArray,
    x: FloatArray,
    y: FloatArray,
    member: IntArray,
    low: float,
    step: float,
    curvature: float,
    expected: tuple[float, float, float],
    band: FloatArray,
    right: FloatArray,
    cross: FloatArray,
    schur: FloatArray,
    heights: FloatArray,
    first: IntArray,
) -> tuple[float, float]:  # pragma: no cover
    """Return the logarithm of the posterior of a point, and the mean variance of the scatter there.

    Parameters
    ----------
    point : array, shape (curves + 1,)
        Horizontal shifts of all curves but the first; natural logarithms of the ratio of two variances (of the steps
        between neighbours, in widths and heights of a curve, and of the scatter) and of the weight of the curvature.
    x, y, member : arrays, shape (points,)
        Points, and the curve of each.
    low, step : float
        Where the uniform cubic spline begins, and the width of its cells.
    curvature : float
        Size of the squared second differences beside the data's own.
    expected : tuple of float
        Mean and standard deviation expected of the horizontal shift between neighbours, and the height of a curve, by
        which vertical shifts are measured.
    band, right, cross, first : arrays, shapes (splines, 4), (splines,), (curves - 1, splines), (curves - 1,)
        Room to work in.
    schur, heights : arrays, shapes (curves - 1, curves - 1) and (curves - 1,), output
        Factor of the precision of the vertical shifts, for a scatter of one, and their mean.

    Notes
    -----
    Curve and vertical shifts enter linearly and have normal priors, so that they and the variance of the scatter are
    integrated out. Steps between neighbours scatter about an unknown mean by an unknown amount, whose prior makes them
    Student's t: independent steps would make wide shifts likely for their number alone, as where a flat curve leaves
    their common scale open the volume of all steps grows with a power of it.
    """
    curves, splines = heights.size, right.size
    shifts, log_ratio, log_weight = point[:curves], point[curves], point[curves + 1]
    total = _sums(shifts, x, y, member, low, step, band, right, cross, schur, heights, first)
    if total < 0:
        return -np.inf, 0.0
    scatter, unusual = _expect(shifts, np.exp(log_ratio), expected[0], expected[1], expected[2], schur)
    volume, explained = _eliminate_curve(curvature * np.exp(log_weight), band, right, cross, schur, heights, first)
    rest, more = _solve_heights(schur, heights)
    misfit = max(total + scatter - explained - more, 1e-14 * total + 1e-300)
    freedom = x.size - 2 + curves
    volume += rest - (splines - 2) * log_weight + 2 * curves * log_ratio
    return -0.5 * (volume + freedom * np.log(misfit) + unusual), misfit / (freedom - 2)


@njit(nogil=True, cache=True)
def _room(
    splines: int, curves: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray]:  # pragma: no cover
    """Return what `log_posterior` works in: band, right, cross, schur, heights and first."""
    cross, schur = np.empty((curves, splines)), np.empty((curves, curves))
    return np.empty((splines, 4)), np.empty(splines), cross, schur, np.empty(curves), np.empty(curves, np.intp)


@njit(nogil=True, cache=True, error_model="numpy")
def log_posteriors(
    points: FloatArray,
    x: FloatArray,
    y: FloatArray,
    member: IntArray,
    low: float,
    step: float,
    splines: int,
    curvature: float,
    expected: tuple[float, float, float],
    bounds: FloatArray,
) -> FloatArray:  # pragma: no cover
    """Return the logarithms of the posterior at points, shape (points,); see `log_posterior`.

    `bounds` is the range of the logarithm of the weight of the curvature.
    """
    curves = points.shape[1] - 2
    room = _room(splines, curves)
    found = np.full(points.shape[0], -np.inf)
    for i in range(points.shape[0]):
        if bounds[0] < points[i, curves + 1] < bounds[1]:
            found[i] = log_posterior(points[i], x, y, member, low, step, curvature, expected, *room)[0]
    return found


@njit(nogil=True, cache=True, error_model="numpy")
def heights_of(
    points: FloatArray,
    weights: FloatArray,
    x: FloatArray,
    y: FloatArray,
    member: IntArray,
    low: float,
    step: float,
    splines: int,
    curvature: float,
    expected: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray]:  # pragma: no cover
    """Return the mean vertical shifts at points, and the mean of their covariance there by weights that sum to one."""
    curves = points.shape[1] - 2
    room = _room(splines, curves)
    schur, heights = room[3], room[4]
    means, spread = np.empty((points.shape[0], curves)), np.zeros((curves, curves))
    for i in range(points.shape[0]):
        variance = log_posterior(points[i], x, y, member, low, step, curvature, expected, *room)[1]
        means[i] = heights
        _add_inverse(schur, weights[i] * variance, spread)
    return means, spread


@njit(nogil=True, cache=True, error_model="numpy")
def _add_inverse(factor: FloatArray, times: float, spread: FloatArray) -> None:  # pragma: no cover
    """Add a multiple of the inverse of what a lower triangle is the factor of; the triangle is overwritten."""
    size, column = factor.shape[0], np.empty(factor.shape[0])
    for j in range(size):
        for k in range(j, size):
            found = 1.0 if k == j else 0.0
            for back in range(j, k):
                found -= factor[k, back] * column[back]
            column[k] = found / factor[k, k]
        factor[j, j:] = column[j:]  # the inverse of the factor, transposed, in the upper triangle
    for a in range(size):
        for b in range(a + 1):
            found = 0.0
            for k in range(a, size):
                found += factor[a, k] * factor[b, k]
            spread[a, b] += times * found
            if a != b:
                spread[b, a] += times * found
