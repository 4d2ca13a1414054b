"""Elastic deformation of a half-plane under a piecewise linear pressure, with integrals that are exact on any grid.

In Hertz units, positions are divided by the half width a, pressures by p0, and films and deformations by ``a^2/R``
(thesis eq. B.13, B.19).
"""

from __future__ import annotations

from math import log, pi

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit


@jit
def _second_integral(x: float) -> float:
    """Return the value at x of a function whose second derivative is ``ln|x|``."""
    square = x * x
    return 0.0 if square == 0.0 else 0.25 * square * (log(square) - 3.0)


@jit
def _over_hats(nodes: FloatArray, row: FloatArray) -> None:
    """Replace the results of `_second_integral` at the nodes by integrals of ``ln|x|`` times the hat functions.

    The hat function of a node is 1 at this node, 0 at all other nodes, and linear between nodes. The entries of the two
    end nodes become 0.
    """
    left, left_slope = row[0], 0.0
    for j in range(nodes.size - 1):
        right = row[j + 1]
        slope = (right - left) / (nodes[j + 1] - nodes[j])
        row[j] = slope - left_slope
        left, left_slope = right, slope
    row[0] = 0.0
    row[-1] = 0.0


@jit
def _influence_row(point: float, nodes: FloatArray, row: FloatArray) -> None:
    """For each inner node j, write the integral of ``ln|point - X|`` times the hat function of j to ``row[j]``.

    The entries of the two end nodes are 0.
    """
    for j in range(nodes.size):
        row[j] = _second_integral(point - nodes[j])
    _over_hats(nodes, row)


@jit
def influence_matrix(nodes: FloatArray) -> FloatArray:
    """Return the matrix D, shape (n, n), with ``delta_i - delta(0) = sum_j D_ij P_j``.

    The first and the last pressure must be zero. The deformation minus the deformation at ``X = 0`` is ``-(1/pi) int P
    (ln|X_i - X| - ln|X|) dX`` (thesis eq. B.19).
    """
    n = nodes.size
    matrix, origin = np.empty((n, n)), np.empty(n)
    _influence_row(0.0, nodes, origin)
    for i in range(n):
        for j in range(i + 1):  # the matrix is symmetric, so one logarithm gives two entries
            matrix[i, j] = matrix[j, i] = _second_integral(nodes[i] - nodes[j])
    for i in range(n):
        row = matrix[i]
        _over_hats(nodes, row)
        for j in range(n):
            row[j] = (origin[j] - row[j]) / pi
    return matrix


@jit
def film(points: FloatArray, nodes: FloatArray, pressure: FloatArray, central_film: float) -> FloatArray:
    """Return the film ``H = H(0) + X^2/2 + delta(X) - delta(0)`` at any points X (thesis eq. B.19).

    The first and the last pressure must be zero.
    """
    origin, row = np.empty(nodes.size), np.empty(nodes.size)
    _influence_row(0.0, nodes, origin)
    result = np.empty(points.size)
    for i in range(points.size):
        _influence_row(points[i], nodes, row)
        total = 0.0  # no BLAS, because the last bits of its results depend on the number of threads
        for j in range(nodes.size):
            total += (origin[j] - row[j]) * pressure[j]
        result[i] = central_film + 0.5 * points[i] ** 2 + total / pi
    return result
