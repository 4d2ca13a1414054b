"""Linear viscoelastic solids: moduli, Prony series fitted to data, and shifts to other temperatures.

The stress due to a shear strain u is ``G_inf u + sum G_m (u - a_m) + eta du/dt``. The strain a_m of the dashpot in
Prony term m follows from ``da_m/dt = (u - a_m) / tau_m``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.refine import CLOSE, MOST_ITERATIONS

GAS_CONSTANT = 8.31446261815324
"""Molar gas constant, J / (mol K)."""


@dataclass(frozen=True)
class LinearSolid:
    """A linear viscoelastic solid: a spring, Prony terms and a dashpot in parallel.

    Moduli are shear moduli in Pa. `times` contains the relaxation times of the Prony terms in s, ascending and
    distinct. `viscosity` is the viscosity in Pa s of the dashpot that is parallel to the Prony terms.
    """

    static_modulus: float
    moduli: FloatArray
    times: FloatArray
    viscosity: float = 0.0


def kelvin(shear_modulus: float, relaxation_time: float) -> LinearSolid:
    """Return the Kelvin solid of modulus G in Pa and relaxation time tau = eta / G in s."""
    return prony(shear_modulus, [], [], shear_modulus * relaxation_time)


def standard_solid(static_modulus: float, glass_modulus: float, relaxation_time: float) -> LinearSolid:
    """Return the standard solid, which has one Prony term. Moduli are in Pa, and the time is in s.

    `static_modulus` is the modulus for very slow deformation, and `glass_modulus` the modulus for sudden deformation.
    A ValueError is raised if the glass modulus is below the static one, or as by `prony`.
    """
    if not glass_modulus >= static_modulus:
        raise ValueError(f"the glass modulus must not be below the static one, got {glass_modulus!r}")
    return prony(static_modulus, [glass_modulus - static_modulus], [relaxation_time])


def prony(static_modulus: float, moduli: ArrayLike, times: ArrayLike, viscosity: float = 0.0) -> LinearSolid:
    """Return a solid whose Prony terms are sorted by relaxation time.

    Terms with equal relaxation times are merged. Terms with the modulus 0 are left out.

    Parameters
    ----------
    static_modulus : float
        Static modulus G_inf > 0 in Pa. Without a static modulus, a periodic contact would carry no load in the steady
        state.
    moduli, times : array_like, shape (terms,)
        Moduli G_m >= 0 in Pa, and relaxation times tau_m > 0 in s.
    viscosity : float
        Viscosity eta >= 0 in Pa s of a dashpot in parallel.

    Raises
    ------
    ValueError
        If a number is not finite or has the wrong sign, or if `moduli` and `times` differ in length.

    Examples
    --------
    >>> solid = prony(1.0, [9.0], [1e-3])
    >>> print(abs(complex_modulus(solid, [1.0, 1e3, 1e6])).round(2))
    [ 1.    7.11 10.  ]
    """
    stiffness, time = (np.asarray(a, dtype=np.float64).reshape(-1) for a in (moduli, times))
    if stiffness.shape != time.shape:
        raise ValueError(
            f"each Prony term needs a modulus and a time, got {stiffness.size} moduli and {time.size} times"
        )
    if not (np.isfinite(static_modulus) and static_modulus > 0):
        raise ValueError(f"the static modulus must be positive and finite, got {static_modulus!r}")
    if not (np.all(np.isfinite(stiffness)) and np.all(stiffness >= 0)):
        raise ValueError(f"the moduli of the terms must be finite and must not be negative, got {stiffness.tolist()!r}")
    if not (np.all(np.isfinite(time)) and np.all(time > 0)):
        raise ValueError(f"the relaxation times must be positive and finite, got {time.tolist()!r}")
    if not (np.isfinite(viscosity) and viscosity >= 0):
        raise ValueError(f"the viscosity must be finite and must not be negative, got {viscosity!r}")
    distinct, place = np.unique(time[stiffness > 0], return_inverse=True)
    merged = np.bincount(place, weights=stiffness[stiffness > 0], minlength=distinct.size)
    return LinearSolid(float(static_modulus), merged.astype(np.float64), distinct, float(viscosity))


def complex_modulus(solid: LinearSolid, angular_frequency: ArrayLike) -> NDArray[np.complex128]:
    """Return G*(omega) = G' + i G'' in Pa at angular frequencies omega in rad/s."""
    omega = np.asarray(angular_frequency, dtype=np.float64)
    product = omega[..., None] * solid.times
    terms = solid.moduli * product / (product - 1j)
    modulus = solid.static_modulus + 1j * omega * solid.viscosity + terms.sum(axis=-1)
    return np.asarray(modulus, dtype=np.complex128)


