"""The elastohydrodynamic film of a line contact, from rigid and isoviscous to elastic and piezoviscous.

Hertz units: ``X = x/a``, ``P = p/p0``, ``H = h R/a^2`` (thesis eq. B.13), with ``a/R = sqrt(8 W/pi)`` and
``p0 = E' sqrt(W/(2 pi))``. Two numbers decide for Barus and an incompressible liquid: Moes' M and L. A solution of
:func:`solve` starts from a guess of its own; for dense sweeps see :mod:`mdr_dask.physics.lubrication.lattice`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.lubrication.deformation import film as film_at
from mdr_dask.physics.lubrication.film_formulas import moes_parameters
from mdr_dask.physics.lubrication.levels import GridSolution, Levels, minimum, solve_levels
from mdr_dask.physics.lubrication.newton import CONVERGED, FILM_COLLAPSED, SINGULAR, TOO_MANY_STEPS, Liquid
from mdr_dask.physics.lubrication.oil import DENSITY_RISE, DENSITY_SATURATION, ROELANDS_LOGARITHM, ROELANDS_PRESSURE

VISCOSITY_LAWS = ("barus", "roelands")

_WHY = {
    TOO_MANY_STEPS: "the Newton iteration did not settle",
    SINGULAR: "the Newton equations became singular",
    FILM_COLLAPSED: "the Newton iteration would have closed the film",
}
#: A second pressure maximum counts as a spike if it stands out by this share of the greatest pressure.
_SPIKE = 0.01


class LineContact(NamedTuple):
    """A case in dimensionless numbers; equal tuples have the same solution.

    Parameters
    ----------
    M, L : float
        Moes' load and lubricant parameters.
    pole, exponent : float
        Roelands' pressure over p0 and exponent z; zeros for Barus.
    density_rise, density_saturation : float
        Constants of the density law times p0; zeros for an incompressible liquid.
    inlet : float or None
        Where the oil begins, in half widths (negative); None for a fully flooded inlet.
    """

    M: float
    L: float
    pole: float = 0.0
    exponent: float = 0.0
    density_rise: float = 0.0
    density_saturation: float = 0.0
    inlet: float | None = None

    @property
    def film_number(self) -> float:
        """Return ``K = (3 pi^2/4) U/W^2``."""
        return 3 * np.pi**2 / (8 * self.M**2)

    @property
    def liquid(self) -> Liquid:
        """Return the laws of the liquid; ``alpha p0 = L sqrt(M/(2 pi))``."""
        alpha = self.L * float(np.sqrt(self.M / (2 * np.pi)))
        return Liquid(alpha, self.pole, self.exponent, self.density_rise, self.density_saturation)


def line_contact(
    W: float,
    U: float,
    G: float,
    E_star: float,
    *,
    viscosity_law: str = "barus",
    viscosity: float | None = None,
    compressible: bool = True,
    inlet: float | None = None,
) -> LineContact:
    """Return the dimensionless case of a line contact.

    Parameters
    ----------
    W, U, G : float
        Load, speed and material parameters with ``E' = 2 E*`` and the mean velocity.
    E_star : float
        Contact modulus in Pa; it sets the pressures that the density law and Roelands' law see.
    viscosity_law : str
        ``"barus"`` or ``"roelands"``.
    viscosity : float, optional
        Viscosity at ambient pressure in Pa s; needed by Roelands' law.
    compressible : bool
        Whether the density follows the law of Dowson and Higginson.
    inlet : float, optional
        Where the oil begins, in half widths, negative; None for a fully flooded inlet.

    Raises
    ------
    ValueError
        If a number is not positive, the law is unknown, Roelands' law has no viscosity above ``exp(-9.67)`` Pa s, or
        the inlet is not upstream.
    """
    for name, value in (("W", W), ("U", U), ("G", G), ("E_star", E_star)):
        if not (np.isfinite(value) and (value > 0 or (name == "G" and value == 0))):
            raise ValueError(f"expected a positive {name}, got {value!r}")
    if inlet is not None and not inlet < 0:
        raise ValueError(f"expected an inlet upstream of the centre, in half widths and negative, got {inlet!r}")
    moes = moes_parameters(W, U, G)
    p0 = 2 * E_star * float(np.sqrt(W / (2 * np.pi)))
    pole = exponent = 0.0
    if viscosity_law == "roelands" and G > 0:
        if viscosity is None or not np.log(viscosity) + ROELANDS_LOGARITHM > 0:
            raise ValueError(f"roelands' law needs a viscosity above 6.3e-5 Pa s, got {viscosity!r}")
        pole = ROELANDS_PRESSURE / p0
        exponent = G / (2 * E_star) * ROELANDS_PRESSURE / float(np.log(viscosity) + ROELANDS_LOGARITHM)
    elif viscosity_law not in VISCOSITY_LAWS:
        raise ValueError(f"expected a viscosity law of {', '.join(VISCOSITY_LAWS)}, got {viscosity_law!r}")
    rise, saturation = (DENSITY_RISE * p0, DENSITY_SATURATION * p0) if compressible else (0.0, 0.0)
    return LineContact(float(moes.M), float(moes.L), pole, exponent, rise, saturation, inlet)


@dataclass(frozen=True)
class LineSolution:
    """The film of a line contact in Hertz units.

    Parameters
    ----------
    case : LineContact
        What was solved.
    status : int
        CONVERGED (0), or what stopped the iteration on the grid that failed.
    reason : str
        One sentence if it failed or missed the accuracy, else empty.
    fine, coarse : GridSolution
        On the finest grid and on the one before, of double spacing; empty if it failed.
    central_film, minimum_film : float
        In ``a^2/R``, extrapolated over the grids to second order.
    minimum_position : float
        Of the minimum film, in half widths.
    error : float
        Estimated relative error of the worse of the two films.
    order : float
        Observed order of convergence of the central film; NaN if fewer than three grids were solved.
    load_error : float
        Relative deviation of the integral of the pressure from the load.
    spike_position, spike_pressure : float
        Place and height of the pressure spike, NaN if there is none. The height does not converge with Barus' law.
    rupture_position : float
        Where the film ends, in half widths.
    steps : int
        Newton steps on all grids together.
    """

    case: LineContact
    status: int
    reason: str
    fine: GridSolution
    coarse: GridSolution
    central_film: float
    minimum_film: float
    minimum_position: float
    error: float
    order: float
    load_error: float
    spike_position: float
    spike_pressure: float
    rupture_position: float
    steps: int

    @property
    def nodes(self) -> FloatArray:
        """Nodes of the finest grid in half widths, shape (n,)."""
        return self.fine.nodes

    @property
    def pressure(self) -> FloatArray:
        """Pressure there in p0, shape (n,)."""
        return self.fine.pressure

    @property
    def film(self) -> FloatArray:
        """Film there in ``a^2/R``, shape (n,)."""
        return self.fine.film

    def film_at(self, positions: FloatArray) -> FloatArray:
        """Return the film at any positions in half widths, from the deformation by the pressure found."""
        return film_at(np.asarray(positions, dtype=np.float64), self.nodes, self.pressure, self.fine.central)

    def pressure_at(self, positions: FloatArray) -> FloatArray:
        """Return the pressure in p0 at any positions in half widths; zero outside the film."""
        return np.interp(positions, self.nodes, self.pressure, left=0.0, right=0.0)


def _spike(state: GridSolution) -> tuple[float, float]:
    """Return position and height of a second pressure maximum behind the first, NaN twice if there is none."""
    P = state.pressure
    peaks = np.flatnonzero((P[1:-1] > P[:-2]) & (P[1:-1] >= P[2:])) + 1
    if peaks.size < 2:
        return float("nan"), float("nan")
    last = peaks[-1]
    if P[last] - P[peaks[-2] : last].min() < _SPIKE * P.max():
        return float("nan"), float("nan")
    return float(state.nodes[last]), float(P[last])


def _rupture(state: GridSolution) -> float:
    """Return where the film ends, from the pressure's last two positive values: it goes out like a square."""
    last = int(np.flatnonzero(state.pressure)[-1])
    (x1, x2), (P1, P2) = state.nodes[last - 1 : last + 1], state.pressure[last - 1 : last + 1]
    ratio = np.sqrt(P1 / P2)
    end = (ratio * x2 - x1) / (ratio - 1) if ratio > 1 else np.inf
    return float(min(end, state.nodes[min(last + 1, state.nodes.size - 1)]))


