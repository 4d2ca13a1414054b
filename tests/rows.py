"""Rows of a record (`record.check`) for a labelled result: every constant beside the ends of its intervals."""

from __future__ import annotations

import numpy as np
import xarray as xr

ENDS = ("_low", "_high", "_low_68", "_high_68", "_error")


def of_dataset(where: str, found: xr.Dataset, told: bool = False, sentences: int = 9) -> dict[str, object]:
    """Return the numbers of a Dataset and what it says; if asked, its dimensions, units, meanings and attributes."""
    names = [str(name) for name in found.data_vars]
    beside = {name + end for name in names for end in ENDS}
    kept: dict[str, object] = {}
    for name in (name for name in names if name not in beside):
        ends = [end for end in ("", *ENDS) if name + end in names]
        values = even(np.stack([found[name + end].values for end in ends]))
        kept[f"{where} {name}{' '.join(ends)}"] = values if values.dtype.kind in "biuf" else values[:sentences]
    if told:
        kept[f"{where}: words"] = [_words(name, array) for name, array in found.variables.items()]
        kept[f"{where}: attributes"] = [f"{name}={value}" for name, value in found.attrs.items()]
    return kept


def even(values: np.ndarray) -> np.ndarray:
    """Return numbers on a scale on which none is lost beside others: logarithms of what spreads over decades."""
    if values.dtype.kind not in "biuf":
        return np.array(list(dict.fromkeys(map(str, values.ravel()))), dtype=object)
    known = values[np.isfinite(values)]
    if known.size and known.min() > 0 and known.max() > 30 * known.min():
        return np.log(values)
    return values


def _words(name: object, array: xr.Variable) -> str:
    return f"{name}({', '.join(map(str, array.dims))}) {', '.join(map(str, array.attrs.values()))}"
