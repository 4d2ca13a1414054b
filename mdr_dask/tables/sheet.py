"""From a grid of cells to a `Sheet`: names and units of the columns, and rows of numbers.

`read_sheet` finds, in this order, the columns and the lines with numbers, the head above them, the text between and
below them, and groups of columns. The functions stand in the same order.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import BoolArray
from mdr_dask.errors import DataError
from mdr_dask.headings import is_called, plain, split_unit
from mdr_dask.tables.cells import BLANKS, NO_ROWS, Cells, Grid, Line, are_units, grid_of
from mdr_dask.tables.numerals import decimal_mark, decimal_marks, with_point
from mdr_dask.units import in_degrees

HEAD_LINES = 100  # larger than the number of lines above the names in the files of instruments, chosen by trial

TEMPERATURE = r"([+-]?\d+(?:[.,]\d+)?)[\s\[(]*(°\s?[CF]|deg[CF]|[CFK])\b"
_STATED = rf"(?i)(?<![a-z])t(?:emp[a-z]*)?\.?\s*[=:]?\s*{TEMPERATURE}"
#: A temperature as text, and its unit.
Temperature = tuple[str, str]
_WORD = re.compile(r"(?!inf|nan)[^\W\d]{2}", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Sheet:
    """A table as text.

    `cells` has the shape (rows, columns), and its numbers have decimal points. `lines` contains the line from which
    each row was read. `names` is empty if the table has no names. `units` has an empty text for a column without a
    unit. `head` is the line of names, or the first row of numbers if there are no names. `remark` lists the lines of
    text below the numbers.
    """

    source: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    cells: Cells
    lines: tuple[Line, ...]
    head: Line
    remark: str = ""


def read_sheet(text: str, source: str, is_name: Callable[[str], bool] | None = None) -> Sheet:
    """Find the names, the units and the lines of numbers of a table.

    Text above the names and below the numbers is left out. A table may consist of several blocks of numbers, each below
    the same line of names. If a temperature is stated above each block, the temperatures become a further column.
    If groups of columns with the same names stand side by side, the groups are joined one below the other. If cells may
    be words, the caller must give the function `is_name`, which returns whether a text is the name of a column.
    """
    grid = grid_of(text, source)
    if is_name is None:
        numeric = _numeric_columns(grid)
        data = _lines_of_numbers(grid, numeric)
        head = _head(grid, data, numeric.size)
    else:
        head = _head_of_words(grid, is_name)
        data, numeric = np.ones(len(grid.cells), dtype=bool), grid.number[head.begin :].mean(axis=0) >= 0.5
    rows, stated, remark = _body(grid, head, data, numeric)
    first = grid.lines[rows[0] if head.names is None else head.names]
    names, units = _names_and_units(grid, head, numeric.size)
    _require_even(grid, rows, len(units), numeric, first)
    cells = _with_points(grid, rows)[:, : len(units)]
    sheet = Sheet(source, names, units, cells, tuple(grid.lines[row] for row in rows), first, remark)
    if groups := _groups(sheet):
        return _joined(grid, sheet, head, groups)
    return _with_temperatures(sheet, stated)


def read_head(text: str) -> Sheet:
    """Read the first `HEAD_LINES` lines of a text as a table. Raise DataError if these lines contain no table."""
    return read_sheet("\n".join(text.splitlines()[:HEAD_LINES]), "")


def _numeric_columns(grid: Grid) -> BoolArray:
    """Return a mask of the columns with numbers, for the most frequent number of cells in lines with numbers.

    Lines with more words than numbers are ignored, unless all lines are of this kind. A column is numeric if at least
    half of the lines with the most frequent number of cells have a number in this column.
    """
    mostly = grid.number.any(axis=1) & (grid.number.sum(axis=1) >= grid.word.sum(axis=1))
    mostly = mostly if mostly.any() else grid.number.any(axis=1)  # every line has more words than numbers
    if not mostly.any():
        return np.zeros(0, dtype=bool)
    lengths = Counter(grid.length[mostly].tolist())
    width = max(lengths, key=lambda each: (lengths[each], each))
    return np.asarray(grid.number[mostly & (grid.length == width), :width].mean(axis=0) >= 0.5)


def _lines_of_numbers(grid: Grid, numeric: BoolArray) -> BoolArray:
    """Return a mask of the lines with numbers.

    Only cells in numeric columns count. A line contains numbers if it has at least one number and at most half of its
    filled cells are words, or if its filled cells are all marks of missing numbers. A line that begins with a word is
    text if the word is in a numeric column, or if less than half of the columns are filled.
    """
    width = numeric.size
    numeric = np.append(numeric, np.zeros(grid.cells.shape[1] - width, dtype=bool))
    filled, words = (marks[:, numeric].sum(axis=1) for marks in (grid.filled, grid.word))
    has_numbers = (2 * words <= filled) & grid.number[:, numeric].any(axis=1)
    first = grid.filled.argmax(axis=1)
    begins = np.array([bool(_WORD.match(row[column])) for row, column in zip(grid.cells, first, strict=True)])
    is_text = begins & (numeric[first] | (2 * grid.filled.sum(axis=1) < width))
    return np.asarray((filled > 0) & (has_numbers | (words == 0)) & ~is_text)


class _Head(NamedTuple):
    """The indices of the line of names, of the line of units, and of the line of labels above groups of columns.

    An index is None if the table has no such line. Numbers are read from the line `begin` on.
    """

    names: int | None
    units: int | None
    labels: int | None
    begin: int


def _head(grid: Grid, data: BoolArray, width: int) -> _Head:
    """Find the names and units in the lines of text above the numbers.

    `data` is a mask of the lines of numbers, and `width` is the number of cells of most of these lines. A candidate is
    a line above the numbers with `width` cells. Without candidates, the last line above the numbers contains the names.
    If a candidate below the first consists of units, the candidate above it contains the names. If not, the last
    candidate contains the names; if there are exactly two candidates, the first may then consist of units. The next
    remaining candidate above the names contains labels of columns.
    """
    full = np.flatnonzero(data & (grid.length == width))
    if not full.size:
        grid.require([len(grid.cells) - 1], NO_ROWS)
    begin = int(full[0])
    above = [row for row in range(begin) if not data[row]]
    if not above:
        return _Head(None, None, None, begin)
    wide = [row for row in above if grid.length[row] == width] or above[-1:]
    units = next((row for row in wide[:0:-1] if are_units(grid.cells[row])), None)
    if units is not None:
        wide = wide[: wide.index(units)]
    elif len(wide) > 1 and are_units(grid.cells[wide[-2]]):
        units = wide.pop(-2)
    return _Head(wide[-1], units, wide[-2] if len(wide) > 1 else None, above[-1] + 1)


def _head_of_words(grid: Grid, is_name: Callable[[str], bool]) -> _Head:
    """Find the line of names of a table whose cells may be words: the first line with a known name.

    If no line has a known name, the first line of the table is the line of names.
    """
    count = len(grid.cells)
    names = next((row for row in range(count) if any(is_name(split_unit(cell)[0]) for cell in grid.cells[row])), 0)
    grid.require([names] if grid.number[names].any() else [], "expected a line of names")
    units = names + 1 if names + 1 < count and are_units(grid.cells[names + 1]) else None
    begin = names + 1 if units is None else units + 1
    grid.require([names] if begin == count else [], NO_ROWS)
    return _Head(names, units, None, begin)


def _names_and_units(grid: Grid, head: _Head, width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names and the units of the columns. A line of units takes precedence over units in the names.

    Without a line of names, return no names, and `width` empty units.
    """
    if head.names is None:
        return (), ("",) * width
    parts = [split_unit(name) for name in grid.cells[head.names][: grid.length[head.names]]]
    below = [""] * len(parts) if head.units is None else [cell.strip("[](){}<> ") for cell in grid.cells[head.units]]
    units = (in_degrees(one or own) for one, (_, own) in zip(below, parts, strict=False))
    return tuple(name for name, _ in parts), tuple(units)


