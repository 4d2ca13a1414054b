"""Laws of sliding friction in closed form (thesis chapter 3), and the dimensionless numbers in these laws.

Arguments may be numbers, numpy arrays or xarray arrays that broadcast. "Slope" means the spectral rms slope of the
line.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

INDENTER_EXPONENT = 1.5  # exponent alpha in eq. 3.40
BETA = 1.6  # beta of eq. 3.11 for every Hurst exponent; computed values: 1.61 to 1.67 (docs/evidence/friction.md, Laws)


def force_number(force: Any, shear_modulus: Any, rms: Any, length: Any) -> Any:
    """Return F_N / (G h L) (eq. 3.20)."""
    return force / (shear_modulus * rms * length)


def velocity_number(velocity: Any, relaxation_time: Any, slope: Any, rms: Any) -> Any:
    """Return v tau slope / (sqrt(2) h) (eq. 3.19).

    If this number is about 1, only the fronts of the asperities are in contact.
    """
    return velocity * relaxation_time * slope / (math.sqrt(2) * rms)


def alpha(hurst: Any) -> Any:
    """Return the exponent alpha = H / (1 + H) of eq. 3.11 for the Hurst exponent H (eq. 3.13)."""
    return hurst / (1 + hurst)


def full_contact(force: Any, velocity: Any) -> Any:
    """Return mu / slope in full contact, from `force_number` and `velocity_number`.

    The underlying law mu = 4 eta v L slope^2 / F_N is exact (eq. 3.14).
    """
    return 4 * math.sqrt(2) * velocity / force


def interpolation(force: Any, velocity: Any, exponent: Any, beta: Any) -> Any:
    """Return mu / (sqrt(2) slope) for all velocities and forces (eq. 3.17, 3.18).

    The arguments are `force_number`, `velocity_number`, and the constants alpha and beta of eq. 3.11. Three laws are
    combined by 1 / mu^2 = 1 / mu_1^2 + 1 / mu_2^2 + 1 / mu_3^2. Here mu_1 = sqrt(2) slope is the plateau, mu_2 follows
    from `full_contact`, and mu_3 = mu_1 * beta * velocity / force^alpha is the law at low velocity and low force.
    """
    return (1 + (crossover(force, exponent, beta) / velocity) ** 2) ** -0.5


def crossover(force: Any, exponent: Any, beta: Any) -> Any:
    """Return the `velocity_number` at which friction, extrapolated linearly from low velocity, reaches the plateau."""
    return np.hypot(force / 4, force**exponent / beta)


def indenter_low(
    half_width: Any, velocity: Any, relaxation_time: Any, shear_modulus: Any, force: Any, slope: Any
) -> Any:
    """Return mu of a rough indenter at low velocity, 8 G a tau v slope^2 / F_N.

    This is eq. 3.34 with the contact length L_cont = 2a, where a is `half_width`.
    """
    return 8 * shear_modulus * half_width * relaxation_time * velocity * slope**2 / force


def indenter(xi: Any, exponent: Any = INDENTER_EXPONENT) -> Any:
    """Return mu / (sqrt(2) slope) of a rough indenter (eq. 3.40, 3.43).

    The argument `xi` is mu / (sqrt(2) slope) with mu from `indenter_low`.
    """
    return np.exp(-np.logaddexp(0.0, -exponent * np.log(xi)) / exponent)
