"""Steps between neighbours: what the curves say of each, and what all have in common where the curves say nothing.

On a plateau any step is as good as any other within reach, so that a normal distribution about the best one promises
too much. Here the likelihood of each step is scanned instead, while the others follow it, and steps are taken to
scatter about a common mean: those that are measured tell where the others may lie.
"""

from __future__ import annotations

from math import erf, sqrt
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.superposition.least_squares import (
    DEGREE,
    Knots,
    Normal,
    Points,
    Shifts,
    assemble,
    eliminate,
    extent,
    solve_border,
    workspace,
)
from mdr_dask.physics.superposition.least_squares import SETTINGS as FIT
from mdr_dask.physics.superposition.problem import Common, ShiftProblem


class Settings(NamedTuple):
    """Numbers of the scan; `python -m benchmarks superposition accuracy` shows what they do."""

    scatters: tuple[float, float, int] = (0.04, 1.0, 7)
    """Least, largest and number of the scatters considered of steps about their mean, in widths of a curve."""
    means: int = 25
    """Number of common means considered."""
    margin: float = 0.15
    """Widths of a curve by which they reach beyond the steps themselves."""
    noisy: float = 0.4
    """Power of the likelihood of a step that the curves do not tell."""
    coarse: int = 37
    """Places of a step between the ends where its neighbours cease to overlap."""
    unlikely: float = 12.0
    """Logarithm of a likelihood, below the largest, that no scan needs to visit."""
    impossible: float = 1e-15
    """Of the largest share of a place of a step: places that need no sum."""
    beyond: tuple[float, float] = (0.05, 8.0)
    """Widths of a curve over which a step without overlap becomes unlikely, and how unlikely at most."""


SETTINGS, NEAR = Settings(), FIT.near
FINE = np.array([-4.0, -3.0, -2.5, -2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0])
"""Places of a scan about the best step, in standard deviations of the linearised problem."""


class Scan(NamedTuple):
    """Places of each step, ascending, and the logarithms of its likelihood there."""

    places: list[FloatArray]
    logs: list[FloatArray]


class Steps(NamedTuple):
    """What is known of the steps.

    Parameters
    ----------
    mean, own : arrays, shape (steps,)
        Mean of each, and the variance that it has for itself.
    shared : array, shape (steps, steps)
        Covariance that all have through their common mean and scatter.
    told : array, shape (steps,)
        Part of the common scatter that the curves take away: 1 where they tell a step, 0 where they do not.
    common : Common
    """

    mean: FloatArray
    own: FloatArray
    shared: FloatArray
    told: FloatArray
    common: Common


@jit
def _roughness_trace(band: FloatArray, near: FloatArray) -> float:  # pragma: no cover
    """Return the trace of the squared second differences times the inverse of a factorised band.

    Only the band of the inverse is needed; it is filled into `near`, from the last row to the first.
    """
    size, found = band.shape[0], 0.0
    for i in range(size - 1, -1, -1):
        last = min(size - 1, i + DEGREE)
        for j in range(last, i - 1, -1):
            total = 1 / band[i, 0] if i == j else 0.0
            for k in range(i + 1, last + 1):
                total -= band[k, k - i] * near[max(j, k), abs(j - k)]
            near[j, j - i] = total / band[i, 0]
    for i in range(size - 2):
        found += near[i, 0] + 4 * near[i + 1, 0] + near[i + 2, 0]
        found += 2 * near[i + 2, 2] - 4 * near[i + 1, 1] - 4 * near[i + 2, 1]
    return found


@jit
def _border_trace(normal: Normal, weight: float, known: FloatArray) -> float:  # pragma: no cover
    """Return what the border adds to the trace of the penalties times the inverse, after `solve_border`.

    `known` is what the border's own penalty added to it. Overwrites `cross`.
    """
    band, cross, border = normal.band, normal.cross, normal.border
    unknowns, splines = cross.shape
    inner = known.copy()
    for row in cross:
        for i in range(splines - 1, -1, -1):
            for k in range(i + 1, min(splines, i + DEGREE + 1)):
                row[i] -= band[k, k - i] * row[k]
            row[i] /= band[i, 0]
    bent = cross[:, 2:] - 2 * cross[:, 1:-1] + cross[:, :-2]
    for k in range(unknowns):
        for other in range(unknowns):
            inner[k, other] += weight * np.sum(bent[k] * bent[other])
    found, column = 0.0, np.empty(unknowns)
    for j in range(unknowns):
        for i in range(unknowns):
            column[i] = inner[i, j]
            for k in range(i):
                column[i] -= border[i, k] * column[k]
            column[i] /= border[i, i]
        for i in range(unknowns - 1, j - 1, -1):
            for k in range(i + 1, unknowns):
                column[i] -= border[k, i] * column[k]
            column[i] /= border[i, i]
        found += column[j]
    return found