@dataclass(frozen=True)
class SeriesFit:
    """A Prony series fitted to moduli, and the errors of the fit.

    `storage_error` and `loss_error` are the root mean squares of the relative errors of G' and of G''. `storage_error`
    is NaN if the series was fitted to G'' alone. `largest_error` is the largest relative error of the fitted moduli (G'
    and G'', or G'' alone), and occurs at the angular frequency `worst_frequency` in rad/s. `range` contains the lowest
    and the highest angular frequency of the fit.
    """

    solid: LinearSolid
    storage_error: float
    loss_error: float
    largest_error: float
    worst_frequency: float
    range: tuple[float, float]

    @property
    def error(self) -> float:
        """Root mean square of `storage_error` and `loss_error`, or `loss_error` alone if `storage_error` is NaN."""
        return _rms(np.array([error for error in (self.storage_error, self.loss_error) if np.isfinite(error)]))


def power_law_series(
    static_modulus: float,
    loss_modulus: float,
    frequency: float,
    exponent: float,
    lowest: float,
    highest: float,
) -> SeriesFit:
    """Return a Prony series for the law G'' = loss_modulus (omega / frequency)^exponent (thesis eq. 3.45).

    `loss_modulus` is G'' in Pa at the angular frequency `frequency` in rad/s. The series follows the law at angular
    frequencies from `lowest` to `highest`. The reciprocals of the relaxation times extend one decade beyond both ends
    of this range. The series has about two terms per decade, and the error of G'' in the range is below 1 %.
    A ValueError is raised if the exponent does not lie between 0 and 1, or if the range is not positive and ascending.
    """
    if not 0 < exponent < 1:
        raise ValueError(f"the exponent of a power-law spectrum must lie between 0 and 1, got {exponent!r}")
    if not 0 < lowest < highest:
        raise ValueError(f"the range of frequencies must be positive and ascending, got {(lowest, highest)!r}")
    decades = np.log10(highest / lowest)
    times = np.geomspace(0.1 / highest, 10 / lowest, round((decades + 2) * 2) + 1)
    omega = np.geomspace(lowest, highest, int(np.ceil(20 * decades)) + 1)
    wanted = loss_modulus * (omega / frequency) ** exponent
    moduli, _ = nnls(_loss_columns(omega, times) / wanted[:, None], np.ones_like(omega), maxiter=100 * times.size)
    solid = prony(static_modulus, moduli, times)
    error = complex_modulus(solid, omega).imag / wanted - 1
    worst = int(np.abs(error).argmax())
    return SeriesFit(solid, np.nan, _rms(error), abs(float(error[worst])), float(omega[worst]), (lowest, highest))


def fit_series(
    angular_frequency: ArrayLike,
    storage: ArrayLike,
    loss: ArrayLike,
    terms_per_decade: float = 1.0,
) -> SeriesFit:
    """Fit a Prony series to a table of measured moduli by non-negative least squares of the relative errors.

    Parameters
    ----------
    angular_frequency : array_like, shape (points,)
        Angular frequencies omega in rad/s, in any order. They should cover at least one decade.
    storage, loss : array_like, shape (points,)
        G' and G'' in Pa, all positive. Moduli in tension must first be divided by 2 (1 + Poisson's ratio).
    terms_per_decade : float
        Number of relaxation times per decade. The relaxation times extend from half a decade below the smallest 1 /
        omega to half a decade above the largest 1 / omega.

    Raises
    ------
    ValueError
        If frequencies and moduli differ in length, have fewer than two values, or contain a value that is not positive
        and finite, or if the fitted static modulus is zero.
    """
    omega, stored, lost = (np.asarray(a, dtype=np.float64).reshape(-1) for a in (angular_frequency, storage, loss))
    if not omega.size == stored.size == lost.size >= 2:
        raise ValueError(
            f"expected at least two frequencies with a storage and a loss modulus each, got {omega.size} frequencies, "
            f"{stored.size} storage and {lost.size} loss moduli"
        )
    if not all(np.all(np.isfinite(a) & (a > 0)) for a in (omega, stored, lost)):
        raise ValueError("frequencies and moduli must be positive and finite")
    slowest, fastest = 10**0.5 / omega.min(), 10**-0.5 / omega.max()
    terms = max(2, round(np.log10(slowest / fastest) * terms_per_decade) + 1)
    times = np.geomspace(fastest, slowest, terms)
    product = np.multiply.outer(omega, times)
    of_storage = np.column_stack([np.ones_like(omega), product / (product + 1 / product)])
    of_loss = np.column_stack([np.zeros_like(omega), _loss_columns(omega, times)])
    design = np.vstack([of_storage / stored[:, None], of_loss / lost[:, None]])
    (static, *moduli), _ = nnls(design, np.ones(2 * omega.size), maxiter=100 * (terms + 1))
    if static <= 0:
        raise ValueError("the fitted static modulus is zero: the table must reach the rubbery plateau")
    solid = prony(static, moduli, times)
    modulus = complex_modulus(solid, omega)
    errors = modulus.real / stored - 1, modulus.imag / lost - 1
    larger = np.maximum(*np.abs(errors))
    worst = int(larger.argmax())
    covered = float(omega.min()), float(omega.max())
    return SeriesFit(solid, _rms(errors[0]), _rms(errors[1]), float(larger[worst]), float(omega[worst]), covered)


