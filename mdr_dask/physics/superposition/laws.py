"""Laws of shift factors: power of velocity, Arrhenius, and Williams, Landel and Ferry, fitted with their covariance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.physics.solids import GAS_CONSTANT

CONFIDENCE = 0.95
BISECTIONS = 24


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
    """

    name: str
    constants: dict[str, tuple[float, float, float]]
    residual: float
    scatter: float


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
    return _fit("power", ("exponent",), lambda c: c[0] * distance, [_slope(distance, factors)], factors, covariance)


def fit_arrhenius(
    temperature: FloatArray, log_factors: FloatArray, covariance: FloatArray, reference: float
) -> ShiftLaw:
    """Fit ``log10 a_T = E / (R ln 10) (1/T - 1/T_ref)``, temperatures in K; see `fit_power`."""
    if np.any(temperature <= 0) or reference <= 0:
        raise FitError("the law of Arrhenius needs absolute temperatures")
    distance = (1 / temperature - 1 / reference) / (GAS_CONSTANT * np.log(10))
    guess = [_slope(distance, log_factors)]
    return _fit("arrhenius", ("activation_energy",), lambda c: c[0] * distance, guess, log_factors, covariance)


def fit_wlf(temperature: FloatArray, log_factors: FloatArray, covariance: FloatArray, reference: float) -> ShiftLaw:
    """Fit ``log10 a_T = -c1 (T - T_ref) / (c2 + T - T_ref)``; see `fit_power`. Temperatures in K or in degrees
    Celsius.
    """
    distance = temperature - reference
    lowest = float(max(0.0, -distance.min()))

    def law(constants: FloatArray) -> FloatArray:
        c2 = lowest + np.exp(constants[1])
        return np.asarray(-constants[0] * distance / (c2 + distance), dtype=np.float64)

    span = float(np.ptp(distance))
    slope = -_slope(distance, log_factors)
    guess = [slope * (lowest + span), np.log(span)]
    fitted = _fit("wlf", ("c1", "log_excess"), law, guess, log_factors, covariance)
    low_high = tuple(lowest + float(np.exp(value)) for value in fitted.constants["log_excess"])
    constants = {"c1": fitted.constants["c1"], "c2": (low_high[0], low_high[1], low_high[2])}
    return ShiftLaw("wlf", constants, fitted.residual, fitted.scatter)


def _slope(distance: FloatArray, factors: FloatArray) -> float:
    return float(distance @ factors / (distance @ distance))


def _fit(
    name: str,
    names: tuple[str, ...],
    law: Callable[[FloatArray], FloatArray],
    guess: list[float],
    factors: FloatArray,
    covariance: FloatArray,
) -> ShiftLaw:
    """Fit by generalised least squares; a law that misses by more than the errors gets a scatter of its own."""
    known = np.diag(covariance) > 0
    freedom = int(known.sum()) - len(names)
    if freedom < 1:
        raise FitError(
            f"the law {name} needs more than {len(names)} shift factors beside the reference, got {known.sum()}"
        )
    values, vectors = np.linalg.eigh(covariance[np.ix_(known, known)])
    scale = np.maximum(np.abs(np.array(guess)), 1e-12)

    def solve(scatter: float) -> tuple[FloatArray, FloatArray, float]:
        whiten = vectors.T / np.sqrt(np.maximum(values, 1e-12 * values.max()) + scatter**2)[:, None]

        def misfit(relative: FloatArray) -> FloatArray:
            return np.asarray(whiten @ (law(relative * scale) - factors)[known], dtype=np.float64)

        found = least_squares(misfit, np.array(guess) / scale, x_scale="jac", method="lm")
        jacobian = np.asarray(found.jac, dtype=np.float64)
        spread = np.linalg.pinv(jacobian.T @ jacobian)
        return found.x * scale, np.sqrt(np.diag(spread)) * scale, float(2 * found.cost / freedom)

    scatter = _scatter(lambda width: solve(width)[2], float(np.std(factors)))
    best, error, _ = solve(scatter)
    half = student.ppf(0.5 + CONFIDENCE / 2, freedom) * error
    constants = {
        key: (float(value), float(value - width), float(value + width))
        for key, value, width in zip(names, best, half, strict=True)
    }
    residual = float(np.sqrt(np.mean((law(best) - factors) ** 2)))
    return ShiftLaw(name, constants, residual, scatter)


def _scatter(chi2: Callable[[float], float], largest: float) -> float:
    """Return the scatter about the law at which the reduced chi-squared is one, or zero if it is less without."""
    if chi2(0.0) <= 1:
        return 0.0
    low, high = np.log(1e-6 * largest + 1e-300), np.log(10 * largest + 1e-300)
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (middle, high) if chi2(float(np.exp(middle))) > 1 else (low, middle)
    return float(np.exp(high))
