"""Damaged tables as files of a campaign: each is refused with one sentence that names the file."""

from mdr_dask.campaign import loads
from mdr_dask.errors import CampaignError

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
SOUND = """\
f [Hz],G' [MPa],G'' [MPa],T [degC]
0.01,1.2512,0.1256,19.8
0.1,1.5012,0.2506,19.9
1,2,0.5,20
10,2.9953,0.9976,20.1
100,4.9811,1.9905,20.2
"""
CELLS = ("", "x", "nan", "inf", "1e400", "1.2.3", "--", "#REF!", "1 MPa", "0x10", "-5000")
#: Names, and wrong names that replace them one at a time.
HEADINGS = {
    "f [Hz]": ("f", "f [MPa]", "f [hz]", "frequenzy [Hz]", "G' [MPa]", ""),
    "G' [MPa]": ("G'", "G' [Hz]", "G' [mpa]", "storage modulos [MPa]", "f [Hz]", "E* [MPa]"),
    "G'' [MPa]": ("G''", "G'' [degC]", "G'' [Mpa]", "loss modul [MPa]", "G' [MPa]", "compliance [1/MPa]"),
    "T [degC]": ("T", "T [Hz]", "Temprature [degC]", "f [Hz]"),
}


def damaged() -> dict[str, bytes]:
    """Return more than a hundred tables, each with one error."""
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
            told = any(word in said for word in ("expected", "unknown", "given twice", "static modulus is zero"))
            if not (sound and told):
                strange[name] = said
        else:
            strange[name] = "read"
    assert strange == {}
