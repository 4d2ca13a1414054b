"""Read a table of measured points: columns with conditions of a study, and a column with an output of the study."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask import models
from mdr_dask.arrays import SAME, BoolArray, FloatArray
from mdr_dask.campaign.definition import Series
from mdr_dask.campaign.document import LARGEST
from mdr_dask.errors import DataError
from mdr_dask.headings import Column, factors, fits, match, nearest, plain
from mdr_dask.models.data_file import DataFile
from mdr_dask.models.numbers import numbers_of
from mdr_dask.tables import AGREE, Line, Read, Sheet, further, listed, matched, read_columns, read_sheet
from mdr_dask.units import shown

ERROR = "standard_error"
#: Names of errors in a heading, such as ``std``. They stand alone, or before or after the name of an output.
_ERROR = re.compile(
    r"(?<!\w)(?:(?:std?|standard)? ?(?:dev|deviation|err|error|abw|abweichung|fehler)|uncertainty|std|sd|sem?)(?!\w)"
    r"|[σ±]|\+ ?/?"
)
#: The reason why the fit refuses a table with errors that are zero.
ZERO = "the fit needs standard errors above 0: delete the column of errors, so that the fit estimates them"


@dataclass(frozen=True)
class Measured:
    """Measured points in SI. Each array has the shape (points,).

    `errors` are the standard errors of `values`, or None if the table has no column of errors. `error_column` describes
    this column. The keys of `conditions` are names of coordinates of the store. `remark` names unused columns, and
    counts rows without a number.
    """

    source: str
    output: str
    values: FloatArray
    errors: FloatArray | None
    conditions: Mapping[str, FloatArray]
    lines: tuple[Line, ...]
    error_column: str = ""
    remark: str = ""


def read_measured(
    text: str,
    source: str,
    conditions: Mapping[str, str],
    outputs: Mapping[str, str],
    axes: Mapping[str, ArrayLike] | None = None,
    dims: Mapping[str, Collection[str]] | None = None,
    wanted: Collection[str] = (),
) -> Measured:
    """Read a table of measured points.

    `conditions` and `outputs` map names of possible columns to SI units. `axes` maps the names of the numerical axes of
    the study, and of the coordinates of outputs, to their values. `dims` maps the name of each output of the model to
    the names of the coordinates of this output, such as the radius of a profile. DataError is raised if a column has
    the name of a coordinate that only other outputs have.

    If the table contains several outputs, the output in `wanted` is read. DataError is raised unless exactly one output
    can be read, with at least two points. A heading such as ``temperature`` may be short for ``solid_temperature``, if
    every other name that ends in ``temperature`` has more words. An axis without a column is an unknown parameter.
    DataError is raised if an unused column may contain an unknown parameter, because the column may be misnamed.
    """
    sheet = read_sheet(text, source)
    units = {**outputs, **conditions}
    short = _short_names(units)
    columns = [Column(name, unit, short[name], needed=False) for name, unit in units.items()]
    present = {column.name for column, _, _ in matched(sheet, columns) if column} if sheet.names else set()
    found = [name for name in outputs if name in present]
    found = [name for name in found if name in wanted] or found
    if len(found) != 1:
        hint = "" if found else next(filter(None, (nearest(name, [*outputs]) for name in sheet.names)), "")
        got = f"{' and '.join(found)}: delete all but one" if found else listed(sheet.names) + hint
        what = f"a column with one output of the study ({', '.join(outputs)})"
        raise DataError(f"{source}: expected {what}, got {got}")
    output = found[0]
    foreign = {name for each in (dims or {}).values() for name in each}.difference((dims or {}).get(output, ()))
    for name in sheet.names:
        if plain(name) in foreign:
            what = f"column {name!r} is not used, because {output} does not depend on it"
            raise DataError(f"{source}: {what}: give another output, or delete the column")
    axes = {name: values for name, values in (axes or {}).items() if name not in foreign}
    kept = present.union(axes).difference(foreign, [output])
    columns = [column for column in columns if column.name in kept]
    columns.append(Column(output, outputs[output], short[output]))
    headings, unit, is_relative = _error_of(sheet, columns)
    unit_of_errors = "1" if is_relative else outputs[output]
    error = Column(ERROR, unit_of_errors, headings, needed=False, least=0.0, given_unit=unit)
    read = read_columns(sheet, [*columns, error], allow_missing=True)
    _require_names(read, source, conditions, axes)
    others = [read.headings[name] for name in outputs if name in read and name != output]
    for name in outputs.keys() - {output}:
        read.pop(name, None)
    if is_relative and ERROR in read:
        read[ERROR] = read[ERROR] * np.abs(read[output])
    not_used = f"outputs of the study, not used: {', '.join(others)}" if others else ""
    read.remark = "; ".join(filter(None, (read.remark, not_used)))
    read.leave_out_incomplete()
    rows = dict(read)
    values, errors = rows.pop(output), rows.pop(ERROR, None)
    if values.size < 2:
        raise DataError(f"{source}: expected at least two measured points, got {values.size}")
    of_errors = f"column {read.headings.get(ERROR, '')!r}{' (in % of the values)' if is_relative else ''}"
    return Measured(source, output, values, errors, rows, read.lines, of_errors, read.remark)


def belonging(values: FloatArray, known: ArrayLike) -> FloatArray:
    """Return the known value nearest to each value, or NaN if the relative difference exceeds `tables.AGREE`.

    For example, a measured value of 49.9 % belongs to the set value of 50 %. A difference that exceeds `tables.AGREE`
    only by rounding is allowed.
    """
    set_values = np.atleast_1d(np.asarray(known, dtype=np.float64))
    near = set_values[np.argmin(np.abs(values[:, None] - set_values), axis=1)]
    return np.where(np.abs(values - near) <= AGREE * (1 + SAME) * np.abs(near), near, np.nan)


def outside(values: FloatArray, known: ArrayLike) -> BoolArray:
    """Return which values lie outside the range of the known values, and do not belong to an end of this range."""
    low, high = np.min(known), np.max(known)
    found: BoolArray = ((values < low) | (values > high)) & np.isnan(belonging(values, [low, high]))
    return found


def scatter(measured: Measured, known: Mapping[str, ArrayLike], units: Mapping[str, str]) -> Iterator[str]:
    """Yield a sentence for each condition with measured values that are near, but not equal to, a known value.

    `units` contains the SI units of the conditions.
    """
    for name, values in known.items():
        rows = measured.conditions[name]
        away = np.abs(rows - (near := belonging(rows, values)))
        count = int(np.count_nonzero(away > SAME * np.abs(near)))
        if count:
            share = 100 * float(np.nanmax(away / np.abs(np.where(near, near, np.nan))))
            most = f"{np.nanmax(away):.2g} K" if units[name] == "K" else f"{share:.2g} %"
            yield (
                f"{count} of {rows.size} points differ in {name} by up to {most} from the nearest value of the "
                "study, and count as points at this value"
            )


def _error_of(sheet: Sheet, columns: Sequence[Column]) -> tuple[tuple[str, ...], str, bool]:
    """Return the headings of columns with errors of the output, the unit of the errors, and whether they are relative.

    The last of `columns` is the output. If no heading of errors states a unit, the unit in the heading of the output is
    returned. If a heading of errors states a unit, the returned unit is empty, because the values are converted with
    the unit of this heading. Errors in percent are relative, unless the output is in percent as well. The heading
    ``std``, which names no quantity, belongs to the nearest known column on its left, or to the output if no known
    column is on its left.
    """
    output, headings, given, before = columns[-1], [], "", None
    for name, unit in zip(sheet.names, sheet.units, strict=True):
        column, _ = match(name, unit, columns)
        before = column or before
        if column is output:
            given = unit
        found = _ERROR.search(plain(name))
        if column or not found:
            continue
        of = plain(name).replace(found[0], "", 1).strip(" ()").removeprefix("of ")
        if output.holds(of) or (not of and before in (output, None)):
            headings.append((name, unit))
    percent = {unit in ("%", "percent") for _, unit in headings}
    return (
        tuple(name for name, _ in headings),
        "" if any(unit for _, unit in headings) else given,
        percent == {True} and given not in ("%", "percent"),
    )


def _short_names(names: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return the short forms of each name, such as ``temperature`` for ``solid_temperature``.

    A short form consists of the last words of a name. If several names end in the same words, the form belongs to
    the name with the fewest words, or to no name if two names have equally few words.
    """
    words = [tuple(name.split("_")) for name in names]
    found: dict[str, tuple[str, ...]] = {"_".join(each): () for each in words}
    for end in {each[start:] for each in words for start in range(1, len(each))}:
        having = sorted((each for each in words if each[-len(end) :] == end), key=len)
        if len(having) == 1 or len(having[0]) < len(having[1]):
            found["_".join(having[0])] += ("_".join(end),)
    return found


