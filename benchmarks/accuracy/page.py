"""Write docs/accuracy-and-speed.md and its figures from what was measured: ``python -m benchmarks accuracy page``."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from itertools import groupby

import numpy as np

from benchmarks.accuracy import honesty as kept_apart
from benchmarks.accuracy.honesty import Honest
from benchmarks.accuracy.points import FILE, Point, cheapest, read
from benchmarks.measures import draw_errors

PAGE = FILE.parents[1] / "accuracy-and-speed.md"
PICTURES = FILE.parents[1] / "pictures/accuracy"
GOALS = (1e-1, 1e-2, 1e-3, 1e-4)
#: What is compared and with what; a solver in its own words stands in the page named.
ABOUT = {
    "steady friction": (
        "Error of the friction of a Kelvin solid on ten lines of 128 Nyquist points. Reference: one element "
        "followed along a fine line step by step, its losses summed, until three grids agree to 2e-7 "
        "([friction](evidence/friction.md))."
    ),
    "indenters": (
        "Error of the friction under a smooth body. Reference: the same element, on a line that is not periodic."
    ),
    "general solids": (
        "Error of the friction of solids with relaxing arms on ten lines, at the transition. Reference: the same "
        "element ([materials](evidence/materials.md))."
    ),
    "velocity jump": (
        "Largest error of friction at any time, over its last value. Velocities rise by a fifth under a heavy and a "
        "usual load, and fall to a fifth under a light one. Reference: every element followed from rest on two fine "
        "grids, extrapolated ([kinetics](evidence/kinetics.md))."
    ),
    "loading histories": (
        "Largest error of the drag over the largest drag. Reference: the solver itself on 40 nodes for every "
        "Nyquist point; backward Euler, which shares nothing with it, tends to the same ([loading "
        "histories](evidence/loading-histories.md))."
    ),
    "transforms": (
        "Largest error of the profile of the images cos 5x, max(x^2 - 1, 0), which has a kink, and cos 200x. "
        "Reference: the profiles in closed form, Bessel's J0 and one of arccos 1/r and sqrt(r^2 - 1)."
    ),
    "wear": (
        "Largest error of the worn profile over the depth that can wear, which is what `accuracy` means here. "
        "Reference: the exact evolution itself at 1e-5; every cycle simulated, as the thesis did, tends to the same "
        "([wear](evidence/wear.md)). The other rules are shown for the first of the ten bodies; blocks of load step on "
        "a uniform grid, and the limit is right for many cycles."
    ),
    "line contact (EHL)": (
        "Error of the worse film in nine of ten contacts: one, and nine with loads within 20 % and speeds within 50 % "
        "of it. Reference: films of another solver on up to 10241 nodes, known to 5e-6; of the nine, the finest five "
        "grids ([films](evidence/ehl.md))."
    ),
    "mixed lubrication": (
        "Error of the probability of breakthrough in one turn, transform included. Reference: splines of the same turn "
        "on two million points; the thesis's sums over points tend to the same "
        "([mixed lubrication](evidence/mixed-lubrication.md))."
    ),
    "measured lines": (
        "Error of the friction of a Kelvin solid on ten times 128 samples: waves of eight samples and more, white "
        "noise, steps with spikes. Reference: the element of steady friction, on the Fourier series as scipy draws it."
    ),
    "surfaces": (
        "Error of the rms gradient of generated maps (rms of three), by their spectrum, by that of a windowed quarter, "
        "and by differences of neighbours. Reference: the sum over waves. A quarter has other waves than the whole: "
        "its error is that of one sample."
    ),
    "campaigns of sliding friction": (
        "Sixteen cases through the runner; four loads and four speeds in full contact (easy), in the transition "
        "(typical), and of a rough line under a low load (hard). "
        "Reference: 1000 other lines at an accuracy of 0.5 %."
    ),
    "campaigns of velocity jumps": (
        "Eight cases: error of the jump of friction. Reference: 1000 other lines at an accuracy of 0.5 %."
    ),
    "campaigns of mixed lubrication": (
        "Eight cases on lines of the same waves, the shortest 3.14 µm, whatever the number of points. Error of the "
        "probability of breakthrough, over the probability or a quarter. Reference: 40 other lines of three million "
        "points."
    ),
    "campaigns of line contacts": (
        "Nine cases: error of the minimum film, the harder of the two that `accuracy` holds for. Reference: an "
        "accuracy of 2e-5."
    ),
    "campaigns of wear": (
        "Nine cases: error of the worn volume, which the campaign's `accuracy` is asked of. The exact rule was also "
        "given accuracies of its profile. Reference: such a one of 1e-5."
    ),
    "master curves": (
        "Largest error of ten shift factors in decades, and twice the largest bar: medians of twenty planted "
        "families ([master curves](evidence/master-curves.md))."
    ),
}


def text(points: Iterable[Point], judged: Iterable[Honest]) -> str:
    """Return the page."""
    points = list(points)
    parts = [HEAD, honesty(judged)]
    for solver, group in groupby(points, lambda point: point.solver):
        parts.append(
            f"## {solver[0].upper()}{solver[1:]}\n\n{ABOUT[solver]}\n\n![{solver}](pictures/accuracy/{_file(solver)})\n"
        )
        parts.append(_table(list(group)))
    return "\n".join(parts)


def honesty(judged: Iterable[Honest]) -> str:
    """Return a table of how many stated errors hold, and how large they are."""
    rows = [
        f"| {row.solver} | {row.what} | {row.cases} | {100 * row.covered:.0f} % | {row.over:.2g} |" for row in judged
    ]
    return HONESTY.format(rows="\n".join(rows))


def _file(solver: str) -> str:
    return f"{solver.split(' (')[0].replace(' ', '-')}.png"


def _table(points: list[Point]) -> str:
    """Return the time that each method takes for errors of 0.1 to 0.0001, and what it states."""
    dates = sorted({point.measured for point in points})
    rows = [
        f"Measured {' and '.join(dates)}.",
        "",
        "| case | method | " + " | ".join(f"{goal:.2g}" for goal in GOALS) + " | smallest error | stated over error |",
        "|---|---|" + "---|" * (len(GOALS) + 2),
    ]
    for (case, method), group in groupby(points, lambda point: (point.case, point.method)):
        chosen = list(group)
        times = [cheapest(chosen, goal) for goal in GOALS]
        said = [point.stated / point.error for point in chosen if np.isfinite(point.stated) and point.error > 0]
        cells = [_time(seconds) for seconds in times]
        errors = [point.error for point in chosen if np.isfinite(point.error)]
        smallest = f"{min(errors):.1e}" if errors else "no solution"
        honest = f"{min(said):.2g} to {max(said):.2g}" if said else ""
        rows.append(f"| {case} | {method} | {' | '.join(cells)} | {smallest} | {honest} |")
    return "\n".join(rows) + "\n"


def _time(seconds: float) -> str:
    """Return a time for a reader."""
    if np.isnan(seconds):
        return "-"
    factor, unit = (1, "s") if seconds >= 1 else (1e3, "ms") if seconds >= 1e-3 else (1e6, "µs")
    return f"{float(f'{seconds * factor:.2g}'):g} {unit}"


def draw(points: Iterable[Point]) -> None:
    """Write a figure for every solver: a panel for every case, a curve for every method."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    for solver, group in groupby(points, lambda point: point.solver):
        panels: dict[str, dict[str, tuple[list[float], list[float]]]] = {}
        for point in group:
            seconds, errors = panels.setdefault(point.case, {}).setdefault(point.method, ([], []))
            seconds.append(point.seconds)
            errors.append(max(point.error, FLOOR))
        draw_errors(panels, "error", str(PICTURES / _file(solver)))


