"""The elastohydrodynamic film of a line contact, from rigid and isoviscous to elastic and piezoviscous.

Hertz units: ``X = x/a``, ``P = p/p0``, ``H = h R/a^2`` (thesis eq. B.13), with ``a/R = sqrt(8 W/pi)`` and
``p0 = E' sqrt(W/(2 pi))``. Two numbers decide for Barus and an incompressible liquid: Moes' M and L. A case is
solved on ever finer grids of one density, whose cells end alike at the rupture, until what the films tend to is known
well enough.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.lubrication import grids
from mdr_dask.physics.lubrication.film_formulas import expected_film, moes_parameters
from mdr_dask.physics.lubrication.grid_solution import GridSolution, expected
from mdr_dask.physics.lubrication.limits import Limit, extrapolate
from mdr_dask.physics.lubrication.newton import Grid, Liquid, Pace, film_on, log_viscosities, newton
from mdr_dask.physics.lubrication.oil import DENSITY_RISE, DENSITY_SATURATION, ROELANDS_LOGARITHM, ROELANDS_PRESSURE
from mdr_dask.physics.outcome import Outcome

VISCOSITY_LAWS = ("barus", "roelands")


class Attempt(NamedTuple):
    """A way to the first solution.

    Parameters
    ----------
    factor : float
        On the film that the limiting regimes let expect.
    starved : float
        Upper limit of the film over the square of the inlet's distance.
    clip : float
        Greatest change of pressure in a step.
    nodes : int
        Number of nodes.
    """

    factor: float
    starved: float
    clip: float
    nodes: int


class Settings(NamedTuple):
    """Numbers of the solver, chosen with ``python -m benchmarks ehl honesty`` on seeds kept apart from its tables.

    Parameters
    ----------
    attempts : tuple of Attempt
        Ways to the first solution, in this order, of at most `attempt_steps` steps each.
    attempt_steps : int
        Greatest number of steps of an attempt.
    paces : tuple of Pace
        Ways from one grid to another, in this order: from what the last grids let expect, then from the last one's own.
    adapted_nodes, adaptations : int
        Nodes of the grids that are placed by a solution before grids are compared, and their number.
    nodes : tuple of int
        Nodes of the grids that are compared, as many as the accuracy needs, three at least. The last is a cap: its
        dense equations take some 30 ms a step.
    leap, order : int, float
        Greatest number of rungs to a grid that is expected to meet the accuracy, on a ladder with one half way between
        each two of `nodes`, and the power of the spacing that the stated error is expected to fall like.
    smooth : float
        Logarithm of the viscosity at Hertz' pressure from which on `nodes` follow each other: where the pressure has a
        spike, grids near each other tell less of what is left.
    end_order : float
        Power of the spacing that the error of a film's end goes like: where a finer grid lets expect it.
    further : float
        Greatest share of a pressure by which two grids let expect another one on the next: spikes move.
    fourth : float
        Error of a film over what is left of a fourth power of the spacing, :func:`extrapolate`.
    floor : float
        Least share of an error that is trusted in a film, :class:`Trust`.
    sharpest : float
        Greatest logarithm of the viscosity at Hertz' pressure that counts: the pressure has a spike, the sharper the
        more viscous the oil.
    spike : float
        Added to that share for each such logarithm, times the square of the spacing: what the spike leaves of the
        square of the spacing goes like the fourth power.
    narrow, thick : float, pair of float
        Added to it for each such logarithm where M is below `thick` (half of it there), that of the central and of the
        minimum film: the spike stands in the narrowest place, and at the centre only where M is small.
    cut : float
        Added to that share for a film that ends a whole cell from the nearest node: the minimum film scatters.
    placed : float
        Least error of a position, in cells there.
    spiked : float
        That share for readings other than films, which pass the spike, whatever the spacing.
    """

    attempts: tuple[Attempt, ...] = (
        Attempt(1.5, 0.2, 0.12, 121),
        Attempt(2.5, 0.4, 0.12, 121),
        Attempt(1.5, 0.1, 0.04, 121),
        Attempt(4.0, 0.2, 0.05, 121),
        Attempt(1.5, 0.2, 0.05, 361),
    )
    attempt_steps: int = 80
    paces: tuple[Pace, ...] = (Pace(0.12, 16), Pace(0.05, 80), Pace(0.02, 250))
    adapted_nodes: int = 161
    adaptations: int = 2
    nodes: tuple[int, ...] = (57, 114, 161, 227, 321, 454, 641, 906, 1281)
    leap: int = 3
    smooth: float = 15.0
    order: float = 4.0
    end_order: float = 4.0
    further: float = 0.1
    fourth: float = 2.0
    floor: float = 0.01
    sharpest: float = 50.0
    spike: float = 0.15
    narrow: float = 0.008
    thick: tuple[float, float] = (6.0, 30.0)
    cut: float = 0.1
    placed: float = 0.1
    spiked: float = 0.13


SETTINGS = Settings()


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
    def log_viscosity(self) -> float:
        """Return ``ln(eta/eta0)`` at Hertz' pressure."""
        return float(log_viscosities(np.ones(1), self.liquid)[0])

    @property
    def liquid(self) -> Liquid:
        """Return the laws of the liquid; ``alpha p0 = L sqrt(M/(2 pi))``."""
        alpha = self.L * float(np.sqrt(self.M / (2 * np.pi)))
        return Liquid(alpha, self.pole, self.exponent, self.density_rise, self.density_saturation)


