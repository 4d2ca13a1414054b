"""The elastohydrodynamic film of a line contact, from rigid and isoviscous to elastic and piezoviscous.

Hertz units: ``X = x/a``, ``P = p/p0``, ``H = h R/a^2`` (thesis eq. B.13), with ``a/R = sqrt(8 W/pi)`` and
``p0 = E' sqrt(W/(2 pi))``. Two numbers decide for Barus and an incompressible liquid: Moes' M and L. Every solution
starts from a guess of its own, so it depends on nothing but its arguments.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.physics import ehl_grid
from mdr_dask.physics.deformation import film as film_at
from mdr_dask.physics.deformation import influence_matrix
from mdr_dask.physics.ehl_newton import (
    CONVERGED,
    FILM_COLLAPSED,
    SINGULAR,
    TOO_MANY_STEPS,
    Liquid,
    newton,
    nodal_film,
)
from mdr_dask.physics.film import limiting_films, moes_parameters
from mdr_dask.physics.oil import DENSITY_RISE, DENSITY_SATURATION, ROELANDS_LOGARITHM, ROELANDS_PRESSURE

FloatArray = NDArray[np.float64]

VISCOSITY_LAWS = ("barus", "roelands")

_WHY = {
    TOO_MANY_STEPS: "the Newton iteration did not settle",
    SINGULAR: "the Newton equations became singular",
    FILM_COLLAPSED: "the Newton iteration would have closed the film",
}
#: Least ratio of successive changes that an error estimate believes in.
_SLOWEST = 1.2
#: A second pressure maximum counts as a spike if it stands out by this share of the greatest pressure.
_SPIKE = 0.01
#: Ways to the first solution, in this order: factor on the expected film, its upper limit over the square of the
#: inlet's distance (starvation), greatest change of pressure, nodes.
_ATTEMPTS = (
    (1.5, 0.2, 0.12, 121),
    (2.5, 0.4, 0.12, 121),
    (1.5, 0.1, 0.04, 121),
    (4.0, 0.2, 0.05, 121),
    (1.5, 0.2, 0.05, 361),
)
#: Ways from one grid to another: greatest change of pressure in a step, greatest number of steps.
_PACES = ((0.12, 30), (0.05, 80), (0.02, 250))
#: Numbers of nodes: of the grids that are placed by a solution, and of those whose films are compared.
_ADAPTED_NODES = 121
_NODES = (41, 81, 161, 321, 641, 1281)
_TOLERANCE = 1e-8
_FIRST_STEPS = 80
#: Rounds of placing the nodes by the solution before the grids are compared.
_ADAPTATIONS = 2


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


class GridSolution(NamedTuple):
    """Pressure (in p0) and film (in ``a^2/R``) at the nodes of one grid, the film at ``X = 0``, and the steps taken."""

    nodes: FloatArray
    pressure: FloatArray
    film: FloatArray
    central: float
    steps: int


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


def expected_film(M: float, L: float) -> float:
    """Return the film in ``a^2/R`` that the four limiting regimes let expect; good for a first guess."""
    rigid_iso, rigid_piezo, elastic_iso, elastic_piezo = limiting_films(M, 0.5, L) * np.pi / (8 * M)
    return float(max(min(rigid_piezo, elastic_piezo), max(rigid_iso, elastic_iso)))


def _solve_on(
    case: LineContact, nodes: FloatArray, pressure: FloatArray, central: float, paces: tuple[tuple[float, int], ...]
) -> tuple[int, GridSolution]:
    """Solve on one grid from a guess of the pressure at its nodes, at the first pace that converges."""
    width = np.diff(nodes)
    weights = np.zeros_like(nodes)
    weights[:-1] += width / 2
    weights[1:] += width / 2
    matrix = influence_matrix(nodes, nodes)
    gap = np.empty_like(nodes)
    status, total, state = TOO_MANY_STEPS, 0, GridSolution(nodes, pressure, pressure, central, 0)
    for clip, most in paces:
        trial = pressure.copy()
        trial[0] = trial[-1] = 0.0
        # a guess that leaves no film has no Newton step
        nodal_film(nodes, matrix, trial, central, gap)
        lift = max(0.0, 0.1 * central - float(gap.min()))
        status, steps, found, film = newton(
            nodes, matrix, weights, case.liquid, case.film_number, trial, central + lift, clip, _TOLERANCE, most
        )
        total += steps
        state = GridSolution(nodes, trial, film, found, total)
        if status == CONVERGED:
            break
    return status, state


def _first_pressure(nodes: FloatArray, central: float) -> FloatArray:
    """Return half an ellipse: Hertz' pressure, or a wider and flatter one upstream for a thick film."""
    reach = float(np.sqrt(2 * central))
    width, centre = (1.0, 0.0) if reach < 1 else (max(1.0, 0.8 * reach), -0.4 * reach)
    return np.sqrt(np.maximum(1 - ((nodes - centre) / width) ** 2, 0.0)) / width


def _first_solution(case: LineContact) -> tuple[int, GridSolution]:
    """Return the solution on a first grid, by the first of the known ways that leads there."""
    for factor, starved, clip, count in _ATTEMPTS:
        guess = factor * expected_film(case.M, case.L)
        inlet = ehl_grid.inlet_position(guess) if case.inlet is None else case.inlet
        guess = min(guess, starved * inlet**2)
        nodes = ehl_grid.first_grid(guess, inlet, count)
        status, state = _solve_on(case, nodes, _first_pressure(nodes, guess), guess, ((clip, _FIRST_STEPS),))
        if status == CONVERGED:
            break
    return status, state


