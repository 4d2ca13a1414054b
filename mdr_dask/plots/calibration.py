"""The figure of a calibration: measured points and predictions, residuals, and the density of each unknown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray, is_geometric
from mdr_dask.bootstrap import RESAMPLES
from mdr_dask.campaign.measured import belonging
from mdr_dask.errors import FitError
from mdr_dask.fits import calibration as fit
from mdr_dask.fits import posterior
from mdr_dask.plots import colours, labels
from mdr_dask.plots.base import Plot
from mdr_dask.plots.figure import Axis, Figure, Key, Mean, Panel, Trace, columns
from mdr_dask.plots.measured import HALF, conditions

Points = NDArray[np.intp]


def calibration(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw measured points with the band of predictions, residuals, and the density of each unknown.

    The density of an unknown is grey if the data do not determine this unknown. If the data determine a product of
    such unknowns, the density of this product has a panel too.
    """
    found, series, data, left_out = _first(groups)
    varied = _set_values(found, data)
    main = max(varied, key=lambda name: np.unique(varied[name]).size, default="")
    curves = _curves(varied, main, found.measured.values.size, data)
    x = Axis("measured point")
    if main:
        x = Axis(labels.label(main, data[main]), is_geometric(varied[main]), quantity=main)
    panels = [_data(found, x, curves, data), _residuals(found, x, curves, data)]
    for k, name in enumerate(found.unknowns):
        panels.append(_density(found, name, found.values[:, k], labels.quantity(name, data[name]), k in found.free))
    for product in found.products:
        name, unit = found.name_and_unit(product)
        panels.append(_density(found, name, product.values, labels.Quantity(name, unit), False))
    points = f"{found.measured.source}, {found.measured.values.size} points{f', series {series}' if series else ''}"
    subject = f"calibration: {fit.sentence(found)}"
    figure = Figure(panels, subject, points, "bars, bands and shades: 95 % (dark: 68 %)", ratio=0.8)
    figure.judge(found.law_holds)
    figure.leave_out(left_out)
    return figure


def _first(groups: Mapping[str, xr.Dataset]) -> tuple[fit.Calibration, str, xr.Dataset, list[str]]:
    """Calibrate the first series that can be compared with a table of measurements.

    The last value returned is a list of texts that say why the other series are not drawn. FitError is raised if no
    series can be compared.
    """
    reasons = {}
    for name, dataset in groups.items():
        try:
            found = fit.calibrate(dataset, fit.measured_of(dataset))
        except FitError as error:
            reasons[name] = str(error)
            continue
        later = [f"series {other} (--series draws it)" for other in [*groups][[*groups].index(name) + 1 :]]
        return found, name, dataset, [f"series {other}: {reason}" for other, reason in reasons.items()] + later
    raise FitError("; ".join(dict.fromkeys(reasons.values())))


def _set_values(found: fit.Calibration, data: xr.Dataset) -> dict[str, FloatArray]:
    """Return the measured conditions. A measured value that is near a value of the study is replaced by this value."""
    near = {name: belonging(each, data[name]) for name, each in found.measured.conditions.items()}
    return {name: np.where(np.isnan(each), found.measured.conditions[name], each) for name, each in near.items()}


def _curves(varied: Mapping[str, FloatArray], main: str, count: int, data: xr.Dataset) -> dict[str, Points]:
    """Divide `count` measured points into curves, and return the indices of the points of each curve by its label.

    The points of a curve differ only in the condition `main`. If this would give more curves than colours, all points
    form one curve.
    """
    others = {name: each for name, each in varied.items() if name != main}
    rows = np.stack(list(others.values()), axis=1) if others else np.zeros((count, 1))
    places, which = np.unique(np.round(rows, 12), axis=0, return_inverse=True)
    if not 1 < len(places) <= colours.most():
        return {"measured": np.arange(len(rows))}
    curves = {}
    for k, row in enumerate(places):
        here = {
            name: xr.DataArray(value, {name: value}, attrs=data[name].attrs)
            for name, value in zip(others, row, strict=True)
        }
        label = ", ".join(labels.named(name, value) for name, value in here.items())
        curves[label] = np.flatnonzero(which.ravel() == k)
    return curves


def _along(found: fit.Calibration, x: Axis, points: Points, data: xr.Dataset) -> FloatArray:
    """Return the positions of points on the horizontal axis. Without a condition, the positions are 1, 2, 3, ..."""
    if not x.quantity:
        return np.asarray(points, dtype=np.float64) + 1
    along: FloatArray = labels.quantity(x.quantity, data[x.quantity]).of(found.measured.conditions[x.quantity][points])
    return along


