"""Figures of any output of any model against parameters: curves and maps."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from mdr_dask import aggregation
from mdr_dask.arrays import is_geometric
from mdr_dask.errors import LISTED, DataError, did_you_mean
from mdr_dask.models.base import Status
from mdr_dask.plots import colours, curves, labels, laws
from mdr_dask.plots.base import Plot
from mdr_dask.plots.figure import Axis, Figure, Key, Mean, Panel, Trace, columns

#: Largest number of characters in a line of text at a tick. Chosen by trial.
LONGEST_WORD = 20
#: `MARKS`: marks for cases without a value. `SOME`: mark for a case in which some realisations failed or did not
#: converge, because the mean of the others may be biased.
MARKS = {
    Status.FAILED: ("x", "failed"),
    Status.NOT_CONVERGED: ("+", "did not converge"),
    Status.MISSING: ("1", "missing"),
}
SOME = "v", "mean without realisations that failed"
T = TypeVar("T")
Series = Mapping[str, xr.Dataset]
#: The title of a panel, and the series in the panel.
Part = tuple[str, dict[str, xr.Dataset]]


@dataclass(frozen=True)
class View:
    """The description of a figure of outputs. Each output has its own panels (see `draw`).

    `over` is the parameter on the horizontal axis. With two parameters, the figure is a map. Colours show the values of
    the parameter `by`. There is one panel for each value of the parameter `panels`. `log` contains the letters of the
    logarithmic axes (x, y, and z for colours). If `log` is None, an axis is logarithmic if the numbers are positive and
    span more than a factor of ten, with three exceptions: the vertical axis of an output that is a pure number is
    linear, an axis in a unit with an offset, such as degC, is linear, and both axes are linear if an output that is a
    curve, such as a profile, is drawn against its own coordinate. If `single` is true, the first realisation is drawn
    instead of the mean. `guides` contains positions and names of horizontal lines for each output.
    """

    outputs: str | tuple[str, ...]
    over: str | Sequence[str]
    by: str = ""
    panels: str = ""
    log: str | None = None
    single: bool = False
    guides: Mapping[str, Mapping[float, str]] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return (self.outputs,) if isinstance(self.outputs, str) else tuple(self.outputs)

    @property
    def along(self) -> tuple[str, ...]:
        """Names of the parameters in `over`."""
        return (self.over,) if isinstance(self.over, str) else tuple(self.over)

    def is_log(self, which: str, values: Any, how: labels.Quantity) -> bool:
        """Return whether an axis is logarithmic. A requested logarithmic axis is linear if a value is not positive."""
        values = np.asarray(values, dtype=np.float64)
        positive = bool((values[np.isfinite(values)] > 0).all())
        return not how.offset and is_geometric(values) if self.log is None else which in self.log and positive


def main_axis(groups: Mapping[str, xr.Dataset], output: str, without: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the parameter that has the most values among the parameters with which an output varies.

    The parameters in `without` are not considered. If the output is itself a curve, for example against time, return
    the coordinate of this curve instead. Return an empty tuple if no parameter is left.
    """
    found: dict[str, int] = {}
    for data in (data for data in groups.values() if output in data):
        own = _own_dims(data, output)
        if own:
            return (own[0],)
        found |= {name: max(found.get(name, 0), data[name].size) for name in varied(data, output)}
    left = [name for name in found if name not in without]
    return (max(left, key=lambda name: found[name]),) if left else ()


def _own_dims(data: xr.Dataset, output: str) -> list[str]:
    """Return the dimensions of an output within a single result, such as the positions of a profile."""
    return [str(dim) for dim in data[output].dims if dim not in (*curves.axes_of(data, output), "realisation")]


def figure_of(
    groups: Mapping[str, xr.Dataset],
    output: str,
    over: str | Sequence[str] = (),
    by: str = "",
    panels: str = "",
    log: str | None = None,
) -> Plot:
    """Return the figure of an output. `View` explains the arguments. An empty `over` means the `main_axis`."""
    view = View(output, over or main_axis(groups, output, (by, panels)), by, panels, log)
    summary = f"{output} against {' and '.join(view.along)}".replace("_", " ")
    return Plot(output, (), summary, lambda groups: draw(groups, view))


