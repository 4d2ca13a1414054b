"""Parameters of a measured line."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field, ValidationInfo, model_validator

from mdr_dask.models.base import quantity
from mdr_dask.models.data_file import NamedByFile, NamedFile, check_in_campaign
from mdr_dask.models.parts.surface_files import SPACING, UNIT, X_UNIT, doubts_of_line, line_of_scan, scan_of
from mdr_dask.units import shown

if TYPE_CHECKING:
    from mdr_dask.physics.surfaces.measured import MeasuredLine


class ProfileFile(NamedByFile):
    """A measured height profile. The user writes only the name of a file, or `file: name` with options."""

    file: NamedFile = Field(
        description='file with the columns "x" and "z"; other formats need the package SurfaceTopography'
    )
    unit: str = UNIT
    x_unit: str = X_UNIT
    spacing: float | None = SPACING
    detrend: Literal["none", "mean", "line", "parabola"] = Field(
        default="mean", description="polynomial that is subtracted from the heights"
    )
    taper: float = quantity(
        "1",
        "fraction of the line in which the heights fade to their mean, so that both ends meet; each end has half of "
        "this fraction",
        default=0.0,
        ge=0,
        le=1,
    )
    shortest_wavelength: float | None = quantity(
        "m", "shortest wavelength of the roughness; shorter waves are removed", usual="10 um", default=None, gt=0
    )
    longest_wavelength: float | None = quantity(
        "m", "longest wavelength of the roughness; longer waves are removed", usual="1 mm", default=None, gt=0
    )

    @model_validator(mode="after")
    def _holds_a_line(self, info: ValidationInfo) -> ProfileFile:
        check_in_campaign(info, lambda: line_of(self))
        return self

    def notes(self) -> tuple[str, ...]:
        """Return notes on points, length, rms height and rms slope of the line, and on how the file was read."""
        from mdr_dask.physics.surfaces.waves import waves_of

        line = line_of(self)
        height, slope = float(line.height.std()), waves_of(line.height).rms_slope() / line.length
        statistics = (
            f"{line.height.size} points, {shown(line.length, 'm')} long, rms height {shown(height, 'm')}, "
            f"rms slope {slope:.3g}"
        )
        remarks = (statistics, *scan_of(self, self.file).remarks, *doubts_of_line(line, self.detrend))
        return tuple(f"profile {self.file.name}: {remark}" for remark in remarks)


def line_of(profile: ProfileFile) -> MeasuredLine:
    """Return one period of the measured line. Raise DataError if the file contains no line."""
    band = profile.shortest_wavelength or 0.0, profile.longest_wavelength or 0.0
    return line_of_scan(profile, profile.file, profile.taper, *band)
