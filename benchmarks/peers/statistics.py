"""Compare statistics of lines and maps with those of SurfaceTopography."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from benchmarks.peers import OURS, installed
from benchmarks.rows import Row, timed_in_turns
from benchmarks.surfaces.punches import areal_surface
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces.maps import SurfaceMap, spectrum_of_map, wavenumbers
from mdr_dask.physics.surfaces.spectrum import self_affine
from mdr_dask.physics.surfaces.waves import series, waves_of

POINTS, SIDE, HURST = 2**16, 512, 0.8
#: Numbers of points per shortest wavelength.
SHORTEST = {"smooth": 8, "to the grid": 2}


def lines(shortest: int) -> tuple[np.ndarray, float]:
    """Return a line of unit length, and its exact rms slope from the amplitudes."""
    modes = POINTS // shortest - (shortest == 2)
    amplitude = roughness.amplitudes(modes, HURST)
    height = series(0.5 * amplitude * np.exp(1j * roughness.phases(1, 0, modes)), POINTS)
    q = 2 * np.pi * np.arange(1, modes + 1)
    return height, float(np.sqrt(np.sum((amplitude * q) ** 2) / 2))


def maps(shortest: int) -> tuple[np.ndarray, float]:
    """Return a map of unit size, and its exact rms gradient from the amplitudes."""
    spectrum = self_affine(HURST, 1.0, shortest / SIDE)
    height = areal_surface(spectrum, (SIDE, SIDE), (1.0, 1.0), 1, 0)
    q = np.hypot(*np.meshgrid(*wavenumbers((SIDE, SIDE), (1.0, 1.0)), indexing="ij"))
    power = (2 * np.pi * q) ** 2 * spectrum.at(q)
    power[:, 1:-1] *= 2
    return height, float(np.sqrt(power.sum()))


def of_line(height):
    waves = waves_of(height)
    return height.std(), waves.rms_slope(), np.abs(waves.coefficients) ** 2


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
    """Yield rows with the error of the rms slope or gradient, and the time for height, slope and spectrum."""
    name = installed("SurfaceTopography")
    for what, made, ours, theirs in (("line", lines, of_line, peer_of_line), ("map", maps, of_map, peer_of_map)):
        for waves, shortest in SHORTEST.items():
            height, truth = made(shortest)
            methods = {OURS: partial(ours, height)} | ({name: partial(theirs, height)} if name else {})
            for method, (values, seconds) in timed_in_turns(methods, 3).items():
                error = max(abs(values[1] / truth - 1), 1e-16)
                yield Row("statistics of surfaces", f"{what}, {waves}", method, "", 1, seconds, float(error))
