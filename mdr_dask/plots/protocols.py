"""Figures of friction along histories of velocity and load."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.arrays import FloatArray
from mdr_dask.models.parts.loading_history import pieces
from mdr_dask.models.velocity_jump import VelocityJump
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.base import Plot
from mdr_dask.plots.kinetics import AFTER, CASE, OUTPUTS, TIME, over_slope, trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BEFORE = 0.08  # of the time shown
#: What a loading history prescribes.
DRIVEN = ("velocity", "normal_force")
#: Width of a column alone, and beside others, in inches.
ALONE, BESIDE = 6.4, 3.4


def first_case(data: xr.Dataset) -> tuple[xr.Dataset, VelocityJump, list[str]]:
    """Return the data at the first value of every axis, the parameters there, and what is left out."""
    held = curves.axes_of(data, AFTER)
    told = [f"{data.sizes[dim] - 1} of {data.sizes[dim]} values of {dim} (drawn: the first)" for dim in held]
    case = data.isel(dict.fromkeys(held, 0))
    return case, VelocityJump.model_validate(curves.parameters_at(case)), told


def loading_history(case: VelocityJump, last: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times in units of tau from before the loading history to `last`, with velocity and load then, in SI."""
    unit = case.time_unit()
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


def draw_protocols(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw friction against time over velocity and load, one column for each series."""
    found, told = curves.few(curves.with_outputs(groups, OUTPUTS))
    width = ALONE if len(found) == 1 else BESIDE
    figure, panels = drawing.panels(3 * len(found), columns=len(found), size=(width, 2.0), sharex="col")
    families = []
    for k, (name, data) in enumerate(found.items()):
        top, *below = panels[k :: len(found)]
        values, case, held = first_case(data)
        told += [f"{name}: {each}" if name else each for each in held]
        families.append(curves.scalars(values))
        last = float(values["relaxation_times"].values[-1])
        slope, label = over_slope(values)
        time, friction = trace(values, BEFORE)
        drawing.curve(top, drawing.Curve(values, "mean", style.COLOURS[0], "-", ""), time, friction)
        after = float(aggregation.mean(values[AFTER] / slope))
        if np.isfinite(after):
            steady = "steady state at the end"
            drawing.law(top, [0, last], [after, after], of=values, color="0.5", ls=":", lw=1, label=steady)
        top.set_title(name or case.protocol.shape, fontsize="small")
        top.set_ylabel(label)
        time, speed, force = loading_history(case, last)
        for axes, row, name, colour in zip(below, (speed, force), DRIVEN, style.COLOURS[1:], strict=False):
            like = values.get(name)  # absent where the history has it in its own numbers
            row = style.quantity(name, like).of(row)
            drawing.plain(axes, time, row, of=values, color=colour, lw=1.2)
            axes.set_ylim(min(0.0, 1.15 * float(row.min())), 1.15 * max(float(row.max()), 1e-300))
            axes.set_ylabel(style.label(name, like))
        below[1].set_xlabel(TIME)
        below[1].set_xlim(-BEFORE * last, last)
    style.legend(panels[0])
    held_by_all = curves.fixed_text(curves.fixed_by_all(families), CASE)
    bars = curves.meaning_of_bars(*found.values(), outputs=["friction_coefficient"])
    style.title(figure, "friction along histories of velocity and load", held_by_all, bars)
    style.leave_out(figure, told)
    return figure


PLOTS: tuple[Plot, ...] = (
    Plot("protocols", ("velocity_jump",), "friction against time along histories of velocity and load", draw_protocols),
)
