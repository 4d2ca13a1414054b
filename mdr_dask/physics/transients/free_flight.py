"""Compiled parts of the velocity jump: the displacement of elements in free flight.

An element at x came along the path x' = x - reach (t - t') with reach = v tau / L, and its displacement is the largest
one it was pressed to, faded since:

    u(x, t) = max over t' <= t of (d(t') + p(x')) exp(-(t - t'))

so that only the depth d(t) has a history. Free flights are never followed: the place where an element left is the one
where this expression is stationary.
"""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.compiling import inlined
from mdr_dask.physics.transients.patches import (
    ROOT_STEPS,
    Course,
    Patches,
    Profile,
    height_at,
    last_until,
    patch_before,
)

NEAR = 0.02  # of a cell: a last Newton step whose gain is added, for its cube is what is left
MET = 3e-4  # of a cell: a last Newton step that is not checked


@inlined
def _moment(course: Course, t: float) -> tuple[float, float, float]:
    """Return depth, rate and its derivative at time t by the cubic through values and rates."""
    last = course.count - 1
    if last <= 0 or t >= course.time[last]:
        return course.depth[last], course.rate[last], 0.0
    low, high, back = last - 1, last, 1
    while course.time[low] > t and low > 0:
        high, low, back = low, max(low - back, 0), 2 * back
    low = last_until(course.time, t, low, high)
    high = low + 1
    step = course.time[high] - course.time[low]
    y = (t - course.time[low]) / step
    rise = course.depth[high] - course.depth[low]
    enter, leave = course.rate[low] * step, course.rate[high] * step
    c2, c3 = 3 * rise - 2 * enter - leave, enter + leave - 2 * rise
    return (
        course.depth[low] + y * (enter + y * (c2 + y * c3)),
        (enter + y * (2 * c2 + 3 * y * c3)) / step,
        (2 * c2 + 6 * y * c3) / step**2,
    )


@inlined
def _follows(course: Course, t: float) -> float:
    """Return the derivative of the depth at time t by the last depth."""
    last = course.count - 1
    if last <= 0 or t >= course.time[last]:
        return 1.0
    if t <= course.time[last - 1]:
        return 0.0
    step = course.time[last] - course.time[last - 1]
    y = (t - course.time[last - 1]) / step
    return float(y * y * (3 - 2 * y + course.stiff * step * (y - 1)))


@inlined
def _left_from(
    profile: Profile, course: Course, t: float, reach: float, x: float, place: float
) -> tuple[float, float, float]:
    """Return displacement at x of an element that left near `place`, its slope along x, and the derivative by depth.

    The leaving point of that element is where its load vanished then, not where it vanishes now; a few Newton steps
    from there suffice, because the displacement is stationary in it.
    """
    best, best_slope, best_gain = -1.0, 0.0, 0.0
    s = place
    for _ in range(4):
        then = t - (x - s) / reach
        if then <= 0:
            break
        d, rate, change = _moment(course, then)
        h, slope, curvature = height_at(profile, s)
        fade = np.exp(-(x - s) / reach)
        force = d + h + rate + reach * slope
        falls = (rate + change) / reach + slope + reach * curvature
        step = -force / falls if falls < 0 else 0.0
        near = abs(step) < NEAR * profile.cell
        u = (d + h + (0.5 * force * step / reach if near else 0.0)) * fade
        if u > best:
            best, best_slope = u, -(d + h + rate) * fade / reach
            best_gain = _follows(course, then) * fade
        if near:
            break
        s = min(max(s + min(max(step, -2 * profile.cell), 2 * profile.cell), 0.0), x)
    return best, best_slope, best_gain


@inlined
def left_before(profile: Profile, first: Patches, t: float, reach: float, x: float) -> tuple[float, float]:
    """Return what is left at x of the state before the jump, and its slope along x."""
    s = x - reach * t
    if profile.periodic:
        s -= np.floor(s - profile.origin)
    elif s < first.start[0]:
        return 0.0, 0.0
    low = patch_before(first, s)
    fade = np.exp(-t)
    if s <= first.end[low]:
        h, slope, _ = height_at(profile, s)
        return (first.depth + h) * fade, slope * fade
    u = first.pressed[low] * np.exp(-(s - first.end[low]) / first.reach) * fade
    return u, -u / first.reach


