"""An output against one parameter: curves of a grid, points of a sampled study, and the law where there is one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from mdr_dask.errors import DataError
from mdr_dask.models.base import Status
from mdr_dask.plots import curves, drawing, laws, style
from mdr_dask.plots.outputs.view import Panel, View, by_series, by_value, places, scale, subject, title, value

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mdr_dask.plots.table import Drawn

#: Width and height of one of several panels, in inches.
SMALL = (4.4, 3.4)
#: How a case without a value is marked, the worst of what became of its realisations first.
MARKS = {
    Status.FAILED: ("x", "failed"),
    Status.NOT_CONVERGED: ("+", "did not converge"),
    Status.MISSING: ("1", "missing"),
}


def draw_lines(found: Mapping[str, xr.Dataset], view: View) -> tuple[Drawn, list[str]]:
    """Draw an output against one parameter; return the figure, and what is left out."""
    panels, told = _panels(found, view)
    figure, axes_of = drawing.panels(len(panels), size=drawing.PANEL if len(panels) == 1 else SMALL, sharey=True)
    every: list[curves.Family] = []
    for axes, panel in zip(axes_of, panels, strict=True):
        families = {name: _family(data, view) for name, data in panel.series.items()}
        _draw_panel(figure, axes, families, view)
        axes.set_title(panel.title, fontsize="small", wrap=True)
        every += families.values()
    told += [sentence for one in every for sentence in one.left_out]
    _bars(figure, axes_of, every)
    every_place = [found[name][view.over[0]] for name in found]
    along = every_place[0].attrs, np.concatenate([np.atleast_1d(values.values) for values in every_place])
    for axes in axes_of:
        scale(axes, "x", view.over[0], xr.DataArray(along[1], dims="place", attrs=along[0]), view)
    _scale_values(figure, axes_of, found, view)
    bars = curves.meaning_of_bars(*found.values(), outputs=[view.output])
    words = f"against {view.over[0].replace('_', ' ')}"
    title(figure, subject(found, view, words), found, [one.held for one in every], bars)
    return figure, told


def _bars(figure: Figure, axes_of: list[Axes], families: list[curves.Family]) -> None:
    """Draw the colour bars of panels: one for all, where it is the same."""
    bars = [one.bar for one in families if one.bar]
    if len(axes_of) > 1 and bars and len(bars) == len(families) and all(_alike(bar, bars[0]) for bar in bars):
        curves.colour_bar(figure, axes_of, *bars[0])
        return
    for axes, one in zip(axes_of, families, strict=False):
        if one.bar:
            curves.colour_bar(figure, [axes], *one.bar)


def _alike(one: tuple[str, xr.DataArray], other: tuple[str, xr.DataArray]) -> bool:
    return one[0] == other[0] and np.array_equal(one[1].values, other[1].values)


def _scale_values(figure: Drawn, axes_of: list[Axes], found: Mapping[str, xr.Dataset], view: View) -> None:
    """Label the values and give them their scale, the same in all panels; draw each legend once."""
    first = next(iter(found.values()))
    axes_of[0].set_ylabel(style.beside(figure, axes_of[0], style.label(view.output, first[view.output])))
    table = figure.table()
    drawn = table["y"][table["what"] == drawing.DATA]
    said: list[list[str]] = []
    for axes in axes_of:
        if view.is_log("y", drawn):
            style.logarithmic(axes, "y")
        labels = axes.get_legend_handles_labels()[1]
        if labels not in said:
            style.legend(axes)
        said.append(labels)


def _panels(found: Mapping[str, xr.Dataset], view: View) -> tuple[list[Panel], list[str]]:
    """Return what each panel shows: a value of a parameter, a series where all together are too many, or all."""
    if view.panels:
        return by_value(found, view)
    count = sum(len(_family(data, view).curves) for data in found.values())
    if len(found) > 1 and count > style.most_colours():
        return by_series(found)
    return [Panel("", dict(found))], []


def _family(data: xr.Dataset, view: View) -> curves.Family:
    """Return the curves of one series; the points of a sampled study are one."""
    by = curves.along_dim(data, view.by, view.output) if view.by else None
    return curves.family(data, view.output, view.over[0], (by,) if by else ())


def _draw_panel(figure: Figure, axes: Axes, families: Mapping[str, curves.Family], view: View) -> None:
    """Draw the curves of all series of a panel, with their laws, and mark the cases without a value."""
    known: dict[str, None] = {}
    marked: set[str] = set()
    for curve, one in _coloured(families):
        x = places(curve.data, view.over[0])
        y = value(curve.data, view.output)
        shades = curve.data[view.by] if view.by in curve.data.coords else None
        if shades is not None and shades.ndim:
            how, norm = style.shades(style.shown(view.by, shades))
            dots = drawing.shaded(axes, x, y, style.shown(view.by, shades), cmap=how, norm=norm)
            figure.colorbar(dots, ax=axes, label=style.label(view.by, shades))
            one = one._replace(varying=tuple(name for name in one.varying if name != view.by))
        else:
            drawing.curve(axes, curve, x, y, bars=curve.line != "" and y.value.size < drawing.MANY_POINTS)
        marks = _mark(axes, curve, x, view)
        if marks and not np.isfinite(y.value).any():
            axes.plot([], [], color=curve.colour, label=curve.label or None)
        marked |= marks
        if one.joined and (law := laws.law_of(curve.data, view.output)):
            _draw_law(axes, curve, law, view)
            known[law.name] = None
        if curve is one.curves[-1]:
            curves.name_varying(axes, one)
    for name in known:
        axes.plot([], [], "--", lw=0.8, color="k", label=name)
    for mark, words in MARKS.values():
        if words in marked:
            axes.plot([], [], mark, ls="", color="0.3", ms=5, label=words)


def _coloured(families: Mapping[str, curves.Family]) -> Iterator[tuple[drawing.Curve, curves.Family]]:
    """Yield the curves of a panel with their family; those of several series have the name of theirs in the legend."""
    every = [(name, curve, one) for name, one in families.items() for curve in one.curves]
    if len(families) > 1 and len(every) > style.most_colours():
        raise DataError(
            f"expected at most {style.most_colours()} curves of several series in a panel, got {len(every)}: "
            "--select fewer, or leave --panels out"
        )
    markers = dict(zip(families, style.MARKERS * len(families), strict=False))
    for k, (name, curve, one) in enumerate(every):
        if len(families) > 1:
            label = ", ".join(part for part in (name, curve.label) if part)
            line = style.line_and_marker(k)[0] if curve.line else ""
            curve = drawing.Curve(curve.data, label, style.colour(k), line, markers[name])
        yield curve, one


def _draw_law(axes: Axes, curve: drawing.Curve, law: laws.Law, view: View) -> None:
    """Draw the law of an output for one curve."""
    fine = laws.along(curve.data, view.over[0])
    how = style.quantity(view.output, curve.data[view.output])
    course = how.of(law.value(fine))
    x = places(fine, view.over[0])
    drawing.law(axes, x, course, "--", name=law.name, of=curve.data, lw=0.8, color=curve.colour)


def _mark(axes: Axes, curve: drawing.Curve, x: xr.DataArray, view: View) -> set[str]:
    """Mark at the foot of a panel where no realisation has a value, and return why."""
    if "status" not in curve.data:
        return set()
    marked = set()
    rest = curve.data[view.output].isnull().all("realisation")
    for state, (mark, words) in MARKS.items():
        here = rest & (curve.data["status"] == state.value).any("realisation")
        rest = rest & ~here
        if bool(here.any()):
            drawing.absent(axes, x.where(here), words, marker=mark, color=curve.colour)
            marked.add(words)
    return marked
