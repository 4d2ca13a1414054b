"""Compiled parts of the velocity jump: who touches what at one moment, and the march of the depth through time.

Lengths are in units of the line, heights in any one unit, times in relaxation times tau. An element at x came along
the path x' = x - reach (t - t') with reach = v tau / L, and its displacement is the largest one it was pressed to,
faded since:

    u(x, t) = max over t' <= t of (d(t') + p(x')) exp(-(t - t'))

so that only the depth d(t) has a history. Free flights are never followed: the place where an element left is the one
where this expression is stationary.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

CANDIDATES = 8
BLOCK = 16
WINDOW_CELLS = 64.0
WINDOWS = 12
TRIALS = 80
EXACT = 1e-11  # of the load
ROOT_STEPS = 60
SETTLED = 2.5  # times the time since when a march has been near its end: where it ends
NEAR = 0.02  # of a cell: a last Newton step whose gain is added, for its cube is what is left
MET = 3e-4  # of a cell: a last Newton step that is not checked
GUARD_CELLS = 200.0
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


@njit(nogil=True, cache=True, _nrt=False, inline="always")
def _cubic(profile: Profile, i: int) -> tuple[float, float, float, float]:
    """Return the coefficients of the height in cell i over 0..1."""
    h = profile.height[i]
    rise = profile.height[i + 1] - h
    enter, leave = profile.slope[i] * profile.cell, profile.slope[i + 1] * profile.cell
    return h, enter, 3 * rise - 2 * enter - leave, enter + leave - 2 * rise


@njit(nogil=True, cache=True, _nrt=False)
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


@njit(nogil=True, cache=True, _nrt=False)
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


@njit(nogil=True, cache=True, _nrt=False)
def add_patch(profile: Profile, start: float, end: float, lift: float, reach: float, sums: FloatArray) -> None:
    """Add the forces of a patch in contact, f = lift + p + reach p' with lift = d + d_dot, exactly."""
    h0, area0, square0 = integrals_at(profile, start)
    h1, area1, square1 = integrals_at(profile, end)
    sums[LOAD] += lift * (end - start) + area1 - area0 + reach * (h1 - h0)
    sums[DRAG] += lift * (h1 - h0) + 0.5 * (h1 * h1 - h0 * h0) + reach * (square1 - square0)
    sums[LENGTH] += end - start
    sums[TILT] += h1 - h0


@njit(nogil=True, cache=True, _nrt=False)
def _moment(course: Course, t: float) -> tuple[float, float, float]:
    """Return depth, rate and its derivative at time t by the cubic through values and rates."""
    last = course.count - 1
    if last <= 0 or t >= course.time[last]:
        return course.depth[last], course.rate[last], 0.0
    low, high, back = last - 1, last, 1
    while course.time[low] > t and low > 0:
        high, low, back = low, max(low - back, 0), 2 * back
    while high - low > 1:
        middle = (low + high) // 2
        if course.time[middle] <= t:
            low = middle
        else:
            high = middle
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


@njit(nogil=True, cache=True, _nrt=False)
def _follows(course: Course, t: float) -> float:
    """Return the derivative of the depth at time t by the last depth."""
    last = course.count - 1
    if last <= 0 or t >= course.time[last]:
        return 1.0
    if t <= course.time[last - 1]:
        return 0.0
    step = course.time[last] - course.time[last - 1]
    y = (t - course.time[last - 1]) / step
    return y * y * (3 - 2 * y + course.stiff * step * (y - 1))


