"""One factor of the wear law from measured volumes or profiles: wear coefficient, or xi of the fast rule."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.stats import t as student

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.wear import worn as wear
from mdr_dask.physics.wear.exact import exact
from mdr_dask.physics.wear.forced import exact_forced
from mdr_dask.physics.wear.forced_fast import fast_forced

#: N at which every profile has reached its limit to a millionth of d0, and later under constant force.
_ENOUGH = 60.0
_ENOUGH_FORCED = 400.0


class Factor(NamedTuple):
    """A fitted factor with its 95 % interval, the residual (root mean square) and the share of variance explained."""

    value: float
    low: float
    high: float
    residual: float
    explained: float


def volume_curve(
    profile: Profile, stick_radius: float, method: str = "exact", xi: float = 1.0, *, constant_force: bool = False
) -> CubicSpline:
    """Return V(N), by the exact or the fast rule, as a curve over ln(1 + N / 0.01).

    Parameters
    ----------
    profile : Profile
        The virgin body.
    stick_radius : float
        c.
    method : {"exact", "fast"}
        The rule.
    xi : float
        Factor of the fast rule.
    constant_force : bool
        Keep the force of the virgin contact instead of its depth.
    """
    cycles = _cycles(constant_force)
    contacts = _contacts(profile, stick_radius, method, xi, cycles, constant_force)
    return CubicSpline(_stretch(cycles), [contact.wear_volume for contact in contacts])


def profile_curve(
    profile: Profile,
    stick_radius: float,
    radius: ArrayLike,
    method: str = "exact",
    xi: float = 1.0,
    *,
    constant_force: bool = False,
) -> CubicSpline:
    """Return f(r; N) at given radii as `volume_curve` does."""
    cycles = _cycles(constant_force)
    contacts = _contacts(profile, stick_radius, method, xi, cycles, constant_force)
    return CubicSpline(_stretch(cycles), np.array([contact.height(radius) for contact in contacts]))


def at_cycles(curve: CubicSpline, cycles: ArrayLike) -> FloatArray:
    """Evaluate one of the curves; beyond its end the body has reached its limit."""
    return np.asarray(curve(np.minimum(_stretch(np.asarray(cycles, dtype=float)), curve.x[-1])))


def fit_factor(predict: Callable[[float], FloatArray], measured: ArrayLike) -> Factor:
    """Fit the factor of N by least squares in its logarithm.

    Parameters
    ----------
    predict : callable, float -> array
        What would be measured if N were multiplied by the factor.
    measured : array_like
        What was measured, of the same shape, at least two numbers.

    Returns
    -------
    Factor
        The interval is Student's, of the law linearised in the logarithm of the factor, for independent errors of equal
        size.

    Raises
    ------
    ValueError
        If there are fewer than two finite numbers, or none of them says anything about the factor.
    """
    data = np.asarray(measured, dtype=float)
    if data.size < 2 or not np.all(np.isfinite(data)):
        raise ValueError(f"a fit of wear needs at least 2 finite measurements, got {data.size!r} numbers")
    trials = np.linspace(-9.0, 9.0, 73)
    costs = [float(np.sum((predict(float(np.exp(trial))) - data) ** 2)) for trial in trials]
    start = trials[int(np.argmin(costs))]

    def deviations(unknown: FloatArray) -> FloatArray:
        return np.asarray(predict(float(np.exp(unknown[0]))) - data)

    found = least_squares(deviations, [start], method="lm", x_scale=[0.1], xtol=1e-12, ftol=1e-14)
    slope = float(np.sum(np.square(np.asarray(found.jac))))
    if slope <= 1e-12 * float(data @ data):
        raise ValueError("the measurements do not depend on the factor: the body is unworn, or worn to its limit")
    residual = float(np.sqrt(np.mean(found.fun**2)))
    deviation = np.sqrt(np.sum(found.fun**2) / (data.size - 1) / slope)
    half = float(student.ppf(0.975, data.size - 1) * deviation)
    spread = float(np.sum((data - np.mean(data)) ** 2))
    explained = 1.0 - float(np.sum(found.fun**2)) / spread if spread > 0.0 else np.nan
    value = float(found.x[0])
    return Factor(float(np.exp(value)), float(np.exp(value - half)), float(np.exp(value + half)), residual, explained)


def _cycles(constant_force: bool) -> FloatArray:
    return np.append(0.0, np.geomspace(1e-3, _ENOUGH_FORCED if constant_force else _ENOUGH, 80))


def _stretch(cycles: FloatArray) -> FloatArray:
    return np.log1p(cycles / 0.01)


def _contacts(
    profile: Profile, c: float, method: str, xi: float, cycles: FloatArray, constant_force: bool
) -> list[wear.Worn]:
    if method == "fast":
        rule = fast_forced if constant_force else wear.fast
        return [rule(profile, c, float(n), xi) for n in cycles]
    if constant_force:
        return list(exact_forced(profile, c, [float(n) for n in cycles], 1e-3))
    return list(exact(profile, c, [float(n) for n in cycles], 1e-4))
