"""Friction under any course of velocity and load: every element followed in time, at second order in the step.

This is the general and slow way; a single jump on a periodic line is solved by :mod:`mdr_dask.physics.kinetics`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

CONVERGED, NOT_CONVERGED = 0, 1
MESSAGES = {NOT_CONVERGED: "the depth for the load was not found at one moment of the protocol"}


class Response(NamedTuple):
    """State at every moment of a protocol.

    Parameters
    ----------
    drag, depth, rate, contact, stored, dissipated : array, shape (moments,)
        F_x / (4 G L) in the unit of height squared over length; depth; its derivative by t / tau; fraction in contact;
        energy stored and power dissipated over 4 G L, in height squared (per tau).
    displacement : array, shape (n,)
        Of every element at the end, for going on from there.
    status : int
        `CONVERGED` or a key of `MESSAGES`.
    """

    drag: FloatArray
    depth: FloatArray
    rate: FloatArray
    contact: FloatArray
    stored: FloatArray
    dissipated: FloatArray
    displacement: FloatArray
    status: int


@njit(nogil=True, cache=True)
def _under(height: FloatArray, slope: FloatArray, travel: float, under: FloatArray, slope_under: FloatArray) -> None:
    """Write height and slope of the profile over every element after a travel, from cubic cells."""
    n = height.size
    cells = travel * n
    shift = int(np.floor(cells))
    y = cells - shift
    a0, a1 = (1 + 2 * y) * (1 - y) ** 2, y * y * (3 - 2 * y)
    b0, b1 = y * (1 - y) ** 2 / n, y * y * (y - 1) / n
    g0, k0, k1 = 6 * y * (y - 1) * n, (1 - y) * (1 - 3 * y), y * (3 * y - 2)
    i = shift % n
    for j in range(n):
        m = i + 1 if i + 1 < n else 0
        under[j] = a0 * height[i] + a1 * height[m] + b0 * slope[i] + b1 * slope[m]
        slope_under[j] = g0 * (height[i] - height[m]) + k0 * slope[i] + k1 * slope[m]
        i = m


@njit(nogil=True, cache=True)
def _depth(under: FloatArray, free: FloatArray, mean: float, depth: float) -> tuple[float, bool]:
    """Find the depth at which the mean displacement max(d + p, free) has its value; convex and increasing in d."""
    n = under.size
    for _ in range(200):
        total, touching = 0.0, 0
        for j in range(n):
            w = depth + under[j]
            if w > free[j]:
                total += w
                touching += 1
            else:
                total += free[j]
        if touching == 0:
            nearest = np.inf
            for j in range(n):
                nearest = min(nearest, free[j] - under[j])
            if abs(total - mean * n) <= 1e-12 * abs(mean) * n:
                return nearest, True
            depth = nearest + (mean * n - total)
            continue
        step = (mean * n - total) / touching
        depth += step
        if abs(step) <= 1e-12 * (abs(depth) + abs(mean)):
            return depth, True
    return depth, False


@njit(nogil=True, cache=True)
def _forces(
    under: FloatArray, slope: FloatArray, free: FloatArray, depth: float, rate: float, reach: float
) -> tuple[float, float, float]:
    """Return mean load, drag and fraction in contact; edges are placed inside the cells by linear interpolation."""
    n = under.size
    load, drag, length = 0.0, 0.0, 0.0
    gap0 = depth + under[n - 1] - free[n - 1]
    f0, s0 = depth + under[n - 1] + rate + reach * slope[n - 1], slope[n - 1]
    for j in range(n):
        gap1 = depth + under[j] - free[j]
        f1, s1 = depth + under[j] + rate + reach * slope[j], slope[j]
        low, high = 0.0, 1.0
        if gap0 < 0 and gap1 < 0:
            high = 0.0
        elif gap0 < 0:
            low = gap0 / (gap0 - gap1)
        elif gap1 < 0:
            high = gap0 / (gap0 - gap1)
        if f0 <= 0 and f1 <= 0:
            high = low
        elif f0 < 0:
            low = max(low, f0 / (f0 - f1))
        elif f1 < 0:
            high = min(high, f0 / (f0 - f1))
        if high > low:
            width, middle = high - low, 0.5 * (low + high)
            f, s = f0 + (f1 - f0) * middle, s0 + (s1 - s0) * middle
            load += width * f
            drag += width * (f * s + width * width / 12 * (f1 - f0) * (s1 - s0))
            length += width
        gap0, f0, s0 = gap1, f1, s1
    return load / n, drag / n, length / n


@njit(nogil=True, cache=True)
def _rate(
    under: FloatArray, slope: FloatArray, free: FloatArray, depth: float, rate: float, reach: float, load: float
) -> tuple[float, float, float]:
    """Find the rate of the depth that carries the load; return it with drag and fraction in contact."""
    drag, length = 0.0, 0.0
    for _ in range(60):
        carried, drag, length = _forces(under, slope, free, depth, rate, reach)
        if length <= 0 or abs(carried - load) <= 1e-11 * load:
            break
        rate += (load - carried) / length
    return rate, drag, length


@njit(nogil=True, cache=True)
def _follow(
    height: FloatArray,
    slope: FloatArray,
    moments: FloatArray,
    travels: FloatArray,
    reaches: FloatArray,
    loads: FloatArray,
    u: FloatArray,
    depth: float,
    mean: float,
    out: FloatArray,
) -> int:
    """March all elements through the moments; see :func:`follow`. Rows of `out` are the fields of `Response`."""
    n = height.size
    under, grade = np.empty(n), np.empty(n)
    below, before_grade = np.empty(n), np.empty(n)
    free, pressed = np.empty(n), np.empty(n)
    _under(height, slope, travels[0], under, grade)
    rate = 0.0
    for j in range(n):  # what touches at first touches but for rounding
        if abs(depth + under[j] - u[j]) < 1e-12 * (abs(depth) + abs(under[j]) + u[j]):
            u[j] = depth + under[j]
    rate, drag, length = _rate(under, grade, u, depth, rate, reaches[0], loads[0])
    previous = u.copy()
    for now in range(moments.size):
        if now > 0:
            step = moments[now] - moments[now - 1]
            below[:], before_grade[:] = under, grade
            old_depth, old_rate, old_reach = depth, rate, reaches[now - 1]
            _under(height, slope, travels[now], under, grade)
            fade = np.exp(-step)
            rise = (loads[now] - loads[now - 1]) / step
            mean = (mean - loads[now - 1] + rise) * fade + loads[now] - rise
            for j in range(n):
                previous[j] = u[j]
                free[j] = u[j] * fade
                pressed[j] = free[j]
            for _ in range(3):
                depth, good = _depth(under, free, mean, depth)
                if not good:
                    return NOT_CONVERGED
                rate, drag, length = _rate(under, grade, free, depth, rate, reaches[now], loads[now])
                for j in range(n):
                    w0 = old_depth + below[j]
                    f0 = (w0 + old_rate + old_reach * before_grade[j]) * step
                    f1 = (depth + under[j] + rate + reaches[now] * grade[j]) * step / fade
                    if w0 >= previous[j] * (1 - 1e-12) and f0 > 0 and f1 < 0:
                        y = f0 / (f0 - f1)
                        w1 = (depth + under[j]) / fade
                        peak = w0 + y * (f0 + y * (3 * (w1 - w0) - 2 * f0 - f1 + y * (f0 + f1 - 2 * (w1 - w0))))
                        pressed[j] = max(peak, w0) * fade
                    else:
                        pressed[j] = previous[j] * fade
                free[:] = pressed
            for j in range(n):
                u[j] = max(depth + under[j], free[j])
        stored, lost = 0.0, 0.0
        for j in range(n):
            stored += 0.5 * u[j] * u[j]
            w = depth + under[j]
            speed = rate + reaches[now] * grade[j]
            lost += speed * speed if u[j] == w and w + speed > 0 else u[j] * u[j]
        out[0, now], out[1, now], out[2, now], out[3, now] = drag, depth, rate, length
        out[4, now], out[5, now] = stored / n, lost / n
    return CONVERGED


def follow(
    height: FloatArray,
    slope: FloatArray,
    moments: FloatArray,
    travels: FloatArray,
    reaches: FloatArray,
    loads: FloatArray,
    displacement: FloatArray,
    depth: float,
) -> Response:
    """Follow every element of a periodic line through a course of velocity and load.

    In free flight an element fades exponentially; in contact it has the displacement that the profile imposes, and
    where it leaves within a step the largest displacement is found inside the step. The total of the loads fixes the
    mean displacement, F_N / (4 G L) = I + tau dI/dt, so that the depth is the root of a convex sum.

    Parameters
    ----------
    height, slope : array, shape (n,)
        Profile of unit length, as in :func:`mdr_dask.physics.kinetics.cubic_profile`.
    moments : array, shape (m,)
        Times over tau, increasing; a jump needs the moments before and after it apart by a short step.
    travels, reaches : array, shape (m,)
        Distance travelled over L, and its derivative by t / tau, of either sign.
    loads : array, shape (m,)
        F_N / (4 G L), positive; linear between the moments.
    displacement : array, shape (n,)
        Of every element at the first moment; the profile stands over element j at ``x_j + travel``.
    depth : float
        Depth at the first moment.

    Returns
    -------
    Response
    """
    u = displacement.copy()
    out = np.full((6, moments.size), np.nan)
    status = _follow(height, slope, moments, travels, reaches, loads, u, depth, float(u.mean()), out)
    return Response(out[0], out[1], out[2], out[3], out[4], out[5], u, status)
