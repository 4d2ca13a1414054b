"""Compiled parts of the velocity jump: a profile of cubic cells, patches in contact and the forces on them.

Lengths are in units of the line, heights in any one unit, times in relaxation times tau.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.compiling import compiled, inlined
from mdr_dask.physics.surfaces.cubic_line import highest_point

ROOT_STEPS = 60
CLOSE = 1e-5  # of a cell: a step of Newton after which the next one is below rounding
NEARBY = 8  # patches to look at one by one before halving
LOAD, DRAG, LENGTH, TILT, STIFFNESS, DRAG_STIFFNESS = range(6)
SUMS = 6


class Profile(NamedTuple):
    """A profile of cubic cells, from the cell of its highest point on where it is periodic.

    Parameters
    ----------
    height, slope : array, shape (n + 2,) if periodic, else (n + 1,)
        Height into the elastomer and its derivative at the nodes.
    area, square : array, same shape
        Integrals of the height and of the slope squared up to each node.
    cells, cell : float
        Number of cells of a line, and the length of one.
    origin : float
        Highest point, in the first cell, where a turn begins.
    periodic : bool
        Whether the last cell is the first one again; else elements enter undeformed.
    """

    height: FloatArray
    slope: FloatArray
    area: FloatArray
    square: FloatArray
    cells: float
    cell: float
    origin: float
    periodic: bool


def cubic_profile(height: FloatArray, slope: FloatArray) -> tuple[Profile, float]:
    """Return a periodic profile of cubic cells that begins at its highest point.

    Parameters
    ----------
    height : array, shape (n,)
        Heights at equidistant nodes of a line of unit length, positive into the elastomer, which moves along it in the
        order of the nodes.
    slope : array, shape (n,)
        Derivative at the nodes.

    Returns
    -------
    profile : Profile
        With heights from the highest point, so that a light contact loses no digits.
    top : float
        Height of that point.
    """
    best, place, top = highest_point(height, slope)
    n = height.size
    heights, slopes, area, square = np.empty((4, n + 2))
    _turned(height, slope, best, top, heights, slopes, area, square)
    return Profile(heights, slopes, area, square, float(n), 1 / n, place / n, True), top


@njit(nogil=True, cache=True)
def _turned(
    height: FloatArray,
    slope: FloatArray,
    best: int,
    top: float,
    heights: FloatArray,
    slopes: FloatArray,
    area: FloatArray,
    square: FloatArray,
) -> None:
    """Write the columns of a profile that begins at cell `best`."""
    n = height.size
    for i in range(n + 2):
        node = best + i if best + i < n else best + i - n
        node = node if node < n else node - n
        heights[i], slopes[i] = height[node] - top, slope[node]
    area[0] = square[0] = 0.0
    for i in range(n + 1):
        enter, leave = slopes[i] / n, slopes[i + 1] / n
        before, after = slopes[i - 1 if i > 0 else n - 1] / n, slopes[i + 2 if i < n else 2] / n
        area[i + 1] = area[i] + (0.5 * (heights[i + 1] + heights[i]) + (enter - leave) / 12) / n
        # by Euler and Maclaurin: exact over the whole line, whose roughness is band-limited
        bend = (leave**2 - before**2 - after**2 + enter**2) / 24
        square[i + 1] = square[i] + (0.5 * (enter**2 + leave**2) + bend) * n


class Patches(NamedTuple):
    """Where the elements touch: patch k from ``start[k]`` to ``end[k]``, `count` of them, at one depth and reach.

    ``cursor`` is where one of them was found last.
    """

    start: FloatArray
    end: FloatArray
    pressed: FloatArray
    count: int  # type: ignore[assignment]
    depth: float
    reach: float
    cursor: IntArray


class Course(NamedTuple):
    """The depth and its rate at the moments so far, ``count`` of them; constant depth where there is none.

    ``stiff`` is the derivative of the last rate by the last depth.
    """

    time: FloatArray
    depth: FloatArray
    rate: FloatArray
    count: int  # type: ignore[assignment]
    stiff: float


@inlined
def _cubic(profile: Profile, i: int) -> tuple[float, float, float, float]:
    """Return the coefficients of the height in cell i over 0..1."""
    h = profile.height[i]
    rise = profile.height[i + 1] - h
    enter, leave = profile.slope[i] * profile.cell, profile.slope[i + 1] * profile.cell
    return h, enter, 3 * rise - 2 * enter - leave, enter + leave - 2 * rise


@inlined
def height_at(profile: Profile, x: float) -> tuple[float, float, float]:
    """Return height, slope and curvature at x."""
    y = x * profile.cells
    i = min(max(int(y), 0), profile.height.size - 2)
    y -= i
    c0, c1, c2, c3 = _cubic(profile, i)
    return (
        c0 + y * (c1 + y * (c2 + y * c3)),
        (c1 + y * (2 * c2 + y * 3 * c3)) * profile.cells,
        (2 * c2 + 6 * y * c3) * (profile.cells * profile.cells),
    )


@inlined
def last_until(values: FloatArray, x: float, low: int, high: int) -> int:
    """Return the index of the last of the ascending values from `low` to before `high` that is x at most, or `low`."""
    while high - low > 1:
        middle = (low + high) // 2
        if values[middle] <= x:
            low = middle
        else:
            high = middle
    return low


@inlined
def patch_before(patches: Patches, s: float) -> int:
    """Return the last patch that begins at s or before, or the first one; those near the last one found come first."""
    low, high = int(patches.cursor[0]), patches.count
    if patches.start[low] <= s:
        for _ in range(NEARBY):
            if low + 1 >= high or patches.start[low + 1] > s:
                patches.cursor[0] = low
                return low
            low += 1
    else:
        high, low = low, max(low - NEARBY, 0)
        if patches.start[low] > s:
            high, low = low, 0
    low = last_until(patches.start, s, low, high)
    patches.cursor[0] = low
    return low


@inlined
def integrals_at(profile: Profile, x: float) -> tuple[float, float, float]:
    """Return the height at x, its integral up to x and that of its slope squared."""
    y = x * profile.cells
    i = min(max(int(y), 0), profile.height.size - 2)
    y -= i
    a, b, c, e = _cubic(profile, i)
    area = y * (a + y * (b / 2 + y * (c / 3 + y * e / 4)))
    square = y * (b * b + y * (2 * b * c + y * ((4 * c * c + 6 * b * e) / 3 + y * (3 * c * e + y * 1.8 * e * e))))
    return (
        a + y * (b + y * (c + y * e)),
        profile.area[i] + area * profile.cell,
        profile.square[i] + square * profile.cells,
    )


@inlined
def add_patch(profile: Profile, start: float, end: float, lift: float, reach: float, sums: FloatArray) -> None:
    """Add the forces of a patch in contact, f = lift + p + reach p' with lift = d + d_dot, exactly."""
    h0, area0, square0 = integrals_at(profile, start)
    h1, area1, square1 = integrals_at(profile, end)
    sums[LOAD] += lift * (end - start) + area1 - area0 + reach * (h1 - h0)
    sums[DRAG] += lift * (h1 - h0) + 0.5 * (h1 * h1 - h0 * h0) + reach * (square1 - square0)
    sums[LENGTH] += end - start
    sums[TILT] += h1 - h0


