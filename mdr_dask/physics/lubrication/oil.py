"""Lubricating oils: viscosity as a function of temperature and pressure, density, and pressure-viscosity coefficient.

Temperatures are in K, pressures in Pa, dynamic viscosities in Pa s, and kinematic viscosities in m^2/s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray

_LUBRICANT_EXPANSION = 0.6278  # coefficient of expansion in 1/K times density in kg/m^3 at 60 F (ASTM D1250, table 54D)

#: Pairs (s, t) of Gold's correlation ``alpha = s nu^t 1e-9``, alpha in 1/Pa and nu in mm^2/s, for each kind of oil.
#: Only the pair for mineral oils could be confirmed (see docs/evidence/mixed-lubrication.md).
GOLD: dict[str, tuple[float, float]] = {
    "gold_mineral": (9.904, 0.1390),
    "gold_polyalphaolefin": (7.382, 0.1335),
}


def walther_constants(temperature: ArrayLike, viscosity: ArrayLike) -> tuple[float, float]:
    """Return A and B of ASTM D341, ``log10 log10(nu + 0.7) = A - B log10 T`` with nu in mm^2/s and T in K.

    With more than two viscosities, a least-squares fit to ``log10 log10(nu + 0.7)`` gives the constants.

    Parameters
    ----------
    temperature : array_like, shape (n,)
        Temperatures in K. At least two temperatures must differ.
    viscosity : array_like, shape (n,)
        Kinematic viscosities in m^2/s at these temperatures.

    Raises
    ------
    ValueError
        If all temperatures are equal, a viscosity is below 2 mm^2/s (where D341 needs more terms), or the viscosity
        does not fall with temperature.

    Examples
    --------
    >>> A, B = walther_constants([313.15, 333.15, 373.15], [335e-6, 136e-6, 38.3e-6])
    >>> print(f"{A:.2f} {B:.2f}")
    6.97 2.63
    """
    T, nu = (np.asarray(each, dtype=np.float64) for each in (temperature, viscosity))
    if np.unique(T).size < 2:
        raise ValueError(f"expected viscosities at two temperatures or more, got all of them at {float(T[0])!r} K")
    if nu.min() < 2e-6:
        raise ValueError(
            f"expected kinematic viscosities of at least 2 mm^2/s (ASTM D341), got {float(nu.min())!r} m^2/s"
        )
    slope, A = np.polyfit(np.log10(T), np.log10(np.log10(nu / 1e-6 + 0.7)), 1)
    if slope >= 0:
        raise ValueError(
            f"expected viscosities that fall with temperature, got {nu.tolist()!r} m^2/s at {T.tolist()!r} K"
        )
    return float(A), float(-slope)


def kinematic_viscosity(temperature: ArrayLike, A: float, B: float) -> FloatArray:
    """Return the kinematic viscosity in m^2/s at a temperature in K by ASTM D341 (Walther)."""
    exponent = 10.0 ** (A - B * np.log10(np.asarray(temperature, dtype=np.float64)))
    return np.asarray((10.0**exponent - 0.7) * 1e-6)


def density_at(temperature: ArrayLike, density: float, reference_temperature: float) -> FloatArray:
    """Return the density at a temperature in K: ``rho_ref exp(-b dT (1 + 0.8 b dT))`` with ``b = 0.6278/rho_ref``.

    `density` is rho_ref, the density in kg/m^3 at the reference temperature. dT is the temperature minus the reference
    temperature. The formula is from ASTM D1250, table 54D, in which the reference temperature is 60 F.
    """
    expansion = _LUBRICANT_EXPANSION / density * (np.asarray(temperature, dtype=np.float64) - reference_temperature)
    return np.asarray(density * np.exp(-expansion * (1 + 0.8 * expansion)))


def pressure_viscosity(correlation: str, kinematic: ArrayLike) -> FloatArray:
    """Return the pressure-viscosity coefficient alpha in 1/Pa by Gold's power law of the kinematic viscosity.

    Parameters
    ----------
    correlation : str
        Kind of oil, one of the names in `GOLD`.
    kinematic : array_like
        Kinematic viscosity in m^2/s at ambient pressure.

    Raises
    ------
    ValueError
        If the kind of oil is unknown.
    """
    if correlation not in GOLD:
        raise ValueError(f"expected one of the correlations {', '.join(GOLD)}, got {correlation!r}")
    factor, exponent = GOLD[correlation]
    return np.asarray(factor * (np.asarray(kinematic, dtype=np.float64) / 1e-6) ** exponent * 1e-9)


@dataclass(frozen=True)
class Oil:
    """An oil, described by the numbers of a data sheet.

    Parameters
    ----------
    T1, nu1, T2, nu2 : float
        Two temperatures in K, and the kinematic viscosities in m^2/s at these temperatures.
    density, density_temperature : float
        Density in kg/m^3, and the temperature in K at which the density was measured.
    correlation : str
        Pressure-viscosity correlation, one of the names in `GOLD`.
    lowest, highest : float
        Range of temperatures in K in which the data are valid.

    Examples
    --------
    >>> oil = Oil(313.15, 320e-6, 373.15, 24e-6, 900.0, 288.15, "gold_mineral", 273.15, 393.15)
    >>> print(f"{float(oil.dynamic(333.15)):.3f} Pa s")
    0.094 Pa s
    """

    T1: float
    nu1: float
    T2: float
    nu2: float
    density: float
    density_temperature: float
    correlation: str
    lowest: float
    highest: float

    def kinematic(self, temperature: ArrayLike) -> FloatArray:
        """Return the kinematic viscosity in m^2/s at temperatures in K."""
        return kinematic_viscosity(temperature, *walther_constants((self.T1, self.T2), (self.nu1, self.nu2)))

    def dynamic(self, temperature: ArrayLike) -> FloatArray:
        """Return the viscosity at ambient pressure in Pa s at temperatures in K."""
        return self.kinematic(temperature) * density_at(temperature, self.density, self.density_temperature)

    def alpha(self, temperature: ArrayLike) -> FloatArray:
        """Return the pressure-viscosity coefficient in 1/Pa at temperatures in K, by the correlation of the oil."""
        return pressure_viscosity(self.correlation, self.kinematic(temperature))

    def outside(self, temperature: float) -> str:
        """Return a message if a temperature is outside the range of the data, or an empty string."""
        if self.lowest <= temperature <= self.highest:
            return ""
        ends = f"{self.lowest:.9g} to {self.highest:.9g} K"
        return f"expected a temperature within the oil's data, {ends}, got {temperature:.9g} K"


#: Available oils, by name. The thesis (table A.1) states no pressure-viscosity coefficient, so a correlation is used.
OILS: dict[str, Oil] = {
    "mobilgear_shc_xmp_320": Oil(
        T1=313.15,
        nu1=335e-6,
        T2=373.15,
        nu2=38.3e-6,
        density=0.860 * 999.016,  # specific gravity times the density of water at 60 F
        density_temperature=288.705555,  # 60 F
        correlation="gold_polyalphaolefin",
        lowest=313.15,
        highest=373.15,
    ),
}


ROELANDS_PRESSURE = 1.9609e8  # p_r of Roelands' law in Pa
ROELANDS_LOGARITHM = 9.67  # the constant in ln eta0 + 9.67, with eta0 in Pa s


DENSITY_RISE = 0.6e-9  # in 1/Pa; rho/rho0 = 1 + DENSITY_RISE p/(1 + DENSITY_SATURATION p) (thesis eq. B.6)
DENSITY_SATURATION = 1.7e-9  # in 1/Pa, in the same formula
