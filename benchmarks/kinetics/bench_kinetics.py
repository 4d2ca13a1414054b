"""Run times of a jump and of its steady ends."""

import numpy as np
import pytest

from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients.velocity_jump import Transient, velocity_jump

POINTS = 1000


@pytest.mark.parametrize("hurst", [0.3, 0.7])
@pytest.mark.parametrize("deborah", [0.002, 0.02])
def test_bench_jump(benchmark, hurst, deborah):
    amplitude, phase = roughness.amplitudes(POINTS // 2, hurst), roughness.phases(1, 0, POINTS // 2)
    line = periodic_line(*(roughness.line(amplitude, phase, 4 * POINTS, order) for order in (0, 1)))
    asked = Transient(np.geomspace(1e-4, 20, 40), np.pi * POINTS, 12)
    found = benchmark(velocity_jump, line, 0.3, (deborah, 1.2 * deborah), asked)
    assert found.outcome == Outcome.CONVERGED
