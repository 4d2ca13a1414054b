"""List parameters of a case under the names that they have in a store."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from mdr_dask import models
from mdr_dask.errors import ModelError
from mdr_dask.models.base import Parameters, unit_of
from mdr_dask.models.data_file import DataFile


def numbers_of(parameters: BaseModel, prefix: str = "") -> dict[str, tuple[float, str, str]]:
    """Return the value, unit and meaning of each parameter that is a number, unless another parameter overrides it.

    The name of a nested parameter is its path, joined by ``_``, such as ``indenter_angle``.
    """
    found: dict[str, tuple[float, str, str]] = {}
    idle = parameters.inactive if isinstance(parameters, Parameters) else {}
    for name, field in type(parameters).model_fields.items():
        value = getattr(parameters, name)
        if isinstance(value, BaseModel) and not isinstance(value, DataFile):
            found |= numbers_of(value, f"{prefix}{name}_")
        elif isinstance(value, int | float) and not isinstance(value, bool) and name not in idle:
            found[prefix + name] = (value, unit_of(type(parameters), name) or "1", field.description or "")
    return found


def least_of(name: str) -> dict[str, float]:
    """Return the lower bound of each parameter and coordinate of a model; empty if the model cannot be loaded."""
    try:
        model = models.load(name)
    except ModelError:
        return {}
    fields = model.parameters.model_fields.items()
    bounds = [(key, getattr(each, "ge", getattr(each, "gt", None))) for key, field in fields for each in field.metadata]
    return {key: bound for key, bound in bounds if bound is not None} | dict(model.least)


def entries_of(axis: Mapping[str, Any]) -> dict[tuple[str, ...], list[Any]]:
    """Return the parameters inside the values of a stored axis, such as the radius along an axis of indenters.

    The key is the path of a parameter in the campaign; a value of the axis without this parameter has the entry None.
    """
    path = tuple(axis["path"].split("."))
    each = [dict(_leaves(value, path)) if isinstance(value, dict) else {} for value in axis["values"]]
    return {key: [one.get(key) for one in each] for key in dict.fromkeys(key for one in each for key in one)}


def _leaves(value: Any, path: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(inner, (*path, key))
    elif isinstance(value, str | int | float):
        yield path, value
