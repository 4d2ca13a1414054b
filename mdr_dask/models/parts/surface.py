"""A measured surface as a campaign names it: by its spectrum, by maps or scans of it, or by a line taken as it is."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

from pydantic import Field, ValidationInfo, model_validator

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.base import DataFile, NamedFile, Parameters, Ways, quantity
from mdr_dask.models.parts.measured_line import ProfileFile
from mdr_dask.models.parts.named_by_file import NamedByFile
from mdr_dask.tables import Column, read_table
from mdr_dask.units import shown

if TYPE_CHECKING:
    from mdr_dask.physics.surfaces.spectrum import Spectrum

CUT_ERROR = 0.05  # relative, of every point of a tabulated cut


class Files(NamedByFile):
    """Files of one surface; a bare file name stands for them with all options at their defaults."""

    files: tuple[NamedFile, ...] = Field(
        strict=False, min_length=1, description="one file, or several of the same surface: each realisation takes one"
    )

    def spectra(self) -> tuple[Spectrum, ...]:
        """Return the spectrum C2D of every file; DataError if one has none."""
        raise NotImplementedError


class SpectrumTables(Files):
    """Tables of a spectrum: wave number or wavelength, and C2D, the C1D of the method or the C of a straight cut."""

    def spectra(self) -> tuple[Spectrum, ...]:
        """Return the spectrum C2D of every table."""
        return tuple(map(_tabulated, self.files))


class Surface(Parameters):
    """A measured surface, in place of a generated one."""

    ways: ClassVar[tuple[Ways, ...]] = ((("spectrum",), ("profile",)),)
    spectrum: SpectrumTables | None = Field(default=None, description="table of the spectrum")
    profile: ProfileFile | None = Field(default=None, description="line that is taken as it is")
    longest_wavelength: float | None = quantity("m", "wavelength above which there is no roughness", default=None, gt=0)
    shortest_wavelength: float | None = quantity(
        "m", "wavelength below which there is no roughness", default=None, gt=0
    )
    extrapolate: bool = Field(
        default=False, description="whether the spectrum goes on to these wavelengths by a power law"
    )

    @model_validator(mode="after")
    def _one_kind(self, info: ValidationInfo) -> Surface:
        """Refuse a bad file where a campaign names it, before any case fails of it."""
        self.require_one_way()
        ends = self.longest_wavelength, self.shortest_wavelength
        if self.profile is not None and (self.extrapolate or any(ends)):
            raise ValueError("a profile is taken as it is: give its cut-offs with its file, profile: {file: ...}")
        if self.extrapolate and not any(ends):
            raise ValueError(
                "extrapolate needs longest_wavelength or shortest_wavelength, to which the spectrum goes on"
            )
        if info.context is not None and self.profile is None:
            try:
                spectra_of(self)
            except DataError as problem:
                raise ValueError(str(problem)) from None
        return self

    def notes(self) -> tuple[str, ...]:
        """Return range, rms height and rms gradient of the spectra."""
        return () if self.profile is not None else tuple(map(_statistics, self.measured.files, spectra_of(self)))

    @property
    def measured(self) -> Files:
        """What the spectrum comes from."""
        found: Files | None = self.spectrum
        assert found is not None
        return found


def _statistics(file: DataFile, spectrum: Spectrum) -> str:
    longest, shortest = spectrum.wavelengths
    return (
        f"surface {file.name}: waves of {shown(shortest, 'm')} to {shown(longest, 'm')}, "
        f"rms height {shown(spectrum.rms_height(), 'm')}, rms gradient {spectrum.rms_gradient():.3g}"
    )


def without_exponent(value: Any, surface: str) -> Any:
    """Return the data of a parameter set; where a measured surface is named, no Hurst exponent stands beside it."""
    measured = isinstance(value, dict) and value.get(surface) is not None
    return {"hurst": None, **value} if measured else value


@lru_cache(maxsize=64)
def spectra_of(surface: Surface) -> tuple[Spectrum, ...]:
    """Return the spectra C2D of a surface between its cut-offs, one of each file.

    Raises
    ------
    DataError
        If a file does not hold one, or the cut-offs lie outside of it.
    """
    return tuple(
        _within(surface, spectrum, file)
        for file, spectrum in zip(surface.measured.files, surface.measured.spectra(), strict=True)
    )


def _within(surface: Surface, spectrum: Spectrum, file: DataFile) -> Spectrum:
    """Return a spectrum between the cut-offs."""
    ends = surface.longest_wavelength or 0.0, surface.shortest_wavelength or 0.0
    if surface.extrapolate:
        spectrum = spectrum.continued(*ends)
    longest, shortest = spectrum.wavelengths
    beyond = [
        f"expected {name} of at {'most' if end > longest else 'least'} {longest if end > longest else shortest:.4g} m, "
        f"where the spectrum ends, got {end:.4g} m: `extrapolate: true` goes on by a power law"
        for name, end in zip(("longest_wavelength", "shortest_wavelength"), ends, strict=True)
        if end and not shortest * (1 - 1e-9) <= end <= longest * (1 + 1e-9)
    ]
    if beyond:
        raise DataError("; ".join(f"{file.name}: {sentence}" for sentence in beyond))
    return spectrum.between(*ends)


@lru_cache(maxsize=64)
def lines_of(surface: Surface, length: float, modes: int) -> tuple[FloatArray, ...]:
    """Return the amplitudes, m, of the lines that the method puts in the place of a surface, one of each file.

    Raises
    ------
    DataError
        If the spectrum has no wave that fits the line.
    """
    import numpy as np

    lines = tuple(spectrum.line(length, modes) for spectrum in spectra_of(surface))
    for file, spectrum, line in zip(surface.measured.files, spectra_of(surface), lines, strict=True):
        if not np.any(line):
            longest, shortest = spectrum.wavelengths
            raise DataError(
                f"{file.name}: expected a line with waves of {shortest:.4g} to {longest:.4g} m, "
                f"got {length / modes:.4g} to {length:.4g} m: change length or points"
            )
        line.flags.writeable = False
    return lines


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
    )
    table = read_table(file.read_text(), file.name, columns)
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
