"""Self-affine rough lines: amplitudes for an rms height of 1, and phases from a counter-based random stream."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray, random_stream

ComplexArray = NDArray[np.complex128]


def amplitudes(modes: int, hurst: float, rolloff: float = 0.0, longest: float = 0.0) -> FloatArray:
    """Return the amplitudes of a self-affine line of unit rms height.

    Parameters
    ----------
    modes : int
        Number M of harmonics; the shortest wavelength is length / M.
    hurst : float
        Hurst exponent H, 0..1: A_k ~ k^(-H - 1/2), that is C_1D ~ q^(-2H - 1).
    rolloff : float
        Harmonic number, length / wavelength, below which the spectrum is constant; 0 for no roll-off.
    longest : float
        Harmonic number, length / wavelength, below which there is no roughness; 0 for no limit.

    Returns
    -------
    array, shape (modes,)
        A_k for k = 1..M with sum A_k^2 / 2 = 1 (thesis 2.3).

    Raises
    ------
    ValueError
        If there is no roughness at any of the harmonics, because of `longest`.

    Examples
    --------
    >>> amplitudes(3, hurst=0.5).round(3)
    array([1.212, 0.606, 0.404])
    """
    k = np.arange(1, modes + 1, dtype=np.float64)
    amplitude = np.maximum(k, rolloff) ** (-hurst - 0.5)
    amplitude[k < longest * (1 - 1e-12)] = 0.0
    power = np.sum(amplitude**2) / 2
    if not power > 0:
        raise ValueError(f"the longest wavelength must be above the shortest wavelength: none of {modes} waves is left")
    unit: FloatArray = amplitude / np.sqrt(power)
    return unit


def spectral_slope(amplitude: FloatArray) -> float:
    """Return the rms slope of a line of unit length, sqrt(sum (A_k q_k)^2 / 2) with q_k = 2 pi k.

    Parameters
    ----------
    amplitude : array, shape (modes,)
        Amplitudes of the harmonics, in any unit of height.
    """
    q = 2 * np.pi * np.arange(1, amplitude.size + 1)
    return float(np.sqrt(np.sum((amplitude * q) ** 2) / 2))


def phases(seed: int, realisation: int, modes: int) -> FloatArray:
    """Return the phases of the waves of a realisation, shape (modes,), between 0 and 2 pi.

    The phases depend only on the seed and the index of the realisation. The phase of a wave does not depend on the
    number of waves. Lines that differ only in Hurst exponent, rms height or cut-off therefore have the same phases
    (thesis Fig. 2.6).
    """
    phase: FloatArray = 2 * np.pi * random_stream(seed, realisation).random(modes)
    return phase


def phase_factors(seed: int, realisation: int, modes: int) -> ComplexArray:
    """Return exp(i phi_k) for the phases of a realisation, shape (modes,); cached."""
    # the number of modes is rounded up to a power of two, so that similar lines use the same entry of the cache
    return _phase_factors(seed, realisation, 1 << max(modes - 1, 0).bit_length())[:modes]


@lru_cache(maxsize=8)  # eight entries, enough for the powers of two within a factor of 128 of one realisation
def _phase_factors(seed: int, realisation: int, modes: int) -> ComplexArray:
    factors: ComplexArray = np.exp(1j * phases(seed, realisation, modes))
    factors.flags.writeable = False
    return factors
