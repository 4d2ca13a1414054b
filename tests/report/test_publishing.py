"""A published study: complete, verified, and a store to read and to extend."""

import json
import platform
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr

from mdr_dask.cli import main
from mdr_dask.store import datasets

CAMPAIGN = """\
name: road
model: sliding_friction
seed: 7
realisations: {realisations}
parameters:
  surface: {{spectrum: {file}}}
  length: 20 mm
  points: 100
  shear_modulus: 10 MPa
  relaxation_time: 1 ms
  normal_force: 1 N
  velocity: [0.1 m/s, 1 m/s]
outputs: [friction_coefficient]
"""


def spectrum():
    rows = "\n".join(f"{q:g},{1e-2 * q**-3.6:g}" for q in (1e2, 1e3, 1e4, 1e5, 1e6))
    return f"wavenumber [rad/m],C2D [m^4]\n{rows}\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A study whose campaign names a table in another folder, run and published."""
    folder = tmp_path_factory.mktemp("published")
    (folder / "data").mkdir()
    (folder / "work").mkdir()
    (folder / "data/road.csv").write_text(spectrum())
    (folder / "work/road.yaml").write_text(CAMPAIGN.format(realisations=2, file="../data/road.csv"))
    assert main(["run", str(folder / "work/road.yaml"), "--store", str(folder / "road.zarr"), "--quiet"]) == 0
    assert main(["publish", str(folder / "road.zarr"), "-o", str(folder / "road.zip")]) == 0
    return folder


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    for name in ("road.zip", "data/road.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(made / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_plain_xarray_opens_the_zip(made, folder):
    opened = xr.open_zarr(zarr.storage.ZipStore("road.zip", mode="r"))
    (original,) = datasets(str(made / "road.zarr")).values()
    xr.testing.assert_identical(opened.friction_coefficient.load(), original.friction_coefficient.load())


def test_it_holds_all_that_belongs_to_it(folder):
    with zipfile.ZipFile("road.zip") as packed:
        assert packed.read("published/road.csv").decode() == spectrum()
        assert "spectrum: road.csv" in packed.read("published/road.yaml").decode()
        assert b"<h1>road</h1>" in packed.read("published/report.html")
        machine, when, *installed = packed.read("published/environment.txt").decode().splitlines()
        assert machine.startswith(f"# Python {platform.python_version()}, ")
        assert re.match(r"# [\d-]+T[\d:]+\+00:00; ", when)
        assert f"numpy=={np.__version__}" in installed


def test_the_checksums_are_those_of_sha256sum(folder):
    subprocess.run([sys.executable, "-m", "zipfile", "-e", "road.zip", "unpacked"], check=True)
    command = ["sha256sum", "--check", "--strict", "--quiet", "published/checksums.sha256"]
    assert subprocess.run(command, cwd="unpacked", capture_output=True, text=True, check=False).stderr == ""
    lines = Path("unpacked/published/checksums.sha256").read_text().splitlines()
    files = [path for path in Path("unpacked").rglob("*") if path.is_file()]
    assert len(lines) == len(files) - 1


def test_verify_reads_it_and_names_what_is_wrong(folder, capsys):
    assert main(["verify", "road.zip"]) == 0
    capsys.readouterr()
    with zipfile.ZipFile("road.zip") as packed, zipfile.ZipFile("bad.zip", "w") as bad:
        for name in packed.namelist():
            if name == "friction_coefficient/c/0/0":
                bad.writestr(name, b"other")
            elif name != "published/report.html":
                bad.writestr(name, packed.read(name))
        bad.writestr("added", b"")
    assert main(["verify", "bad.zip", "--json"]) == 1
    found = {finding["file"]: finding["kind"] for finding in json.loads(capsys.readouterr().out)["findings"]}
    assert found == {"friction_coefficient/c/0/0": "damaged", "published/report.html": "missing", "added": "foreign"}


def test_run_goes_on_with_it_unpacked(folder, capsys):
    subprocess.run([sys.executable, "-m", "zipfile", "-e", "road.zip", "road.zarr"], check=True)
    assert main(["verify", "road.zarr"]) == 0
    Path("road.yaml").write_text(CAMPAIGN.format(realisations=3, file="road.zarr/published/road.csv"))
    assert main(["run", "road.yaml", "--store", "road.zarr", "--quiet"]) == 0
    assert "2 done, 0 failed" in capsys.readouterr().out
    (data,) = datasets("road.zarr").values()
    assert data.sizes["realisation"] == 3
    assert main(["verify", "road.zarr"]) == 0


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda place: (place.parent / "data/road.csv").write_text("other"), "changed since the study was run"),
        (lambda place: (place.parent / "data/road.csv").unlink(), "gone, but the campaign names it"),
        (lambda place: (place / "status/c/0/0").write_bytes(b""), "'mdr-dask verify --repair"),
    ],
    ids=["other data", "no data", "damaged store"],
)
def test_what_is_not_whole_is_not_published(made, spoil, said, tmp_path, capsys):
    shutil.copytree(made / "data", tmp_path / "data")
    (tmp_path / "work").mkdir()
    (tmp_path / "work/road.yaml").write_text(CAMPAIGN.format(realisations=1, file="../data/road.csv"))
    place = tmp_path / "road.zarr"
    assert main(["run", str(tmp_path / "work/road.yaml"), "--store", str(place), "--quiet"]) == 0
    spoil(place)
    assert main(["publish", str(place), "-o", str(tmp_path / "road.zip")]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.glob("*.zip*"))


@pytest.mark.parametrize("content", [b"", b"no zip", None], ids=["empty", "text", "another zip"])
def test_what_is_no_published_study_is_refused(content, folder, capsys):
    if content is None:
        with zipfile.ZipFile("other.zip", "w") as other:
            other.writestr("a", "b")
    else:
        Path("other.zip").write_bytes(content)
    assert main(["verify", "other.zip"]) == 2
    assert "mdr-dask publish" in capsys.readouterr().err


def test_two_files_of_one_name_are_refused(tmp_path, capsys):
    """Both would have the same name in the zip."""
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "road.csv").write_text(spectrum())
    (tmp_path / "work").mkdir()
    files = "[../one/road.csv, ../two/road.csv]"
    (tmp_path / "work/road.yaml").write_text(CAMPAIGN.format(realisations=1, file=files))
    place = str(tmp_path / "road.zarr")
    assert main(["run", str(tmp_path / "work/road.yaml"), "--store", place, "--quiet"]) == 0
    assert main(["publish", place, "-o", str(tmp_path / "road.zip")]) == 2
    assert "two files of the campaign are called road.csv in the zip" in capsys.readouterr().err
