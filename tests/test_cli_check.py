"""``check`` says what it understood, asks about bare numbers, and refuses what would fail in every case."""

import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mdr_dask.campaign.measured import read_measured
from mdr_dask.cli import main
from mdr_dask.errors import DataError
from mdr_dask.summary import axis_range
from mdr_dask.tables import described

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


def test_check_tells_axes_tables_lines_and_how_they_meet(capsys):
    assert main(["check", "tyre.yaml"]) == 0
    said = capsys.readouterr().out.splitlines()
    for line in (
        "tyre.yaml: sliding_friction",
        "  material_temperature  0 degC, 20 degC, 50 degC",
        "  velocity              1 um/s to 1 m/s, 7 values, geometric",
        "  table rubber.csv: 15 rows; f 0.01 to 100 Hz, G' 1.079 to 35.62 MPa, G'' 0.0402 to 17.64 MPa, T 0 to 50 degC",
        "  profile road.csv: 100 points, 1 mm long, rms height 707.1 nm, rms slope 0.00889",
        "  21 cases x 2 realisations = 42 results",
    ):
        assert line in said
    text = "\n".join(said)
    assert "table rubber.csv: superposed at 20 degC by the given shift factors, moduli multiplied by b_T" in text
    for temperature in (0, 20, 50):
        assert f"roughness excites 0.0063 to 3.1e+05 rad/s at {temperature} degC, data from" in text
    assert " uncompressed, about " in text


