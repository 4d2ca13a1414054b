"""Lubrication as a user meets it: campaign files in any units, bad input with its place, measured rollers."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mdr_dask.cli import main

MIXED = """\
name: mixed
model: mixed_lubrication
seed: 5
parameters:
  normal_force: 100 N
  rotation_speed: 100 rpm
  temperature: 60 degC
  rms_roughness: 0.2 um
  points: 20000
  roller_radius: 1 mm
  cutoff_force: 100 N
outputs: [breakthrough_probability, contact_length, film, film_ratio, asperity_load_share]
"""
LINE = """\
name: line
model: ehl_line
parameters:
  line_load: 80 kN/m
  mean_velocity: 1 m/s
  pressure_viscosity: 2e-8 1/Pa
  radius: 20 mm
  viscosity: 0.08 Pa s
outputs: [central_film, central_film_thickness, pressure, traction_coefficient]
"""
PROFILES = """\
  surface_1: {profile: {file: one.csv, unit: um, x_unit: um}}
  surface_2: {profile: {file: two.csv, unit: um, x_unit: um}}
"""


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(text: str, *changes: tuple[str, str]) -> str:
    """Write a campaign with some lines changed; return its name."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    name = re.match(r"name: (\w+)", text)[1]
    Path(f"{name}.yaml").write_text(text)
    return f"{name}.yaml"


def results(text: str, *changes: tuple[str, str]) -> xr.Dataset:
    """Run a campaign and return what its store holds."""
    path = write(text, *changes)
    assert main(["run", path, "--quiet"]) == 0
    return xr.open_zarr(f"results/{path[:-5]}.zarr", consolidated=False).load()


def profile(name: str, spacing: float, seed: int, size: int = 4000) -> None:
    """Write a measured line, both columns in um: white noise of 0.2 um smoothed over nine points."""
    noise = np.random.default_rng(seed).normal(size=size + 8)
    heights = np.convolve(noise, np.ones(9) / 9, "valid") * 0.6
    np.savetxt(name, np.column_stack([np.arange(size) * spacing, heights]), delimiter=",", fmt="%.9e")


@pytest.mark.parametrize(
    ("text", "old", "new", "message"),
    [
        (MIXED, "temperature: 60 degC", "temperature: 20 degC", "expected a temperature within the oil's data"),
        (MIXED, "temperature: 60 degC", "temperature: [60 degC, 20 degC]", "expected a temperature within the oil's"),
        (MIXED, "points: 20000", "points: some", "points"),
        (
            MIXED,
            "normal_force: 100 N",
            "normal_force: 200 MN",
            "expected a contact width 2a of at most the length of the line",
        ),
        (MIXED, "rotation_speed: 100 rpm", "rotation_speed: 0 rpm", "0 rpm"),
        (MIXED, "normal_force: 100 N", "normal_force: 0 N", "0 N"),
        (
            MIXED,
            "  roller_radius: 1 mm\n",
            "  roller_radius: 1 mm\n  longest_wavelength: 1 um\n  shortest_wavelength: 10 um\n",
            "expected the longest wavelength above the shortest",
        ),
        (
            MIXED,
            "  roller_radius: 1 mm\n",
            "  roller_radius: 1 mm\n  shortest_wavelength: 0.1 um\n",
            "expected a shortest wavelength of at least two point spacings",
        ),
        (
            MIXED,
            "  rms_roughness: 0.2 um\n",
            PROFILES,
            "expected profiles of the same spacing, got 1e-06 m and 2e-06 m",
        ),
        (
            MIXED,
            "  rms_roughness: 0.2 um\n",
            PROFILES.splitlines(True)[0],
            "expected both surface_1 and surface_2 or neither",
        ),
        (MIXED, "  rms_roughness: 0.2 um\n", "", "expected rms_roughness, or surface_1 and surface_2"),
        (MIXED, "  rms_roughness: 0.2 um\n", PROFILES.replace("two.csv", "no.csv"), "no.csv"),
        (LINE, "mean_velocity: 1 m/s", "mean_velocity: 0 m/s", "0 m/s"),
        (LINE, "  radius: 20 mm\n", "", "line_load needs radius"),
        (LINE, "  radius: 20 mm\n", "  radius: 20 mm\n  load_parameter: 1e-5\n", "got load_parameter and line_load"),
        (LINE, "  radius: 20 mm\n", "  radius: 20 mm\n  inlet: 2\n", "expected a number below 0, got 2"),
        (
            LINE,
            "  radius: 20 mm\n",
            "  radius: 20 mm\n  neighbours: true\n",
            "neighbours has been renamed or removed: every case",
        ),
        (
            MIXED,
            "  roller_radius: 1 mm\n",
            "  roller_radius: 1 mm\n  young_modulus: 1 GPa\n",
            "write contact_modulus, E*",
        ),
        (
            MIXED,
            "asperity_load_share]",
            "load_share]",
            "load_share has been renamed or removed: write asperity_load_share",
        ),
        (LINE, "outputs: [", "outputs: [discretisation_error, ", "or removed: central_film and minimum_film come with"),
    ],
)
def test_bad_input_is_told_once_with_its_place(text, old, new, message, capsys):
    profile("one.csv", 1.0, 1)
    profile("two.csv", 2.0, 2)
    path = write(text, (old, new))
    assert main(["check", path]) == 2
    problems = capsys.readouterr().err.splitlines()
    assert len(problems) == 1
    assert re.match(rf"{path}:\d+:\d+: ", problems[0])
    assert message in problems[0]


