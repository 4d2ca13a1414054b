"""Find the contact patches at one instant after a velocity jump.

The search visits the cells of the line one by one, from the highest point on and in the direction in which the elements
move. It records where contact last ended and where free elements may have separated (`FreeRecovery`). The force on an
element in contact is lift + h + D h', where D is the Deborah number v tau in cells, and the lift is the depth plus its
rate. In each cell that is examined:

* Inside a patch, contact ends where the force falls through zero, or where free elements arrive with a displacement
  larger than the depth plus the height of the line (contact is then lost although the contact force is positive).
* Outside a patch, contact begins where the line rises above the free elements and the force would be positive.

A patch is added to the sums when its end is found. Most cells can be skipped because of three bounds, which are
rigorous: no contact is missed.

* A cell in contact is skipped under two conditions. The force was positive everywhere in the cell while the elements
  that are now further along the line passed it. And the displacement u of free elements cannot exceed w = depth + h
  there. Along the line u' = (drift - u) / D, so that u stays below w wherever w + D h' exceeds the largest drift (see
  `free_recovery`).
* A free cell is skipped if its highest point is below a lower bound of the displacement of the free elements. The bound
  is computed along the line from the last known displacement and the least drift.
* A free cell is also skipped if its gap is wider than any gap that can have opened since the elements separated,
because
  the cell was then out of contact all the time. It is skipped until the line has approached by the width of the gap.
  The gap closes at most at the rate of the depth plus the largest drift. The integral of this rate over time is the
  *approach*.

Elements that travel more than a whole period of the line can pass the highest point out of contact. In that case the
search is repeated with the places of separation of the previous period.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit_inline_uncounted, jit_uncounted
from mdr_dask.physics.sliding.kelvin import BLOCK, Barriers
from mdr_dask.physics.surfaces.cubic_line import NONE, cubic
from mdr_dask.physics.transients.free_recovery import (
    MARGIN,
    WINDOW,
    WINDOWS,
    FreeRecovery,
    Instant,
    PathBounds,
    contact_begin,
    displacement_at,
    from_before,
    gap_at,
    nearest_approach,
    prune,
    window,
    write_bounds,
)
from mdr_dask.physics.transients.patches import (
    DRAG_GROWTH,
    DRAG_STIFFNESS,
    GROWTH,
    LENGTH,
    STIFFNESS,
    SUMS,
    TILT,
    Track,
    add_patch,
    force_at,
    height_at,
    keeps_pressed,
    loading,
    unloading,
)

SEPARATIONS = 1024  # largest number of places of separation at one instant
PERIODS = 3  # largest number of periods of the line for which the search is repeated
VISITS = 6  # largest number of changes of contact in a cell: a cubic force changes sign at most three times
ROUNDING = 1e-9  # margin for rounding errors, relative to a displacement
CLOSE = 1e-9  # cells: accuracy of the place where contact is lost to free elements
FULL = -1  # returned instead of the number of patches if the capacity is exceeded or a patch continues beyond its run
DEPTH_CHANGES = 4.0  # assumed largest derivative of a displacement with respect to the last depth

# Entries of `Workspace.scan`, the state of the search
BEGIN, FREE_FROM, HELD, FIRM_LIFT, FIRM_UNTIL, LOWEST, LOWEST_PASSED, PASSED = range(8)
# Entries of `SkipBounds.state`
APPROACH, LARGEST, TIME, DEPTH, DRIFT = range(5)


class Reachable(NamedTuple):
    """The cells in which elements can be in contact at depths between two limits.

    Parameters
    ----------
    runs : int array, shape (m, 2)
        First and last node of each run of cells in which contact is possible.
    from_depth : array, shape (n + 2,)
        For each cell, the largest depth at which the cell is certainly out of contact.
    second : float
        Largest height outside the patch that contains the highest point of the line.
    """

    runs: IntArray
    from_depth: FloatArray
    second: float


class SkipBounds(NamedTuple):
    """Bounds that show which cells can be skipped until the line has approached further.

    Parameters
    ----------
    skip_until : array, shape (n + 2,)
        For each cell, the approach up to which the cell is certainly out of contact.
    state : array, shape (5,)
        Approach so far, the largest entry of `skip_until`, and time, depth and largest drift at the last search.
    """

    skip_until: FloatArray
    state: FloatArray


class Workspace(NamedTuple):
    """Work arrays of a search, and its results.

    Parameters
    ----------
    start, end : array
        Places where the patches begin and end.
    sums : array, shape (SUMS,)
        Sums over the patches, and their derivatives.
    scan : array
        State of the search, in this order: place where the current patch begins; place where contact last ended; place
        up to which contact is certain; barrier below which cells in contact can be skipped; place up to which this
        barrier is valid; least displacement of free elements at the end of the previous cell; least displacement there
        of those free elements that passed the end of the last patch after the jump; and the farthest place that the
        latter elements have reached.
    recovery : FreeRecovery
    skip : SkipBounds
    barriers : Barriers
        Barriers of the cells at the Deborah number after the jump.
    """

    start: FloatArray
    end: FloatArray
    sums: FloatArray
    scan: FloatArray
    recovery: FreeRecovery
    skip: SkipBounds
    barriers: Barriers


def workspace_for(patches: int, barriers: Barriers, below: FloatArray) -> Workspace:
    """Return a workspace with a capacity of four times the given number of patches, plus 4096.

    `below` is the increase of depth, for each cell, up to which the cell certainly stays out of contact.
    """
    start, end = np.empty((2, 4 * patches + 4096))
    bounds = PathBounds(*np.empty((5, WINDOWS)))
    earliest, place, farthest, barrier = np.empty((4, SEPARATIONS))
    recovery = FreeRecovery(earliest, place, farthest, barrier, np.zeros(1, np.int64), bounds)
    state = np.zeros(5)
    state[TIME] = np.nan
    return Workspace(start, end, np.zeros(SUMS), np.empty(8), recovery, SkipBounds(below, state), barriers)


class Motion(NamedTuple):
    """Changes of the depth up to an instant.

    Parameters
    ----------
    rise, fall : float
        Largest mean rate at which the lift has risen from any earlier moment until now, and largest rate at which the
        lift has fallen between two successive moments.
    shallowest, deepest, highest : float
        Least depth, largest depth and largest lift so far.
    passes_top : bool
        Whether elements that separated before the patch of the highest point may have passed this point out of contact.
    """

    rise: float
    fall: float
    shallowest: float
    deepest: float
    highest: float
    passes_top: bool


@jit_inline_uncounted
def motion_until(now: Instant, second: float) -> Motion:
    """Return the changes of the depth; `second` is the largest height outside the patch of the highest point."""
    history, deborah, last = now.history, now.deborah, now.history.count - 1
    depth, rate = history.depth[last], history.rate[last]
    lift, rise, fall, passes_top = depth + rate, 0.0, 0.0, False
    shallowest, deepest, highest = depth, depth, lift
    carried, before, lift_before = -np.inf, 0.0, history.depth[0] + history.rate[0]
    for moment in range(last + 1):
        time, then = history.time[moment], history.depth[moment]
        lift_then = then + history.rate[moment]
        shallowest, deepest, highest = min(shallowest, then), max(deepest, then), max(highest, lift_then)
        if moment < last:
            rise = max(rise, (lift - lift_then) / (now.time - time))
        if moment > 0:
            fall = max(fall, (lift_before - lift_then) / (time - before))
            carried *= np.exp(before - time)
        passes_top |= carried > then and deborah * (now.time - time) < now.track.cells
        carried, before, lift_before = max(carried, then + second), time, lift_then
    if last > 0:
        step = history.time[last] - history.time[last - 1]
        fallen = (history.depth[last - 1] - depth) / step
        rise = max(rise, rate + (6 * fallen + 2 * history.rate[last - 1] + 4 * rate) / step)
    return Motion(rise, fall, shallowest, deepest, highest, passes_top)


@jit_inline_uncounted
def add_approach(now: Instant, bounds: PathBounds, state: FloatArray) -> None:
    """Add the approach since the last search.

    If the last search was neither at this instant nor at the previous instant of the history, no cell remains skipped.
    """
    history, last = now.history, now.history.count - 1
    depth, drift = history.depth[last], bounds.most_drift[WINDOWS - 1]
    if now.time == state[TIME]:  # same instant, another guess of the depth
        state[APPROACH] += DEPTH_CHANGES * abs(depth - state[DEPTH])
    elif last > 0 and history.time[last - 1] == state[TIME]:
        before = history.depth[last - 1]
        nearer = depth - before + (now.time - state[TIME]) * max(drift, state[DRIFT])
        state[APPROACH] += DEPTH_CHANGES * abs(before - state[DEPTH]) + max(nearer, 0.0)
    else:
        state[APPROACH] = state[LARGEST] + max(depth - history.depth[0], 0.0)
    state[TIME], state[DEPTH], state[DRIFT] = now.time, depth, drift


@jit_inline_uncounted
def skip_until(skip: SkipBounds, cell: int, gap: float) -> None:
    """Skip a cell until the line has approached by the given gap."""
    until = skip.state[APPROACH] + gap
    skip.skip_until[np.uintp(cell)] = until
    skip.state[LARGEST] = max(skip.state[LARGEST], until)


@jit_uncounted
def find_contact(now: Instant, reachable: Reachable, work: Workspace) -> int:
    """Find the contact patches at an instant, at the last depth and rate of its history, and add up their forces.

    Parameters
    ----------
    now : Instant
    reachable : Reachable
        Its runs must contain all patches at this depth.
    work : Workspace
        Written: the patches and `sums`. The sums are: load and drag, divided by 4 G dx; length in contact; integral of
        the slope over the length in contact; derivatives of load and drag with respect to the depth; and the rates at
        which load and drag change because patches grow.

    Returns
    -------
    int
        Number of patches, or `FULL`.
    """
    motion = motion_until(now, reachable.second)
    write_bounds(now.history, now.first, now.deborah, work.recovery.bounds)
    add_approach(now, work.recovery.bounds, work.skip.state)
    work.recovery.count[0] = 0
    found = _search_period(now, motion, reachable, work)
    if motion.passes_top:
        work.skip.state[TIME] = np.nan  # bounds found in a repeated search are invalid at the next instant
        for _ in range(min(int(now.deborah * now.time / now.track.cells) + 1, PERIODS)):
            _move_back_one_period(now, work.recovery, motion)
            if work.recovery.count[0] == 0:
                break
            found = _search_period(now, motion, reachable, work)
    return found


@jit_inline_uncounted
def _move_back_one_period(now: Instant, recovery: FreeRecovery, motion: Motion) -> None:
    """Shift all places of separation back by one period; keep those whose elements may be free behind the highest
    point.
    """
    for k in range(recovery.count[0]):
        recovery.earliest[k] -= now.track.cells
        recovery.place[k] -= now.track.cells
        recovery.farthest[k] -= now.track.cells
    prune(now, recovery, now.track.origin, now.history.depth[now.history.count - 1], motion.deepest)


@jit_uncounted
def _search_period(now: Instant, motion: Motion, reachable: Reachable, work: Workspace) -> int:
    """Search one period of the line; return the number of patches, or `FULL`.

    Places of separation that the workspace already contains belong to the previous period. If it contains no place, the
    highest point is assumed to be in contact.
    """
    track, history, scan, sums, recovery = now.track, now.history, work.scan, work.sums, work.recovery
    last, runs = history.count - 1, reachable.runs
    lift, origin = history.depth[last] + history.rate[last], track.origin
    sums[:] = 0.0
    scan[BEGIN] = scan[FREE_FROM] = scan[HELD] = scan[PASSED] = origin
    scan[FIRM_UNTIL] = scan[LOWEST] = scan[LOWEST_PASSED] = 0.0
    contact, found = history.depth[last] >= displacement_at(now, recovery, origin)[0], 0
    if not contact:
        _add_separation(now, motion, work, origin)
    for run in range(runs.shape[0]):
        i, stop = runs[run, 0], runs[run, 1]
        if not contact:
            scan[LOWEST] = scan[LOWEST_PASSED] = 0.0  # displacements between two runs of cells are not computed
        while True:
            if contact:
                i = _skip_pressed(now, work, lift, i, stop)
            else:
                i = _skip_free(now, motion, reachable.from_depth, work, lift, i, stop)
            if i >= stop:
                break
            contact, found = _examine(now, motion, work, lift, i, contact, found)
            if found < 0:
                return FULL
            i += 1
        if contact and run + 1 < runs.shape[0]:
            return FULL
    finish = track.cells + origin
    begin = scan[BEGIN] if contact else finish
    add_patch(track, begin, finish, lift, now.deborah, sums)
    work.start[found], work.end[found] = begin, finish
    sums[STIFFNESS] += sums[LENGTH] * (1 + history.stiff)
    sums[DRAG_STIFFNESS] += sums[TILT] * (1 + history.stiff)
    return found + 1


@jit_inline_uncounted
def _oldest(recovery: FreeRecovery, otherwise: float) -> float:
    """Return the first place at which elements that are now further along the line can have separated."""
    return recovery.earliest[0] if recovery.count[0] > 0 else otherwise


@jit_inline_uncounted
def _skip_pressed(now: Instant, work: Workspace, lift: float, i: int, stop: int) -> int:
    """Return the first cell from cell i on in which contact may end or elements may have separated."""
    track, scan, barriers, bounds = now.track, work.scan, work.barriers, work.recovery.bounds
    n, depth = int(track.cells), now.history.depth[now.history.count - 1]
    firm, until, begin = scan[FIRM_LIFT], scan[FIRM_UNTIL], scan[BEGIN]
    while i < stop:
        if i + 1 > until:
            oldest = _oldest(work.recovery, begin)
            k = window(2 * (i + 1 - oldest))
            firm, until = min(depth - bounds.most_drift[k], bounds.least_lift[k]), oldest + WINDOW * 2.0**k
        pressed = i < n and keeps_pressed(track, barriers, now.deborah, i, lift)
        if not (pressed and begin <= i and barriers.cell[np.uintp(i)] < firm):
            break
        whole = i % BLOCK == 0 and i + BLOCK < min(stop, until) and i + BLOCK <= n
        i += BLOCK if whole and barriers.block[i // BLOCK] < firm else 1
    scan[FIRM_LIFT], scan[FIRM_UNTIL] = firm, until
    return i


@jit_inline_uncounted
def _skip_free(
    now: Instant, motion: Motion, from_depth: FloatArray, work: Workspace, lift: float, i: int, stop: int
) -> int:
    """Return the first cell from cell i on in which contact may begin."""
    track, scan, barriers, bounds, skip = now.track, work.scan, work.barriers, work.recovery.bounds, work.skip
    n, depth, approach = int(track.cells), now.history.depth[now.history.count - 1], skip.state[APPROACH]
    drift, fade = bounds.least_drift[WINDOWS - 1], np.exp(-1 / min(now.deborah, now.first.deborah))
    fade_passed, passed, oldest = np.exp(-1 / now.deborah), scan[PASSED], _oldest(work.recovery, scan[FREE_FROM])
    lowest, lowest_passed = scan[LOWEST], scan[LOWEST_PASSED]
    while i < stop:
        lowest_passed = lowest_passed * fade_passed if i < passed else 0.0
        lowest = max((lowest - drift) * fade + drift, lowest_passed)
        if not (approach < skip.skip_until[np.uintp(i)] or motion.deepest <= from_depth[np.uintp(i)]):
            gap = lowest - depth - track.peak[np.uintp(i)]
            if gap > 0 and gap > bounds.opened[window(2 * (i + 1 - oldest) + MARGIN)]:
                skip_until(skip, i, gap)
            elif i >= n or keeps_pressed(track, barriers, now.deborah, i, lift) or lift > barriers.idle[np.uintp(i)]:
                break
        i += 1
    scan[LOWEST], scan[LOWEST_PASSED] = lowest, lowest_passed
    return i


@jit_inline_uncounted
def _examine(
    now: Instant, motion: Motion, work: Workspace, lift: float, cell: int, contact: bool, found: int
) -> tuple[bool, int]:
    """Find where contact begins and ends in a cell.

    Return whether there is contact at the end of the cell, and the number of patches found so far.
    """
    track, scan, recovery, barriers = now.track, work.scan, work.recovery, work.barriers
    n, finish = int(track.cells), track.cells + track.origin
    if recovery.count[0] + VISITS > recovery.place.size or found + VISITS > work.start.size:
        return contact, FULL
    line, stop = cubic(track.height, track.enter, track.leave, cell), min(cell + 1.0, finish)
    pressed = cell < n and keeps_pressed(track, barriers, now.deborah, cell, lift)
    barrier = barriers.cell[np.uintp(cell)] if cell < n else lift
    weak = (contact or pressed) and barrier >= recovery.bounds.least_lift[WINDOWS - 1]
    separated = weak and _may_have_separated(track, motion, now.deborah, cell)
    if separated:
        _add_stretch(recovery, float(cell), barrier)
    x, ended = max(float(cell), scan[BEGIN] if contact else scan[FREE_FROM]), False
    for _ in range(VISITS):
        if contact:
            until, off, is_lost, by_force = _contact_end(now, work, line, lift, cell, x, stop, pressed, separated)
            if not (is_lost or by_force):
                break
            _close_patch(now, motion, work, lift, cell, until, is_lost, found)
            contact, found, x, ended = False, found + 1, off, True
            scan[FREE_FROM] = off
            if not by_force:
                break
            _add_separation(now, motion, work, off)
        contact, x = _contact_begin(now, motion, work, line, lift, cell, x, stop, pressed, weak, ended)
        if contact:
            scan[BEGIN] = scan[HELD] = x
            scan[FIRM_UNTIL] = 0.0
        elif x >= stop:
            break
        else:  # from here on, the force on elements in contact would be tensile
            scan[FREE_FROM], ended = x, True
    return contact, found


@jit_inline_uncounted
def _contact_end(
    now: Instant,
    work: Workspace,
    line: tuple[float, float, float, float],
    lift: float,
    cell: int,
    x: float,
    stop: float,
    pressed: bool,
    separated: bool,
) -> tuple[float, float, bool, bool]:
    """Return where contact ends in a cell from x on, the place from which elements are free, and two flags.

    The first flag is True if contact ends because free elements arrive with a displacement beyond the line, the second
    flag if the force falls to zero. Both are False if contact does not end in the cell.
    """
    scan, place = work.scan, NONE
    c0, c1, c2, c3 = line
    if not pressed:
        place = x - cell
        if force_at(c0, c1, c2, c3, lift, now.deborah, place) > 0:
            place = unloading(c0, c1, c2, c3, lift, now.deborah, place)
    by_force = cell + place < stop
    off = cell + place if by_force else stop
    if separated:
        scan[HELD] = off
    u = _overtaking(now, work.recovery, scan[HELD], off)
    is_lost = now.history.depth[now.history.count - 1] + height_at(now.track, off)[0] < u * (1 - ROUNDING)
    return _contact_loss(now, work.recovery, x, off) if is_lost else off, off, is_lost, by_force


@jit_inline_uncounted
def _overtaking(now: Instant, recovery: FreeRecovery, held: float, x: float) -> float:
    """Return the displacement at x of free elements that may arrive inside a patch, or 0 if no such element exists.

    Up to `held` the patch is certainly in contact. Beyond `held` no element of the patch has separated.
    """
    if x > held:
        depth = now.history.depth[now.history.count - 1]
        w, w_held = depth + height_at(now.track, x)[0], depth + height_at(now.track, held)[0]
        drift = recovery.bounds.most_drift[window(x - recovery.earliest[0]) if recovery.count[0] > 0 else 0]
        slowest = max(now.deborah, now.first.deborah)
        if w >= max(w_held, drift) or w >= drift + (w_held - drift) * np.exp((held - x) / slowest):
            return from_before(now, x, w)[0] if x - now.deborah * now.time > held else 0.0
    return displacement_at(now, recovery, x)[0]


@jit_uncounted
def _contact_loss(now: Instant, recovery: FreeRecovery, low: float, high: float) -> float:
    """Return, by bisection, the place between `low` and `high` where free elements rise above the line."""
    depth = now.history.depth[now.history.count - 1]
    while high - low > CLOSE:
        x = 0.5 * (low + high)
        if depth + height_at(now.track, x)[0] < displacement_at(now, recovery, x)[0]:
            high = x
        else:
            low = x
    return high


@jit_inline_uncounted
def _close_patch(
    now: Instant, motion: Motion, work: Workspace, lift: float, cell: int, end: float, is_lost: bool, found: int
) -> None:
    """Store the current patch, which ends in this cell, and start the bounds of the free elements behind it."""
    scan, recovery = work.scan, work.recovery
    if is_lost:
        _, slope, _, by_depth, opening = gap_at(now, recovery, end)
        _add_edge(now, lift, end, -slope, by_depth, opening, work.sums)
    add_patch(now.track, scan[BEGIN], end, lift, now.deborah, work.sums)
    work.start[found], work.end[found] = scan[BEGIN], end
    depth = now.history.depth[now.history.count - 1]
    w = depth + height_at(now.track, end)[0]
    prune(now, recovery, end, w, motion.deepest)
    scan[PASSED] = end + now.deborah * now.time - 1
    least = max(w - (depth - motion.shallowest), 0.0) * np.exp(-1 / now.deborah)
    scan[LOWEST_PASSED] = least if cell < scan[PASSED] else 0.0
    scan[LOWEST] = max(_lowest_behind(now, recovery.bounds, w), scan[LOWEST_PASSED])


@jit_inline_uncounted
def _lowest_behind(now: Instant, bounds: PathBounds, u: float) -> float:
    """Return the least displacement of free elements one cell behind a place at which the displacement is u."""
    drift, fade = bounds.least_drift[WINDOWS - 1], np.exp(-1 / min(now.deborah, now.first.deborah))
    return float((u - drift) * fade + drift)


@jit_inline_uncounted
def _contact_begin(
    now: Instant,
    motion: Motion,
    work: Workspace,
    line: tuple[float, float, float, float],
    lift: float,
    cell: int,
    x: float,
    stop: float,
    pressed: bool,
    weak: bool,
    ended: bool,
) -> tuple[bool, float]:
    """Return whether contact begins in a cell from x on, and where; if not, the place where the search continues.

    Contact can begin only between the place `low`, where the force becomes positive, and the place `high`, where the
    force falls to zero again. Elements may have separated at `high` at an earlier time.
    """
    track, scan, recovery, (c0, c1, c2, c3) = now.track, work.scan, work.recovery, line
    low, high, depth = x - cell, NONE, now.history.depth[now.history.count - 1]
    if not pressed:
        if ended or force_at(c0, c1, c2, c3, lift, now.deborah, low) <= 0:
            low = loading(c0, c1, c2, c3, lift, now.deborah, low)
        if cell + low >= stop:
            return False, stop
        high = unloading(c0, c1, c2, c3, lift, now.deborah, low)
    by_force = cell + high < stop
    probe, peak = cell + high if by_force else stop, depth + track.peak[np.uintp(cell)]
    if not (by_force or weak) and peak <= scan[LOWEST]:
        return False, stop
    u, u_slope, _ = displacement_at(now, recovery, probe)
    scan[LOWEST] = max(_lowest_behind(now, recovery.bounds, u) if by_force else u, scan[LOWEST_PASSED])
    clear = scan[LOWEST] - peak
    if clear > 0:
        oldest = _oldest(recovery, scan[FREE_FROM])
        if clear > recovery.bounds.opened[window(2 * (cell + 1 - oldest) + MARGIN)]:
            skip_until(work.skip, cell, clear)
            return False, stop
    h, slope, _ = height_at(track, probe)
    gap, top = depth + h - u, probe
    if gap <= 0 and gap > (slope - u_slope) * (probe - cell - low):
        top, gap = nearest_approach(now, recovery, cell + low, probe)
    if gap > 0:
        guess = cell + _guess_begin(line, depth, u, u_slope, low, top - cell)
        begin, rise, by_depth, opening = contact_begin(now, recovery, cell + low, top, guess)
        _add_edge(now, lift, begin, rise, by_depth, opening, work.sums)
        return True, begin
    if not by_force:
        return False, stop
    prune(now, recovery, probe, depth + h, motion.deepest)
    _add_separation(now, motion, work, probe)
    return False, probe


@jit_inline_uncounted
def _guess_begin(
    line: tuple[float, float, float, float], depth: float, u: float, u_slope: float, low: float, high: float
) -> float:
    """Return an approximate place in a cell where the line rises above free elements.

    The displacement of the free elements at `high` is u, and the slope of the displacement along the line `u_slope`.
    """
    c0, c1, c2, c3 = line
    bend, y = u_slope * u_slope / u if u > 0 else 0.0, high
    for _ in range(5):
        free = u + (y - high) * (u_slope + (y - high) * 0.5 * bend)
        rise = c1 + y * (2 * c2 + y * 3 * c3) - u_slope - (y - high) * bend
        if rise <= 0:
            break
        step = (free - depth - c0 - y * (c1 + y * (c2 + y * c3))) / rise
        y = min(max(y + step, low), high)
        if abs(step) < 0.01:
            break
    return y


@jit_inline_uncounted
def _add_edge(
    now: Instant, lift: float, place: float, steep: float, by_depth: float, opening: float, sums: FloatArray
) -> None:
    """Add the derivatives of load and drag, with respect to depth and time, due to the motion of an edge of a patch.

    The force at this edge is not zero. The gap is the height of the line above the free elements: `steep` is the slope
    of the gap towards the inside of the patch, `by_depth` the derivative of the gap with respect to the depth, and
    `opening` the rate of the gap.
    """
    h, slope, _ = height_at(now.track, place)
    force = lift + h + now.deborah * slope
    if force > 0 and steep > 0:
        edge = force / steep
        sums[STIFFNESS] += edge * by_depth
        sums[DRAG_STIFFNESS] += edge * by_depth * slope
        sums[GROWTH] += edge * opening
        sums[DRAG_GROWTH] += edge * opening * slope


@jit_inline_uncounted
def _add_separation(now: Instant, motion: Motion, work: Workspace, place: float) -> None:
    """Add a place where the force falls to zero now.

    Also store the farthest such place since the jump.
    """
    track, recovery, n = now.track, work.recovery, int(now.track.cells)
    i = min(int(place), n)
    h, slope, _ = height_at(track, i + 1.0)
    if motion.highest + h + now.deborah * slope > 0:
        i += 1
        while i < n and keeps_pressed(track, work.barriers, now.deborah, i, motion.highest):
            i += 1
    k = recovery.count[0]
    recovery.earliest[k] = recovery.place[k] = place
    recovery.farthest[k], recovery.barrier[k] = i + 1.0, np.inf
    recovery.count[0] = k + 1


@jit_inline_uncounted
def _add_stretch(recovery: FreeRecovery, cell: float, barrier: float) -> None:
    """Add a cell in which elements can have separated although the force is positive now.

    If the last stretch ends at this cell, extend the stretch.
    """
    k, last = recovery.count[0], recovery.count[0] - 1
    if k > 0 and recovery.earliest[last] < recovery.place[last] and recovery.place[last] == cell:
        recovery.place[last] = recovery.farthest[last] = cell + 1
        recovery.barrier[last] = max(recovery.barrier[last], barrier)
    else:
        recovery.earliest[k], recovery.barrier[k] = cell, barrier
        recovery.place[k] = recovery.farthest[k] = cell + 1
        recovery.count[0] = k + 1


@jit_inline_uncounted
def _force_slopes(track: Track, deborah: float, i: int) -> tuple[float, float, float]:
    """Return three bounds of the slope of the force in a cell: at its start, at a control point and at its end."""
    _, c1, c2, c3 = cubic(track.height, track.enter, track.leave, i)
    enter, bend, turn = c1 + 2 * deborah * c2, c2 + 3 * deborah * c3, 3 * c3
    return enter, enter + bend, enter + 2 * bend + turn


@jit_inline_uncounted
def _may_have_separated(track: Track, motion: Motion, deborah: float, i: int) -> bool:
    """Return whether elements can have separated in cell i or just before it, although the force is positive now.

    The force on such an element has fallen through zero and has risen again while the element travelled.
    """
    start, middle, end = _force_slopes(track, deborah, i)
    if deborah * max(start, middle, end) <= -motion.rise:
        return False
    least = min(start, middle, end)
    if i > 0:
        least = min(least, _force_slopes(track, deborah, i - 1)[2])
    return bool(deborah * least < motion.fall)
