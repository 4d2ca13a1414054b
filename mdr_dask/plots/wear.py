"""Figures of fretting wear: thesis figures 6.1 to 6.3, the error of the fast rule, and volumes with their scatter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.errors import DataError
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODELS = ("fretting_wear",)
RULE = "wear_rule"
LINES = {"exact": "--", "fast": "-", "limit": ":"}
#: What a title says of a case; rules and shapes come from the parameters of the series.
CASE = (
    *("shape", RULE, "hold", "stick_radius", "cycles", "xi", "indenter_radius", "indenter_angle", "contact_modulus"),
    *("friction", "amplitude", "normal_force", "depth"),
)
PROFILES = (("worn_profile", "radius"), ("worn_image", "position"))


def _named_rules(data: xr.Dataset) -> xr.Dataset:
    """Return a series with its rule, shape and load condition as coordinates, where they are fixed."""
    parameters = curves.parameters_of(data)
    words = {name: parameters.get(name) for name in (RULE, "hold")}
    words["shape"] = (parameters.get("indenter") or {}).get("shape") if "indenter" not in data.coords else None
    fixed = {name: word for name, word in words.items() if isinstance(word, str) and name not in data.coords}
    return data.assign_coords(fixed)


def _series(groups: Mapping[str, xr.Dataset], outputs: Sequence[str], *varied: str) -> dict[str, xr.Dataset]:
    return {name: _named_rules(data) for name, data in curves.with_outputs(groups, outputs, *varied).items()}


def _rules(data: xr.Dataset) -> list[str]:
    return [str(rule) for rule in np.ravel(data[RULE].values)] if RULE in data.coords else [""]


def _prefer(data: xr.Dataset, rule: str) -> xr.DataArray | None:
    """Return where a rule stands on its axis, to hold it there."""
    return (data[RULE] == rule).astype(float) if RULE in data.dims else None


def draw_development(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw f(r) and g(x) for growing numbers of cycles in one case (figure 6.1)."""
    found = _series(groups, ["worn_profile", "worn_image"], "cycles")
    name, data = next(((n, d) for n, d in found.items() if "exact" in _rules(d)), next(iter(found.items())))
    rest = [other for other in found if other != name]
    if "cycles" not in data["worn_profile"].dims:
        raise DataError("expected cycles as an axis of its own: a shape develops in one case")
    others = [dim for dim in curves.axes_of(data, "worn_profile") if dim != "cycles"]
    data, told = curves.hold(data, others, _prefer(data, "exact"))
    figure, panels = drawing.panels(2)
    for axes, (output, place) in zip(panels, PROFILES, strict=True):
        one = curves.family(data, output, place, ("cycles",))
        for curve in one.curves:
            drawing.curve(axes, curve._replace(marker=""), data[place], curves.measured(curve.data, output))
        _draw_limit(axes, groups, data, output, place)
        _label(axes, output, data)
        if axes is panels[0] or one.bar:
            curves.finish(figure, axes, one)
    text = curves.fixed_text(curves.scalars(data), CASE)
    style.title(figure, f"development of the worn shape{f', series {name}' if name else ''}", text)
    style.leave_out(figure, [*told, f"series {', '.join(rest)}" if rest else ""])
    return figure


def _draw_limit(axes: Axes, groups: Mapping[str, xr.Dataset], data: xr.Dataset, output: str, place: str) -> None:
    """Add the limit of the same case, dotted, from any series that holds it."""
    for other in groups.values():
        named = _named_rules(other)
        if output not in named or "limit" not in _rules(named) or not _alike(named, data):
            continue
        limit = named.isel({RULE: _rules(named).index("limit")}) if RULE in named.dims else named
        keys = [key for key in ("stick_radius", "amplitude", "normal_force", "depth") if key in limit.dims]
        limit = limit.sel({key: data[key] for key in keys if key in data.coords}, method="nearest")
        rest = [dim for dim in curves.axes_of(limit, output) if limit.sizes[dim] > 1 and dim != "cycles"]
        if any(not np.allclose(limit[key], data[key]) for key in keys if key in data.coords) or rest:
            continue
        limit = limit.isel(dict.fromkeys(curves.axes_of(limit, output), -1))
        drawing.law(axes, limit[place], aggregation.mean(limit[output]), "k:", of=limit, label="limit")
        return


