"""The fast rule under constant force: the logistic law with the depth that keeps the force.

With y = 1 - (d - g) / eta, negative where the contact sticks, the rule of thesis eq. 6.11 reads at every x

    dy/dN = (xi / a) q (1 - y) - (dd/dN) / eta,    q = max(y, 0) for y < 1,  1 beyond,

and the force on the first contact stays if dd/dN = (xi / a) eta int_0^1 max(y, 0) (1 - y) dx. As d depends on N
alone, it is found once for a few dozen places. Any other place follows it by its first y alone, in a table that crowds
where contact turns into stick. a is the a(c) of constant depth.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.mdr.revolution import Profile, bisect
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear.rules import THESIS_XI, limit_radius
from mdr_dask.physics.wear.worn import Scar, Worn, virgin_load, worn_by, worn_height


class Settings(NamedTuple):
    """Tuned numbers; `tests/physics/wear/test_forced.py` halves the step.

    Parameters
    ----------
    step, last : float
        Step of the classical Runge-Kutta rule in xi N / a, and where nothing changes any more.
    error : float
        Error of every output over its largest value: that of the rule's own equation, no more.
    crowd : int
        Places of the table whenever the distance from the border of stick doubles.
    """

    step: float = 0.0125
    last: float = 60.0
    error: float = 1e-4
    crowd: int = 24


SETTINGS = Settings()


def fast_forced(profile: Profile, stick_radius: float, cycles: float, xi: float = THESIS_XI) -> Worn:
    """Return the worn contact under constant force by the fast rule.

    Parameters
    ----------
    profile : Profile
        The virgin body.
    stick_radius : float
        The first c, between 0 and 1.
    cycles : float
        N >= 0.
    xi : float
        Factor of the order of one.

    Returns
    -------
    Worn
        With the depth and the border up to which the contact sticks.
    """
    c, reach = stick_radius, limit_radius(profile, stick_radius)
    eta = float(profile.rise(np.array(1.0 - c), c))
    step, stages, load = _depth_stages(profile, c, eta, min(xi * cycles / reach, SETTINGS.last))
    rise = float(stages[:, 4].sum())
    followed = _followed(stages, step)
    steepness = followed.derivative()

    def share(x: FloatArray) -> FloatArray:
        return np.asarray(followed(profile.rise(x - c, c) / eta))

    def change(x: FloatArray) -> FloatArray:
        return np.asarray(eta * (rise + share(x)) - profile.rise(x - c, c))

    def slope(x: FloatArray) -> FloatArray:
        return np.asarray(profile.image_slope(x) * (steepness(profile.rise(x - c, c) / eta) - 1.0))

    border = bisect(lambda x: float(share(np.array(x))[()]), c, 1.0) if rise > 0.0 else c
    quarterings = _quarterings(step * len(stages))
    near = (*(border + (1.0 - border) * 0.25**k for k in range(1, quarterings)), border, 1.0)
    breaks = tuple(sorted({*near, *(border - (border - c) * 0.25**k for k in range(1, quarterings - 4))} - {c}))
    whole = Scar(c, reach, change, slope, breaks)

    def fall(radius: float) -> float:
        return -float(worn_height(whole, np.array([radius]))[0])

    high = reach
    while fall(high) < 0.0 and high < profile.largest_radius:
        high = min(1.3 * high, profile.largest_radius)
    scar = whole._replace(radius=bisect(fall, 1.0, high) if cycles > 0.0 else 1.0)
    reached = scar.radius > 1.0
    edge = bisect(lambda x: float(share(np.array(x))[()]) - 1.0, border, scar.radius) if reached else 1.0
    force = 2.0 * (virgin_load(profile, c) + eta * load)
    worn = worn_by(profile, scar, border, edge, 1.0 + eta * rise, force)
    return replace(worn, relative_error=SETTINGS.error)


def _quarterings(duration: float) -> int:
    """Return how often what is left to the border is quartered, down to where a change of the image is a jump.

    Differences between radii grow as exp(t) there; a quadrature with fixed pieces misses up to 4 % of the load.
    """
    return int(np.clip(np.ceil(duration / np.log(4.0)) + 3, 8, 17))


def _depth_stages(profile: Profile, c: float, eta: float, duration: float) -> tuple[float, FloatArray, float]:
    """Return length of the steps, for each four rates and growth of d / eta, and the load of the virgin slip zone."""
    abscissa, weight = gauss(24)
    cuts = np.array([0.0, 0.02, 0.1, 0.3, 1.0])
    widths = np.diff(cuts)
    gaps = (1.0 - c) * (cuts[:-1, None] + widths[:, None] * abscissa).ravel()
    weights = (1.0 - c) * (widths[:, None] * weight).ravel()
    y = profile.rise(gaps, c) / eta
    load = float((1.0 - y) @ weights)
    stages = np.zeros((int(np.ceil(duration / SETTINGS.step)), 5))
    step = duration / max(stages.shape[0], 1)
    _advance(y, weights, step, stages)
    return step, stages, load


@jit
def _rate(y: float) -> float:
    if y >= 1.0:
        return 1.0 - y
    return max(y, 0.0) * (1.0 - y)


@jit
def _rate_slope(y: float) -> float:
    if y >= 1.0:
        return -1.0
    return 1.0 - 2.0 * y if y > 0.0 else 0.0


@jit
def _growth(y: FloatArray, weights: FloatArray) -> float:
    total = 0.0
    for k in range(y.size):
        if y[k] < 1.0:
            total += weights[k] * _rate(y[k])
    return total


@jit
def _advance(y: FloatArray, weights: FloatArray, step: float, stages: FloatArray) -> None:
    """Advance y at the places by the classical Runge-Kutta rule; keep the four rates of the depth of every step."""
    middle, slopes = np.empty_like(y), np.empty((4, y.size))
    for number in range(stages.shape[0]):
        for stage in range(4):
            share = 0.0 if stage == 0 else (step if stage == 3 else 0.5 * step)
            for k in range(y.size):
                middle[k] = y[k] + (share * slopes[stage - 1, k] if stage > 0 else 0.0)
            growth = _growth(middle, weights)
            stages[number, stage] = growth
            for k in range(y.size):
                slopes[stage, k] = _rate(middle[k]) - growth
        for k in range(y.size):
            y[k] += step / 6.0 * (slopes[0, k] + 2.0 * (slopes[1, k] + slopes[2, k]) + slopes[3, k])
        s = stages[number]
        s[4] = step / 6.0 * (s[0] + 2.0 * (s[1] + s[2]) + s[3])


def _followed(stages: FloatArray, step: float) -> CubicHermiteSpline:
    """Return y at the end as a function of y at the start, from 0 to where it still lies beyond the contact."""

    def end(first: float) -> float:
        y = np.array([first])
        _follow(stages, step, y, np.ones(1))
        return float(y[0])

    border = bisect(end, 0.0, 1.0) if stages.size else 0.0
    doublings = 2.0 ** (np.arange(-50 * SETTINGS.crowd, 0) / SETTINGS.crowd)
    farther = 2.0 ** (np.arange(SETTINGS.crowd * (8.0 + step * len(stages) / np.log(2.0))) / SETTINGS.crowd)
    places = np.unique([0.0, *(border * (1.0 - doublings)), border, *(border + doublings), *(border + farther)])
    y, steepness = places.copy(), np.ones_like(places)
    _follow(stages, step, y, steepness)
    return CubicHermiteSpline(places, y, steepness)


@jit
def _follow(stages: FloatArray, step: float, y: FloatArray, steepness: FloatArray) -> None:
    """Advance y at any places under the depths found, and its derivative by its first value."""
    for number in range(stages.shape[0]):
        s = stages[number]
        for k in range(y.size):
            one, by_one = _rate(y[k]) - s[0], _rate_slope(y[k])
            place, by_place = y[k] + 0.5 * step * one, 1.0 + 0.5 * step * by_one
            two, by_two = _rate(place) - s[1], _rate_slope(place) * by_place
            place, by_place = y[k] + 0.5 * step * two, 1.0 + 0.5 * step * by_two
            three, by_three = _rate(place) - s[2], _rate_slope(place) * by_place
            place, by_place = y[k] + step * three, 1.0 + step * by_three
            four, by_four = _rate(place) - s[3], _rate_slope(place) * by_place
            y[k] += step / 6.0 * (one + 2.0 * (two + three) + four)
            steepness[k] *= 1.0 + step / 6.0 * (by_one + 2.0 * (by_two + by_three) + by_four)
