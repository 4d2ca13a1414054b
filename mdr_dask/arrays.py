"""Short names for types of arrays, comparisons of numbers, and the random generator of a realisation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

#: Two numbers that a user writes or reads count as equal up to this relative difference. Tables show six digits.
SAME = 1e-5


def is_geometric(values: Any) -> bool:
    """Return whether numbers suit a logarithmic scale: all are positive, and they span more than a decade.

    Numbers that are not finite are ignored.
    """
    values = np.asarray(values, dtype=np.float64)
    values = values[np.isfinite(values)]
    return bool(values.size and values.min() > 0 and values.max() > 10 * values.min())


def random_stream(seed: int, realisation: int) -> np.random.Generator:
    """Return the random generator of a realisation. It gives the same numbers in every case and every model."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(realisation,))))
