"""Wear under a sequence of load blocks, each with a constant amplitude and a constant depth or force.

The wear rate is df/dN = p(r) s(r), where the slip s is the half-integral of the positive part of 1 - (d - g) / eta.
Slip in a block is partial or gross. The grid is uniform, because the image has a kink or a jump at the stick border of
every earlier block with partial slip.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.uniform_grid import UniformGrid, uniform_grid
from mdr_dask.physics.wear.worn import Worn


@dataclass(frozen=True)
class LoadBlock:
    """Load cycles of constant amplitude, at constant `depth` (unit d0) or constant `force` (unit E* d0 a0).

    `cycles` is N = 4 U0 n k E* / (sigma0 a0) for n cycles of the amplitude U0 of this block. `slip_share` is eta = G*
    U0 / (mu E* d0). If eta exceeds the depth in units of d0, the slip is gross. An infinite eta means sliding in one
    direction, and `cycles` is then k E* l / (sigma0 a0) for the sliding distance l.
    """

    cycles: float
    slip_share: float
    depth: float | None = None
    force: float | None = None


def history(profile: Profile, blocks: Sequence[LoadBlock], *, cells: int = 200, reach: float = 2.0) -> list[Worn]:
    """Return the contact at the end of every block. The virgin body has the contact radius 1 at the depth 1.

    The error is about proportional to the cell width. After a block in which the image gets a jump, the error is about
    proportional to the square root of the cell width. `reach` is the largest radius of the grid in units of a0. If
    the table of the profile ends at a smaller radius, the grid ends there. If the contact reaches beyond the grid, a
    ValueError is raised.
    """
    grid = uniform_grid(cells, min(reach, profile.largest_radius))
    image_0 = profile.image(grid.nodes)
    worn = np.zeros_like(image_0)
    records = []
    for block in blocks:
        worn = _advance(grid, image_0, worn, block)
        records.append(_record(grid, profile, worn, image_0 + grid.forward @ worn, block))
    return records


def _advance(grid: UniformGrid, image_0: FloatArray, worn: FloatArray, block: LoadBlock) -> FloatArray:
    """Return the worn depth after a block, by Heun's method."""
    done = 0.0

    def rate(worn: FloatArray) -> FloatArray:
        image = image_0 + grid.forward @ worn
        depth = _depth(grid, image, block)
        free = np.maximum(1.0 - np.maximum(depth - image, 0.0) / block.slip_share, 0.0)
        return np.asarray(grid.pressure(image, depth) * (grid.inverse @ free))

    while done < block.cycles:
        step = min(0.85 * grid.spacing, block.cycles - done)  # in units of N0; half of the largest stable step
        first = rate(worn)
        worn = worn + 0.5 * step * (first + rate(worn + step * first))
        done += step
    return worn


def _depth(grid: UniformGrid, image: FloatArray, block: LoadBlock) -> float:
    """Return the indentation depth of a worn body in a block.

    If the contact reaches beyond the grid, a ValueError is raised.
    """
    depth = block.depth if block.depth is not None else grid.depth(image, float(block.force or 0.0))
    if image[-1] <= depth:
        raise ValueError(
            f"at the depth {depth:.4g} d0 the contact reaches beyond the last radius of the grid, "
            f"{grid.nodes[-1]:.4g} a0: give fewer cycles, or `path` if the whole contact slips; if the body is a "
            "table, the grid ends where the table ends, so extend the table"
        )
    return depth


def _record(grid: UniformGrid, profile: Profile, worn: FloatArray, image: FloatArray, block: LoadBlock) -> Worn:
    """Return the worn contact at the end of a block. Beyond the grid, the image is NaN and the pressure is zero."""
    depth = _depth(grid, image, block)
    pressure = grid.pressure(image, depth)
    stuck = np.flatnonzero(depth - image < block.slip_share)
    k = int(stuck[0]) if stuck.size else 0
    border = 0.0
    if k > 0:
        excess = depth - image[k - 1 : k + 1] - block.slip_share
        border = float(grid.nodes[k - 1] + grid.spacing * excess[0] / (excess[0] - excess[1]))
    return Worn(
        contact_radius=grid.edge(image, depth),
        stick_border=border,
        depth=depth,
        normal_force=grid.force(image, depth),
        wear_volume=float(2.0 * np.pi * np.trapezoid(worn * grid.nodes, grid.nodes)),
        worn_depth=float(np.max(worn)),
        height=lambda r: np.asarray(profile.height(r) + np.interp(r, grid.nodes, worn, right=0.0)),
        image=lambda x: np.asarray(np.interp(np.abs(x), grid.nodes, image, right=np.nan)),
        pressure=lambda r: np.asarray(np.interp(r, grid.nodes, pressure, right=0.0)),
        radius_error=0.5 * grid.spacing,
    )