def _require_names(read: Read, source: str, units: Mapping[str, str], axes: Mapping[str, ArrayLike]) -> None:
    """Raise DataError if an unused column may contain the values of an axis that has no column.

    A column that states a unit may contain an axis with this dimension. Pure numbers and numbers without a unit may
    contain an axis if they lie in the range of this axis.
    """
    wrong = []
    for axis in [name for name in axes if name not in read]:
        ends = np.asarray(axes[axis], dtype=np.float64)
        low, high = ends.min() - SAME * abs(ends.min()), ends.max() + SAME * abs(ends.max())
        for heading, (unit, numbers) in read.unused.items():
            values = numbers[np.isfinite(numbers)]
            if not values.size or (unit and not fits(unit, Column(axis, units[axis]))):
                continue
            before, factor, zero = factors(unit, units[axis])
            values = before * (values * factor + zero)
            if (unit and units[axis] != "1") or (low <= values.min() and values.max() <= high):
                what = f"column {heading!r} is not used, but may contain {axis!r}, which has no column"
                wrong.append(f"{source}: {what}: rename the column to {axis!r}, or delete the column")
    if wrong:
        raise DataError("\n".join(wrong))


def notes(table: DataFile, model: str, outputs: Sequence[str], series: Sequence[Series]) -> tuple[str, ...]:
    """Return notes on the measured points of each series, such as its unknowns and the rows outside its ranges.

    Raise DataError if the table is too large, or does not fit any series.
    """
    text = table.read_text()
    if len(text) > LARGEST:
        raise DataError(f"{table.name}: expected a table of at most {LARGEST} characters, got {len(text)}")
    found, errors = [], []
    for one in series:
        before = f"measured {table.name}{f', series {one.name}' if one.name else ''}"
        try:
            measured = read_measured(text, table.name, *_of_series(model, outputs, one))
        except DataError as error:
            errors.append(error)
            found.append(f"{before}: no measured points belong to this series")
        else:
            found += [f"{before}: {sentence}" for sentence in _sentences(measured, model, one)]
    if len(errors) == len(series):
        raise errors[0]
    return tuple(found)