def _body(
    grid: Grid, head: _Head, data: BoolArray, numeric: BoolArray
) -> tuple[list[int], list[Temperature | None], str]:
    """Return the indices of the lines of numbers, the temperature stated above each line, and a remark.

    The remark lists the lines below the numbers. DataError is raised for text between two lines of numbers, unless this
    text repeats the line of names, and for a line below the numbers whose first filled cell is a number.
    """
    kept, stated, wrong = [], [], []
    between: list[int] = []
    temperature = _stated(grid, range(head.begin))
    for row in range(head.begin, data.size):
        if not data[row]:
            between.append(row)
            continue
        if head.names is not None and any(np.array_equal(grid.cells[each], grid.cells[head.names]) for each in between):
            temperature = _stated(grid, between)
        else:
            wrong += between
        kept.append(row)
        stated.append(temperature)
        between = []
    first = grid.filled.argmax(axis=1)
    wrong += [row for row in between if grid.number[row, first[row]]]
    if wrong:
        words = np.flatnonzero(grid.word[wrong[0]])
        column = next(iter([*words[np.isin(words, np.flatnonzero(numeric))], *words]), 0)
        several = len({grid.lines[row].sheet for row in [*wrong, *kept]}) > 1
        remedy = " (all sheets of a workbook are read as one table: delete the sheets of other tables)" * several
        grid.require(wrong, f"expected a line of numbers, got {grid.cells[wrong[0], column][:60]!r}{remedy}")
    below = dict.fromkeys(repr(grid.cells[row, first[row]][:60]) for row in between)
    return kept, stated, f"lines below the numbers, left out: {', '.join(below)}" if below else ""


def _stated(grid: Grid, rows: Sequence[int]) -> Temperature | None:
    """Return the last temperature that is stated in the lines `rows`, or None."""
    found = [each for row in rows for each in _temperatures(" ".join(grid.cells[row]), _STATED)]
    return found[-1] if found else None


