"""Scans of single steps, and what all steps have in common, beside dense algebra and closed forms."""

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.stats import norm

from mdr_dask.physics.superposition import steps
from mdr_dask.physics.superposition.least_squares import Knots, Shifts, extent
from mdr_dask.physics.superposition.problem import Common, ShiftProblem
from mdr_dask.physics.superposition.steps import SETTINGS, Scan, scan, scan_pairs, together

VARIANCE = 1e-4


@pytest.fixture(scope="module")
def problem():
    """Four curves of unequal width, each a part of one, with scatter."""
    random = np.random.default_rng(0)
    pieces = [np.linspace(-1, 1 + 0.2 * k, 9 + k) for k in range(4)]
    return ShiftProblem.of(
        [(x, np.tanh(x + 0.4 * k) + 0.01 * random.standard_normal(x.size)) for k, x in enumerate(pieces)]
    )


def smoothed(points, across, step, weight):
    """Return the matrix of the smoothed curve, its basis, and the number of its second differences."""
    low, splines = extent(points, across, step)
    knots = low + step * np.arange(-3, splines + 1)
    basis = BSpline.design_matrix(points.x + across[points.member], knots, 3, extrapolate=True).toarray()
    second = np.diff(np.eye(splines), 2, axis=0)
    return basis.T @ basis + weight * second.T @ second, basis, splines - 2


def likelihood(points, across, step, weight):
    matrix, basis, _ = smoothed(points, across, step, weight)
    hat = basis @ np.linalg.solve(matrix, basis.T)
    return -0.5 * (points.y @ (points.y - hat @ points.y) / VARIANCE + np.trace(hat))


def smoothing(points, across, grid, usual):
    """Return the likeliest weight within a factor of the usual one."""
    scores = {}
    for weight in grid.weights[(grid.weights > usual / steps.NEAR) & (grid.weights < usual * steps.NEAR)]:
        matrix, basis, bends = smoothed(points, across, grid.step, weight)
        misfit = points.y @ (points.y - basis @ np.linalg.solve(matrix, basis.T @ points.y))
        scores[weight] = np.linalg.slogdet(matrix)[1] - bends * np.log(weight) + misfit / VARIANCE
    return min(scores, key=scores.get)


def test_a_pair_is_scanned_from_end_to_end_of_its_overlap(problem):
    weight = problem.grid.weights[8]
    found = scan_pairs(problem, weight, VARIANCE)
    for k, (places, logs) in enumerate(zip(*found, strict=True)):
        x, other = (problem.points.x[problem.points.member == k + i] for i in (0, 1))
        np.testing.assert_allclose(places, np.linspace(x[0] - other[-1], x[-1] - other[0], SETTINGS.coarse))
        for j in (0, 18, 30):
            expected = likelihood(problem.between(k, k + 1), np.array([0, places[j]]), problem.grid.step, weight)
            assert logs[j] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("usual", [4, 8, 14])
def test_neighbours_are_smoothed_as_is_likeliest_for_them(problem, usual):
    points, across = problem.between(1, 3), np.array([0.0, 0.3, 0.7])
    weights = problem.grid.weights
    grid = Knots(problem.grid.step, weights)
    found = steps._smoothing(points, Shifts(across, np.zeros(3)), grid, weights[usual], VARIANCE)
    assert found == smoothing(points, across, grid, weights[usual])


