"""Answer a question with labelled arrays, for files in the formats NetCDF and Zarr."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from mdr_dask.aggregation import aggregate
from mdr_dask.errors import DataError
from mdr_dask.questions.columns import COUNTS, STATUS, WORDS, Columns, counts, needed
from mdr_dask.questions.expression import parse
from mdr_dask.questions.groups import CASES, averaged
from mdr_dask.questions.selection import Tell, outputs, select, where
from mdr_dask.questions.units import in_units

if TYPE_CHECKING:
    import xarray as xr

    from mdr_dask.questions.table import Question


#: Largest size in bytes of a piece of an array. The pieces are computed in parallel.
PIECE = 2**20


def labelled(dataset: xr.Dataset, question: Question, tell: Tell = warnings.warn) -> xr.Dataset:
    """Answer a question with lazy arrays: statistics and ``state_counts``, or single results and their ``status``.

    The values of cases that do not meet the condition are NaN.
    """
    if question.sort:
        raise DataError("expected a table (.csv or .json) with --sort, got labelled arrays")
    columns = [name for name in question.columns if name not in dataset.coords]
    shown = outputs(dataset, [*question.outputs, *(name for name in columns if name in dataset.data_vars)], tell)
    used = needed(dataset, [*columns, *(parse(question.where).names if question.where else ())])
    data = select(dataset[list(dict.fromkeys([*shown.data_vars, *used, STATUS]))], question.selections, tell)
    data = _in_pieces(data)
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


def _in_pieces(dataset: xr.Dataset) -> xr.Dataset:
    """Divide arrays into small lazy pieces, each with all realisations of its cases."""
    import dask

    with dask.config.set({"array.chunk-size": PIECE}):
        return dataset.chunk({dim: -1 if dim == "realisation" else "auto" for dim in dataset.sizes})
