"""What is written of a line at its nodes, against the cubic cells themselves."""

import numpy as np

from mdr_dask.physics.sliding.nodes import _peaks


def test_the_highest_point_of_a_cell_is_that_of_its_cubic():
    """Steep and level slopes, hills, valleys and inflections, among them cubics that rise without a top."""
    height, slope = np.random.default_rng(7).normal(size=(2, 400)) * [[1.0], [4.0]]
    slope[::5] = 0.0
    height[10:20] = np.arange(10.0)
    slope[10:20] = 1.0  # straight
    peak = np.empty(height.size - 1)
    _peaks(*(np.append(0.0, each) for each in (height, slope)), peak.size, peak)
    x = np.linspace(0.0, 1.0, 2001)[:, None]
    rise = np.diff(height)
    bend, twist = 3 * rise - 2 * slope[:-1] - slope[1:], slope[:-1] + slope[1:] - 2 * rise
    cubic = height[:-1] + x * (slope[:-1] + x * (bend + x * twist))
    assert np.all(peak >= cubic.max(axis=0) - 1e-12)
    assert np.allclose(peak, cubic.max(axis=0), atol=1e-5)
