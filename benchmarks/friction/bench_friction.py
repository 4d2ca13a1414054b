"""Kernel time of steady friction for a force series of the PRL campaign: 20 loads, 20 velocities, 5000 points."""

import numpy as np
import pytest

from mdr_dask.models.base import Block
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction

BASE = SlidingFriction(
    length=0.02,
    points=5000,
    oversampling=1,
    rms_roughness=5e-7,
    shear_modulus=1e7,
    relaxation_time=1e-3,
    normal_force=1.5,
    velocity=0.1,
)


def force_series(scheme, oversampling, hurst=0.7, realisations=4):
    force, velocity = np.meshgrid(np.geomspace(1e-3, 1e2, 20), np.geomspace(1e-4, 1e2, 20), indexing="ij")
    columns = {"normal_force": force.ravel(), "velocity": velocity.ravel()}
    parameters = BASE.model_copy(update={"scheme": scheme, "oversampling": oversampling, "hurst": hurst})
    return Block(parameters, columns, 400, tuple(range(realisations)), 2013, ("friction_coefficient",))


@pytest.mark.parametrize(
    ("scheme", "oversampling"),
    [("backward_euler", 1), ("piecewise_linear", 1), ("hermite", 1), ("hermite", 2), ("hermite", "auto")],
)
@pytest.mark.parametrize("hurst", [0.0, 0.7])
def test_force_series(benchmark, scheme, oversampling, hurst):
    block = force_series(scheme, oversampling, hurst)
    MODEL.compute(block.part(0, 0))
    result = benchmark(MODEL.compute, block)
    assert np.all(result.status == 1)
