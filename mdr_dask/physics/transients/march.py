"""The march of the depth in time after a velocity jump, at constant load."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit_uncounted
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import EPS, MOST_ITERATIONS
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

NEWTON_LOAD = 0.03  # largest relative error of the load before the last Newton step


class Marching(NamedTuple):
    """Quantities that are constant during a march.

    `first` is the contact before the jump. `reachable` contains the cells where contact is possible at depths from
    `low` to `high`. `deborah` belongs to the velocity after the jump, and `load` is F_N / (4 G dx). The instants are
    equidistant in log(1 + t / onset), with the spacing `pace`. The last step of Newton's method changes the depth by at
    most `close`.
    """

    track: Track
    first: Patches
    reachable: Reachable
    deborah: float
    load: float
    low: float
    high: float
    onset: float
    pace: float
    close: float


class Trajectory(NamedTuple):
    """Time, depth, rate of the depth, drag and rate of the drag at every instant, beginning just after the jump.

    Rates are derivatives with respect to t / tau.
    """

    time: FloatArray
    depth: FloatArray
    rate: FloatArray
    drag: FloatArray
    drag_rate: FloatArray


@jit_uncounted
def _drag_rate(sums: FloatArray, stiff: float, step: float) -> float:
    """Return the rate of the drag at constant load, after the last Newton `step` of the depth."""
    edges = sums[STIFFNESS] - sums[LENGTH] * (1 + stiff)
    edges_drag = sums[DRAG_STIFFNESS] - sums[TILT] * (1 + stiff)
    # the step changes the rate of the depth, and therefore the growth of the patches
    growth, drag_growth = sums[GROWTH] + edges * stiff * step, sums[DRAG_GROWTH] + edges_drag * stiff * step
    # the depth plus its rate falls, to compensate for the load of growing patches
    lift = -growth / sums[LENGTH] if sums[LENGTH] > 0 else 0.0
    return float(lift * sums[TILT] + drag_growth)


@jit_uncounted
def _balance(
    marching: Marching, history: History, weights: tuple[float, float], work: Workspace
) -> tuple[int, float, float]:
    """Find, by Newton's method, the depth that carries the load at the last instant of the history.

    The rate of the depth d is a d + b, where a and b are the two `weights`. Depth and rate are written to the history.
    Return the outcome, the drag, and the derivative of the drag with respect to t / tau.
    """
    now, load = history.count - 1, marching.load
    guess, (a, b), sums = history.depth[now], weights, work.sums
    instant = Instant(
        marching.track, marching.first, history, history.time[now], marching.deborah, np.exp(-history.time[now])
    )
    low, high = marching.low, marching.high
    for _ in range(MOST_ITERATIONS):
        history.depth[now], history.rate[now] = guess, a * guess + b
        if find_contact(instant, marching.reachable, work) == 0:
            break
        off = sums[LOAD] - load
        step = -off / sums[STIFFNESS] if sums[STIFFNESS] > 0 else 0.5 * (low + high) - guess
        if off < 0:
            low = guess
        else:
            high = guess
        if abs(step) <= marching.close and abs(off) <= NEWTON_LOAD * load:
            guess += step
            history.depth[now], history.rate[now] = guess, a * guess + b
            drag = sums[DRAG] + step * sums[DRAG_STIFFNESS]
            return Outcome.CONVERGED, drag, _drag_rate(sums, a, step)
        if high - low <= EPS * (abs(low) + abs(high)):
            # the load is discontinuous at this depth, because a single asperity comes into contact
            return Outcome.CONVERGED, sums[DRAG], _drag_rate(sums, a, 0.0)
        guess += step
        if not marching.low <= guess <= marching.high:
            break
        if not low < guess < high:
            guess = 0.5 * (low + high)
    return Outcome.DEPTH_NOT_FOUND, 0.0, 0.0


@jit_uncounted
def _weights(marching: Marching, found: Trajectory, now: int) -> tuple[float, float]:
    """Return a and b in the formula a d + b for the rate of the depth d at the instant with the index `now`."""
    depth = found.depth
    if now == 1:  # the formula contains the known rate just after the jump
        taken = found.time[1]
        return 2 / taken, -2 * depth[0] / taken - found.rate[0]
    scale = 1 / (marching.pace * (marching.onset + found.time[now]))
    if now == 2:
        return 3 / 2 * scale, (depth[0] / 2 - 2 * depth[1]) * scale
    return 11 / 6 * scale, (3 / 2 * depth[now - 2] - 3 * depth[now - 1] - depth[now - 3] / 3) * scale


@jit_uncounted
def _extrapolated(found: Trajectory, now: int) -> float:
    """Return the depth at index `now`, extrapolated in log(1 + t / onset), or in t if `now` is 1 or 2."""
    time, depth, rate = found.time, found.depth, found.rate
    taken = time[now] - time[now - 1]
    if now == 1:
        return float(depth[0] + taken * rate[0])
    if now == 2:
        bend = (rate[1] - rate[0]) / time[1]
        return float(depth[1] + taken * (rate[1] + 0.5 * taken * bend))
    return float(depth[now - 3] + 3 * (depth[now - 1] - depth[now - 2]))


@jit_uncounted
def march_depth(marching: Marching, found: Trajectory, work: Workspace) -> int:
    """March the depth at constant load by backward differentiation of third order with respect to log(1 + t / onset).

    The first two time steps use formulas of second order.

    `found` contains all times. The other quantities in `found` are given at the first instant, and are written for all
    later instants. If a time step fails, the march ends, and the remaining entries are undefined. Return an `Outcome`.
    """
    time, depth, rate, drag, drag_rate = found
    for now in range(1, time.size):
        weights = _weights(marching, found, now)
        depth[now] = min(max(_extrapolated(found, now), marching.low), marching.high)
        history = History(time, depth, rate, now + 1, weights[0])
        outcome, drag[now], drag_rate[now] = _balance(marching, history, weights, work)
        if outcome != Outcome.CONVERGED:
            return outcome
    return Outcome.CONVERGED
