"""Fretting wear at constant depth: what a worn contact is, its limiting shape, and the fast rule of the thesis.

Units: lengths a0, heights d0, pressure E* d0 / a0, volume a0^2 d0, cycles N0 = a0 sigma0 / (4 U0 k E*). Wear raises
f, which is measured upwards from the virgin apex. The stick radius c follows from g0(c) = 1 - eta and never moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.revolution import Profile, bisect
from mdr_dask.physics.mdr.transforms import gauss, pressure

Function = Callable[[FloatArray], FloatArray]

#: Factor of the fast rule: the thesis's fit by eye. The best one lies between 0.9 and 1 (see docs/wear.md).
THESIS_XI = 0.8

#: Widths of the pieces next to the stick border, where the rule builds a layer as thin as exp(-xi N / a).
LAYER_GROWTH = 30.0

#: Floor of exp(-xi N / a): the layer must not become thinner than numbers are.
SMALLEST_REST = 1e-30


@dataclass(frozen=True, eq=False)
class Worn:
    """A worn contact, whatever method it came from.

    Parameters
    ----------
    profile : Profile
        The virgin body.
    stick_radius : float
        c.
    contact_radius : float
        Radius of the wear scar: beyond it f = f0. With the exact rule it is the contact radius a as well.
    edge : float
        Where g reaches the depth.
    wear_volume, normal_force : float
        V and F_N = int (1 - g) dx.
    error : float
        Error expected of the profile, in d0.
    change : callable
        g(x) - g0(x) for c < x < contact_radius.
    change_slope : callable
        Its derivative.
    breaks : tuple of float
        Places between c and the contact radius where `change` is not smooth.
    depth : float
        d.
    border : float, optional
        Where sticking ends, if that is beyond the first stick radius c, up to which the body is virgin.
    """

    profile: Profile
    stick_radius: float
    contact_radius: float
    edge: float
    wear_volume: float
    normal_force: float
    error: float
    change: Function
    change_slope: Function
    breaks: tuple[float, ...] = ()
    depth: float = 1.0
    border: float | None = None

    @property
    def stick_border(self) -> float:
        """Radius up to which the contact sticks."""
        return self.stick_radius if self.border is None else self.border

    def height(self, radius: ArrayLike) -> FloatArray:
        """Return the worn profile f(r)."""
        r = np.atleast_1d(np.asarray(radius, dtype=float))
        worn = (r > self.stick_radius) & (r < self.contact_radius)
        result = self.profile.height(r)
        result[worn] += np.maximum(worn_height(self.change, self.stick_radius, r[worn], self.breaks), 0.0)
        return result

    def image(self, position: ArrayLike) -> FloatArray:
        """Return the worn image g(x); beyond the scar it is the one that leaves f = f0 there."""
        x = np.abs(np.atleast_1d(np.asarray(position, dtype=float)))
        result = self.profile.image(x)
        scar = (x > self.stick_radius) & (x <= self.contact_radius)
        result[scar] += self.change(x[scar])
        beyond = x > self.contact_radius
        result[beyond] += change_beyond(self.change, self.stick_radius, self.contact_radius, x[beyond], self.breaks)
        return result

    def pressure(self, radius: ArrayLike) -> FloatArray:
        """Return p(r) / (E* d0 / a0), zero outside the contact."""
        c, border = self.stick_radius, self.stick_border

        def slope(x: FloatArray) -> FloatArray:
            inside = np.maximum(x, c)
            return np.asarray(self.profile.image_slope(x) + np.where(x > c, self.change_slope(inside), 0.0))

        near = np.array([border * (1.0 - 1e-13), border * (1.0 + 1e-13), self.edge * (1.0 - 1e-13)])
        before, after, last = self.change(near)
        jump = float(after) - (float(before) if border > c else 0.0)
        gap = self.depth - float(self.profile.image(near[2:])[0]) - float(last)
        return pressure(
            slope,
            radius,
            self.edge,
            edge_gap=gap if abs(gap) > 1e-9 else 0.0,
            breaks=(c, *self.breaks, *self.profile.breaks),
            jumps=[(border, jump)],
            tolerance=1e-8,
        ).value

    def worn_depth(self) -> float:
        """Return the largest f - f0."""
        c, a = self.stick_radius, self.contact_radius
        r = c + (a - c) * np.linspace(0.0, 1.0, 201)[1:-1]
        return float(np.max(worn_height(self.change, c, r, self.breaks), initial=0.0))


def check_stick_radius(stick_radius: float) -> None:
    """Raise ValueError unless there is partial slip."""
    if not 0.0 < stick_radius < 1.0:
        raise ValueError(
            f"the stick radius must lie between 0 and 1 for partial slip, got {stick_radius!r}; "
            "an amplitude beyond mu E* d0 / G* is gross slip"
        )


def worn_height(change: Function, c: float, radius: FloatArray, breaks: tuple[float, ...] = ()) -> FloatArray:
    """Return f - f0 = (2/pi) int_c^r (g - g0) / sqrt(r^2 - x^2) dx, by x = r cos(phi), at r > c."""
    cuts = [c, *sorted(b for b in breaks if b > c)]
    total = np.zeros_like(radius)
    abscissa, weight = gauss(32 if len(cuts) < 6 else 12)
    for number, low in enumerate(cuts):
        high = np.minimum(cuts[number + 1] if number + 1 < len(cuts) else np.inf, radius)
        begin, end = _angle(high, radius), _angle(np.full_like(radius, low), radius)
        angle = begin[:, None] + (end - begin)[:, None] * abscissa
        x = np.clip(radius[:, None] * np.cos(angle), c * (1.0 + 1e-15), radius[:, None])
        total += (end - begin) * (change(x) @ weight)
    return 2.0 / np.pi * total


def worn_volume(change: Function, c: float, a: float, breaks: tuple[float, ...] = ()) -> float:
    """Return V = 4 int_c^a (g - g0) sqrt(a^2 - x^2) dx."""

    def weighted(x: FloatArray) -> FloatArray:
        return np.asarray(change(x) * (a - x) * (a + x))

    return float(2.0 * np.pi * worn_height(weighted, c, np.array([a]), breaks)[0])


def change_beyond(
    change: Function, c: float, a: float, position: FloatArray, breaks: tuple[float, ...] = ()
) -> FloatArray:
    """Return g - g0 outside a scar of radius a, where f = f0.

    The half-integral that vanishes beyond a continues the image uniquely:
    (2x/pi) sqrt(x^2 - a^2) int_c^a (g - g0) / ((x^2 - t^2) sqrt(a^2 - t^2)) dt, by sin(phi) = (s/a) sinh(w).
    """
    s = np.sqrt((position - a) * (position + a))
    cuts = [c, *sorted(b for b in breaks if c < b < a), a]
    abscissa, weight = gauss(32 if len(cuts) < 6 else 12)
    total = np.zeros_like(position)
    for low, high in pairwise(cuts):
        begin = np.arcsinh(np.sqrt(max((a - high) * (a + high), 0.0)) / s)
        end = np.arcsinh(np.sqrt((a - low) * (a + low)) / s)
        angle = begin[:, None] + (end - begin)[:, None] * abscissa
        sine = s[:, None] / a * np.sinh(angle)
        cosine = np.sqrt(np.maximum((1.0 - sine) * (1.0 + sine), 0.0))
        t = np.clip(a * cosine, c * (1.0 + 1e-15), a)
        total += (end - begin) * ((change(t) / (np.cosh(angle) * np.maximum(cosine, 1e-300))) @ weight)
    return np.asarray(2.0 * position / (np.pi * a) * total)


def limit_radius(profile: Profile, stick_radius: float) -> float:
    """Return a(c): the root of int_c^a (1 - g0) / sqrt(a^2 - x^2) dx = 0 (thesis eq. 6.10, exact).

    Raises
    ------
    ValueError
        Without partial slip, or if the scar would reach beyond the table of the profile.
    """
    check_stick_radius(stick_radius)

    def excess(a: float) -> float:
        return -float(worn_height(lambda x: 1.0 - profile.image(x), stick_radius, np.array([a]), profile.breaks)[0])

    high = min(2.0, profile.largest_radius)
    while excess(high) < 0.0:
        if high == profile.largest_radius:
            raise ValueError(
                f"the contact reaches beyond the table, which ends at r = {profile.largest_radius:.4g} contact radii; "
                f"extend it, got stick radius {stick_radius!r}"
            )
        high = min(2.0 * high, profile.largest_radius)
    return float(brentq(excess, 1.0, high, xtol=1e-15, rtol=4.0 * np.finfo(float).eps))


def limit(profile: Profile, stick_radius: float) -> Worn:
    """Return the shape that ends all wear: g = g0 up to c, then 1 (thesis eqs. 6.8-6.10)."""
    a, c = limit_radius(profile, stick_radius), stick_radius

    def change(x: FloatArray) -> FloatArray:
        return 1.0 - profile.image(x)

    force = 2.0 * _integral(lambda x: 1.0 - profile.image(x), 0.0, c)
    volume = worn_volume(change, c, a, profile.breaks)
    return Worn(profile, c, a, c, volume, force, 1e-12, change, lambda x: -profile.image_slope(x), profile.breaks)


def fast(profile: Profile, stick_radius: float, cycles: float, xi: float = THESIS_XI) -> Worn:
    """Return the worn contact by the fast rule (thesis eq. 6.11), integrated in closed form.

    Inside the first contact y = (g - g_c) / eta follows a logistic law, outside it g - 1 decays; both with the
    exponent xi N / a(c). The profile is cut where it would fall below the virgin one.

    Parameters
    ----------
    profile : Profile
        The virgin body.
    stick_radius : float
        c, between 0 and 1.
    cycles : float
        N >= 0.
    xi : float
        Factor of the order of one.
    """
    c, reach = stick_radius, limit_radius(profile, stick_radius)
    rest = max(float(np.exp(-xi * cycles / reach)), SMALLEST_REST)
    eta = float(profile.rise(np.array(1.0), c))

    def change(x: FloatArray) -> FloatArray:
        start = profile.rise(x, c) / eta
        inside = eta * start * (1.0 - start) * (1.0 - rest) / (start + (1.0 - start) * rest)
        return np.asarray(np.where(x <= 1.0, inside, (profile.image(x) - 1.0) * (rest - 1.0)))

    def slope(x: FloatArray) -> FloatArray:
        start = profile.rise(x, c) / eta
        inside = rest / (start + (1.0 - start) * rest) ** 2 - 1.0
        return np.asarray(profile.image_slope(x) * np.where(x <= 1.0, inside, rest - 1.0))

    steep = profile.inside(1.0 - eta + eta * rest / (1.0 + rest))
    layers = [c + (steep - c) * LAYER_GROWTH**power for power in range(3)]
    breaks = (*(b for b in layers if c < b < 1.0), 1.0)
    scar = _scar_edge(change, c, reach, breaks)
    force = 2.0 * _integral(lambda x: 1.0 - profile.image(x), 0.0, 1.0)
    force -= 2.0 * sum(_integral(change, low, high) for low, high in zip((c, *breaks[:-1]), breaks, strict=True))
    volume = worn_volume(change, c, scar, breaks)
    return Worn(profile, c, scar, 1.0, volume, force, 1e-9, change, slope, breaks)


def parabola_limit_radius(half_angle: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return (c, a) of a parabola as functions of t = arccos(c/a): a = sqrt(2 / (1 + sin(2t)/(2t)))."""
    t = np.asarray(half_angle, dtype=float)
    a = np.sqrt(2.0 / (1.0 + np.sinc(2.0 * t / np.pi)))
    return np.asarray(a * np.cos(t)), a


