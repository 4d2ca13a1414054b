"""Figures of the kinetics of friction after a jump of the velocity (thesis Figs. 4.1-4.7)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.base import Plot
from mdr_dask.plots.kinetic_laws import draw_jump, draw_jump_law, draw_power, draw_rate, jumps

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEFORE_JUMP, JUMP, AFTER = (f"friction_coefficient_{name}" for name in ("before", "jump", "after"))
TRACE = "friction_coefficient"
OUTPUTS = (BEFORE_JUMP, JUMP, AFTER, TRACE)
#: What a title says of a case.
CASE = (
    *("hurst", "normal_force", "velocity", "velocity_change", "shear_modulus", "relaxation_time"),
    *("rms_roughness", "length", "points"),
)
EXPONENT = 0.7  # Hurst exponent of Figs. 4.1-4.4
LAST = 3.0  # (t - t_0) / tau up to which traces are shown
TIME = r"$(t - t_0)/\tau$"
MU = r"$\mu$ / rms slope"


def over_slope(data: xr.Dataset) -> tuple[Any, str]:
    """Return what friction is divided by and its label: the rms slope, where the store holds it."""
    return (data["rms_slope"], MU) if "rms_slope" in data else (xr.DataArray(1.0), r"$\mu$")


def relaxing(data: xr.Dataset) -> xr.DataArray:
    """Return the size of the relaxing part of every case, as figures show it."""
    slope, _ = over_slope(data)
    return aggregation.mean(abs(data[BEFORE_JUMP] + data[JUMP] - data[AFTER]) / slope)


def trace(data: xr.Dataset, lead: float = 0.3) -> tuple[Any, drawing.Mean]:
    """Return times from before the jump on, by a share of the last one, and friction with its interval."""
    slope, _ = over_slope(data)
    time = np.asarray(data["relaxation_times"].values)
    instant = data.assign({JUMP: data[BEFORE_JUMP] + data[JUMP]})
    before = curves.measured(data, BEFORE_JUMP, 1 / slope)
    at = curves.mean(instant[JUMP] / slope, _joined(data, slope))
    later = curves.measured(data, TRACE, 1 / slope)
    joined = [
        xr.DataArray(np.concatenate([[float(b), float(b), float(a)], np.ravel(c.values)]), dims="time")
        for b, a, c in zip(before, at, later, strict=True)
    ]
    return np.concatenate([[-lead * time[-1], 0.0, 0.0], time]), drawing.Mean(*joined)


def _joined(data: xr.Dataset, slope: Any) -> xr.DataArray | None:
    """Return the error of friction just after the jump: those of both its parts."""
    parts = [aggregation.companion(data, name) for name in (BEFORE_JUMP, JUMP)]
    errors = [abs(part) / slope for part in parts if part is not None]
    return sum(errors[1:], errors[0]) if errors else None


def _early(data: xr.Dataset) -> xr.Dataset:
    return data.sel(relaxation_times=data["relaxation_times"] <= max(LAST, float(data["relaxation_times"][1])))


def pick(groups: Mapping[str, xr.Dataset], outputs: Sequence[str], *varied: str) -> tuple[str, xr.Dataset, list[str]]:
    """Return the series that varies along most of some parameters, and which others there are."""
    found = curves.with_outputs(jumps(groups), outputs)
    rank = {
        name: [sum(data[key].size > 1 for key in varied if key in data.coords), data[outputs[0]].size]
        for name, data in found.items()
    }
    best = max(found, key=lambda name: rank[name])
    rest = [name for name in found if name != best]
    return best, found[best], [f"series {', '.join(rest)}"] if rest else []


def _one_case(data: xr.Dataset) -> tuple[xr.Dataset, list[str]]:
    """Return the case whose friction relaxes most."""
    return curves.hold(data, curves.axes_of(data, BEFORE_JUMP), relaxing(data))


def draw_trace(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw friction against time through jumps, up and down where the store has both (Fig. 4.1)."""
    name, data, told = pick(groups, OUTPUTS, "velocity_change")
    cases, more = _extreme_jumps(data)
    figure, panels = drawing.panels(len(cases), size=(5.2, 4.2))
    for axes, case in zip(panels, cases, strict=True):
        curve = drawing.Curve(case, "mean", style.colour(0), "-", "")
        time, course = trace(_early(case))
        drawing.curve(axes, curve, time, course)
        slope, label = over_slope(case)
        after = float(aggregation.mean(case[AFTER] / slope))
        drawing.law(axes, [0, time[-1]], [after, after], of=case, color="0.5", ls=":", label="steady at $v_2$")
        axes.set_title(f"$v_2 = {1 + float(case['velocity_change']):.3g}\\,v_1$", fontsize="small")
        axes.set(xlabel=TIME, ylabel=label)
        style.legend(axes)
    held = curves.fixed_by_all([curves.scalars(case) for case in cases])
    bars = curves.meaning_of_bars(data, outputs=[TRACE])
    style.title(figure, f"friction through a jump{_of(name)}", curves.fixed_text(held, CASE), bars)
    style.leave_out(figure, [*more, *told])
    return figure


