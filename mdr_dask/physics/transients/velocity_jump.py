"""Friction after a jump of the velocity at constant load, from one steady state to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.interpolate import Akima1DInterpolator

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.steady import steady_sliding
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients.march import Pace, march
from mdr_dask.physics.transients.patches import (
    DRAG,
    LENGTH,
    LOAD,
    SUMS,
    TILT,
    Patches,
    Profile,
    cubic_profile,
    released,
)
from mdr_dask.physics.transients.steady_patches import Ends, steady_ends

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
        See :func:`mdr_dask.physics.transients.patches.cubic_profile`.
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
    if not np.all(np.isfinite(height)):
        return [_failed(times, INVALID)] * loads.size
    every = 2 if height.size >= LONG_LINE and height.size % 2 == 0 else 1
    steady = steady_sliding(periodic_line(height[::every], slope[::every]), reaches.ravel(), np.repeat(loads, 2))
    depths, states = steady.depth.reshape(-1, 2), steady.status.reshape(-1, 2)
    profile, top = cubic_profile(height, slope)
    equilibrium = EQUILIBRIUM * (STEPS_PER_DECADE / per_decade) ** 3
    jumps = []
    for k in range(loads.size):
        if states[k].any():
            jumps.append(_failed(times, INVALID if Outcome.INVALID in states[k] else NOT_CONVERGED))
            continue
        change = float(depths[k, 1] - depths[k, 0])
        pace = pace_after(float(times[-1]), reaches[k, 1], wavenumber, per_decade, change, loads[k])
        tolerances = float(accuracies[k]), equilibrium, DOUBT if every > 1 else 0.0
        pair = float(reaches[k, 0]), float(reaches[k, 1])
        jump = _relax(profile, float(loads[k]), pair, depths[k] + top, times, pace, tolerances)
        jumps.append(jump._replace(depth=jump.depth - top))
    return jumps


def _failed(times: FloatArray, status: int) -> Jump:
    return Jump(np.nan, np.nan, np.nan, np.full(times.size, np.nan), np.full(2, np.nan), 0, 0.0, status)


def _relax(
    profile: Profile,
    load: float,
    reaches: tuple[float, float],
    depths: FloatArray,
    times: FloatArray,
    pace: Pace,
    tolerances: tuple[float, float, float],
) -> Jump:
    """Solve both steady states on one profile and march between them, within limits of the depth that may widen."""
    low, high = float(depths.min()), float(depths.max())
    accuracy, equilibrium, doubt = tolerances
    margin = 0.25 * (high - low) + NEGLIGIBLE * load + doubt * high
    for _ in range(WIDENINGS):
        ends = steady_ends(profile, load, reaches, depths, (low - margin, high + margin))
        jump = _between(profile, load, reaches[1], ends, times, pace, (accuracy, equilibrium)) if ends else None
        if jump is not None:
            return jump
        margin *= 4
    return _failed(times, NOT_CONVERGED)


def _between(
    profile: Profile,
    load: float,
    reach: float,
    ends: Ends,
    times: FloatArray,
    pace: Pace,
    tolerances: tuple[float, float],
) -> Jump | None:
    """Solve the jump condition and follow the depth to its end, where it matters; None if it leaves its limits."""
    before, after, accuracy = ends.before, ends.after, tolerances[0]
    depth = np.array([ends.first.depth, ends.last.depth])
    if _full(ends.first, profile) and _full(ends.last, profile):
        return Jump(before, after, after, np.full(times.size, after), depth, 0, 0.0, CONVERGED)
    sums = np.empty(SUMS)
    rate, good = _release(profile, ends.first, reach, load, sums)
    if not good:
        return _failed(times, NOT_CONVERGED)
    at = sums[DRAG]
    # the difference of its ends alone does not bound a transient, which may cross its end
    transient = abs(at - after) + abs(rate * sums[TILT]) + ends.by_depth
    if transient <= accuracy * after:
        return Jump(before, at, after, np.where(times > 0, after, at), depth, 0, transient, CONVERGED)
    settled = max(tolerances[1], SHARE * accuracy * after / max(transient, 1e-300))
    close = max(10 * tolerances[1], settled) * abs(depth[1] - depth[0])
    course = np.empty((4, MOMENTS))
    course[:, 0] = 0.0, depth[0], rate, at
    aim = depth[1], after, close, settled
    count, status = march(profile, ends.runs, ends.floor, ends.first, reach, load, pace, ends.limits, aim, *course)
    if status != 0:
        return _failed(times, NOT_CONVERGED) if status == 1 else None
    moments, drag = course[0, :count], course[3, :count]
    if moments[-1] >= LONG and abs(drag[-1] - after) > STRAY * np.ptp(drag):
        return _failed(times, STRAYED)
    return Jump(before, at, after, _at_times(moments, drag, times, after), depth, count, 0.0, CONVERGED)


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


def _at_times(moments: FloatArray, drag: FloatArray, times: FloatArray, after: float) -> FloatArray:
    """Interpolate over log time by a modified Akima curve, which no kink makes overshoot; linear in the first step."""
    scale = moments[1]
    curve = Akima1DInterpolator(np.log1p(moments / scale), drag, method="makima")
    trace: FloatArray = curve(np.log1p(times / scale))
    trace[times > moments[-1]] = after
    return trace
