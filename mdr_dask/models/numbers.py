"""Parameters of a case, under the names that the parameters have in a store."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from mdr_dask.models.base import Parameters, unit_of
from mdr_dask.models.data_file import DataFile


def numbers_of(parameters: BaseModel, prefix: str = "") -> dict[str, tuple[float, str, str]]:
    """Return the value, unit and meaning of each parameter that is a number.

    Parameters that another parameter overrides are left out. The nested parameter ``indenter.angle`` is called
    ``indenter_angle``.
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


def entries_of(axis: Mapping[str, Any]) -> dict[tuple[str, ...], list[Any]]:
    """Return the parameters inside the values of a stored axis, such as the radius of each indenter on an axis.

    The keys are the paths of the parameters in the campaign. Each list has one element for each value of the axis: a
    number, a text, or None if the value lacks the parameter. If the values are numbers or texts, the result is empty.
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