def test_check_tells_the_same_to_a_program(capsys):
    assert main(["check", "tyre.yaml", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert [(axis["axis"], axis["unit"], axis["values"]) for axis in row["axes"]] == [
        ("material_temperature", "K", 3),
        ("velocity", "m/s", 7),
    ]
    assert (row["results"], row["questions"]) == (42, [])
    assert any(note.startswith("profile road.csv: 100 points") for note in row["notes"])


REFUSED = {
    "curves with a gap": (
        lambda folder: (folder / "rubber.csv").write_text(rubber((-20, 200))),
        ("dma_table: {file: rubber.csv}", "dma_table: {file: rubber.csv, reference: 20 degC}"),
        "material: the curves do not overlap: the modulus reaches",
    ),
    "no law and no reference": (
        lambda _: None,
        ("    temperature: [0 degC, 20 degC, 50 degC]\n    wlf: {c1: 10, c2: 100 K, reference: 20 degC}\n", ""),
        "rubber.csv: has several temperatures: choose one by table_temperature, or superpose them by",
    ),
    "reference outside the data": (
        lambda _: None,
        ("dma_table: {file: rubber.csv}", "dma_table: {file: rubber.csv, table_temperature: 90 degC}"),
        "rubber.csv: got no rows at 90 degC; the table was measured at 0 degC, 20 degC, 50 degC",
    ),
    "the law ends": (
        lambda _: None,
        ("[0 degC, 20 degC, 50 degC]", "[-90 degC, 20 degC]"),
        "material: expected a temperature above reference - c2 = -80 degC for wlf, got -90 degC",
    ),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_what_would_fail_in_every_case_is_refused(kind, files, capsys):
    damage, change, told = REFUSED[kind]
    damage(files)
    (files / "tyre.yaml").write_text(CAMPAIGN.replace(*change))
    assert main(["check", "tyre.yaml"]) == 2
    assert told in capsys.readouterr().err


BARE = {
    "10 Pa of rubber": ("shear_modulus: 10", "write '10 MPa' if you mean that, '10 Pa' if not"),
    "a line of 20 m": ("length: 20", "write '20 mm' if you mean that, '20 m' if not"),
    "a roughness of half a metre": ("rms_roughness: 0.5", "write '0.5 um' if you mean that"),
    "a range": ("velocity: {geometric: [0.1, 1e6, 8]}", "parameters.velocity.geometric[1]: 1e+06 is read as 1e+06 m/s"),
    "a list": ("relaxation_time: [1 ms, 5000]", "parameters.relaxation_time[1]: 5000 is read as 5000 s"),
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


@pytest.mark.parametrize("unit", ["mPa", "10 TPa"])
def test_moduli_of_no_solid_are_asked_about(files, capsys, unit):
    """Softer than a gel, stiffer than diamond."""
    (files / "rubber.csv").write_text(rubber((0, 20, 50)).replace("MPa", unit))
    assert main(["check", "tyre.yaml"]) == 0
    told = r"rubber.csv: shear moduli of [\d.]+ \w+ to [\d.]+ \w+ are not those of a solid \(is the unit right\?\)"
    assert re.search(told, capsys.readouterr().out)


def test_columns_of_measured_points_leave_out_structures_where_nothing_else_is_called_so():
    """With a unit of its own; a name that two structures have is written in full."""
    conditions = {"material_temperature": "K", "velocity": "m/s", "oil_density": "kg/m^3", "body_density": "kg/m^3"}
    text = "Temperature [°C];Velocity [mm/s];µ\n20;1;0,5\n40;10;0,6\n"
    output = {"friction_coefficient": "1"}
    read = read_measured(text, "rig.csv", conditions, output, ("material", "oil", "body"))
    np.testing.assert_allclose(read.conditions["material_temperature"], [293.15, 313.15])
    np.testing.assert_allclose(read.values, [0.5, 0.6])
    with pytest.raises(DataError, match="unknown column 'density'"):
        read_measured("density [kg/m^3],mu\n1,2\n3,4\n", "rig.csv", conditions, output, ("oil", "body"))


def test_check_says_how_measured_points_meet_each_series(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("rig.csv").write_text(
        "# of a rig\nvelocity [mm/s], relaxation_times, friction_coefficient, standard_error\n"
        "1, 0.01, 0.3, 0.01\n10.005, 1, 0.2, 0.01\n1, 100, 0.2, 0.01\n10.000001, 1, 0.2, 0.01\n"
    )
    Path("rig.yaml").write_text(
        "name: rig\nmodel: velocity_jump\nmeasured: {table: rig.csv}\nparameters:\n"
        "  {length: 5 mm, rms_roughness: 1 um, normal_force: 1 N, velocity: [1 mm/s, 10 mm/s],\n"
        "   material: {kelvin: {shear_modulus: 1 MPa, relaxation_time: [1 ms, 2 ms]}}}\n"
    )
    assert main(["check", "rig.yaml"]) == 0
    told = capsys.readouterr().out
    for line in (
        "measured rig.csv: 4 rows of friction_coefficient, 0.2 to 0.3, standard_error",
        "measured rig.csv: conditions velocity 1 mm/s to 10.01 mm/s, relaxation_times 0.01 to 100",
        "measured rig.csv: unknowns material_kelvin_relaxation_time",
        "measured rig.csv: outside the ranges of the study, so that the fit will refuse the table: line 4, velocity "
        "10.01 mm/s; line 5, relaxation_times 100",
    ):
        assert f"  {line}\n" in told


def test_a_file_of_a_list_that_is_not_there_is_one_problem(tmp_path, capsys):
    path = tmp_path / "lost.yaml"
    path.write_text(
        "name: lost\nmodel: sliding_friction\nparameters:\n  length: 1 mm\n  points: 200\n"
        "  surface: {map: {files: [nowhere.npy], spacing: 2 um, unit: m}}\n"
        "  shear_modulus: 2 MPa\n  relaxation_time: 1 ms\n  normal_force: 1 N\n  velocity: 1 m/s\n"
    )
    assert main(["check", str(path)]) == 2
    (problem,) = capsys.readouterr().err.splitlines()
    assert "parameters.surface.map.files[0]: no such file: " in problem


def test_a_map_is_described_in_one_line():
    text = "\n".join(",".join(str(row * column) for column in range(30)) for row in range(40))
    assert described(text, "map.csv") == "40 rows x 30 columns, 0 to 1131"


def test_an_axis_is_described_by_its_values_or_its_range():
    axis = SimpleNamespace(values=(1.0, 10.0, 100.0), refinement=None, labels=None, dim="a")
    assert axis_range(axis, "N") == "1 N, 10 N, 100 N"
    axis.values = tuple(np.geomspace(1, 1e9, 10))
    assert axis_range(axis, "N") == "1 N to 1 GN, 10 values, geometric"
    axis.values = tuple(np.linspace(1, 10, 10))
    assert axis_range(axis, "N", "mN") == "1000 mN to 1e+04 mN, 10 values, linear"
    axis.labels = tuple("abcdefghij")
    assert axis_range(axis, "1").endswith(", ... (10 values)")
