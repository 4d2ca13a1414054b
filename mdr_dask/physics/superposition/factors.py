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
    vertical_rounds: int = 6
    """Of the linearised problem with vertical shifts, at most."""
    settled: float = 0.3
    """Standard errors by which no shift moves any more in the last of them."""
    places: int = 20
    """Places on either side of the best, one standard deviation apart, along the loosest combination of shifts, at
    most."""
    unlikely: float = 5.0
    """Logarithm of the evidence, below the largest, where they end."""
    power: float = 0.7
    """Power of the evidence there: a curve is not quite what its smoothing expects."""
    pin: float = 1e6
    """Precision with which that combination is held there, relative to its own."""
    held: int = 3
    """Gauss-Newton steps of the others."""


SETTINGS = Settings()


class Found(NamedTuple):
    """Shifts, the covariance of those that are free, and the smoothing, scatter and prior they were found with.

    ``told`` says how far the curves tell each horizontal step: see `Steps`; ``rising`` is the scatter of vertical ones.
    """

    shifts: Shifts
    covariance: FloatArray
    weight: float
    variance: float
    prior: Prior
    told: FloatArray
    common: Common
    rising: float = 0.0


def find_horizontal(problem: ShiftProblem) -> Found:
    """Find horizontal shifts.

    A first fit knows smoothing and scatter. Scans of all pairs of neighbours then tell what steps have in common, a
    joint fit with that knowledge finds the best shifts, and scans about these their means and errors.
    """
    guess = problem.first_guess()
    first = SETTINGS.first_weight * float(problem.grid.weights[-1]) / 1e6
    usual = problem.prior(Common(float(np.median(guess)), problem.width))
    _, weight, variance = fit(
        problem.points, _chained(guess), problem.grid, usual, (first, 0.0), SETTINGS.first_iterations
    )
    pairs = scan_pairs(problem, weight, variance)
    steps = together(pairs, problem)
    for _ in range(SETTINGS.rounds):
        prior = problem.prior(steps.common)
        smoothing = weight, 0.0
        shifts, weight, variance = fit(
            problem.points, _chained(steps.mean), problem.grid, prior, smoothing, SETTINGS.iterations
        )
        _, covariance, *_ = changes_of(problem.points, shifts, problem.grid, weight, variance, [prior])
        spread = _of_steps(covariance)
        scanned = scan(problem, shifts, spread, (weight, variance), steps.common, pairs)
        steps = together(scanned, problem)
        apart = steps.mean - np.diff(shifts.across)
        if np.all(np.abs(apart) < SETTINGS.near * np.sqrt(np.diag(spread))):
            break
    sums = np.tri(problem.curves - 1)
    covariance = sums @ _covariance(steps, spread) @ sums.T
    return Found(_chained(steps.mean), covariance, weight, variance, prior, steps.told, steps.common)


def find_both(problem: ShiftProblem) -> Found:
    """Find vertical shifts beside horizontal ones.

    Vertical shifts enter linearly, so that the problem is linear about good horizontal ones. On a plateau it is not:
    there scans, in which vertical shifts are free at each place, tell whether it began well, and what it leaves open.
    What both disagree in counts as an error.
    """
    level = find_horizontal(problem)
    level, _ = _linear(problem, level, problem.priors(level.common.mean))
    found, size = _likeliest(problem, [level, _by_pairs(problem, level)]), problem.curves - 1
    for left in range(SETTINGS.rounds - 1, -1, -1):
        spread = _of_steps(found.covariance[:size, :size])
        steps = _scanned(problem, found, spread)
        apart = steps.mean - np.diff(found.shifts.across)
        if not left or np.all(np.abs(apart) < SETTINGS.near * np.sqrt(np.diag(spread))):
            break
        shifts = found.shifts._replace(across=_chained(steps.mean).across)
        found = _likeliest(problem, [found._replace(shifts=shifts, common=steps.common)])
    return _joined(problem, found, steps, spread)


