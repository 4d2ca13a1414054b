"""The one way in which data and laws come into a figure: whatever is drawn is also written down, for its table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.plots import page, style

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from mdr_dask.plots.table import Drawn

#: Width and height of a panel in inches.
PANEL = (6.4, 4.4)
#: Columns of panels, and how wide and high a panel has to be, in inches.
MOST_COLUMNS, LEAST_PANEL, LEAST_HEIGHT = 3, 2.2, 1.3
#: Height of what stands over and under the panels of a figure whose width is asked for, in inches.
TEXT_HEIGHT = 0.7
#: Points of a curve from which on they have no markers.
MANY_POINTS = 60
#: How high in a panel cases without a value are marked.
FOOT = 0.02
#: What stands in the column ``what`` of data; laws have their names there.
DATA = "data"


class Mean(NamedTuple):
    """A mean over realisations with the ends of its 95 % interval, NaN where nothing is known of its error."""

    value: xr.DataArray
    low: xr.DataArray
    high: xr.DataArray


class Curve(NamedTuple):
    """What one curve of a figure is drawn from, and how."""

    data: xr.Dataset
    label: str
    colour: Any
    line: str
    marker: str


def panels(
    count: int, columns: int | None = None, size: tuple[float, float] = PANEL, **shared: Any
) -> tuple[Drawn, list[Axes]]:
    """Return a figure and as many panels as asked for, in rows: of as many columns, or of as many as the page takes."""
    from mdr_dask.plots.table import Drawn

    asked = page.asked()
    free = MOST_COLUMNS if asked.width is None else min(MOST_COLUMNS, int(asked.width / LEAST_PANEL))
    columns = max(1, min(columns or (min(free, 2) if count == 4 else free), count))
    rows = -(-count // columns)
    width, height = size[0] * columns, size[1] * rows
    if asked.width is not None:
        height = max(LEAST_HEIGHT * rows, height * asked.width / width) + TEXT_HEIGHT
        width, height = asked.width, asked.height or height
    figure = Drawn(figsize=(width, height), layout="constrained")
    grid = list(figure.subplots(rows, columns, squeeze=False, **shared).ravel())
    for unused in grid[count:]:
        unused.remove()
    return figure, grid[:count]


def _record(
    artist: Artist, what: str, label: str | None, of: Mapping[str, xr.DataArray], columns: dict[str, Any]
) -> None:
    """Write down what an artist of matplotlib draws; a figure that was made elsewhere has no table."""
    from mdr_dask.plots.table import Drawn

    figure = artist.get_figure(root=True)
    if isinstance(figure, Drawn):
        figure.write_down(artist, what, label or "", of, columns)


def _coordinates(values: Any) -> dict[str, xr.DataArray]:
    """Return the parameters of every point of an array, each in its shape."""
    if not isinstance(values, xr.DataArray):
        return {}
    shape = dict(values.sizes)
    return {
        str(name): xr.DataArray(coord.variable.set_dims(shape).transpose(*shape), attrs=coord.attrs)
        for name, coord in values.coords.items()
    }


def _fixed(of: xr.Dataset | None) -> dict[str, xr.DataArray]:
    """Return the parameters that a case stands at."""
    return {} if of is None else {str(name): value for name, value in of.coords.items() if value.ndim == 0}


def _ends(name: str, y: Mean) -> dict[str, FloatArray]:
    return {name: flat(y.value), f"{name}_low": flat(y.low), f"{name}_high": flat(y.high)}


def curve(axes: Axes, one: Curve, x: Any, y: Mean, bars: bool = False) -> None:
    """Draw a curve with its band, or with bars; points that belong on no line have bars."""
    across, value, low, high = (flat(each) for each in (x, y.value, y.low, y.high))
    order = np.argsort(across, kind="stable")
    across, value, low, high = across[order], value[order], low[order], high[order]
    marker = one.marker if value.size < MANY_POINTS or not one.line else ""
    label = one.label if np.isfinite(value).any() else None  # a legend names what is seen
    look: dict[str, Any] = {"ms": 3, "lw": 1.2, "color": one.colour, "label": label or None}
    (line,) = axes.plot(across, value, linestyle=one.line or "none", marker=marker, gid=style.DATA, **look)
    _record(line, DATA, one.label, _coordinates(y.value), {"x": flat(x), **_ends("y", y)})
    if not np.isfinite(low).any():
        return
    if bars or not one.line:
        _bars(axes, across, value, _lengths(value, low, high), one.colour)
        return
    axes.fill_between(across, low, high, color=one.colour, alpha=0.25, linewidth=0, gid=style.BAND)


def points(axes: Axes, x: Any, y: Mean, colour: Any, marker: str, label: str | None, along: Mean | None = None) -> None:
    """Draw points with their bars, upwards and perhaps sideways."""
    sideways = {} if along is None else _ends("x", along)
    across, value = flat(x), flat(y.value)
    (line,) = axes.plot(across, value, marker, ms=4, color=colour, label=label, gid=style.DATA)
    _record(line, DATA, label, _coordinates(y.value), {"x": flat(x), **sideways, **_ends("y", y)})
    _bars(axes, across, value, _lengths(value, flat(y.low), flat(y.high)), colour)
    if along is not None:
        bars = axes.errorbar(
            across, value, xerr=_lengths(across, flat(along.low), flat(along.high)), fmt="none", ecolor=colour
        )
        _mark(bars)


def shaded(axes: Axes, x: Any, y: Mean, value: Any, **look: Any) -> Any:
    """Draw points with their bars, in colours that a colour bar names; returns what it is made of."""
    _bars(axes, flat(x), flat(y.value), _lengths(flat(y.value), flat(y.low), flat(y.high)), "0.7")
    known = np.isfinite(flat(y.value))
    at = flat(x)[known], flat(y.value)[known]
    drawn = axes.scatter(*at, c=flat(value)[known], s=14, zorder=3, gid=style.DATA, **look)
    _record(drawn, DATA, None, _coordinates(y.value), {"x": flat(x), **_ends("y", y), "value": flat(value)})
    return drawn


def absent(axes: Axes, x: xr.DataArray, why: str, **look: Any) -> None:
    """Mark at the foot of a panel where points have no value."""
    across = flat(x)
    known = np.isfinite(across)
    place = np.full(int(known.sum()), FOOT)
    (marks,) = axes.plot(
        across[known], place, ls="", ms=5, transform=axes.get_xaxis_transform(), zorder=4, gid=style.GUIDE, **look
    )
    _record(marks, why, None, {name: value[known] for name, value in _coordinates(x).items()}, {"x": across[known]})


def plain(
    axes: Axes, x: Any, y: Any, *form: str, label: str | None = None, of: xr.Dataset | None = None, **look: Any
) -> None:
    """Draw data without errors of their own as `Axes.plot` does; parameters are those of y, or of the case `of`."""
    (line,) = axes.plot(flat(x), flat(y), *form, label=label, gid=style.DATA, **look)
    _record(line, DATA, label, _fixed(of) | _coordinates(y), {"x": flat(x), "y": flat(y)})


def law(
    axes: Axes,
    x: Any,
    y: Any,
    *form: str,
    label: str | None = None,
    name: str = "",
    of: xr.Dataset | None = None,
    **look: Any,
) -> None:
    """Draw a law as `Axes.plot` does; the table calls it by `name`, or else by its label."""
    (line,) = axes.plot(flat(x), flat(y), *form, label=label, gid=style.LAW, **look)
    _record(line, name or label or "law", label, _fixed(of), {"x": flat(x), "y": flat(y)})


def band(axes: Axes, x: Any, low: Any, high: Any, name: str, **look: Any) -> None:
    """Draw the band that a law is known within."""
    drawn = axes.fill_between(flat(x), flat(low), flat(high), alpha=0.25, linewidth=0, gid=style.LAW, **look)
    _record(drawn, name, None, {}, {"x": flat(x), "y_low": flat(low), "y_high": flat(high)})


def dots(axes: Axes, x: Any, y: Any, value: Any, ends: Mean | None = None, **look: Any) -> Any:
    """Draw points whose colour is a value; returns what a colour bar is made of."""
    columns = {"x": flat(x), "y": flat(y), **({"value": flat(value)} if ends is None else _ends("value", ends))}
    known = np.isfinite(flat(value))
    drawn = axes.scatter(flat(x)[known], flat(y)[known], c=flat(value)[known], gid=style.DATA, **look)
    _record(drawn, DATA, None, _coordinates(value), columns)
    return drawn


def field(axes: Axes, x: xr.DataArray, y: xr.DataArray, values: Mean, **look: Any) -> Any:
    """Draw a map of values over two axes; returns what a colour bar is made of.

    The cells end in the middle between two values of an axis: of their logarithms where the axis is geometric.
    """
    value, low, high = (each.transpose(y.dims[0], x.dims[0]) for each in values)
    across, up = (each.broadcast_like(value).transpose(*value.dims) for each in (x, y))
    columns = {"x": flat(across), "y": flat(up), **_ends("value", Mean(value, low, high))}
    drawn = axes.pcolormesh(edges(flat(x)), edges(flat(y)), value.values, gid=style.DATA, rasterized=True, **look)
    _record(drawn, DATA, None, _coordinates(value), columns)
    return drawn


def edges(centres: FloatArray) -> FloatArray:
    """Return the ends of the cells around the values of an axis."""
    if centres.size == 1:
        half = 0.5 * (abs(float(centres[0])) or 1.0)
        return np.array([centres[0] - half, centres[0] + half])
    if style.is_geometric(centres):
        geometric: FloatArray = np.exp(_edges_between(np.log(centres)))
        return geometric
    ends = _edges_between(centres)
    return ends if centres.min() < 0 else np.clip(ends, 0.0, None)


def _edges_between(centres: FloatArray) -> FloatArray:
    between = 0.5 * (centres[1:] + centres[:-1])
    ends: FloatArray = np.concatenate([[2 * centres[0] - between[0]], between, [2 * centres[-1] - between[-1]]])
    return ends


def _lengths(value: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the lengths of bars down and up, 0 where they are not known."""
    lengths: FloatArray = np.nan_to_num(np.clip([value - low, high - value], 0, None), nan=0.0, posinf=0.0)
    return lengths


def _bars(axes: Axes, x: FloatArray, y: FloatArray, lengths: FloatArray, colour: Any) -> None:
    _mark(axes.errorbar(x, y, lengths, fmt="none", ecolor=colour, elinewidth=0.8, capsize=2))


def _mark(bars: Any) -> None:
    """Mark all parts of error bars as such."""
    for part in (*bars.lines[1], *bars.lines[2]):
        part.set_gid(style.BAND)


def flat(values: Any) -> FloatArray:
    """Return numbers in one row."""
    return np.atleast_1d(np.asarray(getattr(values, "values", values), dtype=np.float64)).ravel()
