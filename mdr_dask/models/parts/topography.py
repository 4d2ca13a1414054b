"""Files of instruments: lines and maps that SurfaceTopography reads, if it is installed."""

from __future__ import annotations

from typing import Any

from mdr_dask.errors import DataError
from mdr_dask.models.data_file import DataFile
from mdr_dask.units import to_si

#: Ends of the names of plain text.
TEXT = (".csv", ".txt", ".dat", ".xyz", ".asc", ".tsv")


def topography(file: DataFile, unit: str) -> tuple[Any, float]:
    """Return the line scan or map of a file as SurfaceTopography has it, and its unit of lengths and heights in m.

    Parameters
    ----------
    file : DataFile
        Any format that it reads.
    unit : str
        Unit of lengths and heights, where the file does not say.

    Raises
    ------
    DataError
        If it is not installed, cannot read the file, or neither file nor `unit` says the unit.
    """
    try:
        import SurfaceTopography
    except ImportError:
        raise DataError(f"{file.name}: this format needs SurfaceTopography: pip install mdr_dask[formats]") from None
    file.read_bytes()  # refuses a changed one
    try:
        found = SurfaceTopography.read_topography(file.path)
    except Exception as problem:  # every reader of every format has errors of its own
        reason = type(problem).__name__
        raise DataError(f"{file.name}: SurfaceTopography cannot read it: {reason}") from None
    if found.unit is not None:
        return found.to_unit("m"), 1.0
    if not unit:
        raise DataError(f"{file.name}: does not say its unit: give `unit`, such as um")
    try:
        return found, to_si(f"1 {unit}", "m")
    except ValueError as error:
        raise DataError(f"{file.name}: unit: {error}") from None
