"""Where contact gives way under a positive force: elements in flight overtake a patch, pressed further than by it.

Along the line D u' + u of elements in flight is what the rate of the depth took when they left, faded since. While it
is below w + D h' the gap of line and wake cannot close. So contact is lost only where w + D h' is below the largest of
those, the `push`: to elements that come from before the patch, were free in it at the jump, or left it since.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.surfaces.cubic_line import cubic
from mdr_dask.physics.transients.free_flight import Instant, Wakes, left_before, wake_at, worth_keeping
from mdr_dask.physics.transients.patches import Track, height_at
from mdr_dask.physics.transients.recent import over

CLOSE = 1e-9  # of a cell: where contact is lost


class Motion(NamedTuple):
    """How the depth has moved until a moment.

    Parameters
    ----------
    rise, fall : float
        Most by which the lift has risen until now, and by which it has fallen, by time.
    shallowest, deepest, highest : float
        Least depth, largest depth and largest lift so far.
    overflown : bool
        Whether elements from before the patch of the highest point may have come over it.
    """

    rise: float
    fall: float
    shallowest: float
    deepest: float
    highest: float
    overflown: bool


@jit_inline
def motion_at(now: Instant, second: float) -> Motion:
    """Return how the depth has moved, with the highest point outside of the patch of the highest of all."""
    history, deborah, last = now.history, now.deborah, now.history.count - 1
    depth, rate = history.depth[last], history.rate[last]
    lift, rise, fall, overflown = depth + rate, 0.0, 0.0, False
    shallowest, deepest, highest = depth, depth, lift
    carried, before, lift_before = -np.inf, 0.0, history.depth[0] + history.rate[0]
    for moment in range(last + 1):
        time, then = history.time[moment], history.depth[moment]
        here = then + history.rate[moment]
        shallowest, deepest, highest = min(shallowest, then), max(deepest, then), max(highest, here)
        if moment < last:
            rise = max(rise, (lift - here) / (now.time - time))
        if moment > 0:
            fall = max(fall, (lift_before - here) / (time - before))
            carried *= np.exp(before - time)
        overflown |= carried > then and deborah * (now.time - time) < now.track.cells
        carried, before, lift_before = max(carried, then + second), time, here
    if last > 0:
        step = history.time[last] - history.time[last - 1]
        fallen = (history.depth[last - 1] - depth) / step
        rise = max(rise, rate + (6 * fallen + 2 * history.rate[last - 1] + 4 * rate) / step)
    return Motion(rise, fall, shallowest, deepest, highest, overflown)


@jit_inline
def _slopes(track: Track, deborah: float, i: int) -> tuple[float, float, float]:
    """Return slopes that bound that of the force in a cell: at its start, the control point between, at its end."""
    _, c1, c2, c3 = cubic(track.height, track.enter, track.leave, i)
    enter, bend, turn = c1 + 2 * deborah * c2, c2 + 3 * deborah * c3, 3 * c3
    return enter, enter + bend, enter + 2 * bend + turn


@jit_inline
def may_have_left(track: Track, motion: Motion, deborah: float, i: int) -> bool:
    """Return whether elements can have left in cell i or where it begins, where the force is positive now.

    On their way the force on them has fallen through zero and risen again.
    """
    start, middle, end = _slopes(track, deborah, i)
    if deborah * max(start, middle, end) <= -motion.rise:
        return False
    least = min(start, middle, end)
    if i > 0:
        least = min(least, _slopes(track, deborah, i - 1)[2])
    return bool(deborah * least < motion.fall)


@jit_inline
def overtaking(now: Instant, wakes: Wakes, held: float, x: float) -> float:
    """Return a displacement that elements in flight have at x in a patch, or 0 if the line surely presses further.

    Parameters
    ----------
    now, wakes : Instant, Wakes
    held : float
        A place in the patch up to which contact is known to hold, and from which on none has left.
    x : float
        At `held` or beyond.
    """
    if x > held:
        depth = now.history.depth[now.history.count - 1]
        w, pressed = depth + height_at(now.track, x)[0], depth + height_at(now.track, held)[0]
        push = wakes.recent.push[over(x - wakes.earliest[0]) if wakes.count > 0 else 0]
        slowest = max(now.deborah, now.first.deborah)
        if w >= max(pressed, push) or w >= push + (pressed - push) * np.exp((held - x) / slowest):
            return left_before(now, x, w)[0] if x - now.deborah * now.time > held else 0.0
    return wake_at(now, wakes, x)[0]


@jit
def loss(now: Instant, wakes: Wakes, low: float, high: float) -> float:
    """Return where contact is lost between low and high, by bisection."""
    depth = now.history.depth[now.history.count - 1]
    while high - low > CLOSE:
        x = 0.5 * (low + high)
        if depth + height_at(now.track, x)[0] < wake_at(now, wakes, x)[0]:
            high = x
        else:
            low = x
    return high


@jit_inline
def turned(now: Instant, wakes: Wakes, motion: Motion) -> int:
    """Shift places by a turn, to before the highest point, and keep those worth it; count them."""
    for k in range(wakes.count):
        wakes.earliest[k] -= now.track.cells
        wakes.places[k] -= now.track.cells
        wakes.farthest[k] -= now.track.cells
    return worth_keeping(now, wakes, now.track.origin, now.history.depth[now.history.count - 1], motion.deepest)
