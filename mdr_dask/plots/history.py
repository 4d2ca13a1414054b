"""Friction against time before and after a jump of the velocity, or during any history of velocity and load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import LISTED, DataError
from mdr_dask.models.parts.loading_history import pieces
from mdr_dask.models.velocity_jump import VelocityJump
from mdr_dask.plots import curves, labels
from mdr_dask.plots.base import Plot
from mdr_dask.plots.figure import SMOOTH, Axis, Figure, Key, Mean, Panel, Trace, columns

BEFORE, JUMP, AFTER = (f"friction_coefficient_{name}" for name in ("before", "jump", "after"))
FRICTION = "friction_coefficient"
TIME = "relaxation_times"
DRIVEN = {"velocity": "m/s", "normal_force": "N"}
#: Time span that is shown before the history begins, divided by the shown time span of the history. Chosen by trial.
LEAD = 0.08
STEADY = "steady state at the end"


def draw(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw friction against time, one column of panels for each series.

    At most `LISTED` series are drawn, all with the same legend. The columns have a panel for the velocity only if the
    velocity changes in a series, and a panel for the normal force only if the normal force changes in a series.
    """
    needed = {BEFORE, JUMP, FRICTION}
    found = {name: data for name, data in groups.items() if needed <= data.keys() and data[FRICTION].notnull().any()}
    if not found:
        raise DataError(f"expected a series with finished results of {', '.join(sorted(needed))}, got none")
    families = {name: curves.family(data, FRICTION, TIME) for name, data in found.items()}
    kept, left_out = curves.with_one_legend(families)
    rest, kept = kept[LISTED:], kept[:LISTED]
    columns_of = {name: _column(name, found[name], families[name]) for name in kept}
    shown = [0, *(k for k in (1, 2) if any(_changes(column[k]) for column in columns_of.values()))]
    panels = [column[k] for column in columns_of.values() for k in shown]
    figure = Figure(panels, "friction along histories of velocity and load", stack=len(shown), ratio=0.45)
    held = curves.fixed_by_all(curve.data for name in kept for curve in families[name].curves)
    figure.fixed = curves.fixed_text(held, found[kept[0]])
    figure.bars = curves.meaning_of_bars(found.values(), [FRICTION])
    figure.leave_out([*left_out, f"series {', '.join(rest)}" if rest else ""])
    figure.leave_out([sentence for name in kept for sentence in families[name].left_out])
    return figure


def _changes(panel: Panel) -> bool:
    return any(np.ptp(trace.column("y")) > 0 for trace in panel.traces)


def _column(name: str, data: xr.Dataset, one: curves.Family) -> list[Panel]:
    last = float(data[TIME].values[-1])
    time = Axis(r"$(t - t_0)/\tau$", low=-LEAD * last, high=last)
    panels = [Panel(time, Axis("coefficient of friction", quantity=FRICTION), bar=one.bar)]
    panels[0].title = f"series {name}" if name else ""
    for key, unit in DRIVEN.items():
        values = data[key] if key in data.coords else xr.DataArray(np.nan, attrs={"units": unit})
        panels.append(Panel(time, Axis(labels.label(key, values), quantity=key), keys=one.keys))
    for curve in one.curves:
        case = curve.data
        look: dict[str, Any] = {"label": curve.label, "colour": curve.colour, "line": curve.line or "-"}
        panels[0].traces.append(Trace("curve", _trace(case, last), **look))
        after = float(aggregation.mean(case[AFTER])) if AFTER in case else np.nan
        if np.isfinite(after):
            level = columns(case, x=np.array([0.0, last]), y=np.full(2, after))
            panels[0].traces.append(Trace("law", level, STEADY, STEADY, curve.colour, ":"))
        at, *driven = loading_history(VelocityJump.model_validate(curves.parameters_at(case)), last)
        for panel, (key, unit), value in zip(panels[1:], DRIVEN.items(), driven, strict=True):
            shown = labels.converted(key, xr.DataArray(value, attrs={"units": unit}))
            panel.traces.append(Trace("curve", columns(case, x=at, y=shown), **look))
    panels[0].keys = [*one.keys, Key(STEADY, "#808080", ":")] if len(panels[0].traces) > 1 else one.keys
    for panel in panels[1:]:
        every = np.concatenate([trace.column("y") for trace in panel.traces])
        panel.y = replace(panel.y, low=0.0 if every.min() >= 0 else None)
    return panels


def _trace(case: xr.Dataset, last: float) -> xr.Dataset:
    """Return the friction of one curve: before the history starts, just after the start, and during the history."""
    before = curves.mean(case, BEFORE)
    at_once = case.assign({JUMP: (case[BEFORE] + case[JUMP]).assign_attrs(case[JUMP].attrs)})
    errors = [aggregation.companion(case, name) for name in (BEFORE, JUMP)]
    known = [abs(error) for error in errors if error is not None]
    start = Mean(*aggregation.mean_and_ends(at_once[JUMP], sum(known[1:], known[0]) if known else None))
    later = curves.mean(case, FRICTION)
    joined = [
        np.concatenate([[float(b), float(b), float(s)], np.ravel(c.values)])
        for b, s, c in zip(before, start, later, strict=True)
    ]
    time = np.concatenate([[-LEAD * last, 0.0, 0.0], np.asarray(case[TIME].values)])
    return columns(case, x=time, y=Mean(*joined))


def loading_history(case: VelocityJump, last: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return times divided by `VelocityJump.time_unit`, velocities in m/s and normal forces in N.

    The times begin before the history, at -`LEAD` times `last`, and end at `last`.
    """
    unit = case.time_unit()
    (speed, force), parts = pieces(case.protocol, case.velocity, case.normal_force, case.velocity_change)
    found = [np.array([[-LEAD * last, 0.0], [speed, speed], [force, force]])]
    for part in parts:
        if part.start < last * unit:
            count = SMOOTH if part.swing[2] else 2
            time = np.linspace(part.start, min(part.end, last * unit), count)
            found.append(np.array([time / unit, *part.at(time)[1:]]))
    times, speeds, forces = np.concatenate(found, axis=1)
    return times, speeds, forces


PLOTS: tuple[Plot, ...] = (
    Plot("history", ("velocity_jump",), "friction against time, with velocity and normal force if they change", draw),
)
