"""Who touches what at one moment after a jump: one pass along the stretches of the line where contact is possible."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.sliding.kelvin import BLOCK, Barriers
from mdr_dask.physics.surfaces.cubic_line import NONE, cubic
from mdr_dask.physics.transients.clearance import APPROACH, TIME, Clearance, approached, rests
from mdr_dask.physics.transients.contact_loss import (
    Motion,
    loss,
    may_have_left,
    motion_at,
    overtaking,
    turned,
)
from mdr_dask.physics.transients.free_flight import (
    Instant,
    Wakes,
    crest,
    foreseen,
    gap_at,
    meeting,
    wake_at,
    worth_keeping,
)
from mdr_dask.physics.transients.patches import (
    DRAG_GROWTH,
    DRAG_STIFFNESS,
    GROWTH,
    LENGTH,
    STIFFNESS,
    SUMS,
    TILT,
    add_patch,
    force_at,
    height_at,
    keeps_pressed,
    loading,
    unloading,
)
from mdr_dask.physics.transients.recent import WINDOW, WINDOWS, Recent, over, write_recent

CANDIDATES = 1024  # most places of leaving whose wakes are compared
NEARBY = 64.0  # cells more than twice the way, over which contact may have been where it is not now
ROUNDING = 1e-9  # of a displacement
TURNS = 3  # of the line that an element may fly over
VISITS = 6  # of one cell: a force that is a cubic changes sign three times at most


class Reachable(NamedTuple):
    """Where elements can be in contact between two depths.

    Parameters
    ----------
    runs : int array, shape (m, 2)
        First and last node of the stretches in which contact is possible.
    from_depth : array, shape (n + 2,)
        Depth up to which the line touches no element in a cell.
    second : float
        Height of the highest point outside of the patch of the highest of all.
    """

    runs: IntArray
    from_depth: FloatArray
    second: float


class Workspace(NamedTuple):
    """What a search writes: patches and their sums, the places of leaving now and the farthest, bounds, barriers."""

    start: FloatArray
    end: FloatArray
    sums: FloatArray
    earliest: FloatArray
    places: FloatArray
    farthest: FloatArray
    barrier: FloatArray
    recent: Recent
    clearance: Clearance
    barriers: Barriers


def workspace_for(patches: int, barriers: Barriers, clearance: Clearance) -> Workspace:
    """Return the workspace of a number of patches and some more, with what is known of the cells."""
    most = 4 * patches + 4096
    start, end = np.empty((2, most))
    earliest, places, farthest, barrier = np.empty((4, CANDIDATES))
    recent = Recent(*np.empty((5, WINDOWS)))
    return Workspace(start, end, np.zeros(SUMS), earliest, places, farthest, barrier, recent, clearance, barriers)


@jit_inline
def _remember(place: float, farthest: float, work: Workspace, known: int) -> int:
    """Write down where contact was left; count the places."""
    work.earliest[known], work.places[known], work.farthest[known], work.barrier[known] = place, place, farthest, np.inf
    return known + 1


@jit_inline
def _remember_cell(cell: float, barrier: float, work: Workspace, known: int) -> int:
    """Write down that contact may have been left in a cell where the force is positive now; count the places."""
    last = known - 1
    if known > 0 and work.earliest[last] < work.places[last] and work.places[last] == cell:
        work.places[last], work.farthest[last] = cell + 1, cell + 1
        work.barrier[last] = max(work.barrier[last], barrier)
        return known
    work.earliest[known], work.places[known], work.farthest[known], work.barrier[known] = (
        cell,
        cell + 1,
        cell + 1,
        barrier,
    )
    return known + 1


@jit_inline
def _farthest(now: Instant, place: float, highest: float, barriers: Barriers) -> float:
    """Return how far from where contact is left it can have reached, at the highest of depth and rate so far."""
    i = min(int(place), int(now.track.cells))
    h, slope, _ = height_at(now.track, i + 1.0)
    if highest + h + now.deborah * slope <= 0:
        return i + 1.0
    i += 1
    while i < int(now.track.cells) and keeps_pressed(now.track, barriers, now.deborah, i, highest):
        i += 1
    return i + 1.0


@jit_inline
def _add_edge(now: Instant, lift: float, place: float, gap: tuple[float, float, float], sums: FloatArray) -> None:
    """Add what load and drag gain by depth and time where a patch grows at an edge: the force there is not zero.

    The gap is that of line and wake: its slope into the patch, its derivative by the depth, and its rate.
    """
    steep, gain, opening = gap
    h, slope, _ = height_at(now.track, place)
    force = lift + h + now.deborah * slope
    if force > 0 and steep > 0:
        edge = force / steep
        sums[STIFFNESS] += edge * gain
        sums[DRAG_STIFFNESS] += edge * gain * slope
        sums[GROWTH] += edge * opening
        sums[DRAG_GROWTH] += edge * opening * slope


@jit
def touch(now: Instant, reachable: Reachable, work: Workspace) -> int:
    """Find the patches in contact at a moment, at the last depth and rate of its history, and add up their forces.

    Parameters
    ----------
    now : Instant
    reachable : Reachable
        Its stretches must hold the patches at the depth.
    work : Workspace
        Written: the patches, and in `sums` load and drag over 4 G dx, length in contact, rise over it, the derivatives
        of load and drag by the depth, and what they gain by time where patches begin.

    Returns
    -------
    int
        Number of patches, or -1 if a patch does not end within its stretch, or if there are more patches or more places
        of leaving than fit.
    """
    motion = motion_at(now, reachable.second)
    write_recent(now.history, now.first, now.deborah, work.recent)
    state = work.clearance.state
    approached(now, work.recent, state)
    found, known = _turn(now, motion, reachable, work, 0)
    if motion.overflown:
        state[TIME] = np.nan  # what a turn knows does not hold for the next moment
        for _ in range(min(int(now.deborah * now.time / now.track.cells) + 1, TURNS)):
            known = turned(
                now, Wakes(work.earliest, work.places, work.farthest, work.barrier, work.recent, known), motion
            )
            if known == 0:
                break
            found, known = _turn(now, motion, reachable, work, known)
    return found


@jit
def _turn(now: Instant, motion: Motion, reachable: Reachable, work: Workspace, known: int) -> tuple[int, int]:
    """Do what `touch` does on one turn of the line, with some places of leaving known; return how many are known then.

    Where none is, the highest point is taken for touched.
    """
    track, history, deborah = now.track, now.history, now.deborah
    height, enter, leave, peak = track.height, track.enter, track.leave, track.peak
    runs, from_depth = reachable.runs, reachable.from_depth
    start, end, sums, earliest, places, farthest, least_lift, recent, clearance, barriers = work
    until_approach, approach = clearance.until, clearance.state[APPROACH]
    depth = history.depth[history.count - 1]
    lift = depth + history.rate[history.count - 1]
    deepest, highest = motion.deepest, motion.highest  # elements may fly from where the line is no longer touched
    found = 0
    n, finish, begin = int(track.cells), track.cells + track.origin, track.origin
    free_from = held = begin
    firm, firm_until = 0.0, 0.0
    contact = depth >= wake_at(now, Wakes(earliest, places, farthest, least_lift, recent, known), begin)[0]
    fade, pull = np.exp(-1 / min(deborah, now.first.deborah)), recent.pull[WINDOWS - 1]
    slow, gone, risen = np.exp(-1 / deborah), deborah * now.time, depth - motion.shallowest
    oldest = earliest[0] if known > 0 else begin
    lowest = 0.0  # what a free element has at least at the end of a cell
    least, passed = 0.0, begin  # and one that passed the end of the last patch after the jump: those up to `passed` did
    sums[:] = 0.0
    if not contact:  # it may have been left there
        known = _remember(begin, _farthest(now, begin, highest, barriers), work, known)
    for run in range(runs.shape[0]):
        i, stop = runs[run, 0], runs[run, 1]
        if not contact:
            lowest = least = 0.0  # nothing is known of what is left between the stretches
        while i < stop:
            if not contact:
                least = least * slow if i < passed else 0.0
                lowest = max((lowest - pull) * fade + pull, least)
                if approach < until_approach[np.uintp(i)] or deepest <= from_depth[np.uintp(i)]:
                    i += 1
                    continue
                clear = lowest - depth - peak[np.uintp(i)]
                if clear > 0 and clear > recent.apart[over(2 * (i + 1 - oldest) + NEARBY)]:
                    rests(clearance, i, clear)
                    i += 1
                    continue
            positive = i < n and keeps_pressed(track, barriers, deborah, i, lift)
            if not contact and i < n and lift <= barriers.idle[np.uintp(i)]:
                i += 1
                continue
            if contact and i + 1 > firm_until:
                oldest = earliest[0] if known > 0 else begin
                k = over(2 * (i + 1 - oldest))
                firm, firm_until = min(depth - recent.push[k], recent.lowest[k]), oldest + WINDOW * 2.0**k
            if contact and positive and begin <= i and barriers.cell[np.uintp(i)] < firm:
                whole = i % BLOCK == 0 and i + BLOCK < min(stop, firm_until) and i + BLOCK <= n
                i += BLOCK if whole and barriers.block[i // BLOCK] < firm else 1
                continue
            if known + VISITS > places.size:
                return -1, 0
            cell, x1 = i, min(i + 1.0, finish)
            i += 1
            c0, c1, c2, c3 = cubic(height, enter, leave, cell)
            barrier = barriers.cell[np.uintp(cell)] if cell < n else lift
            weak = (contact or positive) and barrier >= recent.lowest[WINDOWS - 1]
            leaves = contact and weak and may_have_left(track, motion, deborah, cell)
            if leaves:
                known = _remember_cell(float(cell), barrier, work, known)
            x, pulled = max(float(cell), begin if contact else free_from), False
            for _ in range(VISITS):
                if contact:
                    y = x - cell
                    place = NONE
                    if not positive:
                        pressed = force_at(c0, c1, c2, c3, lift, deborah, y) > 0
                        place = unloading(c0, c1, c2, c3, lift, deborah, y) if pressed else y
                    pulls = cell + place < x1
                    off = cell + place if pulls else x1
                    wakes = Wakes(earliest, places, farthest, least_lift, recent, known)
                    if leaves:
                        held = off
                    u = overtaking(now, wakes, held, off)
                    lost, until = depth + height_at(track, off)[0] < u * (1 - ROUNDING), off
                    if not (pulls or lost):
                        break
                    if lost:
                        until = loss(now, wakes, x, off)
                        _, rise, _, gain, opening = gap_at(now, until, wake_at(now, wakes, until))
                        _add_edge(now, lift, until, (-rise, gain, opening), sums)
                    if found + 1 >= start.size:
                        return -1, 0
                    add_patch(track, begin, until, lift, deborah, sums)
                    start[found], end[found] = begin, until
                    found += 1
                    w = depth + height_at(track, until)[0]
                    known = worth_keeping(now, wakes, until, w, deepest)
                    passed = until + gone - 1
                    least = max(w - risen, 0.0) * slow if cell < passed else 0.0
                    lowest, oldest = max((w - pull) * fade + pull, least), earliest[0] if known > 0 else until
                    contact, free_from, x, pulled = False, off, off, True
                    if not pulls:
                        break
                    known = _remember(off, _farthest(now, off, highest, barriers), work, known)
                # the line comes nearer to free elements while the force on them would be positive
                low, high = x - cell, NONE
                if not positive:
                    if pulled or force_at(c0, c1, c2, c3, lift, deborah, low) <= 0:
                        low = loading(c0, c1, c2, c3, lift, deborah, low)
                    if cell + low >= x1:
                        break
                    high = unloading(c0, c1, c2, c3, lift, deborah, low)
                pulls = cell + high < x1
                probe = cell + high if pulls else x1
                h, slope, _ = height_at(track, probe)
                if not (pulls or weak) and depth + peak[np.uintp(cell)] <= lowest:
                    break
                wakes = Wakes(earliest, places, farthest, least_lift, recent, known)
                u, u_slope, _ = wake_at(now, wakes, probe)
                lowest = max((u - pull) * fade + pull if pulls else u, least)
                clear = lowest - depth - peak[np.uintp(cell)]
                if clear > 0 and clear > recent.apart[over(2 * (i - oldest) + NEARBY)]:
                    rests(clearance, cell, clear)
                    break
                gap, rise = depth + h - u, slope - u_slope
                if gap <= 0 and gap > rise * (probe - cell - low):
                    top, above = crest(now, wakes, cell + low, probe)
                    probe, gap = (top, above) if above > 0 else (probe, gap)
                if weak and may_have_left(track, motion, deborah, cell):
                    known = _remember_cell(float(cell), barrier, work, known)
                if gap > 0:
                    guess = cell + foreseen((c0, c1, c2, c3), depth, (u, u_slope), low, probe - cell)
                    begin, rise, gain, opening = meeting(now, wakes, cell + low, probe, guess)
                    _add_edge(now, lift, begin, (rise, gain, opening), sums)
                    contact, x, held, firm_until = True, begin, begin, 0.0
                    continue
                if not pulls:
                    break
                known = worth_keeping(now, wakes, probe, depth + h, deepest)
                known = _remember(probe, _farthest(now, probe, highest, barriers), work, known)
                free_from, x, pulled = probe, probe, True
        if contact and run + 1 < runs.shape[0]:
            return -1, 0
    begin = begin if contact else finish
    add_patch(track, begin, finish, lift, deborah, sums)
    start[found], end[found] = begin, finish
    sums[STIFFNESS] += sums[LENGTH] * (1 + history.stiff)
    sums[DRAG_STIFFNESS] += sums[TILT] * (1 + history.stiff)
    return found + 1, known
