"""Bootstrap intervals from the scatter of realisations and from the discretisation errors of results.

A *stack* is an array with three kinds of rows, in this order: one row with the mean; `RESAMPLES` rows with means of
resampled realisations; and pairs of rows in which the mean is shifted up and down by discretisation errors. A fit is
applied to every row, and `interval` computes the interval of a constant from the stack of fitted constants.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray

CONFIDENCE = 0.95
#: Number of resamples. With 400 resamples, the ends of an interval are accurate to about 5 % of the width of the
#: interval.
RESAMPLES = 400
#: Largest number of groups of values. All values of a group are shifted by their errors, or left out, at the same time.
GROUPS = 32
#: Cumulative probabilities at the lower and the upper end of an interval.
TAILS = (0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2)
#: Smallest number of finite resamples from which the ends of an interval are computed: one resample in each tail.
FEWEST = round(1 / TAILS[0])


@lru_cache(maxsize=8)
def weights(count: int) -> FloatArray:
    """Return how often each resample draws each realisation, shape (1 + RESAMPLES, count); the first row is ones."""
    generator = np.random.Generator(np.random.Philox(0))
    drawn = generator.multinomial(count, np.full(count, 1 / count), RESAMPLES)
    both: FloatArray = np.vstack([np.ones(count), drawn])
    both.flags.writeable = False
    return both


def means(values: FloatArray) -> FloatArray:
    """Return the stack of means of the finite values over the first axis (realisations), without rows for errors.

    With fewer than two finite values, the rows of the resamples are NaN.
    """
    flat = values.reshape(values.shape[0], -1)
    known = np.isfinite(flat)
    drawn = weights(values.shape[0])
    total = drawn @ np.where(known, flat, 0.0)
    number = drawn @ known if not known.all() else drawn.sum(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = total / number
    mean[1:, known.sum(axis=0) < 2] = np.nan
    return mean.reshape(drawn.shape[0], *values.shape[1:])


def complete(values: FloatArray) -> FloatArray:
    """Return the values; if a realisation (first axis) has a value that is not finite, all its values become NaN."""
    known = np.all(np.isfinite(values.reshape(values.shape[0], -1)), axis=1)
    return np.where(known.reshape(-1, *(1 for _ in values.shape[1:])), values, np.nan)


def moved(values: FloatArray, errors: FloatArray) -> FloatArray:
    """For each group of neighbouring values, return all values twice: with this group shifted up, and shifted down.

    A value is shifted by the error of this value; if the error is NaN, by 0. If the error is infinite, the value is
    shifted by its absolute value.
    """
    size = np.where(np.isinf(errors), values, errors)
    flat = np.abs(np.where(np.isfinite(size), size, 0.0)).ravel()
    groups = np.array_split(np.arange(flat.size), max(1, min(GROUPS, flat.size)))
    shifts = np.zeros((2 * len(groups), flat.size))
    for k, group in enumerate(groups):
        shifts[2 * k, group], shifts[2 * k + 1, group] = flat[group], -flat[group]
    rows: FloatArray = values + shifts.reshape(-1, *values.shape)
    return rows


def with_errors(stack: FloatArray, errors: FloatArray) -> FloatArray:
    """Return a stack with additional rows in which the mean is shifted by `errors` (see `moved`).

    If no error is positive, the stack is returned unchanged.
    """
    return np.concatenate([stack, moved(stack[0], errors)]) if np.any(errors > 0) else stack


def difference(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the stack of the difference `one` minus `other` of two stacks with the same resamples.

    After the resamples come the rows that are shifted by the errors of `one`, and then the rows that are shifted by
    the errors of `other`.
    """
    plain = 1 + RESAMPLES
    rows = [one[:plain] - other[:plain], one[plain:] - other[0], one[0] - other[plain:]]
    both: FloatArray = np.concatenate(rows)
    return both


def logarithms(stack: FloatArray) -> FloatArray:
    """Return the logarithms of a stack; numbers of 0 or less are replaced by the smallest positive float."""
    logs: FloatArray = np.log(np.maximum(stack, np.finfo(float).tiny))
    return logs


def _reach(shifts: FloatArray) -> FloatArray:
    """Return the sum over all groups of the larger shift of each group, or of 0 if both shifts are negative."""
    known = np.where(np.isnan(shifts), 0.0, shifts)
    reach: FloatArray = np.maximum(np.maximum(known[0::2], known[1::2]), 0.0).sum(axis=0)
    return reach


