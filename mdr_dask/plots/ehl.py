"""Figures of the lubricated line contact: thesis figure B.3, the film against its formulas and limits, traction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.ehl_line import groups as groups_of
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODELS = ("ehl_line",)
#: What a title says of a case.
CASE = (
    *("load_parameter", "speed_parameter", "material_parameter", "line_load", "mean_velocity", "pressure_viscosity"),
    *("radius", "viscosity", "contact_modulus", "slide_roll_ratio", "inlet"),
)


def _one(dataset: xr.Dataset) -> xr.Dataset:
    """Return the first realisation: the model is not random, the others are the same."""
    return dataset.isel(realisation=0) if "realisation" in dataset.dims else dataset


def _with(groups: Mapping[str, xr.Dataset], outputs: tuple[str, ...], *varied: str) -> dict[str, xr.Dataset]:
    """Return the series that hold the outputs, and vary along parameters."""
    return curves.with_outputs(groups, outputs, *varied)


class _Films(NamedTuple):
    """The cases of a series: W, U, G and the film found, of one shape; NaN where there is no film."""

    W: xr.DataArray
    U: xr.DataArray
    G: xr.DataArray
    film: xr.DataArray

    def put(self, values: Any) -> xr.DataArray:
        """Return numbers of all cases with their parameters, where there is a film."""
        return self.film.copy(data=values).where(self.film.notnull())


def _films(dataset: xr.Dataset, output: str) -> _Films:
    """Return the cases of a series."""
    one = _one(dataset)
    W, U, G, film = xr.broadcast(*groups_of(one.coords.get), one[output])
    known = film.notnull()
    return _Films(W.where(known), U.where(known), G.where(known), film)


def _require(values: Any) -> None:
    if not np.isfinite(values).any():
        raise DataError("expected a film, got no case that succeeded")


def draw_profile(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw film and pressure against the position, one panel for each series (thesis figure B.3)."""
    found, told = curves.few(_with(groups, ("film", "pressure")))
    figure, panels = drawing.panels(len(found), columns=2)
    families = []
    for axes, (name, data) in zip(panels, found.items(), strict=True):
        family = curves.family(data, "film", "position", styled=False)
        families.append(family)
        told += [f"{name}: {each}" if name else each for each in family.left_out]
        _draw_one_profile(figure, axes, family)
    alike = curves.fixed_by_all([family.held for family in families])
    for axes, name, family in zip(panels, found, families, strict=True):
        own = curves.fixed_text({key: value for key, value in family.held.items() if key not in alike}, CASE)
        axes.set_title(", ".join(part for part in (name, own) if part), fontsize="small", wrap=True)
    subject = "pressure (dashed, left) and film (full line, right)"
    style.title(figure, subject, curves.fixed_text(alike, CASE), _errors(found, "film"))
    style.leave_out(figure, told)
    return figure


def _errors(found: Mapping[str, xr.Dataset], *outputs: str) -> str:
    """Return what bars mean: errors of the grid, as far as the store holds them."""
    one = [data.isel(realisation=[0]) if "realisation" in data.dims else data for data in found.values()]
    text = curves.meaning_of_bars(*one, outputs=outputs)
    return text if "grid" in text else ""


def _measured(data: xr.Dataset, output: str, factor: float = 1.0) -> drawing.Mean:
    """Return an output with the error of its grid."""
    known = data.isel(realisation=[0]) if "realisation" in data.dims else data.expand_dims("realisation")
    return curves.measured(known, output, factor)