@jit
def likelihoods(
    points: Points, ways: FloatArray, step: float, weight: float, variance: float, rises: FloatArray
) -> FloatArray:  # pragma: no cover
    """Return logarithms of the likelihood of horizontal shifts, as far as the data tell them apart.

    Half the squared distance from the best curve, in units of the scatter, and half of what that curve explains for its
    freedom alone: the sum has the same mean wherever the curves agree. So a flat curve beside another one is no more
    likely than on it.

    Parameters
    ----------
    points : Points
    ways : array, shape (places, curves)
        Horizontal shifts of all curves.
    step, weight, variance : float
        Width of the cells, weight of the curvature, variance of the scatter.
    rises : array, shape (curves - 1, curves - 1) or (0, 0)
        Precision of the vertical shifts of all curves but the first, which are free beside the curve; none without.
    """
    places, widest, known = ways.shape[0], 0, variance * rises
    for place in range(places):
        widest = max(widest, extent(points, ways[place], step)[1])
    whole, near = workspace(widest, rises.shape[0]), np.empty((widest, DEGREE + 1))
    found, nothing, level = np.empty(places), np.empty(0), np.zeros(ways.shape[1])
    for place in range(places):
        low, size = extent(points, ways[place], step)
        part = Normal(whole.band[:size], whole.right[:size], whole.cross[:, :size], whole.border, whole.pull)
        total = assemble(points, Shifts(ways[place], level), nothing, low, step, part)
        np.add(part.border, known, part.border)
        _, explained = eliminate(part, weight)
        freedom = size - weight * _roughness_trace(part.band, near)
        if rises.size > 0:
            explained += solve_border(part)[2]
            freedom += rises.shape[0] - _border_trace(part, weight, known)
        found[place] = -0.5 * ((total - explained) / variance + freedom)
    return found


