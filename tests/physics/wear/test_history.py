import numpy as np
import pytest

from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.mdr.uniform_grid import uniform_grid
from mdr_dask.physics.wear.exact import exact
from mdr_dask.physics.wear.history import LoadBlock, history

PARABOLA = PowerProfile(2.0)
RADII = np.linspace(0.0, 1.5, 201)
ETA = 1 - 0.455**2


def test_orders_of_the_uniform_grid():
    errors = []
    for cells in (100, 200, 400):
        grid = uniform_grid(cells, 1.6)
        x = grid.nodes
        hertz = 2 / np.pi * np.sqrt(np.maximum(1 - x**2, 0))
        smooth = x < 0.9
        errors.append(
            [
                np.max(np.abs(grid.inverse @ x**2 - x**2 / 2)),
                np.max(np.abs(grid.forward @ (x**2 / 2) - x**2)),
                np.max(np.abs(grid.pressure(x**2, 1.0) - hertz)[smooth]),
                abs(grid.force(x**2, 1.0) - 4 / 3),
            ]
        )
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(orders[:, 0] > 1.9)
    assert np.all(orders[:, 1] > 1.4)
    assert np.all(orders[:, 3] > 1.9)
    assert errors[-1][2] < 1e-3
    inside = np.abs(grid.pressure(x**2, 1.003) - 2 / np.pi * np.sqrt(np.maximum(1.003 - x**2, 0)))
    assert np.max(inside[x > 0.9]) < 1e-4  # an edge within a cell: 0.01 if it stood at the next node
    narrow = uniform_grid(4, 4.0).pressure(np.array([0.0, 1.0, 2.0, 3.0, 4.0]), 0.5)  # the edge is at x = 0.5
    np.testing.assert_allclose(narrow[0], 2 / np.pi)


def test_one_block_at_constant_depth_is_fretting():
    fretted = exact(PARABOLA, 0.455, [2.0], accuracy=1e-4)[0]
    whole = history(PARABOLA, [LoadBlock(2.0, ETA, depth=1.0)], cells=200, reach=1.5)[0]
    halves = history(PARABOLA, [LoadBlock(1.0, ETA, depth=1.0)] * 2, cells=200, reach=1.5)[1]
    assert np.max(np.abs(whole.height(RADII) - fretted.height(RADII))) < 5e-3
    np.testing.assert_allclose(halves.height(RADII), whole.height(RADII), atol=1e-5)  # the same steps but one
    assert whole.stick_border == pytest.approx(0.455, abs=0.01)
    assert whole.wear_volume == pytest.approx(fretted.wear_volume, rel=0.01)


def test_sliding_is_gross_slip():
    reference = exact(PARABOLA, 0.0, [2.0], accuracy=1e-3)[0]
    record = history(PARABOLA, [LoadBlock(2.0, np.inf, depth=1.0)], reach=1.6)[0]
    assert record.wear_volume == pytest.approx(reference.wear_volume, rel=2e-3)
    assert record.contact_radius == pytest.approx(reference.contact_radius, abs=0.01)
    assert record.stick_border == 0.0


def test_oscillating_gross_slip_wears_less_than_sliding_and_more_than_partial_slip():
    volumes = [
        history(PARABOLA, [LoadBlock(2.0, eta, depth=1.0)], cells=100, reach=1.6)[0].wear_volume
        for eta in (0.5, 1.5, 10.0, np.inf)
    ]
    assert volumes == sorted(volumes)


def test_constant_force_keeps_the_force_and_lets_stick_advance():
    blocks = [LoadBlock(1.0, ETA, force=4 / 3), LoadBlock(3.0, ETA, force=4 / 3)]
    first, second = history(PARABOLA, blocks, cells=100, reach=2.0)
    assert first.normal_force == pytest.approx(4 / 3, rel=1e-9)
    assert 1.0 < first.depth < second.depth
    assert 0.455 < first.stick_border < second.stick_border


def test_smaller_amplitude_after_a_larger_one_leaves_the_old_border_alone():
    first, second = history(
        PARABOLA, [LoadBlock(3.0, 0.8, depth=1.0), LoadBlock(3.0, 0.2, depth=1.0)], cells=100, reach=1.6
    )
    assert second.stick_border > first.stick_border
    stuck = RADII[first.stick_border - 0.02 > RADII]
    np.testing.assert_array_equal(first.height(stuck), second.height(stuck))


def test_contact_beyond_the_grid():
    with pytest.raises(ValueError, match=r"beyond the last radius of the grid, 1.2 a0: give fewer cycles, or `path`"):
        history(PARABOLA, [LoadBlock(1.0, 0.5, depth=2.0)], cells=40, reach=1.2)
