"""Friction of a lubricated line contact from the shear of its film.

The film itself is that of a Newtonian, isothermal liquid in rolling; the shear is laid over it. That is right for small
sliding; heat and shear thinning, which lower the film and the traction, are left out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.lubrication.levels import GridSolution
from mdr_dask.physics.lubrication.line_contact import LineContact, LineSolution
from mdr_dask.physics.lubrication.newton import log_viscosities

#: Largest exponent of a viscosity ratio that is evaluated; a Newtonian liquid that thick has no meaning any more.
_LARGEST_EXPONENT = 600.0


class Traction(NamedTuple):
    """Friction forces over the load.

    Parameters
    ----------
    sliding : float
        Integral of the shear stress at mid-film over the load.
    sliding_error : float
        Its change from the coarser grid to the finer one.
    rolling : float
        Integral of ``(h/2) dp/dx`` over the load: what rolling costs each surface.
    """

    sliding: float
    sliding_error: float
    rolling: float


def shear_stress(
    case: LineContact, grid: GridSolution, W: float, slide_roll_ratio: float, eyring_stress: float | None
) -> FloatArray:
    """Return the shear stress at mid-film.

    Parameters
    ----------
    case : LineContact
        Its dimensionless numbers.
    grid : GridSolution
        Its pressure and film.
    W : float
        Load parameter; ``a/R = sqrt(8 W/pi)`` sets the slope of the surfaces.
    slide_roll_ratio : float
        ``(u1 - u2)/u`` with the mean velocity u.
    eyring_stress : float or None
        Eyring's stress in p0, None for a Newtonian liquid.

    Returns
    -------
    array, shape (n,)
        In p0 at the nodes: ``eta (u1 - u2)/h``, or ``tau_E asinh`` of that over tau_E; zero where the film is torn.
    """
    slope = case.film_number * np.sqrt(2 * W / np.pi) / 6 * slide_roll_ratio
    exponent = np.minimum(log_viscosities(grid.pressure, case.liquid), _LARGEST_EXPONENT)
    newtonian = np.where(grid.pressure > 0, slope * np.exp(exponent) / grid.film, 0.0)
    return newtonian if eyring_stress is None else eyring_stress * np.arcsinh(newtonian / eyring_stress)


def traction(solution: LineSolution, W: float, slide_roll_ratio: float, eyring_stress: float | None = None) -> Traction:
    """Return the friction coefficients of a solved line contact.

    Parameters
    ----------
    solution : LineSolution
        A solution with status zero.
    W, slide_roll_ratio, eyring_stress
        As for :func:`shear_stress`.

    Returns
    -------
    Traction
        With Barus' law and a Newtonian liquid the error says how far the pressure spike decides.
    """
    fine, coarse = (
        2 / np.pi * np.trapezoid(shear_stress(solution.case, grid, W, slide_roll_ratio, eyring_stress), grid.nodes)
        for grid in (solution.fine, solution.coarse)
    )
    film = (solution.film[1:] + solution.film[:-1]) / 2
    rolling = 2 / np.pi * np.sqrt(8 * W / np.pi) * np.sum(film / 2 * np.diff(solution.pressure))
    return Traction(float(fine), float(abs(fine - coarse)), float(rolling))
