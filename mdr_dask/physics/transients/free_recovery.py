"""The displacement of elements that recover freely after a velocity jump.

An element that is now at x was at x' = x - D (t - t') at the time t', where the Deborah number D is the distance v tau
in cells. The line may have imposed displacements on this element at earlier times t', and every imposed displacement
decays afterwards. The displacement of the element is the largest of the decayed displacements:

    u(x, t) = max over t' <= t of (d(t') + h(x')) exp(-(t - t'))

This formula needs only the history of the depth d(t). Before the jump, the depth was constant and D had another value
(see `from_before`). A free element separated from the line at the time t' of the maximum. Unless the element separated
at the jump itself, the force on the element was zero then.

The *drift* of free elements is D u' + u, where u' is the derivative along the line. If an element separated after the
jump, its drift is -d'(t') exp(-(t - t')), where t' is the time of separation and d' is the rate of the depth. The
extremes of the drift over the recent past (`PathBounds`) limit how fast u can change along the line.
"""

from __future__ import annotations

from math import frexp
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit_inline_uncounted, jit_uncounted, last_until
from mdr_dask.physics.refine import MOST_ITERATIONS
from mdr_dask.physics.transients.patches import AT_EDGE, History, Patches, Track, height_at

STRIDE = 2.0  # longest step in the search for a place of separation, in cells
ROUNDING = 1e-9  # smaller distances (in cells) and smaller relative differences of displacements may be due to rounding
# In the first of WINDOWS windows of time, the line travels WINDOW cells. Each further window is twice as long.
WINDOW, WINDOWS = 8.0, 16


class Instant(NamedTuple):
    """An instant after the jump, with the line, the contact before the jump, and the history of the depth.

    `time` is the time since the jump, `deborah` belongs to the velocity after the jump, and `left` is exp(-time),
    the factor by which displacements have decayed since the jump.
    """

    track: Track
    first: Patches
    history: History
    time: float
    deborah: float
    left: float


class PathBounds(NamedTuple):
    """Bounds over windows of time that end now, shape (WINDOWS,) each.

    During the shortest window the line travels `WINDOW` cells. Each further window is twice as long as the previous
    window. `spread` is the range of the depth. `least_lift` is the smallest lift (depth plus rate of the depth).
    `most_drift` (at least 0) and `least_drift` (at most 0) are the extreme drifts of elements that separated within the
    window or have been free since before the jump.
    """

    spread: FloatArray
    least_lift: FloatArray
    most_drift: FloatArray
    least_drift: FloatArray


class FreeRecovery(NamedTuple):
    """Places and runs of cells where elements may have separated, in order along the line.

    An entry with ``earliest == place`` is a place of separation. The force on elements in contact is zero at `place`
    now. At earlier instants since the jump, this force may have been zero anywhere between `place` and `farthest`.
    If the search begins out of contact, the highest point of the line is an entry, too, although the force is not zero
    there. Every other entry is a run of cells from `earliest` to `place`. The force is positive there now, but elements
    may have separated there at times when the lift was below `barrier`. Only the first `count[0]` entries are used.
    """

    earliest: FloatArray
    place: FloatArray
    farthest: FloatArray
    barrier: FloatArray
    count: IntArray  # type: ignore[assignment]
    bounds: PathBounds


@jit_inline_uncounted
def write_bounds(history: History, first: Patches, deborah: float, bounds: PathBounds) -> None:
    """Write the bounds over all windows that end at the last instant of a history."""
    last = history.count - 1
    time, depth, rate = history.time[last], history.depth[last], history.rate[last]
    left, back = np.exp(-time), last
    shallowest, deepest, least_lift = depth, depth, depth + rate
    most, least = max(-rate, -history.rate[0] * left, 0.0), min(-rate, -history.rate[0] * left, 0.0)
    if first.deborah > deborah:  # elements that separated before the jump have the drift u (1 - D / D_1)
        most = max(most, min(depth, first.depth * left) * (1 - deborah / first.deborah))
    for k in range(WINDOWS):
        since = time - WINDOW / deborah * 2.0**k
        while back > 0 and history.time[back] > since:
            back -= 1
            then, drift = history.depth[back], -history.rate[back]
            shallowest, deepest = min(shallowest, then), max(deepest, then)
            least_lift = min(least_lift, then - drift)
            if drift > most or drift < least:
                drift *= np.exp(history.time[back] - time)
                most, least = max(most, drift), min(least, drift)
        bounds.spread[k], bounds.least_lift[k] = deepest - shallowest, least_lift
        bounds.most_drift[k], bounds.least_drift[k] = most, least


@jit_inline_uncounted
def window(distance: float) -> int:
    """Return the index of the shortest window with more than `distance` cells of travel, or the last index if none."""
    return min(max(frexp(distance / WINDOW)[1], 0), WINDOWS - 1)


