"""Graded grids: spacing inverse to the density, both ends kept, nesting."""

from __future__ import annotations

import numpy as np
import pytest

from mdr_dask.physics.lubrication.grids import (
    adapted_density,
    aligned,
    first_grid,
    inlet_position,
    outlet_position,
    sample,
    second_derivative,
)


def test_uniform_density_gives_a_uniform_grid() -> None:
    nodes = sample(np.array([-2.0, 0.5, 3.0]), np.full(3, 7.0), 11)
    np.testing.assert_allclose(nodes, np.linspace(-2, 3, 11), atol=1e-14)


def test_spacing_is_inverse_to_a_linear_density() -> None:
    nodes = sample(np.array([0.0, 1.0]), np.array([1.0, 3.0]), 5)
    counts = nodes + nodes**2  # integral of 1 + 2 x
    np.testing.assert_allclose(np.diff(counts), 0.5, rtol=1e-13)


def test_halved_grids_nest() -> None:
    positions = np.linspace(-3, 2, 40)
    density = 1 + np.exp(-(positions**2) * 8)
    np.testing.assert_allclose(sample(positions, density, 81)[::2], sample(positions, density, 41), atol=1e-13)


@pytest.mark.parametrize("central", [1e-6, 1e-3, 0.3, 2.0, 500.0])
def test_first_grid_spans_inlet_to_outlet(central: float) -> None:
    nodes = first_grid(central, inlet_position(central), 121)
    assert nodes.size == 121
    assert np.all(np.diff(nodes) > 0)
    assert nodes[0] == inlet_position(central)
    assert nodes[-1] == outlet_position(central)


def test_second_derivative_of_a_square_on_any_grid() -> None:
    nodes = np.sort(np.random.default_rng(1).uniform(-1, 1, 20))
    np.testing.assert_allclose(second_derivative(nodes, 3 * nodes**2), 6.0, rtol=1e-6)


def test_nodes_gather_where_the_film_bends() -> None:
    nodes = np.linspace(-3, 2, 201)
    film = 0.1 + np.where(nodes < -1, (nodes + 1) ** 2, 0.0)
    pressure = np.sqrt(np.maximum(1 - nodes**2, 0))
    density = adapted_density(nodes, pressure, film, 0.1)
    assert density.min() > 0
    assert density[np.argmin(abs(nodes + 1.1))] > 2 * density[np.argmin(abs(nodes))]


def test_a_film_ends_at_a_node_of_every_aligned_grid() -> None:
    positions, density = np.linspace(-5.0, 2.0, 60), 1 + np.exp(-((np.linspace(-5.0, 2.0, 60) - 1) ** 2) / 0.1)
    spacings = []
    for count in (41, 58, 81):
        nodes, spacing = aligned(positions, density, count, 1.037)
        assert np.min(np.abs(nodes - 1.037)) < 1e-12
        assert nodes[0] == -5.0
        assert nodes[-2] < 2.0 <= nodes[-1] + 1e-12
        assert np.all(np.diff(nodes) > 0)
        assert abs(nodes.size - count) <= 2
        cells = np.trapezoid(np.interp(np.linspace(-5, 1.037, 20_001), positions, density), dx=6.037 / 20_000)
        assert cells / spacing == pytest.approx(round(cells / spacing), abs=1e-3)
        spacings.append(spacing)
    assert spacings[0] / spacings[2] == pytest.approx(2, rel=0.03)


@pytest.mark.parametrize("front", [0.61, 0.8, 0.95])
def test_a_front_lies_in_the_middle_of_a_cell_of_every_aligned_grid(front: float) -> None:
    """By the number of cells alone, an eighth more or fewer at most: all are as wide as the density wants them."""
    positions, density = np.linspace(-5.0, 2.0, 60), 1 + np.exp(-((np.linspace(-5.0, 2.0, 60) - 1) ** 2) / 0.1)
    for count in (114, 161, 227, 641):
        nodes, spacing = aligned(positions, density, count, 1.037, front)
        after = int(np.searchsorted(nodes, front))
        assert (front - nodes[after - 1]) / (nodes[after] - nodes[after - 1]) == pytest.approx(0.5, abs=0.1)
        assert np.min(np.abs(nodes - 1.037)) < 1e-9
        assert abs(nodes.size / count - 1) < 0.15
        middle = 0.5 * (nodes[:-2] + nodes[1:-1])
        np.testing.assert_allclose(np.diff(nodes[:-1]) * np.interp(middle, positions, density), spacing, rtol=0.02)
