"""The deformation of a half-plane by a piecewise linear pressure on many nodes, in O(n log n).

The kernel ``-(1/pi) ln|X - X'|`` between two neighbouring halves of a line of nodes is a matrix of low rank; each half
is halved again until a dense leaf remains. The low ranks come from adaptive cross approximation: rows and columns
of the block itself, taken where the rest is largest, until the rest is rounding. Hertz units, as in
:mod:`mdr_dask.physics.lubrication.deformation`, whose dense matrix this is within rounding.
"""

from __future__ import annotations

from math import log, log2, pi
from typing import NamedTuple

import numpy as np
from numba import njit

from mdr_dask.arrays import FloatArray, IntArray

#: Nodes of a leaf, about; greatest rank of a block; size of the rest of a block over its largest entry.
_LEAF = 40
_RANK = 40
_REST = 1e-13
#: Rows that a block has beside its own: the two nodes before, the one behind, whose films its balances see.
BEFORE, BEHIND = 2, 1
BESIDE = BEFORE + BEHIND
#: Columns of a block that the balances see without the kernel: neighbours across the cut.
CROSSING = 2
#: An element nearer to the point than this many widths is integrated in closed form, one farther by quadrature, as
#: the closed form is a second difference and loses digits.
_NEAR = 8.0
_ABSCISSAE, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(6)


class LineKernel(NamedTuple):
    """Kernel between the nodes of a line, in blocks.

    Level ``l`` cuts the n nodes into ``2^(l+1)`` clusters, of which cluster k begins at ``k n >> (l+1)``; it has a
    block with the columns of its sibling ``k ^ 1``. The constant in the kernel is such that it is positive.

    Parameters
    ----------
    nodes, weights : array, shape (n,)
        Ascending nodes in half widths and their trapezoidal weights.
    origin : array, shape (n,)
        Row of the point ``X = 0``.
    leaves : array, shape (clusters, m + 3, m)
        Dense blocks of the last level's clusters with themselves; rows from two nodes before to one behind.
    rows : array, shape (levels, n + 3 clusters, r)
        Left factors; the node i of cluster k is in row ``i + 3 k + 2``, after two nodes before it.
    columns : array, shape (levels, n, r + 2)
        Right factors of the node's sibling cluster; after its rank, unit vectors of the nodes next to the cut.
    ranks : array, shape (levels, clusters)
        Ranks of the blocks.
    """

    nodes: FloatArray
    weights: FloatArray
    origin: FloatArray
    leaves: FloatArray
    rows: FloatArray
    columns: FloatArray
    ranks: IntArray


@njit(nogil=True, cache=True)
def _element(distance: float, width: float, reach: float) -> float:
    """Return ``int_0^1 s ln(|distance + width (s - 1)|/reach) ds``: over an element, weighted to its far end."""
    total = 0.0
    if abs(distance) > _NEAR * abs(width):
        for k in range(_ABSCISSAE.size):
            s = 0.5 * (1.0 + _ABSCISSAE[k])
            total += 0.5 * _GAUSS_WEIGHTS[k] * s * log(abs(distance + width * (s - 1.0)) / reach)
        return total
    # with t = distance + width (s - 1): int t ln|t| and int ln|t| between the ends
    start = distance - width
    for t, sign in ((distance, 1.0), (start, -1.0)):
        if t != 0.0:
            logarithm = log(abs(t) / reach)
            total += sign * (0.5 * t * t * (logarithm - 0.5) - start * t * (logarithm - 1.0))
    return total / (width * width)


@njit(nogil=True, cache=True)
def _entry(point: float, nodes: FloatArray, j: int, reach: float) -> float:
    """Return the deformation at a point by the hat function of an inner node j, over the weight of the node."""
    left, right = nodes[j] - nodes[j - 1], nodes[j + 1] - nodes[j]
    distance = point - nodes[j]
    total = left * _element(distance, -left, reach) + right * _element(distance, right, reach)
    return float(-2.0 * total / (pi * (left + right)))


@njit(nogil=True, cache=True)
def _between(i: int, j: int, nodes: FloatArray, reach: float) -> float:
    """Return the deformation at node i by node j, over its weight; none by the ends, and rows outside repeat them."""
    if j == 0 or j == nodes.size - 1:
        return 0.0
    return _entry(nodes[min(max(i, 0), nodes.size - 1)], nodes, j, reach)


