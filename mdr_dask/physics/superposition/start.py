"""The posterior of shifts as it would be if the problem were linear: where sampling it begins."""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.superposition.least_squares import SMOOTHING, System
from mdr_dask.physics.superposition.marginal import ALIKE
from mdr_dask.physics.superposition.problem import Problem

RATIOS = 1e-3 * ALIKE**2, 4.0
"""Least and largest variance considered of the steps between neighbours, in widths and heights of a curve."""

STEPS = 20
SMALLEST = 1e-30
"""Variance of the scatter of curves that are one without any."""

VARIANCES = 0.25, 1.5
"""Added to those of the logarithms of the ratio and of the smoothing, which are taken on a grid."""


def moments(
    problem: Problem, system: System, shifts: FloatArray, variance: float, height: float
) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of a point as `log_posterior` takes it, about shifts at which a system is linear.

    For each smoothing, and for each ratio of the variances of steps and of scatter, the shifts are normal; both are
    weighed by their likelihood.

    Parameters
    ----------
    variance : float
        Of the scatter.
    height : float
        Of a curve.
    """
    rest, gain, squares, volume = _without_curve(system)
    alike = _alikeness(problem, height)
    least, largest = np.log(np.array(RATIOS) / max(variance, SMALLEST))
    log_ratios = np.linspace(least, largest, STEPS)
    precision = rest[:, None] + np.exp(-log_ratios)[:, None, None] * alike
    pull = gain[:, None] - np.exp(-log_ratios)[:, None] * (alike @ shifts)
    inverse = np.linalg.inv(precision)
    steps = np.einsum("ijkl,ijl->ijk", inverse, pull)
    scatter = np.exp(-log_ratios) * (shifts @ alike @ shifts + ALIKE**2)
    misfit = squares[:, None] + scatter - np.einsum("ijk,ijk->ij", steps, pull)
    freedom = problem.x.size - 2
    volume = volume[:, None] + np.linalg.slogdet(precision)[1] + shifts.size * log_ratios
    misfit = np.maximum(misfit, 1e-14 * system.total + 1e-300)
    logs = -0.5 * (volume + freedom * np.log(misfit))
    share = np.exp(logs - logs.max())
    share /= share.sum()
    return _mixed(share, shifts + steps, inverse * (misfit / max(freedom - 2, 1))[..., None, None], log_ratios)


def _without_curve(system: System) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return normal equations of the shifts alone for each smoothing, squares left, and logs of the determinant."""
    inner, outer = slice(system.splines), slice(system.splines, None)
    curve = system.normal[inner, inner] + SMOOTHING[:, None, None] * system.penalty[inner, inner]
    both = np.column_stack([system.normal[inner, outer], system.right[inner]])
    solved = np.linalg.solve(curve, np.broadcast_to(both, (SMOOTHING.size, *both.shape)))
    rest = system.normal[outer, outer] - both[:, :-1].T @ solved[:, :, :-1]
    gain = system.right[outer] - solved[:, :, -1] @ both[:, :-1]
    volume = np.linalg.slogdet(curve)[1] - (system.splines - 2) * np.log(SMOOTHING)
    return rest, gain, system.total - solved[:, :, -1] @ both[:, -1], volume


def _alikeness(problem: Problem, height: float) -> FloatArray:
    """Return the quadratic form of the scatter of steps about their mean, horizontal and vertical."""
    size = problem.curves - 1
    steps = np.eye(size) - np.eye(size, k=-1)
    form = steps.T @ (steps - steps.mean(axis=0))
    return np.kron(np.diag([1 / problem.width**2, 1 / height**2]), form)


def _mixed(
    share: FloatArray, means: FloatArray, covariances: FloatArray, log_ratios: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return mean and covariance of a mixture over smoothing and ratio, of these beside the horizontal shifts."""
    curves = means.shape[2] // 2
    centres = np.empty((*share.shape, curves + 2))
    centres[..., :curves] = means[..., :curves]
    centres[..., curves], centres[..., curves + 1] = log_ratios, np.log(SMOOTHING)[:, None]
    mean = np.einsum("ij,ijk->k", share, centres)
    covariance = np.einsum("ij,ijk,ijl->kl", share, centres - mean, centres - mean)
    covariance[:curves, :curves] += np.einsum("ij,ijkl->kl", share, covariances[..., :curves, :curves])
    covariance[curves:, curves:] += np.diag(VARIANCES)
    return mean, covariance
