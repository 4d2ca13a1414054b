"""Friction of a lubricated line contact from the shear of its film.

The film is computed for pure rolling and a Newtonian liquid of constant temperature; the shear stress follows from this
film. This is a good approximation for small sliding velocities. Heating and shear thinning are neglected; both effects
would make film and traction smaller.
"""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.lubrication.grid_solution import GridSolution
from mdr_dask.physics.lubrication.line_contact import LineContact
from mdr_dask.physics.lubrication.newton import log_viscosities

#: Largest natural logarithm of the viscosity ratio that is evaluated; a Newtonian liquid of higher viscosity has no
#: physical meaning.
_LARGEST_EXPONENT = 600.0


def shear_stress(
    case: LineContact, grid: GridSolution, W: float, slide_roll_ratio: float, eyring_stress: float | None
) -> FloatArray:
    """Return the shear stress at mid-film.

    Parameters
    ----------
    case : LineContact
        The dimensionless numbers of the case.
    grid : GridSolution
        Pressure and film of the case.
    W : float
        Load parameter; the shear stress in units of p0 depends on W because of ``a/R = sqrt(8 W/pi)``.
    slide_roll_ratio : float
        ``(u1 - u2)/u`` with the mean velocity u.
    eyring_stress : float or None
        Eyring's stress in units of p0; None for a Newtonian liquid.

    Returns
    -------
    array, shape (n,)
        Shear stress in units of p0 at the nodes. The stress of a Newtonian liquid is ``tau = eta (u1 - u2)/h``. With
        Eyring's law, the stress is ``tau_E asinh(tau/tau_E)``, where tau is the Newtonian stress. The stress is zero
        where the film has ended.
    """
    slope = case.film_number * np.sqrt(2 * W / np.pi) / 6 * slide_roll_ratio
    exponent = np.minimum(log_viscosities(grid.pressure, case.liquid), _LARGEST_EXPONENT)
    newtonian = np.where(grid.pressure > 0, slope * np.exp(exponent) / grid.film, 0.0)
    return newtonian if eyring_stress is None else eyring_stress * np.arcsinh(newtonian / eyring_stress)


def sliding_coefficient(
    case: LineContact, grid: GridSolution, W: float, slide_roll_ratio: float, eyring_stress: float | None
) -> float:
    """Return the integral of the shear stress at mid-film, divided by the load; arguments as in `shear_stress`."""
    stress = shear_stress(case, grid, W, slide_roll_ratio, eyring_stress)
    return float(2 / np.pi * np.trapezoid(stress, grid.nodes))


def rolling_coefficient(grid: GridSolution, W: float) -> float:
    """Return the rolling friction of one surface, the integral of ``(h/2) dp/dx``, divided by the load."""
    film = (grid.film[1:] + grid.film[:-1]) / 2
    return float(2 / np.pi * np.sqrt(8 * W / np.pi) * np.sum(film / 2 * np.diff(grid.pressure)))
