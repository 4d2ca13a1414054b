"""From a `Sheet` to the columns that a caller expects, in SI units."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, similar
from mdr_dask.headings import Column, factors, fits, match, nearest, split_unit
from mdr_dask.tables.cells import Line, further
from mdr_dask.tables.numerals import floats, is_number
from mdr_dask.tables.sheet import TEMPERATURE, Sheet, read_sheet
from mdr_dask.units import example_unit, scaled

#: Measured values count as equal up to this relative difference, because some instruments print only three digits.
AGREE = 0.01
#: A column name that stands for a common logarithm: ``log10 q``, ``lg(q)``.
_LOGARITHM = re.compile(r"(?:log10|log|lg)(?:[\s_]+|\s*(?=\())(.+)", re.IGNORECASE)


class Meaning(NamedTuple):
    """The meaning of a column of a sheet. `column` is None if none of the expected columns has its name."""

    column: Column | None
    unit: str
    is_logarithm: bool


class Read(dict[str, FloatArray]):
    """The columns that were read from a table, in SI, indexed by `Column.name`.

    `headings` contains the name of each column as written in the table. `lines` contains the line of each row. `remark`
    names the columns that were found only by their unit, and the columns and lines of the table that were not used.
    `unused` maps the name of each unused column to its unit and its numbers.
    """

    headings: Mapping[str, str] = {}
    lines: tuple[Line, ...] = ()
    remark: str = ""
    unused: Mapping[str, tuple[str, FloatArray]] = {}

    def leave_out_incomplete(self) -> None:
        """Remove the rows in which a number is missing, and state the number of removed rows in `remark`.

        The columns in `unused` keep all rows.
        """
        known = np.isfinite(np.array([*self.values()])).all(axis=0)
        if known.all():
            return
        self.update({name: column[known] for name, column in self.items()})
        self.lines = tuple(compress(self.lines, known))
        missing = f"rows without a number are left out: {np.count_nonzero(~known)}"
        self.remark = "; ".join(filter(None, (self.remark, missing)))


def read_table(
    text: str,
    source: str,
    columns: Sequence[Column],
    allow_missing: bool = False,
    ways: Sequence[Sequence[str]] = (),
) -> Read:
    """Read the requested columns of a table in SI, each of shape (rows,).

    A table without names must have its columns in the order of `columns`. The result lacks an optional column that the
    table does not have. If `allow_missing` is true, entries without a digit become NaN. The message of a DataError
    contains at most one problem of each column. `ways` contains groups of column names, and the table must contain all
    columns of at least one group. The first complete group is read, and columns that belong only to other groups are
    not used.
    """
    return read_columns(read_sheet(text, source), columns, allow_missing, ways)


def read_columns(
    sheet: Sheet, columns: Sequence[Column], allow_missing: bool = False, ways: Sequence[Sequence[str]] = ()
) -> Read:
    """Read the requested columns of a table that was already split into cells, as `read_table` does."""
    meanings = matched(sheet, columns)
    present = {each.column.name for each in meanings if each.column}
    way = next((way for way in ways if present.issuperset(way)), None)
    others = {name for each in ways for name in each}.difference(way) if way is not None else set()
    columns = [column for column in columns if column.name not in others]
    meanings = [each if each.column in columns else each._replace(column=None) for each in meanings]
    absent = [column for column in columns if column.name not in present]
    unknown = [name for name, each in zip(sheet.names, meanings, strict=False) if each.column is None]
    read, wrong = _converted(sheet, meanings, allow_missing)
    lacking = [f"a column {column.name!r}" for column in absent if column.needed]
    if ways and way is None:
        columns_of = [" and ".join(f"a column {name!r}" for name in each) for each in ways]
        lacking.append("either " + ", or ".join(columns_of))
    problems = [*_misspelt(sheet, meanings, absent), *wrong]
    if lacking and not problems:
        got = f", got {listed(unknown)}" if unknown else ""
        problems = [sheet.head.message(sheet.source, f"expected {' and '.join(lacking)}{got}")]
    if problems:
        raise DataError("\n".join(problems))
    unused = ", ".join(filter(None, unknown))
    remarks = (*_found_by_unit(sheet, meanings, columns), f"not used: {unused}" if unused else "", sheet.remark)
    read.remark = "; ".join(filter(None, remarks))
    return read


def matched(sheet: Sheet, columns: Sequence[Column]) -> list[Meaning]:
    """Return the meaning of each column of the sheet.

    In a sheet without names, `columns` describes the columns of the sheet in order. If no name in the sheet means a
    needed `Column`, a column with an unknown name is taken for this `Column` if its unit has the right dimension, and
    if it is the only unknown column with this dimension. No other `Column` may have the same dimension. A `Column` of
    pure numbers is never found in this way.
    """
    if not sheet.names:
        count = len(sheet.units)
        if count > len(columns):
            what = f"expected the names of the {count} columns in the first line"
            raise DataError(sheet.head.message(sheet.source, what))
        return [Meaning(column, unit, False) for column, unit in zip(columns, sheet.units, strict=False)]
    found = []
    for name, unit in zip(sheet.names, sheet.units, strict=True):
        try:
            column, written = match(name, unit, columns)
        except ValueError as error:
            raise DataError(sheet.head.message(sheet.source, str(error))) from None
        logarithm = _LOGARITHM.fullmatch(name)
        if column is None and logarithm:
            inner, own = split_unit(re.sub(r"^\((.*)\)$", r"\1", logarithm[1].strip()))
            column, written = match(inner, unit or own, columns)
        is_logarithm = column is not None and logarithm is not None and not column.holds(name)
        found.append(Meaning(column, written, is_logarithm))
    missing = [column for column in columns if column.needed and column not in [each.column for each in found]]
    for column in missing:
        places = [place for place, each in enumerate(found) if each.column is None and fits(each.unit, column)]
        alike = [each for each in columns if fits(each.unit, column)]
        if column.unit != "1" and alike == [column] and len(places) == 1:
            found[places[0]] = found[places[0]]._replace(column=column)
    return found


def _misspelt(sheet: Sheet, meanings: Sequence[Meaning], absent: Sequence[Column]) -> Iterator[str]:
    """Yield a message for each unknown column whose name is similar to the name of an absent column."""
    for name, unit, (column, _, _) in zip(sheet.names, sheet.units, meanings, strict=False):
        alike = [each.name for each in absent if not unit or fits(unit, each)]
        hint = "" if column else similar(name, [each.name for each in absent]) or nearest(name, alike)
        if hint:
            yield sheet.head.message(sheet.source, f"unknown column {name!r}{hint}")


def _found_by_unit(sheet: Sheet, meanings: Sequence[Meaning], columns: Sequence[Column]) -> Iterator[str]:
    """Yield a remark for each column that was found by its unit, because its name is not known."""
    for name, (column, unit, is_logarithm) in zip(sheet.names, meanings, strict=False):
        if column and not is_logarithm and match(name, unit, columns)[0] is not column:
            yield f"{name!r} is taken as {column.name!r}, because of its unit"


def _converted(sheet: Sheet, meanings: Sequence[Meaning], allow_missing: bool) -> tuple[Read, list[str]]:
    """Return the columns of the sheet that mean a `Column`, converted to SI, and messages about their problems.

    If two columns of the sheet mean the same `Column`, the first is used. If they disagree, there is a message.
    """
    read, problems, taken = Read(), [], {}
    for place, (column, written, is_logarithm) in enumerate(meanings):
        if column is None:
            continue
        try:
            unit = _unit(written, column)
        except ValueError as error:
            got = f", got {f'{sheet.names[place]} [{written}]'!r}" if sheet.names and written else ""
            problems.append(sheet.head.message(sheet.source, f"column {column.name}: {error}{got}"))
            continue
        values, wrong = _values(sheet, place, column, unit, is_logarithm, allow_missing)
        problems += wrong
        if column.name not in taken:
            read[column.name], taken[column.name] = values, place
        elif not wrong and not np.allclose(values, read[column.name], rtol=AGREE, atol=0, equal_nan=True):
            both = f"{sheet.names[taken[column.name]]!r} and {sheet.names[place]!r}"
            what = f"column {column.name!r} is given twice: {both} disagree: delete one of the two"
            problems.append(sheet.head.message(sheet.source, what))
    read.lines = sheet.lines
    read.headings = {name: sheet.names[place] if sheet.names else "" for name, place in taken.items()}
    read.unused = {
        name: (unit, np.array(floats(cells)))
        for name, unit, cells, (column, _, _) in zip(sheet.names, sheet.units, sheet.cells.T, meanings, strict=False)
        if column is None
    }
    return read, problems


def _unit(written: str, column: Column) -> str:
    """Return the unit of a column, or an empty text for pure numbers without a unit such as ``%``.

    Raise ValueError for a wrong or missing unit.
    """
    unit = written or column.given_unit
    if unit in ("-", "1") and column.unit == "1":
        return ""
    if not unit and column.unit != "1":
        raise ValueError(
            f"expected its unit, such as {column.name + f' [{example_unit(column.unit)}]'!r} in the first line"
        )
    stated = factors(unit, column.unit)
    if column.given_unit and not np.allclose(stated, factors(column.given_unit, column.unit), atol=0):
        raise ValueError(
            f"the file states {written!r}, got the unit {column.given_unit!r}: give a unit only if the file states none"
        )
    return unit


def _values(
    sheet: Sheet, place: int, column: Column, unit: str, is_logarithm: bool, allow_missing: bool
) -> tuple[FloatArray, list[str]]:
    """Return the values of a column in SI, and a list with a message about the first problem, or an empty list."""
    before, factor, zero = factors(unit, column.unit)

    def in_si(text: str) -> float:
        exact = repr(10.0 ** float(text)) if is_logarithm and abs(float(text)) < sys.float_info.max_10_exp else text
        return before * (scaled(exact, factor) + zero)

    texts = sheet.cells[:, place]
    values = np.array([in_si(text) if is_number(text) else math.nan for text in texts])
    above, least = (-math.inf if end is None else end for end in (column.above, column.least))
    fits_bounds = (values > above) & (values >= least) & (values < math.inf)
    rows = [row for row in np.flatnonzero(~fits_bounds) if not allow_missing or re.search(r"\d", texts[row])]
    if not rows:
        return values, []
    text, value = texts[rows[0]][:60], values[rows[0]]
    bound, limit = ("at least", column.least) if column.above is None else ("a value above", column.above)
    if np.isnan(value):
        hint = " (write errors in a column of their own)" if re.search("±|[+][/-]", text) else ""
        is_quantity = re.fullmatch(r"[+-]?[\d.,]+ ?[^\W\d]\S*|.*\d ?%", text)
        hint = " (write units in the line of names)" if is_quantity else hint
        what = f"expected a number, got {text!r}{hint}"
    elif limit is None or not math.isfinite(value):
        what = f"expected a finite number, got {f'{text} {unit}'.strip()!r}"
    else:
        written = f"{(limit / before - zero) / factor:.6g}{f' {unit}' if limit or zero else ''}"
        what = f"expected {bound} {written}, got {f'{text} {unit}'.strip()!r}"
    what = f"column {column.name}: {what}{further(len(rows))}"
    return values, [sheet.lines[rows[0]].message(sheet.source, what)]


def listed(names: Sequence[str]) -> str:
    """Return the names of columns as a text. If a name contains a temperature, add a hint to rewrite the table."""
    by_temperature = any(re.search(TEMPERATURE, name) for name in names)
    hint = " (write the temperatures into a column of their own, and these columns one below the other)"
    return (", ".join(filter(None, names))[:200] or "no names") + hint * by_temperature


def numbers(sheet: Sheet) -> FloatArray:
    """Return the cells of a table as numbers, with NaN for cells without a digit and for columns without numbers.

    Raise DataError if a column of numbers has a cell that contains a digit but is not a number.
    """
    values = np.array([floats(row) for row in sheet.cells])
    is_numeric = ~np.all(np.isnan(values), axis=0)
    places = np.argwhere(np.isnan(values) & is_numeric)
    wrong = [(row, place) for row, place in places if re.search(r"\d", sheet.cells[row, place])]
    if wrong:
        row, place = wrong[0]
        name = f"column {sheet.names[place]}: " if sheet.names else ""
        what = f"{name}expected a number, got {sheet.cells[row, place][:60]!r}{further(len(wrong))}"
        raise DataError(sheet.lines[row].message(sheet.source, what))
    return values


def described(text: str, source: str) -> str:
    """Return a text with the number of rows of a table, and the name, unit and range of each column as written."""
    sheet = read_sheet(text, source)
    ranges = []
    for name, unit, column in zip(sheet.names, sheet.units, numbers(sheet).T, strict=False):
        known = column[np.isfinite(column)]
        ends = dict.fromkeys(f"{end:.4g}" for end in (known.min(), known.max())) if known.size else ["nothing"]
        ranges.append(" ".join(filter(None, [name, " to ".join(ends), unit if unit not in ("-", "1") else ""])))
    return f"{len(sheet.cells)} rows; {', '.join(ranges)}{f'; {sheet.remark}' if sheet.remark else ''}"
