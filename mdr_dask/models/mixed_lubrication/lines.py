"""The two rough lines of a case: with random phases, or measured."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mdr_dask.arrays import FloatArray, random_stream
from mdr_dask.models.parts.measured_line import ProfileFile, line_of
from mdr_dask.models.parts.surface import Surface, lines_of
from mdr_dask.units import shown

MOST_POINTS = 10**7  # largest number of points of a line, limited by memory
LEAST_PER_WAVE = 2.5  # points per shortest wavelength on the coarsest grid for `points: auto`; 2 is the minimum
DOUBLINGS = 3  # largest number of grids that are finer than the coarsest grid, for `points: auto`


def points_for(modes: int) -> tuple[int, ...]:
    """Return the number of points of each grid, from coarse to fine.

    `modes` is the length of a line divided by its shortest wavelength.
    """
    from scipy.fft import next_fast_len

    least = next_fast_len(min(int(np.ceil(LEAST_PER_WAVE * modes)), MOST_POINTS), real=True)
    return tuple(least * 2**k for k in range(1 + DOUBLINGS) if least * 2**k <= MOST_POINTS)


@dataclass(frozen=True)
class GeneratedPair:
    """Two lines with random phases.

    If `roughness` is a Hurst exponent, the lines are self-affine with the rms height 1. If `roughness` contains two
    measured surfaces, the lines have the spectra of these surfaces and heights in m. If a surface has several files,
    the realisations use these files in turn. `points` is the number of points of each grid, from coarse to fine. The
    lines have the same waves on every grid. `length` is the circumference of a roller in m. `longest` is this length
    divided by the longest wavelength, and `modes` is this length divided by the shortest wavelength.
    """

    points: tuple[int, ...]
    length: float
    longest: float
    modes: int
    roughness: float | tuple[Surface, Surface]

    def problem(self) -> str:
        """Return the reason why the lines cannot be made, or an empty string."""
        if self.longest > self.modes:
            longest, shortest = self.length / self.longest, self.length / max(self.modes, 1)
            return f"expected a longest wavelength above the shortest wavelength {shortest:.9g} m, got {longest:.9g} m"
        if 2 * self.modes > self.points[-1]:
            wave, least = self.length / self.modes, 2 * self.length / self.points[-1]
            return f"expected a shortest wavelength of at least two point spacings, {least:.9g} m, got {wave:.9g} m"
        if isinstance(self.roughness, tuple) and not all(np.any(line) for both in self._amplitudes() for line in both):
            return "expected waves between shortest_wavelength and longest_wavelength, got a surface without such waves"
        return ""

    def combined_rms(self) -> float:
        """Return the rms height of the sum of the two lines.

        It is sqrt(2) for self-affine lines. For measured surfaces it is in m, and the mean squares of the heights are
        averaged over all files of a surface.
        """
        if not isinstance(self.roughness, tuple):
            return float(np.sqrt(2.0))
        squares = [np.mean([np.sum(line**2) / 2 for line in lines]) for lines in self._amplitudes()]
        return float(np.sqrt(sum(squares)))

    def lines(self, seed: int, realisation: int, points: int) -> FloatArray:
        """Return the coefficients of the least-squares splines of both lines, shape (2, points).

        The random phases are drawn in the order of the wavelengths, beginning with the longest wavelength. Longer waves
        therefore stay the same if shorter waves are added.
        """
        from mdr_dask.physics.surfaces.roughness import phase_factors
        from mdr_dask.physics.surfaces.splines import closest

        phases = phase_factors(seed, realisation, 2 * self.modes).reshape(-1, 2).T
        amplitudes = [lines[realisation % len(lines)] for lines in self._amplitudes()]
        return np.array([closest(0.5 * a * phase, points) for a, phase in zip(amplitudes, phases, strict=True)])

    def _amplitudes(self) -> list[list[FloatArray]]:
        """Return the amplitudes of the waves of line 1 and of line 2, for each file."""
        from mdr_dask.physics.surfaces import roughness

        if not isinstance(self.roughness, tuple):
            return [[roughness.amplitudes(self.modes, self.roughness, longest=self.longest)]] * 2
        waves = np.arange(1, self.modes + 1) >= self.longest * (1 - 1e-12)
        return [[line * waves for line in lines_of(each, self.length, self.modes)] for each in self.roughness]


@dataclass(frozen=True)
class MeasuredPair:
    """Two measured lines. The end of each line is joined to its beginning.

    If the spacings of the two lines differ, the line with the larger spacing is interpolated to the smaller spacing.
    """

    file_1: ProfileFile
    file_2: ProfileFile
    scaled: bool  # whether each line is scaled to the rms height 1

    @property
    def points(self) -> tuple[int, int]:
        """Number of points of the coarse grid and of the fine grid.

        Both lines are cut to the same even number of points.
        """
        half = min(height.size for height in self._heights()) // 2
        return half, 2 * half

    @property
    def spacing(self) -> float:
        """Distance between points in m."""
        one, two = (line_of(file).spacing for file in (self.file_1, self.file_2))
        return one if _are_equal(one, two) else min(one, two)

    @property
    def length(self) -> float:
        """Length of the lines in m, which does not depend on the circumference of the rollers."""
        return self.points[-1] * self.spacing

    def problem(self) -> str:
        """Return an empty string, because any two measured lines can be combined."""
        return ""

    def note(self) -> str:
        """Return a text that states the number of points, the length and the rms heights of the unscaled lines."""
        first, second = (shown(float(line.std()), "m") for line in self._levelled())
        return (
            f"both profiles are used without tilt, with {self.points[-1]} points over {shown(self.length, 'm')}; "
            f"their rms heights are then {first} and {second}"
        )

    def combined_rms(self) -> float:
        """Return the rms height of the sum of the two lines, in m, or without a unit if the lines are scaled."""
        return float(np.sqrt(sum(np.mean(line**2) for line in self._pair())))

    def lines(self, seed: int, realisation: int, points: int) -> FloatArray:
        """Return the coefficients of the splines of both lines, shape (2, points).

        On the fine grid, the splines go through all points, and on the coarse grid through every second point.

        During one revolution at the mean velocity, with a slide-roll ratio S, the contact travels (1 + S/2) times the
        length of line 1, and (1 - S/2) times the length of line 2. The contact thus passes some points more often than
        others. Because both lines begin at random points, means over realisations are nevertheless unbiased.
        """
        from mdr_dask.physics.surfaces.splines import through_heights

        stream = random_stream(seed, realisation)
        offset, start = (int(stream.integers(self.points[-1])) for _ in range(2))
        rings = zip(self._pair(), (start, start + offset), strict=True)
        return np.array([through_heights(np.roll(line, roll)[:: self.points[-1] // points]) for line, roll in rings])

    def _pair(self) -> tuple[FloatArray, FloatArray]:
        """Return the two lines without mean and tilt. If `scaled` is True, each line is scaled to the rms height 1."""
        first, second = (line / line.std() if self.scaled else line for line in self._levelled())
        return first, second

    def _levelled(self) -> list[FloatArray]:
        """Return the lines without mean and tilt. A tilt would cause a step where the two ends of a line are joined."""
        from mdr_dask.physics.surfaces.measured import detrended

        return [detrended(height[: self.points[-1]], "line") for height in self._heights()]

    def _heights(self) -> list[FloatArray]:
        return [_heights_at(file, self.spacing) for file in (self.file_1, self.file_2)]


def _are_equal(one: float, two: float) -> bool:
    return abs(one - two) <= 1e-3 * one


@lru_cache(maxsize=16)
def _heights_at(file: ProfileFile, spacing: float) -> FloatArray:
    """Return the heights of a measured line at points with the distance `spacing`, interpolated if necessary."""
    from scipy.interpolate import CubicSpline

    line = line_of(file)
    if _are_equal(spacing, line.spacing):
        return line.height
    place = line.spacing * np.arange(line.height.size)
    return np.asarray(CubicSpline(place, line.height)(np.arange(0, place[-1], spacing)), dtype=np.float64)


Source = GeneratedPair | MeasuredPair
