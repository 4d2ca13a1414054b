"""The four kinds of lines: generated lines, lines with the spectrum of a surface, measured lines, and smooth lines.

Heights are divided by a unit of height, which is the rms height of the line unless a method `height` says otherwise.
Positions are divided by the length of the line.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.models.parts.measured_line import ProfileFile, line_of
from mdr_dask.models.parts.surface import Surface, lines_of

if TYPE_CHECKING:
    from mdr_dask.physics.surfaces.waves import Waves


@dataclass(frozen=True)
class Generated:
    """Generated self-affine roughness. All realisations have the same amplitudes, but different random phases."""

    hurst: float
    points: int
    rolloff: float  # length of the line divided by the roll-off wavelength; 0 without a roll-off
    longest: float  # length of the line divided by the longest wavelength; 0 if all waves are present
    is_random = True

    def waves(self, seed: int, realisation: int) -> Waves:
        """Return the waves of one realisation. Raise ValueError if no wave lies between the cut-off wavelengths."""
        return _with_random_phases(_amplitudes(self), self.points, seed, realisation)

    def slope(self, realisation: int) -> float:
        """Return the spectral rms slope."""
        return _slope(self)


def _with_random_phases(amplitude: FloatArray, points: int, seed: int, realisation: int) -> Waves:
    from mdr_dask.physics.surfaces import roughness
    from mdr_dask.physics.surfaces.waves import Waves

    return Waves(0.5 * amplitude * roughness.phase_factors(seed, realisation, points // 2), points)


@lru_cache(maxsize=32)
def _amplitudes(line: Generated) -> FloatArray:
    from mdr_dask.physics.surfaces import roughness

    return roughness.amplitudes(line.points // 2, line.hurst, line.rolloff, line.longest)


@lru_cache(maxsize=1024)
def _slope(line: Generated) -> float:
    from mdr_dask.physics.surfaces import roughness

    return roughness.spectral_slope(_amplitudes(line))


@dataclass(frozen=True)
class OfSurface:
    """Lines with the spectrum of a measured surface and random phases.

    If the surface has several files, the realisations use the files in turn. The scatter between realisations then
    includes the scatter between files.
    """

    surface: Surface
    points: int
    length: float  # m
    is_random = True

    def height(self) -> float:
        """Return the unit of height in m: the rms height of the lines of all files together."""
        return _height(self)

    def waves(self, seed: int, realisation: int) -> Waves:
        """Return the waves of one realisation."""
        return _with_random_phases(self._amplitudes(realisation), self.points, seed, realisation)

    def slope(self, realisation: int) -> float:
        """Return the spectral rms slope."""
        from mdr_dask.physics.surfaces import roughness

        return roughness.spectral_slope(self._amplitudes(realisation))

    def _amplitudes(self, realisation: int) -> FloatArray:
        lines = lines_of(self.surface, self.length, self.points // 2)
        return lines[realisation % len(lines)] / self.height()


@lru_cache(maxsize=64)
def _height(line: OfSurface) -> float:
    lines = lines_of(line.surface, line.length, line.points // 2)
    return float(np.sqrt(np.mean([np.sum(amplitude**2) / 2 for amplitude in lines])))


@dataclass(frozen=True)
class Measured:
    """The measured profile of a file. All realisations have the same line."""

    profile: ProfileFile
    is_random = False

    @property
    def points(self) -> int:
        """Number of samples of the profile."""
        return int(line_of(self.profile).height.size)

    def height(self) -> float:
        """Return the unit of height in m: the rms height, or the length of the line if the line is flat."""
        line = line_of(self.profile)
        return float(line.height.std()) or line.length

    def waves(self, seed: int, realisation: int) -> Waves:
        """Return the waves of the line that passes through the samples."""
        return _waves(self)

    def slope(self, realisation: int) -> float:
        """Return the spectral rms slope."""
        return _waves(self).rms_slope()


@lru_cache(maxsize=16)
def _waves(line: Measured) -> Waves:
    from mdr_dask.physics.surfaces.waves import waves_of

    return waves_of(line_of(line.profile).height / line.height())


@dataclass(frozen=True)
class Smooth:
    """A line without roughness. Solvers choose the same grids as for a rough line with `points` points."""

    points: int
    is_random = False

    def waves(self, seed: int, realisation: int) -> Waves:
        """Return a line without waves."""
        from mdr_dask.physics.surfaces.waves import Waves

        return Waves(np.zeros(0, np.complex128), self.points)

    def slope(self, realisation: int) -> float:
        """Return 0."""
        return 0.0


Roughness = Generated | OfSurface | Measured | Smooth
