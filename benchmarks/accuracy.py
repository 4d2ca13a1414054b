"""Measure error against processor time for every solver, and test its stated errors.

python -m benchmarks accuracy             all solvers, 20 random cases of each family; then write the page
python -m benchmarks accuracy wear 5      one solver, 5 cases
python -m benchmarks accuracy page        only write the page, from the stored table

Solvers that are not measured keep their rows and dates.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from benchmarks.rows import DOCS, Row, dated, number, read, seconds, table, with_tables, write
from benchmarks.solvers import SOLVERS

TABLE = DOCS / "evidence/accuracy-and-speed.csv"
PAGE = DOCS / "accuracy-and-speed.md"
FIGURE = DOCS / "pictures/accuracy.png"
CASES, SEED = 20, 31_000
COLUMNS = ("cases", "method", "setting", "number", "time", "error", "stated", "held")


def text(page: str) -> str:
    """Return the text of the page with the current tables."""
    measured = {name: [row for row in read(TABLE) if row.solver == name] for name in SOLVERS}
    tables = {name: dated(rows, table(COLUMNS, map(cells, rows))) for name, rows in measured.items() if rows}
    return with_tables(page, tables)


def cells(row: Row) -> tuple[str, ...]:
    """Return the cells of one row of a table on the page."""
    errors = number(row.error) if row.error == row.error else "no solution"
    held = number(100 * row.held, " %")
    return row.case, row.method, row.setting, str(row.cases), seconds(row.seconds), errors, number(row.stated), held


def draw(rows: Sequence[Row]) -> None:
    """Write the figure: one panel for the first family of every solver, one curve for every method."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    measured = [name for name in SOLVERS if any(row.solver == name for row in rows)]
    columns, count = 4, len(measured)
    figure = Figure(figsize=(14, 3.4 * -(-count // columns)), layout="constrained")
    places = figure.subplots(-(-count // columns), columns, squeeze=False).ravel()
    for axes in places[count:]:
        axes.remove()
    for axes, name in zip(places, measured, strict=False):
        of_solver = [row for row in rows if row.solver == name]
        first = [row for row in of_solver if row.case == of_solver[0].case]
        for method, group in groupby(first, lambda row: row.method):
            points = list(group)
            axes.loglog([row.seconds for row in points], [row.error for row in points], "o-", ms=4, label=method)
        axes.set_title(f"{name}: {first[0].case}", fontsize="small")
        for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            axis.set_view_interval(low / 2, max(2 * high, 30 * low))  # wide enough for labels at decades
            axis.set_minor_formatter(NullFormatter())
        axes.grid(alpha=0.3)
        axes.legend(fontsize="xx-small")
        axes.set_xlabel("processor time (s)", fontsize="small")
        axes.set_ylabel("error of 90 % of the cases", fontsize="small")
    figure.savefig(FIGURE, dpi=90)


def main(*arguments: str) -> None:
    """Measure the named solvers (default: all) with a number of cases; then write the page and its figure."""
    names = [name for name in arguments if not name.isdigit() and name != "page"]
    if unknown := set(names) - set(SOLVERS):
        raise SystemExit(f"no solver {', '.join(sorted(unknown))}; known: {', '.join(SOLVERS)}")
    cases = next((int(argument) for argument in arguments if argument.isdigit()), CASES)
    for name in () if "page" in arguments else names or SOLVERS:
        rows = list(SOLVERS[name].measure(cases, SEED))
        write(rows, TABLE)
        print(f"{name}\n{table(COLUMNS, [cells(row) for row in rows])}", flush=True)
    draw(read(TABLE))
    PAGE.write_text(text(PAGE.read_text()))
