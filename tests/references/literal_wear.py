"""Fretting wear as it was first simulated: springs, their hysteresis, sub-steps of every cycle, transforms at each one.

The slow, independent reference for the evolution equation (procedure of Dimaki et al., thesis chapter 6).
"""

from __future__ import annotations

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.uniform_grid import UniformGrid, uniform_grid
from mdr_dask.physics.wear.exact import farthest_contact
from mdr_dask.physics.wear.rules import limit_radius
from mdr_dask.physics.wear.worn import Worn, check_stick_radius


def literal(
    profile: Profile,
    stick_radius: float,
    cycles: float,
    *,
    cells: int = 200,
    cycles_per_unit: float | None = None,
    substeps: int = 32,
    constant_force: bool = False,
) -> Worn:
    """Return the worn contact, without an estimate of its error, by simulating every cycle.

    `cycles` is N in units of N0. Such a unit consists of `cycles_per_unit` cycles, by default of 3 / h, which are just
    enough for a stable simulation on cells of the width h.
    """
    check_stick_radius(stick_radius)
    reach = farthest_contact(profile, stick_radius) if constant_force else 1.02 * limit_radius(profile, stick_radius)
    grid = uniform_grid(cells, reach)
    rate = 3.0 / grid.spacing if cycles_per_unit is None else cycles_per_unit
    number = max(int(np.ceil(cycles * rate)), 1)
    virgin = profile.height(grid.nodes)
    image_0 = profile.image(grid.nodes)
    eta = 1.0 - float(profile.image(np.array(stick_radius)))
    depth, force = 1.0, grid.force(image_0, 1.0)
    worn = np.zeros_like(virgin)
    springs = np.zeros_like(virgin)
    phase = 2.0 * np.pi * np.arange(1, substeps + 1) / substeps
    moves = np.diff(np.append(0.0, np.sin(phase)))
    share = 0.0 if cycles == 0.0 else cycles / (4.0 * number)
    for _ in range(number):
        for move in moves:
            image = image_0 + grid.forward @ worn
            depth = grid.depth(image, force) if constant_force else 1.0
            limit = np.maximum(depth - image, 0.0) / eta
            moved = np.clip(springs + move, -limit, limit)
            slip = grid.inverse @ (move - (moved - springs))
            springs = moved
            worn += share * grid.pressure(image, depth) * np.abs(slip)
    return _describe(profile, stick_radius, grid, worn, depth)


def _describe(profile: Profile, c: float, grid: UniformGrid, worn: FloatArray, depth: float) -> Worn:
    """Turn the worn depth at the nodes into a worn contact."""
    shift = grid.forward @ worn
    image = profile.image(grid.nodes) + shift
    a = grid.edge(image, depth)
    eta = 1.0 - float(profile.image(np.array(c)))
    border = max(grid.edge(image, depth - eta), c)

    return Worn(
        contact_radius=a,
        stick_border=border,
        depth=depth,
        normal_force=grid.force(image, depth),
        wear_volume=float(2.0 * np.pi * np.trapezoid(worn * grid.nodes, grid.nodes)),
        worn_depth=float(np.max(worn)),
        height=lambda r: np.asarray(profile.height(r) + np.interp(r, grid.nodes, worn, right=0.0)),
        image=lambda x: np.asarray(np.interp(np.abs(x), grid.nodes, image)),
        pressure=lambda r: np.asarray(np.interp(r, grid.nodes, grid.pressure(image, depth), right=0.0)),
    )
