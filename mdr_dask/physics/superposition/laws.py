"""Laws of shift factors: power of velocity, Arrhenius, and Williams, Landel and Ferry, fitted with their covariance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import chdtrc, stdtrit

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.physics.solids import GAS_CONSTANT

CONFIDENCE = 0.95
ITERATIONS, CONVERGED = 40, 1e-12
"""Gauss-Newton steps at most, and the change of the sum of squares, relative to itself, at which they end."""

RIDGE = 1e-12
"""Added to the precision of the constants, relative to it, so that a step is finite where they cannot be told apart."""

NEGLIGIBLE = 1e-3
"""Scatter about a law over the least error of the factors, below which there is none."""

STRAIGHTEST = 1e-5
"""Span of the temperatures over c2, below which factors are as good as linear in temperature."""

Law = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""From constants to factors and their derivatives, shape (groups, constants)."""


@dataclass(frozen=True)
class ShiftLaw:
    """A law fitted to shift factors.

    Parameters
    ----------
    name : str
        ``power``, ``arrhenius`` or ``wlf``.
    constants : dict of str to (value, low, high)
        With 95 % intervals: ``exponent``; ``activation_energy`` in J/mol; ``c1`` and ``c2`` (K).
    residual : float
        Root mean square distance of the factors from the law, decades.
    scatter : float
        Standard deviation about the law beyond the errors of the factors, decades; 0 where the errors explain the
        distance.
    departures : array, shape (groups,)
        Factors less those of the law, decades.
    chance : float
        Probability of such departures by the errors of the factors alone.
    """

    name: str
    constants: dict[str, tuple[float, float, float]]
    residual: float
    scatter: float
    departures: FloatArray
    chance: float


def fit_power(groups: FloatArray, factors: FloatArray, covariance: FloatArray, reference: float) -> ShiftLaw:
    """Fit ``factor = exponent log10(group / reference)`` to factors that are zero at the reference.

    Parameters
    ----------
    groups : array, shape (groups,)
        Positive numbers, such as velocities.
    factors, covariance : arrays, shapes (groups,) and (groups, groups)
        Shift factors, decades; the covariance is singular at the reference.
    reference : float
        Group of the reference.

    Raises
    ------
    FitError
        If there are too few factors or the groups are not positive.
    """
    if np.any(groups <= 0) or reference <= 0:
        raise FitError("a power law needs positive groups, such as velocities")
    distance = np.log10(groups / reference)
    fitted = _fit("power", _proportional(distance), np.array([_slope(distance, factors)]), factors, covariance)
    return fitted.law("power", {"exponent": fitted.interval(0)})


def fit_arrhenius(
    temperature: FloatArray, log_factors: FloatArray, covariance: FloatArray, reference: float
) -> ShiftLaw:
    """Fit ``log10 a_T = E / (R ln 10) (1/T - 1/T_ref)``, temperatures in K; see `fit_power`."""
    if np.any(temperature <= 0) or reference <= 0:
        raise FitError("the law of Arrhenius needs absolute temperatures")
    distance = (1 / temperature - 1 / reference) / (GAS_CONSTANT * np.log(10))
    guess = np.array([_slope(distance, log_factors)])
    fitted = _fit("arrhenius", _proportional(distance), guess, log_factors, covariance)
    return fitted.law("arrhenius", {"activation_energy": fitted.interval(0)})


def fit_wlf(temperature: FloatArray, log_factors: FloatArray, covariance: FloatArray, reference: float) -> ShiftLaw:
    """Fit ``log10 a_T = -c1 (T - T_ref) / (c2 + T - T_ref)``; see `fit_power`. Temperatures in K or in degrees
    Celsius.
    """
    distance = temperature - reference
    lowest = float(max(0.0, -distance.min()))
    bounds = STRAIGHTEST / float(np.ptp(distance)), (1 - 1e-9) / lowest if lowest > 0 else np.inf

    def law(constants: FloatArray) -> tuple[FloatArray, FloatArray]:
        """With the slope c1 / c2 and the bend 1 / c2, which both stay finite where the factors are linear."""
        slope, bend = constants[0], float(np.clip(constants[1], *bounds))
        share = distance / (1 + bend * distance)
        return -slope * share, np.column_stack([-share, slope * share**2])

    guess = np.array([-_slope(distance, log_factors), 1 / (lowest + float(np.ptp(distance)))])
    fitted = _fit("wlf", law, guess, log_factors, covariance)
    slope, bend = float(fitted.constants[0]), float(np.clip(fitted.constants[1], *bounds))
    c1, c2 = slope / bend, 1 / bend
    if bend == bounds[0]:  # as good as linear: neither constant has an end above
        least = 1 / min(bend + fitted.quantile * float(np.sqrt(fitted.covariance[1, 1])), bounds[1])
        first, last = sorted([slope * least, float(np.copysign(np.inf, slope))])
        constants = {"c1": (c1, first, last), "c2": (c2, least, np.inf)}
        return fitted.law("wlf", constants)
    change = np.array([[1 / bend, -slope / bend**2], [0.0, -1 / (bend**2 * (c2 - lowest))]])
    half = fitted.quantile * np.sqrt(np.diag(change @ fitted.covariance @ change.T))
    ends = lowest + (c2 - lowest) * np.exp(np.clip([-half[1], half[1]], -700, 700))
    constants = {"c1": (c1, c1 - float(half[0]), c1 + float(half[0])), "c2": (c2, float(ends[0]), float(ends[1]))}
    return fitted.law("wlf", constants)


