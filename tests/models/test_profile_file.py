import sys

import numpy as np
import pytest

from mdr_dask.errors import DataError
from mdr_dask.models.profile_file import ProfileFile, line_of

HEIGHT = np.sin(2 * np.pi * np.arange(16) / 16)


def write(path, header="", separator=","):
    rows = [f"{i}{separator}{z:.17g}" for i, z in enumerate(HEIGHT)]
    path.write_text(header + "\n".join(rows) + "\n")
    return ProfileFile.model_validate(str(path))


def test_a_bare_name_is_a_profile(tmp_path):
    profile = write(tmp_path / "line.csv")
    line = line_of(profile)
    assert line.length == 16
    np.testing.assert_allclose(line.height, HEIGHT, atol=1e-15)


@pytest.mark.parametrize("separator", [",", ";", "\t", " "])
def test_header_units_comments_and_mark_are_tolerated(tmp_path, separator):
    header = f"\ufeff# scanned\nx{separator}z\nmm{separator}um\n"
    line = line_of(write(tmp_path / "line.txt", header, separator))
    assert line.length == pytest.approx(0.016)
    assert line.height.max() == pytest.approx(1e-6)


def test_unit_can_be_given(tmp_path):
    write(tmp_path / "line.csv")
    line = line_of(ProfileFile.model_validate({"file": str(tmp_path / "line.csv"), "unit": "um"}))
    assert line.length == pytest.approx(16e-6)
    with pytest.raises(DataError, match=r"expected one of the units .* got 'inch'"):
        line_of(ProfileFile.model_validate({"file": str(tmp_path / "line.csv"), "unit": "inch"}))


def test_a_changed_file_is_refused(tmp_path):
    profile = write(tmp_path / "line.csv")
    (tmp_path / "line.csv").write_text("0 0\n")
    with pytest.raises(DataError, match="changed since the campaign was read"):
        line_of(profile)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# nothing\n", "expected rows of numbers, got none"),
        ("x,z\n", "expected rows of numbers, got only names"),
        ("1\n2\n", "expected two columns x, z, got one"),
        ("1,2\n3,?\n", "line.csv:2: expected 2 numbers"),
        ("1,2\n3,4\n", "8 or more pairs"),
    ],
)
def test_files_that_hold_no_line(tmp_path, text, message):
    (tmp_path / "line.csv").write_text(text)
    with pytest.raises(DataError, match=message):
        line_of(ProfileFile.model_validate(str(tmp_path / "line.csv")))


def test_other_formats_name_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    (tmp_path / "line.al3d").write_bytes(b"\x00")
    with pytest.raises(DataError, match=r"pip install mdr_dask\[formats\]"):
        line_of(ProfileFile.model_validate(str(tmp_path / "line.al3d")))