def test_a_step_is_scanned_while_the_others_follow_it(problem):
    """Likelihood of all curves that overlap, of the other steps about their mean, and of a step beyond the overlap."""
    best, weight, common = np.array([0.4, 0.35, 0.45]), problem.grid.weights[8], Common(0.4, 0.2)
    across = np.concatenate([[0.0], np.cumsum(best)])
    spread = np.array([[4.0, 1.0, 0.5], [1.0, 9.0, -1.0], [0.5, -1.0, 6.0]]) * 1e-4
    pairs = scan_pairs(problem, weight, VARIANCE)
    pairs.logs[1][[2, 30]] = pairs.logs[1].max()  # places far away that are as likely
    found = scan(problem, Shifts(across, np.zeros(4)), spread, (weight, VARIANCE), common, pairs)
    own = smoothing(problem.points, across, problem.grid, weight)
    for k, (places, logs) in enumerate(zip(*found, strict=True)):
        visited = [*(best[k] + np.sqrt(spread[k, k]) * steps.FINE), *pairs.places[k][[2, 30]][: 2 * (k == 1)]]
        assert np.abs(np.subtract.outer(visited, places)).min(axis=1) == pytest.approx(0, abs=1e-12)
        assert np.all(np.diff(places) > 0)
        for place, log in list(zip(places, logs, strict=True))[:: max(len(places) // 5, 1)]:
            moved = best + (place - best[k]) * spread[:, k] / spread[k, k]
            expected = likelihood(problem.points, np.append(0.0, np.cumsum(moved)), problem.grid.step, own)
            expected -= sum((moved[i] - common.mean) ** 2 for i in range(3) if i != k) / (2 * common.scatter**2)
            low, high = problem.windows[k]
            beyond = max(place - high, low - place, 0.0) / (SETTINGS.beyond[0] * problem.width)
            assert log == pytest.approx(expected - min(beyond**2 / 2, SETTINGS.beyond[1]), rel=1e-6)


def test_steps_in_common_are_sums_over_mean_and_scatter(problem):
    """Normal likelihoods, one wide: on a grid of means and scatters, each step is known in closed form."""
    centre, width = np.array([0.30, 0.45, 0.60]), np.array([0.02, 0.03, 0.6])
    places = [np.linspace(m - 6 * s, m + 6 * s, 2001) for m, s in zip(centre, width, strict=True)]
    logs = [norm.logpdf(x, m, s) for x, m, s in zip(places, centre, width, strict=True)]
    found = together(Scan(places, logs), problem)
    told = normal(problem, centre, width, np.ones(3))[3]
    mean, own, shared, told, common = normal(problem, centre, width, SETTINGS.noisy + (1 - SETTINGS.noisy) * told)
    np.testing.assert_allclose(found.mean, mean, rtol=2e-3)
    np.testing.assert_allclose(found.own, own, rtol=2e-3)
    np.testing.assert_allclose(found.shared, shared, rtol=5e-3, atol=1e-5)
    np.testing.assert_allclose(found.told, told, rtol=2e-3, atol=1e-3)
    assert found.common == pytest.approx(common, rel=2e-3)


def normal(problem, centre, width, powers):
    """Return mean, variance, shared covariance, what is told and what is common of steps of normal likelihoods."""
    margin = SETTINGS.margin * problem.width
    means = np.linspace(centre.min() - margin, centre.max() + margin, SETTINGS.means)[:, None]
    scatters = problem.width * np.geomspace(*SETTINGS.scatters)[None]
    evidence, mean, own = np.log(scatters) + 0 * means, [], []
    for m, s, power, (low, high) in zip(centre, width, powers, problem.windows, strict=True):
        v = s**2 / power
        within = norm.cdf(high, means, scatters) - norm.cdf(low, means, scatters)
        evidence = evidence + norm.logpdf(m, means, np.sqrt(scatters**2 + v)) - np.log(np.maximum(within, 5e-13))
        mean.append((m * scatters**2 + means * v) / (scatters**2 + v))
        own.append(scatters**2 * v / (scatters**2 + v) + 0 * means)
    share = np.exp(evidence - evidence.max())
    share /= share.sum()
    common = Common(np.sum(share * means), np.exp(np.sum(share * np.log(scatters))))
    average, variance = (np.array([np.sum(share * each) for each in found]) for found in (mean, own))
    apart = np.array(mean) - average[:, None, None]
    shared = np.einsum("iab,jab,ab->ij", apart, apart, share)
    return average, variance, shared, np.clip(1 - variance / common.scatter**2, 0, 1), common


@pytest.mark.parametrize("size", [4, 5, 12])
def test_the_trace_of_the_roughness_is_that_of_dense_algebra(size):
    random = np.random.default_rng(size)
    lower = np.tril(np.triu(random.uniform(-0.5, 0.5, (size, size)), -3)) + np.eye(size)
    band = np.array([[lower[i, i - k] if k <= i else np.nan for k in range(4)] for i in range(size)])
    bend = np.diff(np.eye(size), n=2, axis=0)
    found = steps._roughness_trace(band, np.full((size, 4), np.nan))
    assert found == pytest.approx(np.trace(bend.T @ bend @ np.linalg.inv(lower @ lower.T)), rel=1e-9)
