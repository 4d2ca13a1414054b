"""Master curves: curves of one quantity in several groups, shifted along their logarithmic axes until they are one
curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.physics.superposition.least_squares import Settled, System
from mdr_dask.physics.superposition.posterior import sample
from mdr_dask.physics.superposition.problem import Problem

FIRST_WEIGHT = 1e-3
"""Smoothing of the curve whose slope linearises the problem."""

CURVE_POINTS = 201
ITERATIONS = 40
DRAW_ITERATIONS = 3
"""A bootstrap sample starts from the solution, where Gauss-Newton steps converge at once."""

WEIGHED = (0, 1, 2, 4, 8)
"""Iterations that choose the smoothing anew."""

CONVERGED = 1e-5
"""Last step of the shifts, in decades."""


@dataclass(frozen=True)
class Superposition:
    """Shift factors and the curve they make; abscissa and ordinate as logarithms to the base 10.

    Parameters
    ----------
    groups : array, shape (groups,)
        What the curves differ in (velocity, temperature), ascending.
    horizontal, vertical : array, shape (groups,)
        What is added to log10 x and to log10 y of each curve; zero for the reference.
    covariance : array, shape (2 groups, 2 groups)
        Of horizontal and vertical factors together, for independent scatter of the ordinates.
    reference : float
        The group's value at which the factors are zero.
    noise : float
        Scatter of log10 y about the curve.
    freedom : float
        Degrees of freedom of the scatter, for quantiles of Student's t.
    x, y : array, shape (points,)
        All points after shifting, ascending in x.
    member : array of int, shape (points,)
        The group of each.
    curve_x, curve_y, curve_error : array, shape (curve points,)
        The merged curve with its standard error, where the reference is held in place.
    curve_cross : array, shape (curve points, 2 groups)
        Covariance of the curve and the factors.
    measured : tuple of float
        Range of log10 x in which the reference itself was measured; the merged curve beyond is extrapolated by
        superposition.
    draws : array, shape (draws, 2 groups)
        Bootstrap samples of the factors; none unless asked for.
    sampled : float
        Number of points of even weight on which vertical fits rest: below some 200 their bars are rough. 0 where
        nothing was sampled.
    """

    groups: FloatArray
    horizontal: FloatArray
    vertical: FloatArray
    covariance: FloatArray
    reference: float
    noise: float
    freedom: float
    x: FloatArray
    y: FloatArray
    member: NDArray[np.intp]
    curve_x: FloatArray
    curve_y: FloatArray
    curve_error: FloatArray
    curve_cross: FloatArray
    measured: tuple[float, float]
    draws: FloatArray
    sampled: float = 0.0

    @property
    def horizontal_error(self) -> FloatArray:
        """Standard errors of the horizontal factors, decades."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[: self.groups.size]), dtype=np.float64)

    @property
    def vertical_error(self) -> FloatArray:
        """Standard errors of the vertical factors, decades."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[self.groups.size :]), dtype=np.float64)


def superpose(
    groups: ArrayLike,
    curves: Sequence[tuple[ArrayLike, ArrayLike]],
    vertical: bool = False,
    reference: float | None = None,
    draws: int = 0,
    seed: int = 0,
) -> Superposition:
    """Find the shifts that make curves parts of one smooth curve, with their covariance.

    All shifts and the curve are fitted together by least squares: the curve is a cubic spline whose curvature is
    weighted by
    restricted maximum likelihood, so that curves are joined by their overlaps, and by smoothness where those are short.

    Parameters
    ----------
    groups : array_like, shape (groups,)
        What the curves differ in; distinct numbers.
    curves : sequence of (x, y)
        log10 of abscissa and ordinate of each curve, at least two points each.
    vertical : bool
        Whether curves may move along the ordinate as well.
    reference : float, optional
        Group whose factors are zero; the middle one if not given. A value between groups is interpolated to.
    draws : int
        Bootstrap samples, residuals drawn again curve by curve and everything but the smoothing fitted anew.
    seed : int
        Seed of the bootstrap.

    Raises
    ------
    DataError
        If there are fewer than two curves, too few or not finite points, or the shifted curves leave a gap.
    """
    values, sorted_curves = _sorted(groups, curves)
    problem = Problem.of(values, sorted_curves)
    guess = problem.first_guess(sorted_curves)
    problem = replace(problem, usual=float(np.median(np.diff(guess, prepend=0.0))))
    shifts, settled = _fit(problem, guess, None)
    if vertical:
        problem = replace(problem, vertical=True)
        shifts, settled = _fit(problem, np.append(shifts, np.zeros(values.size - 1)), None)
    result = _result(problem, shifts, settled, values, seed)
    _require_overlap(result)
    if draws:
        result = replace(result, draws=_bootstrap(problem, shifts, settled, draws, seed))
    return rereference(result, values[values.size // 2] if reference is None else reference)


def _sorted(
    groups: ArrayLike, curves: Sequence[tuple[ArrayLike, ArrayLike]]
) -> tuple[FloatArray, list[tuple[FloatArray, FloatArray]]]:
    values = np.asarray(groups, dtype=np.float64).reshape(-1)
    if values.size != len(curves) or values.size < 2 or np.unique(values).size != values.size:
        raise DataError(f"expected one distinct group for each of two or more curves, got {values.tolist()!r}")
    arrays = []
    for place in np.argsort(values):
        x, y = (np.asarray(a, dtype=np.float64).reshape(-1) for a in curves[place])
        if x.size != y.size or x.size < 2 or np.ptp(x) == 0 or not np.all(np.isfinite(x) & np.isfinite(y)):
            raise DataError(f"the curve at {values[place]:g} needs two or more distinct points with finite logarithms")
        order = np.argsort(x, kind="stable")
        arrays.append((x[order], y[order]))
    if all(np.ptp(y) == 0 for _, y in arrays):
        raise DataError("every curve is constant: nothing tells how far to shift them")
    return np.sort(values), arrays


def _fit(
    problem: Problem, shifts: FloatArray, settled: Settled | None, iterations: int = ITERATIONS
) -> tuple[FloatArray, Settled]:
    """Return shifts by damped Gauss-Newton steps, and smoothing and scatter, found unless given."""
    choice, longest = settled or Settled(FIRST_WEIGHT, 0.0), 0.3 * problem.width
    system = System.at(problem, shifts, choice)
    for iteration in range(iterations):
        if settled is None and iteration in WEIGHED:
            choice = system.likeliest()
            system = System.at(problem, shifts, choice)
        step = system.solve(choice.weight)[system.splines :]
        largest = float(np.abs(step).max())
        if largest < CONVERGED or longest < CONVERGED:
            break
        proposal = System.at(problem, shifts + step * min(1.0, longest / largest), choice)
        if proposal.misfit(choice.weight) <= system.misfit(choice.weight) * (1 + 1e-6):
            shifts, system = shifts + step * min(1.0, longest / largest), proposal
        else:
            longest = 0.3 * min(longest, largest)
    return shifts, choice


def _result(problem: Problem, shifts: FloatArray, settled: Settled, values: FloatArray, seed: int) -> Superposition:
    system = System.at(problem, shifts, settled)
    solution, covariance, noise, freedom = system.posterior(settled.weight)
    spread, sampled = covariance[system.splines :, system.splines :], 0.0
    if problem.vertical:
        shifts, spread, sampled = _sampled(problem, shifts, settled, freedom, seed)
        system = System.at(problem, shifts, settled)
        solution = system.best_curve(settled.weight)
        covariance = _widened(system.posterior(settled.weight)[1], system.splines, spread)
    horizontal, vertical = problem.split(shifts)
    full = np.zeros((2 * problem.curves, 2 * problem.curves))
    places = np.r_[1 : problem.curves, problem.curves + 1 : 2 * problem.curves][: problem.free]
    full[np.ix_(places, places)] = spread
    x, y = problem.x + horizontal[problem.member], problem.y + vertical[problem.member]
    order = np.argsort(x, kind="stable")
    grid = np.linspace(x.min(), x.max(), CURVE_POINTS)
    rows = system.curve(grid)
    along = rows @ covariance[: system.splines]
    error = np.sqrt(np.maximum(np.sum(along[:, : system.splines] * rows, axis=1), 0))
    cross = np.zeros((grid.size, 2 * problem.curves))
    cross[:, places] = along[:, system.splines :]
    own = x[problem.member == 0]
    return Superposition(
        values,
        horizontal,
        vertical,
        full,
        float(values[0]),
        noise,
        freedom,
        x[order],
        y[order],
        problem.member[order],
        grid,
        rows @ solution[: system.splines],
        error,
        cross,
        (float(own.min()), float(own.max())),
        np.empty((0, 2 * problem.curves)),
        sampled,
    )


def _widened(covariance: FloatArray, splines: int, spread: FloatArray) -> FloatArray:
    """Return the covariance of curve and shifts with another one of the shifts; the curve depends on them as before."""
    inner, outer = slice(splines), slice(splines, None)
    gain = covariance[inner, outer] @ np.linalg.pinv(covariance[outer, outer], hermitian=True)
    change = spread - covariance[outer, outer]
    both = np.vstack([gain, np.eye(spread.shape[0])])
    return np.asarray(covariance + both @ change @ both.T, dtype=np.float64)


def _sampled(
    problem: Problem, shifts: FloatArray, settled: Settled, freedom: float, seed: int
) -> tuple[FloatArray, FloatArray, float]:
    """Return mean and covariance of the posterior, as the square of a scale for Student's t, and the points drawn."""
    mean, covariance, points = sample(problem, shifts, settled, seed)
    return mean, covariance * ((freedom - 2) / freedom if freedom > 4 else 0.5), points


