"""Breaks of the boundary layer by asperities of two rough lines that are separated by a film (thesis section 5.2.2).

A cluster is an interval in which the sum ``z`` of the heights of both lines exceeds the film ``h0``. The cluster breaks
the layer if ``int (z - h0) dx > s D^3``, with the length D of the interval and the result s of `layer_strength` (eqs.
5.5, 5.6). The contact zone is a window of the lines; in pure rolling, the window begins at each node in turn. Clusters
are cut at the edges of the window. The length in intimate contact of a window, or briefly its length in contact, is the
total length of the clusters in the window that break the layer. The lines are closed cubic splines: the first node
follows the last node. All integrals are exact.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.lubrication.clusters import Clusters, crossings, total, whole_piece
from mdr_dask.physics.surfaces.splines import integral, piece, shares

#: Number of equal parts of a spacing between two nodes. Lengths in contact are rounded to whole numbers of parts, whose
#: sums are exact. Even the length of a line of 2^30 spacings fits into a 64-bit integer.
PARTS = 2**32


def layer_strength(shear_strength: ArrayLike, E_star: ArrayLike, thickness: ArrayLike) -> FloatArray:
    """Return ``s = pi tau0/(12 E* h_c)`` in 1/m. A parabolic asperity with a curvature above ``12 s`` breaks the layer.

    tau0 is the limiting shear stress of the layer in Pa, and h_c is the critical thickness of the layer in m.
    """
    return np.asarray(np.pi * np.asarray(shear_strength) / (12 * np.asarray(E_star) * np.asarray(thickness)))


@jit
def _counted(length: float) -> int:
    """Convert a length in spacings to a whole number of parts (see `PARTS`), at least 1."""
    return max(1, int(length * PARTS + 0.5))


@jit
def _block(jumps: IntArray, begin: int, count: int, number: int) -> None:
    """Add `number` to the lengths in contact of the `count` successive windows from node `begin` on.

    `jumps` holds the differences between the lengths in contact of neighbouring windows.
    """
    points = jumps.size - 1
    while begin < 0:
        begin += points
    while begin >= points:
        begin -= points
    end = begin + count
    jumps[begin] += number
    if end > points:
        jumps[0] += number
        end -= points
    jumps[end] -= number


@jit
def _add_cuts(clusters: Clusters, c: int, window: float, reach: float, jumps: IntArray) -> None:
    """Add the parts of a cluster to the lengths in contact of all windows that contain exactly one end of it.

    Only parts that break the layer are added. No part that is longer than `reach` can break the layer.
    """
    overlap, points, limit = clusters.overlap, clusters.overlap.size - 3, clusters.limit
    start, end, total = clusters.start[c], clusters.end[c], clusters.total[c]
    longest = min(window, reach)
    width = int(window)
    beyond = window - width  # distance from the last node in the window to the right edge of the window
    first, second, third, fourth = shares(beyond)
    node = int(start)
    until_node = -integral(piece(overlap, node), start - node)
    while node < end:
        k = node if node < points else node - points
        head, tail = node + beyond - start, end - node
        force = first * overlap[k] + second * overlap[k + 1] + third * overlap[k + 2] + fourth * overlap[k + 3]
        breaks = until_node + force > limit * head * head * head
        if breaks and 0 < head < end - start and head <= longest:
            _block(jumps, node - width, 1, _counted(head))
        breaks = total - until_node > limit * tail * tail * tail
        if breaks and node > start and tail <= longest:
            _block(jumps, k, 1, _counted(tail))
        until_node += whole_piece(overlap, k)
        node += 1


@jit
def _add_middles(clusters: Clusters, c: int, window: float, jumps: IntArray) -> None:
    """Add a cluster to the lengths in contact of all windows that lie entirely within this cluster.

    Only windows in which the cluster breaks the layer are changed.
    """
    overlap, points, limit = clusters.overlap, clusters.overlap.size - 3, clusters.limit
    start, end = clusters.start[c], clusters.end[c]
    first, last = (0, points - 1) if clusters.closed else (int(start) + 1, int(np.ceil(end - window)) - 1)
    width = int(window)
    beyond = window - width
    force = 0.0
    for k in range(first, first + width if last >= first else first):
        force += whole_piece(overlap, k % points)
    for node in range(first, last + 1):
        edge = (node + width) % points
        inside = force + integral(piece(overlap, edge), beyond)
        if inside > limit * window**3:
            _block(jumps, node, 1, _counted(window))
        force += whole_piece(overlap, edge) - whole_piece(overlap, node % points)


@jit
def _collect(clusters: Clusters, window: float, jumps: IntArray) -> None:
    """Write the lengths in contact of all windows to `jumps`, which must contain only zeros before the call.

    The last entry of `jumps` belongs to no window.
    """
    points = jumps.size - 1
    # if a part of a cluster is longer than `reach`, this part cannot break the layer
    reach = np.sqrt(clusters.overlap.max() / clusters.limit) if clusters.limit > 0 else np.inf
    for c in range(clusters.start.size):
        start, end = clusters.start[c], clusters.end[c]
        length = end - start
        broken = clusters.total[c] > clusters.limit * length**3
        if broken and not clusters.closed:
            first = int(np.ceil(end - window))
            if first <= start:
                _block(jumps, first, int(start) - first + 1, _counted(length))
        if not clusters.closed:
            _add_cuts(clusters, c, window, reach, jumps)
        if clusters.closed or length > window:
            _add_middles(clusters, c, window, jumps)
    height = 0
    for p in range(points):
        height += jumps[p]
        jumps[p] = height


def contact_lengths(clusters: Clusters, window: float) -> IntArray:
    """Return the length in intimate contact, in parts (see `PARTS`), of the window that begins at each node.

    `window` is the length of a window in spacings, and must not exceed the length of the line. The breakthrough
    probability is the fraction of windows whose length in contact is not zero.
    """
    trace = np.zeros(clusters.points + 1, dtype=np.int64)
    if clusters.start.size:
        _collect(clusters, window, trace)
    return trace[:-1]


class Pair(NamedTuple):
    """The heights of two closed lines, as splines in m (see `surfaces.splines`), and the film between the lines.

    `level` is the film h0 in m, `spacing` is the distance between neighbouring nodes in m, and `strength` is the result
    of `layer_strength` in 1/m.
    """

    line_1: FloatArray
    line_2: FloatArray
    level: float
    spacing: float
    strength: float


@jit
def _fill(pair: Pair, p: int, q: int, overlap: FloatArray) -> None:
    """Write the spline coefficients of ``z - h0`` to `overlap`. Node p of line 1 faces node q of line 2."""
    points = pair.line_1.size
    for k in range(overlap.size):
        overlap[k] = pair.line_1[(p + k - 1) % points] + pair.line_2[(q + k - 1) % points] - pair.level


@jit
def _judge(pair: Pair, position: tuple[int, int], window: float, work: FloatArray) -> int:
    """Return the length in intimate contact of a window, in parts. `work` is workspace for ``z - h0`` and its zeros."""
    pieces = int(np.ceil(window))
    overlap, found = work[: pieces + 3], work[pieces + 3 :]
    limit = pair.strength * pair.spacing**2
    _fill(pair, position[0], position[1], overlap)
    count = crossings(overlap, found)
    inside = overlap[0] + 4 * overlap[1] + overlap[2] > 0
    contact = 0
    begin = 0.0
    for number in range(count + 1):
        end = min(found[number], window) if number < count else window
        if inside and begin < window:
            length = end - begin
            if total(overlap, begin, end) > limit * length**3:
                contact += _counted(length)
        begin = end
        inside = not inside
    return contact


@jit
def _windows(
    pair: Pair, positions: tuple[IntArray, IntArray], window: float, work: FloatArray, contact: IntArray
) -> None:
    for w in range(contact.size):
        contact[w] = _judge(pair, (positions[0][w], positions[1][w]), window, work)


def judge_windows(pair: Pair, window: float, positions: tuple[IntArray, IntArray]) -> IntArray:
    """Return the length in intimate contact, in parts (see `PARTS`), of each window.

    `positions` holds the node of line 1 and the node of line 2 at the left edge of each window. Rolling with creep
    needs this function (see `creep_positions`). For pure rolling, :func:`contact_lengths` is faster. `window` is the
    length of a window in spacings.
    """
    contact = np.zeros(positions[0].size, dtype=np.int64)
    if pair.line_1.max() + pair.line_2.max() > pair.level:
        work = np.empty(4 * int(np.ceil(window)) + 3)
        _windows(pair, positions, window, work, contact)
    return contact


def creep_positions(travel: ArrayLike, points: int, slide_roll_ratio: float) -> tuple[IntArray, IntArray]:
    """Return the nodes of line 1 and of line 2 nearest to the left edge of the window after each distance in `travel`.

    The distances are in spacings and are covered at the mean velocity u. With the slide-roll ratio ``S = (v1 - v2)/u``,
    line 1 moves by ``1 + S/2`` times the travel, and line 2 by ``1 - S/2`` times the travel.
    """
    steps = np.asarray(travel, dtype=np.float64)
    first, second = (np.round(steps * (1 + sign * slide_roll_ratio / 2)).astype(np.int64) % points for sign in (1, -1))
    return first, second
