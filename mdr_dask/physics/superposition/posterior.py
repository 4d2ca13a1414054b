"""Horizontal and vertical shifts together: mean and covariance of their posterior, by sampling of importance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.superposition import marginal as shift_marginal
from mdr_dask.physics.superposition import sampling as shift_sampling
from mdr_dask.physics.superposition import start as shift_start
from mdr_dask.physics.superposition.least_squares import SMOOTHING, Settled, System
from mdr_dask.physics.superposition.problem import Problem

Data = tuple[FloatArray, FloatArray, NDArray[np.intp], float, float, int, float]
"""Points and their curves; low end, step and number of the splines; size of the curvature."""

ENOUGH = 500.0
"""Points of even weight that those drawn are worth: means are known to 0.05 standard deviations, these to 3 %."""

STAGE, MOST_STAGES = 30, 60
"""Points of a stage for every unknown, and stages at most."""

WORTH = 6.0
"""Points of even weight, for every unknown, that the shape of the next stage is taken from."""

WIDER = 5.0
"""Variance added to a stage, shared by all unknowns: tails that a stage misses make bars short, and wide ones waste."""

TEMPER, COLDEST = 0.8, 0.02
"""Factor and least value of the power to which the posterior is raised where too few points decide."""

LEAST_WEIGHT = 1e-3
"""Weight, relative to the largest, below which a point is left out."""


def sample(problem: Problem, shifts: FloatArray, settled: Settled, seed: int) -> tuple[FloatArray, FloatArray, float]:
    """Return mean and covariance of the posterior of the shifts, and how many points of even weight they rest on.

    The curve, its smoothness and the scatter are unknown too.
    Vertical shifts and the curve are integrated out in closed form. The rest is drawn from Student's t, in stages: the
    first is that of the linearised problem, each other has the middle and the shape that all points before tell of, and
    all points count, by the mixture of all stages.

    Parameters
    ----------
    problem : Problem
    shifts : array, shape (unknowns,)
        The most likely ones.
    settled : Settled
        Smoothing and scatter there.
    seed : int
        Seed of the points.
    """
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed)))
    system = System.at(problem, shifts, settled)
    data, expected = _arguments(problem, system)
    curves, bounds = problem.curves - 1, np.log(SMOOTHING[[0, -1]])
    mean, spread = shift_start.moments(problem, system, shifts, settled.variance, expected[2])
    cloud = _Cloud(mean.size)
    while True:
        drawn = cloud.draw(generator, mean, spread)
        cloud.logs = np.append(cloud.logs, shift_marginal.log_posteriors(drawn, *data, expected, bounds))
        if cloud.worth(1.0) >= ENOUGH or len(cloud.stages) == MOST_STAGES:
            break
        mean, spread = cloud.next_shape(spread)
    weights = cloud.weights(1.0)
    kept = weights > LEAST_WEIGHT * weights.max()
    points, weights = cloud.points[kept], weights[kept] / weights[kept].sum()
    heights, spread = shift_marginal.heights_of(points, weights, *data, expected)
    mean, covariance = shift_sampling.moments(np.hstack([points[:, :curves], heights]), weights)
    covariance[curves:, curves:] += spread
    return mean, covariance, cloud.worth(1.0)


class _Cloud:
    """Points of all stages with the logarithms of their posterior, and their density under the mixture of stages."""

    def __init__(self, unknowns: int) -> None:
        self.points, self.logs, self.mixture = np.empty((0, unknowns)), np.empty(0), np.empty(0)
        self.stages: list[tuple[FloatArray, FloatArray]] = []

    def draw(self, generator: np.random.Generator, mean: FloatArray, spread: FloatArray) -> FloatArray:
        """Draw the points of another stage."""
        factor = np.asarray(np.linalg.cholesky(spread), dtype=np.float64)
        count = STAGE * mean.size
        normals, squares = (
            generator.standard_normal((count, mean.size)),
            generator.chisquare(shift_sampling.TAIL, count),
        )
        drawn = shift_sampling.placed(mean, factor, normals, squares)
        self.stages.append((mean, factor))
        densities = np.zeros(count)
        scale = -float(np.log(np.diag(self.stages[0][1])).sum())
        shift_sampling.add_density(self.points, mean, factor, scale, self.mixture)
        for stage in self.stages:
            shift_sampling.add_density(drawn, *stage, scale, densities)
        self.points, self.mixture = np.vstack([self.points, drawn]), np.append(self.mixture, densities)
        return drawn

    def weights(self, power: float) -> FloatArray:
        """Return the weights of all points, which sum to one, those of the posterior raised to a power."""
        logs = self.logs - np.log(self.mixture)
        weights = np.exp(power * (logs - logs.max()))
        return np.asarray(weights / weights.sum(), dtype=np.float64)

    def worth(self, power: float) -> float:
        """Return how many points of even weight all are worth; none if the posterior is zero at all of them."""
        return 1 / float(np.sum(self.weights(power) ** 2)) if np.isfinite(self.logs.max()) else 0.0

    def next_shape(self, spread: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return mean and covariance by the weights, which are made more even while too few points decide."""
        if not np.isfinite(self.logs.max()):
            return self.stages[-1][0], spread / 4
        power, wanted = 1.0, min(WORTH * spread.shape[0], 0.5 * self.logs.size)
        while self.worth(power) < wanted and power > COLDEST:
            power *= TEMPER
        mean, found = shift_sampling.moments(self.points, self.weights(power))
        return mean, (1 + WIDER / spread.shape[0]) * found + 1e-9 * np.diag(np.diag(spread))


def _arguments(problem: Problem, system: System) -> tuple[Data, tuple[float, float, float]]:
    """Return what the compiled posterior takes: a spline with room for the points to move, and what is expected."""
    splines = int(np.ceil(system.splines + 2 * problem.width / system.step))
    heights = [float(np.ptp(problem.y[problem.member == curve])) for curve in range(problem.curves)]
    spline = system.low - problem.width, system.step, splines, float(system.penalty[0, 0])
    return (problem.x, problem.y, problem.member, *spline), (
        problem.usual,
        problem.width,
        float(np.median(heights)) or 1.0,
    )