def _refine(case: LineContact, state: GridSolution, source: GridSolution, count: int) -> tuple[int, GridSolution]:
    """Solve on `count` nodes placed as the solution `source` asks for, starting from `state`."""
    density = ehl_grid.adapted_density(source.nodes, source.pressure, source.film, source.central)
    nodes = ehl_grid.sample(source.nodes, density, count)
    guess = np.interp(nodes, state.nodes, state.pressure)
    return _solve_on(case, nodes, guess, state.central, _PACES)


def _minimum(state: GridSolution) -> tuple[float, float]:
    """Return position and height of the lowest film: the vertex of the parabola through the lowest three nodes."""
    i = int(np.clip(np.argmin(state.film), 1, state.film.size - 2))
    x, h = state.nodes[i - 1 : i + 2], state.film[i - 1 : i + 2]
    left, right = (h[1] - h[0]) / (x[1] - x[0]), (h[2] - h[1]) / (x[2] - x[1])
    curvature = (right - left) / (x[2] - x[0])
    if not curvature > 0:
        return float(x[1]), float(h[1])
    slope = left + curvature * (x[1] - x[0])
    offset = -slope / (2 * curvature)
    return float(x[1] + offset), float(h[1] + 0.5 * slope * offset)


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


def extrapolate(values: FloatArray) -> tuple[float, float]:
    """Return the limit of values on grids of halved spacing, to second order, and its estimated error.

    Parameters
    ----------
    values : array, shape (k,)
        From the coarsest grid to the finest, at least three.

    Returns
    -------
    limit, error : float
        Richardson's limit from the last two grids; its change against the limit from the two grids before, more where
        the values change slower than to first order (a spike at the very place), and never below a fiftieth of the
        correction to the finest value.
    """
    coarse, middle, fine = (float(value) for value in values[-3:])
    limit, earlier = (4 * fine - middle) / 3, (4 * middle - coarse) / 3
    change = abs(fine - middle)
    ratio = max(_SLOWEST, abs(middle - coarse) / change) if change > 0 else np.inf
    return limit, max(abs(limit - earlier) * max(1.0, 1 / (ratio - 1)), abs(limit - fine) / 50)


def _failed(case: LineContact, status: int, steps: int, nodes: int) -> LineSolution:
    nan = float("nan")
    none = GridSolution(np.empty(0), np.empty(0), np.empty(0), nan, 0)
    reason = f"no film found for M = {case.M:.4g}, L = {case.L:.4g}: {_WHY[status]} on {nodes} nodes"
    return LineSolution(case, status, reason, none, none, nan, nan, nan, nan, nan, nan, nan, nan, nan, steps)


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
        allowed (1281 nodes) or the finest one that converged misses the accuracy.
    """
    status, state = _first_solution(case)
    steps = state.steps
    if status != CONVERGED:
        return _failed(case, status, steps, state.nodes.size)
    for _ in range(_ADAPTATIONS):
        status, adapted = _refine(case, state, state, _ADAPTED_NODES)
        steps += adapted.steps
        if status == CONVERGED:
            state = adapted
    source = state
    films: list[tuple[float, float]] = []
    error, failure = np.inf, TOO_MANY_STEPS
    for count in _NODES:
        status, finer = _refine(case, state, source, count)
        steps += finer.steps
        if status != CONVERGED:
            failure = status
            if films:
                break
            continue  # too coarse for this film
        coarser, state = state, finer
        films.append((state.central, _minimum(state)[1]))
        if len(films) > 2:
            limits = [extrapolate(np.array(column)) for column in zip(*films, strict=True)]
            error = max(uncertainty / limit for limit, uncertainty in limits)
            if error <= accuracy:
                break
    if not np.isfinite(error):
        return _failed(case, failure, steps, count)
    return _solution(case, state, coarser, np.array(films), error, accuracy, steps)


def _solution(
    case: LineContact,
    state: GridSolution,
    coarser: GridSolution,
    films: FloatArray,
    error: float,
    accuracy: float,
    steps: int,
) -> LineSolution:
    """Put together what the grids gave."""
    central, minimum = (extrapolate(column)[0] for column in films.T)
    coarse, middle, fine = films[-3:, 0]
    change = (middle - coarse) / (fine - middle) if fine != middle else np.nan
    position, _ = _minimum(state)
    load = float(np.trapezoid(state.pressure, state.nodes))
    spike_position, spike_pressure = _spike(state)
    reason = ""
    if error > accuracy:
        reason = (
            f"the estimated error of the film is {error:.1e} on {state.nodes.size} nodes, {accuracy:.1e} was asked for"
        )
    return LineSolution(
        case=case,
        status=CONVERGED,
        reason=reason,
        fine=state,
        coarse=coarser,
        central_film=central,
        minimum_film=minimum,
        minimum_position=position,
        error=error,
        order=float(np.log2(change)) if change > 0 else float("nan"),
        load_error=abs(load / (np.pi / 2) - 1),
        spike_position=spike_position,
        spike_pressure=spike_pressure,
        rupture_position=_rupture(state),
        steps=steps,
    )
