"""A result outside the range that docs/validity.md has tested says so, in `check` and beside the result."""

import numpy as np
import pytest

from mdr_dask.models.base import Block, Status
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction
from mdr_dask.physics.surfaces.spectrum import self_affine

OUTPUTS = MODEL.with_companions(["friction_coefficient", "contact_fraction"])


@pytest.fixture
def parameters(tmp_path):
    road = self_affine(0.8, 5e-3, 5e-5, 2e-5)
    wavenumber = np.geomspace(*road.wavenumber, 60)
    rows = zip(wavenumber, road.at(wavenumber), strict=True)
    (tmp_path / "road.csv").write_text("q [1/m],C2D [m^4]\n" + "".join(f"{q:.8g},{c:.8g}\n" for q, c in rows))
    surface = {"spectrum": str(tmp_path / "road.csv")}
    body = {"shear_modulus": 1e6, "relaxation_time": 1e-5, "velocity": 1.0, "normal_force": 1.0}
    return {"length": 5e-3, "points": 200, "surface": surface, **body}


@pytest.mark.parametrize(("load", "words"), [(0.01, []), (1.5, ["above 1", "0.5 of the line in contact"])])
def test_heavy_loads_on_a_spectrum(parameters, load, words):
    force = load * 4e6 * 5e-3 * 2e-5  # F / (4 G L h)
    case = SlidingFriction.model_validate(parameters | {"normal_force": force})
    result = MODEL.compute(Block(case, {}, 1, (0,), 1, OUTPUTS, 0.05))
    assert result.status[0, 0] == Status.DONE
    message, note = result.messages.get((0, 0), ""), "".join(MODEL.notes([case]))
    assert bool(message) == bool(note) == bool(words)
    assert all(word in message for word in words)
    assert ("docs/validity.md" in note) == bool(words)


def test_generated_lines_and_lines_as_they_are_make_no_claim_about_a_surface(parameters):
    line = {"length": 5e-3, "points": 200, "hurst": 0.8, "rms_roughness": 2e-5}
    case = SlidingFriction.model_validate(line | {k: parameters[k] for k in list(parameters)[3:]} | {"normal_force": 9})
    assert not MODEL.notes([case])
    result = MODEL.compute(Block(case, {"velocity": np.array([1.0])}, 1, (0,), 1, OUTPUTS, 0.05))
    assert not result.messages
