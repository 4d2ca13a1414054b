"""Files of a measured surface (tables, maps and scans), and the computation of a spectrum from each file."""

from __future__ import annotations

from abc import abstractmethod
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from mdr_dask.errors import DataError
from mdr_dask.headings import Column
from mdr_dask.models.base import quantity
from mdr_dask.models.data_file import DataFile, NamedByFile, NamedFile
from mdr_dask.models.parts.height_file import Scan, Units, read_map, read_scan
from mdr_dask.tables import matched, read_head, read_table

if TYPE_CHECKING:
    from mdr_dask.arrays import FloatArray
    from mdr_dask.physics.surfaces.maps import MapSpectrum
    from mdr_dask.physics.surfaces.measured import MeasuredLine
    from mdr_dask.physics.surfaces.spectrum import Spectrum

POINT_ERROR = 0.1  # assumed relative error of each value of a spectrum whose errors are unknown, chosen by trial
# A surface counts as isotropic if its anisotropy does not exceed this value. The slopes along x and y then differ by at
# most about a quarter.
MOST_ANISOTROPY = 0.25

#: Columns of a table that contains a spectrum.
COLUMNS = (
    Column("wavenumber", "rad/m", needed=False, above=0),
    Column("wavelength", "m", needed=False, above=0),
    Column("C2D", "m^4", ("C 2D",), needed=False, above=0),
    Column("C1D", "m^3", ("C 1D",), needed=False, above=0),
    Column("C cut", "m^3", ("cut", "scan spectrum"), needed=False, above=0),
    Column("relative error", "1", needed=False, least=0),
)
KINDS = ("C2D", "C1D", "C cut")
#: Pairs of columns. The first pair that a table contains is used.
WAYS = [(place, kind) for kind in KINDS for place in ("wavenumber", "wavelength")]


class Found(NamedTuple):
    """The spectrum C2D of a surface, limited to the wave numbers in its file.

    `resolution` is the wavelength in m below which there is only noise, or 0 if no noise was found. `error` contains
    the standard errors of log C2D if C2D was fitted to the spectrum of a scan, and is None otherwise.
    """

    spectrum: Spectrum
    resolution: float = 0.0
    remarks: tuple[str, ...] = ()
    error: FloatArray | None = None


class Files(NamedByFile):
    """Files of one surface. If a user writes only the name of a file, all options have their default values."""

    files: tuple[NamedFile, ...] = Field(
        strict=False, min_length=1, description="files of the same surface; each realisation uses one of them"
    )

    @abstractmethod
    def found(self) -> tuple[Found, ...]:
        """Return the spectrum of every file. Raise DataError if a file has no spectrum."""


class SpectrumTables(Files):
    """Tables of a spectrum as a function of the wave number or of the wavelength.

    The spectrum is one of three: C2D of the surface, C1D of the line that replaces the surface in the method of
    dimensionality reduction, or the spectrum of a straight profile.
    """

    def found(self) -> tuple[Found, ...]:
        """Return the spectrum of every table."""
        return tuple(_tabulated(file) for file in self.files)


#: Options of all files with heights.
SPACING = quantity(
    "m",
    "distance between neighbouring points along x, for a file of heights without positions",
    usual="1 um",
    default=None,
    gt=0,
)
UNIT = Field(default="", description="unit of the heights, if the file does not state it")
X_UNIT = Field(default="", description="unit of the positions, if the file does not state it")


class HeightFiles(Files):
    """Files with heights of a surface: line scans or maps."""

    spacing: float | None = SPACING
    unit: str = UNIT
    x_unit: str = X_UNIT
    window: Literal["hann", "none"] = Field(
        default="hann", description="window for the Fourier transform; write none only if the heights are periodic"
    )


class ScanFiles(HeightFiles):
    """Scans of an isotropic surface along straight lines, as a stylus records them."""

    detrend: Literal["none", "mean", "line", "parabola"] = Field(
        default="line", description="polynomial that is subtracted from the heights"
    )

    def found(self) -> tuple[Found, ...]:
        """Return the spectrum of the surface from each scan."""
        return tuple(scanned(self, file) for file in self.files)