def _by_pairs(problem: ShiftProblem, found: Found) -> Found:
    """Return shifts by scans of two neighbours each, whose vertical shifts are free about their mean step.

    Horizontal shifts alone take the levels of a plateau for a slope, so that its curves lie far apart. The scatter is
    to be one of both kinds of shifts.
    """
    usual = _usual(found)
    pairs = scan_pairs(problem.lifted(usual), found.weight, found.variance, found.rising)
    steps = together(pairs, problem)
    return found._replace(shifts=_chained(steps.mean)._replace(along=usual), common=steps.common)


def _usual(found: Found) -> FloatArray:
    """Return vertical shifts whose steps all are the mean step."""
    return np.asarray(np.linspace(0.0, found.shifts.along[-1], found.shifts.along.size))


def _joined(problem: ShiftProblem, found: Found, steps: Steps, spread: FloatArray) -> Found:
    """Return shifts of the linearised problem and of scans together; `spread` is the covariance of the former's steps.

    A scan counts for the place as far as it is the wider of the two, and for the width where the curves do not tell.
    Curves that overlap nowhere tell nothing of a step beside a vertical one: it is taken to be as others are.
    """
    scanned, linear, sums = steps.shared + np.diag(steps.own), np.diff(found.shifts.across), np.tri(steps.mean.size)
    width = np.diag(scanned)
    share = np.clip(1 - np.divide(np.diag(spread), width, out=np.ones_like(width), where=width > 0), 0.0, 1.0)
    wide, apart = np.sqrt(np.maximum(share, 1 - steps.told)), steps.mean - linear
    between = linear + share * apart
    place = np.clip(between, *problem.windows.T)
    other = sums @ ((1 - steps.told) * (1 - share) * apart + place - between)
    covariance = sums @ (spread + wide[:, None] * scanned * wide) @ sums.T + np.outer(other, other)
    is_open = place != between
    covariance += sums @ np.diag(is_open * steps.common.scatter**2) @ sums.T
    told = np.where(is_open, 0.0, steps.told)
    return _followed(found, sums @ (place - linear), covariance)._replace(told=told, common=steps.common)


def _scanned(problem: ShiftProblem, found: Found, spread: FloatArray) -> Steps:
    """Return what scans tell of steps where vertical shifts are free, about their mean step."""
    usual = _usual(found)
    level, smoothing = problem.lifted(usual), (found.weight, found.variance)
    shifts = found.shifts._replace(along=found.shifts.along - usual)
    pairs = scan_pairs(level, *smoothing, found.rising)
    return together(scan(level, shifts, spread, smoothing, found.common, pairs, found.rising), level)


def _followed(found: Found, moved: FloatArray, covariance: FloatArray) -> Found:
    """Return horizontal shifts moved, with another covariance, and the vertical ones as they follow linearly."""
    size = moved.size
    gain = np.linalg.solve(found.covariance[:size, :size], found.covariance[:size, size:]).T
    alone = found.covariance[size:, size:] - gain @ found.covariance[:size, size:]
    beside = gain @ covariance
    whole = np.block([[covariance, beside.T], [beside, alone + beside @ gain.T]])
    changes = np.insert(np.append(moved, gain @ moved), [0, size], 0.0).reshape(2, -1)
    shifts = Shifts(found.shifts.across + changes[0], found.shifts.along + changes[1])
    return found._replace(shifts=shifts, covariance=whole)


def _likeliest(problem: ShiftProblem, starts: list[Found]) -> Found:
    """Return both kinds of shifts from the start of most evidence."""
    priors = problem.priors(starts[-1].common.mean)
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
        shifts=shifts,
        covariance=covariance,
        weight=weight,
        variance=variance,
        prior=priors[best],
        rising=RATIOS[best] * problem.height,
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
            if log < max(evidence) - SETTINGS.unlikely:
                break
    share = np.exp(SETTINGS.power * (np.array(evidence) - max(evidence)))
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
