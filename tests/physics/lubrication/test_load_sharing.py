"""Load shared by film and asperities: sums of Gaussian heights, the balance, its limits, and the gap between lines."""

from __future__ import annotations

import numpy as np
import pytest
from schemes import sampled
from scipy.integrate import quad
from scipy.stats import norm

from mdr_dask.physics.lubrication.film_formulas import FORMULAS
from mdr_dask.physics.lubrication.load_sharing import (
    SharedLoad,
    asperity_pressure,
    distance_of_means,
    mean_overlap,
    share_load,
)
from mdr_dask.physics.surfaces import roughness

E_STAR, RMS, WAVELENGTH = 115.385e9, 0.28e-6, 0.42e-3


def on_asperities(film: float) -> float:
    """Pressure on the asperities of the lines of these tests."""
    return asperity_pressure(film, RMS, WAVELENGTH, E_STAR)


@pytest.mark.parametrize("distance", [-20.0, -3.0, -0.5, 0.0, 0.7, 2.0, 6.0])
def test_mean_overlap_is_the_integral_over_gaussian_heights(distance: float) -> None:
    by_quadrature = quad(lambda z: (z - distance) * norm.pdf(z), distance, 12.0, epsabs=0, epsrel=1e-11)[0]
    assert mean_overlap(distance) == pytest.approx(by_quadrature, rel=1e-8)


@pytest.mark.parametrize("gap", [1e-100, 1e-12, 1e-3, 0.3989, 1.0, 3.0, 8.999, 9.001, 40.0, 1e6])
def test_gap_between_the_lines_is_the_film(gap: float) -> None:
    distance = distance_of_means(gap)
    assert mean_overlap(-distance) == pytest.approx(gap, rel=1e-9)
    assert distance <= gap * (1 + 1e-12)
    if gap >= 3:
        assert distance == pytest.approx(gap, rel=2e-4)  # far apart, the film is the distance


def test_pressure_is_that_of_the_springs_of_two_lines() -> None:
    """MDR springs of two generated lines, pressed until the gap between them is the film: E* times overlap."""
    points = 400_000
    amplitude = RMS / np.sqrt(2) * roughness.amplitudes(40_000, 0.7, longest=300.0)
    phase = roughness.phases(7, 0, 80_000).reshape(-1, 2)
    heights = sum(sampled(amplitude, phase[:, roller], points) for roller in (0, 1))
    for distance in (-1.0, 0.0, 1.0):
        film = np.mean(np.maximum(distance * RMS - heights, 0))
        spacing = WAVELENGTH * 300 / points
        force = E_STAR * spacing * np.sum(np.maximum(heights - distance * RMS, 0))  # of 300 squares in a row
        # 300 longest waves: means scatter by some per cent
        assert on_asperities(film) == pytest.approx(force / (300 * WAVELENGTH**2), rel=0.1)


@pytest.mark.parametrize("name", list(FORMULAS))
@pytest.mark.parametrize("ratio", [1e-4, 0.3, 2.0])
@pytest.mark.parametrize("pressure", [1e7, 1e9])
def test_shares_add_to_one_and_the_film_is_never_thinner(name: str, ratio: float, pressure: float) -> None:
    formula = FORMULAS[name]
    W, U, G = 2e-5, 1e-11, 4000.0
    scale = ratio * RMS / float(formula(W, U, G))
    shared = share_load(
        lambda share: scale * float(formula(W, U / share, G * share)), lambda film: on_asperities(film) / pressure
    )
    assert shared.film_share + shared.asperity_share == pytest.approx(1.0, abs=1e-7)
    assert shared.film >= ratio * RMS
    assert shared.film == pytest.approx(ratio * RMS * shared.film_share ** (formula.material - formula.speed), rel=1e-9)
    assert shared.asperity_share == pytest.approx(on_asperities(shared.film) / pressure, rel=1e-9)


def test_as_the_film_vanishes_the_asperities_carry_everything() -> None:
    """The film that they leave is that of the dry contact, whatever the formula gives."""
    pressure = 1.3e8

    def shared(alone: float) -> SharedLoad:
        return share_load(lambda share: alone * share**-0.222, lambda film: on_asperities(film) / pressure)

    shares = [shared(film) for film in np.geomspace(1e-6, 1e-16, 12)]
    carried = [each.asperity_share for each in shares]
    assert np.all(np.diff(carried) > -1e-9)
    assert carried[0] < 1e-3
    assert carried[-1] == pytest.approx(1.0, abs=1e-6)
    assert on_asperities(shares[-1].film) == pytest.approx(pressure, rel=1e-6)
