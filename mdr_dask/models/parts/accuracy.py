"""For all models: check whether results reach the accuracy of a campaign, and write a message if they do not.

The relative error of an output is its error divided by its value. For a profile or a history, it is the largest error
divided by the largest value. For an output that can be zero, the model gives a floor in the unit of the output. If the
output is smaller than the floor, the error is divided by the floor.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import distinguishable


def relative_errors(
    values: Mapping[str, ArrayLike], errors: Mapping[str, ArrayLike], floors: Mapping[str, ArrayLike] | None = None
) -> dict[str, FloatArray]:
    """Return the relative error of every output of every case, shape (cases,).

    Parameters
    ----------
    values, errors : mapping of str to array, shape (cases, ...)
        Results and their absolute errors, by the name of the output. Entries are ignored where the result or the error
        is NaN.
    floors : mapping of str to array, shape (cases,), or float
        Floors by the name of the output. If the result is smaller than its floor, its error is relative to the floor.
    """
    found = {}
    for name, value in values.items():
        size, error = (np.abs(np.atleast_1d(np.asarray(each, dtype=np.float64))) for each in (value, errors[name]))
        known = ~(np.isnan(size) | np.isnan(error))
        largest_error, largest = (
            np.where(known, each, 0.0).reshape(len(each), -1).max(axis=1, initial=0.0) for each in (error, size)
        )
        floor = np.asarray((floors or {}).get(name, 0.0), dtype=np.float64)
        with np.errstate(all="ignore"):
            share = largest_error / np.maximum(largest, floor)
        found[name] = np.where(largest_error == 0, 0.0, share)
    return found


def missed_accuracy(
    values: Mapping[str, ArrayLike],
    errors: Mapping[str, ArrayLike],
    accuracy: float,
    floors: Mapping[str, ArrayLike] | None = None,
    where: str = "",
) -> dict[int, str]:
    """Return messages, by the index of the case, for all cases with outputs that miss the accuracy.

    Parameters
    ----------
    values, errors, floors
        As in :func:`relative_errors`.
    accuracy : float
        Allowed relative error of every output.
    where : str
        Text that is added to the message, such as ``" on the finest grid"``.
    """
    shares = relative_errors(values, errors, floors)
    late = np.flatnonzero(np.any([~(share <= accuracy) for share in shares.values()], axis=0)) if shares else ()
    return {int(k): missed({name: float(share[k]) for name, share in shares.items()}, accuracy, where) for k in late}


def missed(shares: Mapping[str, float], accuracy: float, where: str = "") -> str:
    """Return a message about the outputs that miss an accuracy, or an empty string if all outputs reach it."""
    named = [f"{name} by {_amount(share, accuracy)}" for name, share in shares.items() if share > accuracy]
    return f"an accuracy of {accuracy:.12g} is missed{where}: {', '.join(named)} (estimated)" if named else ""


def _amount(share: float, accuracy: float) -> str:
    return distinguishable(share, accuracy, digits=2)[0] if np.isfinite(share) else "an unknown amount"