def _temperatures(text: str, pattern: str = TEMPERATURE) -> list[Temperature]:
    found = re.findall(pattern, text)
    return [(value.replace(",", "."), in_degrees(unit.replace(" ", ""))) for value, unit in found]


def _with_temperatures(sheet: Sheet, temperatures: Sequence[Temperature | None]) -> Sheet:
    """Add a column with the temperature of each row.

    The sheet is returned unchanged if it has no names, if a temperature is missing, or if it has such a column already.
    """
    if not sheet.names or not all(temperatures) or any(is_called(name, "temperature") for name in sheet.names):
        return sheet
    values, units = zip(*filter(None, temperatures), strict=True)
    return replace(
        sheet,
        names=(*sheet.names, "temperature"),
        units=(*sheet.units, units[0]),
        cells=np.column_stack([sheet.cells, values]),
    )


def _require_even(grid: Grid, rows: Sequence[int], width: int, numeric: BoolArray, first: Line) -> None:
    """Raise DataError if a line ends before the last column of numbers, or has more than `width` cells.

    `width` is the number of names or, without names, of the cells in most lines of numbers. If the cells are separated
    by blanks and there are more names than cells in these lines, every line must have `width` cells.
    """
    blanks = width > numeric.size and grid.separator == BLANKS  # a name that contains a blank became two cells
    wrong = [
        row
        for row in rows
        if grid.filled[row, width:].any()
        or numeric[grid.length[row] : width].any()
        or (blanks and grid.length[row] < width)
    ]
    if wrong:
        length = int(grid.length[wrong[0]])
        hint = " (put semicolons between the values if they have decimal commas)" if length > width else ""
        if grid.word[wrong[0]].any():
            hint = " (write a missing number as one word, such as nan, or put semicolons between the cells)"
        hint = " (write names without blanks, or put tabs between the columns)" if blanks else hint
        grid.require(wrong, f"expected {width} values as in {first}, got {length}{hint}")


def _with_points(grid: Grid, rows: Sequence[int]) -> Cells:
    """Return the cells of `rows`, with all numbers written with decimal points and without marks between thousands.

    DataError is raised if some numbers have a decimal point and other numbers have a decimal comma.
    """
    cells, number = grid.cells[rows], grid.number[rows]
    texts: list[str] = cells[number].tolist()
    decimal = decimal_mark(texts)
    if not decimal:
        of = np.argwhere(number)[:, 0]
        ranks = [[(decimal_marks([text]) == mark, mark in text) for text in texts] for mark in ".,"]
        point, comma = (rank.index(max(rank)) for rank in ranks)
        what = (
            f"expected decimal commas or decimal points, got both ({texts[point]!r}, and {texts[comma]!r} in "
            f"{grid.lines[rows[of[comma]]]}): write one kind of decimals"
        )
        grid.require([rows[of[point]]], what)
    cells[number] = [with_point(text, decimal) for text in texts]
    return cells


def _groups(sheet: Sheet) -> list[list[int]]:
    """Return the columns of each group if groups with equal names and units stand side by side, or [].

    A group has at least two columns. Columns without names and values are ignored.
    """
    places = [place for place, name in enumerate(sheet.names) if name or sheet.cells[:, place].any()]
    known = [(plain(sheet.names[place]), sheet.units[place]) for place in places]
    for size in range(2, len(known) // 2 + 1):
        if known == known[:size] * (len(known) // size):
            return [places[start : start + size] for start in range(0, len(places), size)]
    return []


def _joined(grid: Grid, sheet: Sheet, head: _Head, groups: Sequence[Sequence[int]]) -> Sheet:
    """Join groups of columns into one group, in which the rows of the second group follow the rows of the first group.

    Empty rows of a group are left out. If the groups have no column of temperatures, the temperature in the label above
    each group becomes a further column. DataError is raised if a label states no temperature.
    """
    pairs = [(line, row[places]) for places in groups for line, row in zip(sheet.lines, sheet.cells, strict=True)]
    filled = [row.any() for _, row in pairs]
    lines, rows = zip(*compress(pairs, filled), strict=True)
    first = groups[0]
    names, units = (tuple(each[place] for place in first) for each in (sheet.names, sheet.units))
    joined = replace(sheet, names=names, units=units, cells=np.array(rows, dtype=object), lines=lines)
    if any(is_called(name, "temperature") for name in names):
        return joined
    labels = [] if head.labels is None else [cell for cell in grid.cells[head.labels] if cell]
    share = len(labels) // len(groups)  # number of labels of each group
    texts = [" ".join(dict.fromkeys(labels[k * share : (k + 1) * share])) for k in range(len(groups))]
    known = [found[0] for text in texts if (found := _temperatures(text))]
    if not len(known) * share == len(labels) > 0 or len({unit for _, unit in known}) > 1:
        what = f"expected {len(groups)} temperatures such as '20 degC', one in the heading of each group of columns"
        raise DataError(sheet.head.message(sheet.source, what))
    return _with_temperatures(joined, [*compress([each for each in known for _ in sheet.lines], filled)])
