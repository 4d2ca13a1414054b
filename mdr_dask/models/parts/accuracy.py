"""Messages about cases whose estimated errors exceed the accuracy that a campaign requires."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray

# Relative accuracy if the campaign gives no accuracy. Friction differs by more than this from one surface to another.
ACCURACY = 0.01


def missed_accuracy(
    values: Mapping[str, ArrayLike],
    errors: Mapping[str, ArrayLike],
    accuracy: float,
    floors: Mapping[str, ArrayLike] | None = None,
    where: str = "",
) -> dict[int, str]:
    """Return a message for every case in which an output misses the accuracy. The key is the index of the case.

    The relative error of an output is the largest absolute error in the case, divided by the largest absolute value in
    the case, or by the floor of the output if the floor is larger. `values` and `errors` have the shape (cases, ...).
    Elements that are NaN in `values` or in `errors` are ignored. The text `where`, such as ``" on the finest grid"``,
    is added to the messages.
    """
    shares = {
        name: _relative_errors(value, errors[name], (floors or {}).get(name, 0.0)) for name, value in values.items()
    }
    messages = {}
    for k in np.flatnonzero(np.any([~(share <= accuracy) for share in shares.values()], axis=0)) if shares else ():
        late = {name: share[k] for name, share in shares.items() if not share[k] <= accuracy}
        texts = (f"{name} {f'{share:.3g}' if np.isfinite(share) else 'unknown'}" for name, share in late.items())
        messages[int(k)] = (
            f"an accuracy of {accuracy:.12g} is missed{where}; estimated relative errors: {', '.join(texts)}"
        )
    return messages


def _relative_errors(values: ArrayLike, errors: ArrayLike, floor: ArrayLike) -> FloatArray:
    """Return the relative error of one output for every case, shape (cases,).

    The relative error of a case is 0 if all errors are 0. The relative error is infinite if some error is not 0, but
    all values and the floor are 0.
    """
    size, error = (np.abs(np.atleast_1d(np.asarray(each, dtype=np.float64))) for each in (values, errors))
    known = ~(np.isnan(size) | np.isnan(error))
    largest_error, largest = (
        np.where(known, each, 0.0).reshape(len(each), -1).max(axis=1, initial=0.0) for each in (error, size)
    )
    with np.errstate(all="ignore"):
        share = largest_error / np.maximum(largest, np.asarray(floor, dtype=np.float64))
    return np.where(largest_error == 0, 0.0, share)
