"""A change of the units of length, mass and time changes every output by the power that its unit implies.

Factors are powers of two, so that the change of units causes no rounding errors. In some rows, not all units can be
changed freely, because the physics contains numbers with a unit: the constants of the laws of Roelands and of Dowson
and Higginson (pressure, viscosity), the gas constant, and the zero of the Celsius scale.
"""

import re
from functools import reduce

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import BaseModel
from test_extremes import BALL, FILM, JUMP, KELVIN, LINE, ROLLERS, WEAR

from mdr_dask.models import load
from mdr_dask.models.base import Block, Status, unit_of

BASE = {
    "1": (0, 0, 0),
    "rad": (0, 0, 0),
    "K": (0, 0, 0),
    "m": (1, 0, 0),
    "s": (0, 0, 1),
    "Hz": (0, 0, -1),
    "kg": (0, 1, 0),
    "N": (1, 1, -2),
    "Pa": (-1, 1, -2),
    "ohm": (0, 0, 0),
    "S": (0, 0, 0),
}
FREE = ("length", "mass", "time")
#: Units in which a pressure and a viscosity keep their numbers.
AT_ONE_PRESSURE = ("length",)


def powers(unit, exponent=None):
    """Return the powers of length, mass and time in a unit such as ``kg/m^3``, ``N/m`` or ``Pa*s``."""
    if unit == "m^(1-n)":
        return np.array([1 - exponent, 0, 0])
    if unit.startswith("ohm m"):  # of the length only: electrical units have no mass here
        return np.array([1, 0, 0])
    total, sign = np.zeros(3), 1
    for part in re.split(r"([*/ ])", unit):
        if part in "*/ ":
            sign = -1 if part == "/" else sign
            continue
        name, _, power = part.partition("^")
        total = total + sign * int(power or 1) * np.array(BASE[name])
    return total


def scaled(parameters, factors):
    """Return a parameter set in other units: every quantity, also those in structures and lists."""
    changes = {}
    for name in type(parameters).model_fields:
        value, unit = getattr(parameters, name), unit_of(type(parameters), name)
        if isinstance(value, BaseModel):
            changes[name] = scaled(value, factors)
        elif unit is not None and isinstance(value, float | tuple):
            factor = float(np.prod(factors ** powers(unit, getattr(parameters, "exponent", None))))
            changes[name] = value * factor if isinstance(value, float) else tuple(one * factor for one in value)
    return parameters.model_copy(update=changes)