def solve(case: LineContact, accuracy: float = 1e-3) -> LineSolution:
    """Return the film and pressure of a lubricated line contact.

    Parameters
    ----------
    case : LineContact
        The case; see :func:`line_contact`.
    accuracy : float
        Relative error allowed for the central and the minimum film; the grid is halved until the estimate meets it.

    Returns
    -------
    LineSolution
        With ``status`` other than zero and a reason if no solution was found; with a reason too if the finest grid
        allowed (10241 nodes) or the finest one that converged misses the accuracy.
    """
    return solution(case, solve_levels(case, accuracy), accuracy)


def solution(case: LineContact, levels: Levels, accuracy: float) -> LineSolution:
    """Return what the grids of a case gave as a solution, with the reason if they failed or missed the accuracy."""
    nan, state = float("nan"), levels.fine
    if levels.status != CONVERGED:
        none = GridSolution(np.empty(0), np.empty(0), np.empty(0), nan, 0)
        why = f"{_WHY[levels.status]} on {state.nodes.size} nodes"
        reason = f"no film found for M = {case.M:.4g}, L = {case.L:.4g}: {why}"
        return LineSolution(
            case, levels.status, reason, none, none, nan, nan, nan, nan, nan, nan, nan, nan, nan, levels.steps
        )
    changes = np.diff(levels.films[-3:, 0])
    change = changes[0] / changes[1] if changes.size == 2 and changes[1] != 0 else nan
    spike_position, spike_pressure = _spike(state)
    reason = ""
    if levels.error > accuracy:
        reason = (
            f"the estimated error of the film is {levels.error:.1e} on {state.nodes.size} nodes, "
            f"{accuracy:.1e} was asked for"
        )
    return LineSolution(
        case=case,
        status=CONVERGED,
        reason=reason,
        fine=state,
        coarse=levels.coarse,
        central_film=float(levels.limit[0]),
        minimum_film=float(levels.limit[1]),
        minimum_position=minimum(state)[0],
        error=levels.error,
        order=float(np.log2(change)) if change > 0 else nan,
        load_error=abs(float(np.trapezoid(state.pressure, state.nodes)) / (np.pi / 2) - 1),
        spike_position=spike_position,
        spike_pressure=spike_pressure,
        rupture_position=_rupture(state),
        steps=levels.steps,
    )
