"""Friction after a jump of the velocity at constant load, from one steady state to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator

from mdr_dask.physics.kinetics_kernels import BLOCK, CANDIDATES, WINDOWS, block_least, touch
from mdr_dask.physics.kinetics_march import Pace, march
from mdr_dask.physics.kinetics_profile import (
    DRAG,
    DRAG_STIFFNESS,
    LENGTH,
    LOAD,
    STIFFNESS,
    SUMS,
    TILT,
    Course,
    Patches,
    Profile,
    cubic_profile,
    height_at,
    released,
)
from mdr_dask.physics.sliding import INVALID as STEADY_INVALID
from mdr_dask.physics.sliding import steady_sliding

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

CONVERGED, NOT_CONVERGED, INVALID, STRAYED = 0, 1, 2, 3
MESSAGES = {
    NOT_CONVERGED: "the depth for the load was not found at one moment after the jump",
    INVALID: "load, velocity and profile must be finite, the load and both velocities positive",
    STRAYED: "friction after the jump did not come to the steady state at the new velocity",
}
STEPS_PER_DECADE = 24
MISS = 0.01  # of the change of depth: what a step may differ from a parabola through the ones before
NEGLIGIBLE = 1e-5  # of the mean displacement: changes of depth that need no finer steps
NEWTON = 0.03  # of the change of depth: the step of Newton whose square is left out, at 8 steps a decade or fewer
EQUILIBRIUM = 5e-5  # of depth and drag, at 24 steps a decade
MOMENTS = 3000
SHARE = 0.1  # of the accuracy: how near to its end friction is left
LONG, STRAY = 15.0, 0.02  # relaxation times after which friction has come so near to its end, of all its changes
FIRST_STEP = 0.02  # of the time in which 1 / q_max is passed, and of tau
WIDENINGS = 3
LONG_LINE = 40_000  # nodes from which on depths are looked for on every other one first
DOUBT = 2e-3  # of the depth: how far off it may be there


class Jump(NamedTuple):
    """Friction before, at and after a jump of the velocity.

    Parameters
    ----------
    before, at, after : float
        F_x / (4 G L) in the unit of height squared over that of length, steady at v_1, at t_0+, and steady at v_2.
    trace : array, shape (times,)
        The same at the times asked for.
    depth : array, shape (2,)
        Depth before and after.
    moments : int
        Number of moments computed; the rest is in equilibrium.
    left_out : float
        Estimated size of a transient that is not computed, because all of it lies within the accuracy.
    status : int
        `CONVERGED` or a key of `MESSAGES`.
    """

    before: float
    at: float
    after: float
    trace: FloatArray
    depth: FloatArray
    moments: int
    left_out: float
    status: int


@njit(nogil=True, cache=True)
def _patches(profile: Profile, start: FloatArray, end: FloatArray, found: int, depth: float, reach: float) -> Patches:
    """Return the patches found at a depth, with the displacements that they leave with."""
    pressed = np.empty(found)
    for k in range(found):
        pressed[k] = depth + height_at(profile, end[k])[0]
    return Patches(start[:found].copy(), end[:found].copy(), pressed, found, depth, reach, np.zeros(1, np.int64))


@njit(nogil=True, cache=True)
def _settle(
    profile: Profile, runs: IntArray, floor: FloatArray, reach: float, load: float, depth: float, sums: FloatArray
) -> tuple[Patches, bool]:
    """Find the steady state at a load, from a depth near it."""
    start, end = np.empty(floor.size), np.empty(floor.size)
    none = _patches(profile, start, end, 0, 0.0, 1.0)
    places, spreads = np.empty(CANDIDATES), np.empty(WINDOWS)
    least = np.empty(floor.size // BLOCK)
    block_least(profile, reach, least)
    moment, at, rate = np.array([np.inf]), np.array([depth]), np.zeros(1)
    converged, found = False, 0
    for _ in range(60):
        found = touch(
            profile,
            runs,
            floor,
            least,
            none,
            Course(moment, at, rate, 1, 0.0),
            np.inf,
            reach,
            start,
            end,
            sums,
            places,
            spreads,
        )
        if found < 0:
            break
        if abs(sums[LOAD] - load) <= 1e-12 * load:
            converged = True
            break
        step = (load - sums[LOAD]) / sums[STIFFNESS]
        if abs(step) < 1e-14 * abs(at[0]):
            converged = True
            break
        at[0] += step
    converged = converged or (found > 0 and abs(sums[LOAD] - load) <= 1e-8 * load)
    return _patches(profile, start, end, max(found, 0), at[0], reach), converged


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


@njit(nogil=True, cache=True)
def _release(profile: Profile, first: Patches, reach: float, load: float, sums: FloatArray) -> tuple[float, bool]:
    """Solve the jump condition: the rate of the depth that carries the load right after the jump."""
    rate = 0.0
    for _ in range(60):
        released(profile, first, reach, rate, sums)
        if abs(sums[LOAD] - load) <= 1e-13 * load or sums[LENGTH] <= 0:
            break
        rate += (load - sums[LOAD]) / sums[LENGTH]
    return rate, abs(sums[LOAD] - load) <= 1e-9 * load


def _full(state: Patches, profile: Profile) -> bool:
    """Return whether all of a periodic line is in contact: then u = d + p, d is constant and nothing relaxes."""
    return state.count == 1 and profile.periodic and state.end[0] - state.start[0] >= 1


def _reachable(profile: Profile, floor: FloatArray, highest: float) -> IntArray:
    """Return the stretches of nodes in which an element can be in contact up to a depth."""
    active = highest + profile.height > floor
    active[1:] |= active[:-1].copy()
    active[:-1] |= active[1:].copy()
    edges = np.flatnonzero(np.diff(np.concatenate([[False], active, [False]]).astype(np.int8)))
    runs: IntArray = edges.reshape(-1, 2).astype(np.int64)
    runs[:, 1] = np.minimum(runs[:, 1], profile.height.size - 1)
    return runs


def pace_after(last: float, reach: float, wavenumber: float, per_decade: float, change: float, load: float) -> Pace:
    """Return steps from a part of the time in which 1 / q_max is passed, growing in a constant ratio, up to `last`.

    Parameters
    ----------
    last : float
        Last time, in relaxation times.
    reach : float
        v_2 tau / L.
    wavenumber : float
        q_max L of the profile.
    per_decade : float
        Steps in a factor ten of the time.
    change : float
        Difference of the depths before and after.
    load : float
        F_N / (4 G L), in the same unit.
    """
    finer = STEPS_PER_DECADE / per_decade
    first = FIRST_STEP * finer * min(1.0, 1 / (wavenumber * reach))
    scale = max(abs(change), NEGLIGIBLE * load)
    close = NEWTON * min(1.0, (8 / per_decade) ** 2)
    return Pace(first, 10 ** (1 / per_decade), MISS * finer**3 * scale, close * scale, last)


def velocity_jump(
    height: FloatArray,
    slope: FloatArray,
    load: float,
    reaches: tuple[float, float],
    times: FloatArray,
    wavenumber: float,
    per_decade: float = STEPS_PER_DECADE,
    accuracy: float = 0.0,
) -> Jump:
    """Return the friction of a Kelvin foundation on a periodic line through a jump of the velocity at constant load.

    The start is the direct steady state at v_1; the instant t_0+ solves the jump condition (displacements and depth
    do not change at once, the rate of the depth does); then the depth is marched by backward differentiation of order
    three over graded steps, with every contact edge solved at every moment (thesis 4.2 with the indentation rate kept).

    Parameters
    ----------
    height, slope : array, shape (n,)
        See :func:`mdr_dask.physics.kinetics_profile.cubic_profile`.
    load : float
        F_N / (4 G L), in the unit of height.
    reaches : tuple of float
        v_1 tau / L and v_2 tau / L.
    times : array, shape (m,)
        (t - t_0) / tau at which friction is wanted, increasing.
    wavenumber : float
        q_max L, which fixes the first step.
    per_decade : float
        Steps in a factor ten of the time.
    accuracy : float
        Error allowed for the trace, over the friction at the end: a transient that is smaller is not computed, another
        one ends when drag and depth have stayed within a tenth of it.

    Returns
    -------
    Jump
        With ``mu = drag / load`` times height over length.
    """
    cases = np.array([load]), np.array([reaches])
    return velocity_jumps(height, slope, *cases, times, wavenumber, per_decade, np.array([accuracy]))[0]


def velocity_jumps(
    height: FloatArray,
    slope: FloatArray,
    loads: FloatArray,
    reaches: FloatArray,
    times: FloatArray,
    wavenumber: float,
    per_decade: float,
    accuracies: FloatArray,
) -> list[Jump]:
    """Return the jumps of many cases on one line, whose steady states are found together; see :func:`velocity_jump`.

    Parameters
    ----------
    height, slope : array, shape (n,)
    loads, accuracies : array, shape (cases,)
    reaches : array, shape (cases, 2)
    times, wavenumber, per_decade
        As of one case, which does not depend on the others.
    """
    failed = Jump(np.nan, np.nan, np.nan, np.full(times.size, np.nan), np.full(2, np.nan), 0, 0.0, INVALID)
    if not np.all(np.isfinite(height)):
        return [failed] * loads.size
    every = 2 if height.size >= LONG_LINE and height.size % 2 == 0 else 1
    steady = steady_sliding(height[::every], slope[::every], reaches.ravel(), np.repeat(loads, 2), contact=False)
    depths, states = steady.depth.reshape(-1, 2), steady.status.reshape(-1, 2)
    profile, top = cubic_profile(height, slope)
    equilibrium = EQUILIBRIUM * (STEPS_PER_DECADE / per_decade) ** 3
    jumps = []
    for k in range(loads.size):
        if states[k].any():
            jumps.append(failed._replace(status=INVALID if STEADY_INVALID in states[k] else NOT_CONVERGED))
            continue
        change = float(depths[k, 1] - depths[k, 0])
        pace = pace_after(float(times[-1]), reaches[k, 1], wavenumber, per_decade, change, loads[k])
        ends = float(accuracies[k]), equilibrium, DOUBT if every > 1 else 0.0
        jump = _relax(
            profile, float(loads[k]), (float(reaches[k, 0]), float(reaches[k, 1])), depths[k] + top, times, pace, ends
        )
        jumps.append(jump._replace(depth=jump.depth - top))
    return jumps


def _relax(
    profile: Profile,
    load: float,
    reaches: tuple[float, float],
    depths: FloatArray,
    times: FloatArray,
    pace: Pace,
    ends: tuple[float, float, float],
) -> Jump:
    """Solve both steady states on one profile and march between them."""
    sums = np.empty(SUMS)
    failed = Jump(np.nan, np.nan, np.nan, np.full(times.size, np.nan), np.full(2, np.nan), 0, 0.0, NOT_CONVERGED)
    floor = np.zeros(profile.height.size)
    low, high = float(depths.min()), float(depths.max())
    accuracy, equilibrium, doubt = ends
    margin = 0.25 * (high - low) + NEGLIGIBLE * load + doubt * high
    for _ in range(WIDENINGS):
        floor[:] = 0.0
        everywhere = _reachable(profile, floor, high + margin)
        lowest = _settle_at(profile, everywhere, floor, min(reaches), low - margin)
        _fill(profile, lowest, floor)
        runs = _reachable(profile, floor, high + margin)
        first, good_first = _settle(profile, runs, floor, reaches[0], load, float(depths[0]), sums)
        before = sums[DRAG]
        last, good_last = _settle(profile, runs, floor, reaches[1], load, float(depths[1]), sums)
        after, by_depth = sums[DRAG], abs(sums[DRAG_STIFFNESS] * (last.depth - first.depth))
        known = low - margin <= min(first.depth, last.depth) and max(first.depth, last.depth) <= high + margin
        if not (good_first and good_last and known):
            margin *= 4
            continue
        ended = np.array([first.depth, last.depth])
        if _full(first, profile) and _full(last, profile):
            return Jump(before, after, after, np.full(times.size, after), ended, 0, 0.0, CONVERGED)
        rate, good = _release(profile, first, reaches[1], load, sums)
        if not good:
            return failed
        at = sums[DRAG]
        # the difference of its ends alone does not bound a transient, which may cross its end
        transient = abs(at - after) + abs(rate * sums[TILT]) + by_depth
        if transient <= accuracy * after:
            trace = np.where(times > 0, after, at)
            return Jump(before, at, after, trace, ended, 0, transient, CONVERGED)
        settled = max(equilibrium, SHARE * accuracy * after / max(transient, 1e-300))
        course = np.empty((4, MOMENTS))
        course[:, 0] = 0.0, first.depth, rate, at
        count, status = march(
            profile,
            runs,
            floor,
            first,
            reaches[1],
            load,
            pace,
            (low - margin, high + margin),
            (last.depth, after, max(10 * equilibrium, settled) * abs(last.depth - first.depth), settled),
            *course,
        )
        if status == 1:
            return failed
        strays = course[0, count - 1] >= LONG and abs(course[3, count - 1] - after) > STRAY * np.ptp(course[3, :count])
        if status == 0 and strays:
            return failed._replace(status=STRAYED)
        if status == 0:
            trace = _at_times(course[0, :count], course[3, :count], times, after)
            return Jump(before, course[3, 0], after, trace, ended, count, 0.0, CONVERGED)
        margin *= 4
    return failed


@njit(nogil=True, cache=True)
def _settle_at(profile: Profile, runs: IntArray, floor: FloatArray, reach: float, depth: float) -> Patches:
    """Return the steady state at a depth."""
    start, end, sums = np.empty(floor.size), np.empty(floor.size), np.empty(SUMS)
    none = _patches(profile, start, end, 0, 0.0, 1.0)
    places, spreads = np.empty(CANDIDATES), np.empty(WINDOWS)
    least = np.empty(floor.size // BLOCK)
    block_least(profile, reach, least)
    course = Course(np.array([np.inf]), np.array([depth]), np.zeros(1), 1, 0.0)
    found = max(touch(profile, runs, floor, least, none, course, np.inf, reach, start, end, sums, places, spreads), 0)
    return _patches(profile, start, end, found, depth, reach)


def _at_times(moments: FloatArray, drag: FloatArray, times: FloatArray, after: float) -> FloatArray:
    """Interpolate over log time by a modified Akima curve, which no kink makes overshoot; linear in the first step."""
    scale = moments[1]
    curve = Akima1DInterpolator(np.log1p(moments / scale), drag, method="makima")
    trace: FloatArray = curve(np.log1p(times / scale))
    trace[times > moments[-1]] = after
    return trace