def line_contact(
    groups: tuple[float, float, float],
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
    groups : tuple of float
        Load, speed and material parameters W, U and G with ``E' = 2 E*`` and the mean velocity.
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
    W, U, G = groups
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
    outcome : Outcome
        CONVERGED, or what stopped the iteration on the grid that failed.
    reason : str
        One sentence if no film was found, else empty.
    grids : tuple of GridSolution
        The last three or four grids, the finest last; empty if no film was found.
    central_film, minimum_film : Limit
        In ``a^2/R``; NaN if no film was found.
    steps : int
        Newton steps on all grids together.
    """

    case: LineContact
    outcome: Outcome
    reason: str
    grids: tuple[GridSolution, ...]
    central_film: Limit
    minimum_film: Limit
    steps: int

    @property
    def finest(self) -> GridSolution:
        """The solution on the finest grid."""
        return self.grids[-1]

    @property
    def error(self) -> float:
        """Estimated relative error of the worse of the two films."""
        return float(max(film.error / film.value for film in (self.central_film, self.minimum_film)))

    @property
    def load_error(self) -> float:
        """Relative deviation of the pressure's integral from the load."""
        return abs(float(np.trapezoid(self.finest.pressure, self.finest.nodes)) / (np.pi / 2) - 1)

    def estimate(self, reading: Callable[[GridSolution], float | FloatArray]) -> Limit:
        """Return what a reading of the grids tends to, such as ``lambda grid: grid.rupture``."""
        return _tends_to(self.grids, reading, SETTINGS.spiked)

    def position(self, reading: Callable[[GridSolution], float]) -> Limit:
        """Return what a position in half widths tends to, which is known no better than to a share of a cell."""
        found, nodes = self.estimate(reading), self.finest.nodes
        after = np.clip(np.searchsorted(nodes, found.value), 1, nodes.size - 1)
        cell = nodes[after] - nodes[after - 1]
        return found._replace(error=np.maximum(found.error, SETTINGS.placed * cell))


def _tends_to(
    solved: Sequence[GridSolution],
    reading: Callable[[GridSolution], float | FloatArray],
    share: float | FloatArray,
    fourth: float | None = None,
) -> Limit:
    """Return what a reading of the last grids tends to; `share` is the least error's, but for what a cut film adds."""
    last = solved[-4:]
    least = share + SETTINGS.cut * max(grid.cut for grid in last[-3:])
    return extrapolate(np.array([reading(grid) for grid in last]), [grid.spacing for grid in last], least, fourth)


def _solve_on(
    case: LineContact,
    nodes: FloatArray,
    pressure: FloatArray,
    central: float,
    paces: tuple[Pace, ...],
    spacing: float = np.nan,
) -> tuple[Outcome, GridSolution]:
    """Solve on one grid from a guess of the pressure at its nodes, at the first pace that converges."""
    grid, total = Grid.of(nodes), 0
    guess = pressure.copy()
    guess[0] = guess[-1] = 0.0
    # a guess that leaves no film has no Newton step
    lift = max(0.0, 0.1 * central - float(film_on(grid, guess, central).min()))
    for pace in paces:
        found = newton(grid, case.liquid, case.film_number, guess, central + lift, pace)
        total += found.steps
        if found.outcome == Outcome.CONVERGED:
            break
    return found.outcome, GridSolution(nodes, found.pressure, found.film, found.central, total, spacing)


def _first_solution(case: LineContact, settings: Settings) -> tuple[Outcome, GridSolution]:
    """Return the solution on a first grid, by the first of the known ways that leads there."""
    for attempt in settings.attempts:
        guess = attempt.factor * expected_film(case.M, case.L)
        inlet = grids.inlet_position(guess) if case.inlet is None else case.inlet
        guess = min(guess, attempt.starved * inlet**2)
        nodes = grids.first_grid(guess, inlet, attempt.nodes)
        pace = Pace(attempt.clip, settings.attempt_steps)
        outcome, state = _solve_on(case, nodes, grids.first_pressure(nodes, guess), guess, (pace,))
        if outcome == Outcome.CONVERGED:
            break
    return outcome, state


def _refined(
    case: LineContact, solved: Sequence[GridSolution], source: GridSolution, count: int, settings: Settings
) -> tuple[Outcome, GridSolution]:
    """Solve on some `count` nodes placed as the `source` asks for.

    The start is what the last grids let expect; where that leads nowhere, the pressure of the last one as it is.
    """
    before = _nearest(solved, source)
    last = before[-1]
    spacing = last.spacing * (last.nodes.size - 1) / (count - 1)
    end = float(expected(before, lambda grid: grid.rupture, spacing, settings.end_order))
    front = float("nan")
    if case.log_viscosity >= settings.smooth:
        same = solved[-2:] if len(solved) > 1 else [source]  # cells beside the front are wider in the source
        front = float(expected(same, lambda grid: grid.front, spacing, settings.end_order))
    nodes, spacing = grids.aligned(source.nodes, source.density, count, end, front)
    here = last.pressure_carried(nodes, front)
    further = expected(before, lambda grid: grid.pressure_carried(nodes, front), spacing, 2.0) - here
    guess = here + np.clip(further, -settings.further * here, settings.further * here)
    central = float(expected(before, lambda grid: grid.central, spacing, 2.0))
    outcome, found = _solve_on(case, nodes, guess, central, settings.paces[:1], spacing)
    if outcome == Outcome.CONVERGED:
        return outcome, found
    straight = np.interp(nodes, last.nodes, last.pressure)
    outcome, again = _solve_on(case, nodes, straight, last.central, settings.paces[1:], spacing)
    return outcome, replace(again, steps=found.steps + again.steps)


def _adapted_solution(case: LineContact, settings: Settings) -> tuple[Outcome, GridSolution, int]:
    """Return the solution that places the nodes of the grids compared, and the steps that it took."""
    outcome, state = _first_solution(case, settings)
    steps = state.steps
    for _ in range(settings.adaptations if outcome == Outcome.CONVERGED else 0):
        adapted_outcome, adapted = _refined(case, (), state, settings.adapted_nodes, settings)
        steps += adapted.steps
        if adapted_outcome == Outcome.CONVERGED:
            state = adapted
    return outcome, state, steps


def solve_film(case: LineContact, accuracy: float = 1e-3, settings: Settings = SETTINGS) -> LineSolution:
    """Return the film and pressure of a lubricated line contact.

    Parameters
    ----------
    case : LineContact
        The case; see :func:`line_contact`.
    accuracy : float
        Relative error allowed for the central and the minimum film; grids become finer until the estimates meet it.
    settings : Settings
        Numbers of the solver.

    Returns
    -------
    LineSolution
        With an outcome other than CONVERGED and a reason if no film was found. Its `error` may exceed the accuracy: on
        the finest grid allowed, or the finest one that converged.

    Examples
    --------
    >>> found = solve_film(line_contact((2e-5, 1e-11, 5000.0), E_star=115e9))
    >>> central = found.central_film.scaled(8 * 2e-5 / np.pi)  # a^2/R^2
    >>> print(f"h_c/R = {central.value:.3e}")
    h_c/R = 2.546e-05
    """
    outcome, source, steps = _adapted_solution(case, settings)
    failure, found, solved = (outcome, source), None, list[GridSolution]()
    rungs, at = grids.ladder(settings.nodes), 0
    while outcome == Outcome.CONVERGED and at < len(rungs):
        outcome, finer = _refined(case, solved, source, rungs[at], settings)
        steps += finer.steps
        if outcome == Outcome.CONVERGED:
            solved.append(finer)
        elif not solved:  # this grid is too coarse for this film
            failure, outcome = (outcome, finer), Outcome.CONVERGED
        if outcome == Outcome.CONVERGED and len(solved) > 2:
            found = _solution(case, solved, steps)
        at = _next_rung(rungs, at, found, accuracy, settings)
    return found or _no_solution(case, *failure, steps)


def _next_rung(rungs: Sequence[int], at: int, found: LineSolution | None, accuracy: float, settings: Settings) -> int:
    """Return which grid is next: the first of some that is expected to meet the accuracy, two rungs on, or none."""
    error = found.error if found else np.inf
    if error <= accuracy or at == len(rungs) - 1:
        return len(rungs)
    leap = settings.leap if found and found.case.log_viscosity < settings.smooth else 0
    for further in range(at + 1, min(at + 1 + leap, len(rungs))):
        if error * (rungs[at] / rungs[further]) ** settings.order <= accuracy:
            return further
    return min(at + 2, len(rungs) - 1)


def _nearest(solved: Sequence[GridSolution], source: GridSolution) -> Sequence[GridSolution]:
    """Return the last two grids, from which a finer one starts, or the source as long as that is finer."""
    return solved[-2:] if solved and solved[-1].nodes.size > source.nodes.size - 3 else [source]


def _solution(case: LineContact, solved: list[GridSolution], steps: int) -> LineSolution:
    """Return what the last three grids tend to."""
    viscosity = min(case.log_viscosity, SETTINGS.sharpest)
    narrow = SETTINGS.narrow / (1 + (case.M / np.array(SETTINGS.thick)) ** 2)
    share = SETTINGS.floor + viscosity * (narrow + SETTINGS.spike * solved[-1].spacing ** 2)
    films = _tends_to(solved, lambda grid: np.array([grid.central_film, grid.minimum[1]]), share, SETTINGS.fourth)
    central, minimum = (Limit(*(column[film] for column in films)) for film in (0, 1))
    return LineSolution(case, Outcome.CONVERGED, "", tuple(solved[-4:]), central, minimum, steps)


def _no_solution(case: LineContact, outcome: Outcome, failed: GridSolution, steps: int) -> LineSolution:
    """Return a solution without a film, and why there is none."""
    none = Limit(*(np.array(np.nan),) * 3)
    why = "too few grids have a solution" if outcome == Outcome.CONVERGED else outcome.sentence
    reason = f"no film found for M = {case.M:.4g}, L = {case.L:.4g}: {why} on {failed.nodes.size} nodes"
    return LineSolution(case, outcome, reason, (), none, none, steps)
