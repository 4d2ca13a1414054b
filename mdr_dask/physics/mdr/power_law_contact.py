"""Closed forms for normal contacts of bodies with the profile f = A r^n and the contact modulus `E_star`.

The factor kappa_n is `power_factor(n)`. The two bodies are assumed to be elastically similar, so that tangential forces
have no effect on the normal contact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.transforms import power_factor


def contact_radius(depth: ArrayLike, amplitude: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Return the contact radius a = (d / (kappa_n A))^(1/n) with kappa_n from `power_factor` (thesis eq. 2.8)."""
    ratio = np.asarray(depth, dtype=float) / (power_factor(exponent) * np.asarray(amplitude))
    return np.asarray(ratio ** (1.0 / np.asarray(exponent, dtype=float)))


def depth(radius: ArrayLike, amplitude: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Return the indentation depth d = kappa_n A a^n for the contact radius a."""
    return np.asarray(power_factor(exponent) * np.asarray(amplitude) * np.asarray(radius, dtype=float) ** exponent)


def normal_force(radius: ArrayLike, amplitude: ArrayLike, exponent: ArrayLike, E_star: ArrayLike) -> FloatArray:
    """Return the normal force F_N = 2 E* d a n / (n + 1) for the contact radius a (thesis eq. 2.10).

    Examples
    --------
    A contact radius of 1 mm on a sphere with a radius of 50 mm, E* = 115 GPa:

    >>> print(f"{normal_force(1e-3, 0.5 / 0.05, 2.0, 115e9):.1f}")
    3066.7
    """
    n = np.asarray(exponent, dtype=float)
    return np.asarray(2.0 * np.asarray(E_star) * depth(radius, amplitude, n) * np.asarray(radius) * n / (n + 1.0))


def radius_from_force(force: ArrayLike, amplitude: ArrayLike, exponent: ArrayLike, E_star: ArrayLike) -> FloatArray:
    """Return the contact radius for a normal force (the inverse function of `normal_force`)."""
    n = np.asarray(exponent, dtype=float)
    factor = 2.0 * np.asarray(E_star) * power_factor(n) * np.asarray(amplitude) * n / (n + 1.0)
    return np.asarray((np.asarray(force, dtype=float) / factor) ** (1.0 / (n + 1.0)))
