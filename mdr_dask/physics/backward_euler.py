"""The papers' method: the stationary state of a Kelvin foundation by backward Euler, many cases on a line at once.

u_i = max(w_i, lambda u_(i-1)) with w = depth + height and lambda = 1 / (1 + dt / tau). Because a turn closes,
F_N / (4 G dx) is the sum of u, and F_x / (4 G) that of (u_i - lambda u_(i-1)) / (1 - lambda) (w_i - w_(i-1)).
The inner loops run over cases, so that they are vector instructions; each case does the same arithmetic whatever runs
beside it.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

ITERATIONS = 200
COARSENING = 8
COARSEST = 64  # nodes of the grid that the search for the depth starts on
CONVERGED_STEP = 1e-13  # relative change of the depth that ends the search: rounding
COARSE_STEP = 1e-2

# What a sweep writes for every case, in this order
CARRIED, STIFFNESS, DRAG = range(3)
SUMS = 3


@njit(nogil=True, cache=True)
def _step(h: float, t: float, decay: float, depth: float, u: float, fade: float) -> tuple[float, float, float]:
    """Go on by one node: return u, its derivative by the depth, and the drag times 1 - lambda."""
    free = decay * u
    w = h + depth
    touches = w > free
    now = w if touches else free
    return now, 1.0 if touches else decay * fade, (now - free) * t


@njit(nogil=True, cache=True)
def _sweep(
    height: FloatArray,
    rise: FloatArray,
    periodic: bool,
    decay: FloatArray,
    depth: FloatArray,
    state: FloatArray,
    sums: FloatArray,
) -> None:
    """Follow one element of every case along the line: from its highest node back to it, or undeformed from its start.

    Parameters
    ----------
    height : array, shape (n,)
        Heights from the highest node.
    rise : array, shape (n,)
        Height less that of the node before.
    periodic : bool
        Whether the line closes on itself; its highest node then comes last.
    decay, depth : array, shape (cases,)
        lambda, and the penetration of the highest node.
    state : array, shape (2, cases)
        Room for u and its derivative.
    sums : array, shape (SUMS, cases)
        Written: sum of u, its derivative by the depth, F_x / (4 G) times 1 - lambda.
    """
    cases = depth.size
    for k in range(cases):
        state[0, k] = depth[k] if periodic else 0.0
        state[1, k] = 1.0 if periodic else 0.0
        sums[0, k] = sums[1, k] = sums[2, k] = 0.0
    whole = height.size // 4 * 4
    for i in range(0, whole, 4):
        h0, h1, h2, h3 = height[i], height[i + 1], height[i + 2], height[i + 3]
        t0, t1, t2, t3 = rise[i], rise[i + 1], rise[i + 2], rise[i + 3]
        for k in range(cases):
            u0, a0, x0 = _step(h0, t0, decay[k], depth[k], state[0, k], state[1, k])
            u1, a1, x1 = _step(h1, t1, decay[k], depth[k], u0, a0)
            u2, a2, x2 = _step(h2, t2, decay[k], depth[k], u1, a1)
            u3, a3, x3 = _step(h3, t3, decay[k], depth[k], u2, a2)
            state[0, k] = u3
            state[1, k] = a3
            sums[0, k] += (u0 + u1) + (u2 + u3)
            sums[1, k] += (a0 + a1) + (a2 + a3)
            sums[2, k] += (x0 + x1) + (x2 + x3)
    for i in range(whole, height.size):
        for k in range(cases):
            u0, a0, x0 = _step(height[i], rise[i], decay[k], depth[k], state[0, k], state[1, k])
            state[0, k] = u0
            state[1, k] = a0
            sums[0, k] += u0
            sums[1, k] += a0
            sums[2, k] += x0


@njit(nogil=True, cache=True)
def _newton(
    height: FloatArray,
    rise: FloatArray,
    periodic: bool,
    reaches: FloatArray,
    loads: FloatArray,
    tolerance: float,
    depths: FloatArray,
    drags: FloatArray,
    outside: NDArray[np.bool_],
) -> None:
    """Find the depth of every case; `depths` holds the guesses on entry, `drags` is NaN where none was found.

    The load is convex, increasing and piecewise linear in the depth, so that Newton comes down from the right after its
    first step and ends exactly.
    """
    active = np.arange(loads.size)
    decay, depth, load = reaches / (1 + reaches), depths.copy(), loads.copy()
    state, sums = np.empty((2, loads.size)), np.empty((SUMS, loads.size))
    drags[:] = np.nan
    ends = 0.0 if periodic else 1.0
    count = loads.size
    for _ in range(ITERATIONS):
        _sweep(height, rise, periodic, decay[:count], depth[:count], state, sums)
        kept = 0
        for k in range(count):
            case = active[k]
            # behind a line that does not close, u and its derivative fade away undisturbed
            carried = sums[CARRIED, k] + ends * reaches[case] * state[0, k]
            step = (load[k] - carried) / (sums[STIFFNESS, k] + ends * reaches[case] * state[1, k])
            if abs(step) <= tolerance * depth[k]:
                depths[case] = depth[k]
                drags[case] = sums[DRAG, k] * (1 + reaches[case])
                outside[case] = not periodic and (state[1, k] == 1 or height[0] + depth[k] > 0)
                continue
            active[kept], decay[kept], load[kept] = case, decay[k], load[k]
            depth[kept] = max(depth[k] + step, 0.25 * depth[k])
            kept += 1
        count = kept
        if count == 0:
            return


@njit(nogil=True, cache=True)
def contact(
    height: FloatArray,
    periodic: bool,
    reaches: FloatArray,
    depths: FloatArray,
    touched: FloatArray,
    slope: FloatArray,
) -> None:
    """Write the number of nodes in contact and the rms rise over them, for line and cases as in :func:`solve`."""
    for k in range(depths.size):
        decay, count, square = reaches[k] / (1 + reaches[k]), 0, 0.0
        u = depths[k] if periodic else 0.0
        for i in range(height.size):
            w = height[i] + depths[k]
            if w > decay * u:
                u = w
                rise = height[i] - height[i - 1]
                count += 1
                square += rise * rise
            else:
                u *= decay
        touched[k] = count
        slope[k] = np.sqrt(square / max(count, 1))


def solve(
    height: FloatArray, periodic: bool, reaches: FloatArray, loads: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return the depth of the highest node, F_x / (4 G) and whether the contact leaves the line, for every case.

    The first guess comes from every `COARSENING`-th node, and so on: it depends on the case alone, and so does
    every bit of the result.

    Parameters
    ----------
    height : array, shape (n,)
        Heights from the highest node, which comes last if the line is periodic.
    periodic : bool
        Whether the line closes on itself; if not, elements enter undeformed at the first node.
    reaches, loads : array, shape (cases,)
        v tau in cells, and F_N / (4 G dx) in the unit of height; both positive and finite.
    """
    strides = [1]
    while height.size > COARSEST * strides[-1]:
        strides.append(strides[-1] * COARSENING)
    mean = loads / height.size
    depths = np.maximum(mean, mean ** (2 / 3))
    drags, outside = np.empty(loads.size), np.zeros(loads.size, np.bool_)
    top = int(np.argmax(height))
    for stride in reversed(strides):
        coarse = np.ascontiguousarray(height[top % stride :: stride])
        rise = coarse - np.roll(coarse, 1)
        tolerance = CONVERGED_STEP if stride == 1 else COARSE_STEP
        _newton(coarse, rise, periodic, reaches / stride, loads / stride, tolerance, depths, drags, outside)
    return depths, drags, outside
