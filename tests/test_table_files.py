"""Tables as files of a campaign: dialects of one fill stores with the same bytes; damaged ones are one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from mdr_dask.campaign import loads
from mdr_dask.errors import CampaignError
from mdr_dask.execute import Resources, run

CAMPAIGN = """\
name: study
model: sliding_friction
parameters:
  length: 1 mm
  points: 16
  rms_roughness: 1 um
  material: {dma_table: {file: rubber.csv}}
  normal_force: 1 mN
  velocity: [1 mm/s, 1 m/s]
accuracy: 5 %
"""
ROWS = [(10**k, round(1 + 10 ** (0.3 * k), 4), round(0.5 * 10 ** (0.3 * k), 4), 20 + k / 10) for k in range(-2, 3)]


def table(names, scales=(1, 1, 1, 0), order=(0, 1, 2, 3), comma=".", separator=",", ends="\n"):
    """Write the table; the units of the moduli are `scales` of MPa, that of the temperature is moved by the last."""
    lines = [names] if isinstance(names, str) else list(names)
    for f, storage, loss, temperature in ROWS:
        cells = (f * scales[0], round(storage * scales[1], 9), round(loss * scales[2], 9), temperature + scales[3])
        lines.append(separator.join(f"{cells[k]:.10g}".replace(".", comma) for k in order))
    return ends.join(lines) + ends


NAMES = "f [Hz],G' [MPa],G'' [MPa],T [degC]"
DIALECTS = {
    "plain": table(NAMES),
    "kilopascals and kilohertz": table("f [kHz],G' [kPa],G'' [kPa],T [degC]", (1e-3, 1e3, 1e3, 0)),
    "bars": table("f [Hz],G' [bar],G'' [bar],T [degC]", (1, 10, 10, 0)),
    "kelvins": table("f [Hz],G' [MPa],G'' [MPa],T [K]", (1, 1, 1, 273.15)),
    "another order": table("T [C],G'' [MPa],f [Hz],G' [MPa]", order=(3, 2, 0, 1)),
    "semicolons and decimal commas": table(NAMES.replace(",", ";"), comma=",", separator=";"),
    "tabs": table(NAMES.replace(",", "\t"), separator="\t"),
    "blanks": table(["f G_stor G_loss T", "Hz MPa MPa C"], separator=" "),
    "a row of units": table(["Frequency, Storage Modulus, Loss modulus, Temperature", "Hz,MPa,MPa,°C"]),
    "remarks and a byte-order mark": "\ufeff# machine 3\n\n" + table(NAMES).replace("\n0.1,", "\n% cold\n0.1,"),
    "line ends of another system": table(NAMES, ends="\r\n"),
}


def chunks(store: Path) -> dict[str, bytes]:
    """Return every chunk of results and coordinates."""
    files = [path for path in store.rglob("*") if path.is_file() and "c" in path.relative_to(store).parts]
    return {str(path.relative_to(store)): path.read_bytes() for path in files}


def test_one_table_in_several_dialects_fills_stores_with_the_same_bytes(tmp_path):
    filled = {}
    for number, (name, text) in enumerate(DIALECTS.items()):
        (tmp_path / "rubber.csv").write_bytes(text.encode())
        store = tmp_path / f"{number}.zarr"
        progress = run(loads(CAMPAIGN, "study.yaml", str(tmp_path)), str(store), Resources(threads=1), lambda _: None)
        assert (progress.done, progress.failed) == (2, 0)
        filled[name] = chunks(store)
    assert len(filled["plain"]) > 5
    for name, content in filled.items():
        assert content == filled["plain"], name


SOUND = table(NAMES)
CELLS = ("", "x", "nan", "inf", "1e400", "1.2.3", "--", "#REF!", "1 MPa", "0x10", "-5000")
#: Names, and what becomes of them one at a time.
HEADINGS = {
    "f [Hz]": ("f", "f [MPa]", "f [hz]", "frequenzy [Hz]", "G' [MPa]", ""),
    "G' [MPa]": ("G'", "G' [Hz]", "G' [mpa]", "storage modulos [MPa]", "f [Hz]", "E* [MPa]"),
    "G'' [MPa]": ("G''", "G'' [degC]", "G'' [Mpa]", "loss modul [MPa]", "G' [MPa]", "compliance [1/MPa]"),
    "T [degC]": ("T", "T [Hz]", "Temprature [degC]", "f [Hz]"),
}


def damaged() -> dict[str, bytes]:
    """Return a hundred tables and more, each with one thing wrong."""
    lines = SOUND.splitlines()
    tables: dict[str, str] = {}
    for row in (1, 5):
        for column in range(4):
            for cell in CELLS if column else [cell for cell in CELLS if cell[:1] != "#"]:
                cells = lines[row].split(",")
                cells[column] = cell
                tables[f"{cell!r} in row {row} column {column}"] = "\n".join(
                    [*lines[:row], ",".join(cells), *lines[row + 1 :]]
                )
    for heading, changes in HEADINGS.items():
        tables |= {f"{change!r} for {heading!r}": SOUND.replace(heading, change) for change in changes}
    for row in (1, 3, 5):
        tables[f"a cell more in row {row}"] = "\n".join([*lines[:row], f"{lines[row]},1", *lines[row + 1 :]])
        tables[f"a cell less in row {row}"] = "\n".join(
            [*lines[:row], lines[row].rpartition(",")[0], *lines[row + 1 :]]
        )
        if row > 1:
            tables[f"a remark without a mark in row {row}"] = "\n".join([*lines[:row], "cooled down", *lines[row:]])
    tables |= {
        "nothing": "",
        "blanks": " \n \n",
        "names alone": lines[0],
        "a column less": "\n".join(line.partition(",")[2] for line in lines),
        "one column": "\n".join(line.partition(",")[0] for line in lines),
        "no names and seven columns": "\n".join(["1,2,3,4,5,6,7"] * 4),
        "a page of the web": "<!DOCTYPE html>\n<html><body>404</body></html>\n",
        "JSON": '{"f": [1, 2], "E": [3, 4]}\n',
        "two rows of units": SOUND.replace("\n", "\nHz,MPa,MPa,C\nHz,MPa,MPa,C\n", 1),
        "a letter": "the rubber of last week\n",
        "cut off": SOUND[:-12] + "1e",
    }
    files = {name: text.encode() for name, text in tables.items()}
    return files | {
        "Shift-JIS": SOUND.replace("degC", "℃").encode("shift_jis"),
        "a picture": b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR",
        "a spreadsheet": b"PK\x03\x04\x14\x00\x06\x00" + bytes(range(128, 256)),
        "zeros": SOUND.encode().replace(b"\n0.1,", b"\n\x00\x00,"),
    }


def test_a_hundred_damaged_tables_are_one_sentence_each(tmp_path):
    files = damaged()
    assert len(files) > 100
    strange = {}
    for name, content in files.items():
        (tmp_path / "rubber.csv").write_bytes(content)
        try:
            loads(CAMPAIGN, "study.yaml", str(tmp_path))
        except CampaignError as error:
            said = str(error).replace(str(tmp_path), "")
            sound = said.startswith("study.yaml:7:") and "rubber.csv" in said and "\n" not in said and len(said) < 400
            told = any(word in said for word in ("expected", "unknown", "given twice", "leave no static modulus"))
            if not (sound and told):
                strange[name] = said
        else:
            strange[name] = "read"
    assert strange == {}


@pytest.mark.parametrize("column", range(4))
def test_a_damaged_cell_is_named_by_its_line_and_column(column, tmp_path):
    lines = SOUND.splitlines()
    cells = lines[3].split(",")
    place = len(",".join(cells[:column])) + (2 if column else 1)
    cells[column] = "x"
    (tmp_path / "rubber.csv").write_text("\n".join([*lines[:3], ",".join(cells), *lines[4:]]))
    with pytest.raises(CampaignError, match=rf"rubber\.csv:4:{place}: column .*: expected a number, got 'x'"):
        loads(CAMPAIGN, "study.yaml", str(tmp_path))
