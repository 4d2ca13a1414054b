"""Shift factors that are the sum of two: one of velocity and one of temperature, say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.physics.superposition.master_curve import Superposition, moved_with, superpose


@dataclass(frozen=True)
class TwoShifts:
    """Factors ``h(v, T) = a(v) + b(T)``, perhaps vertical ones of that form too, and the curve they make.

    Parameters
    ----------
    first, second : Superposition
        The same merged points and curve twice, once with the factors a and the groups v, once with b and T; `member`
        counts the groups of each.
    chi_squared : float
        Squared distance of the factors of all pairs from the sum, in their covariance, for every degree of freedom; the
        errors are enlarged by its root where it is above one.
    probability : float
        Of a chi-squared that large if the sum held; 1 where nothing is left over to test it.
    """

    first: Superposition
    second: Superposition
    chi_squared: float
    probability: float


def superpose_twice(
    first: ArrayLike,
    second: ArrayLike,
    curves: Sequence[tuple[ArrayLike, ArrayLike]],
    references: tuple[float, float] | None = None,
    draws: int = 0,
    seed: int = 0,
    vertical: bool = False,
) -> TwoShifts:
    """Shift curves that differ in two things into one, and split the factors into a sum of two.

    All curves are superposed freely; a and b follow by least squares in the covariance of all factors, which is what a
    joint fit does to first order, and tells whether the sum holds.

    Parameters
    ----------
    first, second : array_like, shape (curves,)
        What each curve belongs to, two or more values of each; not every pair is needed.
    curves : sequence of (x, y)
        log10 of abscissa and ordinate.
    references : pair of float, optional
        Groups whose factors are zero; the middle ones if not given.
    draws, seed : int
        Bootstrap samples, as of `superpose`; each is split into a sum as the factors are.
    vertical : bool
        Whether curves may move along the ordinate as well, by factors that are such a sum, too.

    Raises
    ------
    DataError
        If a group has one value only, or the pairs fall into parts that share no value.
    """
    values = [np.asarray(a, dtype=np.float64).reshape(-1) for a in (first, second)]
    groups, places = zip(*(np.unique(a, return_inverse=True) for a in values), strict=True)
    if min(group.size for group in groups) < 2:
        raise DataError("two shifts need two or more values of each group")
    order = _serpentine(places[0], places[1])
    free = superpose(np.arange(order.size), [curves[k] for k in order], vertical, 0.0, draws, seed)
    zeros = [_nearest(group, None if references is None else references[i]) for i, group in enumerate(groups)]
    return _split(free, groups, [place[order] for place in places], zeros, 1 + vertical)


def _split(
    free: Superposition,
    groups: Sequence[FloatArray],
    places: Sequence[NDArray[np.intp]],
    zeros: Sequence[int],
    axes: int,
) -> TwoShifts:
    """Fit the sum to free factors, which are zero for the first curve, in the covariance of the others.

    `axes` is two if there are vertical factors, of which the same sum holds, else one.
    """
    size, curves = groups[0].size, free.groups.size
    columns = np.delete(np.arange(size + groups[1].size), [zeros[0], size + zeros[1]])
    design = np.hstack([np.eye(group.size)[place] for group, place in zip(groups, places, strict=True)])
    rows = (design - design[0])[1:, columns]
    if np.linalg.matrix_rank(rows) < columns.size:
        raise DataError("the curves fall into parts that share neither group: measure one value of each with the other")
    moved = np.concatenate([curves * axis + np.arange(1, curves) for axis in range(axes)])
    kept = np.concatenate([design.shape[1] * axis + columns for axis in range(axes)])
    whiten = np.linalg.inv(np.linalg.cholesky(free.covariance[np.ix_(moved, moved)]))
    projected = whiten @ np.kron(np.eye(axes), rows)
    target = whiten @ np.append(free.horizontal, free.vertical)[moved]
    spread = np.linalg.inv(projected.T @ projected)
    project = spread @ projected.T
    misfit = float(np.sum((target - projected @ (project @ target)) ** 2))
    freedom = target.size - kept.size
    reduced = misfit / freedom if freedom else 0.0
    both, covariance = np.zeros(2 * design.shape[1]), np.zeros((2 * design.shape[1], 2 * design.shape[1]))
    both[kept], covariance[np.ix_(kept, kept)] = project @ target, spread * max(reduced, 1.0)
    drawn = np.zeros((free.draws.shape[0], both.size))
    drawn[:, kept] = free.draws[:, moved] @ (project @ whiten).T
    cross = np.zeros((free.curve_x.size, both.size))
    cross[:, kept] = free.curve_cross[:, moved] @ (project @ whiten).T
    summed = _summed(replace(free, curve_cross=cross), design, both, covariance)
    own = summed.x[np.isin(free.member, np.flatnonzero((places[0] == zeros[0]) & (places[1] == zeros[1])))]
    own = own if own.size else summed.x[places[0][free.member] == zeros[0]]
    summed = replace(
        summed,
        measured=(float(own.min()), float(own.max())),
        horizontal=both[: both.size // 2],
        vertical=both[both.size // 2 :],
        covariance=covariance,
        draws=drawn,
    )
    one, other = (
        _one(summed, groups[i], zeros[i], places[i], columns_of + np.arange(groups[i].size))
        for i, columns_of in enumerate((0, size))
    )
    return TwoShifts(one, other, reduced, float(chi2.sf(misfit, freedom)) if freedom else 1.0)


def _summed(free: Superposition, design: FloatArray, both: FloatArray, covariance: FloatArray) -> Superposition:
    """Return points and curve shifted by the sums of factors, horizontal ones first, instead of freely."""
    across, along = both.reshape(2, -1) @ design.T
    slope = np.gradient(free.curve_y, free.curve_x)
    gradient = np.hstack([-np.outer(slope, design[0]), np.outer(np.ones(slope.size), design[0])])
    error, cross = moved_with(free.curve_error, free.curve_cross, gradient, covariance)
    return replace(
        free,
        x=free.x + (across - free.horizontal)[free.member],
        y=free.y + (along - free.vertical)[free.member],
        curve_x=free.curve_x + across[0],
        curve_y=free.curve_y + along[0],
        curve_error=error,
        curve_cross=cross,
    )


def _one(
    summed: Superposition, groups: FloatArray, zero: int, place: NDArray[np.intp], own: NDArray[np.intp]
) -> Superposition:
    """Return the superposition as seen by one of the groups, whose factors are at `own` among those of both."""
    kept = np.append(own, summed.horizontal.size + own)
    return replace(
        summed,
        groups=groups,
        horizontal=summed.horizontal[own],
        vertical=summed.vertical[own],
        covariance=summed.covariance[np.ix_(kept, kept)],
        curve_cross=summed.curve_cross[:, kept],
        reference=float(groups[zero]),
        member=place[summed.member],
        draws=summed.draws[:, kept],
        undetermined=(),
    )


def _serpentine(first: NDArray[np.intp], second: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return an order in which curves that follow each other are neighbours in one of the groups."""
    along = np.where(second % 2 == 0, first, first.max() - first)
    return np.lexsort((along, second))


def _nearest(group: FloatArray, wanted: float | None) -> int:
    return group.size // 2 if wanted is None else int(np.argmin(np.abs(group - wanted)))
