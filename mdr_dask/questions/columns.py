"""The columns of a study, found by name: axes, parameters, outputs, dimensionless numbers, and the state of results."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from functools import lru_cache, reduce
from typing import Any

import numpy as np
import xarray as xr

from mdr_dask import models
from mdr_dask.aggregation import mean
from mdr_dask.campaign.fields import unit_at
from mdr_dask.errors import DataError, ModelError, did_you_mean
from mdr_dask.models.base import Number, Status
from mdr_dask.models.numbers import entries_of
from mdr_dask.questions.expression import ALTERNATIVES, Find, Value, evaluate, parse

#: Names of two columns: the state of a row, and the number of results in this row that are done.
STATUS, REALISATIONS = "status", "realisations"
#: Name of the variable with the number of results in each state, in datasets made by `groups.averaged`.
COUNTS = "state_counts"
#: States of results that need no further work.
COMPLETE = (Status.DONE, Status.NOT_NEEDED)
WORDS = np.array([state.name.lower() for state in Status], dtype=object)


def numbers(dataset: xr.Dataset) -> dict[str, Number]:
    """Return the dimensionless numbers of a study's model by name, or ``{}`` if the model cannot be loaded."""
    try:
        return {number.name: number for number in models.load(str(dataset.attrs.get("model"))).numbers}
    except ModelError:
        return {}


def fixed_words(dataset: xr.Dataset) -> dict[str, str]:
    """Return the fixed parameters whose value is a word or a truth value, with ``_`` for dots in their names."""
    import pandas as pd

    flat = pd.json_normalize(_parameters(dataset.attrs.get("parameters", "{}")), sep="_")
    words = {str(name): str(value) for name, (value,) in flat.items() if isinstance(value, str | bool)}
    return {name: word for name, word in words.items() if name not in dataset.coords and inner(dataset, name) is None}


def inner(dataset: xr.Dataset, name: str) -> xr.DataArray | None:
    """Return a parameter nested in the values of an axis, such as ``indenter_radius`` along an axis of indenters.

    Return NaN, or ``-`` for words, where a value of the axis lacks the parameter. Return None if every axis lacks it.
    """
    for axis in dataset.attrs.get("axes", []):
        for path, entries in entries_of(axis).items() if axis["name"] in dataset.coords else ():
            if "_".join(path) == name:
                along, of = dataset[axis["name"]], dict(zip(axis["labels"], entries, strict=True))
                found = [of[str(label)] for label in np.ravel(along.values)]
                is_word = any(isinstance(value, str | bool) for value in entries)
                words = np.array(["-" if value is None else str(value) for value in found], dtype=object)
                array = (words if is_word else np.array(found, dtype=np.float64)).reshape(along.shape)
                attrs = {} if is_word else {"units": _unit(dataset, axis, path)}
                return xr.DataArray(array, along.coords, along.dims, attrs=attrs)
    return None


def _unit(dataset: xr.Dataset, axis: Mapping[str, Any], path: tuple[str, ...]) -> str:
    kind = models.load(str(dataset.attrs.get("model"))).parameters
    above = axis["path"].split(".")[::-1]
    each = (reduce(lambda inside, key: {key: inside}, above, value) for value in axis["values"])
    return next(filter(None, (unit_at(kind, path, data) for data in each)), "1")


@lru_cache(maxsize=16)
def _parameters(text: str) -> dict[str, object]:
    found: dict[str, object] = json.loads(text)
    return found


