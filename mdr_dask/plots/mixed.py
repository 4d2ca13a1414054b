"""Figures of mixed lubrication: thesis figures 5.5, 5.7a and 5.9a, sensitivities beside them, and a Stribeck curve."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.plots import curves, drawing, style
from mdr_dask.plots.base import Plot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MODELS = ("mixed_lubrication",)
OPERATION = ("normal_force", "rotation_speed", "temperature")
#: What a title says of a case.
CASE = (*OPERATION, "rms_roughness", "slide_roll_ratio", "layer_thickness", "boundary_friction")
PROBABILITY = "breakthrough_probability"
MOST_SERIES = 4
#: What a logarithmic axis shows beside the largest value: shares of asperities go to zero without an end.
LEAST_PART = 1e-7


def _cases(found: Mapping[str, xr.Dataset], output: str) -> tuple[list[tuple[str, xr.Dataset]], list[str]]:
    """Return single cases of all series, spread evenly over them, each with its series; and what is left out."""
    every = []
    for name, data in found.items():
        axes = curves.axes_of(data, output)
        places = itertools.product(*(range(data.sizes[axis]) for axis in axes))
        every += [(name, data.isel(dict(zip(axes, place, strict=True)))) for place in places]
    chosen = np.unique(np.linspace(0, len(every) - 1, min(style.MOST_PANELS, len(every))).round().astype(int))
    told = [f"realisations but the first of {max(data.sizes['realisation'] for data in found.values())}"]
    told = told if any(data.sizes["realisation"] > 1 for data in found.values()) else []
    if chosen.size < len(every):
        told.append(f"{len(every) - chosen.size} of {len(every)} cases ({chosen.size} drawn, spread evenly)")
    return [every[number] for number in chosen], told


def _case_titles(figure: Figure, subject: str, panels: Sequence[Axes], cases: Sequence[tuple[str, xr.Dataset]]) -> None:
    """Write what all cases share over the figure, and over each panel its series and what it alone has."""
    alike = curves.fixed_by_all([curves.scalars(case) for _, case in cases])
    style.title(figure, subject, curves.fixed_text(alike, CASE))
    for panel, (name, case) in zip(panels, cases, strict=True):
        own = {key: value for key, value in curves.scalars(case).items() if key not in alike}
        text = ", ".join(part for part in (name, curves.fixed_text(own, tuple(own)), panel.get_title()) if part)
        panel.set_title(text, fontsize="small")


def draw_profiles(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the two surfaces in the contact at the moment of greatest contact, realisation 0 (thesis figure 5.5)."""
    cases, told = _cases(curves.with_outputs(groups, ["upper_profile", "lower_profile", "film"]), "film")
    figure, panels = drawing.panels(len(cases), columns=1, size=(8.0, 2.4), sharex=True)
    for panel, (_, case) in zip(panels, cases, strict=True):
        one = case.isel(realisation=0)
        upper, lower = one["upper_profile"].values * 1e6, one["lower_profile"].values * 1e6
        place = one["position"].values
        colours = style.scale(2)
        label = "elastic roller, held off by the film"
        drawing.plain(panel, place, upper, label=label, of=case, lw=0.8, color=colours[0])
        drawing.plain(panel, place, lower, label="rough counter body", of=case, lw=0.8, color=colours[1])
        panel.fill_between(place, lower, upper, where=lower > upper, color="k", label="overlap", gid=style.GUIDE)
        for edge in (-1, 1):
            panel.axvline(edge, color="0.7", lw=0.8, ls=":")
        panel.set_title(f"$h_0$ = {float(one['film']) * 1e6:.2f} µm")
        panel.set_ylabel("height [µm]")
    _case_titles(figure, "surfaces where the contact is greatest", panels, cases)
    figure.legend(*panels[0].get_legend_handles_labels(), fontsize="small", loc="outside upper right", ncols=3)
    panels[-1].set_xlabel("place over half width of the contact $x/a$")
    style.leave_out(figure, told)
    return figure


