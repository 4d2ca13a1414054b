"""Tables of curves for master curves: which columns they are, and which rows belong to which curve."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.headings import folded, meanings
from mdr_dask.tables import decoded, numbers, read_sheet

ALIASES: dict[str, tuple[str, ...]] = {
    "friction_coefficient": ("coefficient", "coefficient_of_friction", "friction", "mu", "cof"),
    "normal_force": ("force", "load", "f_n", "fn"),
    "velocity": ("v", "speed", "sliding_velocity"),
    "temperature": ("T", "t_c", "t_k", "temp", "material_temperature"),
    "frequency": ("f", "freq", "omega"),
    "time": ("t",),
    "modulus": ("relaxation_modulus", "e_relax", "g_relax", "storage_modulus", "e_stor", "g_stor", "e'", "g'"),
}
"""Names of columns that are understood, beside the names themselves; case does not matter."""

LEAST_JUMP = 3.0  # between gaps within a group of scattered values and gaps between groups


def read_table(path: str | Path) -> pd.DataFrame:
    """Read a table of numbers: one row of names, perhaps a row of units, comments and a byte-order mark tolerated.

    Returns
    -------
    pandas.DataFrame
        Floating-point columns under their own names; ``attrs["units"]`` holds the units found.

    Raises
    ------
    DataError
        If there is no row of names, or an entry is not a number.
    """
    sheet = read_sheet(decoded(Path(path).read_bytes(), str(path)), str(path))
    if not sheet.names:
        raise DataError(f"{path}: expected names of columns, got numbers")
    names = [cell.text for cell in sheet.names]
    if len(set(names)) < len(names):
        raise DataError(f"{path}: expected each name of a column once, got {', '.join(names)!r:.200}")
    table = pd.DataFrame(numbers(sheet), columns=names)
    table.attrs["units"] = dict(zip(names, sheet.units, strict=True)) if any(sheet.units) else {}
    return table


def frame_of(table: xr.Dataset | pd.DataFrame) -> pd.DataFrame:
    """Return a table, or a row for every case of a study with the means over its realisations."""
    if isinstance(table, pd.DataFrame):
        return table
    mean = table.mean("realisation", keep_attrs=True) if "realisation" in table.dims else table
    numeric = [name for name in mean.variables if mean[name].dtype.kind in "fiu" and name != "status"]
    frame = mean[[name for name in numeric if name in mean.data_vars]].to_dataframe().reset_index()
    frame.attrs["units"] = {str(name): str(mean[name].attrs.get("units", "1")) for name in numeric}
    return frame


def finite_rows(frame: pd.DataFrame, columns: list[str]) -> tuple[pd.DataFrame, str]:
    """Return the rows that have a finite number in each of the columns, and a sentence about the others, if any."""
    missing = {name: ~np.isfinite(frame[name].to_numpy(dtype=np.float64)) for name in columns}
    anywhere = np.logical_or.reduce(list(missing.values()))
    if not anywhere.any():
        return frame, ""
    where = ", ".join(f"{name!r} in {lines.sum()}" for name, lines in missing.items() if lines.any())
    kept = frame[~anywhere]
    kept.attrs.update(frame.attrs)
    return kept, f"{anywhere.sum()} of {anywhere.size} rows are left out, which have no finite number: {where}"


def column_of(frame: pd.DataFrame, wanted: str) -> str | None:
    """Return the column of a name or of one of its aliases, as written or else as tables may have it."""
    columns = [str(name) for name in frame.columns]
    names = (wanted, *ALIASES.get(wanted, ()))
    exact = [name for name in names if name in columns]
    loose = [[column for column in columns if folded(name) in meanings(column)] for name in names]
    return (exact + [found[0] for found in loose if len(found) == 1] + [None])[0]


def columns_to_use(frame: pd.DataFrame, *given: str | None) -> tuple[str, str, str]:
    """Return the columns to use: those given, else the first family of which the table has all."""
    families = [
        ("normal_force", "friction_coefficient", "velocity"),
        ("normal_force", "friction_coefficient", "temperature"),
        ("frequency", "modulus", "temperature"),
        ("time", "modulus", "temperature"),
    ]
    found = []
    for family in families:
        names = [
            column_of(frame, name) if wish is None else column_of(frame, wish)
            for wish, name in zip(given, family, strict=True)
        ]
        if None not in names:
            found.append([str(name) for name in names])
    varied = [names for names in found if all(frame[name].nunique() > 1 for name in (names[0], names[2]))]
    if found and not varied:
        constant = next(name for name in (found[0][2], found[0][0]) if frame[name].nunique() < 2)
        raise DataError(
            f"expected curves at two or more values of {constant!r}, got one value: there is nothing to shift"
        )
    if not found:
        wanted = ", ".join(repr(name) for name in given if name is not None) or (
            "a coefficient over force by velocity or temperature, or a modulus over frequency or time by temperature"
        )
        got = [str(name) for name in frame.columns]
        raise DataError(f"expected columns for {wanted}, got {got!r}: name them by --over, --of and --by")
    return varied[0][0], varied[0][1], varied[0][2]


def second_group(frame: pd.DataFrame, used: set[str]) -> str | None:
    """Return what the table varies in beside the columns used, or refuse it if that is no second group."""
    found = None
    for name in ("normal_force", "velocity", "temperature"):
        column = column_of(frame, name)
        if column is not None and column not in used and frame[column].nunique() > 1:
            if found is not None or name == "normal_force":
                raise DataError(f"the table varies in {column!r} too: keep one of its values, or group by it")
            found = column
    return found


def curves_of(
    frame: pd.DataFrame, over: str, values: str, by: str
) -> tuple[FloatArray, list[tuple[FloatArray, FloatArray]]]:
    """Return what the curves are grouped by, and the logarithms to base 10 of every curve's points."""
    rows = frame[[over, values, by]].to_numpy(dtype=np.float64)
    if rows.size == 0 or np.any(rows[:, :2] <= 0):
        raise DataError(f"{over!r} and {values!r} must be positive: curves are shifted along logarithmic axes")
    labels = clusters(rows[:, 2])
    parts = [rows[labels == label] for label in np.unique(labels)]
    centres = np.array([np.median(part[:, 2]) for part in parts])
    return centres, [(np.log10(part[:, 0]), np.log10(part[:, 1])) for part in parts]


def clusters(values: FloatArray) -> NDArray[np.intp]:
    """Return the number of the group of each value.

    Measured values that scatter about a few set ones are split at the largest jump among their gaps. Values that occur
    again, or whose gaps are much alike, are set ones themselves.
    """
    distinct, place, times = np.unique(values, return_inverse=True, return_counts=True)
    if distinct.size <= values.size / 3 or distinct.size < 3 or times.min() > 1:
        return place
    gaps = np.sort(np.diff(distinct))
    jump = int(np.argmax(gaps[1:] / gaps[:-1]))
    if gaps[jump + 1] < LEAST_JUMP * gaps[jump]:
        return place
    threshold = np.sqrt(gaps[jump] * gaps[jump + 1])
    return np.asarray(np.append(0, np.cumsum(np.diff(distinct) > threshold))[place], dtype=np.intp)


def is_temperature(by: str) -> bool:
    """Say whether a column is one of temperatures, by its name."""
    return not meanings(by).isdisjoint(map(folded, ("temperature", *ALIASES["temperature"])))
