"""The Newton iteration of :mod:`mdr_dask.physics.lubrication.newton` on many nodes, each step in O(n log^2 n).

The derivative of the balances is a band, plus a band times the deformation kernel. So its blocks beside the diagonal
have low rank too, and the equations are solved from the leaves up: what a cluster of nodes hands to its sibling is a
few moments of the pressure. No iteration, no preconditioner; the same equations as the dense elimination.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from mdr_dask.arrays import BoolArray, FloatArray, IntArray
from mdr_dask.physics.lubrication.line_kernel import BESIDE, CROSSING, LineKernel, deform
from mdr_dask.physics.lubrication.newton import (
    SINGULAR,
    TOO_MANY_STEPS,
    UNDER_WAY,
    Liquid,
    balance,
    outcome,
    take_step,
)

#: Columns before those of the blocks: the balances, and their derivative by the film.
_RIGHT_SIDES = 2


@njit(nogil=True, cache=True)
def film_of(kernel: LineKernel, P: FloatArray, central: float, H: FloatArray) -> None:
    """Fill the film H at the nodes, given the pressure and the film at ``X = 0``."""
    at_origin = deform(kernel, P, H)
    for i in range(P.size):
        H[i] += central + 0.5 * kernel.nodes[i] ** 2 - at_origin


@njit(nogil=True, cache=True)
def _eliminate(A: FloatArray, B: FloatArray) -> bool:
    """Solve ``A X = B`` in place by Gauss' elimination with partial pivoting; False if A is singular."""
    n = A.shape[0]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        if not abs(A[pivot, k]) > 0.0:
            return False
        if pivot != k:
            for j in range(n):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
            for j in range(B.shape[1]):
                B[k, j], B[pivot, j] = B[pivot, j], B[k, j]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            if factor != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]
                for j in range(B.shape[1]):
                    B[i, j] -= factor * B[k, j]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            for j in range(B.shape[1]):
                B[i, j] -= A[i, k] * B[k, j]
        for j in range(B.shape[1]):
            B[i, j] /= A[i, i]
    return True


@njit(nogil=True, cache=True)
def _fill_leaf(
    kernel: LineKernel,
    k: int,
    by_pressure: FloatArray,
    by_film: FloatArray,
    scale: FloatArray,
    active: BoolArray,
    A: FloatArray,
) -> None:
    """Fill the derivative of the balances of leaf k by its own pressures; a node without pressure keeps none."""
    n, levels = active.size, kernel.ranks.shape[0]
    first, last = k * n >> levels, (k + 1) * n >> levels
    for i in range(first, last):
        line, row = A[i - first], i - first
        line[:] = 0.0
        if not active[i]:
            line[row] = 1.0
            continue
        for q in range(4):
            coefficient = by_film[i, q] / scale[i]
            films = kernel.leaves[k, row + q]
            for j in range(last - first):
                line[j] += coefficient * films[j]
            if first <= i - 2 + q < last:
                line[row - 2 + q] += by_pressure[i, q] / scale[i]


@njit(nogil=True, cache=True)
def _fill_columns(
    kernel: LineKernel,
    starts: IntArray,
    by_pressure: FloatArray,
    by_film: FloatArray,
    scale: FloatArray,
    active: BoolArray,
    X: FloatArray,
) -> None:
    """Fill the left factors of the blocks of every level, from the column ``starts[level]`` of X on."""
    n, levels = active.size, kernel.ranks.shape[0]
    X[:, _RIGHT_SIDES:] = 0.0
    for level in range(levels):
        cut, start = level + 1, starts[level]
        for k in range(2 << level):
            first, last, rank = k * n >> cut, (k + 1) * n >> cut, kernel.ranks[level, k]
            for i in range(first, last):
                if not active[i]:
                    continue
                for q in range(4):
                    films = kernel.rows[level, i + BESIDE * k + q]
                    for s in range(rank):
                        X[i, start + s] += by_film[i, q] / scale[i] * films[s]
            if k % 2 == 0:
                X[last - 1, start + rank] = by_pressure[last - 1, 3] / scale[last - 1] * active[last - 1]
            else:
                X[first, start + rank] = by_pressure[first, 0] / scale[first] * active[first]
                X[first, start + rank + 1] = by_pressure[first, 1] / scale[first] * active[first]
                X[first + 1, start + rank + 1] = by_pressure[first + 1, 0] / scale[first + 1] * active[first + 1]