@njit(nogil=True, cache=True, _nrt=False)
def _left_from(
    profile: Profile, course: Course, t: float, reach: float, x: float, place: float
) -> tuple[float, float, float]:
    """Return displacement at x of an element that left near `place`, its slope along x, and its derivative by the depth.

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


@njit(nogil=True, cache=True, _nrt=False)
def _before(profile: Profile, first: Patches, t: float, reach: float, x: float) -> tuple[float, float]:
    """Return what is left at x of the state before the jump, and its slope along x."""
    s = x - reach * t
    if profile.periodic:
        s -= np.floor(s - profile.origin)
    elif s < first.start[0]:
        return 0.0, 0.0
    low, high = 0, first.count
    while high - low > 1:
        middle = (low + high) // 2
        if first.start[middle] <= s:
            low = middle
        else:
            high = middle
    fade = np.exp(-t)
    if s <= first.end[low]:
        h, slope, _ = height_at(profile, s)
        return (first.depth + h) * fade, slope * fade
    u = first.pressed[low] * np.exp(-(s - first.end[low]) / first.reach) * fade
    return u, -u / first.reach


@njit(nogil=True, cache=True, _nrt=False)
def _wake(
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
        value, value_slope = _before(profile, first, t, reach, x)
        if value > u:
            u, slope, gain = value, value_slope, 0.0
    return u, slope, gain


@njit(nogil=True, cache=True, _nrt=False)
def _unloading(profile: Profile, lift: float, reach: float, low: float, high: float) -> float:
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


@njit(nogil=True, cache=True, _nrt=False)
def _meeting(
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
        u, u_slope, gain = _wake(profile, first, course, t, reach, x, places, count, oldest)
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


@njit(nogil=True, cache=True, _nrt=False)
def _losing(profile: Profile, first: Patches, t: float, reach: float, depth: float, low: float, high: float) -> float:
    """Return where, between low and high, contact gives way to elements that the jump found free; by bisection."""
    while high - low > 1e-12 * profile.cell:
        x = 0.5 * (low + high)
        if not low < x < high:
            break
        if depth + height_at(profile, x)[0] > _before(profile, first, t, reach, x)[0]:
            low = x
        else:
            high = x
    return high


@njit(nogil=True, cache=True, _nrt=False)
def _spreads(course: Course, t: float, reach: float, window: float, spreads: FloatArray) -> None:
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


@njit(nogil=True, cache=True, _nrt=False, inline="always")
def _spread(spreads: FloatArray, window: float, distance: float) -> float:
    """Return the range of the depth while the profile went a distance."""
    k = 0
    while k < spreads.size - 1 and distance > window:
        distance *= 0.5
        k += 1
    return float(spreads[k])


@njit(nogil=True, cache=True, _nrt=False)
def _worth_keeping(
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
        u = _left_from(profile, course, t, reach, x, places[k])[0]
        if u + 2 * _spread(spreads, window, 2 * (x - places[k]) + window) >= pressed:
            places[kept] = places[k]
            kept += 1
    return kept


@njit(nogil=True, cache=True, _nrt=False)
def block_least(profile: Profile, reach: float, least: FloatArray) -> None:
    """Write the least p + reach p' over the nodes that end the cells of each block of `BLOCK` cells."""
    for m in range(least.size):
        value = np.inf
        for i in range(m * BLOCK + 1, (m + 1) * BLOCK + 1):
            value = min(value, profile.height[i] + reach * profile.slope[i])
        least[m] = value


@njit(nogil=True, cache=True, _nrt=False)
def _next_free(profile: Profile, first: Patches, t: float, reach: float, x: float) -> float:
    """Return the first place from x on whose element was free at the jump."""
    s = x - reach * t
    turns = np.floor(s - profile.origin) if profile.periodic else 0.0
    s -= turns
    low, high = 0, first.count
    while high - low > 1:
        middle = (low + high) // 2
        if first.start[middle] <= s:
            low = middle
        else:
            high = middle
    if not first.start[low] <= s <= first.end[low]:
        return x
    until = first.end[low]
    if profile.periodic and low == first.count - 1:
        until = first.end[0] + 1.0
    return float(until + turns + reach * t)


