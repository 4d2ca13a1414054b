"""The image of a body of revolution and its rise over a distance."""

import numpy as np
import pytest

from mdr_dask.physics.mdr.revolution import PowerProfile, from_table, image_rise


@pytest.mark.parametrize("exponent", [0.5, 2.0, 3.7])
@pytest.mark.parametrize("gap", [-0.3, -1e-9, 0.01])
def test_the_rise_of_a_power_is_that_of_its_formula_down_to_the_centre(exponent, gap):
    rise = getattr(image_rise, "py_func", image_rise)  # as it is where nothing is compiled
    image, start = PowerProfile(exponent).pieces(), 0.3
    level = start**exponent
    exact = np.longdouble(start + gap) ** exponent - np.longdouble(start) ** exponent
    if abs(gap) < 1e-6:
        exact = exponent * gap * start ** (exponent - 1)
    assert rise(image, start, level, gap) == pytest.approx(float(exact), rel=1e-7)


@pytest.mark.parametrize("gap", [-0.3, 0.003])
def test_the_rise_of_a_table_is_the_difference_of_its_image(gap):
    """Over short distances it is the integral of the slope by eight values; kinks of a table make it wrong by 1e-4."""
    rise = getattr(image_rise, "py_func", image_rise)
    radius = np.linspace(0, 2, 400)
    profile = from_table(radius, radius**2 + 0.3 * np.sin(2 * radius) ** 2, 1.0)
    for start in (0.35, 0.5123, 0.77):
        low, high = profile.image(np.array([start, start + gap]))
        assert rise(profile.pieces(), start, low, gap) == pytest.approx(high - low, rel=2e-4)


def test_the_rise_of_a_power_from_the_centre_is_its_image():
    gap = np.array([0.0, 1e-9, 0.3, 2.0])
    for exponent in (0.5, 1.0, 2.0, 8.0):
        profile = PowerProfile(exponent)
        np.testing.assert_array_equal(profile.rise(gap, 0.0), profile.image(gap))
        for start in (0.05, 0.4):
            np.testing.assert_allclose(
                profile.rise(gap, start), (start + gap) ** exponent - start**exponent, atol=1e-15
            )
