"""Sweep along a line of cubic cells, which gives the steady state of a Kelvin foundation at a given depth.

The unit of length is the cell width, a slope is the rise over one cell, and ``deborah`` is the distance v tau in cell
widths. Heights are measured from the highest point of the line, so that the penetration is w = depth + height with
depth > 0. The displacement of an element is u = w in contact. At the distance s beyond the place where contact ends, u
and du/d(depth) have decayed by the factor exp(-s / deborah). If the depth changes, contact begins and ends at slightly
shifted places. The effect of this shift on the load is of second order.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.refine import CLOSE, MOST_ITERATIONS
from mdr_dask.physics.surfaces.cubic_line import NONE, Cells, cubic, summit

BLOCK = 16  # number of cells in a block, chosen by trial; a block entirely in contact or free is one step of a sweep
TINY = float(np.finfo(np.float64).tiny)  # smallest normal floating-point number; smaller displacements become 0

# Indices of the `sums` of a sweep, and the number of these sums
DISPLACEMENT, STIFFNESS, DRAG, DRAG_RATE, LENGTH, STRETCH, OUTSIDE, SUMS = range(8)


class Blocks(NamedTuple):
    """Largest height in every block of cells, and integrals of the height and of the squared slope over every block."""

    peak: FloatArray
    mean: FloatArray
    stretch: FloatArray


def blocks_of(cells: Cells) -> Blocks:
    """Return the complete blocks of a line. The cells that remain at the end of the line belong to no block."""
    whole = (cells.mean.size - 1) // BLOCK * BLOCK
    peak, mean, stretch = (each[:whole].reshape(-1, BLOCK) for each in (cells.peak, cells.mean, cells.stretch))
    return Blocks(peak.max(axis=1), mean.sum(axis=1), stretch.sum(axis=1))


class Barriers(NamedTuple):
    """Limits of the depth for each cell and each block, at one Deborah number.

    After a velocity jump, the lift (depth plus rate of the depth) takes the place of the depth.

    At depths above the entry in `cell`, the force on elements in contact is positive everywhere in the cell. The entry
    in `block` is the same limit for a whole block, or NaN until the limits of the cells in the block are computed. At
    depths up to the entry in `idle`, the force on elements in contact is positive nowhere in the cell.
    """

    cell: FloatArray
    block: FloatArray
    idle: FloatArray


def barriers_for(cells: int) -> Barriers:
    """Return arrays for the barriers of a line with `cells` cells. No barrier is computed yet: `block` contains NaN."""
    return Barriers(np.empty(cells), np.full(cells // BLOCK + 1, np.nan), np.empty(cells))


@jit
def write_barriers(
    height: FloatArray, enter: FloatArray, leave: FloatArray, deborah: float, block: int, barriers: Barriers
) -> None:
    """Write the barriers of a block and of the cells in the block, computed from the force w + deborah w'."""
    every, written, idle = -np.inf, barriers.cell, barriers.idle
    for i in range(block * BLOCK, min((block + 1) * BLOCK, written.size)):
        h0, a, b, c = cubic(height, enter, leave, i)
        first = -(h0 + deborah * a)
        last = -(height[i + 1] + deborah * leave[i])
        highest = first if first > last else last
        # force - depth = p + q x + r x^2 + c x^3; the minimum of this cubic may be inside the cell
        q, r = a + 2 * deborah * b, b + 3 * deborah * c
        near, far = first - q / 3, last + (q + 2 * r + 3 * c) / 3
        x = summit(-q, -r, -c) if max(near, far) > highest else NONE
        if x < 1:
            inside = first - x * (q + x * (r + x * c))
            highest = inside if inside > highest else highest
        written[i] = highest
        # the largest Bernstein coefficient is an upper bound of force - depth
        idle[i] = min(min(first, last), min(near, far))
        every = highest if highest > every else every
    barriers.block[block] = every


