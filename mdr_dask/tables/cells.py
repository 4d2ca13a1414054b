"""From text to a grid of cells: lines, separators, comments, and which cells are numbers or words."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import BoolArray
from mdr_dask.errors import DataError
from mdr_dask.tables.numerals import is_missing, is_number
from mdr_dask.tables.text import SHEET
from mdr_dask.units import is_unit

COMMENT = "#%"
BLANKS = r"\s+"
SEPARATORS = ("\t", ";", "|", ",", BLANKS)
NO_ROWS = "expected a line of names and at least one line of values"

Cells = NDArray[np.object_]


class Line(NamedTuple):
    """The place of a line of a table, counted from 1 in the text or in the sheet of a workbook."""

    number: int
    sheet: str = ""

    def __str__(self) -> str:
        return f"sheet {self.sheet!r}, row {self.number}" if self.sheet else f"line {self.number}"

    def message(self, source: str, what: str) -> str:
        """Return a message about this line of the file `source`."""
        return f"{source}: {self}: {what}" if self.sheet else f"{source}:{self.number}: {what}"


def further(count: int) -> str:
    """Return a text such as `` (and in 2 more lines)`` for a problem in 3 lines. For one line, the text is empty."""
    return f" (and in {count - 1} more line{'s' if count > 2 else ''})" if count > 1 else ""


@dataclass(frozen=True, eq=False)
class Grid:
    """The cells of a text as an array, with masks of the filled cells, of the numbers and of the words.

    `length` contains the number of cells of each line in the text. In `cells`, short lines are filled up with empty
    cells. Columns at the right end that are empty in all lines are left out and not counted. A word is a filled cell
    that is neither a number nor a mark of a missing number.
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


def grid_of(text: str, source: str) -> Grid:
    """Split a text into cells. Comments are left out, unless they contain the names of the columns."""
    every = list(_lines(text))
    texts = [(line, text) for line, text in every if text.lstrip()[0] not in COMMENT]
    if not texts:
        raise DataError(Line(1).message(source, NO_ROWS))
    lines = [line for line, _ in texts]
    separator = separator_of([text for _, text in texts])
    rows = [split(text, separator) for _, text in texts]
    has_names = not any(map(is_number, rows[0])) and not are_units(rows[0])
    for line, comment in [] if has_names else reversed(every[: every.index(texts[0])]):
        ways = (split(comment.lstrip(COMMENT + " "), each) for each in SEPARATORS)
        names = next((names for names in ways if len(names) == len(rows[0]) > 1), [])
        if not names or any(map(is_number, names)):
            break
        rows, lines = [names, *rows], [line, *lines]
    width = 1 + max((place for row in rows for place, cell in enumerate(row) if cell), default=0)
    cells = np.array([[*row[:width], *[""] * (width - len(row))] for row in rows], dtype=object)
    number = np.array([[is_number(cell) for cell in row] for row in cells])
    word = ~number
    word[word] = [not is_missing(cell) for cell in cells[word]]
    length = np.array([min(len(row), width) for row in rows])
    return Grid(source, separator, cells, tuple(lines), length, cells != "", number, word)


def _lines(text: str) -> Iterator[tuple[Line, str]]:
    """Yield the lines of a text that contain more than separators and dashes, each with its place."""
    sheet, before = "", 0
    # a name in quotation marks may contain a line break
    text = re.sub(r'(?:^|(?<=[\n;,\t]))"[^"]*"(?=[;,\t\r\n])', lambda found: re.sub(r"\s+", " ", found[0]), text)
    for number, line in enumerate(text.lstrip("\ufeff").splitlines(), 1):
        if line.startswith(SHEET):
            sheet, before = line.removeprefix(SHEET), number
        elif line.strip(" ,;\t-=_+|"):  # neither empty nor a line of dashes
            yield Line(number - before, sheet), line


def separator_of(lines: Sequence[str]) -> str:
    """Return the separator that splits the lines into the largest share of numbers.

    A line counts only if at least two of its filled cells, and at least half of them, are numbers. Lines split by
    commas or blanks count half, because commas also occur inside numbers, and blanks also occur before units. If no
    line counts, return the separator, apart from blanks, that occurs in the largest number of lines, or a comma if
    there is none.
    """

    def share(line: str, mark: str) -> float:
        filled = [cell for cell in split(line, mark) if cell] if mark == BLANKS or mark in line else []
        count = sum(map(is_number, filled))
        return count / len(filled) if count > 1 and 2 * count >= len(filled) else 0.0

    several = {mark: sum(share(line, mark) for line in lines) * (2 if mark in "\t;|" else 1) for mark in SEPARATORS}
    best = max(SEPARATORS, key=lambda mark: several[mark])
    if not several[best]:
        best = max(SEPARATORS[:-1], key=lambda mark: sum(mark in line for line in lines))
        return best if any(best in line for line in lines) else ","
    if best == "," and all(is_number(line.strip()) for line in lines[1:]) and "," not in lines[0]:
        return ";"  # the table is one column of numbers with decimal commas
    return best


def split(line: str, separator: str) -> list[str]:
    """Split a line into cells without blanks at their ends."""
    if separator == BLANKS:
        return re.sub(r"\s+(?=[\[(])", "", line).split()  # a unit in brackets belongs to the name before it
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    return [cell.strip() for cell in next(csv.reader([line[:100_000]], delimiter=separator, skipinitialspace=True))]


def are_units(row: Sequence[str]) -> bool:
    """Return whether at least half of the filled cells of a line are units, or all are in square brackets.

    Cells such as ``-`` or ``1``, which stand for pure numbers, are ignored.
    """
    filled = [text for text in row if text not in ("", "-", "--", "1", "[1]", "[-]")]
    # a text such as "10 mm" is a value and not a unit, but "10^3 um^3" is a unit
    texts = [text for text in filled if re.match(r"(?!\d)|10\s*[\^⁰¹²³⁴-⁹]|1e", text)]
    known = sum(is_unit(text.strip("[](){}<> ")) for text in texts)
    return bool(filled) and (2 * known >= len(filled) or all(re.fullmatch(r"\[.*\]", text) for text in filled))
