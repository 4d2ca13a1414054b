"""What a table of measured points says of the unknowns of a study: data and band, residuals, marginals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits import calibration as room
from mdr_dask.fits import identifiability
from mdr_dask.plots import drawing, style
from mdr_dask.plots.base import Plot
from mdr_dask.plots.drawing import Mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Cells of the posterior whose predictions make the band, and parts that a marginal is drawn in.
CELLS, PARTS = 400, 60
#: Curves with colours of their own.
MOST_CURVES = 7
#: Quantiles of a normal distribution at 95 %.
_Z = 1.96


class _Curve(NamedTuple):
    """Points that differ in one condition only."""

    label: str
    colour: str
    points: NDArray[np.intp]


def calibration(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw measured points with the band of the study, their residuals, and the marginal of each unknown.

    Bars of points are errors of measurement, the band is that of the posterior, both 95 %. A marginal is grey where the
    data do not determine its unknown, and the marginals of what they determine instead follow.
    """
    found, series = _first(groups)
    marginals = [
        (name, found.values[:, k], found.units[name], k in found.free) for k, name in enumerate(found.unknowns)
    ]
    marginals += [(*_named(found, product), False) for product in found.products]
    figure, axes = drawing.panels(2 + len(marginals), size=(4.2, 3.4))
    main = max(found.measured.conditions, key=lambda name: np.unique(found.measured.conditions[name]).size, default="")
    curves = _curves(found, main)
    _data(axes[0], found, main, curves)
    _residuals(axes[1], found, main, curves)
    for panel, (name, values, unit, is_free) in zip(axes[2:], marginals, strict=True):
        _marginal(panel, found, name, values, unit, is_free)
    about = f"{found.measured.source}, {found.measured.values.size} points{f', series {series}' if series else ''}"
    style.title(figure, f"calibration: {room.sentence(found)}", f"{about}; bars, bands and shades: 95 % (dark: 68 %)")
    return figure


def _first(groups: Mapping[str, xr.Dataset]) -> tuple[room.Calibration, str]:
    """Return the calibration of the first series that the table is of."""
    reasons = []
    for name, dataset in groups.items():
        try:
            return room.calibrate(dataset, room.measured_of(dataset)), name
        except FitError as error:
            reasons.append(str(error))
    raise FitError("; ".join(dict.fromkeys(reasons)))


def _named(found: room.Calibration, product: identifiability.Product) -> tuple[str, FloatArray, str]:
    units = [found.units[name] for name in found.unknowns]
    name = identifiability.written(found.unknowns, product.exponents)
    return name, product.values, identifiability.unit_of(units, product.exponents)


def _axis(found: room.Calibration, name: str, values: Any) -> xr.DataArray:
    """Return values of a parameter or of the output as figures take them."""
    attributes = {"units": found.units.get(name, "1"), "long_name": name.replace("_", " ")}
    return xr.DataArray(np.asarray(values), dims="point", name=name, attrs=attributes)


def _curves(found: room.Calibration, main: str) -> list[_Curve]:
    """Return the points in groups of equal conditions other than the one along the axis."""
    others = {name: each for name, each in found.measured.conditions.items() if name != main}
    rows = np.stack(list(others.values()), axis=1) if others else np.zeros((found.measured.values.size, 1))
    places, which = np.unique(np.round(rows, 12), axis=0, return_inverse=True)
    if not 1 < len(places) <= MOST_CURVES:
        return [_Curve("", style.colour(0), np.arange(len(rows)))]
    labels = [
        ", ".join(
            style.named(name, _axis(found, name, value)[0])
            for name, value in zip(others, np.atleast_2d(row).T, strict=True)
        )
        for row in places
    ]
    return [_Curve(label, style.colour(k), np.flatnonzero(which.ravel() == k)) for k, label in enumerate(labels)]


def _along(found: room.Calibration, main: str, points: NDArray[np.intp]) -> FloatArray:
    if not main:
        return np.asarray(points, dtype=np.float64) + 1
    shown: FloatArray = np.asarray(style.shown(main, _axis(found, main, found.measured.conditions[main][points])))
    return shown


def _finish(axes: Axes, found: room.Calibration, main: str) -> None:
    conditions = found.measured.conditions
    axes.set_xlabel(style.label(main, _axis(found, main, conditions[main])) if main else "measured point")
    if main and style.is_geometric(conditions[main]):
        style.logarithmic(axes, "x")


def _data(axes: Axes, found: room.Calibration, main: str, curves: list[_Curve]) -> None:
    output, values = found.measured.output, found.measured.values
    half = _Z * found.noise[0]
    low, best, high = _band(found)
    for curve in curves:
        at = curve.points[np.argsort(_along(found, main, curve.points))]
        x = _along(found, main, at)
        data = Mean(*(_axis(found, output, each[at]) for each in (values, values - half, values + half)))
        drawing.points(axes, x, data, curve.colour, "o", curve.label or None)
        drawing.law(axes, x, best[at], "-", color=curve.colour, name=f"study {curve.label}".strip(), linewidth=1)
        drawing.band(axes, x, low[at], high[at], f"study {curve.label}".strip(), color=curve.colour)
    if style.is_geometric(values) and found.prediction.logarithmic:
        style.logarithmic(axes, "y")
    _finish(axes, found, main)
    axes.set_ylabel(style.label(output, _axis(found, output, values)))
    style.legend(axes)