def draw(groups: Mapping[str, xr.Dataset], *views: View) -> Figure:
    """Draw the outputs of all views.

    If the outputs have different numbers of panels, or if more than three outputs have one panel each, the panels fill
    row after row. Otherwise the outputs are drawn one above the other.
    If a view cannot be drawn, the figure states the reason, unless another view shows the same output. If no view can
    be drawn, DataError is raised with the reason for each series.
    """
    figures, shown, reasons = [], [], []
    missing: dict[str, list[str]] = {}
    for view, output in [(each, name) for each in views for name in each.names]:
        found, why = _holding(groups, view, output)
        if not found:
            missing.setdefault(output, []).extend(why)
            continue
        reasons += why
        if view.single:
            most = max(data.sizes.get("realisation", 1) for data in found.values())
            reasons += [f"all realisations except the first of {most}"] * (most > 1)
            found = {name: data.isel(realisation=[0]) for name, data in found.items()}
        if not view.along:
            raise DataError(f"expected an output that varies with a parameter, got {output}")
        figures.append((_lines if len(view.along) == 1 else _map)(found, view, output))
        shown.append((view, output, found))
    drawn = {output for _, output, _ in shown}
    reasons += [reason for output, why in missing.items() if output not in drawn for reason in why]
    if not figures:
        raise DataError("; ".join(dict.fromkeys(reasons)))
    whole = figures[0]
    whole.subject = _subject(*shown[0], len(figures) - 1)
    if len(figures) > 1:
        alike = len({len(figure.panels) for figure in figures}) == 1
        groups_of = zip(*(figure.panels for figure in figures), strict=True) if alike else [f.panels for f in figures]
        whole.stack = len(figures) if alike and (len(figures) <= 3 or len(whole.panels) > 1) else 1
        whole.panels = [panel for group in groups_of for panel in group]
        for k, panel in enumerate(whole.panels):
            panel.title = panel.title if k % whole.stack == 0 else ""
        whole.ratio, whole.share_y = 0.45 if whole.stack > 1 else 0.7, False
    whole.leave_out([sentence for figure in figures for sentence in figure.left_out])
    whole.leave_out(reasons)
    return whole


def _holding(groups: Mapping[str, xr.Dataset], view: View, output: str) -> tuple[dict[str, xr.Dataset], list[str]]:
    """Return the series that can be drawn as requested, and the reasons why the other series cannot be drawn."""
    known = sorted({str(name) for data in groups.values() for name in data.data_vars if name != "status"})
    if output not in known:
        hint = did_you_mean(output, known)
        return {}, [f"this study has no output {output!r}{hint if 'mean' in hint else ''}"]
    found: dict[str, xr.Dataset] = {}
    reasons: dict[str, list[str]] = {}
    for name, data in groups.items():
        if output not in data:
            reason = f"{output} was not computed"
        elif not data[output].notnull().any():
            reason = f"no case has a value of {output}; see mdr-dask status"
        else:
            reason = _unfit(data, view, output)
        if reason:
            reasons.setdefault(reason, []).append(name)
        else:
            found[name] = data
    several = len(groups) > 1
    return found, [f"series {', '.join(names)}: {why}" if several else why for why, names in reasons.items()]


def _unfit(data: xr.Dataset, view: View, output: str) -> str:
    """Return the reason why a series cannot be drawn as requested, or an empty text if it can be drawn."""
    own = _own_dims(data, output)
    known = [*varied(data, output), *own]
    for name in (*view.along, view.by, view.panels):
        if name and name not in known:
            others = f"varied: {', '.join(known) or 'nothing'}"
            if name in data.coords and data[name].ndim == 0:
                return f"{labels.plain(labels.named(name, data[name]))} is fixed; {others}"
            hint = did_you_mean(name, known)
            return f"no axis {name!r}{hint if 'mean' in hint else ''}; {others}"
    if rest := [dim for dim in own if dim not in view.along]:
        return f"{output} varies along {rest[0]}: draw it over {rest[0]}, or select {rest[0]}=VALUE"
    dims = [(name, curves.along_dim(data, name, output)) for name in (*view.along, view.by, view.panels) if name]
    if view.panels and _is_sampled(data, dims[-1][1]):
        return f"every case of a sampled study has its own value of {view.panels}: use it as 'by' instead of 'panels'"
    for name, dim in dims:
        if [each for _, each in dims].count(dim) > 1 and not _is_sampled(data, dim):
            return f"{name} is requested twice: curves, panels and axes need different parameters"
    return ""


def varied(data: xr.Dataset, output: str) -> list[str]:
    """Return the names of the parameters with which an output of a series varies."""
    return [name for dim in curves.axes_of(data, output) for name in curves.parameters_along(data, dim)]


