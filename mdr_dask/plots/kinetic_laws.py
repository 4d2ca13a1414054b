"""Figures of the laws of the kinetics of friction (thesis Figs. 4.4-4.7)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mdr_dask.errors import DataError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


INTERVALS = "bars: 95 % intervals, bootstrap over the realisations"


def _fitted(series: Mapping[str, xr.Dataset], name: str) -> xr.Dataset:
    from mdr_dask.fit.kinetics import FITS

    return next(fit for fit in FITS if fit.name == name).compute(series)


def _meant(series: Mapping[str, xr.Dataset]) -> Mapping[str, xr.Dataset]:
    """Return the series of most velocities and, of those, most Hurst exponents, as in Figs. 4.5-4.7."""
    if not series:
        raise DataError("expected a store with at least one series, got none")
    both = {name: data for name, data in series.items() if {"velocity", "hurst"} <= set(data.dims)} or series
    return dict([max(both.items(), key=lambda item: [item[1].sizes.get(dim, 1) for dim in ("velocity", "hurst")])])


def _colours(values: np.ndarray) -> list[Any]:
    """Return one colour for every value, by rank."""
    from matplotlib import colormaps

    places = np.linspace(0, 0.92, values.size) if values.size > 1 else np.array([0.3])
    return [colormaps["viridis"](place) for place in places]


def _bars(found: xr.Dataset, name: str) -> np.ndarray:
    """Return the lengths of error bars down and up to the ends of the intervals."""
    value = found[name].values
    bars: np.ndarray = np.clip([value - found[f"{name}_low"].values, found[f"{name}_high"].values - value], 0, None)
    return bars


def draw_jump(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw mu_1 and d_mu_0 v_1 / dv over the velocity for every load, with eq. 4.11 (Fig. 4.4)."""
    from matplotlib.figure import Figure

    from mdr_dask.fit.kinetics import LAW, jump_law

    data = next(
        (data for data in series.values() if {"velocity", "normal_force"} <= set(data.dims)),
        next(iter(series.values())),
    )
    spare = set(data["friction_coefficient_before"].dims) - {"realisation", "velocity", "normal_force"}
    data = data.isel(dict.fromkeys(spare, 0))
    for axis in ("normal_force", "velocity"):
        data = data if axis in data.dims else data.expand_dims(axis)
    found = _fitted({"": data}, "kinetics")
    figure = Figure(figsize=(9.5, 4), layout="constrained")
    labels = r"$\mu_1/\nabla z$", r"$\Delta\mu_0\,v_1/(\Delta v\,\nabla z)$"
    loads, speed = found["normal_force"].values, found["velocity"].values
    names = "before_over_slope", "jump_over_slope"
    for axes, name, label in zip(figure.subplots(1, 2, sharey=True), names, labels, strict=True):
        for k, colour in enumerate(_colours(loads)):
            line = found.isel(normal_force=k).transpose("velocity")
            axes.errorbar(speed, line[name].values, _bars(line, name), color=colour, lw=1, marker=".", ms=3)
            if name == names[1]:
                axes.plot(speed, jump_law(line[names[0]].values, LAW), ":", color=colour, lw=1)
        axes.set(xscale="log", yscale="log", xlabel=r"$v_1$ (m/s)", ylabel=label)
    figure.axes[1].plot([], [], "k:", lw=1, label=f"eq. 4.11 with {LAW}, from $\\mu_1$ on the left")
    figure.axes[1].legend(frameon=False, fontsize=8)
    figure.suptitle(f"$F_N$ from {loads.min():.2g} (dark) to {loads.max():.2g} N (light); {INTERVALS}", fontsize=10)
    return figure


def _by_hurst(found: xr.Dataset) -> Iterator[tuple[float, Any, xr.Dataset]]:
    """Yield Hurst exponent, colour, and what was found with it, its other axes flattened."""
    found = found if "hurst" in found.dims else found.expand_dims("hurst")
    values = np.atleast_1d(found["hurst"].values)
    for k, colour in enumerate(_colours(values)):
        part = found.isel(hurst=k)
        dims = list(part.sizes)
        yield float(values[k]), colour, part.stack(case=dims) if dims else part.expand_dims("case")


