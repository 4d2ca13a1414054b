"""The spectrum C2D(q) of an isotropic surface, the spectra of its MDR line and of a straight profile, and rms values.

Angular wave numbers q are in rad/m. Spectra are two-sided: both signs of the wave vector carry the same power (thesis
2.12 and 2.13).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.physics.refine import CLOSE

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The spectrum C2D(q), m^4: a power law between adjacent points with ascending q, and 0 outside."""

    wavenumber: FloatArray
    density: FloatArray

    def __post_init__(self) -> None:
        q, density = self.wavenumber, self.density
        if q.size < 2 or q.size != density.size:
            raise DataError(f"a spectrum needs two points or more, got {q.size} wave numbers, {density.size} densities")
        for what, numbers in (("wave numbers", q), ("spectral densities", density)):
            if not np.all(np.isfinite(numbers) & (numbers > 0)):
                raise DataError(f"expected positive and finite {what} in a spectrum")
        if not np.all(np.diff(q) > 0):
            raise DataError("expected strictly ascending wave numbers in a spectrum")

    @cached_property
    def _logs(self) -> tuple[FloatArray, FloatArray]:
        return np.log(self.wavenumber), np.log(self.density)

    @property
    def wavelengths(self) -> tuple[float, float]:
        """The longest and the shortest wavelength, m."""
        return 2 * np.pi / float(self.wavenumber[0]), 2 * np.pi / float(self.wavenumber[-1])

    def at(self, wavenumber: ArrayLike) -> FloatArray:
        """Return C2D at wave numbers, m^4, by linear interpolation of the logarithms."""
        q = np.asarray(wavenumber, dtype=np.float64)
        inside = (q >= self.wavenumber[0] * (1 - CLOSE)) & (q <= self.wavenumber[-1] * (1 + CLOSE))
        density = np.zeros_like(q)
        density[inside] = np.exp(np.interp(np.log(q[inside]), *self._logs))
        return density

    def line(self, length: float, modes: int) -> FloatArray:
        """Return the amplitudes A_k, m, of the harmonics q_k = 2 pi k / L for an MDR line with the length L.

        A_k = 2 sqrt(C1D(q_k) 2 pi / L), with C1D = pi q C2D (thesis 2.19, 2.20). If the harmonics resolve the
        spectrum, the line has the rms height of the surface, and its rms slope equals the rms gradient of the surface.
        """
        q = 2 * np.pi / length * np.arange(1, modes + 1)
        amplitude: FloatArray = 2 * np.sqrt(np.pi * q * self.at(q) * (2 * np.pi / length))
        return amplitude

    def between(self, longest: float = 0.0, shortest: float = 0.0) -> Spectrum:
        """Return the spectrum of the waves between two wavelengths in m. A wavelength of 0 means no limit.

        If the spectrum has no waves between the wavelengths, DataError is raised.
        """
        low = max(2 * np.pi / longest if longest else 0.0, float(self.wavenumber[0]))
        high = min(2 * np.pi / shortest if shortest else math.inf, float(self.wavenumber[-1]))
        if not low < high:
            ends = " to ".join(f"{2 * np.pi / q:.4g} m" for q in self.wavenumber[[0, -1]])
            what = f"expected a longest wavelength above the shortest wavelength, both within {ends}"
            raise DataError(f"{what}, got {longest:.4g} m and {shortest:.4g} m")
        inner = (self.wavenumber > low * (1 + CLOSE)) & (self.wavenumber < high * (1 - CLOSE))
        q = np.concatenate([[low], self.wavenumber[inner], [high]])
        return Spectrum(q, self.at(q))

    def continued(self, longest: float = 0.0, shortest: float = 0.0, decades: float = 1.0) -> Spectrum:
        """Return the spectrum, continued by power laws up to the wavelength `longest` and down to `shortest`, m.

        A wavelength of 0, or a wavelength within the spectrum, means no change. The exponent is fitted to the points
        within `decades` decades of the end that is continued, and to at least two points.
        """
        q, density = [self.wavenumber], [self.density]
        for index, end in (
            (0, 2 * np.pi / longest if longest else 0.0),
            (-1, 2 * np.pi / shortest if shortest else 0.0),
        ):
            last = self.wavenumber[index]
            if end and (end < last if index == 0 else end > last):
                near = np.abs(np.log10(self.wavenumber / last)) <= decades
                near[[index, 1 if index == 0 else -2]] = True
                slope = np.polyfit(self._logs[0][near], self._logs[1][near], 1)[0]
                place = 0 if index == 0 else len(q)
                q.insert(place, np.array([end]))
                density.insert(place, self.density[[index]] * (end / last) ** slope)
        return Spectrum(np.concatenate(q), np.concatenate(density))

    def rms_height(self) -> float:
        """Return the rms height, m (thesis 2.21)."""
        return math.sqrt(2 * np.pi * self._moment(1))

    def rms_gradient(self) -> float:
        """Return the rms of the gradient, from the slopes along x and along y (thesis 2.23)."""
        return math.sqrt(2 * np.pi * self._moment(3))

    def _moment(self, order: int) -> float:
        """Return the integral of q^order C2D over q; the result is exact, because C2D is a power law between points."""
        q, value = self._logs[0], np.exp(self._logs[1] + (order + 1) * self._logs[0])
        rise = np.diff(np.log(value))
        # if v is linear, the integral of exp(v) is the width times the logarithmic mean of exp(v) at both ends
        small = np.abs(rise) < 1e-8
        safe = np.where(small, 1.0, rise)
        mean = np.where(small, 0.5 * (value[1:] + value[:-1]), np.diff(value) / safe)
        return float(np.sum(mean * np.diff(q)))


def self_affine(hurst: float, longest: float, shortest: float, rms: float = 1.0, rolloff: float = 0.0) -> Spectrum:
    """Return C2D ~ q^(-2 - 2 H) between two wavelengths, with the rms height `rms` (thesis 2.14).

    C2D is constant at wavelengths above `rolloff`; 0 means no roll-off.
    """
    corners = sorted({2 * np.pi / end for end in (longest, shortest, rolloff) if end and shortest <= end <= longest})
    q = np.array(corners)
    bend = 2 * np.pi / rolloff if rolloff else 0.0
    unit = Spectrum(q, np.maximum(q / q[-1], bend / q[-1]) ** (-2 - 2 * hurst))
    return Spectrum(q, unit.density * (rms / unit.rms_height()) ** 2)


def quadrature(wavenumber: FloatArray, edges: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return nodes k and weights, shape (n, nodes), of the integral that gives the spectrum of a straight profile.

    For each of n wave numbers q, sum(weight * C2D(k)) is 2 int C2D(k) k / sqrt(k^2 - q^2) dk from k = q to infinity.
    C2D is smooth between the ascending `edges`, and 0 outside. In each interval of the quadrature, k rises by
    a factor of e at most.
    """
    parts = [np.geomspace(low, high, 1 + math.ceil(math.log(high / low)))[:-1] for low, high in pairwise(edges)]
    bounds = np.append(np.concatenate(parts), edges[-1])
    q = wavenumber[:, None]
    u = np.sqrt(np.maximum(bounds[None, :] ** 2 - q**2, 0.0))
    half = 0.5 * np.diff(u, axis=1)[:, :, None]
    place = 0.5 * (u[:, 1:] + u[:, :-1])[:, :, None] + half * NODES
    k = np.sqrt(q[:, :, None] ** 2 + place**2)
    shape = wavenumber.size, -1
    return np.clip(k, bounds[0], bounds[-1]).reshape(shape), (2 * half * WEIGHTS).reshape(shape)
