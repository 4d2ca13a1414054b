"""A measured line as a campaign names it."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from pydantic import Field, ValidationInfo, model_validator

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.base import quantity
from mdr_dask.models.data_file import DataFile, NamedFile
from mdr_dask.models.parts.named_by_file import NamedByFile
from mdr_dask.models.parts.topography import TEXT, topography
from mdr_dask.tables import Column, read_table
from mdr_dask.units import shown

if TYPE_CHECKING:
    from mdr_dask.physics.surfaces.measured import MeasuredLine


class ProfileFile(NamedByFile):
    """A measured line; a bare file name stands for it with all options at their defaults."""

    file: NamedFile = Field(
        description="two columns x, z; other formats are read by SurfaceTopography if it is installed"
    )
    unit: str = Field(default="", description="unit of both columns, where the file does not say")
    detrend: Literal["none", "mean", "line", "parabola"] = Field(default="mean", description="polynomial subtracted")
    taper: float = quantity("1", "part of the line brought to its mean so that it closes", default=0.0, ge=0, le=1)
    shortest_wavelength: float | None = quantity(
        "m", "wavelength below which there is no roughness", default=None, gt=0
    )
    longest_wavelength: float | None = quantity("m", "wavelength above which there is no roughness", default=None, gt=0)

    @model_validator(mode="after")
    def _holds_a_line(self, info: ValidationInfo) -> ProfileFile:
        """Refuse a bad file where a campaign names it, before any case fails of it."""
        if info.context is not None:
            try:
                line_of(self)
            except DataError as problem:
                raise ValueError(str(problem)) from None
        return self

    def notes(self) -> tuple[str, ...]:
        """Return points, length, rms height and rms slope of the line."""
        return (_statistics(self),)


@lru_cache(maxsize=16)
def _statistics(profile: ProfileFile) -> str:
    from mdr_dask.physics.surfaces.waves import waves_of

    line = line_of(profile)
    height, slope = float(line.height.std()), waves_of(line.height).rms_slope() / line.length
    return (
        f"profile {profile.file.name}: {line.height.size} points, {shown(line.length, 'm')} long, "
        f"rms height {shown(height, 'm')}, rms slope {slope:.3g}"
    )


@lru_cache(maxsize=16)
def line_of(profile: ProfileFile) -> MeasuredLine:
    """Return one period of the measured line.

    Raises
    ------
    DataError
        If the file does not hold a line.
    """
    from mdr_dask.physics.surfaces.measured import measured_line

    x, z = recorded(profile.file, profile.unit)
    band = profile.shortest_wavelength or 0.0, profile.longest_wavelength or 0.0
    return measured_line(x, z, profile.detrend, profile.taper, *band)


def recorded(file: DataFile, unit: str) -> tuple[FloatArray, FloatArray]:
    """Return positions and heights of a line, m, as they were recorded.

    Parameters
    ----------
    file : DataFile
        Table of x and z, or a file that SurfaceTopography reads.
    unit : str
        Unit of both, where the file does not say.

    Raises
    ------
    DataError
        If the file does not hold a line.
    """
    if file.name.lower().endswith(".npy"):
        raise DataError(
            f"{file.name}: expected a table of x and z, got an array: a map is named by surface: {{map: ...}}"
        )
    if not file.name.lower().endswith(TEXT):
        line, metre = topography(file, unit)
        if line.dim != 1:
            raise DataError(
                f"{file.name}: expected a line scan, got a map of {' x '.join(map(str, line.nb_grid_pts))} points: "
                "name it by surface: {map: ...}"
            )
        x, z = line.positions_and_heights()
        return x * metre, z * metre
    columns = (
        Column("x", "m", ("position", "distance", "length", "X"), given_unit=unit),
        Column("z", "m", ("height", "h", "y", "profile"), given_unit=unit),
    )
    table = read_table(file.read_text(), file.name, columns)
    return table["x"], table["z"]