@jit
def _decayed(x: float) -> float:
    """Return 1 - exp(-x) for x >= 0. For small x, a series is faster and exact to rounding."""
    if x > 1 / 32:
        return -math.expm1(-x)
    # multiply by 1 / 5 instead of dividing by 5, because divisions would make a sweep 10 % slower
    rest = 1 - x * (1 / 5) * (1 - x * (1 / 6) * (1 - x * (1 / 7)))
    return x * (1 - x * (1 / 2) * (1 - x * (1 / 3) * (1 - x * (1 / 4) * rest)))


@jit
def contact_end(w0: float, a: float, b: float, c: float, deborah: float, start: float) -> float:
    """Return the first position between `start` and 1 in a cell where the force falls to 0, or `NONE`.

    The force is w + deborah w', with w = w0 + a x + b x^2 + c x^3. At `start`, the force must not be negative.
    """
    # search each monotone piece of the cubic force; because of rounding, the force at `start` may be just below 0
    p, q, r = w0 + deborah * a, a + 2 * deborah * b, b + 3 * deborah * c
    low, positive = start, True
    discriminant = r * r - 3 * c * q
    root = math.sqrt(discriminant) if discriminant > 0 else 0.0
    lead = -(r + root) if r > 0 else root - r
    one, other = (lead / (3 * c) if c != 0 else NONE), (q / lead if lead != 0 else NONE)
    one, other = (one, other) if one < other else (other, one)
    for piece in range(3):
        high = 1.0 if piece == 2 else (one if piece == 0 else other)
        if not low < high <= 1:
            continue
        end = p + high * (q + high * (r + high * c))
        if positive and end <= 0:
            return _falling(p, q, r, c, low, high)
        low, positive = high, end > 0
    return NONE


@jit
def _falling(p: float, q: float, r: float, c: float, low: float, high: float) -> float:
    """Return the root of a cubic that decreases between `low` and `high`."""
    x = low + (high - low) * 0.5
    for _ in range(MOST_ITERATIONS):
        force = p + x * (q + x * (r + x * c))
        if force > 0:
            low = x
        else:
            high = x
        slope = q + x * (2 * r + x * 3 * c)
        step = x - force / slope if slope < 0 else high
        if abs(step - x) < CLOSE:
            return min(max(step, low), high)
        x = step if low < step < high else 0.5 * (low + high)
    return x


class FreeElement(NamedTuple):
    """A free element with the displacement u at the position `start` in a cell.

    The penetration in the cell is w = w0 + a x + b x^2 + c x^3.
    """

    w0: float
    a: float
    b: float
    c: float
    u: float
    start: float


@jit
def _contact_begin_between(element: FreeElement, deborah: float, low: float, high: float) -> float:
    """Return the position x between `low` and `high` where the line reaches a free element.

    If the line is not below the element at `low`, `low` is returned.

    The displacement of the element is u exp(-(x - start) / deborah). At `high`, the penetration w must exceed this
    displacement.
    """
    w0, a, b, c, u, start = element
    if w0 + low * (a + low * (b + low * c)) >= u - u * _decayed((low - start) / deborah):
        return low
    first, end, x = low, high, high
    for _ in range(MOST_ITERATIONS):
        free = u - u * _decayed((x - start) / deborah)
        gap = w0 + x * (a + x * (b + x * c)) - free
        if gap > 0:
            high = x
        else:
            low = x
        slope = a + x * (2 * b + x * 3 * c) + free / deborah
        step = x - gap / slope if slope > 0 else low
        if abs(step - x) < CLOSE:
            return min(max(step, first), end)
        x = step if low < step < high else 0.5 * (low + high)
    return x


@jit
def _contact_begin(element: FreeElement, deborah: float, low: float, stop: float) -> float:
    """Return the first position between `low` and `stop` where contact with a free element begins, or `NONE`.

    In an interval of positive force w + deborah w', the function (w - u) exp(x / deborah) increases, where u is the
    displacement of the free element. Contact therefore begins at most once in this interval.
    """
    w0, a, b, c, u, start = element
    for _ in range(3):
        force = w0 + low * (a + low * (b + low * c)) + deborah * (a + low * (2 * b + low * 3 * c))
        first = low if force > 0 else contact_end(-w0, -a, -b, -c, deborah, low)
        if first >= stop:
            return NONE
        high = min(contact_end(w0, a, b, c, deborah, first), stop)
        if w0 + high * (a + high * (b + high * c)) > u - u * _decayed((high - start) / deborah):
            return _contact_begin_between(element, deborah, first, high)
        if high >= stop:
            return NONE
        low = high + CLOSE
    return NONE


