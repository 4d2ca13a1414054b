"""Figures of a master curve: the curves as measured, the merged curve, the shift factors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.fits.curve_tables import is_temperature
from mdr_dask.plots import colours, curves, labels
from mdr_dask.plots.base import Plot
from mdr_dask.plots.figure import Axis, Bar, Figure, Key, Mean, Panel, Trace, columns

#: Largest relative rms deviation from the merged curve at which the curves count as collapsed.
COLLAPSED = 0.05


def draw_master_curve(curve: xr.Dataset) -> Figure:
    """Return the figure of a master curve from :func:`mdr_dask.fits.master_curve.master_curve`.

    It shows the curves as measured, the merged curve and the shift factors. Bars and band are 68 % intervals. The
    merged curve is dashed beyond the range that was measured at the reference.
    """
    shown = [(str(curve.attrs["group"]), "shift_factor", "vertical_factor", curve.attrs["reference"])]
    if "second" in curve.attrs:
        second = str(curve.attrs["second"]), "second_factor", "", curve.attrs["second_reference"]
        shown.append(second)
    rising = bool(curve["vertical_factor"].any())
    groups, keys, bar = _groups(curve)
    panels = [_measured(curve, groups), _merged(curve, groups)]
    channels = [Key(_words(curve.attrs[name]), "#777777", "", marker) for name, marker in _channels(curve)]
    panels[0].keys = panels[1].keys = [
        *keys,
        *(channels if len(channels) > 1 else []),
        Key("reached by shifting", "#000000", "--"),
        Key("measured at the reference", "#000000", "-"),
    ]
    panels[0].bar = panels[1].bar = bar
    for by, across, along, reference in shown:
        panels.append(_factors(curve, by, across, reference))
        if rising and along:
            panels.append(_factors(curve, by, along, reference))
    references = ", ".join(f"{by} = {reference:.4g} {_unit(curve, by)}".strip() for by, _, _, reference in shown)
    return Figure(
        panels, "master curve", f"reference: {references}", f"bars and band: 68 %; {_collapse(curve)}", ratio=0.85
    )


def _collapse(curve: xr.Dataset) -> str:
    """Return a text with the rms deviation of the points from the merged curve, and whether the curves collapse."""
    away = deviations(curve)
    rms, largest = float(np.sqrt(np.mean(away**2))), float(np.max(np.abs(away)))
    verdict = "" if rms < COLLAPSED else "the curves do NOT collapse: "
    return f"{verdict}points deviate from the merged curve by {rms:.1%} (rms), at most by {largest:.1%}"


def deviations(curve: xr.Dataset) -> FloatArray:
    """Return ln(point / merged curve) for every point; the merged curve is interpolated linearly in logarithms."""
    x, y = (np.log(curve[f"curve_{name}"].to_numpy()) for name in ("abscissa", "ordinate"))
    order = np.argsort(x)
    at = np.log(curve["point_abscissa"].to_numpy())
    away: FloatArray = np.log(curve["point_ordinate"].to_numpy()) - np.interp(at, x[order], y[order])
    return away


def _unit(curve: xr.Dataset, name: str) -> str:
    unit = str(curve[name].attrs.get("units", "")) if name in curve.coords else ""
    return "" if unit == "1" else unit


def _words(name: str) -> str:
    return str(name).replace("_", " ")


def _label(name: str, values: xr.DataArray) -> str:
    return labels.with_unit(_words(name), str(values.attrs.get("units", "")))


def _channels(curve: xr.Dataset) -> list[tuple[str, str]]:
    """Return the ordinates that were shifted together, each with its marker."""
    return [(name, marker) for name, marker in (("ordinate", "."), ("companion", "x")) if f"curve_{name}" in curve]


def _axes(curve: xr.Dataset, shifted: str = "") -> tuple[Axis, Axis]:
    """Return the axes of the curves; two ordinates share one vertical axis."""
    names = [_words(curve.attrs[name]) for name, _ in _channels(curve)]
    unit = str(curve["curve_ordinate"].attrs.get("units", ""))
    across = _label(curve.attrs["abscissa"], curve["curve_abscissa"])
    return Axis(f"{shifted}{across}", log=True), Axis(labels.with_unit(", ".join(names), unit), log=True)


class _Group(NamedTuple):
    """The points of one group with its factors, its name and its colour."""

    value: float
    points: xr.Dataset
    shift: float
    rise: float
    label: str
    colour: str


def _groups(curve: xr.Dataset) -> tuple[list[_Group], list[Key], Bar | None]:
    """Return all groups, with a legend if they are few or a colour bar if they are many."""
    by = str(curve.attrs["group"])
    values = curve[by].to_numpy()
    bar = colours.bar(_label(by, curve[by]), values) if values.size > colours.most() else None
    points = curve[[name for name in curve.data_vars if curve[name].dims == ("point",)]]
    # measured temperatures or velocities scatter about round values: round labels to a hundredth of the smallest step
    digits = -int(np.floor(np.log10(np.min(np.diff(np.sort(values))) / 100)))
    found = [
        _Group(
            float(value),
            points.isel(point=np.flatnonzero(curve["point_group"].to_numpy() == value)),
            float(curve["shift_factor"][k]),
            float(curve["vertical_factor"][k]),
            f"{round(float(value), digits):.6g} {labels.printed_unit(_unit(curve, by))}".strip(),
            colours.shade(bar, float(value)) if bar else colours.colour(k),
        )
        for k, value in enumerate(values)
    ]
    keys = [] if bar else [Key(group.label, group.colour, "", ".") for group in found]
    return found, keys, bar


def _measured(curve: xr.Dataset, groups: list[_Group]) -> Panel:
    panel = Panel(*_axes(curve), title="as measured")
    for group in groups:
        points = group.points
        x = points["point_abscissa"] / 10 ** points.get("point_shift", group.shift)
        second = points["point_second"].to_numpy() if "point_second" in points else np.zeros(x.size)
        for channel, marker in _channels(curve):
            y = points[f"point_{channel}"] / 10 ** points.get("point_rise", group.rise)
            for value in np.unique(second):
                one = np.flatnonzero(second == value)
                data = columns(x=x[one].values, y=y[one].values)
                trace = Trace("curve", data, label=group.label, colour=group.colour, line="-", marker=marker)
                panel.traces.append(trace)
    return panel


def _merged(curve: xr.Dataset, groups: list[_Group]) -> Panel:
    panel = Panel(*_axes(curve, "shifted "), title="merged")
    x = curve["curve_abscissa"].to_numpy()
    low, high = (curve["curve_abscissa"].attrs[f"measured_{end}"] for end in ("low", "high"))
    inside = (x >= low) & (x <= high)
    for channel, marker in _channels(curve):
        for group in groups:
            data = columns(x=group.points["point_abscissa"].values, y=group.points[f"point_{channel}"].values)
            panel.traces.append(Trace("curve", data, label=group.label, colour=group.colour, marker=marker))
        error = curve["curve_error" if channel == "ordinate" else "curve_companion_error"].to_numpy()
        panel.traces += _lines(x, curve[f"curve_{channel}"].to_numpy(), 10**error, inside)
    return panel


def _lines(x: FloatArray, y: FloatArray, error: FloatArray, inside: NDArray[np.bool_]) -> list[Trace]:
    """Return a merged curve with its band; it is solid in the range that was measured at the reference."""
    black: dict[str, Any] = {"colour": "#000000"}
    return [
        Trace("band", columns(x=x, y=Mean(y, y / error, y * error)), "merged curve", **black),
        Trace("law", columns(x=x, y=y), "reached by shifting", "reached by shifting", line="--", **black),
        Trace(
            "law",
            columns(x=x[inside], y=y[inside]),
            "measured at the reference",
            "measured at the reference",
            line="-",
            **black,
        ),
    ]


def _factors(curve: xr.Dataset, by: str, factor: str, reference: float) -> Panel:
    groups = curve[by].to_numpy()
    value, error = curve[factor], curve[f"{factor}_error"]
    across = "vertical" not in factor
    moved = str(curve.attrs["abscissa" if across else "ordinate"]).replace("_", " ")
    power = "power_exponent" in curve and not is_temperature(by, _unit(curve, by))
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
