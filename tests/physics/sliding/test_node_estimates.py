"""Estimates from node to node against cubic cells, which share neither grid nor sums with them."""

import numpy as np
import pytest

from mdr_dask.physics.sliding.accuracy import SETTINGS, Ladder, Seen, _sampled_errors
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import Waves

ROUNDING = 1e-9


def drawn(seed, lines=48, cases=12):
    """Yield light, slow planes: F/(GhL) in 1e-6..1 and v tau slope/h in 1e-6..0.3."""
    random = np.random.default_rng(seed)
    for k in range(lines):
        hurst, points = float(random.choice([0.0, 0.0, random.uniform()])), int(random.choice([74, 1274, 2000]))
        amplitude = roughness.amplitudes(points // 2, hurst)
        waves = Waves(0.5 * amplitude * roughness.phase_factors(seed, k, points // 2), points)
        deborah = 10 ** random.uniform(-6, np.log10(0.3), cases) / roughness.spectral_slope(amplitude)
        yield Ladder(RoughLine(waves), "hermite", deborah, 10 ** random.uniform(-6, 0, cases) / 4, ("drag",))


def test_light_slow_planes_are_right_to_their_estimates():
    """Mostly H = 0, the hardest; cases of a line err together, so that the shares are looser than of single lines."""
    ratios, missed = [], []
    for ladder in drawn(31):
        exact = ladder.on_grid(64).drag
        for accuracy in (0.05, 0.01):
            found, errors = ladder.to_accuracy(accuracy)
            off = np.abs(found.drag - exact)
            ratios.append(off / (errors.drag + ROUNDING * exact))
            missed.append(off > accuracy * exact)
    assert np.mean(np.concatenate(ratios) <= 1) >= 0.955
    assert np.mean(np.concatenate(ratios) > 3) <= 0.006
    assert np.mean(np.concatenate(missed)) <= 0.01


@pytest.mark.parametrize("fraction", [0.01, 0.9])
def test_grids_that_agree_by_chance_are_trusted_no_more_than_the_nodes_that_tell_allow(fraction):
    """Nothing changed between the first two grids: what is left is chance, 0.3 over the nodes, and the profile."""
    columns, seen = np.array([[0.2], [-1.5], [fraction], [0.3]]), Seen(np.full(1, 50.0), np.full(1, 0.1))
    same = np.zeros((4, 1))
    errors = _sampled_errors(columns, seen, SETTINGS.sampled, same, same)[:, 0]
    drag, depth, contact, slope = errors / [0.2, 1.0, fraction, 0.3]
    touching, apart = 100, min(100, 100 * (1 / fraction - 1))
    np.testing.assert_allclose([drag, contact, slope], 0.3 / np.array([touching, apart, apart]), rtol=0.05)
    assert depth < 1e-5
    # on finer grids it is the change before that tells
    later = _sampled_errors(columns, seen, 2 * SETTINGS.sampled, same, same)[:, 0]
    assert np.all(later / [0.2, 1.0, fraction, 0.3] < 1e-4)
