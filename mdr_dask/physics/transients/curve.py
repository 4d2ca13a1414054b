"""Curves through the moments of a march, with the slopes that it finds there.

As `scipy.interpolate.CubicHermiteSpline`, with which a test compares them: its checks would take a twenty-fifth of a
short jump.
"""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit

STEEPEST = 3.0  # times the lesser of the secants beside a point: a steeper cubic would overshoot


@jit
def curve_through(x: FloatArray, y: FloatArray, slope: FloatArray, places: FloatArray, values: FloatArray) -> None:
    """Write the curve of cubics through points with slopes at places, both in ascending order.

    A slope far steeper than the secants beside its point is that of a single asperity, which comes or goes: it is made
    less steep. At the ends there is one secant only.

    Parameters
    ----------
    x, y : array, shape (n,)
        Two points or more.
    slope : array, shape (n,)
        Slopes at the points; if the first is NaN, a parabola joins the first two.
    places, values : array, shape (m,)
        The places, and what is written; beyond the ends the curve goes on as a cubic.
    """
    n = x.size
    tangent = np.empty(n)
    for i in range(n):
        first, last = max(i, 1), min(i + 1, n - 1)
        before = (y[first] - y[first - 1]) / (x[first] - x[first - 1])
        after = (y[last] - y[last - 1]) / (x[last] - x[last - 1])
        most = STEEPEST * min(abs(before), abs(after))
        tangent[i] = min(max(slope[i], -most), most)
    if np.isnan(slope[0]):
        tangent[0] = 2 * (y[1] - y[0]) / (x[1] - x[0]) - tangent[1]
    i = 0
    for k in range(places.size):
        while i < n - 2 and places[k] >= x[i + 1]:
            i += 1
        step = x[i + 1] - x[i]
        t = (places[k] - x[i]) / step
        rise, enter, leave = y[i + 1] - y[i], tangent[i] * step, tangent[i + 1] * step
        values[k] = y[i] + t * (enter + t * (3 * rise - 2 * enter - leave + t * (enter + leave - 2 * rise)))
