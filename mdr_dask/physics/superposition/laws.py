"""Laws of shift factors: a power of the velocity, Arrhenius' law, and the WLF law (Williams, Landel and Ferry).

The fits are weighted with the inverse covariance of the factors. FitError is raised if a law has too few factors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.optimize import OptimizeResult, brentq, least_squares
from scipy.special import chdtrc, stdtrit

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.physics.refine import CLOSE
from mdr_dask.physics.solids import GAS_CONSTANT


@dataclass(frozen=True)
class ShiftLaw:
    """A law fitted to shift factors.

    `name` is ``power``, ``arrhenius`` or ``wlf``. `constants` contains the value and the ends of the 95 % interval of
    ``exponent``, of ``activation_energy`` (J/mol), or of ``c1`` and ``c2`` (K) at the reference temperature. `factors`
    converts groups (velocities or temperatures) to factors in decades by the law. The result is zero at the anchor, the
    group whose measured factor is zero by definition. `departures` are the measured factors minus the law, in decades.
    `chance` is the probability that the errors of the factors would cause deviations at least as large if the law were
    exact.
    """

    name: str
    constants: dict[str, tuple[float, float, float]]
    factors: Callable[[FloatArray], FloatArray]
    departures: FloatArray
    chance: float

    @property
    def residual(self) -> float:
        """Root mean square of the deviations from the law, in decades."""
        return float(np.sqrt(np.mean(self.departures**2)))


def fit_power(groups: FloatArray, factors: FloatArray, covariance: FloatArray, anchor: int) -> ShiftLaw:
    """Fit ``factor = exponent log10(group / groups[anchor])`` to factors in decades.

    The groups must be positive. `anchor` is the index of the group whose factor is zero.
    """
    return _one_constant("power", "exponent", lambda at: np.log10(at / groups[anchor]), groups, factors, covariance)


def fit_arrhenius(temperature: FloatArray, log_factors: FloatArray, covariance: FloatArray, anchor: int) -> ShiftLaw:
    """Fit ``log10 a_T = E / (R ln 10) (1/T - 1/T_anchor)`` to temperatures in K.

    The arguments are those of `fit_power`. FitError is also raised if a temperature is not above 0 K.
    """
    if np.any(temperature <= 0):
        raise FitError(f"the law of Arrhenius needs temperatures above 0 K, got {temperature.min():.9g} K")

    def distance(at: FloatArray) -> FloatArray:
        return np.asarray((1 / at - 1 / temperature[anchor]) / (GAS_CONSTANT * np.log(10)))

    return _one_constant("arrhenius", "activation_energy", distance, temperature, log_factors, covariance)


def fit_wlf(
    temperature: FloatArray, log_factors: FloatArray, covariance: FloatArray, anchor: int, reference: float
) -> ShiftLaw:
    """Fit ``log10 a_T = -c1 (T - T_ref) / (c2 + T - T_ref)`` to temperatures in K.

    First c1 / c2 and 1 / c2 are fitted with the anchor as reference, because these ratios remain finite if the factors
    are linear in temperature. If the reference is dT above the anchor, c1 and c2 become ``c2' = c2 + dT`` and ``c1' =
    c1 c2 / c2'``.
    """
    lowest, moved = float(temperature[anchor] - temperature.min()), reference - float(temperature[anchor])
    straight = CLOSE / float(np.ptp(temperature))  # below this value of 1 / c2, factors are linear in temperature
    steepest = (1 - CLOSE) / lowest if lowest > 0 else np.inf

    def law(constants: FloatArray, at: FloatArray) -> FloatArray:
        distance = at - temperature[anchor]
        return np.asarray(-constants[0] * distance / (1 + constants[1] * distance))

    span = float(np.ptp(temperature))
    guess = np.array([-_slope(temperature - temperature[anchor], log_factors), 1 / (lowest + span)])
    ends = ([-np.inf, straight], [np.inf, steepest])
    fitted, (slope, bend), spread, quantile = _fit("wlf", law, guess, temperature, log_factors, covariance, ends)
    factor, c2 = slope / bend**2, 1 / bend + moved
    c1, half_of_bend = factor / c2, quantile * float(np.sqrt(spread[1, 1]))
    if bend - half_of_bend <= straight:  # a straight line fits: one end of each interval is infinite
        least = 1 / min(bend + half_of_bend, steepest) + moved
        first, last = sorted([slope * (least - moved) ** 2 / least, float(np.copysign(np.inf, slope))])
        constants = {"c1": (c1, first, last), "c2": (c2, least, np.inf)}
    else:
        gap = 1 / bend - lowest  # lowest measured temperature minus the temperature at which the law is infinite
        change = np.array(
            [1 / (bend + bend**2 * moved), -slope * (1 + 2 * bend * moved) / (bend + bend**2 * moved) ** 2]
        )
        half = quantile * float(np.sqrt(change @ spread @ change))
        ratio = np.exp(min(half_of_bend / (bend**2 * gap), 700.0))
        near, far = (lowest + moved + gap * part for part in (1 / ratio, ratio))
        constants = {"c1": (c1, c1 - half, c1 + half), "c2": (c2, near, far)}
    return replace(fitted, constants=constants)


def _slope(distance: FloatArray, factors: FloatArray) -> float:
    return float(distance @ factors / (distance @ distance))


def _one_constant(
    name: str,
    constant: str,
    distance: Callable[[FloatArray], FloatArray],
    groups: FloatArray,
    factors: FloatArray,
    covariance: FloatArray,
) -> ShiftLaw:
    """Fit a law with one constant: the factor is the constant times `distance`, a function of the group."""

    def law(constants: FloatArray, at: FloatArray) -> FloatArray:
        return np.asarray(constants[0] * distance(at), dtype=np.float64)

    guess = np.array([_slope(distance(groups), factors)])
    fitted, (value,), spread, quantile = _fit(name, law, guess, groups, factors, covariance)
    half = quantile * float(np.sqrt(spread[0, 0]))
    return replace(fitted, constants={constant: (float(value), float(value) - half, float(value) + half)})


def _fit(
    name: str,
    law: Callable[[FloatArray, FloatArray], FloatArray],
    guess: FloatArray,
    groups: FloatArray,
    factors: FloatArray,
    covariance: FloatArray,
    ends: tuple[list[float], list[float]] | None = None,
) -> tuple[ShiftLaw, FloatArray, FloatArray, float]:
    """Fit a law by generalised least squares.

    Return the law, in which `constants` is still empty; the values of the constants and their covariance; and the half
    width of a 95 % interval in standard errors. If deviations from the law exceed the errors of the factors, an
    additional scatter is fitted. The square of this scatter is added to the variances of the factors. Factors with the
    variance 0, such as that of the anchor, are not fitted.
    """
    known = np.diag(covariance) > 0
    freedom = int(known.sum()) - guess.size
    if freedom < 1:
        raise FitError(
            f"the law {name} needs more than {guess.size} shift factors besides the reference, got {known.sum()}"
        )
    values, vectors = np.linalg.eigh(covariance[np.ix_(known, known)])
    values = np.maximum(values, 1e-12 * values.max())
    bounds = ends or ([-np.inf] * guess.size, [np.inf] * guess.size)

    def solved(scatter: float) -> OptimizeResult:
        whiten = vectors / np.sqrt(values + scatter**2)

        def misfit(constants: FloatArray) -> FloatArray:
            return np.asarray((law(constants, groups) - factors)[known] @ whiten, dtype=np.float64)

        start = np.clip(guess, *bounds)
        return least_squares(misfit, start, bounds=bounds, x_scale="jac", xtol=1e-13, ftol=1e-13, gtol=1e-13)

    def excess(log_scatter: float) -> float:
        """Return the reduced chi-squared of the fit with an additional scatter, minus 1."""
        return float(2 * solved(np.exp(log_scatter)).cost / freedom - 1)

    found = solved(0.0)
    squares = 2 * float(found.cost)
    largest = np.log(2 * np.sqrt(np.sum((law(found.x, groups) - factors)[known] ** 2) / freedom) + 1e-300)
    smallest = np.log(1e-3 * np.sqrt(values.min()))
    if squares > freedom and excess(smallest) > 0 > excess(largest):
        found = solved(float(np.exp(brentq(excess, smallest, largest, xtol=1e-3))))
    spread = np.asarray(np.linalg.pinv(found.jac.T @ found.jac), dtype=np.float64)
    quantile = float(stdtrit(freedom, 0.975))
    best = np.asarray(found.x, dtype=np.float64)
    fitted = ShiftLaw(name, {}, partial(law, best), factors - law(best, groups), float(chdtrc(freedom, squares)))
    return fitted, best, spread, quantile
