"""Traction: against the dimensional formula, closed limits of the shear laws, and the balance of forces."""

from __future__ import annotations

import numpy as np
import pytest

from mdr_dask.physics.lubrication.line_contact import LineContact, LineSolution, line_contact, solve
from mdr_dask.physics.lubrication.traction import shear_stress, traction

W, U, G, E_STAR = 2.0452e-5, 1e-11, 2500.0, 115.385e9


@pytest.fixture(scope="module")
def solution() -> LineSolution:
    return solve(line_contact(W, U, G, E_STAR))


def test_newtonian_stress_in_units(solution: LineSolution) -> None:
    R, viscosity, S = 0.02, 0.1, 0.01
    u = U * 2 * E_STAR * R / viscosity
    p0 = 2 * E_STAR * np.sqrt(W / (2 * np.pi))
    h = solution.film * R * 8 * W / np.pi
    expected = viscosity * np.exp(G / (2 * E_STAR) * p0 * solution.pressure) * S * u / h
    found = shear_stress(solution.case, solution.fine, W, S, None) * p0
    full = solution.pressure > 0
    np.testing.assert_allclose(found[full], expected[full], rtol=1e-10)
    assert not found[~full].any()


def test_eyring_is_newtonian_at_small_and_logarithmic_at_large_stress(solution: LineSolution) -> None:
    newtonian = traction(solution, W, 1e-3).sliding
    assert traction(solution, W, 1e-3, eyring_stress=1e4).sliding == pytest.approx(newtonian, rel=1e-6)
    case, grid = solution.case, solution.fine
    stress = shear_stress(case, grid, W, 1e9, None)
    full = stress > 0
    limited = shear_stress(case, grid, W, 1e9, 1e-3)[full]
    np.testing.assert_allclose(limited, 1e-3 * np.log(2 * stress[full] / 1e-3), rtol=1e-6)


def test_newtonian_traction_is_proportional_to_sliding_and_zero_in_rolling(solution: LineSolution) -> None:
    assert traction(solution, W, 0.0).sliding == 0.0
    assert traction(solution, W, 0.02).sliding == pytest.approx(2 * traction(solution, W, 0.01).sliding, rel=1e-12)


def test_rolling_friction_of_a_rigid_contact_balances_the_pressure() -> None:
    """The half film times the gradient is, by parts, the pressure on half the slope of the gap."""
    found = solve(LineContact(0.01, 0.0), accuracy=1e-4)
    small = 1e-6
    by_pressure = -2 / np.pi * np.sqrt(8 * small / np.pi) * np.trapezoid(found.pressure * found.nodes / 2, found.nodes)
    assert traction(found, small, 0.0).rolling == pytest.approx(by_pressure, rel=1e-3)  # two quadratures, second order
    assert by_pressure > 0


def test_error_covers_the_next_grid() -> None:
    case = line_contact(W, U, G, E_STAR)
    coarse, fine = (traction(solve(case, accuracy), W, 0.01) for accuracy in (1e-3, 5e-5))
    assert abs(coarse.sliding - fine.sliding) <= coarse.sliding_error


def test_a_liquid_like_glass_gives_no_overflow() -> None:
    case = line_contact(5e-4, 1e-11, 8000.0, E_STAR)
    found = solve(case)
    with np.errstate(all="raise", under="ignore"):
        assert np.isfinite(traction(found, 5e-4, 1.0).sliding)
        assert 0 < traction(found, 5e-4, 1.0, eyring_stress=3e-3).sliding < 1
