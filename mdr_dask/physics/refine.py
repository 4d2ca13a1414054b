"""Grid refinement, in which the difference between the results on two grids gives an estimate of the error.

Usually, the number of cells doubles from one level to the next. If a solver has the order of convergence p, the error
is divided by r = 2^p at each level. Take three successive levels. Let b be the relative change of a result from the
first level to the second, and c the relative change from the second level to the third. The relative error on the third
level is estimated as

    error = safety * max( c / (r - 1),  b / (r (r - 1)) ) + e.

The first expression, c / (r - 1), is Richardson's estimate. The second expression is needed because the results on the
last two levels may agree by chance. After the change b, the next change should be b / r. After only two levels, b is
unknown, and Richardson's estimate is used alone. The safety factor is taken from the grid convergence index (Roache, J.
Fluids Eng. 116, 405, 1994). The last term, e (`Solution.unseen`), stands for errors that may be equal on two grids.
Equal errors do not appear in the difference between the results.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.outcome import Outcome

SAFETY = 3.0
"""Roache's safety factor for an estimate from two grids."""

MOST_ITERATIONS = 100
"""Largest number of steps of an iteration. As bisections, 100 steps divide an interval by 2^100."""

EPS = float(np.finfo(np.float64).eps)
"""Relative rounding error of floating-point numbers."""

CLOSE = float(np.sqrt(EPS))
"""The square root of `EPS`, used as a tolerance and as the step of finite differences.

Newton's method ends after a relative step below this limit, because the next step would be a rounding error.
"""


class Estimate(NamedTuple):
    """Computed values, and the estimated absolute error of each value."""

    value: FloatArray
    error: FloatArray

    def scaled(self, factor: float) -> Estimate:
        """Return the estimate with value and error multiplied by a factor, for example to change the unit."""
        return Estimate(self.value * factor, self.error * factor)


class Solution(NamedTuple):
    """Results of some cases on one grid.

    `values` contains one array per output, with one number or one profile per case. NaN in a profile marks positions
    where the output does not exist. `outcome` contains one value of `Outcome` per case. `unseen`, a number or an array
    of shape (outputs, cases), is a relative error that may be equal on two grids, and is then missing in the difference
    between the results on these grids.
    """

    values: Sequence[FloatArray] | FloatArray
    outcome: NDArray[np.int8]
    unseen: FloatArray | float = 0.0


class Refined(NamedTuple):
    """Results of `refine` for all cases.

    `values` contains one array per output, with NaN for cases without a solution. `errors`, shape (outputs, cases),
    contains absolute errors, or infinity if an error was not estimated. The error of a profile is the largest error
    along the profile. `met` is True for a case if every requested output meets the accuracy. `level` is the level of
    the grid on which the case was solved, or the last level that was tried if the case has no solution.
    """

    values: list[FloatArray]
    errors: FloatArray
    met: NDArray[np.bool_]
    level: IntArray
    outcome: NDArray[np.int8]