@jit
def _pressed(w0: float, a: float, b: float, c: float, start: float, end: float) -> tuple[float, float]:
    """Return the integrals of w and of w'^2 from `start` to `end` by Gauss's rule with three nodes, which is exact."""
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


@jit
def _over_recovery(u: float, travelled: float, deborah: float, slope: float) -> tuple[float, float, float, float]:
    """Return the contributions of a free recovery to load and drag, each followed by the derivative d/d(depth).

    The load is the integral of u. The recovery begins with the displacement u, and extends over the distance
    `travelled`. The derivative of the drag includes the shift of the place where contact begins again. At this place,
    the line has the slope `slope`.
    """
    lost = _decayed(travelled / deborah) if u > 0 else 1.0
    memory = deborah * lost
    return u * memory, memory if u > 0 else 0.0, 0.5 * u * u * lost * (2 - lost), memory * (u / deborah + slope)


@jit_inline
def _skip_free(
    peak: FloatArray, block_peak: FloatArray, depth: float, decay: float, block_decay: float, i: int, free: float
) -> tuple[int, float]:
    """Skip cells, beginning with cell i, in which a free element certainly stays free.

    Return the first cell that is not skipped, and u at the start of this cell.
    """
    n, blocks = peak.size - 1, block_peak.size
    while i < n and peak[i] + depth <= free * decay:
        if i & (BLOCK - 1) == 0 and i // BLOCK < blocks and block_peak[i // BLOCK] + depth <= free * block_decay:
            free *= block_decay
            i += BLOCK
        else:
            free *= decay
            i += 1
        # avoid subnormal numbers, because arithmetic with them is a hundred times slower
        free = free if free > TINY else 0.0
    return i, free


