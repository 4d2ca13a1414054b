"""Steady friction beside stepping in time, as the thesis did: ``python -m benchmarks peers friction``.

All springs of a line stand on it at rest, then it moves on by a cell in each step. A step of backward Euler finds the
depth that carries the load. Friction is the mean over the last part of the way.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.accuracy import sliding
from benchmarks.accuracy.points import Point
from benchmarks.peers.beside import OURS, in_turns, single_threaded
from benchmarks.peers.page import tell
from mdr_dask.physics.sliding.problem import Request, solve

GRIDS = (1, 2, 4, 8, 16, 32, 64, 128)
GOALS = (0.1, 0.03, 0.01)
#: Relaxation times for which the line moves on, and the part of the way that counts.
WAY, LAST = 12, 0.1


def stepped(line, deborah: float, load: float, nodes: int) -> float:
    """Return the friction of a line that is stepped in time until it slides steadily; unit length, unit modulus."""
    height = line.heights(nodes)
    slope = (height - np.roll(height, 1)) * nodes  # of the cell that it has come over, so that no work is lost
    damping = deborah * nodes  # of a spring in a step of one cell
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
    """Return the depth at which summits, in rising order, carry a mean load: forces are pieces of straight lines."""
    falling = summits[::-1]
    numbers = np.arange(1, falling.size + 1)
    sums = np.cumsum(falling)
    carried = (sums - numbers * falling) / falling.size  # as each comes into contact
    count = np.searchsorted(carried, load, side="right")
    return (load * falling.size - sums[count - 1]) / count


def compared() -> Iterator[Point]:
    """Yield what the least errors that reach a goal take of each method."""
    for case, (hurst, depth, deborah) in sliding.CASES.items():
        line, reference = sliding.rough(hurst)
        truth = sliding.exact(reference, depth, sliding.slow.Body(np.empty(0), np.empty(0), deborah), True, False)

        def ours(accuracy, line=line, deborah=deborah, truth=truth):
            aim = Request(accuracy, "auto", "hermite")
            steady, _ = solve(line, None, np.array([deborah]), np.array([truth.load]), aim)
            return steady.drag[0] / truth.load

        def thesis(grid, line=line, deborah=deborah, truth=truth):
            return stepped(line, deborah, truth.load, 2 * sliding.MODES * grid)

        errors = {grid: abs(thesis(grid) / truth.friction - 1) for grid in GRIDS}
        for goal in GOALS:
            grid = next((grid for grid in GRIDS if errors[grid] <= goal), None)
            methods = {(OURS, f"accuracy {goal:g}"): lambda ours=ours, goal=goal: ours(goal)}
            if grid:
                methods["all springs, NumPy", f"grid {grid}"] = lambda thesis=thesis, grid=grid: thesis(grid)
            for (name, setting), (friction, seconds) in in_turns(methods).items():
                error = max(abs(friction / truth.friction - 1), truth.doubt)
                yield Point("steady sliding", f"{case}, {goal:g}", name, setting, seconds, error)


if __name__ == "__main__":
    single_threaded()
    tell(compared())
