"""Steady states before and after a jump equal sweeps at their depths and do not depend on other cases."""

import numpy as np
import pytest

from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients.limits import PreparedLine, steady_limits


def rough(points=200, hurst=0.5, oversampling=4):
    amplitude, phase = roughness.amplitudes(points // 2, hurst), roughness.phases(11, 0, points // 2)
    nodes = points * oversampling
    return PreparedLine.of(periodic_line(*(roughness.line(amplitude, phase, nodes, order) for order in (0, 1))))


def test_limits_of_a_case_do_not_depend_on_other_cases_nor_on_guesses():
    line, random = rough(), np.random.default_rng(3)
    loads, deborah = np.exp(random.uniform(-5, 1.5, 40)), np.exp(random.uniform(-9, 0, (40, 2)))
    together = steady_limits(line, loads, deborah)
    for k in range(0, loads.size, 4):
        (alone,) = steady_limits(line, loads[k : k + 1], deborah[k : k + 1])
        guesses = alone.depth[None] * random.uniform(0.7, 1.4, (1, 2))
        (guessed,) = steady_limits(line, loads[k : k + 1], deborah[k : k + 1], guesses)
        for other in (alone, guessed):
            assert together[k][:5] == other[:5]
            np.testing.assert_array_equal(together[k].depth, other.depth)
            np.testing.assert_array_equal(together[k].first.start, other.first.start)


@pytest.mark.parametrize("change", [-0.5, 0.5])
def test_full_contact_is_exact(change):
    """The drag is D times the mean square of the slope, and changes with the velocity at once (eq. 3.14)."""
    line, deborah = rough(), np.array([[0.1, 0.1 * (1 + change)]])
    (found,) = steady_limits(line, np.array([100.0]), deborah)
    assert found.is_full
    assert found.at == pytest.approx(found.after, rel=1e-12)
    assert found.after / found.before == pytest.approx(1 + change, rel=1e-12)