def _alike(one: xr.Dataset, other: xr.Dataset) -> bool:
    """Return whether two series have the same shape and load condition."""
    return all(
        str(one[name].values) == str(other[name].values)
        for name in ("shape", "hold")
        if name in one.coords and name in other.coords
    )


def draw_profiles(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw f(r) and g(x) by all rules, a row for each stick radius or other parameter (figures 6.2 and 6.3)."""
    found = _series(groups, ["worn_profile"])
    several = {name: data for name, data in found.items() if len(_rules(data)) > 1}
    rest = [name for name in found if several and name not in several]
    told = [f"series {', '.join(rest)}" if rest else ""]
    rows = [row for name, data in (several or found).items() for row in _rows(name, data)]
    chosen = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), style.MOST_PANELS)).round().astype(int))
    if chosen.size < len(rows):
        told.append(f"{len(rows) - chosen.size} of {len(rows)} cases ({chosen.size} drawn, spread evenly)")
    figure, panels = drawing.panels(2 * chosen.size, columns=2, size=(5.4, 3.0))
    alike = curves.fixed_by_all([_without(curves.scalars(rows[number][1]), ("cycles", RULE)) for number in chosen])
    for k, number in enumerate(chosen):
        name, part = rows[number]
        for axes, (output, place) in zip(panels[2 * k : 2 * k + 2], PROFILES, strict=True):
            if output in part:
                _draw_rules(figure, axes, part, output, place, named=k == 0)
                _label(axes, output, part)
        text = curves.fixed_text(_without(curves.scalars(part), ("cycles", RULE, *alike)), CASE)
        panels[2 * k].set_title(", ".join(part for part in (name, text) if part), fontsize="small", wrap=True)
    style.title(figure, "worn shapes by rule and cycles", curves.fixed_text(alike, CASE))
    style.leave_out(figure, told)
    return figure


def _without(held: Mapping[str, xr.DataArray], names: Sequence[str]) -> dict[str, xr.DataArray]:
    return {name: value for name, value in held.items() if name not in names}


def _rows(name: str, data: xr.Dataset) -> list[tuple[str, xr.Dataset]]:
    """Return a series apart by every axis but rule and cycles."""
    over = curves.along_dim(data, "cycles", "worn_profile")
    dims = [dim for dim in curves.axes_of(data, "worn_profile") if dim not in (RULE, "cycles") and dim != over]
    cells = np.ndindex(*(data.sizes[dim] for dim in dims))
    return [(name, data.isel(dict(zip(dims, cell, strict=True)))) for cell in cells]


def _draw_rules(figure: Figure, axes: Axes, data: xr.Dataset, output: str, place: str, named: bool) -> None:
    """Draw all rules and cycles: exact dashed, fast full, the limit dotted."""
    for rule in _rules(data):
        one = data.isel({RULE: _rules(data).index(rule)}) if RULE in data.dims else data
        over = curves.along_dim(one, "cycles", output)
        if rule == "limit" and over:
            one = one.isel({over: -1})
        family = curves.family(one, output, place, ("cycles",))
        line = LINES.get(rule, "-")
        for curve in family.curves:
            drawn = curve._replace(line=line, marker="", label="", colour="k" if rule == "limit" else curve.colour)
            drawing.curve(axes, drawn, one[place], curves.measured(curve.data, output))
            if rule in ("exact", "") and named and curve.label:
                axes.plot([], [], color=curve.colour, label=curve.label)
        if named:
            axes.plot([], [], line, color="k", label=rule or None)
        if rule in ("exact", "") and family.bar:
            curves.finish(figure, axes, family)
    if named:
        style.legend(axes)


def draw_volume(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the worn volume against the cycles or the path; the band holds 95 % of the realisations."""
    found = {
        name: (data, along)
        for name, data in _series(groups, ["wear_volume"]).items()
        for along in ("cycles", "path")
        if along in data.coords and data[along].size > 1
    }
    if not found:
        raise DataError("no series holds wear_volume over cycles or path")
    shown, told = curves.few({name: data for name, (data, _) in found.items()})
    figure, panels = drawing.panels(len(shown))
    families, most = [], 1
    for axes, (name, data) in zip(panels, shown.items(), strict=True):
        along = found[name][1]
        one = curves.family(data, "wear_volume", along, ("stick_radius", "normal_force", "amplitude", RULE))
        families.append(one)
        most = max(most, data.sizes["realisation"])
        told += [f"{name}: {each}" if name else each for each in one.left_out]
        for curve in one.curves:
            drawing.curve(axes, curve, style.shown(along, curve.data[along]), _spread(curve.data))
        axes.set_xlabel(_over(along, data))
        volume = style.label("wear_volume", data["wear_volume"])
        axes.set_ylabel("worn volume $V/(a_0^2 d_0)$" if dimensionless(data) else volume)
        values = np.asarray(data[along].values, dtype=np.float64)
        if style.is_geometric(values):
            style.logarithmic(axes, "x")
        if not dimensionless(data) and style.is_geometric(data["wear_volume"]):
            style.logarithmic(axes, "y")
        curves.finish(figure, axes, one)
        own = curves.fixed_text(_without(one.held, ("cycles",)), CASE)
        axes.set_title("\n".join(part for part in (name, own) if part), fontsize="small", wrap=True)
    band = f"median of {most} realisations; bands hold 95 % of them" if most > 1 else "one realisation: no bands"
    style.title(figure, "worn volume", band)
    style.leave_out(figure, told)
    return figure


def _spread(data: xr.Dataset) -> drawing.Mean:
    """Return the median of the realisations and what 95 % of them lie within."""
    volume, how = data["wear_volume"], style.quantity("wear_volume", data["wear_volume"])
    if volume.sizes["realisation"] < 2:
        return curves.measured(data, "wear_volume", how.factor)
    known = volume.notnull().any("realisation")
    ends = volume.where(known, 0.0).quantile([0.025, 0.5, 0.975], "realisation", skipna=True).where(known)
    low, middle, high = (how.of(ends.isel(quantile=k)) for k in range(3))
    return drawing.Mean(middle, low, high)


def _over(along: str, data: xr.Dataset) -> str:
    """Return the label of cycles or path."""
    if along == "path":
        return r"sliding path $k E^* l / (\sigma_0 a_0)$" if dimensionless(data) else style.label("path", data["path"])
    return "cycles $N/N_0$" if dimensionless(data) else "cycles $N$"


def draw_fast_error(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the largest error of the fast rule over stick radius and cycles, and the xi that makes it least."""
    error, volume_error, told = compare(groups)
    usual = float(error.xi.sel(xi=0.8, method="nearest"))
    overall = (error["rms"] ** 2).mean(["stick_radius", "cycles"]) ** 0.5
    figure, panels = drawing.panels(4, columns=2)
    best = error.xi.isel(xi=error["rms"].fillna(np.inf).argmin("xi"))
    maps = (
        (error["largest"].sel(xi=usual), rf"largest $|\Delta f|/d_0$ at $\xi$ = {usual:g}", "viridis"),
        (best, r"$\xi$ of the least rms error of f", "cividis"),
        (100 * volume_error.sel(xi=usual), rf"error of the volume at $\xi$ = {usual:g} [%]", "RdBu"),
    )
    for panel, (values, text, colours) in zip(panels, maps, strict=False):
        bound = {"vmin": -abs(values).max(), "vmax": abs(values).max()} if colours == "RdBu" else {}
        unknown = xr.full_like(values, np.nan)
        shown = drawing.Mean(values, unknown, unknown)
        mesh = drawing.field(panel, error.cycles, error.stick_radius, shown, cmap=colours, **bound)
        figure.colorbar(mesh, ax=panel)
        panel.set_title(text, fontsize="small")
        panel.set(xlabel="cycles $N/N_0$", ylabel=style.label("stick_radius"))
        if style.is_geometric(error.cycles):
            style.logarithmic(panel, "x")
    drawing.plain(panels[3], error.xi, overall, "o-", color=style.colour(0))
    least = float(error.xi[int(np.nanargmin(overall.values))])
    panels[3].axvline(least, color="0.6", linewidth=1)
    panels[3].set(xlabel=style.label("xi"), ylabel="rms error of $f/d_0$ over the map")
    panels[3].set_title(rf"least at $\xi$ = {least:.3g}", fontsize="small")
    style.title(figure, "error of the fast rule against the exact one", curves.fixed_text(curves.scalars(error), CASE))
    style.leave_out(figure, told)
    return figure


def compare(groups: Mapping[str, xr.Dataset]) -> tuple[xr.Dataset, xr.DataArray, list[str]]:
    """Compare a series ``fast``, which varies xi, with a series ``exact``.

    Returns
    -------
    error : Dataset
        ``largest`` and ``rms`` of the difference of f over the radius, by stick radius, cycles and xi.
    volume : DataArray
        Relative error of the volume.
    told : list of str
        What else varies and is held.

    Raises
    ------
    DataError
        If the two series are not there, or do not vary stick radius and cycles.
    """
    needed = {"stick_radius", "cycles"}
    if not {"exact", "fast"} <= set(groups) or "xi" not in groups["fast"].dims:
        raise DataError("expected the series exact and fast, the latter over xi; see campaigns/fast_wear_error.yaml")
    both = [groups[name][["worn_profile", "wear_volume"]] for name in ("exact", "fast")]
    if any(not needed <= set(data["worn_profile"].dims) for data in both):
        raise DataError("expected the series exact and fast over the axes stick_radius and cycles")
    told, held = [], []
    for data in both:
        other = [dim for dim in curves.axes_of(data, "worn_profile") if dim not in (*needed, "xi")]
        one, sentences = curves.hold(data.isel(realisation=0, drop=True), other)
        held.append(one)
        told += sentences
    exact, fast = held[0].drop_vars("xi", errors="ignore"), held[1]
    difference = fast.worn_profile - exact.worn_profile
    error = xr.Dataset({"largest": abs(difference).max("radius"), "rms": (difference**2).mean("radius") ** 0.5})
    return error, fast.wear_volume / exact.wear_volume - 1.0, told


def _label(axes: Axes, output: str, data: xr.Dataset) -> None:
    profile = output == "worn_profile"
    axes.set_xlabel("$r/a_0$" if profile else "$x/a_0$")
    name = "f(r)" if profile else "g(x)"
    axes.set_ylabel(f"${name}/d_0$" if dimensionless(data) else f"${name}$ [m]")


def dimensionless(data: xr.Dataset) -> bool:
    """Return whether a series is of pure numbers."""
    if "wear_volume" in data and "units" in data.wear_volume.attrs:
        return bool(data.wear_volume.attrs["units"] == "1")
    return "stick_radius" in data.coords and bool(np.all(np.isfinite(np.ravel(data.stick_radius).astype(float))))


PLOTS: tuple[Plot, ...] = (
    Plot("wear_development", MODELS, "f(r) and g(x) for growing cycles (thesis figure 6.1)", draw_development),
    Plot("wear_profiles", MODELS, "f(r) and g(x), exact, fast and limit (thesis figures 6.2 and 6.3)", draw_profiles),
    Plot("wear_growth", MODELS, "worn volume against cycles or path, with the scatter of realisations", draw_volume),
    Plot("fast_wear_error", MODELS, "error of the fast rule over c and N, and the best xi", draw_fast_error),
)
