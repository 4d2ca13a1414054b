"""The model velocity_jump with histories of velocity and load."""

from pathlib import Path

import numpy as np
import pytest
from jump_blocks import EVERY, STEP, block
from pydantic import ValidationError
from schemes import sampled

from mdr_dask.models.base import Status
from mdr_dask.models.velocity_jump import VelocityJump
from mdr_dask.models.velocity_jump.solve import compute
from mdr_dask.physics.surfaces import roughness


def test_one_step_is_the_jump() -> None:
    """The solution for any history agrees with that for a jump within their errors."""
    step, jump = (compute(block(oversampling=16, **change)).values for change in ({"protocol": STEP}, {}))
    for name in ("friction_coefficient_before", "friction_coefficient_after", "friction_coefficient"):
        assert np.allclose(step[name], jump[name], rtol=4e-3), name
    assert np.allclose(step["indentation_depth"], jump["indentation_depth"], rtol=1e-3)


@pytest.mark.parametrize(
    "protocol",
    [
        {"shape": "steps", "start": "rest", "times": [0.0, 2e-3], "velocities": [0.03, 0.05]},
        {"shape": "ramp", "duration": 2e-3, "velocity": 0.05, "force": 0.1, "start": "rest"},
        {"shape": "steps", "times": [0.0, 1e-3], "velocities": [0.2, 0.05], "forces": [0.2, 0.1]},
    ],
)
@pytest.mark.parametrize(
    "material", [None, {"standard_solid": {"static_modulus": 1e7, "glass_modulus": 3e7, "relaxation_time": 3e-4}}]
)
def test_every_history_ends_in_its_steady_state(protocol, material) -> None:
    kelvin = {} if material is None else {"shear_modulus": None, "relaxation_time": None, "material": material}
    found = compute(block(protocol=protocol, relaxation_times=(1.0, 60.0), **kelvin)).values
    assert np.allclose(found["friction_coefficient"][..., -1], found["friction_coefficient_after"], rtol=0.01)


@pytest.mark.parametrize(("time", "oversampling"), [(1e-3, 16), (0.7e-3, 6)])
def test_a_time_at_a_change_of_velocity_has_the_value_after_it(time: float, oversampling: int) -> None:
    """This also holds for the last requested time, and if the time is not a multiple of the time step."""
    steps = {"shape": "steps", "times": [0.0, time], "velocities": [0.03, 0.3]}
    at = (0.2, time / 1e-3)
    small = {"points": 16, "oversampling": oversampling, "protocol": steps}
    last, inside, later = (
        compute(block(relaxation_times=times, **small)).values["friction_coefficient"][..., 1]
        for times in (at, (*at, 3.0), (at[0], at[1] + 1e-7))
    )
    assert np.allclose(last, later, rtol=0.02)
    assert np.allclose(inside, later, rtol=0.02)


def test_oscillation_returns_every_period() -> None:
    swing = {"shape": "oscillation", "amplitude": 0.02, "frequency": 500.0}
    found = compute(block(protocol=swing, relaxation_times=(10.0, 12.0, 14.0))).values["friction_coefficient"]
    assert np.allclose(found[..., 0], found[..., 2], rtol=0.03)


def test_table_is_the_ramp(tmp_path: Path) -> None:
    file = tmp_path / "protocol.csv"
    file.write_text("force [N],time [ms],velocity [m/s]\n0.1,0,0.05\n0.2,2,0.1\n")
    table = compute(block(protocol={"shape": "table", "file": str(file)}))
    ramp = compute(block(protocol={"shape": "ramp", "duration": 2e-3, "velocity": 0.1, "force": 0.2}))
    for name in EVERY:
        assert np.array_equal(table.values[name], ramp.values[name]), name


@pytest.mark.parametrize(
    "indenter", [{"shape": "parabola", "radius": 0.01}, {"shape": "power", "exponent": 4.0, "coefficient": 1e6}]
)
def test_indenters(indenter: dict[str, object]) -> None:
    found = compute(block(indenter=indenter))
    assert np.all(found.status == Status.DONE), found.messages
    after = found.values["friction_coefficient_after"]
    assert np.allclose(found.values["friction_coefficient"][..., -1], after, rtol=0.01)


def test_contact_that_leaves_the_line_is_a_status() -> None:
    found = compute(block(indenter={"shape": "parabola", "radius": 1.0}, normal_force=1e3))
    assert np.all(found.status == Status.FAILED)
    assert all("leaves the line" in message for message in found.messages.values())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"protocol": {"shape": "steps", "times": [0.0, 1.0], "velocities": [1.0]}}, "for each of the 2 times"),
        ({"protocol": {"shape": "steps", "times": [1.0, 0.5], "velocities": [1.0, 2.0]}}, "increasing times"),
        ({"material": {"kelvin": {"shear_modulus": 1e6, "relaxation_time": 1e-3}}}, "or material"),
    ],
)
def test_impossible_histories_are_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        block(**change)


def written_line(tmp_path: Path, nodes: int) -> str:
    """Write the generated line of realisation 0 as a file, in m."""
    amplitude, phase = roughness.amplitudes(50, 0.7), roughness.phases(5, 0, 50)
    x = np.arange(nodes) / nodes * 0.002
    file = tmp_path / "line.csv"
    rows = np.column_stack([x, 2e-6 * sampled(amplitude, phase, nodes)])
    np.savetxt(file, rows, "%.17g", ",", header="x [m],z [m]", comments="")
    return str(file)


