"""Errors over what they belong to, and the sentence of all models about outputs that miss an accuracy."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import distinguishable


def share(error: ArrayLike, value: ArrayLike, whole: ArrayLike = 0.0) -> FloatArray:
    """Return errors over the size of their values; no error is none of anything.

    A value that is zero within its error has no relative one: that counts beside the whole it is a part of.
    """
    errors, size = np.asarray(error, dtype=np.float64), np.abs(np.asarray(value, dtype=np.float64))
    with np.errstate(all="ignore"):
        shares = errors / np.where(size > errors, size, np.maximum(size, np.abs(whole)))
    return np.where(errors == 0, 0.0, shares)


def missed(shares: Mapping[str, float], accuracy: float, where: str = "") -> str:
    """Say which outputs miss an accuracy and by how much; an empty string if none does."""
    named = [f"{name} by {_amount(share, accuracy)}" for name, share in shares.items() if share > accuracy]
    return f"an accuracy of {accuracy:.12g} is missed{where}: {', '.join(named)} (estimated)" if named else ""


def _amount(share: float, accuracy: float) -> str:
    return distinguishable(share, accuracy, digits=2)[0] if np.isfinite(share) else "an unknown amount"
