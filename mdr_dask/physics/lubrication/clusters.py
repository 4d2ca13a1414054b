"""Clusters: runs of points of a closed line that reach beyond the film."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.compiling import compiled


class Excursions(NamedTuple):
    """The points of a closed line above some level: all that higher levels need.

    Parameters
    ----------
    place : int array, shape (n,)
        Their numbers on the line, ascending.
    height : array, shape (n,)
        Their heights in m.
    points : int
        Number of points of the whole line.
    """

    place: IntArray
    height: FloatArray
    points: int

    def above(self, level: float, step: int = 1) -> Excursions:
        """Return those above a higher level, of the line made of every `step`-th point, `step` a power of two."""
        place, height = np.empty_like(self.place), np.empty_like(self.height)
        n = _kept(self, level, step, place, height)
        return Excursions(place[:n], height[:n], self.points // step)


@compiled
def _kept(above: Excursions, level: float, step: int, place: IntArray, height: FloatArray) -> int:
    """Copy the excursions of every `step`-th point above a level; return their number."""
    end, count = above.points // step * step, 0
    for k in range(above.place.size):
        at = above.place[k]
        if above.height[k] > level and at & (step - 1) == 0 and at < end:  # a division would take longer than the rest
            place[count] = at
            height[count] = above.height[k]
            count += 1
    if step > 1:
        for k in range(count):
            place[k] //= step
    return count


def excursions(line: FloatArray, level: float) -> Excursions:
    """Return the points of a closed line (heights in m) that lie above a level (m)."""
    place = np.flatnonzero(line > level)
    return Excursions(place, line[place], line.size)


class Clusters(NamedTuple):
    """Clusters of overlapping points of a closed line, in the order of their starts.

    Parameters
    ----------
    start, length : int array, shape (n,)
        First point and number of points; a cluster across the seam has ``start + length > points``.
    total : array, shape (n,)
        Sum of ``z - h0`` over its points in m.
    overlap : array, shape (length.sum(),)
        ``z - h0`` of all points in m, cluster after cluster.
    limit : float
        ``s dx^2`` in m: the layer breaks where ``total > limit length^3``.
    points : int
        Number of points of the line.
    """

    start: IntArray
    length: IntArray
    total: FloatArray
    overlap: FloatArray
    limit: float
    points: int

    @property
    def broken(self) -> NDArray[np.bool_]:
        """Whether each cluster, taken whole, breaks the layer (thesis eq. 5.6)."""
        return self.total > self.limit * self.length.astype(np.float64) ** 3


@compiled
def _scan(above: Excursions, level: float, found: Clusters) -> int:
    """Fill the clusters of excursions in the order of their starts; return their number."""
    place, points = above.place, above.points
    first = 0
    while first < place.size and (place[first - 1] + 1) % points == place[first]:
        first += 1
    count, following, j = -1, -1, first
    for k in range(place.size):
        if j == place.size:
            j = 0
        if place[j] != following:
            count += 1
            found.start[count] = place[j]
            found.length[count] = 0
            found.total[count] = 0.0
        found.length[count] += 1
        found.overlap[k] = above.height[j] - level
        found.total[count] += found.overlap[k]
        following = place[j] + 1 if place[j] + 1 < points else 0
        j += 1
    return count + 1


def find_clusters(above: Excursions, level: float, spacing: float, strength: float, step: int = 1) -> Clusters:
    """Return the clusters at a film thickness.

    Parameters
    ----------
    above : Excursions
        The line's points above some level not higher than `level`.
    level : float
        Film thickness h0 in m.
    spacing : float
        Distance dx of the points in m.
    strength : float
        From `layer_strength`, in 1/m.
    step : int
        A power of two: clusters are those of every `step`-th point, `spacing` apart.
    """
    beyond = above.above(level, step)
    most, limit = beyond.place.size, strength * spacing**2
    start, length = np.empty(most, np.int64), np.empty(most, np.int64)
    found = Clusters(start, length, np.empty(most), np.empty(most), limit, beyond.points)
    n = _scan(beyond, level, found)
    return found._replace(start=start[:n], length=length[:n], total=found.total[:n])
