"""The elastohydrodynamic film of a line contact, in all regimes from rigid isoviscous to elastic piezoviscous.

Hertz units are ``X = x/a``, ``P = p/p0`` and ``H = h R/a^2`` (thesis eq. B.13). With ``E' = 2 E*``, half width and
maximum pressure are ``a/R = sqrt(8 W/pi)`` and ``p0 = E' sqrt(W/(2 pi))``. Preliminary solutions of a case determine
the density of nodes on all grids of 40, 80, 160, ... nodes. Films extrapolated from two grids have an error of third
order in the spacing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.lubrication import grids
from mdr_dask.physics.lubrication.film_formulas import expected_film, moes_parameters
from mdr_dask.physics.lubrication.grid_solution import GridSolution, expected
from mdr_dask.physics.lubrication.newton import Grid, Liquid, film_on, newton
from mdr_dask.physics.lubrication.oil import DENSITY_RISE, DENSITY_SATURATION, ROELANDS_LOGARITHM, ROELANDS_PRESSURE
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import Estimate, Solution, refine

NODES = (40, 80, 160, 320, 640, 1280)  # numbers of nodes of the grids; a Newton step with 1280 nodes takes about 0.1 s
ORDER = 3.0  # order of convergence of the films extrapolated from two grids
ORDER_OF_READINGS = 2.0  # order of convergence of other extrapolated values, which can depend on the pressure spike
ACCURACY = 1e-3  # allowed relative error of the films if no accuracy is given
#: Attempts at the first solution of a case, chosen by trial; the second attempt is slow but hardly ever fails. Each
#: attempt has a guess of the film, divided by the expected film; an upper limit of the guess, divided by the square of
#: the inlet position; and the number of nodes of all preliminary solutions.
ATTEMPTS = ((1.5, 0.2, 121), (2.5, 0.4, 361))
#: `clip` of Newton's method in the first and in the second attempt on every grid, chosen by trial.
CLIPS = (0.12, 0.06)
NO_ESTIMATE = Estimate(np.asarray(np.nan), np.asarray(np.nan))

#: Function that evaluates a quantity, or a profile at fixed positions, on one grid.
Reading = Callable[[GridSolution], float | FloatArray]


class LineContact(NamedTuple):
    """A case in dimensionless numbers: Moes' numbers `M` and `L`, and the laws of the liquid.

    `pole` and `exponent` are p_r / p0 and z of Roelands' law, or zero for Barus' law. `density_rise` and
    `density_saturation` are the constants of the density law times p0, or zero for an incompressible liquid. `inlet` is
    the position where the oil begins, in half widths (negative), or None for a fully flooded inlet.
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
        """Return viscosity and density as functions of pressure, with ``alpha p0 = L sqrt(M/(2 pi))``."""
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
        Load, speed and material parameters W, U and G, defined with ``E' = 2 E*`` and the mean velocity.
    E_star : float
        Contact modulus in Pa. The maximum pressure p0, which follows from `E_star` and W, is the unit of pressure in
        the density law and in Roelands' law.
    viscosity_law : str
        ``"barus"`` or ``"roelands"``.
    viscosity : float, optional
        Viscosity at ambient pressure in Pa s, needed only for Roelands' law with a positive G.
    compressible : bool
        Whether the density follows the law of Dowson and Higginson.
    inlet : float, optional
        Position where the oil begins, in half widths (negative), or None for a fully flooded inlet.

    Raises
    ------
    ValueError
        If W, U, G or `E_star` is not positive (G may be zero), the law is unknown, the inlet is not upstream, or the
        viscosity is needed but is missing or is not above ``exp(-9.67)`` Pa s.
    """
    W, U, G = groups
    for name, value in (("W", W), ("U", U), ("G", G), ("E_star", E_star)):
        if not (np.isfinite(value) and (value > 0 or (name == "G" and value == 0))):
            raise ValueError(f"expected a positive {name}, got {value!r}")
    if inlet is not None and not inlet < 0:
        raise ValueError(f"expected a negative inlet position (in half widths, upstream of the centre), got {inlet!r}")
    moes = moes_parameters(W, U, G)
    p0 = 2 * E_star * float(np.sqrt(W / (2 * np.pi)))
    pole = exponent = 0.0
    if viscosity_law == "roelands" and G > 0:
        if viscosity is None or not np.log(viscosity) + ROELANDS_LOGARITHM > 0:
            raise ValueError(f"roelands' law needs a viscosity above 6.3e-5 Pa s, got {viscosity!r}")
        pole = ROELANDS_PRESSURE / p0
        exponent = G / (2 * E_star) * ROELANDS_PRESSURE / float(np.log(viscosity) + ROELANDS_LOGARITHM)
    elif viscosity_law not in ("barus", "roelands"):
        raise ValueError(f"expected the viscosity law 'barus' or 'roelands', got {viscosity_law!r}")
    rise, saturation = (DENSITY_RISE * p0, DENSITY_SATURATION * p0) if compressible else (0.0, 0.0)
    return LineContact(float(moes.M), float(moes.L), pole, exponent, rise, saturation, inlet)


@dataclass(frozen=True)
class LineSolution:
    """The film of a line contact in Hertz units.

    `grids` contains the solutions on all grids, the finest last. `central_film` and `minimum_film` are in units of
    ``a^2/R``. `readings` contains the values and errors of the requested quantities. If no film was found, `outcome`
    and `reason` give the cause, `grids` and `readings` are empty, and `central_film` and `minimum_film` are NaN.
    """

    case: LineContact
    outcome: Outcome
    reason: str
    grids: tuple[GridSolution, ...]
    central_film: Estimate
    minimum_film: Estimate
    readings: tuple[Estimate, ...] = ()

    @property
    def finest(self) -> GridSolution:
        """The solution on the finest grid."""
        return self.grids[-1]

    @property
    def error(self) -> float:
        """The larger of the estimated relative errors of central and minimum film."""
        return float(max(film.error / film.value for film in (self.central_film, self.minimum_film)))


def _extrapolated(reading: Reading, coarse: GridSolution, fine: GridSolution) -> FloatArray:
    """Return a quantity extrapolated from two grids. The extrapolation removes the error of second order."""
    value, ratio = np.asarray(reading(fine)), (coarse.spacing / fine.spacing) ** 2
    return np.asarray(value + (value - np.asarray(reading(coarse))) / (ratio - 1))


def _solve_on(
    case: LineContact, nodes: FloatArray, pressure: FloatArray, central: float, clip: float, spacing: float = np.nan
) -> tuple[Outcome, GridSolution]:
    """Solve on one grid from guesses of the pressure at the nodes and of the film at ``X = 0``."""
    grid = Grid.of(nodes)
    guess = pressure.copy()
    guess[0] = guess[-1] = 0.0
    # Newton's method needs a positive film in the initial guess
    lift = max(0.0, 0.1 * central - float(film_on(grid, guess, central).min()))
    found = newton(grid, case.liquid, case.film_number, guess, central + lift, clip)
    return found.outcome, GridSolution(nodes, found.pressure, found.film, found.central, spacing)


def _source(case: LineContact) -> tuple[Outcome, GridSolution]:
    """Return the solution whose density of nodes is used for all grids of `NODES`, and its outcome.

    If no attempt converges, the result of the last attempt is returned.
    """
    for (factor, starved, count), clip in zip(ATTEMPTS, CLIPS, strict=True):
        guess = factor * expected_film(case.M, case.L)
        inlet = grids.inlet_position(guess) if case.inlet is None else case.inlet
        guess = min(guess, starved * inlet**2)
        nodes = grids.first_grid(guess, inlet, count)
        outcome, state = _solve_on(case, nodes, grids.first_pressure(nodes, guess), guess, clip)
        if outcome == Outcome.CONVERGED:
            break
    for _ in range(2 if outcome == Outcome.CONVERGED else 0):
        adapted_outcome, adapted = _refined(case, [state], state, count)
        if adapted_outcome == Outcome.CONVERGED:
            state = adapted
    return outcome, state


def _refined(
    case: LineContact, before: Sequence[GridSolution], source: GridSolution, count: int
) -> tuple[Outcome, GridSolution]:
    """Solve on about `count` nodes, placed by `source.density`. `before` contains the last one or two solutions."""
    last = before[-1]
    spacing = last.spacing * (last.nodes.size - 1) / (count - 1)
    end = float(expected(before, lambda grid: grid.rupture, spacing))
    nodes, spacing = grids.aligned(source.nodes, source.density, count, end)
    guess = np.maximum(expected(before, lambda grid: grid.pressure_between(nodes), spacing), 0.0)
    central = float(expected(before, lambda grid: grid.central, spacing))
    outcome, found = _solve_on(case, nodes, guess, central, CLIPS[0], spacing)
    if outcome != Outcome.CONVERGED:
        straight = np.interp(nodes, last.nodes, last.pressure)
        outcome, found = _solve_on(case, nodes, straight, last.central, CLIPS[1], spacing)
    return outcome, found


def solve_film(
    case: LineContact,
    accuracy: float = ACCURACY,
    readings: Sequence[Reading] = (),
    floors: Sequence[float] = (),
    *,
    films_only: bool = False,
) -> LineSolution:
    """Return the film and pressure of a lubricated line contact.

    Parameters
    ----------
    case : LineContact
        The case; see :func:`line_contact`.
    accuracy : float
        Allowed relative error of the central film, the minimum film and the `readings`. The grid is refined until no
        estimated error exceeds `accuracy`, or until the finest grid is reached.
    readings : sequence of callable, GridSolution -> float or array
        Further quantities, or profiles at fixed positions. The relative error of a profile is the largest error along
        the profile, divided by the largest absolute value.
    floors : sequence of float
        One floor for each reading, or an empty sequence if all floors are 0. If a reading is below the floor, the
        relative error is the error divided by the floor.
    films_only : bool
        Whether only the central and the minimum film must meet the accuracy.

    Returns
    -------
    LineSolution
        If no film was found, `outcome` and `reason` give the cause. The `error` may exceed the accuracy if the finest
        grid is reached, or if Newton's method fails on finer grids.

    Examples
    --------
    >>> found = solve_film(line_contact((2e-5, 1e-11, 5000.0), E_star=115e9))
    >>> central = found.central_film.scaled(8 * 2e-5 / np.pi)  # a^2/R^2
    >>> print(f"h_c/R = {central.value:.3e}")
    h_c/R = 2.547e-05
    """
    outcome, source = _source(case)
    if outcome != Outcome.CONVERGED:
        return _no_solution(case, outcome, source)
    solved: list[GridSolution] = []
    # both films get the larger of their two relative errors, because two grids may agree on one of them by chance
    scales = np.array([source.central_film, source.minimum])
    wanted: list[Reading] = [lambda grid: np.array([grid.central_film, grid.minimum]) / scales, *readings]

    def add(count: int) -> Outcome:
        before = solved[-2:] or [source]
        outcome, found = _refined(case, before, source, count)
        if outcome == Outcome.CONVERGED:
            solved.append(found)
        return outcome

    def solve(count: int, _: IntArray) -> Solution:
        outcome = add(count)
        if outcome == Outcome.CONVERGED and len(solved) < 2:
            outcome = Outcome.UNDER_WAY  # an extrapolated value needs two grids
        if outcome != Outcome.CONVERGED:
            none = [np.full_like(np.asarray(reading(source))[None], np.nan, dtype=np.float64) for reading in wanted]
            return Solution(none, np.array([outcome], np.int8))
        values = [_extrapolated(reading, *solved[-2:])[None] for reading in wanted]
        return Solution(values, np.array([outcome], np.int8))

    add(NODES[0])
    found = refine(
        solve,
        1,
        NODES[1:],
        accuracy,
        [ORDER, *[ORDER_OF_READINGS] * len(readings)],
        floors=[0.0, *(floors or np.zeros(len(readings)))],
        shared=False,
        requested=1 if films_only else None,
    )
    error, outcome = found.errors[0, 0] / np.max(found.values[0]), Outcome(int(found.outcome[0]))
    if outcome == Outcome.CONVERGED and not np.isfinite(error):
        outcome = Outcome.UNDER_WAY  # too few grids have a solution
    if outcome != Outcome.CONVERGED:
        return _no_solution(case, outcome, solved[-1] if solved else source)
    central, minimum = (Estimate(film, error * film) for film in found.values[0][0] * scales)
    others = tuple(
        Estimate(value[0], error) for value, error in zip(found.values[1:], found.errors[1:, 0], strict=True)
    )
    return LineSolution(case, Outcome.CONVERGED, "", tuple(solved), central, minimum, others)


def operations(accuracy: float) -> float:
    """Return the approximate number of operations of `solve_film`.

    On each grid of n nodes, ten Newton steps of 30 n^2 operations are assumed.
    """
    # each finer grid divides the error by 8, because the error is of third order
    grids_needed = 1.0 if accuracy == 0 else min(np.log(1 / accuracy) / np.log(8) / len(NODES), 1.0)
    nodes = np.array([ATTEMPTS[0][-1]] * 3 + [*NODES[: round(grids_needed * len(NODES))]])
    return 300.0 * float(np.sum(nodes**2))


def _no_solution(case: LineContact, outcome: Outcome, failed: GridSolution) -> LineSolution:
    reason = f"no film found for M = {case.M:.4g}, L = {case.L:.4g} on {failed.nodes.size} nodes: {outcome.sentence}"
    return LineSolution(case, outcome, reason, (), NO_ESTIMATE, NO_ESTIMATE)
