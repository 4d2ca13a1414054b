import numpy as np
import pytest
from friction_store import relative_error
from pydantic import ValidationError

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


@pytest.mark.slow
def test_kelvin_as_a_material_is_the_kelvin_body():
    columns = {"velocity": [1e-3, 0.1, 1.0], "normal_force": [0.1, 1.0, 10.0]}
    ours = MODEL.compute(block(LINE | LOAD | {"material": {"kelvin": KELVIN}}, columns, accuracy=1e-3))
    theirs = MODEL.compute(block(LINE | LOAD | KELVIN, columns, accuracy=1e-3))
    for name, tolerance in (("friction_coefficient", 5e-3), ("rms_slope", 1e-12), ("contact_fraction", 0.03)):
        np.testing.assert_allclose(ours.values[name], theirs.values[name], rtol=tolerance)
    np.testing.assert_allclose(ours.values["indentation_depth"], theirs.values["indentation_depth"], rtol=1e-3)


@pytest.mark.slow
def test_a_value_does_not_depend_on_its_neighbours():
    parameters = (
        LINE | LOAD | {"material": {"standard_solid": SOLID}, "indenter": {"shape": "parabola", "radius": 0.01}}
    )
    columns = {"velocity": [1e-3, 0.1, 1.0, 0.1], "normal_force": [0.1, 0.2, 0.3, 0.2]}
    whole = MODEL.compute(block(parameters, columns))
    assert np.all(whole.status == Status.DONE)
    assert whole.solves == 6  # the last case is the second: three in two realisations
    assert MODEL.distinct(block(parameters, columns)) == 6
    for index in range(4):
        alone = MODEL.compute(block(parameters, columns).part(index, 1))
        for name in ALL:
            assert alone.values[name][0, 0].tobytes() == whole.values[name][index, 1].tobytes()


def test_accuracy_is_met_by_refining():
    parameters = LINE | LOAD | {"material": {"standard_solid": SOLID}}
    fine = MODEL.compute(block(parameters, {"velocity": [0.1]}, accuracy=1e-4))
    coarse = MODEL.compute(block(parameters, {"velocity": [0.1]}, accuracy=0.1))
    assert np.all(relative_error(fine.values) <= 1e-4)
    change = np.abs(coarse.values["friction_coefficient"] / fine.values["friction_coefficient"] - 1)
    assert np.all(change <= relative_error(coarse.values))


def test_temperature_and_velocity_are_interchangeable():
    """Times a_T and velocity / a_T are the same case: here a_T = 10."""
    law = {"wlf": {"c1": 11.0, "c2": 110.0, "reference": 300.0}}
    warm = {"standard_solid": SOLID, "temperature": 290.0} | law
    cool = MODEL.compute(block(LINE | LOAD | {"material": warm}, {"velocity": [0.01]}))
    factor = 10 ** (11 * 10 / 100)
    same = MODEL.compute(block(LINE | LOAD | {"material": {"standard_solid": SOLID}}, {"velocity": [0.01 * factor]}))
    assert cool.values["friction_coefficient"] == pytest.approx(same.values["friction_coefficient"], rel=1e-9)


def test_material_can_vary():
    materials = np.empty(2, dtype=object)
    materials[:] = [
        Material.model_validate({"kelvin": KELVIN}),
        Material.model_validate({"standard_solid": SOLID}),
    ]
    result = MODEL.compute(block(LINE | LOAD | {"material": materials[0]}, {"material": materials}))
    assert np.all(result.status == Status.DONE)
    assert np.all(result.values["friction_coefficient"][0] != result.values["friction_coefficient"][1])