def _is_sampled(data: xr.Dataset, dim: str | None) -> bool:
    """Return whether several parameters change together along a dimension."""
    return dim is not None and len(curves.parameters_along(data, dim)) > 1


def _subject(view: View, output: str, found: Mapping[str, xr.Dataset], more: int) -> str:
    several = f" and {more} more output{'s' * (more > 1)}" if more else ""
    along = " and ".join(view.along).replace("_", " ")
    series = f", series {next(iter(found))}" if len(found) == 1 and next(iter(found)) else ""
    return f"{labels.quantity(output, next(iter(found.values()))[output]).symbol}{several} against {along}{series}"


def _places(data: xr.Dataset, name: str) -> xr.DataArray:
    """Return the positions of values on an axis: numbers in the shown unit, or 0, 1, 2, ... for words."""
    values = data[name]
    shown = labels.converted(name, values) if values.dtype.kind in "fiu" else np.arange(values.size)
    return xr.DataArray(shown, dims=values.dims)


def _axis(name: str, arrays: list[xr.DataArray], view: View, which: str) -> Axis:
    """Return the axis of a parameter: a linear axis, a logarithmic axis, or an axis with words at the ticks."""
    first = arrays[0]
    label = labels.label(name, first)
    if first.dtype.kind not in "fiu":
        words = [textwrap.fill(str(word), LONGEST_WORD) for word in np.atleast_1d(first.values)]
        return Axis(label, ticks=[*enumerate(words)])
    every = np.concatenate([np.ravel(labels.converted(name, each)) for each in arrays])
    return Axis(label, log=view.is_log(which, every, labels.quantity(name, first)), quantity=name)


def _height(view: View, output: str, array: xr.DataArray, values: Any) -> Axis:
    """Return the vertical axis of an output. `values` are the drawn values in the shown unit."""
    is_linear = view.log is None and array.attrs.get("units", "1") == "1"
    log = not is_linear and view.is_log("y", values, labels.quantity(output, array))
    return Axis(labels.label(output, array), log, quantity=output)


# curves


def _lines(found: Mapping[str, xr.Dataset], view: View, output: str) -> Figure:
    """Draw an output against one parameter."""
    along = view.along[0]
    if view.log is None and any(along in _own_dims(data, output) for data in found.values()):
        view = replace(view, log="")
    parts, left_out = _divided(found, view, output)
    x = _axis(along, [data[along] for data in found.values()], view, "x")
    panels = [_panel(title, families, view, output, x) for title, families in parts]
    first = next(iter(found.values()))
    drawn = [trace.column("y") for panel in panels for trace in panel.traces if trace.what == "data"]
    values = np.concatenate(drawn)
    y = _height(view, output, first[output], values)
    for panel in panels:
        panel.y = y
        panel.traces += _guides(view.guides.get(output, {}), panel)
    families = [one for _, each in parts for one in each]
    every = [curve.data for one in families for curve in one.curves]
    figure = Figure(panels, "", share_y=len(panels) > 1)
    figure.states = [data["status"] for data in every if "status" in data]
    figure.fixed = curves.fixed_text(curves.fixed_by_all(every), first)
    figure.bars = curves.meaning_of_bars(found.values(), [output])
    figure.leave_out([*left_out, *(sentence for one in families for sentence in one.left_out)])
    return figure


def _guides(levels: Mapping[float, str], panel: Panel) -> list[Trace]:
    across = [trace.column("x") for trace in panel.traces if trace.what == "data"]
    if not across:
        return []
    ends = np.array([np.nanmin(np.concatenate(across)), np.nanmax(np.concatenate(across))])
    found = []
    for k, (level, name) in enumerate(levels.items()):
        line = colours.LINES[1 + k % 3]
        panel.keys.append(Key(name, "#808080", line))
        found.append(Trace("law", columns(x=ends, y=np.full(2, level)), name, name, "#808080", line))
    return found


