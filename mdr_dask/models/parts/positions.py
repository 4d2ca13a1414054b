"""Positions and row numbers in tables of heights, and the regular grid on which the positions lie."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.physics.refine import SAFETY
from mdr_dask.tables import AGREE
from mdr_dask.units import shown

OUTER = 2  # at most this many rows (or columns) at each edge of a table contain positions or row numbers
FEW_LEVELS = 10  # largest number of distinct heights of a designed surface such as a grating, chosen by trial


def rising(lines: FloatArray) -> NDArray[np.bool_]:
    """Return, for each row of a table, whether its numbers only rise or only fall, as positions and row numbers do.

    Neighbours may be equal or NaN, but more than half of the differences between neighbours must be finite and not 0.
    """
    steps = np.diff(lines, axis=1)
    known = np.isfinite(steps)
    one_way = np.all((steps >= 0) | ~known, axis=1) | np.all((steps <= 0) | ~known, axis=1)
    return np.asarray(one_way & (2 * np.count_nonzero(known & (steps != 0), axis=1) > steps.shape[1]))


def without_positions(rows: FloatArray) -> tuple[FloatArray, tuple[float | None, float | None], tuple[str, ...]]:
    """Remove positions and row numbers from the outermost rows and columns of a table of heights.

    Return the heights, the steps of the positions along x and y, and remarks that name the removed rows and columns.
    The step along x is None if the table has no positions along x. The same applies to y. A table with fewer than
    ``4 * OUTER`` rows or columns is returned unchanged. Raise DataError if the positions do not lie on one regular
    grid.
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
    remarks = (f"left out, because they hold positions or row numbers: {', '.join(left_out)}",) if left_out else ()
    return rows[inner], (steps[0], steps[1]), remarks


def _leading(lines: FloatArray) -> int:
    """Return how many of the first rows of a table hold positions or row numbers.

    On a tilted surface the heights of a row may also only rise or only fall. Such a row counts as positions only if the
    row differs much more from adjacent rows than rows of heights differ from each other.
    """
    inner = lines[:, OUTER:-OUTER]
    rises = rising(inner)
    count = int(np.argmin(np.append(rises, False)))
    if count <= OUTER and not rises[count:-OUTER].any():
        return count
    bends = np.nanmedian(np.abs(np.nan_to_num(np.diff(inner, 2, axis=0))), axis=1)
    apart = np.flatnonzero(bends[: min(count, OUTER)] > SAFETY * np.max(bends[OUTER:-OUTER]))
    return int(apart[-1]) + 1 if apart.size else 0


def is_numbered(line: FloatArray) -> bool:
    """Return whether the numbers of a row or column are consecutive integers, such as 1, 2, 3, 4."""
    return bool(np.all(np.diff(line) == 1) and np.all(line == np.rint(line)))


def _common_step(lines: list[FloatArray], name: str) -> float | None:
    """Return the common step of the positions in the given rows or columns.

    Lines of consecutive integers are row numbers and are ignored. Return None if no other lines are left. Raise
    DataError if the steps differ, or if positions do not lie on a regular grid.
    """
    steps = [regular(line)[1] for line in lines if not is_numbered(line)]
    if any(abs(step - steps[0]) > AGREE * steps[0] for step in steps):
        apart = " and ".join(f"{step:.4g}" for step in steps)
        raise DataError(
            f"more than one {name} of positions, and their steps differ ({apart}): keep only one {name} of positions"
        )
    return steps[0] if steps else None


def regular(positions: FloatArray) -> tuple[NDArray[np.int64], float]:
    """Return the index of each position on a regular grid, counted from 0, and the step of the grid.

    There may be grid points without a position. Raise DataError if a position is half a step or more off the grid, if a
    position is NaN, or if all positions are equal.
    """
    known = np.sort(positions[np.isfinite(positions)])
    gaps = np.diff(known)
    # Positions on one grid line differ by small deviations. Some grid lines may have no positions; those that have
    # positions are 1 to about 3 steps apart. A gap of at most a quarter of the largest gap is such a deviation.
    lines = np.split(known, np.flatnonzero(gaps > 0.25 * gaps.max(initial=0.0)) + 1)
    middles = np.array([line.mean() for line in lines])
    if middles.size < 2 or len(known) != len(positions):
        raise DataError("expected positions on a regular grid")
    apart = np.diff(middles)
    # distances in whole steps, so that deviations of single positions do not add up
    place = np.append(0.0, np.cumsum(np.rint(apart / np.median(apart))))
    step, origin = np.polyfit(place, middles, 1)
    nearest = np.rint((positions - origin) / step)
    own = np.repeat(place, [line.size for line in lines])
    if np.any(np.abs(known - origin - own * step) >= 0.5 * step):
        raise DataError("expected positions on a regular grid")
    return np.asarray(nearest - nearest.min(), dtype=np.int64), float(step)


def scattered(x: FloatArray, y: FloatArray, z: FloatArray) -> tuple[FloatArray, tuple[float, float]]:
    """Arrange points, given in any order, in rows of heights. Return the rows and the steps along x and y.

    Grid points without a height become NaN. Raise DataError if the points do not lie on a regular grid, if two points
    have the same place, or if fewer than a quarter of the grid points are given.
    """
    (column, step_x), (row, step_y) = regular(x), regular(y)
    shape = row.max() + 1, column.max() + 1
    if shape[0] * shape[1] > 4 * z.size or np.unique(row * shape[1] + column).size < z.size:
        raise DataError("expected columns x, y and z with one point of a regular grid in each row")
    rows = np.full(shape, np.nan)
    rows[row, column] = z
    return rows, (step_x, step_y)


def without_codes(height: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Replace codes for missing points, such as 9999, by NaN. Return the heights and remarks.

    The largest number is replaced if its distance from the next smaller number exceeds the range of the inner numbers,
    which are all numbers without the smallest and the largest. The same applies to the smallest number. A number that
    occurs only once may be the height of a narrow groove or peak. Such a number is replaced only if its distance from
    the next number exceeds `SAFETY` times the range. These steps are repeated until no number is replaced. A surface
    such as a grating, with at most `FEW_LEVELS` distinct inner numbers, is left unchanged.
    """
    height = np.where(np.isfinite(height), height, np.nan)
    found: list[str] = []
    while True:
        low, high = (float(end) for end in (np.nanmin(height), np.nanmax(height)))
        rest = height[(height > low) & (height < high)]
        if np.unique(rest).size <= FEW_LEVELS:
            return height, tuple(found)
        codes = []
        for code, distance in ((low, rest.min() - low), (high, high - rest.max())):
            count = np.count_nonzero(height == code)
            if distance > np.ptp(rest) * (1.0 if count > 1 else SAFETY):
                codes.append(code)
                points = f"{count} points" if count > 1 else "1 point"
                found.append(f"points counted as missing: {points} at {shown(code, 'm')}, far from all others")
        if not codes:
            return height, tuple(found)
        height[np.isin(height, codes)] = np.nan
