"""The fast rule of the thesis for wear at constant depth, and the limiting profile, for any body of revolution.

In the fast rule (thesis eq. 6.11), the image g depends on the cycles through `rest` = exp(-xi N / a(c)). Up to x = 1,
y = (g - g0(c)) / (1 - g0(c)) follows a logistic law. Beyond x = 1, g - 1 is the fraction `rest` of g0 - 1. In the
limiting profile (eqs. 6.8-6.10), `rest` is zero.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.mdr.revolution import Image, PowerProfile, Profile, image_rise
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear.worn import Scar, Worn, beyond_table, check_stick_radius, worn_by

LAYER_GROWTH = 30.0  # ratio of the widths of successive pieces of integration at the stick border
SCAR = 1e-10  # tolerance, divided by eta, of the integral that vanishes at the radius of the scar
ERROR = 2e-6  # numerical error of every output, divided by the largest value; not the error of the fast rule
EPS = float(np.finfo(np.float64).eps)
_NO_TABLE = PowerProfile(1.0).pieces()


class Rule(NamedTuple):
    """One case, with virgin image, stick radius c, `level` = g0(c), eta = 1 - g0(c), and `rest` = exp(-xi N / a(c))."""

    image: Image
    c: float
    level: float
    eta: float
    rest: float


class Quadrature(NamedTuple):
    """Gauss nodes on [0, 1], and the ends of the pieces of integration: c, three radii between c and 1, and 1."""

    abscissa: FloatArray
    weight: FloatArray
    cuts: FloatArray


def limit_radius(profile: Profile, stick_radius: float) -> float:
    """Return a(c), the root of int_c^a (1 - g0) / sqrt(a^2 - x^2) dx = 0 (thesis eq. 6.10)."""
    check_stick_radius(stick_radius)
    radius = float(_limit_radius(_rule(profile, stick_radius, 0.0), profile.largest_radius, _quadrature()))
    if np.isnan(radius):
        raise beyond_table(profile, stick_radius)
    return radius


def limit(profile: Profile, stick_radius: float) -> Worn:
    """Return the limiting profile at constant depth, with the image g = g0 up to c, and g = 1 beyond c.

    Examples
    --------
    >>> from mdr_dask.physics.mdr.revolution import PowerProfile
    >>> worn = limit(PowerProfile(2.0), stick_radius=0.5)
    >>> print(f"{worn.contact_radius:.4f} {worn.wear_volume:.4f}")
    1.2298 0.7593
    """
    radius = limit_radius(profile, stick_radius)
    return _worn(profile, _rule(profile, stick_radius, 0.0), radius, stick_radius)


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
    radius = limit_radius(profile, stick_radius)
    rest = max(math.exp(-xi * cycles / radius), EPS)  # a smaller value would be lost to rounding at the stick border
    return _worn(profile, _rule(profile, stick_radius, rest), radius, 1.0)


def limit_cases(exponent: ArrayLike, stick_radius: ArrayLike) -> FloatArray:
    """Return contact radius, wear volume and normal force of limiting profiles of power-law bodies, shape (3, ...)."""
    parts = np.broadcast_arrays(exponent, stick_radius)
    cases = np.array([np.ravel(part) for part in parts], dtype=float)
    return _limits(cases, _NO_TABLE, _quadrature()).reshape((3, *parts[0].shape))


def fast_cases(
    exponent: ArrayLike, stick_radius: ArrayLike, cycles: ArrayLike, xi: ArrayLike, limit_radius: ArrayLike
) -> FloatArray:
    """Return scar radius, wear volume and normal force of power-law bodies by the fast rule, shape (3, ...).

    `limit_radius` is a(c).
    """
    parts = np.broadcast_arrays(exponent, stick_radius, cycles, xi, limit_radius)
    cases = np.array([np.ravel(part) for part in parts], dtype=float)
    return _fasts(cases, _NO_TABLE, _quadrature()).reshape((3, *parts[0].shape))


def _quadrature() -> Quadrature:
    return Quadrature(*gauss(16), np.empty(5))  # 16 nodes are sufficient for the accuracy `ERROR`


def _rule(profile: Profile, c: float, rest: float) -> Rule:
    eta = float(profile.rise(np.array(1.0 - c), c))
    return Rule(profile.pieces(), c, float(profile.image(np.array(c))), eta, rest)


def _worn(profile: Profile, rule: Rule, radius: float, edge: float) -> Worn:
    """Return the worn contact that carries load up to the radius `edge`."""
    quadrature = _quadrature()
    radius, volume, force = _numbers(rule, radius, quadrature)
    c, eta, rest = rule.c, rule.eta, rule.rest

    def change(x: FloatArray) -> FloatArray:
        return _changes(rule, x.ravel()).reshape(x.shape)

    def slope(x: FloatArray) -> FloatArray:
        start = profile.rise(np.maximum(x - c, 0.0), c) / eta
        left = start + (1.0 - start) * rest
        inside = np.where(left > 0.0, rest / np.maximum(left, 1e-100) ** 2, 0.0) - 1.0
        return np.asarray(profile.image_slope(x) * np.where(x <= 1.0, inside, rest - 1.0))

    scar = Scar(c, radius, change, slope, tuple(float(cut) for cut in quadrature.cuts[1:] if cut > c))
    return replace(worn_by(profile, scar, c, edge, 1.0, force, volume), relative_error=ERROR)


@jit_inline
def _change(rule: Rule, gap: float) -> float:
    """Return g - g0 at c + gap."""
    rise = image_rise(rule.image, rule.c, rule.level, gap)
    if rule.rest == 0.0:
        return rule.eta - rise
    if rule.c + gap > 1.0:
        return (rise - rule.eta) * (rule.rest - 1.0)
    start = rise / rule.eta
    left = start + (1.0 - start) * rule.rest
    return rule.eta * start * (1.0 - start) * (1.0 - rule.rest) / left


@jit
def _changes(rule: Rule, places: FloatArray) -> FloatArray:
    result = np.empty(places.size)
    for k in range(places.size):
        result[k] = _change(rule, max(places[k] - rule.c, 0.0))
    return result


@jit
def _put_cuts(rule: Rule, cuts: FloatArray) -> None:
    """Write the ends of the pieces of integration to `cuts`: c, the radius with y = 1/2, two larger radii, and 1."""
    low, high, level = 0.0, 1.0 - rule.c, rule.eta * rule.rest / (1.0 + rule.rest)
    if rule.rest == 0.0:
        high = 0.0
    elif rule.image.knots.size == 0:
        high = rule.c * math.expm1(math.log1p(level / rule.level) / rule.image.exponent)
    else:
        for _ in range(60):
            middle = 0.5 * (low + high)
            if image_rise(rule.image, rule.c, rule.level, middle) < level:
                low = middle
            else:
                high = middle
    cuts[0], cuts[1] = rule.c, min(rule.c + high, 1.0)
    for piece in range(2, 4):
        cuts[piece] = min(rule.c + LAYER_GROWTH * (cuts[piece - 1] - rule.c), 1.0)
    cuts[4] = 1.0


@jit
def _scar_integral(rule: Rule, radius: float, moment: int, quadrature: Quadrature) -> float:
    """Return int_c^R (g - g0) (R^2 - x^2)^(moment - 1/2) dx for R = `radius`, piece by piece between the cuts."""
    abscissa, weight, cuts = quadrature
    total, end = 0.0, _angle(cuts[0], radius)
    for piece in range(cuts.size):
        last = piece + 1 == cuts.size or cuts[piece + 1] >= radius
        if not last and cuts[piece + 1] <= cuts[piece]:
            continue
        begin = 0.0 if last else _angle(cuts[piece + 1], radius)
        part = 0.0
        for k in range(abscissa.size):
            angle = begin + (end - begin) * abscissa[k]
            term = _change(rule, max(radius * math.cos(angle) - rule.c, 0.0)) * weight[k]
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
def _scar_radius(
    rule: Rule, low: float, low_value: float, high: float, high_value: float, quadrature: Quadrature
) -> float:
    """Return a radius between `low` and `high` at which `_scar_integral` vanishes, or `high` if there is no such
    radius.

    `low_value` and `high_value` are the values of the integral at `low` and `high`. The root is found by the method of
    false position with the improvement by Anderson and Björck.
    """
    if not high_value < 0.0 < low_value:
        return high
    radius, replaced = (low * high_value - high * low_value) / (high_value - low_value), 0
    for _ in range(100):
        value, last = _scar_integral(rule, radius, 0, quadrature), radius
        share = 1.0 - value / (low_value if value > 0.0 else high_value)
        share = share if share > 0.0 else 0.5
        if value > 0.0:
            high_value *= share if replaced < 0 else 1.0
            low, low_value, replaced = radius, value, -1
        else:
            low_value *= share if replaced > 0 else 1.0
            high, high_value, replaced = radius, value, 1
        radius = (low * high_value - high * low_value) / (high_value - low_value)
        if abs(value) < SCAR * rule.eta or abs(radius - last) < 2.0 * EPS * radius:
            break
    return radius


@jit
def _limit_radius(rule: Rule, largest: float, quadrature: Quadrature) -> float:
    """Return a(c) for a rule with `rest` = 0, or NaN if a(c) exceeds the largest radius."""
    _put_cuts(rule, quadrature.cuts)
    low, high = 1.0, min(1.5, largest)
    low_value, high_value = _scar_integral(rule, low, 0, quadrature), _scar_integral(rule, high, 0, quadrature)
    while high_value > 0.0:
        if high == largest:
            return np.nan
        low, low_value, high = high, high_value, min(1.5 * high, largest)
        high_value = _scar_integral(rule, high, 0, quadrature)
    return _scar_radius(rule, low, low_value, high, high_value, quadrature)


@jit
def _numbers(rule: Rule, limit: float, quadrature: Quadrature) -> tuple[float, float, float]:
    """Return scar radius, volume and normal force. Write the ends of the pieces of integration to `quadrature`."""
    abscissa, weight, cuts = quadrature
    _put_cuts(rule, cuts)
    radius = limit
    if rule.rest > 0.0:
        first, last = _scar_integral(rule, 1.0, 0, quadrature), _scar_integral(rule, limit, 0, quadrature)
        radius = _scar_radius(rule, 1.0, first, limit, last, quadrature)
    volume = 4.0 * _scar_integral(rule, radius, 1, quadrature)
    load, worn = _sticking_load(rule, abscissa, weight), 0.0
    for piece in range(4 if rule.rest > 0.0 else 0):  # in the limiting profile, the slip zone carries no load
        width = cuts[piece + 1] - cuts[piece]
        for k in range(abscissa.size):
            gap = cuts[piece] - rule.c + width * abscissa[k]
            unworn = rule.eta - image_rise(rule.image, rule.c, rule.level, gap)
            worn += weight[k] * width * (unworn - _change(rule, gap))
    return radius, volume, 2.0 * (load + worn)


@jit
def _sticking_load(rule: Rule, abscissa: FloatArray, weight: FloatArray) -> float:
    """Return int_0^c (1 - g0) dx."""
    if rule.image.knots.size == 0:
        return rule.c * (1.0 - rule.level / (rule.image.exponent + 1.0))
    load = 0.0
    for k in range(abscissa.size):
        share = weight[k] * 4.0 * rule.c * abscissa[k] ** 3  # x = c t^4 makes a power law smooth at the axis
        place = rule.c * abscissa[k] ** 4
        load += share * (rule.eta - image_rise(rule.image, rule.c, rule.level, place - rule.c))
    return load


@jit
def _limits(cases: FloatArray, no_table: Image, quadrature: Quadrature) -> FloatArray:
    """Return scar radius, volume and force of limiting profiles. The rows of `cases` are n and c."""
    result = np.empty((3, cases.shape[1]))
    for k in range(cases.shape[1]):
        rule = _power_rule(no_table, cases[0, k], cases[1, k], 0.0)
        radius = _limit_radius(rule, np.inf, quadrature)
        result[0, k], result[1, k], result[2, k] = _numbers(rule, radius, quadrature)
    return result


@jit
def _fasts(cases: FloatArray, no_table: Image, quadrature: Quadrature) -> FloatArray:
    """Return scar radius, volume and force by the fast rule. The rows of `cases` are n, c, N, xi and a(c)."""
    result = np.empty((3, cases.shape[1]))
    for k in range(cases.shape[1]):
        n, c, cycles, xi, limit = cases[0, k], cases[1, k], cases[2, k], cases[3, k], cases[4, k]
        rule = _power_rule(no_table, n, c, max(math.exp(-xi * cycles / limit), EPS))
        result[0, k], result[1, k], result[2, k] = _numbers(rule, limit, quadrature)
    return result


@jit
def _power_rule(no_table: Image, exponent: float, c: float, rest: float) -> Rule:
    image = Image(exponent, no_table.knots, no_table.coefficients)
    return Rule(image, c, math.pow(c, exponent), -math.expm1(exponent * math.log(c)), rest)
