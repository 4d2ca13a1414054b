"""Curves through the moments of a march are those of scipy."""

import numpy as np
import pytest
from scipy.interpolate import Akima1DInterpolator

from mdr_dask.physics.transients.makima import curve_through


@pytest.mark.parametrize("points", [2, 3, 4, 5, 30])
@pytest.mark.parametrize("shape", ["random", "step", "flat"])
def test_curves_are_those_of_scipy(points, shape):
    random = np.random.default_rng(points)
    x = np.cumsum(random.uniform(0.01, 1.0, points))
    y = {"random": random.standard_normal(points), "step": (x > x[0]) * 1.0, "flat": np.full(points, 2.0)}[shape]
    places, found = np.append(np.sort(random.uniform(x[0], x[-1], 40)), x[-1]), np.empty(41)
    curve_through(x, y, places, found)
    assert np.allclose(found, Akima1DInterpolator(x, y, method="makima")(places), rtol=0, atol=1e-13)