def cone_limit_radius(half_angle: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return (c, a) of a cone as functions of t = arccos(c/a): a = t / sin(t), c = t cot(t) (thesis eq. 6.17)."""
    t = np.asarray(half_angle, dtype=float)
    a = 1.0 / np.sinc(t / np.pi)
    return np.asarray(a * np.cos(t)), np.asarray(a)


def printed_parabola_limit(stick_radius: ArrayLike) -> FloatArray:
    """Return a(c) as printed in thesis eq. 6.16, sqrt(2 + c^2/4) - c/2: an approximation, up to 3.6 % low."""
    half = 0.5 * np.asarray(stick_radius, dtype=float)
    return np.asarray(np.sqrt(2.0 + half**2) - half)


def _scar_edge(change: Function, c: float, reach: float, breaks: tuple[float, ...]) -> float:
    """Return where the transformed change crosses zero, at most a(c)."""

    def fall(radius: float) -> float:
        return -float(worn_height(change, c, np.array([radius]), breaks)[0])

    return bisect(fall, 1.0, reach) if fall(reach) > 0.0 else reach


def _integral(function: Function, low: float, high: float) -> float:
    abscissa, weight = gauss(32)
    return float((high - low) * (function(low + (high - low) * abscissa) @ weight))


def _angle(x: FloatArray, radius: FloatArray) -> FloatArray:
    """Return arccos(x / r) without cancellation near x = r."""
    return np.asarray(np.arctan2(np.sqrt(np.maximum((radius - x) * (radius + x), 0.0)), x))
