"""Times of the ways to the worn profile, of the transforms and of a block of fast cases."""

import numpy as np
import pytest

from mdr_dask.models.base import Block
from mdr_dask.models.fretting_wear import MODEL
from mdr_dask.models.fretting_wear.declaration import FrettingWear
from mdr_dask.physics.mdr.half_integrals import graded_panels
from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.mdr.transforms import inverse_transform
from mdr_dask.physics.wear import rules as wear
from mdr_dask.physics.wear.exact import exact, limit_under_force
from mdr_dask.physics.wear.forced_rule import fast_forced

PARABOLA = PowerProfile(2.0)


def test_limit(benchmark):
    assert benchmark(wear.limit, PARABOLA, 0.455).contact_radius > 1


def test_fast(benchmark):
    assert benchmark(wear.fast, PARABOLA, 0.455, 4.0).wear_volume > 0


@pytest.mark.parametrize("errors", [False, True])
@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4])
def test_exact(benchmark, accuracy, errors):
    assert benchmark(exact, PARABOLA, 0.455, [4.0], accuracy, errors=errors)[0].wear_volume > 0


@pytest.mark.parametrize("rule", ["limit", "fast", "exact"])
def test_constant_force(benchmark, rule):
    """The three rules at N = 2, c = 0.455, accuracy 1e-3."""
    run = {
        "limit": lambda: limit_under_force(PARABOLA, 0.455, 1e-3),
        "fast": lambda: fast_forced(PARABOLA, 0.455, 2.0),
        "exact": lambda: exact(PARABOLA, 0.455, [2.0], 1e-3, constant_force=True)[0],
    }[rule]
    assert benchmark.pedantic(run).depth > 1.0


def test_inverse_transform(benchmark):
    assert benchmark(inverse_transform, np.cos, np.linspace(0, 2, 200)).error.max() < 1e-9


def test_panels(benchmark):
    assert benchmark(graded_panels.__wrapped__, 6, 6, 6).nodes.size == 84


def test_block_of_fast_cases(benchmark):
    columns = {"stick_radius": np.linspace(0.05, 0.95, 2000), "cycles": np.linspace(0.1, 20, 2000)}
    block = Block(
        FrettingWear(wear_rule="fast", stick_radius=0.5), columns, 2000, (0,), 0, ("wear_volume", "contact_radius")
    )
    assert benchmark(MODEL.compute, block).solves == 2000
