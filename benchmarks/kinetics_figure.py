"""What the rate of thesis Fig. 4.3 (printed: 2.4) depends on: window, grid, time steps and indentation rate.

    python -m benchmarks.kinetics_figure [REALISATIONS]

The papers' way is backward Euler with steps of one cell, from the steady state of the same scheme at v_1.
"""

from __future__ import annotations

import sys

import numpy as np

from mdr_dask.fit.relaxation import exponential, widths
from mdr_dask.physics import roughness
from mdr_dask.physics.backward_euler import solve
from mdr_dask.physics.kinetics import velocity_jump

POINTS, HURST, LOAD, REACH, CHANGE = 5000, 0.7, 0.3, 0.005, 0.2
WINDOWS = 0.3, 1.0, 2.0, 3.0
LAST = 6.0


def stepped(height: np.ndarray, with_rate: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return times and mu - mu_2 of backward Euler with steps of one cell, with or without the rate of the depth."""
    n = height.size
    height = np.roll(height, -1 - int(np.argmax(height)))
    cells = np.array([REACH * n])
    depth = solve(height - height[-1], True, cells, np.array([LOAD * n]))[0][0] - height[-1]
    fade = 1 / (1 + 1 / cells[0])
    u, now = np.empty(n), depth + height[-1]
    for i in range(n):
        now = max(depth + height[i], fade * now)
        u[i] = now
    ratio = cells[0] * (1 + CHANGE)
    fade, rise = ratio / (1 + ratio), height - np.roll(height, 1)
    drag = []
    for _ in range(int(LAST * ratio)):
        free = fade * np.roll(u, 1)
        low, high = depth - 0.2, depth + 0.2
        for _ in range(36):  # the load grows with the depth, by leaps where the rate is left out
            depth = 0.5 * (low + high)
            w = depth + height
            force = np.where(w > free, (1 + ratio) * (w - free) if with_rate else np.maximum(w + ratio * rise, 0), 0)
            low, high = (depth, high) if force.sum() < LOAD * n else (low, depth)
        u = np.maximum(depth + height, free)
        drag.append(float(force @ rise) / LOAD)
    trace = np.array(drag)
    return np.arange(1, trace.size + 1) / ratio, trace - trace[-1]


def graded(amplitude: np.ndarray, phase: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return mu - mu_2 of the march."""
    nodes = 4 * POINTS
    line = roughness.line(amplitude, phase, nodes), roughness.line(amplitude, phase, nodes, 1)
    jump = velocity_jump(*line, LOAD, (REACH, REACH * (1 + CHANGE)), times, np.pi * POINTS, 12)
    trace: np.ndarray = (jump.trace - jump.after) / LOAD
    return trace


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    amplitude = roughness.amplitudes(POINTS // 2, HURST)
    uniform, early = np.arange(0, LAST, 1 / (REACH * 1.2 * POINTS)), np.concatenate([[0], np.geomspace(1e-4, LAST, 60)])
    rows: dict[str, list[np.ndarray]] = {}
    times: dict[str, np.ndarray] = {}
    for realisation in range(count):
        phase = roughness.phases(2014, realisation, POINTS // 2)
        rows.setdefault("graded march", []).append(graded(amplitude, phase, early))
        times["graded march"] = early
        rows.setdefault("graded march, read after each cell", []).append(graded(amplitude, phase, uniform[1:]))
        times["graded march, read after each cell"] = uniform[1:]
        for oversampling in (1, 4):
            height = roughness.line(amplitude, phase, oversampling * POINTS)
            for with_rate in (True, False):
                name = f"backward Euler, oversampling {oversampling}, {'with' if with_rate else 'no'} rate of depth"
                times[name], trace = stepped(height, with_rate)
                rows.setdefault(name, []).append(trace)
    print(f"{'method':58}" + "".join(f"{f'b, t < {window}':>14}" for window in WINDOWS) + f"{'integral rate':>16}")
    for name, traces in rows.items():
        mean, time = np.mean(traces, axis=0), times[name]
        rates = []
        for window in WINDOWS:
            inside = time <= window
            rates.append(exponential(time[inside], mean[inside], widths(time[inside]))[0])
        integral = mean[0] / (widths(time) @ mean)
        print(f"{name:58}" + "".join(f"{rate:14.2f}" for rate in rates) + f"{integral:16.2f}")


if __name__ == "__main__":
    main()
