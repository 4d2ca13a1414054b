import numpy as np
import pytest

from mdr_dask.models.base import Block, Status
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction

BASE = SlidingFriction(
    length=0.02,
    points=200,
    rms_roughness=5e-7,
    shear_modulus=1e7,
    relaxation_time=1e-3,
    normal_force=1.5,
    velocity=0.1,
)
ALL = tuple(output.name for output in MODEL.outputs)


def make(columns, outputs=ALL, realisations=(0, 1), accuracy=None, **changes):
    columns = {name: np.asarray(values) for name, values in columns.items()}
    cases = len(next(iter(columns.values())))
    return Block(BASE.model_copy(update=changes), columns, cases, realisations, 7, outputs, accuracy)


def grid():
    force, velocity = np.meshgrid(np.geomspace(1e-3, 1e2, 4), np.geomspace(1e-4, 1e2, 4), indexing="ij")
    return {"normal_force": force.ravel(), "velocity": velocity.ravel()}


@pytest.mark.parametrize("scheme", ["hermite", "piecewise_linear", "backward_euler"])
@pytest.mark.parametrize("oversampling", [1, 4, "auto"])
def test_a_value_does_not_depend_on_its_neighbours(scheme, oversampling):
    block = make(grid(), scheme=scheme, oversampling=oversampling, accuracy=0.1)
    whole = MODEL.compute(block)
    assert np.all(whole.status == Status.DONE)
    for index in (0, 6, 15):
        alone = MODEL.compute(block.part(index, 1))
        for name in ALL:
            assert alone.values[name][0, 0].tobytes() == whole.values[name][index, 1].tobytes()


def test_equal_dimensionless_numbers_are_solved_once():
    # the same F_N / (G h L) and v tau / L, reached through different parameters
    block = make(
        {
            "normal_force": [1.5, 15.0, 0.15],
            "shear_modulus": [1e7, 1e8, 1e7],
            "rms_roughness": [5e-7, 5e-7, 5e-8],
            "velocity": [0.1, 0.3, 0.7],
            "relaxation_time": [1e-3, 1e-3 / 3, 1e-3 / 7],
        }
    )
    result = MODEL.compute(block)
    assert MODEL.distinct(block) == 2
    assert result.solves == 2
    scaled = result.values["friction_coefficient"] / result.values["rms_slope"]
    assert np.ptp(scaled, axis=0) == pytest.approx(0, abs=1e-14)
