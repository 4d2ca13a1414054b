"""Bootstrap intervals from the scatter of realisations and from the discretisation errors of results.

A *stack* is an array with three kinds of rows. The first row is the mean. The next `RESAMPLES` rows are the means of
resampled realisations. In the remaining rows, the mean is shifted by its discretisation errors. A fit is applied to
every row. The result is a stack of the fitted constants, from which `interval` computes an interval. A resample that
contains only failed realisations is NaN and is left out.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray

CONFIDENCE = 0.95
#: Number of resamples. With this number, the ends of an interval are accurate to about 5 % of the width of the
#: interval.
RESAMPLES = 400
#: Neighbouring values are put into groups; this is the largest number of groups. In each shifted row, the values of one
#: group are shifted by their errors, all with the same sign.
GROUPS = 32
#: Probabilities of the ends of an interval.
TAILS = (0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2)
#: Smallest number of resamples from which the ends of an interval are computed.
FEWEST = round(1 / TAILS[0])
#: Number that replaces the logarithm of a value that is not positive; its exponential is 0 in double precision.
NOTHING = -1000.0


@lru_cache(maxsize=8)
def weights(count: int) -> FloatArray:
    """Return how often each resample draws each realisation, shape (1 + RESAMPLES, count); the first row is all ones.

    All cases use the same resamples, because realisation number k has the same rough line in all cases. The difference
    between two cases is then computed for each resample.
    """
    generator = np.random.Generator(np.random.Philox(0))
    drawn = generator.multinomial(count, np.full(count, 1 / count), RESAMPLES)
    both: FloatArray = np.vstack([np.ones(count), drawn])
    both.flags.writeable = False
    return both


def means(values: FloatArray) -> FloatArray:
    """Return the stack of means over the first axis (realisations).

    Values that are not finite are left out. Without any finite value, the mean and its resamples are NaN. With one
    finite value, only the resamples are NaN.
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
    """Return the values without incomplete realisations.

    If a realisation (first axis) has a value that is not finite, all values of this realisation become NaN.
    """
    known = np.all(np.isfinite(values.reshape(values.shape[0], -1)), axis=1)
    return np.where(known.reshape(-1, *(1 for _ in values.shape[1:])), values, np.nan)


def moved(values: FloatArray, errors: FloatArray) -> FloatArray:
    """Return values shifted up and down by their errors.

    The result has two rows for each group of neighbouring values. In the first row, only the values of this group are
    shifted up; in the second row, only these values are shifted down.

    A value with an infinite error is shifted by its own absolute value.
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
    """Return a stack with additional rows in which the mean is shifted by its errors (see `moved`)."""
    return np.concatenate([stack, moved(stack[0], errors)]) if np.any(errors > 0) else stack


def difference(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the stack of the difference of two stacks with the same resamples.

    The shifted rows of the difference have two parts. In the first part, the errors of `one` shift the difference; in
    the second part, the errors of `other` do.
    """
    plain = 1 + RESAMPLES
    rows = [one[:plain] - other[:plain], one[plain:] - other[0], one[0] - other[plain:]]
    both: FloatArray = np.concatenate(rows)
    return both


def logarithms(stack: FloatArray) -> FloatArray:
    """Return the logarithms of a stack of a positive quantity; values that are not positive become `NOTHING`."""
    with np.errstate(invalid="ignore", divide="ignore"):
        logs: FloatArray = np.where(stack <= 0, NOTHING, np.log(stack))
    return logs


def _reach(shifts: FloatArray) -> FloatArray:
    """Return the sum of the largest upward shifts of all groups.

    Each group has two shifts, one for each sign of the errors; the larger one is used. A shift that is negative or NaN
    counts as 0.
    """
    known = np.where(np.isnan(shifts), 0.0, shifts)
    reach: FloatArray = np.maximum(np.maximum(known[0::2], known[1::2]), 0.0).sum(axis=0)
    return reach


def regrouped(stack: FloatArray) -> FloatArray:
    """Return a stack with new shifted rows: in each of these rows, a whole group of neighbouring cases is shifted.

    All cases of the group are shifted in the same direction. In the shifted rows of the given stack, only one case is
    shifted in each row.
    """
    shifts = stack[1 + RESAMPLES :] - stack[0]
    own = np.maximum(_reach(shifts), _reach(-shifts))
    return with_errors(stack[: 1 + RESAMPLES], own)


def interval(stack: FloatArray, count: ArrayLike, positive: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return 95 % intervals from a stack, along its first axis.

    With few realisations, the percentiles of a bootstrap lie too close to the value. Their distances from the value are
    therefore multiplied by sqrt(n / (n - 1)) t / z. Here t is the 97.5 % quantile of Student's distribution with n - 1
    degrees of freedom, and z is that of the normal distribution. The shifts by discretisation errors are added to these
    distances. They are added linearly, because an error that is the same in every realisation does not average out.

    Parameters
    ----------
    stack : array, shape (1 + RESAMPLES + 2 groups, ...)
        The value, its resamples, and the value shifted up and down by its errors.
    count : int or array
        Number n of realisations that were resampled.
    positive : bool
        Whether to compute the interval in logarithms, for positive quantities.
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
    """Return the factor sqrt(n / (n - 1)) t / z for n = `count` realisations (see `interval`)."""
    from scipy.special import ndtri, stdtrit

    number = np.maximum(np.asarray(count, dtype=np.float64), 2.0)
    wider: FloatArray = np.sqrt(number / (number - 1)) * stdtrit(number - 1, TAILS[1]) / ndtri(TAILS[1])
    return wider


def chance(residuals: FloatArray, count: int, draws: int = RESAMPLES) -> float:
    """Return the probability that scatter and errors alone cause an rms residual at least as large as that of the data.

    `residuals`, shape (1 + RESAMPLES + 2 groups, ...), is a stack of the differences between data and law; those of the
    data are in its first row. The next `draws` rows are resamples. If the law holds, the numbers in the first row are
    about as large as the differences between the resamples and the first row. `count` is the number of realisations
    that were resampled. The probability is NaN if there are too few resamples, for example with one realisation.
    """
    caused = _caused(residuals, count, draws)
    return float(np.mean(caused >= np.sqrt(np.mean(residuals[0] ** 2)))) if caused.size else np.nan


def scatter(residuals: FloatArray, count: int) -> float:
    """Return the rms residual that scatter and errors alone exceed with a probability of 5 %; NaN if unknown.

    `residuals` and `count` are as for `chance`.
    """
    caused = _caused(residuals, count, RESAMPLES)
    return float(np.quantile(caused, CONFIDENCE, method="higher")) if caused.size else np.nan


def _caused(residuals: FloatArray, count: int, draws: int) -> FloatArray:
    """Return the rms residuals that scatter and errors alone cause, one per resample.

    The array is empty if there are too few resamples.

    Errors of different groups affect different cases. The residuals that the groups cause are therefore combined as the
    root of the sum of their squares.
    """
    flat = residuals.reshape(residuals.shape[0], -1)
    away = np.sqrt(np.mean((flat[1:] - flat[0]) ** 2, axis=1))
    known = away[:draws][~np.isnan(away[:draws])]
    if count < 2 or known.size < FEWEST:
        return np.empty(0)
    moves = away[draws:]
    by_errors = np.sqrt(np.nansum(np.fmax(moves[0::2], moves[1::2]) ** 2))
    caused: FloatArray = widening(count) * known + by_errors
    return caused
