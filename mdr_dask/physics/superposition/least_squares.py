"""Least squares of shifted curves and one smoothing spline: a band of spline coefficients with the shifts as border.

Compiled, as the systems are a few dozen unknowns wide. Prior knowledge of the shifts enters as rows of the border.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit

DEGREE = 3


class Settings(NamedTuple):
    """Numbers of the solver; `python -m benchmarks superposition accuracy` shows what they do."""

    cells: int = 8
    """Spline cells along a curve of median width; smoothing decides how many of them count."""
    smoothing: tuple[float, float, int] = (-8.0, 6.0, 15)
    """Powers of ten, and number, of the weights of the curvature, relative to the points in a cell."""
    least_pivot: float = 1e-13
    """Of the largest on the diagonal: what rounding leaves of a direction that nothing decides."""
    longest_step: float = 0.3
    """Of a Gauss-Newton step at first, in widths of a curve."""
    converged: float = 1e-5
    """Last step of the shifts, in decades."""
    near: float = 30.0
    """Ratio of a smoothing to the one found before within which the next is sought, or others count."""
    smoothed: int = 6
    """Iterations that may choose the smoothing anew; later ones keep it, so that they end."""


SETTINGS = Settings()


class Points(NamedTuple):
    """Points of all curves in one row, and the curve of each."""

    x: FloatArray
    y: FloatArray
    member: IntArray


class Shifts(NamedTuple):
    """Horizontal and vertical shifts of all curves, shape (curves,); those of the first are zero."""

    across: FloatArray
    along: FloatArray


class Knots(NamedTuple):
    """Cells of the spline, and the weights of its squared second differences that are tried, ascending."""

    step: float
    weights: FloatArray


class Prior(NamedTuple):
    """What is known of the free shifts, horizontal ones first, without the curves: a normal distribution."""

    mean: FloatArray
    precision: FloatArray


class Normal(NamedTuple):
    """Normal equations of spline coefficients, and of the border.

    ``band[i, k]`` is the matrix at (i, i - k), ``cross`` the rows of the border in the columns of the spline, and
    ``border`` holds its lower triangle. `eliminate` and `solve_border` overwrite all by Cholesky's factor.
    """

    band: FloatArray
    right: FloatArray
    cross: FloatArray
    border: FloatArray
    pull: FloatArray


@jit
def workspace(splines: int, unknowns: int) -> Normal:  # pragma: no cover
    """Return arrays for normal equations of that many splines and unknowns of the border."""
    cross, border = np.empty((unknowns, splines)), np.empty((unknowns, unknowns))
    return Normal(np.empty((splines, DEGREE + 1)), np.empty(splines), cross, border, np.empty(unknowns))


@jit
def extent(points: Points, across: FloatArray, step: float) -> tuple[float, int]:  # pragma: no cover
    """Return where the spline of shifted curves begins, on cells that stay where they are, and its coefficients."""
    lowest, highest = np.inf, -np.inf
    for i in range(points.x.size):
        place = points.x[i] + across[points.member[i]]
        lowest, highest = min(lowest, place), max(highest, place)
    low = np.floor(lowest / step) * step
    return low, int(np.floor((highest - low) / step)) + 1 + DEGREE


@jit
def basis(x: float, low: float, step: float, splines: int, value: FloatArray) -> int:  # pragma: no cover
    """Fill the four cubic B-splines at x; return the number of the first."""
    cell = min(max(int(np.floor((x - low) / step)), 0), splines - DEGREE - 1)
    t = (x - low) / step - cell
    value[0] = (1 - t) ** 3 / 6
    value[1] = (t * t * (3 * t - 6) + 4) / 6
    value[3] = t**3 / 6
    value[2] = 1 - value[0] - value[1] - value[3]
    return cell


@jit
def slopes(
    points: Points, across: FloatArray, low: float, step: float, curve: FloatArray
) -> FloatArray:  # pragma: no cover
    """Return the slope of a spline at each shifted point."""
    found = np.empty(points.x.size)
    for i in range(found.size):
        place = (points.x[i] + across[points.member[i]] - low) / step
        cell = min(max(int(np.floor(place)), 0), curve.size - DEGREE - 1)
        t = place - cell
        found[i] = (3 * t**2 - 4 * t) * curve[cell + 1] - ((1 - t) ** 2) * curve[cell]
        found[i] += (-3 * t**2 + 2 * t + 1) * curve[cell + 2] + t**2 * curve[cell + 3]
        found[i] /= 2 * step
    return found


@jit
def assemble(
    points: Points, shifts: Shifts, slope: FloatArray, low: float, step: float, normal: Normal
) -> float:  # pragma: no cover
    """Fill the normal equations at given shifts; return the sum of squares of the ordinates.

    Parameters
    ----------
    points : Points
    shifts : Shifts
    slope : array, shape (points,) or (0,)
        Of the curve at each point; without it horizontal shifts are no unknowns.
    low, step : float
        Where the first cell begins, and the width of cells.
    normal : Normal, output
        The border holds changes of the horizontal shifts of all curves but the first, then of the vertical ones, as far
        as it has rows.
    """
    band, right, cross, border, pull = normal
    across = shifts.across.size - 1 if slope.size > 0 else 0
    band[:] = 0.0
    right[:] = 0.0
    cross[:] = 0.0
    border[:] = 0.0
    pull[:] = 0.0
    value, total = np.empty(DEGREE + 1), 0.0
    for i in range(points.x.size):
        k = points.member[i]
        target = points.y[i] + shifts.along[k]
        cell = basis(points.x[i] + shifts.across[k], low, step, right.size, value)
        total += target * target
        for a in range(DEGREE + 1):
            right[cell + a] += value[a] * target
            for b in range(a + 1):
                band[cell + a, a - b] += value[a] * value[b]
        if k > 0 and across > 0:
            border[k - 1, k - 1] += slope[i] ** 2
            pull[k - 1] += slope[i] * target
            for a in range(DEGREE + 1):
                cross[k - 1, cell + a] += slope[i] * value[a]
        if k > 0 and pull.size > across:
            row = across + k - 1
            border[row, row] += 1.0
            pull[row] -= target
            for a in range(DEGREE + 1):
                cross[row, cell + a] -= value[a]
            if across > 0:
                border[row, k - 1] -= slope[i]
    return total


@jit
def eliminate(normal: Normal, weight: float) -> tuple[float, float]:  # pragma: no cover
    """Factorise the spline with its curvature and take it out of the border; return log determinant and squares.

    `weight` is that of the squared second differences of the coefficients.
    """
    band, right, cross, border, pull = normal
    splines = right.size
    for i in range(splines - 2):
        band[i, 0] += weight
        band[i + 1, 0] += 4 * weight
        band[i + 2, 0] += weight
        band[i + 1, 1] -= 2 * weight
        band[i + 2, 1] -= 2 * weight
        band[i + 2, 2] += weight
    least, volume, explained = SETTINGS.least_pivot * np.max(band[:, 0]), 0.0, 0.0
    for i in range(splines):
        for back in range(min(i, DEGREE), -1, -1):
            j = i - back
            found = band[i, back]
            for k in range(max(0, i - DEGREE), j):
                found -= band[i, i - k] * band[j, j - k]
            band[i, back] = found / band[j, 0] if back else np.sqrt(max(found, least))
        for k in range(max(0, i - DEGREE), i):
            right[i] -= band[i, i - k] * right[k]
        right[i] /= band[i, 0]
        explained += right[i] ** 2
        volume += 2 * np.log(band[i, 0])
    for k in range(pull.size):
        row = cross[k]
        for i in range(splines):
            for j in range(max(0, i - DEGREE), i):
                row[i] -= band[i, i - j] * row[j]
            row[i] /= band[i, 0]
            pull[k] -= row[i] * right[i]
        for other in range(k + 1):
            for i in range(splines):
                border[k, other] -= row[i] * cross[other, i]
    return volume, explained


@jit
def solve_border(normal: Normal) -> tuple[FloatArray, float, float]:  # pragma: no cover
    """Factorise the border after `eliminate`; return its solution, its log determinant and the squares it explains."""
    border, pull = normal.border, normal.pull
    size, volume, explained, largest = pull.size, 0.0, 0.0, 0.0
    for i in range(size):
        largest = max(largest, border[i, i])
    for i in range(size):
        for j in range(i + 1):
            found = border[i, j]
            for k in range(j):
                found -= border[i, k] * border[j, k]
            border[i, j] = found / border[j, j] if i > j else np.sqrt(max(found, SETTINGS.least_pivot * largest))
        for k in range(i):
            pull[i] -= border[i, k] * pull[k]
        pull[i] /= border[i, i]
        explained += pull[i] ** 2
        volume += 2 * np.log(border[i, i])
    steps = pull.copy()
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            steps[i] -= border[k, i] * steps[k]
        steps[i] /= border[i, i]
    return steps, volume, explained


@jit
def best_curve(normal: Normal) -> FloatArray:  # pragma: no cover
    """Return the spline that fits best where the border stays as it is, after `eliminate`."""
    band, found = normal.band, normal.right.copy()
    for i in range(found.size - 1, -1, -1):
        for k in range(i + 1, min(found.size, i + DEGREE + 1)):
            found[i] -= band[k, k - i] * found[k]
        found[i] /= band[i, 0]
    return found


@jit
def linearise(
    points: Points, shifts: Shifts, step: float, weight: float, vertical: bool
) -> tuple[Normal, float, float]:  # pragma: no cover
    """Return normal equations about the best curve of a smoothing, squares of the ordinates, and penalised misfit."""
    low, splines = extent(points, shifts.across, step)
    smooth, nothing = workspace(splines, 0), np.empty(0)
    total = assemble(points, shifts, nothing, low, step, smooth)
    misfit = max(total - eliminate(smooth, weight)[1], 1e-14 * total)
    slope = slopes(points, shifts.across, low, step, best_curve(smooth))
    normal = workspace(splines, (shifts.across.size - 1) * (2 if vertical else 1))
    assemble(points, shifts, slope, low, step, normal)
    return normal, total, misfit


@jit
def copied(normal: Normal) -> Normal:  # pragma: no cover
    """Return a copy, which may be overwritten."""
    border = normal.cross.copy(), normal.border.copy(), normal.pull.copy()
    return Normal(normal.band.copy(), normal.right.copy(), border[0], border[1], border[2])


@jit
def reduced(normal: Normal, weight: float) -> tuple[Normal, float, float]:  # pragma: no cover
    """Return a copy after `eliminate`, its log determinant and the squares it explains."""
    work = copied(normal)
    volume, explained = eliminate(work, weight)
    return work, volume, explained


@jit
def _expect(normal: Normal, prior: Prior, shifts: Shifts, variance: float) -> float:  # pragma: no cover
    """Add rows of what is known of the shifts; return the squares that they leave."""
    size, free = normal.pull.size, shifts.across.size - 1
    missing, left = np.empty(size), 0.0
    for i in range(size):
        missing[i] = prior.mean[i] - (shifts.across[i + 1] if i < free else shifts.along[i - free + 1])
    for i in range(size):
        for k in range(size):
            normal.pull[i] += variance * prior.precision[i, k] * missing[k]
            left += variance * prior.precision[i, k] * missing[i] * missing[k]
            if k <= i:
                normal.border[i, k] += variance * prior.precision[i, k]
    return left


@jit
def _expected(
    points: Points, shifts: Shifts, step: float, weight: float, vertical: bool, prior: Prior, variance: float
) -> tuple[Normal, float, float]:  # pragma: no cover
    """Return what `linearise` does, with the rows of what is known of the shifts."""
    normal, total, misfit = linearise(points, shifts, step, weight, vertical)
    left = _expect(normal, prior, shifts, variance)
    return normal, total + left, misfit + left


@jit
def restricted(
    points: int, normal: Normal, total: float, weight: float
) -> tuple[FloatArray, FloatArray, float, float]:  # pragma: no cover
    """Return the changes of the shifts that fit best, Cholesky's factor of their precision, variance and score.

    The variance is that of the scatter, the score twice the negative logarithm of the restricted likelihood.
    """
    work, volume, explained = reduced(normal, weight)
    changes, more, besides = solve_border(work)
    freedom = max(points - 2 - changes.size, 1)
    misfit = max(total - explained - besides, 1e-14 * total + 1e-300)
    score = volume + more - (normal.right.size - 2) * np.log(weight) + freedom * np.log(misfit)
    return changes, work.border, misfit / freedom, score


@jit
def likeliest(
    points: int, normal: Normal, total: float, weights: FloatArray
) -> tuple[float, float]:  # pragma: no cover
    """Return the smoothing of largest restricted likelihood, and the variance of the scatter with it."""
    least, best, variance = np.inf, weights[0], 0.0
    for weight in weights:
        _, _, spread, score = restricted(points, normal, total, weight)
        if score < least:
            least, best, variance = score, weight, spread
    return best, variance


@jit
def _moved(shifts: Shifts, changes: FloatArray, share: float) -> Shifts:  # pragma: no cover
    across, along, free = shifts.across.copy(), shifts.along.copy(), shifts.across.size - 1
    for i in range(changes.size):
        if i < free:
            across[i + 1] += share * changes[i]
        else:
            along[i - free + 1] += share * changes[i]
    return Shifts(across, along)


@jit
def fit(
    points: Points,
    shifts: Shifts,
    grid: Knots,
    prior: Prior,
    smoothing: tuple[float, float],
    iterations: int,
) -> tuple[Shifts, float, float]:  # pragma: no cover
    """Find shifts by damped Gauss-Newton steps; return them, the weight of the curvature and the scatter's variance.

    Parameters
    ----------
    points : Points
    shifts : Shifts
        First guess.
    grid : Knots
    prior : Prior
        Of the horizontal shifts, or of both kinds: as many shifts are found as it has.
    smoothing : tuple of float
        Weight and variance; chosen anew where the variance is zero.
    iterations : int
        At most.
    """
    weight, variance = smoothing
    vertical, chosen = prior.mean.size >= shifts.across.size, variance > 0
    longest = SETTINGS.longest_step * SETTINGS.cells * grid.step
    normal, total, misfit = _expected(points, shifts, grid.step, weight, vertical, prior, variance)
    for iteration in range(iterations):
        if not chosen and iteration < SETTINGS.smoothed:
            near = (grid.weights > weight / SETTINGS.near) & (grid.weights < weight * SETTINGS.near) | (iteration == 0)
            weight, variance = likeliest(points.x.size, normal, total, grid.weights[near])
            normal, total, misfit = _expected(points, shifts, grid.step, weight, vertical, prior, variance)
        work, _, _ = reduced(normal, weight)
        changes, _, _ = solve_border(work)
        largest = np.max(np.abs(changes))
        if largest < SETTINGS.converged or longest < SETTINGS.converged:
            break
        proposal = _moved(shifts, changes, min(1.0, longest / largest))
        other = _expected(points, proposal, grid.step, weight, vertical, prior, variance)
        if other[2] <= misfit * (1 + 1e-6):
            shifts = proposal
            normal, total, misfit = other
        else:
            longest = SETTINGS.longest_step * min(longest, largest)
    return shifts, weight, variance


@jit
def rows(points: Points, across: FloatArray, low: float, step: float, splines: int) -> FloatArray:  # pragma: no cover
    """Return the B-splines at shifted points, shape (points, splines)."""
    found, value = np.zeros((points.x.size, splines)), np.empty(DEGREE + 1)
    for i in range(points.x.size):
        cell = basis(points.x[i] + across[points.member[i]], low, step, splines, value)
        for k in range(DEGREE + 1):
            found[i, cell + k] = value[k]
    return found


def changes_of(
    points: Points, shifts: Shifts, grid: Knots, weight: float, variance: float, priors: Sequence[Prior]
) -> tuple[FloatArray, FloatArray, int, float]:
    """Return mean and covariance of the free shifts' changes where the problem is linear about given shifts.

    Smoothing, variance of the scatter, and which of the priors holds are unknown: the mean is over all. The likeliest
    prior and the logarithm of the evidence of all come with them.

    Parameters
    ----------
    points, shifts, grid
        As of `fit`.
    weight, variance : float
        What `fit` found.
    priors : sequence of Prior
        All as likely before the curves are seen.
    """
    vertical = priors[0].mean.size >= shifts.across.size
    normal, total, _ = linearise(points, shifts, grid.step, weight, vertical)
    near = grid.weights[(grid.weights > weight / SETTINGS.near) & (grid.weights < weight * SETTINGS.near)]
    logs, means, spreads = [], [], []
    for prior in priors:
        known = copied(normal)
        left = _expect(known, prior, shifts, variance)
        volume = float(np.linalg.slogdet(variance * prior.precision)[1])
        for each in near:
            changes, factor, scatter, score = restricted(points.x.size, known, total + left, each)
            half = np.linalg.inv(np.tril(factor))
            logs.append((volume - score) / 2)
            means.append(changes)
            spreads.append(scatter * (half.T @ half))
    share = np.exp(np.array(logs) - max(logs))
    evidence, best = max(logs) + float(np.log(share.sum())), int(np.argmax(logs)) // near.size
    share /= share.sum()
    mean = share @ np.array(means)
    apart = np.array(means) - mean
    return mean, (apart.T * share) @ apart + np.tensordot(share, np.array(spreads), 1), best, evidence
