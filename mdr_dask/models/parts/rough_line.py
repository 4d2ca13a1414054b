"""The roughness of a line as a campaign names it: generated, measured or none; each a sum of waves."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from mdr_dask.arrays import FloatArray
from mdr_dask.models.parts.measured_line import ProfileFile, line_of

if TYPE_CHECKING:
    from mdr_dask.physics.surfaces.waves import Waves


@dataclass(frozen=True)
class Generated:
    """Self-affine roughness: what fixes it but for its phases, in units of its length and rms height."""

    hurst: float
    points: int
    rolloff: float  # harmonic numbers: length over wavelength, 0 for none
    longest: float
    is_random = True

    def waves(self, seed: int, realisation: int) -> Waves:
        """Return one realisation; ValueError if no wave is left between the cut-offs."""
        from mdr_dask.physics.surfaces import roughness
        from mdr_dask.physics.surfaces.waves import Waves

        amplitude = _amplitudes(self)
        return Waves(0.5 * amplitude * roughness.phase_factors(seed, realisation, self.points // 2), self.points)

    def slope(self) -> float:
        """Return the spectral rms slope."""
        return _slope(self)


@lru_cache(maxsize=32)
def _amplitudes(line: Generated) -> FloatArray:
    from mdr_dask.physics.surfaces import roughness

    return roughness.amplitudes(line.points // 2, line.hurst, line.rolloff, line.longest)


@lru_cache(maxsize=1024)
def _slope(line: Generated) -> float:
    from mdr_dask.physics.surfaces import roughness

    return roughness.spectral_slope(_amplitudes(line))


@dataclass(frozen=True)
class Measured:
    """The line of a file, the same in every realisation, in units of its length and rms height."""

    profile: ProfileFile
    is_random = False

    @property
    def points(self) -> int:
        """Nyquist points: the samples of the line."""
        return int(line_of(self.profile).height.size)

    def height(self) -> float:
        """Return the unit of height, m: the rms height, or the length of a flat line."""
        line = line_of(self.profile)
        return float(line.height.std()) or line.length

    def waves(self, seed: int, realisation: int) -> Waves:
        """Return the waves of the line through the samples."""
        return _waves(self)

    def slope(self) -> float:
        """Return the spectral rms slope."""
        return _waves(self).rms_slope()


@lru_cache(maxsize=16)
def _waves(line: Measured) -> Waves:
    from mdr_dask.physics.surfaces.waves import waves_of

    return waves_of(line_of(line.profile).height / line.height())


@dataclass(frozen=True)
class Smooth:
    """No roughness, on as many points as a generated line would have."""

    points: int
    is_random = False

    def waves(self, seed: int, realisation: int) -> Waves:
        """Return no waves."""
        import numpy as np

        from mdr_dask.physics.surfaces.waves import Waves

        return Waves(np.zeros(0, np.complex128), self.points)

    def slope(self) -> float:
        """Return 0."""
        return 0.0


Roughness = Generated | Measured | Smooth