def _band(found: room.Calibration) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what the study predicts at the points: low end, median and high end of 95 %."""
    steps = (np.arange(CELLS) + 0.5) / CELLS
    cells = np.searchsorted(np.cumsum(found.posterior.weights), steps).clip(0, len(found.posterior.weights) - 1)
    low, middle, high = np.quantile(found.prediction(found.posterior.places[cells]).mean, [0.025, 0.5, 0.975], axis=0)
    return low, middle, high


def _residuals(axes: Axes, found: room.Calibration, main: str, curves: list[_Curve]) -> None:
    unknown = np.full(found.measured.values.size, np.nan)
    for curve in curves:
        scaled = _axis(found, "residual", found.residuals.scaled[curve.points])
        empty = _axis(found, "residual", unknown[curve.points])
        x = _along(found, main, curve.points)
        drawing.points(axes, x, Mean(scaled, empty, empty), curve.colour, "o", None)
    axes.axhline(0, color="black", linewidth=0.8)
    axes.axhspan(-_Z, _Z, color="0.9", zorder=0)
    _finish(axes, found, main)
    axes.set_ylabel("residual over its error")
    axes.set_title(style.broken(found.law_holds, 52), fontsize="x-small")


def _marginal(axes: Axes, found: room.Calibration, name: str, values: FloatArray, unit: str, is_free: bool) -> None:
    """Draw the marginal density of an unknown, or of a product, over its natural scale."""
    known = name in found.unknowns
    shown = np.asarray(style.shown(name, _axis(found, name, values))) if known else values
    label = style.label(name, _axis(found, name, values)) if known else style.with_unit(name, unit)
    geometric = bool(np.all(shown > 0)) and (not known or _is_geometric(found, name))
    weights = found.posterior.weights
    across = np.log(shown) if geometric else shown
    ends = identifiability.quantiles(across, weights, [1e-4, 1 - 1e-4])
    if known and is_free:
        ends = np.array([across.min(), across.max()])
    margin = 1e-9 * np.abs(ends).max()
    edges = np.linspace(ends[0] - margin, ends[1] + margin, PARTS + 1)
    if known:
        place = found.posterior.places[:, found.unknowns.index(name)]
        edges = _of_whole_cells(ends, across, place, found.posterior.width)
    density = np.histogram(across, edges, weights=weights)[0]
    centres = (edges[1:] + edges[:-1]) / 2
    smooth = np.convolve(np.pad(density, 2, mode="edge"), [0.1, 0.2, 0.4, 0.2, 0.1], mode="valid")
    height = smooth / smooth.max()
    x = np.exp(centres) if geometric else centres
    colour = "0.6" if is_free else style.colour(style.FITTED)
    drawing.law(axes, x, height, "-", color=colour, name=f"density of {name}")
    if not is_free:
        for level, alpha in ((0.95, 0.2), (0.6827, 0.35)):
            low, high = identifiability.quantiles(across, weights, [0.5 - level / 2, 0.5 + level / 2])
            inside, shaded = between(centres, height, low, high)
            inside = np.exp(inside) if geometric else inside
            axes.fill_between(inside, shaded, color=colour, alpha=alpha, linewidth=0, gid=style.LAW)
    axes.set_ylim(0, 1.1)
    axes.set_yticks([])
    axes.set_xlabel(style.broken(label, 44))
    if geometric:
        style.logarithmic(axes, "x")
    if is_free:
        axes.set_title("not determined", fontsize="small")


def between(x: FloatArray, y: FloatArray, low: float, high: float) -> tuple[FloatArray, FloatArray]:
    """Return the part of a curve between two ends, which lie on it."""
    inside = np.concatenate([[low], x[(x > low) & (x < high)], [high]])
    return inside, np.interp(inside, x, y)


def _of_whole_cells(ends: FloatArray, across: FloatArray, place: FloatArray, width: float) -> FloatArray:
    """Return edges of parts that hold as many cells each: others would show a density that beats with the cells."""
    low, high = int(place.argmin()), int(place.argmax())
    cell = width * (across[high] - across[low]) / (place[high] - place[low])
    start = across[low] - cell / 2
    first, last = np.floor((ends[0] - start) / cell), np.ceil((ends[1] - start) / cell)
    cells = max(1, int(np.ceil((last - first) / PARTS)))
    edges: FloatArray = start + cell * np.arange(first, max(last, first + cells) + 1, cells)
    return edges


def _is_geometric(found: room.Calibration, name: str) -> bool:
    return found.prediction.scales[found.unknowns.index(name)].logarithmic


PLOTS = (
    Plot(
        "calibration",
        (),
        "measured points with the band of the study, residuals, marginals of the unknowns",
        calibration,
    ),
)