def _loss_columns(omega: FloatArray, times: FloatArray) -> FloatArray:
    product = np.multiply.outer(omega, times)
    return np.asarray(1 / (product + 1 / product), dtype=np.float64)


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def wlf_factor(temperature: ArrayLike, reference: float, c1: float, c2: float) -> FloatArray:
    """Return a_T of Williams, Landel and Ferry: log10 a_T = -c1 (T - T_ref) / (c2 + T - T_ref).

    Parameters
    ----------
    temperature : array_like
        Temperatures T in K.
    reference : float
        Reference temperature T_ref in K.
    c1 : float
        Dimensionless constant.
    c2 : float
        Constant in K. The law is valid for T > T_ref - c2 only.

    Raises
    ------
    ValueError
        If a temperature is not above T_ref - c2.
    """
    difference = np.asarray(temperature, dtype=np.float64) - reference
    if np.any(c2 + difference <= 0):
        got = f"{np.min(temperature):.9g} K"
        raise ValueError(f"the law of Williams, Landel and Ferry is valid above {reference - c2:.9g} K only, got {got}")
    return np.asarray(10 ** (-c1 * difference / (c2 + difference)), dtype=np.float64)


def arrhenius_factor(temperature: ArrayLike, reference: float, activation_energy: float) -> FloatArray:
    """Return a_T = exp((E / R) (1/T - 1/T_ref)) for temperatures in K and an activation energy in J/mol.

    A ValueError is raised if a temperature or the reference temperature is not positive.
    """
    absolute = np.asarray(temperature, dtype=np.float64)
    if np.any(absolute <= 0) or reference <= 0:
        raise ValueError(f"absolute temperatures must be positive, got {temperature!r}")
    return np.asarray(np.exp(activation_energy / GAS_CONSTANT * (1 / absolute - 1 / reference)), dtype=np.float64)


def at_temperature(solid: LinearSolid, factor: float) -> LinearSolid:
    """Return the solid with all relaxation times and the viscosity multiplied by the shift factor a_T (`factor`)."""
    return replace(solid, times=solid.times * factor, viscosity=solid.viscosity * factor)


@jit
def _imbalance(k: int, offset: float, weight: FloatArray, times: FloatArray) -> tuple[float, float]:
    """Return f = 1 + sum weight_m / (tau_m - lambda) at lambda = tau_k + offset, and df/dlambda."""
    total, rate = 1.0, 0.0
    for m in range(times.size):
        inverse = 1 / ((times[m] - times[k]) - offset)
        total += weight[m] * inverse
        rate += weight[m] * inverse * inverse
    return total, rate


@jit
def recovery_times(weight: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the decay times lambda_k of free recovery, which are the zeros of 1 + sum weight_m / (tau_m - lambda).

    The weight is G_m tau_m / G_inf for a Prony term. A dashpot has the weight eta / G_inf and the time 0. The times
    tau_m must be ascending and distinct. Each lambda_k lies between tau_k and tau_(k+1), except the largest lambda_k,
    which lies above the largest tau_m. The second result contains tau_m - lambda_k in row m and column k.
    """
    terms = times.size
    zeros, distance = np.empty(terms), np.empty((terms, terms))
    for k in range(terms):
        last = k == terms - 1
        gap = 2 * weight.sum() if last else times[k + 1] - times[k]
        left = last or _imbalance(k, gap / 2, weight, times)[0] >= 0
        pole, sign = (k, 1.0) if left else (k + 1, -1.0)
        offset = sign * _distance_to_zero(pole, sign, gap, weight, times)
        zeros[k] = times[pole] + offset
        for m in range(terms):
            # this form of tau_m - lambda_k is precise even if the times cover many decades
            distance[m, k] = (times[m] - times[pole]) - offset
    return zeros, distance


@jit
def _distance_to_zero(pole: int, sign: float, gap: float, weight: FloatArray, times: FloatArray) -> float:
    """Return the distance from tau_m, with m = `pole`, to the zero lambda_k above (`sign` = 1) or below (`sign` = -1).

    `gap` is an upper bound of this distance.
    """
    high = np.log(gap)
    low = high - 80.0  # exp(-80) is far below the rounding error
    place = 0.5 * (low + high)
    for _ in range(MOST_ITERATIONS):
        offset = np.exp(place)
        total, rate = _imbalance(pole, sign * offset, weight, times)
        if sign * total > 0:
            high = place
        else:
            low = place
        following = place - sign * total / (rate * offset)
        if not low < following < high or high - low > 1.0:
            following = 0.5 * (low + high)
        place, step = following, following - place
        if abs(step) <= CLOSE:
            break
    return float(np.exp(place))
