"""The transforms of piecewise linear functions on a uniform grid, with exact integrals over each cell.

With the cell width h, the error of the inverse transform (image to profile) is proportional to h^2, and the error of
the forward transform (profile to image) is proportional to h^1.5. The error of the pressure is proportional to h, and
is largest next to the axis. Unlike the panels of `half_integrals`, this grid is suitable for functions with any number
of kinks.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.refine import EPS, MOST_ITERATIONS


@dataclass(frozen=True, eq=False)
class UniformGrid:
    """Nodes 0, h, 2h, ... and (n, n) matrices with f = inverse @ g, g = forward @ f and p / E* = stress @ q.

    The line load q is d - g inside the contact and zero outside. A contact that does not end on the grid is cut off at
    the last node.
    """

    nodes: FloatArray
    inverse: FloatArray
    forward: FloatArray
    stress: FloatArray

    @property
    def spacing(self) -> float:
        """Distance between neighbouring nodes."""
        return float(self.nodes[1])

    def edge(self, image: FloatArray, depth: float) -> float:
        """Return the smallest radius at which the image reaches the depth, by linear interpolation between nodes.

        If the image is below the depth at all nodes, return the last radius of the grid.
        """
        beyond = np.flatnonzero(image >= depth)
        if beyond.size == 0:
            return float(self.nodes[-1])
        k = int(beyond[0])
        if k == 0:
            return 0.0
        return float(self.nodes[k] - self.spacing * (image[k] - depth) / (image[k] - image[k - 1]))

    def pressure(self, image: FloatArray, depth: float) -> FloatArray:
        """Return p / E* at the nodes. In the last cell of the contact, the line load falls linearly to the edge."""
        load = np.maximum(depth - image, 0.0)
        k = int(np.argmax(image >= depth))
        result = self.stress @ load
        if k == 0:
            return result
        a = self.edge(image, depth)
        low, inside = self.nodes[k - 1], self.nodes[:k]
        cut, whole = _kernel(low, a, inside), _kernel(low, self.nodes[k], inside)
        steep, flat = load[k - 1] / max(a - low, 1e-300), load[k - 1] / self.spacing
        result[:k] += (cut * steep - whole * flat) / np.pi
        result[k:] = 0.0
        return result

    def force(self, image: FloatArray, depth: float) -> float:
        """Return F_N / E*, twice the integral of d - g from 0 to the contact edge."""
        load = np.maximum(depth - image, 0.0)
        k = int(np.argmax(image >= depth))
        if k == 0:
            return float(2.0 * np.trapezoid(load, self.nodes))
        last = load[k - 1] * (self.edge(image, depth) - self.nodes[k - 1])
        return float(2.0 * np.trapezoid(load[:k], self.nodes[:k]) + last)

    def depth(self, image: FloatArray, force: float) -> float:
        """Return the depth at which F_N / E* equals `force`, by Newton's method (the force is convex in the depth)."""
        depth = float(np.max(image))
        for _ in range(MOST_ITERATIONS):
            slope = 2.0 * max(self.edge(image, depth), self.spacing)
            change = (force - self.force(image, depth)) / slope
            depth += change
            if abs(change) <= EPS * depth:
                break
        return depth


@lru_cache(maxsize=8)
def uniform_grid(cells: int, length: float) -> UniformGrid:
    """Return the grid of equal cells on [0, length]."""
    x = np.linspace(0.0, length, cells + 1)
    h = x[1]
    inverse, forward, stress = (np.zeros((cells + 1, cells + 1)) for _ in range(3))
    inverse[0, 0] = forward[0, 0] = 1.0
    for i in range(1, cells + 1):
        angle = np.arcsin(np.minimum(x[: i + 1] / x[i], 1.0))
        root = np.sqrt(np.maximum((x[i] - x[: i + 1]) * (x[i] + x[: i + 1]), 0.0))
        zeroth, first = np.diff(angle), -np.diff(root)
        right = (first - x[:i] * zeroth) / h
        inverse[i, :i] += 2.0 / np.pi * (zeroth - right)
        inverse[i, 1 : i + 1] += 2.0 / np.pi * right
        forward[i, 0] += 1.0
        forward[i, :i] -= x[i] * zeroth / h
        forward[i, 1 : i + 1] += x[i] * zeroth / h
    for i in range(cells):
        step = _kernel(x[i:-1], x[i + 1 :], x[i])
        stress[i, i:-1] += step / (np.pi * h)
        stress[i, i + 1 :] -= step / (np.pi * h)
    return UniformGrid(x, inverse, forward, stress)


def _kernel(low: ArrayLike, high: ArrayLike, radius: ArrayLike) -> FloatArray:
    """Return the integral of 1 / sqrt(x^2 - r^2) from `low` >= r to `high`.

    For r = low = 0, the integral diverges, and 2 is returned instead: if the slope of the line load is proportional to
    x, the integral of slope / x over the first cell is 2 times the mean slope in this cell.
    """
    low, high, r = np.broadcast_arrays(*(np.asarray(each, dtype=np.float64) for each in (low, high, radius)))
    with np.errstate(divide="ignore", invalid="ignore"):
        ring = np.arccosh(np.maximum(high / r, 1.0)) - np.arccosh(np.maximum(low / r, 1.0))
        return np.where(r > 0, ring, np.where(low > 0, np.log(high / low), 2.0))
