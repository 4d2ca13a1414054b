"""The pressure of worn contacts, of every rule and condition, carries what the contact carries."""

import numpy as np
import pytest

from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear.exact import exact
from mdr_dask.physics.wear.rules import fast, limit


def places(contact, edge):
    """Return radii that crowd at the border of stick and at an edge, and the weights of their integral."""
    abscissa, weight = gauss(8)
    inner, outer = contact.stick_border, edge - contact.stick_border
    parts = 0.25 ** np.arange(1, 12)
    cuts = [0.0, *(inner * (1 - parts)), inner, *(inner + outer * parts), *(inner + outer * (1 - parts)), edge]
    widths = np.diff(np.unique(cuts))[:, None]
    return (np.unique(cuts)[:-1, None] + widths * abscissa).ravel(), (widths * weight).ravel()


def pressed(contact, edge):
    radius, weights = places(contact, edge)
    return 2 * np.pi * (weights * radius) @ contact.pressure(radius)


CONTACTS = {
    "limit": limit,
    "fast": lambda body, c: fast(body, c, 4.0),
    "exact": lambda body, c: exact(body, c, [4.0])[0],
    "exact, late": lambda body, c: exact(body, c, [200.0])[0],
    "exact under force": lambda body, c: exact(body, c, [4.0], 3e-4, constant_force=True)[0],
    "limit under force": lambda body, c: exact(body, c, [np.inf], constant_force=True)[0],
    "gross slip": lambda body, c: exact(body, 0.0, [2.0])[0],
    "gross slip under force": lambda body, c: exact(body, 0.0, [2.0], constant_force=True)[0],
}


@pytest.mark.parametrize(("exponent", "c"), [(1.0, 0.2), (2.0, 0.455), (6.0, 0.8)])
@pytest.mark.parametrize("name", CONTACTS)
def test_pressure_is_the_normal_force(name, exponent, c):
    contact = CONTACTS[name](PowerProfile(exponent), c)
    assert pressed(contact, contact.contact_radius) == pytest.approx(contact.normal_force, rel=1e-3)


@pytest.mark.parametrize("exponent", [1.05, 1.3, 1.7, 3.0])
def test_pressure_at_the_axis_is_finite_unless_the_body_has_a_sharp_tip(exponent):
    unworn = fast(PowerProfile(exponent), 0.3, 1e-9)
    expected = exponent / (np.pi * (exponent - 1))  # int_0^1 g0'(x) / x dx / pi
    assert unworn.pressure(np.array([0.0]))[0] == pytest.approx(expected, rel=1e-4)
    assert np.isinf(fast(PowerProfile(1.0), 0.3, 1e-9).pressure(np.array([0.0]))[0])
