"""What the figure of a calibration shades."""

import numpy as np
import pytest

from mdr_dask.plots.calibration import between


@pytest.mark.parametrize("ends", [(0.3, 2.2), (0.3, 0.4), (1.0, 2.0)])
def test_a_shade_reaches_to_the_ends_of_its_interval(ends):
    """Not only to the nearest points of the curve."""
    x = np.arange(4.0)
    inside, height = between(x, 2 * x, *ends)
    assert (inside[0], inside[-1]) == ends
    assert np.all(np.diff(inside) > 0)
    np.testing.assert_allclose(height, 2 * inside)
