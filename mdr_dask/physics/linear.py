"""Small dense systems solved by one thread, so that a result does not depend on how many threads a library may use."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(nogil=True, cache=True)
def solve_in_place(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> bool:
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
