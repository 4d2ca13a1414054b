"""What was found when somebody last looked: whole results in numbers and words, kept as tables beside the tests.

A record tells that something changed, not that it is right; closed forms, invariants and references tell that. What
is meant to change is taken over by ``pytest --force-regen TESTS``, and read as a difference of text.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pandas as pd

#: Other processors and libraries round otherwise: parts of a value that may differ.
ROUNDING = 1e-5
#: Columns whose unit is the root mean square of the values.
OF_ALL = ("mean", "first", "last", "least", "largest")


def unversioned(text: str) -> str:
    """Return a text without versions of models: what raises one stands elsewhere in a record, or is no matter to it."""
    return re.sub(r'((?:model_)?version"?\W{1,3})\d+', r"\1N", text)


def check(regression, found: Mapping[str, object]) -> None:
    """Compare numbers, arrays and texts with those on record, by `dataframe_regression` of pytest-regressions.

    Of an array counts how many values it has, how many are finite, their weighted root mean square, and in units of
    that the weighted mean, the ends and the extremes: no value can change by itself.
    """
    _compare(regression, _table(found))


def _table(found: Mapping[str, object]) -> pd.DataFrame:
    rows = {name: _row(value) for name, value in found.items()}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("what").reset_index()


def _compare(regression, table: pd.DataFrame, name: str | None = None) -> None:
    tolerances = {column: {"atol": ROUNDING, "rtol": 0.0} for column in OF_ALL}
    regression.check(table, basename=name, default_tolerance={"atol": 0.0, "rtol": ROUNDING}, tolerances=tolerances)


def _row(value: object) -> dict[str, object]:
    values = np.atleast_1d(np.asarray(value)).ravel()
    row: dict[str, object] = {"words": "", "values": values.size, "finite": 0, "rms": 0.0, **dict.fromkeys(OF_ALL, 0.0)}
    if values.dtype.kind not in "biuf":
        return row | {"words": unversioned(" | ".join(map(str, values)))}
    known = np.isfinite(values)
    finite, weights = values[known].astype(float), weights_of(values.size)[known]
    rms = float(np.sqrt(np.average(finite**2, weights=weights))) if finite.size else 0.0
    if rms == 0.0:
        return row | {"finite": finite.size}
    scaled = finite / rms
    ends = (np.average(scaled, weights=weights), scaled[0], scaled[-1], scaled.min(), scaled.max())
    return row | {"finite": finite.size, "rms": rms, **dict(zip(OF_ALL, map(float, ends), strict=True))}


def weights_of(size: int) -> np.ndarray:
    """Return weights about one, each its own: values in each other's place are another mean."""
    return 1.0 + 0.5 * np.sin(1.0 + np.arange(size))


def check_part(regression, name: str, part: str, found: Mapping[str, object]) -> None:
    """Compare what was found of one part of a record that several tests share."""
    path = regression.original_datadir / f"{name}.csv"
    here = _table({f"{part}: {what}": value for what, value in found.items()})
    if path.exists():
        there = pd.read_csv(path, index_col=0, keep_default_na=False)
        of_part = there["what"].str.startswith(f"{part}: ")
        before = there.index < (of_part.idxmax() if of_part.any() else len(there))
        here = pd.concat([there[before], here, there[~before & ~of_part]], ignore_index=True)
    _compare(regression, here, name)
