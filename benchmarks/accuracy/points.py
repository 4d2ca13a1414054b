"""What is measured: one solution of one method at one setting, its time, its error, and the error that it stated."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from datetime import date
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mdr_dask.version import __version__

FILE = Path(__file__).parents[2] / "docs/evidence/accuracy-and-speed.csv"
LIKE = 10  # cases that one setting is judged by, and seeds of a campaign


class Point(NamedTuple):
    """One entry of a work-precision diagram; `stated` is NaN where a method states no error.

    `covered` is the share of cases whose error is at most the stated one, NaN where it was not counted. `measured` is
    the date and the version of the package.
    """

    solver: str
    case: str
    method: str
    setting: str
    seconds: float
    error: float
    stated: float = np.nan
    covered: float = np.nan
    measured: str = ""


def read(path: Path = FILE) -> list[Point]:
    """Return the points of a table."""
    with path.open() as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    return [Point(*row[:4], *map(float, row[4:8]), row[8]) for row in rows[1:]]


def write(points: Iterable[Point], path: Path = FILE) -> None:
    """Write points as a table; the solvers measured now replace their earlier rows."""
    points = list(points)
    measured = {point.solver for point in points}
    kept = [point for point in read(path) if point.solver not in measured] if path.exists() else []
    today = f"{date.today()} with version {__version__}"
    with path.open("w") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(Point._fields)
        for point in [*kept, *(point._replace(measured=today) for point in points)]:
            writer.writerow([*point[:4], *(f"{number:.3e}" for number in point[4:8]), point.measured])


def neighbours(short: bool) -> Iterator[tuple[int, float, float]]:
    """Yield the number of every like case and where it lies: the first at the origin, the others around it."""
    yield 0, 0.0, 0.0
    for number in range(1, 1 if short else LIKE):
        angle = 2 * np.pi * number / (LIKE - 1)
        yield number, float(np.cos(angle)), float(np.sin(angle))


def gathered(points: Iterable[Point], share: float = 0.9) -> list[Point]:
    """Return a point for the like cases of every setting, so that none counts as good because it is right by chance.

    Its time is their mean, its error the one that a `share` of them stay within, its stated error that times the median
    of stated over error.
    """
    groups: dict[tuple[str, ...], list[Point]] = {}
    for point in points:
        groups.setdefault(point[:4], []).append(point)
    found = []
    for key, like in groups.items():
        seconds, errors, stated = (np.array([point[place] for point in like]) for place in (4, 5, 6))
        error = float(np.quantile(errors, share, method="lower")) if np.all(np.isfinite(errors)) else np.nan
        known = np.isfinite(stated)
        over = float(np.median(stated[known] / errors[known])) if np.any(known) else np.nan
        found.append(Point(*key, float(np.mean(seconds)), error, error * over, like[0].covered))
    return found


def cheapest(points: Iterable[Point], error: float) -> float:
    """Return the least time of a setting whose error is at most so large; NaN if none is."""
    return min((point.seconds for point in points if point.error <= error), default=np.nan)
