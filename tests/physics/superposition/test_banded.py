"""Banded factors of the linear part beside dense matrices: density, gradient, mean, and the covariance of draws."""

import numpy as np
import pytest
from scipy.special import softmax

from mdr_dask.physics.superposition.banded import drawn
from mdr_dask.physics.superposition.posterior import CELLS, REACH, ROUNDING, Curves, _basis, solve

CASES = [(1, None, False), (2, None, False), (1, (0.03, 1.5), True), (2, (0.01, 0.7), False)]


def random_curves(channels, offset, drifting, seed=1):
    random, count = np.random.default_rng(seed), 5
    member = np.repeat(np.arange(count), random.integers(3, 12, count))
    x = np.sort(member + random.uniform(0, 1, member.size)) - 0.4 * member
    y = np.cumsum(0.1 * random.standard_normal((channels, member.size)), axis=1)
    curves = Curves(x, y, member, count, np.ones(channels), 40, offset, drifting)
    return curves, curves.prior[0] + 0.3 * random.standard_normal((6, curves.prior[0].size))


def dense(curves, row):
    """Return energy, gradient, mean and covariance of one row of parameters by dense matrices."""
    count, splines, (channels, points) = curves.count, curves.splines, curves.y.shape
    lines, offsets = count - 1, 0 if curves.offset is None else count
    shifts, near = np.append(0, row[:lines]), row[lines : lines + channels * count].reshape(channels, count)
    noise = np.exp(row[lines + channels * count :][:channels])
    weight, moved = np.repeat(1 / (noise**2 + ROUNDING**2), points), curves.x + shifts[curves.member]
    low, second = curves.begin(moved[None])[0], np.diff(np.eye(splines), 2, axis=0)
    first, *parts = _basis((moved - low) * CELLS, splines)
    value, slope = (np.sum(np.eye(splines)[first[:, None] + np.arange(4)] * part[..., None], axis=1) for part in parts)
    tie, tied = -np.eye(count)[curves.member, :offsets], (curves.tied * np.exp(-2 * row[-1]))[:offsets, :offsets]
    design = np.hstack([np.kron(np.eye(channels), value), np.tile(tie, (channels, 1))])
    turned = np.hstack([np.kron(np.eye(channels), slope), np.zeros((channels * points, offsets))])
    apart = (low + np.arange(splines - 2) / CELLS)[:, None] - curves.centre - shifts
    share = softmax(-0.5 * (apart / REACH) ** 2, axis=1)
    bend = (near @ share.T).ravel()
    bending = np.hstack([np.kron(np.eye(channels), second), np.zeros((bend.size, offsets))])
    precision = design.T * weight @ design + bending.T * np.exp(-2 * bend) @ bending
    precision[channels * splines :, channels * splines :] += tied
    covariance, y = np.linalg.inv(precision), curves.y.ravel()
    mean = np.linalg.solve(precision, design.T @ (weight * y))
    left, both = y - design @ mean, covariance + np.outer(mean, mean)
    away = row - curves.prior[0]
    energy = 0.5 * (np.linalg.slogdet(precision)[1] + weight @ (left * y) - np.sum(np.log(weight)))
    energy += bend.sum() + (offsets * row[-1] if offsets else 0) + 0.5 * away @ curves.prior[1] @ away
    by_bend = 1 - np.sum(bending @ both * bending, axis=1) * np.exp(-2 * bend)
    change = np.tile(share * apart / REACH**2, (channels, 1)) * (np.repeat(near, splines - 2, 0) - bend[:, None])
    turn = weight * (np.sum(turned @ covariance * design, axis=1) - left * (turned @ mean)) * CELLS
    by_shift = np.tile(np.eye(count)[curves.member], (channels, 1)).T @ turn + by_bend @ change
    squares = left**2 + np.sum(design @ covariance * design, axis=1)
    by_noise = ((1 - weight * squares) * weight).reshape(channels, -1).sum(axis=1) * noise**2
    by_tie = [offsets - np.sum(both[channels * splines :, channels * splines :] * tied)] if offsets else []
    parts = (by_shift[1:], (by_bend.reshape(channels, -1) @ share).ravel(), by_noise, by_tie)
    return energy, np.concatenate(parts) + curves.prior[1] @ away, mean, covariance


@pytest.mark.parametrize(("channels", "offset", "drifting"), CASES)
def test_density_gradient_and_mean_are_those_of_dense_matrices(channels, offset, drifting):
    """To 1e-9 of the largest entry: the condition number of these precisions, some 1e6, times rounding."""
    curves, rows = random_curves(channels, offset, drifting)
    found = solve(curves, rows)
    for r, row in enumerate(rows):
        for ours, reference in zip(
            (found.energy[r], found.gradient[r], found.mean[r]), dense(curves, row), strict=False
        ):
            np.testing.assert_allclose(ours, reference, rtol=0, atol=1e-9 * np.abs(reference).max())


@pytest.mark.parametrize(("channels", "offset", "drifting"), CASES)
def test_draws_have_the_covariance_of_dense_matrices(channels, offset, drifting):
    """The draw of each unit vector is a column of a square root of the covariance."""
    curves, rows = random_curves(channels, offset, drifting)
    covariance = dense(curves, rows[0])[3]
    size = len(covariance)
    factors = solve(curves, np.tile(rows[0], (size, 1))).factors
    root = drawn(factors, np.eye(size))
    np.testing.assert_allclose(root.T @ root, covariance, rtol=0, atol=1e-9 * np.abs(covariance).max())
