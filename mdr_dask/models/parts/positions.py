"""Find positions and row numbers in tables of heights, and the regular grid on which the positions lie."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.units import shown

OUTER = 3
"""Largest number of rows or columns on each side of a table that may hold positions or row numbers."""
BREAK = 3.0
"""A row or column holds positions if it differs from its neighbours by more than this times the largest difference
between rows or columns of heights (see `_leading`)."""
FAR_ALONE = 10.0
"""A number that occurs once is not a height if its distance from all other heights exceeds this times their range."""
FEW_LEVELS = 10
"""Heights with at most this many different values belong to a designed surface, such as a grating."""


def rising(lines: FloatArray) -> NDArray[np.bool_]:
    """Return, for each line, whether its numbers only rise or only fall, as positions and row numbers do."""
    steps = np.diff(lines, axis=1)
    known = np.isfinite(steps)
    one_way = np.all((steps >= 0) | ~known, axis=1) | np.all((steps <= 0) | ~known, axis=1)
    return np.asarray(one_way & (2 * np.count_nonzero(known & (steps != 0), axis=1) > steps.shape[1]))


def without_positions(rows: FloatArray) -> tuple[FloatArray, tuple[float | None, float | None], tuple[str, ...]]:
    """Remove the outermost rows and columns that hold positions or row numbers, which the returned remarks name.

    Also return the steps of the positions along x and y, None if unknown. Raise DataError if positions are not
    equidistant, or if several lines of positions have different steps.
    """
    if min(rows.shape) < 4 * OUTER:
        return rows, (None, None), ()
    edges = [(_leading(lines), _leading(lines[::-1])) for lines in (rows, rows.T)]
    (top, bottom), (left, right) = edges
    inner = slice(top, rows.shape[0] - bottom), slice(left, rows.shape[1] - right)
    left_out, steps = [], []
    for lines, name, (first, last), along in zip((rows, rows.T), ("row", "column"), edges, inner[::-1], strict=True):
        places = [*range(first), *range(len(lines) - last, len(lines))]
        steps.append(_common_step([lines[place, along] for place in places], name))
        left_out += [f"{name} {place + 1}" for place in places]
    remarks = (f"lines of positions or row numbers are left out: {', '.join(left_out)}",) if left_out else ()
    return rows[inner], (steps[0], steps[1]), remarks


def _leading(lines: FloatArray) -> int:
    """Return the number of lines at the beginning that hold positions or row numbers.

    Heights on a tilted surface may only rise, as positions do. But positions differ much more from the adjacent line
    than two lines of heights differ from each other.
    """
    inner = lines[:, OUTER:-OUTER]
    rises = rising(inner)
    count = int(np.argmin(np.append(rises, False)))
    if count <= OUTER and not rises[count:-OUTER].any():
        return count
    bends = np.nanmedian(np.abs(np.nan_to_num(np.diff(inner, 2, axis=0))), axis=1)
    apart = np.flatnonzero(bends[: min(count, OUTER)] > BREAK * np.max(bends[OUTER:-OUTER]))
    return int(apart[-1]) + 1 if apart.size else 0


def is_numbered(line: FloatArray) -> bool:
    """Return whether a line holds the numbers of its points: integers that increase by one from point to point."""
    return bool(np.all(np.diff(line) == 1) and np.all(line == np.rint(line)))


def _common_step(lines: list[FloatArray], name: str) -> float | None:
    """Return the common step of all lines of positions; raise DataError if their steps differ.

    Return None if every line holds the numbers of its points.
    """
    steps = [regular(line)[1] for line in lines if not is_numbered(line)]
    if any(abs(step - steps[0]) > 0.01 * steps[0] for step in steps):
        apart = " and ".join(f"{step:.4g}" for step in steps)
        raise DataError(f"more than one {name} of positions, with steps of {apart}: delete all but one")
    return steps[0] if steps else None


def regular(positions: FloatArray) -> tuple[NDArray[np.int64], float]:
    """Return the index of each position on a regular grid, counted from 0, and the step of the grid.

    Grid points may be missing. Raise DataError if a position is half a step or more off the grid.
    """
    known = np.sort(positions[np.isfinite(positions)])
    gaps = np.diff(known)
    # a gap between points on different grid lines is one to about 3 steps; smaller gaps are deviations from the grid
    lines = np.split(known, np.flatnonzero(gaps > 0.25 * gaps.max(initial=0.0)) + 1)
    middles = np.array([line.mean() for line in lines])
    if middles.size < 2 or len(known) != len(positions):
        raise DataError("expected positions on a regular grid")
    apart = np.diff(middles)
    place = np.append(0.0, np.cumsum(np.rint(apart / np.median(apart))))  # so that rounding errors do not add up
    step, origin = np.polyfit(place, middles, 1)
    nearest = np.rint((positions - origin) / step)
    own = np.repeat(place, [line.size for line in lines])
    if np.any(np.abs(known - origin - own * step) >= 0.5 * step):
        raise DataError("expected positions on a regular grid")
    return np.asarray(nearest - nearest.min(), dtype=np.int64), float(step)


def scattered(x: FloatArray, y: FloatArray, z: FloatArray) -> tuple[FloatArray, tuple[float, float]]:
    """Arrange points, which are given in any order, in rows of heights; return the rows and the steps along x and y.

    Missing points become NaN. Raise DataError if two points have the same position or the grid is not regular.
    """
    (column, step_x), (row, step_y) = regular(x), regular(y)
    shape = row.max() + 1, column.max() + 1
    if shape[0] * shape[1] > 4 * z.size or np.unique(row * shape[1] + column).size < z.size:
        raise DataError("expected columns x, y and z with one point of a regular grid in each row")
    rows = np.full(shape, np.nan)
    rows[row, column] = z
    return rows, (step_x, step_y)


def without_codes(height: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Replace numbers that cannot be heights, such as the code 9999 for missing points, by NaN. Also return remarks.

    The largest number is replaced if its distance from all other heights exceeds the range of these other heights; so
    is the smallest number. A number that occurs once may belong to a deep groove: its distance must exceed `FAR_ALONE`
    times the range. A surface with at most `FEW_LEVELS` different heights, such as a grating, stays as it is.
    """
    height = np.where(np.isfinite(height), height, np.nan)
    found: list[str] = []
    while True:
        low, high = (float(end) for end in (np.nanmin(height), np.nanmax(height)))
        rest = height[(height > low) & (height < high)]
        if np.unique(rest[:: 1 + rest.size // 1000]).size <= FEW_LEVELS:
            return height, tuple(found)
        codes = []
        for code, distance in ((low, rest.min() - low), (high, high - rest.max())):
            count = np.count_nonzero(height == code)
            if distance > np.ptp(rest) * (1.0 if count > 1 else FAR_ALONE):
                codes.append(code)
                points = f"{count} points" if count > 1 else "1 point"
                found.append(f"points counted as missing: {points} at {shown(code, 'm')}, far from all others")
        if not codes:
            return height, tuple(found)
        height[np.isin(height, codes)] = np.nan
