"""Short names for types of arrays, and the random generator of a realisation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def random_stream(seed: int, realisation: int) -> np.random.Generator:
    """Return a generator that gives a realisation the same random numbers in every case and every model."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(realisation,))))
