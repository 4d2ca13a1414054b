"""Half-integrals on graded panels: exact for powers, order of convergence."""

import itertools

import numpy as np
import pytest

from mdr_dask.physics.mdr.half_integrals import graded_panels, interpolate

PANELS = graded_panels(4, 5, 6)
Z = PANELS.nodes


def test_half_integrals_of_powers_are_exact():
    for k in range(1, 5):
        beta = np.prod([2 * j / (2 * j + 1) for j in range(1, k + 1)])  # int_0^1 u^k / sqrt(1-u) du / 2
        np.testing.assert_allclose(PANELS.inner @ Z**k, 2 * beta / np.pi * Z ** (k + 0.5), rtol=1e-9, atol=1e-13)
        shares = np.prod([(2 * j - 1) / (2 * j) for j in range(1, k + 1)])
        np.testing.assert_allclose(PANELS.full @ Z**k, shares * Z**k, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(PANELS.outer @ Z, 2 / np.pi * np.sqrt(1 - Z), atol=1e-12)
    np.testing.assert_allclose(PANELS.slope @ Z**3, 3 * Z**2, atol=1e-11)
    assert PANELS.weights @ Z**3 == pytest.approx(0.25, rel=1e-12)


def test_order_of_convergence():
    """A smooth function: the error of the half-integral falls as the panels' power."""
    errors = []
    for order in (2, 4, 6, 8):
        panels = graded_panels(2, 2, order)
        half = panels.full @ np.cos(4 * panels.nodes)
        from scipy.special import j0

        errors.append(np.max(np.abs(half - j0(2 * panels.nodes) * np.cos(2 * panels.nodes))))
    assert all(later < 0.05 * earlier for earlier, later in itertools.pairwise(errors))
    assert errors[-1] < 1e-8


def test_interpolation_is_exact_for_polynomials_and_zero_outside():
    x = np.array([1e-4, 0.01, Z[7], 0.3, 0.77, 0.9999, 1.0, 1.3])
    values = interpolate(PANELS.mesh, Z**4 - Z, x)
    np.testing.assert_allclose(values[:6], (x**4 - x)[:6], rtol=1e-10)
    assert np.all(values[6:] == 0)


def test_slowest_modes_of_a_flat_punch_that_wears_under_constant_force():
    """The pressure of a punch tends to F / (pi a^2); its slowest mode decays as exp(-2.0606 s)."""
    from scipy.linalg import eigvals

    panels = graded_panels(4, 12, 6)
    size = panels.nodes.size
    force = np.pi / 2 * panels.full[-1] * np.sqrt(1 - panels.nodes)
    rates, shape = np.zeros((size, size)), np.zeros((size, size))
    rates[:-1, :-1], rates[:-1, -1], rates[-1, :-1] = -panels.outer[:-1, :-1], -1.0, force[:-1]
    shape[:-1, :-1] = panels.full[:-1, :-1]
    with np.errstate(divide="ignore", invalid="ignore"):
        modes = eigvals(rates, shape)
    real = np.sort(modes[np.isfinite(modes) & (np.abs(modes.imag) < 1e-6)].real)
    assert real[real > 0.1][0] == pytest.approx(2.0606, abs=1e-4)  # digits printed
