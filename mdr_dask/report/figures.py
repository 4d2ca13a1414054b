"""Figures as data for the page: a `mdr_dask.plots.figure.Figure` as JSON."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask.errors import DataError, FitError
from mdr_dask.plots import colours
from mdr_dask.plots.base import Plot
from mdr_dask.plots.figure import LAST, Axis, Bar, Figure, Panel, Trace, edges
from mdr_dask.plots.labels import plain
from mdr_dask.report.words import markup

#: Largest number of points of one figure. A figure with more points is thinned: only every n-th point is on the page.
MOST_POINTS = 20_000
#: `DIGITS`: number of significant digits. `SHADES`: number of colours of a colour bar.
DIGITS, SHADES = 9, 17

Json = dict[str, Any]


def drawn_of(
    figures: Mapping[str, Plot], groups: Mapping[str, xr.Dataset], provenance: Any
) -> Iterator[Json | tuple[str, str]]:
    """Yield each figure as data, or the name of a figure and the reason why this figure cannot be drawn."""
    for name, each in figures.items():
        try:
            figure = each.describe(groups)
        except (DataError, FitError) as error:
            yield name, str(error)
            continue
        yield figure_data(name, each.summary, figure, provenance(name))


def figure_data(name: str, summary: str, figure: Figure, origin: Mapping[str, str]) -> Json:
    """Return a figure as data for the page. Labels are HTML; all other texts are plain text."""
    every = [(k, panel, trace) for k, panel in enumerate(figure.panels) for trace in panel.traces]
    total = sum(trace.column("x").size for *_, trace in every)
    step = max(1, -(-total // MOST_POINTS))
    reduced = f"only one of {step} points is on this page" if step > 1 else ""
    bars = list(dict.fromkeys(panel.bar for panel in figure.panels if panel.bar))
    return {
        "name": name,
        "summary": summary,
        "title": markup(figure.subject),
        "spoken": plain(figure.subject),
        "fixed": [markup(line) for line in (figure.fixed, figure.bars) if line],
        "left_out": markup("; ".join([*figure.left_out, *([reduced] if reduced else [])])),
        "head": figure.head(origin),
        "panels": [_panel(panel) for panel in figure.panels],
        "traces": [_trace(trace, k, panel, bars, step) for k, panel, trace in every],
        "scales": [_scale(bar, figure.panels) for bar in bars],
        "parameters": {
            name: {"label": name.replace("_", " "), "unit": "" if unit == "1" else unit}
            for name, unit in figure.units().items()
        },
    }


def _panel(panel: Panel) -> Json:
    return {"title": markup(panel.title), "x": _axis(panel.x), "y": _axis(panel.y)}


def _axis(axis: Axis) -> Json:
    found: Json = {"label": markup(axis.label), "spoken": plain(axis.label), "log": axis.log}
    if axis.reverse:
        found["reversed"] = True
    if axis.ticks:
        found["ticks"] = [[place, markup(text)] for place, text in axis.ticks]
    return found


def _trace(trace: Trace, panel: int, of: Panel, bars: list[Bar], step: int) -> Json:
    """Return one trace as data, with every `step`-th point. The points of a curve are in the order in which the curve
    joins them.
    """
    rows = trace.frame()
    if trace.kind == "curve" and trace.line:
        rows = rows.sort_values("x", kind="stable")
    rows = rows.iloc[np.unique([*range(0, len(rows), step), len(rows) - 1])] if len(rows) else rows
    found: Json = {
        "panel": panel,
        "kind": trace.kind,
        "what": plain(trace.what),
        "curve": markup(trace.label),
        "spoken": plain(trace.label),
        "colour": trace.colour,
        "line": trace.line,
        "marker": trace.marker,
        **{name: numbers(rows[name].to_numpy()) for name in LAST if name in rows},
        "of": {str(name): _once(numbers(rows[name].to_numpy())) for name in trace.data.coords},
    }
    if of.bar and trace.kind in ("dots", "map"):
        found["scale"] = bars.index(of.bar)
    if trace.kind == "map":
        for name, axis in (("x", of.x), ("y", of.y)):
            found[f"{name}_edges"] = numbers(edges(np.unique(trace.column(name)), axis.log))
    if trace.line and "y" in trace.data:
        found["gaps"] = numbers(trace.column("x")[~np.isfinite(trace.column("y"))])
    return found


def _once(column: list[Any]) -> Any:
    """Return a column, or a single value if all values of the column are equal."""
    return column[0] if column and all(value == column[0] for value in column) else column


def numbers(values: NDArray[Any]) -> list[Any]:
    """Return values for JSON: numbers to `DIGITS` digits, None for numbers that are not finite, and texts."""
    if values.dtype.kind not in "fiu":
        return [str(value) for value in values.ravel()]
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values.ravel().tolist()]


def _shades(bar: Bar) -> Json:
    """Return the two values at the ends of a colour bar, and the colours between the ends."""
    between = np.geomspace if bar.log else np.linspace
    shades = [colours.shade(bar, value) for value in between(bar.low, bar.high, SHADES)]
    return {"low": bar.low, "high": bar.high, "log": bar.log, "colours": shades}


def _scale(bar: Bar, panels: list[Panel]) -> Json:
    beside = [k for k, panel in enumerate(panels) if panel.bar == bar]
    return {**_shades(bar), "label": markup(bar.label), "spoken": plain(bar.label), "panels": beside}