def test_measured_line_is_the_generated_line_it_was_written_from(tmp_path):
    from mdr_dask.physics.surfaces import roughness

    phase = roughness.phases(7, 0, 100)
    height = 5e-7 * roughness.line(roughness.amplitudes(100, 0.7), phase, 400)
    rows = "\n".join(f"{i * 0.02 / 400:.17g},{z:.17g}" for i, z in enumerate(height))
    (tmp_path / "line.csv").write_text("x,z\nm,m\n" + rows)
    surface = {"profile": str(tmp_path / "line.csv")}
    columns = {"velocity": [0.01, 0.1]}
    measured = MODEL.compute(block(LOAD | KELVIN | {"surface": surface}, columns, accuracy=1e-3))
    generated = MODEL.compute(block(LINE | LOAD | KELVIN, columns, accuracy=1e-3))
    assert measured.solves == 2  # every realisation is the same line
    for name, tolerance in (("friction_coefficient", 5e-3), ("rms_slope", 1e-9)):
        np.testing.assert_allclose(measured.values[name][:, 0], generated.values[name][:, 0], rtol=tolerance)
    assert np.array_equal(measured.values["friction_coefficient"][:, 0], measured.values["friction_coefficient"][:, 1])


def test_failures_are_said():
    parameters = LINE | LOAD | {"material": {"kelvin": KELVIN}, "indenter": {"shape": "parabola", "radius": 1.0}}
    result = MODEL.compute(block(parameters, {"normal_force": [1e4]}))
    assert np.all(result.status == Status.FAILED)
    assert "the contact leaves the line" in result.messages[0, 0]
    assert np.all(np.isnan(result.values["friction_coefficient"]))
    bad = {"prony": {"static_modulus": 1e7, "moduli": (1.0,), "times": (-1.0,)}}
    result = MODEL.compute(block(LINE | LOAD | {"material": bad}, {"velocity": [0.1]}))
    assert "relaxation times must be positive" in result.messages[0, 0]
    assert result.solves == 0


def test_one_body_and_one_line():
    with pytest.raises(ValidationError, match="expected shear_modulus with relaxation_time, or material"):
        SlidingFriction.model_validate(LINE | LOAD | KELVIN | {"material": {"kelvin": KELVIN}})
    with pytest.raises(ValidationError, match="expected shear_modulus with relaxation_time, or material"):
        SlidingFriction.model_validate(LINE | LOAD | {"shear_modulus": 1e6})
    with pytest.raises(ValidationError, match="expected length with rms_roughness, or length with surface"):
        SlidingFriction.model_validate(LOAD | KELVIN | {"length": 0.02})


def test_time_estimate_grows_with_the_work():
    material = {"material": {"standard_solid": SOLID}}
    small, large = (block(LINE | LOAD | material | {"points": n}, {"velocity": [0.1, 1.0]}) for n in (200, 20000))
    assert MODEL.seconds(small) < MODEL.seconds(large)


def test_cases_of_equal_numbers_are_solved_once():
    """Twice the modulus and the load, or a tenth of the velocity and ten times the time: the same, bit by bit."""
    solids = np.empty(4, dtype=object)
    numbers = [(1.0, 1.0), (2.0, 1.0), (1.0, 10.0), (1.0, 1.0)]
    for index, (stiff, slow) in enumerate(numbers):
        solid = {
            "static_modulus": 1e7 * stiff,
            "glass_modulus": 5e7 * stiff,
            "relaxation_time": 1e-3 * slow,
        }
        solids[index] = Material.model_validate({"standard_solid": solid})
    columns = {
        "material": solids,
        "normal_force": [0.2, 0.4, 0.2, 0.6],
        "velocity": [0.1, 0.1, 0.01, 0.1],
        "rms_roughness": [5e-7, 5e-7, 5e-7, 15e-7],
    }
    parameters = LINE | LOAD | {"material": solids[0]}
    result = MODEL.compute(block(parameters, columns))
    assert result.solves == MODEL.distinct(block(parameters, columns)) == 2
    friction = result.values["friction_coefficient"]
    assert np.array_equal(friction[0], friction[1])
    assert np.array_equal(friction[0], friction[2])
    np.testing.assert_allclose(friction[3], 3 * friction[0], rtol=1e-14)