class MapFiles(HeightFiles):
    """Areal maps of a surface."""

    spacing_y: float | None = quantity(
        "m", "distance between neighbouring rows, if it differs from `spacing`", usual="1 um", default=None, gt=0
    )
    detrend: Literal["none", "mean", "plane", "parabola"] = Field(
        default="plane", description="polynomial that is subtracted from the heights"
    )
    outliers: Literal["keep", "fill"] = Field(
        default="keep", description="whether heights far from those of their neighbours are kept or replaced"
    )
    direction: Literal["x", "y"] | None = Field(
        default=None,
        description="sliding direction on an anisotropic surface; the rough line is a cut along this direction",
    )

    def found(self) -> tuple[Found, ...]:
        """Return the spectrum of every map."""
        return tuple(mapped(self, file) for file in self.files)


def is_spectrum(text: str) -> bool:
    """Return whether a text begins with a table that has column names of a spectrum.

    If only one column has such a name, the name must have two letters or more.
    """
    try:
        sheet = read_head(text)
    except DataError:
        return False
    if not sheet.names:
        return False
    found = [name for name, (column, *_) in zip(sheet.names, matched(sheet, COLUMNS), strict=True) if column]
    return len(found) > 1 or any(len(name) > 1 for name in found)


@lru_cache(maxsize=64)
def _tabulated(file: DataFile) -> Found:
    from mdr_dask.physics.surfaces.scans import averaged, of_cut
    from mdr_dask.physics.surfaces.spectrum import Spectrum

    table = read_table(file.read_text(), file.name, COLUMNS, allow_missing=True, ways=WAYS)
    kind = next(kind for kind in KINDS if kind in table)
    q = table["wavenumber"] if "wavenumber" in table else 2 * np.pi / table["wavelength"]
    order = np.argsort(q)
    q, density = q[order], table[kind][order]
    error = None
    with file.in_errors():
        if kind == "C cut":
            spectrum, error = of_cut(averaged(q, density, POINT_ERROR**-2))
        else:
            spectrum = Spectrum(q, density / (np.pi * q) if kind == "C1D" else density)
    return Found(spectrum, remarks=(table.remark,) if table.remark else (), error=error)


@lru_cache(maxsize=64)
def scan_of(options: Any, file: DataFile) -> Scan:
    """Return the positions and heights of a scan. `options` has the attributes `unit`, `x_unit` and `spacing`."""
    return read_scan(file, Units(options.unit, options.x_unit, options.spacing))


@lru_cache(maxsize=64)
def line_of_scan(options: Any, file: DataFile, *taper_and_band: float) -> MeasuredLine:
    """Return a scan without its trend as one period of a line.

    `options` has the attribute `detrend` and those that `scan_of` needs. `taper_and_band` are the last three parameters
    of `measured_line`: the taper, and the shortest and the longest wavelength.
    """
    from mdr_dask.physics.surfaces.measured import measured_line

    scan = scan_of(options, file)
    with file.in_errors():
        return measured_line(scan.position, scan.height, options.detrend, *taper_and_band)


def doubts_of_line(line: MeasuredLine, detrend: str) -> tuple[str, ...]:
    """Return warnings if a line may contain the form of the measured part, or if the rms slope exceeds 45 degrees."""
    place = np.linspace(-1, 1, line.height.size)
    level, curved = (line.height - np.polyval(np.polyfit(place, line.height, order), place) for order in (1, 2))
    form = _form(level, curved) if detrend != "parabola" else ()
    return (*form, *_steepness(float(np.sqrt(np.mean(np.diff(line.height) ** 2)) / line.spacing)))


def _form(level: FloatArray, curved: FloatArray) -> tuple[str, ...]:
    """Return a warning if a parabola, perhaps the form of the measured part, explains most of the levelled heights.

    `level` are the heights minus a fitted plane or line. `curved` are the heights minus a fitted parabola.
    """
    square, rest = (float(np.nanmean((height - np.nanmean(height)) ** 2)) for height in (level, curved))
    if not 2 * rest < square:  # the parabola explains most of the mean square height
        return ()
    return (
        f"a parabola explains {100 * (1 - rest / square):.3g} % of the mean square height: this may be the form "
        "of the part (`detrend: parabola` removes it)",
    )


def _steepness(slope: float) -> tuple[str, ...]:
    if not slope > 1:
        return ()
    return (f"rms slope {slope:.3g}, steeper than 45 degrees (are the units of heights and positions right?)",)


