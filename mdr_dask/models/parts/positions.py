"""Positions and row numbers beside heights: how they are recognised, and the grid that they lie on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.units import shown

OFF_GRID = 0.5
"""Steps by which a position may be off a regular grid: farther, it would belong to the next point."""
OUTER = 3
"""Rows or columns on each side that may hold positions or numbers."""
BREAK = 3.0
"""Change of slope between a line of positions and its neighbours, over the largest between lines of heights."""
FAR_ALONE = 10.0
"""Ranges of all other heights by which a number that occurs once must be away from them to be no height."""
FEW_LEVELS = 10
"""Different heights of a profile that was designed, not measured."""


class Outer(NamedTuple):
    """Heights without the lines around them, the steps of positions along x and y, and what was left out."""

    rows: FloatArray
    steps: tuple[float | None, float | None]
    remarks: tuple[str, ...]


def rising(lines: FloatArray) -> NDArray[np.bool_]:
    """Return which lines rise all along, or fall all along, as positions and numbers do but no rough line."""
    steps = np.diff(lines, axis=1)
    known = np.isfinite(steps)
    one_way = np.all((steps >= 0) | ~known, axis=1) | np.all((steps <= 0) | ~known, axis=1)
    return np.asarray(one_way & (2 * np.count_nonzero(known & (steps != 0), axis=1) > steps.shape[1]))


def without_positions(rows: FloatArray) -> Outer:
    """Leave out the outermost rows and columns that hold positions or numbers.

    Raises
    ------
    DataError
        If positions are not equidistant, or if there are two of them that differ.
    """
    if min(rows.shape) < 4 * OUTER:
        return Outer(rows, (None, None), ())
    edges = [(_leading(lines), _leading(lines[::-1])) for lines in (rows, rows.T)]
    (top, bottom), (left, right) = edges
    inner = slice(top, rows.shape[0] - bottom), slice(left, rows.shape[1] - right)
    left_out, steps = [], []
    for lines, name, (first, last), along in zip((rows, rows.T), ("row", "column"), edges, inner[::-1], strict=True):
        places = [*range(first), *range(len(lines) - last, len(lines))]
        steps.append(_common_step([lines[place, along] for place in places], name))
        left_out += [f"{name} {place + 1}" for place in places]
    remarks = (f"positions or numbers, left out: {', '.join(left_out)}",) if left_out else ()
    return Outer(rows[inner], (steps[0], steps[1]), remarks)


def _leading(lines: FloatArray) -> int:
    """Return how many of the first lines hold positions or numbers.

    They rise all along. Where lines of heights do so too, as on a tilted or curved surface, positions differ from the
    lines beside them by much more than heights do.
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
    """Return whether a line holds the numbers of its points: whole ones, each one more than the last."""
    return bool(np.all(np.diff(line) == 1) and np.all(line == np.rint(line)))


def _common_step(lines: list[FloatArray], name: str) -> float | None:
    """Return the distance of the positions in some lines, or None if there are none but numbers."""
    steps = [regular(line)[1] for line in lines if not is_numbered(line)]
    if any(abs(step - steps[0]) > 0.01 * steps[0] for step in steps):
        apart = " and ".join(f"{step:.4g}" for step in steps)
        raise DataError(f"more than one {name} of positions, with steps of {apart}: delete all but one")
    return steps[0] if steps else None


def regular(positions: FloatArray) -> tuple[NDArray[np.int64], float]:
    """Return the place on a regular grid of each position, from 0 on, and the step of the grid.

    Positions of one place may differ a little, and places may be empty.

    Raises
    ------
    DataError
        If a position is half a step or more off the grid.
    """
    known = np.sort(positions[np.isfinite(positions)])
    gaps = np.diff(known)
    lines = np.split(known, np.flatnonzero(gaps > 0.25 * gaps.max(initial=0.0)) + 1)  # a gap may be 2 or 3 steps
    middles = np.array([line.mean() for line in lines])
    if middles.size < 2 or len(known) != len(positions):
        raise DataError("expected positions on a regular grid")
    place = np.rint((middles - middles[0]) / np.median(np.diff(middles)))
    step, origin = np.polyfit(place, middles, 1)
    nearest = np.rint((positions - origin) / step)
    own = np.repeat(place, [line.size for line in lines])
    if np.any(np.abs(known - origin - own * step) >= OFF_GRID * step):
        raise DataError("expected positions on a regular grid")
    return np.asarray(nearest - nearest.min(), dtype=np.int64), float(step)


def scattered(x: FloatArray, y: FloatArray, z: FloatArray) -> tuple[FloatArray, tuple[float, float]]:
    """Return rows of heights, NaN where there is no point, and the steps along x and y, from points in any order.

    Raises
    ------
    DataError
        If the points do not lie on a regular grid, or if there are two at one place.
    """
    (column, step_x), (row, step_y) = regular(x), regular(y)
    shape = row.max() + 1, column.max() + 1
    if shape[0] * shape[1] > 4 * z.size or np.unique(row * shape[1] + column).size < z.size:
        raise DataError("expected x, y and z of one point each on a regular grid")
    rows = np.full(shape, np.nan)
    rows[row, column] = z
    return rows, (step_x, step_y)


def without_codes(height: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Replace numbers that cannot be heights, m, by NaN, such as a code 9999 for missing points.

    Such a number is the highest or the lowest, and is farther from all other heights than these are from each other;
    `FAR_ALONE` times as far if it occurs once, because a single deep groove is possible. Where the other heights are
    `FEW_LEVELS` numbers or fewer, as of a grating, there is no code.
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
                found.append(f"taken as missing: {points} at {shown(code, 'm')}, far from all others")
        if not codes:
            return height, tuple(found)
        height[np.isin(height, codes)] = np.nan
