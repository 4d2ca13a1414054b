from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline

from mdr_dask.physics.superposition import marginal as shift_marginal
from mdr_dask.physics.superposition import posterior as shift_posterior
from mdr_dask.physics.superposition import sampling as shift_sampling
from mdr_dask.physics.superposition.least_squares import Settled
from mdr_dask.physics.superposition.problem import Problem

USUAL, WIDTH, HEIGHT = 0.4, 2.0, 1.5
LOW, STEP, SPLINES = -3.0, 0.5, 16
BOUNDS = np.array([-20.0, 20.0])


def problem(curves, points, noise):
    random = np.random.default_rng(0)
    x = np.linspace(-1, 1, points)
    pieces = [(x, np.tanh(x + 0.4 * k) - 0.1 * k + noise * random.standard_normal(points)) for k in range(curves)]
    return Problem.of(np.arange(curves, dtype=float), pieces)


def squares(point, curve, heights, data):
    """Squared misses of the data, roughness of the curve and scatter of the steps, in units of the scatter."""
    size = heights.size
    x = data.x + np.append(0, point[:size])[data.member]
    spline = BSpline(LOW + STEP * np.arange(-3, SPLINES + 1), curve, 3)
    misses = data.y + np.append(0, heights)[data.member] - spline(x)
    steps = [np.diff(np.append(0, part)) / scale for part, scale in ((point[:size], WIDTH), (heights, HEIGHT))]
    scatter = shift_marginal.ALIKE**2 + sum(np.sum((step - step.mean()) ** 2) for step in steps)
    return misses @ misses + np.exp(point[-1]) * np.sum(np.diff(curve, 2) ** 2) + scatter / np.exp(point[-2])


def slowly(point, data):
    """Return the logarithm of the posterior, the mean heights and their covariance, by dense algebra and a long sum."""
    size, eye = data.curves - 1, np.eye(SPLINES + data.curves - 1)

    def of(unknown):
        return squares(point, unknown[:SPLINES], unknown[SPLINES:], data)

    nothing = of(0 * eye[0])
    form = np.array([[(of(a + b) - of(a) - of(b) + nothing) / 2 for a in eye] for b in eye])
    best = np.linalg.solve(form, [(of(-a) - of(a)) / 4 for a in eye])
    variance = np.geomspace(1e-9, 1e3, 20001)
    powers = data.x.size + SPLINES - 2 + 2 * size - eye.shape[0]  # of data, curve and steps, less what is integrated
    logs = -0.5 * of(best) / variance - 0.5 * powers * np.log(variance)
    usual = np.sum((np.diff(np.append(0, point[:size])) - USUAL) ** 2) / WIDTH**2
    whole = -0.5 * (np.linalg.slogdet(form)[1] + usual - (SPLINES - 2) * point[-1] + 2 * size * point[-2])
    share = np.exp(logs - logs.max())
    spread = np.linalg.inv(form)[SPLINES:, SPLINES:] * (share @ variance) / share.sum()
    return whole + np.logaddexp.reduce(logs), best[SPLINES:], spread


def test_curve_heights_and_scatter_are_integrated_out():
    data = problem(3, 7, 0.02)
    points = np.array([[0.4, 0.8, 5.0, 0.0], [0.3, 0.9, 6.0, 0.0], [0.5, 0.7, 5.0, 1.5], [0.2, 1.3, 3.0, -2.0]])
    about = data.x, data.y, data.member, LOW, STEP, SPLINES, 1.0, (USUAL, WIDTH, HEIGHT)
    logs, heights, spreads = (list(part) for part in zip(*(slowly(point, data) for point in points), strict=True))
    np.testing.assert_allclose(np.diff(shift_marginal.log_posteriors(points, *about, BOUNDS)), np.diff(logs), atol=1e-5)
    for point, height, spread in zip(points, heights, spreads, strict=True):
        found, covariance = shift_marginal.heights_of(point[None], np.ones(1), *about)
        np.testing.assert_allclose(found[0], height, rtol=1e-6)
        np.testing.assert_allclose(covariance, spread, rtol=1e-4)


def test_points_beyond_the_spline_or_the_range_of_smoothing_are_impossible():
    data = problem(3, 7, 0.02)
    points = np.array([[0.4, 9.0, 5.0, 0.0], [0.4, 0.8, 5.0, 30.0], [-9.0, 0.8, 5.0, 0.0]])
    about = data.x, data.y, data.member, LOW, STEP, SPLINES, 1.0, (USUAL, WIDTH, HEIGHT)
    assert np.all(shift_marginal.log_posteriors(points, *about, BOUNDS) == -np.inf)


def test_density_and_moments_are_those_of_students_t():
    random = np.random.default_rng(2)
    mean, factor = np.array([1.0, -2.0]), np.array([[0.5, 0.0], [0.3, 0.2]])
    normals, squared = random.standard_normal((200_000, 2)), random.chisquare(shift_sampling.TAIL, 200_000)
    points = shift_sampling.placed(mean, factor, normals, squared)
    found, covariance = shift_sampling.moments(points, np.full(200_000, 1 / 200_000))
    np.testing.assert_allclose(found, mean, atol=0.01)
    widened = factor @ factor.T * shift_sampling.TAIL / (shift_sampling.TAIL - 2)
    np.testing.assert_allclose(covariance, widened, rtol=0.05)
    density = np.zeros(200_000)
    shift_sampling.add_density(points, mean, factor, 0.0, density)
    box = np.all(np.abs(points - mean) < 0.1, axis=1)
    grid = np.stack(np.meshgrid(*(c + np.linspace(-0.0995, 0.0995, 200) for c in mean), indexing="ij"), -1)
    inside = np.zeros(40_000)
    shift_sampling.add_density(grid.reshape(-1, 2), mean, factor, 0.0, inside)
    constant = 1 / (2 * np.pi)  # of two dimensions, whatever the degrees of freedom
    assert constant * inside.sum() * 0.001**2 == pytest.approx(box.mean(), rel=0.05)


def test_many_more_points_change_bars_by_little(monkeypatch):
    """500 points of even weight know standard deviations to 3 %."""
    data = replace(problem(6, 20, 0.01), vertical=True)
    shifts = np.concatenate([0.4 * np.arange(1, 6), 0.1 * np.arange(1, 6)])
    few = shift_posterior.sample(data, shifts, Settled(0.01, 1e-4), 0)
    again = shift_posterior.sample(data, shifts, Settled(0.01, 1e-4), 0)
    assert all(np.array_equal(one, other) for one, other in zip(few, again, strict=True))
    monkeypatch.setattr(shift_posterior, "ENOUGH", 5000.0)
    many = shift_posterior.sample(data, shifts, Settled(0.01, 1e-4), 1)
    wide = np.sqrt(np.diag(many[1]))
    np.testing.assert_allclose(np.sqrt(np.diag(few[1])) / wide, 1, atol=0.15)
    assert np.max(np.abs(few[0] - many[0]) / wide) < 0.2
    assert 500 <= few[2] < 5000 <= many[2]


def test_too_few_points_are_told(monkeypatch):
    monkeypatch.setattr(shift_posterior, "MOST_STAGES", 1)
    data = replace(problem(6, 20, 0.01), vertical=True)
    shifts = np.concatenate([0.4 * np.arange(1, 6), 0.1 * np.arange(1, 6)])
    mean, covariance, points = shift_posterior.sample(data, shifts, Settled(0.01, 1e-4), 0)
    assert 1 <= points < 500
    assert np.all(np.isfinite(mean))
    assert np.all(np.diag(covariance) > 0)