@njit(nogil=True, cache=True, _nrt=False)
def touch(
    profile: Profile,
    runs: IntArray,
    floor: FloatArray,
    least: FloatArray,
    first: Patches,
    course: Course,
    t: float,
    reach: float,
    start: FloatArray,
    end: FloatArray,
    sums: FloatArray,
    places: FloatArray,
    spreads: FloatArray,
) -> int:
    """Find the patches in contact at time t, at the last depth and rate of the course, and add up their forces.

    Parameters
    ----------
    profile : Profile
    runs : int array, shape (m, 2)
        First and last node of the stretches in which contact is possible.
    floor : array, shape of the profile
        Displacement that a free element has at least.
    least : array
        See :func:`block_least`.
    first : Patches
        State before the jump; ``count = 0`` for the steady state.
    course : Course
        Depth and rate, this moment included.
    t, reach : float
        Time since the jump, and v tau / L since then.
    start, end : array
        Written: the patches.
    sums : array, shape (SUMS,)
        Written: load and drag over 4 G L, length in contact, rise over it, derivatives of load and drag by the depth.
    places, spreads : array, shape (CANDIDATES,), (WINDOWS,)
        Room.

    Returns
    -------
    int
        Number of patches, or -1 if a patch does not end within its stretch or there are more than fit.
    """
    depth = course.depth[course.count - 1]
    lift = depth + course.rate[course.count - 1]
    height, slope, cell = profile.height, profile.slope, profile.cell
    known, found, edges, edges_drag = 0, 0, 0.0, 0.0
    oldest, last_start = -np.inf, -np.inf
    contact, begin, free_from = profile.periodic, profile.origin, 0.0
    finish = 1.0 + profile.origin if profile.periodic else np.inf
    guard = first.count > 0 and reach * t < GUARD_CELLS * cell
    next_free = _next_free(profile, first, t, reach, begin) if guard and contact else np.inf
    window = WINDOW_CELLS * cell
    _spreads(course, t, reach, window, spreads)
    fade_of_cell = np.exp(-cell / (min(reach, first.reach) if first.count > 0 else reach))
    least_free, known_at = 0.0, 0.0
    sums[:] = 0.0
    for run in range(runs.shape[0]):
        i, stop = runs[run, 0], runs[run, 1]
        if not contact:
            known_at = -np.inf
        while i < stop:
            whole = contact and i % BLOCK == 0 and i + BLOCK < stop and (i + BLOCK) * cell < next_free
            if whole and lift + least[i // BLOCK] > 0:
                i += BLOCK
                continue
            x0, x1, h1, slope1 = i * cell, (i + 1) * cell, height[i + 1], slope[i + 1]
            i += 1
            if x1 > finish:
                x1 = finish
                h1, slope1, _ = height_at(profile, x1)
            pulls = lift + h1 + reach * slope1 <= 0
            if contact:
                until = _unloading(profile, lift, reach, max(x0, begin), x1) if pulls else x1
                lost = False
                if until >= next_free:
                    w = depth + height_at(profile, until)[0]
                    next_free = _next_free(profile, first, t, reach, until)
                    if next_free == until and w < _before(profile, first, t, reach, until)[0] * (1 - 1e-14):
                        until, lost = _losing(profile, first, t, reach, depth, max(x0, begin), until), True
                if not (pulls or lost):
                    continue
                if found + 1 >= start.size:
                    return -1
                add_patch(profile, begin, until, lift, reach, sums)
                start[found], end[found] = begin, until
                found += 1
                w = depth + height_at(profile, until)[0]
                known = _worth_keeping(profile, course, t, reach, until, w, spreads, window, places, known)
                least_free, known_at = (w - spreads[0]) * fade_of_cell, until
                oldest, last_start = last_start, begin
                if not lost:
                    known = min(known, CANDIDATES - 1)
                    places[known] = until
                    known += 1
                contact, free_from = False, until
                continue
            least_free *= fade_of_cell
            highest = depth + max(h1, height[i - 1])
            if slope[i - 1] > 0 > slope1:
                highest += 0.5 * cell * min(slope[i - 1], -slope1)
            if highest <= min(floor[i - 1], floor[i]) or (highest < least_free and x1 - known_at < window):
                continue
            low, probe = max(x0, free_from), x1
            if pulls:
                if lift + height[i - 1] + reach * slope[i - 1] <= 0 or free_from > x0:
                    continue
                probe = _unloading(profile, lift, reach, low, x1)
                h1, slope1, _ = height_at(profile, probe)
            u, u_slope, _ = _wake(profile, first, course, t, reach, probe, places, known, oldest)
            gap, rise = depth + h1 - u, slope1 - u_slope
            spread = _spread(spreads, window, 2 * (probe - places[0]) + window) if known > 0 else spreads[0]
            least_free, known_at = (u - spread) * fade_of_cell, probe
            if gap > 0:
                guess = probe - gap / rise if rise > 0 else low
                begin, rise, gain = _meeting(profile, first, course, t, reach, low, probe, guess, places, known, oldest)
                h, h_slope, _ = height_at(profile, begin)
                if rise > 0:
                    edge = max(lift + h + reach * h_slope, 0.0) * gain / rise
                    edges += edge
                    edges_drag += edge * h_slope
                contact = True
                next_free = _next_free(profile, first, t, reach, begin) if guard else np.inf
            if pulls and gap > -2 * spread:
                if contact:
                    if found + 1 >= start.size:
                        return -1
                    add_patch(profile, begin, probe, lift, reach, sums)
                    start[found], end[found] = begin, probe
                    found += 1
                    oldest, last_start = last_start, begin
                known = _worth_keeping(profile, course, t, reach, probe, depth + h1, spreads, window, places, known)
                known = min(known, CANDIDATES - 1)
                places[known] = probe
                known += 1
                contact, free_from = False, probe
        if contact and run + 1 < runs.shape[0]:
            return -1
    if contact and not profile.periodic:
        return -1
    if profile.periodic:
        begin = begin if contact else finish
        add_patch(profile, begin, finish, lift, reach, sums)
        start[found], end[found] = begin, finish
        found += 1
    sums[STIFFNESS] = sums[LENGTH] * (1 + course.stiff) + edges
    sums[DRAG_STIFFNESS] = sums[TILT] * (1 + course.stiff) + edges_drag
    return found


@njit(nogil=True, cache=True, _nrt=False)
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
                add_patch(profile, begin, _unloading(profile, lift, reach, x0, x1), lift, reach, sums)
            elif now and not pressed:
                begin = _loading(profile, lift, reach, x0, x1)
            pressed = now
            x0 = x1
            i += 1
        if pressed:
            add_patch(profile, begin, first.end[k], lift, reach, sums)


@njit(nogil=True, cache=True, _nrt=False)
def _loading(profile: Profile, lift: float, reach: float, low: float, high: float) -> float:
    """Return where lift + p + reach p' rises through zero between low and high, by bisection."""
    for _ in range(ROOT_STEPS):
        x = 0.5 * (low + high)
        h, slope, _ = height_at(profile, x)
        if lift + h + reach * slope > 0:
            high = x
        else:
            low = x
    return high


@njit(nogil=True, cache=True, _nrt=False)
def _rate_weights(time: FloatArray, depth: FloatArray, now: int, order: int) -> tuple[float, float]:
    """Return a and b of d_dot = a d + b at moment `now`, from the polynomial through the last depths (BDF)."""
    t = time[now]
    a, b = 0.0, 0.0
    for j in range(1, order + 1):
        a += 1 / (t - time[now - j])
    for j in range(1, order + 1):
        weight = 1 / (time[now - j] - t)
        for m in range(1, order + 1):
            if m != j:
                weight *= (t - time[now - m]) / (time[now - j] - time[now - m])
        b += weight * depth[now - j]
    return a, b


class Pace(NamedTuple):
    """How the steps of a march go.

    Parameters
    ----------
    first : float
        First step.
    growth : float
        Largest ratio of one step to the one before.
    miss : float
        Largest difference, in depth, of what a parabola foretells from what is found.
    close : float
        Largest change of depth that one step of Newton is trusted with.
    until : float
        Last time.
    """

    first: float
    growth: float
    miss: float
    close: float
    until: float


@njit(nogil=True, cache=True, _nrt=False)
def _balance(
    profile: Profile,
    runs: IntArray,
    floor: FloatArray,
    least: FloatArray,
    first: Patches,
    course: Course,
    reach: float,
    load: float,
    weights: tuple[float, float],
    limits: tuple[float, float],
    close: float,
    room: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray],
) -> tuple[int, float]:
    """Find the depth that carries the load at the last moment of the course, by Newton steps.

    Returns
    -------
    status : int
        0 found, 1 not found, 2 limits exceeded.
    drag : float
    """
    now = course.count - 1
    guess, (a, b) = course.depth[now], weights
    start, end, sums, places, spreads = room
    low, high = limits
    for trial in range(TRIALS):
        course.depth[now], course.rate[now] = guess, a * guess + b
        found = touch(
            profile, runs, floor, least, first, course, course.time[now], reach, start, end, sums, places, spreads
        )
        if found < 0:
            return 2, 0.0
        off = sums[LOAD] - load
        step = -off / sums[STIFFNESS] if sums[STIFFNESS] > 0 else 0.5 * (low + high) - guess
        if off < 0:
            low = guess
        else:
            high = guess
        if abs(step) <= close or abs(off) <= EXACT * load:
            guess += step
            course.depth[now], course.rate[now] = guess, a * guess + b
            return 0, sums[DRAG] + step * sums[DRAG_STIFFNESS]
        if high - low <= 1e-13 * (abs(low) + abs(high)):
            return 0, sums[DRAG]  # the load jumps here, as a grid lets it where a patch comes or goes
        guess += step
        if not limits[0] <= guess <= limits[1]:
            return 2, 0.0
        if trial > 4 and not low < guess < high:
            guess = 0.5 * (low + high)
    return 1, 0.0