def _data(found: fit.Calibration, x: Axis, curves: Mapping[str, Points], data: xr.Dataset) -> Panel:
    output, values = found.measured.output, found.measured.values
    log = is_geometric(values) and found.prediction.logarithmic
    panel = Panel(x, Axis(labels.label(output, data[output]), log))
    how, half = labels.quantity(output, data[output]), HALF * found.noise[0]
    steps = (np.arange(RESAMPLES) + 0.5) / RESAMPLES
    cells = np.searchsorted(np.cumsum(found.posterior.weights), steps).clip(0, len(found.posterior.weights) - 1)
    predicted = found.prediction(found.posterior.places[cells]).mean
    low, best, high = np.quantile(predicted, [0.025, 0.5, 0.975], axis=0)
    for k, (label, points) in enumerate(curves.items()):
        at = points[np.argsort(_along(found, x, points, data))]
        of, place = conditions(found.measured, data, at), _along(found, x, at, data)
        measured, band = (
            Mean(*(how.of(each[at]) for each in ends))
            for ends in ((values, values - half, values + half), (best, low, high))
        )
        study = f"study, {label}"
        look: dict[str, Any] = {"colour": colours.colour(k)}
        panel.traces += [
            Trace("band", columns(of, x=place, y=band), study, **look),
            Trace("law", columns(of, x=place, y=band.value), study, study, line="-", **look),
            Trace("curve", columns(of, x=place, y=measured), "data", label, marker="o", **look),
        ]
        panel.keys.append(Key(label, look["colour"], "", "o"))
    panel.keys.append(Key("median of the calibrated study", "#808080", "-"))
    return panel


def _residuals(found: fit.Calibration, x: Axis, curves: Mapping[str, Points], data: xr.Dataset) -> Panel:
    panel = Panel(x, Axis("residual over its error"))
    every = _along(found, x, np.concatenate(list(curves.values())), data)
    ends = np.array([every.min(), every.max()])
    strip = columns(x=ends, y=Mean(np.zeros(2), np.full(2, -HALF), np.full(2, HALF)))
    panel.traces.append(Trace("band", strip, "95 % of normal residuals", colour="#b0b0b0"))
    panel.traces.append(Trace("law", columns(x=ends, y=np.zeros(2)), "zero", "", "#000000", "-"))
    for k, (label, points) in enumerate(curves.items()):
        of, place = conditions(found.measured, data, points), _along(found, x, points, data)
        residuals = columns(of, x=place, y=found.residuals.scaled[points])
        panel.traces.append(Trace("curve", residuals, "data", label, colours.colour(k), "", "o"))
    return panel


def _density(found: fit.Calibration, name: str, values: FloatArray, how: labels.Quantity, is_free: bool) -> Panel:
    """Return the panel with the density and the 68 % and 95 % intervals of an unknown or a product of unknowns.

    If the data do not determine the unknown (`is_free`), the panel shows no intervals.
    """
    shown, weights = how.of(values), found.posterior.weights
    known = name in found.unknowns
    log = bool(np.all(shown > 0)) and (not known or found.prediction.scales[found.unknowns.index(name)].logarithmic)
    across = np.log(shown) if log else shown
    if known:
        _, first, cell = np.unique(
            found.posterior.places[:, found.unknowns.index(name)], return_index=True, return_inverse=True
        )
        centres, density = across[first], np.bincount(cell, weights)
    else:
        ends = posterior.quantiles(across, weights, [1e-4, 1 - 1e-4])
        density, edges = np.histogram(across, np.histogram_bin_edges(across, "sturges", tuple(ends)), weights=weights)
        centres = (edges[1:] + edges[:-1]) / 2
    height, back = density / density.max(), np.exp if log else np.asarray
    colour = "#909090" if is_free else colours.colour(1)
    x = Axis(labels.with_unit(how.symbol, how.unit), log)
    panel = Panel(x, Axis("probability density", ticks=[(0.0, "0")], low=0.0))
    panel.traces.append(Trace("law", columns(x=back(centres), y=height), f"density of {name}", "", colour, "-"))
    if is_free:
        panel.title = "not determined"
        return panel
    for level in posterior.LEVELS.values():
        low, high = posterior.quantiles(across, weights, [0.5 - level / 2, 0.5 + level / 2])
        inside = np.concatenate([[low], centres[(centres > low) & (centres < high)], [high]])
        below = np.interp(inside, centres, height)
        shade = columns(x=back(inside), y=Mean(below, np.zeros(inside.size), below))
        panel.traces.append(Trace("band", shade, f"{level:.0%} of {name}", "", colour))
    low, middle, high = back(posterior.quantiles(across, weights, [0.025, 0.5, 0.975]))
    panel.title = f"{middle:.3g} ({low:.3g}, {high:.3g}) {labels.printed_unit(how.unit)}".strip()
    return panel


PLOTS = (
    Plot(
        "calibration",
        (),
        "measured points with the band of the study, residuals, and the density of each unknown",
        calibration,
        fitted=True,
    ),
)
