"""Isotropic spectra: moments, lines, cuts, and the way back from scans."""

import math

import numpy as np
import pytest
from references.areal import areal_surface
from scipy import integrate

from mdr_dask.errors import DataError
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.measured import MeasuredLine
from mdr_dask.physics.surfaces.scans import Cut, cut_of_line, of_cut
from mdr_dask.physics.surfaces.spectrum import Spectrum, quadrature, self_affine

HURST = (0.3, 0.8)
LENGTH = 0.02


def waves(modes):
    return 2 * np.pi / LENGTH * np.arange(1, modes + 1)


@pytest.mark.parametrize("hurst", [0.0, *HURST, 1.0])
def test_the_line_of_a_power_law_is_the_generated_line(hurst):
    """Two ways to the same amplitudes: C2D by the rule 2.20, and k^(-H - 1/2) of the generator."""
    spectrum = self_affine(hurst, LENGTH / 4, LENGTH / 100, 1e-6)
    line = spectrum.line(LENGTH, 250)
    rms = np.sqrt(np.sum(line**2) / 2)
    generated = roughness.amplitudes(100, hurst, longest=4)
    np.testing.assert_allclose(line[:100] / rms, generated, rtol=1e-12, atol=1e-14)
    assert not np.any(line[100:])


@pytest.mark.parametrize("hurst", HURST)
def test_moments_are_the_integrals(hurst):
    """Against quadrature of 2.21 and 2.23, with a roll-off; one stretch has rms^2 ~ log q (H = 0 in the moment)."""
    spectrum = self_affine(hurst, 1e-2, 1e-5, 3e-6, 1e-3)
    for order, value in ((1, spectrum.rms_height()), (3, spectrum.rms_gradient())):
        moment = integrate.quad(
            lambda x, order=order: np.exp(x * (order + 1)) * spectrum.at(np.exp(x)),
            *np.log(spectrum.wavenumber[[0, -1]]),
            points=np.log(spectrum.wavenumber[1:-1]),
            epsrel=1e-10,
        )[0]
        assert value**2 == pytest.approx(2 * np.pi * moment, rel=1e-8)
    assert spectrum.rms_height() == pytest.approx(3e-6, rel=1e-12)


@pytest.mark.parametrize("hurst", HURST)
def test_a_cut_is_lower_than_the_line_by_the_known_factor(hurst):
    """C_cut / C1D = Gamma(H + 1/2) / (sqrt(pi) Gamma(H + 1)) far from the ends."""
    spectrum, q = self_affine(hurst, 1e3, 1e-6), np.array([60.0])
    factor = math.gamma(hurst + 0.5) / (math.sqrt(math.pi) * math.gamma(hurst + 1))
    k, weight = quadrature(q, spectrum.wavenumber)
    cut = np.sum(weight * spectrum.at(k), axis=1)
    assert cut / (np.pi * q * spectrum.at(q)) == pytest.approx([factor], rel=1e-6)


@pytest.mark.parametrize("hurst", HURST)
def test_a_generated_surface_has_height_and_gradient_of_its_line(hurst):
    """Within 1 %; the slope of one direction is smaller by the root of two. The line begins with a whole wave: 2 %."""
    spectrum = self_affine(hurst, LENGTH / 32, LENGTH / 128, 1e-6)
    height = areal_surface(spectrum, (1024, 1024), (LENGTH, LENGTH), 5, 0)
    line = spectrum.line(LENGTH, 512)
    q = 2 * np.pi * np.fft.fftfreq(1024, LENGTH / 1024)
    slopes = [
        np.fft.ifft(1j * q[:, None] * np.fft.fft(turned, axis=0), axis=0).real.std() for turned in (height, height.T)
    ]
    assert height.std() == pytest.approx(spectrum.rms_height(), rel=0.01)
    assert np.hypot(*slopes) == pytest.approx(spectrum.rms_gradient(), rel=0.01)
    assert slopes[0] == pytest.approx(spectrum.rms_gradient() / np.sqrt(2), rel=0.01)
    assert np.sqrt(np.sum(line**2) / 2) == pytest.approx(spectrum.rms_height(), rel=0.02)
    assert np.sqrt(np.sum((line * waves(512)) ** 2) / 2) == pytest.approx(spectrum.rms_gradient(), rel=0.02)
    assert abs(height.mean()) < 1e-12 * height.std()


@pytest.mark.parametrize("hurst", HURST)
def test_scans_give_back_the_spectrum(hurst):
    """Scans of one generated surface: C2D within the scatter of its bins, slope within 5 %, not smaller by sqrt 2."""
    spectrum = self_affine(hurst, LENGTH / 4, LENGTH / 128, 1e-6)
    height = areal_surface(spectrum, (1024, 1024), (LENGTH, LENGTH), 6, 1)
    cuts = [cut_of_line(MeasuredLine(height[k], LENGTH)) for k in range(0, 1024, 16)]
    density = np.mean([one.density for one in cuts], axis=0)
    cut = Cut(cuts[0].wavenumber, density, cuts[0].error / np.sqrt(len(cuts)))
    found, _ = of_cut(cut)
    inner = (cut.wavenumber > 2 * np.pi / LENGTH * 8) & (cut.wavenumber < 2 * np.pi / LENGTH * 100)
    scatter = np.log(found.at(cut.wavenumber[inner]) / spectrum.at(cut.wavenumber[inner]))
    assert np.sqrt(np.mean(scatter**2)) < 0.05 + 3 * np.sqrt(np.mean(cut.error[inner] ** 2))
    slope, wanted = (np.sqrt(np.sum((one.line(LENGTH, 511) * waves(511)) ** 2) / 2) for one in (found, spectrum))
    assert slope == pytest.approx(wanted, rel=0.05)


def test_errors_of_a_single_scan_hold_above_and_below_the_rolloff():
    spectrum = self_affine(0.8, LENGTH, LENGTH / 128, 1e-6, LENGTH / 16)
    height = areal_surface(spectrum, (1024, 1024), (LENGTH, LENGTH), 6, 1)
    apart = []
    for row in range(0, 1024, 64):
        found, error = of_cut(cut_of_line(MeasuredLine(height[row], LENGTH)))
        kept = (found.wavenumber > spectrum.wavenumber[0]) & (found.wavenumber < 2 * np.pi / LENGTH * 100)
        apart.append(np.log(found.density[kept] / spectrum.at(found.wavenumber[kept])) / error[kept])
    assert np.mean(np.abs(np.concatenate(apart)) < 1.96) > 0.9


@pytest.mark.parametrize(
    ("q", "density", "message"),
    [
        ([1.0], [1.0], "two points or more"),
        ([1.0, 2.0], [1.0, 0.0], "positive and finite spectral densities"),
        ([1.0, np.nan], [1.0, 1.0], "positive and finite wave numbers"),
        ([1.0, 1.0], [1.0, 1.0], "expected strictly ascending wave numbers"),
    ],
)
def test_impossible_spectra_are_refused(q, density, message):
    with pytest.raises(DataError, match=message):
        Spectrum(np.array(q), np.array(density))