@njit(nogil=True, cache=True)
def march(
    profile: Profile,
    runs: IntArray,
    floor: FloatArray,
    first: Patches,
    reach: float,
    load: float,
    pace: Pace,
    limits: tuple[float, float],
    aim: tuple[float, float, float, float],
    time: FloatArray,
    depth: FloatArray,
    rate: FloatArray,
    drag: FloatArray,
) -> tuple[int, int]:
    """March the depth at constant load through the time after a jump, by backward differentiation of order three.

    Parameters
    ----------
    profile, runs, floor, first, reach
        As in :func:`touch`.
    load : float
        F_N / (4 G L).
    pace : Pace
    limits : tuple of float
        Least and greatest depth for which `runs` and `floor` hold.
    aim : tuple of float
        Final depth and drag, how near to the depth the march ends, and which part of the largest distance of the drag.
    time, depth, rate, drag : array, shape (m,)
        Written from the second entry on; the first one holds the state right after the jump.

    Returns
    -------
    count : int
        Number of moments computed.
    status : int
        0 done, 1 depth not found, 2 limits exceeded.
    """
    most = 4 * first.count + 4096
    room = np.empty(most), np.empty(most), np.empty(SUMS), np.empty(CANDIDATES), np.empty(WINDOWS)
    least = np.empty(profile.height.size // BLOCK)
    block_least(profile, reach, least)
    near, step, now, farthest = 0.0, pace.first, 1, abs(drag[0] - aim[1])
    while time[now - 1] < pace.until:
        if now == time.size:
            return now, 1
        time[now] = min(time[now - 1] + step, pace.until)
        if pace.until - time[now] < 0.1 * step:
            time[now] = pace.until
        taken = time[now] - time[now - 1]
        if now == 1:
            weights = 2 / taken, -2 * depth[0] / taken - rate[0]
            foretold = depth[0] + taken * rate[0]
        else:
            weights = _rate_weights(time, depth, now, min(now, 3))
            bend = (rate[now - 1] - rate[now - 2]) / (time[now - 1] - time[now - 2])
            foretold = depth[now - 1] + taken * (rate[now - 1] + 0.5 * taken * bend)
        depth[now] = min(max(foretold, limits[0]), limits[1])
        course = Course(time, depth, rate, now + 1, weights[0])
        status, drag[now] = _balance(
            profile, runs, floor, least, first, course, reach, load, weights, limits, pace.close, room
        )
        miss = abs(depth[now] - foretold) if status == 0 else 8 * pace.miss
        if miss > 2 * pace.miss or status != 0:
            if step < 1e-3 * pace.first or (status == 2 and step < 1e-2 * time[now - 1]):
                return now, max(status, 1)
            step = taken * max(0.25, 0.8 * (pace.miss / miss) ** (1 / 3))
            continue
        step = taken * min(pace.growth, 0.9 * (pace.miss / max(miss, 1e-300)) ** (1 / 3))
        farthest = max(farthest, abs(drag[now] - aim[1]))
        settled = abs(drag[now] - aim[1]) <= aim[3] * farthest and abs(depth[now] - aim[0]) <= aim[2]
        near = near if settled else time[now]
        now += 1
        if settled and time[now - 1] > SETTLED * near:
            break
    return now, 0
