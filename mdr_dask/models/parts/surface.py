"""A measured surface of a campaign, given by a spectrum, by maps, by scans, or by a profile that is itself the line."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pydantic import Field, ValidationInfo, model_validator

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.base import Alternatives, Parameters, quantity
from mdr_dask.models.data_file import DataFile, check_in_campaign
from mdr_dask.models.parts.measured_line import ProfileFile
from mdr_dask.models.parts.surface_files import Files, Found, MapFiles, ScanFiles, SpectrumTables, anisotropic
from mdr_dask.units import shown

if TYPE_CHECKING:
    from mdr_dask.physics.surfaces.spectrum import Spectrum


NO_AREA = "contact length of the line, not the contact area of a rough surface (docs/validity.md)"
NO_GAP = "approach of the line, not the mean separation or the gaps of a rough surface (docs/validity.md)"


class Surface(Parameters):
    """A measured surface, in place of a generated one."""

    alternatives: ClassVar[tuple[Alternatives, ...]] = ((("spectrum",), ("map",), ("scan",), ("profile",)),)
    spectrum: SpectrumTables | None = Field(default=None, description="table with the power spectrum of the surface")
    map: MapFiles | None = Field(default=None, description="map of heights z(x, y)")
    scan: ScanFiles | None = Field(
        default=None, description="height profile along a straight line on an isotropic surface; its spectrum is used"
    )
    profile: ProfileFile | None = Field(
        default=None, description="height profile that is itself used as the rough line"
    )
    longest_wavelength: float | None = quantity(
        "m", "longest wavelength of the roughness; longer waves are removed", usual="1 mm", default=None, gt=0
    )
    shortest_wavelength: float | None = quantity(
        "m", "shortest wavelength of the roughness; shorter waves are removed", usual="10 um", default=None, gt=0
    )
    extrapolate: bool = Field(
        default=False,
        description="whether a power law extends the spectrum to longest_wavelength and shortest_wavelength",
    )

    @model_validator(mode="after")
    def _one_kind(self, info: ValidationInfo) -> Surface:
        """Raise an error for wrong parameters or an unusable file when the campaign is read, before any computation."""
        self.require_one_alternative()
        ends = self.longest_wavelength, self.shortest_wavelength
        if self.profile is not None and (self.extrapolate or any(ends)):
            raise ValueError(
                "a profile has its own options shortest_wavelength and longest_wavelength, but no `extrapolate`: "
                "write profile: {file: ..., shortest_wavelength: ...}"
            )
        if self.extrapolate and not any(ends):
            raise ValueError(
                "`extrapolate` needs longest_wavelength or shortest_wavelength, up to which the spectrum is continued"
            )
        if info.context is not None and self.profile is None:
            check_in_campaign(info, lambda: spectra_of(self))
            if "describe" not in info.context and (reasons := self.without_spectrum()):
                raise ValueError("\n".join(reasons))
        return self

    def without_spectrum(self) -> tuple[str, ...]:
        """Return the reason for each map that is not isotropic, unless the user gives the direction of sliding."""
        if self.map is None:
            return ()
        return tuple(reason for file in self.map.files if (reason := anisotropic(self.map, file)))

    def notes(self) -> tuple[str, ...]:
        """Return notes on the wavelengths, the rms height and the rms gradient of each spectrum, and on its file.

        Return () for a profile, which has its own notes.
        """
        if self.profile is not None:
            return ()
        spectra = zip(self.measured.files, self.measured.found(), spectra_of(self), strict=False)
        return tuple(note for file, found, spectrum in spectra for note in _notes(self, file, found, spectrum))

    @property
    def measured(self) -> Files:
        """The files from which the spectrum is computed."""
        found: Files | None = self.spectrum or self.map or self.scan
        assert found is not None
        return found


def _notes(surface: Surface, file: DataFile, found: Found, spectrum: Spectrum) -> tuple[str, ...]:
    longest, shortest = spectrum.wavelengths
    statistics = (
        f"spectrum of the line: wavelengths {shown(shortest, 'm')} to {shown(longest, 'm')}, "
        f"rms height {shown(spectrum.rms_height(), 'm')}, rms gradient {spectrum.rms_gradient():.3g}"
    )
    if surface.map is not None and (reason := anisotropic(surface.map, file)):
        return (*(f"surface {file.name}: {remark}" for remark in found.remarks), f"surface {reason}")
    notes = [statistics, *found.remarks]
    if found.resolution:
        noise = f"wavelengths below {shown(found.resolution, 'm')} contain only noise"
        if surface.shortest_wavelength is None:
            whole = found.spectrum
            height = 1 - (spectrum.rms_height() / whole.rms_height()) ** 2
            gradient = 1 - (spectrum.rms_gradient() / whole.rms_gradient()) ** 2
            parts = (
                f"{100 * height:.2g} % of the mean square height and {100 * gradient:.2g} % of the mean square gradient"
            )
            notes.insert(1, f"{noise}; leaving them out removes {parts}")
        elif surface.shortest_wavelength < found.resolution:
            notes.insert(1, noise)
    return tuple(f"surface {file.name}: {note}" for note in notes)


def without_exponent(value: Any, surface: str) -> Any:
    """Add ``hurst: None`` to a copy of the parameters `value` if they contain a measured surface but no `hurst`.

    `surface` is the name of the parameter that contains the surface. Without a measured surface, `value` is returned
    unchanged, because the default of `hurst` is for generated roughness.
    """
    measured = isinstance(value, dict) and value.get(surface) is not None
    return {"hurst": None, **value} if measured else value


@lru_cache(maxsize=64)
def spectra_of(surface: Surface) -> tuple[Spectrum, ...]:
    """Return the spectrum C2D of each file of a surface, between the cut-off wavelengths."""
    return tuple(
        _within(surface, found, file)
        for file, found in zip(surface.measured.files, surface.measured.found(), strict=False)
    )


def _within(surface: Surface, found: Found, file: DataFile) -> Spectrum:
    """Return a spectrum between the cut-off wavelengths.

    Without `shortest_wavelength`, the spectrum ends where noise begins. Raise DataError if a given cut-off wavelength
    lies outside the spectrum.
    """
    spectrum = found.spectrum
    ends = surface.longest_wavelength or 0.0, surface.shortest_wavelength or 0.0
    if surface.extrapolate:
        spectrum = spectrum.continued(*ends)
    longest, shortest = spectrum.wavelengths
    beyond = []
    for name, end in zip(("longest_wavelength", "shortest_wavelength"), ends, strict=True):
        if end and not shortest * (1 - 1e-9) <= end <= longest * (1 + 1e-9):
            limit = f"most {shown(longest, 'm', 9)}" if end > longest else f"least {shown(shortest, 'm', 9)}"
            beyond.append(
                f"{file.name}: expected {name} of at {limit}, where the spectrum ends, got {shown(end, 'm', 9)} "
                "(`extrapolate: true` continues the spectrum by a power law)"
            )
    if beyond:
        raise DataError("; ".join(beyond))
    return spectrum.between(ends[0], ends[1] or min(found.resolution, longest))


@lru_cache(maxsize=64)
def lines_of(surface: Surface, length: float, modes: int) -> tuple[FloatArray, ...]:
    """Return the amplitudes, in m, of the lines that replace a surface in the method of dimensionality reduction (MDR).

    There is one line for each file of the surface. Raise DataError if the spectrum of a file has no waves that fit the
    line.
    """
    lines = tuple(spectrum.line(length, modes) for spectrum in spectra_of(surface))
    for file, spectrum, line in zip(surface.measured.files, spectra_of(surface), lines, strict=False):
        if not np.any(line):
            ends = (*spectrum.wavelengths, length, length / modes)
            most, least, last, first = (shown(end, "m", 9) for end in ends)
            raise DataError(
                f"{file.name}: expected wavelengths of the line in the range {least} to {most}, got {first} to {last}: "
                "change `length` or `points`"
            )
        line.flags.writeable = False
    return lines
