"""From the bytes of a file to text."""

from __future__ import annotations

import io
import re
from pathlib import Path

from mdr_dask.errors import DataError
from mdr_dask.tables.numerals import decimal_marks, with_point

#: In the text of a workbook, each sheet begins with a line of this text and the name of the sheet.
SHEET = "# sheet of a workbook: "


def is_table(path: str | Path) -> bool:
    """Return whether a path is a file other than a campaign or a published study, and so may contain a table."""
    return Path(path).is_file() and Path(path).suffix not in (".yaml", ".zip")


def decoded(content: bytes, source: str) -> str:
    """Return the content of a text file in UTF-8, UTF-16 or Windows-1252, or of an Excel workbook, as text.

    Raise DataError if the content is none of these.
    """
    if content[:4] == b"PK\x03\x04":
        return _workbook(content, source)
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    if content[1:2] == b"\0" or content[:1] == b"\0":  # UTF-16 without a byte-order mark
        return content.decode("utf-16-le" if content[:1] != b"\0" else "utf-16-be", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = content.decode("cp1252", errors="replace")
        # four consecutive characters outside ASCII do not occur in Western text
        if re.search(r"[^\x00-\x7f]{4}", text) or not all(c.isprintable() or c in "\t\r\n\xa0" for c in text):
            found = f"got byte {content[error.start]:#x} at position {error.start}"
            raise DataError(f"{source}: expected text in UTF-8, {found} (save it as 'CSV UTF-8')") from None
        return text


def _workbook(content: bytes, source: str) -> str:
    """Return all sheets of a workbook as one text, with tabs between the cells."""
    import pandas as pd

    try:
        sheets = pd.read_excel(io.BytesIO(content), sheet_name=None, header=None, dtype=object, engine="openpyxl")
    except ImportError:
        raise DataError(
            f"{source}: reading Excel workbooks needs openpyxl: pip install openpyxl, or save the sheet as 'CSV UTF-8'"
        ) from None
    except Exception as error:  # openpyxl and zipfile raise many kinds of errors for damaged files
        raise DataError(f"{source}: expected a table or an Excel workbook, got neither ({error})") from None
    lines = []
    texts = [" ".join(cell.split()) for sheet in sheets.values() for cell in sheet.to_numpy().flat if type(cell) is str]
    kinds = {kind for text in texts if len(kind := decimal_marks([text])) == 1}
    for name, sheet in sheets.items():
        frame = sheet.fillna("").map(lambda cell: _of_workbook(cell, kinds))
        lines += [SHEET + str(name), *("\t".join(row) for row in frame.to_numpy())]
    return "\n".join(lines)


def _of_workbook(cell: object, kinds: set[str]) -> str:
    """Return a cell as text on one line, with a decimal point instead of a decimal comma.

    `kinds` contains the decimal marks of all texts in the workbook that have only one possible mark. A text such as
    ``3,158`` has two possible marks, and is read as a number only if `kinds` contains exactly one mark. If not, a
    remark is appended, so that the cell counts as a text.
    """
    text = " ".join(str(cell).split())
    kind = decimal_marks([text]) if isinstance(cell, str) else ""
    if len(kind) == 2 and re.search("[.,]", text):
        if len(kinds) != 1:
            return f"{text} (as text, with an uncertain decimal mark)"
        (kind,) = kinds
    return with_point(text, kind) if kind == "," else text
