"""An output over two parameters: the cells of a grid in colours, or the cases of a sampled study as coloured points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.outputs.view import View, by_series, by_value, places, scale, subject, title, value

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from mdr_dask.plots.table import Drawn


def draw_map(found: Mapping[str, xr.Dataset], view: View) -> tuple[Drawn, list[str]]:
    """Draw an output over two parameters, a panel for each series; return the figure, and what is left out."""
    if view.by or (view.panels and len(found) > 1):
        raise DataError("expected a map of one series, without --by: its colours are the values")
    panels, told = by_value(found, view) if view.panels else by_series(found)
    series, means = [], []
    for panel in panels:
        ((_, data),) = panel.series.items()
        drawn_along = {curves.along_dim(data, name, view.output) for name in view.over}
        rest = [dim for dim in curves.axes_of(data, view.output) if dim not in drawn_along]
        data, sentences = curves.hold(data, rest)
        told += sentences
        series.append(data)
        means.append(value(data, view.output))
    figure, axes_of = drawing.panels(len(panels), sharex=True, sharey=True)
    how, norm = style.shades(_known(means, view), view.log is None or "z" in view.log)
    for axes, panel, data, mean in zip(axes_of, panels, series, means, strict=True):
        x, y = (places(data, name) for name in view.over)
        if x.dims == y.dims:
            colours = drawing.dots(axes, x, y, mean.value, mean, cmap=how, norm=norm, s=22)
        else:
            colours = drawing.field(axes, x, y, mean, cmap=how, norm=norm)
        _cross_out(axes, x, y, data[view.output].isnull().all("realisation"))
        for which, name in zip("xy", view.over, strict=True):
            scale(axes, which, name, data[name], view)
        axes.set_title(panel.title, fontsize="small", wrap=True)
    quantity = style.quantity(view.output, series[0][view.output])
    words = style.with_unit(quantity.symbol, quantity.unit)
    figure.colorbar(colours, ax=axes_of, label=style.broken(words))
    words = " against {} and {}".format(*(name.replace("_", " ") for name in view.over)).strip()
    title(
        figure,
        subject(found, view, words),
        found,
        [curves.scalars(data) for data in series],
        _reach(means, quantity.unit),
    )
    return figure, told


def _known(means: Sequence[drawing.Mean], view: View) -> np.ndarray:
    every = np.concatenate([drawing.flat(mean.value) for mean in means])
    if not np.isfinite(every).any():
        raise DataError(f"expected {view.output} of some case, got none that succeeded")
    return every


def _cross_out(axes: Axes, x: xr.DataArray, y: xr.DataArray, empty: xr.DataArray) -> None:
    """Mark the cases that have no value."""
    across, up, where = (drawing.flat(each) for each in xr.broadcast(*(e.drop_vars(e.coords) for e in (x, y, empty))))
    if where.any():
        axes.plot(across[where > 0], up[where > 0], "x", color="0.3", ms=4, gid=style.GUIDE, label="no value")
        style.legend(axes)


def _reach(means: Sequence[drawing.Mean], unit: str) -> str:
    """Return how far the 95 % intervals of a map reach at most, for a map shows none."""
    half = np.concatenate([drawing.flat(mean.high - mean.low) / 2 for mean in means])
    if not np.isfinite(half).any():
        return "one realisation: no intervals"
    return f"95 % intervals: at most ±{np.nanmax(half):.2g} {unit}".rstrip()