@lru_cache(maxsize=64)
def scanned(scans: ScanFiles, file: DataFile) -> Found:
    """Return the spectrum of the surface from one scan, without waves that are only noise."""
    from mdr_dask.physics.surfaces.scans import cut_of_line, of_cut
    from mdr_dask.physics.surfaces.self_affine import noise_limit

    line = line_of_scan(scans, file)
    with file.in_errors():
        cut = cut_of_line(line, scans.window == "hann")
        limit = noise_limit(cut, roughness=-1.0, decades=0.5)
        spectrum, error = of_cut(cut.until(limit))
    remarks = (*scan_of(scans, file).remarks, *doubts_of_line(line, scans.detrend))
    return Found(spectrum, 0.0 if np.isinf(limit) else 2 * np.pi / limit, remarks, error)


@lru_cache(maxsize=16)
def mapped(maps: MapFiles, file: DataFile) -> Found:
    """Return the spectrum of one map, averaged over all directions.

    If the user gives a `direction`, compute the spectrum from profiles along this direction instead.
    """
    from mdr_dask.physics.surfaces.scans import averaged
    from mdr_dask.physics.surfaces.self_affine import noise_limit

    levelled = levelled_map(maps, file)
    rings = levelled.spectrum
    if maps.direction is None:
        spectrum, limit = rings.spectrum(), noise_limit(rings.binned())
    else:
        axis = "xy".index(maps.direction)
        spectrum, limit = rings.along(axis), noise_limit(averaged(*rings.cuts[axis], 1.0), roughness=-1.0)
    return Found(spectrum, 0.0 if np.isinf(limit) else 2 * np.pi / limit, levelled.remarks)


def anisotropic(maps: MapFiles, file: DataFile) -> str:
    """Return the reason why a map has no isotropic spectrum.

    Return an empty string if the map is isotropic, or if the user gives a sliding direction.
    """
    rings = levelled_map(maps, file).spectrum
    if maps.direction is not None or rings.anisotropy() <= MOST_ANISOTROPY:
        return ""
    slopes = " and ".join(f"{np.sqrt(square):.3g}" for square in rings.slopes)
    return (
        f"{file.name}: expected an isotropic surface, got an anisotropy of {rings.anisotropy():.2f} "
        f"(slopes along x and y {slopes}): give the `direction` of sliding, x or y"
    )


class LevelledMap(NamedTuple):
    """A map after its trend has been subtracted.

    `height_rms` and `height_mean` are Sq and Sa of the measured points in m. `spectrum` is computed after
    missing points are filled in and the window is applied.
    """

    height_rms: float
    height_mean: float
    spectrum: MapSpectrum
    remarks: tuple[str, ...]


@lru_cache(maxsize=16)
def levelled_map(maps: MapFiles, file: DataFile) -> LevelledMap:
    """Return height parameters and spectrum of one map."""
    from mdr_dask.physics.surfaces.maps import (
        MOST_MISSING,
        filled,
        outliers,
        require_points,
        spectrum_of_map,
        without_trend,
    )

    surface, remarks = read_map(file, Units(maps.unit, maps.x_unit, maps.spacing, maps.spacing_y))
    with file.in_errors():
        require_points(surface)
        missing = int(np.count_nonzero(~np.isfinite(surface.height)))
        if missing:
            remarks = (*remarks, f"missing points filled: {missing}")
        far = outliers(surface)
        count = int(np.count_nonzero(far))
        if count > MOST_MISSING * far.size:  # so many points are part of the surface and are kept
            share = 100 * count / far.size
            remarks = (*remarks, f"{share:.2g} % of the points are far from their neighbours, too many to be outliers")
        elif count and maps.outliers == "fill":
            surface.height[far] = np.nan
            remarks = (*remarks, f"outliers replaced: {count}")
        elif count:
            remarks = (*remarks, f"outliers (far from their neighbours): {count} (`outliers: fill` replaces them)")
        surface = without_trend(surface, maps.detrend)
        height = surface.height - np.nanmean(surface.height)
        spectrum = spectrum_of_map(filled(surface), maps.window == "hann")
    if maps.detrend != "parabola":
        remarks = (*remarks, *_form(without_trend(surface, "plane").height, without_trend(surface, "parabola").height))
    remarks = (*remarks, *_steepness(spectrum.rms_gradient))
    rms, mean = np.sqrt(np.nanmean(height**2)), np.nanmean(np.abs(height))
    return LevelledMap(float(rms), float(mean), spectrum, remarks)
