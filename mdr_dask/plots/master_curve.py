"""Figures of a master curve: the curves as measured, the merged curve, the shift factors (thesis figures 3.17 to
3.19).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BAR = 1.0  # standard errors shown


def draw_master_curve(curve: xr.Dataset) -> Figure:
    """Draw what :func:`mdr_dask.fit.master_curve.master_curve` returns: curves, merged curve and factors side by side.

    Bars and the band are one standard error; the merged curve is dashed beyond the range measured at the reference.
    """
    from matplotlib.figure import Figure

    shown = [(str(curve.attrs["group"]), "shift_factor", "vertical_factor", curve.attrs["reference"])]
    if "second" in curve.attrs:
        second = str(curve.attrs["second"]), "second_factor", "second_vertical_factor", curve.attrs["second_reference"]
        shown.append(second)
    rising = bool(curve["vertical_factor"].any())
    panels = 2 + len(shown) * (1 + rising)
    figure = Figure(figsize=(4.4 * panels, 4.2), layout="constrained")
    axes = list(figure.subplots(1, panels))
    _measured(axes.pop(0), curve)
    _merged(axes.pop(0), curve)
    for by, across, along, reference in shown:
        _factors(axes.pop(0), curve, by, across, reference)
        if rising:
            _factors(axes.pop(0), curve, by, along, reference)
    return figure


def _label(name: str, values: xr.DataArray) -> str:
    unit = values.attrs.get("units", "")
    return f"{name.replace('_', ' ')} ({unit})" if unit and unit != "1" else name.replace("_", " ")


def _colours(curve: xr.Dataset) -> Any:
    from matplotlib import colormaps

    return colormaps["viridis"](np.linspace(0, 0.95, curve.sizes[str(curve.attrs["group"])]))


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


def _measured(axes: Axes, curve: xr.Dataset) -> None:
    groups = _by_group(curve)
    for (value, points, shift, rise), colour in zip(groups, _colours(curve), strict=True):
        shifts = points.get("point_shift", shift)
        x, y = points["point_abscissa"] / 10**shifts, points["point_ordinate"] / 10 ** points.get("point_rise", rise)
        if "point_second" not in points:
            axes.loglog(x, y, ".-", color=colour, label=f"{value:.3g}")
            continue
        for number, other in enumerate(np.unique(points["point_second"])):
            one = np.flatnonzero(points["point_second"] == other)
            axes.loglog(x[one], y[one], ".-", color=colour, label=None if number else f"{value:.3g}")
    axes.set_xlabel(_label(curve.attrs["abscissa"], curve["curve_abscissa"]))
    axes.set_ylabel(_label(curve.attrs["ordinate"], curve["curve_ordinate"]))
    if len(groups) <= 12:
        axes.legend(title=_label(curve.attrs["group"], curve[curve.attrs["group"]]), fontsize="small")
    axes.set_title("as measured")


def _merged(axes: Axes, curve: xr.Dataset) -> None:
    for (_, points, _, _), colour in zip(_by_group(curve), _colours(curve), strict=True):
        axes.loglog(points["point_abscissa"], points["point_ordinate"], ".", color=colour)
    x, y = curve["curve_abscissa"].to_numpy(), curve["curve_ordinate"].to_numpy()
    error = 10 ** (BAR * curve["curve_error"].to_numpy())
    low, high = (curve["curve_abscissa"].attrs[f"measured_{end}"] for end in ("low", "high"))
    inside = (x >= low) & (x <= high)
    axes.loglog(x, y, "k--", linewidth=1, label="reached by shifting")
    axes.loglog(np.where(inside, x, np.nan), np.where(inside, y, np.nan), "k-", label="measured at the reference")
    axes.fill_between(x, y / error, y * error, color="k", alpha=0.2, label="standard error")
    axes.set_xlabel("shifted " + _label(curve.attrs["abscissa"], curve["curve_abscissa"]))
    axes.set_ylabel(_label(curve.attrs["ordinate"], curve["curve_ordinate"]))
    axes.set_title(f"reference {curve.attrs['reference']:.3g}")
    axes.legend(fontsize="small")


def _factors(axes: Axes, curve: xr.Dataset, by: str, factor: str, reference: float) -> None:
    groups = curve[by].to_numpy()
    error = BAR * curve[f"{factor}_error"]
    axes.errorbar(groups, curve[factor], error, fmt="o", color="k", label="factors, 68 %")
    across = "vertical" not in factor
    if "power_exponent" in curve and "temperature" not in by.lower() and by not in ("T", "temp"):
        exponent = float(curve["power_exponent"])
        if across:
            axes.plot(groups, exponent * np.log10(groups / reference), label=f"slope {exponent:.3g}")
        axes.set_xscale("log")
        _plain_ticks(axes, groups)
    axes.set_xlabel(_label(by, curve[by]))
    moved = str(curve.attrs["abscissa" if across else "ordinate"]).replace("_", " ")
    axes.set_ylabel(f"shift of log10 {moved} (decades)")
    axes.set_title("shift factors" if across else "vertical factors")
    axes.legend(fontsize="small")


def _plain_ticks(axes: Axes, groups: NDArray[np.float64]) -> None:
    """Name three or four of the groups on a logarithmic axis: within a decade its own labels run into each other."""
    from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator

    if np.ptp(np.log10(groups)) >= 2:
        axes.xaxis.set_minor_formatter(NullFormatter())
        return
    named = np.unique(np.linspace(0, groups.size - 1, min(groups.size, 4)).round().astype(int))
    axes.xaxis.set_major_locator(FixedLocator(groups[named]))
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:.3g}")
    axes.xaxis.set_minor_locator(NullLocator())


def _of_store(series: Mapping[str, xr.Dataset]) -> Figure:
    from mdr_dask.fit.master_curve import friction_of_roughness, master_curve

    return draw_master_curve(master_curve(friction_of_roughness(series)))


PLOTS = (
    Plot(
        "master_curve",
        ("sliding_friction",),
        "coefficient of friction over force at each velocity, merged, and shift factors (figures 3.17 to 3.19)",
        _of_store,
    ),
)
