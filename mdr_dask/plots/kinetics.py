"""Figures of the kinetics of friction after a jump of the velocity (thesis Figs. 4.1-4.7)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mdr_dask.plots.base import Plot
from mdr_dask.plots.kinetic_laws import draw_jump, draw_jump_law, draw_power, draw_rate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_TRACES = 30
EXPONENT = 0.7  # Hurst exponent of Figs. 4.1-4.4
BEFORE = 0.3  # of the width of the figure that shows the steady state before the jump


def pick(series: Mapping[str, xr.Dataset], dim: str) -> xr.Dataset:
    """Return the first series that varies a parameter, else the first one."""
    return next((data for data in series.values() if data.sizes.get(dim, 1) > 1), next(iter(series.values())))


def first_of(data: xr.Dataset, *kept: str) -> xr.Dataset:
    """Return the data at the first value of every dimension but the ones kept."""
    spare = set(data["friction_coefficient_before"].dims) - {"realisation", *kept}
    return data.isel(dict.fromkeys(spare, 0))


def _mean(array: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray]:
    """Return the mean over the realisations and its standard error."""
    number = array.notnull().sum("realisation")
    return array.mean("realisation"), array.std("realisation", ddof=1) / np.sqrt(number)


def _trace(data: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times from before the jump on, and mean and standard error of mu / rms slope."""
    slope = data["rms_slope"]
    steady, steady_error = _mean(data["friction_coefficient_before"] / slope)
    at = (data["friction_coefficient_before"] + data["friction_coefficient_jump"]) / slope
    instant, instant_error = _mean(at)
    mean, error = _mean(data["friction_coefficient"] / slope)
    time = data["relaxation_times"].values
    lead = -BEFORE * time[-1]
    return (
        np.concatenate([[lead, 0.0, 0.0], time]),
        np.concatenate([[steady, steady, instant], mean.values]),
        np.concatenate([[steady_error, steady_error, instant_error], error.values]),
    )


