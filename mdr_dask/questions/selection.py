"""Select parts of a study by texts such as ``velocity=1 mm/s..1 m/s``, ``hurst=0.3,0.7``, ``wear_rule=exact``."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import SAME
from mdr_dask.campaign.written import written_units
from mdr_dask.errors import LISTED, DataError, did_you_mean
from mdr_dask.models.base import Status
from mdr_dask.questions.columns import Columns, fixed_words, inner
from mdr_dask.units import shown, to_si

if TYPE_CHECKING:
    import xarray as xr

FORM = "NAME=VALUE, NAME=VALUE,VALUE or NAME=FROM..TO"

Tell = Callable[[str], object]


def select(dataset: xr.Dataset, selections: Sequence[str], tell: Tell = warnings.warn) -> xr.Dataset:
    """Keep the selected part of a group of a study. No dimension is removed.

    A selection is a name, ``=``, and values or ranges that are separated by commas, as in ``velocity=1 mm/s..1 m/s``,
    ``hurst=0.3,0.7`` or ``radius=..2``. The name is ``case``, ``realisation``, or the name of an axis, of a column of a
    sampled study or of a fixed parameter. Both ends of a range are included. If a number between two values of the axis
    is selected, the nearest value is kept, and `tell` receives a message. A selection by a fixed parameter leaves the
    group unchanged. DataError is raised for an unknown name, and for a value or a range that selects nothing.
    """
    units = written_units(str(dataset.attrs.get("campaign", "")))
    for text in selections:
        name, wanted = _parsed(text)
        axis = _axis(dataset, name)
        kept = np.flatnonzero(_chosen(axis, name, wanted, units.get(name, ""), tell))
        if axis.dims[0] in dataset.dims:
            dataset = dataset.isel({axis.dims[0]: kept})
    return dataset


def select_all(
    datasets: Mapping[str, xr.Dataset], selections: Sequence[str], tell: Tell = warnings.warn
) -> dict[str, xr.Dataset]:
    """Apply each selection to all series in which its parameter varies, or to the first series if it varies in none."""
    chosen = dict(datasets)
    for text in selections:
        name, _ = _parsed(text)
        varied = [key for key, data in chosen.items() if _varies(data, name)]
        for key in varied or list(chosen)[:1]:
            chosen[key] = select(chosen[key], (text,), tell)
    return chosen


def where(dataset: xr.Dataset, condition: str) -> xr.Dataset:
    """Keep the cases whose means over realisations meet a condition.

    In all other cases, outputs are set to NaN, and the status is set to not needed.
    """
    truth = Columns(dataset).truth(condition)
    masked = {name: array.where(truth) for name, array in dataset.data_vars.items() if name != "status"}
    status = dataset["status"].where(truth, Status.NOT_NEEDED.value).astype(dataset["status"].dtype)
    return dataset.assign(masked | {"status": status.transpose(*dataset["status"].dims)})


def where_all(groups: Mapping[str, xr.Dataset], condition: str) -> dict[str, xr.Dataset]:
    """Keep the cases of all groups that meet a condition. Raise DataError if no case meets the condition."""
    kept = {name: where(dataset, condition) for name, dataset in groups.items()}
    if all((dataset["status"] == Status.NOT_NEEDED.value).all() for dataset in kept.values()):
        raise DataError(f"--where {condition}: no result meets the condition")
    return kept


def group(datasets: Mapping[str, xr.Dataset], series: str | None) -> xr.Dataset:
    """Return the group of a series, or the only group of a study if `series` is None."""
    names = ", ".join(datasets)
    if series is None:
        if len(datasets) > 1:
            raise DataError(f"expected --series (in Python series=) with one of {names}, because this study has series")
        return next(iter(datasets.values()))
    if series not in datasets:
        raise DataError(f"no series {series!r}; known: {names or 'none (leave out --series)'}")
    return datasets[series]


def outputs(dataset: xr.Dataset, names: Sequence[str], tell: Tell | None = None) -> xr.Dataset:
    """Keep the named outputs and their errors. Without names, keep all outputs with one number for each result.

    The variable ``status`` is not kept. Without names, `tell` receives a message about the outputs that are left out.
    DataError is raised for an unknown name.
    """
    known = [str(name) for name in dataset.data_vars if name != "status"]
    for name in names:
        if name not in known:
            hint = did_you_mean(name, known) or f"; known: {', '.join(known)}"
            raise DataError(f"no output {name!r} in this study{hint}")
    of_cases = set(dataset["status"].dims)
    kept = list(names) or [name for name in known if set(dataset[name].dims) <= of_cases]
    errors = [dataset[name].attrs.get("ancillary_variables") for name in kept]
    all_errors = {array.attrs.get("ancillary_variables") for array in dataset.data_vars.values()}
    if tell and not names and (others := [name for name in known if name not in {*kept, *all_errors}]):
        tell(f"left out, because they have further dimensions: {', '.join(others)} (name an output to include it)")
    return dataset[list(dict.fromkeys([*kept, *(error for error in errors if error in known)]))]


def _parsed(text: str) -> tuple[str, str]:
    name, equals, wanted = text.partition("=")
    name, wanted = name.strip().replace(".", "_"), wanted.strip()
    if not (equals and name and wanted):
        raise DataError(f"expected {FORM}, got {text!r}")
    return name, wanted


def _varies(dataset: xr.Dataset, name: str) -> bool:
    array = dataset[name] if name in dataset.coords else inner(dataset, name)
    return name in dataset.dims or (array is not None and array.ndim > 0)


def _axis(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return the values of an axis, or the value of a fixed parameter, as a one-dimensional array."""
    from xarray import DataArray

    if name in dataset.dims and name not in dataset.coords:
        return dataset[name].assign_attrs(units="1")
    if (entries := inner(dataset, name)) is not None:
        return entries if entries.ndim else entries.expand_dims("fixed")
    fixed = {key: coord for key, coord in dataset.coords.items() if coord.ndim == 0}
    fixed |= {key: DataArray(word) for key, word in fixed_words(dataset).items()}
    varied = [str(key) for key, coord in dataset.coords.items() if coord.ndim == 1]
    if name in varied:
        return dataset[name]
    if name in fixed:
        only: xr.DataArray = fixed[name].expand_dims("fixed")
        return only
    known = [*varied, *(str(dim) for dim in dataset.dims if dim not in dataset.coords)]
    hint = did_you_mean(name, [*known, *map(str, fixed)])
    raise DataError(f"no axis {name!r} in this study{hint or '; known: ' + ', '.join(known)}")


