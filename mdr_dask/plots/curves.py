"""Curves of a series: the parameters that vary in a figure, the fixed parameters, and means with intervals."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import aggregation, models
from mdr_dask.errors import DataError
from mdr_dask.models.base import Status
from mdr_dask.plots import colours, labels, page
from mdr_dask.plots.figure import Bar, Key, Mean


class Curve(NamedTuple):
    """The data, label, colour, line and marker of one curve."""

    data: xr.Dataset
    label: str
    colour: str
    line: str
    marker: str


class Family(NamedTuple):
    """Curves against one parameter. `left_out` are texts about the values that are not drawn.

    `bar` is a colour bar if the curves need more colours than there are, otherwise None.
    """

    curves: list[Curve]
    bar: Bar | None
    left_out: list[str]

    @property
    def keys(self) -> list[Key]:
        """The entries of the legend. A colour bar replaces the legend."""
        return [] if self.bar else [Key(c.label, c.colour, c.line, c.marker) for c in self.curves if c.label]


def mean(data: xr.Dataset, output: str) -> Mean:
    """Return the mean of an output over realisations and the 95 % interval of the mean, in the unit of the figure."""
    values = data[output]
    if "realisation" not in values.dims:
        values = values.expand_dims("realisation")
    error = aggregation.companion(data, output)
    if error is not None and "realisation" not in error.dims:
        error = error.expand_dims("realisation")
    how = labels.quantity(output, data[output])
    return Mean(*map(how.of, aggregation.mean_and_ends(values, error)))


def intervals(most: int) -> str:
    """Return the name of the intervals of values that are means over at most `most` realisations."""
    return "95 % intervals of the mean" if most > 1 else "95 % intervals"


def meaning_of_bars(data: Iterable[xr.Dataset], outputs: Sequence[str]) -> str:
    """Return the text that explains bars and bands."""
    groups = [*data]
    most = max((each.sizes.get("realisation", 1) for each in groups), default=1)
    grid = any(aggregation.companion(each, name) is not None for each in groups for name in outputs if name in each)
    parts = [f"the scatter of up to {most} realisations"] * (most > 1) + ["the error of the grid"] * grid
    return f"bars and bands: {intervals(most)}, from {' and '.join(parts)}" if parts else "one realisation: no bars"


def axes_of(data: xr.Dataset, output: str) -> list[str]:
    """Return the dimensions of an output that are axes of the study."""
    if "status" in data:
        cases = {str(dim) for dim in data["status"].dims}
    else:
        cases = {str(axis["dim"]) for axis in data.attrs.get("axes", [])} or {str(dim) for dim in data[output].dims}
    return [str(dim) for dim in data[output].dims if dim in cases and dim != "realisation"]


def along_dim(data: xr.Dataset, along: str, output: str) -> str | None:
    """Return the dimension along which both a parameter and an output vary, or None if there is no such dimension."""
    if along in data[output].dims:
        return along
    if along in data.coords and data[along].ndim == 1 and data[along].dims[0] in data[output].dims:
        return str(data[along].dims[0])
    return None


def parameters_along(data: xr.Dataset, dim: str) -> list[str]:
    """Return the parameters that change along a dimension, or the name of the dimension if there are none.

    In a sampled design, several parameters change together.
    """
    names = [str(name) for name, values in data.coords.items() if values.dims == (dim,)]
    axes = [str(axis["name"]) for axis in data.attrs.get("axes", [])]
    return sorted(names or [dim], key=lambda name: axes.index(name) if name in axes else -1)


def hold(data: xr.Dataset, dims: Sequence[str]) -> tuple[xr.Dataset, list[str]]:
    """Fix axes at their middle values. Return the series and a text for each fixed axis that has several values."""
    places = {dim: data.sizes[dim] // 2 for dim in dims}
    sentences = [_only_one(data, dim, place) for dim, place in places.items() if data.sizes[dim] > 1]
    return data.isel(places), sentences


def _only_one(data: xr.Dataset, dim: str, place: int) -> str:
    names = parameters_along(data, dim)
    values = ", ".join(labels.named(name, data[name].isel({dim: place})) for name in names if name in data.coords)
    return f"{data.sizes[dim] - 1} of {data.sizes[dim]} values of {' and '.join(names)} (drawn: {values or place})"


def thin(data: xr.Dataset, dim: str, most: int) -> tuple[xr.Dataset, list[str]]:
    """Return a series with at most `most` evenly spread values of an axis, and a text about the omitted values."""
    size = data.sizes[dim]
    if size <= most:
        return data, []
    chosen = np.unique(np.linspace(0, size - 1, most).round().astype(int))
    names = " and ".join(parameters_along(data, dim))
    return data.isel({dim: chosen}), [
        f"{size - chosen.size} of {size} values of {names} ({chosen.size} drawn, spread evenly)"
    ]


def family(data: xr.Dataset, output: str, along: str, by: str = "", series: str = "", first: int = 0) -> Family:
    """Split a series into curves against the parameter `along`.

    The curves differ in the parameter `by`. Without `by`, there is a curve for every combination of values of the other
    axes. If this would give more curves than colours, the curves differ only in the longest of these axes. Every
    remaining axis is fixed at the middle value. If the axis in which the curves differ has more values than there are
    colours, a colour bar shows the values; if the values are words, some curves are left out instead. The label of each
    curve begins with the name `series`. The first curve gets the colour with the index `first`.
    """
    if along not in data.coords and along not in data.dims:
        raise DataError(f"expected a series with the axis {along!r}, got {', '.join(map(str, data.dims))}")
    over = along_dim(data, along, output)
    others = [dim for dim in axes_of(data, output) if dim != over and data.sizes[dim] > 1]
    if by:
        others = [dim for dim in [along_dim(data, by, output)] if dim not in (None, over)]
    elif int(np.prod([data.sizes[dim] for dim in others], dtype=int)) > colours.most():
        others = [max(others, key=lambda dim: data.sizes[dim])]
    data, left_out = hold(data, [dim for dim in axes_of(data, output) if dim not in (over, *others)])
    for dim in (dim for dim in others if not _is_numeric(data, dim)):
        data, more = thin(data, dim, colours.most())
        left_out += more
    cells = [dict(zip(others, cell, strict=True)) for cell in np.ndindex(*(data.sizes[dim] for dim in others))]
    parts = [needed(data.isel(cell)) for cell in cells]
    named = [", ".join([series] * bool(series) + _names(part, others)) for part in parts]
    joined = over is not None and len(parameters_along(data, over)) == 1 and data.sizes[over] > 1
    looks = [(colours.colour(k), *colours.line_and_marker(k)) for k in range(first, first + len(parts))]
    bar = None
    if len(parts) > colours.most():
        name = parameters_along(data, others[0])[0]
        values = labels.converted(name, data[name])
        bar = colours.bar(labels.label(name, data[name]), values)
        # small markers, because there are many curves
        looks = [(colours.shade(bar, value), "-", "." if joined else "o") for value in values]
    curves = [
        Curve(part, label, colour, line if joined else "", marker)
        for part, label, (colour, line, marker) in zip(parts, named, looks, strict=True)
    ]
    return Family(curves, bar, left_out)


def with_one_legend(families: Mapping[str, Family]) -> tuple[list[str], list[str]]:
    """Return the names of the largest set of series with the same legend and colour bar, and a text about the others.

    If there are no other series, the list of texts is empty.
    """
    groups: dict[Any, list[str]] = {}
    for name, one in families.items():
        groups.setdefault((tuple(one.keys), one.bar), []).append(name)
    kept = max(groups.values(), key=len)
    rest = [name for name in families if name not in kept]
    return kept, [
        f"series {', '.join(rest)}, whose curves differ in other parameters (--series draws them)"
    ] if rest else []


def _is_numeric(data: xr.Dataset, dim: str) -> bool:
    name = parameters_along(data, dim)[0]
    return name in data.coords and data[name].dtype.kind in "fiu"


def needed(curve: xr.Dataset) -> xr.Dataset:
    """Return a curve with only those values of an adaptive axis for which results were needed."""
    if "status" not in curve:
        return curve
    spared = (curve["status"] == Status.NOT_NEEDED).all("realisation")
    return curve.isel({spared.dims[0]: np.flatnonzero(~spared)}) if spared.ndim == 1 and spared.any() else curve


def _names(part: xr.Dataset, dims: Sequence[str]) -> list[str]:
    """Return one label for each of the dimensions `dims`. A label shows the parameters along one dimension."""
    axes = part.attrs.get("axes", [])
    found = []
    for dim in dims:
        along = {dim, *(str(axis["name"]) for axis in axes if axis["dim"] == dim)}
        here = [str(name) for name, value in part.coords.items() if value.ndim == 0 and name in along]
        found.append(", ".join(labels.named(name, part[name]) for name in here) or dim)
    return found


def scalars(data: xr.Dataset) -> dict[str, xr.DataArray]:
    """Return the parameters that have a single value in a series and are worth mentioning.

    Parameters without effect are left out. Defaults are left out if they are zero or settings of the solution.
    If the name of the model is unknown, no parameter is left out.
    """
    kept = {str(name): value for name, value in data.coords.items() if value.ndim == 0 and name != "realisation"}
    if "model" not in data.attrs:
        return kept
    declared = models.load(data.attrs["model"]).parameters
    idle = {name for name, (other, value) in declared.requires.items() if value not in _given(data, other)}
    defaults = {name: declared.model_fields[name].default for name in kept.keys() & declared.model_fields.keys()}
    usual = {name for name, default in defaults.items() if kept[name].item() == default}
    idle |= {name for name in usual if defaults[name] == 0 or name in declared.settings}
    return {name: value for name, value in kept.items() if name not in idle}


def _given(data: xr.Dataset, name: str) -> list[Any]:
    return list(np.ravel(data[name].values)) if name in data.coords else [parameters_of(data).get(name)]


def fixed_by_all(parts: Iterable[xr.Dataset]) -> dict[str, xr.DataArray]:
    """Return the parameters that have one and the same value in all parts of a study."""
    held = [scalars(part) for part in parts]
    first = held[0] if held else {}
    return {
        name: value
        for name, value in first.items()
        if all(name in each and np.array_equal(each[name], value) for each in held)
    }


def fixed_text(held: Mapping[str, xr.DataArray], data: xr.Dataset) -> str:
    """Return a text with the fixed parameters, for a title.

    The text begins with the parameters that are axes of the study. Other parameters are left out if they have no symbol
    or if their value is unknown.
    """
    axes = [str(axis["name"]) for axis in data.attrs.get("axes", [])]
    names = [name for name in axes if name in held]
    names += [name for name in page.current().symbols if name in held and name not in names and _is_known(held[name])]
    return ", ".join(labels.named(name, held[name]) for name in names)


def _is_known(value: xr.DataArray) -> bool:
    return value.dtype.kind not in "fiu" or bool(np.isfinite(value))


def parameters_of(data: xr.Dataset) -> dict[str, Any]:
    """Return all parameters of a series as stored: numbers, and words such as the names of rules."""
    found: dict[str, Any] = json.loads(data.attrs.get("parameters", "{}"))
    return found


def parameters_at(case: xr.Dataset) -> dict[str, Any]:
    """Return the parameters of one case: the fixed parameters of the series, and the values of the case on the axes."""
    parameters = parameters_of(case)
    for axis in case.attrs.get("axes", []):
        *above, last = axis["path"].split(".")
        place = parameters
        for key in above:
            place = place[key]
        value = case[axis["name"]].item()
        names = axis.get("labels")
        place[last] = axis["values"][names.index(value)] if names else value
    return parameters