def draw_jump_law(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw d_mu_0 v_1 / dv over mu_1, both over the rms slope, with eq. 4.11 (Fig. 4.5)."""
    from matplotlib.figure import Figure

    from mdr_dask.fit.kinetics import LAW, jump_law

    series = _meant(series)
    cases, law = _fitted(series, "kinetics"), _fitted(series, "jump_law").isel(hurst=-1)
    figure = Figure(figsize=(6, 4.6), layout="constrained")
    axes = figure.subplots()
    for value, colour, part in _by_hurst(cases):
        x, y = part["before_over_slope"].values, part["jump_over_slope"].values
        across, up = _bars(part, "before_over_slope"), _bars(part, "jump_over_slope")
        axes.errorbar(x, y, up, across, fmt=".", color=colour, ms=4, lw=0.6, label=f"H = {value:.3g}")
    ends = [float(cases["before_over_slope"].min()), float(cases["before_over_slope"].max())]
    x = np.geomspace(ends[0], ends[1], 200)
    fitted, low, high = (float(law[f"constant{end}"]) for end in ("", "_low", "_high"))
    axes.plot(x, jump_law(x, LAW), "k-", lw=1, label=f"eq. 4.11, {LAW}")
    axes.plot(x, jump_law(x, fitted), "C3--", lw=1.2, label=f"fitted {fitted:.3f} ({low:.3f}, {high:.3f})")
    axes.fill_between(x, jump_law(x, low), jump_law(x, high), color="C3", alpha=0.25, lw=0)
    axes.plot(x, x, "k:", lw=0.8, label="eq. 4.9")
    axes.set(xscale="log", yscale="log", xlabel=r"$\mu_1/\nabla z$", ylabel=r"$\Delta\mu_0\,v_1/(\Delta v\,\nabla z)$")
    axes.set_ylim(top=3 * float(cases["jump_over_slope"].max()))
    axes.set_title(INTERVALS, fontsize=9)
    axes.legend(frameon=False, fontsize=7, ncols=2)
    return figure


def draw_rate(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw b over v_1 tau q_max for every Hurst exponent, with the powers fitted (Fig. 4.6)."""
    from matplotlib.figure import Figure

    from mdr_dask.fit.kinetics import well_known

    series = _meant(series)
    cases, powers = _fitted(series, "relaxation"), _fitted(series, "rate_power")
    powers = powers if "hurst" in powers.dims else powers.expand_dims("hurst")
    figure = Figure(figsize=(6.4, 5.2), layout="constrained")
    axes = figure.subplots()
    for k, (value, colour, part) in enumerate(_by_hurst(cases)):
        known = part.isel(case=np.flatnonzero(well_known(part["rate_low"].values, part["rate_high"].values)))
        x = known["passing_number"].values
        bars = _bars(known, "rate")
        axes.errorbar(x, known["rate"], yerr=bars, color=colour, fmt=".", ms=4, lw=0.6, label=f"H = {value:.3g}")
        for regime in ("below", "above"):
            fit = powers.isel(hurst=k).sel(regime=regime)
            inside = x[(x < 1) == (regime == "below")]
            if np.isfinite(fit["power"]) and inside.size:
                line = np.array([inside.min(), inside.max()])
                axes.plot(line, float(fit["factor"]) * line ** float(fit["power"]), color=colour, lw=1)
        whole = np.sort(part["passing_number"].values)
        axes.plot(whole, np.where(whole < 1, whole, whole ** (1 - value)), ":", color=colour, lw=0.8)
    axes.plot([], [], "k-", lw=1, label="power fitted")
    axes.plot([], [], "k:", lw=0.8, label="eq. 4.12")
    axes.axvline(1, color="0.7", lw=0.8)
    axes.set(xscale="log", yscale="log", xlabel=r"$v_1 \tau q_{max}$", ylabel="$b$")
    axes.set_title(f"{INTERVALS}; rates known to a factor of 1.6", fontsize=9)
    axes.legend(frameon=False, fontsize=7, ncols=2)
    return figure


def draw_power(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the power of b over v_1 tau q_max over the Hurst exponent (Fig. 4.7)."""
    from matplotlib.figure import Figure

    powers = _fitted(_meant(series), "rate_power")
    powers = powers if "hurst" in powers.dims else powers.expand_dims("hurst")
    figure = Figure(figsize=(5.4, 4), layout="constrained")
    axes = figure.subplots()
    for regime, name, style, label in (
        ("above", "power", "C0o", r"$v_1\tau q_{max} > 1$"),
        ("above", "power_unweighted", "C7x", r"$v_1\tau q_{max} > 1$, all times alike"),
        ("below", "power", "C1s", r"$v_1\tau q_{max} < 1$"),
    ):
        fit = powers.sel(regime=regime)
        fit = fit.isel(hurst=np.flatnonzero(np.isfinite(fit[name].values)))
        axes.errorbar(
            fit["hurst"].values, fit[name].values, yerr=_bars(fit, name), fmt=style, ms=4, capsize=2, label=label
        )
    line = np.array([0.0, 1.0])
    axes.plot(line, 1 - line, "k-", lw=1, label="1 - H")
    axes.plot(line, [1, 1], "k:", lw=1, label="1")
    axes.set(xlabel="Hurst exponent H", ylabel="power of $b$")
    axes.set_title(INTERVALS, fontsize=9)
    axes.legend(frameon=False, fontsize=8)
    return figure
