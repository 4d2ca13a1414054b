"""Tables of curves for master curves: find the columns, and the rows that belong to each curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.headings import JOINED, is_called, nearest
from mdr_dask.models.parts.moduli_table import WAYS, moduli_of
from mdr_dask.tables import AGREE, decoded, further, numbers, read_sheet
from mdr_dask.units import conversion, converts, is_unit

if TYPE_CHECKING:
    from mdr_dask.physics.superposition.master_curve import Vertical

# smallest ratio of a gap between two groups of measured values to a gap within a group, chosen by trial
LEAST_JUMP = 3.0


def read_table(path: str | Path) -> pd.DataFrame:
    """Read a table of numbers below a row of names.

    Columns of words are left out. ``attrs["units"]`` contains the units if the table has a row of units. The index
    contains the place of each row in the file, as the beginning of a message. If the storage or the loss modulus is
    missing, it is added if other columns determine it.
    """
    sheet = read_sheet(decoded(Path(path).read_bytes(), str(path)), str(path))
    if not sheet.names:
        raise DataError(f"{path}: expected names of columns, got numbers")
    values = numbers(sheet)
    names = list(sheet.names)
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise DataError(f"{path}: column {twice!r} is given twice: delete or rename one of the two")
    kept = [k for k, column in enumerate(values.T) if not np.all(np.isnan(column))]  # columns of words are left out
    places = [line.message(str(path), "") for line in sheet.lines]
    table = pd.DataFrame(values[:, kept], columns=[names[k] for k in kept], index=places)
    units = {names[k]: sheet.units[k] for k in kept}
    table.attrs["units"] = units if any(units.values()) else {}
    return _with_moduli(table)


def _with_moduli(table: pd.DataFrame) -> pd.DataFrame:
    """Add a missing storage or loss modulus to a table with columns that determine it, such as tan delta.

    A table that has both moduli, or does not determine them, is returned unchanged.
    """
    names = {name: column_of(table, name) for way in WAYS for name in way}
    way = next((way for way in WAYS if None not in [names[name] for name in way]), WAYS[0])
    if way == WAYS[0]:
        return table
    columns = {name: table[names[name]].to_numpy(dtype=np.float64) for name in way}
    units = table.attrs["units"]
    if "phase angle" in columns:
        unit = units.get(names["phase angle"], "")
        if not converts(unit, "rad"):
            raise DataError(
                f"column {names['phase angle']!r}: expected an angle with its unit, such as deg, got {unit!r}"
            )
        columns["phase angle"] = columns["phase angle"] * conversion(unit, "rad")[0]
    kept, modulus = table.attrs, units.get(names[way[0]], "")
    for name, values in zip(WAYS[0], moduli_of(columns), strict=True):
        if name not in columns:
            table = table.assign(**{name.replace(" ", "_"): values})
            units[name.replace(" ", "_")] = modulus
    table.attrs = {**kept, "sources": [names[name] for name in way]}
    return table


def frame_of(table: xr.Dataset | pd.DataFrame) -> pd.DataFrame:
    """Convert a study into a table of means over realisations, one row for each case. Return a DataFrame unchanged."""
    if isinstance(table, pd.DataFrame):
        return table
    mean = table.mean("realisation", keep_attrs=True) if "realisation" in table.dims else table
    numeric = [name for name in mean.variables if mean[name].dtype.kind in "fiu" and name != "status"]
    frame = mean[[name for name in numeric if name in mean.data_vars]].to_dataframe().reset_index()
    frame.attrs["units"] = {str(name): str(mean[name].attrs.get("units", "1")) for name in numeric}
    return frame


def finite_rows(frame: pd.DataFrame, columns: list[str]) -> tuple[pd.DataFrame, str]:
    """Return the rows with a finite number in every column, and a sentence about omitted rows (or an empty text)."""
    missing = {name: ~np.isfinite(frame[name].to_numpy(dtype=np.float64)) for name in columns}
    anywhere = np.logical_or.reduce(list(missing.values()))
    if not anywhere.any():
        return frame, ""
    where = ", ".join(f"{name!r} in {lines.sum()}" for name, lines in missing.items() if lines.any())
    kept = frame[~anywhere]
    kept.attrs.update(frame.attrs)
    return kept, f"rows without a finite number are left out: {anywhere.sum()} of {anywhere.size} ({where})"


def column_of(frame: pd.DataFrame, wanted: str) -> str | None:
    """Return the column with the wanted name.

    If no column has this name, return the first column whose name is a synonym, perhaps with a unit. Return None if
    there is no such column, or if there are several that do not contain the same quantity.
    """
    columns = [str(name) for name in frame.columns]
    if wanted in columns:
        return wanted
    loose = [each for each in columns if _is(each, wanted)]
    return loose[0] if loose and all(_agree(frame[loose[0]], frame[each]) for each in loose[1:]) else None


def _agree(one: pd.Series, other: pd.Series) -> bool:
    """Return whether two columns may be one quantity in two units: the ratio or the difference is constant."""
    first, second = one.to_numpy(dtype=np.float64), other.to_numpy(dtype=np.float64)
    with np.errstate(all="ignore"):
        return any(np.ptp(each) <= AGREE * abs(np.median(each)) for each in (second / first, second - first))


def _is(column: str, wanted: str) -> bool:
    return column == wanted or is_called(column, wanted) or _joined(column, wanted)


def _joined(column: str, wanted: str) -> bool:
    """Return whether the name of a column consists of the wanted name and a unit, as in ``freq_hz``."""
    front, _, behind = column.rpartition("_")
    unit = JOINED.get(behind.casefold(), behind)
    return bool(front) and is_unit(unit) and is_called(front, wanted)


FAMILIES = (
    ("normal_force", ("friction_coefficient",), "velocity"),
    ("normal_force", ("friction_coefficient",), "temperature"),
    ("frequency", ("storage_modulus", "loss_modulus"), "temperature"),
    ("frequency", ("modulus",), "temperature"),
    ("time", ("modulus",), "temperature"),
    ("frequency", ("compliance",), "temperature"),
    ("time", ("compliance",), "temperature"),
)
"""Each entry names an abscissa, ordinates and a group. `columns_to_use` chooses the first suitable entry."""


def columns_to_use(
    frame: pd.DataFrame, abscissa: str | None, ordinate: str | Sequence[str] | None, group: str | None
) -> tuple[str, tuple[str, ...], str]:
    """Return the names of the columns with the abscissa, the ordinates and the group.

    Columns that are not given are taken from the first of the `FAMILIES` for which two conditions are met: the table
    has all columns, and both the abscissa and the group vary. Raise DataError if no entry meets them.
    """
    wished = None if ordinate is None else (ordinate,) if isinstance(ordinate, str) else tuple(ordinate)
    found = []
    for over, values, by in FAMILIES:
        names = [abscissa or over, group or by, *(wished or values)]
        columns = [column_of(frame, name) for name in names]
        if None not in columns:
            found.append([str(name) for name in columns])
    varied = [names for names in found if all(frame[name].nunique() > 1 for name in names[:2])]
    if found and not varied:
        constant = next(name for name in found[0][1::-1] if frame[name].nunique() < 2)
        raise DataError(f"expected two or more values of {constant!r}, got one value: there are no curves to shift")
    if not found:
        got = [str(name) for name in frame.columns]
        lacking = [name for name in (abscissa, *(wished or ()), group) if name and column_of(frame, name) is None]
        if lacking:
            hints = (f"{name!r}{nearest(name, got)}" for name in lacking)
            raise DataError(f"expected a column {' and a column '.join(hints)}, got {', '.join(got)}")
        names = list(dict.fromkeys(name for over, values, by in FAMILIES for name in (over, *values, by)))
        known = {column_of(frame, name) for name in names}
        hints = (each if each in known else each + nearest(each, names) for each in got)
        raise DataError(
            "expected three columns, such as friction coefficient, velocity and force, or modulus, frequency and "
            f"temperature, got {', '.join(hints)}: name columns by --over, --of and --by"
        )
    over, by, *ordinates = varied[0]
    return over, tuple(ordinates), by


def kind_of(over: str, ordinates: Sequence[str], by: str, units: Mapping[str, str]) -> Vertical:
    """Return which vertical factors suit these columns; columns are recognised by name or unit.

    The kind is ``none`` unless three conditions are met: the abscissa is a time or a frequency; the group is a
    temperature; and the ordinates are all moduli, or all compliances.
    """

    def is_one(column: str, *names: str, unit: str) -> bool:
        return any(_is(column, name) for name in names) or converts(units.get(column, ""), unit)

    dynamic = is_one(over, "frequency", unit="rad/s") or is_one(over, "frequency", unit="Hz")
    if not (is_temperature(by, units.get(by, "")) and (dynamic or is_one(over, "time", unit="s"))):
        return "none"
    if all(is_one(each, "modulus", "storage_modulus", "loss_modulus", unit="Pa") for each in ordinates):
        return "modulus"
    return "compliance" if all(is_one(each, "compliance", unit="1/Pa") for each in ordinates) else "none"


def require_one_group(frame: pd.DataFrame, used: Sequence[str]) -> None:
    """Raise DataError if a column of forces, velocities or temperatures varies although it is not one of `used`.

    In a table of moduli against time or frequency, forces and velocities are readings of the instrument and are
    ignored.
    """
    of_moduli = not any(_is(name, "friction_coefficient") for name in used) and any(
        _is(name, over) for name in used for over in ("frequency", "time")
    )
    for name in ("temperature",) if of_moduli else ("normal_force", "velocity", "temperature"):
        column = column_of(frame, name)
        if column is not None and column not in used and frame[column].nunique() > 1:
            raise DataError(
                f"the table varies in {column!r} too: keep one of its values, group by it, or delete the column if it "
                "only scatters about one value"
            )


def curves_of(
    frame: pd.DataFrame, over: str, ordinates: Sequence[str], by: str
) -> tuple[FloatArray, list[tuple[FloatArray, FloatArray]]]:
    """Return the value of `by` for each curve, and the points of each curve as log10(abscissa) and log10(ordinates)."""
    names = [over, *ordinates]
    rows = frame[names].to_numpy(dtype=np.float64)
    if rows.size == 0:
        raise DataError(f"expected numbers in the columns {', '.join(names)}, got none")
    wrong = np.argwhere(rows <= 0)
    if wrong.size:
        row, column = wrong[0]
        place = frame.index[row] if isinstance(frame.index[row], str) else f"row {frame.index[row]}: "
        raise DataError(
            f"{place}{names[column]!r} must be positive, because curves are shifted along logarithmic axes, got "
            f"{rows[row, column]:g}{further(len({*wrong[:, 0]}))}"
        )
    groups = frame[by].to_numpy(dtype=np.float64)
    labels = clusters(groups, rows[:, 0])
    parts = [labels == label for label in np.unique(labels)]
    centres = np.array([np.median(groups[part]) for part in parts])
    return centres, [(np.log10(rows[part, 0]), np.log10(rows[part, 1:].T)) for part in parts]


def clusters(values: FloatArray, abscissa: FloatArray | None = None) -> NDArray[np.intp]:
    """Return the index of the nominal value of each measured value; measured values scatter about nominal values.

    The sorted values are divided at the wide gaps. If the gaps are nearly equal, or if there are fewer than three
    distinct values, each distinct value is a group of its own. The same holds if values are repeated: each at least
    twice, or three times on average. But repeated values that are close to each other form one group, as rounded
    readings of one nominal value, if they alternate and no abscissa occurs twice in a group.
    """
    distinct, place, times = np.unique(values, return_inverse=True, return_counts=True)
    if distinct.size < 3:
        return place
    gaps = np.sort(np.diff(distinct))
    jump = int(np.argmax(gaps[1:] / gaps[:-1]))
    if gaps[jump + 1] < LEAST_JUMP * gaps[jump]:
        return place
    threshold = np.sqrt(gaps[jump] * gaps[jump + 1])
    merged = np.asarray(np.append(0, np.cumsum(np.diff(distinct) > threshold))[place], dtype=np.intp)
    if distinct.size > values.size / 3 and times.min() == 1:
        return merged
    runs = 1 + np.count_nonzero(np.diff(values))
    one_sweep = abscissa is not None and len(set(zip(merged, abscissa, strict=True))) == values.size
    return merged if one_sweep and runs > distinct.size else place


def is_temperature(by: str, unit: str = "") -> bool:
    """Return whether a column contains temperatures, judged by its name or its unit."""
    return _is(by, "temperature") or "temperature" in by.casefold() or converts(unit, "K")