@jit_inline_uncounted
def _depth_at(history: History, t: float) -> tuple[float, float, float]:
    """Return depth, rate and second derivative at time t, by cubic Hermite interpolation of the history.

    At the last instant, the second derivative is set to 0.
    """
    last = history.count - 1
    if last <= 0 or t >= history.time[last]:
        return history.depth[last], history.rate[last], 0.0
    low = last_until(history.time, t, last)
    high = low + 1
    step = history.time[high] - history.time[low]
    y = (t - history.time[low]) / step
    rise = history.depth[high] - history.depth[low]
    enter, leave = history.rate[low] * step, history.rate[high] * step
    c2, c3 = 3 * rise - 2 * enter - leave, enter + leave - 2 * rise
    return (
        history.depth[low] + y * (enter + y * (c2 + y * c3)),
        (enter + y * (2 * c2 + 3 * y * c3)) / step,
        (2 * c2 + 6 * y * c3) / (step * step),
    )


@jit_inline_uncounted
def _by_last_depth(history: History, t: float) -> float:
    """Return the derivative of the depth at time t with respect to the last depth of the history."""
    last = history.count - 1
    if last <= 0 or t >= history.time[last]:
        return 1.0
    if t <= history.time[last - 1]:
        return 0.0
    step = history.time[last] - history.time[last - 1]
    y = (t - history.time[last - 1]) / step
    return float(y * y * (3 - 2 * y + history.stiff * step * (y - 1)))


@jit_inline_uncounted
def _in_period(now: Instant, s: float) -> float:
    """Return the place in the first period of the line that corresponds to the place s."""
    track = now.track
    return float(s - np.floor((s - track.origin) / track.cells) * track.cells)


@jit_inline_uncounted
def _separated_near(now: Instant, x: float, place: float, farthest: float) -> tuple[float, float, float]:
    """Return the displacement u, du/dx and du/d(depth) of an element at x that separated near a place.

    The search for the place of separation starts at `place`. The force has not vanished anywhere beyond `farthest`
    since the jump. If the search finds no place of separation, the returned displacement is -1.
    """
    deborah = now.deborah
    first = x - deborah * now.time
    low, high, s = first, min(x, farthest), max(place, first)
    for _ in range(MOST_ITERATIONS):
        if s > high:
            break
        since = (x - s) / deborah
        d, rate, change = _depth_at(now.history, max(now.time - since, 0.0))
        h, slope, curvature = height_at(now.track, s if s > 0 else _in_period(now, s))
        force = d + h + rate + deborah * slope
        falls = (rate + change) / deborah + slope + deborah * curvature
        step = -force / falls if falls < 0 else STRIDE if force > 0 else -STRIDE
        if abs(step) < AT_EDGE:
            if s + step > x:  # the element at x has not reached the place of zero force yet
                break
            fade = np.exp(-since)
            u = (d + h + 0.5 * force * step / deborah) * fade
            return u, -(u + rate * fade) / deborah, _by_last_depth(now.history, now.time - since) * fade
        if force > 0:
            low = s
        elif s > first:
            high = s
        else:
            break
        s += min(max(step, -STRIDE), STRIDE)
        if not low < s < high:
            s = 0.5 * (low + high)
        if high - low < AT_EDGE:
            break
    return -1.0, 0.0, 0.0


@jit_uncounted
def _separated_within(now: Instant, x: float, low: float, high: float) -> tuple[float, float, float]:
    """Return the results of `_separated_near` for an element at x that separated in the cells from `low` to `high`.

    The search starts at the node between `low` and `high` for which the displacement is largest.
    """
    most, place, s = 0.0, x, min(high, np.ceil(x) - 1)
    low = max(low, x - now.deborah * now.time)
    while s >= low:
        since = (x - s) / now.deborah
        height = now.track.height[int(s if s >= 0 else _in_period(now, s))]
        u = (_depth_at(now.history, now.time - since)[0] + height) * np.exp(-since)
        if u > most:
            most, place = u, s
        s -= 1
    return _separated_near(now, x, place, place + 1) if most > 0 else (-1.0, 0.0, 0.0)


@jit_inline_uncounted
def _from_separation(now: Instant, recovery: FreeRecovery, k: int, x: float) -> tuple[float, float, float]:
    """Return the displacement u, du/dx and du/d(depth) of an element at x that separated at entry k of `recovery`.

    If the element did not separate there, the returned displacement is -1.
    """
    if recovery.earliest[k] < recovery.place[k]:
        if recovery.bounds.least_lift[window(x - recovery.earliest[k])] > recovery.barrier[k]:
            return -1.0, 0.0, 0.0
        return _separated_within(now, x, recovery.earliest[k], recovery.place[k])
    return _separated_near(now, x, recovery.place[k], recovery.farthest[k])