def _draw_one_profile(figure: Figure, axes: Axes, family: curves.Family) -> None:
    right = axes.twinx()
    deepest = []
    pressure = style.quantity("pressure", family.curves[0].data["pressure"])
    for curve in family.curves:
        case = curve.data
        pressed = curve._replace(line="--", marker="", label="")
        drawing.curve(axes, pressed, case["position"], _measured(case, "pressure", pressure.factor))
        label = curve.label or ("film" if len(family.curves) == 1 else "")
        drawing.curve(
            right, curve._replace(line="-", marker="", label=label), case["position"], _measured(case, "film")
        )
        deepest.append(np.nanmax(_one(case)["film"].where(abs(case["position"]) <= 1), initial=0.0))
    if len(family.curves) == 1:
        case = family.curves[0].data
        W = float(groups_of(case.coords.get)[0])
        p0 = 2 * pressure.factor * float(case["contact_modulus"]) * np.sqrt(W / (2 * np.pi))
        X = np.linspace(-1, 1, 201)
        dry = p0 * np.sqrt(1 - X**2)
        drawing.law(axes, X, dry, ":", of=case, color="0.5", label="dry contact (Hertz)")
    right.set_ylim(0, 3 * max(deepest) if max(deepest) > 0 else 1)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("position $x/a$ (flow to the right)")
    axes.set_ylabel(style.with_unit("pressure $p$ (dashed)", pressure.unit))
    right.set_ylabel("film $h/R$ (full line)")
    if family.bar:
        curves.colour_bar(figure, [axes], *family.bar)
    curves.name_varying(right, family)
    style.legend_below(axes, right)


