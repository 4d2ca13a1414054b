"""The probability density of shifts: its gradient, and the density itself beside a dense normal distribution."""

import numpy as np
import pytest

from mdr_dask.physics.superposition.posterior import CELLS, REACH, Curves, _basis, solve


def problem(channels, offset, drifting=False):
    random, count, points = np.random.default_rng(0), 4, 9
    x, member = np.tile(np.linspace(0, 1, points), count), np.repeat(np.arange(count), points)
    shifts = np.array([0.0, 0.5, 1.1, 1.5])
    shapes = np.array([np.tanh(x + shifts[member] - 1), -0.2 * (x + shifts[member] - 1) ** 2])[:channels]
    y = shapes + 0.01 * random.standard_normal(shapes.shape)
    curves = Curves(x, y, member, count, np.ones(channels), 36, offset, drifting)
    row = curves.prior[0] + 0.1 * random.standard_normal(curves.prior[0].size)
    row[: count - 1] += shifts[1:]
    return curves, row


@pytest.mark.parametrize(
    ("channels", "offset", "drifting"), [(1, None, False), (2, (0.01, 0.7), False), (1, (0.03, 1.5), True)]
)
def test_the_gradient_is_that_of_the_energy(channels, offset, drifting):
    curves, row = problem(channels, offset, drifting)
    step = 1e-5 * np.eye(row.size)
    differences = (solve(curves, row + step).energy - solve(curves, row - step).energy) / 2e-5
    gradient = solve(curves, row[None]).gradient[0]
    # the last curve reaches the end of the grid, which moves with it; the gradient leaves this out
    inside = np.arange(row.size) != curves.count - 2
    np.testing.assert_allclose(gradient[inside], differences[inside], rtol=1e-3, atol=5e-3)


def test_the_density_is_that_of_a_normal_distribution_of_all_ordinates():
    """A dense covariance of the ordinates; a small precision of the straight lines that smoothness leaves free."""
    curves, row = problem(2, (0.01, 0.7))
    rows = np.array([row, row])
    rows[1, : curves.count - 1] += [0.02, -0.05, 0.01]
    energies = []
    for each in rows:
        moved = curves.x + np.append(0.0, each[: curves.count - 1])[curves.member]
        low = curves.begin(moved[None])
        first, value, _ = _basis((moved - low) * CELLS, curves.splines)
        basis = np.zeros((moved.size, curves.splines))
        np.put_along_axis(basis, first[:, None] + np.arange(4), value, 1)
        second = np.diff(np.eye(curves.splines), 2, axis=0)
        centres = curves.centre + np.append(0.0, each[: curves.count - 1])
        bend = each[curves.count - 1 : -3].reshape(2, -1)
        offsets = np.eye(curves.count)[curves.member] * np.exp(each[-1])
        total = np.kron(np.ones((2, 2)), offsets @ offsets.T)
        for c in range(2):
            share = np.exp(-0.5 * ((low + np.arange(curves.splines - 2)[:, None] / CELLS - centres) / REACH) ** 2)
            log_bend = share @ bend[c] / share.sum(axis=1)
            smooth = second.T @ (second * np.exp(-2 * log_bend)[:, None]) + 1e-9 * np.eye(curves.splines)
            own = basis @ np.linalg.inv(smooth) @ basis.T
            noise = np.exp(2 * each[-3 + c]) + 1e-10
            part = slice(c * moved.size, (c + 1) * moved.size)
            total[part, part] += own + noise * np.eye(moved.size)
        y = curves.y.ravel()
        away = each - curves.prior[0]
        likelihood = 0.5 * np.linalg.slogdet(total)[1] + 0.5 * y @ np.linalg.solve(total, y)
        energies.append(likelihood + 0.5 * away @ curves.prior[1] @ away)
    found = solve(curves, rows).energy
    assert found[1] - found[0] == pytest.approx(energies[1] - energies[0], rel=1e-3)