def _bootstrap(problem: Problem, shifts: FloatArray, settled: Settled, draws: int, seed: int) -> FloatArray:
    """Return factors fitted to residuals drawn again within each curve, shape (draws, 2 curves)."""
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)))
    system = System.at(problem, shifts, settled)
    fitted, scatter = system.residuals(settled.weight)
    vertical = problem.split(shifts)[1][problem.member]
    places = [np.flatnonzero(problem.member == curve) for curve in range(problem.curves)]
    samples = np.empty((draws, 2 * problem.curves))
    for row in samples:
        drawn = np.concatenate([generator.choice(scatter[place], place.size) for place in places])
        again = replace(problem, y=fitted + drawn - vertical)
        row[:] = np.concatenate(problem.split(_fit(again, shifts, settled, DRAW_ITERATIONS)[0]))
    return samples


def _require_overlap(result: Superposition) -> None:
    low, high = (
        np.array([function(result.x[result.member == k]) for k in range(result.groups.size)])
        for function in (np.min, np.max)
    )
    order = np.argsort(low)
    reach = np.maximum.accumulate(high[order])
    gaps = np.flatnonzero(low[order][1:] > reach[:-1])
    if gaps.size:
        after = result.groups[order[gaps[0] + 1]]
        choice = " or do without vertical factors" if result.vertical.any() else ""
        raise DataError(
            f"the curve at {after:g} does not overlap the others after shifting: measure in between{choice}"
        )


