"""Compare steady friction with time stepping, the method of the thesis.

At first the springs are in contact with a line at rest. Then the line moves by one cell in each step. Each step of
backward Euler finds the depth that carries the load. Friction is the mean over the last part of the distance.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.peers import OURS
from benchmarks.rows import Row, timed_in_turns
from benchmarks.solvers import sliding
from mdr_dask.physics.sliding.problem import Request
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import Waves

GRIDS = (1, 2, 4, 8, 16, 32, 64, 128)
GOALS = (0.1, 0.01)
#: Hurst exponent, depth in rms heights, v tau / L.
CASES = {
    "full contact": (0.7, 8.0, 0.01),
    "transition": (0.7, 0.3, 0.003),
    "few peaks": (0.3, -2.0, 0.003),
}
#: Sliding time in relaxation times; the last fraction of this time over which friction is averaged.
WAY, LAST = 12, 0.1


def stepped(line, deborah: float, load: float, nodes: int) -> float:
    """Return friction by time stepping until the line slides steadily, for unit length and unit modulus."""
    height = line.roughness.heights(nodes)
    slope = (height - np.roll(height, 1)) * nodes  # slope of the cell just passed, so that the work is exact
    damping = deborah * nodes  # damping of a spring during one step of one cell
    steps = max(int(WAY * deborah * nodes), 20)
    displacement, depth, sums = np.zeros(nodes), 0.0, []
    for step in range(steps):
        free = displacement * damping / (1 + damping)
        depth = _carrying(load, np.sort(height - free) * (1 + damping), depth * (1 + damping)) / (1 + damping)
        touching = depth + height > free
        moved = np.where(touching, depth + height, free)
        force = np.where(touching, moved + damping * (moved - displacement), 0.0)
        if step >= steps * (1 - LAST):
            sums.append(np.mean(force * slope) / np.mean(force))
        displacement, height, slope = moved, np.roll(height, -1), np.roll(slope, -1)
    return float(abs(np.mean(sums)))


def _carrying(load: float, summits: np.ndarray, depth: float) -> float:
    """Return the depth at which springs carry a mean load. The load is a piecewise linear function of the depth.

    `summits` are the heights of the springs in rising order.
    """
    falling = summits[::-1]
    numbers = np.arange(1, falling.size + 1)
    sums = np.cumsum(falling)
    carried = (sums - numbers * falling) / falling.size  # load at which each spring comes into contact
    count = np.searchsorted(carried, load, side="right")
    return (load * falling.size - sums[count - 1]) / count


def compared() -> Iterator[Row]:
    """Yield the least time in which each method reaches a given error."""
    modes = sliding.MODES
    for name, (hurst, depth, deborah) in CASES.items():
        amplitude, phase = roughness.amplitudes(modes, hurst), roughness.phases(0, 1, modes)
        line = RoughLine(Waves(0.5 * amplitude * np.exp(1j * phase), 2 * modes))
        case, truth = sliding.known(line, sliding.slow.waves(amplitude, phase), None, deborah, depth)
        errors = {grid: abs(stepped(line, deborah, case.load, 2 * modes * grid) / truth.values - 1) for grid in GRIDS}
        for goal in GOALS:
            methods = {(OURS, f"accuracy {goal:g}"): lambda case=case, goal=goal: case.found(Request(goal)).values}
            grid = next((grid for grid in GRIDS if errors[grid] <= goal), None)
            if grid:
                methods["all springs, NumPy", f"grid {grid}"] = lambda line=line, case=case, nodes=2 * modes * grid: (
                    stepped(line, case.deborah, case.load, nodes)
                )
            for (method, setting), (friction, seconds) in timed_in_turns(methods, 3).items():
                error = max(abs(friction / truth.values - 1), truth.doubt / truth.scale)
                yield Row("steady sliding", f"{name}, {goal:g}", method, setting, 1, seconds, float(error))