def draw_formula(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the films found against those of Pan and Hamrock, for every series that varies W, U or G."""
    from mdr_dask.physics.lubrication.film_formulas import PAN_HAMROCK_CENTRAL, PAN_HAMROCK_MINIMUM

    figure, panels = drawing.panels(2, sharey=True)
    told: list[str] = []
    for axes, output, formula in zip(
        panels, ("central_film", "minimum_film"), (PAN_HAMROCK_CENTRAL, PAN_HAMROCK_MINIMUM), strict=True
    ):
        maps, told = _film_maps(groups, output)
        for index, (name, dataset) in enumerate(maps.items()):
            cases = _films(dataset, output)
            _require(cases.film)
            expected = cases.put(formula(*cases[:3]))
            outside = [bool(formula.outside(*case)) for case in zip(*map(drawing.flat, cases[:3]), strict=True)]
            inside = np.reshape(np.logical_not(outside), cases.film.shape)
            marker = "os^Dv"[index % 5]
            look: dict[str, Any] = {
                "marker": marker,
                "linestyle": "",
                "color": style.colour(index),
                "ms": 4,
            }
            label = name or "film"
            ratio = cases.film / expected
            drawing.plain(axes, expected, ratio.where(inside), label=label, **look)
            if bool(ratio.where(~inside).notnull().any()):
                label += ", outside the range of the formula"
                drawing.plain(axes, expected, ratio.where(~inside), label=label, markerfacecolor="none", **look)
        axes.axhline(1, color="0.5", linewidth=1)
        axes.set_xlabel(f"{formula.name}: $h/R$")
        axes.set_title(output.replace("_", " "), fontsize="small")
        style.logarithmic(axes, "xy")
    panels[0].set_ylabel("film found / film of the formula")
    style.legend(panels[0])
    style.title(figure, "films found against the formulas of Pan and Hamrock")
    style.leave_out(figure, told)
    return figure


def _film_maps(groups: Mapping[str, xr.Dataset], output: str) -> tuple[dict[str, xr.Dataset], list[str]]:
    """Return the fully flooded series that vary load, speed or material parameter, or all if none does."""
    found = _with(groups, (output,))
    maps = {
        name: dataset
        for name, dataset in found.items()
        if any(number.ndim for number in groups_of(dataset.coords.get)) and "inlet" not in dataset.coords
    }
    rest = [name for name in found if maps and name not in maps]
    return maps or found, [f"series {', '.join(rest)}, which do not vary W, U or G alone"] if rest else []


class _Moes(NamedTuple):
    """The cases of a series in Moes' numbers; the film over R sqrt(2 U), and over the limit of its regime."""

    M: xr.DataArray
    L: xr.DataArray
    film: xr.DataArray
    share: xr.DataArray


def _in_moes_numbers(cases: _Films) -> _Moes:
    """Return the cases of one series."""
    from mdr_dask.physics.lubrication.film_formulas import limiting_films, moes_parameters, regime

    numbers = moes_parameters(*cases[:3])
    flat = [drawing.flat(each) for each in cases[:3]]
    limits = limiting_films(*flat)[regime(*flat), range(flat[0].size)].reshape(cases.film.shape)
    scaled = cases.film / np.sqrt(2 * cases.U)
    return _Moes(cases.put(numbers.M), cases.put(numbers.L), scaled, cases.film / limits)


def _every(series: Sequence[_Moes], name: str) -> FloatArray:
    """Return one number of all cases that have a film."""
    values: FloatArray = np.concatenate([drawing.flat(getattr(each, name)) for each in series])
    return values[np.isfinite(values)]


def _moes(groups: Mapping[str, xr.Dataset]) -> tuple[list[_Moes], list[str]]:
    """Return the cases of every series in Moes' numbers, and what is left out."""
    maps, told = _film_maps(groups, "minimum_film")
    found = [_in_moes_numbers(_films(data, "minimum_film")) for data in maps.values()]
    _require(np.concatenate([drawing.flat(each.film) for each in found]))
    return found, told


def draw_regimes(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the minimum film in Moes' numbers with the isoviscous limits, coloured by L."""
    from mdr_dask.physics.lubrication.film_formulas import limiting_films

    series, told = _moes(groups)
    M, L, film = (_every(series, name) for name in ("M", "L", "film"))
    figure, (axes,) = drawing.panels(1)
    how, norm = style.shades(L)
    for one in series:
        dots = drawing.dots(axes, one.M, one.film, one.L, norm=norm, cmap=how, s=16, zorder=3)
    span = np.geomspace(M.min() / 2, M.max() * 2, 100)
    limits = limiting_films(span, np.full(100, 0.5), np.ones(100))
    drawing.law(axes, span, limits[0], "--", color="0.4", label="rigid isoviscous: $4.895/(2M)$")
    drawing.law(axes, span, limits[2], ":", color="0.4", label="elastic isoviscous: $2.05\\,M^{-1/5}$")
    axes.set(xlabel="Moes' load $M = W (2U)^{-1/2}$", ylabel="minimum film $(h_{min}/R)(2U)^{-1/2}$")
    axes.set_ylim(0.5 * min(film.min(), limits[2].min()), 2 * film.max())
    style.logarithmic(axes, "xy")
    style.legend(axes)
    figure.colorbar(dots, label="Moes' lubricant parameter $L = G (2U)^{1/4}$")
    style.title(figure, "minimum film and its isoviscous limits")
    style.leave_out(figure, told)
    return figure


def draw_regime_map(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the four regimes over Moes' numbers with their names, and in them the films found over their limits."""
    from matplotlib.colors import ListedColormap

    from mdr_dask.physics.lubrication.film_formulas import REGIMES, regime

    series, told = _moes(groups)
    M, L = (_every(series, name) for name in ("M", "L"))
    across = np.geomspace(min(0.1, M.min() / 2), max(1e3, M.max() * 2), 300)
    up = np.geomspace(min(0.1, L[L > 0].min(initial=0.1) / 2), max(1e2, L.max() * 2), 300)
    field = regime(across, 0.5, up[:, None])  # with 2 U = 1, M is W and L is G
    figure, (axes,) = drawing.panels(1)
    axes.set(xscale="log", yscale="log")
    shades = ListedColormap(["#dbe9f6", "#fde5c8", "#e2f0d9", "#eadcf0"])
    axes.pcolormesh(across, up, field, cmap=shades, vmin=0, vmax=3, shading="nearest", rasterized=True, gid=style.GUIDE)
    for index, name in enumerate(REGIMES):
        rows, places = np.nonzero(field == index)
        if rows.size:
            middle = (across[int(np.median(places))], up[int(np.median(rows))])
            axes.annotate(name.replace(" ", "\n"), middle, ha="center", va="center", weight="bold", zorder=3)
    how, norm = style.shades(_every(series, "share"), logarithmic=False)
    for one in series:
        dots = drawing.dots(axes, one.M, one.L, one.share, cmap=how, norm=norm, edgecolor="0.2", linewidth=0.5)
    figure.colorbar(dots, label="minimum film found / limit of its regime")
    axes.set(xlabel="Moes' load $M = W (2U)^{-1/2}$", ylabel="Moes' lubricant parameter $L = G (2U)^{1/4}$")
    isoviscous = int((L <= 0).sum())
    style.title(figure, "regimes of the film")
    style.leave_out(figure, [f"{isoviscous} isoviscous cases, L = 0" if isoviscous else "", *told])
    return figure


def _draw_along(
    groups: Mapping[str, xr.Dataset], along: str, outputs: tuple[str, ...], ylabel: str, subject: str
) -> Figure:
    """Draw outputs along one parameter, a panel for each series."""
    found, told = curves.few(_with(groups, outputs, along))
    figure, panels = drawing.panels(len(found))
    families = []
    for axes, (name, data) in zip(panels, found.items(), strict=True):
        family = curves.family(data, outputs[0], along, styled=False)
        families.append(family)
        told += [f"{name}: {each}" if name else each for each in family.left_out]
        for curve in family.curves:
            for output, line, marker in zip(outputs, style.LINES, style.MARKERS, strict=False):
                label = curve.label if output == outputs[0] else ""
                drawn = curve._replace(line=line if family.joined else "", marker=marker, label=label)
                drawing.curve(axes, drawn, style.shown(along, curve.data[along]), _measured(curve.data, output))
        if len(outputs) > 1:
            for output, line, marker in zip(outputs, style.LINES, style.MARKERS, strict=False):
                axes.plot([], [], line, marker=marker, ms=3, color="k", label=output.replace("_", " "))
        axes.set(xlabel=style.label(along, data[along]), ylabel=ylabel)
        axes.set_ylim(bottom=0)
        curves.finish(figure, axes, family)
    alike = curves.fixed_by_all([family.held for family in families])
    for axes, name, family in zip(panels, found, families, strict=True):
        own = curves.fixed_text({key: value for key, value in family.held.items() if key not in alike}, CASE)
        axes.set_title(", ".join(part for part in (name, own) if part), fontsize="small", wrap=True)
    style.title(figure, subject, curves.fixed_text(alike, CASE), _errors(found, *outputs))
    style.leave_out(figure, told)
    return figure


def draw_starvation(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the films against the distance of the inlet from the edge of the contact."""
    outputs = ("central_film", "minimum_film")
    figure = _draw_along(groups, "inlet", outputs, "film $h/R$", "films of a starved contact")
    for axes in figure.axes:
        if axes.get_xlabel():
            axes.set_xscale("symlog", linthresh=1)
            inlets = np.unique(np.concatenate([np.ravel(line.get_xdata()) for line in axes.lines if line.get_gid()]))
            shown = _apart(inlets)
            axes.set_xlim(1.15 * inlets[0], 0.95 * inlets[-1])
            axes.set_xticks(shown, [f"{inlet:.3g}" for inlet in shown], fontsize="small", rotation=60)
    return figure


def _apart(values: FloatArray) -> FloatArray:
    """Return those of sorted negative numbers whose labels do not collide on a logarithmic axis."""
    kept = [values[0]]
    for value in values[1:]:
        if np.log(kept[-1] / value) > np.log(values[0] / values[-1]) / 25:
            kept.append(value)
    return np.array(kept)


def draw_traction(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the traction coefficient against the slide-roll ratio."""
    outputs = ("traction_coefficient",)
    figure = _draw_along(groups, "slide_roll_ratio", outputs, "traction coefficient", "traction")
    for axes in figure.axes:
        if axes.get_xlabel():
            ratios = np.concatenate([np.ravel(line.get_xdata()) for line in axes.lines if line.get_gid()])
            if style.is_geometric(ratios):
                style.logarithmic(axes, "x")
    return figure


PLOTS: tuple[Plot, ...] = (
    Plot("film_profile", MODELS, "film and pressure against the position (thesis figure B.3)", draw_profile),
    Plot("film_formula", MODELS, "films found against the formulas of Pan and Hamrock", draw_formula),
    Plot(
        "film_regimes", MODELS, "minimum film against load in Moes' numbers, with the isoviscous limits", draw_regimes
    ),
    Plot("regime_map", MODELS, "the four regimes by name over Moes' numbers, and the films in them", draw_regime_map),
    Plot("starvation", MODELS, "central and minimum film against the position of the inlet", draw_starvation),
    Plot("traction", MODELS, "traction coefficient against the slide-roll ratio", draw_traction),
)
