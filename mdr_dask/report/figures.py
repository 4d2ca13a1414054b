"""A figure that was drawn, as data for the page: what its table holds, and how matplotlib drew it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.plots import drawing, style, table
from mdr_dask.plots.table import FIRST, LAST, Bar, Drawn, Rows
from mdr_dask.report.words import markup, plain

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

#: Points of one figure of the page; more are thinned out.
MOST_POINTS = 20_000
#: Digits of a number on the page; files of the figure's data have them, too.
DIGITS = 9
#: Colours that a scale is made of.
SHADES = 17

Json = dict[str, Any]


def figure_data(name: str, summary: str, figure: Drawn, provenance: Mapping[str, str]) -> Json:
    """Return a figure as the page draws it.

    Parameters
    ----------
    name, summary : str
        What it is called, and one line about it.
    figure : Drawn
        A figure of this package.
    provenance : mapping of str to str
        What the file with its data says of its origin.

    Returns
    -------
    dict
        ``panels`` with labels and scales, ``traces`` with a column for everything drawn, ``scales`` of colours,
        ``parameters`` with labels and units, and the texts around them; labels are HTML, all else is plain text.
    """
    panels = figure.panels()
    total = sum(_length(rows) for rows in figure.rows)
    step = -(-total // MOST_POINTS)
    traces = [_trace(rows, panels.index(rows.axes), figure.bars, step) for rows in figure.rows]
    drawn = sum(len(trace["x"]) for trace in traces)
    reduced = f"{drawn} of {total} points are on this page, one of {step} spread evenly" if step > 1 else ""
    subject, *fixed = figure.get_suptitle().replace(",\n", ", ").split("\n")
    held = figure.table()
    return {
        "name": name,
        "summary": summary,
        "title": markup(subject),
        "spoken": plain(subject),
        "fixed": [markup(line) for line in fixed],
        "left_out": markup("; ".join(part for part in (style.left_out(figure), reduced) if part)),
        "head": table.head(figure, held, provenance),
        "panels": [_panel(axes) for axes in panels],
        "traces": traces,
        "scales": [_scale(bar, panels) for bar in figure.bars],
        "parameters": _parameters(figure.rows),
    }


def _length(rows: Rows) -> int:
    return max((np.size(column) for column in rows.columns.values()), default=0)


def _parameters(rows: list[Rows]) -> Json:
    units = {name: unit for each in rows for name, unit in each.units.items()}
    return {
        name: {"label": name.replace("_", " "), "unit": "" if unit == "1" else unit} for name, unit in units.items()
    }


def _panel(axes: Axes) -> Json:
    return {
        "title": markup(axes.get_title().replace("\n", " ")),
        "x": _axis(axes.xaxis, axes.get_xlim()),
        "y": _axis(axes.yaxis, axes.get_ylim()),
    }


def _axis(axis: Axis, limits: tuple[float, float]) -> Json:
    from matplotlib.ticker import FixedLocator

    label = axis.get_label_text().replace("\n", " ")
    found: Json = {"label": markup(label), "spoken": plain(label), "log": axis.get_scale() == "log"}
    if limits[0] > limits[1]:
        found["reversed"] = True
    if isinstance(axis.get_major_locator(), FixedLocator) and axis.get_scale() == "linear":
        places = axis.get_majorticklocs().tolist()
        texts = axis.get_major_formatter().format_ticks(places)
        found["ticks"] = [[place, markup(text)] for place, text in zip(places, texts, strict=True)]
    return found


def _trace(rows: Rows, panel: int, bars: list[Bar], step: int) -> Json:
    """Return what one curve, law or map draws, every `step`-th point of it, and its last."""
    length = _length(rows)
    kept = np.unique([*range(0, length, step), max(length - 1, 0)])[: length or None] if step > 1 else slice(None)
    order = _order(rows, length)
    columns = {name: _column(values, order[kept]) for name, values in rows.columns.items() if name not in FIRST}
    trace: Json = {
        "panel": panel,
        "what": str(rows.columns["what"]),
        "curve": markup(rows.label),
        "spoken": str(rows.columns["curve"]),
        **_look(rows, bars),
        **{name: columns[name] for name in LAST if name in columns},
        "of": {name: _once(columns[name]) for name in columns if name not in LAST},
    }
    gaps = _gaps(rows.artist)
    if gaps:
        trace["gaps"] = gaps
    return trace if "x" in trace else {**trace, "x": []}


def _order(rows: Rows, length: int) -> NDArray[np.intp]:
    """Return the order in which points are joined: a curve is drawn from left to right, its table is as it comes."""
    from matplotlib.lines import Line2D

    if isinstance(rows.artist, Line2D):
        across = np.asarray(rows.artist.get_xdata(), dtype=np.float64)
        if np.all(np.diff(across[np.isfinite(across)]) >= 0):
            return np.argsort(np.asarray(rows.columns["x"], dtype=np.float64), kind="stable")
    return np.arange(length)


def _gaps(artist: Artist) -> list[Any]:
    """Return the places where a line is parted, because there is no value."""
    from matplotlib.lines import Line2D

    if not isinstance(artist, Line2D):
        return []
    across, up = (np.asarray(values, dtype=np.float64) for values in artist.get_data())
    return numbers(across[np.isfinite(across) & ~np.isfinite(up)])


def _column(values: Any, kept: Any) -> list[Any]:
    return numbers(np.atleast_1d(values)[kept])


def _once(column: list[Any]) -> Any:
    """Return a column whose values are all alike as that value."""
    return column[0] if column and all(value == column[0] for value in column) else column


def numbers(values: NDArray[Any]) -> list[Any]:
    """Return numbers as JSON holds them, to `DIGITS` digits; None for what is not finite; texts as they are."""
    if values.dtype.kind not in "fiu":
        return [str(value) for value in values]
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values.ravel().tolist()]


def _look(rows: Rows, bars: list[Bar]) -> Json:
    """Return how matplotlib draws it: its kind, colour, line and marker, or the scale of its colours."""
    from matplotlib.collections import FillBetweenPolyCollection, PathCollection, QuadMesh
    from matplotlib.colors import to_hex
    from matplotlib.lines import Line2D

    artist: Artist = rows.artist
    if isinstance(artist, Line2D):
        if "y" not in rows.columns:
            return {"kind": "absent", "marker": str(artist.get_marker()), "colour": to_hex(artist.get_color())}
        line, marker = str(artist.get_linestyle()), str(artist.get_marker())
        kind = "law" if artist.get_gid() == style.LAW else "curve"
        marker = "" if marker in ("None", " ", "") else marker
        return {
            "kind": kind,
            "colour": to_hex(artist.get_color()),
            "line": "" if line == "None" else line,
            "marker": marker,
        }
    if isinstance(artist, FillBetweenPolyCollection):
        return {"kind": "band", "colour": to_hex(np.asarray(artist.get_facecolor())[0])}
    assert isinstance(artist, PathCollection | QuadMesh)
    scale = next((k for k, bar in enumerate(bars) if bar.drawn.mappable is artist), None)
    own: Json = {"scale": scale} if scale is not None else {"shades": _shades(artist)}
    if isinstance(artist, PathCollection):
        return {"kind": "dots", **own}
    across, up = (np.unique(rows.columns[name]) for name in ("x", "y"))
    return {"kind": "map", **own, "x_edges": _edges(across), "y_edges": _edges(up)}


def _edges(centres: FloatArray) -> list[Any]:
    return numbers(drawing.edges(centres))


def _shades(mappable: Any) -> Json:
    """Return the scale of what has colours by value: its ends, and the colours between them."""
    from matplotlib.colors import LogNorm, to_hex

    low, high = mappable.get_clim()
    colours = [to_hex(colour) for colour in mappable.get_cmap()(np.linspace(0, 1, SHADES))]
    return {"low": float(low), "high": float(high), "log": isinstance(mappable.norm, LogNorm), "colours": colours}


def _scale(bar: Bar, panels: list[Axes]) -> Json:
    axes = bar.drawn.ax
    label = (axes.get_ylabel() or axes.get_xlabel()).replace("\n", " ")
    beside = [panels.index(panel) for panel in bar.panels if panel in panels]
    return {**_shades(bar.drawn.mappable), "label": markup(label), "spoken": plain(label), "panels": beside}


def drawn_of(
    figures: Mapping[str, Any], groups: Mapping[str, Any], provenance: Any
) -> Iterator[Json | tuple[str, str]]:
    """Yield every figure that a study has the data for; of the others name and reason."""
    from mdr_dask.errors import DataError, FitError

    for name, each in figures.items():
        try:
            figure = each.figure(groups)
        except (DataError, FitError) as error:
            yield name, str(error)
            continue
        if isinstance(figure, Drawn):
            yield figure_data(name, each.summary, figure, provenance(name))
        else:
            yield name, "it was drawn without mdr_dask.plots.drawing, and has no table"
