"""Bootstrap over realisations: all cases of a store are resampled alike, because they share their lines."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from mdr_dask.arrays import FloatArray

RESAMPLES = 400


@lru_cache(maxsize=4)
def weights(count: int) -> FloatArray:
    """Return how often each realisation is drawn, shape (1 + RESAMPLES, count): each once first, then the resamples."""
    generator = np.random.Generator(np.random.Philox(0))
    drawn = generator.multinomial(count, np.full(count, 1 / count), RESAMPLES)
    both: FloatArray = np.vstack([np.ones(count), drawn])
    both.flags.writeable = False
    return both


def means(values: FloatArray) -> FloatArray:
    """Return means over the first axis, realisations: of all of them first, then of every resample.

    A realisation that is not finite somewhere is left out everywhere; NaN where fewer than two are left.
    """
    flat = values.reshape(values.shape[0], -1)
    known = np.all(np.isfinite(flat), axis=1)
    drawn = weights(values.shape[0])[:, known]
    shape = (drawn.shape[0], *values.shape[1:])
    if np.count_nonzero(known) < 2:
        return np.full(shape, np.nan)
    total = drawn.sum(axis=1, keepdims=True)
    mean: FloatArray = (drawn @ flat[known] / np.where(total > 0, total, np.nan)).reshape(shape)
    return mean


def interval(samples: FloatArray, count: int, positive: bool = False) -> tuple[FloatArray, FloatArray]:
    """Return 95 % intervals from a value and its resamples, along the first axis.

    The percentiles of a bootstrap over a few realisations are too near: their distances from the value are widened by
    sqrt(n / (n - 1)) t / z, Student's t over the normal z.

    Parameters
    ----------
    samples : array, shape (1 + RESAMPLES, ...)
        The value first, then the resamples.
    count : int
        Realisations n that were resampled.
    positive : bool
        Whether to widen in logarithms, for what is positive.
    """
    from scipy.stats import norm, t

    if count < 2:
        nothing = np.full(samples.shape[1:], np.nan)
        return nothing, nothing
    wider = np.sqrt(count / (count - 1)) * t.ppf(0.975, count - 1) / norm.ppf(0.975)
    with np.errstate(invalid="ignore"):
        values = np.log(np.where(samples > 0, samples, np.nan)) if positive else samples
    known = np.isfinite(values[0]) & np.any(np.isfinite(values[1:]), axis=0)
    ends = np.full((2, *values.shape[1:]), np.nan)
    ends[:, known] = np.nanquantile(values[1:][:, known], (0.025, 0.975), axis=0)
    low, high = values[0] + wider * (ends - values[0])
    return (np.exp(low), np.exp(high)) if positive else (low, high)
