"""Report on each file of a measured surface: heights, slopes, spectra, fitted power law, resolution."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.models.data_file import DataFile
from mdr_dask.models.parts.surface import Surface
from mdr_dask.models.parts.surface_files import (
    POINT_ERROR,
    Found,
    MapFiles,
    ScanFiles,
    anisotropic,
    levelled_map,
    line_of_scan,
)
from mdr_dask.physics.surfaces.scans import Cut, averaged, cut_of_line, hann_window
from mdr_dask.physics.surfaces.self_affine import SelfAffine, fit_self_affine, steep_limit
from mdr_dask.physics.surfaces.waves import waves_of

if TYPE_CHECKING:
    from mdr_dask.physics.surfaces.spectrum import Spectrum

UNITS = {
    "file": "",
    "Sq": "m",
    "Sa": "m",
    "Pq": "m",
    "rms_gradient": "1",
    "slope_x": "1",
    "slope_y": "1",
    "anisotropy": "1",
    "hurst": "1",
    "hurst_low": "1",
    "hurst_high": "1",
    "rolloff": "m",
    "rolloff_low": "m",
    "rolloff_high": "m",
    "cutoff": "m",
    "cutoff_low": "m",
    "cutoff_high": "m",
    "resolution": "m",
    "length": "m",
}
"""Columns of a report and their units. A value is NaN if a file does not determine the quantity.

* Sq and Sa: rms height and mean absolute height of the levelled map. Pq: rms height of the levelled profile. Sq, Sa and
Pq are computed without a window. Slopes, anisotropy and the gradient of a map are computed from the windowed heights.
The gradient of any other file is computed from its spectrum C2D.
* hurst, rolloff and cutoff: Hurst exponent, longest and shortest wavelength of the fitted power law, each with the ends
of its 95 % confidence interval (`_low` and `_high`).
* resolution: shortest wavelength that is not only noise, or shortest wavelength of the spectrum if no noise was found.
length: longest wavelength of a map, length of a profile.
"""


class FileReport(NamedTuple):
    """Report on one file.

    `row` contains a value for each name in `UNITS`. `bins` contains wave numbers, C2D and the standard error of log
    C2D. `cuts` contains the wave numbers and the power spectrum, in m^3, of straight profiles. The key is "x" or "y",
    the direction of the profiles. A table of a spectrum has no `cuts`. `law` is the fitted power law, or None if no
    power law fits, or if a map is anisotropic and the user gives no direction.
    """

    file: DataFile
    row: dict[str, float | str]
    found: Found
    bins: Cut
    cuts: dict[str, tuple[FloatArray, FloatArray]]
    law: SelfAffine | None


def reports(surface: Surface) -> tuple[FileReport, ...]:
    """Return a report on each file of a surface. Raise DataError if a file cannot be read."""
    measured = surface.measured
    return tuple(_report(surface, file, found) for file, found in zip(measured.files, measured.found(), strict=True))


def _report(surface: Surface, file: DataFile, found: Found) -> FileReport:
    row: dict[str, float | str] = {name: float("nan") for name in UNITS} | {"file": file.name}
    row |= {"rms_gradient": found.spectrum.rms_gradient()}
    cuts: dict[str, tuple[FloatArray, FloatArray]] = {}
    if found.error is None:
        bins = averaged(found.spectrum.wavenumber, found.spectrum.density, POINT_ERROR**-2)
    else:  # the last wave number is beyond the data
        bins = Cut(*(column[:-1] for column in (found.spectrum.wavenumber, found.spectrum.density, found.error)))
    if surface.map is not None:
        bins, cuts = _of_map(surface.map, file, row, bins)
    elif surface.scan is not None:
        cuts = _of_scan(surface.scan, file, row)
    end = 2 * np.pi / found.resolution if found.resolution else np.inf
    isotropic = surface.map is None or not anisotropic(surface.map, file)
    law = fit_self_affine(bins.until(min(end, steep_limit(bins)))) if isotropic else None
    row["resolution"] = found.resolution or found.spectrum.wavelengths[1]
    if law is not None:
        for name, interval in (("hurst", law.hurst), ("rolloff", law.longest), ("cutoff", law.shortest)):
            if interval is not None:
                row |= dict(zip((name, f"{name}_low", f"{name}_high"), interval, strict=True))
    return FileReport(file, row, found, bins, cuts, law)


def _of_map(
    maps: MapFiles, file: DataFile, row: dict[str, float | str], bins: Cut
) -> tuple[Cut, dict[str, tuple[FloatArray, FloatArray]]]:
    levelled = levelled_map(maps, file)
    rings = levelled.spectrum
    slopes = np.sqrt(rings.slopes)
    row |= {"Sq": levelled.height_rms, "Sa": levelled.height_mean, "rms_gradient": rings.rms_gradient}
    row |= {"slope_x": float(slopes[0]), "slope_y": float(slopes[1]), "anisotropy": rings.anisotropy()}
    row |= {"length": 2 * np.pi / float(rings.wavenumber[0])}
    return rings.binned() if maps.direction is None else bins, dict(zip("xy", rings.cuts, strict=True))


def _of_scan(scans: ScanFiles, file: DataFile, row: dict[str, float | str]) -> dict[str, tuple[FloatArray, FloatArray]]:
    line = line_of_scan(scans, file)
    cut = cut_of_line(line, scans.window == "hann")
    slope = waves_of(line.height * hann_window(line.height.size)).rms_slope() / line.length
    row |= {"Pq": float(line.height.std()), "slope_x": slope, "length": line.length}
    return {"x": (cut.wavenumber, cut.density)}


def mean_spectrum(spectra: tuple[Spectrum, ...]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the wave numbers of the first spectrum, the mean spectrum, and the relative standard error of the mean.

    At each wave number, the mean includes only the spectra whose range contains this wave number. If there is only
    one such spectrum, the standard error is NaN.
    """
    q = spectra[0].wavenumber
    each = np.array([spectrum.at(q) for spectrum in spectra])
    there = each > 0
    count = there.sum(axis=0)
    mean = each.sum(axis=0) / count
    with np.errstate(all="ignore"):
        scatter = np.sqrt(np.sum(np.where(there, each - mean, 0.0) ** 2, axis=0) / (count - 1) / count) / mean
    return q, mean, np.where(count > 1, scatter, np.nan)
