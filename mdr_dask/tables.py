"""Read the tables that campaigns and commands name, in the forms in which people and instruments write tables.

Columns are recognised by their names, in any order. Units are in brackets after the names, joined to the names, or in a
separate row. Text before the table, blocks with repeated names, decimal commas, UTF-16 and Excel workbooks are allowed.
"""

from __future__ import annotations

import io
import math
import re
import unicodedata
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, did_you_mean
from mdr_dask.units import example_unit, is_unit, to_si

COMMENT = "#%"
BLANKS = r"\s+"
SEPARATORS = ("\t", ";", ",", BLANKS)
#: Four consecutive characters outside ASCII. Western text does not contain them, but text with a wrong encoding does.
MANY_LETTERS = re.compile(r"[^\x00-\x7f]{4}")
#: Start of the line that precedes each sheet of a workbook; the name of the sheet follows.
SHEET = "# sheet of a workbook: "
#: Largest number of columns of a table.
MOST_COLUMNS = 1000
#: Largest number of problems of one table that are shown.
MOST_SHOWN = 10
#: Two columns of the same quantity agree if their relative difference is at most this, because instruments print at
#: least three digits.
AGREE = 0.01
#: Largest number of characters of a number.
LONGEST_NUMBER = 60
SEMICOLONS = " (put semicolons between the values if they have decimal commas)"
NO_ROWS = "expected a line of names and at least one line of values"

#: Common names of quantities, in the form that `plain` returns; a `Column` may have further names.
SYNONYMS = {
    "temperature": ("T", "temp", "sample temperature", "temperature sample", "ts", "tr", "temperatur"),
    "frequency": (
        "f",
        "freq",
        "omega",
        "w",
        "ω",
        "angular frequency",
        "frequency angular",
        "frequenz",
        "kreisfrequenz",
    ),
    "time": ("t", "step time", "test time", "zeit"),
    "velocity": (
        "v",
        "speed",
        "sliding velocity",
        "sliding speed",
        "load point velocity",
        "geschwindigkeit",
        "gleitgeschwindigkeit",
    ),
    "storage modulus": (
        "e'",
        "g'",
        "storage",
        "e storage",
        "g storage",
        "e stor",
        "g stor",
        "e1",
        "g1",
        "speichermodul",
    ),
    "loss modulus": ("e''", "g''", "loss", "e loss", "g loss", "e2", "g2", "verlustmodul"),
    "modulus": ("relaxation modulus", "e relax", "g relax", "e(t)", "g(t)", "e", "g"),
    "compliance": ("creep compliance", "j", "j(t)"),
    "tan delta": (
        "tan(delta)",
        "tan d",
        "tan δ",
        "tandelta",
        "tan(δ)",
        "loss factor",
        "damping factor",
        "verlustfaktor",
    ),
    "friction coefficient": (
        "coefficient of friction",
        "coefficient",
        "friction",
        "mu",
        "μ",
        "cof",
        "reibwert",
        "reibungskoeffizient",
        "reibungszahl",
    ),
    "normal force": ("force", "load", "normal load", "f n", "fn", "F", "kraft", "normalkraft"),
    "kinematic viscosity": ("nu", "ν", "viscosity", "kinematische viskosität", "viskosität"),
    "dynamic viscosity": ("eta", "η", "mu", "viscosity", "dynamische viskosität", "viskosität"),
    "wavenumber": ("q", "k", "wave number", "wavevector", "wave vector"),
    "wavelength": ("lambda", "λ"),
    "C2D": ("C", "c iso", "areal spectrum", "psd 2d", "psd", "c(q)"),
    "C1D": ("C", "line spectrum", "psd 1d", "psd", "c(q)"),
    "x": ("X", "position", "distance", "length", "weg"),
    "height": ("z", "Z", "h", "höhe"),
    "wear volume": ("worn volume", "verschleißvolumen"),
}
_ALIKE = str.maketrans({"’": "'", "′": "'", "″": "''", '"': "''", "µ": "μ", "δ": "δ"})
#: Units that may be joined to a name, as in ``freq_hz``, by their spelling in lower case.
JOINED = {
    "pa": "Pa",
    "kpa": "kPa",
    "mpa": "MPa",
    "gpa": "GPa",
    "hz": "Hz",
    "c": "degC",
    "k": "K",
    "f": "degF",
    "n": "N",
}
_DEGREES = {"c": "degC", "°c": "degC", "ºc": "degC", "deg c": "degC", "f": "degF", "°f": "degF", "deg f": "degF"}
#: A heading of a column of common logarithms: ``log10 q``, ``lg(q)``.
_LOGARITHM = re.compile(r"(?:log10|log|lg)(?:[\s_]+|\s*(?=\())(.+)", re.IGNORECASE)
#: The end of a word that is abbreviated, as in ``Ang. frequency``.
_ABBREVIATED = re.compile(r"(?<=\w{3})\.")
_BRACKETED = re.compile(r"(.*?)[\s,/]*(?:\[([^\]]*)\]|\(([^()]*)\)|\{([^}]*)\}|<([^>]*)>)\s*\Z")
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?\Z")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}([.,' ]\d{3})+([.,]\d+)?\Z")
#: A number before a unit, as in ``10^3 um^3``, ``1e-6 mm^3`` or ``x 1000 N``.
_FACTOR = re.compile(
    r"[x×*]?\s*(?:10\s*(?:\^|\*\*)\s*\{?([+-]?\d+)\}?|(\d+(?:\.\d+)?(?:e[+-]?\d+)?|e[+-]?\d+))[\s×x*]*(?=[^\W\d]|°)",
    re.I,
)
_STATED = re.compile(
    r"(?:^|[^a-z])t(?:emp[a-z]*)?\.?\s*[=:]?\s*([+-]?\d+(?:[.,]\d+)?)\s*(°\s?[CF]|deg[CF]|K)\b", re.IGNORECASE
)
_MISSING = frozenset({"", "nan", "na", "nodata", "null", "none"})


