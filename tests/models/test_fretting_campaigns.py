"""Fretting wear through the command line: units in the store, sharing of solutions, sliding, histories, bad input."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mdr_dask.cli import main
from mdr_dask.physics.mdr.revolution import PowerProfile
from mdr_dask.physics.wear import rules
from mdr_dask.physics.wear.exact import exact

STEEL = """\
  indenter: {shape: parabola, radius: 10 mm}
  contact_modulus: 115 GPa
  effective_shear_modulus: 90 GPa
  friction: 0.6
  amplitude: 1 um
  normal_force: 50 N
  hardness: 2 GPa
  wear_coefficient: 1e-4
"""
TABLE = """\
  indenter: {shape: table, file: profile.csv}
  contact_modulus: 115 GPa
  effective_shear_modulus: 90 GPa
  friction: 0.6
  amplitude: 1 um
  depth: 4.7 um
  hardness: 2 GPa
  wear_coefficient: 1e-4
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    """Write a campaign and return its path."""
    monkeypatch.chdir(tmp_path)

    def campaign(parameters: str, rest: str = "") -> Path:
        path = tmp_path / "wear.yaml"
        path.write_text(
            f"name: wear\nmodel: fretting_wear\nparameters:\n{parameters}store: {{path: wear.zarr}}\n{rest}"
        )
        return path

    return campaign


def filled(path: Path) -> xr.Dataset:
    assert main(["run", str(path), "--quiet"]) == 0
    return xr.open_zarr("wear.zarr").load()


@pytest.mark.parametrize(
    ("parameters", "units"),
    [
        ("  stick_radius: 0.5\n", ("1", "1", "1", "1", "1")),
        ("  path: 2\n  wear_rule: exact\n", ("1", "1", "1", "1", "1")),
        (STEEL + "  wear_rule: exact\n", ("m", "m^3", "N", "m", "Pa")),
    ],
)
def test_units_in_the_store(write, parameters, units):
    names = ("contact_radius", "wear_volume", "contact_force", "worn_profile", "pressure")
    data = filled(write(parameters, f"outputs: [{', '.join(names)}]\n"))
    assert tuple(data[name].attrs["units"] for name in names) == units
    assert data.radius.attrs["units"] == "1"
    if "path" in parameters:
        assert data["path"].attrs["units"] == "1"


def test_profiles_over_a_length_are_those_over_the_contact_radius(write):
    forces = STEEL.replace("50 N", "[50 N, 100 N]") + "  points: 9\n"
    outputs = "outputs: [worn_profile, worn_image]\n"
    data = filled(write(forces + "  last_radius: 0.2 mm\n", outputs)).isel(realisation=0)
    for name in ("radius", "position"):
        assert data[name].attrs["units"] == "m"
        np.testing.assert_allclose(data[name], np.linspace(0.0, 2e-4, 9))
    for case, force in enumerate((50.0, 100.0)):
        a0 = (0.75 * force * 0.01 / 115e9) ** (1 / 3)
        shutil.rmtree("wear.zarr")
        one = STEEL.replace("50 N", f"{force} N") + f"  points: 9\n  extent: {2e-4 / a0}\n"
        alone = filled(write(one, outputs)).isel(realisation=0)
        for name in ("worn_profile", "worn_image"):
            np.testing.assert_allclose(data[name][case], alone[name].squeeze(), rtol=1e-9)


def test_a_grid_over_friction_and_stiffness_is_solved_once_for_each_distinct_stick_radius(write, capsys):
    """G* U0 / (mu E*) takes 6 values in 18 combinations; the blocks hold all the cases of each of them."""
    varied = STEEL.replace("normal_force: 50 N", "depth: 5 um").replace("115 GPa", "[100 GPa, 200 GPa, 400 GPa]")
    varied = varied.replace("90 GPa", "[80 GPa, 160 GPa, 320 GPa]").replace("friction: 0.6", "friction: [0.4, 0.8]")
    varied = varied.replace("wear_coefficient: 1e-4", "wear_coefficient: [1e-5, 1e-4]").replace("1 um", "0.5 um")
    path = write(varied + "  cycles: [1e3, 1e4]\n  wear_rule: exact\n")
    assert main(["run", str(path)]) == 0
    streams = capsys.readouterr()
    assert streams.out == "wear.zarr: 72 done, 0 failed\n"
    assert " 6 solves (91.7% of the results" in streams.err