@jit
def _given(
    places: FloatArray, shares: FloatArray, window: FloatArray, means: FloatArray, scatters: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:  # pragma: no cover
    """Return evidence, mean and variance of a step for each common mean and scatter.

    `shares` are its likelihoods times the widths of the places; beyond the window a step is not expected.
    """
    shape = means.size, scatters.size
    evidence, centre, spread = np.empty(shape), np.empty(shape), np.empty(shape)
    kept = np.flatnonzero(shares > SETTINGS.impossible * np.max(shares))
    for a in range(means.size):
        for b in range(scatters.size):
            zero = first = second = 0.0
            for j in kept:
                apart = (places[j] - means[a]) / scatters[b]
                part = shares[j] * np.exp(-0.5 * apart * apart)
                zero += part
                first += part * places[j]
                second += part * places[j] * places[j]
            ends = (window - means[a]) / (sqrt(2.0) * scatters[b])
            whole = scatters[b] * max(erf(ends[1]) - erf(ends[0]), 1e-12)
            evidence[a, b] = np.log(zero + 1e-300) - np.log(whole)
            centre[a, b] = first / (zero + 1e-300)
            spread[a, b] = max(second / (zero + 1e-300) - centre[a, b] ** 2, 0.0)
    return evidence, centre, spread


def together(scan: Scan, problem: ShiftProblem) -> Steps:
    """Return what all steps are if they scatter about a common mean, by an amount that they tell.

    Where a step is hardly told, its likelihood is little but noise, and counts for less.
    """
    steps = _averaged(scan, problem, np.ones(problem.curves - 1))
    return _averaged(scan, problem, SETTINGS.noisy + (1 - SETTINGS.noisy) * steps.told)


def _averaged(scan: Scan, problem: ShiftProblem, powers: FloatArray) -> Steps:
    """Return mean and covariance of steps over their common mean and scatter, the likelihoods raised to powers."""
    shares = []
    for place, log, power in zip(*scan, powers, strict=True):
        ends = np.concatenate([place[:1], (place[1:] + place[:-1]) / 2, place[-1:]])
        shares.append(np.exp(power * (log - log.max())) * np.diff(ends))
    alone = np.array([share @ place / share.sum() for share, place in zip(shares, scan.places, strict=True)])
    margin = SETTINGS.margin * problem.width
    means = np.linspace(alone.min() - margin, alone.max() + margin, SETTINGS.means)
    scatters = problem.width * np.geomspace(*SETTINGS.scatters)
    parts = zip(scan.places, shares, problem.windows, strict=True)
    found = [_given(*part, means, scatters) for part in parts]
    evidence = np.sum([step[0] for step in found], axis=0) + np.log(scatters)  # any scatter is as likely as another
    share = np.exp(evidence - evidence.max())
    share /= share.sum()
    common = Common(float(share.sum(axis=1) @ means), float(np.exp(share.sum(axis=0) @ np.log(scatters))))
    centre, spread = (np.array([step[i].ravel() for step in found]) for i in (1, 2))
    mean, own = centre @ share.ravel(), spread @ share.ravel()
    apart = centre - mean[:, None]
    told = np.clip(1 - own / common.scatter**2, 0.0, 1.0)
    return Steps(mean, own, (apart * share.ravel()) @ apart.T, told, common)


@jit
def _smoothing(points: Points, shifts: Shifts, grid: Knots, usual: float, variance: float) -> float:  # pragma: no cover
    """Return the likeliest smoothing of a few neighbours alone, near the usual one: a plateau is smoother."""
    low, splines = extent(points, shifts.across, grid.step)
    curve, nothing = workspace(splines, 0), np.empty(0)
    least, best = np.inf, usual
    for weight in grid.weights:
        if not usual / NEAR < weight < usual * NEAR:
            continue
        total = assemble(points, shifts, nothing, low, grid.step, curve)
        volume, explained = eliminate(curve, weight)
        score = volume - (splines - 2) * np.log(weight) + (total - explained) / variance
        if score < least:
            least, best = score, weight
    return best


def scan_pairs(problem: ShiftProblem, weight: float, variance: float, rising: float = 0.0) -> Scan:
    """Scan each step with its two curves alone, from one end of their overlap to the other; `rising` as of `scan`."""
    found = Scan([], [])
    for k, window in enumerate(problem.windows):
        place = np.linspace(window[0], window[1], SETTINGS.coarse)
        ways = np.column_stack([np.zeros(place.size), place])
        found.places.append(place)
        pair, rises = problem.between(k, k + 1), problem.rises(rising, 2)
        found.logs.append(likelihoods(pair, ways, problem.grid.step, weight, variance, rises))
    return found


def scan(
    problem: ShiftProblem,
    shifts: Shifts,
    spread: FloatArray,
    smoothing: tuple[float, float],
    common: Common,
    pairs: Scan,
    rising: float = 0.0,
) -> Scan:
    """Scan each step while the others follow it, with the curves that overlap across it.

    Parameters
    ----------
    problem : ShiftProblem
    shifts : Shifts
        Found.
    spread : array, shape (steps, steps)
        Covariance of their steps in the linearised problem.
    smoothing : tuple of float
        Weight of the curvature and variance of the scatter.
    common : Common
        What the other steps are expected to be.
    pairs : Scan
        Of two neighbours: where else a step may lie.
    rising : float
        Scatter of vertical steps, in heights of a curve, where vertical shifts are free at each place; 0 where there
        are none.
    """
    weight, variance = smoothing
    across, along = shifts
    found, best, wide = Scan([], []), np.diff(across), np.sqrt(np.diag(spread))
    for k, window in enumerate(problem.windows):
        near, far = best[k] + wide[k] * FINE, pairs.places[k]
        gap = far[1] - far[0]
        far = far[pairs.logs[k] > pairs.logs[k].max() - SETTINGS.unlikely]
        place = np.unique(np.append(near, far[(far < near[0]) | (far > near[-1]) | (wide[k] > gap)]))
        first, last = _overlapping(problem, across, k)
        points, rises = problem.between(first, last), problem.rises(rising, last - first + 1)
        own = Shifts(across[first : last + 1] - across[first], along[first : last + 1] - along[first])
        local = _smoothing(points, own, problem.grid, weight, variance)
        steps = best + np.outer(place - best[k], spread[:, k] / spread[k, k])
        ways = np.column_stack([np.zeros(place.size), np.cumsum(steps[:, first:last], axis=1)])
        log = likelihoods(points, ways, problem.grid.step, local, variance, rises)
        others = np.delete(steps, k, axis=1) - common.mean
        beyond = np.maximum(np.maximum(place - window[1], window[0] - place), 0) / (SETTINGS.beyond[0] * problem.width)
        log -= 0.5 * np.sum(others**2, axis=1) / common.scatter**2 + np.minimum(0.5 * beyond**2, SETTINGS.beyond[1])
        found.places.append(place)
        found.logs.append(log)
    return found


def _overlapping(problem: ShiftProblem, across: FloatArray, k: int) -> tuple[int, int]:
    """Return first and last curve of those that overlap across step k, and of those beside its own two."""
    member = problem.points.member
    ends = (
        np.searchsorted(member, np.arange(problem.curves)),
        np.searchsorted(member, np.arange(problem.curves), "right"),
    )
    low, high = problem.points.x[ends[0]] + across, problem.points.x[ends[1] - 1] + across
    met = np.argwhere((low[: k + 1, None] < high[k + 1 :]) & (high[: k + 1, None] > low[k + 1 :]))
    first = int(met[:, 0].min()) if met.size else k
    last = k + 1 + (int(met[:, 1].max()) if met.size else 0)
    return max(min(first, k - 1), 0), min(max(last, k + 2), problem.curves - 1)
