"""List those parameters of a case that are numbers, under the names that they have in a store."""

from __future__ import annotations

from pydantic import BaseModel

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