TERMS = {"material": {"prony": {"static_modulus": 1e7, "moduli": (1e7, 3e8), "times": (1e-2, 1e-4), "viscosity": 50.0}}}
FRETTING = WEAR | {"points": 20}
SLIDING_FILM = FILM | {"slide_roll_ratio": 0.1}
LONG_ROLLERS = ROLLERS | {"points": 20_000, "trace_points": 100}
#: Model, parameters, and the units that may be changed freely; one row for each solver.
ROWS = {
    "friction": ("sliding_friction", LINE | KELVIN, FREE),
    "friction, roll-off": (
        "sliding_friction",
        LINE | KELVIN | {"rolloff_wavelength": 5e-3, "longest_wavelength": 0.01, "oversampling": 4},
        FREE,
    ),
    "friction, papers' steps": ("sliding_friction", LINE | KELVIN | {"scheme": "backward_euler"}, FREE),
    "friction, cone": ("sliding_friction", LINE | KELVIN | {"indenter": {"shape": "cone", "angle": 0.05}}, FREE),
    "friction, Prony terms": ("sliding_friction", LINE | TERMS, FREE),
    "jump": ("velocity_jump", JUMP | KELVIN, FREE),
    "steps": (
        "velocity_jump",
        JUMP
        | KELVIN
        | {"protocol": {"shape": "steps", "times": (0.0, 5e-4), "velocities": (0.06, -0.1), "forces": (2.0, 1.0)}},
        FREE,
    ),
    "ramp": (
        "velocity_jump",
        JUMP
        | KELVIN
        | {"protocol": {"shape": "ramp", "start": "rest", "duration": 1e-3, "velocity": 0.2, "force": 2.0}},
        FREE,
    ),
    "oscillation": (
        "velocity_jump",
        JUMP
        | KELVIN
        | {"protocol": {"shape": "oscillation", "amplitude": 0.02, "frequency": 250.0, "force_amplitude": 0.5}},
        FREE,
    ),
    "wear": ("fretting_wear", FRETTING | BALL, FREE),
    "wear, force": ("fretting_wear", FRETTING | BALL | {"hold": "force"}, FREE),
    "wear, fast": ("fretting_wear", FRETTING | BALL | {"wear_rule": "fast"}, FREE),
    "wear, cone": ("fretting_wear", FRETTING | {"indenter": {"shape": "cone", "angle": 0.05}, "depth": 1e-6}, FREE),
    "wear, history": (
        "fretting_wear",
        {name: value for name, value in (FRETTING | BALL).items() if name != "cycles"}
        | {"cells": 40, "history": ({"cycles": 1e4}, {"cycles": 1e4, "amplitude_factor": 1.5, "load_factor": 1.2})},
        FREE,
    ),
    "wear, path": (
        "fretting_wear",
        {name: FRETTING[name] for name in ("contact_modulus", "hardness", "wear_coefficient", "points")}
        | BALL
        | {"path": 0.1},
        FREE,
    ),
    "film": ("ehl_line", SLIDING_FILM | {"compressible": False}, FREE),
    "film, compressible": ("ehl_line", SLIDING_FILM, AT_ONE_PRESSURE),
    "film, starved, Eyring": (
        "ehl_line",
        SLIDING_FILM | {"compressible": False, "inlet": -1.5, "shear_law": "eyring", "eyring_stress": 5e6},
        FREE,
    ),
    "film, Roelands": ("ehl_line", SLIDING_FILM | {"viscosity_law": "roelands"}, AT_ONE_PRESSURE),
    "rollers": ("mixed_lubrication", LONG_ROLLERS | {"film_thickness": 4e-7}, AT_ONE_PRESSURE),
    "rollers, slip, formula": ("mixed_lubrication", LONG_ROLLERS | {"slide_roll_ratio": 0.1}, AT_ONE_PRESSURE),
    "rollers, EHL, strong layer": (
        "mixed_lubrication",
        LONG_ROLLERS | {"slide_roll_ratio": 0.05, "film_formula": "ehl", "layer_shear_strength": 1e6},
        AT_ONE_PRESSURE,
    ),
}

#: Outputs without a value: friction in the steady state if the last state is not steady.
NO_VALUE = {
    "steps": {"friction_coefficient_after", "friction_coefficient_after_error"},
    "oscillation": {"friction_coefficient_after", "friction_coefficient_after_error"},
}


def solved(model, parameters):
    outputs = model.with_companions([output.name for output in model.outputs])
    return model.compute(Block(parameters, {}, 1, (1,), 5, outputs, None))


def units_of(model, parameters):
    known = {output.name: output.unit for output in (*model.outputs, *model.companions.values())}
    return known | (model.units(parameters) if model.units else {})


@pytest.mark.slow
@pytest.mark.parametrize("name", ROWS)
@settings(max_examples=1, deadline=None)
@given(data=st.data())
def test_every_output_scales_with_its_unit(name, data):
    model_name, numbers, free = ROWS[name]
    model = load(model_name)
    drawn = {unit: 2.0 ** data.draw(st.integers(-3, 3).filter(bool), unit) for unit in free}
    if free == AT_ONE_PRESSURE:
        drawn |= {"mass": drawn["length"], "time": 1.0}
    factors = np.array([drawn[unit] for unit in FREE])
    plain = model.parameters.model_validate(numbers)
    other = scaled(plain, factors)
    assert other != plain
    one, two = solved(model, plain), solved(model, other)
    assert one.status[0, 0] == two.status[0, 0] == Status.DONE, [*one.messages.values(), *two.messages.values()]
    changed = 0
    for output, unit in units_of(model, plain).items():
        if output not in one.values:
            continue
        factor = float(reduce(np.multiply, factors ** powers(unit)))
        value, found = one.values[output][0, 0], two.values[output][0, 0]
        scale = np.max(np.abs(value), initial=0.0, where=np.isfinite(value))
        rounding = 1e-6 if output.endswith("_error") else 1e-8  # a difference of two grids may be next to nothing
        np.testing.assert_allclose(found / factor, value, rtol=rounding, atol=1e-9 * scale, err_msg=output)
        assert np.isfinite(value).any() == (output not in NO_VALUE.get(name, ())), output
        assert not output.endswith("_error") or not np.any(value < 0), output
        changed += factor != 1 and np.any(found != value)
    assert changed or all(unit == "1" for unit in units_of(model, plain).values())
