"""The contact patches of a sweep have the length and displacement that the sweep returns."""

import numpy as np
import pytest

from mdr_dask.physics.sliding.kelvin import DISPLACEMENT, LENGTH, SUMS, barriers_for, blocks_of, patches_at
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import cut, periodic_line

POINTS, FINE = 100, 400


def cells(hurst, nodes):
    amplitude, phase = roughness.amplitudes(POINTS // 2, hurst), roughness.phases(4, 0, POINTS // 2)
    return cut(periodic_line(*(roughness.line(amplitude, phase, nodes, order) for order in (0, 1))))


@pytest.mark.parametrize(("depth", "deborah"), [(0.05, 300.0), (1.0, 0.05), (3.0, 3.0), (20.0, 3.0)])
def test_patches_are_the_contact_of_the_sums(depth, deborah):
    line, sums = cells(0.4, 8 * POINTS), np.empty(SUMS)
    touches, leaves = patches_at(line, blocks_of(line), barriers_for(line.mean.size - 1), deborah, depth, sums)
    assert np.all(touches <= leaves)
    assert np.all(leaves[:-1] < touches[1:])
    assert np.sum(leaves - touches) == pytest.approx(sums[LENGTH], rel=1e-9)
    # displacements between the patches fade from their ends, and meet the line where the next one begins
    top, n = line.start, line.mean.size - 1
    x = top + np.arange(n * FINE) / FINE
    k = np.searchsorted(touches, x, side="right") - 1
    inside, place = x <= leaves[k], np.minimum(x.astype(int), n)
    w = depth + height(line, x, place)
    pressed = depth + height(line, leaves, np.minimum(leaves.astype(int), n))
    u = np.where(inside, w, pressed[k] * np.exp(-np.maximum(x - leaves[k], 0) / deborah))
    assert u.mean() * n == pytest.approx(sums[DISPLACEMENT], rel=2e-4)
    assert np.all(w <= u + 1e-6)
    first = touches[1:]
    free = pressed[:-1] * np.exp(-(first - leaves[:-1]) / deborah)
    touched = depth + height(line, first, np.minimum(first.astype(int), n))
    assert np.allclose(free, touched, rtol=0, atol=1e-8)


def height(line, x, i):
    """Return the height of cubic cells."""
    y, rise = x - i, line.height[i + 1] - line.height[i]
    a, b = line.enter[i], line.leave[i]
    return line.height[i] + y * (a + y * (3 * rise - 2 * a - b + y * (a + b - 2 * rise)))
