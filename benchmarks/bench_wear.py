"""Times of the ways to the worn profile, of the transforms and of a block of fast cases."""

import numpy as np
import pytest

from mdr_dask.models.base import Block
from mdr_dask.models.fretting_wear import MODEL
from mdr_dask.models.fretting_wear.parameters import FrettingWear
from mdr_dask.physics.mdr.half_integrals import graded_panels
from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.mdr.transforms import inverse_transform
from mdr_dask.physics.wear import worn as wear
from mdr_dask.physics.wear.exact import exact_without_error
from mdr_dask.physics.wear.forced import exact_forced, limit_forced
from mdr_dask.physics.wear.forced_fast import fast_forced
from mdr_dask.physics.wear.literal import literal

PARABOLA = PowerProfile(2.0)


def test_limit(benchmark):
    assert benchmark(wear.limit, PARABOLA, 0.455).contact_radius > 1


def test_fast(benchmark):
    assert benchmark(wear.fast, PARABOLA, 0.455, 4.0).wear_volume > 0


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_exact(benchmark, tolerance):
    assert benchmark(exact_without_error, PARABOLA, 0.455, 4.0, tolerance).wear_volume > 0


def test_literal(benchmark):
    assert benchmark.pedantic(literal, (PARABOLA, 0.455, 0.5), {"cells": 60, "substeps": 16}).wear_volume > 0


@pytest.mark.parametrize("method", [limit_forced, fast_forced, exact_forced, literal])
def test_constant_force(benchmark, method):
    """The four methods at N = 2, c = 0.455: tolerance 1e-3, 100 cells."""
    arguments = {
        limit_forced: ((1e-3,), {}),
        fast_forced: ((2.0,), {}),
        exact_forced: (([2.0], 1e-3), {}),
        literal: ((2.0,), {"cells": 100, "substeps": 16, "constant_force": True}),
    }
    values, names = arguments[method]
    worn = benchmark.pedantic(method, (PARABOLA, 0.455, *values), names)
    assert np.ravel([worn])[0].depth > 1.0


def test_inverse_transform(benchmark):
    assert benchmark(inverse_transform, np.cos, np.linspace(0, 2, 200)).error.max() < 1e-9


def test_panels(benchmark):
    assert benchmark(graded_panels.__wrapped__, 6, 6, 6).nodes.size == 84


def test_block_of_fast_cases(benchmark):
    columns = {"stick_radius": np.linspace(0.05, 0.95, 2000), "cycles": np.linspace(0.1, 20, 2000)}
    block = Block(FrettingWear(stick_radius=0.5), columns, 2000, (0,), 0, ("wear_volume", "contact_radius"))
    assert benchmark(MODEL.compute, block).solves == 2000
