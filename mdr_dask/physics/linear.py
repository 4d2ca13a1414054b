"""Dense linear systems: LAPACK's factors, kept for many right-hand sides, and an elimination for compiled kernels.

A worker runs LAPACK with one thread, so that a result does not depend on how many threads a library may use.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.compiling import compiled


class Factors(NamedTuple):
    """The triangular factors of the transpose of a matrix, and its row exchanges."""

    triangles: FloatArray
    pivots: NDArray[np.int32]

    def solve(self, right: FloatArray) -> FloatArray:
        """Return x of matrix @ x = right, a vector or one column for each system."""
        return np.asarray(dgetrs(self.triangles, self.pivots, right, trans=1)[0])


def factorise(matrix: FloatArray) -> Factors | None:
    """Return the factors of a square matrix in C order, which is spent; None if it is singular or not finite."""
    triangles, pivots, status = dgetrf(matrix.T, overwrite_a=True)
    diagonal = np.diagonal(triangles)
    return Factors(triangles, pivots) if status == 0 and np.all(np.isfinite(diagonal)) else None


@compiled
def solve_in_place(matrix: FloatArray, right: FloatArray) -> bool:
    """Solve matrix @ x = right by elimination with row pivots; `right` becomes x, `matrix` is spent.

    Parameters
    ----------
    matrix : array, shape (n, n)
        Coefficients.
    right : array, shape (n,)
        Right-hand side.

    Returns
    -------
    bool
        False if a pivot vanishes; `right` is then spoilt.
    """
    size = right.size
    for column in range(size):
        pivot = column
        for row in range(column + 1, size):
            if abs(matrix[row, column]) > abs(matrix[pivot, column]):
                pivot = row
        if matrix[pivot, column] == 0.0:
            return False
        if pivot != column:
            for k in range(column, size):
                matrix[column, k], matrix[pivot, k] = matrix[pivot, k], matrix[column, k]
            right[column], right[pivot] = right[pivot], right[column]
        source = matrix[column]
        for row in range(column + 1, size):
            target = matrix[row]
            factor = target[column] / source[column]
            right[row] -= factor * right[column]
            for k in range(column + 1, size):
                target[k] -= factor * source[k]
    for row in range(size - 1, -1, -1):
        for k in range(row + 1, size):
            right[row] -= matrix[row, k] * right[k]
        right[row] /= matrix[row, row]
    return True
