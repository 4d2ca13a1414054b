"""The two rough lines of a case, generated or measured, and why a case may have none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mdr_dask.errors import DataError
from mdr_dask.models.base import FloatArray
from mdr_dask.models.profile_file import ProfileFile, line_of

if TYPE_CHECKING:
    from mdr_dask.models.mixed_lubrication.parameters import MixedLubrication


@dataclass(frozen=True)
class Generated:
    """Two generated lines of unit rms height; what fixes them but for their phases."""

    points: int
    hurst: float
    longest: float  # harmonic number of the longest wavelength
    modes: int  # harmonic number of the shortest wavelength

    def spacing(self, case: MixedLubrication) -> float:
        """Return the distance of the points in m."""
        return 2 * np.pi * case.roller_radius / self.points

    def combined_rms(self) -> float:
        """Return the rms height of both lines together."""
        return float(np.sqrt(2.0))

    def lines(self, seed: int, realisation: int) -> tuple[FloatArray, FloatArray]:
        """Return both lines; one stream feeds them in turn, so that a shorter cut-off keeps the longer waves."""
        from mdr_dask.physics import roughness

        amplitude = roughness.amplitudes(self.modes, self.hurst, longest=self.longest)
        phase = roughness.phases(seed, realisation, 2 * self.modes).reshape(-1, 2)
        return (
            roughness.line(amplitude, phase[:, 0], self.points),
            roughness.line(amplitude, phase[:, 1], self.points),
        )


@dataclass(frozen=True)
class Measured:
    """Two measured lines, closed to rings; a realisation turns one ring against the other."""

    file_1: ProfileFile
    file_2: ProfileFile
    scaled: bool  # to unit rms height

    @property
    def points(self) -> int:
        """Number of points of the shorter file; the longer one is cut."""
        return min(line_of(file).height.size for file in (self.file_1, self.file_2))

    def spacing(self, case: MixedLubrication) -> float:
        """Return the distance of the points in m, as in the files."""
        return line_of(self.file_1).spacing

    def combined_rms(self) -> float:
        """Return the rms height of both lines together, in m unless scaled."""
        return float(np.sqrt(sum(np.mean(line**2) for line in self._pair())))

    def lines(self, seed: int, realisation: int) -> tuple[FloatArray, FloatArray]:
        """Return both lines, the second one turned by a random number of points."""
        line_1, line_2 = self._pair()
        stream = np.random.Philox(np.random.SeedSequence(seed, spawn_key=(realisation,)))
        return line_1, np.roll(line_2, int(np.random.Generator(stream).integers(line_2.size)))

    def _pair(self) -> tuple[FloatArray, FloatArray]:
        """Return the lines without mean and tilt, so that their ends nearly meet."""
        from mdr_dask.physics.measured import detrended, rms_height

        lines = [detrended(line_of(file).height[: self.points], "line") for file in (self.file_1, self.file_2)]
        first, second = (line / rms_height(line) if self.scaled else line for line in lines)
        return first, second


Source = Generated | Measured


def source_of(case: MixedLubrication) -> Source:
    """Return where the lines of a case come from; equal for cases that can share them."""
    if case.profile_1 is not None and case.profile_2 is not None:
        return Measured(case.profile_1, case.profile_2, case.rms_roughness is not None)
    perimeter = 2 * np.pi * case.roller_radius
    longest = case.longest_wavelength
    if longest == "auto":
        longest = 2 * float(case.dry_contact(case.cutoff_force).half_width)
    shortest = 10 * perimeter / case.points if case.shortest_wavelength == "auto" else case.shortest_wavelength
    return Generated(case.points, case.hurst, perimeter / longest, int(perimeter / shortest * (1 + 1e-12)))


def problem_of(case: MixedLubrication) -> str:
    """Say why a case cannot be computed, in one sentence; an empty string if it can."""
    if (case.profile_1 is None) != (case.profile_2 is None):
        return "expected the profiles of both rollers or of none, got one"
    if case.profile_1 is None and case.rms_roughness is None:
        return "expected rms_roughness, or the measured profiles of both rollers, got neither"
    outside = case.oil_data().outside(case.temperature)
    if outside:
        return outside
    try:
        source = source_of(case)
        problem = _problem_of_waves(case, source) if isinstance(source, Generated) else _problem_of_profiles(source)
        return problem or _problem_of_width(case, source)
    except DataError as error:
        return str(error)


def _problem_of_waves(case: MixedLubrication, source: Generated) -> str:
    perimeter = 2 * np.pi * case.roller_radius
    if source.longest > source.modes:
        return (
            f"expected the longest wavelength above the shortest, got {perimeter / source.longest:.4g} m and "
            f"{perimeter / max(source.modes, 1):.4g} m"
        )
    if 2 * source.modes > case.points:
        return (
            f"expected a shortest wavelength of at least two spacings, {2 * perimeter / case.points:.4g} m, "
            f"got {perimeter / source.modes:.4g} m; raise points"
        )
    return ""


def _problem_of_profiles(source: Measured) -> str:
    one, two = (line_of(file).spacing for file in (source.file_1, source.file_2))
    if abs(one - two) > 1e-3 * one:
        return f"expected profiles of the same spacing, got {one:.6g} m and {two:.6g} m; resample one of them"
    return ""


def _problem_of_width(case: MixedLubrication, source: Source) -> str:
    length = source.points * source.spacing(case)
    width = 2 * float(case.dry_contact(case.normal_force).half_width)
    if width > length:
        return f"the contact is wider than the line: expected 2a of at most {length:.4g} m, got {width:.4g} m"
    return ""
