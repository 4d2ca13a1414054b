"""Curves of two groups: a shift factor for each."""

import numpy as np
import pytest

from mdr_dask.errors import DataError
from mdr_dask.physics.superposition.two_factors import superpose_twice

VELOCITIES, TEMPERATURES = np.geomspace(1e-3, 1e-1, 4), np.array([280.0, 290.0, 300.0, 310.0, 320.0])


def family(seed, noise=0.01, cross=0.0):
    """Curves on a sigmoid at every pair; `cross` is a part of the shift that is no sum."""
    random = np.random.default_rng(seed)
    x = np.linspace(-1, 1, 20)
    a, b = -0.4 * np.log10(VELOCITIES / VELOCITIES[2]), 0.03 * (TEMPERATURES - 300.0)
    first, second, curves = [], [], []
    for i, velocity in enumerate(VELOCITIES):
        for j, temperature in enumerate(TEMPERATURES):
            shift = a[i] + b[j] + cross * (i - 2) * (j - 2)
            first.append(velocity)
            second.append(temperature)
            curves.append((x, 2 * np.tanh((x + shift) / 2) + noise * random.standard_normal(x.size)))
    return first, second, curves, a, b


@pytest.mark.slow
def test_both_shifts_are_found_within_their_intervals():
    """Six families of 7 factors, whose errors are correlated within a family."""
    held, chances = [], []
    for seed in range(6):
        first, second, curves, a, b = family(seed)
        found = superpose_twice(first, second, curves)
        for part, truth in ((found.first, a), (found.second, b)):
            low, high = part.interval()[:, : truth.size]
            held += list(((low <= truth) & (truth <= high))[high > low])
        chances.append(found.probability)
    assert np.mean(held) >= 0.85
    assert np.mean(chances) > 0.2


def test_a_shift_that_is_no_sum_has_a_small_probability():
    first, second, curves, *_ = family(1, cross=0.05)
    assert superpose_twice(first, second, curves).probability < 1e-3


def test_pairs_may_be_missing_and_a_reference_chosen():
    first, second, curves, a, b = family(2, noise=1e-3)
    kept = [k for k in range(20) if k % 3]
    found = superpose_twice(*([thing[k] for k in kept] for thing in (first, second, curves)), reference=1e-3)
    np.testing.assert_allclose(found.first.horizontal, a - a[0], atol=0.01)
    np.testing.assert_allclose(found.second.horizontal, b, atol=0.01)


def test_parts_that_share_no_group_are_refused():
    first, second, curves, *_ = family(3)
    kept = [0, 1, 7, 8]  # two velocities, each at temperatures of its own
    with pytest.raises(DataError, match="fall into sets that share no value"):
        superpose_twice(*([thing[k] for k in kept] for thing in (first, second, curves)))
    with pytest.raises(DataError, match="two or more different values of each quantity"):
        superpose_twice(first[:5], second[:5], curves[:5])