def _extreme_jumps(data: xr.Dataset) -> tuple[list[xr.Dataset], list[str]]:
    """Return the case of the greatest jump down and of that up, where the store has both; else the only one."""
    if "velocity_change" not in data[BEFORE_JUMP].dims:
        case, told = _one_case(data)
        return [case], told
    case, told = curves.hold(
        data, [dim for dim in curves.axes_of(data, BEFORE_JUMP) if dim != "velocity_change"], relaxing(data)
    )
    changes = case["velocity_change"].values
    chosen = np.unique([int(changes.argmin()), int(changes.argmax())])
    if changes.size > chosen.size:
        told.append(f"{changes.size - chosen.size} of {changes.size} values of velocity_change (drawn: the extremes)")
    return [case.isel(velocity_change=int(k)) for k in chosen], told


def _of(name: str) -> str:
    return f", series {name}" if name else ""


def draw_velocities(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw steady friction against velocity, and friction against time for all velocities (Fig. 4.2)."""
    name, data, told = pick(groups, OUTPUTS, "velocity")
    over = curves.along_dim(data, "velocity", BEFORE_JUMP)
    others = [dim for dim in curves.axes_of(data, BEFORE_JUMP) if dim != over]
    near = -abs(data["hurst"] - EXPONENT) if "hurst" in others else None
    data, more = curves.hold(data, others, near)
    figure, (left, right) = drawing.panels(2, size=(5.4, 4.2))
    steady = curves.family(data, BEFORE_JUMP, "velocity")
    slope, label = over_slope(data)
    for curve in steady.curves:
        value = curves.measured(curve.data, BEFORE_JUMP, 1 / slope)
        drawing.curve(left, curve, style.shown("velocity", curve.data["velocity"]), value, bars=True)
    left.set(xlabel=style.label("velocity", data["velocity"]), ylabel=label)
    style.logarithmic(left, "x")
    shown = data if over else data.expand_dims("velocity")
    traces = curves.family(shown, BEFORE_JUMP, TIME_AXIS, ("velocity", over or "velocity"))
    for curve in traces.curves:
        time, value = trace(_early(curve.data))
        blank = xr.full_like(value.value, np.nan)
        drawing.curve(right, curve._replace(line="-", marker=""), time, drawing.Mean(value.value, blank, blank))
    right.set(xlabel=TIME, ylabel=label)
    curves.finish(figure, right, traces)
    bars = f"{curves.meaning_of_bars(data, outputs=[BEFORE_JUMP])} (left)"
    style.title(figure, f"friction at every velocity{_of(name)}", curves.fixed_text(steady.held, CASE), bars)
    style.leave_out(figure, [*more, *told])
    return figure


TIME_AXIS = "relaxation_times"


def draw_fit(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the relaxing part with the exponential fitted to it, for the case that relaxes most (Fig. 4.3)."""
    from mdr_dask.fits.kinetics import relaxation_curves

    name, data, told = pick(groups, (*OUTPUTS, "rms_slope"))
    if "example" in jumps(groups):
        name, data, told = pick({"example": groups["example"]}, (*OUTPUTS, "rms_slope"))
        told = ["series " + ", ".join(key for key in groups if key != "example")] if len(groups) > 1 else []
    data, more = _one_case(data)
    found = relaxation_curves(data)
    value = curves.mean((data[TRACE] - data[AFTER]) / data["rms_slope"])
    time = np.asarray(data["relaxation_times"].values)
    figure, panels = drawing.panels(2, size=(5.4, 4.2))
    for axes, logarithmic in zip(panels, (False, True), strict=True):
        points = drawing.Curve(data, "mean of the realisations", "k", "", "o")
        drawing.curve(axes, points, time, value, bars=True)
        _draw_exponentials(axes, found, float(time[time > 0][0]))
        axes.axvline(float(found["window"]), color="0.7", lw=0.8, label="end of the window")
        axes.axhline(0, color="0.8", lw=0.6)
        axes.set_xlim((time[time > 0][0], time[-1]) if logarithmic else (0, 1.2 * float(found["window"])))
        axes.set(xlabel=TIME, ylabel=r"$(\mu - \mu_2)$ / rms slope")
        if logarithmic:
            style.logarithmic(axes, "x")
    style.legend(panels[0])
    held = curves.fixed_text(curves.scalars(data), CASE)
    bars = f"{curves.meaning_of_bars(data, outputs=[])}; band and brackets: 95 % of the fit"
    style.title(figure, f"relaxation after the jump{_of(name)}", held, bars)
    style.leave_out(figure, [*more, *told])
    return figure


def _draw_exponentials(axes: Axes, found: xr.Dataset, first: float) -> None:
    """Draw the exponentials fitted, from the first moment on: they are level before the first point of their grid."""
    t = np.where(found["t"].values > 0, found["t"].values, first)
    order = np.argsort(t)
    inside = t[order]

    def ends(name: str) -> str:
        return ", ".join(f"{float(found[f'{name}_{end}']):.2f}" for end in ("low", "high"))

    def curve(name: str) -> Any:
        return found[name].values[order]

    drawing.band(
        axes, inside, curve("one_low"), curve("one_high"), "one exponential, 95 %", color=style.colour(style.FITTED)
    )
    label = f"$b$ = {float(found['rate']):.2f} ({ends('rate')}), weights 1/variance"
    drawing.law(axes, inside, curve("one"), color=style.colour(style.FITTED), label=label)
    law = float(found["law_rate"])
    start = float(found["one"][0])
    label = f"$b$ = {law:.2f} of eq. 4.12"
    drawing.law(axes, inside, start * np.exp(-law * inside), "--", color=style.colour(0), lw=1, label=label)


def draw_course(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw simulated friction against time beside the closed courses of eqs. 4.13-4.15."""
    from mdr_dask.fits.base import require
    from mdr_dask.fits.kinetic_cases import law_rate
    from mdr_dask.fits.kinetics import relaxation_law

    name, data, told = pick(groups, (*OUTPUTS, "rms_slope"), "velocity")
    require(data, "hurst", "relaxation_time", "length", "points")
    over = curves.along_dim(data, "velocity", BEFORE_JUMP)
    held_dims = [dim for dim in curves.axes_of(data, BEFORE_JUMP) if dim != over]
    data, more = curves.hold(data, held_dims, relaxing(data))
    if over:
        data, thinned = curves.thin(data, over, style.MOST_PANELS)
        more += thinned
    cases = [data.isel({over: k}) for k in range(data.sizes[over])] if over else [data]
    figure, panels = drawing.panels(len(cases), size=(4.6, 3.4))
    for axes, case in zip(panels, cases, strict=True):
        slope, label = over_slope(case)
        time, value = trace(_early(case))
        drawing.curve(axes, drawing.Curve(case, "simulated", style.colour(0), "-", ""), time, value)
        before, after = (float(aggregation.mean(case[part] / slope)) for part in (BEFORE_JUMP, AFTER))
        passing = float(case["velocity"] * case["relaxation_time"] * np.pi * case["points"] / case["length"])
        rate = float(law_rate(np.array(passing), np.array(float(case["hurst"]))))
        t = np.linspace(0, float(time[-1]), 400)
        change = float(case["velocity_change"])
        course = relaxation_law(np.array([before]), np.array([after]), 1.0, change, rate, t)[0]
        error = np.sqrt(np.nanmean((np.interp(time[2:], t, course) - value.value.values[2:]) ** 2))
        size = abs(after - before) + abs(course[0] - before)
        drawing.law(axes, t, course, "k--", of=case, lw=1, label="closed course")
        axes.set_title(
            f"{style.named('velocity', case['velocity'])}: rms {error / size:.1%} of the change", fontsize="small"
        )
        axes.set(xlabel=TIME, ylabel=label)
    style.legend(panels[0])
    held = curves.fixed_by_all([curves.scalars(case) for case in cases])
    subject = r"courses of friction: jump of eq. 4.11, rate of eq. 4.12, both ends simulated"
    bars = curves.meaning_of_bars(data, outputs=[TRACE])
    style.title(figure, subject + _of(name), curves.fixed_text(held, CASE), bars)
    style.leave_out(figure, [*more, *told])
    return figure


_MODELS = ("velocity_jump",)
PLOTS: tuple[Plot, ...] = (
    Plot("jump_trace", _MODELS, "friction against time through a jump up and down (Fig. 4.1)", draw_trace),
    Plot(
        "jump_velocities",
        _MODELS,
        "steady friction against v_1, and against time at every v_1 (Fig. 4.2)",
        draw_velocities,
    ),
    Plot("jump_fit", _MODELS, "relaxing part against time with one exponential fitted (Fig. 4.3)", draw_fit),
    Plot("jump_height", _MODELS, "mu_1 and d_mu_0 v_1 / dv against v_1 for every load (Fig. 4.4)", draw_jump),
    Plot("jump_law", _MODELS, "d_mu_0 v_1 / dv against mu_1 for every H, with eq. 4.11 (Fig. 4.5)", draw_jump_law),
    Plot("relaxation_rate", _MODELS, "b against v_1 tau q_max for every H (Fig. 4.6)", draw_rate),
    Plot("relaxation_power", _MODELS, "power of b against H, with 1 - H (Fig. 4.7)", draw_power),
    Plot("relaxation_course", _MODELS, "friction against time beside its closed course (eqs. 4.13-4.15)", draw_course),
)
