"""Add measured points to any figure that shows the measured output against a condition of the measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from statistics import NormalDist
from typing import Any

import numpy as np
import xarray as xr

from mdr_dask.arrays import SAME, FloatArray
from mdr_dask.bootstrap import CONFIDENCE
from mdr_dask.campaign.measured import Measured, belonging, scatter
from mdr_dask.errors import DataError, FitError
from mdr_dask.fits.calibration import measured_of, with_table
from mdr_dask.plots import labels
from mdr_dask.plots.base import Plot
from mdr_dask.plots.figure import Axis, Figure, Key, Mean, Panel, Trace, columns
from mdr_dask.plots.view import figure_of, varied
from mdr_dask.units import shown

#: Half width of a 95 % interval divided by the standard error.
HALF = NormalDist().inv_cdf((1 + CONFIDENCE) / 2)
NAME = "measured"


def with_points(
    groups: Mapping[str, xr.Dataset], figures: Mapping[str, Plot], file: Any
) -> tuple[dict[str, xr.Dataset], dict[str, Plot]]:
    """Return the series with the measurements in `file`, and figures that also draw the measured points.

    `file` is a path or a pandas DataFrame.
    """
    given = with_table(groups, file)
    return given, {name: _with_points(figure) for name, figure in figures.items()}


def _with_points(figure: Plot) -> Plot:
    def draw(groups: Mapping[str, xr.Dataset]) -> Figure:
        drawn = figure.draw(groups)
        if figure.name not in ("calibration", NAME):
            add_points(drawn, groups)
        return drawn

    return replace(figure, draw=draw)


def _measured(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the measured output, and the measured points, against the condition with the most values in the study."""
    data = next(iter(groups.values()))
    try:
        measured = measured_of(data)
    except FitError as error:
        raise DataError(str(error)) from None
    along = [name for name in varied(data, measured.output) if name in measured.conditions]
    drawn = figure_of(groups, measured.output, max(along, key=lambda name: data[name].size, default=""))
    figure = drawn.draw(groups)
    add_points(figure, groups)
    return figure


def add_points(figure: Figure, groups: Mapping[str, xr.Dataset]) -> None:
    """Add the measured points to the panels of a figure that show the measured output against a measured condition."""
    data = next(iter(groups.values()))
    try:
        measured = measured_of(data, [panel.y.quantity for panel in figure.panels])
    except FitError as error:
        raise DataError(str(error)) from None
    panels = [p for p in figure.panels if p.y.quantity == measured.output and p.x.quantity in measured.conditions]
    if not measured.conditions:
        axes = ", ".join(str(name) for name in data["status"].dims if name != "realisation")
        raise DataError(f"{measured.source}: expected a column with a parameter of the study ({axes}), got none")
    if not panels:
        known = ", ".join(measured.conditions)
        raise DataError(
            f"{measured.source} contains {measured.output} against {known}, but no panel of this figure has these axes"
        )
    drawn = np.any([_add(panel, measured, data) for panel in panels], axis=0)
    along = {panel.x.quantity for panel in panels}
    others = {name: data[name] for name in measured.conditions if name not in along}
    if not drawn.all():
        off = [name for name in others if _without_curve(panels, measured, name)[~drawn].any()]
        why = f"no curve has their {' or '.join(off)}" if off else "a logarithmic axis shows only numbers above 0"
        figure.leave_out([f"{np.count_nonzero(~drawn)} of {drawn.size} measured points: {why}"])
    figure.warnings += _apart(measured, data, [measured.output, *along])
    bars = f"{measured.error_column} taken as one standard error" if measured.errors is not None else ""
    units = {name: str(known.attrs.get("units", "1")) for name, known in others.items()}
    texts = (bars, measured.remark, *scatter(measured, others, units))
    figure.notes += [f"measured {measured.source}: {text}" for text in texts if text]


def _apart(measured: Measured, data: xr.Dataset, names: Sequence[str]) -> list[str]:
    """Return a warning for each quantity whose measured values are all above or all below the values in the study."""
    warnings = []
    for name in names:
        values, known = measured.conditions.get(name, measured.values), data[name]
        low, high = float(known.min()), float(known.max())
        if values.min() > high or values.max() < low:
            unit = str(known.attrs.get("units", "1"))
            ends = [shown(float(end), unit) for end in (values.min(), values.max(), low, high)]
            warnings.append(
                f"measured {name} is {ends[0]} to {ends[1]}, the study has {ends[2]} to {ends[3]}: is the unit of the "
                "table right?"
            )
    return warnings


