"""Figures of fretting wear: thesis figures 6.1 to 6.3, the error of the fast rule, and volumes with their scatter."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODELS = ("fretting_wear",)
_LINES = {"exact": "--", "fast": "-", "limit": ":"}
_MOST_PANELS = 12


def development(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw f(r) and g(x) for growing numbers of cycles at one stick radius (figure 6.1)."""
    data = _first(groups, ("worn_profile", "worn_image", "cycles"))
    chosen = {dim: 0 for dim in data.worn_profile.dims if dim not in {"cycles", "radius"}}
    figure = _figure(10.0, 4.2)
    left, right = figure.subplots(1, 2)
    for axes, name, place in ((left, "worn_profile", "radius"), (right, "worn_image", "position")):
        curves = data[name].isel({dim: at for dim, at in chosen.items() if dim in data[name].dims})
        for number, cycles in enumerate(data.cycles.values):
            axes.plot(
                data[place], curves.sel(cycles=cycles), color=_shade(number, data.cycles.size), label=f"{cycles:g}"
            )
        _label(axes, name, data)
    _limit(groups, (left, right), data, chosen)
    left.legend(title="cycles", fontsize=8)
    stick = float(np.ravel(data.stick_radius)[0]) if "stick_radius" in data.coords else np.nan
    if np.isfinite(stick):
        figure.suptitle(f"Development of the worn shape, c = {stick:g} $a_0$")
    return figure


