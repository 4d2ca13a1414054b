"""What the rate of thesis Fig. 4.3 (printed: 2.4) depends on: window, fit, grid, time steps and indentation rate.

    python -m benchmarks kinetics figure [LINES]

The papers' way is backward Euler with steps of one cell, from the steady state of the same scheme at v_1. Without
the rate of the depth the force of an element in contact is d + p + V p' as the thesis prints it, and the load fixes d
by the elements that touch and push. Intervals: 95 %, bootstrap over the lines.
"""

from __future__ import annotations

import sys

import numpy as np
from numba import njit

from mdr_dask import bootstrap
from mdr_dask.fits.relaxation import exponential, point_weights, widths
from mdr_dask.physics.sliding.backward_euler import steady_by_steps
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.cubic_line import periodic_line
from mdr_dask.physics.transients.velocity_jump import Transient, velocity_jump

POINTS, HURST, LOAD, DEBORAH, CHANGE = 5000, 0.7, 0.3, 0.005, 0.2
LAW = (DEBORAH * np.pi * POINTS) ** (1 - HURST)
WINDOWS = 0.3, 1.0, 8 / LAW
LAST = 6.0
FULL_RATE, NO_RATE = 0, 1
WAYS = {
    FULL_RATE: "with the rate of the depth",
    NO_RATE: "without it",
}


@njit(cache=True)
def depth_with_rate(height, free, ratio, load, depth):  # type: ignore[no-untyped-def]
    """Return the depth at which the elements carry a load, by Newton's steps on a convex sum."""
    for _ in range(60):
        force, count = 0.0, 0
        for i in range(height.size):
            gap = depth + height[i] - free[i]
            if gap > 0:
                force += gap
                count += 1
        if count == 0:
            depth = np.min(free - height) + load
            continue
        step = (load / (1 + ratio) - force) / count
        depth += step
        if abs(step) < 1e-13:
            break
    return depth


@njit(cache=True)
def carried(height, free, push, depth):  # type: ignore[no-untyped-def]
    """Return the load of the elements that touch and push without the rate of the depth."""
    force = 0.0
    for i in range(height.size):
        w = depth + height[i]
        if w > free[i] and w + push[i] > 0:
            force += w + push[i]
    return force


@njit(cache=True)
def depth_by_pushing(height, free, push, load, depth):  # type: ignore[no-untyped-def]
    """Return the depth where the load is passed, which grows with the depth by leaps."""
    width = 1e-4
    low, high = depth - width, depth + width
    while carried(height, free, push, low) > load:
        width *= 4
        low = depth - width
    while carried(height, free, push, high) < load:
        width *= 4
        high = depth + width
    while high - low > 1e-10:
        depth = 0.5 * (low + high)
        if carried(height, free, push, depth) < load:
            low = depth
        else:
            high = depth
    return 0.5 * (low + high)


@njit(cache=True)
def march(height, u, depth, ratios, load, moments, way):  # type: ignore[no-untyped-def]
    """Return friction after every step of one cell, from displacements u of the steady state at ratios[0]."""
    n = height.size
    push = np.empty(n)
    fade = ratios[1] / (1 + ratios[1])
    for i in range(n):
        push[i] = ratios[1] * (height[i] - height[i - 1])
    drag, free = np.empty(moments), np.empty(n)
    for k in range(moments):
        for i in range(n):
            free[i] = fade * u[i - 1]
        if way == 0:
            depth = depth_with_rate(height, free, ratios[1], load, depth)
        else:
            depth = depth_by_pushing(height, free, push, load, depth)
        total, along = 0.0, 0.0
        for i in range(n):
            w = depth + height[i]
            f = 0.0
            if way == 0:
                f = max((1 + ratios[1]) * (w - free[i]), 0.0)
            elif w > free[i]:
                f = max(w + push[i], 0.0)
            u[i] = max(w, free[i]) if way == 0 or f > 0 else free[i]
            total += f
            along += f * (height[i] - height[i - 1])
        drag[k] = along / total * n if total > 0 else np.nan
    return drag


