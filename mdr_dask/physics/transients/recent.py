"""What the depth did while the line went its last cells: bounds of what elements in flight can have."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.compiling import inlined
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
    lowest : array, shape (WINDOWS,)
        Least depth and rate together, the lift.
    push : array, shape (WINDOWS,)
        Most that D u' + u is of elements that left meanwhile, or have been in flight since the jump.
    pull : array, shape (WINDOWS,)
        Least that it is, or 0, where D is the lesser of the Deborah numbers before and after the jump.
    """

    spread: FloatArray
    lowest: FloatArray
    push: FloatArray
    pull: FloatArray


@inlined
def write_recent(history: History, first: Patches, deborah: float, recent: Recent) -> None:
    """Write the bounds at the last moment of a history."""
    last = history.count - 1
    time, depth, rate = history.time[last], history.depth[last], history.rate[last]
    left, back = np.exp(-time), last
    lowest, highest, least, push = depth, depth, depth + rate, max(-rate, -history.rate[0] * left, 0.0)
    pull = min(-rate, -history.rate[0] * left, 0.0)
    if first.deborah > deborah:  # what was free at the jump fades more slowly along the line
        push = max(push, min(depth, first.depth * left) * (1 - deborah / first.deborah))
    for k in range(WINDOWS):
        since = time - WINDOW / deborah * 2.0**k
        while back > 0 and history.time[back] > since:
            back -= 1
            then, falls = history.depth[back], -history.rate[back]
            lowest, highest, least = min(lowest, then), max(highest, then), min(least, then - falls)
            if falls > push or falls < pull:
                falls *= np.exp(history.time[back] - time)
                push, pull = max(push, falls), min(pull, falls)
        recent.spread[k], recent.lowest[k], recent.push[k], recent.pull[k] = highest - lowest, least, push, pull


@inlined
def over(distance: float) -> int:
    """Return which of the bounds holds over a distance."""
    ways = max(distance * (1 / WINDOW), 0.0)
    return int(LONGER[np.uintp(ways)]) if ways < LONGER.size else WINDOWS - 1
