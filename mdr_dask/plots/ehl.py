"""Figures of the lubricated line contact: thesis figure B.3, the film against its formulas and limits, traction."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.ehl_line import groups as groups_of
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODELS = ("ehl_line",)
#: Curves in one panel, and panels in one figure, that can still be told apart.
MOST_CURVES = 6
MOST_PANELS = 6

_OUTSIDE_AXES = {"realisation", "position"}
_LABELS = {
    "load_parameter": "load parameter $W$",
    "speed_parameter": "speed parameter $U$",
    "material_parameter": "material parameter $G$",
    "line_load": "line load $w$ [N/m]",
    "mean_velocity": "mean velocity $u$ [m/s]",
    "pressure_viscosity": "pressure-viscosity coefficient $\\alpha$ [1/Pa]",
    "inlet": "inlet $x_{in}/a$",
    "slide_roll_ratio": "slide-roll ratio $(u_1 - u_2)/u$",
    "viscosity": "viscosity $\\eta_0$ [Pa s]",
    "radius": "reduced radius $R$ [m]",
}


def _label(name: str) -> str:
    return _LABELS.get(name, name.replace("_", " "))


def _axes_of(dataset: xr.Dataset, output: str) -> list[str]:
    return [str(dim) for dim in dataset[output].dims if dim not in _OUTSIDE_AXES]


def _one(dataset: xr.Dataset) -> xr.Dataset:
    """Return the first realisation: the model is not random, the others are the same."""
    return dataset.isel(realisation=0) if "realisation" in dataset.dims else dataset


def _with(groups: Mapping[str, xr.Dataset], outputs: tuple[str, ...], axis: str = "") -> dict[str, xr.Dataset]:
    """Return the groups that hold the outputs, and vary along the axis if one is named."""
    found = {
        name: _one(dataset)
        for name, dataset in groups.items()
        if all(output in dataset for output in outputs) and (not axis or axis in dataset.dims)
    }
    if not found:
        along = f" along {axis}" if axis else ""
        raise DataError(f"expected a series with {', '.join(outputs)}{along}, got {', '.join(groups) or 'none'}")
    return found


def _table(dataset: xr.Dataset, output: str) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return W, U, G and an output of all cases of a series, each of shape (cases,)."""
    W, U, G, values = (np.ravel(array) for array in xr.broadcast(*groups_of(dataset.coords.get), dataset[output]))
    return W, U, G, values


def _profiles(dataset: xr.Dataset) -> list[tuple[str, xr.Dataset]]:
    """Return label and profile of some cases with different films: all along the first axis, thinned evenly."""
    axes = _axes_of(dataset, "film")
    if not axes:
        return [("", dataset)]
    for other in axes[1:]:
        dataset = dataset.isel({other: 0})
    count = dataset.sizes[axes[0]]
    chosen: list[tuple[str, xr.Dataset]] = []
    for index in np.unique(np.linspace(0, count - 1, min(count, MOST_CURVES)).astype(int)):
        case = dataset.isel({axes[0]: index})
        label = f"{float(case[axes[0]]):.4g}" if axes[0] in case.coords else f"case {index}"
        if not chosen or not case["film"].identical(chosen[-1][1]["film"].assign_coords(case.coords)):
            chosen.append((label, case))
    return chosen


