"""A measured line as a campaign names it."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, ValidationInfo, model_validator

from mdr_dask.errors import DataError
from mdr_dask.models.base import NamedFile, quantity
from mdr_dask.models.parts.named_by_file import NamedByFile
from mdr_dask.tables import Column, read_table
from mdr_dask.units import shown, to_si

if TYPE_CHECKING:
    from mdr_dask.physics.surfaces.measured import MeasuredLine

TEXT = (".csv", ".txt", ".dat", ".xyz", ".asc", ".tsv")


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

    x, z = _columns(profile) if profile.file.name.lower().endswith(TEXT) else _topography(profile)
    band = profile.shortest_wavelength or 0.0, profile.longest_wavelength or 0.0
    return measured_line(x, z, profile.detrend, profile.taper, *band)


def _columns(profile: ProfileFile) -> tuple[Any, Any]:
    columns = (
        Column("x", "m", ("position", "distance", "length", "X"), given_unit=profile.unit),
        Column("z", "m", ("height", "h", "y", "profile"), given_unit=profile.unit),
    )
    table = read_table(profile.file.read_text(), profile.file.name, columns)
    return table["x"], table["z"]


def _topography(profile: ProfileFile) -> tuple[Any, Any]:
    try:
        import SurfaceTopography
    except ImportError:
        raise DataError(
            f"{profile.file.name}: this format needs SurfaceTopography: pip install mdr_dask[formats]"
        ) from None
    if hashlib.sha256(Path(profile.file.path).read_bytes()).hexdigest() != profile.file.sha256:
        raise DataError(f"{profile.file.path}: changed since the campaign was read")
    try:
        line = SurfaceTopography.read_topography(profile.file.path)
    except Exception as problem:  # every reader of every format has errors of its own
        reason = type(problem).__name__
        raise DataError(f"{profile.file.name}: SurfaceTopography cannot read it: {reason}") from None
    if line.dim != 1:
        raise DataError(
            f"{profile.file.name}: expected a line scan, got a map of {' x '.join(map(str, line.nb_grid_pts))} points: "
            "save one of its lines as x, z"
        )
    x, z = (line if line.unit is None else line.to_unit("m")).positions_and_heights()
    if line.unit is not None:
        return x, z
    if not profile.unit:
        raise DataError(f"{profile.file.name}: does not say its unit: give `unit`, such as um")
    try:
        scale = to_si(f"1 {profile.unit}", "m")
    except ValueError as error:
        raise DataError(f"{profile.file.name}: unit: {error}") from None
    return x * scale, z * scale
