"""What the depth did while the line went its last cells: bounds of what elements in flight can have."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit_inline
from mdr_dask.physics.transients.patches import History, Patches

WINDOW = 8.0  # cells: the shortest way
WINDOWS = 16  # each twice as long as the one before
LONGER = np.frexp(np.arange(1024))[1]  # how often a way is doubled to pass so many of the shortest


class Recent(NamedTuple):
    """Bounds over the time in which the line went `WINDOW` cells, twice that, four times that, and so on.

    Parameters
    ----------
    spread : array, shape (WINDOWS,)
        Range of the depth.
    apart : array, shape (WINDOWS,)
        Most by which the gap of the line and elements in flight has opened at one place.
    lowest : array, shape (WINDOWS,)
        Least depth and rate together, the lift.
    push : array, shape (WINDOWS,)
        Most that D u' + u is of elements that left meanwhile, or have been in flight since the jump.
    pull : array, shape (WINDOWS,)
        Least that it is, or 0, where D is the lesser of the Deborah numbers before and after the jump.
    """

    spread: FloatArray
    apart: FloatArray
    lowest: FloatArray
    push: FloatArray
    pull: FloatArray


@jit_inline
def write_recent(history: History, first: Patches, deborah: float, recent: Recent) -> None:
    """Write the bounds at the last moment of a history."""
    last = history.count - 1
    time, depth, rate = history.time[last], history.depth[last], history.rate[last]
    left, back = np.exp(-time), last
    lowest, highest, least, push = depth, depth, depth + rate, max(-rate, -history.rate[0] * left, 0.0)
    pull = min(-rate, -history.rate[0] * left, 0.0)
    if first.deborah > deborah:  # what was free at the jump fades more slowly along the line
        push = max(push, min(depth, first.depth * left) * (1 - deborah / first.deborah))
    # faster elements that were free at the jump come to a place pressed further, half of a way long at most
    rise, gains = 0.0, first.depth * (deborah / first.deborah - 1)
    for k in range(WINDOWS):
        way = WINDOW / deborah * 2.0**k
        since = time - way
        while back > 0 and history.time[back] > since:
            back -= 1
            then, falls = history.depth[back], -history.rate[back]
            lowest, highest, least = min(lowest, then), max(highest, then), min(least, then - falls)
            rise = max(rise, highest - then)
            if falls > push or falls < pull:
                falls *= np.exp(history.time[back] - time)
                push, pull = max(push, falls), min(pull, falls)
        spread = highest - lowest
        recent.spread[k], recent.lowest[k], recent.push[k], recent.pull[k] = spread, least, push, pull
        recent.apart[k] = highest - depth + rise
        if gains > 0 and since < 0.5 * way:
            recent.apart[k] += gains * (np.exp(-max(since, 0.0)) - np.exp(-min(time, 0.5 * way)))


@jit_inline
def over(distance: float) -> int:
    """Return which of the bounds holds over a distance."""
    ways = max(distance * (1 / WINDOW), 0.0)
    return int(LONGER[np.uintp(ways)]) if ways < LONGER.size else WINDOWS - 1
