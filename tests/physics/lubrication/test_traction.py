"""Traction: against the dimensional formula, closed limits of the shear laws, and the balance of forces."""

from __future__ import annotations

import numpy as np
import pytest

from mdr_dask.physics.lubrication.line_contact import LineContact, LineSolution, line_contact, solve_film
from mdr_dask.physics.lubrication.traction import rolling_coefficient, shear_stress, sliding_coefficient

W, U, G, E_STAR = 2.0452e-5, 1e-11, 2500.0, 115.385e9


def sliding(solution: LineSolution, slide_roll_ratio: float, eyring_stress: float | None = None) -> float:
    return sliding_coefficient(solution.case, solution.finest, W, slide_roll_ratio, eyring_stress)


@pytest.fixture(scope="module")
def solution() -> LineSolution:
    return solve_film(line_contact((W, U, G), E_STAR))


def test_newtonian_stress_in_units(solution: LineSolution) -> None:
    R, viscosity, S = 0.02, 0.1, 0.01
    u = U * 2 * E_STAR * R / viscosity
    p0 = 2 * E_STAR * np.sqrt(W / (2 * np.pi))
    h = solution.finest.film * R * 8 * W / np.pi
    expected = viscosity * np.exp(G / (2 * E_STAR) * p0 * solution.finest.pressure) * S * u / h
    found = shear_stress(solution.case, solution.finest, W, S, None) * p0
    full = solution.finest.pressure > 0
    np.testing.assert_allclose(found[full], expected[full], rtol=1e-10)
    assert not found[~full].any()


def test_eyring_is_newtonian_at_small_and_logarithmic_at_large_stress(solution: LineSolution) -> None:
    newtonian = sliding(solution, 1e-3)
    assert sliding(solution, 1e-3, eyring_stress=1e4) == pytest.approx(newtonian, rel=1e-6)
    case, grid = solution.case, solution.finest
    stress = shear_stress(case, grid, W, 1e9, None)
    full = stress > 0
    limited = shear_stress(case, grid, W, 1e9, 1e-3)[full]
    np.testing.assert_allclose(limited, 1e-3 * np.log(2 * stress[full] / 1e-3), rtol=1e-6)


def test_newtonian_traction_is_proportional_to_sliding_and_zero_in_rolling(solution: LineSolution) -> None:
    assert sliding(solution, 0.0) == 0.0
    assert sliding(solution, 0.02) == pytest.approx(2 * sliding(solution, 0.01), rel=1e-12)


def test_rolling_friction_of_a_rigid_contact_balances_the_pressure() -> None:
    """The half film times the gradient is, by parts, the pressure on half the slope of the gap."""
    found = solve_film(LineContact(0.01, 0.0), accuracy=1e-5)
    small = 1e-6
    grid = found.finest
    by_pressure = -2 / np.pi * np.sqrt(8 * small / np.pi) * np.trapezoid(grid.pressure * grid.nodes / 2, grid.nodes)
    assert rolling_coefficient(grid, small) == pytest.approx(by_pressure, rel=1e-3)  # two quadratures, second order
    assert by_pressure > 0


@pytest.mark.parametrize("eyring_stress", [None, 0.01])
@pytest.mark.parametrize("law", ["barus", "roelands"])
def test_errors_of_friction_cover_the_finest_grids(law: str, eyring_stress: float | None) -> None:
    case = line_contact((W, U, G), E_STAR, viscosity_law=law, viscosity=0.08)
    coarse, fine = solve_film(case, 1e-3), solve_film(case, 3e-5)
    for read in (
        lambda grid: sliding_coefficient(case, grid, W, 0.01, eyring_stress),
        lambda grid: rolling_coefficient(grid, W),
    ):
        there, here = fine.estimate(read), coarse.estimate(read)
        assert abs(here.value - there.value) <= here.error + there.error
        assert here.error < 0.2 * abs(here.value)


def test_a_liquid_like_glass_gives_no_overflow() -> None:
    case = line_contact((5e-4, 1e-11, 8000.0), E_STAR)
    found = solve_film(case)
    with np.errstate(all="raise", under="ignore"):
        assert np.isfinite(sliding_coefficient(case, found.finest, 5e-4, 1.0, None))
        assert 0 < sliding_coefficient(case, found.finest, 5e-4, 1.0, 3e-3) < 1
