"""Figures of sliding friction: those of thesis chapter 3, redrawn from a store."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.fit.friction import FITS, indenter_xi, numbers, spectral_slope, within_indenter_law
from mdr_dask.physics.sliding import laws
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODELS = ("sliding_friction",)
BAND = "bands: standard error over realisations"
MOST_CURVES = 24
FIT = {fit.name: fit for fit in FITS}


def _figure(xlabel: str, ylabel: str, title: str) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4.8), layout="constrained")
    axes = figure.add_subplot()
    axes.set(xlabel=xlabel, ylabel=ylabel)
    axes.set_title(title, fontsize="medium")
    axes.grid(alpha=0.3)
    return figure, axes


def _colours(count: int) -> Any:
    from matplotlib import colormaps

    return colormaps["viridis"](np.linspace(0, 0.9, max(count, 2)))


def _moments(value: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray]:
    """Return mean and standard error over realisations."""
    count = value.count("realisation")
    error = value.std("realisation", ddof=1) / np.sqrt(count) if value.sizes["realisation"] > 1 else 0 * count
    return value.mean("realisation"), error


def _curves(data: xr.Dataset, along: str) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield a label and the data of every curve over one dimension, at most `MOST_CURVES` of them."""
    dims = [str(dim) for dim in data["friction_coefficient"].dims if dim not in (along, "realisation")]
    cells = list(np.ndindex(*(data.sizes[dim] for dim in dims)))
    shown = sorted({round(k) for k in np.linspace(0, len(cells) - 1, min(len(cells), MOST_CURVES))})
    for k in shown:
        part = data.isel(dict(zip(dims, cells[k], strict=True)))
        yield ", ".join(_named(part, dim) for dim in dims), part


def _named(data: xr.Dataset, name: str) -> str:
    """Return a parameter as it stands in a legend."""
    value, unit = data[name].values[()], data[name].attrs.get("units", "1")
    number = f"{value:.3g}" if np.issubdtype(data[name].dtype, np.number) else str(value)
    symbol = {"hurst": "H", "normal_force": "F_N", "shear_modulus": "G", "rms_roughness": "h"}.get(name, name)
    return f"{symbol} = {number}" + ("" if unit == "1" else f" {unit}")


def _with_dimension(series: Mapping[str, xr.Dataset], *names: str) -> tuple[str, xr.Dataset]:
    """Return the first group whose friction varies along all of some parameters."""
    for name, data in series.items():
        if set(names) <= set(data["friction_coefficient"].dims):
            return name, data
    wanted = " and ".join(names)
    raise DataError(f"expected a series whose axes include {wanted}, got {', '.join(series) or 'none'}")


def _constants(data: xr.Dataset) -> tuple[Any, float]:
    return laws.alpha(data["hurst"]), laws.BETA


def _caption(name: str, what: str) -> str:
    return f"{what}{f', series {name}' if name else ''} ({BAND})"


