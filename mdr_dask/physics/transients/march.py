"""Compiled parts of the velocity jump: the march of the depth through time at constant load."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.compiling import compiled
from mdr_dask.physics.transients.contact_search import BLOCK, CANDIDATES, WINDOWS, block_least, touch
from mdr_dask.physics.transients.patches import DRAG, DRAG_STIFFNESS, LOAD, STIFFNESS, SUMS, Course, Patches, Profile

TRIALS = 80
EXACT = 1e-11  # of the load
MANY, CAREFUL = 100, 0.1  # with fewer patches than many the load bends more with the depth: smaller steps are trusted
SETTLED = 2.5  # times the time since when a march has been near its end: where it ends


@compiled
def _rate_weights(time: FloatArray, depth: FloatArray, now: int, order: int) -> tuple[float, float]:
    """Return a and b of d_dot = a d + b at moment `now`, from the polynomial through the last depths (BDF)."""
    t = time[now]
    a, b = 0.0, 0.0
    for j in range(1, order + 1):
        a += 1 / (t - time[now - j])
    for j in range(1, order + 1):
        weight = 1 / (time[now - j] - t)
        for m in range(1, order + 1):
            if m != j:
                weight *= (t - time[now - m]) / (time[now - j] - time[now - m])
        b += weight * depth[now - j]
    return a, b


class Pace(NamedTuple):
    """How the steps of a march go.

    Parameters
    ----------
    first : float
        First step.
    growth : float
        Largest ratio of one step to the one before.
    miss : float
        Largest difference, in depth, of what a parabola foretells from what is found.
    close : float
        Largest change of depth that one step of Newton is trusted with.
    until : float
        Last time.
    """

    first: float
    growth: float
    miss: float
    close: float
    until: float


@compiled
def _balance(
    profile: Profile,
    runs: IntArray,
    floor: FloatArray,
    least: FloatArray,
    first: Patches,
    course: Course,
    reach: float,
    load: float,
    weights: tuple[float, float],
    limits: tuple[float, float],
    close: float,
    room: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray],
) -> tuple[int, float]:
    """Find the depth that carries the load at the last moment of the course, by Newton steps.

    Returns
    -------
    status : int
        0 found, 1 not found, 2 limits exceeded.
    drag : float
    """
    now = course.count - 1
    guess, (a, b) = course.depth[now], weights
    start, end, sums, places, spreads = room
    low, high = limits
    for trial in range(TRIALS):
        course.depth[now], course.rate[now] = guess, a * guess + b
        found = touch(
            profile, runs, floor, least, first, course, course.time[now], reach, start, end, sums, places, spreads
        )
        if found < 0:
            return 2, 0.0
        off = sums[LOAD] - load
        step = -off / sums[STIFFNESS] if sums[STIFFNESS] > 0 else 0.5 * (low + high) - guess
        if off < 0:
            low = guess
        else:
            high = guess
        if abs(step) <= (close if found >= MANY else CAREFUL * close) or abs(off) <= EXACT * load:
            guess += step
            course.depth[now], course.rate[now] = guess, a * guess + b
            return 0, sums[DRAG] + step * sums[DRAG_STIFFNESS]
        if high - low <= 1e-13 * (abs(low) + abs(high)):
            return 0, sums[DRAG]  # the load jumps here, as a grid lets it where a patch comes or goes
        guess += step
        if not limits[0] <= guess <= limits[1]:
            return 2, 0.0
        if trial > 4 and not low < guess < high:
            guess = 0.5 * (low + high)
    return 1, 0.0


@njit(nogil=True, cache=True)
def march(
    profile: Profile,
    runs: IntArray,
    floor: FloatArray,
    first: Patches,
    reach: float,
    load: float,
    pace: Pace,
    limits: tuple[float, float],
    aim: tuple[float, float, float, float],
    time: FloatArray,
    depth: FloatArray,
    rate: FloatArray,
    drag: FloatArray,
) -> tuple[int, int]:
    """March the depth at constant load through the time after a jump, by backward differentiation of order three.

    Parameters
    ----------
    profile, runs, floor, first, reach
        As in :func:`touch`.
    load : float
        F_N / (4 G L).
    pace : Pace
    limits : tuple of float
        Least and greatest depth for which `runs` and `floor` hold.
    aim : tuple of float
        Final depth and drag, how near to the depth the march ends, and which part of the largest distance of the drag.
    time, depth, rate, drag : array, shape (m,)
        Written from the second entry on; the first one holds the state right after the jump.

    Returns
    -------
    count : int
        Number of moments computed.
    status : int
        0 done, 1 depth not found, 2 limits exceeded.
    """
    most = 4 * first.count + 4096
    room = np.empty(most), np.empty(most), np.empty(SUMS), np.empty(CANDIDATES), np.empty(WINDOWS)
    least = np.empty(profile.height.size // BLOCK)
    block_least(profile, reach, least)
    near, step, now, farthest = 0.0, pace.first, 1, abs(drag[0] - aim[1])
    while time[now - 1] < pace.until:
        if now == time.size:
            return now, 1
        time[now] = min(time[now - 1] + step, pace.until)
        if pace.until - time[now] < 0.1 * step:
            time[now] = pace.until
        taken = time[now] - time[now - 1]
        if now == 1:
            weights = 2 / taken, -2 * depth[0] / taken - rate[0]
            foretold = depth[0] + taken * rate[0]
        else:
            weights = _rate_weights(time, depth, now, min(now, 3))
            bend = (rate[now - 1] - rate[now - 2]) / (time[now - 1] - time[now - 2])
            foretold = depth[now - 1] + taken * (rate[now - 1] + 0.5 * taken * bend)
        depth[now] = min(max(foretold, limits[0]), limits[1])
        course = Course(time, depth, rate, now + 1, weights[0])
        status, drag[now] = _balance(
            profile, runs, floor, least, first, course, reach, load, weights, limits, pace.close, room
        )
        miss = abs(depth[now] - foretold) if status == 0 else 8 * pace.miss
        if miss > 2 * pace.miss or status != 0:
            if step < 1e-3 * pace.first or (status == 2 and step < 1e-2 * time[now - 1]):
                return now, max(status, 1)
            step = taken * max(0.25, 0.8 * (pace.miss / miss) ** (1 / 3))
            continue
        step = taken * min(pace.growth, 0.9 * (pace.miss / max(miss, 1e-300)) ** (1 / 3))
        farthest = max(farthest, abs(drag[now] - aim[1]))
        settled = abs(drag[now] - aim[1]) <= aim[3] * farthest and abs(depth[now] - aim[0]) <= aim[2]
        near = near if settled else time[now]
        now += 1
        if settled and time[now - 1] > SETTLED * near:
            break
    return now, 0
