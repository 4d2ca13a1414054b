"""Transforms between a body of revolution and its one-dimensional image, and pressures, in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import hyp2f1

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
def test_both_transforms_of_a_power(exponent):
    kappa = transforms.power_factor(exponent)
    f, error = transforms.inverse_transform(lambda x: x**exponent, RADII)
    np.testing.assert_allclose(f, RADII**exponent / kappa, atol=1e-9 + 2 * error.max(), rtol=0)
    g, error = transforms.forward_transform(lambda r: exponent * r ** (exponent - 1), RADII)
    np.testing.assert_allclose(g, kappa * RADII**exponent, atol=1e-9 + 2 * error.max(), rtol=0)


def test_smooth_profile_there_and_back_to_1e_10_with_few_nodes():
    radii = np.linspace(0, 2, 9)

    def image(x):
        return transforms.forward_transform(lambda r: np.sinh(r), x.ravel(), apex=1.0).value.reshape(x.shape)

    f, error = transforms.inverse_transform(image, radii)
    np.testing.assert_allclose(f, np.cosh(radii), rtol=1e-10)
    assert error.max() < 1e-9


def test_error_falls_geometrically_with_the_nodes(monkeypatch):
    errors = []
    for most in (16, 32):
        monkeypatch.setattr(transforms, "MOST_NODES", most)
        f = transforms.inverse_transform(lambda x: np.cos(5 * x), [2.0], tolerance=0).value
        from scipy.special import j0

        errors.append(abs(f[0] - j0(10.0)))
    assert errors[0] < 1e-10
    assert errors[1] < 1e-14


def test_kink_and_jump():
    # a plateau g = 1 beyond x = c: the transform is (2/pi) arccos(c/r)
    c = 0.455
    radii = np.array([0.2, 0.46, 0.8, 1.3])
    f = transforms.inverse_transform(lambda x: (x > c).astype(float), radii, breaks=[c]).value
    np.testing.assert_allclose(f, 2 / np.pi * np.arccos(np.minimum(c / radii, 1)), atol=1e-14)
    # a step of f comes back as a root singularity of g
    g = transforms.forward_transform(np.zeros_like, radii, apex=0.3, jumps=[(c, 2.0)]).value
    expected = 0.3 + np.where(radii > c, 2 * radii / np.sqrt(np.maximum(radii**2 - c**2, 1e-300)), 0)
    np.testing.assert_allclose(g, expected, rtol=1e-13)


def test_error_estimate_covers_the_error_of_an_unannounced_jump():
    f, error = transforms.inverse_transform(lambda x: (x > 0.3).astype(float), [1.0])
    assert abs(f[0] - 2 / np.pi * np.arccos(0.3)) < 10 * error[0] + 1e-15
    assert error[0] > 1e-10


@pytest.mark.parametrize("exponent", [0.6, 1.0, 2.0, 3.0])
def test_pressure_of_powers_is_the_closed_form(exponent):
    radii, a = np.array([1e-4, 0.2, 0.7, 0.999, 1.2, 1.3]), 1.2
    p, error = transforms.pressure(lambda x: exponent * x ** (exponent - 1), radii, a)
    share = np.maximum(1 - (radii / a) ** 2, 0)
    closed = exponent / np.pi * a ** (exponent - 1) * np.sqrt(share) * hyp2f1(1, 1 - exponent / 2, 1.5, share)
    np.testing.assert_allclose(p, closed, rtol=1e-9, atol=1e-10)
    assert error.max() < 1e-8


def test_pressure_of_cone_and_punch():
    r = np.array([0.0, 0.3, 0.99])
    cone = transforms.pressure(np.ones_like, r, 1.0).value
    assert cone[0] == np.inf
    punch = transforms.pressure(np.zeros_like, r, 1.0, edge_gap=0.5).value
    np.testing.assert_allclose(punch, 0.5 / np.pi / np.sqrt(1 - r**2), rtol=1e-14)


def test_pressure_on_the_axis_is_finite_where_the_line_load_falls_fast():
    """A Gaussian line load is that of a Gaussian pressure; its slope is steepest near the axis."""
    r = np.array([0.0, 0.1, 0.5])
    p = transforms.pressure(lambda x: 2 * x * np.sqrt(np.pi) / 0.3 * np.exp(-((x / 0.3) ** 2)), r, 2.0).value
    np.testing.assert_allclose(p, np.exp(-((r / 0.3) ** 2)), rtol=1e-9)


def test_a_jump_of_the_line_load_inside_the_contact():
    p = transforms.pressure(np.zeros_like, [0.1, 0.6], 1.0, jumps=[(0.5, 0.2)], edge_gap=0.0).value
    np.testing.assert_allclose(p, [0.2 / np.pi / np.sqrt(0.25 - 0.01), 0.0], rtol=1e-14)


def test_volume_from_the_image():
    # parabola: int 2 pi r (r^2/2) dr = pi R^4 / 4
    value, error = transforms.volume(lambda x: x**2, 1.3)
    assert value[0] == pytest.approx(np.pi * 1.3**4 / 4, rel=1e-13)
    assert error[0] < 1e-9  # what was asked for, times the volume