def refine(
    solve: Callable[[int, IntArray], Solution],
    cases: int,
    levels: Sequence[int],
    accuracy: float,
    order: ArrayLike,
    *,
    safety: float = SAFETY,
    floors: ArrayLike = 0.0,
    shared: bool = True,
    requested: int | None = None,
) -> Refined:
    """Solve every case on the coarsest grid on which all requested outputs meet `accuracy`.

    If a case does not meet the accuracy on any grid, the solution on the finest grid is returned.

    The function `solve(level, cases)` solves the cases with the given indices on the grid of a level, and must not
    raise an exception for a case that fails. If `levels` has more than one entry, every case is solved on at least two
    levels, unless the parameters of the case are the cause of a failure. If a case fails on fine grids only, the
    solution on the finest grid without a failure is returned instead.

    The accuracy of an output is relative to the largest absolute value of the output in the case, or to the entry of
    the output in `floors` if this entry is larger. If `accuracy` is infinite, the first result on the second or a finer
    level is accepted. `order` is the order of convergence of the dominant part of the error, one number or one for each
    output. Only the first `requested` outputs must meet the accuracy, or all outputs if `requested` is None.

    If `shared` is True, the largest relative change among the requested outputs of a case is used for all requested
    outputs of this case, because a single output may have the same value on two grids by chance. Outputs that are not
    requested then have infinite errors. Choose `shared` = False for outputs that converge at different rates.
    """
    reduction = np.reshape(2.0 ** np.asarray(order), (-1, 1))
    left = np.arange(cases)
    coarse = solve(levels[0], left)
    floor = np.broadcast_to(np.asarray(floors, dtype=np.float64), len(coarse.values))
    values = [np.array(value, dtype=np.float64) for value in coarse.values]
    errors = np.full((len(values), cases), np.inf)
    outcome, level, met = coarse.outcome.copy(), np.full(cases, levels[0]), np.zeros(cases, np.bool_)
    before = np.zeros((len(values), cases))
    for finer in levels[1:]:
        going_on = ~met[left] & ~IMPOSSIBLE[outcome[left]]
        left, before, coarse = left[going_on], before[:, going_on], _only(coarse, going_on)
        if not left.size:
            break
        fine = solve(finer, left)
        change = relative_changes(coarse, fine, floor)
        if shared:
            change = np.broadcast_to(change[:requested].max(axis=0, initial=0.0), change.shape)
        # if a case had no solution on an earlier grid, `before` is infinite, and only Richardson's estimate is used
        earlier = np.where(np.isfinite(before), before, 0.0) / reduction
        relative = safety / (reduction - 1) * np.maximum(change, earlier) + fine.unseen
        solved = fine.outcome == Outcome.CONVERGED
        better = solved | (outcome[left] != Outcome.CONVERGED)
        kept = left[better]
        for value, found in zip(values, fine.values, strict=True):
            value[kept] = found[better]
        outcome[kept], level[kept] = fine.outcome[better], finer
        with np.errstate(invalid="ignore"):
            errors[:, kept] = np.where(solved, relative * _sizes(fine.values, floor), np.inf)[:, better]
        met[left] = solved & np.all(relative[:requested] <= accuracy, axis=0)
        coarse, before = fine, change
    if requested is not None and shared:
        errors[requested:] = np.inf
    for value in values:
        value[outcome != Outcome.CONVERGED] = np.nan
    return Refined(values, errors, met, level, outcome)


def relative_changes(coarse: Solution, fine: Solution, floors: FloatArray) -> FloatArray:
    """Return the relative change of every output from one grid to the next, shape (outputs, cases).

    The largest change along a profile is divided by the largest absolute value of the profile, or by the floor of the
    output if the floor is larger. Positions at which one of the two profiles does not exist are ignored. The change is
    infinite if the case has no solution on one of the grids, or if a number is NaN on only one of the grids.
    """
    solved = (coarse.outcome == Outcome.CONVERGED) & (fine.outcome == Outcome.CONVERGED)
    changes = np.empty((len(fine.values), solved.size))
    with np.errstate(all="ignore"):
        for change, one, other in zip(changes, coarse.values, fine.values, strict=True):
            difference = np.abs(other - one)
            difference[(np.isnan(one) & np.isnan(other)) | ((difference.ndim > 1) & np.isnan(difference))] = 0.0
            change[:] = _largest(difference)
        changes = np.where(changes == 0, 0.0, changes / _sizes(fine.values, floors))
    return np.where(solved & ~np.isnan(changes), changes, np.inf)


def _sizes(values: Sequence[FloatArray] | FloatArray, floors: FloatArray) -> FloatArray:
    """Return the largest absolute value of each output in each case, or the output's floor if this floor is larger."""
    return np.maximum([_largest(np.fmax(np.abs(value), 0.0)) for value in values], floors[:, None])


def _largest(sizes: FloatArray) -> FloatArray:
    """Return the largest entry of `sizes` for each case. No entry may be negative."""
    return sizes if sizes.ndim == 1 else sizes.reshape(len(sizes), -1).max(axis=1, initial=0.0)


def _only(solution: Solution, cases: NDArray[np.bool_]) -> Solution:
    """Return the values and outcomes of the selected cases."""
    return Solution([value[cases] for value in solution.values], solution.outcome[cases])


IMPOSSIBLE = np.array([outcome.is_impossible for outcome in Outcome])
