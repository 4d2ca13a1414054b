"""Compare our solvers with other programs and with the methods of the papers: a part of docs/comparison.md.

python -m benchmarks peers              all subjects; programs that are not installed are left out
python -m benchmarks peers contact      one subject: contact, curves, friction, statistics or transforms
python -m benchmarks peers page         only write the page, from the stored table

The other programs are dependencies of these benchmarks only: ``pip install '.[peers]'``.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from itertools import groupby
from textwrap import fill

import numpy as np

from benchmarks.rows import DOCS, Row, number, read, table, write

OURS = "mdr_dask"
SUBJECTS = ("friction", "contact", "curves", "transforms", "statistics")
TABLE, PAGE, HEADING = DOCS / "evidence/peers.csv", DOCS / "comparison.md", "## Solvers\n"
#: Texts on each comparison: its subject, the licences of the programs, and the differences between the methods.
ABOUT = {
    "steady sliding": (
        "Friction of a Kelvin solid on one line, beside stepping in time as in the thesis: all springs move on by a "
        "cell in each step, and the depth is found that carries the load. Both rows of a goal (0.1 or 0.01) have at "
        "most this error, against the reference of [accuracy and speed](accuracy-and-speed.md#steady-friction).",
        "Stepping also gives the transient from rest to the steady state; the steady solver does not.",
    ),
    "bodies of revolution": (
        "A rigid body is pressed by a given force into an elastic half-space. The error is the larger one of depth and "
        "radius of contact, against closed forms. The contact is half as wide as the grid, whose boundaries are free. "
        "Tamaas (AGPL-3.0) solves by Polonsky and Keer to 1e-10, ContactMechanics (MIT) by constrained conjugate "
        "gradients.",
        "Boundary elements solve any surface, the transforms bodies of revolution only. The error of boundary elements "
        "here is that of the radius, which is counted in whole points; their depth is much more exact.",
    ),
    "rough surface": (
        "One circular punch with self-affine roughness (H = 0.8, 128 x 128 points) on a half-space, at five loads. "
        "The error is the largest one of the stiffness between loads, against ContactMechanics at a tenth of its "
        "tolerance.",
        "The last row does not solve the same equations: 200 lines replace the surface. Its error is that of the "
        "method for one sample ([where the method holds](validity.md)). Areas in contact are not compared, since "
        "lines do not have them.",
    ),
    "master curves": (
        "Four families of ten curves for each shape, with a scatter of 0.01 decades and planted shift factors. Median "
        "time of a family, median error of a factor in decades, median half width of the 95 % intervals, and share of "
        "factors inside. mastercurves (GPL-3.0) merges neighbours by Gaussian processes; its second row is given the "
        "scatter. pyvisco (MIT) merges power laws of neighbours and states no error.",
        "pyvisco is made for moduli that only rise. A row says so where some of its fits end without a result.",
    ),
    "Abel transform": (
        "Largest error of the pressure from the line load at 1601 equidistant radii. PyAbel (MIT) has its matrices in "
        "memory. Ours is given the function, or a cubic spline through the same samples.",
        "PyAbel is made for images: a matrix serves hundreds of rows at once, and no edge of the contact is needed. "
        "Ours is given the edge.",
    ),
    "statistics of surfaces": (
        "Relative error of the rms slope of a line of 65 536 points, or of the rms gradient of a map of 512 x 512 "
        "points, with known spectra, either without waves of less than eight points or with all waves of the grid; and "
        "time of height, slope and spectrum together. SurfaceTopography (MIT) takes differences of neighbours.",
        "Differences suit measured points with noise, which the derivative of a Fourier series makes larger. The "
        "series suits generated lines, whose waves are known.",
    ),
}
HEAD = f"""{HEADING}
What a solver costs beside other programs that compute the same, or nearly the same, and beside the way of the thesis.

```console
$ pip install '.[peers]'
$ python -m benchmarks peers
```

The methods of a case are called in turns in one run, on one thread, and the least processor time of three calls counts
(master curves and rough surface: one call). Compare times within a case, as ratios. The rows are
[a table](evidence/peers.csv). Each program has its recommended settings; where these leave a choice, the row names it.

No solver of lubricated line contacts was found that installs beside this package.
"""


def installed(package: str) -> str | None:
    """Return name and version of a program; if it is not installed, print how to install it and return None."""
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        print(f"{package} is not installed and left out: pip install '.[peers]'")
        return None


def text(rows: Iterable[Row]) -> str:
    """Return this part of the page: a table for each subject, in the order of `ABOUT`."""
    rows, parts = list(rows), [HEAD]
    for name, (what, differs) in ABOUT.items():
        of_subject = [row for row in rows if row.solver == name]
        if of_subject:
            dates = " and ".join(sorted({row.measured for row in of_subject}))
            about = fill(f"{what} Measured {dates}.", 118, break_on_hyphens=False)
            end = fill(differs, 118, break_on_hyphens=False)
            parts.append(f"### {name[0].upper()}{name[1:]}\n\n{about}\n\n{cells(of_subject)}\n\n{end}\n")
    return "\n".join(parts)


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
    """Compare the named subjects (default: all); then write this part of the page."""
    if unknown := set(arguments) - {*SUBJECTS, "page"}:
        raise SystemExit(f"no subject {', '.join(sorted(unknown))}; known: {', '.join(SUBJECTS)}")
    for subject in () if "page" in arguments else arguments or SUBJECTS:
        rows = list(importlib.import_module(f"benchmarks.peers.{subject}").compared())
        write(rows, TABLE)
        print(cells(rows), flush=True)
    PAGE.write_text(PAGE.read_text().partition(HEADING)[0] + text(read(TABLE)))
