"""Horizontal and vertical shifts together: mean and covariance of their posterior, by a random walk through it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mdr_dask.physics import shift_sampling
from mdr_dask.physics.shift_problem import Problem
from mdr_dask.physics.shift_system import SMOOTHING, Settled, System

FloatArray = NDArray[np.float64]

FIRST_STEPS, MOST_STEPS = 1500, 48000
"""Of a stage of the walk; each is twice as long as the one before, until both halves of one tell the same."""

SAME = 0.5
"""Difference of the means of both halves, in standard deviations, and of the logarithms of these."""

FIRST_LENGTH = 2.4
"""Of a step, in standard deviations and divided by the root of the number of unknowns: the best for a normal
distribution."""


def sample(problem: Problem, shifts: FloatArray, settled: Settled, covariance: FloatArray, seed: int) -> FloatArray:
    """Walk through the posterior of the shifts, in which the curve, its smoothness and the scatter are unknown too.

    Parameters
    ----------
    problem : Problem
    shifts : array, shape (unknowns,)
        The most likely ones.
    settled : Settled
        Smoothing there.
    covariance : array, shape (unknowns, unknowns)
        That of the linearised problem, which shapes the first steps.
    seed : int
        Seed of the walk.

    Returns
    -------
    array, shape (steps, unknowns)
        Correlated draws, evenly weighted.
    """
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)))
    system = System.at(problem, shifts, settled)
    low = system.low - problem.width
    cells = int(np.ceil(system.splines + 2 * problem.width / system.step))
    height = float(np.median([np.ptp(problem.y[problem.member == curve]) for curve in range(problem.curves)]))
    about = cells, float(system.penalty[0, 0]), problem.usual, problem.width, height
    here, log_weight, size = shifts.copy(), float(np.log(settled.weight)), shifts.size
    bounds, length = np.log(SMOOTHING[[0, -1]]), FIRST_LENGTH / np.sqrt(size)
    shape, steps, visited = covariance * (1 + 1e-9 * np.eye(size)), FIRST_STEPS, np.empty((0, size))
    while steps <= MOST_STEPS and not _settled(visited):
        visited = np.empty((steps, size))
        log_weight, length = shift_sampling.walk(
            here,
            log_weight,
            bounds,
            np.asarray(np.linalg.cholesky(shape), dtype=np.float64),
            length,
            generator.standard_normal((steps, size + 1)),
            generator.random((steps, 2)),
            problem.x,
            problem.y,
            problem.member,
            problem.curves,
            low,
            system.step,
            *about,
            steps == FIRST_STEPS,
            visited,
        )
        if steps > FIRST_STEPS:
            shape, length = np.cov(visited.T) + 1e-3 * np.diag(np.diag(covariance)), FIRST_LENGTH / np.sqrt(size)
        steps *= 2
    return visited


def _settled(visited: FloatArray) -> bool:
    """Say whether both halves of a stage have the same means and widths; the first stages only find their way."""
    if visited.shape[0] <= 2 * FIRST_STEPS:
        return False
    halves = np.split(visited, 2)
    means, widths = (np.array([of(half, axis=0) for half in halves]) for of in (np.mean, np.std))
    apart = np.abs(means[0] - means[1]) / widths.mean(axis=0)
    return bool(np.all(apart < SAME) and np.all(np.abs(np.log(widths[0] / widths[1])) < SAME))
