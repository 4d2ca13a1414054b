"""Files of a measured surface, and the spectrum of each: tables, maps and scans."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from pydantic import Field

from mdr_dask.errors import DataError
from mdr_dask.models.base import quantity
from mdr_dask.models.data_file import DataFile, NamedFile
from mdr_dask.models.parts.measured_line import recorded
from mdr_dask.models.parts.named_by_file import NamedByFile
from mdr_dask.models.parts.topography import TEXT, topography
from mdr_dask.tables import Column, read_table
from mdr_dask.units import to_si

if TYPE_CHECKING:
    from mdr_dask.physics.surfaces.maps import MapSpectrum, SurfaceMap
    from mdr_dask.physics.surfaces.measured import MeasuredLine
    from mdr_dask.physics.surfaces.scans import Cut
    from mdr_dask.physics.surfaces.spectrum import Spectrum

CUT_ERROR = 0.05  # relative, of every point of a tabulated cut
MOST_ANISOTROPY = 0.25  # slopes in two directions that differ by more than a fifth
STRIPES = 10.0  # times the power of an isotropic surface, in waves along an axis

Window = Literal["hann", "none"]


class Found(NamedTuple):
    """The spectrum of a file.

    Parameters
    ----------
    spectrum : Spectrum
        C2D, as far as the points go.
    resolution : float
        Wavelength, m, below which there is noise and no roughness; 0 if none was found.
    remarks : tuple of str
        What was found and done: missing points, outliers, stripes.
    """

    spectrum: Spectrum
    resolution: float = 0.0
    remarks: tuple[str, ...] = ()


class Files(NamedByFile):
    """Files of one surface; a bare file name stands for them with all options at their defaults."""

    files: tuple[NamedFile, ...] = Field(
        strict=False, min_length=1, description="one file, or several of the same surface: each realisation takes one"
    )

    def found(self) -> tuple[Found, ...]:
        """Return the spectrum of every file; DataError if one has none."""
        raise NotImplementedError


class SpectrumTables(Files):
    """Tables of a spectrum: wave number or wavelength, and C2D, the C1D of the method or the C of a straight cut."""

    def found(self) -> tuple[Found, ...]:
        """Return the spectrum of every table."""
        return tuple(Found(_tabulated(file)) for file in self.files)


class ScanFiles(Files):
    """Scans of an isotropic surface, as a stylus records them: straight cuts."""

    unit: str = Field(default="", description="unit of both columns, where the file does not say")
    detrend: Literal["none", "mean", "line", "parabola"] = Field(default="line", description="polynomial subtracted")
    window: Window = Field(default="hann", description="window of each scan; none only if it closes")

    def found(self) -> tuple[Found, ...]:
        """Return the spectrum of the surface that each scan cuts."""
        return tuple(scanned(self, file) for file in self.files)


class MapFiles(Files):
    """Areal maps of a surface."""

    spacing: float | None = quantity("m", "distance of points, of text and npy", default=None, gt=0)
    spacing_y: float | None = quantity("m", "distance of lines where it is another", default=None, gt=0)
    unit: str = Field(default="", description="unit of the heights, where the file does not say")
    detrend: Literal["none", "mean", "plane", "parabola"] = Field(default="plane", description="polynomial subtracted")
    window: Window = Field(default="hann", description="window of the map; none only if it is periodic")
    outliers: Literal["keep", "fill"] = Field(
        default="keep", description="what becomes of points that stick out of their neighbours"
    )
    direction: Literal["x", "y"] | None = Field(
        default=None, description="of sliding over an anisotropic surface: the line is the cut along it"
    )

    def found(self) -> tuple[Found, ...]:
        """Return the spectrum of every map."""
        return tuple(mapped(self, file) for file in self.files)


@lru_cache(maxsize=64)
def _tabulated(file: DataFile) -> Spectrum:
    """Return the spectrum of a table."""
    import numpy as np

    from mdr_dask.physics.surfaces.scans import averaged, of_cut
    from mdr_dask.physics.surfaces.spectrum import Spectrum

    columns = (
        Column("wavenumber", "rad/m", ("q", "k", "wave number", "wavevector"), needed=False, above=0),
        Column("wavelength", "m", ("lambda", "λ"), needed=False, above=0),
        Column("C2D", "m^4", ("C 2D", "C_iso", "areal spectrum"), needed=False, above=0),
        Column("C1D", "m^3", ("C 1D", "line spectrum"), needed=False, above=0),
        Column("C cut", "m^3", ("cut", "C_cut", "scan spectrum"), needed=False, above=0),
        Column("relative error", "1", needed=False, least=0),
    )
    table = read_table(file.read_text(), file.name, columns, allow_missing=True)
    places = [name for name in ("wavenumber", "wavelength") if name in table]
    kinds = [name for name in ("C2D", "C1D", "C cut") if name in table]
    problems = [
        f"{file.name}: expected one column of {wanted}, got {' and '.join(found) or 'none'}"
        for wanted, found in (("wavenumber and wavelength", places), ("C2D, C1D and C cut", kinds))
        if len(found) != 1
    ]
    if problems:
        raise DataError("\n".join(problems))
    q = table["wavenumber"] if "wavenumber" in table else 2 * np.pi / table["wavelength"]
    order = np.argsort(q)
    q, density = q[order], table[kinds[0]][order]
    try:
        if kinds == ["C cut"]:
            return of_cut(averaged(q, density, CUT_ERROR**-2))
        return Spectrum(q, density / (np.pi * q) if kinds == ["C1D"] else density)
    except DataError as problem:
        raise DataError(f"{file.name}: {problem}") from None


@lru_cache(maxsize=64)
def line_of_scan(scans: ScanFiles, file: DataFile) -> MeasuredLine:
    """Return a scan without its trend."""
    from mdr_dask.physics.surfaces.measured import measured_line

    x, z = recorded(file, scans.unit)
    try:
        return measured_line(x, z, scans.detrend)
    except DataError as problem:
        raise DataError(f"{file.name}: {problem}") from None


@lru_cache(maxsize=64)
def scanned(scans: ScanFiles, file: DataFile) -> Found:
    """Return the spectrum of the surface that a scan cuts."""
    from mdr_dask.physics.surfaces.scans import cut_of_lines

    line = line_of_scan(scans, file)  # names the file itself
    try:
        return of_surface_cut(cut_of_lines([line], scans.window == "hann"))
    except DataError as problem:
        raise DataError(f"{file.name}: {problem}") from None


def of_surface_cut(cut: Cut) -> Found:
    """Return the spectrum of the surface whose cut this is, as far as it is no noise."""
    import numpy as np

    from mdr_dask.physics.surfaces.scans import NOISE_SLOPE, NOISE_TAIL, of_cut
    from mdr_dask.physics.surfaces.self_affine import noise_limit

    limit = noise_limit(cut, NOISE_SLOPE, NOISE_TAIL)
    return Found(of_cut(cut.until(limit)), 0.0 if np.isinf(limit) else 2 * np.pi / limit)


@lru_cache(maxsize=16)
def mapped(maps: MapFiles, file: DataFile) -> Found:
    """Return the spectrum of one map.

    Raises
    ------
    DataError
        If the file holds no map, or an anisotropic one and no direction is named.
    """
    import numpy as np

    from mdr_dask.physics.surfaces.scans import NOISE_SLOPE, averaged
    from mdr_dask.physics.surfaces.self_affine import noise_limit

    found, remarks = rings_of(maps, file)
    stripes = [name for name, power in zip("xy", found.axes, strict=True) if power > STRIPES]
    told = f", and waves along {' and '.join(stripes)} stick out: steps or scan lines?" if stripes else ""
    if maps.direction is None and found.anisotropy() > MOST_ANISOTROPY:
        slopes = " and ".join(f"{np.sqrt(square):.3g}" for square in found.slopes[:2])
        raise DataError(
            f"{file.name}: expected an isotropic surface, got an anisotropy of {found.anisotropy():.2f} "
            f"(slopes along x and y {slopes}){told}: name the `direction` of sliding, x or y"
        )
    if maps.direction is None:
        spectrum, limit = found.spectrum(), noise_limit(found.binned())
    else:
        spectrum = found.along("xy".index(maps.direction))
        limit = noise_limit(averaged(spectrum.wavenumber, spectrum.density, 1.0), NOISE_SLOPE - 1)
    resolution = 0.0 if np.isinf(limit) else 2 * np.pi / limit
    return Found(spectrum, resolution, (*remarks, told.removeprefix(", and ")) if told else remarks)


@lru_cache(maxsize=16)
def rings_of(maps: MapFiles, file: DataFile) -> tuple[MapSpectrum, tuple[str, ...]]:
    """Return the spectrum of one map in rings, and what was done with its points."""
    import numpy as np

    from mdr_dask.physics.surfaces.maps import filled, outliers, spectrum_of_map, without_trend

    surface = read_map(file, maps)
    remarks = []
    far = int(np.count_nonzero(stick_out := outliers(surface)))
    if far and maps.outliers == "fill":
        surface.height[stick_out] = np.nan
        told = "1 point stuck out of its" if far == 1 else f"{far} points stuck out of their"
        remarks.append(f"{told} neighbours and {'was' if far == 1 else 'were'} filled")
    elif far:
        told = "1 point sticks out of its" if far == 1 else f"{far} points stick out of their"
        remarks.append(f"{told} neighbours: `outliers: fill` takes {'it' if far == 1 else 'them'} out")
    missing = int(np.count_nonzero(~np.isfinite(surface.height)))
    if missing and not (far and maps.outliers == "fill"):
        remarks.append("1 missing point was filled" if missing == 1 else f"{missing} missing points were filled")
    try:
        surface = without_trend(filled(surface), maps.detrend)
        return spectrum_of_map(surface, maps.window == "hann"), tuple(remarks)
    except DataError as problem:
        raise DataError(f"{file.name}: {problem}") from None


def read_map(file: DataFile, maps: MapFiles) -> SurfaceMap:
    """Return the heights of a map in m, NaN where points are missing.

    Rows of text and npy run along x, one below the other along y. Other formats, and text without a spacing, are read
    by SurfaceTopography.
    """
    import numpy as np

    from mdr_dask.physics.surfaces.maps import SurfaceMap

    name = file.name.lower()
    if not name.endswith(".npy") and (maps.spacing is None or not name.endswith(TEXT)):
        surface, metre = topography(file, maps.unit)
        if surface.dim != 2:
            raise DataError(f"{file.name}: expected a map, got a line scan: name it by surface: {{scan: ...}}")
        height = np.ma.filled(surface.heights(), np.nan) * metre
        return SurfaceMap(
            np.asarray(height, dtype=np.float64), tuple(length * metre for length in surface.physical_sizes)
        )
    if maps.spacing is None:
        raise DataError(f"{file.name}: does not say its spacing: give `spacing`, such as 1 um")
    if not maps.unit:
        raise DataError(f"{file.name}: does not say the unit of its heights: give `unit`, such as um")
    try:
        metre = to_si(f"1 {maps.unit}", "m")
    except ValueError as error:
        raise DataError(f"{file.name}: unit: {error}") from None
    rows = _array(file) if name.endswith(".npy") else _matrix(file)
    if rows.ndim != 2:
        raise DataError(f"{file.name}: expected rows and columns of heights, got {rows.ndim} dimensions")
    size = rows.shape[1] * maps.spacing, rows.shape[0] * (maps.spacing_y or maps.spacing)
    return SurfaceMap(np.ascontiguousarray(rows.T, dtype=np.float64) * metre, size)


def _array(file: DataFile) -> Any:
    """Return the heights of a file of numpy; masked and missing points are NaN."""
    import io

    import numpy as np

    try:
        array = np.load(io.BytesIO(file.read_bytes()), allow_pickle=False)
    except (ValueError, EOFError, OSError) as problem:
        raise DataError(f"{file.name}: expected an array of numpy: {problem}") from None
    if array.dtype.kind not in "iuf":
        raise DataError(f"{file.name}: expected heights, got numbers of the type {array.dtype}")
    return array


def _matrix(file: DataFile) -> Any:
    """Return the heights of a text: rows of numbers; decimal commas, remarks and missing entries are understood."""
    import io

    import numpy as np

    text = file.read_text()
    first = next((line for line in text.splitlines() if line.strip() and line.lstrip()[0] not in "#%"), "")
    separator = next((mark for mark in ("\t", ";") if mark in first), None)
    words = first.split()
    if separator is None and "," in first and (len(words) == 1 or words[0].endswith(",")):
        separator = ","
    elif "," in first:
        text = text.replace(",", ".")
    try:
        return np.loadtxt(io.StringIO(text), delimiter=separator, comments=("#", "%"), ndmin=2)
    except ValueError as problem:
        raise DataError(f"{file.name}: expected rows of heights of one length: {problem}") from None