@jit
def sweep_cells(
    cells: Cells, every: Blocks, barriers: Barriers, deborah: float, depth: float, sums: FloatArray, places: FloatArray
) -> int:
    """Move one element once along the line, and return the number of contact patches.

    Limits in `barriers` that are still NaN are computed when they are needed. `sums` receives, in this order: the
    load f = F_N / (4 G dx), which is the integral of u; df/d(depth); the drag g = F_x / (4 G); dg/d(depth); the length
    in contact; the integral of w'^2 over the length in contact; and 1 if an end of a line that is not periodic is in
    contact, otherwise 0. `places`, shape (2, capacity), receives the positions where the first `capacity` patches begin
    and end. Further patches are only counted.

    On a periodic line, the first patch begins at the highest point, and the last patch ends there. If a free element
    arrives at the highest point, the last patch has the length 0.
    """
    # local names, because reading an array from a tuple takes more time than computing a cell
    height, enter, leave, peak, mean, stretches = (
        cells.height,
        cells.enter,
        cells.leave,
        cells.peak,
        cells.mean,
        cells.stretch,
    )
    block_peak, block_mean, block_stretch = every.peak, every.mean, every.stretch
    barrier, block_barrier = barriers.cell, barriers.block
    begins, ends = places[0], places[1]
    n, blocks, start = mean.size - 1, block_peak.size, cells.start
    decay, block_decay = np.exp(-1 / deborah), np.exp(-BLOCK / deborah)
    area = rate = drag = drag_rate = length = stretch = 0.0
    i, x, contact, patches = 0, start, cells.periodic, 0
    if contact and begins.size > 0:
        begins[0] = start
    # `left` is the place where the last contact ended, `u` is the displacement at this place,
    # and `free` is the displacement at the start of the current cell
    u = free = left = 0.0
    # if the highest point is inside cell 0, a period ends inside cell n, which is a copy of cell 0
    last = n if cells.periodic and start > 0 else n - 1
    while i <= last:
        if contact and x == 0:
            while i < n:
                if math.isnan(block_barrier[i // BLOCK]):
                    write_barriers(height, enter, leave, deborah, i // BLOCK, barriers)
                if not barrier[i] < depth:
                    break
                if i & (BLOCK - 1) == 0 and i // BLOCK < blocks and block_barrier[i // BLOCK] < depth:
                    area += block_mean[i // BLOCK] + BLOCK * depth
                    stretch += block_stretch[i // BLOCK]
                    length += BLOCK
                    i += BLOCK
                else:
                    area += mean[i] + depth
                    stretch += stretches[i]
                    length += 1
                    i += 1
        elif not contact:
            i, free = _skip_free(peak, block_peak, depth, decay, block_decay, i, free)
        if i > last:
            break
        stop = 1.0 if i < n else start
        h0, c1, c2, c3 = cubic(height, enter, leave, i)
        w0 = depth + h0
        visits = 0
        while True:
            if contact:
                pressed = w0 + x * (c1 + x * (c2 + x * c3)) + deborah * (c1 + x * (2 * c2 + x * 3 * c3)) > 0
                place = contact_end(w0, c1, c2, c3, deborah, x) if pressed else x
                end = min(place, stop)
                part, part_stretch = _pressed(w0, c1, c2, c3, x, end)
                area += part
                stretch += part_stretch
                length += end - x
                visits += 1
                if place >= stop:
                    break
                contact, left, x = False, i + place, place
                if patches < ends.size:
                    ends[patches] = left
                patches += 1
                free = u = w0 + place * (c1 + place * (c2 + place * c3))
            # a cubic force changes from positive to negative at most twice in a cell
            low = x + CLOSE if visits > 0 else x
            may_begin = visits < 2 and low < stop
            begin = _contact_begin(FreeElement(w0, c1, c2, c3, free, x), deborah, low, stop) if may_begin else NONE
            if begin > stop:
                free -= free * _decayed((stop - x) / deborah)
                break
            gain = _over_recovery(u, i + begin - left, deborah, c1 + begin * (2 * c2 + begin * 3 * c3))
            area, rate, drag, drag_rate = area + gain[0], rate + gain[1], drag + gain[2], drag_rate + gain[3]
            contact, x = True, begin
            if patches < begins.size:
                begins[patches] = i + begin
        x = 0.0
        i += 1
    # the last free recovery extends to the highest point of a periodic line, or to infinity beyond any other line
    if not contact:
        travelled = n + start - left if cells.periodic else np.inf
        slope = enter[n] if cells.periodic and start == 0 else 0.0
        gain = _over_recovery(u, travelled, deborah, slope)
        area, rate, drag, drag_rate = area + gain[0], rate + gain[1], drag + gain[2], drag_rate + gain[3]
    sums[DISPLACEMENT] = area
    sums[STIFFNESS] = rate + length
    sums[DRAG] = drag + deborah * stretch
    sums[DRAG_RATE] = drag_rate
    sums[LENGTH] = length
    sums[STRETCH] = stretch
    sums[OUTSIDE] = 0.0 if cells.periodic or not (contact or depth + height[0] > 0) else 1.0
    if not (cells.periodic or contact):
        return patches
    # the last patch ends at the highest point of a periodic line, or at the end of any other line
    if patches < ends.size:
        begins[patches], ends[patches] = begins[patches] if contact else n + start, n + start
    return patches + 1


@jit
def patches_at(
    cells: Cells, every: Blocks, barriers: Barriers, deborah: float, depth: float, sums: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the positions where the contact patches begin and where they end, as described in `sweep_cells`."""
    places = np.empty((2, 2 * cells.mean.size + 1))  # contact ends at most twice in a cell, and at the end of the line
    count = sweep_cells(cells, every, barriers, deborah, depth, sums, places)
    return places[0, :count], places[1, :count]
