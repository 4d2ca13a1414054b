"""The compiled band and border beside dense algebra and scipy's splines."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.linalg import block_diag

from mdr_dask.physics.superposition.least_squares import (
    Points,
    Prior,
    Shifts,
    changes_of,
    extent,
    fit,
    linearise,
    restricted,
    rows,
)
from mdr_dask.physics.superposition.problem import ShiftProblem
from mdr_dask.physics.superposition.steps import likelihoods

STEP, WEIGHT = 0.25, 0.3
NONE = np.empty((0, 0))


def data(curves=3, points=9, noise=0.01):
    random, x = np.random.default_rng(0), np.linspace(-1, 1, points)
    pieces = [(x, np.tanh(x + 0.4 * k) + noise * random.standard_normal(points)) for k in range(curves)]
    return ShiftProblem.of(pieces)


def dense(points, across):
    """Return B-splines at shifted points by scipy, and their second differences."""
    low, splines = extent(points, across, STEP)
    knots = low + STEP * np.arange(-3, splines + 1)
    x = points.x + across[points.member]
    return BSpline.design_matrix(x, knots, 3, extrapolate=True).toarray(), np.diff(np.eye(splines), 2, axis=0)


def test_splines_are_those_of_scipy():
    points, across = data().points, np.array([0.0, 0.37, 0.9])
    low, splines = extent(points, across, STEP)
    np.testing.assert_allclose(rows(points, across, low, STEP, splines), dense(points, across)[0], atol=1e-12)


@pytest.mark.parametrize("vertical", [False, True])
def test_changes_and_score_are_those_of_dense_algebra(vertical):
    points, across = data().points, np.array([0.0, 0.37, 0.9])
    along = np.array([0.0, 0.01, -0.02]) * vertical
    normal, total, _ = linearise(points, Shifts(across, along), STEP, WEIGHT, vertical)
    changes, _, variance, score = restricted(points.x.size, normal, total, WEIGHT)
    basis, second = dense(points, across)
    target = points.y + along[points.member]
    smooth = basis.T @ basis + WEIGHT * second.T @ second
    curve = np.linalg.solve(smooth, basis.T @ target)
    ahead, behind = (dense_at(points, across, move) @ curve for move in (1e-6, -1e-6))
    moved = np.eye(3)[points.member][:, 1:]
    border = [moved * ((ahead - behind) / 2e-6)[:, None]] + ([-moved] if vertical else [])
    design = np.hstack([basis, *border])
    penalty = np.zeros((design.shape[1],) * 2)
    penalty[: second.shape[1], : second.shape[1]] = WEIGHT * second.T @ second
    matrix = design.T @ design + penalty
    best = np.linalg.solve(matrix, design.T @ target)
    misfit = float(target @ target - best @ design.T @ target)
    freedom = target.size - 2 - changes.size
    np.testing.assert_allclose(changes, best[second.shape[1] :], rtol=1e-5, atol=1e-8)
    assert variance == pytest.approx(misfit / freedom, rel=1e-6)
    expected = np.linalg.slogdet(matrix)[1] - second.shape[0] * np.log(WEIGHT) + freedom * np.log(misfit)
    assert score == pytest.approx(expected, rel=1e-6)


def dense_at(points, across, move):
    """Return B-splines on the cells of `across`, at points moved a little more."""
    low, splines = extent(points, across, STEP)
    return BSpline.design_matrix(
        points.x + across[points.member] + move, low + STEP * np.arange(-3, splines + 1), 3, extrapolate=True
    ).toarray()


@pytest.mark.parametrize("rises", [NONE, np.array([[50.0, -20.0], [-20.0, 30.0]])])
def test_likelihoods_are_misfit_and_freedom_of_the_smoothed_curve(rises):
    """With vertical shifts free beside the curve, or without."""
    points, variance = data().points, 1e-4
    ways = np.array([[0.0, 0.4, 0.8], [0.0, -0.3, 1.9], [0.0, 2.5, 5.1]])
    found = likelihoods(points, ways, STEP, WEIGHT, variance, rises)
    moved = -np.eye(3)[points.member][:, 1 : 1 + len(rises)]
    for way, log in zip(ways, found, strict=True):
        basis, second = dense(points, way)
        design, penalty = np.hstack([basis, moved]), block_diag(WEIGHT * second.T @ second, variance * rises)
        hat = design @ np.linalg.solve(design.T @ design + penalty, design.T)
        misfit = points.y @ (points.y - hat @ points.y)
        assert log == pytest.approx(-0.5 * (misfit / variance + np.trace(hat)), rel=1e-6)


def test_on_a_plateau_all_steps_are_as_likely_in_the_mean():
    """Two flat curves, 400 of them: how they lie changes the mean logarithm by no more than its error."""
    random, x = np.random.default_rng(1), np.linspace(-1, 1, 15)
    steps = np.linspace(-2, 2, 9)
    ways = np.column_stack([np.zeros(9), steps])
    member = np.repeat([0, 1], 15)
    both = np.append(x, x)
    logs = [
        likelihoods(Points(both, random.standard_normal(30), member), ways, STEP, 1.0, 1.0, NONE) for _ in range(400)
    ]
    mean = np.mean(logs, axis=0)
    spread = np.std(np.array(logs) - np.mean(logs, axis=1, keepdims=True), axis=0) / 20
    assert np.all(np.abs(mean - mean.mean()) < 4 * spread)


def test_fit_is_stationary_and_a_tight_prior_holds_it():
    problem = data(noise=0.0)
    loose = Prior(np.array([0.4, 0.8]), np.eye(2) * 1e-3)
    shifts, weight, variance = fit(
        problem.points, Shifts(np.array([0.0, 0.6, 1.1]), np.zeros(3)), problem.grid, loose, (1e-3, 0.0), 40
    )
    np.testing.assert_allclose(shifts.across, [0.0, 0.4, 0.8], atol=5e-3)
    changes, *_ = changes_of(problem.points, shifts, problem.grid, weight, variance, [loose])
    assert np.all(np.abs(changes) < 1e-3)
    tight = Prior(np.array([0.5, 1.0]), np.eye(2) * 1e12)
    held, *_ = fit(problem.points, shifts, problem.grid, tight, (weight, 1e-4), 40)
    np.testing.assert_allclose(held.across, [0.0, 0.5, 1.0], atol=1e-4)
