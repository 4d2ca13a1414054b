"""A figure as data: panels and all that is drawn in them, independent of the drawing library."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.plots.labels import plain
from mdr_dask.units import shown

#: Columns of the table of a figure: `FIRST` to the left of the columns of parameters, `LAST` to the right.
FIRST = ("panel", "curve", "what")
LAST = tuple(f"{name}{end}" for name in ("x", "y", "value") for end in ("", "_low", "_high"))
#: Number of points of a smooth line that is drawn from a formula. Chosen by trial: on paper, the points are less than a
#: millimetre apart.
SMOOTH = 400
#: Entry of the column ``what`` for results of a study, and for the measured points of a calibration or a master curve.
DATA = "data"
Kind = Literal["curve", "law", "band", "dots", "map", "absent"]


class Mean(NamedTuple):
    """Values with the lower and upper limits of their intervals. The limits are NaN if the error is unknown."""

    value: Any
    low: Any
    high: Any


@dataclass(frozen=True)
class Axis:
    """An axis of a panel. Symbols in the label are mathtext between dollar signs.

    If the values are words, `ticks` are the positions and texts of the ticks. If the limit `low` or `high` is None, the
    data determine this limit. `quantity` is the name of the parameter or output on the axis. If a derived quantity is
    on the axis, `quantity` is empty. `reverse` means that values increase downwards or to the left.
    """

    label: str
    log: bool = False
    ticks: Sequence[tuple[float, str]] = ()
    low: float | None = None
    high: float | None = None
    quantity: str = ""
    reverse: bool = False


@dataclass(frozen=True)
class Bar:
    """A colour bar from `low` to `high`."""

    label: str
    low: float
    high: float
    log: bool = False


@dataclass(frozen=True)
class Key:
    """An entry of a legend."""

    label: str
    colour: str
    line: str = ""
    marker: str = ""


@dataclass(frozen=True)
class Trace:
    """One curve, law, band, map or set of points.

    Kinds: ``curve`` and ``law`` consist of points, which are joined if `line` is not empty; ``band`` fills the area
    from ``y_low`` to ``y_high``; ``dots`` and the cells of a ``map`` are coloured by ``value``; ``absent`` are marks at
    the lower edge of the panel. The variables of `data` are ``x``, ``y`` and ``value`` in the units of the axes, and
    known limits of intervals, such as ``y_low`` and ``y_high``. The coordinates of `data` are the parameters of each
    point in SI units. `what` says what the points are: ``data``, or for example the name of a law, or the reason why
    cases have no value. The intervals of points that are joined by a line are drawn as a band, unless `bars` is true;
    all other intervals are drawn as bars.
    """

    kind: Kind
    data: xr.Dataset
    what: str = DATA
    label: str = ""
    colour: str = "#000000"
    line: str = ""
    marker: str = ""
    bars: bool = False

    def column(self, name: str) -> FloatArray:
        """Return one variable as a flat array with an entry for every point."""
        whole = self.data[name].broadcast_like(self.data[self._widest]).transpose(*self.data[self._widest].dims)
        return np.asarray(whole.values, dtype=np.float64).ravel()

    @property
    def _widest(self) -> str:
        return str(max(self.data.data_vars, key=lambda name: self.data[name].ndim))

    def frame(self) -> pd.DataFrame:
        """Return a table with a row for every point that is drawn."""
        data, own = self.data, [str(name) for name in self.data.variables]
        rows: pd.DataFrame = (data if data.sizes else data.expand_dims("point")).to_dataframe().reset_index()[own]
        drawn = next(name for name in ("value", "y", "y_low", "x") if name in rows)
        finite: pd.DataFrame = rows[np.isfinite(rows[drawn])]
        return finite.assign(curve=plain(self.label), what=plain(self.what))


@dataclass
class Panel:
    """A panel. Without `keys` and without a colour bar, every trace with a label is an entry of the legend."""

    x: Axis
    y: Axis
    traces: list[Trace] = field(default_factory=list)
    title: str = ""
    bar: Bar | None = None
    keys: list[Key] = field(default_factory=list)

    def entries(self) -> list[Key]:
        """Return the entries of the legend, without duplicates."""
        of_traces = [Key(t.label, t.colour, t.line, t.marker) for t in self.traces if t.label and not self.bar]
        found = self.keys or of_traces
        return list(dict.fromkeys(found))


@dataclass
class Figure:
    """A figure as data.

    `subject` is the first part of the title. With ``stack = 3``, panels 1 to 3 form a column, and panels 4 to 6 form
    the next column. With ``stack = 1``, the panels fill row after row. `fixed` is a text about the whole figure, such
    as the fixed parameters, and `bars` is a text that explains the error bars and bands. `left_out` are texts about
    results that are not drawn. `warnings` are texts about doubtful results. `notes` are texts for the caption and the
    table. `ratio` is the height of a panel divided by its width. `share_y` gives all panels the same vertical axis.
    """

    panels: list[Panel]
    subject: str
    fixed: str = ""
    bars: str = ""
    left_out: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    stack: int = 1
    ratio: float = 0.7
    share_y: bool = False
    #: Names of fixed parameters that the caption leaves out (see `curves.scalars`).
    unnamed: Collection[str] = ()
    #: States of the results that belong to the figure. None means all results of the series.
    states: Sequence[xr.DataArray] | None = None

    def leave_out(self, sentences: Iterable[str]) -> None:
        """Add texts about results that are not drawn."""
        self.left_out = [*dict.fromkeys([*self.left_out, *(sentence for sentence in sentences if sentence)])]

    def judge(self, law_holds: str) -> None:
        """Add a sentence on whether a fitted law holds: to `bars` if the law holds, otherwise to `warnings`."""
        if law_holds.startswith("yes"):
            self.bars = f"{self.bars}; {law_holds}"
        else:
            self.warnings = [*self.warnings, f"does the fit hold? {law_holds}"]

    def table(self) -> pd.DataFrame:
        """Return a table with a row for every point.

        ``x``, ``y`` and ``value`` are in the units of the axes. Parameters are in SI units. Parameters with the same
        value at all points are in ``attrs["held"]``. The units of all parameters are in ``attrs["units"]``.
        """
        frames = [trace.frame().assign(panel=k + 1) for k, panel in enumerate(self.panels) for trace in panel.traces]
        frames = [frame.dropna(axis=1, how="all") for frame in frames if len(frame)]
        whole = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=[*FIRST])
        parameters = [name for name in whole if name not in (*FIRST, *LAST)]
        held = {name: whole[name].dropna().iloc[0] for name in parameters if whole[name].nunique() == 1}
        ends = [name for name in LAST if name in whole or name in ("x", "y")]
        found = whole.reindex(columns=[*FIRST, *(name for name in parameters if name not in held), *ends])
        found.attrs = {"held": held, "units": self.units()}
        return found

    def units(self) -> dict[str, str]:
        """Return the units of all parameters."""
        coords = (item for panel in self.panels for trace in panel.traces for item in trace.data.coords.items())
        return {str(name): str(value.attrs.get("units", "1")) for name, value in coords}

    def caption(self) -> list[str]:
        """Return the lines for a caption: the title, the fixed parameters, what is not drawn, warnings and notes."""
        attrs = self.table().attrs
        units, held = attrs["units"], attrs["held"]
        fixed = [f"{name} = {_text(held[name], units[name])}" for name in held if name not in self.unnamed]
        lines = [f"title: {'; '.join(part for part in (self.subject, self.fixed, self.bars) if part)}"]
        lines += [f"held fixed: {', '.join(fixed)}"] * bool(fixed)
        return list(map(plain, [*lines, *self.remarks()]))

    def remarks(self) -> list[str]:
        """Return one line for each thing that is not drawn, each warning and each note."""
        rest = [f"not drawn: {text}" for text in self.left_out]
        return [*rest, *(f"warning: {warning}" for warning in self.warnings), *self.notes]

    def head(self, origin: Mapping[str, str]) -> list[str]:
        """Return the comment lines above the table: `origin`, the caption, units, and labels of the panels."""
        table = self.table()
        units = table.attrs["units"]
        varied = [name for name in table if name in units]
        lines = [*(f"{name}: {text}" for name, text in origin.items()), *self.caption()]
        lines += [f"units: {', '.join(f'{name} [{units[name]}]' for name in varied)}"] * bool(varied)
        for number, panel in enumerate(self.panels):
            parts = [f"x: {panel.x.label}", f"y: {panel.y.label}", panel.title]
            lines.append(f"panel {number + 1}: {'; '.join(part for part in parts if part)}")
        return [plain(line) for line in lines]


def _text(value: Any, unit: str) -> str:
    return shown(float(value), unit, 12) if isinstance(value, int | float | np.number) else str(value)


def columns(of: xr.Dataset | xr.DataArray | None = None, **values: Any) -> xr.Dataset:
    """Return the data of a trace: the given arrays (``x``, ``y``, ``value``), with the parameters from `of`.

    A `Mean` gives three arrays, such as ``y``, ``y_low`` and ``y_high``. If all lower or all upper limits are unknown,
    their array is left out.
    """
    parts: dict[str, Any] = {}
    for name, value in values.items():
        ends = value if isinstance(value, Mean) else (value,)
        parts |= {f"{name}{end}": each for end, each in zip(("", "_low", "_high"), ends, strict=False)}
    labelled = [part for part in parts.values() if isinstance(part, xr.DataArray)]
    shapes = {part.shape: part.dims for part in labelled if part.ndim}
    arrays = {}
    for name, part in parts.items():
        array = np.asarray(part.values if isinstance(part, xr.DataArray) else part, dtype=np.float64)
        dims = part.dims if isinstance(part, xr.DataArray) else shapes.get(array.shape, ("point",) * array.ndim)
        arrays[name] = ([_apart(dim) for dim in dims], array)
    used = {dim for dims, _ in arrays.values() for dim in dims}
    found = (
        {} if of is None else {name: ([_apart(d) for d in c.dims], c.values, c.attrs) for name, c in of.coords.items()}
    )
    kept = {_apart(name): coord for name, coord in found.items() if set(coord[0]) <= used}
    data = xr.Dataset(arrays, coords=kept)
    unknown = [name for name in arrays if name.endswith(("_low", "_high")) and not np.isfinite(data[name]).any()]
    return data.drop_vars(unknown)


def _apart(name: Any) -> str:
    """Return the name of a parameter, preceded by ``parameter`` if another column of the table has the same name."""
    return f"parameter {name}" if name in (*FIRST, *LAST) else str(name)


def edges(centres: FloatArray, log: bool) -> FloatArray:
    """Return the edges of cells around the values of an axis: halfway between neighbouring values.

    If `log` is true, the edges are halfway between the logarithms of neighbouring values. The value at an end of the
    axis is in the middle of its cell. If the axis has only one value, the width of its cell is the magnitude of the
    value, or 1 if the value is 0.
    """
    if centres.size == 1:
        half = 0.5 * (abs(float(centres[0])) or 1.0)
        return np.array([centres[0] - half, centres[0] + half])
    at = np.log(centres) if log else centres
    between = 0.5 * (at[1:] + at[:-1])
    ends: FloatArray = np.concatenate([[2 * at[0] - between[0]], between, [2 * at[-1] - between[-1]]])
    return np.asarray(np.exp(ends)) if log else ends
