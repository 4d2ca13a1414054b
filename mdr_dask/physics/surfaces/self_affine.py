"""Parameters of a measured spectrum: Hurst exponent, cut-off wavelengths, and the resolution of the instrument."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.surfaces.scans import Cut

LEAST_ERROR = 0.05  # smallest assumed relative error of a bin, because real spectra deviate from power laws
LEAST_BINS = 5  # smallest number of bins to which a power law is fitted
CONFIDENCE = 0.95
DEVIATIONS = float(ndtri((1 + CONFIDENCE) / 2))  # half width of a 95 % interval in standard deviations
STEEPEST = -6.0  # steepest slope d log C2D / d log q of roughness; the slope is -4 for H = 1 and -2 for H = 0


class Interval(NamedTuple):
    """A value, with the ends of its 95 % confidence interval."""

    value: float
    low: float
    high: float


class SelfAffine(NamedTuple):
    """A power law C2D ~ q^(-2 - 2 H) between two wavelengths, m. A wavelength is None if there is no cut-off."""

    hurst: Interval
    longest: Interval | None
    shortest: Interval | None


def noise_limit(bins: Cut, roughness: float = -2.0, decades: float = 0.3) -> float:
    """Return the wave number beyond which the spectrum is noise, or infinity if the spectrum has no flat tail.

    The tail comprises the last `decades` decades of the wave number. The slope d log C / d log q is 0 for noise, and at
    most `roughness` for a surface: -2 for C2D, and -1 for a straight profile. The tail is noise if its slope is closer
    to 0 than to `roughness`. The spectrum is noise where the noise exceeds the roughness. If it does so everywhere, the
    first wave number is returned. A tail with fewer than three bins, or with a bin that is zero, is not taken as noise.
    """
    wavenumber, density = bins.wavenumber, bins.density
    there = wavenumber > wavenumber[-1] / 10**decades * (1 - 1e-9)
    q, tail = wavenumber[there], density[there]
    if q.size < 3 or not np.all(tail > 0):
        return np.inf
    if np.polyfit(np.log(q), np.log(tail), 1)[0] < roughness / 2:
        return np.inf
    above = np.flatnonzero(density > 2 * np.mean(tail))
    return float(wavenumber[above[-1]]) if above.size else float(wavenumber[0])


def steep_limit(bins: Cut) -> float:
    """Return the wave number beyond which C2D falls too steeply for roughness, or infinity if there is no such fall.

    The fall must be steep over two successive intervals between bins, or over the last interval. Without such a fall,
    but with bins in which C2D is zero, the wave number of the last bin with a positive C2D is returned.
    """
    wavenumber, density = bins.wavenumber, bins.density
    there = density > 0
    x, y = np.log(wavenumber[there]), np.log(density[there])
    steep = np.diff(y) < STEEPEST * np.diff(x)
    ends = np.flatnonzero(steep & np.append(steep[1:], True))
    if ends.size:
        return float(wavenumber[there][ends[0]])
    return np.inf if np.all(there) else float(wavenumber[there][-1])


def fit_self_affine(bins: Cut) -> SelfAffine | None:
    """Fit a power law to C2D; return None if the spectrum is not a power law or has too few bins.

    Schwarz's information criterion decides whether there are cut-offs, and at which bins the cut-offs lie. The
    confidence intervals follow from the likelihood. If the spectrum deviates from the law by more than the standard
    errors, the intervals are wider.
    """
    wavenumber, density, error = bins
    if wavenumber.size < LEAST_BINS:
        return None
    x, y = np.log(wavenumber), np.log(density)
    weight = 1 / np.maximum(error, LEAST_ERROR)
    last = x.size - 1
    fits = {}
    for first in range(x.size - LEAST_BINS + 1):
        for end in range(first + LEAST_BINS - 1, x.size):
            columns = [np.ones_like(x), np.clip(x, x[first], x[end])]
            columns += [np.minimum(x - x[first], 0)] if first else []
            columns += [np.maximum(x - x[end], 0)] if end < last else []
            fits[first, end] = _least_squares(np.array(columns).T * weight[:, None], y * weight)
    # the confidence interval of the Hurst exponent must overlap the range from 0 to 1
    fits = {ends: fit for ends, fit in fits.items() if abs(fit.slope + 3) <= 1 + DEVIATIONS * fit.error}
    if not fits:
        return None
    full = min(fits.values(), key=lambda fit: fit.chi_squared)
    scale = max(1.0, full.chi_squared / max(1, x.size - 6))
    penalty = scale * np.log(x.size)
    worth = {ends: fit.chi_squared + penalty * (2 * (ends[0] > 0) + 2 * (ends[1] < last)) for ends, fit in fits.items()}
    first, end = min(worth, key=lambda ends: worth[ends])
    best = fits[first, end]
    allowed = [
        ends
        for ends, fit in fits.items()
        if fit.chi_squared <= best.chi_squared + scale * DEVIATIONS**2
        and (ends[0] > 0) == (first > 0)
        and (ends[1] < last) == (end < last)
    ]
    slopes = [
        fits[ends].slope + sign * DEVIATIONS * np.sqrt(scale) * fits[ends].error for ends in allowed for sign in (-1, 1)
    ]
    low, high = -1 - max(slopes) / 2, -1 - min(slopes) / 2

    def wavelength(bend: int, place: int) -> Interval:
        places = [ends[place] for ends in allowed]
        step = np.exp(np.mean(np.diff(x)) / 2)
        ends = 2 * np.pi / wavenumber[[max(places), min(places)]]
        return Interval(float(2 * np.pi / wavenumber[bend]), float(ends[0] / step), float(ends[1] * step))

    return SelfAffine(
        Interval(-1 - best.slope / 2, low, high),
        wavelength(first, 0) if first else None,
        wavelength(end, 1) if end < last else None,
    )


class _Fit(NamedTuple):
    chi_squared: float
    slope: float  # slope of the power law between the cut-offs
    error: float


def _least_squares(matrix: NDArray[np.float64], right: FloatArray) -> _Fit:
    found = np.linalg.lstsq(matrix, right, rcond=None)[0]
    variance = np.linalg.pinv(matrix.T @ matrix)[1, 1]
    return _Fit(float(np.sum((matrix @ found - right) ** 2)), float(found[1]), float(np.sqrt(variance)))
