"""Sweeps beside a lattice: honest errors, one value whatever was solved before, fewer and smaller systems."""

from __future__ import annotations

import numpy as np
import pytest

from mdr_dask.physics.lubrication import lattice as ehl_lattice
from mdr_dask.physics.lubrication.lattice import lattice_point, solve_beside_lattice
from mdr_dask.physics.lubrication.line_contact import LineContact, line_contact, solve

E_STAR = 115.385e9
LAWS = (
    {},
    {"compressible": False},
    {"viscosity_law": "roelands", "viscosity": 0.08},
    {"inlet": -1.2},
)


@pytest.mark.parametrize("law", LAWS)
def test_a_lattice_point_is_its_own_and_at_most_half_a_cell_away(law: dict[str, float]) -> None:
    for W, U, G in ((2e-6, 1e-9, 500.0), (2.0452e-5, 1e-11, 5007.0), (5e-4, 1e-13, 8000.0)):
        case = line_contact(W, U, G, E_STAR, **law)  # type: ignore[arg-type]
        point = lattice_point(case)
        again = lattice_point(point)
        assert again.inlet == point.inlet
        assert again[:-1] == pytest.approx(point[:-1], rel=1e-12)
        assert abs(np.log10(point.L / case.L)) <= 1 / 24 + 1e-12
        assert abs(np.log10(point.M * point.L**2 / (case.M * case.L**2))) <= 1 / 6 + 1e-12


def test_a_sweep_of_one_parameter_runs_along_the_lattice() -> None:
    speeds = {lattice_point(line_contact(2e-5, U, 5000.0, E_STAR)) for U in np.geomspace(1e-13, 1e-9, 200)}
    loads = {lattice_point(line_contact(W, 1e-11, 5000.0, E_STAR)) for W in np.geomspace(2e-6, 5e-4, 200)}
    assert len(speeds) == 13  # four decades, three a decade, both ends
    assert len(loads) == 8  # 2.4 decades
    assert lattice_point(LineContact(10.0, 0.0)).L == 0


@pytest.mark.parametrize("law", LAWS)
def test_errors_are_within_the_estimate(law: dict[str, float]) -> None:
    for W, U, G in ((2.3e-6, 6e-10, 700.0), (2.4e-5, 1.7e-11, 4400.0), (2e-4, 3e-12, 3000.0), (1e-4, 5e-13, 1500.0)):
        case = line_contact(W, U, G, E_STAR, **law)  # type: ignore[arg-type]
        found, exact = solve_beside_lattice(case), solve(case, accuracy=3e-5)
        assert found.status == 0
        assert found.error <= 1e-3
        allowed = found.error + exact.error
        assert found.central_film == pytest.approx(exact.central_film, rel=allowed)
        assert found.minimum_film == pytest.approx(exact.minimum_film, rel=allowed)


def test_a_value_does_not_depend_on_what_was_solved_before() -> None:
    cases = [line_contact(2e-5, U, 5000.0, E_STAR) for U in np.geomspace(1e-12, 1e-11, 7)]
    ehl_lattice._levels.cache_clear()
    forward = [solve_beside_lattice(case) for case in cases]
    ehl_lattice._levels.cache_clear()
    backward = [solve_beside_lattice(case) for case in cases[::-1]][::-1]
    for here, there in zip(forward, backward, strict=True):
        assert here.central_film == there.central_film
        assert np.array_equal(here.pressure, there.pressure)


def test_grids_are_coarser_than_alone() -> None:
    cases = [line_contact(2e-5, U, 5000.0, E_STAR) for U in np.geomspace(1e-12, 1e-10, 12)]
    beside = sum(solve_beside_lattice(case).nodes.size ** 3 for case in cases)
    alone = sum(solve(case).nodes.size ** 3 for case in cases)
    assert beside < alone / 2


def test_without_help_it_is_the_solution_alone() -> None:
    case = LineContact(1e9, 0.0)  # no film found, neither here nor at the lattice point
    assert solve_beside_lattice(case).reason == solve(case).reason
