"""Where contact gives way under a positive force: elements in flight overtake a patch, pressed further than by it.

Along the line D u' + u of elements in flight is what the rate of the depth took when they left, faded since. While it
is below w + D h' the gap of line and wake cannot close. So contact is lost only where w + D h' is below the largest of
those, the `push`, and only to elements that come from before the patch, were free in it at the jump, or left it since.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.physics.compiling import inlined
from mdr_dask.physics.transients.free_flight import Instant, Wakes, left_before, left_from, pressed_then, wake_at
from mdr_dask.physics.transients.patches import height_at

CLOSE = 1e-9  # of a cell: where contact is lost
FARTHEST = 200  # cells back in which places of leaving are looked for


class Grip(NamedTuple):
    """What keeps contact at a moment.

    Parameters
    ----------
    firm : float
        Cells whose barrier is below do not lose contact, and no element has left them since the jump.
    lowest : float
        Least lift so far.
    push : float
        Most that D u' + u is in flight.
    rise : float
        Most by which the lift has risen until now, by time.
    slowest : float
        Deborah number by which elements in flight fade at least.
    """

    firm: float
    lowest: float
    push: float
    rise: float
    slowest: float


class Leavings(NamedTuple):
    """The cells of a patch that elements may have left under a force that is positive now, from the first to the last.

    None where the end is before the start.
    """

    start: float
    end: float


@inlined
def grip_at(now: Instant) -> Grip:
    """Return what keeps contact at a moment."""
    history, deborah, last = now.history, now.deborah, now.history.count - 1
    depth, rate = history.depth[last], history.rate[last]
    lowest, push, rise = depth + rate, max(-rate, 0.0), 0.0
    for moment in range(last):
        since = now.time - history.time[moment]
        lift = history.depth[moment] + history.rate[moment]
        lowest, rise = min(lowest, lift), max(rise, (depth + rate - lift) / since)
        push = max(push, -history.rate[moment] * np.exp(-since))
    if last > 0:
        step = history.time[last] - history.time[last - 1]
        fallen = (history.depth[last - 1] - depth) / step
        rise = max(rise, rate + (6 * fallen + 2 * history.rate[last - 1] + 4 * rate) / step)
    if now.first.deborah > deborah:
        push = max(push, min(depth, now.first.depth * now.left) * (1 - deborah / now.first.deborah))
    return Grip(min(depth - push, lowest), lowest, push, rise, max(deborah, now.first.deborah))


@inlined
def with_cell(leavings: Leavings, grip: Grip, line: tuple[float, float, float, float], deborah: float, cell: float) -> Leavings:
    """Return the leavings with a cell that is not firm, unless its force falls faster than the lift can have risen."""
    _, c1, c2, c3 = line
    enter, bend, turn = c1 + 2 * deborah * c2, c2 + 3 * deborah * c3, 3 * c3
    least = -max(enter, enter + bend, enter + 2 * bend + turn)
    if least * deborah >= grip.rise:
        return leavings
    return Leavings(leavings.start if leavings.start < leavings.end else cell, cell + 1)


@inlined
def _left_within(now: Instant, leavings: Leavings, x: float) -> tuple[float, float]:
    """Return the displacement at x of elements that left the patch since the jump, and about where they left."""
    high = min(leavings.end, np.ceil(x) - 1)
    low = max(leavings.start, x - now.deborah * now.time, high - FARTHEST)
    u, place, s = 0.0, x, high
    while s >= low:
        value = pressed_then(now, x, s)
        if value > u:
            u, place = value, s
        s -= 1
    return max(u, left_from(now, x, place, min(place + 1, x))[0]), place


@inlined
def overtaking(
    now: Instant, wakes: Wakes, grip: Grip, begin: float, leavings: Leavings, x: float
) -> tuple[float, float]:
    """Return a displacement that elements in flight have at x in a patch, and where they left if that was in it.

    The displacement is 0 where they are surely pressed less than the line presses.
    """
    depth = now.history.depth[now.history.count - 1]
    w, u, place = depth + height_at(now.track, x)[0], 0.0, -1.0
    fade = np.exp((begin - x) / grip.slowest)
    if w < (depth + height_at(now.track, begin)[0]) * fade + grip.push * (1 - fade):
        u = wake_at(now, wakes, x)[0]
    elif x - now.deborah * now.time > begin:
        u = left_before(now, x)[0]
    if leavings.start < leavings.end:
        end = min(leavings.end, x)
        fade = np.exp((end - x) / grip.slowest)
        if w <= (depth + height_at(now.track, end)[0]) * fade + grip.push * (1 - fade):
            value, s = _left_within(now, leavings, x)
            if value > u:
                u, place = value, s
    return u, place


@inlined
def loss(
    now: Instant, wakes: Wakes, grip: Grip, begin: float, leavings: Leavings, low: float, high: float
) -> tuple[float, float]:
    """Return where contact is lost between low and high, by bisection, and the place of leaving of who comes then."""
    depth, place = now.history.depth[now.history.count - 1], -1.0
    while high - low > CLOSE:
        x = 0.5 * (low + high)
        u, left = overtaking(now, wakes, grip, begin, leavings, x)
        if depth + height_at(now.track, x)[0] < u:
            high, place = x, left
        else:
            low = x
    return high, place
