"""Statistics of lines and maps beside SurfaceTopography."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.peers import OURS, installed
from benchmarks.rows import Row, timed_in_turns
from benchmarks.surfaces.punches import areal_surface
from mdr_dask.physics.surfaces import measured, roughness
from mdr_dask.physics.surfaces.maps import SurfaceMap, spectrum_of_map, wavenumbers
from mdr_dask.physics.surfaces.spectrum import self_affine
from mdr_dask.physics.surfaces.waves import waves_of

POINTS, SIDE, HURST = 2**16, 512, 0.8
#: Points of the shortest wave.
SHORTEST = {"smooth": 8, "to the grid": 2}


def lines(shortest: int) -> tuple[np.ndarray, dict[str, float]]:
    """Return a line of unit length, with its rms height and slope from the amplitudes."""
    modes = POINTS // shortest - (shortest == 2)
    amplitude = roughness.amplitudes(modes, HURST)
    height = roughness.line(amplitude, roughness.phases(1, 0, modes), POINTS)
    q = 2 * np.pi * np.arange(1, modes + 1)
    powers = {"rms height": amplitude, "rms slope": amplitude * q}
    return height, {name: float(np.sqrt(np.sum(each**2) / 2)) for name, each in powers.items()}


def maps(shortest: int) -> tuple[np.ndarray, dict[str, float]]:
    """Return a map of unit size, with its rms height and gradient from the amplitudes."""
    spectrum = self_affine(HURST, 1.0, shortest / SIDE)
    height = areal_surface(spectrum, (SIDE, SIDE), (1.0, 1.0), 1, 0)
    q = np.hypot(*np.meshgrid(*wavenumbers((SIDE, SIDE), (1.0, 1.0)), indexing="ij"))
    power = (2 * np.pi) ** 2 * spectrum.at(q)
    power[:, 1:-1] *= 2
    return height, {"rms height": float(np.sqrt(power.sum())), "rms gradient": float(np.sqrt((power * q**2).sum()))}


def of_line(height):
    waves = waves_of(height)
    return measured.rms_height(height), waves.rms_slope(), np.abs(waves.coefficients) ** 2


def of_map(height):
    found = spectrum_of_map(SurfaceMap(height, (1.0, 1.0)), hann=False)
    return found.rms_height, found.rms_gradient, found.wavenumber, found.density


def peer_of_line(height):
    from SurfaceTopography import UniformLineScan

    scan = UniformLineScan(height, 1.0, periodic=True)
    rms = scan.rms_height_from_profile(), scan.rms_slope_from_profile()
    return *rms, *scan.power_spectrum_from_profile(window="None")


def peer_of_map(height):
    from SurfaceTopography import Topography

    found = Topography(height, (1.0, 1.0), periodic=True)
    rms = found.rms_height_from_area(), found.rms_gradient()
    return *rms, *found.power_spectrum_from_area(window="None")


def compared() -> Iterator[Row]:
    """Yield the error of height and slope, with the time of both and of the spectrum."""
    name = installed("SurfaceTopography")
    for what, made, ours, theirs in (("line", lines, of_line, peer_of_line), ("map", maps, of_map, peer_of_map)):
        for waves, shortest in SHORTEST.items():
            height, truth = made(shortest)
            methods = {OURS: lambda h=height, ours=ours: ours(h)}
            if name:
                methods[name] = lambda h=height, theirs=theirs: theirs(h)
            found = timed_in_turns(methods, 3)
            for place, (quantity, known) in enumerate(truth.items()):
                for method, (values, seconds) in found.items():
                    error = max(abs(values[place] / known - 1), 1e-16)
                    yield Row("statistics of surfaces", f"{what}, {waves}: {quantity}", method, "", 1, seconds, error)
