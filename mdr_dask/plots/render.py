"""Draw a figure with matplotlib: panels, legend, colour bars and title, without overlapping texts at any width."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as MplFigure

from mdr_dask.errors import DataError
from mdr_dask.plots import colours, page
from mdr_dask.plots.figure import Axis, Bar, Figure, Key, Panel, Trace, edges

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Drawn(MplFigure):
    """A matplotlib figure that also holds its description as data. A notebook shows the figure as a picture."""

    def __init__(self, description: Figure, **options: Any) -> None:
        super().__init__(**options)
        FigureCanvasAgg(self)
        self.description = description
        self.origin: Mapping[str, str] = {}

    def _repr_png_(self) -> bytes:
        stream = io.BytesIO()
        self.savefig(stream, format="png")
        return stream.getvalue()

    def table(self) -> pd.DataFrame:
        """Return a table of all points that are drawn; see `mdr_dask.plots.figure.Figure.table`."""
        return self.description.table()

    def csv(self, float_format: str | None = None) -> str:
        """Return the table as CSV, below comment lines that describe the figure."""
        head = "".join(f"# {line}\n" for line in self.description.head(self.origin))
        return head + self.table().to_csv(index=False, lineterminator="\n", float_format=float_format)

    def save(self, path: str | Path) -> None:
        """Write the figure to a file, and the table of the figure to the same folder: ``mu.pdf`` and ``mu.csv``."""
        beside = table_beside(path)
        self.savefig(path, dpi=150 if page.current().width is None else 300)
        beside.write_text(self.csv(), encoding="utf-8", newline="")


def table_beside(path: str | Path) -> Path:
    """Return the path for the table of a figure; raise DataError if a file of another kind already has this path."""
    beside = Path(path).with_suffix(".csv")
    if beside.exists() and not beside.read_bytes().startswith(b"# mdr_dask"):
        raise DataError(f"{beside} exists and is not the table of a figure; choose another name for the figure")
    return beside


def render(description: Figure) -> Drawn:
    """Draw a figure with matplotlib and return the drawn figure."""
    panels, asked = description.panels, page.current()
    rows, columns = _grid(description)
    width = asked.width or mpl.rcParams["figure.figsize"][0] * (1 + columns) / 2
    height = rows * max(_least_height(), description.ratio * width / columns)
    figure = Drawn(description, figsize=(width, asked.height or height))
    figure.set_layout_engine("constrained")
    places = _axes(figure, description, rows, columns)
    for axes, panel in zip(places, panels, strict=True):
        _draw_panel(axes, panel)
    _share_labels(places, panels)
    _bars(figure, places, panels)
    traces = [trace for panel in panels for trace in panel.traces]
    markers = {trace.marker for trace in traces}
    keys = list(dict.fromkeys(key for panel in panels for key in panel.entries()))
    keys = [key if key.marker in markers else replace(key, marker="") for key in keys]
    beside = _title(figure, description) + (_legend(figure, keys) if keys else 0.0)
    if asked.height is None:
        figure.set_size_inches(width, min(height + beside, page.TALLEST) if asked.width else height + beside)
    _fit(figure)
    return figure


def _grid(description: Figure) -> tuple[int, int]:
    """Return the number of rows and the number of columns of panels.

    On a screen, there are up to three columns. If a width is requested, there are up to as many columns as columns of
    a journal fit into the width (rounded). If the rows would then not fit on a page, up to twice as many are used.
    """
    width, stack = page.current().width, description.stack
    stacks = -(-len(description.panels) // stack)
    most = 3 if width is None else max(1, round(width / page.COLUMN))
    columns = -(-stacks // -(-stacks // most))
    if width is not None:
        while columns < min(stacks, 2 * most) and -(-stacks // columns) * stack * _least_height() > page.TALLEST:
            columns += 1
    return -(-stacks // columns) * stack, columns


def _least_height() -> float:
    """Return the least height of a row of panels in inches: ten lines of text."""
    return 10 * 1.2 * float(mpl.rcParams["font.size"]) / 72


def _axes(figure: Drawn, description: Figure, rows: int, columns: int) -> list[Axes]:
    """Return the axes of all panels. Stacks of panels fill a row from left to right, then the next row."""
    grid, stack = figure.subplots(rows, columns, squeeze=False, sharey=description.share_y), description.stack
    found = []
    for k in range(len(description.panels)):
        place = k // stack
        found.append(grid[(place // columns) * stack + k % stack, place % columns])
    for unused in grid.ravel():
        if unused not in found:
            unused.remove()
    return found


def _share_labels(places: list[Axes], panels: list[Panel]) -> None:
    """Remove repeated labels of axes.

    The x label of a panel is removed if the panel below has the same x axis. The y label is removed if the panel on the
    left has the same y axis.
    """
    at = {}
    for axes, panel in zip(places, panels, strict=True):
        place = axes.get_subplotspec()
        assert place is not None
        at[place.rowspan.start, place.colspan.start] = axes, panel
    for (row, column), (axes, panel) in at.items():
        below, left = at.get((row + 1, column)), at.get((row, column - 1))
        if below and below[1].x == panel.x:
            axes.set_xlabel("")
        if left and left[1].y == panel.y:
            axes.set_ylabel("")


def _draw_panel(axes: Axes, panel: Panel) -> None:
    for name, axis in (("x", panel.x), ("y", panel.y)):
        getattr(axes, f"set_{name}label")(axis.label)
        if axis.log:
            getattr(axes, f"set_{name}scale")("log")
    for trace in panel.traces:
        _DRAW[trace.kind](axes, trace, panel)
    for name, axis in (("x", panel.x), ("y", panel.y)):
        _finish_axis(axes, name, axis)
    if panel.title:
        axes.set_title(panel.title)


def _finish_axis(axes: Axes, name: str, axis: Axis) -> None:
    if axis.low is not None or axis.high is not None:
        getattr(axes, f"set_{name}lim")(axis.low, axis.high)
    if axis.reverse:
        getattr(axes, f"invert_{name}axis")()
    if axis.ticks:
        getattr(axes, f"set_{name}ticks")([place for place, _ in axis.ticks], [text for _, text in axis.ticks])
    elif axis.log:
        _log_ticks(getattr(axes, f"{name}axis"))


def _log_ticks(axis: Any) -> None:
    """Set the ticks of a logarithmic axis.

    If the axis spans less than two decades, the numbers at the ticks are plain, such as 1, 2, 5, 10, 20 and 50.
    """
    from matplotlib.ticker import AutoLocator, LogLocator, NullFormatter

    low, high = sorted(np.abs(axis.get_view_interval()))
    axis.set_minor_formatter(NullFormatter())
    if 0 < high < 100 * low:
        locator = LogLocator(subs=(1, 2, 5))
        inside = [tick for tick in locator.tick_values(low, high) if low <= tick <= high]
        axis.set_major_locator(locator if len(inside) > 1 else AutoLocator())
        axis.set_major_formatter(lambda value, _: f"{value:.4g}")


def _curve(axes: Axes, trace: Trace, _: Panel) -> None:
    x, y = trace.column("x"), trace.column("y")
    order = np.argsort(x, kind="stable") if trace.line and trace.kind == "curve" else np.arange(x.size)
    look: dict[str, Any] = {"color": trace.colour, "linestyle": trace.line or "none", "marker": trace.marker}
    if trace.kind == "law":
        look["linewidth"] = 0.8 * mpl.rcParams["lines.linewidth"]
    axes.plot(x[order], y[order], gid=trace.kind, zorder=2 if trace.kind == "law" else 2.5, **look)
    ends = [trace.column(f"y_{end}") for end in ("low", "high") if f"y_{end}" in trace.data]
    along = [trace.column(f"x_{end}") for end in ("low", "high") if f"x_{end}" in trace.data]
    if len(ends) == 2 and trace.line and not trace.bars:
        axes.fill_between(x[order], ends[0][order], ends[1][order], color=trace.colour, alpha=0.25, linewidth=0)
        ends = []
    if len(ends) == 2 or len(along) == 2:
        lengths = {"yerr": _lengths(y, *ends)} if len(ends) == 2 else {}
        lengths |= {"xerr": _lengths(x, *along)} if len(along) == 2 else {}
        axes.errorbar(x, y, fmt="none", ecolor=trace.colour, elinewidth=0.8, capsize=2, **lengths)


def _lengths(value: Any, low: Any, high: Any) -> Any:
    """Return the lengths of error bars below and above the value. The length is 0 if the error is unknown."""
    return np.nan_to_num(np.clip([value - low, high - value], 0, None), nan=0.0, posinf=0.0)


def _band(axes: Axes, trace: Trace, _: Panel) -> None:
    x, low, high = (trace.column(name) for name in ("x", "y_low", "y_high"))
    axes.fill_between(x, low, high, color=trace.colour, alpha=0.25, linewidth=0, gid=trace.kind)


def _dots(axes: Axes, trace: Trace, panel: Panel) -> None:
    x, y, value = (trace.column(name) for name in ("x", "y", "value"))
    if "y_low" in trace.data:
        lengths = _lengths(y, trace.column("y_low"), trace.column("y_high"))
        axes.errorbar(x, y, lengths, fmt="none", ecolor="0.7", elinewidth=0.8, capsize=2)
    assert panel.bar is not None
    how, norm = colours.scale(panel.bar)
    known = np.isfinite(value) & np.isfinite(y)
    axes.scatter(x[known], y[known], c=value[known], s=16, cmap=how, norm=norm, zorder=3, gid=trace.kind)


def _map(axes: Axes, trace: Trace, panel: Panel) -> None:
    x, y, value = (trace.column(name) for name in ("x", "y", "value"))
    columns, rows = np.unique(x), np.unique(y)
    cells = np.full((rows.size, columns.size), np.nan)
    cells[np.searchsorted(rows, y), np.searchsorted(columns, x)] = value
    assert panel.bar is not None
    how, norm = colours.scale(panel.bar)
    ends = edges(columns, panel.x.log), edges(rows, panel.y.log)
    axes.pcolormesh(*ends, cells, cmap=how, norm=norm, rasterized=True, gid=trace.kind)


def _absent(axes: Axes, trace: Trace, _: Panel) -> None:
    x = trace.column("x")
    place = np.full(x.size, 0.02)
    look: dict[str, Any] = {"color": trace.colour, "marker": trace.marker, "linestyle": "none"}
    axes.plot(x, place, transform=axes.get_xaxis_transform(), zorder=4, gid=trace.kind, **look)


_DRAW = {"curve": _curve, "law": _curve, "band": _band, "dots": _dots, "map": _map, "absent": _absent}


def _bars(figure: Drawn, places: list[Axes], panels: list[Panel]) -> None:
    """Draw the colour bars. A colour bar that several panels have in common is drawn once."""
    from matplotlib.cm import ScalarMappable

    beside: dict[Bar, list[Axes]] = {}
    for axes, panel in zip(places, panels, strict=True):
        if panel.bar:
            beside.setdefault(panel.bar, []).append(axes)
    for bar, where in beside.items():
        how, norm = colours.scale(bar)
        drawn = figure.colorbar(ScalarMappable(norm, how), ax=where)
        drawn.set_label(bar.label)
        if bar.log:
            _log_ticks(drawn.ax.yaxis)


def _title(figure: Drawn, description: Figure) -> float:
    """Write the title and return its height in inches; without a title, return 0.

    A title from the user replaces the description of the figure. If a size is requested, there is no description.
    """
    asked = page.current()
    if asked.title is not None or asked.width is not None:
        lines = [asked.title] if asked.title else []
    else:
        left_out = f"not drawn: {'; '.join(description.left_out)}" if description.left_out else ""
        lines = [part for part in (description.subject, description.fixed, description.bars, left_out) if part]
        lines += [f"warning: {warning}" for warning in description.warnings]
    if not lines:
        return 0.0
    size = mpl.rcParams["axes.titlesize" if len(lines) == 1 else "legend.fontsize"]
    text = "\n".join(_broken(figure, line, 0.97 * figure.get_figwidth(), size) for line in lines)
    return _height(figure, figure.suptitle(text, fontsize=size))


def _height(figure: Drawn, artist: Any) -> float:
    """Return the height of a text or a legend in inches."""
    return float(artist.get_window_extent(figure.canvas.get_renderer()).height / figure.dpi)  # type: ignore[attr-defined]


def _width_of(figure: Drawn, text: str, size: Any) -> float:
    """Return the width in inches of a printed line of text."""
    from matplotlib.font_manager import FontProperties

    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    font = FontProperties(size=size)
    width: float = renderer.get_text_width_height_descent(text, font, ismath="$" in text)[0]
    return width / figure.dpi


def _broken(figure: Drawn, text: str, width: float, size: Any) -> str:
    """Break a text into lines of at most `width` inches, but not at an equals sign and not within mathtext.

    Parts that cannot be broken may give longer lines.
    """
    joined = text.replace(" = ", "\u00a0=\u00a0")
    lines: list[str] = []
    for word in joined.split(" "):
        longer = f"{lines[-1]} {word}" if lines else word
        whole = longer.count("$") % 2 == 0 and _width_of(figure, longer, size) > width and bool(lines)
        if whole and lines[-1].count("$") % 2 == 0:
            lines.append(word)
        else:
            lines[-1:] = [longer]
    return "\n".join(lines).replace("\u00a0", " ")


def _handle(key: Key) -> Any:
    from matplotlib.lines import Line2D

    line: Any = key.line or "none"
    return Line2D([], [], color=key.colour, linestyle=line, marker=key.marker or "none", label=key.label)


def _legend(figure: Drawn, keys: list[Key]) -> float:
    """Draw one legend below all panels and return the height of the legend in inches.

    If all labels have the same text before the equals sign, this text becomes the title of the legend. If a size is
    requested, the last entries are left out if the legend would take more than a third of the requested height, or of
    the height of a page if only a width is requested.
    """
    width, asked = figure.get_figwidth(), page.current()
    most = (asked.height or (page.TALLEST if asked.width else np.inf)) / 3
    size = mpl.rcParams["legend.fontsize"]
    names = {key.label.rpartition(" = ")[0] for key in keys}
    title = names.pop() if len(keys) > 1 and len(names) == 1 else ""
    keys = [replace(key, label=key.label.removeprefix(f"{title} = ")) for key in keys] if title else keys
    kept = [replace(key, label=_broken(figure, key.label, 0.8 * width, size)) for key in keys]
    while True:
        rest = len(keys) - len(kept)
        handles = [_handle(key) for key in kept]
        handles += [_handle(Key(f"and {rest} more, see the table", "none"))] if rest else []
        for columns in range(len(handles), 0, -1):
            legend = figure.legend(
                handles=handles,
                title=_broken(figure, title, 0.8 * width, size),
                loc="outside lower center",
                ncols=columns,
                frameon=False,
            )
            legend.get_title().set_fontsize(size)
            extent = legend.get_window_extent(figure.canvas.get_renderer())  # type: ignore[attr-defined]
            if extent.width <= width * figure.dpi or columns == 1:
                break
            legend.remove()
        if _height(figure, legend) <= most or len(kept) <= 1:
            return _height(figure, legend)
        legend.remove()
        kept = kept[: len(kept) // 2]


def _fit(figure: Drawn) -> None:
    """Break long labels, and remove overlapping ticks. Repeat both steps, because they change the size of axes."""
    for _ in range(4):
        figure.draw_without_rendering()
        changed = False
        for axes in figure.axes:
            box = axes.get_window_extent()
            for text, length in (
                (axes.xaxis.label, box.width),
                (axes.yaxis.label, box.height),
                (axes.title, box.width),
            ):
                broken = _broken(figure, text.get_text().replace("\n", " "), length / figure.dpi, text.get_fontsize())
                changed |= broken != text.get_text()
                text.set_text(broken)
            changed |= _thin(figure, axes.xaxis, "x") | _thin(figure, axes.yaxis, "y")
        if not changed:
            return


def _thin(figure: Drawn, axis: Any, name: str) -> bool:
    """Keep only every second (or third, ...) tick of an axis if texts overlap. Return whether ticks were removed."""
    from matplotlib.ticker import FixedLocator, FuncFormatter

    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    low, high = sorted(axis.get_view_interval())
    inside = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
    texts = {
        t.get_loc(): text for t in inside for text in (t.label1, t.label2) if text.get_visible() and text.get_text()
    }
    boxes = [text.get_window_extent(renderer) for text in texts.values()]
    ends = [(box.x0, box.x1) if name == "x" else (box.y0, box.y1) for box in boxes]
    gap = 3 / 72 * figure.dpi if name == "x" else 0.0  # a point is 1/72 inch
    step = 1
    while len(ends[::step]) > 2 and any(
        one[1] + gap > two[0] for one, two in zip(sorted(ends[::step])[:-1], sorted(ends[::step])[1:], strict=True)
    ):
        step += 1
    if step == 1:
        return False
    kept = {place: text.get_text() for place, text in [*texts.items()][::step]}
    axis.set_major_locator(FixedLocator(list(kept)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: kept.get(value, "")))
    return True
