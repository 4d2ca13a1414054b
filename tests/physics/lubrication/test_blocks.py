"""Newton steps by blocks: the same as by dense elimination, on the way and at the solution."""

from __future__ import annotations

import numpy as np
import pytest
from tests.physics.test_line_kernel import dense_matrix

from mdr_dask.physics.lubrication import grids as ehl_grid
from mdr_dask.physics.lubrication import levels as ehl_levels
from mdr_dask.physics.lubrication.blocks import film_of, newton_by_blocks, newton_step
from mdr_dask.physics.lubrication.deformation import influence_matrix
from mdr_dask.physics.lubrication.levels import GridSolution, refine, solve_on
from mdr_dask.physics.lubrication.line_contact import LineContact, line_contact, solve
from mdr_dask.physics.lubrication.line_kernel import line_kernel
from mdr_dask.physics.lubrication.newton import CONVERGED, FILM_COLLAPSED, TOO_MANY_STEPS, balance, newton

E_STAR = 115.385e9
CASES = {
    "checked": line_contact(2.0452e-5, 1e-11, 5007.0, E_STAR),
    "thinnest": line_contact(5e-4, 1e-13, 8000.0, E_STAR),
    "rigid": line_contact(2e-6, 1e-9, 500.0, E_STAR),
    "roelands": line_contact(1e-4, 1e-11, 5000.0, E_STAR, viscosity_law="roelands", viscosity=0.08),
    "starved": line_contact(2.0452e-5, 1e-11, 5007.0, E_STAR, inlet=-1.1),
}


def _coarse(case: LineContact) -> GridSolution:
    return solve(case, accuracy=1e-2).fine


def _nodes(state: GridSolution, count: int) -> np.ndarray:
    density = ehl_grid.adapted_density(state.nodes, state.pressure, state.film, state.central)
    return ehl_grid.sample(state.nodes, density, count)


@pytest.mark.parametrize("name", CASES)
def test_step_is_that_of_the_dense_equations(name: str) -> None:
    """All equations written out as one matrix, solved by LAPACK, away from the solution."""
    case, state = CASES[name], _coarse(CASES[name])
    nodes = _nodes(state, 331)
    n = nodes.size
    kernel = line_kernel(nodes)
    P = 1.01 * np.interp(nodes, state.nodes, state.pressure)
    P[[0, -1]] = 0.0
    H, R, by_pressure, by_film, step = np.empty(n), np.empty(n), np.empty((n, 4)), np.empty((n, 4)), np.empty(n)
    film_of(kernel, P, 1.3 * state.central, H)
    balance(nodes, case.liquid, case.film_number, P, H, np.empty((4, n)), R, by_pressure, by_film)
    scale = np.abs(by_pressure).sum(axis=1) + np.abs(by_film).sum(axis=1) * 0.01
    active = P > 0
    solved, central = newton_step(kernel, P, R, by_pressure, by_film, scale, active, step)
    assert solved

    films = np.column_stack([dense_matrix(nodes).astype(float), np.ones(n)])
    A, b = np.zeros((n + 1, n + 1)), np.zeros(n + 1)
    A[n, :n], b[n] = kernel.weights, np.pi / 2 - kernel.weights @ P
    for i in range(n):
        if not active[i]:
            A[i, i], b[i] = 1.0, -P[i]
            continue
        b[i] = -R[i] / scale[i]
        for q in range(4):
            j = i - 2 + q
            if j >= 0:
                A[i] += by_film[i, q] / scale[i] * films[j]
                A[i, j] += by_pressure[i, q] / scale[i]
    expected = np.linalg.solve(A, b)
    size = np.max(np.abs(expected[:n]))
    # pivoting stays within a leaf: of the thinnest film, ten digits are lost, which the next step makes good
    tolerance = 1e-5 if name == "thinnest" else 1e-8
    np.testing.assert_allclose(step, expected[:n], rtol=0, atol=tolerance * size)
    assert central == pytest.approx(expected[n], rel=tolerance, abs=tolerance * state.central)


@pytest.mark.parametrize("name", CASES)
def test_solution_is_that_of_the_dense_elimination(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    case, state = CASES[name], _coarse(CASES[name])
    found = []
    for least in (0, 10_000):
        monkeypatch.setattr(ehl_levels, "BLOCK_NODES", least)
        status, solution = refine(case, state, state, 401)
        assert status == CONVERGED
        found.append(solution)
    blocks, dense = found
    assert blocks.steps == dense.steps
    # the dense film is good to 1e-12, and relative to the thinnest film of 6e-4 to 1e-9
    np.testing.assert_allclose(blocks.pressure, dense.pressure, rtol=0, atol=1e-9)
    np.testing.assert_allclose(blocks.film, dense.film, rtol=2e-9)
    assert blocks.central == pytest.approx(dense.central, rel=2e-9)


def test_solution_on_2561_nodes_is_that_of_the_dense_elimination() -> None:
    """One dense Newton step, of a second, changes no more than the tolerance of the iteration."""
    case = CASES["checked"]
    found = solve(case, accuracy=1e-5)
    nodes, matrix = found.nodes, influence_matrix(found.nodes, found.nodes)
    assert nodes.size == 2561
    pressure, weights = found.pressure.copy(), line_kernel(nodes).weights
    arguments = (nodes, matrix, weights, case.liquid, case.film_number, pressure, found.fine.central)
    status, steps, central, film = newton(*arguments, 0.12, 1e-8, 1)
    assert (status, steps) == (CONVERGED, 1)
    np.testing.assert_allclose(pressure, found.pressure, rtol=0, atol=1e-8)
    np.testing.assert_allclose(film, found.film, rtol=1e-9)
    assert central == pytest.approx(found.fine.central, rel=1e-9)


@pytest.mark.parametrize("name", ["checked", "thinnest", "rigid"])
def test_second_order_goes_on(name: str) -> None:
    found = solve(CASES[name], accuracy=1e-5)
    assert found.reason == ""
    assert found.nodes.size > 1281
    assert found.order == pytest.approx(2.0, abs=0.25)
    assert found.load_error < 1e-11


def test_tight_error_covers_the_finer_grids() -> None:
    case = CASES["thinnest"]
    coarse, fine = solve(case, accuracy=2e-5), solve(case, accuracy=3e-6)
    assert coarse.nodes.size < fine.nodes.size
    for name in ("central_film", "minimum_film"):
        assert abs(getattr(coarse, name) / getattr(fine, name) - 1) < coarse.error + fine.error


def test_failures_are_values() -> None:
    case, state = CASES["checked"], _coarse(CASES["checked"])
    nodes = _nodes(state, 700)
    guess = np.interp(nodes, state.nodes, state.pressure)
    assert solve_on(case, nodes, guess, state.central, ((0.12, 1),))[0] == TOO_MANY_STEPS
    thin = newton_by_blocks(line_kernel(nodes), case.liquid, 1e-30, guess.copy(), state.central, 0.12, 1e-8, 200)
    assert thin[0] in (FILM_COLLAPSED, TOO_MANY_STEPS)


def test_same_case_same_bytes() -> None:
    first, second = (solve(CASES["thinnest"], accuracy=1e-3) for _ in range(2))
    assert first.nodes.size >= ehl_levels.BLOCK_NODES
    assert first.pressure.tobytes() == second.pressure.tobytes()
