"""Products of powers that the data determine, for planted posteriors."""

import numpy as np
import pytest

from mdr_dask.fits.posterior import Posterior, products


def posterior(likely, unknowns):
    """Return a posterior on a unit cube: places are likely if their logarithms fulfil a condition within 0.01."""
    axes = np.linspace(0, 1, 41)
    places = np.stack(np.meshgrid(*unknowns * [axes], indexing="ij"), axis=-1).reshape(-1, unknowns)
    density = -0.5 * sum((each(places) / 0.01) ** 2 for each in likely)
    weights = np.exp(density)
    return Posterior(places, weights / weights.sum(), density, np.ones((len(places), 1)), 1 / 40)


def test_of_three_unknowns_two_products_are_determined():
    """The data determine only x y and y z. Any two products that span the same space are correct."""
    found = posterior([lambda p: p[:, 0] + p[:, 1] - 1, lambda p: p[:, 1] + p[:, 2] - 1], 3)
    found_products = products(found, np.exp(found.places), [0, 1, 2])
    assert len(found_products) == 2
    for each in found_products:
        assert np.sum(each.exponents != 0) == 2
        assert np.abs(each.exponents).max() == 1
        np.testing.assert_allclose(each.values, np.exp(found.places @ each.exponents))
        logarithm = np.log(each.values)
        mean = found.weights @ logarithm
        assert np.sqrt(found.weights @ (logarithm - mean) ** 2) < 0.03
    known = np.array([[1, 1, 0], [0, 1, 1]])
    assert np.linalg.matrix_rank(np.concatenate([known, [each.exponents for each in found_products]])) == 2


@pytest.mark.parametrize("least", [0.0, -0.5])
def test_unknowns_that_are_not_positive_have_no_product(least):
    found = posterior([lambda p: p[:, 0] + p[:, 1] - 1], 2)
    assert len(products(found, np.exp(found.places), [0, 1])) == 1
    assert products(found, found.places + least, [0, 1]) == []
    assert products(found, np.exp(found.places), [0]) == []
