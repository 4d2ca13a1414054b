"""Shifts of curves and what is known of them: horizontal ones alone, or with vertical ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.superposition.least_squares import Prior, Shifts, changes_of, fit
from mdr_dask.physics.superposition.problem import RATIOS, Common, ShiftProblem, differences
from mdr_dask.physics.superposition.steps import Steps, scan, scan_pairs, together


class Settings(NamedTuple):
    """Numbers of the search; `python -m benchmarks superposition accuracy` shows what they do."""

    first_weight: float = 1e-3
    """Smoothing of the first curve, relative to the points in a cell."""
    first_iterations: int = 8
    """Gauss-Newton steps from the first guess: enough to know smoothing and scatter."""
    iterations: int = 40
    rounds: int = 3
    """Of fit and scan, at most."""
    near: float = 1.5
    """Standard deviations by which a scan may move a step without another round."""
    apart: float = 3.0
    """Standard deviations between two ways to a step beyond which the linearised problem starts anew."""
    vertical_rounds: int = 6
    """Of the linearised problem with vertical shifts, at most."""
    settled: float = 0.3
    """Standard errors by which no shift moves any more in the last of them."""
    rises: tuple[float, float] = (0.0, 0.03)
    """Scatter that horizontal shifts allow for, in heights of a curve, before vertical ones are known and after."""
    places: int = 5
    """Places on either side of the best, one standard deviation apart, along the loosest combination of shifts."""
    pin: float = 1e6
    """Precision with which that combination is held there, relative to its own."""
    held: int = 3
    """Gauss-Newton steps of the others."""


SETTINGS = Settings()


class Found(NamedTuple):
    """Shifts, the covariance of those that are free, and the smoothing, scatter and prior they were found with.

    ``told`` says how far the curves tell each horizontal step: see `Steps`.
    """

    shifts: Shifts
    covariance: FloatArray
    weight: float
    variance: float
    prior: Prior
    told: FloatArray
    common: Common


def find_horizontal(problem: ShiftProblem, least: float = 0.0) -> Found:
    """Find horizontal shifts.

    A first fit knows smoothing and scatter. Scans of all pairs of neighbours then tell what steps have in common, a
    joint fit with that knowledge finds the best shifts, and scans about these their means and errors. `least` is a
    scatter of the ordinates to be allowed for, whatever they tell.
    """
    guess = problem.first_guess()
    first = SETTINGS.first_weight * float(problem.grid.weights[-1]) / 1e6
    usual = problem.prior(Common(float(np.median(guess)), problem.width))
    _, weight, variance = fit(
        problem.points, _chained(guess), problem.grid, usual, (first, 0.0), SETTINGS.first_iterations
    )
    pairs = scan_pairs(problem, weight, max(variance, least**2))
    steps = together(pairs, problem)
    for _ in range(SETTINGS.rounds):
        prior = problem.prior(steps.common)
        smoothing = weight, 0.0
        shifts, weight, variance = fit(
            problem.points, _chained(steps.mean), problem.grid, prior, smoothing, SETTINGS.iterations
        )
        variance = max(variance, least**2)
        _, covariance, *_ = changes_of(problem.points, shifts, problem.grid, weight, variance, [prior])
        spread = _of_steps(covariance)
        scanned = scan(problem, shifts.across, spread, (weight, variance), steps.common, pairs)
        steps = together(scanned, problem)
        apart = steps.mean - np.diff(shifts.across)
        if np.all(np.abs(apart) < SETTINGS.near * np.sqrt(np.diag(spread))):
            break
    sums = np.tri(problem.curves - 1)
    covariance = sums @ _covariance(steps, spread) @ sums.T
    return Found(_chained(steps.mean), covariance, weight, variance, prior, steps.told, steps.common)


def find_both(problem: ShiftProblem) -> Found:
    """Find vertical shifts beside horizontal ones.

    Vertical shifts enter linearly, so that the problem is linear about good horizontal ones. Scans of curves moved
    along the ordinate, as a plateau lies level only then, tell whether they are good, and how wide steps on a plateau
    are.
    """
    starts = [find_horizontal(problem, rise * problem.height) for rise in SETTINGS.rises]
    found = _likeliest(problem, starts)
    size = problem.curves - 1
    second = find_horizontal(problem.lifted(found.shifts.along))
    spread, scanned = _of_steps(found.covariance[:size, :size]), _of_steps(second.covariance)
    apart = np.abs(np.diff(found.shifts.across - second.shifts.across))
    if np.any(apart > SETTINGS.apart * np.sqrt(np.diag(spread) + np.diag(scanned))):
        shifts = Shifts(second.shifts.across, found.shifts.along)
        found = _likeliest(problem, [second._replace(shifts=shifts)])
        spread = _of_steps(found.covariance[:size, :size])
    wider = np.sqrt(np.clip(1 - np.diag(spread) / np.diag(scanned), 0.0, 1.0))
    sums = np.tri(size)
    # on a plateau the linear problem stays near its start, and the scan may find another place
    other = (second.shifts.across - found.shifts.across)[1:]
    found.covariance[:size, :size] += sums @ (wider[:, None] * scanned * wider) @ sums.T + np.outer(other, other)
    return found._replace(told=second.told, common=second.common)


def _likeliest(problem: ShiftProblem, starts: list[Found]) -> Found:
    """Return both kinds of shifts from the start of most evidence."""
    priors = problem.priors(float(np.mean([start.common.mean for start in starts])))
    found, _ = max((_linear(problem, start, priors) for start in starts), key=lambda pair: pair[1])
    return _along_the_loosest(problem, found, priors)


def _linear(problem: ShiftProblem, start: Found, priors: list[Prior]) -> tuple[Found, float]:
    """Return both kinds of shifts as the linearised problem has them, and the logarithm of their evidence."""
    size, best, (shifts, _, weight, variance, *_) = problem.curves - 1, RATIOS.size // 2, start
    for _ in range(SETTINGS.vertical_rounds):
        _, weight, variance = fit(problem.points, shifts, problem.grid, priors[best], (weight, 0.0), 1)
        changes, covariance, best, log = changes_of(problem.points, shifts, problem.grid, weight, variance, priors)
        moved = np.insert(changes, [0, size], 0.0).reshape(2, -1)
        shifts = Shifts(shifts.across + moved[0], shifts.along + moved[1])
        if np.all(np.abs(changes) < SETTINGS.settled * np.sqrt(np.diag(covariance))):
            break
    return start._replace(
        shifts=shifts, covariance=covariance, weight=weight, variance=variance, prior=priors[best]
    ), log


def _along_the_loosest(problem: ShiftProblem, found: Found, priors: list[Prior]) -> Found:
    """Return mean and covariance of shifts over places along their loosest combination, by their evidence.

    A straight piece may slide along itself by horizontal and vertical shifts together, so far that the problem is not
    linear any more. At each place that combination is held, and the others are found anew.
    """
    values, vectors = np.linalg.eigh(found.covariance)
    axis, wide, size = vectors[:, -1], float(np.sqrt(values[-1])), problem.curves - 1
    pin = SETTINGS.pin / wide**2
    best, smoothing = np.append(found.shifts.across[1:], found.shifts.along[1:]), (found.weight, found.variance)
    evidence, means, spreads = [], [], []
    for sign, count in ((1.0, SETTINGS.places), (-1.0, SETTINGS.places - 1)):
        here = best if sign > 0 else best - wide * axis
        for _ in range(count):
            held = [_held(prior, pin, axis, here) for prior in priors]
            shifts = Shifts(np.append(0.0, here[:size]), np.append(0.0, here[size:]))
            middle = held[len(held) // 2]
            shifts, *_ = fit(problem.points, shifts, problem.grid, middle, smoothing, SETTINGS.held)
            changes, spread, _, log = changes_of(problem.points, shifts, problem.grid, *smoothing, held)
            evidence.append(log)
            means.append(np.append(shifts.across[1:], shifts.along[1:]) + changes)
            spreads.append(spread)
            here = means[-1] + sign * wide * axis
    share = np.exp(np.array(evidence) - max(evidence))
    share /= share.sum()
    mean = share @ np.array(means)
    apart = np.array(means) - mean
    covariance = (apart.T * share) @ apart + np.tensordot(share, np.array(spreads), 1)
    shifts = Shifts(np.append(0.0, mean[:size]), np.append(0.0, mean[size:]))
    return found._replace(shifts=shifts, covariance=covariance)


def _held(prior: Prior, pin: float, axis: FloatArray, here: FloatArray) -> Prior:
    """Return a prior that holds shifts to a place along one direction, with a precision `pin`."""
    along = np.linalg.solve(prior.precision, axis)
    mean = prior.mean + along * (axis @ (here - prior.mean)) / (1 / pin + axis @ along)
    return Prior(mean, prior.precision + pin * np.outer(axis, axis))


def _covariance(steps: Steps, spread: FloatArray) -> FloatArray:
    """Return the covariance of steps: their own variance, correlated as far as the curves tell them."""
    told = np.sqrt(steps.told)
    wide = told * np.sqrt(steps.own / np.diag(spread))
    joint = wide[:, None] * spread * wide + np.diag((1 - steps.told) * steps.own)
    return np.asarray(steps.shared + joint, dtype=np.float64)


def _of_steps(covariance: FloatArray) -> FloatArray:
    """Return the covariance of steps from that of shifts."""
    rows = differences(covariance.shape[0])
    return np.asarray(rows @ covariance @ rows.T, dtype=np.float64)


def _chained(steps: FloatArray) -> Shifts:
    across = np.append(0.0, np.cumsum(steps))
    return Shifts(across, np.zeros(across.size))
