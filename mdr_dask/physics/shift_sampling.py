"""Compiled random walk through the posterior of shifts, for problems that bend within their own errors."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

WISHED = 0.25
"""Share of proposals taken, near which a random walk in many dimensions is fastest."""

ALIKE = 0.05
"""Scatter of the steps between neighbours, in widths and heights of a curve, below which it is no news that they are
alike."""

STRETCHES = (1.0, 0.3, 3.0)
"""Lengths of steps in turn: a posterior that bends is wide in some places and narrow in others."""


@njit(nogil=True, cache=True, error_model="numpy")
def log_posterior(
    shifts: FloatArray,
    log_weight: float,
    x: FloatArray,
    y: FloatArray,
    member: IntArray,
    curves: int,
    low: float,
    step: float,
    band: FloatArray,
    right: FloatArray,
    curvature: float,
    usual: float,
    width: float,
    height: float,
) -> float:  # pragma: no cover
    """Return the logarithm of the posterior of shifts and smoothing; the curve and the scatter are integrated out.

    Parameters
    ----------
    shifts : array, shape (curves - 1,) or (2 curves - 2,)
        Horizontal and perhaps vertical shifts of all curves but the first.
    log_weight : float
        Natural logarithm of the weight of the curvature.
    x, y, member : arrays, shape (points,)
        Points, and the curve of each.
    low, step : float
        Where the uniform cubic spline begins, and the width of its cells.
    band, right : arrays, shapes (splines, 4) and (splines,)
        Room to work in.
    curvature : float
        Size of the squared second differences beside the data's own.
    usual, width : float
        Mean and standard deviation expected of the horizontal shift between neighbours.
    height : float
        Height of a curve, by which vertical shifts are measured.

    Notes
    -----
    Steps between neighbours scatter about an unknown mean by an unknown amount, whose prior is that of Student's t.
    Independent steps would make wide shifts likely for their number alone: where a flat curve leaves their common scale
    open, the volume of all steps grows with a power of it.
    """
    splines = right.size
    band[:] = 0.0
    right[:] = 0.0
    vertical = shifts.size > curves - 1
    total, value = 0.0, np.empty(4)
    for i in range(x.size):
        place, target = x[i], y[i]
        if member[i] > 0:
            place += shifts[member[i] - 1]
            if vertical:
                target += shifts[curves - 2 + member[i]]
        place = (place - low) / step
        cell = int(np.floor(place))
        if cell < 0 or cell > splines - 4:
            return -np.inf
        t = place - cell
        value[0] = (1 - t) ** 3 / 6
        value[1] = (3 * t**3 - 6 * t**2 + 4) / 6
        value[2] = (-3 * t**3 + 3 * t**2 + 3 * t + 1) / 6
        value[3] = t**3 / 6
        total += target * target
        for a in range(4):
            right[cell + a] += value[a] * target
            for b in range(a + 1):
                band[cell + a, a - b] += value[a] * value[b]
    weight = curvature * np.exp(log_weight)
    for i in range(splines - 2):
        band[i, 0] += weight
        band[i + 1, 0] += 4 * weight
        band[i + 2, 0] += weight
        band[i + 1, 1] -= 2 * weight
        band[i + 2, 1] -= 2 * weight
        band[i + 2, 2] += weight
    rank, volume, explained = splines - 2, 0.0, 0.0
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
    misfit = max(total - explained, 1e-14 * total + 1e-300)
    expected, scatter = 0.0, ALIKE**2
    for start in range(0, shifts.size, curves - 1):
        scale = width if start == 0 else height
        mean, before = shifts[start + curves - 2] / (curves - 1), 0.0
        for k in range(start, start + curves - 1):
            scatter += ((shifts[k] - before - mean) / scale) ** 2
            if start == 0:
                expected += ((shifts[k] - before - usual) / width) ** 2
            before = shifts[k]
    expected += shifts.size * np.log(scatter)
    return float(-0.5 * (volume - rank * log_weight + (x.size - 2) * np.log(misfit) + expected))


@njit(nogil=True, cache=True, error_model="numpy")
def walk(
    shifts: FloatArray,
    log_weight: float,
    bounds: FloatArray,
    factor: FloatArray,
    length: float,
    normals: FloatArray,
    uniforms: FloatArray,
    x: FloatArray,
    y: FloatArray,
    member: IntArray,
    curves: int,
    low: float,
    step: float,
    splines: int,
    curvature: float,
    usual: float,
    width: float,
    height: float,
    adapt: bool,
    visited: FloatArray,
) -> tuple[float, float]:  # pragma: no cover
    """Walk by the rule of Metropolis; return the last smoothing and length of step.

    Parameters
    ----------
    shifts : array, shape (unknowns,)
        Where to begin; where it ended, on return.
    bounds : array, shape (2,)
        Range of `log_weight`.
    factor : array, shape (unknowns, unknowns)
        Lower triangle by which normal numbers become a step, times `length`.
    normals, uniforms : arrays, shapes (steps, unknowns + 1) and (steps, 2)
        Random numbers.
    adapt : bool
        Whether the length of a step may change, as it may before what counts.
    visited : array, shape (steps, unknowns), output
    """
    band, right = np.empty((splines, 4)), np.empty(splines)
    size, proposal = shifts.size, np.empty(shifts.size)
    here = log_posterior(
        shifts, log_weight, x, y, member, curves, low, step, band, right, curvature, usual, width, height
    )
    for i in range(normals.shape[0]):
        stretch = length * STRETCHES[i % len(STRETCHES)]
        for a in range(size):
            proposal[a] = shifts[a]
            for b in range(a + 1):
                proposal[a] += stretch * factor[a, b] * normals[i, b]
        there = log_posterior(
            proposal, log_weight, x, y, member, curves, low, step, band, right, curvature, usual, width, height
        )
        taken = np.log(uniforms[i, 0]) < there - here
        if taken:
            shifts[:] = proposal
            here = there
        if adapt and i % len(STRETCHES) == 0:
            length *= np.exp(((1.0 if taken else 0.0) - WISHED) / np.sqrt(10.0 + i))
        if i % 4 == 0:
            other = log_weight + 2.0 * normals[i, size]
            if bounds[0] < other < bounds[1]:
                there = log_posterior(
                    shifts, other, x, y, member, curves, low, step, band, right, curvature, usual, width, height
                )
                if np.log(uniforms[i, 1]) < there - here:
                    log_weight = other
                    here = there
        visited[i] = shifts
    return log_weight, length
