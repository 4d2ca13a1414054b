"""Shift factors that are a sum of two factors, such as a factor of velocity and a factor of temperature."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.physics.superposition.master_curve import Superposition, superpose


@dataclass(frozen=True)
class TwoShifts:
    """Factors ``h(v, T) = a(v) + b(T)`` and the merged curve.

    `first` contains a, `second` contains b, and both contain the same merged curve. `chi_squared` is the reduced
    chi-squared of the differences between the factor of each curve and the sum a + b. If `chi_squared` is above one,
    the errors of the factors are multiplied by the square root of `chi_squared`. `probability` is the probability of a
    chi-squared at least as large if every factor is really a sum; `probability` is 1 if no degree of freedom is left.
    """

    first: Superposition
    second: Superposition
    chi_squared: float
    probability: float


def superpose_twice(
    first: ArrayLike,
    second: ArrayLike,
    curves: Sequence[tuple[ArrayLike, ArrayLike]],
    reference: float | None = None,
) -> TwoShifts:
    """Shift curves that differ in two quantities into one curve, and split each shift factor into a sum a + b.

    First all curves are superposed with independent factors. Then a and b are fitted to the independent factors, with
    the inverse covariance as weight; to first order, this is the same as a direct fit to the curves. The factors are
    zero at the middle value of each quantity. If a `reference` is given, the factors of the first quantity are zero at
    the value nearest to the reference, and not at the middle value.
    """
    values = [np.asarray(a, dtype=np.float64).reshape(-1) for a in (first, second)]
    groups, places = zip(*(np.unique(a, return_inverse=True) for a in values), strict=True)
    if min(group.size for group in groups) < 2:
        raise DataError("two shifts need two or more different values of each quantity")
    order = _serpentine(places[0], places[1])
    zeros = [group.size // 2 for group in groups]
    if reference is not None:
        zeros[0] = int(np.argmin(np.abs(groups[0] - reference)))
    ordered = [place[order] for place in places]
    design = np.hstack([np.eye(group.size)[place] for group, place in zip(groups, ordered, strict=True)])
    columns = np.delete(np.arange(design.shape[1]), [zeros[0], groups[0].size + zeros[1]])
    if np.linalg.matrix_rank((design - design[0])[1:, columns]) < columns.size:
        raise DataError(
            "the curves fall into sets that share no value of either quantity: add a curve that connects the sets"
        )
    free = superpose(np.arange(order.size), [curves[k] for k in order], "none", 0.0)
    return _split(free, groups, ordered, zeros, design, columns)


def _split(
    free: Superposition,
    groups: Sequence[FloatArray],
    places: Sequence[NDArray[np.intp]],
    zeros: Sequence[int],
    design: FloatArray,
    columns: NDArray[np.intp],
) -> TwoShifts:
    """Fit the sums a + b to the factors of all curves by least squares, weighted with the inverse covariance.

    `design` times the vector of all factors a and b gives the sums a + b of all curves. `columns` are the indices of
    the factors a and b that are not zero by definition.
    """
    curves, both = free.groups.size, design.shape[1]
    rows, moved = (design - design[0])[1:, columns], np.arange(1, curves)
    whiten = np.linalg.inv(np.linalg.cholesky(free.covariance[np.ix_(moved, moved)]))
    solve = np.zeros((both, curves))
    solve[np.ix_(columns, moved)] = np.linalg.pinv(whiten @ rows) @ whiten
    target = free.horizontal
    sums = solve @ target
    freedom = moved.size - columns.size
    misfit = float(np.sum((whiten @ (target[moved] - rows @ sums[columns])) ** 2))
    reduced = misfit / freedom if freedom else 0.0
    drawn = sums + np.sqrt(max(reduced, 1.0)) * (free.draws[:, :curves] - target) @ solve.T

    across = design @ sums
    moves = -np.gradient(free.curve_y, free.curve_x, axis=1)[..., None] * design[0]
    cross = free.curve_cross[..., :curves] @ solve.T
    spread = moves @ np.cov(drawn, rowvar=False)
    variance = free.curve_error**2 + np.sum(moves * (2 * cross + spread), axis=2)
    x = free.x + (across - target)[free.member]
    own = x[np.isin(free.member, np.flatnonzero((places[0] == zeros[0]) & (places[1] == zeros[1])))]
    own = own if own.size else x[places[0][free.member] == zeros[0]]
    merged = replace(
        free,
        x=x,
        curve_x=free.curve_x + across[0],
        curve_error=np.sqrt(np.maximum(variance, 0)),
        measured=(float(own.min()), float(own.max())),
        undetermined=(),
    )
    parts = []
    for which, begin in enumerate((0, groups[0].size)):
        own_columns = begin + np.arange(groups[which].size)
        none = np.zeros((drawn.shape[0], own_columns.size))
        part = replace(
            merged,
            groups=groups[which],
            horizontal=sums[own_columns],
            vertical=none[0],
            draws=np.hstack([drawn[:, own_columns], none]),
            curve_cross=np.pad((cross + spread)[..., own_columns], ((0, 0), (0, 0), (0, own_columns.size))),
            reference=float(groups[which][zeros[which]]),
            member=places[which][free.member],
        )
        parts.append(part)
    return TwoShifts(parts[0], parts[1], reduced, float(chi2.sf(misfit, freedom)) if freedom else 1.0)


def _serpentine(first: NDArray[np.intp], second: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the indices of the curves, sorted by `second`, then by `first` (alternately ascending and descending)."""
    along = np.where(second % 2 == 0, first, first.max() - first)
    return np.lexsort((along, second))