def _divided(found: Series, view: View, output: str) -> tuple[list[tuple[str, list[curves.Family]]], list[str]]:
    """Return the title and the curves of each panel, and texts about what is left out.

    If `View.panels` names a parameter, there is a panel for each of its values, for at most `LISTED` values of each
    series; DataError is raised if a panel would have more curves of several series than there are colours. Without
    this parameter, there is one panel, or one panel for each of at most `LISTED` series if a common panel would have
    more curves than colours.
    """
    if view.panels:
        parts, left_out = _by_value(found, view)
        panels = [(title, _together(series, view, output)) for title, series in parts]
        if not all(_fit(families) for _, families in panels):
            raise DataError(
                f"expected at most {colours.most()} curves of several series in a panel, got more: "
                "select fewer curves, or leave out 'panels'"
            )
        return panels, left_out
    together = _together(found, view, output)
    if _fit(together):
        return [("", together)], []
    alone = {name: curves.family(data, output, view.along[0], view.by) for name, data in found.items()}
    kept, left_out = curves.with_one_legend(alone)
    panels, more = _by_series({name: [alone[name]] for name in kept})
    return panels, [*left_out, *more]


def _together(series: Series, view: View, output: str) -> list[curves.Family]:
    """Return the curves of all series of a panel. Curves of two series have different colours."""
    found: list[curves.Family] = []
    first = 0
    for name, data in series.items():
        found.append(curves.family(data, output, view.along[0], view.by, name if len(series) > 1 else "", first))
        first += len(found[-1].curves)
    return found


def _fit(families: Sequence[curves.Family]) -> bool:
    """Return whether a panel can show the given curves. Curves of several series need different colours."""
    return len(families) == 1 or sum(len(one.curves) for one in families) <= colours.most()


def _by_value(found: Series, view: View) -> tuple[list[Part], list[str]]:
    parts: dict[Any, Part] = {}
    left_out = []
    for name, data in found.items():
        some, sentences = curves.thin(data, view.panels, LISTED)
        left_out += sentences
        for k in range(some.sizes[view.panels]):
            part = some.isel({view.panels: k})
            title = labels.named(view.panels, part[view.panels])
            parts.setdefault(part[view.panels].item(), (title, {}))[1][name] = part
    return [parts[key] for key in sorted(parts)], left_out


def _by_series(each: Mapping[str, T]) -> tuple[list[tuple[str, T]], list[str]]:
    names = list(each)
    rest = [f"series {', '.join(names[LISTED:])}"] if len(names) > LISTED else []
    return [(f"series {name}" if name else "", each[name]) for name in names[:LISTED]], rest


def _panel(title: str, families: Sequence[curves.Family], view: View, output: str, x: Axis) -> Panel:
    """Draw one panel: the curves of all its series, their laws, and marks for cases with failed or missing results."""
    panel = Panel(x, Axis(""), title=title, bar=families[0].bar)
    along, law_name = view.along[0], ""
    marked: dict[str, str] = {}
    varying: dict[str, None] = {}
    every = [curve for one in families for curve in one.curves]
    is_output = any(along in _own_dims(curve.data, output) for curve in every)
    several_styles = panel.bar or len({curve.line for curve in every}) > 1
    for curve in every:
        data = _counted(curve.data, output)
        place, value = _places(data, along), curves.mean(data, output)
        shades = data[view.by] if view.by in data.coords and data[view.by].ndim else None
        if shades is not None and shades.dtype.kind in "fiu":
            points = columns(data, x=place, y=value, value=labels.converted(view.by, shades))
            panel.traces.append(Trace("dots", points, label=curve.label))
            dots = [trace.column("value") for trace in panel.traces if trace.kind == "dots"]
            panel.bar = colours.bar(labels.label(view.by, shades), np.concatenate(dots))
        else:
            points = columns(data, x=place, y=value)
            marker = "" if is_output and curve.line else curve.marker
            look = {"colour": curve.colour, "line": curve.line, "marker": marker}
            panel.traces.append(Trace("curve", points, label=curve.label, bars=not curve.line, **look))
        panel.traces += _absent(curve, place, output, marked)
        if curve.line and not several_styles and (law := laws.law_of(data, output)):
            panel.traces.append(_law(curve, law, along, output))
            law_name = law.name
        dim = curves.along_dim(curve.data, along, output)
        together = curves.parameters_along(curve.data, dim) if dim else []
        varying |= dict.fromkeys(name for name in together if name not in (along, view.by))
    panel.keys = [key for one in families for key in one.keys]
    if law_name:
        panel.keys.append(Key(law_name, "#000000", "--"))
    panel.keys += [Key(name, "#404040", "", mark) for name, mark in marked.items()]
    if varying:
        panel.keys.append(Key(f"also varying: {', '.join(varying)}".replace("_", " "), "none"))
    return panel


