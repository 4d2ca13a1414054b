"""The displacement of elements in free flight after a jump.

An element at x came along the path x' = x - deborah (t - t'), and its displacement is the largest one it was pressed
to, faded since:

    u(x, t) = max over t' <= t of (d(t') + h(x')) exp(-(t - t'))

so that only the depth d(t) has a history. Free flights are never followed: the place where an element left is the one
where this expression is stationary.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline, last_until
from mdr_dask.physics.transients.patches import History, Patches, Track, height_at, patch_before
from mdr_dask.physics.transients.recent import Recent, over

ROOT_STEPS = 60
NEAR = 0.02  # of a cell: a last Newton step whose gain is added, for its cube is what is left
STRIDE = 2.0  # cells: the longest step on the way to a place of leaving
MET = 1e-3  # of a cell: a last step by slope and curvature, for its cube is far below what wakes are known to
FARTHEST = 200  # cells back in which contact may have been left are looked at
KEPT = 64.0  # cells more than twice the way, over which the depth may change what is kept
CREST = 1e-3  # of a cell: where a line that comes near to a wake inside of a cell is nearest
FORESEEN, FORESEEN_STEPS = 1e-2, 5  # of a cell: the last step to a place that is only foreseen


class Instant(NamedTuple):
    """A moment after the jump: the line, the state before the jump, the depths so far, time, and Deborah number.

    `left` is the part exp(-time) that is left of a displacement at the jump.
    """

    track: Track
    first: Patches
    history: History
    time: float
    deborah: float
    left: float


class Wakes(NamedTuple):
    """Places where contact is left now and the farthest where it was, ``count`` of them.

    Where `earliest` is before a place, contact is not left now. It may have been left in the cells between, when the
    lift was below their `barrier`.
    """

    earliest: FloatArray
    places: FloatArray
    farthest: FloatArray
    barrier: FloatArray
    recent: Recent
    count: int  # type: ignore[assignment]


@jit_inline
def _depth_at(history: History, t: float) -> tuple[float, float, float]:
    """Return depth, rate and its derivative at time t by the cubic through values and rates."""
    last = history.count - 1
    if last <= 0 or t >= history.time[last]:
        return history.depth[last], history.rate[last], 0.0
    low, high, back = last - 1, last, 1
    while history.time[low] > t and low > 0:
        high, low, back = low, max(low - back, 0), 2 * back
    low = last_until(history.time, t, low, high)
    high = low + 1
    step = history.time[high] - history.time[low]
    pace = 1 / step
    y = (t - history.time[low]) * pace
    rise = history.depth[high] - history.depth[low]
    enter, leave = history.rate[low] * step, history.rate[high] * step
    c2, c3 = 3 * rise - 2 * enter - leave, enter + leave - 2 * rise
    return (
        history.depth[low] + y * (enter + y * (c2 + y * c3)),
        (enter + y * (2 * c2 + 3 * y * c3)) * pace,
        (2 * c2 + 6 * y * c3) * pace * pace,
    )


@jit_inline
def _follows(history: History, t: float) -> float:
    """Return the derivative of the depth at time t by the last depth."""
    last = history.count - 1
    if last <= 0 or t >= history.time[last]:
        return 1.0
    if t <= history.time[last - 1]:
        return 0.0
    step = history.time[last] - history.time[last - 1]
    y = (t - history.time[last - 1]) / step
    return float(y * y * (3 - 2 * y + history.stiff * step * (y - 1)))


@jit_inline
def _in_turn(now: Instant, s: float) -> float:
    """Return the place in the turn that a line is of a place in any turn."""
    track = now.track
    return float(s - np.floor((s - track.origin) / track.cells) * track.cells)


@jit_inline
def _left_from(now: Instant, x: float, place: float, farthest: float) -> tuple[float, float, float]:
    """Return displacement at x of an element that left near `place` after the jump, its slope, its derivative by depth.

    An element leaves where its load vanished then, between the place where it vanishes now and the farthest one so far.
    The displacement is stationary in that place, and few steps of Newton suffice. It is -1 where no element at x left
    there.
    """
    deborah, pace = now.deborah, 1 / now.deborah
    first = x - deborah * now.time
    low, high, s = first, min(x, farthest), max(place, first)
    for _ in range(ROOT_STEPS):
        if s > high:
            break
        since = (x - s) * pace
        d, rate, change = _depth_at(now.history, max(now.time - since, 0.0))
        h, slope, curvature = height_at(now.track, s if s > 0 else _in_turn(now, s))
        force = d + h + rate + deborah * slope
        falls = (rate + change) * pace + slope + deborah * curvature
        step = -force / falls if falls < 0 else STRIDE if force > 0 else -STRIDE
        if abs(step) < NEAR:
            if s + step > x:  # it is still to come there
                break
            fade = np.exp(-since)
            u = (d + h + 0.5 * force * step * pace) * fade
            return u, -(u + rate * fade) * pace, _follows(now.history, now.time - since) * fade
        if force > 0:
            low = s
        elif s > first:
            high = s
        else:
            break
        s += min(max(step, -STRIDE), STRIDE)
        if not low < s < high:
            s = 0.5 * (low + high)
        if high - low < NEAR:
            break
    return -1.0, 0.0, 0.0


@jit
def _left_within(now: Instant, x: float, low: float, high: float) -> tuple[float, float, float]:
    """Return what `_left_from` does, of an element that left somewhere in a stretch of cells: after a look at nodes."""
    most, place, s = 0.0, x, min(high, np.ceil(x) - 1)
    low = max(low, x - now.deborah * now.time, s - FARTHEST)
    while s >= low:
        since = (x - s) / now.deborah
        height = now.track.height[int(s if s >= 0 else _in_turn(now, s))]
        u = (_depth_at(now.history, now.time - since)[0] + height) * np.exp(-since)
        if u > most:
            most, place = u, s
        s -= 1
    return _left_from(now, x, place, place + 1) if most > 0 else (-1.0, 0.0, 0.0)


@jit_inline
def left(now: Instant, wakes: Wakes, k: int, x: float) -> tuple[float, float, float]:
    """Return what `_left_from` does, of the k-th place."""
    if wakes.earliest[k] < wakes.places[k]:
        if wakes.recent.lowest[over(x - wakes.earliest[k])] > wakes.barrier[k]:
            return -1.0, 0.0, 0.0
        return _left_within(now, x, wakes.earliest[k], wakes.places[k])
    return _left_from(now, x, wakes.places[k], wakes.farthest[k])


@jit_inline
def left_before(now: Instant, x: float, least: float) -> tuple[float, float]:
    """Return what is left at x of the state before the jump, and its slope along x; 0 where that is `least` at most."""
    first, s = now.first, _in_turn(now, x - now.deborah * now.time)
    low = patch_before(first, s)
    if s <= first.end[low]:
        h, slope, _ = height_at(now.track, s)
        return (first.depth + h) * now.left, slope * now.left
    u = first.pressed[low] * now.left
    if u <= least:
        return 0.0, 0.0
    u *= np.exp(-(s - first.end[low]) / first.deborah)
    return u, -u / first.deborah


@jit_inline
def wake_at(now: Instant, wakes: Wakes, x: float) -> tuple[float, float, float]:
    """Return the displacement at x of elements in free flight, its slope along x, and its derivative by the depth."""
    u, slope, gain = 0.0, 0.0, 0.0
    for k in range(wakes.count):
        value, value_slope, value_gain = left(now, wakes, k, x)
        if value > u:
            u, slope, gain = value, value_slope, value_gain
    if now.first.depth * now.left > u:  # heights count from the highest point
        value, value_slope = left_before(now, x, u)
        if value > u:
            u, slope, gain = value, value_slope, 0.0
    return u, slope, gain


@jit_inline
def foreseen(
    line: tuple[float, float, float, float], depth: float, wake: tuple[float, float], low: float, high: float
) -> float:
    """Return where in a cell the line rises through a wake that fades as it does at `high`, where it is below the line.

    Parameters
    ----------
    line : tuple of float
        Coefficients of the height in the cell.
    depth : float
    wake : tuple of float
        Displacement at `high`, and its slope along the line.
    low, high : float
        Places in the cell.
    """
    c0, c1, c2, c3 = line
    u, slope = wake
    bend, y = slope * slope / u if u > 0 else 0.0, high
    for _ in range(FORESEEN_STEPS):
        free = u + (y - high) * (slope + (y - high) * 0.5 * bend)
        rise = c1 + y * (2 * c2 + y * 3 * c3) - slope - (y - high) * bend
        if rise <= 0:
            break
        step = (free - depth - c0 - y * (c1 + y * (c2 + y * c3))) / rise
        y = min(max(y + step, low), high)
        if abs(step) < FORESEEN:
            break
    return y


@jit_inline
def gap_at(now: Instant, x: float, wake: tuple[float, float, float]) -> tuple[float, float, float, float, float]:
    """Return how far the line is above a wake at x, its slope and curvature, its derivative by the depth, and its rate.

    What is in flight fades and moves on: its rate is -u - deborah u'. It bends as what fades does.
    """
    u, u_slope, gain = wake
    last = now.history.count - 1
    h, h_slope, h_bend = height_at(now.track, x)
    bend = h_bend - (u_slope * u_slope / u if u > 0 else 0.0)
    opening = now.history.rate[last] + u + now.deborah * u_slope
    return now.history.depth[last] + h - u, h_slope - u_slope, bend, 1 - gain, opening


@jit_inline
def meeting(now: Instant, wakes: Wakes, low: float, high: float, x: float) -> tuple[float, float, float, float]:
    """Return where the line rises through the wake, the slopes of their gap by place and depth, and its rate there."""
    slope, gain, opening = 1.0, 1.0, 0.0
    for _ in range(ROOT_STEPS):
        if not low < x < high:
            x = 0.5 * (low + high)
        gap, slope, bend, gain, opening = gap_at(now, x, wake_at(now, wakes, x))
        if gap > 0:
            high = x
        else:
            low = x
        step = -gap / slope if slope > 0 else 2.0
        if abs(step) < MET or high - low < 1e-9:
            if 2 * abs(bend * step) < slope:
                step /= 1 + 0.5 * bend * step / slope
                slope += bend * step
            return min(max(x + step, low), high), slope, gain, opening
        x += step
    return x, slope, gain, opening


@jit
def crest(now: Instant, wakes: Wakes, low: float, high: float) -> tuple[float, float]:
    """Return where the line comes nearest to the wake or above it between two places, falling back at `high`."""
    depth, x, gap = now.history.depth[now.history.count - 1], high, -1.0
    while gap <= 0 and high - low > CREST:
        x = 0.5 * (low + high)
        u, u_slope, _ = wake_at(now, wakes, x)
        h, h_slope, _ = height_at(now.track, x)
        gap = depth + h - u
        if h_slope > u_slope:
            low = x
        else:
            high = x
    return x, gap


@jit_inline
def worth_keeping(now: Instant, wakes: Wakes, x: float, pressed: float, deepest: float) -> int:
    """Keep the places whose wake can still come out above that of an element pressed to `pressed` at x; count them."""
    kept = 0
    for k in range(wakes.count):
        place, farthest = wakes.places[k], wakes.farthest[k]
        u = left(now, wakes, k, x)[0]
        if u < 0 and x - now.deborah * now.time < farthest:  # none at x left there; farther ones may have
            u = (deepest + height_at(now.track, _in_turn(now, place))[0]) * np.exp(
                -max(x - farthest, 0.0) / now.deborah
            )
        if u + 2 * wakes.recent.spread[over(2 * (x - place) + KEPT)] >= pressed:
            wakes.earliest[kept], wakes.places[kept], wakes.farthest[kept] = wakes.earliest[k], place, farthest
            wakes.barrier[kept] = wakes.barrier[k]
            kept += 1
    return kept
