"""Whole blocks of fretting wear on record: rules, bodies, units, histories, sliding, scatter, and what is refused."""

import itertools

import numpy as np
import record
from flattened import flat, of_result

from mdr_dask.models import load
from mdr_dask.models.base import Block
from mdr_dask.models.fretting_wear.solve import _first_accuracy, distinct, seconds

MODEL = load("fretting_wear")
ALL = tuple(output.name for output in MODEL.outputs)
FEW = ("contact_radius", "wear_volume", "contact_force", "stick_border")
STEEL = {
    "indenter": {"shape": "parabola", "radius": 0.011},
    "contact_modulus": 1.13e11,
    "effective_shear_modulus": 8.7e10,
    "friction": 0.57,
    "amplitude": 0.9e-6,
    "normal_force": 47.0,
    "hardness": 2.1e9,
    "wear_coefficient": 1.2e-4,
    "cycles": 3e5,
    "points": 11,
}


def block(outputs=FEW, columns=None, accuracy=None, realisations=(0,), **given):
    columns = {name: np.asarray(values) for name, values in (columns or {}).items()}
    cases = len(next(iter(columns.values()))) if columns else 1
    return Block(MODEL.parameters(**given), columns, cases, realisations, 5, MODEL.with_companions(outputs), accuracy)


def test_worn_contacts(dataframe_regression):
    scatter = {"friction_scatter": 0.11, "amplitude_scatter": 0.07, "wear_coefficient_scatter": 0.23}
    steps = [{"cycles": 1e5}, {"cycles": 2e5, "amplitude_factor": 1.3}, {"cycles": 9e4, "load_factor": 1.2}]
    pure = {"stick_radius": 0.61, "points": 7, "extent": 1.3}
    cone, blunt = {"shape": "cone", "angle": 0.05}, {"shape": "power", "exponent": 3.3, "coefficient": 9e5}
    rounded = {"shape": "rounded_cone", "angle": 0.03, "tip_radius": 0.002}
    deep = {name: value for name, value in STEEL.items() if name != "normal_force"} | {"depth": 5e-6}
    oscillating = "amplitude", "friction", "effective_shear_modulus", "cycles"
    slid = {name: value for name, value in STEEL.items() if name not in oscillating}
    loaded = {name: value for name, value in STEEL.items() if name != "cycles"}
    loaded |= {"history": steps, "cells": 41, "amplitude": 0.7e-6}
    few_steps = {"history": [{"cycles": 0.2}, {"cycles": 0.1, "load_factor": 1.1}], "cells": 31}
    scenes = {
        "exact": block(ALL, **STEEL),
        "fast": block(ALL, {"cycles": [1e3, 2e5]}, **STEEL | {"wear_rule": "fast", "xi": 0.93}),
        "limit": block(ALL, **STEEL | {"wear_rule": "limit"}),
        "scatter": block(FEW, {"friction": [0.5, 0.7]}, realisations=(0, 4), **STEEL | {"wear_rule": "fast"} | scatter),
        "exact scatter": block(FEW, realisations=(0, 4), **STEEL | {"accuracy": 0.01} | scatter),
        "accurate": block(FEW, {"cycles": [1e3, 2e5]}, 1e-3, **STEEL),
        "volumes": block(("wear_volume",), {"cycles": [1e3, 2e5]}, 4e-3, **STEEL),
        "force": block(FEW, {"wear_rule": ["exact", "fast", "limit"]}, 0.02, **STEEL | {"hold": "force"}),
        "cone": block(FEW, **STEEL | {"indenter": cone}),
        "angles": block(FEW, {"indenter.angle": [0.02, 0.05]}, **STEEL | {"indenter": cone, "wear_rule": "limit"}),
        "radii": block(FEW, {"indenter.radius": [0.007, 0.03]}, **STEEL | {"wear_rule": "limit"}),
        "blunt": block(FEW, **STEEL | {"indenter": blunt, "wear_rule": "fast"}),
        "rounded": block(FEW, {"depth": [5e-6, 7e-6]}, **deep | {"indenter": rounded, "wear_rule": "fast"}),
        "deep": block(FEW, {"depth": [2e-6, 5e-6]}, **deep | {"wear_rule": "limit"}),
        "history": block(ALL, **loaded),
        "history of forces": block(FEW, **loaded | {"hold": "force"}),
        "sliding": block(ALL, **slid | {"path": 0.8}),
        "sliding far": block(FEW, {"path": [0.1, 3.0]}, **slid | {"path": 0.8, "hold": "force", "accuracy": 0.01}),
        "pure": block(ALL, {"cycles": [0.0, 0.3, 9.0]}, **pure | {"accuracy": 0.003}),
        "pure history": block(ALL[8:13], **pure | few_steps),
        "pure sliding": block(FEW, path=1.1, points=5),
        "gross slip": block(FEW, {"amplitude": [1e-7, 1e-4, 1e-27]}, **STEEL | {"wear_rule": "limit"}),
        "gross slip beside": block(FEW, {"amplitude": [1e-7, 1e-4]}, **STEEL | {"accuracy": 0.01}),
        "huge": block(FEW, {"cycles": [1e3, 1e29]}, **STEEL | {"wear_rule": "limit"}),
    }
    found = {name: of_result(MODEL.compute(one)) for name, one in scenes.items()}
    found |= {"seconds": np.array([seconds(one) for one in scenes.values()])}
    found |= {"distinct": [str(distinct(one)) for one in scenes.values()]}
    found |= {"units": [str(sorted(MODEL.units(scenes[name].parameters).items())) for name in ("pure", "exact")]}
    found |= {"coordinates": MODEL.coordinates(scenes["history"].parameters)}
    found |= {"notes": [*scenes["fast"].parameters.notes(), *scenes["limit"].parameters.notes()]}
    record.check(dataframe_regression, flat("", found))


def test_first_accuracies(dataframe_regression):
    choices = itertools.product((None, 0.03, 2e-4), (None, 0.1, 1e-3, 1e-7), (0.2, 1.0))
    record.check(dataframe_regression, {str(each): _first_accuracy(*each) for each in choices})
