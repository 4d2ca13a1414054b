"""What is written of a line at its nodes, against the cubic cells themselves."""

import numpy as np

from mdr_dask.physics.sliding.node_to_node import (
    BEFORE,
    BLOCK,
    HEIGHTS,
    LOWEST,
    PEAK,
    SQUARES,
    STEEPEST,
    _peaks,
    ends_of,
    nodes,
)
from mdr_dask.physics.surfaces import roughness


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


def test_a_block_tells_the_bounds_and_sums_of_its_cells():
    """From samples of a line of resolved waves, a thousand a block: what sweeps pass without a look at its nodes."""
    amplitude, phase = roughness.amplitudes(40, 0.7), roughness.phases(3, 0, 40)
    height, slope = (roughness.line(amplitude, phase, 640, order) for order in (0, 1))
    line = nodes(height, slope, 5, 1, True, ends_of(height, slope))
    fine, steep = (np.roll(roughness.line(amplitude, phase, 640 * 32, order), -5 * 32) for order in (0, 1))
    fine, steep = (each.reshape(-1, BLOCK * 32) for each in (fine - fine[0], steep))
    scale = np.ptp(fine)
    assert np.all(line.blocks[:, PEAK] >= fine.max(axis=1))
    assert np.all(line.blocks[:, PEAK] <= fine.max(axis=1) + 0.05 * scale)
    own = slice(BEFORE, BEFORE + 640)
    np.testing.assert_array_equal(
        line.blocks[:-1, LOWEST], [line.height[own][first : first + BLOCK + 1].min() for first in range(0, 608, BLOCK)]
    )
    np.testing.assert_array_equal(
        line.blocks[:-1, STEEPEST], [line.slope[own][first : first + BLOCK + 1].min() for first in range(0, 608, BLOCK)]
    )
    np.testing.assert_allclose(line.blocks[:, HEIGHTS] / BLOCK, fine.mean(axis=1), atol=1e-3 * scale)
    squares = (steep**2).mean(axis=1) / 640**2
    np.testing.assert_allclose(line.blocks[:, SQUARES] / BLOCK, squares, rtol=0.02)
