"""What campaigns of steady friction and its kinetics name and get: declarations, values, errors, words, estimates."""

from typing import Any

import numpy as np
import pytest
import record
from pydantic import ValidationError

from mdr_dask.models import sliding_friction, velocity_jump
from mdr_dask.models.base import Block
from mdr_dask.models.parts.sliding_body import frequency_notes
from mdr_dask.models.parts.sliding_problem import LEAST, STATUS, sliding_problems
from mdr_dask.physics.outcome import Outcome

MODELS = {"friction": sliding_friction.MODEL, "jump": velocity_jump.MODEL}
LINE = {"length": 0.013, "points": 64, "rms_roughness": 7e-7, "hurst": 0.6}
KELVIN = {"shear_modulus": 2.3e6, "relaxation_time": 3e-4}
LOAD = {"normal_force": 0.17, "velocity": 0.23}
PRONY = {"prony": {"static_modulus": 3e6, "moduli": (7e6, 2e6), "times": (0.03, 4e-4), "viscosity": 11.0}}
STANDARD = {"standard_solid": {"static_modulus": 3e6, "glass_modulus": 5e7, "relaxation_time": 2e-3}}
POWER = {
    "power_law": {
        "static_modulus": 2e6,
        "loss_modulus": 1e5,
        "frequency": 1e3,
        "exponent": 0.3,
        "lowest": 1.0,
        "highest": 1e5,
    }
}
INDENTERS: dict[str, dict[str, Any]] = {
    "cone": {"shape": "cone", "angle": 0.01},
    "parabola": {"shape": "parabola", "radius": 0.31},
    "power": {"shape": "power", "exponent": 1.6, "coefficient": 0.13},
    "rounded": {"shape": "rounded_cone", "angle": 0.011, "tip_radius": 0.04},
}
SPEEDS = {"velocity": np.array([1e-4, 0.023, 1.9, 0.023]), "normal_force": np.array([0.003, 0.17, 2.1, 0.17])}
WRONG = {
    "velocity": np.array([0.0, np.nan, 1e200, 0.02, 0.02]),
    "normal_force": np.array([0.1, 0.1, 0.1, np.inf, 1e-150]),
}


def block(name, columns, realisations=(0, 4), accuracy=None, outputs=None, **parameters):
    model = MODELS[name]
    every = model.with_companions(outputs or tuple(output.name for output in model.outputs))
    arrays = {key: np.asarray(values) for key, values in columns.items()}
    cases = len(next(iter(arrays.values())))
    whole = model.parameters.model_validate(LINE | LOAD | parameters)
    return Block(whole, arrays, cases, realisations, 9, every, accuracy)


def sizes(values):
    with np.errstate(all="ignore"):
        return np.log10(np.maximum(np.abs(values), 1e-14))


def told(name, one):
    """Return all that a block gives: numbers in units, states, words, and what is expected of it beforehand."""
    model = MODELS[name]
    found = model.compute(one)
    first = {"friction_coefficient", "friction_coefficient_jump", "indentation_depth"}
    scene = {key: sizes(values) for key, values in found.values.items() if key in first}
    for kind, is_error in (("others", False), ("errors", True)):
        others = [
            values for key, values in found.values.items() if key.endswith("_error") == is_error and key not in first
        ]
        scene[kind] = sizes(np.concatenate([[1.0], *map(np.ravel, others)]))
    scene["words"] = " ".join(f"{place}: {words}" for place, words in sorted(found.messages.items()))
    estimates = [model.seconds(one), model.distinct(one), found.solves, model.memory(one) if model.memory else 1]
    scene["estimates and states"] = np.append(sizes(np.array(estimates)), found.status)
    return scene


def check(regression, scenes):
    record.check(
        regression, {f"{scene}: {key}": value for scene, each in scenes.items() for key, value in each.items()}
    )


def test_steady_friction_of_blocks(dataframe_regression):
    found = {"kelvin": told("friction", block("friction", SPEEDS, **KELVIN))}
    for scheme in ("hermite", "piecewise_linear", "backward_euler"):
        for oversampling in (2, "auto"):
            more = {"scheme": scheme, "oversampling": oversampling, "hurst": 0.2}
            found[f"{scheme} {oversampling}"] = told(
                "friction", block("friction", SPEEDS, accuracy=0.03, **KELVIN, **more)
            )
    some = ("friction_coefficient", "rms_slope")
    found["late"] = told("friction", block("friction", SPEEDS, (1,), 1e-9, **KELVIN))
    found["late in some"] = told("friction", block("friction", SPEEDS, (1,), 1e-7, some, **KELVIN))
    for name, indenter in INDENTERS.items():
        found[name] = told("friction", block("friction", SPEEDS, (2,), 0.03, indenter=indenter, **KELVIN))
        smooth = {"rms_roughness": 0.0, "indenter": indenter}
        found[f"smooth {name}"] = told("friction", block("friction", SPEEDS, (2,), 0.1, **smooth, **KELVIN))
    found["smooth"] = told("friction", block("friction", SPEEDS, rms_roughness=0.0, **KELVIN))
    for name, material in {"prony": PRONY, "standard": STANDARD, "power": POWER}.items():
        found[name] = told("friction", block("friction", SPEEDS, (0,), 0.04, material=material))
        found[f"{name} on a grid"] = told(
            "friction", block("friction", SPEEDS, (0,), oversampling=4, material=material)
        )
    ends = {"rolloff_wavelength": np.array([0.002, 0.009, 1e-9]), "longest_wavelength": np.array([0.005, 0.013, 1e-8])}
    found["cut off"] = told("friction", block("friction", ends, **KELVIN))
    found["wrong"] = told("friction", block("friction", WRONG, **KELVIN))
    check(dataframe_regression, found)


