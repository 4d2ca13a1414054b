"""Dense linear systems: LU factors from LAPACK, kept for many right-hand sides.

The results of LAPACK can depend on its number of threads. Workers therefore limit LAPACK to one thread.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from mdr_dask.arrays import FloatArray

#: Newton's method reuses a Jacobian while each step is at most this fraction of the previous step; chosen by trial.
SLOWEST = 0.5


class Factors(NamedTuple):
    """The triangular factors of the transpose of a matrix, and the row exchanges of the factorisation."""

    triangles: FloatArray
    pivots: NDArray[np.int32]

    def solve(self, right: FloatArray) -> FloatArray:
        """Return the solution x of matrix @ x = right, where `right` is a vector or a matrix."""
        return np.asarray(dgetrs(self.triangles, self.pivots, right, trans=1)[0])


def factorise(matrix: FloatArray) -> Factors | None:
    """Return the `Factors` of a square C-ordered matrix, or None if the matrix is singular or not finite.

    The matrix is overwritten.
    """
    triangles, pivots, status = dgetrf(matrix.T, overwrite_a=True)
    diagonal = np.diagonal(triangles)
    return Factors(triangles, pivots) if status == 0 and np.all(np.isfinite(diagonal)) else None
