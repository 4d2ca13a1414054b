"""Answer a question with the rows of a table, or with labelled arrays for files in the formats NetCDF and Zarr.

A large study is read in parts, so the first rows appear quickly.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product, takewhile
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.aggregation import QUANTILES, aggregate
from mdr_dask.errors import DataError
from mdr_dask.models.base import Status
from mdr_dask.questions.columns import COUNTS, REALISATIONS, STATUS, WORDS, Columns, counts, needed
from mdr_dask.questions.expression import parse
from mdr_dask.questions.groups import CASES, averaged
from mdr_dask.questions.selection import Tell, outputs, select, where
from mdr_dask.questions.units import as_written, in_units

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

MEANS = ("mean", "standard_error", "grid_error")
#: Largest number of rows computed together. Chosen by trial: more rows at a time take more memory and are no faster.
ROWS = 2**16


@dataclass(frozen=True)
class Question:
    """A question about a group of a study. If `statistics` is None, the table has one row for each result.

    `where` is a condition on the means of cases or, in a table with one row for each result, on single results. With
    `group_by`, the table has one row for each combination of values of the named axes. `sort` contains columns or
    formulas, with a leading ``-`` for descending order. If `written` is true, axes and parameters are in the units of
    the campaign file, unless `units` contains other units.
    """

    outputs: tuple[str, ...] = ()
    selections: tuple[str, ...] = ()
    where: str = ""
    group_by: tuple[str, ...] = ()
    sort: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    statistics: tuple[str, ...] | None = MEANS
    written: bool = False

    def __post_init__(self) -> None:
        if self.group_by and self.statistics is None:
            raise DataError(
                "expected statistics with --group-by, got single realisations (use only one of --group-by and "
                "--realisations)"
            )


@dataclass(frozen=True)
class Table:
    """A table as a sequence of data frames. The first `keys` columns identify a row.

    `total` is the number of rows, or None if the number is known only after the last frame.
    """

    frames: Iterator[pd.DataFrame]
    units: dict[str, str]
    total: int | None
    keys: int = 1


def table(dataset: xr.Dataset, question: Question, limit: int = 0, tell: Tell = warnings.warn) -> Table:
    """Answer a question about a group of a study. Raise DataError for unknown names.

    The rows of a data frame are computed when the caller reads this frame. `limit` is the number of rows that the
    caller will read, or 0 for all rows. The frames together may have more than `limit` rows.
    """
    maker = _Maker(dataset, question, tell)
    units, keys = maker.first_row()
    if question.sort:
        order = maker.order()
        return Table(maker.picked(order[: limit or None]), units, order.size, keys)
    total = prod(maker.sizes.values())
    if question.where and not question.group_by:
        return Table(maker.frames(ROWS), units, None, keys)
    known = None if maker.may_leave_out else total
    return Table(maker.frames(min(limit, ROWS) or ROWS, whole=not 0 < limit < total), units, known, keys)


def labelled(dataset: xr.Dataset, question: Question, tell: Tell = warnings.warn) -> xr.Dataset:
    """Answer a question with lazy arrays: statistics and ``state_counts``, or single results and their ``status``.

    The values of cases that do not meet the condition are NaN. With `group_by`, such cases are left out of the
    averages.
    """
    if question.sort:
        raise DataError("expected a table (.csv or .json) with --sort, got labelled arrays")
    columns = [name for name in question.columns if name not in dataset.coords]
    shown = outputs(dataset, [*question.outputs, *(name for name in columns if name in dataset.data_vars)], tell)
    used = needed(dataset, [*columns, *(parse(question.where).names if question.where else ())])
    data = select(dataset[list(dict.fromkeys([*shown.data_vars, *used, STATUS]))], question.selections, tell)
    # lazy pieces, each with all realisations of its cases
    data = data.chunk({dim: -1 if dim == "realisation" else "auto" for dim in data.sizes})
    if question.group_by:
        kept = Columns(data).truth(question.where) if question.where else None
        data = averaged(data, question.group_by, kept)
    elif question.where:
        data = where(data, question.where)
    made = Columns(data)
    numbers = {name: made.column(name) for name in columns if name not in data}
    if question.statistics is None:
        found = data[[*shown.data_vars, STATUS]]
    else:
        states = counts(data).assign_coords(state=("state", WORDS)).assign_attrs(units="1")
        found = aggregate(data[[*shown.data_vars]], question.statistics).assign({COUNTS: states})
        found = found.assign({CASES: data[CASES]} if CASES in data else {})
    return in_units(found.assign(numbers), question.units)


class _Maker:
    def __init__(self, dataset: xr.Dataset, question: Question, tell: Tell) -> None:
        raw = question.statistics is None
        texts = [question.where, *question.sort, *question.columns]
        named = [name for text in texts if text for name in parse(text).names]
        shown = outputs(dataset, question.outputs, tell) if question.outputs or not question.columns else dataset[[]]
        errors = {shown[name].attrs.get("ancillary_variables") for name in shown.data_vars}
        self._question, self._raw = question, raw
        self._written = as_written(dataset) if question.written else {}
        self._outputs = [str(name) for name in shown.data_vars if raw or name not in errors]
        used = [name for name in dict.fromkeys([*self._outputs, *needed(dataset, named)]) if name != STATUS]
        wanted = outputs(dataset, used).data_vars if used else ()
        data = select(_numbered(dataset[[*wanted, STATUS]]), question.selections, tell)
        kept = Columns(data).truth(question.where) if question.where and question.group_by else None
        self._data = averaged(data, question.group_by, kept) if question.group_by else data
        own = [str(dim) for dim in self._data.sizes if raw or dim != "realisation"]
        self._dims = [dim for dim in own if dim != "state"]
        self.sizes = {dim: self._data.sizes[dim] for dim in self._dims}

    def first_row(self) -> tuple[dict[str, str], int]:
        """Compute one row, so that errors in the question are raised at once.

        Return the units of the columns, and the number of columns that identify a row.
        """
        rows = self._rows(self._data, dict.fromkeys(self._dims, slice(0, 1)))
        self._kept(rows)
        self._keys(rows)
        keys = sum(1 for _ in takewhile(lambda name: name in rows.coords, self._names(rows)))
        return self._frame(rows)[1], keys

    def frames(self, most: int, whole: bool = True) -> Iterator[pd.DataFrame]:
        """Yield frames in the order of the axes. Each frame has at most `most` or, if `whole`, `ROWS` rows."""
        for _, rows in self._boxes(self._data, most, whole):
            if rows.sizes["row"]:
                yield self._frame(rows)[0]

    def order(self) -> NDArray[np.intp]:
        """Return, for each row of the sorted table, the position of this row among all rows.

        The rows that `where` leaves out are counted too.
        """
        import pandas as pd

        question = self._question
        named = {name for text in (question.where, *question.sort) if text for name in parse(text).names}
        needs = self._data[[*needed(self._data, named), *({STATUS, COUNTS, CASES} & self._data.data_vars.keys())]]
        needs = needs.assign_coords({dim: self._data[dim] for dim in self._dims if dim in self._data.coords})
        found = [(places, *self._keys(rows)) for places, rows in self._boxes(needs, ROWS, whole=True)]
        places, *keys = (np.concatenate(part) for part in zip(*found, strict=True))
        words_by_rank = [pd.factorize(key, sort=True)[0] if key.dtype.kind == "O" else key for key in keys]
        ordered: NDArray[np.intp] = places[np.lexsort(words_by_rank[::-1])]
        return ordered

    def picked(self, places: NDArray[np.intp]) -> Iterator[pd.DataFrame]:
        """Yield frames of the rows at the positions `places`, in the order of `places`."""
        data = self._data.load() if places.size > ROWS else self._data
        for start in range(0, places.size, ROWS):
            along = np.unravel_index(places[start : start + ROWS], tuple(self.sizes.values()))
            at = {dim: ("row", index) for dim, index in zip(self._dims, along, strict=True)}
            yield self._frame(data.isel(at) if at else self._rows(data, {}))[0]

    def _boxes(self, data: xr.Dataset, most: int, whole: bool) -> Iterator[tuple[NDArray[np.intp], xr.Dataset]]:
        """Yield the rows of each box that the table includes: their positions among all rows, and their data."""
        if whole and not data.chunks:
            data = data.load()
        chunks = next((array.encoding.get("chunks") for array in data.data_vars.values()), None) or ()
        before = 0
        for box in boxes(self.sizes, max(most, min(prod(chunks), ROWS) if whole else most), chunks):
            rows = self._rows(data, box)
            kept = np.flatnonzero(self._kept(rows))
            yield before + kept, rows.isel(row=kept)
            before += rows.sizes["row"]

    def _rows(self, data: xr.Dataset, box: Mapping[str, slice]) -> xr.Dataset:
        part = data.isel(dict(box))
        return (part.stack(row=self._dims, create_index=False) if self._dims else part.expand_dims("row")).load()

    @property
    def may_leave_out(self) -> bool:
        """Whether the table may lack cases of the study, because an adaptive axis does not need all cases."""
        adaptive = "adaptive:" in str(self._data.attrs.get("campaign", ""))
        return adaptive and not (self._raw or self._question.group_by)

    def _kept(self, rows: xr.Dataset) -> Any:
        kept = np.ones(rows.sizes["row"], dtype=bool)
        if STATUS in rows and "realisation" in rows[STATUS].dims:
            kept &= ~(rows[STATUS] == Status.NOT_NEEDED).all("realisation").to_numpy()
        if not self._question.where or self._question.group_by:
            return kept
        return kept & np.broadcast_to(Columns(rows).truth(self._question.where).to_numpy(), rows.sizes["row"])

    def _keys(self, rows: xr.Dataset) -> list[Any]:
        columns = Columns(rows)
        values = [np.asarray(columns.evaluate(text).array) for text in self._question.sort]
        return [np.broadcast_to(value, rows.sizes["row"]) for value in values]

    def _names(self, rows: xr.Dataset) -> list[str]:
        if self._question.columns:
            return list(dict.fromkeys([*self._question.columns, *self._outputs]))
        along = [str(name) for name, coord in rows.coords.items() if coord.dims == ("row",)]
        axes = sorted(along, key=lambda name: self._dims.index(name) if name in self._dims else len(self._dims))
        grouped = [CASES] if self._question.group_by else []
        counted = [REALISATIONS] if rows.sizes.get("realisation", 1) > 1 and not (self._raw or grouped) else []
        return [*axes, *grouped, *self._outputs, *counted, STATUS]

    def _frame(self, rows: xr.Dataset) -> tuple[pd.DataFrame, dict[str, str]]:
        """Return rows as a data frame, and the units of its columns."""
        import pandas as pd
        import xarray as xr

        columns, found = Columns(rows), dict[str, xr.DataArray]()
        for name in self._names(rows):
            if name in self._data.data_vars and "realisation" in rows[name].dims and name not in (STATUS, COUNTS):
                error = rows[name].attrs.get("ancillary_variables")
                pair = rows[[name, error] if error in rows else [name]]
                reduced = aggregate(pair, self._question.statistics or ())
                found |= {str(key): array for key, array in reduced.data_vars.items()}
            else:
                found[name] = columns.column(name)
        asked = {name: unit for name, unit in self._written.items() if name in found} | dict(self._question.units)
        wide = in_units(xr.Dataset({}, rows.coords).drop_vars(rows.coords).assign(found), asked)
        flat = {key: value for name in found for key, value in _flattened(wide[name], name).items()}
        units = {key: str(value.attrs.get("units", "1")) for key, value in flat.items()}
        size = rows.sizes["row"]
        return pd.DataFrame({key: np.broadcast_to(value.to_numpy(), size) for key, value in flat.items()}), units


def _numbered(dataset: xr.Dataset) -> xr.Dataset:
    """Assign the values 0, 1, 2, ... to each dimension that has no values, such as the cases of a sampled study."""
    bare = [dim for dim in dataset.dims if dim not in dataset.coords]
    return dataset.assign_coords({dim: np.arange(dataset.sizes[dim]) for dim in bare})


def _flattened(array: xr.DataArray, name: str) -> dict[str, xr.DataArray]:
    """Return the columns for an array: two for an interval, one for each quantile, or the array itself."""
    if "bound" in array.dims:
        return {f"{name.removesuffix('interval')}{end}": array.isel(bound=k) for k, end in enumerate(("low", "high"))}
    if "quantile" in array.dims:
        return {f"{name}_{share:g}": array.isel(quantile=k) for k, share in enumerate(QUANTILES)}
    return {name: array}


def boxes(sizes: Mapping[str, int], most: int, chunks: Sequence[int] = ()) -> Iterator[dict[str, slice]]:
    """Divide a grid into boxes of at most `most` points, and yield them in C order.

    If a box is longer than a chunk along the divided dimension, it ends where a chunk ends.
    """
    dims, inner = list(sizes), 1
    cut = len(dims)
    while cut and inner * sizes[dims[cut - 1]] <= most:
        cut -= 1
        inner *= sizes[dims[cut]]
    if not cut:
        yield {}
        return
    cut -= 1
    step = max(1, most // inner)
    if cut < len(chunks) and step > chunks[cut]:
        step -= step % chunks[cut]
    for place in product(*(range(sizes[dim]) for dim in dims[:cut])):
        for start in range(0, sizes[dims[cut]], step):
            outer = {dim: slice(k, k + 1) for dim, k in zip(dims, place, strict=False)}
            yield outer | {dims[cut]: slice(start, start + step)}
