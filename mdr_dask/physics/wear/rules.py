"""The fast rule of the thesis for wear at constant depth, and the limiting profile, for any body of revolution.

In the fast rule (thesis eq. 6.11), the image g depends on the number of cycles N through `rest` = exp(-xi N / a(c)),
where a(c) is the scar radius of the limiting profile. From the stick radius c to x = 1, y = (g - g0(c)) / (1 - g0(c))
follows a logistic law, where g0 is the virgin image. Beyond the virgin contact radius x = 1, g - 1 = `rest` (g0 - 1).
In the limiting profile (eqs. 6.8-6.10), `rest` is zero. For a `Profile`, a ValueError is raised if the stick radius
does not lie between 0 and 1, or if the scar reaches beyond the table of the profile.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.mdr.revolution import Profile, bisect
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.refine import CLOSE, EPS, MOST_ITERATIONS
from mdr_dask.physics.wear.worn import (
    Scar,
    Worn,
    check_stick_radius,
    closed,
    virgin_load,
    worn_by,
    worn_volume,
)

#: The second and the third piece of integration end this many times farther from the stick border than the piece before
#: (chosen by trial). The fourth piece ends at x = 1. The third piece ends 30^2 = 900 widths of the first piece from
#: the stick border. There, y of the logistic law differs from its limit 1 by about 1/900.
LAYER_GROWTH = 30.0
ERROR = 2e-6  # numerical error of every output, divided by its largest value; it excludes the error of the fast rule


_ABSCISSA, _WEIGHT = gauss(16)  # 16 nodes are sufficient for the accuracy `ERROR`


class Rule(NamedTuple):
    """The fast rule for a body with the image x^exponent, or the limiting profile if `rest` (see the module) is 0.

    `c` is the stick radius, `level` is g0(c) = c^exponent, and `eta` is 1 - `level`.
    """

    exponent: float
    c: float
    level: float
    eta: float
    rest: float


def limit_radius(profile: Profile, stick_radius: float) -> float:
    """Return the scar radius a(c), the root of int_c^a (1 - g0) / sqrt(a^2 - x^2) dx = 0 (thesis eq. 6.10)."""
    return closed(profile, _scar(profile, stick_radius, 0.0)).radius


def limit(profile: Profile, stick_radius: float) -> Worn:
    """Return the limiting profile at constant depth. The image is g0 up to c, and 1 from c to the radius of the scar.

    Examples
    --------
    >>> from mdr_dask.physics.mdr.revolution import PowerProfile
    >>> worn = limit(PowerProfile(2.0), stick_radius=0.5)
    >>> print(f"{worn.contact_radius:.4f} {worn.wear_volume:.4f}")
    1.2298 0.7593
    """
    scar = closed(profile, _scar(profile, stick_radius, 0.0))
    force = 2.0 * virgin_load(profile, stick_radius)
    worn = worn_by(profile, scar, stick_radius, stick_radius, 1.0, force, worn_volume(scar))
    return replace(worn, relative_error=ERROR)


def fast(profile: Profile, stick_radius: float, cycles: float, xi: float = 0.8) -> Worn:
    """Return the worn contact by the fast rule.

    Parameters
    ----------
    profile : Profile
        The virgin body.
    stick_radius : float
        Stick radius c, between 0 and 1.
    cycles : float
        Number of cycles N >= 0, in units of N0.
    xi : float
        Factor xi in the exponent xi N / a(c) of the fast rule. In the thesis, the factor 0.8 was fitted by eye. The
        best factor lies between 0.9 and 1.
    """
    largest = limit_radius(profile, stick_radius)
    rest = max(math.exp(-xi * cycles / largest), EPS)  # a smaller value would be lost to rounding at the stick border
    scar = closed(profile, _scar(profile, stick_radius, rest), largest)
    cuts = np.array([stick_radius, *scar.breaks])
    x = cuts[:-1, None] + np.diff(cuts)[:, None] * _ABSCISSA
    depth_left = 1.0 - profile.image(np.array(stick_radius)) - profile.rise(x - stick_radius, stick_radius)
    load = virgin_load(profile, stick_radius) + float(np.diff(cuts) @ ((depth_left - scar.change(x)) @ _WEIGHT))
    return replace(worn_by(profile, scar, stick_radius, 1.0, 1.0, 2.0 * load, worn_volume(scar)), relative_error=ERROR)


def _scar(profile: Profile, c: float, rest: float) -> Scar:
    """Return the scar of the fast rule, or of the limiting profile if `rest` is 0. Its radius is NaN (see `closed`)."""
    check_stick_radius(c)
    eta = float(profile.rise(np.array(1.0 - c), c))

    def parts(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        start = profile.rise(np.maximum(x - c, 0.0), c) / eta
        return start, start + (1.0 - start) * rest

    def change(x: FloatArray) -> FloatArray:
        start, left = parts(x)
        worn = np.divide(start, left, out=np.ones_like(left), where=(left > 0.0) & (x <= 1.0))
        return eta * (1.0 - start) * (1.0 - rest) * worn

    def slope(x: FloatArray) -> FloatArray:
        _, left = parts(x)
        inside = np.where(left > 0.0, rest / np.maximum(left, 1e-100) ** 2, 0.0)
        return np.asarray(profile.image_slope(x) * (np.where(x <= 1.0, inside, rest) - 1.0))

    # the logistic law rises steeply in a layer at the stick border; the layer ends at the position with y = 1/2
    level = eta * rest / (1.0 + rest)
    layer = bisect(lambda gap: float(profile.rise(np.array(gap), c)) - level, 0.0, 1.0 - c) if rest > 0.0 else 0.0
    breaks = (*(min(c + layer * LAYER_GROWTH**k, 1.0) for k in range(3)), 1.0)
    return Scar(c, np.nan, change, slope, tuple(sorted({place for place in breaks if place > c})))


def limit_cases(exponent: ArrayLike, stick_radius: ArrayLike) -> FloatArray:
    """Return scar radius, wear volume and normal force of limiting profiles of power-law bodies, shape (3, ...)."""
    parts = np.broadcast_arrays(exponent, stick_radius)
    cases = np.array([np.ravel(part) for part in parts], dtype=float)
    return _limits(cases).reshape((3, *parts[0].shape))


def fast_cases(
    exponent: ArrayLike, stick_radius: ArrayLike, cycles: ArrayLike, xi: ArrayLike, limit_radius: ArrayLike
) -> FloatArray:
    """Return scar radius, wear volume and normal force of power-law bodies by the fast rule, shape (3, ...).

    `limit_radius` is the scar radius a(c) of the limiting profile.
    """
    parts = np.broadcast_arrays(exponent, stick_radius, cycles, xi, limit_radius)
    cases = np.array([np.ravel(part) for part in parts], dtype=float)
    return _fasts(cases).reshape((3, *parts[0].shape))


@jit_inline
def _rise(rule: Rule, gap: float) -> float:
    """Return g0(c + gap) - g0(c) without cancellation."""
    n, c = rule.exponent, rule.c
    if n == 2.0:
        return gap * (2.0 * c + gap)
    if n == 1.0:
        return gap
    if gap > 0.25 * c:  # for so large a gap, the difference does not suffer from cancellation
        return math.pow(c + gap, n) - rule.level
    return rule.level * math.expm1(n * math.log1p(gap / c))


@jit_inline
def _change(rule: Rule, gap: float) -> float:
    """Return the change g - g0 of the image at the radius c + `gap`."""
    rise = _rise(rule, gap)
    if rule.rest == 0.0:
        return rule.eta - rise
    if rule.c + gap > 1.0:
        return (rise - rule.eta) * (rule.rest - 1.0)
    start = rise / rule.eta
    left = start + (1.0 - start) * rule.rest
    return rule.eta * start * (1.0 - start) * (1.0 - rule.rest) / left


@jit
def _cuts(rule: Rule) -> FloatArray:
    """Return the ends of the pieces of integration: c, the radius with y = 1/2, two larger radii, and 1.

    In the limiting profile, the first four ends are equal to c.
    """
    cuts = np.empty(5)
    layer = rule.c * math.expm1(math.log1p(rule.eta * rule.rest / (1.0 + rule.rest) / rule.level) / rule.exponent)
    cuts[0], cuts[1] = rule.c, min(rule.c + layer, 1.0)
    for piece in range(2, 4):
        cuts[piece] = min(rule.c + LAYER_GROWTH * (cuts[piece - 1] - rule.c), 1.0)
    cuts[4] = 1.0
    return cuts


@jit
def _scar_integral(rule: Rule, radius: float, moment: int, cuts: FloatArray) -> float:
    """Return the integral of (g - g0) (R^2 - x^2)^(moment - 1/2) from c to R = `radius`, in pieces between cuts."""
    total, end = 0.0, _angle(cuts[0], radius)
    for piece in range(cuts.size):
        last = piece + 1 == cuts.size or cuts[piece + 1] >= radius
        if not last and cuts[piece + 1] <= cuts[piece]:
            continue
        begin = 0.0 if last else _angle(cuts[piece + 1], radius)
        part = 0.0
        for k in range(_ABSCISSA.size):
            angle = begin + (end - begin) * _ABSCISSA[k]
            term = _change(rule, max(radius * math.cos(angle) - rule.c, 0.0)) * _WEIGHT[k]
            if moment == 1:
                term *= (radius * math.sin(angle)) ** 2
            part += term
        total += (end - begin) * part
        if last:
            break
        end = begin
    return total


@jit_inline
def _angle(x: float, radius: float) -> float:
    """Return arccos(x / R) without cancellation near x = R."""
    return math.atan2(math.sqrt((radius - x) * (radius + x)), x)


@jit
def _scar_radius(rule: Rule, low: float, low_value: float, high: float, high_value: float, cuts: FloatArray) -> float:
    """Return the radius between `low` and `high` at which `_scar_integral` vanishes.

    `low_value` and `high_value` are the values of the integral at `low` and `high`. If `low_value` is not positive,
    nothing is worn, and `low` is returned. If `high_value` is not negative, `high` is returned. The root is found by
    the method of false position with the improvement by Anderson and Björck.
    """
    if not low_value > 0.0:
        return low
    if not high_value < 0.0:
        return high
    # the order of the method is 1.7: if the integral is this small, the next radius is exact except for rounding
    tolerance = CLOSE * low_value
    radius, replaced = (low * high_value - high * low_value) / (high_value - low_value), 0
    for _ in range(MOST_ITERATIONS):
        value, last = _scar_integral(rule, radius, 0, cuts), radius
        share = 1.0 - value / (low_value if value > 0.0 else high_value)
        share = share if share > 0.0 else 0.5
        if value > 0.0:
            high_value *= share if replaced < 0 else 1.0
            low, low_value, replaced = radius, value, -1
        else:
            low_value *= share if replaced > 0 else 1.0
            high, high_value, replaced = radius, value, 1
        radius = (low * high_value - high * low_value) / (high_value - low_value)
        if abs(value) < tolerance or abs(radius - last) < 2.0 * EPS * radius:
            break
    return radius


@jit
def _limit_radius(rule: Rule) -> float:
    """Return the scar radius a(c) of the limiting profile, for a rule with `rest` = 0."""
    cuts = _cuts(rule)
    low, high = 1.0, 2.0
    low_value, high_value = _scar_integral(rule, low, 0, cuts), _scar_integral(rule, high, 0, cuts)
    while high_value > 0.0:
        low, low_value, high = high, high_value, 2.0 * high
        high_value = _scar_integral(rule, high, 0, cuts)
    return _scar_radius(rule, low, low_value, high, high_value, cuts)


@jit
def _numbers(rule: Rule, limit: float) -> tuple[float, float, float]:
    """Return scar radius, volume and normal force. `limit` is the scar radius a(c) of the limiting profile."""
    cuts = _cuts(rule)
    radius = limit
    if rule.rest > 0.0:
        first, last = _scar_integral(rule, 1.0, 0, cuts), _scar_integral(rule, limit, 0, cuts)
        radius = _scar_radius(rule, 1.0, first, limit, last, cuts)
    volume = 4.0 * _scar_integral(rule, radius, 1, cuts)
    load, worn = rule.c * (1.0 - rule.level / (rule.exponent + 1.0)), 0.0
    for piece in range(4 if rule.rest > 0.0 else 0):  # in the limiting profile, the slip zone carries no load
        width = cuts[piece + 1] - cuts[piece]
        for k in range(_ABSCISSA.size):
            gap = cuts[piece] - rule.c + width * _ABSCISSA[k]
            unworn = rule.eta - _rise(rule, gap)
            worn += _WEIGHT[k] * width * (unworn - _change(rule, gap))
    return radius, volume, 2.0 * (load + worn)


@jit
def _limits(cases: FloatArray) -> FloatArray:
    """Return scar radius, volume and force of limiting profiles. The rows of `cases` are n and c."""
    result = np.empty((3, cases.shape[1]))
    for k in range(cases.shape[1]):
        rule = _power_rule(cases[0, k], cases[1, k], 0.0)
        radius = _limit_radius(rule)
        result[0, k], result[1, k], result[2, k] = _numbers(rule, radius)
    return result


@jit
def _fasts(cases: FloatArray) -> FloatArray:
    """Return scar radius, volume and force by the fast rule. The rows of `cases` are n, c, N, xi and a(c)."""
    result = np.empty((3, cases.shape[1]))
    for k in range(cases.shape[1]):
        n, c, cycles, xi, limit = cases[0, k], cases[1, k], cases[2, k], cases[3, k], cases[4, k]
        rule = _power_rule(n, c, max(math.exp(-xi * cycles / limit), EPS))
        result[0, k], result[1, k], result[2, k] = _numbers(rule, limit)
    return result


@jit
def _power_rule(exponent: float, c: float, rest: float) -> Rule:
    return Rule(exponent, c, math.pow(c, exponent), -math.expm1(exponent * math.log(c)), rest)
