"""Master curves: curves of one quantity in several groups, shifted along their logarithmic axes until they are one
curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, distinguishable
from mdr_dask.physics.superposition.factors import Found, find_both, find_horizontal
from mdr_dask.physics.superposition.least_squares import Points, extent, fit, rows, slopes
from mdr_dask.physics.superposition.problem import ShiftProblem

CURVE_POINTS = 201
TOUCHING = 1e-9
"""Gap between curves, over the whole range, that is rounding."""

DRAW_ITERATIONS = 3
"""A bootstrap sample starts from the solution, where Gauss-Newton steps converge at once."""

HARDLY_TOLD = 0.5
"""Part of the scatter of all steps that curves take away from a step that they tell, at least."""


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
    undetermined : tuple of (float, float)
        First and last group of each run of neighbours whose steps the curves hardly tell, as on a plateau.
    usual : tuple of float
        Mean and scatter of the steps between neighbours, decades: what is expected of steps that are not told.
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
    undetermined: tuple[tuple[float, float], ...] = ()
    usual: tuple[float, float] = (0.0, 0.0)

    def moved(self, by: float) -> Superposition:
        """Return the same with the abscissa of everything moved."""
        low, high = self.measured
        return replace(self, x=self.x + by, curve_x=self.curve_x + by, measured=(low + by, high + by))

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

    All shifts and the curve are fitted together by least squares. The curve is a cubic spline whose curvature is
    weighted by restricted maximum likelihood. So curves are joined by their overlaps, and by smoothness where those are
    short.

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

    Examples
    --------
    >>> time = np.linspace(0, 2, 9)
    >>> curves = [(time, 6 - 2 / (1 + np.exp(2 - time - shift))) for shift in (0.0, 1.0, 2.0)]
    >>> print(superpose([20.0, 40.0, 60.0], curves, reference=20.0).horizontal.round(2))
    [0. 1. 2.]
    """
    values, sorted_curves = _sorted(groups, curves)
    problem, origin = ShiftProblem.of(sorted_curves).from_own_origin()
    found = find_both(problem) if vertical else find_horizontal(problem)
    result = _result(problem, found, values).moved(origin)
    _require_overlap(result)
    if draws:
        result = replace(result, draws=_bootstrap(problem, found, draws, seed))
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


def _result(problem: ShiftProblem, found: Found, values: FloatArray) -> Superposition:
    points, shifts, curves = problem.points, found.shifts, values.size
    linear = _Merged.at(problem, found)
    across, along = shifts.across[points.member], shifts.along[points.member]
    order = np.argsort(points.x + across, kind="stable")
    x = (points.x + across)[order]
    grid = np.linspace(x[0], x[-1], CURVE_POINTS)
    curve, error, covariance = linear.curve(grid, found.covariance)
    places = np.r_[1:curves, curves + 1 : 2 * curves][: found.covariance.shape[0]]
    full, cross = np.zeros((2 * curves, 2 * curves)), np.zeros((grid.size, 2 * curves))
    full[np.ix_(places, places)], cross[:, places] = found.covariance, covariance
    own = (points.x + across)[points.member == 0]
    return Superposition(
        groups=values,
        horizontal=shifts.across,
        vertical=shifts.along,
        covariance=full,
        reference=float(values[0]),
        noise=linear.noise,
        freedom=linear.freedom,
        x=x,
        y=(points.y + along)[order],
        member=points.member[order],
        curve_x=grid,
        curve_y=curve,
        curve_error=error,
        curve_cross=cross,
        measured=(float(own.min()), float(own.max())),
        draws=np.empty((0, 2 * curves)),
        undetermined=_runs(values, found.told < HARDLY_TOLD),
        usual=(found.common.mean, found.common.scatter),
    )


def _runs(groups: FloatArray, steps: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    """Return first and last group of each run of marked steps."""
    edges = np.diff(np.concatenate([[0], steps.astype(int), [0]]))
    ends = zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True)
    return tuple((float(groups[first]), float(groups[last])) for first, last in ends)


