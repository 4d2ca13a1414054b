"""Curves through points by modified Akima interpolation, which no kink makes overshoot.

As `scipy.interpolate.Akima1DInterpolator` with ``method="makima"``, whose checks would take a tenth of a jump.
"""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.compiling import compiled, kernel, nested

FLAT = 1e-9  # of the largest weight on the curve: with less a point has the mean of the slopes two away


@compiled
def _weights(secant: FloatArray, i: int) -> tuple[float, float]:
    """Return the weights of the slopes before and after a point: how those on the other side change."""
    before = abs(secant[i + 3] - secant[i + 2]) + 0.5 * abs(secant[i + 3] + secant[i + 2])
    after = abs(secant[i + 1] - secant[i]) + 0.5 * abs(secant[i + 1] + secant[i])
    return before, after


@nested
def _write_tangents(secant: FloatArray, tangent: FloatArray) -> None:
    """Write the slopes at points from those between them, two beyond either end included."""
    largest = 0.0
    for i in range(tangent.size):
        before, after = _weights(secant, i)
        largest = max(largest, before + after)
    for i in range(tangent.size):
        before, after = _weights(secant, i)
        if before + after > FLAT * largest:
            tangent[i] = secant[i + 1] + after / (before + after) * (secant[i + 2] - secant[i + 1])
        else:
            tangent[i] = 0.5 * (secant[i] + secant[i + 3])


@kernel
def curve_through(x: FloatArray, y: FloatArray, places: FloatArray, values: FloatArray) -> None:
    """Write the curve through points at places, both in ascending order; beyond the ends it goes on as a cubic.

    Parameters
    ----------
    x, y : array, shape (n,)
        Two points or more.
    places, values : array, shape (m,)
        The places, and what is written.
    """
    n = x.size
    secant, tangent = np.empty(n + 3), np.empty(n)
    for i in range(n - 1):
        secant[i + 2] = (y[i + 1] - y[i]) / (x[i + 1] - x[i])
    second, last_but_one = (secant[3], secant[n - 1]) if n > 2 else (secant[2], secant[2])
    secant[1], secant[n + 1] = 2 * secant[2] - second, 2 * secant[n] - last_but_one
    secant[0], secant[n + 2] = 2 * secant[1] - secant[2], 2 * secant[n + 1] - secant[n]
    _write_tangents(secant, tangent)
    i = 0
    for k in range(places.size):
        while i < n - 2 and places[k] >= x[i + 1]:
            i += 1
        step = x[i + 1] - x[i]
        t = (places[k] - x[i]) / step
        rise, enter, leave = y[i + 1] - y[i], tangent[i] * step, tangent[i + 1] * step
        values[k] = y[i] + t * (enter + t * (3 * rise - 2 * enter - leave + t * (enter + leave - 2 * rise)))
