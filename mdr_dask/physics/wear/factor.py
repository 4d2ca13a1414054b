"""One factor of the wear law from measured volumes or profiles: wear coefficient, or xi of the fast rule."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import f as fisher
from scipy.stats import t as student

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.wear import rules
from mdr_dask.physics.wear.exact import exact
from mdr_dask.physics.wear.forced_rule import fast_forced
from mdr_dask.physics.wear.worn import Worn


class Settings(NamedTuple):
    """Tuned numbers of the fit.

    Parameters
    ----------
    least, enough, enough_forced : float
        N below which wear is of the first order, and at which every profile has reached its limit to a millionth of d0,
        at constant depth and at constant force.
    curve : int
        Number of N in between at which the law is solved.
    accuracy, accuracy_forced : float
        Of the exact rule.
    reach : float
        Largest and smallest logarithm of the factor that is looked for.
    doubtful : float
        Probability of a trend in the residuals by chance, below which the law is doubted.
    within : float
        Departure of the law, rms over the data, that counts as none.
    """

    least: float = 1e-5
    enough: float = 60.0
    enough_forced: float = 400.0
    curve: int = 90
    accuracy: float = 1e-4
    accuracy_forced: float = 1e-3
    reach: float = 14.0
    doubtful: float = 0.005
    within: float = 0.05


SETTINGS = Settings()


class Law(NamedTuple):
    """A rule of wear for one body, as a function of the factor of N.

    Parameters
    ----------
    profile : Profile
        The virgin body.
    stick_radius : float
        c.
    rule : str
        ``"exact"`` or ``"fast"``.
    xi : float
        Factor of the fast rule.
    constant_force : bool
        Keep the force of the virgin contact instead of its depth.
    """

    profile: Profile
    stick_radius: float
    rule: str = "exact"
    xi: float = 1.0
    constant_force: bool = False

    def volumes(self) -> Callable[[ArrayLike], FloatArray]:
        """Return V(N): a curve of V / N, which is smooth and tends to the first order; the end is the limit."""
        cycles = self._cycles()
        curve = CubicSpline(
            np.log(cycles), [one.wear_volume / n for one, n in zip(self._at(cycles), cycles, strict=True)]
        )

        def volume(wanted: ArrayLike) -> FloatArray:
            n = np.minimum(np.asarray(wanted, dtype=float), cycles[-1])
            return np.asarray(n * curve(np.log(np.maximum(n, cycles[0]))))

        return volume

    def profiles(self, radius: ArrayLike) -> Callable[[float], FloatArray]:
        """Return f(r; N) at given radii."""
        r, cycles = np.asarray(radius, dtype=float), self._cycles()
        virgin = self.profile.height(r)
        curve = CubicSpline(
            np.log(cycles), [(one.height(r) - virgin) / n for one, n in zip(self._at(cycles), cycles, strict=True)]
        )

        def height(wanted: float) -> FloatArray:
            n = min(wanted, cycles[-1])
            return np.asarray(virgin + n * curve(np.log(max(n, cycles[0]))))

        return height

    def _cycles(self) -> FloatArray:
        enough = SETTINGS.enough_forced if self.constant_force else SETTINGS.enough
        return np.geomspace(SETTINGS.least, enough, SETTINGS.curve)

    def _at(self, cycles: FloatArray) -> Sequence[Worn]:
        if self.rule == "fast":
            fast = fast_forced if self.constant_force else rules.fast
            return [fast(self.profile, self.stick_radius, float(n), self.xi) for n in cycles]
        accuracy = SETTINGS.accuracy_forced if self.constant_force else SETTINGS.accuracy
        return exact(
            self.profile, self.stick_radius, list(cycles), accuracy, constant_force=self.constant_force, errors=False
        )


class Factor(NamedTuple):
    """A fitted factor.

    Parameters
    ----------
    value, low, high : float
        The factor and its 95 % interval; an end is 0 or infinite where the data do not bound it, NaN where the law does
        not hold.
    residual : float
        Root mean square deviation, relative, over the given errors, or absolute.
    explained : float
        Share of the variance explained, of logarithms where deviations are relative.
    law_holds : str
        Whether the law holds: yes, no or not tested, and why.
    """

    value: float
    low: float
    high: float
    residual: float
    explained: float
    law_holds: str


class Measured(NamedTuple):
    """Measurements of one kind.

    Parameters
    ----------
    data : array
        What was measured.
    errors : array, optional
        Standard errors, by which deviations are weighted.
    relative : bool
        Whether errors are equal shares of the data, where none are given; else they are equal.
    """

    data: FloatArray
    errors: FloatArray | None = None
    relative: bool = True

    def deviations(self, predicted: FloatArray) -> FloatArray:
        """Return how far the data are from what is predicted, in units of equal weight."""
        if self.errors is not None:
            return np.asarray((self.data - predicted) / self.errors)
        if self.relative:
            return np.asarray(np.log(self.data) - np.log(np.maximum(predicted, 1e-300)))
        return np.asarray(self.data - predicted)


def fit_factor(predict: Callable[[float], FloatArray], measured: Measured, order: ArrayLike) -> Factor:
    """Fit the factor of N by least squares.

    Parameters
    ----------
    predict : callable, float -> array
        What would be measured if N were multiplied by the factor.
    measured : Measured
        At least two numbers.
    order : array_like
        Cycles or radii, along which a trend of the deviations is looked for.

    Returns
    -------
    Factor
        The interval holds all factors whose sum of squares exceeds the least by up to Student's t^2 times the variance
        left, which given errors bound from below.

    Raises
    ------
    ValueError
        If there are fewer than two finite numbers, a volume is not positive, or the data say nothing about the factor.
    """
    data = measured.data
    if data.size < 2 or not np.all(np.isfinite(data)):
        raise ValueError(f"a fit of wear needs at least 2 finite measurements, got {data.size!r} numbers")
    if measured.relative and measured.errors is None and np.any(data <= 0.0):
        raise ValueError(
            f"relative deviations need positive measurements, got {float(np.min(data))!r}; leave such rows out, "
            "or give their errors in a column error"
        )

    def cost(log_factor: float) -> float:
        return float(np.sum(measured.deviations(predict(float(np.exp(log_factor)))) ** 2))

    trials = np.linspace(-SETTINGS.reach, SETTINGS.reach, 113)
    costs = np.array([cost(trial) for trial in trials])
    if np.ptp(costs) <= 1e-12 * (1.0 + float(np.max(costs))):
        raise ValueError("the measurements do not depend on the factor: the body is unworn, or worn to its limit")
    start = int(np.argmin(costs))
    ends = trials[max(start - 1, 0)], trials[min(start + 1, trials.size - 1)]
    best = float(minimize_scalar(cost, bounds=ends, method="bounded", options={"xatol": 1e-10}).x)
    deviations = measured.deviations(predict(float(np.exp(best))))
    variance = float(np.sum(deviations**2)) / (data.size - 1)
    if measured.errors is not None:
        variance = max(variance, 1.0)
    allowed = cost(best) + float(student.ppf(0.975, data.size - 1)) ** 2 * max(variance, 1e-24)
    low, high = (_crossing(cost, best, end * SETTINGS.reach, allowed) for end in (-1.0, 1.0))
    plain = measured.errors is not None or not measured.relative
    spread = measured.deviations(np.full(data.size, np.mean(data) if plain else np.exp(np.mean(np.log(data)))))
    explained = 1.0 - float(np.sum(deviations**2) / np.sum(spread**2)) if np.any(spread) else np.nan
    verdict = _verdict(deviations, measured, predict(float(np.exp(SETTINGS.reach))), np.asarray(order, dtype=float))
    if verdict.startswith("no"):
        low = high = np.nan
    elif not np.isfinite(high):
        verdict += "; the data bound the factor from below only, for the body is worn to its limit"
    elif low == 0.0:
        verdict += "; the data bound the factor from above only"
    return Factor(float(np.exp(best)), low, high, float(np.sqrt(np.mean(deviations**2))), explained, verdict)


def _crossing(cost: Callable[[float], float], best: float, end: float, allowed: float) -> float:
    """Return the factor at which the cost exceeds what is allowed; 0 or infinity if it never does."""
    places = best + np.sign(end) * np.append(0.0, np.geomspace(1e-8, abs(end - best), 120))
    for near, far in pairwise(places):
        if cost(float(far)) > allowed:
            return float(np.exp(brentq(lambda place: cost(place) - allowed, near, far)))
    return np.inf if end > 0.0 else 0.0


def _verdict(deviations: FloatArray, measured: Measured, limit: FloatArray, order: FloatArray) -> str:
    """Say whether the law holds: deviations without a trend, and no data beyond the limit of all wear."""
    number, rms = deviations.size, float(np.sqrt(np.mean(deviations**2)))
    if number < 5:
        return f"not tested: {number} measurements leave too little to compare"
    scale = np.argsort(np.argsort(order)) / (number - 1.0) - 0.5
    trend = np.vander(scale, 3)
    left = deviations - trend @ np.linalg.lstsq(trend, deviations, rcond=None)[0]
    scatter = np.sqrt(np.sum(left**2) / (number - 3))
    share = (np.sum(deviations**2) - np.sum(left**2)) / 2.0 / max(scatter**2, 1e-30)
    probability = float(fisher.sf(share, 2, number - 3))
    beyond = measured.deviations(limit)
    excess = int(np.sum(beyond > 2.5 * max(_roughness(measured, scale), 1e-3)))
    unit = " of their errors" if measured.errors is not None else (" relative" if measured.relative else " d0")
    if excess > 1:
        most = float(np.max(beyond))
        return f"no: {excess} of {number} measurements lie beyond the limit of all wear, by up to {most:.2g}{unit}"
    small = measured.errors is None and rms <= SETTINGS.within
    if probability < SETTINGS.doubtful and not small:
        return f"no: deviations of {rms:.2g}{unit} follow a trend (by chance with probability {probability:.1g})"
    return f"yes: deviations of {rms:.2g}{unit} follow no trend (probability {probability:.2g})"


def _roughness(measured: Measured, scale: FloatArray) -> float:
    """Return the scatter of the data about a smooth curve of their own, whatever the law says."""
    if measured.errors is not None:
        return 1.0
    data = np.log(measured.data) if measured.relative else measured.data
    curve = np.vander(scale, 4 if data.size > 6 else 3)
    left = data - curve @ np.linalg.lstsq(curve, data, rcond=None)[0]
    return float(np.sqrt(np.sum(left**2) / (data.size - curve.shape[1])))
