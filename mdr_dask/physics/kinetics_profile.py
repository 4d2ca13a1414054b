"""Compiled parts of the velocity jump: a profile of cubic cells, patches in contact and the forces on them.

Lengths are in units of the line, heights in any one unit, times in relaxation times tau.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

ROOT_STEPS = 60
LOAD, DRAG, LENGTH, TILT, STIFFNESS, DRAG_STIFFNESS = range(6)
SUMS = 6


Kernel = TypeVar("Kernel", bound=Callable[..., object])


def compiled(function: Kernel) -> Kernel:
    """Compile a function that allocates nothing: without counting references, which would take half of its time."""
    compile_it = njit(nogil=True, cache=True, _nrt=False)  # type: ignore[call-overload]
    return cast(Kernel, compile_it(function))


class Profile(NamedTuple):
    """A profile of cubic cells, from the cell of its highest point on where it is periodic.

    Parameters
    ----------
    height, slope : array, shape (n + 2,) if periodic, else (n + 1,)
        Height into the elastomer and its derivative at the nodes.
    area, square : array, same shape
        Integrals of the height and of the slope squared up to each node.
    cell : float
        Length of a cell.
    origin : float
        Highest point, in the first cell, where a turn begins.
    periodic : bool
        Whether the last cell is the first one again; else elements enter undeformed.
    """

    height: FloatArray
    slope: FloatArray
    area: FloatArray
    square: FloatArray
    cell: float
    origin: float
    periodic: bool


class Patches(NamedTuple):
    """Where the elements touch: patch k from ``start[k]`` to ``end[k]``, `count` of them, at one depth and reach."""

    start: FloatArray
    end: FloatArray
    pressed: FloatArray
    count: int  # type: ignore[assignment]
    depth: float
    reach: float


class Course(NamedTuple):
    """The depth and its rate at the moments so far, ``count`` of them; constant depth where there is none.

    ``stiff`` is the derivative of the last rate by the last depth.
    """

    time: FloatArray
    depth: FloatArray
    rate: FloatArray
    count: int  # type: ignore[assignment]
    stiff: float


@compiled
def _cubic(profile: Profile, i: int) -> tuple[float, float, float, float]:
    """Return the coefficients of the height in cell i over 0..1."""
    h = profile.height[i]
    rise = profile.height[i + 1] - h
    enter, leave = profile.slope[i] * profile.cell, profile.slope[i + 1] * profile.cell
    return h, enter, 3 * rise - 2 * enter - leave, enter + leave - 2 * rise


@compiled
def height_at(profile: Profile, x: float) -> tuple[float, float, float]:
    """Return height, slope and curvature at x."""
    y = x / profile.cell
    i = min(max(int(y), 0), profile.height.size - 2)
    y -= i
    c0, c1, c2, c3 = _cubic(profile, i)
    return (
        c0 + y * (c1 + y * (c2 + y * c3)),
        (c1 + y * (2 * c2 + y * 3 * c3)) / profile.cell,
        (2 * c2 + 6 * y * c3) / profile.cell**2,
    )


@compiled
def integrals_at(profile: Profile, x: float) -> tuple[float, float, float]:
    """Return the height at x, its integral up to x and that of its slope squared."""
    y = x / profile.cell
    i = min(max(int(y), 0), profile.height.size - 2)
    y -= i
    a, b, c, e = _cubic(profile, i)
    area = y * (a + y * (b / 2 + y * (c / 3 + y * e / 4)))
    square = y * (b * b + y * (2 * b * c + y * ((4 * c * c + 6 * b * e) / 3 + y * (3 * c * e + y * 1.8 * e * e))))
    return (
        a + y * (b + y * (c + y * e)),
        profile.area[i] + area * profile.cell,
        profile.square[i] + square / profile.cell,
    )


@compiled
def add_patch(profile: Profile, start: float, end: float, lift: float, reach: float, sums: FloatArray) -> None:
    """Add the forces of a patch in contact, f = lift + p + reach p' with lift = d + d_dot, exactly."""
    h0, area0, square0 = integrals_at(profile, start)
    h1, area1, square1 = integrals_at(profile, end)
    sums[LOAD] += lift * (end - start) + area1 - area0 + reach * (h1 - h0)
    sums[DRAG] += lift * (h1 - h0) + 0.5 * (h1 * h1 - h0 * h0) + reach * (square1 - square0)
    sums[LENGTH] += end - start
    sums[TILT] += h1 - h0


@compiled
def unloading(profile: Profile, lift: float, reach: float, low: float, high: float) -> float:
    """Return where lift + p + reach p' falls through zero between low and high."""
    x = 0.5 * (low + high)
    for _ in range(ROOT_STEPS):
        h, slope, curvature = height_at(profile, x)
        force = lift + h + reach * slope
        if force > 0:
            low = x
        else:
            high = x
        falls = slope + reach * curvature
        step = x - force / falls if falls < 0 else 0.5 * (low + high)
        if not low < step < high:
            step = 0.5 * (low + high)
        if abs(step - x) < 1e-9 * profile.cell:
            return step
        x = step
    return x


@compiled
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
