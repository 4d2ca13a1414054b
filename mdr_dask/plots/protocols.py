"""Figures of friction along courses of velocity and load."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.parts.loading_history import pieces
from mdr_dask.models.velocity_jump import VelocityJump
from mdr_dask.models.velocity_jump.solve import time_unit
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BEFORE = 0.08  # of the time shown
MOST_SERIES = 6


def first_case(data: xr.Dataset) -> tuple[xr.Dataset, VelocityJump]:
    """Return the data at the first value of every axis, and the parameters there."""
    parameters = json.loads(data.attrs["parameters"])
    dims = set()
    for axis in data.attrs.get("axes", []):
        *above, last = axis["path"].split(".")
        place = parameters
        for key in above:
            place = place[key]
        place[last] = axis["values"][0]
        dims.add(axis["dim"])
    return data.isel(dict.fromkeys(dims & set(data.dims), 0)), VelocityJump.model_validate(parameters)


def course(case: VelocityJump, last: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times in units of tau from before the course to `last`, with the velocity and the load then, in SI."""
    unit = time_unit(case)
    before, parts = pieces(case.protocol, case.velocity, case.normal_force, case.velocity_change)
    columns = [np.array([[-BEFORE * last, 0.0], [before, before], [case.normal_force, case.normal_force]])]
    for part in parts:
        if part.start < last * unit:
            count = 400 if part.swing[2] else 2
            time = np.linspace(part.start, min(part.end, last * unit), count)
            _, speed, force = part.at(time)
            columns.append(np.array([time / unit, speed, force]))
    time, speed, force = np.concatenate(columns, axis=1)
    return time, speed, force


def _mean(array: xr.DataArray) -> tuple[Any, Any]:
    """Return the mean over the realisations and its standard error."""
    number = array.notnull().sum("realisation")
    spread = array.std("realisation", ddof=1) if array.sizes["realisation"] > 1 else 0 * array.mean("realisation")
    return array.mean("realisation").values, (spread / np.sqrt(number)).values


def _draw_friction(axes: Any, data: xr.Dataset) -> None:
    time = data["relaxation_times"].values
    slope = data["rms_slope"] if "rms_slope" in data else xr.DataArray(1.0)
    steady, steady_error = _mean(data["friction_coefficient_before"] / slope)
    instant, instant_error = _mean((data["friction_coefficient_before"] + data["friction_coefficient_jump"]) / slope)
    mean, error = _mean(data["friction_coefficient"] / slope)
    start = -BEFORE * time[-1]
    times = np.concatenate([[start, 0.0, 0.0], time])
    means = np.concatenate([[steady, steady, instant], mean])
    errors = np.concatenate([[steady_error, steady_error, instant_error], error])
    axes.plot(times, means, "C0", lw=1.2)
    axes.fill_between(times, means - errors, means + errors, color="C0", alpha=0.25, lw=0, label="standard error")
    after, _ = _mean(data["friction_coefficient_after"] / slope)
    if np.isfinite(after):
        axes.axhline(float(after), color="0.5", ls=":", lw=1, label="steady state at the end")


def draw_protocols(series: Mapping[str, xr.Dataset]) -> Figure:
    """Draw mu(t) over velocity and load, one column for each series."""
    from matplotlib.figure import Figure

    needed = {"friction_coefficient", "friction_coefficient_before", "friction_coefficient_jump"}
    needed |= {"friction_coefficient_after"}
    shown = {name: data for name, data in series.items() if needed <= set(data.data_vars)}
    if not shown:
        raise DataError(f"expected the outputs {', '.join(sorted(needed))}")
    shown = dict(list(shown.items())[:MOST_SERIES])
    figure = Figure(figsize=(3.1 * len(shown) + 0.8, 5.6), layout="constrained")
    rows = figure.subplots(3, len(shown), squeeze=False, sharex="col", height_ratios=[2.4, 1, 1])
    for column, (name, data) in zip(rows.T, shown.items(), strict=True):
        values, case = first_case(data)
        last = float(values["relaxation_times"].values[-1])
        _draw_friction(column[0], values)
        time, speed, force = course(case, last)
        column[1].plot(time, speed, "C1", lw=1.2)
        column[2].plot(time, force, "C2", lw=1.2)
        column[0].set_title(name or case.protocol.shape, fontsize=10)
        column[2].set_xlabel(r"$(t - t_0)/\tau$")
        for axes, row in zip(column[1:], (speed, force), strict=True):
            axes.set_ylim(min(0.0, 1.15 * float(row.min())), 1.15 * max(float(row.max()), 1e-300))
        column[2].set_xlim(-BEFORE * last, last)
    normalised = "rms_slope" in next(iter(shown.values()))
    for axes, label in zip(
        rows[:, 0], (r"$\mu/\nabla z$" if normalised else r"$\mu$", "$v$ (m/s)", "$F_N$ (N)"), strict=True
    ):
        axes.set_ylabel(label)
    rows[0, 0].legend(frameon=False, fontsize=8)
    return figure


PLOTS: tuple[Plot, ...] = (
    Plot("protocols", ("velocity_jump",), "mu over time along courses of velocity and load", draw_protocols),
)