def _legend(axes: Axes, count: int) -> None:
    if count:
        axes.legend(fontsize="x-small", ncols=1 + count // 13, loc="best")


def _draw_regions(series: Mapping[str, xr.Dataset]) -> Figure:
    """Figure 3.7: mu / slope over velocity for one case, with the regions of the law."""
    name, data = _with_dimension(series, "velocity")
    middle = {
        dim: data.sizes[dim] // 2 for dim in data["friction_coefficient"].dims if dim not in ("velocity", "realisation")
    }
    data = data.isel(middle)
    slope = spectral_slope(data)
    mean, error = _moments(data["friction_coefficient"] / slope)
    velocity = data["velocity"].values
    where = ", ".join(_named(data, str(dim)) for dim in middle)
    figure, axes = _figure("velocity v (m/s)", "μ / rms slope", _caption(name, where or "friction over velocity"))
    axes.set_xscale("log")
    axes.fill_between(velocity, (mean - error).values, (mean + error).values, alpha=0.3)
    axes.plot(velocity, mean.values, "o-", ms=3, label="simulated")
    _, force, velocity_number = numbers(data)
    exponent, beta = _constants(data)
    fine = np.geomspace(velocity.min(), velocity.max(), 300)
    scale = float(np.ravel((velocity_number / data["velocity"]).values)[0])
    law = np.sqrt(2) * laws.interpolation(float(force), fine * scale, float(exponent), beta)
    axes.plot(fine, law, "k--", lw=1, label="law (eq. 3.18)")
    edges = [edge / scale for edge in laws.regions(float(force), float(exponent), beta)]
    edges.append(_fall(velocity, mean.values))
    bounds = [velocity.min(), *edges, velocity.max()]
    for left, right, region in zip(bounds[:-1], bounds[1:], ("I", "II", "III", "IV"), strict=True):
        if right > left > 0 and np.isfinite(right):
            centre = np.sqrt(max(left, velocity.min()) * min(right, velocity.max()))
            axes.text(centre, 0.02, region, transform=axes.get_xaxis_transform(), ha="center")
    for edge in edges:
        if velocity.min() < edge < velocity.max():
            axes.axvline(edge, color="grey", lw=0.8, ls=":")
    axes.set_ylim(bottom=0)
    _legend(axes, 2)
    return figure


def _fall(velocity: Any, mean: Any) -> float:
    """Return the velocity beyond the maximum at which friction has lost a twentieth of it, the start of region IV."""
    peak = int(np.nanargmax(mean))
    below = np.flatnonzero(mean[peak:] < 0.95 * mean[peak])
    return float(velocity[peak + below[0]]) if below.size else float(velocity.max())


def _draw_velocity(series: Mapping[str, xr.Dataset]) -> Figure:
    """Figure 3.8: mu / (sqrt 2 slope) over the velocity number, several Hurst exponents, with the law."""
    name, data = _with_dimension(series, "velocity")
    figure, axes = _figure("v τ · slope / (√2 h)", "μ / (√2 · slope)", _caption(name, "friction over velocity"))
    axes.set_xscale("log")
    curves = list(_curves(data, "velocity"))
    for colour, (label, part) in zip(_colours(len(curves)), curves, strict=True):
        slope = spectral_slope(part)
        mean, error = _moments(part["friction_coefficient"] / (np.sqrt(2) * slope))
        _, force, velocity = numbers(part)
        axes.fill_between(velocity.values, (mean - error).values, (mean + error).values, color=colour, alpha=0.25)
        axes.plot(velocity.values, mean.values, "o", ms=3, color=colour, label=label)
        law = laws.interpolation(force, velocity, *_constants(part))
        axes.plot(velocity.values, law.values, "-", lw=1, color=colour)
    axes.plot([], [], "k-", lw=1, label="law (eq. 3.18)")
    _legend(axes, len(curves) + 1)
    return figure


def _draw_forces(series: Mapping[str, xr.Dataset]) -> Figure:
    """Figure 3.9: mu / slope over velocity, both logarithmic, for many loads."""
    name, data = _with_dimension(series, "velocity", "normal_force")
    inner = {dim: data.sizes[dim] // 2 for dim in data["friction_coefficient"].dims}
    for dim in ("velocity", "normal_force", "realisation"):
        inner.pop(dim, None)
    data = data.isel(inner)
    fixed = ", ".join(_named(data, str(dim)) for dim in inner)
    figure, axes = _figure("velocity v (m/s)", "μ / rms slope", _caption(name, fixed or "friction over velocity"))
    axes.set(xscale="log", yscale="log")
    curves = list(_curves(data, "velocity"))
    for colour, (label, part) in zip(_colours(len(curves)), curves, strict=True):
        mean, error = _moments(part["friction_coefficient"] / spectral_slope(part))
        low = (mean - error).where(mean > error)
        axes.fill_between(part["velocity"].values, low.values, (mean + error).values, color=colour, alpha=0.3)
        axes.plot(part["velocity"].values, mean.values, "-", lw=1.2, color=colour, label=label)
    _legend(axes, len(curves))
    return figure


def _errorbars(axes: Axes, found: xr.Dataset, name: str, label: str, over: str = "hurst") -> None:
    """Draw a fitted constant with its interval."""
    low, high = found[name] - found[f"{name}_low"], found[f"{name}_high"] - found[name]
    bars = np.clip([low.values, high.values], 0, None)
    axes.errorbar(found[over].values, found[name].values, bars, fmt="o", ms=4, capsize=2, label=label)


def _over_hurst(name: str, series: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
    """Fit every series that varies the Hurst exponent; return the results by a suffix for the legend."""
    found = {key: fit for key, fit in FIT[name].results(series).items() if "hurst" in fit.dims}
    if not found:
        raise DataError("expected a store with an axis hurst, to draw over it")
    return {f" ({key})" if len(found) > 1 else "": fit for key, fit in found.items()}


def _draw_zone_one(series: Mapping[str, xr.Dataset]) -> Figure:
    """Figure 3.10: alpha and beta over the Hurst exponent, with H / (1 + H)."""
    found = _over_hurst("zone_one", series)
    figure, axes = _figure("Hurst exponent H", "α", "law of zone 1: μ/slope = β (v τ slope/h) (GhL/F)^α (bars: 95 %)")
    other = axes.twinx()
    for suffix, part in found.items():
        _errorbars(axes, part, "alpha", f"α{suffix}")
        other.errorbar(
            part["hurst"].values,
            part["beta"].values,
            [(part["beta"] - part["beta_low"]).values, (part["beta_high"] - part["beta"]).values],
            fmt="s",
            ms=4,
            mfc="none",
            capsize=2,
            color="tab:red",
            label=f"β{suffix}",
        )
    fine = np.linspace(0, 1, 101)
    axes.plot(fine, laws.alpha(fine), "k-", label="H / (1 + H) (eq. 3.13)")
    axes.set(ylim=(0, 0.6))
    other.set(ylabel="β", ylim=(0, 2.4))
    lines, labels = axes.get_legend_handles_labels()
    more, more_labels = other.get_legend_handles_labels()
    axes.legend(lines + more, labels + more_labels, fontsize="small", loc="lower right")
    return figure


def _draw_plateau(series: Mapping[str, xr.Dataset]) -> Figure:
    """Figure 3.11: the plateau over the Hurst exponent, one curve for every load."""
    found = _over_hurst("plateau", series)
    figure, axes = _figure("Hurst exponent H", "largest μ / rms slope", "plateau of friction (bars: 95 %)")
    curves = []
    for suffix, part in found.items():
        others = [str(dim) for dim in part["plateau"].dims if dim != "hurst"]
        for index in np.ndindex(*(part.sizes[dim] for dim in others)):
            one = part.isel(dict(zip(others, index, strict=True)))
            curves.append((", ".join(_named(one, dim) for dim in others) + suffix or "simulated", one))
    shown = curves[:: max(1, len(curves) // 10)]
    axes.set_prop_cycle(color=_colours(len(shown)))
    for label, one in shown:
        _errorbars(axes, one, "plateau", label)
    axes.axhline(np.sqrt(2), color="k", lw=1, ls="--", label="√2 (eq. 3.15)")
    axes.set_ylim(bottom=0)
    _legend(axes, len(shown) + 1)
    return figure


def _draw_indenter(series: Mapping[str, xr.Dataset]) -> Figure:
    """Figures 3.14 and 3.15: mu / (sqrt 2 slope) over xi of rough indenters, with the law."""
    figure, axes = _figure(
        "ξ = 8 G a τ v · slope / (√2 F_N)", "μ / (√2 · slope)", f"rough indenters against their law ({BAND})"
    )
    axes.set(xscale="log", yscale="log")
    drawn, left_out = [], 0
    for (name, data), colour in zip(series.items(), _colours(len(series)), strict=False):
        slope = spectral_slope(data)
        mean, error = _moments(data["friction_coefficient"] / (np.sqrt(2) * slope))
        columns = xr.broadcast(indenter_xi(data, slope), mean, error, within_indenter_law(data, slope))
        xi, height, bar, within = (column.values.ravel() for column in columns)
        known = np.isfinite(height) & (height > 0)
        beyond, known = known & ~within, known & within
        left_out += int(beyond.sum())
        axes.plot(xi[beyond], height[beyond], ".", ms=2, color="0.85", zorder=1)
        axes.errorbar(
            xi[known], height[known], bar[known], fmt="o", ms=3, lw=0.8, color=colour, label=name or "simulated"
        )
        drawn.append(xi[known | beyond])
    if left_out:
        axes.plot([], [], ".", color="0.7", label="steep or barely touching body, region IV")
    span = np.concatenate(drawn)
    if not span.size:
        raise DataError("expected a store with friction of a rough indenter, got none")
    fine = np.geomspace(span.min(), span.max(), 300)
    axes.plot(fine, laws.indenter(fine), "k-", lw=1, label="law (eq. 3.40), α = 1.5")
    axes.plot(fine, np.minimum(fine, 1), "k:", lw=0.8, label="limits (eq. 3.34, 3.36)")
    _legend(axes, len(drawn) + 3)
    return figure


PLOTS: tuple[Plot, ...] = (
    Plot("regions", MODELS, "friction over velocity with regions I to IV (Fig. 3.7)", _draw_regions),
    Plot("velocity", MODELS, "friction over velocity and the law, e.g. for several H (Fig. 3.8)", _draw_velocity),
    Plot("force", MODELS, "friction over velocity for many loads, logarithmic (Fig. 3.9)", _draw_forces),
    Plot("zone_one", MODELS, "alpha and beta over the Hurst exponent (Fig. 3.10)", _draw_zone_one),
    Plot("plateau", MODELS, "plateau of friction over the Hurst exponent (Fig. 3.11)", _draw_plateau),
    Plot("indenter", MODELS, "friction of rough indenters against their law (Fig. 3.14, 3.15)", _draw_indenter),
)