def draw_profile(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw film and pressure over the position, one panel a series."""
    from matplotlib.figure import Figure

    found = _with(groups, ("film", "pressure"))
    least = min(len(_axes_of(dataset, "film")) for dataset in found.values())
    few = {name: dataset for name, dataset in found.items() if len(_axes_of(dataset, "film")) <= max(1, least)}
    chosen = dict(sorted(few.items(), key=lambda item: len(_axes_of(item[1], "film")))[:MOST_PANELS])
    columns = min(2, len(chosen))
    figure = Figure(figsize=(6.4 * columns, 4.4 * -(-len(chosen) // columns)), layout="constrained")
    for number, (name, dataset) in enumerate(chosen.items()):
        axes = figure.add_subplot(-(-len(chosen) // columns), columns, number + 1)
        _draw_one_profile(axes, dataset)
        axes.set_title(name)
    return figure


def _draw_one_profile(axes: Axes, dataset: xr.Dataset) -> None:
    right = axes.twinx()
    curves = _profiles(dataset)
    for index, (label, case) in enumerate(curves):
        colour = f"C{index}"
        axes.plot(case["position"], case["pressure"] * 1e-9, "--", color=colour, linewidth=1.2)
        right.plot(case["position"], case["film"], color=colour, linewidth=1.6, label=label or "film")
    if len(curves) == 1:
        W = float(groups_of(curves[0][1].coords.get)[0])
        p0 = 2e-9 * float(curves[0][1]["contact_modulus"]) * np.sqrt(W / (2 * np.pi))
        X = np.linspace(-1, 1, 201)
        axes.plot(X, p0 * np.sqrt(1 - X**2), ":", color="0.5", label="dry contact (Hertz)")
        axes.legend(loc="upper left", frameon=False)
    else:
        names = _axes_of(dataset, "film")
        right.legend(title=_label(names[0]), loc="upper left", frameon=False, fontsize="small")
    films = np.concatenate([np.ravel(case["film"].where(abs(case["position"]) <= 1)) for _, case in curves])
    right.set_ylim(0, 3 * float(np.nanmax(films)) if np.isfinite(films).any() else 1)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("position $x/a$ (flow to the right)")
    axes.set_ylabel("pressure $p$ [GPa] (dashed)")
    right.set_ylabel("film $h/R$ (full line)")


def draw_formula(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the films found over those of Pan and Hamrock, against these, for every series that varies W, U or G."""
    from matplotlib.figure import Figure

    from mdr_dask.physics.lubrication.film_formulas import PAN_HAMROCK_CENTRAL, PAN_HAMROCK_MINIMUM

    figure = Figure(figsize=(11, 4.6), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for axes, output, formula in zip(
        panels, ("central_film", "minimum_film"), (PAN_HAMROCK_CENTRAL, PAN_HAMROCK_MINIMUM), strict=True
    ):
        for index, (name, dataset) in enumerate(_film_maps(groups, output).items()):
            W, U, G, films = _table(dataset, output)
            expected = formula(W, U, G)
            inside = np.array([not formula.outside(*case) for case in zip(W, U, G, strict=True)])
            style = {"marker": "os^Dv"[index % 5], "linestyle": "", "color": f"C{index}"}
            label = name or "film"
            axes.plot(expected[inside], films[inside] / expected[inside], label=label, **style)
            if not inside.all():
                label += ", outside the range of the formula"
                axes.plot(
                    expected[~inside], films[~inside] / expected[~inside], markerfacecolor="none", label=label, **style
                )
        axes.axhline(1, color="0.5", linewidth=1)
        axes.set_xscale("log")
        axes.set_xlabel(f"{formula.name}: $h/R$")
        axes.set_title(output.replace("_", " "))
    panels[0].set_yscale("log")
    for which in (panels[0].yaxis.set_major_formatter, panels[0].yaxis.set_minor_formatter):
        which(lambda value, _: f"{value:g}")
    panels[0].set_ylabel("film found over the formula")
    panels[0].legend(frameon=False, fontsize="small")
    return figure


def _film_maps(groups: Mapping[str, xr.Dataset], output: str) -> dict[str, xr.Dataset]:
    """Return the series that vary load, speed or material parameter, or all if none does."""
    found = _with(groups, (output,))
    maps = {
        name: dataset
        for name, dataset in found.items()
        if any(number.ndim for number in groups_of(dataset.coords.get)) and "inlet" not in dataset.dims
    }
    return maps or found


def draw_regimes(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the minimum film in Moes' numbers with the isoviscous limits and lines of equal L."""
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    from mdr_dask.physics.lubrication.film_formulas import limiting_films, moes_parameters

    figure = Figure(figsize=(7.5, 5.2), layout="constrained")
    axes = figure.add_subplot()
    points: list[list[FloatArray]] = []
    for dataset in _film_maps(groups, "minimum_film").values():
        W, U, G, minimum = _table(dataset, "minimum_film")
        points.append([*moes_parameters(W, U, G), minimum / np.sqrt(2 * U)])
    M, L, film = (np.concatenate(column) for column in zip(*points, strict=True))
    dots = axes.scatter(M, film, c=L, norm=LogNorm(), cmap="viridis", zorder=3)
    span = np.geomspace(M.min() / 2, M.max() * 2, 100)
    limits = limiting_films(span, np.full(100, 0.5), np.ones(100))
    axes.plot(span, limits[0], "--", color="0.4", label="rigid isoviscous: $4.895/(2M)$")
    axes.plot(span, limits[2], ":", color="0.4", label="elastic isoviscous: $2.05\\,M^{-1/5}$")
    axes.set(xscale="log", yscale="log", xlabel="Moes' load $M = W (2U)^{-1/2}$")
    axes.set_ylim(0.5 * min(np.nanmin(film), limits[2].min()), 2 * np.nanmax(film))
    axes.set_ylabel("minimum film $(h_{min}/R)(2U)^{-1/2}$")
    axes.legend(frameon=False)
    figure.colorbar(dots, label="Moes' lubricant parameter $L = G (2U)^{1/4}$")
    return figure


def draw_regime_map(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the four regimes over Moes' numbers with their names, and in them the films found over their limits."""
    from matplotlib.colors import ListedColormap
    from matplotlib.figure import Figure

    from mdr_dask.physics.lubrication.film_formulas import REGIMES, limiting_films, moes_parameters, regime

    columns: list[list[FloatArray]] = []
    for dataset in _film_maps(groups, "minimum_film").values():
        W, U, G, minimum = _table(dataset, "minimum_film")
        columns.append([*moes_parameters(W, U, G), minimum / limiting_films(W, U, G)[regime(W, U, G), range(W.size)]])
    M, L, ratio = (np.concatenate(column) for column in zip(*columns, strict=True))
    across = np.geomspace(min(0.1, M.min() / 2), max(1e3, M.max() * 2), 300)
    up = np.geomspace(min(0.1, L[L > 0].min(initial=0.1) / 2), max(1e2, L.max() * 2), 300)
    field = regime(across, 0.5, up[:, None])  # with 2 U = 1, M is W and L is G
    figure = Figure(figsize=(7.5, 5.2), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log")
    shades = ListedColormap(["#dbe9f6", "#fde5c8", "#e2f0d9", "#eadcf0"])
    axes.pcolormesh(across, up, field, cmap=shades, vmin=0, vmax=3, shading="nearest", rasterized=True)
    for index, name in enumerate(REGIMES):
        rows, places = np.nonzero(field == index)
        if rows.size:
            middle = (across[int(np.median(places))], up[int(np.median(rows))])
            axes.annotate(name.replace(" ", "\n"), middle, ha="center", va="center", weight="bold", zorder=3)
    dots = axes.scatter(M, L, c=ratio, cmap="viridis", edgecolor="0.2", linewidth=0.5)
    figure.colorbar(dots, label="minimum film found over the limit of its regime")
    axes.set(xlabel="Moes' load $M = W (2U)^{-1/2}$", ylabel="Moes' lubricant parameter $L = G (2U)^{1/4}$")
    return figure


def _draw_along(groups: Mapping[str, xr.Dataset], axis: str, outputs: tuple[str, ...], ylabel: str) -> Figure:
    """Draw outputs along one axis, a curve for each value of the first other axis."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.8, 4.6), layout="constrained")
    axes = figure.add_subplot()
    colour = 0
    for name, dataset in _with(groups, outputs, axis).items():
        others = [other for other in _axes_of(dataset, outputs[0]) if other != axis]
        for other in others[1:]:
            dataset = dataset.isel({other: 0})
        for index in range(min(dataset.sizes[others[0]], MOST_CURVES) if others else 1):
            case = dataset.isel({others[0]: index}) if others else dataset
            value = f", {_label(others[0])} = {float(case[others[0]]):.4g}" if others else ""
            for output, style in zip(outputs, ("o-", "s--"), strict=False):
                label = f"{name}{value}: {output.replace('_', ' ')}".lstrip(", :")
                axes.plot(case[axis], case[output], style, color=f"C{colour}", markersize=4, label=label)
            colour += 1
    axes.set_xlabel(_label(axis))
    axes.set_ylabel(ylabel)
    axes.legend(frameon=False, fontsize="small")
    return figure


def draw_starvation(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the films over the position of the inlet."""
    figure = _draw_along(groups, "inlet", ("central_film", "minimum_film"), "film $h/R$")
    figure.axes[0].set_xscale("symlog", linthresh=1)
    inlets = np.unique(np.concatenate([dataset["inlet"] for dataset in groups.values() if "inlet" in dataset.dims]))
    figure.axes[0].set_xticks(inlets, [f"{inlet:g}" for inlet in inlets], fontsize="small", rotation=60)
    figure.axes[0].set_ylim(bottom=0)
    return figure


def draw_traction(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the traction coefficient over the slide-roll ratio."""
    figure = _draw_along(groups, "slide_roll_ratio", ("traction_coefficient",), "traction coefficient")
    figure.axes[0].set_xscale("log")
    figure.axes[0].set_ylim(bottom=0)
    return figure


PLOTS: tuple[Plot, ...] = (
    Plot("film_profile", MODELS, "film and pressure over the position (thesis figure B.3)", draw_profile),
    Plot("film_formula", MODELS, "film found over the formulas of Pan and Hamrock, against these", draw_formula),
    Plot("film_regimes", MODELS, "minimum film over load in Moes' numbers, with the isoviscous limits", draw_regimes),
    Plot("regime_map", MODELS, "the four regimes by name over Moes' numbers, and the films in them", draw_regime_map),
    Plot("starvation", MODELS, "central and minimum film over the position of the inlet", draw_starvation),
    Plot("traction", MODELS, "traction coefficient over the slide-roll ratio", draw_traction),
)
