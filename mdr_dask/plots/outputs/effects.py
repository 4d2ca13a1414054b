"""Main effects: the mean of an output against each parameter in turn, over all others that vary."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.errors import DataError
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.outputs.view import View, is_sampled, places, scale, subject, title, varied

if TYPE_CHECKING:
    from mdr_dask.plots.table import Drawn

#: Cases of a sampled study in a bin, and the most bins and points of one panel.
IN_A_BIN, MOST_BINS, MOST_POINTS = 8, 10, 5000
MOST_EFFECTS = 12


def draw_effects(found: Mapping[str, xr.Dataset], view: View) -> tuple[Drawn, list[str]]:
    """Draw the mean of an output against every parameter of a series; return the figure, and what is left out."""
    if len(found) > 1 or view.by or view.panels:
        raise DataError(
            f"expected one series, without --by and --panels, got {', '.join(found)}: effects fill a figure"
        )
    ((_, data),) = found.items()
    names = varied(data, view.output)
    if not names:
        raise DataError(f"{view.output} varies along nothing: it has no effects to show")
    told = [f"{', '.join(names[MOST_EFFECTS:])}"] if len(names) > MOST_EFFECTS else []
    names = names[:MOST_EFFECTS]
    figure, axes_of = drawing.panels(len(names), size=(3.6, 3.2), sharey=True)
    how = style.quantity(view.output, data[view.output])
    cases = how.of(aggregation.mean(data[view.output]))
    if cases.size > MOST_POINTS:
        told.append(f"the {cases.size} cases themselves")
    for axes, name in zip(axes_of, names, strict=True):
        dim = curves.along_dim(data, name, view.output) or name
        if cases.size <= MOST_POINTS:
            x = places(data, name).broadcast_like(cases).transpose(*cases.dims)
            drawing.plain(axes, x, cases, ".", label="a case", ms=3, color="0.7", zorder=1)
        across, mean = _bins(data, view.output, name, dim) if is_sampled(data, dim) else _means(data, view, name)
        shown = drawing.Mean(*map(how.of, mean))
        joined = drawing.Curve(data, "mean, 95 % interval", style.colour(0), "-", "o")
        drawing.curve(axes, joined, across, shown, bars=True)
        scale(axes, "x", name, data[name], view)
        if view.is_log("y", cases):
            style.logarithmic(axes, "y")
    axes_of[0].set_ylabel(style.beside(figure, axes_of[0], style.with_unit(how.symbol, how.unit)))
    style.legend(axes_of[0])
    bars = "means over all that varies besides"
    title(figure, subject(found, view, "against every parameter that varies"), found, [curves.scalars(data)], bars)
    return figure, told


def _means(data: xr.Dataset, view: View, name: str) -> tuple[xr.DataArray, drawing.Mean]:
    """Return the mean over all other axes at every value of one."""
    rest = [dim for dim in curves.axes_of(data, view.output) if dim != name]
    error = aggregation.companion(data, view.output)
    mean = curves.mean(data[view.output].mean(rest), None if error is None else abs(error).mean(rest))
    return places(data, name), mean


def _bins(data: xr.Dataset, output: str, name: str, dim: str) -> tuple[xr.DataArray, drawing.Mean]:
    """Return the mean of as many cases each, in the order of one parameter of a sampled study."""
    cases = aggregation.mean(data[output])
    cases = cases.mean([each for each in cases.dims if each != dim]).dropna(dim)
    if not cases.size:
        raise DataError(f"expected {output} of some case, got none that succeeded")
    order = np.argsort(cases[name].values, kind="stable")
    count = int(np.clip(cases.size // IN_A_BIN, 1, MOST_BINS))
    groups = [cases.isel({dim: part}) for part in np.array_split(order, count)]
    across = [float(places(group.to_dataset(name=output), name).mean()) for group in groups]
    means = [curves.mean(group.rename({dim: "realisation"}).reset_coords(drop=True)) for group in groups]
    joined = drawing.Mean(*(xr.concat(ends, "bin") for ends in zip(*means, strict=True)))
    return xr.DataArray(across, dims="bin"), joined
