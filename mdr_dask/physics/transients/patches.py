"""Contact patches on a line, and the forces on them.

The unit of length is a cell of the line, and slopes are rises per cell. Times are divided by the relaxation time. The
Deborah number D is the distance v tau in cells. The lift is the sum of the depth and the rate of the depth. The force
on an element in contact, divided by 4 G dx, is lift + h + D h'.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit_inline_uncounted, jit_uncounted
from mdr_dask.physics.refine import MOST_ITERATIONS
from mdr_dask.physics.sliding.kelvin import BLOCK, Barriers, contact_end, write_barriers
from mdr_dask.physics.surfaces.cubic_line import NONE, Cells, cubic, running

# The search for an edge of contact ends after a step s shorter than AT_EDGE, with an error of about s^3 (in cells).
AT_EDGE = 1e-2
# Entries of the sums over the patches; the load is F_N / (4 G dx), and the drag is F_x / (4 G)
(
    LOAD,
    DRAG,
    LENGTH,  # length in contact
    TILT,  # integral of the slope over the length in contact
    STIFFNESS,  # derivative of the load with respect to the depth
    DRAG_STIFFNESS,  # derivative of the drag with respect to the depth
    GROWTH,  # rate at which the load changes because patches grow or shrink
    DRAG_GROWTH,  # rate at which the drag changes because patches grow or shrink
) = range(8)
SUMS = 8

Cubic = tuple[float, float, float, float]  # coefficients of the height of the line in a cell, constant first


class Track(NamedTuple):
    """The cells of a periodic line, with integrals up to every node.

    Heights at the n + 2 nodes are relative to the highest point, to avoid rounding errors in light contacts. `enter`
    and `leave` are the slopes at the start and at the end of each cell, and `peak` is the largest height in each cell.
    The last of the n + 1 cells is a copy of the first cell. `area` and `square` are the integrals of the height and of
    the squared slope up to each node. `cells` is the length n of the line. The period begins at the highest point of
    the line, which lies in the first cell at `origin`.
    """

    height: FloatArray
    enter: FloatArray
    leave: FloatArray
    peak: FloatArray
    area: FloatArray
    square: FloatArray
    cells: float
    origin: float


def track_of(cells: Cells) -> Track:
    """Return the cells of a periodic line with integrals up to every node."""
    area, square = running(cells.mean), running(cells.stretch)
    n = float(cells.mean.size - 1)
    return Track(cells.height, cells.enter, cells.leave, cells.peak, area, square, n, cells.start)


class Patches(NamedTuple):
    """Patches of a steady state. `pressed` is the displacement of an element at the end of each patch."""

    start: FloatArray
    end: FloatArray
    pressed: FloatArray
    depth: float
    deborah: float


class History(NamedTuple):
    """The depth and its rate of change at the first `count` instants of the arrays.

    `stiff` is the derivative of the last rate with respect to the last depth.
    """

    time: FloatArray
    depth: FloatArray
    rate: FloatArray
    count: int  # type: ignore[assignment]
    stiff: float


@jit_inline_uncounted
def height_at(track: Track, x: float) -> tuple[float, float, float]:
    """Return height, slope and curvature of the line at x."""
    i = min(max(int(x), 0), track.enter.size - 1)
    y = x - i
    c0, c1, c2, c3 = cubic(track.height, track.enter, track.leave, i)
    return c0 + y * (c1 + y * (c2 + y * c3)), c1 + y * (2 * c2 + y * 3 * c3), 2 * c2 + 6 * y * c3


@jit_inline_uncounted
def _part(line: Cubic, y: float) -> tuple[float, float, float]:
    """Return the height at y of a cubic on [0, 1], and the integrals of height and squared slope from 0 to y."""
    c0, c1, c2, c3 = line
    height = c0 + y * (c1 + y * (c2 + y * c3))
    area = y * (c0 + y * (c1 / 2 + y * (c2 / 3 + y * c3 / 4)))
    square = y * c1 * c1 + y * y * (
        2 * c1 * c2 + y * ((4 * c2 * c2 + 6 * c1 * c3) / 3 + y * c3 * (3 * c2 + y * 1.8 * c3))
    )
    return height, area, square


@jit_inline_uncounted
def add_patch(track: Track, start: float, end: float, lift: float, deborah: float, sums: FloatArray) -> None:
    """Add the exact load, drag, length and rise (integral of the slope) of a patch in contact to `sums`."""
    last = track.enter.size - 1
    i, j = min(int(start), last), min(int(end), last)
    line = cubic(track.height, track.enter, track.leave, i)
    h0, area0, square0 = _part(line, start - i)
    if i == j:
        h1, area1, square1 = _part(line, end - i)
        area, square = area1 - area0, square1 - square0
    else:
        _, area_all, square_all = _part(line, 1.0)
        h1, area1, square1 = _part(cubic(track.height, track.enter, track.leave, j), end - j)
        area = area_all - area0 + (track.area[j] - track.area[i + 1]) + area1
        square = square_all - square0 + (track.square[j] - track.square[i + 1]) + square1
    rise = h1 - h0
    sums[LOAD] += lift * (end - start) + area + deborah * rise
    sums[DRAG] += rise * (lift + 0.5 * (h0 + h1)) + deborah * square
    sums[LENGTH] += end - start
    sums[TILT] += rise


@jit_uncounted
def _zero(p: float, q: float, r: float, c: float, y: float) -> float:
    """Return the first place x between y and 1 where p + q x + r x^2 + c x^3 falls through zero, or `NONE`.

    The cubic must not be negative at y.
    """
    width = 1 - y
    begin, end = p + y * (q + y * (r + y * c)), p + q + r + c
    near = begin + width * (1 / 3) * (q + y * (2 * r + y * 3 * c))
    far = end - width * (1 / 3) * (q + 2 * r + 3 * c)
    if near > 0 and far > 0 and end > 0:
        return NONE
    if not (begin >= near >= far >= end and begin > 0 >= end):
        return float(contact_end(p, q, r, c, 0.0, y))
    # the Bernstein coefficients on [y, 1] decrease, and therefore the cubic decreases
    low, high, x = y, 1.0, y + width * begin / (begin - end)
    for _ in range(MOST_ITERATIONS):
        value = p + x * (q + x * (r + x * c))
        if value > 0:
            low = x
        else:
            high = x
        falls = q + x * (2 * r + x * 3 * c)
        step = -value / falls if falls < 0 else NONE
        if abs(step) < AT_EDGE:
            bend = (r + 3 * c * x) / falls  # for a step of Halley's method
            return min(max(x + step / (1 + bend * step) if abs(bend * step) < 0.5 else x + step, y), 1.0)
        x = x + step if low < x + step < high else 0.5 * (low + high)
    return x


@jit_inline_uncounted
def unloading(line: Cubic, lift: float, deborah: float, y: float) -> float:
    """Return the first place from y to the end of a cell where `force_at` falls through 0, or `NONE`."""
    c0, c1, c2, c3 = line
    return _zero(lift + c0 + deborah * c1, c1 + 2 * deborah * c2, c2 + 3 * deborah * c3, c3, y)


@jit_inline_uncounted
def loading(line: Cubic, lift: float, deborah: float, y: float) -> float:
    """Return the first place from y to the end of a cell where `force_at` rises through 0, or `NONE`."""
    c0, c1, c2, c3 = line
    return _zero(-lift - c0 - deborah * c1, -c1 - 2 * deborah * c2, -c2 - 3 * deborah * c3, -c3, y)


@jit_inline_uncounted
def meeting(line: Cubic, depth: float, u: float, slope: float, x: float, y: float) -> float:
    """Return the first place from y to the end of a cell where the line rises above free elements, or `NONE`.

    At x, the free elements have the displacement u, and the derivative of u along the line is `slope`. The exponential
    decay of the displacement along the line is expanded to second order.
    """
    c0, c1, c2, c3 = line
    bend = slope * slope / u if u > 0 else 0.0
    return _zero(u - x * (slope - 0.5 * x * bend) - depth - c0, slope - x * bend - c1, 0.5 * bend - c2, -c3, y)


@jit_inline_uncounted
def force_at(line: Cubic, lift: float, deborah: float, y: float) -> float:
    """Return the force lift + h + deborah h' at y in a cell."""
    c0, c1, c2, c3 = line
    return lift + c0 + y * (c1 + y * (c2 + y * c3)) + deborah * (c1 + y * (2 * c2 + y * 3 * c3))


