"""Bootstrap intervals: coverage with few realisations and with errors of the numbers."""

import numpy as np
import pytest

from mdr_dask import bootstrap


@pytest.mark.parametrize("count", [5, 12, 60])
def test_interval_of_a_mean_of_few(count: int) -> None:
    values = np.random.default_rng(3).normal(2.0, 1.0, (count, 2000))
    low, high = bootstrap.interval(bootstrap.means(values), count)
    # 400 resamples and percentiles of five values leave a few per cent
    assert np.mean((low < 2) & (high > 2)) == pytest.approx(0.95, abs=0.035)


def test_the_interval_of_a_positive_constant_is_that_of_its_inverse() -> None:
    samples = bootstrap.means(np.random.default_rng(4).lognormal(0.0, 1.0, (20, 3)))
    low, high = bootstrap.interval(samples, 20, positive=True)
    other_low, other_high = bootstrap.interval(1 / samples, 20, positive=True)
    # percentiles between two resamples are interpolated in logarithms in both
    assert np.allclose([1 / high, 1 / low], [other_low, other_high], rtol=1e-12)
    assert np.all(np.isnan(bootstrap.interval(samples, 1)))


def test_a_realisation_that_failed_somewhere_is_left_out_everywhere() -> None:
    values = np.random.default_rng(6).normal(size=(6, 4))
    values[2, 1] = np.nan
    found = bootstrap.means(bootstrap.complete(values))
    assert np.allclose(found[0], np.delete(values, 2, axis=0).mean(axis=0))
    values[1:, 0] = np.nan  # one realisation is left
    found = bootstrap.means(bootstrap.complete(values))
    assert np.allclose(found[0], values[0])
    assert np.all(np.isnan(found[1:]))
    assert np.all(np.isnan(bootstrap.interval(found, 6)))


@pytest.mark.parametrize("count", [5, 10, 30])
@pytest.mark.parametrize("size", [0.1, 1.0, 5.0])
def test_an_error_of_every_realisation_alike_is_held_beside_their_scatter(count: int, size: float) -> None:
    """The grid is wrong by what it states, and by the same in all realisations: a root of squares would hold 80 %."""
    error = size * 1.96 / np.sqrt(count)
    values = np.random.default_rng(5).normal(2.0 + error, 1.0, (count, 2000))
    stack = bootstrap.means(values)
    low, high = bootstrap.interval(np.concatenate([stack, stack[:1] + error, stack[:1] - error]), count)
    assert np.mean((low < 2) & (high > 2)) > 0.94


@pytest.mark.parametrize("count", [5, 10, 30])
def test_a_law_that_holds_is_rejected_at_the_stated_rate(count: int) -> None:
    """Straight lines through eight cases; lines of their own, and lines that all cases share."""
    rng, x = np.random.default_rng(9), np.linspace(-1, 1, 8)
    design = np.vstack([np.ones(8), x]).T
    left = np.eye(8) - design @ np.linalg.pinv(design)
    found = []
    for _ in range(300):
        values = design @ [1.0, 2.0] + rng.normal(0, 0.3, (count, 8)) + rng.normal(0, 0.5, (count, 1))
        found.append(bootstrap.chance(bootstrap.means(values) @ left, count))
    # few lines know their scatter badly, and are given the benefit of the doubt
    assert np.mean(np.array(found) < 0.05) < 0.07
    bent = bootstrap.means(values + 2 * x**2) @ left
    assert bootstrap.chance(bent, count) < 0.05


def test_infinite_errors_widen_the_interval() -> None:
    stack = bootstrap.means(np.random.default_rng(2).normal(2.0, 0.01, (9, 3)))
    rows = bootstrap.moved(stack[0], np.array([0.0, np.inf, np.nan]))
    low, high = bootstrap.interval(np.concatenate([stack, rows]), 9)
    assert np.allclose((low[1], high[1]), (0.0, 4.0), atol=0.05)
    assert np.all(high[[0, 2]] - low[[0, 2]] < 0.1)


def test_errors_reach_as_far_up_as_they_move_up_and_as_far_down_as_they_move_down() -> None:
    """What is fitted need not follow its data evenly: errors that move it up by 3 move it down by 1."""
    same = np.full((1 + bootstrap.RESAMPLES, 1), 5.0)
    low, high = bootstrap.interval(np.concatenate([same, [[8.0]], [[4.0]], [[4.5]], [[5.2]]]), 10)
    assert (low[0], high[0]) == pytest.approx((3.5, 8.2))


def test_scatter_and_errors_that_reach_zero_leave_no_least_value_of_what_is_positive() -> None:
    """Resamples at or below zero, and errors larger than the value, are not left out of the interval."""
    stack = np.full((1 + bootstrap.RESAMPLES, 2), 1.0)
    stack[1:41, 0] = -0.5
    low, high = bootstrap.interval(stack, 9, positive=True)
    assert low[0] == 0
    assert low[1] == high[1] == high[0] == 1
    low, high = bootstrap.interval(np.concatenate([stack, [[1.0, 3.0], [1.0, -1.0]]]), 9, positive=True)
    assert (low[1], high[1]) == pytest.approx((0.0, 3.0))
    assert np.all(np.isnan(bootstrap.interval(-stack[:, 1:], 9, positive=True)))
