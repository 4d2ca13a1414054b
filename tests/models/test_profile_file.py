"""Measured profiles: units, bad files, formats of instruments."""

import sys

import numpy as np
import pytest

from mdr_dask.errors import DataError
from mdr_dask.models.parts.measured_line import ProfileFile, line_of

HEIGHT = np.sin(2 * np.pi * np.arange(16) / 16)


def write(path, header="x [m],z [m]\n", separator=","):
    rows = [f"{i}{separator}{z:.17g}" for i, z in enumerate(HEIGHT)]
    path.write_text(header + "\n".join(rows) + "\n")
    return ProfileFile.model_validate(str(path))


def test_a_bare_name_is_a_profile(tmp_path):
    profile = write(tmp_path / "line.csv")
    line = line_of(profile)
    assert line.length == 16
    np.testing.assert_allclose(line.height, HEIGHT, atol=1e-15)


def test_unit_can_be_given(tmp_path):
    write(tmp_path / "line.csv", header="")
    line = line_of(ProfileFile.model_validate({"file": str(tmp_path / "line.csv"), "unit": "um", "x_unit": "um"}))
    assert line.length == pytest.approx(16e-6)
    with pytest.raises(DataError, match="unknown unit 'ich'"):
        line_of(ProfileFile.model_validate({"file": str(tmp_path / "line.csv"), "unit": "ich", "x_unit": "um"}))


def test_other_formats_name_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    (tmp_path / "line.al3d").write_bytes(b"\x00")
    with pytest.raises(DataError, match=r"pip install 'mdr_dask\[formats\]'"):
        line_of(ProfileFile.model_validate(str(tmp_path / "line.al3d")))


def test_files_of_instruments_are_read_by_surface_topography(tmp_path):
    topography = pytest.importorskip("SurfaceTopography")
    place = np.arange(64)
    height = np.sin(2 * np.pi * place / 64)
    topography.UniformLineScan(height, 64.0, unit="um").to_netcdf(str(tmp_path / "line.nc"))
    line = line_of(ProfileFile.model_validate(str(tmp_path / "line.nc")))
    assert line.length == pytest.approx(64e-6)
    np.testing.assert_allclose(line.height, 1e-6 * height, atol=1e-15)
    topography.UniformLineScan(height, 64.0).to_netcdf(str(tmp_path / "bare.nc"))
    with pytest.raises(DataError, match="does not state its unit"):
        line_of(ProfileFile.model_validate(str(tmp_path / "bare.nc")))
    bare = line_of(ProfileFile.model_validate({"file": str(tmp_path / "bare.nc"), "unit": "mm"}))
    assert bare.length == pytest.approx(64e-3)
    topography.Topography(np.outer(height, height), (64.0, 64.0), unit="um").to_netcdf(str(tmp_path / "map.nc"))
    with pytest.raises(DataError, match="expected a line scan, got a map of 64 x 64 points"):
        line_of(ProfileFile.model_validate(str(tmp_path / "map.nc")))
    (tmp_path / "noise.nc").write_bytes(b"nothing" * 10)
    with pytest.raises(DataError, match=r"noise.nc: SurfaceTopography cannot read it"):
        line_of(ProfileFile.model_validate(str(tmp_path / "noise.nc")))