def _law(curve: curves.Curve, law: laws.Law, along: str, output: str) -> Trace:
    fine = laws.along(curve.data, along)
    with np.errstate(invalid="ignore"):  # the rms slope of a failed case is NaN
        value = labels.quantity(output, curve.data[output]).of(law.value(fine))
    label = ", ".join(part for part in (law.name, curve.label) if part)
    data = columns(fine, x=_places(fine, along), y=value)
    return Trace("law", data, law.name, label, curve.colour, "--")


def _counted(data: xr.Dataset, output: str) -> xr.Dataset:
    """Return the data of a curve with a coordinate: the number of realisations over which each mean is taken.

    If the output has no realisations, the data are returned unchanged.
    """
    if "realisation" not in data[output].dims:
        return data
    count = xr.DataArray(aggregation.count(data[output]).variable, attrs={"units": "1"})
    return data.assign_coords(realisations=count)


def _absent(curve: curves.Curve, x: xr.DataArray, output: str, marked: dict[str, str]) -> list[Trace]:
    """Return marks at the lower edge of a panel, for the cases that `MARKS` and `SOME` describe.

    The reasons and marks are added to `marked`, for the legend.
    """
    data = curve.data
    if "status" not in data:
        return []
    found = []
    without = data[output].isnull().all("realisation")
    here_of = {look: without & (data["status"] == state.value).any("realisation") for state, look in MARKS.items()}
    failed = data["status"].isin([Status.FAILED.value, Status.NOT_CONVERGED.value])
    here_of[SOME] = failed.any("realisation") & ~without
    for (mark, reason), here in here_of.items():
        if bool(here.any()):
            place = np.flatnonzero(np.atleast_1d(here.values))
            part = data.isel({here.dims[0]: place}) if here.ndim else data
            at = columns(part, x=x.isel({x.dims[0]: place}) if x.ndim and here.ndim else x)
            found.append(Trace("absent", at, reason, curve.label, curve.colour, "", mark))
            marked[reason] = mark
    return found


# maps


def _map(found: Mapping[str, xr.Dataset], view: View, output: str) -> Figure:
    """Draw an output against two parameters. Cases of a grid are drawn as cells, cases of a sampled study as points."""
    if view.by or (view.panels and len(found) > 1):
        raise DataError(
            "expected a map without 'by', because colours show the values, and with 'panels' only one series"
        )
    parts, left_out = _by_series(found)
    if view.panels:
        by_value, left_out = _by_value(found, view)
        parts = [(title, data) for title, series in by_value for data in series.values()]
    drawn = []
    for title, data in parts:
        shown_along = {curves.along_dim(data, name, output) for name in view.along}
        data, sentences = curves.hold(data, [dim for dim in curves.axes_of(data, output) if dim not in shown_along])
        left_out += sentences
        drawn.append((title, data, curves.mean(data, output)))
    every = np.concatenate([np.ravel(value.value) for _, _, value in drawn])
    bar = colours.bar(labels.label(output, drawn[0][1][output]), every, None if view.log is None else "z" in view.log)
    panels = []
    for title, data, value in drawn:
        x, y = (_places(data, name) for name in view.along)
        points = columns(data, value=Mean(*(xr.broadcast(part, x, y)[0] for part in value)), x=x, y=y)
        trace = Trace("dots" if x.dims == y.dims else "map", points)
        across, up = (_axis(name, [data[name]], view, which) for name, which in zip(view.along, "xy", strict=True))
        panels.append(Panel(across, up, [trace], title, bar))
        if (at := ~np.isfinite(trace.column("value"))).any():
            missing = columns(x=trace.column("x")[at], y=trace.column("y")[at])
            panels[-1].traces.append(Trace("curve", missing, "no value", "no value", "#606060", "", "x"))
            panels[-1].keys = [Key("no value", "#606060", "", "x")]
    figure = Figure(panels, "", share_y=len(panels) > 1)
    figure.states = [data["status"] for _, data, _ in drawn if "status" in data]
    figure.fixed = curves.fixed_text(curves.fixed_by_all(data for _, data, _ in drawn), drawn[0][1])
    half = np.concatenate([np.ravel(value.high - value.low) / 2 for _, _, value in drawn])
    unit = labels.printed_unit(labels.quantity(output, drawn[0][1][output]).unit)
    if np.isfinite(half).any() and np.nanmax(half) > np.finfo(float).eps * np.nanmax(abs(every)):
        most = max(data.sizes.get("realisation", 1) for _, data, _ in drawn)
        figure.bars = f"{curves.intervals(most)}: at most ±{np.nanmax(half):.2g} {unit}".rstrip()
    figure.leave_out(left_out)
    return figure
