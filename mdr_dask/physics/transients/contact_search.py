"""Compiled parts of the velocity jump: who touches what at one moment."""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.compiling import compiled, inlined
from mdr_dask.physics.transients.free_flight import (
    left_before,
    losing,
    meeting,
    next_free_place,
    spread_over,
    wake_at,
    worth_keeping,
    write_spreads,
)
from mdr_dask.physics.transients.patches import (
    DRAG_STIFFNESS,
    LENGTH,
    STIFFNESS,
    TILT,
    Course,
    Patches,
    Profile,
    add_patch,
    height_at,
    unloading,
)

CANDIDATES = 8
BLOCK = 16
WINDOW_CELLS = 64.0
WINDOWS = 12
GUARD_CELLS = 200.0


@compiled
def block_least(profile: Profile, reach: float, least: FloatArray) -> None:
    """Write the least p + reach p' over the nodes that end the cells of each block of `BLOCK` cells."""
    for m in range(least.size):
        value = np.inf
        for i in range(m * BLOCK + 1, (m + 1) * BLOCK + 1):
            value = min(value, profile.height[i] + reach * profile.slope[i])
        least[m] = value


@inlined
def _write_patch(
    profile: Profile,
    begin: float,
    until: float,
    lift: float,
    reach: float,
    found: int,
    start: FloatArray,
    end: FloatArray,
    sums: FloatArray,
) -> int:
    """Write a patch, add up its forces and return how many there are now."""
    add_patch(profile, begin, until, lift, reach, sums)
    start[found], end[found] = begin, until
    return found + 1


@inlined
def _remember(place: float, places: FloatArray, known: int) -> int:
    """Write down where contact was left, over the last place where there is no more room; count the places."""
    known = min(known, CANDIDATES - 1)
    places[known] = place
    return known + 1


@inlined
def _leaving(
    profile: Profile,
    first: Patches,
    t: float,
    reach: float,
    depth: float,
    lift: float,
    part: tuple[float, float],
    pulls: bool,
    next_free: float,
) -> tuple[float, bool, float]:
    """Return until where contact lasts in a part of a cell, whether to elements free at the jump, and the next ones."""
    low, high = part
    until = unloading(profile, lift, reach, low, high) if pulls else high
    if until < next_free:
        return until, False, next_free
    w = depth + height_at(profile, until)[0]
    next_free = next_free_place(profile, first, t, reach, until)
    if next_free == until and w < left_before(profile, first, t, reach, until)[0] * (1 - 1e-14):
        return losing(profile, first, t, reach, depth, low, until), True, next_free
    return until, False, next_free


@inlined
def _arriving(
    profile: Profile,
    first: Patches,
    course: Course,
    t: float,
    reach: float,
    lift: float,
    part: tuple[float, float],
    gap: float,
    rise: float,
    places: FloatArray,
    known: int,
    oldest: float,
) -> tuple[float, float, float]:
    """Return where contact begins in a part of a cell, and how load and drag change by the depth as that place moves.

    At the end of the part the profile is above the wake by `gap`, and rises from it by `rise`.
    """
    low, high = part
    guess = high - gap / rise if rise > 0 else low
    begin, rise, gain = meeting(profile, first, course, t, reach, low, high, guess, places, known, oldest)
    h, slope, _ = height_at(profile, begin)
    edge = max(lift + h + reach * slope, 0.0) * gain / rise if rise > 0 else 0.0
    return begin, edge, edge * slope


