"""A result outside the range tested in docs/validity.md has a warning, in `check` and with the result."""

import numpy as np
import pytest

from mdr_dask.models.base import Block, Status
from mdr_dask.models.sliding_friction import MODEL as SLIDING
from mdr_dask.models.sliding_friction import SlidingFriction
from mdr_dask.models.velocity_jump import MODEL as JUMP
from mdr_dask.physics.surfaces.spectrum import self_affine

OUTPUTS = SLIDING.with_companions(["friction_coefficient", "contact_fraction"])
UNIT = 4e6 * 5e-3 * 2e-5  # 4 G L h, N


@pytest.fixture
def parameters(tmp_path):
    road = self_affine(0.8, 5e-3, 5e-5, 2e-5)
    wavenumber = np.geomspace(*road.wavenumber, 60)
    rows = zip(wavenumber, road.at(wavenumber), strict=True)
    (tmp_path / "road.csv").write_text("q [1/m],C2D [m^4]\n" + "".join(f"{q:.8g},{c:.8g}\n" for q, c in rows))
    surface = {"spectrum": str(tmp_path / "road.csv")}
    body = {"shear_modulus": 1e6, "relaxation_time": 1e-5, "velocity": 1.0, "normal_force": 1.0}
    return {"length": 5e-3, "points": 100, "surface": surface, **body}


STEP = {"protocol": {"shape": "steps", "times": [1e-6], "velocities": [1.0]}}
HEAVIER = {"protocol": {"shape": "ramp", "duration": 1e-6, "force": 1.5 * UNIT}}


@pytest.mark.parametrize(
    ("model", "load", "change", "words"),
    [
        (SLIDING, 0.01, {}, []),
        (SLIDING, 1.5, {}, ["above 1", "0.5 of the line in contact"]),
        (JUMP, 1.5, {}, ["above 1", "0.5 of the line in contact"]),
        (JUMP, 0.01, STEP, []),
        (JUMP, 0.01, HEAVIER, ["above 1"]),
    ],
)
def test_heavy_loads_on_a_spectrum(parameters, model, load, change, words):
    given = parameters | {"normal_force": load * UNIT} | change
    if model is JUMP:
        given["relaxation_times"] = (0.0, 0.1)
    case = model.parameters.model_validate(given)
    outputs = model.with_companions(["friction_coefficient"])
    result = model.compute(Block(case, {}, 1, (0,), 1, outputs, None))
    assert result.status[0, 0] == Status.DONE, result.messages
    message, note = result.messages.get((0, 0), ""), "".join(model.notes([case]))
    assert ("outside the range" in message) == bool(note) == bool(words)
    assert all(word in message for word in words)
    assert ("docs/validity.md" in note) == bool(words)


def test_generated_lines_and_measured_profiles_have_no_tested_range(parameters):
    line = {"length": 5e-3, "points": 200, "hurst": 0.8, "rms_roughness": 2e-5}
    case = SlidingFriction.model_validate(line | {k: parameters[k] for k in list(parameters)[3:]} | {"normal_force": 9})
    assert not SLIDING.notes([case])
    result = SLIDING.compute(Block(case, {"velocity": np.array([1.0])}, 1, (0,), 1, OUTPUTS, 0.05))
    assert not result.messages