@njit(nogil=True, cache=True)
def _join(kernel: LineKernel, level: int, k: int, start: int, end: int, X: FloatArray) -> bool:
    """Couple the clusters k and k + 1 of a level, solved each for itself, in the columns of X before `start`."""
    n, cut, width = X.shape[0], level + 1, end - start
    edges = (k * n >> cut, (k + 1) * n >> cut, (k + 2) * n >> cut)
    moments = np.zeros((2 * width, end))
    for half in range(2):  # the columns of a block lie beside its rows: those of cluster k in cluster k + 1
        for j in range(edges[1 - half], edges[2 - half]):
            for s in range(kernel.ranks[level, k + half] + CROSSING):
                factor = kernel.columns[level, j, s]
                if factor != 0.0:
                    for m in range(end):
                        moments[half * width + s, m] += factor * X[j, m]
    A = np.eye(2 * width)
    A[:width, width:] = moments[:width, start:]
    A[width:, :width] = moments[width:, start:]
    B = moments[:, :start].copy()
    if not _eliminate(A, B):
        return False
    for half in range(2):
        for i in range(edges[half], edges[half + 1]):
            for s in range(width):
                factor = X[i, start + s]
                if factor != 0.0:
                    for m in range(start):
                        X[i, m] -= factor * B[half * width + s, m]
    return True


@njit(nogil=True, cache=True)
def newton_step(
    kernel: LineKernel,
    P: FloatArray,
    R: FloatArray,
    by_pressure: FloatArray,
    by_film: FloatArray,
    scale: FloatArray,
    active: BoolArray,
    step: FloatArray,
) -> tuple[bool, float]:
    """Fill the Newton step of the pressures; return whether there is one and the step of the film at ``X = 0``.

    Parameters
    ----------
    kernel : LineKernel
        At the nodes.
    P, R, scale : array, shape (n,)
        Pressure, balance, and the size of the row of each balance.
    by_pressure, by_film : array, shape (n, 4)
        Derivatives of the balances, of :func:`mdr_dask.physics.lubrication.newton.balance`.
    active : array of bool, shape (n,)
        Where the balance decides; the other pressures go to zero.
    step : array, shape (n,)
        The result.
    """
    n = P.size
    levels, clusters = kernel.ranks.shape
    starts = np.empty(levels + 1, np.int64)
    starts[0] = _RIGHT_SIDES
    for level in range(levels):
        starts[level + 1] = starts[level] + np.max(kernel.ranks[level]) + CROSSING
    X = np.empty((n, starts[levels]))
    for i in range(n):
        X[i, 0] = -R[i] / scale[i] if active[i] else -P[i]
        X[i, 1] = np.sum(by_film[i]) / scale[i] if active[i] else 0.0
    _fill_columns(kernel, starts, by_pressure, by_film, scale, active, X)
    A = np.empty((kernel.leaves.shape[2], kernel.leaves.shape[2]))
    for k in range(clusters):
        first, last = k * n >> levels, (k + 1) * n >> levels
        _fill_leaf(kernel, k, by_pressure, by_film, scale, active, A)
        if not _eliminate(A[: last - first, : last - first], X[first:last]):
            return False, 0.0
    for level in range(levels - 1, -1, -1):
        for k in range(0, 2 << level, 2):
            if not _join(kernel, level, k, starts[level], starts[level + 1], X):
                return False, 0.0
    load, by_load = -0.5 * np.pi, 0.0
    for i in range(n):
        load += kernel.weights[i] * (P[i] + X[i, 0])
        by_load += kernel.weights[i] * X[i, 1]
    if by_load == 0.0:
        return False, 0.0
    change = load / by_load
    at_origin = change
    for i in range(n):
        step[i] = X[i, 0] - change * X[i, 1]
        at_origin += kernel.origin[i] * step[i]
    return True, at_origin


@njit(nogil=True, cache=True)
def newton_by_blocks(
    kernel: LineKernel,
    liquid: Liquid,
    K: float,
    P: FloatArray,
    central: float,
    clip: float,
    tolerance: float,
    most: int,
) -> tuple[int, int, float, FloatArray]:
    """Solve for the pressure on one grid, in place; arguments and result as of ehl_newton's `newton`."""
    n = P.size
    state, R, H, scale = np.empty((4, n)), np.empty(n), np.empty(n), np.ones(n)
    by_pressure, by_film, active = np.empty((n, 4)), np.empty((n, 4)), np.zeros(n, np.bool_)
    step, film_step = np.zeros(n), np.empty(n)
    levels, clusters = kernel.ranks.shape
    film_of(kernel, P, central, H)
    for steps in range(1, most + 1):
        balance(kernel.nodes, liquid, K, P, H, state, R, by_pressure, by_film)
        for k in range(clusters):
            first = k * n >> levels
            for i in range(max(first, 1), min((k + 1) * n >> levels, n - 1)):
                scale[i] = abs(by_pressure[i, 2])
                for q in range(4):
                    scale[i] += abs(by_film[i, q] * kernel.leaves[k, i - first + q, i - first])
                active[i] = P[i] + R[i] / scale[i] > 0.0
        solved, change = newton_step(kernel, P, R, by_pressure, by_film, scale, active, step)
        if not solved:
            return SINGULAR, steps, central, H
        at_origin = deform(kernel, step, film_step)
        for i in range(n):
            film_step[i] += change - at_origin
        status, central = take_step(P, central, H, step, change, film_step, clip, tolerance)
        film_of(kernel, P, central, H)
        status = outcome(status, central, H)
        if status != UNDER_WAY:
            return status, steps, central, H
    return TOO_MANY_STEPS, most, central, H
