"""The march of the depth in time after a velocity jump, at constant load."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit_uncounted
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.transients.contact_search import Reachable, Workspace, find_contact
from mdr_dask.physics.transients.free_recovery import Instant
from mdr_dask.physics.transients.patches import (
    DRAG,
    DRAG_GROWTH,
    DRAG_STIFFNESS,
    GROWTH,
    LENGTH,
    LOAD,
    STIFFNESS,
    TILT,
    History,
    Patches,
    Track,
)

TRIALS = 80  # largest number of Newton steps for the depth at one instant
ORDER = 3  # order of the backward differentiation
EXACT = 1e-11  # relative error of the load below which no Newton step is needed
NEWTON_LOAD = 0.03  # largest relative error of the load before the last Newton step
# a march ends at the time t if depth and drag have been near their final values since the time t / SETTLED
SETTLED = 1.5
LEFT_LIMITS = -1  # outcome of a march whose depth leaves the interval for which the reachable cells are known


class Stepping(NamedTuple):
    """Sizes of the time steps of a march.

    `first` and `growth` are the first step and the largest ratio of a step to the previous one. `miss` is the largest
    allowed difference between the extrapolated and the solved depth. Newton's method ends when it changes the depth by
    less than `close`. The march ends at the time `until` at the latest.
    """

    first: float
    growth: float
    miss: float
    close: float
    until: float


class Finish(NamedTuple):
    """Criterion for the end of a march: final depth and drag, and the allowed distances from these values.

    `drag_distance` is a fraction of the largest difference between the drag and the final drag during the march.
    """

    depth: float
    drag: float
    depth_distance: float
    drag_distance: float


class Marching(NamedTuple):
    """Quantities that are constant during a march.

    `first` is the contact before the jump. `reachable` contains the cells where contact is possible at depths from
    `low` to `high`. `deborah` belongs to the velocity after the jump, and `load` is F_N / (4 G dx). The steps are equal
    in log(1 + t / onset).
    """

    track: Track
    first: Patches
    reachable: Reachable
    deborah: float
    load: float
    low: float
    high: float
    onset: float


class Trajectory(NamedTuple):
    """Time, log(1 + t / onset), depth and its rate, drag and its rate at every instant, from just after the jump on.

    Rates are derivatives with respect to t / tau.
    """

    time: FloatArray
    place: FloatArray
    depth: FloatArray
    rate: FloatArray
    drag: FloatArray
    drag_rate: FloatArray


@jit_uncounted
def _drag_rate(sums: FloatArray, stiff: float, step: float) -> float:
    """Return the rate of the drag at constant load.

    Growing patches add load; the lift (the depth plus its rate) falls to compensate for it. The last Newton `step` of
    the depth also changes the rate of the depth, and therefore the growth of the patches.
    """
    edges = sums[STIFFNESS] - sums[LENGTH] * (1 + stiff)
    edges_drag = sums[DRAG_STIFFNESS] - sums[TILT] * (1 + stiff)
    growth, drag_growth = sums[GROWTH] + edges * stiff * step, sums[DRAG_GROWTH] + edges_drag * stiff * step
    lift = -growth / sums[LENGTH] if sums[LENGTH] > 0 else 0.0
    return float(lift * sums[TILT] + drag_growth)


@jit_uncounted
def _balance(
    marching: Marching, history: History, weights: tuple[float, float], close: float, work: Workspace
) -> tuple[int, float, float]:
    """Find the depth at which the load is carried, at the last instant of the history, by Newton's method.

    Return the outcome (or `LEFT_LIMITS`), the drag, and its derivative with respect to t / tau.
    """
    now, load = history.count - 1, marching.load
    guess, (a, b), sums = history.depth[now], weights, work.sums
    moment = Instant(
        marching.track, marching.first, history, history.time[now], marching.deborah, np.exp(-history.time[now])
    )
    low, high = marching.low, marching.high
    for trial in range(TRIALS):
        history.depth[now], history.rate[now] = guess, a * guess + b
        if find_contact(moment, marching.reachable, work) < 0:
            return LEFT_LIMITS, 0.0, 0.0
        off = sums[LOAD] - load
        step = -off / sums[STIFFNESS] if sums[STIFFNESS] > 0 else 0.5 * (low + high) - guess
        if off < 0:
            low = guess
        else:
            high = guess
        if (abs(step) <= close and abs(off) <= NEWTON_LOAD * load) or abs(off) <= EXACT * load:
            guess += step
            history.depth[now], history.rate[now] = guess, a * guess + b
            drag = sums[DRAG] + step * sums[DRAG_STIFFNESS]
            return Outcome.CONVERGED, drag, _drag_rate(sums, a, step)
        if high - low <= 1e-13 * (abs(low) + abs(high)):
            # the load is discontinuous at this depth, because a single asperity comes into contact
            return Outcome.CONVERGED, sums[DRAG], _drag_rate(sums, a, 0.0)
        guess += step
        if not marching.low <= guess <= marching.high:
            return LEFT_LIMITS, 0.0, 0.0
        if trial > 4 and not low < guess < high:
            guess = 0.5 * (low + high)
    return Outcome.DEPTH_NOT_FOUND, 0.0, 0.0


@jit_uncounted
def _weights(found: Trajectory, now: int, onset: float) -> tuple[float, float]:
    """Return the numbers a and b: if d is the depth at instant `now` of a march, the rate of the depth is a d + b.

    The numbers follow from backward differentiation with respect to log(1 + t / onset), because the relaxation is a
    smooth function of this variable. In the first step, they follow from the known rate just after the jump.
    """
    time, place, depth = found.time, found.place, found.depth
    if now == 1:
        taken = time[1] - time[0]
        return 2 / taken, -2 * depth[0] / taken - found.rate[0]
    here, order, a, b = place[now], min(now, ORDER), 0.0, 0.0
    for j in range(now - order, now):
        a += 1 / (here - place[j])
        weight = 1 / (place[j] - here)
        for m in range(now - order, now):
            if m != j:
                weight *= (here - place[m]) / (place[j] - place[m])
        b += weight * depth[j]
    pace = 1 / (onset + time[now])
    return a * pace, b * pace


@jit_uncounted
def _extrapolated(found: Trajectory, now: int) -> float:
    """Extrapolate the depth to instant `now` by a parabola in log(1 + t / onset), or in t for the first instants."""
    time, place, depth, rate, _, _ = found
    taken = time[now] - time[now - 1]
    if now == 1:
        return float(depth[0] + taken * rate[0])
    if now == 2:
        bend = (rate[1] - rate[0]) / (time[1] - time[0])
        return float(depth[1] + taken * (rate[1] + 0.5 * taken * bend))
    ahead, one, two = place[now] - place[now - 1], place[now - 2] - place[now - 1], place[now - 3] - place[now - 1]
    to_one, to_two = (depth[now - 2] - depth[now - 1]) / one, (depth[now - 3] - depth[now - 1]) / two
    return float(depth[now - 1] + ahead * (to_one + (ahead - one) * (to_two - to_one) / (two - one)))


@jit_uncounted
def march_depth(
    marching: Marching, pace: Stepping, finish: Finish, found: Trajectory, work: Workspace
) -> tuple[int, int]:
    """March the depth at constant load by backward differentiation of third order with respect to log(1 + t / onset).

    `found` contains the first instant; all later instants are written. Return the number of instants, and an `Outcome`
    or `LEFT_LIMITS`.
    """
    time, place, depth, rate, drag, drag_rate = found
    near, step, now, farthest = 0.0, pace.first, 1, abs(drag[0] - finish.drag)
    while time[now - 1] < pace.until:
        if now == time.size:
            return now, Outcome.TOO_MANY_STEPS
        time[now] = min(time[now - 1] + step, pace.until)
        if pace.until - time[now] < 0.1 * step:
            time[now] = pace.until
        place[now], taken = np.log1p(time[now] / marching.onset), time[now] - time[now - 1]
        weights, expected = _weights(found, now, marching.onset), _extrapolated(found, now)
        depth[now] = min(max(expected, marching.low), marching.high)
        history = History(time, depth, rate, now + 1, weights[0])
        outcome, drag[now], drag_rate[now] = _balance(marching, history, weights, pace.close, work)
        miss = abs(depth[now] - expected) if outcome == Outcome.CONVERGED else np.inf
        ratio = 0.9 * (pace.miss / max(miss, 1e-300)) ** (1 / 3)  # the error of the extrapolation is of third order
        if miss > 2 * pace.miss:
            if step < 1e-3 * pace.first or (outcome == LEFT_LIMITS and step < 1e-2 * time[now - 1]):
                return now, outcome if outcome != Outcome.CONVERGED else Outcome.DEPTH_NOT_FOUND
            step = taken * max(0.25, ratio)
            continue
        step = taken * min(pace.growth, ratio)
        farthest = max(farthest, abs(drag[now] - finish.drag))
        settled = (
            abs(drag[now] - finish.drag) <= finish.drag_distance * farthest
            and abs(depth[now] - finish.depth) <= finish.depth_distance
        )
        near = near if settled else time[now]
        now += 1
        if settled and time[now - 1] > SETTLED * near:
            break
    return now, Outcome.CONVERGED
