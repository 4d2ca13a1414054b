"""Measured lines under friction, and gradients of maps, against references that share no code."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.signal import resample

from benchmarks.accuracy.points import Point, neighbours
from benchmarks.accuracy.sliding import exact, ladder, slow
from benchmarks.measures import timed
from benchmarks.surfaces.punches import areal_surface
from mdr_dask.physics.surfaces.maps import SurfaceMap, spectrum_of_map, wavenumbers
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.spectrum import self_affine
from mdr_dask.physics.surfaces.waves import waves_of

SAMPLES, DEEP, DEBORAH = 128, 0.5, 0.003
#: Hurst exponent, and points of the shortest wave.
MAPS = {"easy: smooth": (0.8, 12), "typical: H = 0.8": (0.8, 4), "hard: H = 0.3, to the grid": (0.3, 2)}


def scans(seed: int) -> dict[str, np.ndarray]:
    """Return lines of samples with an rms height of 1: waves of eight samples and more, noise, steps with spikes."""
    generator = np.random.default_rng(seed)
    noise = generator.standard_normal(SAMPLES)
    waves = np.fft.rfft(noise)
    waves[SAMPLES // 8 :] = 0
    steps = np.repeat(generator.standard_normal(SAMPLES // 16), 16) + 2 * (generator.uniform(size=SAMPLES) < 0.05)
    found = {"easy: smooth": np.fft.irfft(waves), "typical: noise": noise, "hard: steps and spikes": steps}
    return {name: (height - height.mean()) / height.std() for name, height in found.items()}


def measured_lines(short: bool) -> Iterator[Point]:
    """Yield the friction on ten scans of each kind; the reference draws the same Fourier series by scipy."""
    for number, _, faster in neighbours(short):
        for case, height in list(scans(5 + number).items())[: 1 if short else None]:
            line, deborah = RoughLine(waves_of(height)), DEBORAH * 1.5**faster

            def nodes(count, height=height):
                return np.append(drawn := resample(height, count - 1), drawn[0])

            truth = exact(nodes, DEEP, slow.Body(np.empty(0), np.empty(0), deborah), True, short)
            tried = (2, 8, 0.01) if short else (1, 2, 4, 8, 16, 32, 0.1, 0.01, 0.001, 1e-4)
            for found in ladder(line, None, deborah, truth, tried):
                method = "accuracy: auto" if found[0].startswith("auto") else "cubic cells"
                yield Point("measured lines", case, method, *found)


def by_spectrum(height: np.ndarray, hann: bool) -> float:
    """Return the rms gradient of a map of unit size by its spectrum."""
    return float(spectrum_of_map(SurfaceMap(height, (1.0, 1.0)), hann).rms_gradient)


def by_differences(height: np.ndarray) -> float:
    """Return the rms gradient by differences of neighbours."""
    steps = [np.diff(height, axis=axis) * height.shape[axis] for axis in (0, 1)]
    return float(np.sqrt(sum(np.mean(each**2) for each in steps)))


def maps(short: bool) -> Iterator[Point]:
    """Yield the rms gradient of periodic maps, and of their quarters, against the sum over waves."""
    methods = {
        "spectrum": lambda height: by_spectrum(height, False),
        "spectrum of a quarter, windowed": lambda height: (
            2 * by_spectrum(height[: len(height) // 2, : len(height) // 2], True)
        ),
        "differences": by_differences,
    }
    for case, (hurst, shortest) in list(MAPS.items())[: 1 if short else None]:
        for points in (64, 128) if short else (128, 256, 512, 1024):
            spectrum = self_affine(hurst, 1 / 4, shortest / points)
            heights = [areal_surface(spectrum, (points, points), (1.0, 1.0), 3, index) for index in range(3)]
            q = np.hypot(*np.meshgrid(*wavenumbers((points, points), (1.0, 1.0)), indexing="ij"))
            power = (2 * np.pi * q) ** 2 * spectrum.at(q)
            truth = np.sqrt(power.sum() + power[:, 1:-1].sum())
            for method, gradient in methods.items():
                gradient(heights[0])
                values, seconds = zip(*(timed(gradient, height) for height in heights), strict=True)
                error = max(float(np.sqrt(np.mean((np.array(values) / truth - 1) ** 2))), 1e-16)
                yield Point("surfaces", case, method, f"{points} x {points}", min(seconds), error)
