"""Friction of a lubricated line contact due to the shear of the film.

The film is computed for pure rolling and an isothermal Newtonian liquid. The slide-roll ratio must therefore be small.
Heating, which would make film and traction smaller, is neglected. Shear thinning, if an Eyring stress is given, reduces
only the shear stress, not the film.
"""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.lubrication.film_formulas import HertzLine
from mdr_dask.physics.lubrication.grid_solution import GridSolution
from mdr_dask.physics.lubrication.line_contact import LineContact
from mdr_dask.physics.lubrication.newton import Liquid, log_viscosities


def shear_stress(
    case: LineContact,
    pressure: FloatArray,
    film: FloatArray,
    W: float,
    slide_roll_ratio: float,
    eyring_stress: float | None,
) -> FloatArray:
    """Return the shear stress in the middle of the film, in units of p0, from the pressure and the film thickness.

    `pressure` is in units of p0, and `film` in units of ``a^2/R``. The Newtonian stress is ``tau = eta (u1 - u2)/h``,
    with the slide-roll ratio ``(u1 - u2)/u``. With an Eyring stress tau_E in units of p0, the stress is
    ``tau_E asinh(tau/tau_E)``. The load parameter W is needed for the ratio ``a/R = sqrt(8 W/pi)``.
    """
    slope = case.film_number * np.sqrt(2 * W / np.pi) / 6 * slide_roll_ratio
    exponent = np.minimum(log_viscosities(pressure, case.liquid), 600.0)  # a larger exponent could overflow
    newtonian: FloatArray = slope * np.exp(exponent) / film
    return newtonian if eyring_stress is None else eyring_stress * np.arcsinh(newtonian / eyring_stress)


def sliding_coefficient(
    case: LineContact, grid: GridSolution, W: float, slide_roll_ratio: float, eyring_stress: float | None
) -> float:
    """Return the integral of the shear stress in the middle of the film (see `shear_stress`), divided by the load.

    The film reaches from the first node to the rupture, which may lie between two nodes.
    """
    upstream = grid.nodes < grid.rupture
    places = np.append(grid.nodes[upstream], grid.rupture)
    pressure = np.append(grid.pressure[upstream], 0.0)
    film = np.append(grid.film[upstream], grid.film_between(places[-1:]))
    stress = shear_stress(case, pressure, film, W, slide_roll_ratio, eyring_stress)
    return float(2 / np.pi * np.trapezoid(stress, places))


def uniform_film_coefficient(
    contact: HertzLine, stress: float, liquid: Liquid, eyring_stress: float, film_share: float = 1.0
) -> float:
    """Return the friction force of a uniform film under the Hertzian pressure, divided by the whole load.

    `stress` is the Newtonian shear stress in Pa at ambient pressure, ``eta0 v/h`` with the sliding velocity v, and must
    be positive. The shear stress is ``tau_E asinh(tau/tau_E)``. Here, tau is the Newtonian stress at the pressure of
    the film, and tau_E is `eyring_stress` in Pa. If tau_E is very large, the liquid is Newtonian. `film_share` is the
    fraction of the load, and of the pressure, that the film carries. Rolling friction is not included.
    """
    nodes, weights = np.polynomial.legendre.leggauss(64)
    cosine = np.cos(np.pi / 2 * nodes)
    logarithm = log_viscosities(film_share * cosine, liquid) + np.log(stress / eyring_stress)
    # asinh(e^l) without an overflow of e^l
    sheared = eyring_stress * np.logaddexp(logarithm, np.logaddexp(2 * logarithm, 0) / 2)
    return float(np.sum(weights * sheared * cosine) / (contact.pressure * np.sum(weights * cosine**2)))
