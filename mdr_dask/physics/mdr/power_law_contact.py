"""Contacts of power-law bodies of revolution in closed form: Hertz, cone, punch-like powers, and Cattaneo-Mindlin.

The profile is f = A r^n with the image g = B |x|^n, B = kappa_n A. E_star and G_star are the effective moduli;
normal and tangential contact are independent (elastically similar bodies).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.transforms import power_factor, power_pressure


def contact_radius(depth: ArrayLike, amplitude: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Return a from g(a) = d (thesis eq. 2.8): (d / (kappa_n A))^(1/n)."""
    ratio = np.asarray(depth, dtype=float) / (power_factor(exponent) * np.asarray(amplitude))
    return np.asarray(ratio ** (1.0 / np.asarray(exponent, dtype=float)))


def depth(radius: ArrayLike, amplitude: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Return the indentation depth d = kappa_n A a^n of the contact radius a."""
    return np.asarray(power_factor(exponent) * np.asarray(amplitude) * np.asarray(radius, dtype=float) ** exponent)


def normal_force(radius: ArrayLike, amplitude: ArrayLike, exponent: ArrayLike, E_star: ArrayLike) -> FloatArray:
    """Return F_N = 2 E* d a n / (n + 1) of the contact radius a (thesis eq. 2.10).

    Examples
    --------
    A contact of the radius 1 mm on a sphere of 50 mm, E* = 115 GPa:

    >>> print(f"{normal_force(1e-3, 0.5 / 0.05, 2.0, 115e9):.1f}")
    3066.7
    """
    n = np.asarray(exponent, dtype=float)
    return np.asarray(2.0 * np.asarray(E_star) * depth(radius, amplitude, n) * np.asarray(radius) * n / (n + 1.0))


def radius_from_force(force: ArrayLike, amplitude: ArrayLike, exponent: ArrayLike, E_star: ArrayLike) -> FloatArray:
    """Return the contact radius under a normal force: the inverse of `normal_force`."""
    n = np.asarray(exponent, dtype=float)
    factor = 2.0 * np.asarray(E_star) * power_factor(n) * np.asarray(amplitude) * n / (n + 1.0)
    return np.asarray((np.asarray(force, dtype=float) / factor) ** (1.0 / (n + 1.0)))


def stress(r: ArrayLike, radius: float, amplitude: float, exponent: float, E_star: float) -> FloatArray:
    """Return the pressure p(r) in the contact of radius a, zero outside (thesis eq. 2.11)."""
    return E_star * float(power_factor(exponent)) * amplitude * power_pressure(exponent, r, radius)


def punch_stress(r: ArrayLike, radius: float, depth: float, E_star: float) -> FloatArray:
    """Return the pressure under a flat punch, E* d / (pi sqrt(a^2 - r^2)), infinite at its edge."""
    inside = np.asarray(r, dtype=float)
    share = (radius - inside) * (radius + inside)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(share >= 0.0, E_star * depth / (np.pi * np.sqrt(np.maximum(share, 0.0))), 0.0)


def stiffness(radius: ArrayLike, E_star: ArrayLike) -> FloatArray:
    """Return the normal stiffness dF_N/dd = 2 E* a; the tangential one is the same with G*."""
    return np.asarray(2.0 * np.asarray(E_star) * np.asarray(radius, dtype=float))


def stick_radius(slip_share: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Return c / a0 from eta = G* U0 / (mu E* d0) < 1 (thesis eq. 6.7): (1 - eta)^(1/n); NaN in gross slip."""
    rest = 1.0 - np.asarray(slip_share, dtype=float)
    return np.where(rest > 0.0, np.maximum(rest, 0.0) ** (1.0 / np.asarray(exponent, dtype=float)), np.nan)


def tangential_force(stick: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Return F_x / (mu F_N) when slip has advanced to the radius c = stick * a: 1 - c^(n+1) (Cattaneo, Mindlin)."""
    return np.asarray(1.0 - np.asarray(stick, dtype=float) ** (np.asarray(exponent, dtype=float) + 1.0))


def tangential_displacement(stick: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Return u_x G* / (mu E* d) when slip has advanced to c = stick * a: 1 - c^n."""
    return np.asarray(1.0 - np.asarray(stick, dtype=float) ** np.asarray(exponent, dtype=float))


def hysteresis_loop(eta: float, exponent: float, points: int = 101) -> tuple[FloatArray, FloatArray]:
    """Return one closed cycle of displacement and force under the amplitude eta < 1.

    Parameters
    ----------
    eta : float
        Amplitude in units of mu E* d / G*.
    exponent : float
        Exponent of the profile.
    points : int
        Points on each branch.

    Returns
    -------
    displacement, force : array, shape (2 points,)
        In units of mu E* d / G* and mu F_N: down from +eta to -eta, and back (Masing's rule, exact here).
    """
    downwards = np.linspace(eta, -eta, points)
    peak = _virgin(np.array(eta), exponent)
    branch = peak - 2.0 * _virgin(0.5 * (eta - downwards), exponent)
    return np.concatenate([downwards, -downwards]), np.concatenate([branch, -branch])


def dissipation(stick: ArrayLike, exponent: ArrayLike) -> FloatArray:
    """Return the energy lost in a cycle, in units of mu^2 E*^2 d0^2 a0 / G*.

    Parameters
    ----------
    stick : array_like
        c / a0 of the amplitude.
    exponent : array_like
        Exponent n of the profile.

    Returns
    -------
    array
        8 int_c^1 (1 - x^n)(x^n - c^n) dx; (16/15)(1 - 5c^2 + 5c^3 - c^5) for a parabola.
    """
    c, n = np.asarray(stick, dtype=float), np.asarray(exponent, dtype=float)
    low = (1.0 + c**n) * (1.0 - c ** (n + 1.0)) / (n + 1.0)
    return np.asarray(8.0 * (low - (1.0 - c ** (2.0 * n + 1.0)) / (2.0 * n + 1.0) - c**n * (1.0 - c)))


def _virgin(displacement: FloatArray, exponent: float) -> FloatArray:
    """Return the force of the first loading, in units of mu F_N."""
    return 1.0 - (1.0 - displacement) ** ((exponent + 1.0) / exponent)