@pytest.mark.parametrize("protocol", [{"shape": "jump"}, STEP])
def test_measured_line_is_the_generated_one(tmp_path: Path, protocol: dict[str, object]) -> None:
    """The file has as many nodes as the grid of the generated line needs."""
    whole = block(protocol=protocol, oversampling=8)
    line = written_line(tmp_path, 400)
    read = compute(block(protocol=protocol, oversampling=2, surface={"profile": line}, length=None, rms_roughness=None))
    assert np.all(read.status == Status.DONE), read.messages
    for name in ("friction_coefficient", "friction_coefficient_jump", "rms_slope"):
        wanted = compute(whole).values[name][0, 0]
        assert np.allclose(read.values[name][0, 0], wanted, rtol=5e-3), name


def test_flat_measured_line_is_a_status(tmp_path: Path) -> None:
    file = tmp_path / "flat.csv"
    file.write_text("x [um],z [um]\n" + "".join(f"{k},0\n" for k in range(20)))
    found = compute(block(surface={"profile": str(file)}, length=None, rms_roughness=None))
    assert np.all(found.status == Status.FAILED)
    assert all("got the flat profile" in message for message in found.messages.values())


def load_step(shape: str, start: str, tmp_path: Path) -> dict[str, object]:
    """Return a history whose load falls from 640 to 320 N at t = 0."""
    if shape == "steps":
        return {"shape": "steps", "start": start, "times": [0.0], "velocities": [0.05], "forces": [320.0]}
    if shape == "late":
        times, velocities = [0.0, 3e-3], [0.05, 0.05]
        return {"shape": "steps", "start": start, "times": times, "velocities": velocities, "forces": [320.0, 320.0]}
    first = {"table": "", "two rows": f"0,{0.05 if start == 'steady' else 0},640\n"}[shape]
    file = tmp_path / "load.csv"
    file.write_text(f"time [s],velocity [m/s],force [N]\n{first}0,0.05,320\n1,0.05,320\n")
    return {"shape": "table", "start": start, "file": str(file)}


@pytest.mark.parametrize(
    ("shape", "start", "glass"),
    [("steps", "rest", None), ("late", "steady", 3.0), ("table", "steady", None), ("two rows", "rest", 3.0)],
)
def test_a_load_step_at_the_beginning_starts_from_the_load_before_it(shape, start, glass, tmp_path: Path) -> None:
    """In full contact the depth creeps by the compliance J(t), and mu = 4 eta v L s^2 / F_N under each load."""
    body, recovery, instant = {}, 1.0, 0.0  # J(t) = 1 - (1 - instant) exp(-t / recovery)
    if glass is not None:
        solid = {"static_modulus": 1e7, "glass_modulus": glass * 1e7, "relaxation_time": 1e-3}
        body = {"shear_modulus": None, "relaxation_time": None, "material": {"standard_solid": solid}}
        recovery, instant = glass, 1 / glass
    protocol, times = load_step(shape, start, tmp_path), np.array([0.0, 0.1, 1.0, 5.0])
    found = compute(block(protocol=protocol, normal_force=640.0, relaxation_times=tuple(times), points=32, **body))
    assert np.all(found.status == Status.DONE), found.messages
    creep = 1 - (1 - instant) * np.exp(-times / recovery)
    depth = (640 - 320 * creep) / (4 * 1e7 * 0.002)
    assert np.allclose(found.values["indentation_depth"], depth, rtol=1e-3)
    before = found.values["friction_coefficient_before"]
    if start == "rest":
        assert np.all(np.abs(before) < 1e-12)
    elif glass is None:
        slope = found.values["rms_slope"]
        assert np.allclose(before, 4 * 1e4 * 0.05 * 0.002 * slope**2 / 640, rtol=0.02)
        assert np.allclose(found.values["friction_coefficient"][..., -1], 2 * before, rtol=0.02)


def test_a_table_that_contradicts_the_state_before_it_is_a_failed_case(tmp_path: Path) -> None:
    protocol = load_step("two rows", "steady", tmp_path)
    found = compute(block(protocol=protocol, normal_force=600.0))
    assert np.all(found.status == Status.FAILED)
    assert all("load.csv" in text and "600 N" in text and "640 N" in text for text in found.messages.values())


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("0,0.05\n2,0.1\n1,0.2", "expected times that start at 0 and do not decrease"),
        ("0,0.05\n2,x", "expected a number, got 'x'"),
    ],
)
def test_a_table_that_is_no_history_is_refused_where_it_is_named(tmp_path: Path, rows: str, message: str) -> None:
    (tmp_path / "rig.csv").write_text(f"time [ms],velocity [m/s]\n{rows}\n")
    context = {"to_si": lambda value, unit: value, "directory": tmp_path}
    given = block().parameters.model_dump(exclude={"protocol"}, exclude_none=True)
    with pytest.raises(ValidationError, match=message):
        VelocityJump.model_validate(given | {"protocol": {"shape": "table", "file": "rig.csv"}}, context=context)