def _chosen(axis: xr.DataArray, name: str, wanted: str, own: str, tell: Tell) -> NDArray[np.bool_]:
    """Return a mask of the values of an axis that a selection keeps. `own` is the unit for messages."""
    values = axis.to_numpy()
    if values.dtype.kind not in "fiu":
        return _chosen_words([str(value) for value in values.tolist()], name, wanted)
    given = ~np.isnan(values)  # NaN: a value of the axis, such as an indenter, lacks the parameter
    unit = str(axis.attrs.get("units", "1"))
    text = partial(shown, unit=unit, digits=6, written=own)
    chosen, values = np.zeros(values.shape, dtype=bool), values[given]
    kept = np.zeros(values.shape, dtype=bool)
    for least, most in _intervals(wanted, name, unit):
        if least == most:
            found = _nearest(values, least, name, text, tell)
        else:
            slack = SAME * np.abs(values)
            found = (values >= least - slack) & (values <= most + slack)
        if not found.any():
            asked = text(least) if least == most else f"{text(least)} .. {text(most)}"
            raise DataError(f"no {name} {asked}: {_extent(values, text)}")
        kept |= found
    chosen[given] = kept
    return chosen


def _chosen_words(labels: list[str], name: str, wanted: str) -> NDArray[np.bool_]:
    folded = np.array([label.casefold() for label in labels])
    words = [wanted] if wanted.casefold() in folded else _words(wanted)
    for word in words:
        if word.casefold() not in folded:
            only = f": it is {labels[0]!r} everywhere" if len(labels) == 1 else did_you_mean(word, labels)
            raise DataError(f"no {name} {word!r}{only or '; known: ' + ', '.join(labels)}")
    return np.isin(folded, [word.casefold() for word in words])


def _words(text: str) -> list[str]:
    """Split a text at commas, except inside ``[...]`` and ``{...}``."""
    words, depth = [""], 0
    for mark in text:
        depth += (mark in "[{") - (mark in "]}")
        if mark == "," and depth == 0:
            words.append("")
        else:
            words[-1] += mark
    return [word.strip() for word in words]


def _nearest(
    values: NDArray[Any], wanted: float, name: str, text: Callable[[float], str], tell: Tell
) -> NDArray[np.bool_]:
    """Return a mask of the value nearest to a number. For a number outside the range of the axis, select none."""
    distance = np.abs(values - wanted)
    slack = SAME * max(abs(wanted), np.abs(values).max())
    if not values.min() - slack <= wanted <= values.max() + slack:
        return np.zeros(values.shape, dtype=bool)
    nearest = values[np.argmin(distance)]
    if distance.min() > SAME * max(abs(wanted), abs(nearest)):
        tell(f"{name}: {text(wanted)} is not a value of this axis; the nearest value is used: {text(nearest)}")
    return np.asarray(values == nearest)


def _intervals(wanted: str, name: str, unit: str) -> Iterator[tuple[float, float]]:
    """Yield the two ends of every range in a selection.

    A missing end is infinite. For a single value, the two ends are equal.
    """
    pieces = [[end.strip() for end in piece.split("..")] for piece in wanted.split(",")]
    numbers = [end for piece in pieces for end in piece if end]
    bare = [_is_bare(end) for end in numbers]
    if not all(len(piece) <= 2 and any(piece) for piece in pieces):
        raise DataError(f"{name}: expected {FORM}, got {wanted!r}")
    if not all(bare) and any(alone and float(end) != 0 for end, alone in zip(numbers, bare, strict=True)):
        raise DataError(f"{name}: expected a unit after every number or after none, got {wanted!r}")
    for piece in pieces:
        least, most = (_number(end, name, unit) if end else None for end in (piece[0], piece[-1]))
        yield (-np.inf if least is None else least, np.inf if most is None else most)


def _is_bare(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(text: str, name: str, unit: str) -> float:
    try:
        return float(text) if _is_bare(text) else to_si(text, unit)
    except ValueError as error:
        hint = ", and FROM..TO for a range" if ":" in text else ""
        raise DataError(f"{name}: {error}{hint}") from None


def _extent(values: NDArray[Any], text: Callable[[float], str]) -> str:
    """Return a text about the values of an axis, for error messages."""
    if values.size == 1:
        return f"its only value is {text(values[0])}"
    if values.size <= LISTED:
        return f"its values are {', '.join(map(text, values))}"
    return f"its values go from {text(values.min())} to {text(values.max())}"
