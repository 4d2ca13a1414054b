"""Read a campaign from a dictionary, whose values may be numpy numbers, pint quantities and paths."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from numbers import Number
from pathlib import PurePath
from typing import Any

import numpy as np

from mdr_dask.campaign.definition import Campaign, tidy
from mdr_dask.campaign.read import loads
from mdr_dask.errors import CampaignError
from mdr_dask.models.base import Model


def of_keys(source: Mapping[str, Any]) -> Campaign:
    """Read a campaign from a dictionary with the keys of a campaign file.

    Without the key ``name``, the campaign is called ``study``. Values may also be paths, Python ranges, pint
    quantities, and arrays and numbers of numpy, pandas or xarray. Numbers of numpy are rounded to 14 digits, so that
    ``np.linspace(a, b, n)`` equals ``{linear: [a, b, n]}``.
    """
    keys = {str(key): _written(str(key), value) for key, value in source.items()}
    try:
        found = loads(json.dumps({"name": "study", **keys}, indent=1), "campaign", ".")
    except CampaignError as error:
        raise CampaignError(*_without_lines(error.args)) from None
    return replace(found, remarks=_without_lines(found.remarks))


def _without_lines(messages: Sequence[str]) -> tuple[str, ...]:
    return tuple(re.sub(r"^campaign:\d+:\d+: ", "", message) for message in messages)


def _written(key: str, value: Any) -> Any:
    try:
        return _plain(value)
    except TypeError as error:
        raise CampaignError(f"{key}: expected numbers, texts, lists and mappings, got {error}") from None


def _plain(value: Any) -> Any:
    """Return a value in a form that JSON can represent."""
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple | range):
        return [_plain(inner) for inner in value]
    if hasattr(value, "magnitude") and hasattr(value, "units"):
        return _quantity(_plain(value.magnitude), f"{value.units:~}")
    if isinstance(value, np.floating):
        # str(np.float32(0.1)) is 0.1, while float(np.float32(0.1)) would be 0.10000000149
        return tidy(float(str(value)), whole=False)
    if isinstance(value, np.generic):
        return value.item()
    array = value if isinstance(value, np.ndarray) else getattr(value, "values", None)
    if isinstance(array, np.ndarray):
        return [_plain(inner) for inner in array] if array.ndim else _plain(array[()])
    if value is None or isinstance(value, str | bool | int | float):
        return value
    if isinstance(value, Number | PurePath):
        return str(value)
    hint = (
        " (write its name, module:NAME; see docs/own-model.md)" if isinstance(value, Model) or callable(value) else ""
    )
    raise TypeError(f"{type(value).__name__}{hint}")


def _quantity(magnitude: Any, unit: str) -> Any:
    return (
        [_quantity(each, unit) for each in magnitude]
        if isinstance(magnitude, list)
        else f"{magnitude!r} {unit}".strip()
    )
