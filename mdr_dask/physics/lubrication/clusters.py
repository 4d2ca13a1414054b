"""Clusters: connected intervals of a closed line in which the sum of heights exceeds the film."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.surfaces.splines import integral, piece, zeros


class Clusters(NamedTuple):
    """The clusters of a closed line, in the order in which they begin.

    Parameters
    ----------
    start, end : array, shape (n,)
        Beginning and end of each cluster in spacings. If a cluster continues from the last node of the closed line to
        the first node, the end of the cluster lies beyond the last node.
    total : array, shape (n,)
        Integral of ``z - h0`` over each cluster, in m times the spacing of the nodes.
    overlap : array, shape (points + 3,)
        Spline of ``z - h0`` in m, extended periodically: the last coefficient, all coefficients, and the first two
        coefficients.
    limit : float
        The number ``s dx^2`` in m, with the layer strength s and the distance dx between nodes. A cluster breaks the
        layer if ``total > limit (end - start)^3`` (thesis eq. 5.6).
    closed : bool
        Whether a single cluster covers the whole closed line; such a cluster has no end.
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
    """Return the integral of a spline from node k to node k + 1."""
    found: float = (overlap[k] + 11 * overlap[k + 1] + 11 * overlap[k + 2] + overlap[k + 3]) / 24
    return found


@jit
def total(overlap: FloatArray, start: float, end: float) -> float:
    """Return the integral from `start` to `end` of a closed spline with ``overlap.size - 3`` nodes.

    `end` may lie beyond the last node; the integral then continues at the first node.
    """
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
    """Write the positions where a spline changes sign to `found`, and return the number of these positions.

    The spline has ``overlap.size - 3`` nodes.
    """
    count = 0
    above = 4 * (overlap[0] > 0) + 2 * (overlap[1] > 0) + (overlap[2] > 0)
    for k in range(overlap.size - 3):
        above = (above << 1 | (overlap[k + 3] > 0)) & 15  # one bit for the sign of each of the four coefficients
        if above != 0 and above != 15:
            count = zeros(overlap, k, found, count)
    return count


@jit
def _totals(overlap: FloatArray, start: FloatArray, end: FloatArray, found: FloatArray) -> None:
    for c in range(start.size):
        found[c] = total(overlap, start[c], end[c])


def find_clusters(line: FloatArray, level: float, spacing: float, strength: float) -> Clusters:
    """Return the clusters for a given film thickness.

    Parameters
    ----------
    line : array, shape (points,)
        Spline of the sum of the heights of both lines in m, see `surfaces.splines`; at least three nodes.
    level : float
        Film thickness h0 in m.
    spacing : float
        Distance dx between nodes in m.
    strength : float
        Layer strength from `layer_strength`, in 1/m.
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
    totals = np.empty(start.size)
    _totals(overlap, start, end, totals)
    return Clusters(start, end, totals, overlap, strength * spacing**2, closed)