def stepped(height: np.ndarray, way: int, last: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times and mu - mu_2 of backward Euler with steps of one cell."""
    n = height.size
    height = np.roll(height, -1 - int(np.argmax(height)))
    cells = np.array([DEBORAH * n])
    depth = steady_by_steps(height - height[-1], True, cells, np.array([LOAD * n]))[0][0] - height[-1]
    u, now, fade = np.empty(n), depth + height[-1], 1 / (1 + 1 / cells[0])
    for i in range(n):
        now = max(depth + height[i], fade * now)
        u[i] = now
    ratios = cells[0] * np.array([1.0, 1 + CHANGE])
    trace = march(height, u, depth, ratios, LOAD * n, int(last * ratios[1]), way)
    return np.arange(1, trace.size + 1) / ratios[1], trace - trace[-1]


def graded(amplitude: np.ndarray, phase: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return mu - mu_2 of the march."""
    nodes = 4 * POINTS
    line = roughness.line(amplitude, phase, nodes), roughness.line(amplitude, phase, nodes, 1)
    asked = Transient(times, np.pi * POINTS, 12)
    jump = velocity_jump(periodic_line(*line), LOAD, (DEBORAH, DEBORAH * (1 + CHANGE)), asked)
    trace: np.ndarray = (jump.trace - jump.after) / LOAD
    return trace


def with_offset(time: np.ndarray, traces: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return rates of one exponential whose end mu_2 is fitted too, on a grid of rates a hundredth apart."""
    rates = np.geomspace(0.05, 100, 760)
    shapes = np.exp(-rates[:, None] * time)
    share = weights / weights.sum()
    shapes -= (shapes @ share)[:, None]
    gain = ((traces * weights) @ shapes.T) ** 2 / (shapes**2 @ weights)
    best: np.ndarray = rates[np.argmax(gain, axis=1)]
    return best


def straight(time: np.ndarray, traces: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return rates of a straight line through ln(mu - mu_2); NaN where a trace is not positive."""
    with np.errstate(invalid="ignore", divide="ignore"):
        logs = np.log(traces)
    off = time - (weights @ time) / weights.sum()
    rate: np.ndarray = -(logs @ (weights * off)) / (weights @ off**2)
    return np.where(np.isfinite(rate), rate, np.nan)


def rates_of(time: np.ndarray, lines: np.ndarray) -> list[np.ndarray]:
    """Return samples of the rates of a way: windows, end fitted, straight line, weights 1 / variance, integral."""
    traces = bootstrap.means(bootstrap.complete(lines))
    found = []
    for window in WINDOWS:
        inside = time <= window
        found.append(exponential(time[inside], traces[:, inside], widths(time[inside]))[0])
    for window in WINDOWS[1:]:
        inside = time <= window
        found.append(with_offset(time[inside], traces[:, inside], widths(time[inside])))
    for window in WINDOWS[1:]:
        inside = time <= window
        found.append(straight(time[inside], traces[:, inside], widths(time[inside])))
    inside = time <= WINDOWS[-1]
    error = lines.std(axis=0, ddof=1) / np.sqrt(len(lines))
    weights = point_weights(time[inside], traces[0, inside], error[inside])
    found.append(exponential(time[inside], traces[:, inside], weights)[0])
    return [*found, traces[:, 0] / (traces @ widths(time))]


def lines_of(count: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return times and mu - mu_2 of every line by every way."""
    amplitude = roughness.amplitudes(POINTS // 2, HURST)
    cell = 1 / (DEBORAH * (1 + CHANGE) * POINTS)
    early, uniform = np.append(0.0, np.geomspace(1e-4, LAST, 60)), np.arange(1, int(LAST / cell)) * cell
    times: dict[str, np.ndarray] = {}
    traces: dict[str, list[np.ndarray]] = {}

    def keep(name: str, time: np.ndarray, trace: np.ndarray) -> None:
        times[name] = time
        traces.setdefault(name, []).append(trace)

    for realisation in range(count):
        phase = roughness.phases(2014, realisation, POINTS // 2)
        both = np.union1d(early, uniform)
        trace = graded(amplitude, phase, both)
        keep("graded march", early, trace[np.searchsorted(both, early)])
        keep("graded march, once a cell from the first on", uniform, trace[np.searchsorted(both, uniform)])
        for oversampling in (1, 4):
            height = roughness.line(amplitude, phase, oversampling * POINTS)
            for way, meaning in WAYS.items():
                last = LAST if way == FULL_RATE or oversampling == 1 else 2.2
                keep(f"steps of a cell, oversampling {oversampling}, {meaning}", *stepped(height, way, last))
    return {name: (times[name], np.array(traces[name])) for name in times}


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    heads = [f"t' < {window:.2g}" for window in WINDOWS]
    heads += [
        *(f"end fitted, {head}" for head in heads[1:]),
        *(f"ln, {head}" for head in heads[1:3]),
        f"1/variance, {heads[2]}",
        "integral",
    ]
    print(" | ".join(["way", *heads]))
    for name, (time, lines) in lines_of(count).items():
        cells = []
        for samples in rates_of(time, lines):
            low, high = bootstrap.interval(samples, count, positive=True)
            cells.append(f"{samples[0]:.2f} ({low:.2f}, {high:.2f})")
        print(" | ".join([name, *cells]), flush=True)


if __name__ == "__main__":
    main()
