"""Measure error against processor time for every solver, and test its stated errors.

python -m benchmarks accuracy             all solvers, 20 random cases of each family; then write the page
python -m benchmarks accuracy wear 5      one solver, 5 cases
python -m benchmarks accuracy page        only write the page, from the stored table

Solvers that are not measured keep their rows and dates.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from benchmarks.rows import DOCS, Row, number, read, seconds, table, write
from benchmarks.solvers import SOLVERS

TABLE = DOCS / "evidence/accuracy-and-speed.csv"
PAGE = DOCS / "accuracy-and-speed.md"
FIGURE = DOCS / "pictures/accuracy.png"
CASES, SEED = 20, 31_000
HEAD = """# Accuracy and speed

The processor time of one solution against its error, for every solver of the package and for the methods of the papers
and of the thesis, and whether the stated errors hold. Every row is made by solving random cases, each compared with a
reference; no factor of an estimate was chosen on these cases. Made by

```console
$ python -m benchmarks accuracy
```

*Time* is the median of the cases on one thread, *error* what 90 % of the cases stay below, *stated* the median of the
stated errors, and *held* the share of values whose error is at most the stated one. With 20 cases a share is known to
about 5 to 10 per cent. `-` means that a method states no error. Times depend on the machine and on what else it does:
compare them within one table, as ratios. The data are [a table](evidence/accuracy-and-speed.csv).

![Error against time of every solver](pictures/accuracy.png)
"""
COLUMNS = ("cases", "method", "setting", "number", "time", "error", "stated", "held")


def text(rows: Sequence[Row]) -> str:
    """Return the text of the page."""
    parts = [HEAD]
    for name, solver in SOLVERS.items():
        of_solver = [row for row in rows if row.solver == name]
        if of_solver:
            dates = " and ".join(sorted({row.measured for row in of_solver}))
            parts.append(f"## {name[0].upper()}{name[1:]}\n\n{solver.about} Measured {dates}.\n")
            parts.append(table(COLUMNS, [cells(row) for row in of_solver]) + "\n")
    return "\n".join(parts)


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
    rows = read(TABLE)
    draw(rows)
    PAGE.write_text(text(rows))
