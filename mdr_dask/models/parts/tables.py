"""Tables of numbers as people keep them: names with or without units, decimal commas, comments, a byte-order mark."""

from __future__ import annotations

import csv
import re
import reprlib
from dataclasses import dataclass

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError

COMMENT = "#%"
SEPARATORS = "\t;,"
SCALES = {
    "m": 1.0,
    "mm": 1e-3,
    "um": 1e-6,
    "µm": 1e-6,
    "μm": 1e-6,
    "nm": 1e-9,
    "pa": 1.0,
    "kpa": 1e3,
    "mpa": 1e6,
    "gpa": 1e9,
    "hz": 2 * np.pi,
    "1/s": 1.0,
    "rad/s": 1.0,
    "s": 1.0,
}
"""Units of lengths, moduli, times and frequencies that a row of units may hold, in SI (frequencies in rad/s)."""
TEMPERATURES = ("k", "c", "°c", "degc")
"""Units of temperatures, which are not scaled."""
_WITH_UNIT = re.compile(r"(.*?)\s*[\[(]([^\])]*)[\])]\Z")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?\Z")


@dataclass(frozen=True)
class Table:
    """Columns of numbers.

    Parameters
    ----------
    names : tuple of str
        Names of the columns; empty if the table has none.
    units : tuple of str
        Units as written, in a row of their own or in brackets behind the names; empty if the table has none.
    values : array, shape (rows, columns)
        NaN where an entry is empty.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: FloatArray

    def scale(self, column: int, unit: str) -> float:
        """Return the factor to SI of a column, by its own unit or by one given for the table.

        Raises
        ------
        DataError
            If the unit is not known.
        """
        written = (self.units[column].strip("[]() ") if self.units else "") or unit
        if written.lower() not in SCALES:
            raise DataError(f"expected one of the units {', '.join(SCALES)}, got {written!r}")
        return SCALES[written.lower()]


def parse_table(text: str, source: str) -> Table:
    """Read a table from its text.

    Raises
    ------
    DataError
        If there are no rows, or an entry is not a number: ``source:line`` says where.
    """
    lines = [line.strip() for line in text.lstrip("\ufeff").splitlines()]
    kept = [(number, line) for number, line in enumerate(lines, 1) if line and line[0] not in COMMENT]
    if not kept:
        raise DataError(f"{source}: expected rows of numbers, got none")
    separator = next((mark for mark in SEPARATORS if mark in kept[0][1]), None)
    rows = [(number, _entries(line, separator)) for number, line in kept]
    headings: list[tuple[str, ...]] = []
    while rows and len(headings) < 2 and not any(_is_number(entry) for entry in rows[0][1]):
        headings.append(tuple(rows.pop(0)[1]))
    if not rows:
        raise DataError(f"{source}: expected rows of numbers, got only names")
    width = len(headings[0]) if headings else len(rows[0][1])
    values = np.array([_numbers(row, width, f"{source}:{number}") for number, row in rows])
    names = headings[0] if headings else ()
    if len(headings) == 2:
        return Table(names, headings[1], values)
    return Table(*_with_units(names), values)


def _with_units(names: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Split names such as ``z [um]``, if the brackets of any of them hold a unit."""
    parts = [match.groups() if (match := _WITH_UNIT.match(name)) else (name, "") for name in names]
    if not any(unit.strip().lower() in (*SCALES, *TEMPERATURES) for _, unit in parts):
        return names, ()
    return tuple(name for name, _ in parts), tuple(unit for _, unit in parts)


def _entries(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return line.split()
    entries = [entry.strip() for entry in next(csv.reader([line], delimiter=separator))]
    if separator == ",":
        return entries
    return [entry.replace(",", ".") if _DECIMAL_COMMA.match(entry) else entry for entry in entries]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _numbers(row: list[str], width: int, place: str) -> list[float]:
    if len(row) != width or not all(_is_number(entry) or entry == "" for entry in row):
        raise DataError(f"{place}: expected {width} numbers, got {reprlib.repr(row)}")
    return [float(entry) if entry else np.nan for entry in row]
