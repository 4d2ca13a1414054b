"""Results to a terminal, a pipe, JSON or CSV."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    import xarray as xr

Row = dict[str, Any]
#: Errors below this part of their mean are rounding.
ROUNDING = 1e-13


def print_rows(rows: Sequence[Row], units: dict[str, str], form: str, limit: int | None = None) -> None:
    """Print rows as an aligned table, as CSV, or as one JSON document with units.

    Parameters
    ----------
    rows : sequence of dict
        All with the same keys.
    units : dict of str to str
        Unit of each column that has one.
    form : str
        ``table``, ``csv`` or ``json``.
    limit : int, optional
        Most rows of a table; the rest is counted in a last line on stderr.
    """
    if form == "json":
        print_json({"units": units, "rows": [{key: _finite(value) for key, value in row.items()} for row in rows]})
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
    """Return the heading of a column: its name, and its unit if it has one."""
    return f"{name} [{unit}]" if unit not in ("1", "") else name


def print_aligned(
    titles: Sequence[str], columns: Sequence[Sequence[Any]], widths: Sequence[int] = (), head: bool = True
) -> list[int]:
    """Print columns side by side, at least as wide as those before them; return how wide they are."""
    cells = [[title, *map(short, column)] for title, column in zip(titles, columns, strict=True)]
    widths = [max(map(len, column)) for column in cells] if head else list(widths)
    widths = [max(width, *map(len, column)) for width, column in zip(widths, cells, strict=True)]
    for line in list(zip(*cells, strict=True))[0 if head else 1 :]:
        click.echo("  ".join(map(_aligned, titles, line, widths)).rstrip())
    return widths


def print_left(count: int | None) -> None:
    """Say on stderr how many rows a limit left out; None for some that nobody counted."""
    if count != 0:
        click.echo(f"... {'' if count is None else f'{count} '}more rows (--limit 0 prints all)", err=True)


def _aligned(name: str, cell: str, width: int) -> str:
    """Return a cell, numbers to the right and the sentence of a fit to the left."""
    return cell.ljust(width) if name in ("law_holds", "status") else cell.rjust(width)


def printable(text: str) -> str:
    """Return a text without control characters, which would speak to the terminal in place of the user."""
    return "".join(mark if mark.isprintable() or mark == "\n" else repr(mark)[1:-1] for mark in text)


def print_json(document: Any) -> None:
    """Print one JSON document."""
    click.echo(json.dumps(document, indent=1, default=_plain))


def table(dataset: xr.Dataset) -> tuple[list[Row], dict[str, str]]:
    """Turn a Dataset into rows, one for each point of its dimensions, and the units of the columns.

    Variables that lack a dimension are repeated along it; fixed coordinates are left out.
    """
    dims = [str(dim) for dim in dataset.sizes]
    names = [str(name) for name in dataset.data_vars]
    along = [str(name) for name, coord in dataset.coords.items() if coord.ndim == 1 and name not in dims]
    frame = dataset.drop_vars([name for name, c in dataset.coords.items() if c.ndim == 0])
    columns = {name: frame[name] for name in (*dims, *along, *names)}
    shape = dataset.sizes
    flat = {n: _spread(c, dims, shape) for n, c in columns.items()}
    rows = [dict(zip(flat, values, strict=True)) for values in zip(*flat.values(), strict=True)]
    return rows, {name: str(column.attrs.get("units", "1")) for name, column in columns.items()}


def _spread(column: xr.DataArray, dims: list[Any], shape: Any) -> list[Any]:
    missing = {dim: shape[dim] for dim in dims if dim not in column.dims}
    values: list[Any] = column.expand_dims(missing).transpose(*dims).to_numpy().ravel().tolist()
    return values


def with_intervals(rows: list[Row], units: dict[str, str]) -> tuple[list[Row], dict[str, str]]:
    """Join each constant and the ends of its interval into one column for a reader: ``0.123 (0.120, 0.126)``."""
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
    """Join a number and the ends of its interval, where they are known."""
    if not (math.isfinite(low) and math.isfinite(high)):
        return short(value)
    return f"{value:.4g} ({low:.4g}, {high:.4g})"


def with_error(mean: float, *errors: float | None) -> str:
    """Join a mean and its errors; ``-`` for an error that is not known, 0 for rounding noise."""
    if not any(error is not None and math.isfinite(error) for error in errors):
        return short(mean)
    shown = [_error(error, abs(mean)) for error in errors if error is not None]
    return " +- ".join([f"{mean:.4g}", *shown])


def _error(error: float, size: float) -> str:
    if not math.isfinite(error):
        return "-"
    return f"{error:.1g}" if error > ROUNDING * size else "0"


def short(value: Any) -> str:
    """Return a value as a cell of a table."""
    return f"{value:.6g}" if isinstance(value, float) else printable(str(value)).replace("\n", " ")


def _finite(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else str(value)
