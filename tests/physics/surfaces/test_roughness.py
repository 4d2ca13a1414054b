"""Generated lines: moments, harmonics, phases."""

import numpy as np
import pytest
from schemes import sampled

from mdr_dask.physics.surfaces import roughness


@pytest.mark.parametrize("hurst", [0, 0.7, 1])
def test_rms_and_slope_are_those_of_the_line(hurst):
    amplitude = roughness.amplitudes(64, hurst, rolloff=4, longest=2)
    phase = roughness.phases(3, 0, 64)
    height, slope = (sampled(amplitude, phase, 256, order) for order in (0, 1))
    # a resolved line has its moments in its samples, to rounding
    assert np.sqrt(np.mean(height**2)) == pytest.approx(1, rel=1e-12)
    assert np.sqrt(np.mean(slope**2)) == pytest.approx(roughness.spectral_slope(amplitude), rel=1e-12)


@pytest.mark.parametrize("nodes", [16, 17, 64])
@pytest.mark.parametrize("derivative", [0, 1])
def test_line_is_the_sum_of_its_harmonics(nodes, derivative):
    amplitude, phase = roughness.amplitudes(8, 0.5), roughness.phases(1, 2, 8)
    x, q = np.arange(nodes) / nodes, 2 * np.pi * np.arange(1, 9)
    angle = np.outer(x, q) + phase + derivative * np.pi / 2
    expected = np.cos(angle) @ (amplitude * q**derivative)
    assert sampled(amplitude, phase, nodes, derivative) == pytest.approx(expected, abs=1e-9 * q[-1] ** derivative)


def test_phases_depend_on_seed_and_realisation_only():
    assert np.array_equal(roughness.phases(1, 5, 100)[:40], roughness.phases(1, 5, 40))
    assert not np.any(roughness.phases(1, 5, 40) == roughness.phases(1, 6, 40))
    assert not np.any(roughness.phases(1, 5, 40) == roughness.phases(2, 5, 40))


def test_a_grid_below_the_cutoff_is_refused():
    with pytest.raises(ValueError, match="expected at least 16 nodes for 8 harmonics, got 15"):
        sampled(roughness.amplitudes(8, 0.5), roughness.phases(1, 0, 8), 15)


def test_a_spectrum_without_harmonics_is_refused():
    with pytest.raises(ValueError, match="none of 8 waves is left"):
        roughness.amplitudes(8, 0.5, longest=9)


def test_rolloff_makes_the_spectrum_flat():
    amplitude = roughness.amplitudes(100, 0.8, rolloff=10)
    assert amplitude[:10] == pytest.approx(amplitude[9])
    assert amplitude[19] / amplitude[39] == pytest.approx(2**1.3)


def test_phase_factors_of_a_short_spectrum_begin_a_long_one():
    factors = roughness.phase_factors(7, 3, 1000)
    np.testing.assert_allclose(factors, np.exp(1j * roughness.phases(7, 3, 1000)), rtol=0, atol=1e-15)
    assert np.array_equal(roughness.phase_factors(7, 3, 300), factors[:300])
