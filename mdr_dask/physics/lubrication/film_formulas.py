"""Closed formulas for a lubricated line contact: Hertz contact and film thickness.

The velocity is the mean ``u = (u1 + u2)/2``, and films are given as ``h/R`` (thesis section 5.2.1 and appendix B). The
dimensionless groups are ``W = F/(L' E' R)``, ``U = eta0 u/(E' R)`` and ``G = alpha E'``, with ``E' = 2 E*``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray

STEEL = 210e9 / (2 * (1 - 0.3**2))  # contact modulus of steel on steel in Pa, with E = 210 GPa and nu = 0.3


class HertzLine(NamedTuple):
    """Half width (m) and maximum pressure (Pa) of a dry line contact."""

    half_width: FloatArray
    pressure: FloatArray


def hertz_line(line_load: ArrayLike, E_star: ArrayLike, radius: ArrayLike) -> HertzLine:
    """Return half width and maximum pressure of a Hertzian line contact (thesis eq. 5.2).

    Parameters
    ----------
    line_load : array_like
        Normal force per length of the line, ``w = F/L'``, in N/m.
    E_star, radius : array_like
        Contact modulus in Pa and reduced radius in m.

    Returns
    -------
    HertzLine
        ``a = sqrt(4 w R/(pi E*))`` and ``p0 = 2 w/(pi a)``.
    """
    load = np.asarray(line_load, dtype=np.float64)
    half_width = np.sqrt(4 * load * np.asarray(radius) / (np.pi * np.asarray(E_star)))
    return HertzLine(half_width, 2 * load / (np.pi * half_width))


def hertz_gap(x: ArrayLike, half_width: float, radius: float) -> FloatArray:
    """Return the gap in m between the bodies of a dry line contact, or 0 inside the contact.

    `x` contains distances from the centre of the contact in m.
    """
    ratio = np.maximum(1.0, np.abs(np.asarray(x, dtype=np.float64)) / half_width)
    root = np.sqrt(ratio**2 - 1)
    return np.asarray(half_width**2 / (2 * radius) * (ratio * root - np.log(ratio + root)))


def thick_film(film: float) -> str:
    """Return a message if a film h/R is too thick for lubrication theory, or an empty string."""
    if not film > 0.1:  # up to this height, a roller differs from a parabola by a few per cent at most
        return ""
    return (
        "the film is thicker than 0.1 of the radius: the rollers cannot be approximated by parabolas, and "
        "Reynolds' equation does not hold"
    )


class Groups(NamedTuple):
    """Load, speed and material parameters ``W``, ``U``, ``G`` of a line contact."""

    W: FloatArray
    U: FloatArray
    G: FloatArray


def dimensionless_groups(
    line_load: ArrayLike,
    viscosity: ArrayLike,
    mean_velocity: ArrayLike,
    pressure_viscosity: ArrayLike,
    E_star: ArrayLike,
    radius: ArrayLike,
) -> Groups:
    """Return ``W = w/(E' R)``, ``U = eta0 u/(E' R)`` and ``G = alpha E'`` with ``E' = 2 E*``.

    Parameters
    ----------
    line_load : array_like
        Normal force per length in N/m.
    viscosity : array_like
        Dynamic viscosity at ambient pressure in Pa s.
    mean_velocity : array_like
        Mean velocity of the two surfaces, ``(u1 + u2)/2``, in m/s.
    pressure_viscosity : array_like
        Pressure-viscosity coefficient alpha in 1/Pa.
    E_star, radius : array_like
        Contact modulus in Pa and reduced radius in m.
    """
    modulus = 2 * np.asarray(E_star, dtype=np.float64)
    stiffness = modulus * np.asarray(radius)
    W = np.asarray(line_load) / stiffness
    U = np.asarray(viscosity) * np.asarray(mean_velocity) / stiffness
    return Groups(W, U, np.asarray(pressure_viscosity) * modulus)


@dataclass(frozen=True)
class FilmFormula:
    """A regression ``h/R = factor W^load U^speed G^material``, fitted to data in the `ranges` of W, U and G."""

    name: str
    factor: float
    load: float
    speed: float
    material: float
    ranges: tuple[tuple[float, float], ...]

    def __call__(self, W: ArrayLike, U: ArrayLike, G: ArrayLike) -> FloatArray:
        """Return the film h/R. The arrays W, U and G broadcast."""
        return np.asarray(
            self.factor
            * np.asarray(W, float) ** self.load
            * np.asarray(U, float) ** self.speed
            * np.asarray(G, float) ** self.material
        )

    def outside(self, W: float, U: float, G: float) -> str:
        """Return a message that names the parameters outside the fitted ranges, or an empty string."""
        outside = [
            f"{symbol} lies outside {low:g} to {high:g}"
            for symbol, value, (low, high) in zip("WUG", (W, U, G), self.ranges, strict=True)
            if not low <= value <= high
        ]
        return f"film formula {self.name} is extrapolated: {', '.join(outside)}" if outside else ""


# ranges quoted from memory, because no open copy of the papers was available (docs/evidence/mixed-lubrication.md)
_PAN_HAMROCK_RANGES = ((2.045e-5, 5.0e-4), (1.0e-12, 5.0e-10), (2504.0, 10014.0))
_DOWSON_HIGGINSON_RANGES = ((3.0e-5, 3.0e-4), (1.0e-13, 1.0e-11), (2500.0, 5000.0))

#: Pan and Hamrock (1989) state the factor 2.922; the thesis prints 2.992 in eq. 5.3 and 2.929 in appendix B.
PAN_HAMROCK_CENTRAL = FilmFormula("Pan-Hamrock (central)", 2.922, -0.166, 0.692, 0.470, _PAN_HAMROCK_RANGES)
PAN_HAMROCK_MINIMUM = FilmFormula("Pan-Hamrock (minimum)", 1.714, -0.128, 0.694, 0.568, _PAN_HAMROCK_RANGES)
DOWSON_HIGGINSON_MINIMUM = FilmFormula("Dowson-Higginson (minimum)", 2.65, -0.13, 0.70, 0.54, _DOWSON_HIGGINSON_RANGES)


#: Film formulas by name; campaigns use these names.
FORMULAS: dict[str, FilmFormula] = {
    "pan_hamrock": PAN_HAMROCK_CENTRAL,
    "pan_hamrock_minimum": PAN_HAMROCK_MINIMUM,
    "dowson_higginson": DOWSON_HIGGINSON_MINIMUM,
}


def square_of_half_width(W: float) -> float:
    """Return ``(a/R)^2 = 8 W/pi``, where a is the half width of the dry contact. The film is ``h/R = H (a/R)^2``."""
    return 8 * W / np.pi


class Moes(NamedTuple):
    """Moes' load and lubricant parameters.

    For an incompressible liquid with Barus' law, the film ``h/R (2 U)^(-1/2)`` depends only on these two numbers.
    """

    M: FloatArray
    L: FloatArray


def moes_parameters(W: ArrayLike, U: ArrayLike, G: ArrayLike) -> Moes:
    """Return ``M = W (2U)^(-1/2)`` and ``L = G (2U)^(1/4)``."""
    speed = 2 * np.asarray(U, dtype=np.float64)
    return Moes(np.asarray(W) / np.sqrt(speed), np.asarray(G) * speed**0.25)


RIGID_ISOVISCOUS = 4.894968  # (h_min/R) W/U of a rigid parabola with the Reynolds exit condition (Kapitza)
#: (h_min/R) (G U)^(-2/3) of a rigid parabola, at the film for which the largest isoviscous pressure is 1/alpha (Blok)
RIGID_PIEZOVISCOUS = 1.666297
ELASTIC_ISOVISCOUS = 2.05  # (h_min/R) M^(1/5) (2 U)^(-1/2) of soft bodies (Moes)


def limiting_films(W: ArrayLike, U: ArrayLike, G: ArrayLike) -> FloatArray:
    """Return the minimum film ``h/R`` in each of the four limiting regimes, shape (4, ...).

    The regimes are rigid isoviscous, rigid piezoviscous, elastic isoviscous and elastic piezoviscous. As in Johnson's
    map of the regimes, the formula of Dowson and Higginson gives the elastic piezoviscous film.
    """
    W, U, G = np.broadcast_arrays(np.asarray(W, float), np.asarray(U, float), np.asarray(G, float))
    M = moes_parameters(W, U, G).M
    return np.stack(
        [
            RIGID_ISOVISCOUS * U / W,
            RIGID_PIEZOVISCOUS * (G * U) ** (2 / 3),
            ELASTIC_ISOVISCOUS * M**-0.2 * np.sqrt(2 * U),
            DOWSON_HIGGINSON_MINIMUM(W, U, G),
        ]
    )


def expected_film(M: float, L: float) -> float:
    """Return a first guess of the film in units of ``a^2/R``, taken from the films of the four limiting regimes."""
    rigid_iso, rigid_piezo, elastic_iso, elastic_piezo = limiting_films(M, 0.5, L) * np.pi / (8 * M)
    return float(max(min(rigid_piezo, elastic_piezo), max(rigid_iso, elastic_iso)))