def regrouped(stack: FloatArray) -> FloatArray:
    """Return a stack in which each row of errors shifts one group of neighbouring cases.

    In the given stack, a row of errors may shift every case. The sum of the shifts of a case becomes its error.
    """
    shifts = stack[1 + RESAMPLES :] - stack[0]
    own = np.maximum(_reach(shifts), _reach(-shifts))
    return with_errors(stack[: 1 + RESAMPLES], own)


def interval(stack: FloatArray, count: ArrayLike, positive: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return the ends of 95 % intervals from a stack; with `positive`, computed from the logarithms of the stack.

    With few realisations (`count`), the percentiles of the resamples lie too close to the first row. The distances of
    the percentiles from the first row are therefore multiplied by `widening`. Shifts by discretisation errors are added
    linearly, because an error that is the same in every realisation does not average out. The ends are NaN for fewer
    than two realisations, for fewer than `FEWEST` finite resamples, and if the value in the first row is not finite or,
    with `positive`, not positive.
    """
    values = logarithms(stack) if positive else stack
    enough = np.count_nonzero(np.isfinite(values[1 : 1 + RESAMPLES]), axis=0) >= FEWEST
    known = np.isfinite(values[0]) & ((stack[0] > 0) | (not positive)) & enough & (np.asarray(count) > 1)
    ends = np.full((2, *values.shape[1:]), np.nan)
    ends[:, known] = np.nanquantile(values[1 : 1 + RESAMPLES, known], TAILS, axis=0)
    with np.errstate(invalid="ignore"):
        shifts = values[1 + RESAMPLES :] - values[0]
    wider = widening(count)
    low = values[0] + wider * np.minimum(ends[0] - values[0], 0.0) - _reach(-shifts)
    high = values[0] + wider * np.maximum(ends[1] - values[0], 0.0) + _reach(shifts)
    return (np.exp(low), np.exp(high)) if positive else (low, high)


def widening(count: ArrayLike) -> FloatArray:
    """Return sqrt(n / (n - 1)) t / z for n = `count` realisations; a `count` below 2 is replaced by 2.

    Here t is the 97.5 % quantile of Student's distribution with n - 1 degrees of freedom, and z is the 97.5 % quantile
    of the normal distribution.
    """
    from scipy.special import ndtri, stdtrit

    number = np.maximum(np.asarray(count, dtype=np.float64), 2.0)
    wider: FloatArray = np.sqrt(number / (number - 1)) * stdtrit(number - 1, TAILS[1]) / ndtri(TAILS[1])
    return wider


def chance(residuals: FloatArray, count: int) -> float:
    """Return the probability that scatter and errors alone cause at least the rms residual of the data.

    `residuals` is a stack of the differences between data and law. If the law holds, the residuals of the data (first
    row) are about as large as the differences between these residuals and those of a resample. The result is NaN for
    fewer than two realisations, or too few resamples.
    """
    caused = _caused(residuals, count)
    return float(np.mean(caused >= np.sqrt(np.mean(residuals[0] ** 2)))) if caused.size else np.nan


def scatter(residuals: FloatArray, count: int) -> float:
    """Return the rms residual that scatter and errors alone exceed with probability 5 %.

    The result is NaN for fewer than two realisations, or too few resamples.
    """
    caused = _caused(residuals, count)
    return float(np.quantile(caused, CONFIDENCE, method="higher")) if caused.size else np.nan


def _caused(residuals: FloatArray, count: int) -> FloatArray:
    """Return the rms residuals that scatter and errors alone cause, one per resample.

    The result is empty for fewer than two realisations, or too few resamples.
    """
    flat = residuals.reshape(residuals.shape[0], -1)
    away = np.sqrt(np.mean((flat[1:] - flat[0]) ** 2, axis=1))
    known = away[:RESAMPLES][~np.isnan(away[:RESAMPLES])]
    if count < 2 or known.size < FEWEST:
        return np.empty(0)
    moves = away[RESAMPLES:]
    by_errors = np.sqrt(np.nansum(np.fmax(moves[0::2], moves[1::2]) ** 2))
    caused: FloatArray = widening(count) * known + by_errors
    return caused