def _bootstrap(problem: ShiftProblem, found: Found, draws: int, seed: int) -> FloatArray:
    """Return factors fitted to residuals drawn again within each curve, shape (draws, 2 curves).

    A fit anew repeats the best fit. What the curves leave open, as along a plateau, is drawn from a normal distribution
    beside.
    """
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)))
    linear, points = _Merged.at(problem, found), problem.points
    fitted, scatter = linear.residuals()
    along = found.shifts.along[points.member]
    places = [np.flatnonzero(points.member == curve) for curve in range(problem.curves)]
    samples = np.empty((draws, 2 * problem.curves))
    for row in samples:
        drawn = np.concatenate([generator.choice(scatter[place], place.size) for place in places])
        again = points._replace(y=fitted + drawn - along)
        smoothing = found.weight, found.variance
        row[:] = np.concatenate(fit(again, found.shifts, problem.grid, found.prior, smoothing, DRAW_ITERATIONS)[0])
    size = found.covariance.shape[0]
    free = np.r_[1 : problem.curves, problem.curves + 1 : 2 * problem.curves][:size]
    values, vectors = np.linalg.eigh(found.covariance - linear.repeated())
    samples[:, free] += generator.standard_normal((draws, size)) * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
    return samples


@dataclass(frozen=True)
class _Merged:
    """The problem about shifts that were found, as a dense matrix: for the curve, its band and the residuals."""

    design: FloatArray
    inverse: FloatArray
    target: FloatArray
    splines: int
    low: float
    step: float
    noise: float
    freedom: float
    coefficients: FloatArray

    @classmethod
    def at(cls, problem: ShiftProblem, found: Found) -> _Merged:
        """Return the problem about the shifts found, with the best curve through them."""
        points, shifts, step = problem.points, found.shifts, problem.grid.step
        low, splines = extent(points, shifts.across, step)
        basis = rows(points, shifts.across, low, step, splines)
        second = np.diff(np.eye(splines), 2, axis=0)
        smooth = basis.T @ basis + found.weight * second.T @ second
        target = points.y + shifts.along[points.member]
        coefficients = np.asarray(np.linalg.solve(smooth, basis.T @ target), dtype=np.float64)
        slope = slopes(points, shifts.across, low, step, coefficients)
        moved = np.eye(problem.curves)[points.member][:, 1:]
        border = [moved * slope[:, None]]
        if found.prior.mean.size >= problem.curves:
            border.append(-moved)
        design = np.hstack([basis, *border])
        known = np.zeros((design.shape[1], design.shape[1]))
        known[:splines, :splines] = found.weight * second.T @ second
        known[splines:, splines:] = found.variance * found.prior.precision
        inverse = np.linalg.inv(design.T @ design + known)
        freedom = max(target.size - float(np.sum(inverse * (design.T @ design))), 1.0)
        noise = float(np.sqrt(np.sum((target - basis @ coefficients) ** 2) / freedom))
        return cls(design, inverse, target, splines, low, step, noise, freedom, coefficients)

    def curve(self, x: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the curve, its error, and its covariance with the shifts."""
        inner, outer = slice(self.splines), slice(self.splines, None)
        gain = self.inverse[inner, outer] @ np.linalg.inv(self.inverse[outer, outer])
        alone = self.noise**2 * (self.inverse[inner, inner] - gain @ self.inverse[outer, inner])
        nothing = Points(x, x, np.zeros(x.size, np.intp))
        along = rows(nothing, np.zeros(1), self.low, self.step, self.splines)
        cross = along @ gain @ covariance
        variance = np.sum((along @ alone) * along, axis=1) + np.sum(cross * (along @ gain), axis=1)
        return along @ self.coefficients, np.sqrt(np.maximum(variance, 0)), cross

    def repeated(self) -> FloatArray:
        """Return the covariance of shifts that are fitted anew to other residuals, all else as it is."""
        gain = self.inverse[self.splines :] @ self.design.T
        covariance: FloatArray = self.noise**2 * (gain @ gain.T)
        return covariance

    def residuals(self) -> tuple[FloatArray, FloatArray]:
        """Return fitted values, and residuals enlarged by their leverage."""
        fitted = self.design[:, : self.splines] @ self.coefficients
        leverage = np.sum((self.design @ self.inverse) * self.design, axis=1)
        return fitted, (self.target - fitted) / np.sqrt(np.maximum(1 - leverage, 0.05))


def _require_overlap(result: Superposition) -> None:
    low, high = (
        np.array([function(result.x[result.member == k]) for k in range(result.groups.size)])
        for function in (np.min, np.max)
    )
    order = np.argsort(low)
    reach = np.maximum.accumulate(high[order])
    gaps = np.flatnonzero(low[order][1:] > reach[:-1] + TOUCHING * np.ptp(result.x))
    if gaps.size:
        after = result.groups[order[gaps[0] + 1]]
        raise DataError(f"the curve at {after:g} does not overlap the others after shifting: measure in between")


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
        told, low, high = distinguishable(reference, groups[0], groups[-1], digits=6)
        raise DataError(f"the reference must lie between {low} and {high}, got {told}")
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
