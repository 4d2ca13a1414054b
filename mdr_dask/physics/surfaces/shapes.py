"""Lines that represent indenters according to the MDR rule."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mdr_dask.arrays import FloatArray


@dataclass(frozen=True)
class PowerLaw:
    """The line -c |x|^n, c > 0 and n >= 1, that represents a body of revolution according to the MDR rule."""

    coefficient: float
    exponent: float

    @classmethod
    def of_body(cls, coefficient: float, exponent: float) -> PowerLaw:
        """Return the line -kappa_n c |x|^n of a body c r^n; kappa_n is pi/2 for a cone and 2 for a paraboloid."""
        kappa = 0.5 * math.sqrt(math.pi) * exponent * math.gamma(exponent / 2) / math.gamma((exponent + 1) / 2)
        return cls(kappa * coefficient, exponent)

    def at(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the height -c |x|^n at every x, and the slopes to the left and to the right of x."""
        distance = np.abs(x)
        steepness = self.coefficient * self.exponent * distance ** (self.exponent - 1)
        left = np.where(x > 0, -steepness, steepness)
        right = np.where(x < 0, steepness, -steepness)
        return -self.coefficient * distance**self.exponent, left, right

    def scaled(self, length: float, height: float) -> PowerLaw:
        """Return the same line with lengths in units of `length` and heights in units of `height`."""
        return PowerLaw(self.coefficient * length**self.exponent / height, self.exponent)