class Columns:
    """The columns of a part of a study. Each column is computed once."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self.dataset = dataset
        self._numbers, self._words = numbers(dataset), fixed_words(dataset)
        self._found: dict[str, xr.DataArray | None] = {}

    @property
    def known(self) -> list[str]:
        """Names of the columns that error messages may suggest."""
        data = self.dataset
        return [*map(str, data.data_vars), *map(str, data.coords), *self._numbers, REALISATIONS]

    def find(self, name: str) -> xr.DataArray | None:
        """Return a column with its unit, or None if it does not exist. Outputs are averaged over the realisations."""
        if name not in self._found:
            self._found[name] = None  # prevents an infinite recursion if a formula refers to itself
            self._found[name] = self._make(name)
        return self._found[name]

    def column(self, name: str) -> xr.DataArray:
        """Return a column with its unit. Raise DataError if the column is unknown or cannot be computed."""
        found = self.find(name)
        if found is None:
            raise self.unknown(name)
        return found

    def unknown(self, name: str) -> DataError:
        """Return the error for an unknown name, a formula, or a dimensionless number that cannot be computed."""
        if name in self._numbers:
            needed = parse(self._numbers[name].formula).names
            missing = ", ".join(sorted(each for each in needed if self.find(each) is None))
            return DataError(f"{name} = {self._numbers[name].formula}: the study lacks {missing}")
        if not name.isidentifier():
            return DataError(f"expected the name of a column, got {name!r}; formulas are for --where and --sort")
        hint = did_you_mean(name, self.known) or f"; known: {', '.join(self.known)}"
        return DataError(f"no column {name!r}{hint}")

    def evaluate(self, text: str) -> Value:
        """Return the value of a formula."""
        return self._value(text, self.find)

    def _with_states(self, name: str) -> xr.DataArray | None:
        """Return a column for use in a condition, or None if it does not exist.

        The column ``status`` gets several words in each row, so that ``status == failed`` is true for every row with a
        failed result.
        """
        found = self.find(name)
        if name != STATUS or found is None:
            return found
        number = counts(self.dataset)
        words = [found]
        for state in (state for state in Status if state not in COMPLETE):
            there = number.isel(state=state, drop=True).to_numpy() > 0
            words.append(found.copy(data=np.where(there, WORDS[state], "").astype(object)))
        joined: xr.DataArray = xr.concat(words, ALTERNATIVES, coords="minimal", compat="override")
        return joined

    def _value(self, text: str, find: Find) -> Value:
        expression = parse(text)
        for name in expression.names & self._numbers.keys():
            if self.find(name) is None:
                raise self.unknown(name)
        return evaluate(expression, find, self.known)

    def truth(self, condition: str) -> xr.DataArray:
        """Return an array that is true where a condition is met."""
        found = xr.DataArray(self._value(condition, self._with_states).array)
        if found.dtype != bool:
            raise DataError(f"{condition!r}: expected a comparison such as 'hurst < 0.7'")
        return found

    def _make(self, name: str) -> xr.DataArray | None:
        data = self.dataset
        if name == STATUS:
            return states(data)
        if name == REALISATIONS:
            return counts(data).isel(state=Status.DONE)
        if (entries := inner(data, name)) is not None:
            return entries
        if name in data and name != COUNTS:
            array = data[name]
            has_realisations = name in data.data_vars and "realisation" in array.dims
            return mean(array).assign_attrs(array.attrs) if has_realisations else array
        if name in self._words:
            return xr.DataArray(self._words[name])
        if name in self._numbers:
            expression = parse(self._numbers[name].formula)
            if all(self.find(each) is not None for each in expression.names):
                value = xr.DataArray(evaluate(expression, self.find).array)
                return value.assign_attrs(units="1", long_name=self._numbers[name].meaning)
        return None


def needed(dataset: xr.Dataset, names: Iterable[str]) -> list[str]:
    """Return the names of outputs that columns need. A dimensionless number needs the outputs in its formula."""
    known, found = numbers(dataset), []
    for name in names:
        if name in dataset.data_vars:
            found.append(name)
        elif name in known and name not in dataset.coords:
            found += needed(dataset, parse(known[name].formula).names)
    return list(dict.fromkeys(found))


def counts(dataset: xr.Dataset) -> xr.DataArray:
    """Return the number of results of every row in each state, such as failed, along the dimension ``state``."""
    if COUNTS in dataset:
        return dataset[COUNTS]
    status = dataset[STATUS]
    each = [(status == state).sum("realisation" if "realisation" in status.dims else ()) for state in Status]
    return xr.concat(each, "state", coords="minimal", compat="override")


def states(dataset: xr.Dataset) -> xr.DataArray:
    """Return the state of every row as text, such as ``failed`` or, for several results, ``2 failed, 1 missing``.

    For several results, the states done and not needed are not listed. If all results have these states, the text is
    ``done``.
    """
    if STATUS in dataset and "realisation" not in dataset[STATUS].dims:
        status = dataset[STATUS]
        return status.copy(data=WORDS[status.to_numpy()]).drop_attrs()
    number = counts(dataset)
    kinds, of = np.unique(
        number.transpose(..., "state").to_numpy().reshape(-1, len(Status)), axis=0, return_inverse=True
    )
    words = np.array([_described(kind) for kind in kinds], dtype=object)[of.ravel()]
    like = number.isel(state=0, drop=True)
    return xr.DataArray(words.reshape(like.shape), like.coords, like.dims)


def _described(kind: np.ndarray) -> str:
    parts = [f"{count} {WORDS[state]}" for state, count in enumerate(kind) if count and state not in COMPLETE]
    return ", ".join(parts) or str(WORDS[Status.DONE])
