"""The check whether results meet the accuracy of a campaign, and the message if not: one rule for all models.

The error of an output is relative to its value. For a profile or a history, the largest error is relative to the
largest value. For an output that can be zero, the model gives a floor: an absolute value to which the error is relative
if the output is smaller.
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
        Results and their absolute errors by output; entries where either is NaN are ignored.
    floors : mapping of str to array, shape (cases,), or float
        Absolute values by output to which the error is relative if the result is smaller.
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
    """Return a message for every case with an output that misses the accuracy, by the index of the case.

    Parameters
    ----------
    values, errors, floors
        As in :func:`relative_errors`.
    accuracy : float
        Allowed relative error of every output.
    where : str
        Added to the message, such as ``" on the finest grid"``.
    """
    shares = relative_errors(values, errors, floors)
    late = np.flatnonzero(np.any([~(share <= accuracy) for share in shares.values()], axis=0)) if shares else ()
    return {int(k): missed({name: float(share[k]) for name, share in shares.items()}, accuracy, where) for k in late}


def missed(shares: Mapping[str, float], accuracy: float, where: str = "") -> str:
    """Return the message about the outputs that miss an accuracy, or an empty string if there are none."""
    named = [f"{name} by {_amount(share, accuracy)}" for name, share in shares.items() if share > accuracy]
    return f"an accuracy of {accuracy:.12g} is missed{where}: {', '.join(named)} (estimated)" if named else ""


def _amount(share: float, accuracy: float) -> str:
    return distinguishable(share, accuracy, digits=2)[0] if np.isfinite(share) else "an unknown amount"