def moved_with(
    error: FloatArray, cross: FloatArray, gradient: FloatArray, covariance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return error of a curve that moves with factors, and its covariance with them.

    Parameters
    ----------
    error, cross : arrays, shapes (curve points,) and (curve points, factors)
        As they were.
    gradient : array, shape (curve points, factors)
        How far each factor moves the curve up.
    covariance : array, shape (factors, factors)
    """
    along = gradient @ covariance
    variance = error**2 + np.sum(gradient * (2 * cross + along), axis=1)
    return np.sqrt(np.maximum(variance, 0)), cross + along


def rereference(result: Superposition, reference: float, logarithmic: bool = False) -> Superposition:
    """Return the same master curve with the factors zero at another group, or between two by linear interpolation.

    Parameters
    ----------
    reference : float
        In the range of the groups.
    logarithmic : bool
        Whether factors are linear in the logarithm of the groups, as those of velocities are.

    Raises
    ------
    DataError
        If the value lies outside the groups.
    """
    groups = result.groups
    if not groups[0] <= reference <= groups[-1]:
        raise DataError(f"the reference must lie between {groups[0]:g} and {groups[-1]:g}, got {reference:g}")
    place, places = (np.log(reference), np.log(groups)) if logarithmic else (reference, groups)
    share = np.array([np.interp(place, places, unit) for unit in np.eye(groups.size)])
    one = np.eye(groups.size) - np.outer(np.ones(groups.size), share)
    change = np.kron(np.eye(2), one)
    across, along = float(share @ result.horizontal), float(share @ result.vertical)
    nearest = int(np.argmin(np.abs(places - place)))
    own = result.x[result.member == nearest] - across
    slope = np.gradient(result.curve_y, result.curve_x)
    gradient = np.hstack([np.outer(slope, share), -np.outer(np.ones(slope.size), share)])
    error, cross = moved_with(result.curve_error, result.curve_cross, gradient, result.covariance)
    return replace(
        result,
        horizontal=one @ result.horizontal,
        vertical=one @ result.vertical,
        covariance=change @ result.covariance @ change.T,
        reference=float(reference),
        x=result.x - across,
        y=result.y - along,
        curve_x=result.curve_x - across,
        curve_y=result.curve_y - along,
        curve_error=error,
        curve_cross=cross @ change.T,
        measured=(float(own.min()), float(own.max())),
        draws=result.draws @ change.T,
    )
