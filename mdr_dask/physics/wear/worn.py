"""The class `Worn` for a worn contact, and the integrals for profile, pressure and volume.

The image g(x) is the MDR line of the profile f(r). Lengths are divided by a0, heights by d0, pressures by E* d0 / a0,
forces by E* d0 a0, volumes by a0^2 d0, and numbers of cycles by N0 = a0 sigma0 / (4 U0 k E*). Heights f are measured
upwards from the virgin apex. Wear increases f.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.transforms import Function, gauss
from mdr_dask.physics.refine import CLOSE, EPS

#: Attributes of `Worn` that are functions of position.
FUNCTIONS = ("height", "image", "pressure")


@dataclass(frozen=True, eq=False)
class Worn:
    """A worn contact, as returned by `rules`, `exact` and `history`.

    Parameters
    ----------
    contact_radius : float
        Radius of the wear scar, beyond which f = f0. In an exact evolution, the contact ends at the same radius. In
        `history`, radius of the contact, which may be smaller than the scar of earlier blocks.
    stick_border : float
        Radius up to which the contact sticks; 0 in gross slip.
    depth, normal_force : float
        Indentation depth d, and normal force F_N = 2 int (d - g) dx.
    wear_volume, worn_depth : float
        Wear volume V, and the largest value of f - f0.
    height, image, pressure : callable, array -> array
        f(r), g(x) and p(r). Some methods return NaN for the image outside the contact or the grid.
    relative_error : float
        Known error of every attribute, divided by the largest value of this attribute.
    radius_error : float
        Known absolute error of the contact radius and of the stick border. Solutions of different resolution may agree
        within this error by chance.
    """

    contact_radius: float
    stick_border: float
    depth: float
    normal_force: float
    wear_volume: float
    worn_depth: float
    height: Function
    image: Function
    pressure: Function
    relative_error: float = 0.0
    radius_error: float = 0.0

    def value(self, name: str, places: FloatArray) -> float | FloatArray:
        """Return an attribute. If the attribute is a function, return its values at the positions `places`."""
        found = getattr(self, name)
        return np.asarray(found(places)) if name in FUNCTIONS else float(found)

    def known_error(self, name: str) -> float:
        """Return the known relative error of an attribute. A comparison of resolutions may not reveal this error."""
        is_radius = name in ("contact_radius", "stick_border") and getattr(self, name) > 0.0
        return self.relative_error + (self.radius_error / float(getattr(self, name)) if is_radius else 0.0)


class Scar(NamedTuple):
    """The change g - g0 of the image, between the virgin stick radius c = `border` and the `radius` of the scar.

    `change` and its derivative `slope` are functions of position. Integrals are split at the positions in `breaks`,
    because the change is not smooth or varies steeply there.
    """

    border: float
    radius: float
    change: Function
    slope: Function
    breaks: tuple[float, ...] = ()


def worn_height(scar: Scar, radius: FloatArray) -> FloatArray:
    """Return the worn depth f - f0 = (2/pi) int_c^r (g - g0) / sqrt(r^2 - x^2) dx at radii r > c.

    The substitution x = r cos(phi) removes the square root.
    """
    c = scar.border
    cuts = [c, *sorted(b for b in scar.breaks if b > c)]
    total = np.zeros_like(radius)
    abscissa, weight = gauss(32 if len(cuts) < 6 else 12)
    for number, low in enumerate(cuts):
        high = np.minimum(cuts[number + 1] if number + 1 < len(cuts) else np.inf, radius)
        begin, end = _angle(high, radius), _angle(np.full_like(radius, low), radius)
        angle = begin[:, None] + (end - begin)[:, None] * abscissa
        x = np.clip(radius[:, None] * np.cos(angle), c * (1.0 + 1e-15), radius[:, None])
        total += (end - begin) * (scar.change(x) @ weight)
    return 2.0 / np.pi * total


def worn_volume(scar: Scar) -> float:
    """Return the wear volume V = 4 int_c^a (g - g0) sqrt(a^2 - x^2) dx."""
    a = scar.radius

    def weighted(x: FloatArray) -> FloatArray:
        return np.asarray(scar.change(x) * (a - x) * (a + x))

    return float(2.0 * np.pi * worn_height(scar._replace(change=weighted), np.array([a]))[0])


def closed(profile: Profile, scar: Scar, high: float = 1.5) -> Scar:
    """Return the scar with its radius, at which worn and virgin profile meet. If nothing is worn, the radius is 1.

    `high` is a first estimate of an upper bound of the radius. If the scar reaches beyond the table of the profile, a
    ValueError is raised.
    """

    def depth(radius: float) -> float:
        return float(worn_height(scar, np.array([radius]))[0])

    low, high = 1.0, min(high, profile.largest_radius)
    if not depth(low) > 0.0:
        return scar._replace(radius=low)
    while depth(high) > 0.0:
        if high >= profile.largest_radius:
            raise beyond_table(profile, scar.border)
        low, high = high, min(1.5 * high, profile.largest_radius)
    return scar._replace(radius=brentq(depth, low, high, xtol=EPS))


def worn_image(profile: Profile, scar: Scar) -> Function:
    """Return the worn image g(x). Beyond the scar, the image is continued such that f = f0."""

    def image(position: FloatArray) -> FloatArray:
        x = np.abs(position)
        result = profile.image(x)
        inside, beyond = (x > scar.border) & (x <= scar.radius), x > scar.radius
        result[inside] += scar.change(x[inside])
        result[beyond] += _change_beyond(scar, x[beyond])
        return result

    return image


def worn_profile(profile: Profile, scar: Scar) -> Function:
    """Return the worn profile f(r), which is nowhere below the virgin profile."""

    def height(radius: FloatArray) -> FloatArray:
        inside = (radius > scar.border) & (radius < scar.radius)
        result = profile.height(radius)
        result[inside] += np.maximum(worn_height(scar, radius[inside]), 0.0)
        return result

    return height


def contact_pressure(profile: Profile, scar: Scar, edge: float, depth: float, border: float) -> Function:
    """Return the pressure p(r) / (E* d0 / a0) of a contact of radius `edge` that sticks up to `border`.

    The pressure is 0 outside the contact, and infinite at the tip of a sharp body.
    """
    c = scar.border

    def slope(x: FloatArray) -> FloatArray:
        inside = np.maximum(x, c)
        return np.asarray(profile.image_slope(x) + np.where(x > c, scar.slope(inside), 0.0))

    near = np.array([border * (1.0 - EPS), border * (1.0 + EPS), edge * (1.0 - EPS)])
    before, after, last = scar.change(near)
    jumps = [(border, float(after) - (float(before) if border > c else 0.0))]
    gap = depth - float(profile.image(near[2:])[0]) - float(last)
    if abs(gap) > 1e-9:
        jumps.append((edge, gap))
    first = c if c > 0.0 else edge
    near_axis = [first * 0.03**k for k in range(1, 5)]
    cuts = [0.0, *sorted({x for x in (*near_axis, c, border, *scar.breaks) if 0.0 < x < edge}), edge]
    abscissa, weight = gauss(24 if len(cuts) < 12 else 12)
    apex_slope = slope(np.array([np.finfo(float).tiny]))[0]
    is_sharp = abs(apex_slope) > CLOSE * np.max(np.abs(slope(edge * abscissa)))

    def stress(radius: FloatArray) -> FloatArray:
        total = np.zeros_like(radius)
        inside = radius < edge
        r = np.maximum(radius[inside], 1e-100 * edge)  # so small, because p(0) - p(r) ~ r^(n - 1) for f = r^n
        sums = np.zeros_like(r)
        for low, high in pairwise(cuts):  # substitution x = r cosh(angle), piece by piece to save memory
            begin, end = (np.arccosh(np.maximum(x / r, 1.0)) for x in (low, high))
            angle = begin[:, None] + (end - begin)[:, None] * abscissa
            sums += (end - begin) * (slope(np.minimum(r[:, None] * np.cosh(angle), edge)) @ weight)
        for place, height in jumps:
            ahead = r < place
            sums[ahead] += height / np.sqrt((place - r[ahead]) * (place + r[ahead]))
        total[inside] = sums / np.pi
        if is_sharp:
            total[radius == 0.0] = np.inf
        return total

    return stress


def worn_by(
    profile: Profile, scar: Scar, border: float, edge: float, depth: float, normal_force: float, wear_volume: float
) -> Worn:
    """Return the worn contact for a scar. The contact sticks up to `border`, and carries load up to `edge`."""
    slipping = scar.border + (scar.radius - scar.border) * np.linspace(0.0, 1.0, 201)[1:-1]
    return Worn(
        contact_radius=scar.radius,
        stick_border=border,
        depth=depth,
        normal_force=normal_force,
        wear_volume=wear_volume,
        worn_depth=max(deepest(partial(worn_height, scar), slipping), 0.0),
        height=worn_profile(profile, scar),
        image=worn_image(profile, scar),
        pressure=contact_pressure(profile, scar, edge, depth, border),
    )


def deepest(depth: Function, places: FloatArray) -> float:
    """Return the maximum of the worn depth, which must have at most one maximum between two neighbouring `places`."""
    values = depth(places)
    k = int(np.argmax(values))
    bounds = places[max(k - 1, 0)], places[min(k + 1, places.size - 1)]
    found = minimize_scalar(lambda r: -float(depth(np.array([r]))[0]), bounds=bounds, method="bounded")
    return max(float(values[k]), -float(found.fun))


def _change_beyond(scar: Scar, position: FloatArray) -> FloatArray:
    """Return g - g0 outside a scar of radius a, where f = f0 and the half-integral of the change vanishes.

    The change is (2x/pi) sqrt(x^2 - a^2) int_c^a (g - g0) / ((x^2 - t^2) sqrt(a^2 - t^2)) dt. The first
    substitution is t = a cos(phi), and the second is sin(phi) = sqrt((x / a)^2 - 1) sinh(w).
    """
    c, a = scar.border, scar.radius
    s = np.sqrt((position - a) * (position + a))
    cuts = [c, *sorted(b for b in scar.breaks if c < b < a), a]
    abscissa, weight = gauss(32 if len(cuts) < 6 else 12)
    total = np.zeros_like(position)
    for low, high in pairwise(cuts):
        begin = np.arcsinh(np.sqrt(max((a - high) * (a + high), 0.0)) / s)
        end = np.arcsinh(np.sqrt((a - low) * (a + low)) / s)
        angle = begin[:, None] + (end - begin)[:, None] * abscissa
        sine = s[:, None] / a * np.sinh(angle)
        cosine = np.sqrt(np.maximum((1.0 - sine) * (1.0 + sine), 0.0))
        t = np.clip(a * cosine, c * (1.0 + 1e-15), a)
        total += (end - begin) * ((scar.change(t) / (np.cosh(angle) * np.maximum(cosine, 1e-300))) @ weight)
    return np.asarray(2.0 * position / (np.pi * a) * total)


def check_stick_radius(stick_radius: float) -> None:
    """Raise ValueError unless the stick radius lies between 0 and 1."""
    if not 0.0 < stick_radius < 1.0:
        raise ValueError(
            f"the stick radius must lie between 0 and 1 for partial slip, got {stick_radius!r}; "
            "an amplitude beyond mu E* d0 / G* causes gross slip"
        )


def beyond_table(profile: Profile, stick_radius: float) -> ValueError:
    """Return the exception for a contact that reaches beyond the table of the profile."""
    return ValueError(
        f"the contact reaches beyond the table, which ends at r = {profile.largest_radius:.4g} contact radii; "
        f"extend the table or choose a larger stick radius (a smaller amplitude) than {stick_radius:.4g}"
    )


def virgin_load(profile: Profile, radius: float) -> float:
    """Return the integral of 1 - g0 from 0 to c = `radius`. The substitution x = c t^4 makes power laws smooth."""
    abscissa, weight = gauss(64)
    return 4.0 * radius * float(((1.0 - profile.image(radius * abscissa**4)) * abscissa**3) @ weight)


def _angle(x: FloatArray, radius: FloatArray) -> FloatArray:
    """Return arccos(x / r) without cancellation near x = r."""
    return np.asarray(np.arctan2(np.sqrt(np.maximum((radius - x) * (radius + x), 0.0)), x))
