"""Figures of a master curve: the curves before shifting, the merged curve and the shift factors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from mdr_dask.errors import with_digits
from mdr_dask.fits.curve_tables import is_temperature
from mdr_dask.plots import colours, curves, labels, page
from mdr_dask.plots.base import Plot
from mdr_dask.plots.figure import Axis, Figure, Key, Mean, Panel, Trace, columns

INSIDE, OUTSIDE = "measured at the reference", "reached by shifting"


def draw_master_curve(curve: xr.Dataset) -> Figure:
    """Draw a master curve: the curves before shifting, the merged curve and the shift factors.

    The vertical factors have a panel if a curve is shifted vertically. The bars and the band show 68 % intervals. The
    merged curve is solid in the range that was measured in the reference condition, such as the reference temperature,
    and dashed outside this range.
    """
    curve = _in_shown_units(curve)
    attrs = curve.attrs
    shifts = [(str(attrs["group"]), "shift_factor", attrs["reference"])]
    if curve["vertical_factor"].any():
        shifts.append((str(attrs["group"]), "vertical_factor", attrs["reference"]))
    panels = [*_curves(curve), *(_factors(curve, *shift) for shift in shifts)]
    fixed = ", ".join(dict.fromkeys(f"{_words(by)} = {_text(value, curve[by])}" for by, _, value in shifts))
    figure = Figure(panels, "master curve", f"reference: {fixed}", "bars and band: 68 %", ratio=0.85)
    word, _, answers = curve["law_holds"].item().partition(": ")
    figure.judge(f"{word}: " + "; ".join(": ".join(line.split(": ")[:2]) for line in answers.split(";\n")))
    return figure


def _in_shown_units(curve: xr.Dataset) -> xr.Dataset:
    by = str(curve.attrs["group"])
    named = {"curve_abscissa": curve.attrs["abscissa"], "point_abscissa": curve.attrs["abscissa"]}
    named |= {
        f"{which}_{channel}": curve.attrs[channel] for channel in _channels(curve) for which in ("curve", "point")
    }
    named |= {by: by, "point_group": by}
    how = {name: labels.quantity(str(quantity), curve[name]) for name, quantity in named.items()}
    shown = curve.copy()
    for name, each in how.items():
        ends = {key: each.of(value) for key, value in curve[name].attrs.items() if key.startswith("measured_")}
        shown[name] = (curve[name].dims, each.of(curve[name].values), {**ends, "units": each.unit})
    shown.attrs["reference"] = how[by].of(curve.attrs["reference"])
    return shown


def _channels(curve: xr.Dataset) -> dict[str, str]:
    """Return names and markers of the ordinates. A master curve has one ordinate, or two ordinates shifted together."""
    return {name: marker for name, marker in (("ordinate", "."), ("companion", "x")) if f"curve_{name}" in curve}


def _words(name: Any) -> str:
    return str(name).replace("_", " ")


def _label(name: str, values: xr.DataArray) -> str:
    return labels.with_unit(page.current().symbols.get(name, _words(name)), str(values.attrs["units"]))


def _text(value: float, values: xr.DataArray) -> str:
    return f"{with_digits(value, 4)} {labels.printed_unit(values.attrs['units'])}".strip()


def _curves(curve: xr.Dataset) -> tuple[Panel, Panel]:
    by, across = str(curve.attrs["group"]), _label(curve.attrs["abscissa"], curve["curve_abscissa"])
    channels = _channels(curve)
    names = [_words(curve.attrs[channel]) for channel in channels]
    up = Axis(labels.with_unit(", ".join(names), curve["curve_ordinate"].attrs["units"]), log=True)
    measured = Panel(Axis(across, log=True), up, title="before shifting")
    merged = Panel(Axis(f"shifted {across}", log=True), up, title="merged")
    values = curve[by].values
    bar = colours.bar(_label(by, curve[by]), values) if values.size > colours.most() else None
    keys = []
    for k, value in enumerate(values):
        name, colour = _text(value, curve[by]), colours.shade(bar, float(value)) if bar else colours.colour(k)
        points = curve.isel(point=np.flatnonzero(curve["point_group"].values == value))
        x = points["point_abscissa"].values
        shift, rise = curve["shift_factor"][k].values, curve["vertical_factor"][k].values
        for channel, marker in channels.items():
            y = points[f"point_{channel}"].values
            merged.traces.append(Trace("curve", columns(x=x, y=y), label=name, colour=colour, marker=marker))
            raw = columns(x=x / 10**shift, y=y / 10**rise)
            measured.traces.append(Trace("curve", raw, label=name, colour=colour, line="-", marker=marker))
        keys.append(Key(name, colour, "", "."))
    merged.traces += [trace for channel in channels for trace in _lines(curve, channel)]
    marks = [Key(name, "#777777", "", mark) for name, mark in zip(names, channels.values(), strict=True)]
    keys = [*([] if bar else keys), *(marks if len(marks) > 1 else [])]
    measured.keys = merged.keys = [*keys, Key(OUTSIDE, "#000000", "--"), Key(INSIDE, "#000000", "-")]
    measured.bar = merged.bar = bar
    return measured, merged


def _lines(curve: xr.Dataset, channel: str) -> list[Trace]:
    """Return the traces of a merged curve: the band, the dashed curve, and the solid part measured at the reference."""
    x, y = curve["curve_abscissa"].values, curve[f"curve_{channel}"].values
    error = 10 ** curve["curve_error" if channel == "ordinate" else "curve_companion_error"].values
    ends = curve["curve_abscissa"].attrs
    inside = (x >= ends["measured_low"]) & (x <= ends["measured_high"])
    return [
        Trace("band", columns(x=x, y=Mean(y, y / error, y * error)), "merged curve"),
        Trace("law", columns(x=x, y=y), OUTSIDE, OUTSIDE, line="--"),
        Trace("law", columns(x=x[inside], y=y[inside]), INSIDE, INSIDE, line="-"),
    ]


def _factors(curve: xr.Dataset, by: str, factor: str, reference: float) -> Panel:
    groups, value, error = curve[by].values, curve[factor], curve[f"{factor}_error"]
    across = factor != "vertical_factor"
    moved = _words(curve.attrs["abscissa" if across else "ordinate"])
    power = "power_exponent" in curve and not is_temperature(by, curve[by].attrs["units"])
    y = Axis(labels.with_unit(f"shift of log10 {moved}", "decades"))
    panel = Panel(Axis(_label(by, curve[by]), log=power), y, title="shift factors" if across else "vertical factors")
    points = columns(value, x=groups, y=Mean(value, value - error, value + error))
    panel.traces.append(Trace("curve", points, label="factors, 68 %", marker="o"))
    if power and across:
        exponent = float(curve["power_exponent"])
        name = f"slope {exponent:.3g}"
        line = columns(x=groups, y=exponent * np.log10(groups / reference))
        panel.traces.append(Trace("law", line, name, name, colours.colour(1), "-"))
    return panel


def _of_store(groups: Mapping[str, xr.Dataset]) -> Figure:
    from mdr_dask.fits.master_curve import friction_of_roughness, master_curve

    found, left_out = {}, []
    for name, data in groups.items():
        if "friction_coefficient" in data:
            others = [d for d in curves.axes_of(data, "friction_coefficient") if d not in ("normal_force", "velocity")]
            found[name], more = curves.hold(data, others)
            left_out += [f"{name}: {each}" if name else each for each in more]
    figure = draw_master_curve(master_curve(friction_of_roughness(found)))
    figure.leave_out(left_out)
    return figure


PLOTS = (
    Plot(
        "master_curve",
        ("sliding_friction",),
        "coefficient of friction against force at each velocity, merged, and shift factors",
        _of_store,
        fitted=True,
    ),
)
