"""Lubrication studies run from campaign files."""

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
    return xr.open_zarr(f"results/{path[:-5]}.zarr").load()


def profile(name: str, spacing: float, seed: int, size: int = 4000) -> None:
    """Write a measured line, both columns in um: white noise of 0.2 um smoothed over nine points."""
    noise = np.random.default_rng(seed).normal(size=size + 8)
    heights = np.convolve(noise, np.ones(9) / 9, "valid") * 0.6
    np.savetxt(name, np.column_stack([np.arange(size) * spacing, heights]), delimiter=",", fmt="%.9e")


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
    printed = {}
    assert capsys.readouterr().err.count(" done with a warning: mdr-dask status results/") == 3
    for name in ("mixed", "loaded", "line"):
        assert main(["status", f"results/{name}.zarr", "--messages"]) == 0
        printed[name] = capsys.readouterr().out
    assert "film formula Pan-Hamrock (central) is extrapolated: W lies outside" in printed["mixed"]
    assert "film ratio" in printed["loaded"]
    assert "at the given film thickness, asperities would carry" in printed["loaded"]
    assert "film formula Pan-Hamrock (central) is extrapolated: W lies outside" in printed["line"]


@pytest.mark.parametrize(("errors", "revolutions"), [("true", 4), ("false", 7)])
def test_errors_within_revolutions_end_a_campaign_early(errors, revolutions):
    """Four revolutions with a small error within each are enough; without that error, seven are needed."""
    until = "\nrealisations: {at_least: 4, at_most: 40, until: {breakthrough_probability: {absolute: 0.1}}}"
    dataset = results(MIXED + f"errors: {errors}\n", ("\nseed: 5", f"\nseed: 5{until}"))
    probability = dataset.breakthrough_probability
    assert probability.sizes["realisation"] == revolutions
    assert 0 < float(probability.mean()) < 1
    assert ("revolution_error" in dataset) == (errors == "true")
    assert float(probability.std(ddof=1)) / np.sqrt(revolutions) < 0.1
