"""The spectrum of an isotropic surface from straight profiles through the surface: the inverse Abel transform.

A straight profile (cut) has the spectrum C_cut(q) = 2 int_q^inf C2D(k) k / sqrt(k^2 - q^2) dk, where C2D is the
spectrum of the surface. The line of the MDR has a larger spectrum, pi q C2D.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import optimize

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.physics.surfaces.measured import MeasuredLine
from mdr_dask.physics.surfaces.spectrum import Spectrum, quadrature

BEND = 3.0  # prior standard deviation of the change of the slope d log C2D / d log q between adjacent bins
#: The spectrum ends where -d log C / d log q exceeds this value. It was chosen by trial, and is far above the values of
#: roughness.
STEEPEST = 30.0


class Cut(NamedTuple):
    """The spectrum of straight profiles in logarithmic bins of the wave number q, rad/m.

    `density` is C_cut, m^3, two-sided: <h^2> = 2 int C_cut dq. `error` is the relative standard error of C_cut. The
    bins of a map (`MapSpectrum.binned`) contain C2D, m^4, instead of C_cut.
    """

    wavenumber: FloatArray
    density: FloatArray
    error: FloatArray

    def until(self, wavenumber: float) -> Cut:
        """Return the bins up to and including a wave number."""
        kept = self.wavenumber <= wavenumber
        return Cut(*(column[kept] for column in self))


def cut_of_line(line: MeasuredLine, hann: bool = True) -> Cut:
    """Return the spectrum of a detrended scan, averaged in logarithmic bins.

    The Hann window, if used, is normalised so that <h^2> is preserved.
    """
    points, length = line.height.size, line.length
    window = hann_window(points) if hann else np.ones(points)
    waves = np.fft.rfft((line.height - line.height.mean()) * window) / points
    power = length / (2 * np.pi) * np.abs(waves[1:]) ** 2
    last = (points - 1) // 2  # without the wave that is two spacings long, whose phase is unknown
    independent = 1 / float(np.mean(window**4))  # because of the window, adjacent waves are correlated
    return averaged(2 * np.pi / length * np.arange(1, last + 1, dtype=np.float64), power[:last], independent)


def averaged(wavenumber: FloatArray, density: FloatArray, independent: float, count: FloatArray | None = None) -> Cut:
    """Average a spectrum in ten logarithmic bins per decade; the power in each bin is preserved.

    `independent` is the number of statistically independent squared amplitudes per wave, from which the standard error
    follows. `count` is the number of waves at each wave number (1 if `count` is None).
    """
    count = np.ones(wavenumber.size) if count is None else count
    bins = np.floor(np.log10(wavenumber / wavenumber[0] + 0.5) * 10).astype(int)
    _, member = np.unique(bins, return_inverse=True)
    total = np.bincount(member, count)
    q = np.exp(np.bincount(member, count * np.log(wavenumber)) / total)
    return Cut(q, np.bincount(member, count * density) / total, 1 / np.sqrt(total * independent))


def hann_window(points: int) -> FloatArray:
    """Return the Hann window with a mean square of one."""
    window = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(points) + 0.5) / points)
    return np.asarray(window / np.sqrt(np.mean(window**2)))


def _until_the_end(cut: Cut) -> slice:
    """Return the bins before the first fall that is steeper than `STEEPEST`, or all bins if there is no such fall."""
    with np.errstate(divide="ignore"):
        logs = np.log(cut.density)
    falls = np.flatnonzero(np.diff(logs) < -STEEPEST * np.diff(np.log(cut.wavenumber)))
    return slice(0, int(falls[0]) + 1 if falls.size else None)


def of_cut(cut: Cut) -> tuple[Spectrum, FloatArray]:
    """Return the isotropic spectrum C2D of a surface with the given cut, and the standard errors of log C2D.

    The standard errors are large below the roll-off, where C2D hardly influences the cut. If the cut has fewer than
    three wave numbers before its end (see `STEEPEST`), DataError is raised. The result has one wave number more than
    the cut has before its end.

    C2D is assumed to be a power law between adjacent wave numbers of the cut, and is fitted by least squares. The fit
    amplifies noise less than the explicit inverse -1/pi int C_cut'(k) / sqrt(k^2 - q^2) dk, because the change of the
    slope d log C2D / d log q from bin to bin has a normal prior with the standard deviation `BEND`.
    """
    q, density, error = (np.asarray(column, dtype=np.float64)[_until_the_end(cut)] for column in cut)
    if q.size < 3:
        raise DataError(f"expected a spectrum of three wave numbers or more, got {q.size}")
    # waves beyond the last wave number of the cut contribute to the cut; C2D is assumed to end one bin further
    edge = q[-1] ** 2 / q[-2]
    knots = np.append(q, edge)
    place, weight = quadrature(q, knots)
    where = np.clip(np.searchsorted(knots, place, side="right") - 1, 0, knots.size - 2)
    share = np.log(place / knots[where]) / np.log(knots[where + 1] / knots[where])
    basis = np.zeros((q.size, place.shape[1], knots.size))
    rows, columns = np.indices(place.shape)
    basis[rows, columns, where] = 1 - share
    basis[rows, columns, where + 1] += share
    steps = np.diff(np.log(knots))
    bends = np.diff(np.diff(np.eye(knots.size), axis=0) / steps[:, None], axis=0) / BEND

    def residual(logs: FloatArray) -> FloatArray:
        found = np.sum(weight * np.exp(basis @ logs), axis=1)
        return np.concatenate([np.log(found / density) / error, bends @ logs])

    def jacobian(logs: FloatArray) -> FloatArray:
        part = weight * np.exp(basis @ logs)
        rows = np.einsum("ij,ijk->ik", part, basis) / part.sum(axis=1)[:, None]
        return np.concatenate([rows / error[:, None], bends])

    start = np.log(np.append(density, density[-1] * (q[-1] / edge) ** 3) / (np.pi * knots))
    fit = optimize.least_squares(residual, start, jacobian, method="lm", xtol=1e-12, ftol=1e-12)
    slopes = jacobian(fit.x)
    covariance = np.linalg.inv(slopes.T @ slopes)
    return Spectrum(knots, np.exp(fit.x)), np.sqrt(np.diag(covariance))
