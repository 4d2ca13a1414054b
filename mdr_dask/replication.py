"""Find the number of realisations of each case: add rounds until the standard errors of a case meet the tolerances."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.models.base import Model, Status

#: Least and largest factor by which a round multiplies the number of realisations. The least factor avoids many rounds.
#: The largest factor is limited, because a few results give only a poor estimate of the scatter.
LEAST_GROWTH, MOST_GROWTH = 1.25, 4.0
#: Least number of results with which the estimated standard error alone decides whether a case stops. With fewer
#: results, only 89 % of the 95 % intervals might contain the true mean (``python -m benchmarks campaigns``).
FEWEST = 12


def next_round(replication: Replication, count: int, growth: NDArray[np.float64]) -> int:
    """Return the number of realisations after the next round; the present `count` if no case needs more.

    `growth` contains the factors from `growth_needed`. The number is multiplied by the median factor of the cases that
    need more results, within `LEAST_GROWTH` and `MOST_GROWTH`. The result is at most ``replication.at_most``.
    """
    more = np.minimum(growth[growth > 1], MOST_GROWTH)
    if not more.size:
        return count
    times = max(float(np.quantile(more, 0.5, method="lower")), LEAST_GROWTH)
    return min(math.ceil(round(times * count, 6)), replication.at_most)


def growth_needed(
    values: Mapping[str, NDArray[np.float64]],
    status: NDArray[np.int8],
    until: Mapping[str, Tolerance],
    scatter: Mapping[str, NDArray[np.float64]] | None = None,
) -> NDArray[np.float64]:
    """Return, for each case, the factor by which the number of results must grow (at most 1 if the number is enough).

    `values` and `scatter` (the standard error estimated within each realisation) have the shape (..., realisations).
    `until` contains the tolerances of the standard errors of the means. A case has enough results if, for each output
    in `until`, the standard error is within the tolerance and one of three conditions is met: there are `FEWEST`
    results; the standard error that follows from `scatter` is within the tolerance; or the standard error is as small
    as rounding errors. The factor is 0 for a case without a successful result, and infinite for a case with one.
    """
    done = status == Status.DONE
    count = np.maximum(done.sum(axis=-1), 1)
    needed = np.zeros(count.shape)
    for name, tolerance in until.items():
        mean, error = mean_and_error(values[name], done)
        allowed = np.maximum(tolerance.absolute, tolerance.relative * np.abs(mean))
        enough = count * _times(error, allowed)
        rounding = np.minimum(allowed, np.sqrt(np.finfo(float).eps) * np.abs(mean))
        sufficient = [np.maximum(FEWEST, enough), count * _times(error, rounding)]
        if scatter and name in scatter:
            within = _error_from_within(scatter[name], done)
            sufficient.append(np.maximum(enough, count * _times(within, allowed)))
        needed = np.maximum(needed, np.minimum.reduce(sufficient))
    return np.asarray(np.where(done.any(axis=-1), needed / count, 0.0))


def known_scatter(model: Model[Any], until: Collection[str], outputs: Collection[str]) -> dict[str, str]:
    """For each output in `until`, return the output with its standard errors within each realisation.

    An output in `until` is left out if no output in `outputs` contains its standard errors.
    """
    scatter = {output: model.output(output).scatter for output in until}
    return {output: own for output, own in scatter.items() if own in outputs}


def _times(error: NDArray[np.float64], allowed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the factor by which the number of results must grow to reduce the error to the allowed error.

    The factor is infinite if the error is NaN.
    """
    known = np.where(error > 0, error, 0.0)
    with np.errstate(divide="ignore", over="ignore"):
        found = np.divide(known, allowed, out=np.zeros(known.shape), where=known > 0) ** 2
    return np.where(np.isnan(error), np.inf, found)


def _error_from_within(scatter: NDArray[np.float64], done: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the standard error of a mean from the standard errors of the independent realisations."""
    count = np.maximum(done.sum(axis=-1), 1)
    return np.asarray(np.sqrt((np.where(done, scatter, 0.0) ** 2).sum(axis=-1)) / count)


def mean_and_error(
    values: NDArray[np.float64], valid: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and standard error of the valid values along the last axis.

    The mean of no value is NaN, and so is the standard error of fewer than two values.
    """
    count = valid.sum(axis=-1)
    mean = np.where(valid, values, 0.0).sum(axis=-1) / np.maximum(count, 1)
    squares = np.where(valid, values - mean[..., None], 0.0) ** 2
    variance = squares.sum(axis=-1) / np.maximum(count - 1, 1)
    error = np.sqrt(variance / np.maximum(count, 1))
    return np.where(count > 0, mean, np.nan), np.where(count > 1, error, np.nan)
