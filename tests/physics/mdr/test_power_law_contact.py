"""Contact of power-law bodies: Hertz, cone, and identities of any exponent."""

import numpy as np
import pytest

from mdr_dask.physics.mdr import power_law_contact as contact


def test_hertz():
    R, E, a = 3e-3, 2e9, 1e-4
    A = 1 / (2 * R)
    d = contact.depth(a, A, 2.0)
    assert d == pytest.approx(a**2 / R, rel=1e-12)
    assert contact.normal_force(a, A, 2.0, E) == pytest.approx(4 / 3 * E * np.sqrt(R) * d**1.5, rel=1e-12)


def test_cone():
    slope, E, a = 0.2, 1e9, 2e-3
    d = contact.depth(a, slope, 1.0)
    assert d == pytest.approx(np.pi / 2 * slope * a, rel=1e-12)
    assert contact.normal_force(a, slope, 1.0, E) == pytest.approx(np.pi / 2 * a**2 * E * slope, rel=1e-12)


@pytest.mark.parametrize("exponent", [0.5, 1.0, 3.7])
def test_identities_of_every_power(exponent):
    a = contact.contact_radius(0.3, 1.7, exponent)
    assert contact.depth(a, 1.7, exponent) == pytest.approx(0.3, rel=1e-12)
    force = contact.normal_force(a, 1.7, exponent, 5.0)
    assert contact.radius_from_force(force, 1.7, exponent, 5.0) == pytest.approx(a, rel=1e-12)
    h = 1e-6
    radius = contact.contact_radius(np.array([0.3 - h, 0.3 + h]), 1.7, exponent)
    slope = np.diff(contact.normal_force(radius, 1.7, exponent, 5.0))[0] / (2 * h)
    assert slope == pytest.approx(2 * 5.0 * a, rel=1e-6)  # the stiffness 2 E* a, by a central difference
