"""The columns of a study by name: axes, parameters, outputs, dimensionless numbers, and the state of results."""

from __future__ import annotations

import json
from collections.abc import Iterable
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mdr_dask import models
from mdr_dask.aggregation import mean
from mdr_dask.errors import DataError, ModelError
from mdr_dask.models.base import Number, Status
from mdr_dask.questions.expression import Column, Value, evaluate, parse

if TYPE_CHECKING:
    import xarray as xr

#: Names of the columns with the state of the results of a row, and with the number of its finished results.
STATUS, REALISATIONS = "status", "realisations"
#: Name of the variable with the number of results in each state, for rows that combine several cases.
COUNTS = "state_counts"
#: States of results that need no further work.
COMPLETE = (Status.DONE, Status.NOT_NEEDED)
WORDS = np.array([state.name.lower() for state in Status], dtype=object)


def numbers(dataset: xr.Dataset) -> dict[str, Number]:
    """Return the dimensionless numbers of the model of a study by name; none if the model cannot be loaded."""
    try:
        return {number.name: number for number in models.load(str(dataset.attrs.get("model"))).numbers}
    except ModelError:
        return {}


def fixed_words(dataset: xr.Dataset) -> dict[str, str]:
    """Return the fixed parameters whose value is a word, by name; nested names are joined by ``_``."""
    import pandas as pd

    flat = pd.json_normalize(_parameters(dataset.attrs.get("parameters", "{}")), sep="_")
    words = {str(name): str(value) for name, (value,) in flat.items() if isinstance(value, str | bool)}
    return {name: word for name, word in words.items() if name not in dataset.coords}


@lru_cache(maxsize=16)
def _parameters(text: str) -> dict[str, object]:
    found: dict[str, object] = json.loads(text)
    return found


class Columns:
    """The columns of a part of a study; each column is computed once.

    Parameters
    ----------
    dataset : Dataset
        A group of a study in any shape: as a grid, or with a dimension ``row``.
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self.dataset = dataset
        self._numbers, self._words = numbers(dataset), fixed_words(dataset)
        self._found: dict[str, Column | None] = {}

    @property
    def known(self) -> list[str]:
        """Names of all columns, for hints in messages."""
        data = self.dataset
        return [*map(str, data.data_vars), *map(str, data.coords), *self._numbers, REALISATIONS]

    def find(self, name: str) -> Column | None:
        """Return the values of a column (for an output, its mean over realisations); None if the name is unknown."""
        if name not in self._found:
            self._found[name] = None  # ends the recursion of a formula that refers to itself
            self._found[name] = self._make(name)
        return self._found[name]

    def column(self, name: str) -> xr.DataArray:
        """Return a column with its unit.

        Raises
        ------
        DataError
            If there is no such column, or the study lacks a quantity in the formula of the column.
        """
        from xarray import DataArray

        found = self.find(name)
        if found is None:
            raise self.unknown(name)
        array = found.array if isinstance(found.array, DataArray) else DataArray(found.array)
        if name in self._numbers and name not in self.dataset:
            return array.assign_attrs(units="1", long_name=self._numbers[name].meaning)
        if name in self.dataset and name != STATUS:
            return array.assign_attrs(self.dataset[name].attrs)
        return array

    def unknown(self, name: str) -> DataError:
        """Return the error for an unknown column, or for a number whose formula needs a missing quantity."""
        from mdr_dask.errors import did_you_mean

        if name in self._numbers:
            needed = parse(self._numbers[name].formula).names
            missing = ", ".join(sorted(each for each in needed if self.find(each) is None))
            return DataError(f"{name} is {self._numbers[name].formula}: the study lacks {missing}")
        hint = did_you_mean(name, self.known) or f"; known: {', '.join(self.known)}"
        return DataError(f"no column {name!r}{hint}")

    def evaluate(self, text: str) -> Value:
        """Return the value of a condition or a formula."""
        expression = parse(text)
        for name in expression.names & self._numbers.keys():
            if self.find(name) is None:
                raise self.unknown(name)
        return evaluate(expression, self.find, self.known)

    def truth(self, condition: str) -> xr.DataArray:
        """Return the truth values of a condition."""
        from xarray import DataArray

        array = self.evaluate(condition).array
        found = array if isinstance(array, DataArray) else DataArray(array)
        if found.dtype != bool:
            raise DataError(f"{condition!r}: expected a comparison such as 'hurst < 0.7'")
        return found

    def _make(self, name: str) -> Column | None:
        data = self.dataset
        if name == STATUS:
            return Column(states(data), None)
        if name == REALISATIONS:
            return Column(counts(data).isel(state=Status.DONE), "1")
        if name in data.data_vars:
            array = data[name]
            return Column(mean(array) if "realisation" in array.dims else array, _unit(array))
        if name in data.coords and name != COUNTS:
            return Column(data[name], _unit(data[name]))
        if name in self._words:
            return Column(self._words[name], None)
        if name in self._numbers:
            expression = parse(self._numbers[name].formula)
            if all(self.find(each) is not None for each in expression.names):
                return Column(evaluate(expression, self.find).array, "1")
        return None


def _unit(array: xr.DataArray) -> str | None:
    return str(array.attrs.get("units", "1")) if array.dtype.kind in "fiu" else None


def needed(dataset: xr.Dataset, names: Iterable[str]) -> list[str]:
    """Return the outputs that columns need, including those in the formulas of dimensionless numbers."""
    known, found = numbers(dataset), []
    for name in names:
        if name in dataset.data_vars:
            found.append(name)
        elif name in known and name not in dataset.coords:
            found += needed(dataset, parse(known[name].formula).names)
    return list(dict.fromkeys(found))


def counts(dataset: xr.Dataset) -> xr.DataArray:
    """Return for every row the number of results in each state, along the dimension ``state``."""
    import xarray as xr

    if COUNTS in dataset:
        return dataset[COUNTS]
    status = dataset[STATUS]
    each = [(status == state).sum("realisation" if "realisation" in status.dims else ()) for state in Status]
    return xr.concat(each, "state", coords="minimal", compat="override")


def states(dataset: xr.Dataset) -> xr.DataArray:
    """Return the state of every row as text: ``failed`` for one result, ``2 failed, 1 missing`` for several."""
    from xarray import DataArray

    if STATUS in dataset and "realisation" not in dataset[STATUS].dims:
        status = dataset[STATUS]
        return status.copy(data=WORDS[status.to_numpy()]).drop_attrs()
    number = counts(dataset)
    kinds, of = np.unique(
        number.transpose(..., "state").to_numpy().reshape(-1, len(Status)), axis=0, return_inverse=True
    )
    words = np.array([_described(kind) for kind in kinds], dtype=object)[of.ravel()]
    like = number.isel(state=0, drop=True)
    return DataArray(words.reshape(like.shape), like.coords, like.dims)


def _described(kind: np.ndarray) -> str:
    parts = [f"{count} {WORDS[state]}" for state, count in enumerate(kind) if count and state not in COMPLETE]
    return ", ".join(parts) or str(WORDS[Status.DONE])