def draw_trace(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the contact length over one turn, realisation 0 (thesis figure 5.7a)."""
    cases, told = _cases(curves.with_outputs(groups, ["contact_length_trace"]), "contact_length_trace")
    figure, panels = drawing.panels(len(cases), columns=1, size=(8.0, 1.9))
    for panel, (_, case) in zip(panels, cases, strict=True):
        trace = case["contact_length_trace"].isel(realisation=0)
        time = case["angle"].values / float(case["rotation_speed"]) * 1e3
        drawing.plain(panel, time, trace.values * 1e6, of=case, lw=0.5, color=style.colour(0))
        share = float((trace > 0).where(trace.notnull()).mean())
        panel.set_title(f"layer broken during {share:.1%} of this turn")
        panel.set_ylabel("contact\nlength [µm]")
        panel.set_ylim(bottom=0)
    _case_titles(figure, "length in intimate contact over a turn", panels, cases)
    panels[-1].set_xlabel("time [ms]")
    style.leave_out(figure, told)
    return figure


class _Row(NamedTuple):
    """One quantity of a figure: what it is computed from, how, and its label."""

    outputs: tuple[str, ...]
    label: str
    value: Callable[[xr.Dataset], drawing.Mean]
    logarithmic: bool = False


def _scaled(output: str, factor: float = 1.0) -> Callable[[xr.Dataset], drawing.Mean]:
    return lambda data: curves.measured(data, output, factor)


PER_CENT = _Row((PROBABILITY,), "breakthrough\nprobability [%]", _scaled(PROBABILITY, 100.0))


def _draw_row(axes: Axes, family: curves.Family, row: _Row, along: str, bars: bool) -> None:
    """Draw one quantity along a parameter, every curve of a family."""
    across, drawn = [], []
    for curve in family.curves:
        x, value = np.atleast_1d(style.shown(along, curve.data[along])), row.value(curve.data)
        drawing.curve(axes, curve, x, value, bars=bars)
        across += x.tolist()
        drawn += np.ravel(value.value).tolist()
    axes.set_ylabel(row.label)
    if along != "temperature" and style.is_geometric(across):
        style.logarithmic(axes, "x")
    if row.logarithmic and style.is_geometric(drawn):
        least, most = np.nanmin(drawn), np.nanmax(drawn)
        axes.set_ylim(max(0.5 * least, LEAST_PART * most), 2 * most)
        style.logarithmic(axes, "y")


def _is_cut(axes: Axes) -> bool:
    """Return whether a panel ends above some of its data."""
    lines = [np.asarray(line.get_ydata(), dtype=np.float64) for line in axes.lines if line.get_gid() == style.DATA]
    low = min((np.nanmin(each[each > 0], initial=np.inf) for each in lines), default=np.inf)
    return axes.get_yscale() == "log" and low < axes.get_ylim()[0]


def draw_temperature(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the probability against temperature for each load, a panel for each speed (thesis figure 5.9a)."""
    found = curves.with_outputs(groups, [PROBABILITY], "temperature")
    name = max(found, key=lambda key: sum(found[key][axis].size > 1 for axis in OPERATION if axis in found[key].coords))
    rest = [other for other in found if other != name]
    data, told = found[name], [f"series {', '.join(rest)}"] if rest else []
    by_speed = "rotation_speed" in data[PROBABILITY].dims
    if by_speed:
        data, more = curves.thin(data, "rotation_speed", style.MOST_PANELS)
        told += more
    parts = [data.isel(rotation_speed=k) for k in range(data.sizes["rotation_speed"])] if by_speed else [data]
    figure, panels = drawing.panels(len(parts), size=(4.4, 3.8), sharey=True)
    families = []
    for panel, part in zip(panels, parts, strict=True):
        family = curves.family(part, PROBABILITY, "temperature", ("normal_force",))
        families.append(family)
        told += family.left_out
        _draw_row(panel, family, PER_CENT, "temperature", bars=True)
        panel.set_xlabel(style.label("temperature", data["temperature"]))
        if by_speed:
            panel.set_title(style.named("rotation_speed", part["rotation_speed"]), fontsize="small")
    curves.finish(figure, panels[-1] if families[0].bar else panels[0], families[0])
    held = curves.fixed_text(curves.fixed_by_all([each.held for each in families]), CASE)
    bars = curves.meaning_of_bars(data, outputs=[PROBABILITY])
    style.title(figure, f"breakthrough of the layer{f', series {name}' if name else ''}", held, bars)
    style.leave_out(figure, told)
    return figure


def draw_sensitivity(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw the probability against each parameter that a series varies besides load, speed and temperature."""
    found = []
    for name, data in curves.with_outputs(groups, [PROBABILITY]).items():
        axes = curves.axes_of(data, PROBABILITY)
        varied = [each for axis in axes for each in curves.parameters_along(data, axis)]
        numeric = [each for each in varied if each in data.coords and data[each].dtype.kind in "fiu"]
        found += [(name, data, each) for each in numeric if each not in OPERATION]
    if not found:
        raise DataError("no series of the store varies a number besides load, speed and temperature")
    most = 2 * style.MOST_PANELS
    told = [f"{name}: {along}" for name, _, along in found[most:]]
    found = found[:most]
    figure, panels = drawing.panels(len(found), columns=4, size=(4.0, 3.4), sharey=True)
    held = []
    for panel, (name, data, along) in zip(panels, found, strict=True):
        family = curves.family(data, PROBABILITY, along, ("temperature", *OPERATION))
        held.append(family.held)
        told += [f"{name}: {each}" if name else each for each in family.left_out]
        _draw_row(panel, family, PER_CENT, along, bars=True)
        panel.set_xlabel(style.label(along, data[along]))
        curves.finish(figure, panel, family)
    text = curves.fixed_text(curves.fixed_by_all(held), CASE)
    bars = curves.meaning_of_bars(*(data for _, data, _ in found), outputs=[PROBABILITY])
    style.title(figure, "sensitivity of the breakthrough", text, bars)
    style.leave_out(figure, told)
    return figure


def _width(data: xr.Dataset) -> drawing.Mean:
    """Return the width in intimate contact in per cent of the contact."""
    factor = 100 / (2 * data["contact_half_width"])
    return curves.measured(data, "contact_length", factor)


STRIBECK = (
    _Row(("friction_coefficient",), "coefficient\nof friction", _scaled("friction_coefficient"), logarithmic=True),
    _Row(("asperity_load_share",), "load on\nasperities [%]", _scaled("asperity_load_share", 100.0), logarithmic=True),
    _Row(("contact_length", "contact_half_width"), "width in intimate\ncontact [%]", _width),
    PER_CENT,
    _Row(("film_ratio",), r"film ratio $h_0/\sigma$", _scaled("film_ratio"), logarithmic=True),
)


def draw_stribeck(groups: Mapping[str, xr.Dataset]) -> Figure:
    """Draw friction, and with it what the store holds of its causes, against the speed: a column for each series."""
    found = curves.with_outputs(groups, ["friction_coefficient"], "rotation_speed")
    found, told = curves.few(found, MOST_SERIES)
    rows = [row for row in STRIBECK if all(name in data for name in row.outputs for data in found.values())]
    figure, panels = drawing.panels(len(rows) * len(found), columns=len(found), size=(6.4, 2.2), sharex="col")
    families = []
    for column, (name, data) in enumerate(found.items()):
        family = curves.family(data, "friction_coefficient", "rotation_speed", OPERATION)
        families.append(family)
        told += [f"{name}: {each}" if name else each for each in family.left_out]
        mine = panels[column :: len(found)]
        for panel, row in zip(mine, rows, strict=True):
            _draw_row(panel, family, row, "rotation_speed", bars=False)
            if row.outputs == ("film_ratio",):
                panel.axhline(1, color="0.7", lw=0.8, ls=":")
        mine[-1].set_xlabel(style.label("rotation_speed", data["rotation_speed"]))
        curves.finish(figure, mine[0], family)
    alike = curves.fixed_by_all([each.held for each in families])
    for column, (name, family) in enumerate(zip(found, families, strict=True)):
        own = curves.fixed_text({key: value for key, value in family.held.items() if key not in alike}, CASE)
        panels[column].set_title(", ".join(part for part in (name, own) if part), fontsize="small")
    bars = curves.meaning_of_bars(*found.values(), outputs=["friction_coefficient"])
    if any(_is_cut(axes) for axes in panels):
        told.append(f"values below {LEAST_PART:g} of the largest of their row")
    style.title(figure, "Stribeck curve", curves.fixed_text(alike, CASE), bars)
    style.leave_out(figure, told)
    return figure


PLOTS: tuple[Plot, ...] = (
    Plot("profiles", MODELS, "the two surfaces in the contact, with their overlaps (thesis figure 5.5)", draw_profiles),
    Plot("trace", MODELS, "contact length over the time of one turn (thesis figure 5.7a)", draw_trace),
    Plot(
        "temperature",
        MODELS,
        "breakthrough probability against temperature, by load and speed (figure 5.9a)",
        draw_temperature,
    ),
    Plot("sensitivity", MODELS, "breakthrough probability against every other parameter that varies", draw_sensitivity),
    Plot("stribeck", MODELS, "friction, share in contact, probability and film ratio against speed", draw_stribeck),
)
