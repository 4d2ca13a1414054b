"""Relaxation moduli measured at 21 temperatures: our intervals contain the published shift factors."""

import numpy as np
import pytest

from benchmarks import published_factors


@pytest.mark.slow
def test_published_factors_lie_in_the_intervals():
    temperatures, curves = published_factors.measured()
    theirs = published_factors.published()
    np.testing.assert_allclose(published_factors.by_straight_lines(curves), theirs, atol=1e-6)
    found, _, low, high = published_factors.joint(temperatures, curves)
    inside = (low <= theirs) & (theirs <= high)
    assert inside.mean() > 0.9
    assert found.noise[0] < 0.005
