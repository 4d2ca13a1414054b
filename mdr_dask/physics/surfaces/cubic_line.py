"""The line used by the solvers: cubic cells between equidistant nodes.

The unit of length is the length of a cell, and a slope is the rise over one cell. Heights may have any unit and are
positive towards the elastomer. The function `cut` makes a periodic line start in the cell of its highest point.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.surfaces.shapes import PowerLaw

NONE = 2.0  # result of `summit` if the cell has no maximum
# a cubic cell rises above its higher end by at most this factor times the sum of two slopes: the upward slope at its
# start and the downward slope at its end
STEEPEST_RISE = 4 / 27


class CubicLine(NamedTuple):
    """A line of n cubic cells between n + 1 equidistant nodes, in the order in which an elastomer element passes them.

    `enter` and `leave` are the slopes at the start and the end of each cell. If the line is not periodic, every element
    is undeformed at the first node. A `smooth` line is periodic, has no kinks, and has more than two nodes per shortest
    wave.
    """

    height: FloatArray
    enter: FloatArray
    leave: FloatArray
    periodic: bool
    smooth: bool


def periodic_line(height: FloatArray, slope: FloatArray | None) -> CubicLine:
    """Return a periodic line of cubic cells, or of straight cells if no slopes are given.

    Parameters
    ----------
    height : array, shape (n,)
        Heights at equidistant nodes of one period.
    slope : array, shape (n,), or None
        Slopes at the nodes, for a line of length 1.
    """
    height = np.append(height, height[0])
    if slope is None:
        rise = np.diff(height)
        return CubicLine(height, rise, rise, True, False)
    rise = np.append(slope, slope[0])
    rise /= slope.size
    return CubicLine(height, rise[:-1], rise[1:], True, True)


def indented_line(height: FloatArray, slope: FloatArray | None, body: PowerLaw) -> CubicLine:
    """Return the line of a rough indenter with cubic cells, or with straight cells if no slopes are given.

    Parameters
    ----------
    height, slope
        Heights and slopes of the periodic roughness, as in :func:`periodic_line`.
    body : PowerLaw
        The shape under the roughness, with its tip at node n // 2. The unit of length of the shape is the length of the
        line. The unit of height is the unit of the roughness.
    """
    n = height.size
    smooth, left, right = body.at((np.arange(n + 1) - n // 2) / n)
    height = np.append(height, height[0]) + smooth
    if slope is None:
        rise = np.diff(height)
        return CubicLine(height, rise, rise, False, False)
    enter, leave = slope + right[:-1], np.roll(slope, -1) + left[1:]
    return CubicLine(height, enter / n, leave / n, False, False)


def without_kinks(line: CubicLine) -> CubicLine:
    """Replace the two slopes at every inner node by their mean, which rounds a kink over the two adjacent cells."""
    slope = 0.5 * (line.leave[:-1] + line.enter[1:])
    return line._replace(enter=np.append(line.enter[0], slope), leave=np.append(slope, line.leave[-1]))


class Cells(NamedTuple):
    """The n cells of a line, and one more cell that repeats the first cell.

    If the line is not periodic, the heights in the additional cell are those of the last node. A periodic line starts
    in the cell of its highest point. Heights are relative to the highest point, so that small depths under light loads
    are not lost to rounding. `peak` is the largest height in each cell. `mean` is the integral of the height over each
    cell, and `stretch` is the integral of the squared slope. The highest point has the height `top` on the original
    line. A period of a periodic line begins at this point, whose position in cell 0 is `start`. If the line is not
    periodic, `start` is 0.
    """

    height: FloatArray
    enter: FloatArray
    leave: FloatArray
    peak: FloatArray
    mean: FloatArray
    stretch: FloatArray
    start: float
    top: float
    periodic: bool


@jit_inline
def cubic(height: FloatArray, enter: FloatArray, leave: FloatArray, i: int) -> tuple[float, float, float, float]:
    """Return the coefficients of the height in cell i, in ascending powers."""
    here, after = np.uintp(i), np.uintp(i + 1)  # unsigned, so that compiled code does not test for negative indices
    first, last = enter[here], leave[here]
    rise = height[after] - height[here]
    return height[here], first, 3 * rise - 2 * first - last, first + last - 2 * rise


@jit
def summit(a: float, b: float, c: float) -> float:
    """Return the position of the maximum of a t + b t^2 + c t^3 between t = 0 and t = 1; `NONE` if there is none."""
    discriminant = b * b - 3 * a * c
    if not discriminant > 0:
        return NONE
    root = math.sqrt(discriminant)
    place = a / (root - b) if b < 0 else -(b + root) / (3 * c) if c < 0 else NONE
    return place if 0 < place < 1 else NONE


@jit_inline
def _peak(height: FloatArray, enter: FloatArray, leave: FloatArray, i: int) -> tuple[float, float]:
    """Return the height of the highest point of a cell, and its position in the cell."""
    here, after = np.uintp(i), np.uintp(i + 1)
    first, last, begin, end = enter[here], leave[here], height[here], height[after]
    rise, place, peak = end - begin, 0.0 if begin >= end else 1.0, max(begin, end)
    between = 3 * rise - first - last  # no extreme inside if `between` and the slopes at both ends have the same sign
    if not (min(min(first, between), last) >= 0 or max(max(first, between), last) <= 0):
        b, c = 3 * rise - 2 * first - last, first + last - 2 * rise
        inside = summit(first, b, c)
        top = begin + inside * (first + inside * (b + inside * c))
        if inside < 1 and top > peak:
            place, peak = inside, top
    return peak, place


@jit
def _highest(height: FloatArray, enter: FloatArray, leave: FloatArray) -> tuple[int, float, float]:
    """Return the cell of the highest point of a line, the position in the cell (0 to 1), and the height.

    If several cells are equally high, the first of them is returned.
    """
    best, place, highest = 0, 0.0, -np.inf
    for i in range(enter.size):
        rise = STEEPEST_RISE * (max(enter[i], 0.0) + max(-leave[i], 0.0))
        if not max(height[i], height[i + 1]) + rise * (1 + 1e-9) <= highest:
            peak, x = _peak(height, enter, leave, i)
            if i == 0 or peak > highest:
                best, place, highest = i, x, peak
    return best, place, highest


def highest_point(height: FloatArray, slope: FloatArray) -> tuple[int, float]:
    """Return the cell of the highest point of a periodic cubic line, and the position in the cell (0 to 1).

    The slopes apply to a line of length 1.
    """
    line = periodic_line(height, slope)
    return _highest(line.height, line.enter, line.leave)[:2]


def cut(line: CubicLine) -> Cells:
    """Split a line into its cells. The first cell of a periodic line contains the highest point of the line."""
    best, place, top = _highest(line.height, line.enter, line.leave)
    if line.smooth and place == 1:  # if the highest point is a node, use the cell that begins there
        best, place = (best + 1) % line.enter.size, 0.0
    columns = _turned(line, top, best if line.periodic else 0)
    if line.smooth:
        _resum(columns[1], columns[5])
    return Cells(*columns, place if line.periodic else 0.0, top, line.periodic)


@jit
def running(integrals: FloatArray) -> FloatArray:
    """Return the integral from the first node to each node, given the integrals over the cells; shape (cells + 1,)."""
    summed, total = np.empty(integrals.size + 1), 0.0
    for i in range(integrals.size):
        summed[i] = total
        total += integrals[i]
    summed[integrals.size] = total
    return summed


@jit
def _turned(
    line: CubicLine, top: float, first: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the arrays of `Cells`, starting with cell `first` of the line and ending with a copy of this cell.

    Heights are relative to `top`. If the line is not periodic, the nodes of the copy have the height of the last node.
    """
    nodes, entered, left, n = line.height, line.enter, line.leave, line.enter.size
    height, enter, leave, peak, mean, stretch = (
        np.empty(n + 2),
        np.empty(n + 1),
        np.empty(n + 1),
        np.empty(n + 1),
        np.empty(n + 1),
        np.empty(n + 1),
    )
    for begin, end, shift in ((first, n, -first), (0, first + 1, n - first)):
        for i in range(begin, end):
            k, here, after = np.uintp(i + shift), np.uintp(i), np.uintp(i + 1)
            e, f, rise = entered[here], left[here], nodes[after] - nodes[here]
            height[k], enter[k], leave[k] = nodes[here] - top, e, f
            mean[k] = 0.5 * (nodes[after] + nodes[here]) + (e - f) / 12 - top
            stretch[k] = (36 * rise * rise - 6 * rise * (e + f) + 4 * (e * e + f * f) - 2 * e * f) / 30
        for i in range(begin, end):
            peak[np.uintp(i + shift)] = _peak(nodes, entered, left, i)[0] - top
    height[n + 1] = height[1]
    if not line.periodic:
        height[n] = height[n + 1] = nodes[n] - top
    return height, enter, leave, peak, mean, stretch


@jit
def _resum(slope: FloatArray, stretch: FloatArray) -> None:
    """Compute the integrals of the squared slope over cells by the Euler-Maclaurin formula.

    The integral over the first cell is not changed, because a period begins and ends inside this cell. The integrals
    over the remaining cells are shifted by equal amounts, so that the sum over all cells is still that of the formula.
    """
    n, kept = slope.size - 1, stretch[0]
    before, here, after = slope[n - 1] ** 2, slope[0] ** 2, slope[1] ** 2
    correction, difference = (after - before) / 24, 0.0
    for i in range(n):
        further = slope[i + 2] ** 2 if i + 2 <= n else slope[i + 2 - n] ** 2
        next_correction = (further - here) / 24
        stretch[i] = 0.5 * (here + after) + correction - next_correction
        if i == 0:
            difference = (stretch[0] - kept) / max(n - 1, 1)
            stretch[0] = kept
        else:
            stretch[i] += difference
        here, after, correction = after, further, next_correction
    stretch[n] = kept
