"""Rows of the benchmark tables: time, errors and test of the stated errors of one method at one setting."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mdr_dask.version import __version__

DOCS = Path(__file__).parents[1] / "docs"


class Row(NamedTuple):
    """Results of one method at one setting; numbers that do not apply are NaN.

    `seconds` is processor time. `error` and `stated` are the true and the stated error. `held` is the share of values
    whose error is at most the stated error. `measured` is the date and the version of the package.
    """

    solver: str
    case: str
    method: str
    setting: str
    cases: int
    seconds: float
    error: float
    stated: float = np.nan
    held: float = np.nan
    measured: str = ""


def read(path: Path) -> list[Row]:
    """Read the rows of a table."""
    with path.open(newline="") as file:
        return [Row(*row[:4], int(row[4]), *map(float, row[5:9]), row[9]) for row in list(csv.reader(file))[1:]]


def write(rows: Iterable[Row], path: Path) -> None:
    """Write rows into a table; they replace earlier rows of the same solvers."""
    rows = list(rows)
    solvers = {row.solver for row in rows}
    kept = [row for row in read(path) if row.solver not in solvers] if path.exists() else []
    today = f"{date.today()} (version {__version__})"
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Row._fields)
        for row in [*kept, *(row._replace(measured=today) for row in rows)]:
            writer.writerow([*row[:5], *(f"{number:.3g}" for number in row[5:9]), row.measured])


def timed(function: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """Call a function and return its value and the processor time."""
    started = time.process_time()
    value = function(*arguments)
    return value, time.process_time() - started


def timed_in_turns(functions: Mapping[Any, Callable[[], Any]], rounds: int) -> dict[Any, tuple[Any, float]]:
    """Call functions in turns, so that all run under equal conditions; return values and least processor times."""
    found = [{name: timed(function) for name, function in functions.items()} for _ in range(rounds)]
    return {name: (found[0][name][0], min(each[name][1] for each in found)) for name in functions}


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(str(cell) for cell in line)} |" for line in lines)


def dated(rows: Iterable[Row], text: str) -> str:
    """Return a text with the dates of the rows above it."""
    return f"Measured on {' and '.join(sorted({row.measured for row in rows}))}.\n\n{text}"


def with_tables(page: str, tables: Mapping[str, str]) -> str:
    """Return the text of a page with these tables between their marks."""
    for name, text in tables.items():
        start, end = f"<!-- {name} -->\n", f"\n<!-- end of {name} -->"
        first, last = page.index(start) + len(start), page.index(end)
        page = f"{page[:first]}{text}{page[last:]}"
    return page


def number(value: float, unit: str = "") -> str:
    """Return two digits of a number, or "-" if it is NaN."""
    return f"{float(f'{value:.1e}'):g}{unit}" if np.isfinite(value) else "-"


def seconds(value: float) -> str:
    """Return a time with a unit."""
    factor, unit = (1, "s") if value >= 1 else (1e3, "ms") if value >= 1e-3 else (1e6, "µs")
    return number(value * factor, f" {unit}")
