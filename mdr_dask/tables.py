"""Read tables in the forms in which people and instruments write them.

`decoded` returns the content of a file as text. `read_sheet` finds the names, units and numbers in a text. `match` of
`mdr_dask.headings` compares the names with the columns that a caller expects. `read_table` converts the numbers to SI.
"""

from __future__ import annotations

import csv
import io
import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import BoolArray, FloatArray, IntArray
from mdr_dask.errors import DataError, similar
from mdr_dask.headings import Column, factors, fits, is_called, match, nearest, plain, split_unit
from mdr_dask.units import example_unit, in_degrees, is_unit, scaled

COMMENT = "#%"
BLANKS = r"\s+"
SEPARATORS = ("\t", ";", "|", ",", BLANKS)
#: In the text of a workbook, each sheet begins with a line of this text and the name of the sheet.
SHEET = "# sheet of a workbook: "
#: Measured values count as equal up to this relative difference, because instruments print only three digits.
AGREE = 0.01
HEAD_LINES = 100  # larger than the number of lines above the names in the files of instruments, chosen by trial
NO_ROWS = "expected a line of names and at least one line of values"

#: A column name that stands for a common logarithm: ``log10 q``, ``lg(q)``.
_LOGARITHM = re.compile(r"(?:log10|log|lg)(?:[\s_]+|\s*(?=\())(.+)", re.IGNORECASE)
#: Characters that may separate thousands, in addition to the point or comma that is not the decimal mark.
_GROUPS = "'\N{RIGHT SINGLE QUOTATION MARK} \N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}"
#: For each decimal mark, the pattern of a number with this mark. The other mark may separate thousands.
_DECIMALS = {
    mark: rf"[+-]?(?:(?:\d+|[1-9]\d{{0,2}}(?:[{other}{_GROUPS}]\d{{3}})+)(?:[{mark}]\d*)?|[{mark}]\d+)(?:[eE][+-]?\d+)?"
    for mark, other in (".,", ",.")
}
_NUMBER = re.compile(rf"(?=.{{1,60}}\Z)(?:{_DECIMALS['.']}|{_DECIMALS[',']})")
_TEMPERATURE = r"([+-]?\d+(?:[.,]\d+)?)[\s\[(]*(°\s?[CF]|deg[CF]|[CFK])\b"
_STATED = re.compile(rf"(?<![a-z])t(?:emp[a-z]*)?\.?\s*[=:]?\s*{_TEMPERATURE}", re.IGNORECASE)
_MISSING = re.compile(
    r"(?=.{0,20}\Z)[\s.,/*#_<>–—-]*(n[\s.,/]*a[.,]?n?|no[\s_]*data|null|none)?[\s.,/*#_<>–—-]*", re.IGNORECASE
)
_WORD = re.compile(r"(?!inf|nan)[^\W\d]{2}", re.IGNORECASE)

Cells = NDArray[np.object_]
#: The meaning of a column of a table: its `Column`, its unit, and whether its entries are common logarithms.
Meaning = tuple[Column | None, str, bool]


class Line(NamedTuple):
    """The place of a line of a table, counted from 1 in the text or in the sheet of a workbook."""

    number: int
    sheet: str = ""

    def __str__(self) -> str:
        return f"sheet {self.sheet!r}, row {self.number}" if self.sheet else f"line {self.number}"

    def message(self, source: str, what: str) -> str:
        """Return a message about this line of the file `source`."""
        return f"{source}: {self}: {what}" if self.sheet else f"{source}:{self.number}: {what}"


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


class Read(dict[str, FloatArray]):
    """The columns that were read from a table, in SI, indexed by `Column.name`.

    `headings` contains the name of each column as written in the table. `remark` names the columns and lines of the
    table that were not used. `unused` maps the name of each unused column to its unit and its numbers.
    """

    headings: Mapping[str, str] = {}
    lines: tuple[Line, ...] = ()
    remark: str = ""
    unused: Mapping[str, tuple[str, FloatArray]] = {}

    def leave_out_incomplete(self) -> None:
        """Remove the rows in which a number is missing, and state the number of removed rows in `remark`."""
        known = np.isfinite(np.array([*self.values()])).all(axis=0)
        if known.all():
            return
        self.update({name: column[known] for name, column in self.items()})
        self.lines = tuple(compress(self.lines, known))
        missing = f"rows without a number are left out: {np.count_nonzero(~known)}"
        self.remark = "; ".join(filter(None, (self.remark, missing)))


