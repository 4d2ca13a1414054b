"""Search for the contact patches at one instant after a velocity jump.

The search starts at the highest point of the line and visits the cells in the direction in which the elements move. The
force on an element in contact is lift + h + D h'. Here h is the height of the line, the Deborah number D is the
distance v tau in cells, and the lift is the sum of the depth and the rate of the depth. Contact ends where the force
falls through zero. Contact also ends where free elements arrive with a displacement that is larger than the depth plus
the height of the line. Contact begins where the line rises above the free elements and the force would be positive.
Most cells are skipped, because rigorous bounds show that contact neither begins nor ends there (`_skip_pressed`,
`_skip_free`).

Free elements may pass the highest point without contact and travel more than a whole period of the line. If the motion
since the jump allows free elements to do so, the search is repeated with the elements that separated from the line in
the previous period.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit_inline_uncounted, jit_uncounted
from mdr_dask.physics.sliding.kelvin import Barriers
from mdr_dask.physics.surfaces.cubic_line import NONE, cubic
from mdr_dask.physics.transients.free_recovery import (
    ROUNDING,
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
    Cubic,
    Track,
    add_patch,
    force_at,
    height_at,
    keeps_pressed,
    loading,
    meeting,
    unloading,
)

PERIODS = 3  # largest number of periods of the line for which the search is repeated
VISITS = 6  # more than the number of patches that can end in a cell (a cubic force has at most three zeros)

# Entries of `Workspace.scan`, the state of the search
(
    BEGIN,  # place where the current patch begins
    FREE_FROM,  # place where contact last ended, or where the force last fell to zero
    HELD,  # place up to which the current patch is certainly in contact
    LOWEST,  # lower bound of the displacement of free elements at the end of the previous cell
) = range(4)


class Reachable(NamedTuple):
    """Runs of cells in which contact is possible at depths between two limits.

    Each row of `runs` contains the first and the last node of a run. `second` is the largest height outside the patch
    that contains the highest point of the line, in steady sliding at the lower of the two velocities, or -inf if there
    is none.
    """

    runs: IntArray
    second: float


class Workspace(NamedTuple):
    """Work arrays and results of a search: `start` and `end` of every patch, and the `sums` over all patches.

    Only the first entries of `start` and `end` are used: as many as `find_contact` returns. The barriers of the cells
    belong to the Deborah number after the jump. `free_until` contains, for each cell, the largest depth at which the
    cell is certainly out of contact, or -inf if no such depth is known.
    """

    start: FloatArray
    end: FloatArray
    sums: FloatArray
    scan: FloatArray
    recovery: FreeRecovery
    barriers: Barriers
    free_until: FloatArray


def workspace_for(barriers: Barriers, free_until: FloatArray) -> Workspace:
    """Return a workspace for as many contact patches as cells, and as many separations in each period."""
    start, end = np.empty((2, free_until.size + VISITS))
    earliest, place, farthest, barrier = np.empty((4, (PERIODS + 1) * free_until.size + VISITS))
    bounds = PathBounds(*np.empty((4, WINDOWS)))
    recovery = FreeRecovery(earliest, place, farthest, barrier, np.zeros(1, np.int64), bounds)
    return Workspace(start, end, np.zeros(SUMS), np.empty(4), recovery, barriers, free_until)


class Motion(NamedTuple):
    """Changes of the depth and of the lift from the jump until now.

    `rise` is the largest rate of increase of the lift: the rate now, or the mean rate from any earlier instant until
    now. `fall` is the largest rate at which the lift has decreased from one instant to the next. Both are at least 0.
    `deepest` is the largest depth so far, and `highest` is the largest lift so far. `passes_top` is True if free
    elements may have passed the highest point of the line without contact.
    """

    rise: float
    fall: float
    deepest: float
    highest: float
    passes_top: bool


class Search(NamedTuple):
    """Constants and work arrays of a search on a line of n cells."""

    now: Instant
    motion: Motion
    work: Workspace
    depth: float
    lift: float
    n: int


class Cell(NamedTuple):
    """Cell i of the line. `line` contains the coefficients of the cubic height of the line in this cell.

    `stop` is the end of the cell, or the end of the period if the period ends in this cell. `pressed` is True if the
    force on elements in contact would be positive everywhere in the cell. In the last cell, which is a copy of the
    first, `pressed` is always False. `weak` is True if this force may have been negative at an earlier instant.
    `separated` is True if elements may have separated in the cell although the force is positive now.
    """

    i: int
    line: Cubic
    stop: float
    pressed: bool
    weak: bool
    separated: bool


@jit_uncounted
def find_contact(now: Instant, reachable: Reachable, work: Workspace) -> int:
    """Find the contact patches at the last instant of the history. Return the number of patches.

    The number is 0 if a patch extends beyond its run, or if a work array is full. The patches and the sums over the
    patches are written to the workspace. The last patch ends at the highest point, and has the length 0 if free
    elements arrive there.
    """
    last, recovery = now.history.count - 1, work.recovery
    motion = _motion_until(now, reachable.second)
    write_bounds(now.history, now.first, now.deborah, recovery.bounds)
    depth = now.history.depth[last]
    lift = depth + now.history.rate[last]
    search = Search(now, motion, work, depth, lift, int(now.track.cells))
    recovery.count[0] = 0
    found = _search_period(search, reachable.runs)
    if motion.passes_top:
        for _ in range(min(int(now.deborah * now.time / now.track.cells) + 1, PERIODS)):
            for k in range(recovery.count[0]):  # now the places of separation belong to the previous period
                recovery.earliest[k] -= now.track.cells
                recovery.place[k] -= now.track.cells
                recovery.farthest[k] -= now.track.cells
            prune(now, recovery, now.track.origin, depth, motion.deepest)
            if recovery.count[0] == 0 or found == 0:
                break
            found = _search_period(search, reachable.runs)
    return found


@jit_inline_uncounted
def _motion_until(now: Instant, second: float) -> Motion:
    history, deborah, last = now.history, now.deborah, now.history.count - 1
    depth, rate = history.depth[last], history.rate[last]
    lift, rise, fall, passes_top = depth + rate, 0.0, 0.0, False
    deepest, highest = depth, lift
    carried, before, lift_before = -np.inf, 0.0, history.depth[0] + history.rate[0]
    for instant in range(last + 1):
        time, then = history.time[instant], history.depth[instant]
        lift_then = then + history.rate[instant]
        deepest, highest = max(deepest, then), max(highest, lift_then)
        if instant < last:
            rise = max(rise, (lift - lift_then) / (now.time - time))
        if instant > 0:
            fall = max(fall, (lift_before - lift_then) / (time - before))
            carried *= np.exp(before - time)
        passes_top |= carried > then and deborah * (now.time - time) < now.track.cells
        carried, before, lift_before = max(carried, then + second), time, lift_then
    if last > 0:
        step = history.time[last] - history.time[last - 1]
        fallen = (history.depth[last - 1] - depth) / step
        rise = max(rise, rate + (6 * fallen + 2 * history.rate[last - 1] + 4 * rate) / step)
    return Motion(rise, fall, deepest, highest, passes_top)


@jit_uncounted
def _search_period(search: Search, runs: IntArray) -> int:
    """Find the patches in one period of the line. Return the number of patches (see `find_contact`)."""
    now, work, scan, sums = search.now, search.work, search.work.scan, search.work.sums
    track, origin, lift = now.track, now.track.origin, search.lift
    sums[:] = 0.0
    scan[BEGIN] = scan[FREE_FROM] = scan[HELD] = origin
    scan[LOWEST] = 0.0
    # at the highest point, elements may have been free since the previous period, or since before the jump
    contact, found = search.depth >= displacement_at(now, work.recovery, origin)[0], 0
    if not contact:
        _add_separation(search, origin)
    for run in range(runs.shape[0]):
        i, stop = runs[run, 0], runs[run, 1]
        if not contact:
            scan[LOWEST] = 0.0  # the displacement is not computed between two runs of cells
        while True:
            i = _skip_pressed(search, i, stop) if contact else _skip_free(search, i, stop)
            if i >= stop:
                break
            if found + VISITS > work.start.size or work.recovery.count[0] + VISITS > work.recovery.place.size:
                return 0
            contact, found = _examine(search, i, contact, found)
            i += 1
        if contact and run + 1 < runs.shape[0]:
            return 0
    finish = track.cells + origin
    begin = scan[BEGIN] if contact else finish
    add_patch(track, begin, finish, lift, now.deborah, sums)
    work.start[found], work.end[found] = begin, finish
    sums[STIFFNESS] += sums[LENGTH] * (1 + now.history.stiff)
    sums[DRAG_STIFFNESS] += sums[TILT] * (1 + now.history.stiff)
    return found + 1


@jit_inline_uncounted
def _skip_pressed(search: Search, i: int, stop: int) -> int:
    """Return the first cell from i on in which contact may end or elements may have separated, but at most `stop`.

    A cell is skipped if no element has separated in the cell, if the force on elements in contact is positive in the
    cell, and if the displacement u of free elements stays below w = depth + h. Along the line u' = (drift - u) / D (see
    `free_recovery`). Therefore u stays below w wherever w + D h' exceeds the largest drift.
    """
    now, recovery, barriers = search.now, search.work.recovery, search.work.barriers
    begin, firm, until = search.work.scan[BEGIN], 0.0, 0.0
    oldest = recovery.earliest[0] if recovery.count[0] > 0 else begin
    while i < stop and begin <= i < search.n and keeps_pressed(now.track, barriers, now.deborah, i, search.lift):
        if i + 1 > until:
            k = window(2 * (i + 1 - oldest))
            firm = min(search.depth - recovery.bounds.most_drift[k], recovery.bounds.least_lift[k])
            until = oldest + WINDOW * 2.0**k
        if not barriers.cell[np.uintp(i)] < firm:
            break
        i += 1
    return i


@jit_inline_uncounted
def _skip_free(search: Search, i: int, stop: int) -> int:
    """Return the first cell from i on in which contact may begin, but at most `stop`."""
    now, scan, barriers = search.now, search.work.scan, search.work.barriers
    drift, fade = search.work.recovery.bounds.least_drift[WINDOWS - 1], np.exp(-1 / min(now.deborah, now.first.deborah))
    lowest = scan[LOWEST]
    while i < stop:
        lowest = (lowest - drift) * fade + drift  # this bound of the displacement approaches the least drift
        if search.depth > search.work.free_until[np.uintp(i)]:
            pressed = i >= search.n or keeps_pressed(now.track, barriers, now.deborah, i, search.lift)
            if pressed or search.lift > barriers.idle[np.uintp(i)]:
                break
        i += 1
    scan[LOWEST] = lowest
    return i


@jit_inline_uncounted
def _examine(search: Search, i: int, contact: bool, found: int) -> tuple[bool, int]:
    """Find where contact begins and ends in cell i.

    Return whether there is contact at the end of the cell, and the number of patches found so far.
    """
    now, work, scan, recovery = search.now, search.work, search.work.scan, search.work.recovery
    track, barriers = now.track, work.barriers
    pressed = i < search.n and keeps_pressed(track, barriers, now.deborah, i, search.lift)
    barrier = barriers.cell[np.uintp(i)] if i < search.n else search.lift
    weak = (contact or pressed) and barrier >= recovery.bounds.least_lift[WINDOWS - 1]
    separated = weak and _may_have_separated(search, i)
    if separated:
        _add_stretch(recovery, float(i), barrier)
    line, stop = cubic(track.height, track.enter, track.leave, i), min(i + 1.0, track.cells + track.origin)
    cell = Cell(i, line, stop, pressed, weak, separated)
    x, ended = max(float(i), scan[BEGIN] if contact else scan[FREE_FROM]), False
    for _ in range(VISITS):
        if contact:
            end, off, is_lost, by_force = _contact_end(search, cell, x)
            if not (is_lost or by_force):
                break
            _close_patch(search, end, is_lost, found)
            contact, found, x, ended = False, found + 1, off, True
            scan[FREE_FROM] = off
            if not by_force:
                break
            _add_separation(search, off)
        contact, x = _contact_begin(search, cell, x, ended)
        if contact:
            scan[BEGIN] = scan[HELD] = x
        elif x >= stop:
            break
        else:  # from here on, the force on an element in contact would be negative
            scan[FREE_FROM], ended = x, True
    return contact, found


@jit_inline_uncounted
def _contact_end(search: Search, cell: Cell, x: float) -> tuple[float, float, bool, bool]:
    """Find where contact ends in a cell beyond x.

    Return the place where contact ends, the place where the search continues, whether free elements arrive with a
    displacement larger than depth + h, and whether the force falls to zero. If contact does not end in the cell, both
    places are the end of the cell.
    """
    now, scan, recovery = search.now, search.work.scan, search.work.recovery
    place = NONE
    if not cell.pressed:
        place = x - cell.i
        if force_at(cell.line, search.lift, now.deborah, place) > 0:
            place = unloading(cell.line, search.lift, now.deborah, place)
    by_force = cell.i + place < cell.stop
    off = cell.i + place if by_force else cell.stop
    if cell.separated:
        scan[HELD] = off
    w = search.depth + height_at(now.track, off)[0]
    if w >= _overtaking(search, scan[HELD], off, w) * (1 - ROUNDING):
        return off, off, False, by_force
    low, end = x, off
    while end - low > ROUNDING:  # bisection: u of free elements exceeds depth + h at `end`, but not at `low`
        middle = 0.5 * (low + end)
        if search.depth + height_at(now.track, middle)[0] < displacement_at(now, recovery, middle)[0]:
            end = middle
        else:
            low = middle
    return end, off, True, by_force


@jit_inline_uncounted
def _overtaking(search: Search, held: float, x: float, w: float) -> float:
    """Return the displacement of free elements that may arrive at x inside a patch.

    The result may be 0 if no free element arrives with a displacement larger than w. An element in contact at x has the
    displacement w. The patch is certainly in contact up to `held`, and no element of the patch has separated between
    `held` and x.
    """
    now, recovery = search.now, search.work.recovery
    if x > held:
        w_held = search.depth + height_at(now.track, held)[0]
        drift = recovery.bounds.most_drift[window(x - recovery.earliest[0]) if recovery.count[0] > 0 else 0]
        slowest = max(now.deborah, now.first.deborah)
        if w >= max(w_held, drift) or w >= drift + (w_held - drift) * np.exp((held - x) / slowest):
            return from_before(now, x, w)[0] if x - now.deborah * now.time > held else 0.0
    return displacement_at(now, recovery, x)[0]


@jit_inline_uncounted
def _close_patch(search: Search, end: float, is_lost: bool, found: int) -> None:
    """Store the current patch, and add it to the sums.

    Also store a lower bound of the displacement of free elements one cell beyond the patch.
    """
    now, motion, work, scan = search.now, search.motion, search.work, search.work.scan
    if is_lost:
        _, slope, _, by_depth, opening = gap_at(now, work.recovery, end)
        _add_edge(search, end, -slope, by_depth, opening)
    add_patch(now.track, scan[BEGIN], end, search.lift, now.deborah, work.sums)
    work.start[found], work.end[found] = scan[BEGIN], end
    w = search.depth + height_at(now.track, end)[0]
    prune(now, work.recovery, end, w, motion.deepest)
    scan[LOWEST] = _lowest_beyond(search, w)


@jit_inline_uncounted
def _lowest_beyond(search: Search, u: float) -> float:
    """Return a lower bound of the displacement of free elements one cell after a place with the displacement u."""
    now, drift = search.now, search.work.recovery.bounds.least_drift[WINDOWS - 1]
    return float((u - drift) * np.exp(-1 / min(now.deborah, now.first.deborah)) + drift)


@jit_inline_uncounted
def _contact_begin(search: Search, cell: Cell, x: float, ended: bool) -> tuple[bool, float]:
    """Return True and the place where contact begins beyond x in a cell, or False and the place to search next.

    Contact can begin only between `low`, where the force becomes positive, and `high`, where the force falls to zero
    again. If contact does not begin and `high` is in the cell, `high` is stored as a place of separation, because
    elements may have separated there at an earlier instant. If `ended` is True, contact has just ended at x, or the
    force has just fallen to zero at x.
    """
    now, scan, recovery = search.now, search.work.scan, search.work.recovery
    i, line, lift, depth = cell.i, cell.line, search.lift, search.depth
    low, high = x - i, NONE
    if not cell.pressed:
        if ended or force_at(line, lift, now.deborah, low) <= 0:
            low = loading(line, lift, now.deborah, low)
        if i + low >= cell.stop:
            return False, cell.stop
        high = unloading(line, lift, now.deborah, low)
    by_force = i + high < cell.stop
    probe, peak = i + high if by_force else cell.stop, depth + now.track.peak[np.uintp(i)]
    if not (by_force or cell.weak) and peak <= scan[LOWEST]:
        return False, cell.stop
    u, u_slope, _ = displacement_at(now, recovery, probe)
    scan[LOWEST] = _lowest_beyond(search, u) if by_force else u
    h, slope, _ = height_at(now.track, probe)
    gap, top = depth + h - u, probe
    if gap <= 0 and gap > (slope - u_slope) * (probe - i - low):
        top, gap = nearest_approach(now, recovery, i + low, probe)
    if gap > 0:
        guess = i + meeting(line, depth, u, u_slope, probe - i, low)
        begin, steep, by_depth, opening = contact_begin(now, recovery, i + low, top, guess)
        _add_edge(search, begin, steep, by_depth, opening)
        return True, begin
    if not by_force:
        return False, cell.stop
    _add_separation(search, probe)
    return False, probe


@jit_inline_uncounted
def _add_edge(search: Search, place: float, steep: float, by_depth: float, opening: float) -> None:
    """Add to the sums the derivatives of load and drag that are due to the motion of an edge with a positive force.

    `steep` is the slope of the gap towards the inside of the patch. `by_depth` and `opening` are the derivatives of the
    gap with respect to depth and time.
    """
    sums = search.work.sums
    h, slope, _ = height_at(search.now.track, place)
    force = search.lift + h + search.now.deborah * slope
    if force > 0 and steep > 0:
        edge = force / steep
        sums[STIFFNESS] += edge * by_depth
        sums[DRAG_STIFFNESS] += edge * by_depth * slope
        sums[GROWTH] += edge * opening
        sums[DRAG_GROWTH] += edge * opening * slope


@jit_inline_uncounted
def _add_separation(search: Search, place: float) -> None:
    """Add a place of separation, with the farthest place where the force may have fallen to zero since the jump."""
    now, recovery, highest = search.now, search.work.recovery, search.motion.highest
    i = min(int(place), search.n)
    h, slope, _ = height_at(now.track, i + 1.0)
    if highest + h + now.deborah * slope > 0:
        i += 1
        while i < search.n and keeps_pressed(now.track, search.work.barriers, now.deborah, i, highest):
            i += 1
    k = recovery.count[0]
    recovery.earliest[k] = recovery.place[k] = place
    recovery.farthest[k], recovery.barrier[k] = i + 1.0, np.inf
    recovery.count[0] = k + 1


@jit_inline_uncounted
def _add_stretch(recovery: FreeRecovery, cell: float, barrier: float) -> None:
    """Add to `recovery` a cell in which elements may have separated earlier, although the force is positive now.

    If the last entry is a run that ends at this cell, the run is extended.
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
    """Return three Bernstein coefficients of the slope of the force in a cell. The coefficients enclose the slope."""
    _, c1, c2, c3 = cubic(track.height, track.enter, track.leave, i)
    enter, bend, turn = c1 + 2 * deborah * c2, c2 + 3 * deborah * c3, 3 * c3
    return enter, enter + bend, enter + 2 * bend + turn


@jit_inline_uncounted
def _may_have_separated(search: Search, i: int) -> bool:
    """Return whether elements may have separated in or just before cell i, although the force is positive now."""
    track, motion, deborah = search.now.track, search.motion, search.now.deborah
    start, middle, end = _force_slopes(track, deborah, i)
    if deborah * max(start, middle, end) <= -motion.rise:
        return False
    least = min(start, middle, end)
    if i > 0:
        least = min(least, _force_slopes(track, deborah, i - 1)[2])
    return bool(deborah * least < motion.fall)
