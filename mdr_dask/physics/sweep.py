"""One sweep along a profile of cubic cells: a Kelvin foundation in its stationary state at a given depth.

Everything here is measured in cells: a cell has length 1, a slope is the rise over one cell, ``reach`` is v tau / dx.
Heights point into the elastomer and are measured from the highest point of the profile, so that the penetration is
w = depth + height with depth > 0. In contact u = w, free u decays as exp(-s / reach). By the envelope theorem
du/d(depth) is 1 in contact and decays with u in free flight, whatever the touching and leaving points do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

BLOCK = 16  # cells that are skipped at once where all are in contact, or none can be reached
NONE = 2.0  # a position in a cell that is not there
TINY = 1e-290
CLOSE = 1e-8  # a Newton step after which the next one is below rounding
ITERATIONS = 80

# What a sweep returns, in this order
DISPLACEMENT, STIFFNESS, DRAG, DRAG_RATE, LENGTH, STRETCH, OUTSIDE = range(7)
SUMS = 7


class Cells(NamedTuple):
    """A profile cut into n cubic cells, with one more at the end that repeats the first.

    Parameters
    ----------
    height : array, shape (n + 2,)
        Heights at the nodes, below the highest point of the profile: never positive.
    enter, leave : array, shape (n + 1,)
        Slopes at the start and the end of each cell; they differ across a node where the profile has a kink.
    peak : array, shape (n + 1,)
        Highest point of each cell.
    mean, stretch : array, shape (n + 1,)
        Integrals of the height and of the slope squared over each cell.
    block_peak, block_mean, block_stretch : array, shape (n // BLOCK,)
        Their maximum and sums over `BLOCK` cells.
    start : float
        Where in cell 0 (and cell n) a turn of a periodic profile begins and ends: its highest point.
    periodic : bool
        Whether the profile closes on itself; if not, elements enter undeformed at cell 0.
    """

    height: FloatArray
    enter: FloatArray
    leave: FloatArray
    peak: FloatArray
    mean: FloatArray
    stretch: FloatArray
    block_peak: FloatArray
    block_mean: FloatArray
    block_stretch: FloatArray
    start: float
    periodic: bool


@njit(nogil=True, cache=True)
def cubic(cells: Cells, i: int) -> tuple[float, float, float, float]:
    """Return the coefficients of the height in cell i, by rising power."""
    rise = cells.height[i + 1] - cells.height[i]
    enter, leave = cells.enter[i], cells.leave[i]
    return cells.height[i], enter, 3 * rise - 2 * enter - leave, enter + leave - 2 * rise


@njit(nogil=True, cache=True)
def summit(a: float, b: float, c: float) -> float:
    """Return where a cubic that rises at 0 and falls at 1 is highest, or `NONE`."""
    if not (a > 0 and a + 2 * b + 3 * c < 0):
        return NONE
    root = np.sqrt(max(b * b - 3 * a * c, 0.0))
    place: float = -a / (b - root) if b < 0 else -(b + root) / (3 * c)
    return place


@njit(nogil=True, cache=True)
def barrier(cells: Cells, reach: float, barriers: FloatArray, block_barriers: FloatArray) -> None:
    """Write the depth that keeps each whole cell pressed, w + reach w' > 0, and its maximum over blocks."""
    for i in range(barriers.size):
        first = -(cells.height[i] + reach * cells.enter[i])
        last = -(cells.height[i + 1] + reach * cells.leave[i])
        barriers[i] = first if first > last else last
    for j in range(block_barriers.size):
        highest = barriers[j * BLOCK]
        for i in range(j * BLOCK + 1, (j + 1) * BLOCK):
            highest = barriers[i] if barriers[i] > highest else highest
        block_barriers[j] = highest


@njit(nogil=True, cache=True)
def _lost(x: float) -> float:
    """Return 1 - exp(-x) for x >= 0; its series where that is exact to rounding and quicker."""
    if x > 1 / 32:
        return -math.expm1(-x)
    return x * (1 - x / 2 * (1 - x / 3 * (1 - x / 4 * (1 - x / 5 * (1 - x / 6 * (1 - x / 7))))))


@njit(nogil=True, cache=True)
def _leaving(w0: float, a: float, b: float, c: float, reach: float, start: float) -> float:
    """Return where w + reach w' falls to 0 between start and 1, or `NONE`."""
    if w0 + a + b + c + reach * (a + 2 * b + 3 * c) > 0:
        return NONE
    # the force is a cubic itself
    p, q, r = w0 + reach * a, a + 2 * reach * b, b + 3 * reach * c
    low, high, x = start, 1.0, start
    for _ in range(ITERATIONS):
        force = p + x * (q + x * (r + x * c))
        if force > 0:
            low = x
        else:
            if x == start:
                return start
            high = x
        slope = q + x * (2 * r + x * 3 * c)
        step = x - force / slope if slope < 0 else high
        if abs(step - x) < CLOSE:
            return min(max(step, start), 1.0)
        x = step if low < step < high else 0.5 * (low + high)
    return x


@njit(nogil=True, cache=True)
def _touching(w0: float, a: float, b: float, c: float, reach: float, u: float, end: float) -> float:
    """Return where w rises to u exp(-x / reach) between 0 and end, where it is known to be above."""
    if w0 >= u:
        return 0.0
    low, high, x = 0.0, end, end
    for _ in range(ITERATIONS):
        free = u - u * _lost(x / reach)
        gap = w0 + x * (a + x * (b + x * c)) - free
        if gap > 0:
            high = x
        else:
            low = x
        slope = a + x * (2 * b + x * 3 * c) + free / reach
        step = x - gap / slope if slope > 0 else low
        if abs(step - x) < CLOSE:
            return min(max(step, 0.0), end)
        x = step if low < step < high else 0.5 * (low + high)
    return x


@njit(nogil=True, cache=True)
def _reached(w0: float, a: float, b: float, c: float, reach: float, u: float, decay: float) -> float:
    """Return the end of the stretch of a cell where a free element touches, or `NONE`."""
    if w0 + a + b + c > u * decay:
        return 1.0
    x = summit(a, b, c)
    if x < 1 and w0 + x * (a + x * (b + x * c)) > u - u * _lost(x / reach):
        return x
    return NONE


@njit(nogil=True, cache=True)
def _pressed(w0: float, a: float, b: float, c: float, start: float, end: float) -> tuple[float, float]:
    """Return the integrals of w and w'^2 from start to end: Gauss, exact for these polynomials."""
    half, middle = 0.5 * (end - start), 0.5 * (end + start)
    x, y = middle - half * 0.7745966692414834, middle + half * 0.7745966692414834
    before, centre, after = (
        a + x * (2 * b + x * 3 * c),
        a + middle * (2 * b + middle * 3 * c),
        a + y * (2 * b + y * 3 * c),
    )
    area = 5 * x * (a + x * (b + x * c)) + 8 * middle * (a + middle * (b + middle * c)) + 5 * y * (a + y * (b + y * c))
    stretch = 5 * before * before + 8 * centre * centre + 5 * after * after
    return half * (2 * w0 + area / 9), half * stretch / 9


@njit(nogil=True, cache=True)
def sweep(
    cells: Cells, barriers: FloatArray, block_barriers: FloatArray, reach: float, depth: float, sums: FloatArray
) -> None:
    """Follow an element once along the profile.

    Parameters
    ----------
    cells : Cells
        The profile.
    barriers, block_barriers : array
        From :func:`barrier` for the same reach.
    reach : float
        v tau in cells.
    depth : float
        Penetration of the highest point.
    sums : array, shape (SUMS,)
        Written: the integral of u (F_N / (4 G dx)), its derivative by the depth, F_x / (4 G), its derivative by the
        depth, the length in contact, the integral of w'^2 over it, and 1 if the contact leaves a profile
        that is not periodic.
    """
    n = cells.mean.size - 1
    decay = np.exp(-1 / reach)
    block_decay = np.exp(-BLOCK / reach)
    area = rate = stretch = flights = flights_rate = length = 0.0
    i, x, contact = 0, cells.start, cells.periodic
    u, a, flown = 0.0, 1.0, 0.0  # displacement at leaving, what is left of it, length flown
    sums[OUTSIDE] = 0.0 if cells.periodic or depth + cells.height[0] <= 0 else 1.0
    while i < n:
        if contact:
            if x == 0:
                if i % BLOCK == 0 and i + BLOCK <= n and block_barriers[i // BLOCK] < depth:
                    area += cells.block_mean[i // BLOCK] + BLOCK * depth
                    stretch += cells.block_stretch[i // BLOCK]
                    length += BLOCK
                    i += BLOCK
                    continue
                if barriers[i] < depth:
                    area += cells.mean[i] + depth
                    stretch += cells.stretch[i]
                    length += 1
                    i += 1
                    continue
            h0, c1, c2, c3 = cubic(cells, i)
            w0 = depth + h0
            left = _leaving(w0, c1, c2, c3, reach, x)
            end = min(left, 1.0)
            if left <= 1:
                u = w0 + left * (c1 + left * (c2 + left * c3))
                flown = 1 - left
                a = 1 - _lost(flown / reach)
                contact = depth + cells.height[i + 1] > u * a
                end = 1.0 if contact else left
            part, part_stretch = _pressed(w0, c1, c2, c3, x, end)
            area += part
            stretch += part_stretch
            length += end - x
            i += 1
            x = 0.0
            continue
        if i % BLOCK == 0 and i + BLOCK <= n and cells.block_peak[i // BLOCK] + depth <= u * a * block_decay:
            a *= block_decay
            flown += BLOCK
            i += BLOCK
            continue
        if cells.peak[i] + depth > u * a * decay:
            h0, c1, c2, c3 = cubic(cells, i)
            w0 = depth + h0
            end = _reached(w0, c1, c2, c3, reach, u * a, decay)
            if end <= 1:
                x = _touching(w0, c1, c2, c3, reach, u * a, end)
                flown += x
                lost = _lost(flown / reach)
                memory = reach * lost
                slope = c1 + x * (2 * c2 + x * 3 * c3)
                if u > 0:
                    area += u * memory
                    rate += memory
                    flights += 0.5 * u * u * lost * (2 - lost)
                    flights_rate += memory * (u / reach + slope)
                else:
                    flights_rate += reach * slope
                contact = True
                continue
        a *= decay
        if a < TINY:
            a = 0.0
        flown += 1
        i += 1
    # the last stretch, up to the highest point again or out to infinity
    if cells.periodic and contact:
        h0, c1, c2, c3 = cubic(cells, n)
        part, part_stretch = _pressed(depth + h0, c1, c2, c3, 0.0, cells.start)
        area += part
        stretch += part_stretch
        length += cells.start
    elif cells.periodic:
        h0, c1, c2, c3 = cubic(cells, n)
        w0 = depth + h0
        x = _touching(w0, c1, c2, c3, reach, u * a, cells.start) if cells.start > 0 else 0.0
        flown += x
        lost = _lost(flown / reach)
        memory = reach * lost
        area += u * memory
        rate += memory
        flights += 0.5 * u * u * lost * (2 - lost)
        flights_rate += memory * (u / reach + c1 + x * (2 * c2 + x * 3 * c3))
        part, part_stretch = _pressed(w0, c1, c2, c3, x, cells.start)
        area += part
        stretch += part_stretch
        length += cells.start - x
    elif contact:
        sums[OUTSIDE] = 1.0
    else:
        area += u * reach
        rate += reach
        flights += 0.5 * u * u
        flights_rate += u
    sums[DISPLACEMENT] = area
    sums[STIFFNESS] = rate + length
    sums[DRAG] = reach * stretch + flights
    sums[DRAG_RATE] = flights_rate
    sums[LENGTH] = length
    sums[STRETCH] = stretch