def test_sliding_in_physical_units_obeys_the_wear_law(write):
    kept = [
        line for line in STEEL.splitlines() if line.split(":")[0].strip() not in {"effective_shear_modulus", "friction"}
    ]
    kept = [line for line in kept if "amplitude" not in line]
    data = filled(write("\n".join(kept) + "\n  wear_rule: exact\n  hold: force\n  path: [1 m, 10 m]\n"))
    np.testing.assert_allclose(data.wear_volume.values.ravel(), 1e-4 * 50 * np.array([1, 10]) / 2e9, rtol=1e-3)


def test_every_block_of_a_history_is_kept(write):
    history = (
        "  history:\n    - {cycles: 0.5}\n    - {cycles: 0.5, amplitude_factor: 1.2}\n"
        "    - {cycles: 0.5, amplitude_factor: 0.2, load_factor: 1.2}\n"
    )
    names = "wear_volume, block_wear_volume, block_stick_border, block_depth, block_worn_profile"
    path = write(f"  wear_rule: exact\n  stick_radius: 0.5\n  cells: 60\n{history}", f"outputs: [{names}]\n")
    data = filled(path).isel(realisation=0)
    assert data.block.values.tolist() == [1, 2, 3]
    assert np.all(np.diff(data.block_wear_volume) > 0)
    assert data.block_wear_volume[-1] == data.wear_volume
    np.testing.assert_allclose(data.block_depth, [1.0, 1.0, 1.2])
    assert data.block_stick_border[1] < data.block_stick_border[0] < data.block_stick_border[2]
    assert np.all(data.block_worn_profile.diff("block") >= 0)


@pytest.mark.parametrize(
    ("parameters", "place", "message"),
    [
        (STEEL.replace("1e-4", "-1e-4"), "11:21", "expected a number of at least 0, got -0.0001"),
        ("  stick_radius: 1.2\n", "4:17", "expected a number below 1, got 1.2"),
        ("  stick_radius: .nan\n", "4:17", "expected a finite number, got nan"),
        ("  stick_radius: 0.5\n  friction: 0.3\n", "3:1", "leave out stick_radius or all the others"),
        ("  path: 2\n  hardness: 2 GPa\n", "3:1", "leave out the others, or give contact_modulus"),
        (
            "  stick_radius: 0.5\n  path: 2\n  wear_rule: exact\n",
            "3:1",
            "sliding without oscillation: leave out stick_radius",
        ),
        ("  path: 2\n  wear_rule: fast\n", "3:1", "expected wear_rule: exact, because `path` is given, got 'fast'"),
        ("  indenter: {shape: power, exponent: -1}\n  stick_radius: 0.5\n", "4:38", "above 0.1, got -1"),
        ("  stick_radius: 0.5\n  last_radius: 1 mm\n", "3:1", "in a dimensionless campaign, give `extent`"),
        ("  method: fast\n  stick_radius: 0.5\n", "4:3", "write wear_rule"),
        ("  wear_rule: literal\n  stick_radius: 0.5\n", "4:14", "expected 'exact', 'fast' or 'limit'"),
    ],
)
def test_bad_numbers_are_refused_with_their_place(write, capsys, parameters, place, message):
    path = write(parameters)
    assert main(["check", str(path)]) == 2
    error = capsys.readouterr().err
    assert f"wear.yaml:{place}: " in error
    assert message in error
    assert all("wear.yaml:" in line for line in error.splitlines())


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("0,0\n1e-4,2e-6\n2e-4,1e-6\n1e-3,1e-3\n", "must rise with the radius, got the height 1e-06 after 2e-06"),
        ("1e-5,0\n1e-4,1e-6\n2e-4,2e-6\n1e-3,1e-3\n", "must start at 0, got 1e-05"),
        ("0,0\n1e-4,1e-6\n1e-4,2e-6\n1e-3,1e-3\n", "must increase, got 0.0001 after 0.0001"),
        ("0,0\n1e-4,1x\n", "profile.csv:3: column height: expected a number, got '1x'"),
        ("-1e-4,1e-6\n0,0\n1e-4,1e-6\n2e-4,2e-6\n", "profile.csv:2: column radius: expected at least 0"),
    ],
)
def test_bad_tables_are_refused_with_their_place(write, capsys, rows, message):
    path = write(TABLE)
    Path("profile.csv").write_text("radius [m],height [m]\n" + rows)
    assert main(["check", str(path)]) == 2
    error = capsys.readouterr().err
    assert "wear.yaml:4:34: parameters.indenter.file: profile.csv:" in error
    assert message in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize(("name", "unit"), [("radius", "mm"), ("cycles", "10^3"), ("normal_force", "N")])
