"""How many realisations each case needs: in whole rounds, until its standard error meets every tolerance."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.models.base import Model, Status

#: A round goes to the number that is probably enough for half of its cases, within these multiples of the last one.
LEAST_GROWTH, MOST_GROWTH = 1.25, 4.0
#: Growth of a round for a fitted constant, of which the number needed is not known.
GROWTH = 1.5
#: With `FEWEST` or more results, the estimated standard error is used as it is. Fewer results estimate their scatter
#: badly: stopping by it, 95 % intervals would cover as little as 89 %. So from `FEW` results on, a case may stop if a
#: variance `DOUBT` times as large would meet the tolerance as well. Measured: ``python -m benchmarks campaigns``.
FEWEST, FEW, DOUBT = 12, 7, 2.0
#: Part of the tolerance that the standard error of fewer results must meet: all realisations give the same.
NEGLIGIBLE = 1e-3


def next_round(replication: Replication, count: int, growth: NDArray[np.float64]) -> int:
    """Return the number of realisations after the next round.

    Parameters
    ----------
    replication : Replication
        The rule of the campaign.
    count : int
        Number of realisations so far.
    growth : float array, shape (cases,)
        How many times as many each case needs; cases of at most 1 have enough.
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
    """Return how many times as many results each case needs as it has.

    Parameters
    ----------
    values : mapping of str to array, shape (..., realisations)
        The outputs that have a tolerance.
    status : int8 array, shape (..., realisations)
        The ledger; only cases that are done count.
    until : mapping of str to Tolerance
        Largest standard error of the mean, by output.
    scatter : mapping of str to array, shape (..., realisations), optional
        Standard errors that single realisations estimate themselves, of outputs that have them.

    Returns
    -------
    float array, shape (...)
        At most 1 if every standard error meets its tolerance with `FEWEST` results, or with `FEW` results and a
        variance `DOUBT` times as large; with fewer results if it meets a small part of the tolerance, or if each result
        estimates its own scatter and that meets the tolerance as well. It is 0 for a case without any success.
    """
    done = status == Status.DONE
    count = np.maximum(done.sum(axis=-1), 1)
    needed = np.zeros(count.shape)
    for name, tolerance in until.items():
        mean, error = mean_and_error(values[name], done)
        allowed = np.maximum(tolerance.absolute, tolerance.relative * np.abs(mean))
        enough = count * _times(error, allowed)
        sufficient = [
            np.maximum(FEWEST, enough),
            np.maximum(FEW, DOUBT * enough),
            count * _times(error, NEGLIGIBLE * allowed),
        ]
        if scatter and name in scatter:
            within = _error_from_within(scatter[name], done)
            sufficient.append(np.maximum(enough, count * _times(within, allowed)))
        needed = np.maximum(needed, np.minimum.reduce(sufficient))
    return np.asarray(np.where(done.any(axis=-1), needed / count, 0.0))


def known_scatter(model: Model[Any], until: Collection[str], outputs: Collection[str]) -> dict[str, str]:
    """Return the outputs that estimate the scatter of outputs with a tolerance from single realisations."""
    scatter = {output: model.output(output).scatter for output in until}
    return {output: own for output, own in scatter.items() if own in outputs}


def _times(error: NDArray[np.float64], allowed: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how many times as many results reduce an error to the allowed one; infinite if it is not known."""
    known = np.where(error > 0, error, 0.0)
    with np.errstate(divide="ignore", over="ignore"):
        found = np.divide(known, allowed, out=np.zeros(known.shape), where=known > 0) ** 2
    return np.where(np.isnan(error), np.inf, found)


def _error_from_within(scatter: NDArray[np.float64], done: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the standard error of the mean of independent realisations, from that of each of them."""
    count = np.maximum(done.sum(axis=-1), 1)
    return np.asarray(np.sqrt((np.where(done, scatter, 0.0) ** 2).sum(axis=-1)) / count)


def mean_and_error(
    values: NDArray[np.float64], valid: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean and standard error over the last axis of the valid values; NaN where there are too few."""
    count = valid.sum(axis=-1)
    mean = np.where(valid, values, 0.0).sum(axis=-1) / np.maximum(count, 1)
    squares = np.where(valid, values - mean[..., None], 0.0) ** 2
    variance = squares.sum(axis=-1) / np.maximum(count - 1, 1)
    error = np.sqrt(variance / np.maximum(count, 1))
    return np.where(count > 0, mean, np.nan), np.where(count > 1, error, np.nan)
