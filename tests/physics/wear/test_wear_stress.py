"""Fretting wear over the whole range of its parameters: the limits, the fast rule, the exact evolution, and tables."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mdr_dask.physics.mdr.revolution import PowerProfile, from_table
from mdr_dask.physics.wear import rules as wear
from mdr_dask.physics.wear.accuracy import checked_exact

pytestmark = pytest.mark.slow

EXPONENTS = st.floats(0.3, 20.0)
#: Stick radii, to a millionth beside 0 and 1.
SMALL = st.floats(-6.0, -1.0).map(lambda power: 10.0**power)
STICKS = st.one_of(st.floats(0.001, 0.999), SMALL, SMALL.map(lambda small: 1 - small))
#: N from a millionth of a cycle number that matters to far beyond the last.
CYCLES = st.floats(-6.0, 6.0).map(lambda power: 10.0**power)


@settings(max_examples=300, deadline=None)
@given(EXPONENTS, STICKS, CYCLES, st.floats(0.3, 1.5))
@example(20.0, 0.999, 1e4, 0.8)
@example(0.3, 0.001, 1e-4, 0.8)
def test_closed_forms(exponent, c, cycles, xi):
    """Limit and fast rule are finite and ordered: 0 < V_fast <= V_limit, 1 <= scar <= a(c), force falls."""
    radius, volume, force = (float(part) for part in wear.limit_cases(exponent, c))
    scar, worn, carried = (float(part) for part in wear.fast_cases(exponent, c, cycles, xi, radius))
    assert radius > 1.0
    assert 1.0 <= scar <= radius * (1.0 + 1e-12)
    assert -1e-12 <= worn <= volume * (1.0 + 1e-5) + 1e-12
    assert force * (1.0 - 1e-5) - 3e-6 <= carried <= 2.0
    assert volume <= np.pi * radius**2 * (1.0 - c**exponent)  # nowhere more than eta is worn off


@settings(max_examples=12, deadline=None)
@given(EXPONENTS, st.floats(0.001, 0.999), st.floats(-4.0, 4.0).map(lambda power: 10.0**power))
@example(20.0, 0.999, 1e4)
@example(0.3, 0.001, 1e4)
@example(20.0, 0.001, 3.0)
@example(0.3, 0.999, 3.0)
@example(2.0, 0.001, 1e4)
@example(1.0, 0.999, 1e-4)
@example(20.0, 1 - 1e-6, 1e4)
@example(4.0, 0.001, 100.0)
@example(18.0, 0.8125, 10**1.875)
@example(2.625, 0.00390625, 10**0.8125)
@example(3.962890625, 0.001, 10**2.5)
def test_exact_evolution(exponent, c, cycles):
    """f stays between the virgin body and the limit, a below a(c)."""
    profile = PowerProfile(exponent)
    ((worn, errors),) = checked_exact(profile, c, [cycles], ["normal_force", "height"], np.linspace(0.0, 1.5, 100))
    limit = wear.limit(profile, c)
    assert 1.0 - 1e-4 <= worn.contact_radius <= limit.contact_radius * (1.0 + 2e-3)  # to a tenth of what was asked
    assert worn.wear_volume <= limit.wear_volume * 1.003
    least = limit.normal_force - errors["normal_force"]
    assert least * (1.0 - 1e-3) - 1e-6 <= worn.normal_force <= 2.0
    # beside a stick radius of a few thousandths .06 is stated where a thousandth is true
    assert errors["height"] < 0.1
    r = np.linspace(0.0, 1.2 * limit.contact_radius, 60)
    assert np.all(worn.height(r) >= profile.height(r) - 1e-12)
    if cycles > 100.0:
        assert worn.wear_volume == pytest.approx(limit.wear_volume, rel=3e-3)


@settings(max_examples=3, deadline=None)
@given(st.floats(0.7, 6.0), st.floats(0.05, 0.95), st.floats(0.1, 30.0))
def test_tables_wear_as_their_formula(exponent, c, cycles):
    """A table of 150 rows gives the power law back to the interpolation's error."""
    r = 3.0 * np.linspace(0.0, 1.0, 151) ** 1.5
    profile = PowerProfile(exponent)
    table = from_table(r, profile.height(r), 1.0)
    for method in (wear.limit, lambda body, stick: wear.fast(body, stick, cycles)):
        formula, measured = method(profile, c), method(table, table.inside(c**exponent))
        assert measured.wear_volume == pytest.approx(formula.wear_volume, rel=2e-3, abs=1e-6)
        assert measured.contact_radius == pytest.approx(formula.contact_radius, abs=1e-3)
