"""``check`` describes a study, questions bare numbers, and refuses what would fail in every case."""

import math
from pathlib import Path

import numpy as np
import pytest

from mdr_dask.campaign.measured import read_measured
from mdr_dask.cli import main
from mdr_dask.errors import DataError

CAMPAIGN = """\
name: tyre
model: sliding_friction
parameters:
  surface: {profile: road.csv}
  material:
    dma_table: {file: rubber.csv}
    temperature: [0 degC, 20 degC, 50 degC]
    wlf: {c1: 10, c2: 100 K, reference: 20 degC}
  normal_force: 1 N
  velocity: {geometric: [1 um/s, 1 m/s, 7]}
realisations: 2
"""
LAW = {"c1": 10.0, "c2": 100.0, "reference": 20.0}


def rubber(temperatures):
    lines = ["f [Hz];G' [MPa];G'' [MPa];T [C]"]
    for temperature in temperatures:
        difference = temperature - LAW["reference"]
        factor = 10 ** (-LAW["c1"] * difference / (LAW["c2"] + difference))
        for power in range(-2, 3):
            modulus = 1 + (2j * math.pi * 10**power * factor) ** 0.3
            lines.append(f"{10**power};{modulus.real:.6g};{modulus.imag:.6g};{temperature}")
    return "\n".join(lines).replace(".", ",")


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    heights = "\n".join(f"{k / 100},{math.sin(2 * math.pi * k / 50):.6f}" for k in range(100))
    (tmp_path / "road.csv").write_text(f"x [mm],z [um]\n{heights}\n")
    (tmp_path / "rubber.csv").write_text(rubber((0, 20, 50)))
    (tmp_path / "tyre.yaml").write_text(CAMPAIGN)
    return tmp_path


