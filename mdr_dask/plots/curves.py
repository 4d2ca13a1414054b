"""What a figure shows of a store: its curves along a parameter, what tells them apart, and what is held fixed.

Axes that a figure cannot show are held at one value. Which one stands in its title, and that there are others under it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import aggregation, models
from mdr_dask.errors import DataError, FitError
from mdr_dask.models.base import Status
from mdr_dask.plots import style
from mdr_dask.plots.drawing import Curve, Mean

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Dimensions that outputs have of their own, for data without a status.
OWN = {"relaxation_times", "radius", "position", "angle", "block", "regime"}
#: Line styles that tell a second parameter apart.
MOST_STYLES = len(style.LINES)


class Family(NamedTuple):
    """Curves along one parameter.

    Attributes
    ----------
    curves : list of Curve
        Each with one dimension beside the realisations and those that an output has of its own.
    joined : bool
        Whether their points belong on a line: no other parameter changes from one to the next.
    heading : str
        What the labels name, for the heading of a legend.
    bar : (name, values) or None
        The parameter of a colour bar, where there are more curves than colours.
    held : dict of str to DataArray
        Parameters at their only value, or at the one chosen.
    left_out : list of str
        What is not drawn, a sentence for each axis.
    varying : tuple of str
        Parameters that change from point to point beside the one on the axis, in a sampled design.
    """

    curves: list[Curve]
    joined: bool
    heading: str
    bar: tuple[str, xr.DataArray] | None
    held: dict[str, xr.DataArray]
    left_out: list[str]
    varying: tuple[str, ...] = ()


#: Of several families in one panel, none has the legend's heading or a colour bar.
NO_FAMILY = Family([], False, "", None, {}, [])


def mean(values: xr.DataArray, error: xr.DataArray | None = None) -> Mean:
    """Return the mean over realisations with its interval: their scatter and the error of the grid, joined."""
    return Mean(*aggregation.mean_and_ends(values, error))


def measured(data: xr.Dataset, output: str, factor: Any = 1.0) -> Mean:
    """Return the mean of an output times a factor, with its interval."""
    error = aggregation.companion(data, output)
    return mean(data[output] * factor, None if error is None else error * factor)


def meaning_of_bars(*groups: xr.Dataset, outputs: Sequence[str]) -> str:
    """Return what bars and bands of outputs mean, for the title."""
    most = max((data.sizes.get("realisation", 1) for data in groups), default=1)
    scatter = f"scatter of up to {most} realisations" if most > 1 else ""
    companions = [aggregation.companion(data, name) for data in groups for name in outputs if name in data]
    grid = "error of the grid" if any(each is not None for each in companions) else ""
    parts = " and ".join(part for part in (scatter, grid) if part)
    return f"bars: 95 % intervals, {parts}" if parts else "one realisation: no bars"


def with_outputs(
    groups: Mapping[str, xr.Dataset],
    outputs: Sequence[str],
    *varied: str,
    where: Callable[[xr.Dataset], bool] | None = None,
) -> dict[str, xr.Dataset]:
    """Return the series that hold outputs and vary along parameters.

    Raises
    ------
    DataError
        If there is none.
    """
    found = {
        name: data
        for name, data in groups.items()
        if all(output in data for output in outputs)
        and all(name in data.coords and data[name].size > 1 for name in varied)
        and (where is None or where(data))
    }
    if not found:
        along = f" over {' and '.join(varied)}" if varied else ""
        raise DataError(f"no series of the store holds {', '.join(outputs)}{along}")
    return found


def few(found: Mapping[str, xr.Dataset], most: int = style.MOST_PANELS) -> tuple[dict[str, xr.Dataset], list[str]]:
    """Return as many series as a figure has panels for, and which are left out."""
    names = list(found)
    rest = [f"series {', '.join(names[most:])}"] if len(names) > most else []
    return {name: found[name] for name in names[:most]}, rest


def axes_of(data: xr.Dataset, output: str) -> list[str]:
    """Return the dimensions of an output that cases vary along, not those that it has of its own."""
    if "status" in data:
        cases = {str(dim) for dim in data["status"].dims}
    else:
        cases = {str(axis["dim"]) for axis in data.attrs.get("axes", [])} or {str(d) for d in data[output].dims} - OWN
    return [str(dim) for dim in data[output].dims if dim in cases and dim != "realisation"]


def along_dim(data: xr.Dataset, along: str, output: str) -> str | None:
    """Return the dimension that a parameter varies along, or None where it is fixed."""
    if along in data[output].dims:
        return along
    if along in data.coords and data[along].ndim == 1 and data[along].dims[0] in data[output].dims:
        return str(data[along].dims[0])
    return None


def parameters_along(data: xr.Dataset, dim: str) -> list[str]:
    """Return the parameters that change along a dimension: its own, or all those of a sampled design."""
    names = [str(name) for name, values in data.coords.items() if values.dims == (dim,)]
    axes = [str(axis["name"]) for axis in data.attrs.get("axes", [])]
    return sorted(names or [dim], key=lambda name: axes.index(name) if name in axes else -1)


def middle(size: int) -> int:
    """Return the place that an axis is held at where nothing better is known."""
    return size // 2


def hold(data: xr.Dataset, dims: Sequence[str], best: xr.DataArray | None = None) -> tuple[xr.Dataset, list[str]]:
    """Hold axes at one value.

    Parameters
    ----------
    data : Dataset
        A series.
    dims : sequence of str
        What to hold.
    best : DataArray, optional
        Over some of the axes: they are held where it is largest; the others in the middle.

    Returns
    -------
    Dataset, list of str
        The series without these axes, and a sentence for each that says how many values it has.
    """
    places = {dim: middle(data.sizes[dim]) for dim in dims}
    if best is not None and bool(best.notnull().any()):
        best = best.max([dim for dim in best.dims if dim not in places])
        places |= {str(dim): int(place) for dim, place in best.argmax([*best.dims]).items()} if best.ndim else {}
    sentences = [_only_one(data, dim, place) for dim, place in places.items() if data.sizes[dim] > 1]
    return data.isel(places), sentences


def _only_one(data: xr.Dataset, dim: str, place: int) -> str:
    names = parameters_along(data, dim)
    values = ", ".join(style.named(name, data[name].isel({dim: place})) for name in names if name in data.coords)
    return f"{data.sizes[dim] - 1} of {data.sizes[dim]} values of {' and '.join(names)} (drawn: {values or place})"


def family(data: xr.Dataset, output: str, along: str, by: Sequence[str] = (), styled: bool = True) -> Family:
    """Split a series into curves along a parameter.

    Up to seven curves have colours of their own. Of more, one axis has a colour bar, one of a few values line styles;
    the others are held in the middle.

    Parameters
    ----------
    data : Dataset
        A series.
    output : str
        What is drawn: its axes count.
    along : str
        The parameter on the horizontal axis: one that varies, alone or in a sampled design, or a fixed one, for a
        point.
    by : sequence of str
        Axes for the colours, the first that varies.
    styled : bool
        Whether line styles are free for a second axis.

    Raises
    ------
    DataError
        If the series does not know the parameter.
    """
    if along not in data.coords and along not in data.dims:
        raise DataError(f"expected a series with {along}, got {', '.join(map(str, data.dims))}")
    over = along_dim(data, along, output)
    others = [dim for dim in axes_of(data, output) if dim != over]
    sizes = {dim: data.sizes[dim] for dim in others}
    told: list[str] = []
    if int(np.prod(list(sizes.values()), dtype=int)) > style.most_colours():
        kept = _most_shown(sizes, by, styled)
        data, told = hold(data, [dim for dim in others if dim not in kept])
        others = kept
    together = parameters_along(data, over) if over else [along]
    joined = over is not None and len(together) == 1 and data.sizes[over] > 1
    curves, heading, bar = _split(data, others, joined)
    varying = [name for dim in (over, others[0] if bar else None) if dim for name in parameters_along(data, dim)]
    shown = {along, over, bar[0] if bar else None}
    return Family(
        curves, joined, heading, bar, scalars(data), told, tuple(name for name in varying if name not in shown)
    )


def _most_shown(sizes: Mapping[str, int], by: Sequence[str], styled: bool) -> list[str]:
    """Return the axis for the colours, and perhaps one for line styles: those that show most, preferred ones first."""
    wanted = [dim for dim in by if sizes.get(dim, 1) > 1]
    ranked = [*wanted, *(dim for dim in sizes if dim not in wanted and sizes[dim] > 1)]
    choices = [[dim] for dim in ranked]
    if styled:
        pairs = [[one, two] for one in ranked for two in ranked if two != one and sizes[two] <= MOST_STYLES]
        choices = pairs or choices
    return max(
        choices, key=lambda dims: np.prod([sizes[dim] for dim in dims]) if not wanted or wanted[0] in dims else 0
    )


def _split(
    data: xr.Dataset, others: list[str], joined: bool
) -> tuple[list[Curve], str, tuple[str, xr.DataArray] | None]:
    """Return a curve for every point of some axes, the heading of their legend, and what a colour bar shows."""
    cells = list(np.ndindex(*(data.sizes[dim] for dim in others)))
    varied = [dim for dim in others if data.sizes[dim] > 1]
    if len(cells) <= style.most_colours():
        curves = []
        for k, cell in enumerate(cells):
            part = _needed(data.isel(dict(zip(others, cell, strict=True))))
            line, marker = style.line_and_marker(k)
            curves.append(Curve(part, ", ".join(_names(part, varied)), style.colour(k), line if joined else "", marker))
        return curves, "", None
    colour, second = others[0], others[1] if len(others) > 1 else None
    name = parameters_along(data, colour)[0]
    values = data[name] if name in data.coords else xr.DataArray(np.arange(data.sizes[colour]), dims=colour)
    if values.dtype.kind not in "fiu":
        values = xr.DataArray(np.arange(values.size), dims=colour)
    many = values.size > style.most_colours()
    how, norm = style.shades(style.shown(name, values))
    curves = []
    for cell in cells:
        part = _needed(data.isel(dict(zip(others, cell, strict=True))))
        k = cell[1] if second else 0
        told = [second] if many else [colour, second]
        label = ", ".join(_names(part, [dim for dim in told if dim])) if cell[0] == 0 or not many else ""
        shade = how(norm(float(style.shown(name, values)[cell[0]]))) if many else style.colour(cell[0])
        curves.append(Curve(part, label, shade, style.LINES[k] if joined else "", style.MARKERS[k]))
    return curves, "", (name, values) if many else None


def _needed(curve: xr.Dataset) -> xr.Dataset:
    """Leave out the values of an adaptive axis that a curve did not need."""
    if "status" not in curve:
        return curve
    spared = (curve["status"] == Status.NOT_NEEDED).all("realisation")
    return curve.isel({spared.dims[0]: np.flatnonzero(~spared)}) if spared.ndim == 1 and spared.any() else curve


def _names(part: xr.Dataset, dims: Sequence[str | None]) -> Iterator[str]:
    """Yield how the parameters along some axes are written, for one curve."""
    for dim in dims:
        here = [
            str(name) for name, value in part.coords.items() if value.ndim == 0 and name in (dim, *_along(part, dim))
        ]
        yield ", ".join(style.named(name, part[name]) for name in here) or str(dim)


def _along(part: xr.Dataset, dim: str | None) -> list[str]:
    return [str(axis["name"]) for axis in part.attrs.get("axes", []) if axis["dim"] == dim]


def scalars(data: xr.Dataset) -> dict[str, xr.DataArray]:
    """Return the parameters that stand at one value, but for those that have no say there."""
    silent = _silent(data)
    return {str(name): value for name, value in data.coords.items() if value.ndim == 0 and name not in silent}


def _silent(data: xr.Dataset) -> set[str]:
    """Return the parameters that have no say: another one does not have the value that they are for."""
    if "model" not in data.attrs:
        return set()
    conditions = models.load(data.attrs["model"]).parameters.requires
    return {name for name, (other, value) in conditions.items() if value not in _given(data, other)}


def _given(data: xr.Dataset, name: str) -> list[Any]:
    """Return the values that a parameter has in a series."""
    return list(np.ravel(data[name].values)) if name in data.coords else [parameters_of(data).get(name)]


def thin(data: xr.Dataset, dim: str, most: int) -> tuple[xr.Dataset, list[str]]:
    """Return a series with at most so many values along an axis, spread evenly, and what is left out."""
    size = data.sizes[dim]
    if size <= most:
        return data, []
    chosen = np.unique(np.linspace(0, size - 1, most).round().astype(int))
    names = " and ".join(parameters_along(data, dim))
    return data.isel({dim: chosen}), [
        f"{size - chosen.size} of {size} values of {names} ({chosen.size} drawn, spread evenly)"
    ]


def fixed_text(held: Mapping[str, xr.DataArray], names: Sequence[str]) -> str:
    """Return the parameters of a title: those that stand at one value."""
    there = [name for name in names if name in held and _known(held[name])]
    return ", ".join(style.named(name, held[name]) for name in there)


def _known(value: xr.DataArray) -> bool:
    return value.dtype.kind not in "fiu" or bool(np.isfinite(value))


def fixed_by_all(held: Sequence[Mapping[str, xr.DataArray]]) -> dict[str, xr.DataArray]:
    """Return what several families hold at the same value."""
    first = held[0] if held else {}
    return {
        name: value
        for name, value in first.items()
        if all(
            name in each and np.array_equal(each[name].values, value.values, equal_nan=value.dtype.kind == "f")
            for each in held
        )
    }


def parameters_of(data: xr.Dataset) -> dict[str, Any]:
    """Return the parameters of a series as its store keeps them, names of rules and shapes among them."""
    found: dict[str, Any] = json.loads(data.attrs.get("parameters", "{}"))
    return found


def parameters_at(case: xr.Dataset) -> dict[str, Any]:
    """Return the parameters of one case: those of its series, with the values that its axes have there."""
    parameters = parameters_of(case)
    for axis in case.attrs.get("axes", []):
        *above, last = axis["path"].split(".")
        place = parameters
        for key in above:
            place = place[key]
        value = case[axis["name"]].item()
        labels = axis.get("labels")
        place[last] = axis["values"][labels.index(value)] if labels else value
    return parameters


def finish(figure: Figure, axes: Axes, one: Family) -> None:
    """Draw the legend and the colour bar of a family."""
    if one.bar is not None:
        colour_bar(figure, [axes], *one.bar)
    name_varying(axes, one)
    style.legend(axes, one.heading)


def colour_bar(figure: Figure, axes_of: Sequence[Axes], name: str, values: xr.DataArray) -> None:
    """Draw the colour bar of a parameter that curves differ in."""
    from matplotlib.cm import ScalarMappable

    how, norm = style.shades(style.shown(name, values))
    figure.colorbar(ScalarMappable(norm, how), ax=list(axes_of), label=style.label(name, values))


def name_varying(axes: Axes, one: Family) -> None:
    """Say in the legend what changes from point to point beside the parameter of the axis."""
    if one.varying:
        symbols = ", ".join(style.quantity(name).symbol for name in one.varying)
        axes.plot([], [], " ", label=f"varying too: {symbols}")


def results(
    compute: Callable[[Mapping[str, xr.Dataset]], xr.Dataset], groups: Mapping[str, xr.Dataset]
) -> dict[str, xr.Dataset]:
    """Return what a fit finds for each series that has the data for it, with every parameter as a coordinate.

    Raises
    ------
    FitError
        If no series has; each one's reason is given.
    """
    found, reasons = {}, []
    for name, data in groups.items():
        try:
            result = compute({name: data})
        except (FitError, DataError) as error:
            reasons.append(f"{name}: {error}" if name else str(error))
            continue
        found[name] = with_coordinates(result, data)
    if not found:
        raise FitError("; ".join(dict.fromkeys(reasons)))
    return found


def verdict(found: Iterable[xr.Dataset]) -> str:
    """Return in how many fits the law holds, for the title; the sentence of a fit that stands alone."""
    said = [str(text) for each in found if "law_holds" in each for text in np.ravel(each["law_holds"].values)]
    if len(said) == 1:
        return f"law holds: {said[0]}"
    held = sum(text.startswith("yes") for text in said)
    tested = sum(not text.startswith("not tested") for text in said)
    return f"the law holds in {held} of {tested} fits" if tested else ""


def with_coordinates(found: xr.Dataset, data: xr.Dataset) -> xr.Dataset:
    """Return what was found for a series with the series' parameters, fixed ones too, as coordinates."""
    dims = set(found.dims)
    missing = {
        name: value.reset_coords(drop=True)
        for name, value in data.coords.items()
        if name not in found.coords and name not in found.variables and name not in dims and set(value.dims) <= dims
    }
    return found.assign_coords(missing).assign_attrs(
        axes=data.attrs.get("axes", []), parameters=data.attrs.get("parameters", "{}")
    )
