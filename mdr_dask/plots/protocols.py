"""Figures of friction along histories of velocity and load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.arrays import FloatArray
from mdr_dask.models.parts.loading_history import pieces
from mdr_dask.models.velocity_jump import VelocityJump
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.base import Plot
from mdr_dask.plots.kinetics import AFTER, CASE, OUTPUTS, TIME, TRACE, over_slope, trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEFORE = 0.08  # of the time shown
#: What a loading history prescribes.
DRIVEN = ("velocity", "normal_force")
HELD = [name for name in CASE if name != "velocity_change"]
STEADY = "steady state at the end"
#: Width of a column alone, and beside others, in inches.
ALONE, BESIDE = 6.4, 3.4


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
        one = curves.family(data, TRACE, "relaxation_times")
        told += [f"{name}: {each}" if name else each for each in one.left_out]
        families.append(one.held)
        last = float(data["relaxation_times"].values[-1])
        for curve in one.curves:
            _draw_case(top, below, curve, last)
        top.set_title(name or curves.parameters_of(data)["protocol"]["shape"], fontsize="small")
        top.set_ylabel(over_slope(data)[1])
        for axes, driven in zip(below, DRIVEN, strict=True):
            axes.set_ylabel(style.label(driven, data.get(driven)))
            axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
        below[1].set_xlabel(TIME)
        below[1].set_xlim(-BEFORE * last, last)
        top.plot([], [], ":", lw=1, color="0.5", label=STEADY)
        curves.finish(figure, top, one)
    held_by_all = curves.fixed_text(curves.fixed_by_all(families), HELD)
    bars = curves.meaning_of_bars(*found.values(), outputs=["friction_coefficient"])
    style.title(figure, "friction along histories of velocity and load", held_by_all, bars)
    style.leave_out(figure, told)
    return figure


def _draw_case(top: Axes, below: Sequence[Axes], curve: drawing.Curve, last: float) -> None:
    """Draw friction of a case, and the velocity and the load that it is driven by, up to a time."""
    case = VelocityJump.model_validate(curves.parameters_at(curve.data))
    time, friction = trace(curve.data, BEFORE)
    drawing.curve(top, curve._replace(line=curve.line or "-", marker=""), time, friction)
    slope, _ = over_slope(curve.data)
    after = float(aggregation.mean(curve.data[AFTER] / slope))
    if np.isfinite(after):
        drawing.law(top, [0, last], [after, after], name=STEADY, of=curve.data, color=curve.colour, ls=":", lw=1)
    time, *driven = loading_history(case, last)
    for axes, values, name in zip(below, driven, DRIVEN, strict=True):
        like = curve.data.get(name)  # absent where the history has it in its own numbers
        shown = style.quantity(name, like).of(values)
        drawing.plain(axes, time, shown, of=curve.data, color=curve.colour, ls=curve.line or "-", lw=1.2)
        axes.set_ylim(top=max(axes.get_ylim()[1], 1.15 * float(shown.max())))


PLOTS: tuple[Plot, ...] = (
    Plot("protocols", ("velocity_jump",), "friction against time along histories of velocity and load", draw_protocols),
)
