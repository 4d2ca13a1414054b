"""The papers' method: the stationary state of a Kelvin foundation by backward Euler, many cases on a line at once."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

LANES = 16  # cases that go along the line together
ITERATIONS = 200
COARSENING = 8
CARRIED, STIFFNESS, DRAG, TOUCHED, STRETCH = range(5)
SUMS = 5


@njit(nogil=True, cache=True)
def sweep_lanes(height: FloatArray, rise: FloatArray, decay: FloatArray, depth: FloatArray, sums: FloatArray) -> None:
    """Follow elements of `LANES` cases once along the profile, from its highest point back to it.

    u_i = max(w_i, lambda u_(i-1)) with w = depth + height and lambda = 1 / (1 + dt / tau); because a turn closes,
    F_N / (4 G dx) is the sum of u, and F_x / (4 G) that of (u_i - lambda u_(i-1)) / (1 - lambda) (w_i - w_(i-1)).

    Parameters
    ----------
    height : array, shape (n,)
        Heights from the highest point, which comes first.
    rise : array, shape (n,)
        Height less that of the node before.
    decay, depth : array, shape (LANES,)
        lambda, and the penetration of the highest point.
    sums : array, shape (SUMS, LANES)
        Written: sum of u, its derivative by the depth, F_x / (4 G) times (1 - lambda), number of nodes in contact and
        the sum of the rise squared over them.
    """
    u, a = np.empty(LANES), np.empty(LANES)
    for k in range(LANES):
        u[k] = depth[k]
        a[k] = 1.0
    # the element arrives at the highest point last: node 0 is met after all others
    sums[:] = 0.0
    for j in range(1, height.size + 1):
        i = j if j < height.size else 0
        h, t = height[i], rise[i]
        for k in range(LANES):
            free = decay[k] * u[k]
            w = h + depth[k]
            touches = w > free
            now = w if touches else free
            fade = 1.0 if touches else decay[k] * a[k]
            u[k] = now
            a[k] = fade
            sums[0, k] += now
            sums[1, k] += fade
            sums[2, k] += (now - free) * t
            sums[3, k] += 1.0 if touches else 0.0
            sums[4, k] += t * t if touches else 0.0


@njit(nogil=True, cache=True)
def solve_lanes(
    height: FloatArray,
    rise: FloatArray,
    reaches: FloatArray,
    loads: FloatArray,
    depths: FloatArray,
    tolerance: float,
    results: FloatArray,
) -> None:
    """Find the depth of every case by Newton; lanes that are done take the next case.

    The load is convex and increasing in the depth and linear between changes of the contact, so that Newton comes
    down from the right after its first step and ends exactly.

    Parameters
    ----------
    height, rise : array, shape (n,)
        As in :func:`sweep_lanes`.
    reaches, loads : array, shape (cases,)
        v tau in cells, and F_N / (4 G dx), both positive.
    depths : array, shape (cases,)
        First guess on entry, solution on return.
    tolerance : float
        Relative change of the depth that ends the search.
    results : array, shape (SUMS, cases)
        Written: the sums at the depth returned, NaN where `ITERATIONS` sweeps did not suffice.
    """
    cases = loads.size
    case = np.full(LANES, -1)
    tries = np.zeros(LANES, np.int64)
    decay, depth = np.zeros(LANES), np.ones(LANES)
    sums = np.empty((SUMS, LANES))
    waiting, running = 0, 0
    while True:
        for k in range(LANES):
            if case[k] < 0 and waiting < cases:
                case[k], tries[k], running = waiting, 0, running + 1
                decay[k] = reaches[waiting] / (1 + reaches[waiting])
                depth[k] = depths[waiting]
                waiting += 1
        if running == 0:
            return
        sweep_lanes(height, rise, decay, depth, sums)
        for k in range(LANES):
            j = case[k]
            if j < 0:
                continue
            tries[k] += 1
            step = (loads[j] - sums[CARRIED, k]) / sums[STIFFNESS, k]
            done = abs(step) <= tolerance * depth[k]
            if done or tries[k] == ITERATIONS:
                depths[j] = depth[k]
                for m in range(SUMS):
                    results[m, j] = sums[m, k] if done else np.nan
                results[DRAG, j] *= 1 + reaches[j]
                case[k], running = -1, running - 1
            depth[k] = max(depth[k] + step, 0.25 * depth[k])


def solve(height: FloatArray, reaches: FloatArray, loads: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the depth below the highest node and the sums of every case on a periodic line.

    The first guess comes from every `COARSENING`-th node, and so on: it depends on the case alone, and so does
    every bit of the result.

    Parameters
    ----------
    height : array, shape (n,)
        Heights from the highest node, which comes first.
    reaches, loads : array, shape (cases,)
        v tau in cells, and F_N / (4 G L) in the unit of height.

    Returns
    -------
    depths : array, shape (cases,)
    sums : array, shape (SUMS, cases)
        See :func:`sweep_lanes`; F_x / (4 G) in full.
    """
    strides = [1]
    while height.size > 64 * strides[-1]:
        strides.append(strides[-1] * COARSENING)
    depths = np.maximum(loads, loads ** (2 / 3))
    results = np.empty((SUMS, loads.size))
    for stride in reversed(strides):
        coarse = np.ascontiguousarray(height[::stride])
        rise = coarse - np.roll(coarse, 1)
        tolerance = 1e-13 if stride == 1 else 1e-3
        solve_lanes(coarse, rise, reaches / stride, loads * coarse.size, depths, tolerance, results)
    return depths, results
