"""Master curves: curves of one quantity in several groups, shifted along their logarithmic axes until they are one
curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mdr_dask.errors import DataError
from mdr_dask.physics import spline_system

FloatArray = NDArray[np.float64]

DEGREE = 3
CELLS_PER_CURVE = 8
"""Spline cells along a curve of median width; smoothing decides how many of them count."""

MOST_CELLS = 120
SMOOTHING = np.logspace(-8, 6, 15)
"""Weights of the curvature among which the restricted likelihood chooses, relative to the data's own."""

FIRST_WEIGHT = 1e-3
"""Smoothing of the curve whose slope linearises the problem."""

CURVE_POINTS = 201
ITERATIONS = 40
DRAW_ITERATIONS = 3
"""A bootstrap sample starts from the solution, where Gauss-Newton steps converge at once."""

WEIGHED = (0, 1, 2, 4, 8)
"""Iterations that choose the smoothing anew."""

EXPECTED_SHIFT = 1.0
"""Standard deviation, in widths of a curve, that shifts between neighbours are expected to have about the usual one.

It decides only where the curves do not: on a plateau, or along a straight line with vertical factors.
"""

LEAST_SHARE = 1e-3
"""Likelihood of a smoothing, relative to all, below which it is left out."""

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
        The merged curve with its standard error.
    measured : tuple of float
        Range of log10 x in which the reference itself was measured; the merged curve beyond is extrapolated by
        superposition.
    draws : array, shape (draws, 2 groups)
        Bootstrap samples of the factors; none unless asked for.
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
    measured: tuple[float, float]
    draws: FloatArray

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
    problem = _Problem.of(values, sorted_curves)
    guess = problem.first_guess(sorted_curves)
    problem = replace(problem, usual=float(np.median(np.diff(guess, prepend=0.0))))
    shifts, settled = problem.fit(guess, None)
    if vertical:
        problem = replace(problem, vertical=True)
        shifts, settled = problem.fit(np.append(shifts, np.zeros(values.size - 1)), None)
    result = problem.result(shifts, settled, values)
    _require_overlap(result)
    if draws:
        result = replace(result, draws=problem.bootstrap(shifts, settled, draws, seed))
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
    return np.sort(values), arrays


