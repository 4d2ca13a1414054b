"""Where contact gives way under a positive force: elements in flight overtake a patch, pressed further than by it.

Along the line D u' + u of elements in flight is what the rate of the depth took when they left, faded since. While it
is below w + D h' the gap of line and wake cannot close. So contact is lost only where w + D h' is below the largest of
those, the `push`: to elements that come from before the patch, were free in it at the jump, or left it since.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.physics.compiling import inlined
from mdr_dask.physics.transients.free_flight import Instant, Wakes, left_before, wake_at
from mdr_dask.physics.transients.patches import height_at
from mdr_dask.physics.transients.recent import over

CLOSE = 1e-9  # of a cell: where contact is lost


class Motion(NamedTuple):
    """How the depth has moved until a moment.

    Parameters
    ----------
    rise : float
        Most by which the lift has risen until now, by time.
    overflown : bool
        Whether elements in this turn may have come over the highest point, pressed further than it pressed then.
    """

    rise: float
    overflown: bool


@inlined
def motion_at(now: Instant) -> Motion:
    """Return how the depth has moved until a moment."""
    history, deborah, last = now.history, now.deborah, now.history.count - 1
    depth, rate = history.depth[last], history.rate[last]
    rise, carried, overflown, before = 0.0, history.depth[0], False, 0.0
    for moment in range(last):
        time, then = history.time[moment], history.depth[moment]
        rise = max(rise, (depth + rate - then - history.rate[moment]) / (now.time - time))
        carried, before = carried * np.exp(before - time), time
        overflown |= carried > then and deborah * (now.time - time) < now.track.cells
        carried = max(carried, then)
    overflown |= carried * np.exp(before - now.time) > depth
    if last > 0:
        step = history.time[last] - history.time[last - 1]
        fallen = (history.depth[last - 1] - depth) / step
        rise = max(rise, rate + (6 * fallen + 2 * history.rate[last - 1] + 4 * rate) / step)
    return Motion(rise, overflown)


@inlined
def may_have_left(line: tuple[float, float, float, float], rise: float, deborah: float) -> bool:
    """Return whether elements can have left a cell where the force is positive now: it falls slower than the lift rises."""
    _, c1, c2, c3 = line
    enter, bend, turn = c1 + 2 * deborah * c2, c2 + 3 * deborah * c3, 3 * c3
    return bool(-deborah * max(enter, enter + bend, enter + 2 * bend + turn) < rise)


@inlined
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
        fade = np.exp((held - x) / max(now.deborah, now.first.deborah))
        push = wakes.recent.push[over(x - wakes.earliest[0]) if wakes.count > 0 else 0]
        if w >= pressed * fade + push * (1 - fade):
            return left_before(now, x)[0] if x - now.deborah * now.time > held else 0.0
    return wake_at(now, wakes, x)[0]


@inlined
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