class Problem(NamedTuple):
    """One problem of a table: line and column, counted from 1, and a text; line 0 means the whole table."""

    line: int
    column: int
    what: str


class TableError(DataError):
    """An error in a table that cannot be used; it contains the name of the file and all problems."""

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        super().__init__(source, tuple(problems))

    @property
    def problems(self) -> tuple[Problem, ...]:
        """All problems, in the order of the table."""
        found: tuple[Problem, ...] = self.args[1]
        return found

    def __str__(self) -> str:
        source, problems = self.args
        lines = [
            f"{source}:{line}:{column}: {what}" if line else f"{source}: {what}" for line, column, what in problems
        ]
        more = [f"{source}: {len(lines) - MOST_SHOWN} more problems"] if len(lines) > MOST_SHOWN else []
        return "\n".join([*lines[:MOST_SHOWN], *more])


@dataclass(frozen=True)
class Column:
    """The description of a column that a table may have.

    Parameters
    ----------
    name : str
        Name in messages and in the result. A heading may also be one of the `SYNONYMS` of this name.
    unit : str
        SI unit of the result, ``"1"`` for a pure number. For angular frequencies (``rad/s``) a table may use Hz or rpm.
    other_names : tuple of str
        Further names. Case, blanks and punctuation are ignored, except in names of one letter.
    needed : bool
        Whether a table must have this column.
    above, least : float, optional
        Limits in SI: values must be greater than `above` and not smaller than `least`; a limit that is None is ignored.
    given_unit : str
        Unit to use if the table states no unit. If `given_unit` is empty, a table must state the unit, except for pure
        numbers.
    """

    name: str
    unit: str
    other_names: tuple[str, ...] = ()
    needed: bool = True
    above: float | None = None
    least: float | None = None
    given_unit: str = ""

    def holds(self, heading: str) -> bool:
        """Return whether a heading without unit is a name of this column."""
        return is_called(heading, self.name, *self.other_names)


def is_called(heading: str, *names: str) -> bool:
    """Return whether a heading is one of the names or a synonym, perhaps abbreviated or followed by a symbol.

    For example, ``Storage modulus G'`` and ``Stor. mod.`` are names of the storage modulus.
    """
    known = [each for name in names for each in (name, *SYNONYMS.get(plain(name), ()), *SYNONYMS.get(name, ()))]
    if len(heading.strip()) == 1:
        return heading.strip().translate(_ALIKE) in known
    if plain(heading) in {plain(name) for name in known}:
        return True
    words, _, symbol = heading.strip().rpartition(" ")
    if words and len(symbol.rstrip("'\"’′″")) == 1:
        return is_called(words, *names) and is_called(symbol, *names)
    parts = [re.escape(plain(part)) for part in _ABBREVIATED.split(heading)]
    return len(parts) > 1 and any(re.fullmatch(r"\w* ?".join(parts), plain(name)) for name in known)


def plain(name: str) -> str:
    """Return a name in a standard form: lower case, single blanks, no punctuation, one kind of prime."""
    return re.sub(r"[\s_.\-:]+", " ", name.strip().casefold().translate(_ALIKE)).strip()


@dataclass(frozen=True)
class Cell:
    """One entry of a table: its text and its position; lines and columns are counted from 1."""

    text: str
    line: int
    column: int
    sheet: str = ""

    def problem(self, what: str) -> Problem:
        """Return a problem at this position; in a workbook, the position is the name of the sheet and the row."""
        if self.sheet:
            return Problem(0, 0, f"sheet {self.sheet!r}, row {self.line}: {what}")
        return Problem(self.line, self.column, what)

    def is_missing(self) -> bool:
        """Return whether the entry is empty or marks a missing number: ``-``, ``n.a.``, ``NaN``, ``****``."""
        return re.sub(r"[\s.,/*#_<>–—-]", "", self.text.casefold()) in _MISSING

    def is_entry(self) -> bool:
        """Return whether the entry is a number or marks a missing number."""
        return bool(_NUMBER.match(self.text)) or self.is_missing()


