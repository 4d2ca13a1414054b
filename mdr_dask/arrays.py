"""Type names of arrays, and the random numbers of a realisation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def random_stream(seed: int, realisation: int) -> np.random.Generator:
    """Return the random generator of a realisation, which is the same for all cases and all models."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(realisation,))))
