"""Whatever a function gives back, as one table of names and values for a record."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from enum import Enum

import numpy as np


def flat(name: str, value: object) -> dict[str, object]:
    """Return the parts of a value under the names of their fields, keys or places."""
    if isinstance(value, Enum):
        return {name: value.name}
    if isinstance(value, Mapping):
        parts = value.items()
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts = [(field.name, getattr(value, field.name)) for field in dataclasses.fields(value)]
    elif isinstance(value, tuple) and hasattr(value, "_fields"):
        parts = zip(value._fields, value, strict=True)
    elif isinstance(value, list | tuple) and not _is_plain(value):
        parts = enumerate(value)
    else:
        return {} if callable(value) else {name: "none" if value is None else value}
    return {key: part for field, each in parts for key, part in flat(f"{name} {field}", each).items()}


def _is_plain(values: list[object] | tuple[object, ...]) -> bool:
    """Tell whether values are one row: all words, or numbers none of which is lost beside another."""
    if values and all(isinstance(each, str) for each in values):
        return True
    if not values or not all(isinstance(each, int | float | np.number) for each in values):
        return False
    sizes = np.abs([each for each in values if each and np.isfinite(each)])
    return bool(sizes.size == 0 or sizes.max() < 1e3 * sizes.min())


def of_result(result) -> dict[str, object]:
    """Return what a model gives back for a block: values, what became of the cases, and what is said of them."""
    said = [f"{case} {position}: {text}" for (case, position), text in sorted(result.messages.items())]
    status = [str(number) for number in result.status.ravel()]
    return {**result.values, "status": status, "messages": said, "solves": result.solves}
