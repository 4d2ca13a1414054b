"""Cells that need no look for a while: the line was seen to be clear of the elements there by more than it came nearer.

At one place the gap of line and elements in flight closes at most at the rate of the depth and the largest D u' + u of
the elements, the `push` of `recent`. That adds up to the approach, which is the same for all cells.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit_inline
from mdr_dask.physics.transients.free_flight import Instant
from mdr_dask.physics.transients.recent import WINDOWS, Recent

APPROACH, LARGEST, TIME, DEPTH, PUSH = range(5)
GUESSED = 4.0  # times what a guess of the depth changes: elements that left since the moment before change with it


class Clearance(NamedTuple):
    """How near the line may come before a cell has to be looked at.

    Parameters
    ----------
    until : array, shape (n + 2,)
        Approach up to which the line touches no element in a cell.
    state : array, shape (5,)
        Approach so far, the largest that any cell waits for, and time, depth and push of the last search.
    """

    until: FloatArray
    state: FloatArray


def clearance_from(until: FloatArray) -> Clearance:
    """Return what is known before the first search: up to which depth beyond the first one cells are not touched."""
    state = np.zeros(5)
    state[TIME] = np.nan
    return Clearance(until, state)


@jit_inline
def approached(now: Instant, recent: Recent, state: FloatArray) -> float:
    """Return the approach at a moment, which follows that of the last search; after any other all cells are awake."""
    history, last = now.history, now.history.count - 1
    depth, push = history.depth[last], recent.push[WINDOWS - 1]
    if now.time == state[TIME]:
        state[APPROACH] += GUESSED * abs(depth - state[DEPTH])
    elif last > 0 and history.time[last - 1] == state[TIME]:
        before = history.depth[last - 1]
        nearer = depth - before + (now.time - state[TIME]) * max(push, state[PUSH])
        state[APPROACH] += GUESSED * abs(before - state[DEPTH]) + max(nearer, 0.0)
    else:
        state[APPROACH] = state[LARGEST] + max(depth - history.depth[0], 0.0)
    state[TIME], state[DEPTH], state[PUSH] = now.time, depth, push
    return float(state[APPROACH])


@jit_inline
def rests(clearance: Clearance, cell: int, gap: float) -> None:
    """Write down that the line is below all elements in a cell by a gap."""
    state = clearance.state
    until = state[APPROACH] + gap
    clearance.until[np.uintp(cell)] = until
    state[LARGEST] = max(state[LARGEST], until)
