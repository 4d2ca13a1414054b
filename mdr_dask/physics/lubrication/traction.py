"""Friction of a lubricated line contact due to the shear of the film.

The film is computed for pure rolling and an isothermal Newtonian liquid. The slide-roll ratio must therefore be small.
Heating and shear thinning would make film and traction smaller.
"""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.lubrication.grid_solution import GridSolution
from mdr_dask.physics.lubrication.line_contact import LineContact
from mdr_dask.physics.lubrication.newton import log_viscosities


def shear_stress(
    case: LineContact, grid: GridSolution, W: float, slide_roll_ratio: float, eyring_stress: float | None
) -> FloatArray:
    """Return the shear stress in the middle of the film at the nodes, in units of p0, or zero where there is no film.

    The Newtonian stress is ``tau = eta (u1 - u2)/h``, with the slide-roll ratio ``(u1 - u2)/u``. With an Eyring stress
    tau_E in units of p0, the stress is ``tau_E asinh(tau/tau_E)``. The load parameter W is needed for the ratio
    ``a/R = sqrt(8 W/pi)``.
    """
    slope = case.film_number * np.sqrt(2 * W / np.pi) / 6 * slide_roll_ratio
    exponent = np.minimum(log_viscosities(grid.pressure, case.liquid), 600.0)  # a larger exponent could overflow
    newtonian = np.where(grid.pressure > 0, slope * np.exp(exponent) / grid.film, 0.0)
    return newtonian if eyring_stress is None else eyring_stress * np.arcsinh(newtonian / eyring_stress)


def sliding_coefficient(
    case: LineContact, grid: GridSolution, W: float, slide_roll_ratio: float, eyring_stress: float | None
) -> float:
    """Return the integral of the shear stress in the middle of the film (see `shear_stress`), divided by the load."""
    stress = shear_stress(case, grid, W, slide_roll_ratio, eyring_stress)
    return float(2 / np.pi * np.trapezoid(stress, grid.nodes))


def rolling_coefficient(grid: GridSolution, W: float) -> float:
    """Return the integral of ``(h/2) dp/dx``, which is the rolling friction of one surface, divided by the load."""
    film = (grid.film[1:] + grid.film[:-1]) / 2
    return float(2 / np.pi * np.sqrt(8 * W / np.pi) * np.sum(film / 2 * np.diff(grid.pressure)))
