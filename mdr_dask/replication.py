"""Find the number of realisations of each case: add rounds until the standard errors of a case meet the tolerances."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.models.base import Model, Status

#: A round multiplies the number of realisations by a factor. With this factor, about half of the unfinished cases
#: should have enough realisations after the round. The factor is at least `LEAST_GROWTH`, so that there are few rounds,
#: and at most `MOST_GROWTH`, because few results estimate their scatter poorly.
LEAST_GROWTH, MOST_GROWTH = 1.25, 4.0
#: Factor by which a round for a fitted constant multiplies the number of realisations. It is fixed, because the number
#: of realisations that such a constant needs cannot be estimated.
GROWTH = 1.5
#: A case with `FEWEST` or more results stops if its estimated standard error meets the tolerance. With fewer results
#: the standard error is estimated poorly: if cases stopped on this estimate alone, only 89 % of the 95 % intervals
#: might contain the true mean. `growth_needed` lists two further conditions. The coverage was measured with
#: ``python -m benchmarks campaigns``.
FEWEST = 12
#: A case with two or more results also stops if its standard error is below this fraction of the tolerance, because its
#: results are then practically equal.
NEGLIGIBLE = 1e-3


def next_round(replication: Replication, count: int, growth: NDArray[np.float64]) -> int:
    """Return the number of realisations after the next round; `count` is their number so far.

    `growth` is the factor by which the number of realisations of each case must grow, at most 1 if the case has enough.
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
    """Return the factor by which the number of results of each case must grow.

    `values` are the outputs that have a tolerance, shape (..., realisations), and `status` the ledger; only results
    that are done are used. `until` is the largest allowed standard error of the mean of each output. `scatter`
    contains, for some outputs, the standard error that was estimated within each single realisation.

    The factor is at most 1 if the case has enough results for every tolerance, and 0 if the case has no successful
    result. A case has enough results for a tolerance if at least one of these conditions holds:

    * There are at least `FEWEST` results, and the standard error is within the tolerance.
    * The standard error is below the fraction `NEGLIGIBLE` of the tolerance.
    * The standard error is within the tolerance, and so is the standard error that follows from `scatter`.
    """
    done = status == Status.DONE
    count = np.maximum(done.sum(axis=-1), 1)
    needed = np.zeros(count.shape)
    for name, tolerance in until.items():
        mean, error = mean_and_error(values[name], done)
        allowed = np.maximum(tolerance.absolute, tolerance.relative * np.abs(mean))
        enough = count * _times(error, allowed)
        sufficient = [np.maximum(FEWEST, enough), count * _times(error, NEGLIGIBLE * allowed)]
        if scatter and name in scatter:
            within = _error_from_within(scatter[name], done)
            sufficient.append(np.maximum(enough, count * _times(within, allowed)))
        needed = np.maximum(needed, np.minimum.reduce(sufficient))
    return np.asarray(np.where(done.any(axis=-1), needed / count, 0.0))


def known_scatter(model: Model[Any], until: Collection[str], outputs: Collection[str]) -> dict[str, str]:
    """Return the outputs that estimate the scatter of other outputs from one realisation.

    The keys are the outputs with a tolerance whose scatter is estimated in this way. An output is left out if no such
    estimate exists or if the study does not compute the estimate.
    """
    scatter = {output: model.output(output).scatter for output in until}
    return {output: own for output, own in scatter.items() if own in outputs}


def _times(error: NDArray[np.float64], allowed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the factor by which the number of results must grow to reach the allowed error.

    The factor is infinite if the error is NaN.
    """
    known = np.where(error > 0, error, 0.0)
    with np.errstate(divide="ignore", over="ignore"):
        found = np.divide(known, allowed, out=np.zeros(known.shape), where=known > 0) ** 2
    return np.where(np.isnan(error), np.inf, found)


def _error_from_within(scatter: NDArray[np.float64], done: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the standard error of a mean of independent realisations, given the standard error of each realisation."""
    count = np.maximum(done.sum(axis=-1), 1)
    return np.asarray(np.sqrt((np.where(done, scatter, 0.0) ** 2).sum(axis=-1)) / count)


def mean_and_error(
    values: NDArray[np.float64], valid: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and standard error of the valid values along the last axis.

    The mean is NaN if there is no valid value. The standard error is NaN if there are fewer than two.
    """
    count = valid.sum(axis=-1)
    mean = np.where(valid, values, 0.0).sum(axis=-1) / np.maximum(count, 1)
    squares = np.where(valid, values - mean[..., None], 0.0) ** 2
    variance = squares.sum(axis=-1) / np.maximum(count - 1, 1)
    error = np.sqrt(variance / np.maximum(count, 1))
    return np.where(count > 0, mean, np.nan), np.where(count > 1, error, np.nan)
