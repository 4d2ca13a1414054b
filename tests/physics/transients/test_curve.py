"""Curves through the moments of a march."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from mdr_dask.physics.transients.curve import curve_through


def through(x, y, slope, places):
    found = np.empty(places.size)
    curve_through(x, y, slope, places, found)
    return found


@pytest.mark.parametrize("points", [2, 3, 30])
def test_slopes_are_followed_where_they_are_no_kinks(points):
    x = np.cumsum(np.random.default_rng(points).uniform(0.1, 0.5, points))
    places = np.linspace(x[0], x[-1], 40)
    expected = CubicHermiteSpline(x, np.exp(x), np.exp(x))(places)
    assert np.allclose(through(x, np.exp(x), np.exp(x), places), expected, rtol=1e-13, atol=0)


def test_an_unknown_first_slope_makes_a_parabola():
    x, places = np.array([1.0, 2.0, 4.0]), np.array([1.0, 1.25, 1.5, 2.0])
    assert np.allclose(through(x, x**2, np.array([np.nan, 4.0, 8.0]), places), places**2, rtol=1e-14, atol=0)


@pytest.mark.parametrize("kink", [1e6, -1e6])
def test_no_kink_leads_beyond_neighbours(kink):
    x, y = np.arange(5.0), np.array([0.0, 1.0, 3.0, 3.5, 3.6])
    curve = through(x, y, np.array([1.0, 1.5, kink, 0.3, 0.1]), np.linspace(2, 3, 50))
    rise = 3 * min(2.0, 0.5)  # the steepest slope allowed
    assert np.all(np.abs(curve - 3) <= 0.5 + 4 / 27 * rise)
    assert np.allclose(through(x, y, np.full(5, kink), x), y, rtol=0, atol=1e-14)
    assert np.all(np.diff(through(np.arange(3.0), np.array([0.0, 0.0, 1.0]), np.zeros(3), np.linspace(0, 2, 50))) >= 0)
