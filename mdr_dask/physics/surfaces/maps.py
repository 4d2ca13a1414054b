"""Areal maps: spectrum in rings of constant wave number, straight profiles, slopes and anisotropy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft, sparse

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.physics.refine import EPS
from mdr_dask.physics.surfaces.scans import Cut, averaged
from mdr_dask.physics.surfaces.self_affine import CONFIDENCE, noise_limit
from mdr_dask.physics.surfaces.spectrum import Spectrum

Order = Literal["none", "mean", "plane", "parabola"]

MOST_MISSING = 0.05  # largest accepted fraction of missing points
FAR = 19.0  # smallest deviation of an outlier, in standard deviations; points of generated surfaces deviate less


class SurfaceMap(NamedTuple):
    """Heights on a regular grid, m, positive towards the elastomer; NaN for missing points.

    `size` contains the lengths along x (axis 0) and y (axis 1) in m. A length is the number of points times the
    spacing.
    """

    height: FloatArray
    size: tuple[float, float]


def outliers(surface: SurfaceMap) -> NDArray[np.bool_]:
    """Return a mask of points that deviate from their neighbours on both axes by more than `FAR` standard deviations.

    The standard deviation is estimated from the median of the deviations. If the median is 0, no point is in the mask.
    Points at the edges of the map or next to a missing point are never in the mask, and neither are points that deviate
    only because a neighbour is an outlier.
    """
    height = surface.height
    middle = height[1:-1, 1:-1]
    along = np.abs(middle - 0.5 * (height[2:, 1:-1] + height[:-2, 1:-1]))
    across = np.abs(middle - 0.5 * (height[1:-1, 2:] + height[1:-1, :-2]))
    away = np.minimum(along, across)  # a point on a crest is higher than neighbours across the crest, but not along it
    limit = FAR * 1.4826 * float(np.nanmedian(away[:: 1 + away.shape[0] // 1000, :: 1 + away.shape[1] // 1000]))
    found = np.zeros(height.shape, bool)
    if not limit > 0:
        return found
    row, column = np.nonzero(away > limit)
    largest = np.zeros(row.size)
    for down, right in np.ndindex(3, 3):
        beside = np.clip(row + down - 1, 0, away.shape[0] - 1), np.clip(column + right - 1, 0, away.shape[1] - 1)
        largest = np.fmax(largest, away[beside])
    # a neighbour of an outlier is an outlier only if its deviation is more than half the deviation of this outlier
    deviates = away[row, column] > 0.5 * largest
    found[row[deviates] + 1, column[deviates] + 1] = True
    return found


def require_points(surface: SurfaceMap) -> None:
    """Raise DataError if an axis has fewer than 16 points, or if more than `MOST_MISSING` of the points are missing."""
    height = surface.height
    if height.ndim != 2 or min(height.shape) < 16:
        raise DataError(f"expected a map of 16 x 16 points or more, got {height.shape}")
    require_few_missing(~np.isfinite(height))


def require_few_missing(missing: NDArray[np.bool_]) -> None:
    """Raise DataError if the fraction of missing points exceeds `MOST_MISSING`."""
    count = int(np.count_nonzero(missing))
    if count > MOST_MISSING * missing.size:
        most, got = f"{100 * MOST_MISSING:g} % of the points", f"{count} of {missing.size}"
        raise DataError(f"expected a map in which at most {most} are missing, got {got}")


def filled(surface: SurfaceMap) -> SurfaceMap:
    """Return a map in which each missing point is the mean of its neighbours (Laplace's equation).

    A map without missing points is returned unchanged. DataError is raised as by `require_points`.
    """
    require_points(surface)
    missing = ~np.isfinite(surface.height)
    return SurfaceMap(_harmonic(surface.height, missing), surface.size) if missing.any() else surface


def _harmonic(height: FloatArray, missing: NDArray[np.bool_]) -> FloatArray:
    # a frame around the map gives every point four neighbours; heights of missing points and of the frame are 0
    places = np.flatnonzero(np.pad(missing, 1))
    width = height.shape[1] + 2
    neighbours = places[:, None] + [-width, width, -1, 1]
    number = np.full((height.shape[0] + 2) * width, -1)
    number[places] = np.arange(places.size)
    columns = number[neighbours]
    row, side = np.nonzero(columns >= 0)
    inside = np.pad(np.ones(height.shape), 1).ravel()[neighbours].sum(axis=1)
    right = np.pad(np.where(missing, 0.0, height), 1).ravel()[neighbours].sum(axis=1)
    between = sparse.coo_array((np.ones(row.size), (row, columns[row, side])), (places.size, places.size))
    filled_in = height.copy()
    start = np.full(places.size, float(np.mean(height[~missing])))
    matrix = (sparse.diags_array(inside) - between).tocsr()
    filled_in[missing], _ = sparse.linalg.cg(matrix, right, start, rtol=1e-10, maxiter=2000)
    return filled_in


def without_trend(surface: SurfaceMap, order: Order) -> SurfaceMap:
    """Return a map minus a least-squares polynomial: the mean, a plane, or a polynomial of second degree in x and y.

    If `order` is "none", the map is returned unchanged. Missing points (NaN) are ignored and stay missing.
    """
    if order == "none":
        return surface
    x, y = (np.linspace(-1, 1, points) for points in surface.height.shape)
    powers = {"mean": ((0, 0),), "plane": ((0, 0), (1, 0), (0, 1))}
    wanted = powers.get(order, (*powers["plane"], (2, 0), (1, 1), (0, 2)))
    known = np.isfinite(surface.height)
    height = np.where(known, surface.height, 0.0)
    gram = np.array([[x ** (a + c) @ known @ y ** (b + d) for c, d in wanted] for a, b in wanted])
    right = [x**a @ height @ y**b for a, b in wanted]
    height = surface.height.copy()
    for factor, (a, b) in zip(np.linalg.solve(gram, right), wanted, strict=True):
        height -= np.outer(factor * x**a, y**b)
    return SurfaceMap(height, surface.size)


def hann_disc(points: tuple[int, int], size: tuple[float, float]) -> FloatArray:
    """Return the Hann window as a function of the distance from the centre.

    The mean square of the window is 1. At distances above half the shorter side of the map, the window is 0.
    """
    x, y = (length * np.arange(n // 2 + 1) / n for n, length in zip(points, size, strict=True))
    distance = np.minimum(np.hypot(x[:, None], y) / (0.5 * min(size)), 1.0)
    quarter = 0.5 + 0.5 * np.cos(np.pi * distance)
    mirrored = np.ix_(*(np.abs(np.arange(n) - n // 2) for n in points))
    window = quarter[mirrored]
    return np.asarray(window / np.sqrt(np.mean(window**2)))


@dataclass(frozen=True)
class MapSpectrum:
    """The spectrum of a map, summed in rings in the plane of the wave vectors.

    The width dq of a ring is 2 pi divided by the shorter side of the map. `density` is C2D, m^4: the power in a ring
    divided by the area of the ring, so that the rms height of the waves in all rings is preserved. Waves beyond the
    last ring, which reaches to the smaller Nyquist wave number of the two axes, are left out. `count` is the number of
    waves in each ring; a wave vector and its negative count as two waves. `independent` is the fraction of the waves
    that are statistically independent: 1 without a window, less than 1 with a window. `rms_height`, m, is the rms
    height of the windowed map. `slopes` contains the mean square of the slope along x and the mean square of the slope
    along y. `angular` contains the means of exp(2 i angle) and of exp(4 i angle) in each ring, weighted by power, with
    the angle from the x axis to the wave vector. Both means are 0 for an isotropic surface. `cuts` contains the wave
    numbers and C_cut, m^3, of straight profiles: first along x, then along y.
    """

    wavenumber: FloatArray
    density: FloatArray
    count: FloatArray
    independent: float
    rms_height: float
    slopes: tuple[float, float]
    angular: NDArray[np.complex128]
    cuts: tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]

    @property
    def rms_gradient(self) -> float:
        """Return the rms of the gradient, from the slopes along x and along y."""
        return float(np.sqrt(self.slopes[0] + self.slopes[1]))

    def spectrum(self) -> Spectrum:
        """Return C2D from the first to the last ring with power above the rounding error.

        Rings between them whose power is below the rounding error get the smallest density of the other rings.
        """
        there = np.flatnonzero(_above_rounding(self.wavenumber * self.density))
        rings = slice(there[0], there[-1] + 1)
        least = self.density[there].min()
        return Spectrum(self.wavenumber[rings], np.maximum(self.density[rings], least))

    def binned(self) -> Cut:
        """Return C2D in logarithmic bins with relative errors."""
        there = _above_rounding(self.wavenumber * self.density)
        rings = self.wavenumber[there], self.density[there], 0.5 * self.independent, self.count[there]
        return averaged(*rings)

    def along(self, axis: int) -> Spectrum:
        """Return the isotropic C2D whose MDR line has the spectrum of profiles along one axis (0 for x, 1 for y).

        Use the result for a grooved surface that slides along this axis.
        """
        q, cut = self.cuts[axis]
        there = _above_rounding(q * cut)
        return Spectrum(q[there], cut[there] / (np.pi * q[there]))

    def anisotropy(self) -> float:
        """Return the anisotropy: 0 for an isotropic surface, 1 if all waves have one direction.

        The second and the fourth angular harmonic are averaged over all wave numbers at which the roughness exceeds the
        noise. The weights are the contributions to the mean square of the height or of the gradient. The square of each
        of these four averages is reduced by the value that scatter alone would exceed with a probability of 5 %. The
        anisotropy is the square root of the largest result, or 0 if all results are negative.
        """
        there = self.wavenumber <= noise_limit(self.binned())
        found, power = [], self.density[there] * self.wavenumber[there]
        for weight in (power, power * self.wavenumber[there] ** 2):
            share = weight / weight.sum()
            scatter = np.sum(2 * share**2 / (self.count[there] * self.independent))
            found.append(np.abs(self.angular[:, there] @ share) ** 2 + np.log(1 - CONFIDENCE) * scatter)
        return float(np.sqrt(np.max(found, initial=0.0)))


def spectrum_of_map(surface: SurfaceMap, hann: bool = True) -> MapSpectrum:
    """Return the spectrum of a map that has no missing points and no trend.

    If `hann` is true, the map is multiplied by the window `hann_disc`. A periodic map needs no window. If all heights
    are equal, DataError is raised.
    """
    points, size = surface.height.shape, surface.size
    height = surface.height - surface.height.mean()
    if not np.ptp(height) > 0:
        raise DataError("expected a rough map, got a flat one")
    independent = 1.0
    if hann:
        window = hann_disc(points, size)
        height *= window
        independent = 1 / float(np.mean(np.square(window**2)))  # because of the window, adjacent waves are correlated
    waves = fft.rfft2(height, overwrite_x=True)
    power = np.abs(waves) ** 2 / height.size**2
    power[0, 0] = 0.0
    # rfft2 omits half of the waves, which are the complex conjugates of the others
    power[:, 1 : (points[1] + 1) // 2] *= 2
    del waves, height
    q_x, q_y = wavenumbers(points, size)
    return _rings(power, q_x, q_y, points, size, independent)


def _rings(
    power: FloatArray,
    q_x: FloatArray,
    q_y: FloatArray,
    points: tuple[int, int],
    size: tuple[float, float],
    independent: float,
) -> MapSpectrum:
    """Return the spectrum in rings of constant wave number, from the squared amplitudes (power) of the waves."""
    step = 2 * np.pi / min(size)
    last = int(np.pi * min(n / length for n, length in zip(points, size, strict=True)) / step + 1e-9)
    square_x, square_y = (q_x**2)[:, None], q_y**2
    ring = np.rint(np.hypot(q_x[:, None], q_y) / step).astype(np.int32)
    both = np.full(q_y.size, 2.0)
    both[[0] if points[1] % 2 else [0, -1]] = 1.0

    def summed(weights: FloatArray) -> FloatArray:
        sums = np.bincount(ring.ravel(), weights.ravel(), minlength=last + 1)
        return np.asarray(sums[1 : last + 1], dtype=np.float64)

    total = summed(power)
    count = summed(np.broadcast_to(both, ring.shape))
    cos = (square_x - square_y) / np.maximum(square_x + square_y, 1e-300)
    sin = 2 * q_x[:, None] * q_y / np.maximum(square_x + square_y, 1e-300)
    second = summed(power * cos) + 1j * summed(power * sin)
    fourth = summed(power * (2 * cos**2 - 1)) + 1j * summed(power * 2 * sin * cos)
    del cos, sin
    number = np.arange(1, last + 1)
    safe = np.where(total > 0, total, 1.0)
    row, column = np.sum(power, axis=1), np.sum(power, axis=0)
    slopes = float(row @ q_x**2), float(column @ square_y)
    half = points[0] // 2
    ahead, back = row[1:half], row[::-1][: half - 1]
    cuts = _cut(ahead + back, size[0]), _cut(column[1 : (points[1] + 1) // 2], size[1])
    return MapSpectrum(
        wavenumber=np.asarray(number * step, dtype=np.float64),
        density=total / (2 * np.pi * number * step**2),
        count=count,
        independent=independent,
        rms_height=float(np.sqrt(np.sum(power))),
        slopes=slopes,
        angular=np.array([second / safe, fourth / safe], dtype=np.complex128),
        cuts=cuts,
    )


def _above_rounding(power: FloatArray) -> NDArray[np.bool_]:
    """Return a mask of the powers above the rounding error, which is proportional to the largest power."""
    return np.asarray(power > EPS * power.max(initial=0.0))


def _cut(power: FloatArray, length: float) -> tuple[FloatArray, FloatArray]:
    """Return the wave numbers and the two-sided C_cut of straight profiles; `power` is summed over q and -q."""
    step = 2 * np.pi / length
    return np.asarray(step * np.arange(1, power.size + 1), dtype=np.float64), power / (2 * step)


def wavenumbers(points: tuple[int, int], size: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return the angular wave numbers, rad/m, along both axes, in the order of `rfft2`."""
    q_x = 2 * np.pi * fft.fftfreq(points[0], size[0] / points[0])
    q_y = 2 * np.pi * fft.rfftfreq(points[1], size[1] / points[1])
    return np.asarray(q_x), np.asarray(q_y)
