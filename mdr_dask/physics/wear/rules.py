"""The limiting shape and the fast rule for many power-law bodies at once: compiled, one case after the other."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear.worn import LAYER_GROWTH, SMALLEST_REST

_NODES = 16
#: Error of the scar's integral, over eta.
SCAR_ERROR = 1e-10


def limit_cases(exponent: ArrayLike, stick_radius: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return contact radius, volume and normal force of limiting shapes.

    Parameters
    ----------
    exponent, stick_radius : array_like, broadcast together
        n > 0 and 0 < c < 1.

    Returns
    -------
    contact_radius, wear_volume, normal_force : array
        In the units of `mdr_dask.physics.wear.worn`.
    """
    n, c = (np.array(part, dtype=float) for part in np.broadcast_arrays(exponent, stick_radius))
    result = np.empty((3, n.size))
    _limits(n.ravel(), c.ravel(), *gauss(2 * _NODES), result)
    radius, volume, force = result.reshape((3, *n.shape))
    return radius, volume, force


def fast_cases(
    exponent: ArrayLike, stick_radius: ArrayLike, cycles: ArrayLike, xi: ArrayLike, limit_radius: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return scar radius, volume and normal force by the fast rule.

    Parameters
    ----------
    exponent, stick_radius, cycles, xi, limit_radius : array_like, broadcast together
        n, c, N, xi and a(c), the last from `limit_cases`.

    Returns
    -------
    contact_radius, wear_volume, normal_force : array
        As :func:`mdr_dask.physics.wear.worn.fast` defines them.
    """
    parts = np.broadcast_arrays(exponent, stick_radius, cycles, xi, limit_radius)
    flat = [np.array(part, dtype=float).ravel() for part in parts]
    result = np.empty((3, flat[0].size))
    n, c, cycles_flat, xi_flat, limit = flat
    abscissa, weight = gauss(_NODES)
    _fasts(n, c, cycles_flat, xi_flat, limit, abscissa, weight, result)
    radius, volume, force = result.reshape((3, *parts[0].shape))
    return radius, volume, force


@njit(nogil=True, cache=True)
def _power(x: float, n: float) -> float:
    if n == 2.0:
        return x * x
    if n == 1.0:
        return x
    return math.pow(x, n)


@njit(nogil=True, cache=True)
def _narrowed(low, low_value, high, high_value, side, x, value):  # type: ignore[no-untyped-def]
    """Return a bracket of a falling function, its values and its newer end, -1 or 1: false position by Illinois."""
    if value > 0.0:
        return x, value, high, 0.5 * high_value if side == -1 else high_value, -1
    return low, 0.5 * low_value if side == 1 else low_value, x, value, 1


@njit(nogil=True, cache=True)
def _limits(n, c, abscissa, weight, result):  # type: ignore[no-untyped-def]
    """Find a(c) by false position; then volume and force."""
    for case in range(n.size):
        low, high = 1.0, 1.5
        low_value = _plateau(n[case], c[case], low, abscissa, weight, 0)
        high_value = _plateau(n[case], c[case], high, abscissa, weight, 0)
        while high_value > 0.0:
            low, low_value = high, high_value
            high *= 1.5
            high_value = _plateau(n[case], c[case], high, abscissa, weight, 0)
        a, side = low, 0
        for _ in range(200):
            last = a
            a = (low * high_value - high * low_value) / (high_value - low_value)
            if abs(a - last) < 4e-16 * a or not low < a < high:
                break
            value = _plateau(n[case], c[case], a, abscissa, weight, 0)
            low, low_value, high, high_value, side = _narrowed(low, low_value, high, high_value, side, a, value)
        result[0, case] = a
        result[1, case] = 4.0 * _plateau(n[case], c[case], a, abscissa, weight, 1)
        result[2, case] = 2.0 * (c[case] - c[case] * _power(c[case], n[case]) / (n[case] + 1.0))


@njit(nogil=True, cache=True)
def _plateau(n, c, a, abscissa, weight, moment):  # type: ignore[no-untyped-def]
    """Return int_c^a (1 - x^n) (a^2 - x^2)^(moment - 1/2) dx."""
    span = math.atan2(math.sqrt((a - c) * (a + c)), c)
    total = 0.0
    for k in range(abscissa.size):
        angle = span * abscissa[k]
        term = 1.0 - _power(a * math.cos(angle), n)
        if moment == 1:
            term *= (a * math.sin(angle)) ** 2
        total += weight[k] * term
    return span * total


@njit(nogil=True, cache=True)
def _change(x, n, c, at_c, eta, rest):  # type: ignore[no-untyped-def]
    """Return g - g0 of the fast rule."""
    if x > 1.0:
        return (_power(x, n) - 1.0) * (rest - 1.0)
    if n == 2.0:
        rise = (x - c) * (x + c)
    elif n == 1.0:
        rise = x - c
    else:
        rise = at_c * math.expm1(n * math.log1p((x - c) / c))
    start = rise / eta
    return eta * start * (1.0 - start) * (1.0 - rest) / (start + (1.0 - start) * rest)


@njit(nogil=True, cache=True)
def _scar_integral(radius, moment, n, c, at_c, eta, rest, cuts, abscissa, weight):  # type: ignore[no-untyped-def]
    """Return int_c^R (g - g0) (R^2 - x^2)^(moment - 1/2) dx in pieces between the cuts."""
    total = 0.0
    for piece in range(cuts.size):
        low = cuts[piece]
        high = min(cuts[piece + 1], radius) if piece + 1 < cuts.size else radius
        if high <= low:
            continue
        begin = math.atan2(math.sqrt((radius - high) * (radius + high)), high)
        end = math.atan2(math.sqrt((radius - low) * (radius + low)), low)
        for k in range(abscissa.size):
            angle = begin + (end - begin) * abscissa[k]
            x = max(radius * math.cos(angle), c)
            term = _change(x, n, c, at_c, eta, rest) * weight[k] * (end - begin)
            if moment == 1:
                term *= (radius * math.sin(angle)) ** 2
            total += term
    return total


@njit(nogil=True, cache=True)
def _fasts(n, c, cycles, xi, limit, abscissa, weight, result):  # type: ignore[no-untyped-def]
    cuts = np.empty(5)
    for case in range(n.size):
        rest = max(math.exp(-xi[case] * cycles[case] / limit[case]), SMALLEST_REST)
        at_c = _power(c[case], n[case])
        eta = -math.expm1(n[case] * math.log(c[case]))
        steep = math.pow(at_c + eta * rest / (1.0 + rest), 1.0 / n[case])
        cuts[0], cuts[1] = c[case], steep
        for piece in range(2, 4):
            cuts[piece] = min(c[case] + LAYER_GROWTH * (cuts[piece - 1] - c[case]), 1.0)
        cuts[4] = 1.0
        low, high = 1.0, limit[case]
        low_value = _scar_integral(low, 0, n[case], c[case], at_c, eta, rest, cuts, abscissa, weight)
        high_value = _scar_integral(high, 0, n[case], c[case], at_c, eta, rest, cuts, abscissa, weight)
        radius = high
        if high_value < 0.0 < low_value:
            side = 0
            for _ in range(60):
                radius = (low * high_value - high * low_value) / (high_value - low_value)
                value = _scar_integral(radius, 0, n[case], c[case], at_c, eta, rest, cuts, abscissa, weight)
                if abs(value) < SCAR_ERROR * eta or high - low <= 1e-13 * high:
                    break
                low, low_value, high, high_value, side = _narrowed(
                    low, low_value, high, high_value, side, radius, value
                )
        volume = _scar_integral(radius, 1, n[case], c[case], at_c, eta, rest, cuts, abscissa, weight)
        result[0, case], result[1, case] = radius, 4.0 * volume
        worn = 0.0
        for piece in range(4):
            for k in range(abscissa.size):
                width = cuts[piece + 1] - cuts[piece]
                worn += (
                    weight[k] * width * _change(cuts[piece] + width * abscissa[k], n[case], c[case], at_c, eta, rest)
                )
        result[2, case] = 2.0 * (n[case] / (n[case] + 1.0) - worn)
