import numpy as np
import pytest

from mdr_dask.errors import DataError
from mdr_dask.physics.superposition.two_factors import superpose_twice

VELOCITIES, TEMPERATURES = np.geomspace(1e-3, 1e-1, 4), np.array([280.0, 290.0, 300.0, 310.0, 320.0])


RISES = 0.02 * np.arange(-2, 2), 0.03 * np.arange(-2, 3)


def family(seed, noise=0.01, cross=0.0, rise=0.0):
    """Curves on a sigmoid at every pair; `cross` is a part of the shift that is no sum, `rise` scales vertical ones."""
    random = np.random.default_rng(seed)
    x = np.linspace(-1, 1, 20)
    a, b = -0.4 * np.log10(VELOCITIES / VELOCITIES[2]), 0.03 * (TEMPERATURES - 300.0)
    first, second, curves = [], [], []
    for i, velocity in enumerate(VELOCITIES):
        for j, temperature in enumerate(TEMPERATURES):
            shift = a[i] + b[j] + cross * (i - 2) * (j - 2)
            first.append(velocity)
            second.append(temperature)
            height = rise * (RISES[0][i] + RISES[1][j])
            curves.append((x, 2 * np.tanh((x + shift) / 2) - height + noise * random.standard_normal(x.size)))
    return first, second, curves, a, b


def test_both_shifts_are_found_within_their_bars():
    """30 families: 7 factors each, whose errors are correlated within a family."""
    covered, chances = [], []
    for seed in range(30):
        first, second, curves, a, b = family(seed)
        found = superpose_twice(first, second, curves)
        for part, truth in ((found.first, a), (found.second, b)):
            np.testing.assert_allclose(part.horizontal, truth, atol=0.05)
            inside = np.abs(part.horizontal - truth) <= part.horizontal_error
            covered.extend(inside[part.horizontal_error > 0])
        chances.append(found.probability)
    assert 0.60 <= np.mean(covered) <= 0.78
    assert 0.3 < np.mean(chances) < 0.7  # uniform if the chi-squared is right; 30 of them are known to 0.05


def test_both_shifts_along_both_axes_are_found_within_their_bars():
    """20 families: 14 factors each, whose errors are correlated within a family."""
    covered = []
    for seed in range(20):
        first, second, curves, a, b = family(seed, rise=1.0)
        found = superpose_twice(first, second, curves, vertical=True)
        for part, truth, rise in ((found.first, a, RISES[0]), (found.second, b, RISES[1])):
            np.testing.assert_allclose(part.horizontal, truth, atol=0.15)
            np.testing.assert_allclose(part.vertical, rise, atol=0.15)
            errors = np.append(part.horizontal_error, part.vertical_error)
            inside = np.abs(np.append(part.horizontal - truth, part.vertical - rise)) <= errors
            covered.extend(inside[errors > 0])
    assert len(covered) == 20 * 14
    assert 0.55 <= np.mean(covered) <= 0.8


def test_bootstrap_of_a_sum_agrees_with_its_covariance():
    first, second, curves, _, _ = family(4)
    found = superpose_twice(first, second, curves, draws=60, seed=1)
    for part in (found.first, found.second):
        known = part.horizontal_error > 0
        spread = part.draws[:, : part.groups.size].std(axis=0)
        assert np.all(spread[~known] == 0)
        # standard deviation of 60 draws: 9 %; residuals differ from curve to curve
        assert np.median(spread[known] / part.horizontal_error[known]) == pytest.approx(1, abs=0.4)
    again = superpose_twice(first, second, curves, draws=60, seed=1)
    assert np.array_equal(found.first.draws, again.first.draws)


def test_a_shift_that_is_no_sum_is_told():
    first, second, curves, *_ = family(1, cross=0.05)
    assert superpose_twice(first, second, curves).probability < 1e-3


def test_pairs_may_be_missing_and_references_chosen():
    first, second, curves, a, b = family(2, noise=1e-3)
    kept = [k for k in range(20) if k % 3]
    found = superpose_twice(*([thing[k] for k in kept] for thing in (first, second, curves)), references=(1e-3, 320.0))
    np.testing.assert_allclose(found.first.horizontal, a - a[0], atol=0.01)
    np.testing.assert_allclose(found.second.horizontal, b - b[-1], atol=0.01)


def test_parts_that_share_nothing_are_refused():
    first, second, curves, *_ = family(3)
    kept = [0, 1, 7, 8]  # two velocities, each at temperatures of its own
    with pytest.raises(DataError, match="fall into parts that share neither group"):
        superpose_twice(*([thing[k] for k in kept] for thing in (first, second, curves)))
    with pytest.raises(DataError, match="two or more values of each group"):
        superpose_twice(first[:5], second[:5], curves[:5])