@dataclass(frozen=True)
class _Problem:
    """All points in one row, and which shifts act on which; the first curve is held in place."""

    x: FloatArray
    y: FloatArray
    member: NDArray[np.intp]
    curves: int
    vertical: bool
    width: float
    usual: float = 0.0

    @classmethod
    def of(cls, values: FloatArray, curves: list[tuple[FloatArray, FloatArray]]) -> _Problem:
        member = np.repeat(np.arange(values.size), [x.size for x, _ in curves])
        x, y = np.concatenate([x for x, _ in curves]), np.concatenate([y for _, y in curves])
        return cls(x, y, member, values.size, False, float(np.median([np.ptp(x) for x, _ in curves])))

    @property
    def free(self) -> int:
        """Number of shifts to be found."""
        return (self.curves - 1) * (2 if self.vertical else 1)

    def split(self, shifts: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return horizontal and vertical shifts of all curves."""
        horizontal, vertical = np.zeros(self.curves), np.zeros(self.curves)
        horizontal[1:] = shifts[: self.curves - 1]
        if self.vertical:
            vertical[1:] = shifts[self.curves - 1 :]
        return horizontal, vertical

    def first_guess(self, curves: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
        """Shift each curve onto the one before it."""
        pairs = [_pair_shift(*one, *other) for one, other in pairwise(curves)]
        return np.cumsum(np.array(pairs))

    def cells(self, x: FloatArray) -> tuple[float, float, int]:
        """Return where the spline begins, the width of its cells and their number."""
        cells = int(np.clip(np.ceil(CELLS_PER_CURVE * np.ptp(x) / self.width), 2 * DEGREE, MOST_CELLS))
        return float(x.min()), float(np.ptp(x)) / cells, cells

    def fit(
        self, shifts: FloatArray, settled: _Settled | None, iterations: int = ITERATIONS
    ) -> tuple[FloatArray, _Settled]:
        """Return shifts by damped Gauss-Newton steps, and smoothing and scatter, found unless given."""
        choice, longest = settled or _Settled(FIRST_WEIGHT, 0.0), 0.3 * self.width
        system = _System.at(self, shifts, choice)
        for iteration in range(iterations):
            if settled is None and iteration in WEIGHED:
                choice = system.likeliest()
                system = _System.at(self, shifts, choice)
            step = system.solve(choice.weight)[system.splines :]
            largest = float(np.abs(step).max())
            if largest < CONVERGED or longest < CONVERGED:
                break
            proposal = _System.at(self, shifts + step * min(1.0, longest / largest), choice)
            if proposal.misfit(choice.weight) <= system.misfit(choice.weight) * (1 + 1e-6):
                shifts, system = shifts + step * min(1.0, longest / largest), proposal
            else:
                longest = 0.3 * min(longest, largest)
        return shifts, choice

    def expected(self) -> tuple[FloatArray, FloatArray]:
        """Return rows and targets of what is expected of the shifts: neighbours lie `usual` apart, within a width."""
        rows = np.zeros((self.curves - 1, self.free))
        rows[:, : self.curves - 1] = np.eye(self.curves - 1) - np.eye(self.curves - 1, k=-1)
        scale = EXPECTED_SHIFT * self.width
        return rows / scale, np.full(self.curves - 1, self.usual / scale)

    def result(self, shifts: FloatArray, settled: _Settled, values: FloatArray) -> Superposition:
        system = _System.at(self, shifts, settled)
        solution, covariance, noise, freedom = system.posterior(settled.weight)
        horizontal, vertical = self.split(shifts)
        full = np.zeros((2 * self.curves, 2 * self.curves))
        places = np.r_[1 : self.curves, self.curves + 1 : 2 * self.curves][: self.free]
        full[np.ix_(places, places)] = covariance[system.splines :, system.splines :]
        x, y = self.x + horizontal[self.member], self.y + vertical[self.member]
        order = np.argsort(x, kind="stable")
        grid = np.linspace(x.min(), x.max(), CURVE_POINTS)
        rows = system.curve(grid)
        inner = covariance[: system.splines, : system.splines]
        error = np.sqrt(np.maximum(np.sum((rows @ inner) * rows, axis=1), 0))
        own = x[self.member == 0]
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
            self.member[order],
            grid,
            rows @ solution[: system.splines],
            error,
            (float(own.min()), float(own.max())),
            np.empty((0, 2 * self.curves)),
        )

    def bootstrap(self, shifts: FloatArray, settled: _Settled, draws: int, seed: int) -> FloatArray:
        """Return factors fitted to residuals drawn again within each curve, shape (draws, 2 curves)."""
        generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)))
        system = _System.at(self, shifts, settled)
        fitted, scatter = system.residuals(settled.weight)
        vertical = self.split(shifts)[1][self.member]
        places = [np.flatnonzero(self.member == curve) for curve in range(self.curves)]
        samples = np.empty((draws, 2 * self.curves))
        for row in samples:
            drawn = np.concatenate([generator.choice(scatter[place], place.size) for place in places])
            again = replace(self, y=fitted + drawn - vertical)
            row[:] = np.concatenate(self.split(again.fit(shifts, settled, DRAW_ITERATIONS)[0]))
        return samples


@dataclass(frozen=True)
class _Settled:
    """Weight of the curvature, and variance of the scatter by which the expected overlap is weighed."""

    weight: float
    variance: float


@dataclass(frozen=True)
class _System:
    """The least-squares problem linearised at given shifts: unknown are spline coefficients, then steps of the
    shifts.
    """

    splines: int
    low: float
    step: float
    first: NDArray[np.intp]
    value: FloatArray
    steepness: FloatArray
    member: NDArray[np.intp]
    target: FloatArray
    normal: FloatArray
    right: FloatArray
    total: float
    penalty: FloatArray

    @classmethod
    def at(cls, problem: _Problem, shifts: FloatArray, settled: _Settled) -> _System:
        """Linearise about the curve of a smoothing: a rougher one has steeper slopes, and promises too much."""
        horizontal, vertical = problem.split(shifts)
        x, target = problem.x + horizontal[problem.member], problem.y + vertical[problem.member]
        low, step, cells = problem.cells(x)
        splines, first = cells + DEGREE, np.empty(x.size, np.intp)
        value, slope = np.empty((x.size, DEGREE + 1)), np.empty((x.size, DEGREE + 1))
        spline_system.spline_rows(x, low, step, cells, first, value, slope)
        size = splines + problem.free
        normal, right = np.empty((size, size)), np.empty(size)
        shape = problem.curves, splines, problem.vertical, target, normal, right
        spline_system.normal_equations(first, value, np.zeros(x.size), problem.member, *shape)
        gram = normal[:splines, :splines].copy()
        curvature = _curvature(splines) * np.trace(gram) / splines
        smooth = gram + settled.weight * curvature
        spline_system.factorise(smooth)
        curve = spline_system.solve(smooth, right[:splines].copy())
        steepness = np.einsum("ij,ij->i", slope, curve[first[:, None] + np.arange(DEGREE + 1)])
        spline_system.normal_equations(first, value, steepness, problem.member, *shape)
        penalty = np.zeros((size, size))
        penalty[:splines, :splines] = curvature
        rows, wanted = problem.expected()
        missing = wanted - rows @ shifts
        normal[splines:, splines:] += settled.variance * (rows.T @ rows)
        right[splines:] += settled.variance * (rows.T @ missing)
        total = float(target @ target + settled.variance * (missing @ missing))
        return cls(splines, low, step, first, value, steepness, problem.member, target, normal, right, total, penalty)

    def _factor(self, weight: float) -> FloatArray:
        matrix: FloatArray = self.normal + weight * self.penalty
        spline_system.factorise(matrix)
        return matrix

    def solve(self, weight: float) -> FloatArray:
        solution: FloatArray = spline_system.solve(self._factor(weight), self.right)
        return solution

    def misfit(self, weight: float) -> float:
        """Return the sum of squares with its penalty for the best curve through these shifts."""
        inner = slice(self.splines)
        matrix = self.normal[inner, inner] + weight * self.penalty[inner, inner]
        spline_system.factorise(matrix)
        right = self.right[inner].copy()
        return self.total - float(right @ spline_system.solve(matrix, right))

    def _scores(self) -> FloatArray:
        numbers = self.right, self.total, self.target.size, self.splines - 2, SMOOTHING
        scores: FloatArray = spline_system.likelihoods(self.normal, self.penalty, *numbers)
        return scores

    def likeliest(self) -> _Settled:
        """Return the smoothing weight of largest restricted likelihood, and the scatter with it."""
        weight = float(SMOOTHING[int(np.argmin(self._scores()))])
        return _Settled(weight, max(self.misfit(weight), 0.0) / max(self.target.size - self.right.size, 1))

    def _given(self, weight: float) -> tuple[FloatArray, FloatArray, float, float]:
        """Return the solution, its covariance, the variance of the scatter and its degrees of freedom."""
        inverse = spline_system.inverse(self._factor(weight))
        solution = inverse @ self.right
        freedom = max(self.target.size - float(np.sum(inverse * self.normal)), 1.0)
        variance = float(np.sum((self.target - self.design() @ solution) ** 2)) / freedom
        return solution, variance * inverse, variance, freedom

    def posterior(self, weight: float) -> tuple[FloatArray, FloatArray, float, float]:
        """Return the solution, its covariance, the scatter and its degrees of freedom.

        Smoothness counts as prior knowledge; that it is known only from the data adds to the covariance, by the mean
        over all smoothing weights with their likelihoods.
        """
        best, _, variance, freedom = self._given(weight)
        scores = self._scores()
        share = np.exp(-0.5 * (scores - scores.min()))
        covariance = np.zeros_like(self.normal)
        for part, other in zip(share / share.sum(), SMOOTHING, strict=True):
            if part > LEAST_SHARE:
                solution, spread, _, _ = self._given(float(other))
                covariance += part * (spread + np.outer(solution - best, solution - best))
        return best, covariance, float(np.sqrt(variance)), freedom

    def design(self) -> FloatArray:
        """Return the matrix of the linearised problem, shape (points, unknowns)."""
        rows = np.arange(self.target.size)
        design = np.zeros((rows.size, self.right.size))
        design[rows[:, None], self.first[:, None] + np.arange(DEGREE + 1)] = self.value
        moved = self.member > 0
        design[rows[moved], self.splines + self.member[moved] - 1] = self.steepness[moved]
        curves = int(self.member.max()) + 1
        if self.right.size > self.splines + curves - 1:
            design[rows[moved], self.splines + curves - 1 + self.member[moved] - 1] = -1.0
        return design

    def curve(self, x: FloatArray) -> FloatArray:
        """Return the rows of the splines at any x within their range, shape (points, splines)."""
        first, cells = np.empty(x.size, np.intp), self.splines - DEGREE
        value, slope = np.empty((x.size, DEGREE + 1)), np.empty((x.size, DEGREE + 1))
        spline_system.spline_rows(x, self.low, self.step, cells, first, value, slope)
        rows = np.zeros((x.size, self.splines))
        np.put_along_axis(rows, first[:, None] + np.arange(DEGREE + 1), value, axis=1)
        return rows

    def residuals(self, weight: float) -> tuple[FloatArray, FloatArray]:
        """Return fitted values, and residuals enlarged by their leverage."""
        inverse, design = spline_system.inverse(self._factor(weight)), self.design()
        fitted = design @ (inverse @ self.right)
        leverage = np.sum((design @ inverse) * design, axis=1)
        scatter = (self.target - fitted) / np.sqrt(np.maximum(1 - leverage, 0.05))
        return fitted, np.asarray(scatter, dtype=np.float64)


def _curvature(size: int) -> FloatArray:
    """Return the matrix of the sum of squared second differences."""
    second = np.diff(np.eye(size), 2, axis=0)
    return np.asarray(second.T @ second, dtype=np.float64)


def _pair_shift(x: FloatArray, y: FloatArray, other_x: FloatArray, other_y: FloatArray) -> float:
    """Return the shift of a curve onto its neighbour of least mean square difference over an overlap of a sixth or
    more.
    """
    shorter = min(np.ptp(x), np.ptp(other_x))
    low, high = x[0] - other_x[-1] + shorter / 6, x[-1] - other_x[0] - shorter / 6
    best = (np.inf, 0.0)
    for shift in np.linspace(low, high, 61):
        moved = other_x + shift
        inside, own = (moved >= x[0]) & (moved <= x[-1]), (x >= moved[0]) & (x <= moved[-1])
        difference = np.append(
            np.interp(moved[inside], x, y) - other_y[inside], y[own] - np.interp(x[own], moved, other_y)
        )
        if difference.size >= 2:
            overlap = np.ptp(np.clip(moved, x[0], x[-1]))
            best = min(best, (float(np.mean(difference**2)) * (1 + 0.1 * shorter / overlap), float(shift)))
    return best[1]


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
        raise DataError(f"the curve at {after:g} does not overlap the others after shifting: measure in between")


def rereference(result: Superposition, reference: float) -> Superposition:
    """Return the same master curve with the factors zero at another group, or between two by linear interpolation.

    Raises
    ------
    DataError
        If the value lies outside the groups.
    """
    groups = result.groups
    if not groups[0] <= reference <= groups[-1]:
        raise DataError(f"the reference must lie between {groups[0]:g} and {groups[-1]:g}, got {reference:g}")
    share = np.array([np.interp(reference, groups, unit) for unit in np.eye(groups.size)])
    one = np.eye(groups.size) - np.outer(np.ones(groups.size), share)
    change = np.kron(np.eye(2), one)
    across, along = float(share @ result.horizontal), float(share @ result.vertical)
    nearest = int(np.argmin(np.abs(groups - reference)))
    own = result.x[result.member == nearest] - across
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
        measured=(float(own.min()), float(own.max())),
        draws=result.draws @ change.T,
    )
