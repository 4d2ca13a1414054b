"""Every fit says in words whether its law holds, from the function to the command line."""

import json
from importlib import import_module

import numpy as np
import pytest
import xarray as xr

from mdr_dask import fits
from mdr_dask.cli import main
from mdr_dask.fits.base import Fit, fitted, law_holds

STUDY = """\
name: study
model: sliding_friction
seed: 1
realisations: 4
outputs: [friction_coefficient, contact_fraction, contact_slope, rms_slope]
parameters:
  length: 20 mm
  points: 100
  hurst: 0.7
  rms_roughness: 0.5 um
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: {geometric: [1 mN, 30 mN, 4]}
  velocity: {geometric: [1 um/s, 10 m/s, 8]}
"""


def test_sentences():
    small, large = np.array([0.01, -0.02, 0.01]), np.array([0.3, -0.4, 0.2])
    assert law_holds(small, 0.0) == "yes: departs by 0.014 rms, at most 0.02, within 0.05 and 0.1"
    assert law_holds(large, 0.3).startswith("yes: departs by 0.31 rms, at most 0.4, which the scatter explains")
    assert law_holds(large, 0.0, where="x = 1") == (
        "no: departs by 0.31 rms, at most 0.4 at x = 1; by scatter alone with probability below 0.0025"
    )
    # a step in few of many cases is not small because its mean square is
    assert law_holds(np.append(np.zeros(99), 0.3), 0.0).startswith("no: departs by 0.03 rms, at most 0.3")
    assert law_holds(large, 0.0, constants=3).startswith("not tested: 3 cases for 3 constants")
    assert law_holds(large, np.nan).startswith("not tested: too few realisations to know the scatter")


def test_a_law_that_does_not_hold_moves_its_constants():
    rows = np.repeat([[1.0, 2.0, 4.0]], 401, axis=0)
    mean = fitted(lambda data: data.mean(axis=1, keepdims=True), lambda data, found: data - found, rows, 10)
    assert mean.chance == 0
    assert len(mean.constants) == 401 + 6
    assert np.allclose(mean.departures, [-4 / 3, -1 / 3, 5 / 3])


def test_a_fit_without_a_law_says_so():
    plain = Fit("plain", ("toy",), "none", lambda groups: xr.Dataset({"a": 1.0}))
    assert plain.results({})[""]["law_holds"].item().startswith("not tested: ")
    apart = Fit("plain", ("toy",), "none", lambda groups: xr.Dataset({"a": 1.0}), apart=True)
    assert apart.results({"x": xr.Dataset()})["x"]["law_holds"].item().startswith("not tested: ")


def test_names_of_fits_differ_and_every_module_has_some():
    laws = [each for subject in fits.SUBJECTS for each in import_module(f"mdr_dask.fits.{subject}").FITS]
    assert len({each.name for each in laws}) == len(laws) > 15


@pytest.fixture(scope="module")
def friction(tmp_path_factory):
    folder = tmp_path_factory.mktemp("friction")
    (folder / "study.yaml").write_text(STUDY)
    assert main(["run", str(folder / "study.yaml"), "--quiet", "--store", str(folder / "study.zarr")]) == 0
    return str(folder / "study.zarr")


@pytest.mark.parametrize(
    "name", ["zone_one", "plateau", "interpolation", "contact_growth", "contact_slope", "collapse"]
)
def test_the_command_line_says_it_in_table_and_json(friction, name, capsys):
    capsys.readouterr()
    assert main(["fit", friction, name]) == 0
    title, first, *_ = capsys.readouterr().out.splitlines()
    assert title.endswith("law_holds")
    assert any(f"  {word}: " in first for word in ("yes", "no", "not tested"))
    assert main(["fit", friction, name, "--json"]) == 0
    row = json.loads(capsys.readouterr().out)["rows"][0]
    assert row["law_holds"].split(":")[0] in ("yes", "no", "not tested")
