"""Sliding friction of general linear solids: temperature, varying materials, failures."""

import numpy as np
import pytest

from mdr_dask.models.base import Block, Status
from mdr_dask.models.parts.material import Material
from mdr_dask.models.sliding_friction import MODEL, SlidingFriction

ALL = MODEL.with_companions([output.name for output in MODEL.outputs])
LINE = {"length": 0.02, "points": 200, "rms_roughness": 5e-7}
LOAD = {"normal_force": 1.5, "velocity": 0.1}
KELVIN = {"shear_modulus": 1e7, "relaxation_time": 1e-3}
SOLID = {"static_modulus": 1e7, "glass_modulus": 5e7, "relaxation_time": 1e-3}


def block(parameters, columns, realisations=(0, 1), accuracy=None):
    arrays = {name: np.asarray(values) for name, values in columns.items()}
    cases = len(next(iter(arrays.values())))
    return Block(SlidingFriction.model_validate(parameters), arrays, cases, realisations, 7, ALL, accuracy)


def test_temperature_and_velocity_are_interchangeable():
    """Relaxation times multiplied by a_T = 10 have the same effect as the velocity multiplied by a_T."""
    law = {"wlf": {"c1": 11.0, "c2": 110.0, "reference": 300.0}}
    warm = {"standard_solid": SOLID, "temperature": 290.0} | law
    cool = MODEL.compute(block(LINE | LOAD | {"material": warm}, {"velocity": [0.01]}))
    factor = 10 ** (11 * 10 / 100)
    same = MODEL.compute(block(LINE | LOAD | {"material": {"standard_solid": SOLID}}, {"velocity": [0.01 * factor]}))
    assert cool.values["friction_coefficient"] == pytest.approx(same.values["friction_coefficient"], rel=1e-9)


def test_material_can_vary():
    materials = np.empty(2, dtype=object)
    materials[:] = [Material.model_validate({"kelvin": KELVIN}), Material.model_validate({"standard_solid": SOLID})]
    result = MODEL.compute(block(LINE | LOAD | {"material": materials[0]}, {"material": materials}))
    assert np.all(result.status == Status.DONE)
    assert np.all(result.values["friction_coefficient"][0] != result.values["friction_coefficient"][1])


def test_failed_cases_have_a_message():
    parameters = LINE | LOAD | {"material": {"kelvin": KELVIN}, "indenter": {"shape": "parabola", "radius": 1.0}}
    result = MODEL.compute(block(parameters, {"normal_force": [1e4]}))
    assert np.all(result.status == Status.FAILED)
    assert "the contact leaves the line" in result.messages[0, 0]
    assert np.all(np.isnan(result.values["friction_coefficient"]))
    bad = {"prony": {"static_modulus": 1e7, "moduli": (1.0,), "times": (-1.0,)}}
    result = MODEL.compute(block(LINE | LOAD | {"material": bad}, {"velocity": [0.1]}))
    assert "relaxation times must be positive" in result.messages[0, 0]
    assert result.solves == 0
