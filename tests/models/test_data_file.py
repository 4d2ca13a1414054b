"""Data files named by a campaign: encodings, and files that have changed."""

import pytest

from mdr_dask.errors import DataError
from mdr_dask.models.data_file import DataFile


def test_a_byte_order_mark_is_left_out(tmp_path):
    path = tmp_path / "table.csv"
    path.write_bytes(b"\xef\xbb\xbfx,z\n")
    assert DataFile.of(path).read_text() == "x,z\n"


def test_a_file_that_has_changed_is_refused(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("x,z\n")
    named = DataFile.of(path)
    path.write_text("x,y\n")
    with pytest.raises(DataError, match="changed since the campaign was read"):
        named.read_text()


def test_a_file_in_another_encoding_is_refused_with_the_byte(tmp_path):
    path = tmp_path / "table.csv"
    path.write_bytes(b"x,z [\xb5m]\n")
    assert DataFile.of(path).read_text() == "x,z [µm]\n"
    path.write_bytes("x,z [um],\u9ad8\u3055\n".encode("shift_jis"))
    with pytest.raises(DataError, match=r"expected text in UTF-8, got byte 0x8d at position 9"):
        DataFile.of(path).read_text()