def _add(panel: Panel, measured: Measured, data: xr.Dataset) -> np.ndarray:
    """Add the measured points that belong to the curves of a panel, and return a mask of these points.

    A point has the colour of its curve if it belongs to exactly one of several curves. A point is black if it belongs
    to more than one curve, because the table lacks a parameter in which they differ, or if the panel has one curve.
    """
    curves = [trace for trace in panel.traces if trace.kind == "curve" and trace.what == "data"]
    if not curves:
        return np.zeros(measured.values.size, dtype=bool)
    keys, points = panel.entries(), _points(panel, measured, data)
    can_be_shown = _on(panel.x, points["x"].to_numpy()) & _on(panel.y, points["y"].to_numpy())
    on_curve = [can_be_shown & _at(trace.data, measured, data, panel.x.quantity) for trace in curves]
    found: np.ndarray = np.any(on_curve, axis=0)
    coloured = (np.sum(on_curve, axis=0) == 1) & (len(curves) > 1)
    parts = [
        (trace.colour, f"{NAME}, {trace.label}", here & coloured) for trace, here in zip(curves, on_curve, strict=True)
    ]
    for colour, name, here in [*parts, ("#000000", NAME, found & ~coloured)]:
        if here.any():
            own = points.isel(point=np.flatnonzero(here))
            panel.traces.append(Trace("curve", own, NAME, name, colour, "", "D", bars=True))
    if found.any():
        label = NAME if measured.errors is None else f"{NAME}, 95 %"
        if len(curves) == 1 and not curves[0].label:
            keys = [Key("study", curves[0].colour, curves[0].line, curves[0].marker), *keys]
        panel.keys = [*keys, Key(label, "#000000", "", "D")]
    return found


def _without_curve(panels: Sequence[Panel], measured: Measured, name: str) -> np.ndarray:
    """Return a mask of the points whose value of a condition is not that of any curve in the panels."""
    traces = [trace for panel in panels for trace in panel.traces if trace.what == "data"]
    drawn = [float(trace.data[name]) for trace in traces if name in trace.data.coords and trace.data[name].ndim == 0]
    values = measured.conditions[name]
    return np.isnan(belonging(values, drawn)) if drawn else np.zeros(values.size, dtype=bool)


def _at(curve: xr.Dataset, measured: Measured, data: xr.Dataset, along: str) -> np.ndarray:
    """Return a mask of the points that were measured at the parameters of a curve."""
    here = np.ones(measured.values.size, dtype=bool)
    for name, values in measured.conditions.items():
        if name != along and name in curve.coords and curve[name].ndim == 0:
            here &= np.isclose(belonging(values, data[name]), float(curve[name]), rtol=SAME, atol=0)
    return here


def _on(axis: Axis, places: FloatArray) -> np.ndarray:
    """Return a mask of the numbers that an axis can show. A logarithmic axis cannot show zero or negative numbers."""
    return np.isfinite(places) & ((places > 0) | (not axis.log))


def _points(panel: Panel, measured: Measured, data: xr.Dataset) -> xr.Dataset:
    """Return all measured points in the units of a panel, with 95 % intervals if the errors are known."""
    x = labels.quantity(panel.x.quantity, data[panel.x.quantity]).of(measured.conditions[panel.x.quantity])
    how, values = labels.quantity(measured.output, data[measured.output]), measured.values
    half = np.full(values.size, np.nan) if measured.errors is None else HALF * measured.errors
    y = Mean(*map(how.of, (values, values - half, values + half)))
    return columns(conditions(measured, data, np.arange(values.size)), x=x, y=y)


def conditions(measured: Measured, data: xr.Dataset, here: np.ndarray) -> xr.Dataset:
    """Return the conditions of some measured points as coordinates."""
    units = {name: {"units": str(data[name].attrs.get("units", "1"))} for name in measured.conditions}
    return xr.Dataset(coords={name: ("point", each[here], units[name]) for name, each in measured.conditions.items()})


PLOTS: tuple[Plot, ...] = (Plot(NAME, (), "the measured output with the measured points of the campaign", _measured),)