@inlined
def unloading(profile: Profile, lift: float, reach: float, low: float, high: float) -> float:
    """Return where lift + p + reach p' falls through zero between low and high, in one cell."""
    i = min(max(int(0.5 * (low + high) * profile.cells), 0), profile.height.size - 2)
    c0, c1, c2, c3 = _cubic(profile, i)
    far = reach * profile.cells
    # the force is a cubic itself
    p, q, r = lift + c0 + far * c1, c1 + 2 * far * c2, c2 + 3 * far * c3
    left, right = max(low * profile.cells - i, 0.0), min(high * profile.cells - i, 1.0)
    first, last = left, right
    end = p + right * (q + right * (r + right * c3))
    begin = p + left * (q + left * (r + left * c3))
    y = left + (right - left) * (begin / (begin - end) if begin > 0 > end else 0.5)
    for _ in range(ROOT_STEPS):
        force = p + y * (q + y * (r + y * c3))
        if force > 0:
            left = y
        else:
            right = y
        falls = q + y * (2 * r + 3 * y * c3)
        step = y - force / falls if falls < 0 else 0.5 * (left + right)
        if abs(step - y) < CLOSE and falls < 0:
            y = min(max(step, first), last)
            break
        if not left < step < right:
            step = 0.5 * (left + right)
        if right - left < 1e-12:
            break
        y = step
    return (i + y) * profile.cell


@inlined
def loading(profile: Profile, lift: float, reach: float, low: float, high: float) -> float:
    """Return where lift + p + reach p' rises through zero between low and high, by bisection."""
    for _ in range(ROOT_STEPS):
        x = 0.5 * (low + high)
        h, slope, _ = height_at(profile, x)
        if lift + h + reach * slope > 0:
            high = x
        else:
            low = x
    return high


@compiled
def released(profile: Profile, first: Patches, reach: float, rate: float, sums: FloatArray) -> None:
    """Add up the forces at the very moment of a jump: what touched before touches on where f > 0 at the new rates.

    Parameters
    ----------
    profile, first : Profile, Patches
        The state before the jump; displacements and depth do not change at once.
    reach, rate : float
        New v tau / L, and new rate of the depth.
    sums : array, shape (SUMS,)
        Written: load and drag over 4 G L, length in contact, which is the derivative of the load by the rate.
    """
    sums[:] = 0.0
    lift = first.depth + rate
    cell = profile.cell
    for k in range(first.count):
        i = int(first.start[k] / cell)
        begin, x0 = first.start[k], first.start[k]
        h, slope, _ = height_at(profile, x0)
        pressed = lift + h + reach * slope > 0
        while x0 < first.end[k]:
            x1 = min((i + 1) * cell, first.end[k])
            h, slope = profile.height[i + 1], profile.slope[i + 1]
            if x1 == first.end[k]:
                h, slope, _ = height_at(profile, x1)
            now = lift + h + reach * slope > 0
            if pressed and not now:
                add_patch(profile, begin, unloading(profile, lift, reach, x0, x1), lift, reach, sums)
            elif now and not pressed:
                begin = loading(profile, lift, reach, x0, x1)
            pressed = now
            x0 = x1
            i += 1
        if pressed:
            add_patch(profile, begin, first.end[k], lift, reach, sums)