def _sentences(found: Measured, model: str, series: Series) -> Iterator[str]:
    conditions, outputs, *_ = _of_series(model, (found.output,), series)
    units = conditions | outputs
    errors = "errors estimated by the fit"
    if found.errors is not None:
        errors = f"{found.error_column} taken as one standard error"
    reach = (shown(float(end), units[found.output]) for end in (found.values.min(), found.values.max()))
    yield f"{found.values.size} rows of {found.output}, {' to '.join(dict.fromkeys(reach))}, {errors}"
    yield f"compared with {found.output}: {models.load(model).output(found.output).long_name}"
    ranges = {
        name: f"{name} {' to '.join(dict.fromkeys(shown(float(end), units[name]) for end in (rows.min(), rows.max())))}"
        for name, rows in found.conditions.items()
    }
    if found.remark:
        yield found.remark
    yield f"conditions {', '.join(ranges.values()) or 'none'}"
    yield f"unknowns {', '.join(_unknown(found, series)) or 'none: every axis is a column of the table'}"
    reach_of = _reach(model, series, found.conditions)
    yield from scatter(found, {name: low for name, (low, high) in reach_of.items() if low == high}, units)
    if found.errors is not None and not found.errors.all():
        yield ZERO
    off = [
        f"{found.lines[row]}, {name} {shown(float(found.conditions[name][row]), units[name])} (study: "
        f"{shown(low, units[name])} to {shown(high, units[name])})"
        for name, (low, high) in reach_of.items()
        for row in np.flatnonzero(outside(found.conditions[name], (low, high)))
    ]
    if off:
        first = off[0] + further(len(off))
        yield f"outside the ranges of the study, so that the fit will refuse the table: {first}"
    else:
        yield "every row lies within the ranges of the study"


def _reach(name: str, series: Series, conditions: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest value of each condition in a series, also of parameters that do not vary."""
    held = {key: (value, value) for key, (value, _, _) in numbers_of(series.parameters).items()}
    coordinates = models.load(name).coordinates(series.parameters)
    held |= {key: (float(each.values.min()), float(each.values.max())) for key, each in coordinates.items()}
    held |= {axis.name: (min(axis.values), max(axis.values)) for axis in series.axes if axis.unit is not None}
    return {key: held[key] for key in conditions}


def _unknown(measured: Measured, series: Series) -> list[str]:
    return [axis.name for axis in series.axes if axis.unit is not None and axis.name not in measured.conditions]


def _of_series(
    name: str, outputs: Sequence[str], series: Series
) -> tuple[dict[str, str], dict[str, str], dict[str, ArrayLike], dict[str, tuple[str, ...]]]:
    """Return the units of conditions and outputs of a series, the values of its axes and coordinates, and the
    coordinates of each output.
    """
    model = models.load(name)
    special = model.units(series.parameters)
    conditions = {key: unit for key, (_, unit, _) in numbers_of(series.parameters).items()}
    coordinates = model.coordinates(series.parameters)
    conditions |= {key: each.unit for key, each in coordinates.items()}
    conditions |= {axis.name: axis.unit for axis in series.axes if axis.unit is not None}
    axes: dict[str, ArrayLike] = {key: each.values for key, each in coordinates.items()}
    axes |= {axis.name: axis.values for axis in series.axes if axis.unit is not None}
    declared = {each.name: each.unit for each in model.outputs if each.name in outputs}
    return (
        {key: special.get(key, unit) for key, unit in conditions.items()},
        {key: special.get(key, unit) for key, unit in declared.items()},
        axes,
        {each.name: each.dims for each in model.outputs},
    )
