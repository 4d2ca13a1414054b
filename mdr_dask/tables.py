"""Tables as people and machines keep them: the one reader of every table that a campaign or a command names.

Columns stand by name, in any order; units stand in brackets behind the names or in a row of their own. Commas,
semicolons, tabs or blanks separate; decimal commas, comments and a byte-order mark are understood.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, did_you_mean
from mdr_dask.headings import folded, meanings
from mdr_dask.units import example_unit, is_unit, to_si

COMMENT = "#%"
SEPARATORS = "\t;,"
#: Letters and signs of units beyond ASCII in tables that are not UTF-8.
WESTERN = "°µ²³·±äöüÄÖÜßéèàç"
#: More columns than this are no table of measurements.
MOST_COLUMNS = 1000
#: Problems that are told of one table.
MOST_TOLD = 10
_WITH_UNIT = re.compile(r"(.*?)\s*(?:\[([^\]]*)\]|\(([^)]*)\))\s*\Z")
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?\Z")
_CELSIUS = ("C", "c", "°c", "ºC")
_COMMAS = " (put semicolons between the values if they have decimal commas)"
NO_ROWS = "expected a line of names and at least one line of values"
_MISSING = frozenset({"", "-", "nan", "na", "n/a"})


class Problem(NamedTuple):
    """One thing wrong with a table: where, counted from 1, and what; line 0 stands for the whole table."""

    line: int
    column: int
    what: str


class TableError(DataError):
    """A table that does not hold what it should: the name of its file, and all its problems."""

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        super().__init__(source, tuple(problems))

    @property
    def problems(self) -> tuple[Problem, ...]:
        """Every problem, in the order of the table."""
        found: tuple[Problem, ...] = self.args[1]
        return found

    def __str__(self) -> str:
        source, problems = self.args
        told = [f"{source}:{line}:{column}: {what}" if line else f"{source}: {what}" for line, column, what in problems]
        more = [f"{source}: {len(told) - MOST_TOLD} more problems"] if len(told) > MOST_TOLD else []
        return "\n".join([*told[:MOST_TOLD], *more])


@dataclass(frozen=True)
class Column:
    """A column that a table may have.

    Parameters
    ----------
    name : str
        Its name in messages and in what is read.
    unit : str
        SI unit of what is read, ``"1"`` for a pure number. Angular frequencies (``rad/s``) take Hz and rpm too.
    other_names : tuple of str
        Further spellings; blanks, underscores, hyphens, dots and capitals do not matter.
    needed : bool
        Whether a table without it is refused.
    above, least : float, optional
        Values must lie above the one, and not below the other, in SI.
    given_unit : str
        Unit of a column that has none in the table; empty to refuse a column with a dimension but no unit.
    """

    name: str
    unit: str
    other_names: tuple[str, ...] = ()
    needed: bool = True
    above: float | None = None
    least: float | None = None
    given_unit: str = ""

    def holds(self, heading: str) -> bool:
        """Return whether a heading is a name of this column, in English or German."""
        return not meanings(heading).isdisjoint(map(folded, (self.name, *self.other_names)))


@dataclass(frozen=True)
class Cell:
    """One entry of a table: its text, and where it stands; lines and columns count from 1."""

    text: str
    line: int
    column: int

    def problem(self, what: str) -> Problem:
        """Return what is wrong with it."""
        return Problem(self.line, self.column, what)


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
        Unit of each column as written, empty where it has none.
    rows : tuple of tuple of Cell
        All as long as the first line of the table.
    """

    source: str
    names: tuple[Cell, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


def is_table(path: str | Path) -> bool:
    """Say whether there is a file that may hold a table, not a campaign or a published study."""
    return Path(path).is_file() and Path(path).suffix not in (".yaml", ".zip")


def decoded(content: bytes, source: str) -> str:
    """Return the text of a table: in UTF-8, or as spreadsheets in Western Europe save it.

    Raises
    ------
    DataError
        If it is neither.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        text = content.decode("cp1252", errors="replace")
        if not re.fullmatch(r"[\t\r\n -~" + WESTERN + "]*", text):
            found = f"got byte {content[error.start]:#x} at {error.start}"
            raise DataError(f"{source}: expected text in UTF-8, {found} (save it as 'CSV UTF-8')") from None
        return text


def read_table(text: str, source: str, columns: Sequence[Column], allow_missing: bool = False) -> dict[str, FloatArray]:
    """Read the numbers of a table in SI.

    Parameters
    ----------
    text : str
        The table.
    source : str
        Name of the file, for messages.
    columns : sequence of Column
        What it may hold. A table without names is read in this order.
    allow_missing : bool
        Whether empty entries are NaN; else they are refused.

    Returns
    -------
    dict of str to array, shape (rows,)
        The columns that are there, by `Column.name`.

    Raises
    ------
    TableError
        With every problem, by line and column: unknown, missing or doubled columns, missing or unknown units, entries
        that are no numbers, impossible values.
    """
    sheet = read_sheet(text, source)
    problems: list[Problem] = []
    read = {}
    for index, (column, unit) in _matched(sheet, columns, problems).items():
        read[column.name] = np.empty(len(sheet.rows))
        for number, row in enumerate(sheet.rows):
            try:
                read[column.name][number] = _number(row[index], column, unit, allow_missing)
            except ValueError as error:
                problems.append(row[index].problem(f"column {column.name}: {error}"))
    if problems:
        raise TableError(source, sorted(problems))
    return read


def read_sheet(text: str, source: str, numeric: bool = True) -> Sheet:
    """Split a table into headings, units and rows of cells.

    Parameters
    ----------
    text, source : str
        The table and the name of its file.
    numeric : bool
        Whether all entries are numbers, so that a second row of words can only hold units.

    Raises
    ------
    TableError
        If there are no rows, or rows of different length.
    """
    lines = [(number, line) for number, line in enumerate(text.lstrip("\ufeff").splitlines(), 1) if line.strip()]
    lines = [(number, line) for number, line in lines if line.lstrip()[0] not in COMMENT]
    if not lines:
        raise TableError(source, [Problem(1, 1, NO_ROWS)])
    try:
        separator = _separator(lines[0][1], lines[-1][1])
        rows = [tuple(_cells(number, line, separator)) for number, line in lines]
    except csv.Error as error:
        raise TableError(source, [Problem(0, 0, f"expected a table: {error}")]) from None
    width = len(rows[0])
    if width > MOST_COLUMNS:
        raise TableError(source, [Problem(1, 1, f"expected at most {MOST_COLUMNS} columns, got {width}")])
    uneven = [row for row in rows if len(row) != width]
    if uneven:
        what = f"expected {width} values as in line {rows[0][0].line}, got "
        hints = [_COMMAS if separator == "," and width < len(row) <= 2 * width else "" for row in uneven]
        told = [Problem(row[0].line, 1, f"{what}{len(row)}{hint}") for row, hint in zip(uneven, hints, strict=True)]
        raise TableError(source, told)
    headings: list[tuple[Cell, ...]] = []
    if not any(_NUMBER.match(cell.text) for cell in rows[0]):
        headings.append(rows.pop(0))
        if rows and _are_units(rows[0], numeric) and not _are_names_again(headings[0], rows[0]):
            headings.append(rows.pop(0))
    if not rows:
        raise TableError(source, [Problem(1, 1, NO_ROWS)])
    words = [row for row in rows if numeric and headings and not any(map(_is_entry, row))]
    if words:
        raise TableError(
            source, [row[0].problem(f"expected a line of numbers, got {row[0].text[:60]!r}, ...") for row in words]
        )
    return Sheet(source, *_units(headings, width), tuple(rows))


def numbers(sheet: Sheet) -> FloatArray:
    """Return the entries of a table as they are written, whatever their units, shape (rows, columns).

    NaN where an entry is empty.

    Raises
    ------
    TableError
        If an entry is no number.
    """
    problems = [
        cell.problem(f"expected a number, got {cell.text[:60]!r}")
        for row in sheet.rows
        for cell in row
        if not _is_entry(cell)
    ]
    if problems:
        raise TableError(sheet.source, problems)
    return np.array(
        [[float(cell.text) if _NUMBER.match(cell.text) else math.nan for cell in row] for row in sheet.rows]
    )


#: Columns without names that are described one by one; more of them are a map.
MOST_DESCRIBED = 6


def described(text: str, source: str) -> str:
    """Return the number of rows of a table, and name, unit and range of its columns, as it has them.

    Raises
    ------
    TableError
        If it is no table of numbers.
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
    return f"{len(sheet.rows)} rows; {', '.join(ranges)}"


def _is_entry(cell: Cell) -> bool:
    """Return whether a cell holds a number, or says that one is missing."""
    return bool(_NUMBER.match(cell.text)) or cell.text.lower() in _MISSING


def _are_names_again(names: tuple[Cell, ...], row: tuple[Cell, ...]) -> bool:
    return [cell.text for cell in names] == [cell.text for cell in row]


def _are_units(row: tuple[Cell, ...], numeric: bool) -> bool:
    """Return whether a row holds units: any words in a table of numbers, only known ones in one with words."""
    units = [cell.text.strip("[]() ") for cell in row]
    words = [unit for unit in units if unit.lower() not in _MISSING and unit != "1"]
    if not words or any(re.match(r"[-+]?[.,]?\d(?!/)", word) for word in words):
        return False
    return numeric or all(unit in ("", "-", "1") or is_unit(unit) for unit in units)


def _units(headings: Sequence[tuple[Cell, ...]], width: int) -> tuple[tuple[Cell, ...], tuple[str, ...]]:
    """Take the units off the headings, or from their own row."""
    if not headings:
        return (), ("",) * width
    names, units = [], []
    for cell in headings[0]:
        match = _WITH_UNIT.match(cell.text)
        names.append(Cell(match[1] if match else cell.text, cell.line, cell.column))
        units.append(_bracketed(match) if match else "")
    if len(headings) == 2:
        units = [cell.text.strip("[]() ") or unit for cell, unit in zip(headings[1], units, strict=True)]
    return tuple(names), tuple(units)


def _bracketed(match: re.Match[str]) -> str:
    """Return a unit in brackets; what stands in round ones may be a remark."""
    square, round_ = match[2], (match[3] or "").strip()
    return (square or "").strip() or (round_ if is_unit(round_) or round_ in _CELSIUS else "")


def _separator(first: str, last: str) -> str | None:
    """Return what separates the cells, None for blanks: the first mark that leaves numbers in the last row."""
    for separator in SEPARATORS:
        cells = [cell.text for cell in _cells(1, last, separator)]
        if len(cells) > 1 and all(_NUMBER.match(cell) or cell.lower() in _MISSING for cell in cells):
            return separator
    words = last.split()
    if len(words) > 1 and all(_NUMBER.match(word) for word in words):
        return None
    return next((separator for separator in SEPARATORS if separator in first), SEPARATORS[0])


def _cells(number: int, line: str, separator: str | None) -> Iterator[Cell]:
    if separator is None:
        for match in re.finditer(r"\S+", line):
            yield Cell(_decimal_point(match[0]), number, match.start() + 1)
        return
    column = 1
    for entry in next(csv.reader([line], delimiter=separator)):
        text = entry.strip()
        start = column + len(entry) - len(entry.lstrip())
        yield Cell(text if separator == "," else _decimal_point(text), number, start)
        column += len(entry) + 1


def _decimal_point(text: str) -> str:
    return text.replace(",", ".") if _NUMBER.match(text) else text


def _matched(sheet: Sheet, columns: Sequence[Column], problems: list[Problem]) -> dict[int, tuple[Column, str]]:
    """Return which column stands at which place, and its unit."""
    first = sheet.names or sheet.rows[0]
    matched: dict[int, Column] = {}
    if not sheet.names:
        matched = dict(enumerate(columns[: len(first)]))
        if len(first) > len(columns):
            problems.append(first[0].problem(f"expected the names of the {len(first)} columns in the first line"))
            return {}
    for index, heading in enumerate(sheet.names):
        column = next((column for column in columns if column.holds(heading.text)), None)
        if column is None:
            hint = did_you_mean(heading.text, [column.name for column in columns])
            problems.append(heading.problem(f"unknown column {heading.text!r}{hint}"))
        elif column in matched.values():
            problems.append(heading.problem(f"column {column.name} is given twice"))
        else:
            matched[index] = column
    lacking = [column.name for column in columns if column.needed and column not in matched.values()]
    if lacking and not problems:
        problems.append(first[0].problem(f"expected a column {' and a column '.join(lacking)}"))
    found = {}
    for index, column in matched.items():
        try:
            found[index] = column, _unit(sheet.units[index], column)
        except ValueError as error:
            problems.append(first[index].problem(f"column {column.name}: {error}"))
    return found


def _unit(written: str, column: Column) -> str:
    """Return the unit of a column in its table, known to fit; empty for SI."""
    unit = written or column.given_unit
    if unit in ("-", "1") and column.unit == "1":
        return ""
    if not unit and column.unit != "1":
        raise ValueError(
            f"expected its unit, such as {column.name + f' [{example_unit(column.unit)}]'!r} in the first line"
        )
    _in_si("1", unit, column.unit)
    return unit


def _number(cell: Cell, column: Column, unit: str, allow_missing: bool) -> float:
    if cell.text.lower() in _MISSING:
        if allow_missing:
            return math.nan
        raise ValueError(f"expected a number, got {cell.text!r}")
    if not _NUMBER.match(cell.text):
        raise ValueError(f"expected a number, got {cell.text[:60]!r}")
    value = _in_si(cell.text, unit, column.unit)
    if not math.isfinite(value):
        raise ValueError(f"expected a finite number, got {cell.text!r}")
    if column.above is not None and not value > column.above:
        raise ValueError(f"expected a value above {column.above:g}, got {_shown(cell, unit)}")
    if column.least is not None and not value >= column.least:
        raise ValueError(f"expected at least {column.least:g}, got {_shown(cell, unit)}")
    return value


def _shown(cell: Cell, unit: str) -> str:
    return repr(f"{cell.text} {unit}".strip())


def _in_si(number: str, unit: str, wanted: str) -> float:
    """Convert as a campaign file does; temperatures take C, angular frequencies Hz and 1/s, wave numbers 1/m."""
    number = number.replace(",", ".")
    if not unit:
        return float(number)
    if wanted == "K" and unit in _CELSIUS:
        unit = "degC"
    if not wanted.startswith("rad/"):
        return to_si(f"{number} {unit}", wanted)
    try:
        return to_si(f"{number} {unit}", wanted)
    except ValueError:
        return (2 * math.pi if "hz" in unit.lower() else 1.0) * to_si(f"{number} {unit}", wanted.replace("rad", "1"))
