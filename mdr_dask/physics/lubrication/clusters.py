"""Clusters: intervals of a closed line in which the summed heights of two rough lines exceed the film."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.surfaces.splines import integral, piece, zeros


class Clusters(NamedTuple):
    """The clusters of a closed line, in ascending order of `start`. Positions and lengths are in spacings of the nodes.

    If a cluster continues from the last node to the first node, the `end` lies beyond the last node. For example, on a
    line of 100 nodes, a cluster from position 98 to position 3 has the `end` 103. `total` is the integral of ``z - h0``
    in m over each cluster. `overlap`, shape (points + 3,), contains the spline coefficients of ``z - h0`` in m: first
    the last coefficient of the line, then all coefficients, then the first two again. A cluster breaks the layer if
    ``total > limit (end - start)^3`` (thesis eq. 5.6), with `limit` in m. `closed` means that a single cluster covers
    the whole line.
    """

    start: FloatArray
    end: FloatArray
    total: FloatArray
    overlap: FloatArray
    limit: float
    closed: bool

    @property
    def points(self) -> int:
        """Number of nodes of the line."""
        return self.overlap.size - 3


@jit
def whole_piece(overlap: FloatArray, k: int) -> float:
    """Return the integral of `overlap` (see `Clusters`) from node k to node k + 1."""
    found: float = (overlap[k] + 11 * overlap[k + 1] + 11 * overlap[k + 2] + overlap[k + 3]) / 24
    return found


@jit
def total(overlap: FloatArray, start: float, end: float) -> float:
    """Return the integral of `overlap` (see `Clusters`) from `start` to `end`, which may lie beyond the last node."""
    points = overlap.size - 3
    first, last = int(start), int(end)
    found: float = -integral(piece(overlap, first), start - first)
    for k in range(first, last):
        found += whole_piece(overlap, k if k < points else k - points)
    if end > last:
        found += integral(piece(overlap, last if last < points else last - points), end - last)
    return found


@jit
def crossings(overlap: FloatArray, found: FloatArray) -> int:
    """Write to `found` the positions at which a spline changes sign, and return the number of these positions."""
    count = 0
    above = 4 * (overlap[0] > 0) + 2 * (overlap[1] > 0) + (overlap[2] > 0)
    for k in range(overlap.size - 3):
        above = (above << 1 | (overlap[k + 3] > 0)) & 15  # one bit for the sign of each of the four coefficients
        if above != 0 and above != 15:
            count = zeros(overlap, k, found, count)
    return count


@jit
def _totals(overlap: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    found = np.empty(start.size)
    for c in range(start.size):
        found[c] = total(overlap, start[c], end[c])
    return found


def find_clusters(line: FloatArray, level: float, spacing: float, strength: float) -> Clusters:
    """Return the clusters of a line for the film `level` in m.

    `line` contains the spline coefficients of the summed heights in m, at three nodes or more. `spacing` is the
    distance between neighbouring nodes in m, and `strength` is the result of `layer_strength` in 1/m.
    """
    points = line.size
    overlap = np.concatenate((line[-1:], line, line[:2])) - level
    places = np.empty(3 * points)
    places = places[: crossings(overlap, places)]
    inside = overlap[0] + 4 * overlap[1] + overlap[2] > 0
    closed = bool(inside and places.size == 0)
    if closed:
        places = np.array([0.0, points])
    elif inside:
        places = np.append(places[1:], places[0] + points)
    start, end = np.ascontiguousarray(places[::2]), np.ascontiguousarray(places[1::2])
    return Clusters(start, end, _totals(overlap, start, end), overlap, strength * spacing**2, closed)
