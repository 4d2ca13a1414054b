"""Layouts of instruments are read without edits; others are refused with a message that says what to change."""

import io

import numpy as np
import pandas as pd
import pytest
from instrument_layouts import DMA, READ, REFUSED, TRIOS

from mdr_dask.errors import DataError
from mdr_dask.headings import Column
from mdr_dask.tables import SHEET, decoded, read_table


@pytest.mark.parametrize("layout", READ)
def test_layouts_are_read_without_edits(layout):
    text, columns, expected = READ[layout]
    read = read_table(text, layout, columns)
    for name, value in expected.items():
        assert read[name][0] == pytest.approx(value, rel=1e-3), name


@pytest.mark.parametrize("layout", REFUSED)
def test_refused_layouts_say_what_to_change(layout):
    text, columns, sentence = REFUSED[layout]
    with pytest.raises(DataError) as caught:
        read_table(text, layout, columns)
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)


def test_all_blocks_of_an_export_are_one_table_and_what_is_not_used_is_named():
    read = read_table(TRIOS, "trios.txt", DMA)
    np.testing.assert_allclose(read["temperature"], [253.15, 253.15, 293.15])
    np.testing.assert_allclose(read["storage modulus"], [1e7, 2e7, 2e6])
    assert read.remark == "not used: Torque"


@pytest.mark.parametrize("written", ["10³ µm³", "10^3 um^3", "1000 µm³", "1e-6 mm³", "x 1e3 um3", "e-6 mm^3"])
def test_units_may_have_a_factor(written):
    column = Column("wear volume", "m^3")
    joined = read_table(f"cycles;wear volume [{written}]\n1000;0,5\n2000;0,7\n", "v.csv", [column])
    below = read_table(f"cycles;wear volume\n[-];[{written}]\n1000;0,5\n2000;0,7\n", "v.csv", [column])
    np.testing.assert_allclose(joined["wear volume"], [5e-16, 7e-16], rtol=1e-12)
    np.testing.assert_array_equal(joined["wear volume"], below["wear volume"])


@pytest.mark.parametrize(
    "heading", ["cycles (10^3)", "Cycles (x1000)", "cycles, 10³", "Number of cycles [1e3]", "Cycles N / 10^3"]
)
def test_pure_numbers_may_have_a_factor(heading):
    read = read_table(f"{heading};mu\n1;0,5\n2;0,7\n", "v.csv", [Column("cycles", "1")])
    assert read["cycles"].tolist() == [1000.0, 2000.0]


@pytest.mark.parametrize("heading", ["cycles (1000)", "cycles [N]"])
def test_a_number_alone_is_no_factor(heading):
    with pytest.raises(DataError, match="column cycles: expected a pure number"):
        read_table(f"{heading};mu\n1;0,5\n2;0,7\n", "v.csv", [Column("cycles", "1")])


@pytest.mark.parametrize("missing", ["n.a.", "n/a", "NaN", "-", "****", "#N/A"])
def test_missing_numbers_are_found_in_any_spelling(missing):
    text = f"sample;f [Hz];E' [MPa];remark\nA;1;2;\nB;{missing};{missing};filter\nC;2;3\n"
    read = read_table(text, "v.csv", DMA, allow_missing=True)
    assert np.isnan(read["storage modulus"]).tolist() == [False, True, False]


def test_lines_below_the_numbers_are_named():
    text, columns, _ = READ["notes below"]
    read = read_table(text, "v.csv", columns)
    assert read["storage modulus"].tolist() == [2e6, 3e6]
    assert read.remark == "lines below the numbers, left out: '* limit', 'Mean', 'end of measurement'"


def test_pairs_of_columns_become_a_table_with_a_temperature():
    text, columns, _ = READ["digitised pairs"]
    read = read_table(text, "pairs.csv", columns)
    np.testing.assert_allclose(read["temperature"], [253.15, 253.15, 293.15, 293.15, 293.15])
    np.testing.assert_allclose(read["storage modulus"], [5e7, 6e7, 5e6, 6e6, 7e6])


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
def test_encodings_are_found(encoding):
    read = read_table(decoded(TRIOS.encode(encoding), "trios.txt"), "trios.txt", DMA)
    assert read["temperature"][0] == pytest.approx(253.15)


@pytest.mark.parametrize(("other", "expected"), [("0,5", 3.158), ("1,234.5", 3158.0), ("7", None)])
def test_a_text_in_a_workbook_is_a_number_only_if_its_decimal_mark_is_certain(other, expected):
    pytest.importorskip("openpyxl")
    content = io.BytesIO()
    rows = [["f [Hz]", "E' [MPa]"], [1, other], [2, "3,158"], [3, 4.5]]
    pd.DataFrame(rows).to_excel(content, header=False, index=False)
    text = decoded(content.getvalue(), "dma.xlsx")
    if expected is None:
        with pytest.raises(DataError, match="uncertain decimal mark"):
            read_table(text, "dma.xlsx", DMA)
    else:
        assert read_table(text, "dma.xlsx", DMA)["storage modulus"][1] == pytest.approx(1e6 * expected)


def test_a_sheet_with_another_table_is_refused():
    first, other = "f [Hz]\tE' [MPa]\tE'' [MPa]\n1\t2\t3\nMean\n", "pairing\tk\tmu\nA\t2\t3\n"
    with pytest.raises(DataError, match="delete the sheets of other tables"):
        read_table(f"{SHEET}1\n{first}{SHEET}2\n{other}", "pairs.xlsx", DMA)


def test_workbooks_are_read_sheet_by_sheet():
    pytest.importorskip("openpyxl")
    content = io.BytesIO()
    with pd.ExcelWriter(content) as writer:
        for celsius in (20, 40):
            rows = [
                ["Sample", "EPDM", None],
                ["f", "E'", "T"],
                ["Hz", "MPa", "°C"],
                [1, 5.5, celsius],
                [2, "6,5", celsius],
            ]
            pd.DataFrame(rows).to_excel(writer, sheet_name=f"{celsius} C", header=False, index=False)
    read = read_table(decoded(content.getvalue(), "dma.xlsx"), "dma.xlsx", DMA)
    np.testing.assert_allclose(read["temperature"], [293.15, 293.15, 313.15, 313.15])
    np.testing.assert_allclose(read["storage modulus"], [5.5e6, 6.5e6, 5.5e6, 6.5e6])
    with pytest.raises(DataError, match=r"dma.xlsx: sheet '20 C', row 4: column storage modulus: expected"):
        read_table(decoded(content.getvalue(), "dma.xlsx"), "dma.xlsx", [Column("storage modulus", "Pa", above=5.6e6)])
    with pytest.raises(DataError, match="expected a table or an Excel workbook"):
        decoded(b"PK\x03\x04 nothing of the kind", "dma.xlsx")
