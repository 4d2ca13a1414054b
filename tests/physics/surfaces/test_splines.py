"""Splines of closed lines: closed forms, orthogonality, order of convergence, zeros of polynomials."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from mdr_dask.physics.surfaces import splines
from mdr_dask.physics.surfaces.waves import series


def waves(number, seed=0):
    generator = np.random.default_rng(seed)
    return generator.standard_normal(number) + 1j * generator.standard_normal(number)


def on(spline, places):
    """Heights of a spline at places between its nodes, 0..1, for all nodes; shape (nodes, places)."""
    padded = np.concatenate([spline[-1:], spline, spline[:2]])
    return np.array([[splines.value(splines.piece(padded, k), t) for t in places] for k in range(spline.size)])


def test_the_spline_through_heights_is_scipy_s():
    heights = np.random.default_rng(1).standard_normal(12)
    found = splines.through_heights(heights)
    places = np.linspace(0, 1, 5)
    reference = CubicSpline(np.arange(13), np.append(heights, heights[0]), bc_type="periodic")
    np.testing.assert_allclose(on(found, places), reference(np.arange(12)[:, None] + places), atol=1e-12)
    np.testing.assert_allclose(splines.heights(found), heights, atol=1e-12)


def test_the_closest_spline_leaves_a_rest_that_no_spline_shares():
    """The rest is orthogonal to the B-spline of each node, so that any other spline is farther away."""
    line, nodes, fine = waves(5), 12, 64
    places = (np.arange(fine) + 0.5) / fine
    truth = series(line * np.exp(1j * np.pi * np.arange(1, 6) / (nodes * fine)), nodes * fine).reshape(nodes, fine)
    rest = on(splines.closest(line, nodes), places) - truth
    basis = [on(np.eye(nodes)[k], places) for k in range(nodes)]
    shares = [np.mean(rest * each) for each in basis]
    assert np.max(np.abs(shares)) < 1e-5 * np.sqrt(np.mean(rest**2))
    through = on(splines.through_heights(series(line, nodes)), places) - truth
    assert np.mean(rest**2) < 0.8 * np.mean(through**2)


@pytest.mark.parametrize("spline", [splines.closest, lambda line, nodes: splines.through_heights(series(line, nodes))])
def test_splines_err_at_fourth_order(spline):
    line, places, errors = waves(3), np.array([0.25, 0.5]), []
    for nodes in (24, 48, 96):
        truth = np.stack([series(line * np.exp(2j * np.pi * np.arange(1, 4) * t / nodes), nodes) for t in places], 1)
        errors.append(np.sqrt(np.mean((on(spline(line, nodes), places) - truth) ** 2)))
    assert 13 < errors[0] / errors[1] < 20
    assert 15 < errors[1] / errors[2] < 17


def test_integrals_of_pieces_are_those_of_gauss():
    coefficients, t = np.array([0.3, -1.2, 2.0, 0.7]), 0.37
    of = splines.piece(coefficients, 0)
    nodes, weights = np.polynomial.legendre.leggauss(3)
    expected = t / 2 * sum(w * splines.value(of, t * (1 + x) / 2) for x, w in zip(nodes, weights, strict=True))
    assert splines.integral(of, t) == pytest.approx(expected, rel=1e-13)
    assert np.dot(splines.shares(t), coefficients) == pytest.approx(expected, rel=1e-13)
    assert np.dot(splines.shares(1.0), coefficients) * 24 == pytest.approx(np.dot([1, 11, 11, 1], coefficients))


def test_zeros_of_pieces_are_the_roots_where_they_change_sign():
    """2000 random pieces, of which some have three zeros; numpy's roots of the same polynomials."""
    generator, numbers = np.random.default_rng(2), set()
    for _ in range(2000):
        coefficients = generator.standard_normal(4) * [1, 0.3, 0.3, 1]
        found = np.empty(5)
        count = splines.zeros(coefficients, 0, found, 2)
        roots = np.roots(splines.piece(coefficients, 0)[::-1])
        real = np.sort(roots[np.abs(roots.imag) < 1e-9].real)
        real = real[(real > 0) & (real <= 1)]
        np.testing.assert_allclose(found[2:count], real, atol=1e-9)
        numbers.add(count - 2)
    assert numbers == {0, 1, 2, 3}


def test_pieces_that_touch_zero_have_no_zero_or_two_and_flat_ones_none():
    found = np.empty(3)
    assert splines.zeros(np.zeros(4), 0, found, 0) == 0
    assert splines.zeros(np.ones(4), 0, found, 0) == 0
    for tip in (-1e-3, 1e-3):  # a parabola whose tip lies in the middle of the piece
        x = np.arange(4) - 1.5
        coefficients = tip - (x**2 - 1 / 3) / 2  # of tip - x^2/2
        count = splines.zeros(coefficients, 0, found, 0)
        assert count == (2 if tip > 0 else 0)
        if count:
            np.testing.assert_allclose(found[:2], 0.5 + np.array([-1, 1]) * np.sqrt(2 * tip), atol=1e-12)
