"""Convert columns to other units, from texts such as ``velocity=km/h,wear_volume=um^3``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from mdr_dask.campaign.written import written_units
from mdr_dask.errors import DataError, did_you_mean
from mdr_dask.units import conversion

if TYPE_CHECKING:
    import xarray as xr

#: Suffixes of statistics that are converted like the output itself: a mean of 300 K is a mean of 26.85 degC.
_OF_OUTPUTS = ("mean", "interval", "quantile")
#: Suffixes of statistics that are differences between values of an output: an error of 5 K is an error of 5 degC.
_DIFFERENCES = ("error", "standard_deviation", "standard_error", "grid_error")


def parse_units(texts: Sequence[str]) -> dict[str, str]:
    """Return the unit of each column from texts such as ``velocity=km/h,temperature=degC``."""
    wanted = {}
    for part in (part for text in texts for part in text.split(",")):
        name, equals, unit = (piece.strip() for piece in part.partition("="))
        if not (equals and name and unit):
            raise DataError(f"expected NAME=UNIT,NAME=UNIT, got {part!r}")
        wanted[name.replace(".", "_")] = unit
    return wanted


def as_written(study: xr.Dataset) -> dict[str, str]:
    """Return the units of numerical axes and parameters as written in the campaign file of a study."""
    written = written_units(str(study.attrs.get("campaign", "")))
    return {name: unit for name, unit in written.items() if name in study.coords and study[name].dtype.kind in "fiu"}


def in_units(dataset: xr.Dataset, wanted: Mapping[str, str]) -> xr.Dataset:
    """Convert variables and coordinates to other units, together with their statistics and errors."""
    for name, unit in wanted.items():
        own = {name, *(f"{name}_{ending}" for ending in (*_OF_OUTPUTS, *_DIFFERENCES))}
        found = [str(each) for each in dataset.variables if each in own]
        if not found:
            raise DataError(
                f"expected the name of a column, got {name!r} with unit {unit!r}{did_you_mean(name, _known(dataset))}"
            )
        dataset = dataset.assign({each: _converted(dataset[each], unit, name) for each in found})
    return dataset


def _known(dataset: xr.Dataset) -> list[str]:
    endings = tuple(f"_{ending}" for ending in (*_OF_OUTPUTS, *_DIFFERENCES))
    names = [str(each) for each in dataset.variables]
    return [name.removesuffix("_mean") for name in names if name.endswith("_mean") or not name.endswith(endings)]


def _converted(array: xr.DataArray, unit: str, name: str) -> xr.DataArray:
    try:
        factor, zero = conversion(unit, str(array.attrs.get("units", "1")))
    except ValueError as error:
        raise DataError(f"{name}: {error}, got {unit!r}") from None
    if array.name != name and str(array.name).removeprefix(f"{name}_") in _DIFFERENCES:
        zero = 0.0
    return ((array - zero) / factor).assign_attrs(array.attrs | {"units": unit})
