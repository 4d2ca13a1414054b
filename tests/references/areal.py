"""Generated areal surfaces: random phases on a given isotropic spectrum (thesis 2.16, 2.17)."""

from __future__ import annotations

import numpy as np
from scipy import fft

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.surfaces.maps import wavenumbers
from mdr_dask.physics.surfaces.spectrum import Spectrum


def areal_surface(
    spectrum: Spectrum, points: tuple[int, int], size: tuple[float, float], seed: int, realisation: int
) -> FloatArray:
    """Return a periodic isotropic surface, m, without the waves that the grid does not resolve.

    h = sum_q B(q) exp(i (q x + phi)), B(q) = 2 pi sqrt(C2D / (L_x L_y)): every surface has the same spectrum.
    """
    generator = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(realisation,))))
    waves = fft.rfft2(generator.standard_normal(points), overwrite_x=True)  # phases of noise are those of a real field
    waves /= np.abs(waves)
    q_x, q_y = wavenumbers(points, size)
    waves *= 2 * np.pi * np.sqrt(spectrum.at(np.hypot(q_x[:, None], q_y)) / (size[0] * size[1]))
    surface: FloatArray = fft.irfft2(waves, points, norm="forward", overwrite_x=True)
    return surface