@compiled
def touch(
    profile: Profile,
    runs: IntArray,
    floor: FloatArray,
    least: FloatArray,
    first: Patches,
    course: Course,
    t: float,
    reach: float,
    start: FloatArray,
    end: FloatArray,
    sums: FloatArray,
    places: FloatArray,
    spreads: FloatArray,
) -> int:
    """Find the patches in contact at time t, at the last depth and rate of the course, and add up their forces.

    Parameters
    ----------
    profile : Profile
    runs : int array, shape (m, 2)
        First and last node of the stretches in which contact is possible.
    floor : array, shape of the profile
        Displacement that a free element has at least.
    least : array
        See :func:`block_least`.
    first : Patches
        State before the jump; ``count = 0`` for the steady state.
    course : Course
        Depth and rate, this moment included.
    t, reach : float
        Time since the jump, and v tau / L since then.
    start, end : array
        Written: the patches.
    sums : array, shape (SUMS,)
        Written: load and drag over 4 G L, length in contact, rise over it, derivatives of load and drag by the depth.
    places, spreads : array, shape (CANDIDATES,), (WINDOWS,)
        Room.

    Returns
    -------
    int
        Number of patches, or -1 if a patch does not end within its stretch or there are more than fit.
    """
    depth = course.depth[course.count - 1]
    lift = depth + course.rate[course.count - 1]
    height, slope, cell = profile.height, profile.slope, profile.cell
    known, found, edges, edges_drag = 0, 0, 0.0, 0.0
    oldest, last_start = -np.inf, -np.inf
    contact, begin, free_from = profile.periodic, profile.origin, 0.0
    finish = 1.0 + profile.origin if profile.periodic else np.inf
    guard = first.count > 0 and reach * t < GUARD_CELLS * cell
    next_free = next_free_place(profile, first, t, reach, begin) if guard and contact else np.inf
    window = WINDOW_CELLS * cell
    write_spreads(course, t, reach, window, spreads)
    fade_of_cell = np.exp(-cell / (min(reach, first.reach) if first.count > 0 else reach))
    least_free, known_at = 0.0, 0.0
    sums[:] = 0.0
    for run in range(runs.shape[0]):
        i, stop = runs[run, 0], runs[run, 1]
        if not contact:
            known_at = -np.inf
        while i < stop:
            whole = contact and i % BLOCK == 0 and i + BLOCK < stop and (i + BLOCK) * cell < next_free
            if whole and lift + least[i // BLOCK] > 0:
                i += BLOCK
                continue
            x0, x1, h1, slope1 = i * cell, (i + 1) * cell, height[i + 1], slope[i + 1]
            i += 1
            if x1 > finish:
                x1 = finish
                h1, slope1, _ = height_at(profile, x1)
            pulls = lift + h1 + reach * slope1 <= 0
            if contact:
                until, lost, next_free = _leaving(
                    profile, first, t, reach, depth, lift, (max(x0, begin), x1), pulls, next_free
                )
                if not (pulls or lost):
                    continue
                if found + 1 >= start.size:
                    return -1
                found = _write_patch(profile, begin, until, lift, reach, found, start, end, sums)
                w = depth + height_at(profile, until)[0]
                known = worth_keeping(profile, course, t, reach, until, w, spreads, window, places, known)
                least_free, known_at = (w - spreads[0]) * fade_of_cell, until
                oldest, last_start = last_start, begin
                if not lost:
                    known = _remember(until, places, known)
                contact, free_from = False, until
                continue
            least_free *= fade_of_cell
            highest = depth + max(h1, height[i - 1])
            if slope[i - 1] > 0 > slope1:
                highest += 0.5 * cell * min(slope[i - 1], -slope1)
            if highest <= min(floor[i - 1], floor[i]) or (highest < least_free and x1 - known_at < window):
                continue
            low, probe = max(x0, free_from), x1
            if pulls:
                if lift + height[i - 1] + reach * slope[i - 1] <= 0 or free_from > x0:
                    continue
                probe = unloading(profile, lift, reach, low, x1)
                h1, slope1, _ = height_at(profile, probe)
            u, u_slope, _ = wake_at(profile, first, course, t, reach, probe, places, known, oldest)
            gap, rise = depth + h1 - u, slope1 - u_slope
            spread = spread_over(spreads, window, 2 * (probe - places[0]) + window) if known > 0 else spreads[0]
            least_free, known_at = (u - spread) * fade_of_cell, probe
            if gap > 0:
                begin, edge, edge_drag = _arriving(
                    profile, first, course, t, reach, lift, (low, probe), gap, rise, places, known, oldest
                )
                edges, edges_drag = edges + edge, edges_drag + edge_drag
                contact = True
                next_free = next_free_place(profile, first, t, reach, begin) if guard else np.inf
            if pulls and gap > -2 * spread:
                if contact:
                    if found + 1 >= start.size:
                        return -1
                    found = _write_patch(profile, begin, probe, lift, reach, found, start, end, sums)
                    oldest, last_start = last_start, begin
                known = worth_keeping(profile, course, t, reach, probe, depth + h1, spreads, window, places, known)
                known = _remember(probe, places, known)
                contact, free_from = False, probe
        if contact and run + 1 < runs.shape[0]:
            return -1
    if contact and not profile.periodic:
        return -1
    if profile.periodic:
        begin = begin if contact else finish
        found = _write_patch(profile, begin, finish, lift, reach, found, start, end, sums)
    sums[STIFFNESS] = sums[LENGTH] * (1 + course.stiff) + edges
    sums[DRAG_STIFFNESS] = sums[TILT] * (1 + course.stiff) + edges_drag
    return found