def test_check_describes_axes_tables_and_lines(capsys):
    assert main(["check", "tyre.yaml"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for line in (
        "tyre.yaml: sliding_friction",
        "  material_temperature  0 degC, 20 degC, 50 degC",
        "  velocity              1 um/s to 1 m/s, 7 values, geometric",
        "  table rubber.csv: 15 rows; f 0.01 to 100 Hz, G' 1.079 to 35.62 MPa, G'' 0.0402 to 17.64 MPa, T 0 to 50 ",
        "  profile road.csv: 100 points, 1 mm long, rms height 707.1 nm, rms slope 0.00889",
        "  21 cases x 2 realisations = 42 results",
    ):
        assert any(each.startswith(line) for each in lines)
    text = "\n".join(lines)
    assert "table rubber.csv: superposed at 20 degC by the given shift factors, moduli multiplied by b_T" in text
    for temperature in (0, 20, 50):
        assert f"roughness excites 0.0063 to 3.1e+05 rad/s at {temperature} degC, data from" in text
    assert "on one core: an estimate" in text


def test_studies_that_would_fail_in_every_case_are_refused(files, capsys):
    (files / "tyre.yaml").write_text(CAMPAIGN.replace("[0 degC, 20 degC, 50 degC]", "[-90 degC, 20 degC]"))
    assert main(["check", "tyre.yaml"]) == 2
    message = "material: expected a temperature above -80 degC, where wlf diverges (at reference - c2), got -90 degC"
    assert message in capsys.readouterr().err


BARE = {
    "10 Pa of rubber": ("shear_modulus: 10", "write '10 MPa' if you mean that, '10 Pa' if not"),
    "a range": ("velocity: {geometric: [0.1, 1e6, 8]}", "parameters.velocity.geometric[1]: 1e+06 is read as 1e+06 m/s"),
    "inside a structure": (
        "indenter: {shape: parabola, radius: 50}",
        "parameters.indenter.radius: 50 is read as 50 m: write '50 mm'",
    ),
}
BODY = {
    "length": "20 mm",
    "rms_roughness": "1 um",
    "shear_modulus": "10 MPa",
    "relaxation_time": "1 ms",
    "normal_force": "1",
    "velocity": "0.1",
}


@pytest.mark.parametrize("kind", BARE)
def test_bare_numbers_far_from_usual_are_asked_about(kind, files, capsys):
    written, question = BARE[kind]
    name, _, value = written.partition(": ")
    body = "".join(f"  {key}: {entry}\n" for key, entry in (BODY | {name: value}).items())
    (files / "bare.yaml").write_text(f"name: bare\nmodel: sliding_friction\nparameters:\n{body}")
    for command in (["check"], ["run", "--dry-run"]):
        assert main([*command, "bare.yaml"]) == 0
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("bare.yaml:")
        assert question in line


def test_columns_of_measured_points_may_have_the_end_of_a_name():
    conditions = {"material_temperature": "K", "velocity": "m/s", "oil_density": "kg/m^3", "body_density": "kg/m^3"}
    text = "Temperature [°C];Velocity [mm/s];µ\n20;1;0,5\n40;10;0,6\n"
    output = {"friction_coefficient": "1"}
    read = read_measured(text, "rig.csv", conditions, output)
    np.testing.assert_allclose(read.conditions["material_temperature"], [293.15, 313.15])
    np.testing.assert_allclose(read.values, [0.5, 0.6])
    with pytest.raises(DataError, match="unknown column 'density'"):
        read_measured("density [kg/m^3],mu\n1,2\n3,4\n", "rig.csv", conditions, output, {"oil_density": 5.0})


def test_check_compares_measured_points_with_each_series(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("rig.csv").write_text(
        "# of a rig\nvelocity [mm/s], relaxation_times, friction_coefficient, standard_error\n"
        "1, 0.01, 0.3, 0.01\n10.5, 1, 0.2, 0.01\n1, 100, 0.2, 0.01\n10.000001, 1, 0.2, 0.01\n"
    )
    Path("rig.yaml").write_text(
        "name: rig\nmodel: velocity_jump\nmeasured: {table: rig.csv}\nparameters:\n"
        "  {length: 5 mm, rms_roughness: 1 um, normal_force: 1 N, velocity: [1 mm/s, 10 mm/s],\n"
        "   material: {kelvin: {shear_modulus: 1 MPa, relaxation_time: [1 ms, 2 ms]}}}\n"
    )
    assert main(["check", "rig.yaml"]) == 0
    printed = capsys.readouterr().out
    for line in (
        "measured rig.csv: 4 rows of friction_coefficient, 0.2 to 0.3, "
        "column 'standard_error' taken as one standard error",
        "measured rig.csv: conditions velocity 1 mm/s to 10.5 mm/s, relaxation_times 0.01 to 100",
        "measured rig.csv: unknowns material_kelvin_relaxation_time",
    ):
        assert f"  {line}\n" in printed
    assert "line 4, velocity 10.5 mm/s (study: 1 mm/s to 10 mm/s)" in printed
    assert "measured rig.csv: compared with friction_coefficient: coefficient of friction" in printed


def test_check_names_the_defaults_that_have_an_effect(capsys):
    Path("gear.yaml").write_text(
        "name: gear\nmodel: mixed_lubrication\nparameters:\n  normal_force: 500 N\n  rotation_speed: 100 rpm\n"
        "  temperature: 60 degC\n  rms_roughness: 0.2 um\n  roller_width: 8 mm\n"
    )
    Path("ball.yaml").write_text(
        "name: ball\nmodel: fretting_wear\nparameters:\n  indenter: {shape: parabola}\n  stick_radius: 0.5\n"
        "  cycles: [1, 2]\n  wear_rule: exact\n"
    )
    assert main(["check", "gear.yaml", "ball.yaml"]) == 0
    gear, ball = (line for line in capsys.readouterr().out.splitlines() if "defaults used: " in line)
    for text in ("oil = mobilgear_shc_xmp_320", "roller_radius = 50 mm"):
        assert text in gear
    assert "roller_width" not in gear
    assert "extent = 1.6" in ball
    assert "xi = " not in ball  # the exact rule does not use it