def test_impossible_conditions_of_measured_points_are_named(write, capsys, name, unit):
    rest = "outputs: [worn_profile]\nmeasured: {table: scar.csv}\n"
    path = write(STEEL + "  last_radius: 0.2 mm\n  cycles: [1e3, 1e4]\n", rest)
    Path("scar.csv").write_text(f"{name} [{unit}];worn_profile [um]\n-0.1;3\n0;1\n0.1;3\n")
    assert main(["check", str(path)]) == 0
    assert f"the fit will refuse the table: line 2, {name} -" in "".join(capsys.readouterr())


def test_rows_of_a_profile_without_a_number_are_left_out_and_counted(write, capsys):
    rows = ["0,0", "1e-4,1e-6", "2e-4,4e-6", "3e-4,9e-6", "4e-4,16e-6"]
    path, heading = write(TABLE), "radius [m],height [m]"
    Path("profile.csv").write_text("\n".join([heading, *rows]))
    without = filled(path).wear_volume.values
    shutil.rmtree("wear.zarr")
    Path("profile.csv").write_text("\n".join([heading, *rows[:2], "1.5e-4,***", *rows[2:]]))
    assert main(["check", str(path)]) == 0
    assert "profile.csv: rows without a number are left out: 1" in capsys.readouterr().out
    np.testing.assert_array_equal(filled(path).wear_volume.values, without)


def test_the_limit_needs_neither_hardness_nor_wear_coefficient(write):
    rate = {"hardness", "wear_coefficient"}
    kept = "\n".join(line for line in STEEL.splitlines() if line.split(":")[0].strip() not in rate)
    profiles = "outputs: [wear_volume, worn_profile]\n"
    rule = "\n  wear_rule: limit\n  hold: [depth, force]\n"
    without = filled(write(kept + rule, profiles))
    shutil.rmtree("wear.zarr")
    np.testing.assert_array_equal(without.worn_profile, filled(write(STEEL + rule, profiles)).worn_profile)
    assert (without.wear_volume > 0).all()


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (STEEL.replace("1 um", "100 um"), "expected an amplitude below mu E* d0 / G*, where gross slip begins"),
        (TABLE, "the contact reaches beyond the table"),
    ],
)
def test_impossible_contacts_are_failed_cases_with_a_sentence(write, capsys, parameters, message):
    path = write(parameters)
    Path("profile.csv").write_text("radius [m],height [m]\n0,0\n1e-6,1e-10\n2e-6,4e-10\n3e-6,9e-10\n")
    assert main(["check", str(path)]) == 0
    assert message in " ".join(capsys.readouterr().out.split())
    assert main(["run", str(path), "--quiet"]) == 1
    assert "0 done, 1 failed" in capsys.readouterr().out
    main(["status", "wear.zarr", "--failures"])
    assert message in capsys.readouterr().out


def test_check_and_fit_state_the_error_of_the_fast_rule(write, capsys):
    """The volumes in the note are those of the two rules."""
    varied = "  stick_radius: 0.5\n  wear_rule: fast\n  cycles: {linear: [1, 2, 4]}\n  xi: {linear: [0.7, 0.9, 4]}\n"
    path = write(varied, "outputs: [wear_volume]\n")
    assert main(["check", str(path)]) == 0
    note = capsys.readouterr().out
    assert main(["run", str(path), "--quiet"]) == 0
    capsys.readouterr()
    Path("rig.csv").write_text("cycles,wear_volume\n1,0.1\n1.5,0.15\n2,0.2\n")
    assert main(["fit", "wear.zarr", "calibration", "--measured", "rig.csv"]) == 0
    assert capsys.readouterr().err.strip() in note
    body = PowerProfile(2.0)
    for percent, stick_radius in re.findall(r"(\d+) % (?:too small )?at (?:the stick radius )?([\d.]+) a0", note):
        amounts = [0.25, 1.0, 2.0, 4.0]
        worn = exact(body, float(stick_radius), amounts)
        fast = [rules.fast(body, float(stick_radius), amount) for amount in amounts]
        ratios = [one.wear_volume / other.wear_volume for one, other in zip(fast, worn, strict=True)]
        assert 100 * (1 - min(ratios)) == pytest.approx(float(percent), abs=1)


def test_tables_of_means_state_that_failed_realisations_may_bias_them(write, capsys):
    scattered = STEEL.replace("1 um", "1.9 um") + "  friction_scatter: 0.4\n  cycles: [1e3, 1e4]\n"
    path = write(scattered + "  wear_rule: limit\n", "outputs: [wear_volume]\nrealisations: 12\n")
    assert main(["run", str(path), "--quiet"]) == 1
    capsys.readouterr()
    for command in (["show", "wear.zarr"], ["status", "wear.zarr", "--failures"]):
        assert main(command) == 0
        printed = " ".join(capsys.readouterr().out.split())
        assert "means over the other realisations of these cases may be biased" in printed