def test_units_of_the_file_change_no_result():
    """The same contact in SI and in mm, GPa, mPa s, minutes: the numbers differ by the rounding of the conversion."""
    here = results(LINE)
    there = results(
        LINE,
        ("name: line", "name: other"),
        ("line_load: 80 kN/m", "line_load: 80 N/mm"),
        ("mean_velocity: 1 m/s", "mean_velocity: 60 m/min"),
        ("pressure_viscosity: 2e-8 1/Pa", "pressure_viscosity: 20 1/GPa"),
        ("radius: 20 mm", "radius: 2 cm"),
        ("viscosity: 0.08 Pa s", "viscosity: 80 mPa s"),
    )
    for name in ("central_film", "central_film_thickness", "pressure", "traction_coefficient"):
        np.testing.assert_allclose(there[name], here[name], rtol=1e-6)  # 1e-8 of the Newton iteration, amplified
    here = results(MIXED, ("rotation_speed: 100 rpm", "rotation_speed: 6000 rpm"))
    there = results(
        MIXED,
        ("name: mixed", "name: other_mixed"),
        ("normal_force: 100 N", "normal_force: 0.1 kN"),
        ("rotation_speed: 100 rpm", "rotation_speed: 628.3185307179587 rad/s"),
        ("temperature: 60 degC", "temperature: 333.15 K"),
        ("rms_roughness: 0.2 um", "rms_roughness: 200 nm"),
        ("roller_radius: 1 mm", "roller_radius: 0.1 cm"),
    )
    for name in ("film", "film_ratio"):
        np.testing.assert_allclose(there[name], here[name], rtol=1e-12)
    # one point of 20000 may change sides
    np.testing.assert_allclose(there.breakthrough_probability, here.breakthrough_probability, atol=1e-3)
    assert 0 < float(here.breakthrough_probability.squeeze()) < 1


def test_measured_rollers_roll_and_creep_from_one_file(capsys):
    profile("one.csv", 1.0, 1)
    profile("two.csv", 1.0, 2, 3900)
    data = results(
        MIXED.replace("seed: 5\n", "seed: 5\nrealisations: 4\n"),
        ("  rms_roughness: 0.2 um\n", PROFILES + "  slide_roll_ratio: [0, 0.1, -0.1]\n  film_thickness: 0.45 um\n"),
    )
    assert data.sizes["slide_roll_ratio"] == 3
    assert data.sizes["realisation"] == 4
    assert int(data.status.min()) == int(data.status.max())
    share = data.breakthrough_probability
    assert np.all((share > 0) & (share < 1))
    assert np.all(share.std("realisation") > 0)  # every realisation pairs the rings anew
    # combined rms of two moving averages of nine: 0.2 um times the root of two
    np.testing.assert_allclose(data.film_ratio, 0.45 / (0.2 * np.sqrt(2)), rtol=0.1)
    # without a formula nothing is out of range
    capsys.readouterr()
    assert main(["status", "results/mixed.zarr", "--messages"]) == 0
    assert "film formula" not in capsys.readouterr().out


def test_ranges_that_are_left_stand_beside_the_results(capsys):
    """Film formula, film ratio and a film that is too thin, whatever outputs are asked for."""
    results(
        MIXED,
        ("normal_force: 100 N", "normal_force: 0.1 N"),
        ("rms_roughness: 0.2 um", "rms_roughness: 20 um"),
        (
            "outputs: [breakthrough_probability, contact_length, film, film_ratio, asperity_load_share]",
            "outputs: [film_ratio]",
        ),
    )
    results(
        MIXED,
        ("name: mixed", "name: loaded"),
        ("  rms_roughness: 0.2 um\n", "  rms_roughness: 20 um\n  film_thickness: 10 nm\n"),
        ("outputs: [breakthrough_probability, contact_length, film, film_ratio, asperity_load_share]",
         "outputs: [contact_length]"),
    )  # fmt: skip
    results(LINE, ("line_load: 80 kN/m", "line_load: 80 N/m"), ("outputs: [", "outputs: [formula_central_film, "))
    told = {}
    assert capsys.readouterr().err.count(" done with a warning: mdr-dask status results/") == 3
    for name in ("mixed", "loaded", "line"):
        assert main(["status", f"results/{name}.zarr", "--messages"]) == 0
        told[name] = capsys.readouterr().out
    assert "film formula Pan-Hamrock (central) is extrapolated: W lies outside" in told["mixed"]
    assert "film ratio" in told["loaded"]
    assert "at the given film thickness, asperities would carry" in told["loaded"]
    assert "film formula Pan-Hamrock (central) is extrapolated: W lies outside" in told["line"]


@pytest.mark.parametrize(("errors", "turns"), [("true", 4), ("false", 7)])
def test_turns_that_know_their_own_scatter_end_a_campaign_early(errors, turns):
    """Four turns whose parts tell a standard error below the tolerance are enough; without that, seven must scatter."""
    until = "\nrealisations: {at_least: 4, at_most: 40, until: {breakthrough_probability: {absolute: 0.1}}}"
    dataset = results(MIXED + f"errors: {errors}\n", ("\nseed: 5", f"\nseed: 5{until}"))
    probability = dataset.breakthrough_probability
    assert probability.sizes["realisation"] == turns
    assert 0 < float(probability.mean()) < 1
    assert ("revolution_error" in dataset) == (errors == "true")
    assert float(probability.std(ddof=1)) / np.sqrt(turns) < 0.1
