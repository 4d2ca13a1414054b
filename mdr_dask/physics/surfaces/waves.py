"""A periodic line as a sum of waves: the common form of generated and measured roughness, on any grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.surfaces.roughness import spectral_slope


@dataclass(frozen=True)
class Waves:
    """A line h(x) = 2 Re sum_k c_k exp(2 pi i k x) of unit length and mean 0; `coefficients` are c_k for k = 1..modes.

    `points` is the number of equidistant samples that determine the line (Nyquist points): 2 * modes or 2 * modes + 1.
    """

    coefficients: NDArray[np.complex128]
    points: int

    def heights(self, nodes: int) -> FloatArray:
        """Return h at x = 0, 1/nodes, ..."""
        return series(self.coefficients, nodes)

    def slopes(self, nodes: int) -> FloatArray:
        """Return dh/dx at x = 0, 1/nodes, ...; exact, because each wave is differentiated."""
        return series(self.coefficients * (2j * np.pi * np.arange(1, self.coefficients.size + 1)), nodes)

    def from_place(self, place: float) -> Waves:
        """Return the line that starts at the position `place` (0 to 1) of this line.

        On a grid with only two nodes per shortest wave, a part of the shortest wave of the returned line may be lost.
        """
        wave = np.arange(1, self.coefficients.size + 1)
        return Waves(self.coefficients * np.exp(2j * np.pi * wave * place), self.points)

    def rms_slope(self) -> float:
        """Return the spectral rms slope, sqrt(sum (A_k q_k)^2 / 2) with A_k = 2 |c_k| and q_k = 2 pi k."""
        return spectral_slope(2 * np.abs(self.coefficients))


def series(coefficients: NDArray[np.complex128], nodes: int) -> FloatArray:
    """Return 2 Re sum_k c_k exp(2 pi i k x) at x = 0, 1/nodes, ... by FFT.

    If there are fewer than two nodes per shortest wave, a ValueError is raised.
    """
    modes = coefficients.size
    if nodes < 2 * modes:
        raise ValueError(f"expected at least {2 * modes} nodes for {modes} harmonics, got {nodes}")
    spectrum = np.zeros(nodes // 2 + 1, dtype=np.complex128)
    spectrum[1 : modes + 1] = coefficients
    if nodes == 2 * modes:
        spectrum[-1] = 2 * spectrum[-1].real
    heights: FloatArray = fft.irfft(spectrum, nodes, norm="forward", overwrite_x=True)
    return heights


def waves_of(height: FloatArray) -> Waves:
    """Return the waves of the periodic line through equidistant samples, without the mean.

    For an even number of samples, the sine part of the shortest wave is zero at all samples and is set to 0.
    """
    coefficients = np.fft.rfft(height)[1:] / height.size
    if height.size % 2 == 0:
        coefficients[-1] = 0.5 * coefficients[-1].real
    return Waves(coefficients, height.size)
