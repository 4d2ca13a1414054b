"""Viscoelastic sliding over the number of arms, recovery modes, and superposition of ten curves of thirty points."""

import numpy as np
import pytest

from mdr_dask.physics.sliding.viscoelastic import steady_viscoelastic_sliding
from mdr_dask.physics.solids import prony, recovery
from mdr_dask.physics.superposition.master_curve import superpose
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line

LENGTH, POINTS = 0.02, 4000


def line():
    amplitude = 5e-7 * roughness.amplitudes(POINTS // 16, 0.7)
    return periodic_line(roughness.line(amplitude, roughness.phases(1, 0, POINTS // 16), POINTS), None)


@pytest.mark.parametrize("arms", [1, 5, 15, 50])
@pytest.mark.parametrize("force", [0.01, 1.0, 100.0])
def test_solve(benchmark, arms, force):
    pace = 0.1 / LENGTH
    solid = prony(
        1.0, np.full(arms, 10 / arms), (np.geomspace(1e-6, 1e-1, arms) if arms > 1 else np.array([1e-3])) * pace
    )
    state = benchmark(steady_viscoelastic_sliding, line(), solid, force / (4e7 * LENGTH))
    assert state.status == 0


def test_recovery_modes_of_fifty_arms(benchmark):
    modes = benchmark(recovery, np.ones(50), np.geomspace(1e-12, 1e8, 50))
    assert modes.times.size == 50


@pytest.mark.parametrize("vertical", [False, True])
def test_ten_curves_of_thirty_points(benchmark, vertical):
    random, x = np.random.default_rng(0), np.linspace(-1, 1, 30)
    shifts = np.cumsum(random.uniform(0.2, 0.6, 10))
    curves = [(x, 2 * np.tanh((x + shift - 2) / 2) + 0.01 * random.standard_normal(30)) for shift in shifts]
    result = benchmark(superpose, np.arange(10.0), curves, vertical)
    assert np.abs(np.diff(result.horizontal) - np.diff(shifts)).max() < (0.1 if vertical else 0.05)
