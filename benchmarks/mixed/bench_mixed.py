"""Sliding sums against judging every window, creep, and a turn of the thesis's rig.

Run with ``pytest benchmarks/mixed/bench_mixed.py --benchmark-only``.
"""

import numpy as np
import pytest

from mdr_dask.models import load
from mdr_dask.models.base import Block
from mdr_dask.physics.lubrication import breakthrough as bt
from mdr_dask.physics.lubrication.clusters import find_clusters
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.splines import through_heights

SPACING = 2 * np.pi * 0.05 / 10**6
STRENGTH = float(bt.layer_strength(1e6, 115.385e9, 5e-9))
WINDOW, LEVEL = 945.4, 0.5317e-6  # 800 N, 100 rpm, 60 C


@pytest.fixture(scope="module")
def lines():
    amplitude = 0.2e-6 * roughness.amplitudes(100_000, 0.7, longest=748.0)
    phase = roughness.phases(2013, 0, 200_000).reshape(-1, 2)
    return [through_heights(roughness.line(amplitude, phase[:, roller], 10**6)) for roller in (0, 1)]


def sliding(lines):
    line = lines[0] + lines[1]
    return bt.contact_lengths(find_clusters(line, LEVEL, SPACING, STRENGTH), WINDOW)


def every_window(lines, stride=1, slip=0.0):
    positions = bt.creep_positions(np.arange(0, 10**6, stride), 10**6, slip)
    return bt.judge_windows(bt.Pair(*lines, LEVEL, SPACING, STRENGTH), WINDOW, positions)


def test_pure_rolling_by_sliding_sums(benchmark, lines):
    found = benchmark(sliding, lines)
    assert 0.2 < np.mean(found > 0) < 0.5


def test_pure_rolling_window_by_window(benchmark, lines):
    found = benchmark.pedantic(every_window, (lines,), rounds=1, warmup_rounds=0)
    assert np.array_equal(found, sliding(lines))


def test_creep_with_sparse_windows(benchmark, lines):
    found = benchmark(every_window, lines, int(WINDOW / 8), 0.02)
    assert 0.2 < np.mean(found > 0) < 0.5


def test_one_turn_of_125_cases(benchmark):
    model = load("mixed_lubrication")
    rpm, celsius = np.pi / 30, 273.15
    grid = np.meshgrid([100.0, 200, 400, 800, 1600], [86.0, 100, 130, 160, 200], [40.0, 50, 60, 70, 80], indexing="ij")
    force, speed, temperature = (axis.ravel() for axis in grid)
    parameters = model.parameters(normal_force=800.0, rotation_speed=10.0, temperature=333.15, rms_roughness=2e-7)
    columns = {"normal_force": force, "rotation_speed": speed * rpm, "temperature": temperature + celsius}
    outputs = tuple(output.name for output in model.outputs if output.default)
    block = Block(parameters, columns, 125, (0,), 2013, outputs)
    assert np.all(benchmark(model.compute, block).status == 1)
