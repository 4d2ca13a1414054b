"""The model sliding_friction: every kind of line with every kind of solid, and the errors of the outputs."""

from itertools import product

import numpy as np
import pytest
from schemes import sampled

from mdr_dask.models.base import Block, Status
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction
from mdr_dask.physics.surfaces import roughness

OUTPUTS = tuple(MODEL.companions)
ALL = MODEL.with_companions(OUTPUTS)
LOAD = {"normal_force": 0.2, "velocity": 0.1}
GENERATED = {"length": 0.02, "points": 200, "rms_roughness": 5e-7}
KELVIN = {"shear_modulus": 1e7, "relaxation_time": 1e-3}
SOLIDS = {
    "kelvin": KELVIN,
    "kelvin material": {"material": {"kelvin": KELVIN}},
    "dashpot": {"material": {"prony": {"static_modulus": 1e7, "moduli": (), "times": (), "viscosity": 1e4}}},
    "standard": {
        "material": {"standard_solid": {"static_modulus": 1e7, "glass_modulus": 5e7, "relaxation_time": 1e-3}}
    },
}
BODIES = {"plane": {}, "parabola": {"indenter": {"shape": "parabola", "radius": 0.5}}}


def measured(path, oversampling=4):
    """Write the first realisation of the generated line to a file."""
    phase = roughness.phases(7, 0, 100)
    height = 5e-7 * sampled(roughness.amplitudes(100, 0.7), phase, 200 * oversampling)
    rows = np.column_stack([np.arange(height.size) * 0.02 / height.size, height])
    np.savetxt(path, rows, "%.17g", ",", header="x,z\nm,m", comments="")
    return {"surface": {"profile": str(path)}}


def solved(parameters, outputs=ALL, columns=None, accuracy=None):
    arrays = {name: np.asarray(values) for name, values in (columns or {}).items()}
    cases = len(next(iter(arrays.values()))) if arrays else 1
    block = Block(SlidingFriction.model_validate(LOAD | parameters), arrays, cases, (0,), 7, outputs, accuracy)
    return MODEL.compute(block)


@pytest.mark.parametrize("body", BODIES)
def test_every_line_with_every_solid(tmp_path, body):
    """The same line and Kelvin body, given in different ways, give the same results within their errors."""
    lines = {"generated": GENERATED, "measured": measured(tmp_path / "line.csv")}
    found = {}
    for (line, numbers), (solid, material) in product(lines.items(), SOLIDS.items()):
        result = solved(numbers | material | BODIES[body], accuracy=1e-3)
        assert result.status[0, 0] == Status.DONE, result.messages
        found[line, solid] = {name: float(result.values[name][0, 0]) for name in ALL}
    kelvin = found["generated", "kelvin"]
    for line, solid in found:
        if solid != "standard":
            for name in OUTPUTS:
                margin = kelvin[f"{name}_error"] + found[line, solid][f"{name}_error"]
                assert abs(found[line, solid][name] - kelvin[name]) <= 2 * margin + 1e-9 * abs(kelvin[name])
    for solid in ("kelvin material", "dashpot"):
        assert found["generated", solid] == pytest.approx(kelvin, rel=1e-12)
    standard = found["generated", "standard"]["friction_coefficient"]
    assert found["measured", "standard"]["friction_coefficient"] == pytest.approx(standard, rel=2e-3)
    assert abs(standard / kelvin["friction_coefficient"] - 1) > 0.01


def test_errors_are_computed_only_on_request():
    with_errors, without = (
        solved(GENERATED | KELVIN | {"oversampling": 4}, outputs) for outputs in (ALL, ("friction_coefficient",))
    )
    assert set(without.values) == {"friction_coefficient"}
    friction = without.values["friction_coefficient"]
    assert friction.tobytes() == with_errors.values["friction_coefficient"].tobytes()