@dataclass(frozen=True)
class Sheet:
    """A table as text.

    Parameters
    ----------
    source : str
        Name of the file, for messages.
    names : tuple of Cell
        Headings without their units; empty for a table without names.
    units : tuple of str
        Unit of each column as written; empty for a column without a unit.
    rows : tuple of tuple of Cell
        Rows of equal length.
    notes : tuple of Cell
        First entry of each text line below the numbers.
    """

    source: str
    names: tuple[Cell, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[Cell, ...] = ()

    @property
    def remark(self) -> str:
        """A text that names the lines left out; empty if no line is left out."""
        shown = dict.fromkeys(repr(cell.text[:60]) for cell in self.notes)
        return f"lines below the numbers, left out: {', '.join(shown)}" if shown else ""


class Read(dict[str, FloatArray]):
    """The columns that were read from a table, by `Column.name`.

    `lines` contains the line number of each row, `headings` the names of the columns as written, `unused` the names of
    columns that were not read, and `left_out` a text about lines that were left out.
    """

    headings: Mapping[str, str] = MappingProxyType({})
    lines: tuple[int, ...] = ()
    unused: tuple[str, ...] = ()
    left_out: str = ""

    @property
    def remark(self) -> str:
        """A text that names the unused columns and the lines left out; empty if everything is used."""
        unused = f"not used: {', '.join(self.unused)}" if self.unused else ""
        return "; ".join(filter(None, (unused, self.left_out)))


def is_table(path: str | Path) -> bool:
    """Return whether a path is a file that may contain a table, and not a campaign or a published study."""
    return Path(path).is_file() and Path(path).suffix not in (".yaml", ".zip")


def decoded(content: bytes, source: str) -> str:
    """Return the text of a table: UTF-8, UTF-16, Windows-1252, or the cells of an Excel workbook.

    Raises
    ------
    DataError
        If the content is none of these.
    """
    if content[:4] == b"PK\x03\x04":
        return _workbook(content, source)
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = content.decode("cp1252", errors="replace")
        if MANY_LETTERS.search(text) or not all(letter.isprintable() or letter in "\t\r\n\xa0" for letter in text):
            found = f"got byte {content[error.start]:#x} at {error.start}"
            raise DataError(f"{source}: expected text in UTF-8, {found} (save it as 'CSV UTF-8')") from None
        return text


def _workbook(content: bytes, source: str) -> str:
    """Return the cells of all sheets of a workbook, separated by tabs."""
    import pandas as pd

    try:
        sheets = pd.read_excel(io.BytesIO(content), sheet_name=None, header=None, dtype=str, engine="openpyxl")
    except ImportError:
        raise DataError(
            f"{source}: reading Excel workbooks needs openpyxl (or save the sheet as 'CSV UTF-8')"
        ) from None
    except Exception as error:  # openpyxl and zipfile raise many kinds of errors for damaged files
        raise DataError(f"{source}: expected a table or an Excel workbook, got neither ({error})") from None
    lines = []
    for name, sheet in sheets.items():
        frame = sheet.fillna("").replace(r"[\t\r\n]+", " ", regex=True)
        lines += [SHEET + str(name), *("\t".join(row) for row in frame.to_numpy())]
    return "\n".join(lines)


def read_table(text: str, source: str, columns: Sequence[Column], allow_missing: bool = False) -> Read:
    """Read the requested columns of a table, in SI.

    Parameters
    ----------
    text : str
        The table.
    source : str
        Name of the file, for messages.
    columns : sequence of Column
        The columns that the table may have. The columns of a table without names must be in this order.
    allow_missing : bool
        Whether empty entries are read as NaN; otherwise they are an error.

    Returns
    -------
    Read
        The columns that the table has, by `Column.name`, as arrays of shape (rows,).

    Raises
    ------
    TableError
        With all problems by line and column: missing or misspelt columns, two columns of one quantity that disagree,
        missing or unknown units, entries that are not numbers, impossible values.
    """
    sheet = read_sheet(text, source)
    first, problems, read = sheet.names or sheet.rows[0], [], Read()
    matched = _matched(sheet, columns)
    absent = [each for each in columns if each not in [one.column for one in matched]]
    unknown = [sheet.names[i] for i, one in enumerate(matched) if one.column is None]
    for cell in unknown:
        hint = did_you_mean(cell.text, [each.name for each in absent])
        if "mean" in hint:
            problems.append(cell.problem(f"unknown column {cell.text!r}{hint}"))
    taken: dict[str, int] = {}
    for index, (column, written, is_logarithm) in enumerate(matched):
        if column is None:
            continue
        try:
            unit = _unit(written, column)
        except ValueError as error:
            problems.append(first[index].problem(f"column {column.name}: {error}"))
            continue
        cells = [_antilogarithm(row[index]) if is_logarithm else row[index] for row in sheet.rows]
        values, wrong = _values(cells, column, unit, allow_missing)
        problems += wrong
        if column.name in taken and not wrong:
            other = first[taken[column.name]].text
            if not np.allclose(values, read[column.name], rtol=AGREE, atol=0, equal_nan=True):
                problems.append(first[index].problem(f"column {column.name} is given twice, and {other!r} disagrees"))
            continue
        read[column.name], taken[column.name] = values, index
    lacking = [each.name for each in absent if each.needed]
    if lacking and not problems:
        got = f", got {', '.join(cell.text for cell in unknown)[:200]}" if unknown else ""
        problems.append(first[0].problem(f"expected a column {' and a column '.join(lacking)}{got}"))
    if problems:
        raise TableError(source, sorted(problems, key=lambda problem: problem[:2]))
    read.lines, read.left_out = tuple(row[0].line for row in sheet.rows), sheet.remark
    read.headings = {name: first[place].text if sheet.names else "" for name, place in taken.items()}
    read.unused = tuple(cell.text for cell in unknown if cell.text)
    return read


class _Match(NamedTuple):
    """The `Column` that a heading means (or None), the unit as written, and whether entries are common logarithms."""

    column: Column | None
    unit: str
    is_logarithm: bool = False


def _matched(sheet: Sheet, columns: Sequence[Column]) -> list[_Match]:
    """Return the match of each column of a table; in a table without names, columns are matched in the given order."""
    if sheet.names:
        return [_match_of(cell, unit, columns) for cell, unit in zip(sheet.names, sheet.units, strict=True)]
    if len(sheet.rows[0]) > len(columns):
        what = f"expected the names of the {len(sheet.rows[0])} columns in the first line"
        raise TableError(sheet.source, [sheet.rows[0][0].problem(what)])
    return [_Match(column, unit) for column, unit in zip(columns, sheet.units, strict=False)]


def _match_of(heading: Cell, unit: str, columns: Sequence[Column]) -> _Match:
    """Return the match of a heading, including headings such as ``log10 q``, ``lg(q)`` or ``log10(C2D / m^4)``."""
    column, written = match(heading.text, unit, columns)
    found = _LOGARITHM.fullmatch(heading.text)
    if column or not found:
        return _Match(column, written)
    inner = found[1].strip()
    inner = inner[1:-1] if inner[0] == "(" and inner[-1] == ")" else inner
    (name,), (own,) = _headings((replace(heading, text=inner),), (), 1)
    return _Match(*match(name.text, unit or own, columns), is_logarithm=True)


def _antilogarithm(cell: Cell) -> Cell:
    """Return a cell with ten to the power of its number; other entries remain unchanged."""
    if not _NUMBER.match(cell.text) or len(cell.text) > LONGEST_NUMBER or abs(float(cell.text)) > 300:
        return cell
    return replace(cell, text=repr(10.0 ** float(cell.text)))


def match(heading: str, unit: str, columns: Sequence[Column]) -> tuple[Column | None, str]:
    """Return the column that a heading means, or None, and its unit, which may be part of the heading (``freq_hz``)."""
    names = [(heading, unit)]
    front, _, behind = heading.replace(" ", "_").rpartition("_")
    if front and not unit:
        names.append((front, JOINED.get(behind.casefold(), behind)))
    for name, written in names:
        fitting = [column for column in columns if column.holds(name) and (name == heading or _fits(written, column))]
        best = [column for column in fitting if _fits(written, column)] or fitting
        if best:
            return best[0], written
    return None, unit


def _fits(unit: str, column: Column) -> bool:
    try:
        _in_si("1", unit, column.unit)
    except ValueError:
        return False
    return bool(unit)


def read_sheet(text: str, source: str, is_name: Callable[[str], bool] | None = None) -> Sheet:
    """Split a table into headings, units and rows of cells.

    Text before the headings is skipped. Repeated headings begin another block of the same table. Text lines below the
    last numbers are left out. Pairs of columns with a number above each pair (as digitised from a figure) become three
    columns.

    Parameters
    ----------
    text, source : str
        The table and the name of its file.
    is_name : callable, optional
        For tables whose entries may be words: returns whether a text is a name by which the line of headings is found.

    Raises
    ------
    TableError
        If there are no rows, if rows differ in length, or if decimal commas and points are mixed.
    """
    raw = _numbered(text)
    lines = [line for line in raw if line.text.lstrip()[0] not in COMMENT]
    if not lines:
        raise TableError(source, [Problem(1, 1, NO_ROWS)])
    rows = _cells(lines, _separator([line.text for line in lines], is_name is None))
    if is_name:
        return _plain_sheet(source, rows, is_name)
    widths = Counter(len(row) for row in rows if _is_data(row))
    if not widths:
        raise TableError(source, [rows[-1][0].problem(NO_ROWS)])
    width = max(widths, key=lambda each: (widths[each], each))
    if width > MOST_COLUMNS:
        raise TableError(source, [Problem(1, 1, f"expected at most {MOST_COLUMNS} columns, got {width}")])
    return _blocks(source, rows, width, raw)


class _Line(NamedTuple):
    """A line of text with its number, counted from 1, and the name of its sheet in a workbook."""

    number: int
    text: str
    sheet: str = ""


def _numbered(text: str) -> list[_Line]:
    """Return the lines of a text that are not empty; in a workbook, lines are counted from the start of their sheet."""
    found, sheet, before = [], "", 0
    for number, line in enumerate(text.lstrip("\ufeff").splitlines(), 1):
        if line.startswith(SHEET):
            sheet, before = line.removeprefix(SHEET), number
        elif line.strip(" ,;\t"):
            found.append(_Line(number - before, line, sheet))
    return found


def _numeric_columns(rows: Sequence[tuple[Cell, ...]], width: int) -> list[bool]:
    """Return which columns contain numbers in at least half of the rows."""
    counts = Counter(place for row in rows for place, cell in enumerate(row) if _NUMBER.match(cell.text))
    return [2 * counts[place] >= len(rows) for place in range(width)]


def _label_of(row: tuple[Cell, ...], numeric: Sequence[bool]) -> str:
    """Return the kind of a line that begins with a word and contains numbers: ``settings``, ``mean`` or empty.

    Settings, above a block, fill less than half of the columns. A mean, below a block, has a word in a column of
    numbers.
    """
    first = next(place for place, cell in enumerate(row) if cell.text)
    if not re.match(r"(?!inf)[^\W\d]{2}", row[first].text, re.IGNORECASE) or row[first].is_missing():
        return ""
    if 2 * sum(bool(cell.text) for cell in row) < len(numeric):
        return "settings"
    return "mean" if first < len(numeric) and numeric[first] else ""


def _fits_columns(row: tuple[Cell, ...], numeric: Sequence[bool]) -> bool:
    """Return whether a line fills half of the columns, with numbers or missing marks in the columns of numbers."""
    cells = [cell for cell, holds in zip(row, numeric, strict=False) if holds]
    is_long = 2 * sum(bool(cell.text) for cell in row) >= len(numeric)
    return is_long and any(cell.text for cell in cells) and all(cell.is_entry() for cell in cells)


def _blocks(source: str, rows: list[tuple[Cell, ...]], width: int, raw: list[_Line]) -> Sheet:
    """Return the headings, and the rows of all blocks that have these headings."""
    holds = [_is_data(row) for row in rows]
    numeric = _numeric_columns([row for row, has in zip(rows, holds, strict=True) if has], width)
    labels = [_label_of(row, numeric) if has else "" for row, has in zip(rows, holds, strict=True)]
    data = [has and label != "settings" for has, label in zip(holds, labels, strict=True)]
    begin = next((i for i, row in enumerate(rows) if data[i] and len(row) == width), None)
    if begin is None:
        raise TableError(source, [rows[-1][0].problem(NO_ROWS)])
    for i in range(begin + 1, len(rows)):
        data[i] = (data[i] and labels[i] != "mean") or _fits_columns(rows[i], numeric)
    words = [i for i in range(begin) if not data[i]]
    if not words and begin + 2 < len(rows) and not data[begin + 1]:  # numbers above the names: pairs of columns
        words, begin = [begin, begin + 1], begin + 2
    wide = [i for i in words if len(rows[i]) == width] or words[-1:]
    names: tuple[Cell, ...] = rows[wide[-1]] if wide else _names_in_remark(raw, rows[begin])
    units: tuple[Cell, ...] = ()
    begin = words[-1] + 1 if words else begin
    above = wide[:-1]
    if len(wide) > 1 and _are_units(rows[wide[-1]], surely=len(words) > 2 or _are_pairs(names)):
        units, names, above = names, rows[wide[-2]], wide[:-2]
    again = {tuple(cell.text for cell in names)}
    kept, problems, between, notes = [], [], [], []
    states: list[tuple[str, str] | None] = []
    stated = _stated(rows[:begin])
    for place, row in enumerate([*rows[begin:], ()], begin):
        if row and not data[place]:
            between.append(place)
            continue
        is_block = not again.isdisjoint(tuple(cell.text for cell in rows[each]) for each in between)
        if row and not is_block:
            kept += [rows[each] for each in between if holds[each]]
            problems += [_no_numbers(rows[each], numeric) for each in between if not holds[each]]
        else:
            notes += [rows[each] for each in between if not row or labels[each] == "mean"]
        stated = _stated([rows[each] for each in between]) if between else stated
        between = []
        if row:
            kept.append(row)
        states += [stated] * (len(kept) - len(states))
    width = len(names) or width
    if problems:
        raise TableError(source, problems)
    kept = _with_points(source, _even(source, kept, names or kept[0][:width]))
    headings, written = _headings(names, units, width)
    if _are_pairs(headings) and above:
        return _from_pairs(source, headings, written, rows[above[-1]], kept)
    known = [state for state in states if state]
    if headings and len(known) == len(kept) and not any(is_called(cell.text, "temperature") for cell in headings):
        headings = (*headings, replace(headings[0], text="temperature"))
        written = (*written, known[0][1])
        kept = [(*row, replace(row[0], text=state[0])) for row, state in zip(kept, known, strict=True)]
    return Sheet(
        source, headings, written, tuple(kept), tuple(next(cell for cell in row if cell.text) for row in notes)
    )


def _even(source: str, rows: list[tuple[Cell, ...]], names: tuple[Cell, ...]) -> list[tuple[Cell, ...]]:
    """Return rows of the length of the names; empty entries at the end are added in columns of words."""
    width, even, problems = len(names), [], []
    numeric = _numeric_columns(rows, width)
    for row in rows:
        filled = (*row, *[replace(row[-1], text="")] * (width - len(row)))
        even.append(filled[:width])
        if any(numeric[len(row) :]) or any(cell.text for cell in filled[width:]):
            hint = SEMICOLONS if len(row) > width else ""
            what = f"expected {width} values as in line {names[0].line}, got {len(row)}{hint}"
            problems.append(row[0].problem(what))
    if problems:
        raise TableError(source, problems)
    return even


def _no_numbers(row: tuple[Cell, ...], numeric: Sequence[bool]) -> Problem:
    """Return the problem of a line without numbers between lines of numbers."""
    words = [cell for cell in row if cell.text and not cell.is_entry()]
    wrong = [cell for cell, holds in zip(row, numeric, strict=False) if holds and cell in words]
    cell = (wrong or words or row)[0]
    return cell.problem(f"expected a line of numbers, got {cell.text[:60]!r}")


def _with_points(source: str, rows: list[tuple[Cell, ...]]) -> list[tuple[Cell, ...]]:
    """Return rows with decimal points instead of commas; raise TableError if the rows contain both."""
    commas, points = (
        [cell for row in rows for cell in row if mark in cell.text and _NUMBER.match(cell.text)] for mark in ",."
    )
    if commas and points:
        comma, point = commas[0], points[0]
        what = (
            f"expected decimal commas or decimal points, got both ({point.text!r}, and {comma.text!r} in line "
            f"{comma.line}): remove the separators of thousands, and write one kind of decimals"
        )
        raise TableError(source, [point.problem(what)])
    if not commas:
        return rows
    return [
        tuple(
            replace(cell, text=cell.text.replace(",", ".")) if "," in cell.text and _NUMBER.match(cell.text) else cell
            for cell in row
        )
        for row in rows
    ]


def _plain_sheet(source: str, rows: list[tuple[Cell, ...]], is_name: Callable[[str], bool]) -> Sheet:
    """Return a table whose entries may be words.

    The first line with a known name contains the names; the next line may contain units.
    """
    begin = next((i for i, row in enumerate(rows) if any(map(is_name, _stripped(row)))), 0)
    names, rows = rows[begin], rows[begin + 1 :]
    rows = _even(source, rows, names)
    units: tuple[Cell, ...] = ()
    if any(_NUMBER.match(cell.text) for cell in names):
        raise TableError(source, [names[0].problem("expected a line of names")])
    if rows and _are_units(rows[0], surely=True):
        units, rows = rows[0], rows[1:]
    if not rows:
        raise TableError(source, [Problem(1, 1, NO_ROWS)])
    headings, written = _headings(names, units, len(names))
    return Sheet(source, headings, written, tuple(_with_points(source, rows)))


def _stripped(row: tuple[Cell, ...]) -> list[str]:
    """Return the texts of a line without units in brackets."""
    return [cell.text for cell in _headings(row, (), len(row))[0]]


def _names_in_remark(raw: list[_Line], first: tuple[Cell, ...]) -> tuple[Cell, ...]:
    """Return the names in the last comment above the numbers; empty unless there are as many names as columns."""
    above = [line for line in raw if line.number < first[0].line and line.text.lstrip()[0] in COMMENT]
    for line in above[-1:]:
        words = line._replace(text=line.text.lstrip(COMMENT + " "))
        for separator in SEPARATORS:
            cells = _cells([words], separator)[0]
            if len(cells) == len(first) and not any(cell.is_entry() for cell in cells):
                return cells
    return ()


def _stated(rows: Sequence[tuple[Cell, ...]]) -> tuple[str, str] | None:
    """Return the last temperature, with its unit, in the text above a block; None if the text has no temperature."""
    found = [match for row in rows for match in _STATED.finditer(" ".join(cell.text for cell in row))]
    return (found[-1][1].replace(",", "."), found[-1][2].replace(" ", "")) if found else None


def _are_pairs(headings: tuple[Cell, ...]) -> bool:
    """Return whether the headings are the same two names, repeated."""
    names = [plain(cell.text) for cell in headings]
    return len(names) >= 4 and len(names) % 2 == 0 and names == names[:2] * (len(names) // 2)


def _from_pairs(
    source: str,
    headings: tuple[Cell, ...],
    units: tuple[str, ...],
    above: tuple[Cell, ...],
    rows: list[tuple[Cell, ...]],
) -> Sheet:
    """Return pairs of columns as three columns; the third is the number above each pair, a temperature."""
    long, problems = [], []
    labels = [cell for cell in above if cell.text]
    found = [re.search(r"[+-]?\d+(?:[.,]\d+)?", cell.text) for cell in labels]
    if len(labels) != len(headings) // 2 or not all(found):
        problems.append(above[0].problem(f"expected a number above each of the {len(headings) // 2} pairs of columns"))
        raise TableError(source, problems)
    for pair, match in enumerate(found):
        assert match is not None
        for row in rows:
            two = row[2 * pair : 2 * pair + 2]
            if any(cell.text for cell in two):
                long.append((*two, replace(two[0], text=match[0].replace(",", "."))))
    assert found[0] is not None
    unit = labels[0].text[found[0].end() :].strip(" ]()[")
    third = replace(headings[0], text="temperature")
    return Sheet(source, (*headings[:2], third), (*units[:2], _DEGREES.get(unit.casefold(), unit)), tuple(long))


def numbers(sheet: Sheet) -> FloatArray:
    """Return the entries of a table as numbers without conversion of units, shape (rows, columns).

    Empty entries and columns that contain only words are NaN.

    Raises
    ------
    TableError
        If an entry is not a number in a column that contains numbers.
    """
    columns, problems = [], []
    for cells in zip(*sheet.rows, strict=True):
        are = [bool(_NUMBER.match(cell.text)) for cell in cells]
        if any(are):
            wrong = [cell for cell in cells if not cell.is_entry()]
            problems += [cell.problem(f"expected a number, got {cell.text[:60]!r}") for cell in wrong]
        columns.append([float(cell.text) if number else math.nan for cell, number in zip(cells, are, strict=True)])
    if problems:
        raise TableError(sheet.source, sorted(problems))
    return np.array(columns).T


#: Largest number of columns without names that are described one by one; a table with more is described as a map.
MOST_DESCRIBED = 6


def described(text: str, source: str) -> str:
    """Return a text with the number of rows of a table, and the name, unit and range of each column as written.

    Raises
    ------
    TableError
        If the text is not a table of numbers.
    """
    sheet = read_sheet(text, source)
    columns = numbers(sheet).T
    if not sheet.names and len(columns) > MOST_DESCRIBED:
        return f"{len(sheet.rows)} rows x {len(columns)} columns, {np.nanmin(columns):.4g} to {np.nanmax(columns):.4g}"
    names = [cell.text for cell in sheet.names] or [f"column {place}" for place in range(1, len(columns) + 1)]
    ranges = []
    for name, unit, column in zip(names, sheet.units, columns, strict=True):
        known = column[np.isfinite(column)]
        ends = [f"{end:.4g}" for end in (known.min(), known.max())] if known.size else ["nothing"]
        ranges.append(
            " ".join(filter(None, [name, " to ".join(dict.fromkeys(ends)), unit if unit not in ("-", "1") else ""]))
        )
    left_out = f"; {sheet.remark}" if sheet.remark else ""
    return f"{len(sheet.rows)} rows; {', '.join(ranges)}{left_out}"


def _is_data(row: tuple[Cell, ...]) -> bool:
    """Return whether at least half of the filled cells of a line are numbers."""
    filled = [cell for cell in row if not cell.is_missing()]
    return 2 * sum(bool(_NUMBER.match(cell.text)) for cell in filled) >= max(len(filled), 1)


def _are_units(row: tuple[Cell, ...], surely: bool) -> bool:
    """Return whether a line contains units; unless `surely`, any words count as units."""
    units = [_unit_of(cell.text.strip("[](){}<> ")) for cell in row]
    words = [unit for unit in units if unit not in ("", "-", "--", "1")]
    bracketed = all(re.fullmatch(r"\[.*\]", cell.text) for cell in row if cell.text)
    return bool(words) and (not surely or bracketed or all(_is_unit(unit) for unit in words))


def _headings(names: tuple[Cell, ...], units: tuple[Cell, ...], width: int) -> tuple[tuple[Cell, ...], tuple[str, ...]]:
    """Return names without their units, and the units."""
    if not names:
        return (), ("",) * width
    kept, written = [], []
    for number, cell in enumerate(names):
        match, unit = _BRACKETED.match(cell.text), ""
        if match and match[1]:
            square = match[2] if match[2] is not None else ""
            other = next((group for group in match.groups()[2:] if group), "").strip()
            unit = square.strip() or (other if _is_unit(_unit_of(other)) or _looks_like_a_unit(other) else "")
        if not match and (slash := re.fullmatch(r"(.+?)\s*/\s*(.+)", cell.text)) and _is_unit(_unit_of(slash[2])):
            match, unit = slash, slash[2]
        below = units[number].text.strip("[](){}<> ") if units else ""
        kept.append(replace(cell, text=match[1].strip(" ,") if match and (unit or match[2] is not None) else cell.text))
        written.append(_unit_of(below or unit))
    return tuple(kept), tuple(written)


def _looks_like_a_unit(text: str) -> bool:
    return text == "-" or bool(re.match(r"deg|°|1/|%", text))


def _unit_of(text: str) -> str:
    """Return a unit in the spelling of `mdr_dask.units`, for example for degrees and for exponents."""
    text = re.sub(r"[⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻]+", lambda power: "^" + unicodedata.normalize("NFKC", power[0]), text.strip())
    text = unicodedata.normalize("NFKC", text.replace("º", "°")).replace("−", "-")
    factor = text[: len(text) - len(_factor(text)[1])]
    text = text.removeprefix(factor)
    text = _DEGREES.get(text.casefold(), text)
    text = re.sub(r"(?<=[A-Za-z])\^?\{?(-?\d)\}?", r"^\1", text) if not is_unit(text) else text
    return factor + text.replace("·", " ").replace("microns", "um")


def _separator(lines: Sequence[str], numeric: bool) -> str:
    """Return the separator of cells with which most lines contain two or more numbers."""
    counts = [sum(_numbers_between(line, mark) > 1 for line in lines) for mark in SEPARATORS]
    if not numeric or not any(counts):
        counts = [sum(mark in line for line in lines) for mark in SEPARATORS[:3]]
        return SEPARATORS[int(np.argmax(counts))] if any(counts) else ","
    best = SEPARATORS[int(np.argmax(counts))]
    if best == ",":
        first = next(i for i, line in enumerate(lines) if _numbers_between(line, ",") > 1)
        if first and "," not in lines[first - 1] and all(_NUMBER.match(line.strip()) for line in lines[first:]):
            return ";"  # a single column with decimal commas
    return best


def _numbers_between(line: str, separator: str) -> int:
    """Return the number of cells of a line that are numbers; 0 if they are fewer than half."""
    cells = [cell.strip().strip('"') for cell in re.split(separator, line.strip())]
    filled = [cell for cell in cells if cell]
    count = sum(bool(_NUMBER.match(cell)) for cell in filled)
    return count if 2 * count >= len(filled) else 0


def _cells(lines: Sequence[_Line], separator: str) -> list[tuple[Cell, ...]]:
    """Return the cells of all lines."""
    import pandas as pd  # slow to import, and most commands read no table

    blank = separator == BLANKS
    texts = [
        re.sub(r"\s+(?=[\[(])", "", line.text.strip()) if blank else line.text for line in lines
    ]  # joins a unit in brackets to its name
    counts = [len(re.split(separator, text)) for text in texts]
    frame = pd.read_csv(
        io.StringIO("\n".join(text.replace("\x00", " ") for text in texts)),
        sep=separator,
        header=None,
        names=range(max(counts)),
        dtype=str,
        keep_default_na=False,
        skipinitialspace=True,
        quoting=3 if blank else 0,
    ).fillna("")
    found = []
    for (number, line, sheet), count, row in zip(lines, counts, frame.to_numpy(), strict=False):
        cells, place = [], len(line) - len(line.lstrip()) if blank else 0
        for text in row[:count]:
            text = str(text).strip()
            place = max(line.find(text, place), place) if text else place
            cells.append(Cell(text, number, place + 1, sheet))
            place += len(text) + (0 if blank else 1)
        found.append(tuple(cells))
    return found


def _unit(written: str, column: Column) -> str:
    """Return the unit of a column after checking its dimension; an empty text if no conversion is needed."""
    unit = written or column.given_unit
    if unit in ("-", "1") and column.unit == "1":
        return ""
    if not unit and column.unit != "1":
        raise ValueError(
            f"expected its unit, such as {column.name + f' [{example_unit(column.unit)}]'!r} in the first line"
        )
    size = _in_si("1", unit, column.unit)
    if column.given_unit and not math.isclose(size, _in_si("1", column.given_unit, column.unit), rel_tol=1e-6):
        raise ValueError(f"the file says {written}, got the unit {column.given_unit!r}: give only what the file omits")
    return unit


def _values(cells: Sequence[Cell], column: Column, unit: str, allow_missing: bool) -> tuple[FloatArray, list[Problem]]:
    """Return the values of a column in SI, and the problems of its entries."""
    values, problems = np.full(len(cells), np.nan), []
    for number, cell in enumerate(cells):
        try:
            values[number] = _number(cell, column, unit, allow_missing)
        except ValueError as error:
            problems.append(cell.problem(f"column {column.name}: {error}"))
    return values, problems


def _number(cell: Cell, column: Column, unit: str, allow_missing: bool) -> float:
    if allow_missing and cell.is_missing():
        return math.nan
    if not _NUMBER.match(cell.text) or len(cell.text) > LONGEST_NUMBER:
        thousands = " (remove the separators of thousands)" if _THOUSANDS.match(cell.text) else ""
        raise ValueError(f"expected a number, got {cell.text[:60]!r}{thousands}")
    value = _in_si(cell.text, unit, column.unit)
    shown = repr(f"{cell.text} {unit}".strip())
    if not math.isfinite(value):
        raise ValueError(f"expected a finite number, got {cell.text[:60]!r}")
    if column.above is not None and not value > column.above:
        raise ValueError(f"expected a value above {column.above:g}, got {shown}")
    if column.least is not None and not value >= column.least:
        raise ValueError(f"expected at least {column.least:g}, got {shown}")
    return value


def _in_si(number: str, unit: str, wanted: str) -> float:
    """Convert a number as in campaign files; also Hz and 1/s to angular frequencies, and 1/m to wavenumbers."""
    if not unit:
        return float(number)
    factor, unit = _factor(unit)
    try:
        return factor * to_si(f"{number} {unit}", wanted)
    except ValueError:
        if not wanted.startswith("rad/"):
            raise
        factor *= 2 * math.pi if "hz" in unit.lower() else 1.0
        return factor * to_si(f"{number} {unit}", wanted.replace("rad", "1"))


def _factor(unit: str) -> tuple[float, str]:
    """Return the number before a unit, or 1 for a unit without a number, and the unit without the number."""
    found = _FACTOR.match(unit)
    if not found:
        return 1.0, unit
    return float(
        f"1e{found[1]}" if found[1] else found[2].lower().replace("e", "1e") if found[2][0] in "eE" else found[2]
    ), unit[found.end() :]


def _is_unit(text: str) -> bool:
    return is_unit(_factor(text)[1])
