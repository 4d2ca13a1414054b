"""Laws of friction: limits and interpolation."""

import numpy as np
import pytest

from mdr_dask.physics.sliding import laws


def test_interpolation_has_the_limits_it_joins():
    force, velocity = np.array([1e-8, 1e8]), np.array([1e-9, 1e-3])
    low = np.sqrt(2) * laws.interpolation(force, velocity, 0.4, 1.6)
    expected = [np.sqrt(2) * 1.6 * velocity[0] * force[0] ** -0.4, laws.full_contact(force[1], velocity[1])]
    # the two terms of eq. 3.18 differ by 1e5: either limit is alone to that
    assert low == pytest.approx(expected, rel=1e-4)
    assert laws.interpolation(1.0, 1e6, 0.4, 1.6) == pytest.approx(1)


def test_full_contact_is_the_viscous_law():
    G, h, L, tau, v, slope, F = 1e7, 1e-6, 0.02, 1e-3, 0.3, 0.05, 50.0
    mu = slope * laws.full_contact(laws.force_number(F, G, h, L), laws.velocity_number(v, tau, slope, h))
    assert mu == pytest.approx(4 * G * tau * v * L * slope**2 / F)


def test_indenter_law_has_both_limits():
    assert laws.indenter(1e-6) == pytest.approx(1e-6)
    assert laws.indenter(1e6) == pytest.approx(1)
    assert laws.indenter(1.0, 1.5) == pytest.approx(2 ** (-1 / 1.5))
