"""The deformation in blocks against a dense matrix on graded grids, and its growth with the number of nodes."""

from __future__ import annotations

import numpy as np
import pytest

from mdr_dask.physics.lubrication.line_kernel import deform, line_kernel


def graded(seed: int, count: int) -> np.ndarray:
    """Return nodes of a random smooth density that spans a factor of some hundred, on [-5, 1.5]."""
    random = np.random.default_rng(seed)
    share = np.linspace(0.0, 1.0, count)
    fine = random.uniform(0.1, 0.9, 2)
    density = np.min(np.abs(share[:, None] - fine), axis=1) + 10 ** random.uniform(-3, -1)
    nodes = np.concatenate([[0.0], np.cumsum(density[1:])])
    return -5.0 + 6.5 * nodes / nodes[-1]


def dense_matrix(nodes: np.ndarray) -> np.ndarray:
    """Return the dense matrix in extended precision: its entries are second differences, which cost half the digits."""
    x = nodes.astype(np.longdouble)

    def rows(points: np.ndarray) -> np.ndarray:
        square = (points[:, None] - x) ** 2
        second = 0.25 * square * (np.log(np.where(square == 0, 1, square)) - 3)
        hats = np.diff(np.diff(second, axis=1) / np.diff(x), axis=1)
        return np.pad(hats, ((0, 0), (1, 1)))

    return (rows(np.zeros(1, np.longdouble)) - rows(x)) / np.longdouble(np.pi)


@pytest.mark.parametrize("count", [80, 97, 203, 640, 1281])
@pytest.mark.parametrize("seed", range(3))
def test_deformation_is_that_of_the_dense_matrix(seed: int, count: int) -> None:
    nodes = graded(seed, count)
    pressure = np.random.default_rng(count).uniform(0.0, 1.0, count)
    pressure[[0, -1]] = 0.0
    deformation = np.empty(count)
    at_origin = deform(line_kernel(nodes), pressure, deformation)
    dense = dense_matrix(nodes) @ pressure
    # the rest of the blocks is 1e-13 of their entries
    np.testing.assert_allclose(deformation - at_origin, dense.astype(float), rtol=0, atol=1e-12)


def test_triangle_of_pressure_on_many_nodes_in_closed_form() -> None:
    """Beyond the dense matrix: a pressure 1 - |X|, whose deformation is a second difference of x^2 ln|x| alone."""
    nodes = np.sort(np.append(graded(1, 4999), 0.0))
    nodes = np.sort(np.concatenate([nodes[np.abs(np.abs(nodes) - 1) > 1e-4], [-1.0, 1.0]]))
    deformation = np.empty(nodes.size)
    at_origin = deform(line_kernel(nodes), np.maximum(1 - np.abs(nodes), 0.0), deformation)

    def second(x: np.ndarray) -> np.ndarray:
        return np.where(x == 0, 0.0, 0.25 * x * x * (np.log(np.where(x == 0, 1.0, x * x)) - 3))

    exact = -(second(nodes + 1) - 2 * second(nodes) + second(nodes - 1)) / np.pi
    exact += 2 * float(second(np.ones(1))[0]) / np.pi
    np.testing.assert_allclose(deformation - at_origin, exact, rtol=0, atol=1e-12)


def test_numbers_stored_grow_like_n_log_n() -> None:
    """Each doubling adds the same to the numbers that a node costs in storage, product and so in time."""
    per_node = []
    for count in (640, 1280, 2560, 5120):
        kernel = line_kernel(graded(0, count))
        levels = kernel.ranks.shape[0]
        factors = 2 * sum(int(kernel.ranks[level].sum()) * count // (2 << level) for level in range(levels))
        per_node.append((factors + kernel.leaves.size) / count)
    added = np.diff(per_node)
    assert added.max() < 1.3 * added.min()
    assert per_node[-1] < 0.1 * 5120


def test_ranks_leave_room() -> None:
    """A block that used every rank allowed might be wrong."""
    kernel = line_kernel(graded(2, 5120))
    assert kernel.ranks.max() < kernel.rows.shape[2]