def _slope(distance: FloatArray, factors: FloatArray) -> float:
    return float(distance @ factors / (distance @ distance))


def _proportional(distance: FloatArray) -> Law:
    return lambda constants: (constants[0] * distance, distance[:, None])


class _Fitted(NamedTuple):
    constants: FloatArray
    covariance: FloatArray
    quantile: float
    scatter: float
    departures: FloatArray
    chance: float

    def law(self, name: str, constants: dict[str, tuple[float, float, float]]) -> ShiftLaw:
        """Return the law with its constants."""
        residual = float(np.sqrt(np.mean(self.departures**2)))
        return ShiftLaw(name, constants, residual, self.scatter, self.departures, self.chance)

    def interval(self, place: int) -> tuple[float, float, float]:
        """Return a constant and the ends of its interval."""
        value, half = float(self.constants[place]), self.quantile * float(np.sqrt(self.covariance[place, place]))
        return value, value - half, value + half


def _fit(name: str, law: Law, guess: FloatArray, factors: FloatArray, covariance: FloatArray) -> _Fitted:
    """Fit by generalised least squares; a law that misses by more than the errors gets a scatter of its own."""
    known = np.diag(covariance) > 0
    freedom = int(known.sum()) - guess.size
    if freedom < 1:
        raise FitError(
            f"the law {name} needs more than {guess.size} shift factors beside the reference, got {known.sum()}"
        )
    values, vectors = np.linalg.eigh(covariance[np.ix_(known, known)])
    values, target = np.maximum(values, 1e-12 * values.max()), vectors.T @ factors[known]
    best = guess

    def excess(scatter: float) -> float:
        """Say by how much chi-squared exceeds its freedom; begin at the last solution."""
        nonlocal best
        best, squares, _ = _solved(law, best, known, vectors, values + scatter**2, target)
        return squares / freedom - 1

    alone, scatter = excess(0.0), 0.0
    chance = float(chdtrc(freedom, freedom * (alone + 1)))
    squares = float(np.sum((law(best)[0] - factors)[known] ** 2))
    ends = np.log(NEGLIGIBLE * np.sqrt(values.min())), np.log(2 * np.sqrt(squares / freedom) + 1e-300)
    if alone > 0 and excess(float(np.exp(ends[0]))) > 0 > excess(float(np.exp(ends[1]))):
        scatter = float(np.exp(brentq(lambda width: excess(float(np.exp(width))), *ends, xtol=1e-3)))
    best, _, precision = _solved(law, best, known, vectors, values + scatter**2, target)
    quantile = float(stdtrit(freedom, 0.5 + CONFIDENCE / 2))
    inverse = np.asarray(np.linalg.pinv(precision), dtype=np.float64)
    return _Fitted(best, inverse, quantile, scatter, factors - law(best)[0], chance)


def _solved(
    law: Law,
    constants: FloatArray,
    known: NDArray[np.bool_],
    vectors: FloatArray,
    variances: FloatArray,
    target: FloatArray,
) -> tuple[FloatArray, float, FloatArray]:
    """Return constants by damped Gauss-Newton steps, the sum of squares, and the precision of the constants."""

    def at(place: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        value, slopes = law(place)
        miss, rows = vectors.T @ value[known] - target, vectors.T @ slopes[known]
        return rows, miss, float(np.sum(miss**2 / variances))

    rows, miss, squares = at(constants)
    for _ in range(ITERATIONS):
        weighed = rows / variances[:, None]
        precision = rows.T @ weighed
        scale = np.sqrt(np.diag(precision)) + 1e-300
        relative = precision / np.outer(scale, scale) + RIDGE * np.eye(scale.size)
        step = -np.linalg.solve(relative, weighed.T @ miss / scale) / scale
        share, before = 1.0, squares
        while share > 1e-4:
            proposal = at(constants + share * step)
            if proposal[2] <= squares:
                constants, (rows, miss, squares) = constants + share * step, proposal
                break
            share /= 4
        if before - squares <= CONVERGED * before:
            break
    return constants, squares, rows.T @ weighed
