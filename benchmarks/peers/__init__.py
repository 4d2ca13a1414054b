"""Compare our solvers with other programs and with the methods of the papers: a part of docs/comparison.md.

python -m benchmarks peers              all subjects; programs that are not installed are left out
python -m benchmarks peers contact      one subject: contact, curves, friction or statistics
python -m benchmarks peers page         only write the page, from the stored table

The other programs are dependencies of these benchmarks only: ``pip install '.[peers]'``.
"""

from __future__ import annotations

import importlib
from importlib.metadata import PackageNotFoundError, version
from itertools import groupby

import numpy as np

from benchmarks.rows import DOCS, Row, dated, number, read, table, with_tables, write

OURS = "mdr_dask"
SUBJECTS = ("friction", "contact", "curves", "statistics")
TABLE, PAGE = DOCS / "evidence/peers.csv", DOCS / "comparison.md"


def installed(package: str) -> str | None:
    """Return name and version of a program; if it is not installed, print how to install it and return None."""
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        print(f"{package} is not installed and left out: pip install '.[peers]'")
        return None


def text(page: str) -> str:
    """Return the text of the page with the current tables."""
    rows = groupby(read(TABLE), lambda row: row.solver)
    chosen = {name: list(group) for name, group in rows}
    return with_tables(page, {name: dated(group, cells(group)) for name, group in chosen.items()})


def cells(rows: list[Row]) -> str:
    """Return rows as a table; times are also given as multiples of our time in the same case."""
    stated = any(np.isfinite(row.held) for row in rows)
    found = []
    for case, group in groupby(rows, lambda row: row.case):
        chosen = list(group)
        ours = next((row.seconds for row in chosen if row.method == OURS), np.nan)
        for row in chosen:
            name = f"{row.method}, {row.setting}" if row.setting else row.method
            numbers = [number(row.seconds, " s"), number(row.seconds / ours), number(row.error)]
            found.append([case, name, *numbers, *[number(row.stated), number(100 * row.held, " %")] * stated])
    return table(("case", "method", "time", "times ours", "error", *["half width", "inside"] * stated), found)


def main(*arguments: str) -> None:
    """Compare the named subjects (default: all); then write the tables of the page."""
    if unknown := set(arguments) - {*SUBJECTS, "page"}:
        raise SystemExit(f"no subject {', '.join(sorted(unknown))}; known: {', '.join(SUBJECTS)}")
    for subject in () if "page" in arguments else arguments or SUBJECTS:
        rows = list(importlib.import_module(f"benchmarks.peers.{subject}").compared())
        write(rows, TABLE)
        print(cells(rows), flush=True)
    PAGE.write_text(text(PAGE.read_text()))
