"""Error of a relaxation against run time: the graded march beside fixed steps from rest, in one run.

    python -m benchmarks.work_precision_kinetics [FIGURE]

One realisation of the case of Fig. 4.3 at a tenth of its length (500 Nyquist points); error is the largest difference
of mu - mu_2 at 20 moments from a march on a four times finer grid, over mu_2.
"""

from __future__ import annotations

import sys
import time

import numpy as np

from mdr_dask.physics import roughness
from mdr_dask.physics.kinetics import velocity_jump
from mdr_dask.physics.protocol import follow

POINTS, REACH, CHANGE, LOAD, RUN_IN = 500, 0.05, 0.2, 0.3, 10.0
TIMES = np.geomspace(0.01, 3, 20)


def line(oversampling: int) -> tuple[np.ndarray, np.ndarray]:
    amplitude = roughness.amplitudes(POINTS // 2, 0.7)
    phase = roughness.phases(2014, 0, POINTS // 2)
    nodes = POINTS * oversampling
    return roughness.line(amplitude, phase, nodes), roughness.line(amplitude, phase, nodes, 1)


def march(oversampling: int, per_decade: float) -> tuple[np.ndarray, float]:
    found = velocity_jump(*line(oversampling), LOAD, (REACH, REACH * (1 + CHANGE)), TIMES, np.pi * POINTS, per_decade)
    return found.trace, found.after


def from_rest(oversampling: int, cells: float) -> tuple[np.ndarray, float]:
    """Press at rest, slide at v_1 for 10 tau and at v_2 for 3 tau and more, with one fixed step."""
    height, slope = line(oversampling)
    reach = REACH * (1 + CHANGE)
    step = cells / height.size / reach
    before, after = int(RUN_IN / step), int(1.01 * TIMES[-1] / step)
    moments = step * np.arange(before + after + 1)
    reaches = np.where(moments <= before * step, REACH, reach)
    travels = np.minimum(moments, before * step) * REACH + np.maximum(moments - before * step, 0) * reach
    depth = float(np.sort(LOAD - height)[0])
    loads = np.full(moments.size, LOAD)
    pressed = np.maximum(height + depth, 0)
    pressed *= LOAD / max(pressed.mean(), 1e-300) if pressed.mean() > 0 else 0
    state = follow(height, slope, moments, travels, reaches, loads, pressed, depth)
    trace = np.interp(TIMES, moments - before * step, state.drag)
    return trace, float(state.drag[-1])


def timed(function, *arguments, times=1):
    """Return the value and the least processor time of some calls."""
    seconds = []
    for _ in range(times):
        started = time.process_time()
        value = function(*arguments)
        seconds.append(time.process_time() - started)
    return value, min(seconds)


def main() -> None:
    march(2, 12), from_rest(1, 1.0)
    truth, end = march(32, 96)
    rows = []
    for arguments in ((2, 8), (4, 12), (8, 24), (16, 48)):
        (trace, after), seconds = timed(march, *arguments, times=5)
        error = np.max(np.abs((trace - after) - (truth - end))) / end
        rows.append(("march", *arguments, error, seconds))
    for arguments in ((1, 1.0), (2, 1.0), (4, 1.0), (8, 1.0), (16, 1.0)):
        (trace, _), seconds = timed(from_rest, *arguments)
        error = np.max(np.abs(trace - truth)) / end
        rows.append(("fixed steps from rest", *arguments, error, seconds))
    print(f"{'method':24}{'oversampling':>14}{'steps':>8}{'error':>12}{'seconds':>12}")
    for method, oversampling, steps, error, seconds in rows:
        print(f"{method:24}{oversampling:14d}{steps:8.3g}{error:12.2e}{seconds:12.4f}")
    if len(sys.argv) > 1:
        draw(rows, sys.argv[1])


def draw(rows: list[tuple[str, int, float, float, float]], path: str) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5, 4), layout="constrained")
    axes = figure.subplots()
    for method in dict.fromkeys(row[0] for row in rows):
        mine = np.array([row[3:] for row in rows if row[0] == method])
        axes.loglog(mine[:, 1], mine[:, 0], "o-", label=method)
    axes.set(xlabel="seconds", ylabel=r"largest error of the trace over $\mu_2$")
    axes.legend(frameon=False)
    figure.savefig(path, dpi=120)


if __name__ == "__main__":
    main()
