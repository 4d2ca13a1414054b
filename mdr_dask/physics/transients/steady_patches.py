"""The steady states before and after a velocity jump, on the profile along which the jump is marched."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.transients.contact_search import BLOCK, CANDIDATES, WINDOWS, block_least, touch
from mdr_dask.physics.transients.patches import (
    DRAG,
    DRAG_STIFFNESS,
    LOAD,
    STIFFNESS,
    SUMS,
    Course,
    Patches,
    Profile,
    height_at,
)


class Ends(NamedTuple):
    """The steady states between which a jump leads, and where elements can be in contact on the way.

    Parameters
    ----------
    first, last : Patches
        Contact before, and long after.
    before, after : float
        Their drags over 4 G L.
    by_depth : float
        How much the drag changes by the change of the depth, at the stiffness of the last state.
    limits : tuple of float
        Least and greatest depth for which `runs` and `floor` hold.
    runs : int array, shape (m, 2)
        First and last node of the stretches in which contact is possible.
    floor : array, shape of the profile
        Displacement that a free element has at least.
    """

    first: Patches
    last: Patches
    before: float
    after: float
    by_depth: float
    limits: tuple[float, float]
    runs: IntArray
    floor: FloatArray


def steady_ends(
    profile: Profile, load: float, reaches: tuple[float, float], depths: FloatArray, limits: tuple[float, float]
) -> Ends | None:
    """Return the steady states at a load before and after a jump, or None if they are not found within the limits.

    Parameters
    ----------
    profile : Profile
    load : float
        F_N / (4 G L), in the unit of height.
    reaches : tuple of float
        v_1 tau / L and v_2 tau / L.
    depths : array, shape (2,)
        Depths near those wanted.
    limits : tuple of float
        Least and greatest depth.
    """
    floor, sums = np.zeros(profile.height.size), np.empty(SUMS)
    everywhere = _reachable(profile, floor, limits[1])
    _fill(profile, _settle_at(profile, everywhere, floor, min(reaches), limits[0]), floor)
    runs = _reachable(profile, floor, limits[1])
    first, good_first = _settle(profile, runs, floor, reaches[0], load, float(depths[0]), sums)
    before = sums[DRAG]
    last, good_last = _settle(profile, runs, floor, reaches[1], load, float(depths[1]), sums)
    known = limits[0] <= min(first.depth, last.depth) and max(first.depth, last.depth) <= limits[1]
    if not (good_first and good_last and known):
        return None
    by_depth = abs(sums[DRAG_STIFFNESS] * (last.depth - first.depth))
    return Ends(first, last, before, sums[DRAG], by_depth, limits, runs, floor)


def _reachable(profile: Profile, floor: FloatArray, highest: float) -> IntArray:
    """Return the stretches of nodes in which an element can be in contact up to a depth."""
    active = highest + profile.height > floor
    active[1:] |= active[:-1].copy()
    active[:-1] |= active[1:].copy()
    edges = np.flatnonzero(np.diff(np.concatenate([[False], active, [False]]).astype(np.int8)))
    runs: IntArray = edges.reshape(-1, 2).astype(np.int64)
    runs[:, 1] = np.minimum(runs[:, 1], profile.height.size - 1)
    return runs


class _Search(NamedTuple):
    """Room to look for the contact of a steady state in, `least` of :func:`block_least` and no state before it."""

    least: FloatArray
    none: Patches
    start: FloatArray
    end: FloatArray
    places: FloatArray
    spreads: FloatArray


@njit(nogil=True, cache=True)
def _search(profile: Profile, size: int, reach: float) -> _Search:
    start, end, least = np.empty(size), np.empty(size), np.empty(size // BLOCK)
    block_least(profile, reach, least)
    none = _patches(profile, start, end, 0, 0.0, 1.0)
    return _Search(least, none, start, end, np.empty(CANDIDATES), np.empty(WINDOWS))


@njit(nogil=True, cache=True)
def _touch_at(
    profile: Profile, runs: IntArray, floor: FloatArray, search: _Search, reach: float, depth: float, sums: FloatArray
) -> int:
    """Find the patches of a steady state at a depth; see :func:`touch`."""
    least, none, start, end, places, spreads = search
    course = Course(np.array([np.inf]), np.array([depth]), np.zeros(1), 1, 0.0)
    return touch(profile, runs, floor, least, none, course, np.inf, reach, start, end, sums, places, spreads)


@njit(nogil=True, cache=True)
def _settle(
    profile: Profile, runs: IntArray, floor: FloatArray, reach: float, load: float, depth: float, sums: FloatArray
) -> tuple[Patches, bool]:
    """Find the steady state at a load, from a depth near it."""
    search = _search(profile, floor.size, reach)
    converged, found = False, 0
    for _ in range(60):
        found = _touch_at(profile, runs, floor, search, reach, depth, sums)
        if found < 0:
            break
        step = (load - sums[LOAD]) / sums[STIFFNESS]
        converged = abs(sums[LOAD] - load) <= 1e-12 * load or abs(step) < 1e-14 * abs(depth)
        if converged:
            break
        depth += step
    converged = converged or (found > 0 and abs(sums[LOAD] - load) <= 1e-8 * load)
    return _patches(profile, search.start, search.end, max(found, 0), depth, reach), converged


@njit(nogil=True, cache=True)
def _settle_at(profile: Profile, runs: IntArray, floor: FloatArray, reach: float, depth: float) -> Patches:
    """Return the steady state at a depth."""
    search = _search(profile, floor.size, reach)
    found = max(_touch_at(profile, runs, floor, search, reach, depth, np.empty(SUMS)), 0)
    return _patches(profile, search.start, search.end, found, depth, reach)


@njit(nogil=True, cache=True)
def _patches(profile: Profile, start: FloatArray, end: FloatArray, found: int, depth: float, reach: float) -> Patches:
    """Return the patches found at a depth, with the displacements that they leave with."""
    pressed = np.empty(found)
    for k in range(found):
        pressed[k] = depth + height_at(profile, end[k])[0]
    return Patches(start[:found].copy(), end[:found].copy(), pressed, found, depth, reach, np.zeros(1, np.int64))


@njit(nogil=True, cache=True)
def _fill(profile: Profile, state: Patches, floor: FloatArray) -> None:
    """Write the displacement of a steady state at the nodes."""
    k = -1
    for i in range(floor.size):
        x = i * profile.cell
        while k + 1 < state.count and state.start[k + 1] <= x:
            k += 1
        if k < 0:
            floor[i] = -np.inf if profile.periodic else 0.0
        elif x <= state.end[k]:
            floor[i] = state.depth + profile.height[i]
        else:
            floor[i] = state.pressed[k] * np.exp(-(x - state.end[k]) / state.reach)
