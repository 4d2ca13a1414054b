"""Figures of a master curve: the curves as measured, the merged curve, the shift factors.

Thesis figures 3.17 to 3.19 are such figures of measurements, which are not public.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BAR = 1.0  # standard errors shown
#: Rms deviation from the merged curve up to which curves count as one: laws of friction are not meant to hold better.
COLLAPSED = 0.05


def draw_master_curve(curve: xr.Dataset) -> Figure:
    """Draw what :func:`mdr_dask.fits.master_curve.master_curve` returns: curves, merged curve and factors side by side.

    Bars and the band are 68 %; the merged curve is dashed beyond the range measured at the reference. The title says
    how far the points are from the merged curve, and whether they collapse at all.
    """
    shown = [(str(curve.attrs["group"]), "shift_factor", "vertical_factor", curve.attrs["reference"])]
    if "second" in curve.attrs:
        second = str(curve.attrs["second"]), "second_factor", "second_vertical_factor", curve.attrs["second_reference"]
        shown.append(second)
    rising = bool(curve["vertical_factor"].any())
    count = 2 + len(shown) * (1 + rising)
    figure, panels = drawing.panels(count, columns=count, size=(4.6, 4.0))
    axes = iter(panels)
    _measured(figure, next(axes), curve)
    _merged(next(axes), curve)
    for by, across, along, reference in shown:
        _factors(next(axes), curve, by, across, reference)
        if rising:
            _factors(next(axes), curve, by, along, reference)
    references = ", ".join(f"{by} = {reference:.4g} {_unit(curve, by)}".strip() for by, _, _, reference in shown)
    style.title(figure, "master curve", f"reference: {references}", _collapse(curve))
    return figure


def _collapse(curve: xr.Dataset) -> str:
    """Return how far the points are from the merged curve, and whether that is a collapse."""
    away = deviations(curve)
    rms, largest = float(np.sqrt(np.mean(away**2))), float(np.max(np.abs(away)))
    said = "" if rms < COLLAPSED else "the curves do NOT collapse: "
    return f"{said}points deviate from the merged curve by {rms:.1%} (rms), at most by {largest:.1%}"


def deviations(curve: xr.Dataset) -> FloatArray:
    """Return the natural logarithms of the points over the merged curve, straight between its points on both scales."""
    x, y = (np.log(curve[f"curve_{name}"].to_numpy()) for name in ("abscissa", "ordinate"))
    order = np.argsort(x)
    at = np.log(curve["point_abscissa"].to_numpy())
    away: FloatArray = np.log(curve["point_ordinate"].to_numpy()) - np.interp(at, x[order], y[order])
    return away


def _unit(curve: xr.Dataset, name: str) -> str:
    unit = str(curve[name].attrs.get("units", "")) if name in curve.coords else ""
    return "" if unit == "1" else unit


def _label(name: str, values: xr.DataArray) -> str:
    return style.with_unit(name.replace("_", " "), str(values.attrs.get("units", "")))


def _colours(curve: xr.Dataset) -> list[Any]:
    """Return a colour for every group: named in a legend, or read off a colour bar."""
    groups = curve[str(curve.attrs["group"])].to_numpy()
    if groups.size <= style.most_colours():
        return list(style.scale(groups.size))
    how, norm = style.shades(groups)
    return [how(norm(float(value))) for value in groups]


def _by_group(curve: xr.Dataset) -> list[tuple[float, xr.Dataset, float, float]]:
    """Return each group with its points and factors."""
    by = str(curve.attrs["group"])
    return [
        (
            float(value),
            curve[[name for name in curve.data_vars if curve[name].dims == ("point",)]].isel(
                point=np.flatnonzero(curve["point_group"].to_numpy() == value)
            ),
            float(curve["shift_factor"][i]),
            float(curve["vertical_factor"][i]),
        )
        for i, value in enumerate(curve[by].to_numpy())
    ]


def _measured(figure: Figure, axes: Axes, curve: xr.Dataset) -> None:
    groups = _by_group(curve)
    for (value, points, shift, rise), colour in zip(groups, _colours(curve), strict=True):
        shifts = points.get("point_shift", shift)
        x, y = points["point_abscissa"] / 10**shifts, points["point_ordinate"] / 10 ** points.get("point_rise", rise)
        if "point_second" not in points:
            drawing.plain(axes, x, y, ".-", color=colour, label=f"{value:.3g}")
            continue
        for number, other in enumerate(np.unique(points["point_second"])):
            one = np.flatnonzero(points["point_second"] == other)
            label = None if number else f"{value:.3g}"
            drawing.plain(axes, x[one], y[one], ".-", color=colour, label=label)
    axes.set_xlabel(_label(curve.attrs["abscissa"], curve["curve_abscissa"]))
    axes.set_ylabel(_label(curve.attrs["ordinate"], curve["curve_ordinate"]))
    heading = _label(curve.attrs["group"], curve[curve.attrs["group"]])
    style.logarithmic(axes, "xy")
    if len(groups) <= style.most_colours():
        style.legend(axes, heading)
    else:
        from matplotlib.cm import ScalarMappable

        how, norm = style.shades([value for value, *_ in groups])
        figure.colorbar(ScalarMappable(norm, how), ax=axes, label=heading)
    axes.set_title("as measured", fontsize="small")


def _merged(axes: Axes, curve: xr.Dataset) -> None:
    for (_, points, _, _), colour in zip(_by_group(curve), _colours(curve), strict=True):
        drawing.plain(axes, points["point_abscissa"], points["point_ordinate"], ".", color=colour)
    x, y = curve["curve_abscissa"].to_numpy(), curve["curve_ordinate"].to_numpy()
    error = 10 ** (BAR * curve["curve_error"].to_numpy())
    low, high = (curve["curve_abscissa"].attrs[f"measured_{end}"] for end in ("low", "high"))
    inside = (x >= low) & (x <= high)
    drawing.law(axes, x, y, "k--", linewidth=1, label="reached by shifting")
    drawing.law(axes, x, np.where(inside, y, np.nan), "k-", label="measured at the reference")
    drawing.band(axes, x, y / error, y * error, "merged curve", color="k", label="standard error")
    axes.set_xlabel("shifted " + _label(curve.attrs["abscissa"], curve["curve_abscissa"]))
    axes.set_ylabel(_label(curve.attrs["ordinate"], curve["curve_ordinate"]))
    style.logarithmic(axes, "xy")
    axes.set_title("merged", fontsize="small")
    style.legend(axes)


def _factors(axes: Axes, curve: xr.Dataset, by: str, factor: str, reference: float) -> None:
    groups = curve[by].to_numpy()
    error = BAR * curve[f"{factor}_error"]
    value = curve[factor]
    factors = drawing.Mean(value, value - error, value + error)
    drawing.points(axes, groups, factors, "k", "o", "factors, 68 %")
    across = "vertical" not in factor
    if "power_exponent" in curve and "temperature" not in by.lower() and by not in ("T", "temp"):
        exponent = float(curve["power_exponent"])
        if across:
            slope = exponent * np.log10(groups / reference)
            drawing.law(axes, groups, slope, color=style.colour(style.FITTED), label=f"slope {exponent:.3g}")
        style.logarithmic(axes, "x")
    axes.set_xlabel(_label(by, curve[by]))
    moved = str(curve.attrs["abscissa" if across else "ordinate"]).replace("_", " ")
    axes.set_ylabel(style.with_unit(f"shift of log10 {moved}", "decades"))
    axes.set_title("shift factors" if across else "vertical factors", fontsize="small")
    style.legend(axes)


def _of_store(groups: Mapping[str, xr.Dataset]) -> Figure:
    from mdr_dask.fits.master_curve import friction_of_roughness, master_curve

    found, told = {}, []
    for name, data in groups.items():
        if "friction_coefficient" in data:
            others = [d for d in curves.axes_of(data, "friction_coefficient") if d not in ("normal_force", "velocity")]
            found[name], more = curves.hold(data, others)
            told += [f"{name}: {each}" if name else each for each in more]
    figure = draw_master_curve(master_curve(friction_of_roughness(found)))
    style.leave_out(figure, told)
    return figure


PLOTS = (
    Plot(
        "master_curve",
        ("sliding_friction",),
        "coefficient of friction over force at each velocity, merged, and shift factors (as figures 3.17 to 3.19)",
        _of_store,
    ),
)
