"""Measured lines: detrending, taper, band limits, statistics."""

import numpy as np
import pytest
from schemes import sampled

from mdr_dask.errors import DataError
from mdr_dask.physics.surfaces import measured, roughness
from mdr_dask.physics.surfaces.waves import waves_of

LENGTH, POINTS = 1e-3, 512


def self_affine(points=POINTS, waves=100):
    amplitude = 1e-6 * roughness.amplitudes(waves, 0.7)
    height = sampled(amplitude, roughness.phases(1, 0, waves), points)
    return height, amplitude


def test_period_is_points_times_spacing():
    x = np.arange(POINTS) * 2e-6
    line = measured.measured_line(x, self_affine()[0])
    assert line.length == pytest.approx(POINTS * 2e-6, rel=1e-12)
    assert line.spacing == pytest.approx(2e-6, rel=1e-12)


def test_uneven_positions_are_resampled_and_descending_ones_turned():
    random = np.random.default_rng(0)
    x = np.sort(random.uniform(0, LENGTH, 4000))
    wave = np.sin(6 * np.pi * x / LENGTH)
    line = measured.measured_line(x, wave, detrend="none")
    even = np.linspace(x[0], x[-1], 4000)
    np.testing.assert_allclose(line.height, np.sin(6 * np.pi * even / LENGTH), atol=1e-3)  # linear between points
    turned = measured.measured_line(x[::-1], wave[::-1], detrend="none")
    assert np.array_equal(turned.height, line.height)


@pytest.mark.parametrize(("order", "trend"), [("mean", [3.0]), ("line", [3.0, 2.0]), ("parabola", [3.0, 2.0, 1.0])])
def test_detrending_removes_a_polynomial_and_keeps_what_is_orthogonal(order, trend):
    place = np.linspace(-1, 1, POINTS)
    assert np.abs(measured.detrended(np.polynomial.Polynomial(trend)(place), order)).max() < 1e-12
    rough = measured.detrended(self_affine()[0], order)
    again = measured.detrended(rough + np.polynomial.Polynomial(trend)(place), order)
    np.testing.assert_allclose(again, rough, atol=1e-12)


def test_taper_closes_the_line():
    x = np.arange(POINTS) * 2e-6
    ramp = np.linspace(0, 1e-6, POINTS)
    line = measured.measured_line(x, ramp, taper=0.2)
    assert abs(line.height[0] - line.height[-1]) < 1e-3 * 1e-6
    middle = slice(POINTS // 5, -POINTS // 5)
    np.testing.assert_allclose(line.height[middle], (ramp - ramp.mean())[middle], atol=1e-18)


def test_band_limits_keep_the_waves_between_them():
    height, amplitude = self_affine()
    kept = measured.band_limited(height, LENGTH, LENGTH / 50, LENGTH / 10)
    assert np.var(kept) == pytest.approx(np.sum(amplitude[9:50] ** 2) / 2, rel=1e-12)


def test_statistics_are_those_of_the_spectrum():
    height, amplitude = self_affine()
    q = 2 * np.pi * np.arange(1, amplitude.size + 1) / LENGTH
    assert np.std(height) == pytest.approx(np.sqrt(np.sum(amplitude**2) / 2), rel=1e-12)
    assert waves_of(height).rms_slope() / LENGTH == pytest.approx(np.sqrt(np.sum((amplitude * q) ** 2) / 2), rel=1e-12)


@pytest.mark.parametrize(
    ("x", "z", "message"),
    [
        ([0, 1], [0, 1], "8 or more pairs x, z, got 2 positions and 2 heights"),
        (range(9), [np.nan] * 9, "must be finite"),
        ([0, 1, 1, 2, 3, 4, 5, 6], [0] * 8, "must ascend or descend"),
    ],
)
def test_lines_that_cannot_be_used_are_refused(x, z, message):
    with pytest.raises(DataError, match=message):
        measured.measured_line(list(x), list(z))


@pytest.mark.parametrize("points", [16, 17])
@pytest.mark.parametrize("kind", ["noise", "alternating"])
def test_rms_slope_is_that_of_the_line_that_solvers_slide_over(kind, points):
    """The wave of two points counts: it does not show in slopes at the points, but between them."""
    random = np.random.default_rng(1)
    height = {"noise": random.standard_normal(points), "alternating": np.where(np.arange(points) % 2 == 0, 1.0, -1.0)}[
        kind
    ]
    expected = np.sqrt(np.mean((waves_of(height).slopes(8 * points) / LENGTH) ** 2))
    assert waves_of(height).rms_slope() / LENGTH == pytest.approx(expected, rel=1e-12)