def test_a_smooth_plane_has_no_friction_and_misses_no_accuracy():
    found = MODELS["friction"].compute(block("friction", SPEEDS, rms_roughness=0.0, **KELVIN))
    assert np.all(found.values["friction_coefficient"] == 0)
    assert np.all(found.values["friction_coefficient_error"] == 0)
    assert not found.messages


TIMES = {"relaxation_times": (0.0, 0.5, 1.5), "points": 32}
#: Bodies whose friction does not change at once, or is none before.
WITHOUT = {
    "no dashpot": {"material": STANDARD},
    "ramp": {"protocol": {"shape": "ramp", "duration": 4e-4, "velocity": 0.07, "force": 0.2}, **KELVIN},
    "from rest": {"protocol": {"shape": "ramp", "duration": 4e-4, "start": "rest"}, **KELVIN},
}


@pytest.mark.parametrize("what", WITHOUT)
def test_a_jump_that_is_none_misses_an_accuracy_only_where_its_error_counts_beside_friction(what):
    model, few = MODELS["jump"], {"velocity": np.array([0.02, 0.3])}
    loose, strict = (model.compute(block("jump", few, (0,), each, **WITHOUT[what], **TIMES)) for each in (0.5, 1e-7))
    jump, error = (loose.values[f"friction_coefficient_jump{end}"] for end in ("", "_error"))
    assert np.all(np.abs(jump) <= error)
    assert not loose.messages
    assert all("friction_coefficient_jump by " in told for told in strict.messages.values())
    assert len(strict.messages) == 2
    assert not any("inf" in told or "unknown" in told for told in strict.messages.values())


def test_kinetics_of_blocks(dataframe_regression):
    times = {"relaxation_times": (0.0, 0.003, 0.2, 1.1, 9.0), "points": 32}
    changes = SPEEDS | {"velocity_change": np.array([0.2, -0.3, 1.7, 0.2])}
    found = {}
    for accuracy in (None, 0.03, 1e-7):
        found[f"kelvin {accuracy}"] = told("jump", block("jump", changes, (0, 4), accuracy, **KELVIN, **times))
    levels = ("friction_coefficient_before", "friction_coefficient_jump")
    found["levels"] = told("jump", block("jump", changes, (1,), 0.02, levels, **KELVIN, **times))
    found["slopes"] = told("jump", block("jump", changes, (1,), 0.02, ("rms_slope",), **KELVIN, **times))
    few = {"velocity": np.array([0.02, 0.3])}
    steps = {"shape": "steps", "times": (0.0, 2e-4, 3e-4), "velocities": (0.1, 0.02, 0.03), "forces": (0.2, 0.2, 0.11)}
    protocols = {
        "steps": steps,
        "steps from rest": steps | {"start": "rest", "forces": None},
        "ramp": {"shape": "ramp", "duration": 4e-4, "velocity": 0.07, "force": 0.2},
        "ramp to the same": {"shape": "ramp", "duration": 4e-4, "start": "rest"},
        "oscillation": {"shape": "oscillation", "amplitude": 0.01, "frequency": 300.0, "force_amplitude": 0.05},
        "heavy oscillation": {"shape": "oscillation", "amplitude": 0.01, "frequency": 300.0, "force_amplitude": 5.0},
    }
    more = times | {"relaxation_times": (0.0, 0.5, 1.5)}
    for name, protocol in protocols.items():
        found[name] = told("jump", block("jump", few, (0,), 0.5, protocol=protocol, **KELVIN, **more))
    for name, material in {"prony": PRONY, "standard": STANDARD}.items():
        found[name] = told("jump", block("jump", few, (0,), 0.5, material=material, **more))
    parabola = {"indenter": INDENTERS["parabola"]}
    found["parabola"] = told("jump", block("jump", few, (0,), 0.5, **parabola, **KELVIN, **more))
    found["too fast"] = told("jump", block("jump", {"velocity": [1e5]}, (0,), 0.5, **parabola, **KELVIN, **more))
    same = {"velocity_change": np.array([1e-18, -1.0 + 1e-120, 1e120])}
    found["no jump"] = told("jump", block("jump", same, (0,), **KELVIN, **times))
    found["wrong"] = told("jump", block("jump", WRONG, (0,), **KELVIN, **times))
    check(dataframe_regression, found)


