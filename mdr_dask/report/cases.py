"""Means and errors of all cases of a study. The page draws these means against axes that the reader chooses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.plots import curves, labels
from mdr_dask.report.figures import Json, numbers
from mdr_dask.report.words import markup

#: Largest number of cases of one series on the page.
MOST_CASES = 4000


def thinned(data: xr.Dataset) -> tuple[xr.Dataset, list[str]]:
    """Load at most `MOST_CASES` cases of a series. Return the cases, and texts about the values that are left out."""
    dims, left_out = [str(dim) for dim in data["status"].dims if dim != "realisation"], []
    while (cases := math.prod(data.sizes[dim] for dim in dims)) > MOST_CASES:
        longest = max(dims, key=lambda dim: data.sizes[dim])
        size = data.sizes[longest]
        most = max(1, min(size - 1, size * MOST_CASES // cases), size // 4)
        data, sentences = curves.thin(data, longest, most)
        left_out += sentences
    return data.load(), left_out


def cases_of(groups: Mapping[str, xr.Dataset], left_out: Mapping[str, list[str]]) -> list[Json]:
    """Return the cases of each series as columns: lists with one entry for each case, in the units of the figures.

    ``at`` has a column for each varied parameter, and ``states`` is the column of the states of the cases. ``values``
    has up to five columns for each output: ``value`` (mean), ``low`` and ``high`` (interval), ``lines`` (standard
    error) and ``grid`` (grid error). ``reduced`` are the texts about omitted values that `thinned` returned.
    """
    found = [_series(name, data, left_out[name]) for name, data in groups.items()]
    return [series for series in found if series["outputs"] and series["axes"]]


def _series(name: str, data: xr.Dataset, left_out: list[str]) -> Json:
    outputs = [output for output in main_outputs(data) if set(data[output].dims) <= set(data["status"].dims)]
    dims = [str(dim) for dim in data["status"].dims if dim != "realisation"]
    varied = [axis for dim in dims for axis in curves.parameters_along(data, dim) if axis in data.coords]
    varied = [axis for axis in varied if data[axis].size > 1]
    shape = xr.DataArray(np.zeros([data.sizes[dim] for dim in dims]), dims=dims)
    return {
        "name": name,
        "reduced": left_out,
        "axes": {axis: {**_named(axis, data[axis]), "dim": str(data[axis].dims[0])} for axis in varied},
        "at": {axis: _column(labels.shown(axis, data[axis]), data[axis].dims, shape) for axis in varied},
        "outputs": {output: _named(output, data[output]) for output in outputs},
        "values": {output: _measured(data, output, shape) for output in outputs},
        "states": _states(data, shape),
    }


def main_outputs(data: xr.Dataset) -> list[str]:
    """Return the outputs of a series that are not errors of other outputs (`<output>_error`)."""
    names = [str(name) for name in data.data_vars if name != "status"]
    errors = {str(data[name].attrs.get("ancillary_variables")) for name in names}
    return [name for name in names if name not in errors]


def _named(name: str, values: xr.DataArray) -> Json:
    label = labels.label(name, values)
    return {"label": markup(label), "spoken": labels.plain(label), "unit": labels.quantity(name, values).unit}


def _column(values: Any, dims: tuple[Any, ...], shape: xr.DataArray) -> list[Any]:
    """Return a list with one value for each case.

    If the cases have a dimension that `values` lack, the values are repeated along this dimension.
    """
    along = xr.DataArray(np.asarray(values), dims=dims)
    return numbers(along.broadcast_like(shape).transpose(*shape.dims).to_numpy().ravel())


def _measured(data: xr.Dataset, output: str, shape: xr.DataArray) -> Json:
    """Return mean, interval, standard error and grid error of an output, in the unit of the figures."""
    how = labels.quantity(output, data[output])
    if "realisation" not in data[output].dims:
        return {"value": _column(how.of(data[output]), data[output].dims, shape)}
    mean, factor = curves.mean(data, output), how.factor
    columns: dict[str, xr.DataArray] = {"value": mean.value, "low": mean.low, "high": mean.high}
    columns["lines"] = aggregation.standard_error(data[output] * factor)
    error = aggregation.companion(data, output)
    if error is not None:
        columns["grid"] = aggregation.grid_error(error * factor)
    found = {name: _column(column.to_numpy(), column.dims, shape) for name, column in columns.items()}
    return {name: column for name, column in found.items() if any(value is not None for value in column)}


def _states(data: xr.Dataset, shape: xr.DataArray) -> list[Any]:
    from mdr_dask.questions.columns import states

    found = states(data)
    return [str(word) for word in found.broadcast_like(shape).transpose(*shape.dims).to_numpy().ravel()]