def is_table(path: str | Path) -> bool:
    """Return whether a path is a file other than a campaign or a published study, and so may contain a table."""
    return Path(path).is_file() and Path(path).suffix not in (".yaml", ".zip")


def decoded(content: bytes, source: str) -> str:
    """Return the content of a text file in UTF-8, UTF-16 or Windows-1252, or of an Excel workbook, as text."""
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


def decimal_marks(texts: Sequence[str]) -> str:
    """Return which of ``.`` and ``,`` can be the decimal mark of all texts: ``,`` for ``30,0``, both for ``3,158``."""
    return "".join(mark for mark, form in _DECIMALS.items() if all(map(re.compile(form).fullmatch, texts)))


def _of_workbook(cell: object, kinds: set[str]) -> str:
    """Return a cell as text on one line, with a decimal point instead of a decimal comma.

    `kinds` contains the decimal marks of all texts in the workbook that have only one possible mark. A text such as
    ``3,158`` has two possible marks, and is read as a number only if `kinds` contains exactly one mark.
    """
    text = " ".join(str(cell).split())
    kind = decimal_marks([text]) if isinstance(cell, str) else ""
    if len(kind) == 2 and re.search("[.,]", text):
        if len(kinds) != 1:
            return f"{text} (as text, with an uncertain decimal mark)"
        (kind,) = kinds
    return text.replace(".", "").replace(",", ".") if kind == "," else text


def _lines(text: str) -> Iterator[tuple[Line, str]]:
    """Yield the lines of a text that are not empty."""
    sheet, before = "", 0
    # a name in quotation marks may contain a line break
    text = re.sub(r'(?:^|(?<=[\n;,\t]))"[^"]*"(?=[;,\t\r\n])', lambda found: re.sub(r"\s+", " ", found[0]), text)
    for number, line in enumerate(text.lstrip("\ufeff").splitlines(), 1):
        if line.startswith(SHEET):
            sheet, before = line.removeprefix(SHEET), number
        elif line.strip(" ,;\t-=_+|"):  # neither empty nor a line of dashes
            yield Line(number - before, sheet), line


def _split(line: str, separator: str) -> list[str]:
    if separator == BLANKS:
        return re.sub(r"\s+(?=[\[(])", "", line).split()  # a unit in brackets belongs to the name before it
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    return [cell.strip() for cell in next(csv.reader([line[:100_000]], delimiter=separator, skipinitialspace=True))]


def _separator(lines: Sequence[str]) -> str:
    """Return the separator that splits the largest number of lines into several numbers.

    If no separator splits a line into numbers, return the separator that occurs in the largest number of lines. Lines
    split by commas or blanks count half, because commas also occur inside numbers, and blanks also occur before units.
    """

    def has_numbers(line: str, mark: str) -> bool:
        filled = [cell for cell in _split(line, mark) if cell] if mark == BLANKS or mark in line else []
        count = sum(bool(_NUMBER.fullmatch(cell)) for cell in filled)
        return count > 1 and 2 * count >= len(filled)

    several = {
        mark: sum(has_numbers(line, mark) for line in lines) * (2 if mark in "\t;|" else 1) for mark in SEPARATORS
    }
    best = max(SEPARATORS, key=lambda mark: several[mark])
    if not several[best]:
        best = max(SEPARATORS[:-1], key=lambda mark: sum(mark in line for line in lines))
        return best if any(best in line for line in lines) else ","
    if best == "," and all(_NUMBER.fullmatch(line.strip()) for line in lines[1:]) and "," not in lines[0]:
        return ";"  # the table is one column of numbers with decimal commas
    return best


