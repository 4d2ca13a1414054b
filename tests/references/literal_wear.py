"""Fretting wear as it was first simulated: springs, their hysteresis, sub-steps of every cycle, transforms at each one.

The slow, independent reference for the evolution equation (procedure of Dimaki et al., thesis chapter 6).
"""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.uniform_grid import uniform_grid
from mdr_dask.physics.wear.exact import farthest_contact
from mdr_dask.physics.wear.rules import limit_radius


def literal(
    profile: Profile, stick_radius: float, cycles: float, *, cells: int, constant_force: bool
) -> tuple[FloatArray, FloatArray, float]:
    """Return radii, the worn profile there, and the depth, by simulating every cycle in 16 steps.

    `cycles` is N in units of N0. Such a unit consists of 3 / h cycles, which are just enough for a stable simulation on
    cells of the width h.
    """
    reach = farthest_contact(profile, stick_radius) if constant_force else 1.02 * limit_radius(profile, stick_radius)
    grid = uniform_grid(cells, reach)
    number = int(np.ceil(cycles * 3.0 / grid.spacing))
    image_0 = profile.image(grid.nodes)
    eta = 1.0 - float(profile.image(np.array(stick_radius)))
    depth, force = 1.0, grid.force(image_0, 1.0)
    worn, springs = np.zeros_like(image_0), np.zeros_like(image_0)
    moves = np.diff(np.sin(2.0 * np.pi * np.arange(17) / 16))
    for move in np.tile(moves, number):
        image = image_0 + grid.forward @ worn
        depth = grid.depth(image, force) if constant_force else 1.0
        limit = np.maximum(depth - image, 0.0) / eta
        moved = np.clip(springs + move, -limit, limit)
        slip = grid.inverse @ (move - (moved - springs))
        springs = moved
        worn += cycles / (4.0 * number) * grid.pressure(image, depth) * np.abs(slip)
    return grid.nodes, profile.height(grid.nodes) + worn, depth
