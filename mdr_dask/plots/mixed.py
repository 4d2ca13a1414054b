"""Figures of mixed lubrication: thesis figures 5.5, 5.7a and 5.9a, sensitivities beside them, and a Stribeck curve."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODELS = ("mixed_lubrication",)
OPERATION = ("normal_force", "rotation_speed", "temperature")
MOST_PANELS = 6


@dataclass(frozen=True)
class _Shown:
    """How a parameter is written in a figure: its symbol, a unit of the field, and the way there from SI."""

    symbol: str
    unit: str
    factor: float = 1.0
    offset: float = 0.0
    logarithmic: bool = False

    def __call__(self, values: Any) -> Any:
        return np.asarray(values, dtype=np.float64) * self.factor + self.offset

    def label(self, value: float) -> str:
        return f"{float(self(value)):.4g} {self.unit}".strip()


SHOWN: dict[str, _Shown] = {
    "normal_force": _Shown("normal force $F_N$", "N", logarithmic=True),
    "rotation_speed": _Shown("rotation speed", "rpm", 30 / np.pi, logarithmic=True),
    "temperature": _Shown("temperature", "°C", 1.0, -273.15),
    "slide_roll_ratio": _Shown("slide-roll ratio", ""),
    "rms_roughness": _Shown("rms height of each roller", "µm", 1e6, logarithmic=True),
    "pressure_viscosity": _Shown("pressure-viscosity coefficient α", "1/GPa", 1e9),
    "layer_thickness": _Shown("layer thickness $h_c$", "nm", 1e9, logarithmic=True),
    "layer_shear_strength": _Shown("layer strength $τ_0$", "MPa", 1e-6, logarithmic=True),
    "hurst": _Shown("Hurst exponent $H$", ""),
    "longest_wavelength": _Shown("longest wavelength", "mm", 1e3, logarithmic=True),
    "shortest_wavelength": _Shown("shortest wavelength", "µm", 1e6, logarithmic=True),
}


def _shown(name: str) -> _Shown:
    return SHOWN.get(name, _Shown(name.replace("_", " "), "SI"))


def _axis_label(name: str) -> str:
    shown = _shown(name)
    return f"{shown.symbol} [{shown.unit}]" if shown.unit else shown.symbol


def _axes_of(dataset: xr.Dataset, output: str) -> list[str]:
    extra = {"realisation", "angle", "position"}
    return [str(dim) for dim in dataset[output].dims if dim not in extra]


def _mean_and_error(array: xr.DataArray) -> tuple[xr.DataArray, xr.DataArray]:
    """Return mean and standard error over the realisations that there are; NaN for the error of one."""
    number = array.notnull().sum("realisation")
    mean = array.sum("realisation") / number.where(number > 0)
    variance = ((array - mean) ** 2).sum("realisation") / (number - 1).where(number > 1)
    return mean, (variance / number) ** 0.5


def _with(groups: Mapping[str, xr.Dataset], outputs: tuple[str, ...], axis: str = "") -> dict[str, xr.Dataset]:
    """Return the groups that hold the outputs, and vary along an axis if one is named.

    Raises
    ------
    DataError
        If there is none.
    """
    found = {
        name: dataset
        for name, dataset in groups.items()
        if all(output in dataset for output in outputs) and (not axis or axis in dataset[outputs[0]].dims)
    }
    if not found:
        over = f" over {axis}" if axis else ""
        raise DataError(f"no series of the store holds {', '.join(outputs)}{over}; add them to the campaign's outputs")
    return found


def _cases(dataset: xr.Dataset, output: str, most: int) -> list[tuple[str, xr.Dataset]]:
    """Return up to `most` single cases of a group, spread evenly, each with a title of what varies."""
    axes = _axes_of(dataset, output)
    places = list(itertools.product(*(range(dataset.sizes[axis]) for axis in axes)))
    chosen = sorted({int(i) for i in np.linspace(0, len(places) - 1, min(most, len(places))).round()})
    found = []
    for number in chosen:
        case = dataset.isel(dict(zip(axes, places[number], strict=True)))
        found.append(
            (", ".join(f"{_shown(axis).symbol} {_shown(axis).label(float(case[axis]))}" for axis in axes), case)
        )
    return found


def _panels(count: int, columns: int, size: tuple[float, float], **shared: Any) -> tuple[Figure, list[Axes]]:
    from matplotlib.figure import Figure

    rows = -(-count // columns)
    figure = Figure(figsize=(size[0] * columns, size[1] * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, **shared)
    panels = list(grid.ravel())
    for unused in panels[count:]:
        unused.set_visible(False)
    return figure, panels[:count]


def draw_profiles(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the two surfaces in the contact at the moment of greatest contact, realisation 0 (thesis figure 5.5)."""
    found = _with(groups, ("upper_profile", "lower_profile", "film"))
    cases = [case for dataset in found.values() for case in _cases(dataset, "film", 3)][:MOST_PANELS]
    figure, panels = _panels(len(cases), 1, (8.0, 2.2), sharex=True)
    for panel, (title, case) in zip(panels, cases, strict=True):
        one = case.isel(realisation=0)
        upper, lower = one["upper_profile"].values * 1e6, one["lower_profile"].values * 1e6
        place = one["position"].values
        panel.plot(place, upper, lw=0.8, label="elastic roller, held off by the film")
        panel.plot(place, lower, lw=0.8, label="rough counter body")
        panel.fill_between(place, lower, upper, where=lower > upper, color="crimson", label="overlap")
        for edge in (-1, 1):
            panel.axvline(edge, color="0.7", lw=0.8, ls=":")
        panel.set_title(f"{title}  ($h_0$ = {float(one['film']) * 1e6:.2f} µm)", fontsize="small")
        panel.set_ylabel("height [µm]")
    figure.legend(*panels[0].get_legend_handles_labels(), fontsize="small", loc="outside upper center", ncols=3)
    panels[-1].set_xlabel("place over half width of the contact, $x/a$")
    return figure


