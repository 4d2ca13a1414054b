"""What is asked of a figure of an output, which series can be drawn so, and what stands around the data."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import models
from mdr_dask.errors import DataError, did_you_mean
from mdr_dask.plots import curves, drawing, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Most letters in a line of a name at a tick; lists and structures are longer.
LONGEST_NAME = 20


@dataclass(frozen=True)
class View:
    """What a figure of an output shows.

    Parameters
    ----------
    output : str
        An output of the model, or the error beside it.
    over : tuple of str
        The parameter on the horizontal axis; two for a map, none for the effects of all parameters.
    by : str
        The parameter that curves, or points of a sampled study, differ in.
    panels : str
        The parameter that panels differ in.
    log : str, optional
        Which axes are logarithmic, of ``x``, ``y`` and ``z``, the colours. If nothing is said, those whose numbers are
        positive and spread over more than a decade.
    """

    output: str
    over: tuple[str, ...]
    by: str = ""
    panels: str = ""
    log: str | None = None

    def is_log(self, which: str, values: Any) -> bool:
        """Return whether an axis of the figure is logarithmic."""
        return style.is_geometric(values) if self.log is None else which in self.log


class Panel(NamedTuple):
    """What one panel shows: its title, and the series in it by name."""

    title: str
    series: dict[str, xr.Dataset]


def holding(series: Mapping[str, xr.Dataset], view: View) -> tuple[dict[str, xr.Dataset], list[str]]:
    """Return the series that hold an output and vary along what is named, and what is left out.

    Raises
    ------
    DataError
        If no series can be drawn so, with the reason of each.
    """
    known = sorted({str(name) for data in series.values() for name in data.data_vars if name != "status"})
    if view.output not in known:
        raise DataError(f"no output {view.output!r} in this study{did_you_mean(view.output, known)}")
    found, reasons = {}, []
    for name, data in series.items():
        reason = _unfit(data, view) if view.output in data else f"it does not hold {view.output}"
        if reason:
            reasons.append(f"{name}: {reason}" if name and len(series) > 1 else reason)
        else:
            found[name] = data
    if not found:
        raise DataError("; ".join(dict.fromkeys(reasons)))
    return found, [f"series {reason}" for reason in reasons]


def varied(data: xr.Dataset, output: str) -> list[str]:
    """Return the parameters that an output varies along, those of a sampled study too."""
    return [name for dim in curves.axes_of(data, output) for name in curves.parameters_along(data, dim)]


def is_sampled(data: xr.Dataset, dim: str | None) -> bool:
    """Return whether several parameters change together along a dimension."""
    return dim is not None and len(curves.parameters_along(data, dim)) > 1


def _unfit(data: xr.Dataset, view: View) -> str:
    """Say why a series cannot be drawn as asked; nothing if it can."""
    own = [str(dim) for dim in data[view.output].dims if dim not in (*curves.axes_of(data, view.output), "realisation")]
    known = [*varied(data, view.output), *own]
    for name in (*view.over, view.by, view.panels):
        if name and name not in known:
            fixed = name in data.coords and data[name].ndim == 0
            hint = f"no axis {name!r}{did_you_mean(name, known)}"
            at = f"{name} is fixed, {style.named(name, data[name])}" if fixed else hint
            return f"{at}; {view.output} varies along {', '.join(known) or 'nothing'}"
    if rest := [dim for dim in own if dim not in view.over]:
        return f"{view.output} goes along {rest[0]}: --over {rest[0]}, or --select {rest[0]}=VALUE"
    dims = [(name, curves.along_dim(data, name, view.output)) for name in (*view.over, view.by, view.panels) if name]
    if view.panels and is_sampled(data, dims[-1][1]):
        return f"every case of a sampled study has another {view.panels}: --by {view.panels} gives it colours"
    for name, dim in dims:
        if [each for _, each in dims].count(dim) > 1 and not is_sampled(data, dim):
            return f"{name} is asked for twice: curves, panels and axes need parameters of their own"
    return ""


def value(data: xr.Dataset, output: str) -> drawing.Mean:
    """Return the mean of an output over the realisations with its interval, in the unit shown."""
    how = style.quantity(output, data[output])
    return drawing.Mean(*map(how.of, curves.measured(data, output)))


#: Steps of a thousand for which a unit has a prefix that everybody reads, and what is written with them.
PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
WITH_PREFIX = ("Pa", "m", "N", "s", "W", "ohm")


def with_prefix(found: Mapping[str, xr.Dataset], output: str) -> str | None:
    """Return the unit in which the largest value of an output is a number from 1 to 1000; None for other units."""
    arrays = [data[output] for data in found.values()]
    unit = str(arrays[0].attrs.get("units", "1"))
    if unit not in WITH_PREFIX or any(array.attrs.get("units") != unit for array in arrays):
        return None
    largest = max((float(abs(array).where(np.isfinite(array)).max()) for array in arrays), default=np.nan)
    if not (np.isfinite(largest) and largest > 0):
        return None
    step = int(np.clip(3 * np.floor(np.log10(largest) / 3), min(PREFIXES), max(PREFIXES)))
    return f"{PREFIXES[step]}{unit}"


def places(data: xr.Dataset, name: str) -> xr.DataArray:
    """Return where points lie along an axis: numbers in the unit shown, or the places of names."""
    values = data[name]
    shown = style.shown(name, values) if values.dtype.kind in "fiu" else np.arange(values.size)
    return xr.DataArray(shown, dims=values.dims, coords=values.coords)


def by_value(found: Mapping[str, xr.Dataset], view: View) -> tuple[list[Panel], list[str]]:
    """Return a panel for every value of a parameter, with all series that have it, and what is left out."""
    parts: dict[Any, Panel] = {}
    for name, data in found.items():
        for k in range(data.sizes[view.panels]):
            part = data.isel({view.panels: k})
            title = style.named(view.panels, part[view.panels])
            parts.setdefault(part[view.panels].item(), Panel(title, {})).series[name] = part
    keys = sorted(parts)
    kept = np.unique(np.linspace(0, len(keys) - 1, min(len(keys), style.MOST_PANELS)).round().astype(int))
    told = f"{len(keys) - kept.size} of {len(keys)} values of {view.panels} ({kept.size} drawn, spread evenly)"
    return [parts[keys[k]] for k in kept], [told] if kept.size < len(keys) else []


def by_series(found: Mapping[str, xr.Dataset]) -> tuple[list[Panel], list[str]]:
    """Return a panel for every series, and what is left out."""
    few, told = curves.few(found)
    return [Panel(name if len(found) > 1 else "", {name: data}) for name, data in few.items()], told


def scale(axes: Axes, which: str, name: str, values: xr.DataArray, view: View) -> None:
    """Label an axis of a panel with a parameter, and give it its scale, or names in place of numbers."""
    own = name in curves.OWN and values.attrs.get("units", "1") == "1"
    label = style.meaning(values, name) if own else style.label(name, values)
    getattr(axes, f"set_{which}label")(style.broken(label))
    if values.dtype.kind not in "fiu":
        names = [textwrap.fill(str(each), LONGEST_NAME) for each in np.atleast_1d(values.values)]
        getattr(axes, f"set_{which}ticks")(range(values.size), names)
    elif view.is_log(which, style.shown(name, values)):
        style.logarithmic(axes, which)


def title(
    figure: Figure,
    subject: str,
    found: Mapping[str, xr.Dataset],
    held: Sequence[Mapping[str, xr.DataArray]],
    bars: str,
) -> None:
    """Write over a figure what it shows, what all of it holds fixed, and what bars mean.

    Settings, defaults, and entries of structures are left to the table beside the figure, except those
    that figures have symbols for.
    """
    alike = curves.fixed_by_all(held)
    parameters = models.load(next(iter(found.values())).attrs["model"]).parameters
    plain = {name: field.default for name, field in parameters.model_fields.items()}
    told = [
        name
        for name, value in alike.items()
        if name not in parameters.settings
        and (name in style.QUANTITIES or (name in plain and value.item() != plain[name]))
    ]
    style.title(figure, subject, curves.fixed_text(alike, told), bars)


def subject(found: Mapping[str, xr.Dataset], view: View, words: str) -> str:
    """Return the first line of a title: the output, and the series where there is only one."""
    meaning = style.quantity(view.output, next(iter(found.values()))[view.output]).symbol
    (name,) = found if len(found) == 1 else ("",)
    return f"{meaning} {words}{f', {name}' if name else ''}"