def leaves(node, path=""):
    if isinstance(node, dict):
        for key, value in node.items():
            yield from leaves(value, f"{path}.{key}" if path else str(key))
    else:
        yield f"{path} = {node}"


def test_declarations(dataframe_regression):
    """Every parameter with its unit, bounds, usual value and sense, every output, and what pages show of them."""
    found: dict[str, Any] = {}
    for name in MODELS:
        found |= {key: words for key, words in declared(name).items() if words not in found.values()}
    for key, coordinate in velocity_jump.MODEL.coordinates(
        velocity_jump.VelocityJump(**LINE, **LOAD, **KELVIN)
    ).items():
        found[f"coordinate {key}"] = f"{coordinate.unit} {coordinate.long_name}"
        found[f"values of {key}"] = coordinate.values
    record.check(dataframe_regression, found)


def declared(name):
    model, found = MODELS[name], {}
    schema = model.parameters.model_json_schema()
    for part, definition in {**schema.pop("$defs"), name: schema}.items():
        for parameter, of_it in definition.pop("properties", {}).items():
            found[f"{part}.{parameter}"] = f"{parameter}: {'; '.join(sorted(leaves(of_it)))}"
        found[part] = "; ".join(sorted(leaves(definition)))
    for output in model.outputs:
        found[f"output {output.name}"] = str(output)
    for number in model.numbers:
        found[f"number {number.name}"] = str(number)
    found[f"model {name}"] = " | ".join(map(str, (model.name, model.summary, model.whole, model.compiling)))
    found[f"companions of {name}"] = " ".join(model.with_companions(tuple(output.name for output in model.outputs)))
    return found


WRONG_SETS: dict[str, dict[str, Any]] = {
    "no hurst": {"hurst": None},
    "two bodies": {"material": PRONY},
    "no body": {"shear_modulus": None},
    "no length": {"length": None},
    "an angle beyond a right one": {"indenter": {"shape": "cone", "angle": 1.6}},
    "a tip beyond a right angle": {"indenter": {"shape": "rounded_cone", "angle": 1.6, "tip_radius": 1.0}},
    "times back": {"relaxation_times": (0.1, 0.05)},
    "times before": {"relaxation_times": (-0.1, 0.05)},
    "no change": {"velocity_change": 0.0},
    "few velocities": {"protocol": {"shape": "steps", "times": (0.0, 1.0), "velocities": (1.0,)}},
    "falling times": {"protocol": {"shape": "steps", "times": (1.0, 1.0), "velocities": (1.0, 2.0)}},
    "negative times": {"protocol": {"shape": "steps", "times": (-1.0, 1.0), "velocities": (1.0, 2.0)}},
    "no force": {"protocol": {"shape": "steps", "times": (0.0, 1.0), "velocities": (1.0, 2.0), "forces": (1.0, 0.0)}},
    "few forces": {"protocol": {"shape": "steps", "times": (0.0, 1.0), "velocities": (1.0, 2.0), "forces": (1.0,)}},
}


def test_words_of_what_is_refused(dataframe_regression):
    found = {}
    for name, wrong in WRONG_SETS.items():
        with pytest.raises(ValidationError) as caught:
            velocity_jump.VelocityJump.model_validate(LINE | LOAD | KELVIN | wrong)
        found[name] = "; ".join(f"{each['loc']}: {each['msg']}" for each in caught.value.errors())
    record.check(dataframe_regression, found)


def test_cases_without_units(dataframe_regression):
    found = {}
    columns = {"length": np.array([0.013, 0.02]), "velocity": np.array([0.1, 0.3]), "points": np.array([64, 72])}
    for name, more in {
        "kelvin": KELVIN,
        "prony": {"material": PRONY},
        "smooth": KELVIN | {"rms_roughness": 0.0},
    }.items():
        for shape in ("cone", "rounded"):
            problems = sliding_problems(block("friction", columns, indenter=INDENTERS[shape], **more))
            numbers = [getattr(problems, each) for each in ("loads", "deborah", "length", "height")]
            found[f"{name} {shape}"] = sizes(np.array(numbers))
            for k, setting in enumerate(problems.settings):
                found[f"{name} {shape} {k}"] = f"{setting.roughness} {setting.body} {setting.arms}"
    found["least"] = str(LEAST)
    found["states"] = " ".join(f"{outcome.name} {STATUS[outcome]}" for outcome in Outcome)
    sets = [MODELS["friction"].parameters.model_validate(LINE | LOAD | more) for more in (KELVIN, {"material": POWER})]
    for factor in (1e-6, 1.0, 1e3, 1e9):
        moved = [one.model_copy(update={"velocity": factor * one.velocity}) for one in sets]
        found[f"frequencies {factor}"] = " ".join(frequency_notes([moved[0], moved[1], sets[1]]))
    record.check(dataframe_regression, found)