def _labelled(axes: Any, x: str, y: str) -> None:
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def draw_trace(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw mu(t) through jumps, up and down where the store has both (Fig. 4.1)."""
    from matplotlib.figure import Figure

    data = first_of(pick(series, "velocity_change"), "velocity_change")
    changes = np.atleast_1d(data["velocity_change"].values)
    chosen = np.unique([int(changes.argmin()), int(changes.argmax())])
    figure = Figure(figsize=(4.2 * chosen.size + 1, 3.6), layout="constrained")
    for axes, k in zip(figure.subplots(1, chosen.size, squeeze=False)[0], chosen, strict=True):
        case = data.isel(velocity_change=k) if "velocity_change" in data.dims else data
        shown = case.sel(relaxation_times=case["relaxation_times"] <= 3)
        time, mean, error = _trace(shown)
        axes.plot(time, mean, "C0")
        axes.fill_between(time, mean - error, mean + error, color="C0", alpha=0.25, label="standard error")
        after, _ = _mean(case["friction_coefficient_after"] / case["rms_slope"])
        axes.axhline(float(after), color="0.5", ls=":", label=r"steady at $v_2$")
        axes.set_title(f"$v_2 = {1 + changes[k]:.3g}\\,v_1$, $v_1$ = {float(case['velocity']):.3g} m/s", fontsize=10)
        _labelled(axes, r"$(t - t_0)/\tau$", r"$\mu/\nabla z$")
        axes.legend(frameon=False, fontsize=8)
    return figure


def draw_velocities(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw steady friction over the velocity, and mu(t) for all velocities (Fig. 4.2)."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    data = pick(series, "velocity")
    if "hurst" in data.dims:
        data = data.sel(hurst=EXPONENT, method="nearest")
    data = first_of(data, "velocity")
    data = data if "velocity" in data.dims else data.expand_dims("velocity")
    figure = Figure(figsize=(9.5, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    mean, error = _mean(data["friction_coefficient_before"] / data["rms_slope"])
    speed = data["velocity"].values
    left.errorbar(speed, mean, yerr=error, fmt="o-", ms=3, lw=1)
    left.set(xscale="log", yscale="log", title=r"mean $\pm$ standard error")
    _labelled(left, r"$v_1$ (m/s)", r"$\mu_1/\nabla z$")
    step = max(1, -(-speed.size // MOST_TRACES))
    for k in range(0, speed.size, step):
        case = data.isel(velocity=k)
        time, trace, _ = _trace(case.sel(relaxation_times=case["relaxation_times"] <= 3))
        right.plot(time, trace, lw=0.9, color=colormaps["viridis"](k / max(speed.size - 1, 1)))
    right.set_title(
        f"$v_1$ from {speed.min():.2g} (dark) to {speed.max():.2g} m/s (light), H = {float(data['hurst']):.3g}",
        fontsize=10,
    )
    _labelled(right, r"$(t - t_0)/\tau$", r"$\mu/\nabla z$")
    return figure


def draw_fit(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the relaxing part with the exponential fitted to it (Fig. 4.3)."""
    from matplotlib.figure import Figure

    from mdr_dask.fit.kinetics import relaxation_curves

    data = first_of(next(iter(series.values())))
    found = relaxation_curves(data)
    slope = data["rms_slope"]
    trace, error = _mean((data["friction_coefficient"] - data["friction_coefficient_after"]) / slope)
    time, window = data["relaxation_times"].values, float(found["window"])
    inside = found["t"].values
    figure = Figure(figsize=(10, 4), layout="constrained")
    for axes, logarithmic in zip(figure.subplots(1, 2), (False, True), strict=True):
        axes.plot(time, trace, "k.", ms=4, label="mean of the realisations")
        axes.fill_between(time, trace - error, trace + error, color="0.6", alpha=0.5, label="standard error")
        low, high = found["one_low"], found["one_high"]
        axes.fill_between(inside, low, high, color="C3", alpha=0.25, lw=0)
        ends = ", ".join(f"{float(found[f'rate_{end}']):.2f}" for end in ("low", "high"))
        axes.plot(inside, found["one"], "C3", label=f"$b$ = {float(found['rate']):.2f} ({ends}), weights 1/variance")
        alike = ", ".join(f"{float(found[f'rate_unweighted_{end}']):.2f}" for end in ("low", "high"))
        axes.plot(
            inside,
            found["alike"],
            "C1-.",
            lw=1,
            label=f"$b$ = {float(found['rate_unweighted']):.2f} ({alike}), all times alike",
        )
        law = float(found["law_rate"])
        start = float(found["one"][0])
        axes.plot(inside, start * np.exp(-law * inside), "C0--", lw=1, label=f"$b$ = {law:.2f} of eq. 4.12")
        if "two" in found:
            axes.plot(inside, found["two"], "C2:", lw=1.5, label="two exponentials")
        axes.axvline(window, color="0.7", lw=0.8, label="end of the window")
        axes.axhline(0, color="0.8", lw=0.6)
        axes.set_xlim((time[0], time[-1]) if logarithmic else (0, 1.2 * window))
        axes.set_xscale("log" if logarithmic else "linear")
        _labelled(axes, r"$(t - t_0)/\tau$", r"$(\mu - \mu_2)/\nabla z$")
    figure.axes[0].legend(frameon=False, fontsize=8)
    figure.suptitle("red band and brackets: 95 %, bootstrap over the realisations", fontsize=9)
    return figure


_MODELS = ("velocity_jump",)
PLOTS: tuple[Plot, ...] = (
    Plot("jump_trace", _MODELS, "mu over time through a jump of the velocity up and down (Fig. 4.1)", draw_trace),
    Plot("jump_velocities", _MODELS, "steady mu over v_1, and mu over time for every v_1 (Fig. 4.2)", draw_velocities),
    Plot("jump_fit", _MODELS, "relaxing part over time with one exponential fitted (Fig. 4.3)", draw_fit),
    Plot("jump_height", _MODELS, "mu_1 and d_mu_0 v_1 / dv over v_1 for every load (Fig. 4.4)", draw_jump),
    Plot("jump_law", _MODELS, "d_mu_0 v_1 / dv over mu_1 for every H, with eq. 4.11 (Fig. 4.5)", draw_jump_law),
    Plot("relaxation_rate", _MODELS, "b over v_1 tau q_max for every H (Fig. 4.6)", draw_rate),
    Plot("relaxation_power", _MODELS, "power of b over v_1 tau q_max over H, with 1 - H (Fig. 4.7)", draw_power),
)
