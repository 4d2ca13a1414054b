"""Traction: against the dimensional formula, closed limits of the shear laws, and the balance of forces."""

from __future__ import annotations

import numpy as np
import pytest

from mdr_dask.physics.lubrication.film_formulas import hertz_line
from mdr_dask.physics.lubrication.line_contact import LineSolution, line_contact, solve_film
from mdr_dask.physics.lubrication.newton import Liquid
from mdr_dask.physics.lubrication.traction import shear_stress, sliding_coefficient, uniform_film_coefficient

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
    found = shear_stress(solution.case, solution.finest.pressure, solution.finest.film, W, S, None) * p0
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_eyring_is_newtonian_at_small_and_logarithmic_at_large_stress(solution: LineSolution) -> None:
    newtonian = sliding(solution, 1e-3)
    assert sliding(solution, 1e-3, eyring_stress=1e4) == pytest.approx(newtonian, rel=1e-6)
    at_nodes = solution.case, solution.finest.pressure, solution.finest.film
    stress = shear_stress(*at_nodes, W, 1e9, None)
    limited = shear_stress(*at_nodes, W, 1e9, 1e-3)
    np.testing.assert_allclose(limited, 1e-3 * np.log(2 * stress / 1e-3), rtol=1e-6)


def test_newtonian_traction_is_proportional_to_sliding_and_zero_in_rolling(solution: LineSolution) -> None:
    assert sliding(solution, 0.0) == 0.0
    assert sliding(solution, 0.02) == pytest.approx(2 * sliding(solution, 0.01), rel=1e-12)


@pytest.mark.parametrize("eyring_stress", [None, 0.01])
@pytest.mark.parametrize("law", ["barus", "roelands"])
def test_errors_of_friction_cover_the_finest_grids(law: str, eyring_stress: float | None) -> None:
    case = line_contact((W, U, G), E_STAR, viscosity_law=law, viscosity=0.08)
    readings = [lambda grid: sliding_coefficient(case, grid, W, 0.01, eyring_stress)]
    (here,), (there,) = (solve_film(case, each, readings, films_only=True).readings for each in (1e-3, 3e-5))
    assert abs(here.value - there.value) <= here.error + there.error
    assert here.error < 0.2 * abs(here.value)


def test_a_liquid_like_glass_gives_no_overflow() -> None:
    case = line_contact((5e-4, 1e-11, 8000.0), E_STAR)
    found = solve_film(case)
    with np.errstate(all="raise", under="ignore"):
        assert np.isfinite(sliding_coefficient(case, found.finest, 5e-4, 1.0, None))
        assert 0 < sliding_coefficient(case, found.finest, 5e-4, 1.0, 3e-3) < 1


def test_friction_of_an_isoviscous_newtonian_film_is_shear_times_width() -> None:
    contact = hertz_line(8e4, 115e9, 0.025)
    found = uniform_film_coefficient(contact, 0.1 * 0.3 / 1e-6, Liquid(0.0, 0.0, 0.0, 0.0, 0.0), 1e12)
    assert found == pytest.approx(0.1 * 0.3 / 1e-6 * 2 * contact.half_width / 8e4, rel=1e-12)


def test_eyring_friction_is_newtonian_for_slow_shear_and_smaller_for_fast() -> None:
    contact = hertz_line(8e4, 115e9, 0.025)
    liquid = Liquid(1e-8 * float(contact.pressure), 0.0, 0.0, 0.0, 0.0)
    slow, fast = (
        [uniform_film_coefficient(contact, 1e5 * v, liquid, stress) for stress in (5e6, 1e12)] for v in (1e-3, 10.0)
    )
    assert slow[0] == pytest.approx(slow[1], rel=1e-6)
    assert fast[0] < 0.9 * fast[1]