def read_sheet(text: str, source: str, is_name: Callable[[str], bool] | None = None) -> Sheet:
    """Find the names, the units and the lines of numbers of a table.

    Text above the names and below the numbers is left out. A table may consist of several blocks of numbers, each below
    the same line of names. If a temperature is stated above each block, the temperatures become a further column.
    If groups of columns with the same names stand side by side, the groups are joined one below the other. If cells may
    be words, the caller must give the function `is_name`, which returns whether a text is the name of a column.
    """
    grid = _grid(source, list(_lines(text)))
    if is_name is None:
        data, numeric = _lines_of_numbers(grid)
        head = _head(grid, data, numeric.size)
    else:
        head = _head_of_words(grid, is_name)
        data, numeric = np.ones(len(grid.cells), dtype=bool), grid.number[head.begin :].mean(axis=0) >= 0.5
    rows, stated, remark = _body(grid, head, data, numeric)
    first = grid.lines[rows[0] if head.names is None else head.names]
    names, units = _names_and_units(grid, head) if head.names is not None else ((), ("",) * numeric.size)
    _require_even(grid, rows, len(units), numeric, first)
    cells = _with_points(grid, rows)[:, : len(units)]
    sheet = Sheet(source, names, units, cells, tuple(grid.lines[row] for row in rows), first, remark)
    places = [place for place, name in enumerate(names) if name or cells[:, place].any()]
    known = [(plain(names[place]), units[place]) for place in places]
    for count in range(2, len(known) // 2 + 1):
        if known == known[:count] * (len(known) // count):
            return _from_groups(grid, sheet, head.labels, np.reshape(places, (-1, count)))
    if not names or not all(stated) or any(is_called(name, "temperature") for name in names):
        return sheet
    temperatures, of_temperature = zip(*filter(None, stated), strict=True)
    return replace(
        sheet,
        names=(*names, "temperature"),
        units=(*units, of_temperature[0]),
        cells=np.column_stack([cells, temperatures]),
    )


@dataclass(frozen=True, eq=False)
class _Grid:
    """The cells of a text as an array, with masks of the filled cells, of the numbers and of the words.

    `length` contains the number of cells of each line in the text. In `cells`, short lines are filled up with empty
    cells. A word is a filled cell that is neither a number nor a mark of a missing number.
    """

    source: str
    separator: str
    cells: Cells
    lines: tuple[Line, ...]
    length: NDArray[np.int64]
    filled: BoolArray
    number: BoolArray
    word: BoolArray

    def require(self, wrong: Sequence[int], what: str) -> None:
        """Raise DataError if `wrong` contains lines. The message shows the first line and counts the other lines."""
        if len(wrong):
            raise DataError(self.lines[wrong[0]].message(self.source, what + further(len(wrong))))


def further(count: int) -> str:
    """Return a text such as `` (and in 2 more lines)`` for a problem in 3 lines."""
    return f" (and in {count - 1} more line{'s' if count > 2 else ''})" if count > 1 else ""


def _grid(source: str, every: Sequence[tuple[Line, str]]) -> _Grid:
    """Split lines into cells. Comments are left out, unless they contain the names of the columns."""
    texts = [(line, text) for line, text in every if text.lstrip()[0] not in COMMENT]
    if not texts:
        raise DataError(Line(1).message(source, NO_ROWS))
    lines = [line for line, _ in texts]
    separator = _separator([text for _, text in texts])
    rows = [_split(text, separator) for _, text in texts]
    has_names = not any(map(_NUMBER.fullmatch, rows[0])) and not _are_units(rows[0])
    for line, comment in [] if has_names else reversed(every[: every.index(texts[0])]):
        split = (_split(comment.lstrip(COMMENT + " "), each) for each in SEPARATORS)
        names = next((names for names in split if len(names) == len(rows[0]) > 1), [])
        if not names or any(map(_NUMBER.fullmatch, names)):
            break
        rows, lines = [names, *rows], [line, *lines]
    width = 1 + max((place for row in rows for place, cell in enumerate(row) if cell), default=0)
    cells = np.array([[*row[:width], *[""] * (width - len(row))] for row in rows], dtype=object)
    number = np.array([[bool(_NUMBER.fullmatch(cell)) for cell in row] for row in cells])
    word = ~number
    word[word] = [not _MISSING.fullmatch(cell) for cell in cells[word]]
    length = np.array([min(len(row), width) for row in rows])
    return _Grid(source, separator, cells, tuple(lines), length, cells != "", number, word)


class _Head(NamedTuple):
    """The indices of the line of names, of the line of units, and of the line of labels above groups of columns.

    An index is None if the table has no such line. Numbers are read from the line `begin` on.
    """

    names: int | None
    units: int | None
    labels: int | None
    begin: int


def _head(grid: _Grid, data: BoolArray, width: int) -> _Head:
    """Find the names and units in the lines of text above the numbers.

    `data` is a mask of the lines of numbers, and `width` is the number of cells of most of these lines. A candidate is
    a line above the numbers with `width` cells. Without candidates, the last line above the numbers contains the names.
    If the last candidate contains names with units, there is no line of units. If a candidate below the first consists
    of units, the candidate above it contains the names. If only the first of several candidates consists of units, the
    last candidate contains the names. The candidate that remains above the names contains labels of columns.
    """
    full = np.flatnonzero(data & (grid.length == width))
    if not full.size:
        grid.require([len(grid.cells) - 1], NO_ROWS)
    begin = int(full[0])
    above = [row for row in range(begin) if not data[row]]
    if not above and begin + 2 < data.size and not data[begin + 1]:  # the first numbers are labels of columns
        above, begin = [begin, begin + 1], begin + 2
    if not above:
        return _Head(None, None, None, begin)
    wide = [row for row in above if grid.length[row] == width] or above[-1:]
    units = next((row for row in wide[:0:-1] if _are_units(grid.cells[row])), None)
    if units != wide[-1] and any(unit and is_unit(unit) for _, unit in map(split_unit, grid.cells[wide[-1]])):
        units = None
    elif units is not None:
        wide = wide[: wide.index(units)]
    elif len(wide) > 1 and _are_units(grid.cells[wide[-2]]):
        units = wide.pop(-2)
    return _Head(wide[-1], units, wide[-2] if len(wide) > 1 else None, above[-1] + 1)


def _lines_of_numbers(grid: _Grid) -> tuple[BoolArray, BoolArray]:
    """Return masks of the lines and of the columns that contain numbers.

    A column is numeric if at least half of the lines with the most frequent number of cells have a number in this
    column. A line contains numbers if at least half of its filled cells in numeric columns are numbers or marks of
    missing numbers. A line that begins with a word is text if the word is in a numeric column, or if less than half of
    the columns are filled. With exactly half of the columns filled, such a line is text if most lines have more cells.
    """
    mostly = grid.number.any(axis=1) & (grid.number.sum(axis=1) >= grid.word.sum(axis=1))
    mostly = mostly if mostly.any() else grid.number.any(axis=1)  # every line has more words than numbers
    lengths = Counter(grid.length[mostly].tolist() or [0])
    width = max(lengths, key=lambda each: (lengths[each], each))
    numeric = np.zeros(width, dtype=bool)
    if mostly.any():
        numeric = grid.number[mostly & (grid.length == width), :width].mean(axis=0) >= 0.5
    wide = np.append(numeric, np.zeros(grid.cells.shape[1] - width, dtype=bool))
    first = grid.filled.argmax(axis=1)
    begins = np.array([bool(_WORD.match(row[column])) for row, column in zip(grid.cells, first, strict=True)])
    share = 2 * grid.filled.sum(axis=1)
    is_text = begins & (wide[first] | (share < width) | ((share == width) & (grid.length < width)))
    filled, words = (marks[:, wide].sum(axis=1) for marks in (grid.filled, grid.word))
    has_numbers = (2 * words <= filled) & grid.number[:, wide].any(axis=1)
    return np.asarray((filled > 0) & (has_numbers | (words == 0)) & ~is_text), numeric


def _head_of_words(grid: _Grid, is_name: Callable[[str], bool]) -> _Head:
    """Find the line of names of a table whose cells may be words: the first line with a known name."""
    count = len(grid.cells)
    names = next((row for row in range(count) if any(is_name(split_unit(cell)[0]) for cell in grid.cells[row])), 0)
    grid.require([names] if grid.number[names].any() else [], "expected a line of names")
    units = names + 1 if names + 1 < count and _are_units(grid.cells[names + 1]) else None
    begin = names + 1 if units is None else units + 1
    grid.require([names] if begin == count else [], NO_ROWS)
    return _Head(names, units, None, begin)


def _body(
    grid: _Grid, head: _Head, data: BoolArray, numeric: BoolArray
) -> tuple[list[int], list[tuple[str, str] | None], str]:
    """Return the indices of the lines of numbers, the temperature stated above each line, and a remark.

    The remark lists the lines below the numbers. DataError is raised for text between two lines of numbers, unless this
    text repeats the line of names.
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


def _stated(grid: _Grid, rows: Sequence[int]) -> tuple[str, str] | None:
    """Return the last temperature in the lines `rows`, with its unit, or None if the lines contain no temperature."""
    found = [each for row in rows for each in _STATED.finditer(" ".join(grid.cells[row]))]
    return (found[-1][1].replace(",", "."), in_degrees(found[-1][2].replace(" ", ""))) if found else None


def _names_and_units(grid: _Grid, head: _Head) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names and the units of the columns. A line of units takes precedence over units in the names."""
    parts = [split_unit(name) for name in grid.cells[head.names][: grid.length[head.names]]]
    below = [""] * len(parts) if head.units is None else [cell.strip("[](){}<> ") for cell in grid.cells[head.units]]
    units = (in_degrees(one or own) for one, (_, own) in zip(below, parts, strict=False))
    return tuple(name for name, _ in parts), tuple(units)


def _require_even(grid: _Grid, rows: Sequence[int], width: int, numeric: BoolArray, first: Line) -> None:
    """Raise DataError if a line ends before the last column of numbers, or has more cells than the table has names."""
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


def _with_points(grid: _Grid, rows: Sequence[int]) -> Cells:
    """Return the cells of `rows`, with all numbers written with decimal points and without marks between thousands.

    DataError is raised if some numbers have a decimal point and other numbers have a decimal comma.
    """
    cells, number = grid.cells[rows], grid.number[rows]
    texts: list[str] = cells[number].tolist()
    count = {mark: sum(mark in text for text in texts) for mark in _DECIMALS}
    possible = decimal_marks(texts)
    if not possible or (len(possible) == 2 and all(count.values())):
        of = np.argwhere(number)[:, 0]
        ranks = [[(decimal_marks([text]) == mark, mark in text) for text in texts] for mark in ".,"]
        point, comma = (rank.index(max(rank)) for rank in ranks)
        what = (
            f"expected decimal commas or decimal points, got both ({texts[point]!r}, and {texts[comma]!r} in "
            f"{grid.lines[rows[of[comma]]]}): write one kind of decimals"
        )
        grid.require([rows[of[point]]], what)
    decimal = max(possible, key=lambda mark: count[mark])
    kept = str.maketrans(decimal, ".", ".,".replace(decimal, "") + _GROUPS)
    cells[number] = [text.translate(kept) for text in texts]
    return cells


def _from_groups(grid: _Grid, sheet: Sheet, labels: int | None, groups: IntArray) -> Sheet:
    """Join groups of columns into one group, in which the rows of the second group follow the rows of the first group.

    `groups` contains the indices of the columns of each group. If the groups have no column of temperatures, the
    temperature in the label above each group becomes a further column.
    """
    names, units = ([each[place] for place in groups[0]] for each in (sheet.names, sheet.units))
    extra: list[list[str]] = [[] for _ in groups]
    if not any(is_called(name, "temperature") for name in names):
        above = [] if labels is None else [cell for cell in grid.cells[labels] if cell]
        share = len(above) // len(groups)  # number of labels of each group
        texts = [" ".join(dict.fromkeys(above[k * share : (k + 1) * share])) for k in range(len(groups))]
        known = [found for text in texts if (found := re.search(_TEMPERATURE, text))]
        if not len(known) * share == len(above) > 0 or len({each[2] for each in known}) > 1:
            what = f"expected {len(groups)} temperatures such as '20 degC', one in the heading of each group of columns"
            raise DataError(sheet.head.message(sheet.source, what))
        names, units = [*names, "temperature"], [*units, in_degrees(known[0][2])]
        extra = [[each[1].replace(",", ".")] for each in known]
    filled = [
        (line, [*cells, *more])
        for places, more in zip(groups, extra, strict=True)
        for line, cells in zip(sheet.lines, sheet.cells[:, places], strict=True)
        if any(cells)
    ]
    lines, rows = zip(*filled, strict=True)
    return replace(sheet, names=tuple(names), units=tuple(units), cells=np.array(rows, dtype=object), lines=lines)


def _are_units(row: Sequence[str]) -> bool:
    """Return whether at least half of the filled cells of a line are units, or all are in square brackets."""
    filled = [text for text in row if text not in ("", "-", "--", "1", "[1]", "[-]")]
    # a text such as "10 mm" is a value and not a unit, but "10^3 um^3" is a unit
    texts = [text for text in filled if re.match(r"(?!\d)|10\s*[\^⁰¹²³⁴-⁹]|1e", text)]
    known = sum(is_unit(text.strip("[](){}<> ")) for text in texts)
    return bool(filled) and (2 * known >= len(filled) or all(re.fullmatch(r"\[.*\]", text) for text in filled))


def matched(sheet: Sheet, columns: Sequence[Column]) -> list[Meaning]:
    """Return, for each column of the sheet, its `Column`, its unit, and whether its entries are common logarithms.

    The `Column` is one of `columns`, or None for an unknown column of the sheet. In a sheet without names, `columns`
    describes the columns of the sheet in order. A needed `Column` that no name in the sheet means is
    assigned to the unknown column with its dimension, if there is only one such column and only one such `Column`.
    """
    if not sheet.names:
        count = len(sheet.units)
        if count > len(columns):
            what = f"expected the names of the {count} columns in the first line"
            raise DataError(sheet.head.message(sheet.source, what))
        return [(column, unit, False) for column, unit in zip(columns, sheet.units, strict=False)]
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
        found.append((column, written, is_logarithm))
    missing = [column for column in columns if column.needed and column not in [meant for meant, _, _ in found]]
    for column in missing:
        places = [place for place, (meant, unit, _) in enumerate(found) if meant is None and fits(unit, column)]
        alike = [each for each in columns if fits(each.unit, column)]
        if column.unit != "1" and alike == [column] and len(places) == 1:
            found[places[0]] = column, found[places[0]][1], False
    return found


def read_table(
    text: str,
    source: str,
    columns: Sequence[Column],
    allow_missing: bool = False,
    ways: Sequence[Sequence[str]] = (),
) -> Read:
    """Read the requested columns of a table in SI, each of shape (rows,).

    A table without names must have its columns in the order of `columns`. If `allow_missing` is true, entries without
    a digit become NaN. The message of a DataError contains at most one problem of each column. `ways` contains groups
    of column names, and the table must contain all columns of at least one group. The first complete group is read, and
    columns that belong only to other groups are not used.
    """
    return read_columns(read_sheet(text, source), columns, allow_missing, ways)


def read_columns(
    sheet: Sheet, columns: Sequence[Column], allow_missing: bool = False, ways: Sequence[Sequence[str]] = ()
) -> Read:
    """Read the requested columns of a table that was already split into cells, as `read_table` does."""
    meanings = matched(sheet, columns)
    present = {column.name for column, _, _ in meanings if column}
    way = next((way for way in ways if present.issuperset(way)), None)
    others = {name for each in ways for name in each}.difference(way) if way is not None else set()
    columns = [column for column in columns if column.name not in others]
    meanings = [(each if each in columns else None, unit, is_logarithm) for each, unit, is_logarithm in meanings]
    absent = [column for column in columns if column.name not in present]
    read, problems = _converted(sheet, meanings, allow_missing)
    problems = [*_misspelt(sheet, meanings, absent), *problems]
    unknown = [name for name, (column, _, _) in zip(sheet.names, meanings, strict=False) if column is None]
    lacking = [f"a column {column.name!r}" for column in absent if column.needed]
    columns_of = [" and ".join(f"a column {name!r}" for name in each) for each in ways]
    lacking += ["either " + ", or ".join(columns_of)] if way is None and ways else []
    if lacking and not problems:
        got = f", got {listed(unknown)}" if unknown else ""
        problems = [sheet.head.message(sheet.source, f"expected {' and '.join(lacking)}{got}")]
    if problems:
        raise DataError("\n".join(problems))
    by_unit = [
        f"{name!r} is taken as {column.name!r}, because of its unit"
        for name, (column, unit, is_logarithm) in zip(sheet.names, meanings, strict=False)
        if column and not is_logarithm and match(name, unit, columns)[0] is not column
    ]
    unused = ", ".join(filter(None, unknown))
    read.remark = "; ".join(filter(None, (*by_unit, f"not used: {unused}" if unused else "", sheet.remark)))
    return read


def _misspelt(sheet: Sheet, meanings: Sequence[Meaning], absent: Sequence[Column]) -> Iterator[str]:
    """Yield a message for each unknown column whose name is similar to the name of an absent column."""
    for name, unit, (column, _, _) in zip(sheet.names, sheet.units, meanings, strict=False):
        alike = [each.name for each in absent if not unit or fits(unit, each)]
        hint = "" if column else similar(name, [each.name for each in absent]) or nearest(name, alike)
        if hint:
            yield sheet.head.message(sheet.source, f"unknown column {name!r}{hint}")


def _converted(sheet: Sheet, meanings: Sequence[Meaning], allow_missing: bool) -> tuple[Read, list[str]]:
    """Return the columns of the sheet that mean a `Column`, converted to SI, and messages about their problems."""
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
        name: (unit, _floats(cells))
        for name, unit, cells, (column, _, _) in zip(sheet.names, sheet.units, sheet.cells.T, meanings, strict=False)
        if column is None
    }
    return read, problems


def listed(names: Sequence[str]) -> str:
    """Return the names of columns as a text. If a name contains a temperature, add a hint to rewrite the table."""
    by_temperature = any(re.search(_TEMPERATURE, name) for name in names)
    hint = " (write the temperatures into a column of their own, and these columns one below the other)"
    return (", ".join(filter(None, names))[:200] or "no names") + hint * by_temperature


def _unit(written: str, column: Column) -> str:
    """Return the unit of a column, or an empty text for pure numbers. Raise ValueError for a wrong or missing unit."""
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
    values = np.array([in_si(text) if _NUMBER.fullmatch(text) else math.nan for text in texts])
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


def _floats(cells: Cells) -> FloatArray:
    """Return cells as numbers, with NaN for cells that are not numbers."""
    texts: list[str] = cells.ravel().tolist()
    return np.array([float(text) if _NUMBER.fullmatch(text) else math.nan for text in texts]).reshape(cells.shape)


def numbers(sheet: Sheet) -> FloatArray:
    """Return the cells of a table as numbers, with NaN for cells without a digit and for columns without numbers."""
    values = _floats(sheet.cells)
    is_numeric = ~np.all(np.isnan(values), axis=0)
    places = np.argwhere(np.isnan(values) & is_numeric)
    wrong = [(row, place) for row, place in places if re.search(r"\d", sheet.cells[row, place])]
    if wrong:
        row, place = wrong[0]
        name = f"column {sheet.names[place]}: " if sheet.names else ""
        what = f"{name}expected a number, got {sheet.cells[row, place][:60]!r}{further(len(wrong))}"
        raise DataError(sheet.lines[row].message(sheet.source, what))
    return values


def read_head(text: str) -> Sheet:
    """Return the first rows of a table, with the names and units of its columns. Raise DataError if it has no rows."""
    return read_sheet("\n".join(text.splitlines()[:HEAD_LINES]), "")


def described(text: str, source: str) -> str:
    """Return a text with the number of rows of a table, and the name, unit and range of each column as written."""
    sheet = read_sheet(text, source)
    ranges = []
    for name, unit, column in zip(sheet.names, sheet.units, numbers(sheet).T, strict=False):
        known = column[np.isfinite(column)]
        ends = dict.fromkeys(f"{end:.4g}" for end in (known.min(), known.max())) if known.size else ["nothing"]
        ranges.append(" ".join(filter(None, [name, " to ".join(ends), unit if unit not in ("-", "1") else ""])))
    return f"{len(sheet.cells)} rows; {', '.join(ranges)}{f'; {sheet.remark}' if sheet.remark else ''}"
