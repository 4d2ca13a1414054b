"""Figures of the laws of the kinetics of friction (thesis Figs. 4.4-4.7)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _fitted(series: Mapping[str, xr.Dataset], name: str) -> xr.Dataset:
    from mdr_dask.fit.kinetics import FITS

    return next(fit for fit in FITS if fit.name == name).compute(series)


def _meant(series: Mapping[str, xr.Dataset]) -> Mapping[str, xr.Dataset]:
    """Return the series over velocity and Hurst exponent, which Figs. 4.5-4.7 show; all where there is none."""
    return {name: data for name, data in series.items() if {"velocity", "hurst"} <= set(data.dims)} or series


def _colours(values: np.ndarray) -> list[Any]:
    """Return one colour for every value, by rank."""
    from matplotlib import colormaps

    places = np.linspace(0, 0.92, values.size) if values.size > 1 else np.array([0.3])
    return [colormaps["viridis"](place) for place in places]


def draw_jump(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw mu_1 and d_mu_0 v_1 / dv over the velocity for every load (Fig. 4.4)."""
    from matplotlib.figure import Figure

    data = next(
        (data for data in series.values() if {"velocity", "normal_force"} <= set(data.dims)),
        next(iter(series.values())),
    )
    spare = set(data["friction_coefficient_before"].dims) - {"realisation", "velocity", "normal_force"}
    data = data.isel(dict.fromkeys(spare, 0))
    data = data if "normal_force" in data.dims else data.expand_dims("normal_force")
    figure = Figure(figsize=(9.5, 3.8), layout="constrained")
    before = data["friction_coefficient_before"] / data["rms_slope"]
    jump = data["friction_coefficient_jump"] / data["rms_slope"] / data["velocity_change"]
    labels = r"$\mu_1/\nabla z$", r"$\Delta\mu_0\,v_1/(\Delta v\,\nabla z)$"
    loads = np.atleast_1d(data["normal_force"].values)
    for axes, array, label in zip(figure.subplots(1, 2, sharey=True), (before, jump), labels, strict=True):
        for k, colour in enumerate(_colours(loads)):
            line = array.isel(normal_force=k)
            error = line.std("realisation", ddof=1) / np.sqrt(line.sizes["realisation"])
            speed = np.atleast_1d(data["velocity"].values)
            mean, half = np.atleast_1d(line.mean("realisation")), np.atleast_1d(error)
            axes.errorbar(speed, mean, yerr=half, color=colour, lw=1, marker=".", ms=3)
        axes.set(xscale="log", yscale="log", xlabel=r"$v_1$ (m/s)", ylabel=label)
    figure.suptitle(
        f"$F_N$ from {loads.min():.2g} (dark) to {loads.max():.2g} N (light); mean $\\pm$ standard error", fontsize=10
    )
    return figure


def draw_jump_law(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw d_mu_0 v_1 / dv over mu_1, both over the rms slope, with eq. 4.11 (Fig. 4.5)."""
    from matplotlib.figure import Figure

    from mdr_dask.fit.kinetics import LAW, jump_law

    series = _meant(series)
    cases, law = _fitted(series, "kinetics"), _fitted(series, "jump_law")
    figure = Figure(figsize=(5.6, 4.2), layout="constrained")
    axes = figure.subplots()
    values = np.unique(cases["hurst"].values)
    for value, colour in zip(values, _colours(values), strict=True):
        part = cases.isel(case=np.flatnonzero(cases["hurst"].values == value))
        axes.plot(part["before_over_slope"], part["jump_over_slope"], ".", color=colour, ms=4, label=f"H = {value:.3g}")
    ends = [float(cases["before_over_slope"].min()), float(cases["before_over_slope"].max())]
    x = np.geomspace(ends[0], ends[1], 200)
    fitted = float(law["constant_of_all"])
    low, high = float(law["constant_low_of_all"]), float(law["constant_high_of_all"])
    axes.plot(x, jump_law(x, LAW), "k-", lw=1, label=f"eq. 4.11, {LAW}")
    axes.plot(x, jump_law(x, fitted), "C3--", lw=1.2, label=f"fitted {fitted:.3f} ({low:.3f}, {high:.3f})")
    axes.set(xscale="log", yscale="log", xlabel=r"$\mu_1/\nabla z$", ylabel=r"$\Delta\mu_0\,v_1/(\Delta v\,\nabla z)$")
    axes.legend(frameon=False, fontsize=7, ncols=2)
    return figure


def draw_rate(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw b over v_1 tau q_max for every Hurst exponent, with the powers fitted (Fig. 4.6)."""
    from matplotlib.figure import Figure

    series = _meant(series)
    cases, powers = _fitted(series, "kinetics"), _fitted(series, "rate_power")
    half = (cases["rate_high"] - cases["rate_low"]) / 2
    cases = cases.isel(case=np.flatnonzero((half < 0.5 * cases["rate"]).values))
    figure = Figure(figsize=(6.2, 4.6), layout="constrained")
    axes = figure.subplots()
    values = powers["hurst"].values
    for value, colour in zip(values, _colours(values), strict=True):
        part = cases.isel(case=np.flatnonzero(cases["hurst"].values == value))
        rate = part["rate"].values
        bar = np.clip([rate - part["rate_low"].values, part["rate_high"].values - rate], 0, None)
        x = part["passing_number"].values
        axes.errorbar(x, rate, yerr=bar, color=colour, fmt=".", ms=4, lw=0.6, label=f"H = {value:.3g}")
        for regime in ("below", "above"):
            fit = powers.sel(hurst=value, regime=regime)
            inside = x[(x < 1) == (regime == "below")]
            if np.isfinite(fit["power"]) and inside.size:
                line = np.array([inside.min(), inside.max()])
                axes.plot(line, float(fit["factor"]) * line ** float(fit["power"]), color=colour, lw=1)
    axes.axvline(1, color="0.7", lw=0.8)
    axes.set(xscale="log", yscale="log", xlabel=r"$v_1 \tau q_{max}$", ylabel="$b$, 95 % interval")
    axes.set_title("one exponential over 8 times the time of the law; lines: powers fitted", fontsize=9)
    axes.legend(frameon=False, fontsize=7, ncols=2)
    return figure


def draw_power(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the power of b over v_1 tau q_max over the Hurst exponent (Fig. 4.7)."""
    from matplotlib.figure import Figure

    powers = _fitted(_meant(series), "rate_power")
    figure = Figure(figsize=(5, 3.8), layout="constrained")
    axes = figure.subplots()
    hurst = powers["hurst"].values
    for regime, style, label in (
        ("above", "C0o", r"$v_1\tau q_{max} > 1$"),
        ("below", "C1s", r"$v_1\tau q_{max} < 1$"),
    ):
        fit = powers.sel(regime=regime)
        power = fit["power"].values
        bar = np.array([power - fit["power_low"].values, fit["power_high"].values - power])
        good = np.isfinite(power)
        axes.errorbar(hurst[good], power[good], yerr=bar[:, good], fmt=style, ms=4, capsize=2, label=label)
    line = np.array([0.0, 1.0])
    axes.plot(line, 1 - line, "k-", lw=1, label="1 - H")
    axes.plot(line, [1, 1], "k:", lw=1, label="1")
    axes.set(xlabel="Hurst exponent H", ylabel="power of $b$, 95 % interval")
    axes.legend(frameon=False, fontsize=8)
    return figure