@njit(nogil=True, cache=True)
def _crosses(
    nodes: FloatArray, reach: float, first: int, start: int, ascending: bool, rows: FloatArray, columns: FloatArray
) -> int:
    """Fill the factors of the block of the nodes from `first` and the columns from `start`; return their rank.

    The next row is where the rest is largest in some columns: those at 0, 1, 3, 7, ... nodes from the cut.
    """
    count, size = columns.shape[0], rows.shape[0]
    probes = int(log2(count)) + 1
    rest, where = np.empty((size, probes)), np.empty(probes, np.int64)
    for p in range(probes):
        where[p] = (1 << p) - 1 if ascending else count - (1 << p)
        for i in range(size):
            rest[i, p] = _between(first + i, start + where[p], nodes, reach)
    largest = np.max(np.abs(rest))
    for rank in range(_RANK):
        pivot, top = 0, 0.0
        for i in range(size):
            for p in range(probes):
                if abs(rest[i, p]) > top:
                    pivot, top = i, abs(rest[i, p])
        if top <= _REST * largest:
            return rank
        best = 0
        for j in range(count):
            columns[j, rank] = _between(first + pivot, start + j, nodes, reach)
            for s in range(rank):
                columns[j, rank] -= rows[pivot, s] * columns[j, s]
            if abs(columns[j, rank]) > abs(columns[best, rank]):
                best = j
        columns[:, rank] /= columns[best, rank]
        for i in range(size):
            rows[i, rank] = _between(first + i, start + best, nodes, reach)
            for s in range(rank):
                rows[i, rank] -= rows[i, s] * columns[best, s]
            for p in range(probes):
                rest[i, p] -= rows[i, rank] * columns[where[p], rank]
    return _RANK


@njit(nogil=True, cache=True)
def _fill(kernel: LineKernel, reach: float) -> None:
    """Fill leaves, factors and ranks."""
    nodes, n = kernel.nodes, kernel.nodes.size
    levels, clusters = kernel.ranks.shape
    for j in range(1, n - 1):
        kernel.origin[j] = kernel.weights[j] * _entry(0.0, nodes, j, reach)
    for k in range(clusters):
        first, last = k * n >> levels, (k + 1) * n >> levels
        for j in range(max(first, 1), min(last, n - 1)):
            for i in range(first - BEFORE, last + BEHIND):
                entry = kernel.weights[j] * _between(i, j, nodes, reach)
                kernel.leaves[k, i - first + BEFORE, j - first] = entry
    for level in range(levels):
        cut = level + 1
        for k in range(2 << level):
            first, last, sibling = k * n >> cut, (k + 1) * n >> cut, k ^ 1
            start, end = sibling * n >> cut, (sibling + 1) * n >> cut
            rows = kernel.rows[level, first + BESIDE * k : last + BESIDE * (k + 1)]
            columns = kernel.columns[level, start:end]
            rank = _crosses(nodes, reach, first - BEFORE, start, k < sibling, rows, columns)
            kernel.ranks[level, k] = rank
            for j in range(start, end):
                for s in range(rank):
                    kernel.columns[level, j, s] *= kernel.weights[j]
            if k < sibling:
                columns[0, rank] = 1.0
            else:
                columns[-2, rank] = columns[-1, rank + 1] = 1.0


def line_kernel(nodes: FloatArray) -> LineKernel:
    """Return the kernel between nodes.

    Parameters
    ----------
    nodes : array, shape (n,)
        Ascending nodes in half widths, at least 80; the pressure is linear between them and zero at both ends.
    """
    n = nodes.size
    levels = max(1, round(log2(n / _LEAF)))
    clusters = 1 << levels
    most = -(-n // clusters)
    weights = np.zeros(n)
    weights[:-1] += np.diff(nodes) / 2
    weights[1:] += np.diff(nodes) / 2
    kernel = LineKernel(
        nodes,
        weights,
        np.zeros(n),
        np.zeros((clusters, most + BESIDE, most)),
        np.zeros((levels, n + BESIDE * clusters, _RANK)),
        np.zeros((levels, n, _RANK + CROSSING)),
        np.zeros((levels, clusters), np.int64),
    )
    _fill(kernel, float(nodes[-1] - nodes[0]))
    return kernel


@njit(nogil=True, cache=True)
def deform(kernel: LineKernel, pressure: FloatArray, deformation: FloatArray) -> float:
    """Fill the deformation of the nodes by their pressures, in ``a^2/R`` up to a constant; return that of ``X = 0``."""
    n = pressure.size
    levels, clusters = kernel.ranks.shape
    moments = np.empty(_RANK)
    for k in range(clusters):
        first, last = k * n >> levels, (k + 1) * n >> levels
        for i in range(first, last):
            total = 0.0
            for j in range(first, last):
                total += kernel.leaves[k, i - first + BEFORE, j - first] * pressure[j]
            deformation[i] = total
    for level in range(levels):
        cut = level + 1
        for k in range(2 << level):
            rank, sibling = kernel.ranks[level, k], k ^ 1
            moments[:] = 0.0
            for j in range(sibling * n >> cut, (sibling + 1) * n >> cut):
                for s in range(rank):
                    moments[s] += kernel.columns[level, j, s] * pressure[j]
            for i in range(k * n >> cut, (k + 1) * n >> cut):
                for s in range(rank):
                    deformation[i] += kernel.rows[level, i + BESIDE * k + BEFORE, s] * moments[s]
    total = 0.0
    for j in range(n):
        total += kernel.origin[j] * pressure[j]
    return total