@jit_inline_uncounted
def keeps_pressed(track: Track, barriers: Barriers, deborah: float, i: int, lift: float) -> bool:
    """Return whether the force on elements in contact would be positive everywhere in cell i.

    If the barriers of the block of this cell have not been computed yet, they are written to `barriers`.
    """
    block = np.uintp(i) // np.uintp(BLOCK)
    if np.isnan(barriers.block[block]):
        write_barriers(track.height, track.enter, track.leave, deborah, i // BLOCK, barriers)
    return bool(barriers.cell[np.uintp(i)] < lift)


@jit_uncounted
def released(track: Track, first: Patches, barriers: Barriers, deborah: float, rate: float, sums: FloatArray) -> None:
    """Add up the forces just after a jump, from the contact before the jump and the new rate of the depth.

    Displacements and depth do not change at the jump. Contact continues only where the force is positive at the new
    velocity and the new rate. `deborah` and `barriers` belong to the velocity after the jump. The results are written
    to `sums`.
    """
    sums[:] = 0.0
    lift, n = first.depth + rate, int(track.cells)
    for k in range(first.start.size):
        begin, end = first.start[k], first.end[k]
        x, pressed, entered = begin, False, True
        while x < end:
            i = min(int(x), n)
            stop = min(i + 1.0, end)
            if pressed and x == i and i < n and stop == i + 1 and keeps_pressed(track, barriers, deborah, i, lift):
                whole = i % BLOCK == 0 and i + BLOCK <= min(int(end), n)
                x = i + BLOCK if whole and barriers.block[i // BLOCK] < lift else stop
                continue
            line = cubic(track.height, track.enter, track.leave, i)
            if entered:
                pressed, entered = force_at(line, lift, deborah, x - i) > 0, False
            change = unloading(line, lift, deborah, x - i) if pressed else loading(line, lift, deborah, x - i)
            x = min(i + change, stop) if change < NONE else stop
            if x < stop and pressed:
                add_patch(track, begin, x, lift, deborah, sums)
            elif x < stop:
                begin = x
            pressed = pressed != (x < stop)
        if pressed:
            add_patch(track, begin, end, lift, deborah, sums)
