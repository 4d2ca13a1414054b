"""What values on finer grids tend to: exact to third order, with an error that covers every power and every chance."""

from __future__ import annotations

import numpy as np
import pytest

from mdr_dask.physics.lubrication.limits import TRUST, extrapolate


@pytest.mark.parametrize("spacing", [(4.0, 2.0, 1.0), (4.0, 2.8, 2.0), (2.9, 2.0, 1.0), (5.6, 2.9, 2.0)])
def test_extrapolation_is_exact_to_third_order_and_keeps_an_error(spacing: tuple[float, ...]) -> None:
    h = np.array(spacing)
    found = extrapolate(7 + 0.5 * h**2 + 0.02 * h**3, h)
    assert found.value == pytest.approx(7, abs=1e-13)
    assert TRUST.floor * 0.5 * h[2] ** 2 < found.error < 0.1 * h[2] ** 2
    assert found.order == pytest.approx(2.0, abs=0.2)


HALVED = np.array([4.0, 2.0, 1.0])


@pytest.mark.parametrize("order", [0.3, 0.5, 0.8, 1.0, 1.4, 1.5, 1.6, 1.8, 1.9, 2.0, 2.1, 2.5, 2.7, 3.0, 5.0])
@pytest.mark.parametrize("ratio", [2.0, 1.41])
def test_error_covers_every_order(order: float, ratio: float) -> None:
    spacing = ratio ** np.array([2.0, 1.0, 0.0])
    found = extrapolate(7 + 0.5 * spacing**order, spacing)
    assert found.order == pytest.approx(order, rel=1e-6)
    assert abs(found.value - 7) <= found.error * (1 + 1e-12)


@pytest.mark.parametrize("values", [(1.0, 1.1, 1.0), (1.0, 0.9, 1.0), (1.0, 1.0, 1.1), (1.0, 1.2, 1.3999)])
def test_values_that_approach_nothing_are_not_extrapolated(values: tuple[float, ...]) -> None:
    found = extrapolate(np.array(values), HALVED)
    assert found.value == values[-1]
    assert found.error >= abs(values[2] - values[1])


def test_a_small_last_change_after_a_large_one_is_not_trusted() -> None:
    """Central films of a starved contact, M = 0.37, L = 17, less their limit: the errors change their sign."""
    found = extrapolate(7 + np.array([1.24, -0.217, -0.153]), HALVED)
    assert abs(found.value - 7) <= found.error


def test_extrapolation_is_elementwise_and_knows_no_value() -> None:
    spacing = HALVED[:, None]
    values = np.hstack([1 + spacing**2, np.where(spacing > 3, np.nan, 5.0), np.full((3, 1), np.nan)])
    found = extrapolate(values, HALVED)
    np.testing.assert_allclose(found.value, [1.0, 5.0, np.nan])
    assert np.isfinite(found.error[0])
    assert found.error[1] == np.inf
    assert np.isnan(found.error[2])


def test_an_extrapolated_value_that_still_moves_is_known_no_better() -> None:
    """The last three values extrapolate to 7 with a small error, those before to 8."""
    h = np.array([8.0, 4.0, 2.0, 1.0])
    values = 7 + 0.5 * h**2 + 0.02 * h**3
    values[0] += 21.0
    assert extrapolate(values[1:], h[1:]).error < 0.2
    assert extrapolate(values, h).error > 0.25 * abs(extrapolate(values[:3], h[:3]).value - 7) > 0.2


def test_a_limit_moved_by_a_much_finer_grid_is_known_better() -> None:
    """The same change of the limit, by a grid of half the spacing and by one of 0.71 of it."""
    changed = {}
    for ratio in (2.0, 1.41):
        h = ratio * np.array([4.0, 2.0, 1.0, 1 / ratio])
        values = 7 + 0.5 * h**2
        values[0] += 21.0
        before = extrapolate(values[:3], h[:3]).value
        changed[ratio] = float(extrapolate(values, h).error / abs(before - 7))
    assert changed[2.0] < 0.4 * changed[1.41]


@pytest.mark.parametrize("ratio", [2.0, 1.41])
def test_whole_powers_leave_what_the_spacing_leaves_of_the_fourth(ratio: float) -> None:
    """The same powers on finer grids: the error shrinks with what they leave, and covers it."""
    over = []
    for finest in (0.1, 0.05):
        h = finest * ratio ** np.array([2.0, 1.0, 0.0])
        found = extrapolate(7 + 0.5 * h**2 + 0.2 * h**3 + 0.3 * h**4, h, 1e-6, 3.0)
        assert abs(found.value - 7) <= found.error
        over.append(found.error / finest**4)
    assert over[1] == pytest.approx(over[0], rel=0.3)
