"""Print results and messages: as aligned tables, CSV or JSON."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import re
import shutil
import sys
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from mdr_dask.errors import with_digits

if TYPE_CHECKING:
    import xarray as xr

Row = dict[str, Any]
GAP = "  "
#: Least width, in characters, of a terminal and of a wrapped text in a table. Chosen by trial.
NARROWEST = 25
UNKNOWN = "-"
#: A space at which lines are not broken.
_BLANK = "\N{NO-BREAK SPACE}"


def terminal_width() -> int:
    """Return the width of the terminal in characters, or `NARROWEST` if the terminal is narrower.

    The variable COLUMNS overrides the width of the terminal. If neither is known, the width is 80.
    """
    return max(NARROWEST, shutil.get_terminal_size((80, 24)).columns)


def say(text: str, err: bool = False) -> None:
    """Print a text with control characters escaped.

    Long lines are wrapped between words on a terminal, or if the variable COLUMNS is set.
    """
    stream = sys.stderr if err else sys.stdout
    lines = printable(text).split("\n")
    if stream is not None and (stream.isatty() or "COLUMNS" in os.environ):
        lines = [_filled(line) for line in lines]
    click.echo("\n".join(lines), err=err)


def _filled(line: str) -> str:
    indent = " " * (len(line) - len(line.lstrip()))
    options: dict[str, Any] = {"break_long_words": False, "break_on_hyphens": False}
    return textwrap.fill(line, terminal_width(), subsequent_indent=indent + "  ", **options) or line


def print_rows(rows: Sequence[Row], units: dict[str, str], form: str, limit: int | None = None) -> None:
    """Print rows, all with the same keys: as an aligned ``table``, as ``csv``, or as a ``json`` document with units.

    `limit` is the largest number of rows of an aligned table, or 0 or None for all rows.
    """
    if form == "json":
        print_json({"units": units, "rows": [{key: finite(value) for key, value in row.items()} for row in rows]})
        return
    names = list(rows[0]) if rows else list(units)
    titles = [titled(name, units.get(name, "1")) for name in names]
    if form == "csv":
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(titles)
        writer.writerows([row[name] for name in names] for row in rows)
        click.echo(text.getvalue(), nl=False)
        return
    shown = rows[:limit] if limit else rows
    print_aligned(titles, [[row[name] for row in shown] for name in names])
    print_left(len(rows) - len(shown))


def titled(name: str, unit: str) -> str:
    """Return the heading of a column: the name, and the unit unless the column contains pure numbers."""
    return f"{name} [{unit}]" if unit not in ("1", "") else name


def print_aligned(titles: Sequence[str], columns: Sequence[Sequence[Any]], keys: int = 1, note: str = "") -> None:
    """Print columns side by side. A table that is too wide is printed in parts or, if it has one row, as a list.

    Each part begins with the first `keys` columns. If there are several rows, columns with the same value in all rows
    and columns without values are left out; a line above the table names them. This line begins with `note`.
    """
    rows = len(columns[0]) if columns else 0
    cells = [[cell(value) for value in column] for column in columns]
    if rows > 1:
        same = [all(cell == column[0] for cell in column) for column in cells]
        named = zip(titles, cells, same, strict=True)
        fixed = [(title, column[0]) for title, column, alike in named if alike]
        known = [
            f"{_name(title)} = {cell}{_unit(title)}".replace(" ", _BLANK) for title, cell in fixed if cell != UNKNOWN
        ]
        missing = [_name(title) for title, cell in fixed if cell == UNKNOWN]
        note += f"{'; ' if note else ''}in these rows: {', '.join(known)}" if known else ""
        note += f"{'; ' if note else ''}not known: {', '.join(missing)}" if missing else ""
        keys = sum(not alike for alike in same[:keys])
        titles = [title for title, alike in zip(titles, same, strict=True) if not alike]
        cells = [column for column, alike in zip(cells, same, strict=True) if not alike]
    if note:
        click.echo(_filled(note).replace(_BLANK, " "))
    if cells:
        _print_table(titles, cells, keys)


def _print_table(titles: Sequence[str], cells: Sequence[Sequence[str]], keys: int) -> None:
    wrapped = [_heading(title, max(map(len, column), default=0)) for title, column in zip(titles, cells, strict=True)]
    for heads in ([[title] for title in titles], wrapped):
        widths = [max(map(len, [*head, *column])) for head, column in zip(heads, cells, strict=True)]
        needed = [*widths[:-1], min(widths[-1], NARROWEST) if _is_text(cells[-1]) else widths[-1]]
        if sum(needed) + len(GAP) * (len(needed) - 1) <= terminal_width():
            _print_block(heads, cells, widths)
            return
    if len(cells[0]) == 1:
        print_named([(title, column[0]) for title, column in zip(titles, cells, strict=True)])
        return
    for part in _parts(needed, keys):
        _print_block([heads[k] for k in part], [cells[k] for k in part], [widths[k] for k in part])


def _parts(widths: Sequence[int], keys: int) -> list[list[int]]:
    """Return the columns of each part of a table that is too wide. Every part begins with the key columns."""
    first, rest = list(range(keys)), list(range(keys, len(widths)))
    parts, part = [], list(first)
    for column in rest:
        size = sum(widths[k] + len(GAP) for k in part) + widths[column]
        if size > terminal_width() and len(part) > keys:
            parts.append(part)
            part = list(first)
        part.append(column)
    return [*parts, part]


def _print_block(heads: Sequence[Sequence[str]], cells: Sequence[Sequence[str]], widths: Sequence[int]) -> None:
    left = [_is_text(column) for column in cells]
    height = max(map(len, heads))
    lines = [[*[""] * (height - len(head)), *head] for head in heads]
    for line in [*zip(*lines, strict=True), *zip(*cells, strict=True)]:
        aligned = [
            cell.ljust(width) if is_left else cell.rjust(width)
            for cell, width, is_left in zip(line, widths, left, strict=True)
        ]
        before = "".join(cell + GAP for cell in aligned[:-1])
        click.echo(hanging(before, aligned[-1].rstrip()) if left[-1] else (before + aligned[-1]).rstrip())


def _is_text(column: Sequence[str]) -> bool:
    return any(re.search(r"[a-df-zA-Z]{2}", cell) for cell in column)


def hanging(before: str, text: str) -> str:
    """Join two texts. If the result is wrapped, all lines of the second text begin in the same column."""
    width = terminal_width() - len(before)
    if len(text) <= width or width < NARROWEST:
        return (before + text).rstrip()
    lines = textwrap.wrap(text, width, break_on_hyphens=False)
    return ("\n" + " " * len(before)).join([before + lines[0], *lines[1:]]).rstrip()


def print_named(entries: Sequence[tuple[str, str]]) -> None:
    """Print names in one column, each followed by its description."""
    width = max((len(name) for name, _ in entries), default=0)
    for name, text in entries:
        click.echo(hanging(f"{name.ljust(width)}  ", text))


def _heading(title: str, width: int) -> list[str]:
    """Return the lines of a heading: first the name, wrapped after ``_`` or spaces to fit the column, then the unit."""
    name, unit = _name(title), _unit(title).strip()
    pieces = re.findall(r"[^_ ]+[_ ]*", name) or [name]
    lines = [""]
    for piece in pieces:
        if lines[-1] and len(lines[-1] + piece.rstrip()) > max(width, max(map(len, pieces))):
            lines.append("")
        lines[-1] += piece
    return [line.rstrip() for line in lines] + ([f"[{unit}]"] if unit else [])


def _name(title: str) -> str:
    return title.partition(" [")[0]


def _unit(title: str) -> str:
    unit = title.partition(" [")[2].removesuffix("]")
    return f" {unit}" if unit else ""


def print_left(count: int | None) -> None:
    """Print on stderr that a limit left out `count` rows, or an unknown number of rows if `count` is None.

    Print nothing if `count` is 0.
    """
    if count != 0:
        click.echo(f"... {'' if count is None else f'{count} '}more rows (--limit 0 prints all)", err=True)


def printable(text: str) -> str:
    """Escape the control characters of a text, except line breaks, so that data cannot control the terminal."""
    return "".join(mark if mark.isprintable() or mark == "\n" else repr(mark)[1:-1] for mark in text)


def print_json(document: Any) -> None:
    """Print one JSON document."""
    click.echo(json.dumps(document, indent=1, default=_plain))


def table(dataset: xr.Dataset) -> tuple[list[Row], dict[str, str]]:
    """Return the rows of a Dataset, one for each position along its dimensions, and the units of the columns.

    Coordinates with a single value for the whole Dataset are left out.
    """
    data = dataset.drop_vars([name for name, coord in dataset.coords.items() if coord.ndim == 0])
    dims = [str(dim) for dim in data.sizes]
    names = [*dims, *(str(name) for name in data.variables if name not in dims)]
    frame = (data if dims else data.expand_dims("row")).to_dataframe(dim_order=dims or None).reset_index()
    rows = [dict(zip(names, row, strict=True)) for row in frame[names].itertuples(index=False)]
    return rows, {name: str(data[name].attrs.get("units", "1")) for name in names}


def with_intervals(rows: list[Row], units: dict[str, str]) -> tuple[list[Row], dict[str, str]]:
    """Join each constant and the ends of its interval into one column, as in ``0.123 (0.120, 0.126)``."""
    known = {name for name in units if f"{name}_low" in units and f"{name}_high" in units}
    ends = {f"{name}_{end}" for name in known for end in ("low", "high")}
    kept = [name for name in units if name not in ends]
    joined = [
        {
            name: with_interval(*(row[name + end] for end in ("", "_low", "_high"))) if name in known else row[name]
            for name in kept
        }
        for row in rows
    ]
    return joined, {name: units[name] for name in kept}


def with_interval(value: float, low: float = math.nan, high: float = math.nan) -> str:
    """Return a constant as text, or ``not determined`` for NaN. Known ends of its interval follow in brackets."""
    if math.isnan(value):
        return "not determined"
    if not (math.isfinite(low) and math.isfinite(high)):
        return cell(value)
    return f"{with_digits(value, 4)} ({with_digits(low, 4)}, {with_digits(high, 4)})"


def with_error(mean: float, *errors: float | None) -> str:
    """Join a mean and its errors. An unknown error becomes ``?``, and a rounding error becomes 0.

    If the mean is not finite, or all errors are unknown, the text contains only the mean.
    """
    if not math.isfinite(mean) or not any(error is not None and math.isfinite(error) for error in errors):
        return cell(mean)
    known = [error if error is not None and math.isfinite(error) else None for error in errors]
    shown = ["?" if each is None else "0" if is_rounding(each, mean) else with_digits(each, 1) for each in known]
    return " +- ".join([with_digits(mean, 4), *shown])


def is_rounding(error: float, mean: float) -> bool:
    """Return whether the error of a mean is zero or a rounding error."""
    return math.isclose(mean, mean + error)


def cell(value: Any) -> str:
    """Return the text of a cell with the given value, or ``-`` for an unknown value."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return UNKNOWN
    return f"{value:.6g}" if isinstance(value, float) else printable(str(value)).replace("\n", " ")


def finite(value: Any) -> Any:
    """Return a value for JSON: None instead of a number that is not finite."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else str(value)
