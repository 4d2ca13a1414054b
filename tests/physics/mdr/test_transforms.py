"""The transform of a body of revolution into its one-dimensional image, in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mdr_dask.physics.mdr import transforms

RADII = np.array([1e-3, 0.1, 0.37, 0.9, 1.0, 1.7])


@pytest.mark.parametrize(
    ("exponent", "factor"),
    [(0.5, 1.3110287771), (1, np.pi / 2), (2, 2), (3, 3 * np.pi / 4), (4, 8 / 3), (10, 4.0634920635)],
)
def test_power_factor(exponent, factor):
    assert transforms.power_factor(exponent) == pytest.approx(factor, rel=1e-10)  # printed digits


@settings(max_examples=25, deadline=None)
@given(st.floats(1.0, 8.0))
def test_transform_of_a_power(exponent):
    g, error = transforms.forward_transform(lambda r: exponent * r ** (exponent - 1), RADII)
    expected = transforms.power_factor(exponent) * RADII**exponent
    np.testing.assert_allclose(g, expected, atol=1e-9 + 2 * error.max(), rtol=0)


def test_transform_of_a_truncated_cone():
    # a flat face up to r = c, then the slope 1: g = |x| arccos(c / |x|)
    c = 0.455
    g, error = transforms.forward_transform(lambda r: (r > c).astype(float), RADII, breaks=[c])
    np.testing.assert_allclose(g, RADII * np.arccos(np.minimum(c / RADII, 1)), atol=1e-14)
    g, error = transforms.forward_transform(lambda r: (r > c).astype(float), [1.0])  # the kink is not given
    assert abs(g[0] - np.arccos(c)) < 10 * error[0]