FLOOR = 1e-12
HONESTY = """## Whether stated errors hold

Random cases, each compared with a much finer solution or a closed form; the factors of the estimates were not chosen on
these cases. The columns give the share of cases whose error is below the stated one, and the median of the stated error
over the true error. The data are [a table](evidence/honesty.csv). With 20 cases a share is known to about ten per cent.

| solver | cases | number | held | stated over error |
|---|---|---|---|---|
{rows}
"""
HEAD = """# Accuracy and speed

The processor time of one solution against its error, for every solver of the package and for the methods of the papers
and of the thesis. These commands measure everything again:

```console
$ python -m benchmarks accuracy honesty
$ python -m benchmarks accuracy measure
$ python -m benchmarks accuracy page
```

The data are [a table](evidence/accuracy-and-speed.csv), with the date of each measurement. Times depend on the machine
and on what else it does: compare them within one table, as ratios. Each table gives the least time of a setting whose
error is at most that of the column; `-` means that no setting tried was that accurate. *Stated over error* is the
stated error over the true error, from the smallest to the largest among the settings; below 1 the stated error was too
small.
"""


def main() -> None:
    points = read()
    draw(points)
    PAGE.write_text(text(points, kept_apart.read()))


if __name__ == "__main__":
    sys.exit(main())