@jit_inline_uncounted
def from_before(now: Instant, x: float, least: float) -> tuple[float, float]:
    """Return the displacement u and du/dx at x of elements that separated before the jump or at the jump.

    If the displacement is at most `least`, the two returned values may be 0.
    """
    first, s = now.first, _in_period(now, x - now.deborah * now.time)
    low = last_until(first.start, s, first.start.size)
    if s <= first.end[low]:
        h, slope, _ = height_at(now.track, s)
        return (first.depth + h) * now.left, slope * now.left
    u = first.pressed[low] * now.left
    if u <= least:
        return 0.0, 0.0
    u *= np.exp(-(s - first.end[low]) / first.deborah)
    return u, -u / first.deborah


@jit_inline_uncounted
def displacement_at(now: Instant, recovery: FreeRecovery, x: float) -> tuple[float, float, float]:
    """Return the displacement u of free elements at x, and the derivatives of u with respect to x and to the depth."""
    u, slope, by_depth = 0.0, 0.0, 0.0
    for k in range(recovery.count[0]):
        value, value_slope, value_by_depth = _from_separation(now, recovery, k, x)
        if value > u:
            u, slope, by_depth = value, value_slope, value_by_depth
    if now.first.depth * now.left > u:  # at the jump no displacement exceeded the depth of the highest point
        value, value_slope = from_before(now, x, u)
        if value > u:
            u, slope, by_depth = value, value_slope, 0.0
    return u, slope, by_depth


@jit_inline_uncounted
def gap_at(now: Instant, recovery: FreeRecovery, x: float) -> tuple[float, float, float, float, float]:
    """Return the gap at x, its slope and curvature along the line, and its derivatives with respect to depth and time.

    The gap is depth + h - u, positive where the line is above free elements with the displacement u.
    """
    u, u_slope, by_depth = displacement_at(now, recovery, x)
    last = now.history.count - 1
    h, h_slope, h_bend = height_at(now.track, x)
    bend = h_bend - (u_slope * u_slope / u if u > 0 else 0.0)  # u is taken as an exponential function along the line
    # at a fixed place, du/dt = -u - D u'
    opening = now.history.rate[last] + u + now.deborah * u_slope
    return now.history.depth[last] + h - u, h_slope - u_slope, bend, 1 - by_depth, opening


@jit_inline_uncounted
def contact_begin(
    now: Instant, recovery: FreeRecovery, low: float, high: float, x: float
) -> tuple[float, float, float, float]:
    """Return the place where the line rises above free elements, with the derivatives of the gap at this place.

    The gap is differentiated with respect to place, depth and time. If the first guess x is not between `low` and
    `high`, the search starts in the middle.
    """
    slope, by_depth, opening = 1.0, 1.0, 0.0
    for _ in range(MOST_ITERATIONS):
        if not low < x < high:
            x = 0.5 * (low + high)
        gap, slope, bend, by_depth, opening = gap_at(now, recovery, x)
        if gap > 0:
            high = x
        else:
            low = x
        step = -gap / slope if slope > 0 else 2.0
        if abs(step) < AT_EDGE or high - low < ROUNDING:
            if 2 * abs(bend * step) < slope:
                step /= 1 + 0.5 * bend * step / slope
                slope += bend * step
            return min(max(x + step, low), high), slope, by_depth, opening
        x += step
    return x, slope, by_depth, opening


@jit_uncounted
def nearest_approach(now: Instant, recovery: FreeRecovery, low: float, high: float) -> tuple[float, float]:
    """Return the place between `low` and `high` where the line is nearest to free elements, and the gap there.

    The search stops at the first place where the line is above the free elements. If `low` and `high` are closer than
    `AT_EDGE`, `high` and a gap of -1 are returned without a search.
    """
    x, gap = high, -1.0
    while gap <= 0 and high - low > AT_EDGE:
        x = 0.5 * (low + high)
        gap, slope, _, _, _ = gap_at(now, recovery, x)
        if slope > 0:
            low = x
        else:
            high = x
    return x, gap


@jit_inline_uncounted
def prune(now: Instant, recovery: FreeRecovery, x: float, pressed: float, deepest: float) -> None:
    """Delete the entries of `recovery` that cannot matter at or beyond x, a place in contact.

    An entry is deleted if the elements that separated there certainly have smaller displacements at x than `pressed`,
    the displacement that the line imposes at x. `deepest` is the largest depth since the jump.
    """
    kept = 0
    for k in range(recovery.count[0]):
        place, farthest = recovery.place[k], recovery.farthest[k]
        u = _from_separation(now, recovery, k, x)[0]
        # elements that are now beyond x may have separated at `place`
        if u < 0 and x - now.deborah * now.time < farthest:
            height = height_at(now.track, _in_period(now, place))[0]
            u = (deepest + height) * np.exp(-max(x - farthest, 0.0) / now.deborah)
        if u + 2 * recovery.bounds.spread[window(2 * (x - place))] >= pressed:
            recovery.earliest[kept], recovery.place[kept] = recovery.earliest[k], place
            recovery.farthest[kept], recovery.barrier[kept] = farthest, recovery.barrier[k]
            kept += 1
    recovery.count[0] = kept
