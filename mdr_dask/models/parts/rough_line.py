"""A generated rough line: the numbers that fix it, and one realisation of it on any grid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray


@dataclass(frozen=True)
class Line:
    """What fixes a line but for its phases, in units of its length and rms height."""

    hurst: float
    points: int
    rolloff: float
    longest: float
    coefficient: float  # of the indenter c |x|^n, 0 for a plane
    exponent: float

    def amplitudes(self) -> FloatArray:
        """Return the amplitudes of its harmonics."""
        return _amplitudes(self.points // 2, self.hurst, self.rolloff, self.longest)

    def slope(self) -> float:
        """Return the spectral rms slope."""
        return _slope(self)


@lru_cache(maxsize=32)
def _amplitudes(modes: int, hurst: float, rolloff: float, longest: float) -> FloatArray:
    from mdr_dask.physics.surfaces import roughness

    return roughness.amplitudes(modes, hurst, rolloff, longest)


@lru_cache(maxsize=1024)
def _slope(line: Line) -> float:
    from mdr_dask.physics.surfaces import roughness

    return roughness.spectral_slope(line.amplitudes())


@dataclass(frozen=True)
class Realisation:
    """One realisation of a line, in units of its length and rms height."""

    line: Line
    turned: NDArray[np.complex128]  # exp(i phi) of its harmonics

    @property
    def points(self) -> int:
        """Number of Nyquist points."""
        return self.line.points

    @property
    def coefficient(self) -> float:
        """Of the indenter c |x|^n, 0 for a plane."""
        return self.line.coefficient

    @property
    def exponent(self) -> float:
        """Of the indenter."""
        return self.line.exponent

    def heights(self, oversampling: int) -> FloatArray:
        """Return the roughness on a grid, both ends included where there is an indenter."""
        return self._on_grid(oversampling, 0)

    def slopes(self, oversampling: int) -> FloatArray:
        """Return its derivative by position."""
        return self._on_grid(oversampling, 1)

    def _on_grid(self, oversampling: int, derivative: int) -> FloatArray:
        from mdr_dask.physics.surfaces import roughness

        amplitude, count = self.line.amplitudes(), self.line.points * oversampling
        turn = roughness.turned_line(amplitude, self.turned, count, derivative)
        return turn if self.line.coefficient == 0 else np.append(turn, turn[0])