def profiles(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw f(r) and g(x) by all methods at every stick radius (figures 6.2 and 6.3)."""
    chosen = {name: data for name, data in groups.items() if data.sizes.get("wear_rule", 0) > 1 and "worn_profile" in data}
    if not chosen:
        raise DataError("no series varies the wear_rule and holds worn_profile; see campaigns/fretting2014.yaml")
    rows = [(name, data, at) for name, data in chosen.items() for at in _places(data, "stick_radius")][:_MOST_PANELS]
    figure = _figure(10.0, 2.9 * len(rows))
    panels = figure.subplots(len(rows), 2, squeeze=False)
    for (name, data, stick), (left, right) in zip(rows, panels, strict=True):
        for axes, output, place in ((left, "worn_profile", "radius"), (right, "worn_image", "position")):
            if output in data:
                _methods(axes, _at(data[output], "stick_radius", stick), data[place])
                _label(axes, output, data)
        left.set_title(f"{name}, c = {stick:g} $a_0$", fontsize=10)
    panels[0, 0].legend(fontsize=8)
    return figure


def volume(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the worn volume over the cycles; the band holds 95 % of the realisations."""
    figure = _figure(6.5, 4.6)
    axes = figure.subplots()
    drawn = 0
    for name, data in groups.items():
        if "wear_volume" not in data or "cycles" not in data.dims:
            continue
        others = [dim for dim in data.wear_volume.dims if dim not in {"cycles", "realisation"}]
        stacked = data.wear_volume.stack(case=others) if others else data.wear_volume.expand_dims("case")
        stacked = stacked.transpose("case", "cycles", "realisation")
        for number in range(min(stacked.sizes["case"], 8)):
            one = stacked.isel(case=number)
            label = ", ".join(f"{dim} {np.ravel(one[dim])[0]}" for dim in others) or name or "volume"
            line = axes.plot(data.cycles, one.median("realisation"), label=label)[0]
            if one.sizes["realisation"] > 1:
                low, high = one.quantile([0.025, 0.975], "realisation").values
                axes.fill_between(data.cycles, low, high, alpha=0.2, color=line.get_color(), linewidth=0)
            drawn += 1
    if not drawn:
        raise DataError("no series holds wear_volume over cycles")
    axes.set_xscale("log")
    axes.set_xlabel("cycles")
    axes.set_ylabel(_axis_text("worn volume V", "m³", "a_0^2 d_0", next(iter(groups.values()))))
    axes.legend(fontsize=8)
    axes.set_title("Median over realisations; band: 95 % of them", fontsize=10)
    return figure


def fast_error(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the largest error of the fast rule over stick radius and cycles, and the xi that makes it least."""
    error, volume_error = compare(groups)
    usual = float(error.xi.sel(xi=0.8, method="nearest"))
    overall = (error["rms"] ** 2).mean(["stick_radius", "cycles"]) ** 0.5
    figure = _figure(12.5, 7.4)
    axes = figure.subplots(2, 2).ravel()
    x, y = error.cycles.values, error.stick_radius.values
    best = error.xi.isel(xi=error["rms"].argmin("xi"))
    maps = (
        (error["largest"].sel(xi=usual), f"largest |Δf| / $d_0$ at ξ = {usual:g}", "viridis"),
        (best, "ξ of the least rms error of f", "cividis"),
        (100 * volume_error.sel(xi=usual), f"error of the volume at ξ = {usual:g}, %", "RdBu"),
    )
    for panel, (values, title, colours) in zip(axes, maps, strict=False):
        bound = {"vmin": -abs(values).max(), "vmax": abs(values).max()} if colours == "RdBu" else {}
        mesh = panel.pcolormesh(
            x, y, values.transpose("stick_radius", "cycles"), cmap=colours, shading="nearest", **bound
        )
        figure.colorbar(mesh, ax=panel)
        panel.set_title(title, fontsize=10)
        panel.set_xscale("log")
        panel.set_xlabel("cycles N")
        panel.set_ylabel("stick radius c / $a_0$")
    axes[3].plot(error.xi, overall, "o-")
    least = float(error.xi[int(np.argmin(overall.values))])
    axes[3].axvline(least, color="0.6", linewidth=1)
    axes[3].set_xlabel("ξ")
    axes[3].set_ylabel("rms error of f over the map / $d_0$")
    axes[3].set_title(f"least at ξ = {least:.3g}", fontsize=10)
    return figure


def compare(groups: Mapping[str, xr.Dataset]) -> tuple[xr.Dataset, xr.DataArray]:
    """Compare a series ``fast``, which varies xi, with a series ``exact``.

    Returns
    -------
    error : Dataset
        ``largest`` and ``rms`` of the difference of f over the radius, by stick radius, cycles and xi.
    volume : DataArray
        Relative error of the volume.

    Raises
    ------
    DataError
        If the two series are not there.
    """
    if not {"exact", "fast"} <= set(groups) or "xi" not in groups["fast"].dims:
        raise DataError("expected the series exact and fast, the latter over xi; see campaigns/fast_wear_error.yaml")
    exact, fast = (groups[name].isel(realisation=0, drop=True) for name in ("exact", "fast"))
    difference = fast.worn_profile - exact.worn_profile.drop_vars("xi", errors="ignore")
    error = xr.Dataset({"largest": abs(difference).max("radius"), "rms": (difference**2).mean("radius") ** 0.5})
    volume = fast.wear_volume / exact.wear_volume.drop_vars("xi", errors="ignore") - 1.0
    return error, volume


def _first(groups: Mapping[str, xr.Dataset], names: tuple[str, ...]) -> xr.Dataset:
    """Return the first series that holds all names."""
    for data in groups.values():
        if all(name in data for name in names) and "cycles" in data.dims:
            return data
    raise DataError(f"no series holds {', '.join(names)} over cycles")


def _places(data: xr.Dataset, name: str) -> list[float]:
    return [float(value) for value in np.ravel(data[name])]


def _at(data: xr.DataArray, name: str, value: float) -> xr.DataArray:
    """Choose a value of an axis, if it is one, and the first entry of every axis that a panel cannot show."""
    chosen = data.sel({name: value}) if name in data.dims else data
    rest = {dim: 0 for dim in chosen.dims if dim not in {"wear_rule", "cycles", "radius", "position"}}
    return chosen.isel(rest)


def _methods(axes: Axes, curves: xr.DataArray, place: xr.DataArray) -> None:
    """Draw all methods and cycles: exact dashed, fast full, the limit dotted."""
    cycles = np.ravel(curves.cycles)
    for method in np.ravel(curves.wear_rule):
        numbers = range(cycles.size if str(method) != "limit" else 1)
        for number in numbers:
            curve = _method(curves, str(method))
            curve = curve.isel(cycles=number) if "cycles" in curve.dims else curve
            colour = "k" if str(method) == "limit" else _shade(number, cycles.size)
            text = str(method) + (f", N = {', '.join(f'{n:g}' for n in cycles)}" if str(method) == "exact" else "")
            axes.plot(place, curve, _LINES[str(method)], color=colour, label=text if number == 0 else None)


def _method(curves: xr.DataArray, name: str) -> xr.DataArray:
    return curves.isel(wear_rule=[str(method) for method in curves.wear_rule.values].index(name))


def _limit(
    groups: Mapping[str, xr.Dataset], panels: tuple[Axes, Axes], data: xr.Dataset, chosen: dict[str, int]
) -> None:
    """Add the limit of the same stick radius, dotted, from any series that holds it."""
    stick = data.stick_radius.isel({dim: at for dim, at in chosen.items() if dim in data.stick_radius.dims})
    for other in groups.values():
        if "wear_rule" not in other.dims or "limit" not in [str(m) for m in other.wear_rule.values]:
            continue
        near = [value for value in _places(other, "stick_radius") if abs(value - float(stick)) < 1e-9]
        if near:
            for axes, name, place in zip(panels, ("worn_profile", "worn_image"), ("radius", "position"), strict=True):
                curve = _at(_method(other[name], "limit"), "stick_radius", near[0])
                curve = curve.isel(cycles=-1) if "cycles" in curve.dims else curve
                axes.plot(other[place], curve, "k:", label="limit")
            return


def _label(axes: Axes, name: str, data: xr.Dataset) -> None:
    profile = name == "worn_profile"
    axes.set_xlabel("r / $a_0$" if profile else "x / $a_0$")
    axes.set_ylabel(_axis_text("f(r)" if profile else "g(x)", "m", "d_0", data))
    if _dimensionless(data):
        deepest = float(data["block_depth"].max()) if "block_depth" in data else 1.0
        axes.set_ylim(0.0, deepest + 0.25)


def _axis_text(what: str, unit: str, symbol: str, data: xr.Dataset) -> str:
    return f"{what} / ${symbol}$" if _dimensionless(data) else f"{what}, {unit}"


def _dimensionless(data: xr.Dataset) -> bool:
    if "wear_volume" in data and data.wear_volume.attrs.get("units") == "1":
        return True
    return "stick_radius" in data.coords and bool(np.all(np.isfinite(np.ravel(data.stick_radius).astype(float))))


def _shade(number: int, count: int) -> tuple[float, float, float]:
    share = number / max(count - 1, 1)
    return (0.1 + 0.75 * share, 0.3 * (1.0 - share) + 0.15, 0.75 * (1.0 - share) + 0.1)


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


PLOTS: tuple[Plot, ...] = (
    Plot("wear_development", MODELS, "f(r) and g(x) for growing cycles (thesis figure 6.1)", development),
    Plot("wear_profiles", MODELS, "f(r) and g(x), exact, fast and limit (thesis figures 6.2 and 6.3)", profiles),
    Plot("wear_volume", MODELS, "worn volume over cycles with the scatter of realisations", volume),
    Plot("fast_wear_error", MODELS, "error of the fast rule over c and N, and the best xi", fast_error),
)