def draw_trace(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the contact length over one turn, realisation 0 (thesis figure 5.7a)."""
    found = _with(groups, ("contact_length_trace",))
    cases = [case for dataset in found.values() for case in _cases(dataset, "contact_length_trace", 3)][:MOST_PANELS]
    figure, panels = _panels(len(cases), 1, (8.0, 1.7), sharex=True)
    for panel, (title, case) in zip(panels, cases, strict=True):
        trace = case["contact_length_trace"].isel(realisation=0)
        time = case["angle"].values / float(case["rotation_speed"]) * 1e3
        panel.plot(time, trace.values * 1e6, lw=0.5)
        share = float((trace > 0).mean())
        panel.set_title(f"{title}: layer broken during {share:.1%} of this turn", fontsize="small")
        panel.set_ylabel("contact\nlength [µm]")
        panel.set_ylim(bottom=0)
    panels[-1].set_xlabel("time [ms]")
    return figure


def _probability_lines(panel: Axes, array: xr.DataArray, along: str, by: str | None) -> None:
    """Draw probability in per cent with bars of one standard error along an axis, a line for each value of another."""
    mean, error = _mean_and_error(array)
    shown = _shown(along)
    for index in range(array.sizes[by] if by else 1):
        pick = {by: index} if by else {}
        label = _shown(by).label(float(array[by][index])) if by else None
        y, dy = mean.isel(pick).values * 100, error.isel(pick).values * 100
        panel.errorbar(shown(array[along].values), y, np.nan_to_num(dy), marker="o", ms=3, lw=1, capsize=2, label=label)
    panel.set_xlabel(_axis_label(along))
    values = array[along].values
    if shown.logarithmic and values.max() > 10 * values.min():
        panel.set_xscale("log")


def draw_temperature(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the probability over temperature for each load, at up to three speeds (thesis figure 5.9a)."""
    name = "breakthrough_probability"
    dataset = max(_with(groups, (name,), "temperature").values(), key=lambda d: len(_operating_axes(d)))
    array = dataset[name]
    others = [axis for axis in _axes_of(dataset, name) if axis not in OPERATION]
    array = array.isel(dict.fromkeys(others, 0))
    speeds: list[int | None] = [None]
    if "rotation_speed" in array.dims:
        count = array.sizes["rotation_speed"]
        speeds = sorted({0, (count - 1) // 2, count - 1})  # type: ignore[assignment]
    figure, panels = _panels(len(speeds), len(speeds), (4.0, 3.8), sharey=True)
    for panel, speed in zip(panels, speeds, strict=True):
        part = array if speed is None else array.isel(rotation_speed=speed)
        _probability_lines(panel, part, "temperature", "normal_force" if "normal_force" in part.dims else None)
        panel.set_title(_shown("rotation_speed").label(float(part["rotation_speed"])), fontsize="small")
    panels[0].set_ylabel("breakthrough probability [%]\n(bars: one standard error)")
    if panels[0].get_legend_handles_labels()[1]:
        panels[0].legend(title="normal force", fontsize="small")
    return figure


def _operating_axes(dataset: xr.Dataset) -> list[str]:
    return [axis for axis in OPERATION if axis in dataset["breakthrough_probability"].dims]


def draw_sensitivity(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the probability over each parameter that a series varies besides load, speed and temperature."""
    name = "breakthrough_probability"
    found = []
    for dataset in _with(groups, (name,)).values():
        axes = _axes_of(dataset, name)
        varied = [axis for axis in axes if axis not in OPERATION and axis in SHOWN]
        found += [(dataset[name], axis, [other for other in axes if other != axis]) for axis in varied[:1]]
    if not found:
        raise DataError("no series of the store varies anything besides load, speed and temperature")
    figure, panels = _panels(len(found), min(4, len(found)), (3.6, 3.2), sharey=True)
    for panel, (array, axis, others) in zip(panels, found, strict=True):
        by = others[-1] if others else None
        _probability_lines(panel, array.isel(dict.fromkeys(others[:-1], 0)), axis, by)
    panels[0].set_ylabel("breakthrough probability [%]\n(bars: one standard error)")
    if panels[0].get_legend_handles_labels()[1]:
        panels[0].legend(fontsize="small")
    return figure


def draw_stribeck(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw friction, share in intimate contact and probability over the rotation speed, one line a load."""
    outputs = ("friction_coefficient", "breakthrough_probability", "contact_length", "contact_half_width", "film_ratio")
    dataset = next(iter(_with(groups, outputs, "rotation_speed").values()))
    other = [axis for axis in _axes_of(dataset, outputs[0]) if axis != "rotation_speed"]
    dataset = dataset.isel(dict.fromkeys(other[:-1], 0))
    by = other[-1] if other else None
    share = dataset["contact_length"] / (2 * dataset["contact_half_width"]) * 100
    rows: list[tuple[xr.DataArray, str]] = [
        (dataset["friction_coefficient"], "coefficient of friction"),
        (share, "width in intimate\ncontact [%]"),
        (dataset["breakthrough_probability"] * 100, "breakthrough\nprobability [%]"),
        (dataset["film_ratio"], "film ratio $h_0/σ$"),
    ]
    figure, panels = _panels(len(rows), 1, (6.5, 2.1), sharex=True)
    for panel, (array, label) in zip(panels, rows, strict=True):
        _banded_lines(panel, array, "rotation_speed", by)
        panel.set_ylabel(label)
    panels[-1].axhline(1, color="0.7", lw=0.8, ls=":")
    panels[-1].set_yscale("log")
    panels[-1].set_xlabel(_axis_label("rotation_speed"))
    panels[0].set_title("bands: one standard error", fontsize="small")
    if by:
        panels[0].legend(fontsize="small")
    return figure


def _banded_lines(panel: Axes, array: xr.DataArray, along: str, by: str | None) -> None:
    mean, error = _mean_and_error(array)
    x = _shown(along)(array[along].values)
    for index in range(array.sizes[by] if by else 1):
        pick = {by: index} if by else {}
        y, dy = mean.isel(pick).values, np.nan_to_num(error.isel(pick).values)
        line = panel.plot(x, y, marker="o", ms=3, lw=1, label=_shown(by).label(float(array[by][index])) if by else None)
        panel.fill_between(x, y - dy, y + dy, color=line[0].get_color(), alpha=0.3)
    panel.set_xscale("log")


PLOTS: tuple[Plot, ...] = (
    Plot("profiles", MODELS, "the two surfaces in the contact, with their overlaps (thesis figure 5.5)", draw_profiles),
    Plot("trace", MODELS, "contact length over the time of one turn (thesis figure 5.7a)", draw_trace),
    Plot(
        "temperature", MODELS, "breakthrough probability over temperature, load, speed (figure 5.9a)", draw_temperature
    ),
    Plot("sensitivity", MODELS, "breakthrough probability over every other parameter that varies", draw_sensitivity),
    Plot("stribeck", MODELS, "friction, share in contact, probability and film ratio over speed", draw_stribeck),
)
