"""The table of comparisons, and their part of docs/comparison.md."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from textwrap import TextWrapper

import numpy as np

from benchmarks.accuracy.points import FILE, Point, read, write
from benchmarks.peers.beside import OURS

TABLE = FILE.with_name("peers.csv")
PAGE = FILE.parents[1] / "comparison.md"
HEADING = "## Solvers\n"
#: What is compared, under which licence, and in what it differs.
ABOUT = {
    "steady sliding": (
        "Friction of a Kelvin line by stepping in time, as the thesis did. All springs move on by a cell in each "
        "step, and the depth is found that carries the load. Both rows of a goal have at most its error, against "
        "the reference of [accuracy and speed](accuracy-and-speed.md#steady-friction). Stepping ends at the "
        "numbers of the scheme `backward_euler` on the same grid.",
        "Stepping also shows how the contact comes to the steady state from rest; the steady solver does not.",
    ),
    "bodies of revolution": (
        "A rigid body is pressed by a given force into an elastic half-space: the larger error of depth and radius "
        "of contact, against closed forms. Contact takes half of the width of the grid, whose boundaries are free. "
        "Tamaas (AGPL-3.0) solves by Polonsky and Keer to 1e-10, ContactMechanics (MIT) by constrained conjugate "
        "gradients.",
        "Boundary elements solve any surface, the transforms bodies of revolution only. What limits boundary "
        "elements here is the radius, counted in whole points; their depth is much more exact.",
    ),
    "rough surface": (
        "One circular punch with self-affine roughness (H = 0.8, 128 x 128 points) on a half-space, at five loads. "
        "The largest error of the stiffness between loads, against ContactMechanics at a tenth of its tolerance.",
        "The last row does not solve the same equations. There 200 lines take the place of surfaces, and the "
        "difference is the error of that model for one sample ([where the method holds](validity.md)). Areas in "
        "contact are not compared, since lines do not have them.",
    ),
    "master curves": (
        "Four families a shape of ten curves with a scatter of 0.01 decades and known shift factors. The columns: "
        "median processor time of a family, median error of a factor in decades, median half width of 95 % stated for "
        "it, share of factors inside. The program mastercurves (GPL-3.0) merges neighbours by Gaussian processes, in "
        "its second row with the scatter told. The program pyvisco (MIT) meets power laws of neighbours and states "
        "no error.",
        "pyvisco is made for moduli that only rise. Where some of its fits end without a result, the row says so.",
    ),
    "Abel transform": (
        "Pressure from the line load at equidistant radii: largest error. PyAbel (MIT) has its matrices in memory; "
        "ours is given the function, or a cubic spline through the same samples.",
        "PyAbel is made for images: a matrix serves hundreds of rows at once, and no edge of the contact is "
        "needed. Ours is given the edge.",
    ),
    "statistics of surfaces": (
        "A line of 65 536 points and a map of 512 x 512 points with known spectra. They have either no waves of less "
        "than eight points or all waves of the grid. Relative error, and time of height, slope and spectrum "
        "together. SurfaceTopography (MIT) takes differences of neighbours.",
        "Differences suit measured points with noise, which the derivative of a Fourier series makes larger. The "
        "series suits generated lines, whose waves are known. The maps' spectra also differ in what else is "
        "computed: ours has the anisotropy.",
    ),
}
HEAD = f"""{HEADING}
What a solver costs beside other programs that compute the same, or nearly the same, and beside the way of the thesis.

```console
$ pip install '.[peers]'
$ python -m benchmarks peers
```

The methods of a case are called in turns in one run, on one thread, after a first call that compiles and is not timed.
Times are the least processor times of two or three turns (master curves: medians over families; rough surface: one
call). They were measured on two cores that other programs used too: compare them within a case, as ratios. The points
are [a table](evidence/peers.csv). Each program has its own recommended settings; where these leave a choice, the row
names it.

No solver of lubricated line contacts was found that installs beside this package. The program slippy (MIT) solves
point contacts, HANS (MIT) flows in gaps. Formulas are in the program tribology (MIT), which wants a NumPy of 2019.
"""


fill = TextWrapper(118, break_long_words=False, break_on_hyphens=False).fill


def tell(points: Iterable[Point]) -> None:
    """Write what was measured into the table, make the page's part again, and print it."""
    points = list(points)
    write(points, TABLE)
    PAGE.write_text(PAGE.read_text().partition(HEADING)[0] + text(read(TABLE)))
    print("\n".join(_table(points)))


def text(points: Iterable[Point]) -> str:
    """Return the part of the page: a table for each subject, in the order of `ABOUT`."""
    places = {name: place for place, name in enumerate(ABOUT)}
    ordered = sorted(points, key=lambda point: places[point.solver])
    parts = [HEAD]
    for name, rows in groupby(ordered, key=lambda point: point.solver):
        what, differs = ABOUT[name]
        parts.append(
            "\n".join(
                [f"### {name[0].upper()}{name[1:]}\n", fill(what), "", *_table(list(rows)), "", fill(differs), ""]
            )
        )
    return "\n".join(parts)


def _table(points: list[Point]) -> list[str]:
    """Return the rows of points; times are also told as multiples of ours in the same case."""
    inside = any(np.isfinite(point.covered) for point in points)
    head = ["case", "method", "time", "times ours", "error", *["half width", "inside"] * inside]
    rows = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for case, group in groupby(points, lambda point: point.case):
        chosen = list(group)
        ours = next((point.seconds for point in chosen if point.method == OURS), np.nan)
        for point in chosen:
            name = f"{point.method}, {point.setting}" if point.setting else point.method
            cells = [case, name, _rounded(point.seconds, " s"), _rounded(point.seconds / ours), _rounded(point.error)]
            cells += [_rounded(point.stated), _rounded(100 * point.covered, " %")] * inside
            rows.append(f"| {' | '.join(cells)} |")
    return rows


def _rounded(number: float, unit: str = "") -> str:
    """Return two digits."""
    if not np.isfinite(number):
        return "-"
    return f"{float(f'{number:.1e}'):g}{unit}"