@inlined
def wake_at(
    profile: Profile,
    first: Patches,
    course: Course,
    t: float,
    reach: float,
    x: float,
    places: FloatArray,
    count: int,
    oldest: float,
) -> tuple[float, float, float]:
    """Return the displacement at x of elements in free flight, its slope along x, and its derivative by the depth."""
    u, slope, gain = 0.0, 0.0, 0.0
    for k in range(count):
        value, value_slope, value_gain = _left_from(profile, course, t, reach, x, places[k])
        if value > u:
            u, slope, gain = value, value_slope, value_gain
    if first.count > 0 and t < 45 and x - reach * t > oldest:
        value, value_slope = left_before(profile, first, t, reach, x)
        if value > u:
            u, slope, gain = value, value_slope, 0.0
    return u, slope, gain


@inlined
def meeting(
    profile: Profile,
    first: Patches,
    course: Course,
    t: float,
    reach: float,
    low: float,
    high: float,
    x: float,
    places: FloatArray,
    count: int,
    oldest: float,
) -> tuple[float, float, float]:
    """Return where the profile rises through the wake, the slopes of their gap by place and depth."""
    depth = course.depth[course.count - 1]
    slope, gain = 1.0, 0.0
    for _ in range(ROOT_STEPS):
        if not low < x < high:
            x = 0.5 * (low + high)
        u, u_slope, gain = wake_at(profile, first, course, t, reach, x, places, count, oldest)
        h, h_slope, _ = height_at(profile, x)
        gap = depth + h - u
        slope = h_slope - u_slope
        if gap > 0:
            high = x
        else:
            low = x
        step = -gap / slope if slope > 0 else 2 * profile.cell
        if abs(step) < MET * profile.cell or high - low < 1e-9 * profile.cell:
            return min(max(x + step, low), high), slope, 1 - gain
        x += step
    return x, slope, 1 - gain


@inlined
def losing(profile: Profile, first: Patches, t: float, reach: float, depth: float, low: float, high: float) -> float:
    """Return where, between low and high, contact gives way to elements that the jump found free; by bisection."""
    while high - low > 1e-12 * profile.cell:
        x = 0.5 * (low + high)
        if not low < x < high:
            break
        if depth + height_at(profile, x)[0] > left_before(profile, first, t, reach, x)[0]:
            low = x
        else:
            high = x
    return high


@inlined
def write_spreads(course: Course, t: float, reach: float, window: float, spreads: FloatArray) -> None:
    """Write the range of the depth while the profile went the last window, twice that, four times that, and so on."""
    now = course.count - 1
    lowest = highest = course.depth[now]
    back = now
    for k in range(spreads.size):
        since = t - window / reach * 2.0**k
        while back > 0 and course.time[back] > since:
            back -= 1
            lowest, highest = min(lowest, course.depth[back]), max(highest, course.depth[back])
        spreads[k] = highest - lowest


@inlined
def spread_over(spreads: FloatArray, window: float, distance: float) -> float:
    """Return the range of the depth while the profile went a distance."""
    k = 0
    while k < spreads.size - 1 and distance > window:
        distance *= 0.5
        k += 1
    return float(spreads[k])


@inlined
def worth_keeping(
    profile: Profile,
    course: Course,
    t: float,
    reach: float,
    x: float,
    pressed: float,
    spreads: FloatArray,
    window: float,
    places: FloatArray,
    count: int,
) -> int:
    """Keep the places whose wake can still come out above that of an element pressed to `pressed` at x; count them."""
    kept = 0
    for k in range(count):
        if t * reach <= x - places[k]:
            continue
        u = _left_from(profile, course, t, reach, x, places[k])[0]
        if u + 2 * spread_over(spreads, window, 2 * (x - places[k]) + window) >= pressed:
            places[kept] = places[k]
            kept += 1
    return kept


@inlined
def next_free_place(profile: Profile, first: Patches, t: float, reach: float, x: float) -> float:
    """Return the first place from x on whose element was free at the jump."""
    s = x - reach * t
    turns = np.floor(s - profile.origin) if profile.periodic else 0.0
    s -= turns
    low = patch_before(first, s)
    if not first.start[low] <= s <= first.end[low]:
        return x
    until = first.end[low]
    if profile.periodic and low == first.count - 1:
        until = first.end[0] + 1.0
    return float(until + turns + reach * t)
