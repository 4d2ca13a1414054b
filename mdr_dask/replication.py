"""How many realisations each case needs: whole rounds, until its standard error meets every tolerance."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.models.base import Status

#: Each round adds about this share of the realisations there are.
GROWTH = 0.5
#: Fewer results do not know their own scatter: stopping by it, 95 % intervals would cover as little as 89 %.
FEWEST = 10
#: Part of the tolerance that the standard error of fewer must meet, as where every realisation gives the same.
NEGLIGIBLE = 1e-3


def rounds(replication: Replication) -> Iterator[int]:
    """Yield the number of realisations after each round: multiples of ``at_least``, the last one ``at_most``."""
    count = replication.at_least
    yield count
    while replication.goes_on and count < replication.at_most:
        count += replication.at_least * math.ceil(GROWTH * count / replication.at_least)
        count = min(count, replication.at_most)
        yield count


def needs_more(
    values: Mapping[str, NDArray[np.float64]],
    status: NDArray[np.int8],
    until: Mapping[str, Tolerance],
    scatter: Mapping[str, NDArray[np.float64]] | None = None,
) -> NDArray[np.bool_]:
    """Say which cases need another round.

    Parameters
    ----------
    values : mapping of str to array, shape (..., realisations)
        The outputs that have a tolerance.
    status : int8 array, shape (..., realisations)
        The ledger; only cases that are done count.
    until : mapping of str to Tolerance
        Largest standard error of the mean, by output.
    scatter : mapping of str to array, shape (..., realisations), optional
        The standard errors that single realisations know of themselves, of outputs that have them.

    Returns
    -------
    bool array, shape (...)
        True where the standard error of some output is above its tolerance or not known well yet: from fewer than
        `FEWEST` it counts only with what they know of themselves. A case that never succeeds is not tried for ever.
    """
    done = status == Status.DONE
    count = done.sum(axis=-1)
    wide = np.zeros(count.shape, dtype=bool)
    for name, tolerance in until.items():
        mean, error = mean_and_error(values[name], done)
        allowed = np.maximum(tolerance.absolute, tolerance.relative * np.abs(mean))
        known = count >= FEWEST
        if scatter and name in scatter:
            known |= _error_from_within(scatter[name], done) <= allowed
        wide |= ~(error <= np.where(known, 1.0, NEGLIGIBLE) * allowed)
    return np.asarray(wide & (count > 0))


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
