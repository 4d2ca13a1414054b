"""Maps and line scans of heights, read from text files, from numpy files, and from files of instruments."""

from __future__ import annotations

import io
import math
import re
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.headings import Column, match
from mdr_dask.models.data_file import DataFile
from mdr_dask.models.parts import positions
from mdr_dask.tables import AGREE, numbers, read_columns, read_sheet
from mdr_dask.tables.cells import COMMENT, separator_of, split
from mdr_dask.tables.numerals import decimal_mark, is_number, with_point
from mdr_dask.units import converts, shown, to_si

if TYPE_CHECKING:
    from mdr_dask.physics.surfaces.maps import SurfaceMap

MOST_COLUMNS = 6  # largest number of columns of a table; a text with more columns is a map; chosen by trial
#: File name extensions of text tables and of workbooks.
TEXT = (".csv", ".txt", ".dat", ".xyz", ".asc", ".tsv", ".grd", ".prn", ".xlsx")


class Units(NamedTuple):
    """Unit of the heights, unit of the positions, and the spacings of the points along x and along y.

    The spacings are in m. A unit that is not given is an empty string, and a spacing that is not given is None.
    """

    height: str = ""
    position: str = ""
    spacing: float | None = None
    spacing_y: float | None = None


class Scan(NamedTuple):
    """Positions and heights of a line scan in m, and remarks on how the scan was read."""

    position: FloatArray
    height: FloatArray
    remarks: tuple[str, ...]


class _Grid(NamedTuple):
    """Heights in the unit of a file.

    The rows run along x. The steps of the grid along x and y are in the unit of the positions, or None if the file has
    no positions. `stated` are the units and spacings that the file states.
    """

    rows: FloatArray
    steps: tuple[float | None, float | None] = (None, None)
    stated: Units = Units()
    remarks: tuple[str, ...] = ()


def read_map(file: DataFile, units: Units) -> tuple[SurfaceMap, tuple[str, ...]]:
    """Return the map in a file, and remarks on how the file was read.

    The file is a text, a workbook, an npy file, or a file that SurfaceTopography can read. Each row of a text, workbook
    or npy file contains the heights along x at one y. In a text or workbook, each row may instead contain the
    coordinates x, y and z of one point. A text may also be a grid file of Surfer or ESRI. In the map, missing points
    are NaN. `units` are the units and spacings that the user states.
    """
    from mdr_dask.physics.surfaces.maps import SurfaceMap

    if file.name.lower().endswith(".npy"):
        grid = _without_positions(file, _array(file), Units())
    elif (channel := _channel(file)) is not None:
        grid = _of_channel(file, channel, units)
    else:
        grid = _grid_of_text(file)
    metre, steps_m = _settled(file, grid, units)
    height, remarks = positions.without_codes(grid.rows.T * metre)
    size = height.shape[0] * steps_m[0], height.shape[1] * steps_m[1]
    return SurfaceMap(height, size), (*grid.remarks, *remarks)


def read_scan(file: DataFile, units: Units) -> Scan:
    """Return the line scan in a file. Rows without a position are left out. Missing heights are interpolated.

    The file is a table, or a file that SurfaceTopography can read. `units` are the units and the spacing that the user
    states.
    """
    from mdr_dask.physics.surfaces.maps import require_few_missing

    if file.name.lower().endswith(".npy"):
        raise DataError(f"{file.name}: expected a table of x and z, got an array (write `map` instead of `scan`)")
    channel = _channel(file)
    if channel is None:
        x, z = _line_of_text(file, units)
    elif channel.dim != 1:
        points = " x ".join(map(str, channel.nb_grid_pts))
        raise DataError(
            f"{file.name}: expected a line scan, got a map of {points} points (write `map` instead of `scan`)"
        )
    else:
        line, unit = _topography(file, channel, units)
        metre = _metre(file, unit, "unit")
        x, z = (np.ma.filled(np.ma.asarray(a, dtype=np.float64), np.nan) * metre for a in line.positions_and_heights())
    placed = np.isfinite(x)
    gaps = (f"rows without a position are left out: {np.count_nonzero(~placed)}",) if not placed.all() else ()
    x, (z, codes) = x[placed], positions.without_codes(z[placed])
    remarks = (*gaps, *codes)
    missing = ~np.isfinite(z)
    if missing.any():
        with file.in_errors():
            require_few_missing(missing)
        order = np.argsort(x)
        z[missing] = np.interp(x[missing], x[order][~missing[order]], z[order][~missing[order]])
        remarks = (*remarks, f"missing points interpolated: {np.count_nonzero(missing)}")
    return Scan(x, z, remarks)


def dimensions(file: DataFile) -> int:
    """Return 2 if a file contains a map, and 1 for any other file, such as a line scan."""
    if file.name.lower().endswith(".npy"):
        return 2
    if (channel := _channel(file)) is not None:
        return int(channel.dim)
    lines = file.read_text().replace('"', "").splitlines()
    if _grid_file(file, lines) is not None:
        return 2
    try:
        cells, first = _block(file, lines)
        return 2 if cells.shape[1] > MOST_COLUMNS or _coordinates(file, lines, first, cells) else 1
    except DataError:
        return 1


def _settled(file: DataFile, grid: _Grid, units: Units) -> tuple[float, tuple[float, float]]:
    """Return the unit of the heights in m, such as 1e-6, and the spacings along x and y in m.

    Unit and spacings are taken from the file or from the options of the user. If the unit of the positions is missing
    and the user states the spacing, the unit is taken as the power of ten of a metre that fits the spacing. For
    positions 0, 0.5, 1 ... and a spacing of 0.5 um, the unit is 1e-6 m. Positions 0, 1, 2 ... without a unit are taken
    as indices of points. If there is no spacing along y, the spacing along x is used. Raise DataError if a unit or the
    spacing is missing, or if the file contradicts the user.
    """
    height = _one_unit(file, "unit", grid.stated.height, units.height)
    position = _one_unit(file, "x_unit", grid.stated.position, units.position)
    metre = _metre(file, position, "x_unit") if position else None
    spacings: list[float | None] = []
    for option, step, stated, given in zip(
        ("spacing", "spacing_y"), grid.steps, grid.stated[2:], (units.spacing, units.spacing_y), strict=True
    ):
        length = step * metre if step and metre else None
        user = given or (spacings[0] if spacings and units.spacing and step else None)
        if step and user and not metre and not math.isclose(step, 1.0):
            length = step * 10.0 ** round(math.log10(user / step))
        sources = {"its positions": length, "its heading": stated, f"`{option}`": given}
        known = [(source, length) for source, length in sources.items() if length]
        for source, length in known[1:]:
            if abs(length - known[0][1]) > AGREE * known[0][1]:
                raise DataError(
                    f"{file.name}: the spacing is {shown(known[0][1], 'm')} in {known[0][0]} and "
                    f"{shown(length, 'm')} in {source}: leave out `{option}` or correct the file"
                )
        spacings.append(known[0][1] if known else None)
    missing = []
    if any(grid.steps) and not metre and not units.spacing:
        missing.append("the unit of its positions: give `x_unit`, such as um")
    elif spacings[0] is None:
        missing.append("its spacing: give `spacing`, such as 1 um")
    if not height:
        missing.append("the unit of its heights: give `unit`, such as um")
    if missing:
        raise DataError("\n".join(f"{file.name}: does not state {what}" for what in missing))
    assert spacings[0] is not None
    return _metre(file, height, "unit"), (spacings[0], spacings[1] or spacings[0])


def _one_unit(file: DataFile, option: str, stated: str, given: str) -> str:
    if stated and given and abs(_metre(file, stated, option) / _metre(file, given, option) - 1) > AGREE:
        raise DataError(
            f"{file.name}: the file states the unit {stated}, got {given!r}: leave out `{option}` or correct the file"
        )
    return stated or given


def _metre(file: DataFile, unit: str, option: str) -> float:
    try:
        return to_si(f"1 {unit}", "m")
    except ValueError as error:
        raise DataError(f"{file.name}: {option}: {error}") from None


def _channel(file: DataFile) -> Any:
    """Return the main channel of a file, read by SurfaceTopography. Return None for a text file or a workbook."""
    file.read_bytes()  # raises an error if the file has changed
    import warnings

    not_text = ""
    if file.name.lower().endswith(TEXT):
        try:
            file.read_text()
        except DataError as problem:  # a binary file with a file name extension of text files, such as .dat of Zygo
            not_text = f" ({problem})"
        else:
            return None
    try:
        import SurfaceTopography
    except ImportError:
        raise DataError(f"{file.name}: this format needs SurfaceTopography: pip install 'mdr_dask[formats]'") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # each reader tests whether it can read the file, and may warn
            return SurfaceTopography.open_topography(file.path).default_channel
    except Exception as problem:  # the readers raise errors of many types
        raise DataError(f"{file.name}: SurfaceTopography cannot read it: {type(problem).__name__}{not_text}") from None


def _topography(file: DataFile, channel: Any, units: Units) -> tuple[Any, str]:
    """Return the map or line scan of a channel, and the common unit of heights and positions."""
    stated = channel.unit or ""
    unit = _one_unit(file, "unit", stated, units.height)
    if not unit:
        raise DataError(f"{file.name}: the file does not state its unit: give `unit`, such as um")
    _one_unit(file, "x_unit", unit, units.position)
    if channel.physical_sizes is None:
        if units.spacing is None:
            raise DataError(f"{file.name}: the file does not state its spacing: give `spacing`, such as 1 um")
        steps = (units.spacing, units.spacing_y or units.spacing)
        metre = _metre(file, unit, "unit")
        sizes = tuple(n * step / metre for n, step in zip(channel.nb_grid_pts, steps, strict=False))
        return channel.topography(physical_sizes=sizes), unit
    return channel.topography(), unit


def _of_channel(file: DataFile, channel: Any, units: Units) -> _Grid:
    if channel.dim != 2:
        raise DataError(f"{file.name}: expected a map, got a line scan (write `scan` instead of `map`)")
    surface, unit = _topography(file, channel, units)
    rows = np.ma.filled(np.ma.asarray(surface.heights(), dtype=np.float64), np.nan).T
    steps = tuple(size / points for size, points in zip(surface.physical_sizes, surface.nb_grid_pts, strict=True))
    return _Grid(rows, (float(steps[0]), float(steps[1])), Units(unit, unit))


def _array(file: DataFile) -> FloatArray:
    try:
        array: Any = np.load(io.BytesIO(file.read_bytes()), allow_pickle=False)
    except (ValueError, EOFError, OSError) as problem:
        raise DataError(f"{file.name}: expected a numpy array: {problem}") from None
    if array.dtype.kind not in "iuf":
        raise DataError(f"{file.name}: expected heights, got numbers of the type {array.dtype}")
    if array.ndim != 2:
        raise DataError(f"{file.name}: expected rows and columns of heights, got {array.ndim} dimensions")
    return np.asarray(array, dtype=np.float64)


def _grid_file(file: DataFile, lines: list[str]) -> _Grid | None:
    """Return the heights of a grid file of Surfer or ESRI. Return None for any other text.

    A Surfer text begins with DSAA, the numbers of points, and the ranges of x, y and z. The rows of a Surfer text have
    ascending y. An ESRI text begins with lines such as ``ncols 512``. The rows of an ESRI text have descending y.
    """
    kind = {"dsaa": "Surfer", "ncols": "ESRI"}.get("".join(lines[:1]).casefold().partition(" ")[0].strip())
    if kind is None:
        return None
    try:
        if kind == "Surfer":
            numbers = np.array(" ".join(lines[1:]).split(), dtype=np.float64)
            nx, ny = (int(n) for n in numbers[:2])
            steps = float(numbers[3] - numbers[2]) / (nx - 1), float(numbers[5] - numbers[4]) / (ny - 1)
            return _Grid(numbers[8:].reshape(ny, nx), steps)
        head = {line.split()[0].lower(): line.split()[-1] for line in lines[:6] if line.strip()[:1].isalpha()}
        rows = np.array(" ".join(lines[len(head) :]).split(), dtype=np.float64)
        rows[rows == float(head.get("nodata_value", "nan"))] = np.nan
        steps = float(head.get("dx") or head["cellsize"]), float(head.get("dy") or head["cellsize"])
        return _Grid(rows.reshape(int(head["nrows"]), int(head["ncols"]))[::-1], steps)
    except (KeyError, ValueError, ZeroDivisionError):
        raise DataError(
            f"{file.name}: expected a grid of {kind} with a complete heading, and as many heights as the heading states"
        ) from None


def _grid_of_text(file: DataFile) -> _Grid:
    """Return the heights of a text file, and the units and spacings that the file states."""
    lines = file.read_text().replace('"', "").splitlines()
    if (grid := _grid_file(file, lines)) is not None:
        return grid
    cells, first = _block(file, lines)
    stated = _stated(file, lines[:first], lines[first], cells.shape)
    if cells.shape[1] <= MOST_COLUMNS < len(cells):
        return _scattered(file, lines, first, cells, stated)
    if min(cells.shape) < 3:
        rows, columns = cells.shape
        raise DataError(f"{file.name}: expected a map, got {rows} rows of {columns} heights: write a scan as columns")
    grid = _without_positions(file, cells, stated)
    if words := int(np.count_nonzero(np.isnan(grid.rows))):
        remark = f"cells without a number count as missing points: {words}"
        return grid._replace(remarks=(*grid.remarks, remark))
    return grid


def _without_positions(file: DataFile, rows: FloatArray, stated: Units) -> _Grid:
    with file.in_errors():
        heights, steps, remarks = positions.without_positions(rows)
    return _Grid(heights, steps, stated, remarks)


def _stated(file: DataFile, head: list[str], first: str, shape: tuple[int, int]) -> Units:
    """Return the units and spacings that a file states before its heights.

    A line with a unit or a spacing names a quantity and ends in a unit of length. ``Height [um]`` states the unit of
    the heights. ``Position [mm]``, or the first cell of a table such as ``y [um]``, states the unit of the positions.
    ``Spacing: 2 um`` states a spacing. Gwyddion states the sides of the map instead: ``Width: 10 um`` and
    ``Height: 10 um``. Raise DataError if two lines contradict each other.
    """
    sides = {"width": ("spacing", shape[1]), "height": ("spacing_y", shape[0])}
    corner = re.split(r"[\t;,]", first)[0]
    head = [*head, f"position {corner}"] if re.search(r"[\[(]", corner) else head
    found: dict[str, dict[str, str]] = {}
    for line in head:
        words = [word for word in re.split(r"[\s:=,;()\[\]\"/\\#%]+", line) if word]
        names = {word.rstrip("s") for word in re.findall(r"[a-z]+", line.casefold())}
        if len(words) < 2 or not converts(words[-1], "m"):
            continue
        along, upwards = names & {"x", "y", "lateral", "position", "horizontal"}, names & {"z", "height", "value"}
        number = re.fullmatch(r"[+-]?[\d.]+(e[+-]?\d+)?", words[-2], re.IGNORECASE)
        if number and names & {"spacing", "pitch", "pixel", "step", "dx", "dy", "distance"}:
            key = "spacing_y" if names & {"y", "dy"} and not names & {"x", "dx"} else "spacing"
            found.setdefault(key, {})[f"{words[-2]} {words[-1]}"] = line
        elif number and len(words) == 3 and words[0].casefold() in sides:
            key, points = sides[words[0].casefold()]
            found.setdefault(key, {})[f"{float(words[1]) / points} {words[2]}"] = line
        # a line that names both a position and a height is a row of column names
        elif not number and bool(along) != bool(upwards):
            found.setdefault("position" if along else "height", {})[words[-1]] = line
        elif not number and "unit" in names:
            found.setdefault("height", {})[words[-1]] = line
    for key, values in found.items():
        if len({to_si(f"1 {v}" if key in ("height", "position") else v, "m") for v in values}) > 1:
            lines = " and ".join(repr(line.strip()) for line in values.values())
            raise DataError(f"{file.name}: contradictory lines about {key}: {lines}: remove all but the correct one")
    only = {key: next(iter(values)) for key, values in found.items()}
    spacing, spacing_y = (to_si(only[key], "m") if key in only else None for key in ("spacing", "spacing_y"))
    return Units(only.get("height", ""), only.get("position", ""), spacing, spacing_y)


def _block(file: DataFile, lines: list[str]) -> tuple[FloatArray, int]:
    """Return the numeric rows of a text, and the line index of the first of these rows. Words become NaN.

    The separator and the decimal mark are found as in any table, but pandas converts the numbers, because a map may
    have millions of them.
    """
    import pandas as pd

    kept = [k for k, line in enumerate(lines) if line.strip() and line.lstrip()[0] not in COMMENT]
    separator = separator_of([lines[k] for k in kept[:: 1 + len(kept) // 20]])  # about 20 lines, to save time

    def is_row(k: int) -> bool:
        found = [cell for cell in split(lines[k], separator) if cell]
        return 2 * sum(is_number(cell) or cell.strip("+-").casefold() in ("nan", "inf") for cell in found) > len(found)

    first = next((place for place, k in enumerate(kept) if is_row(k)), 0)
    last = next((place for place, k in reversed([*enumerate(kept)]) if is_row(k)), first)
    rows = [split(lines[k], separator) for k in kept[first : last + 1]]
    if not any(row[-1] for row in rows):  # every line ends in a separator
        rows = [row[:-1] for row in rows]
    width = [len(row) for row in rows]
    common = max(set(width), key=width.count, default=0)
    # skip lines of numbers above the table that have fewer or more columns than the table
    start = next((k for k, count in enumerate(width) if count == common), 0)
    odd = next((k for k in range(start, len(width)) if width[k] != common), None)
    decimal = decimal_mark([cell for row in rows for cell in row if is_number(cell)])
    if not decimal:
        raise DataError(f"{file.name}: expected decimal commas or decimal points, got both")
    if odd is not None:
        where = f"line {kept[first + odd] + 1} has {width[odd]}, others {common} (write nan for a missing point)"
        raise DataError(f"{file.name}: expected the same number of heights in every row: {where}")
    if not rows:
        raise DataError(f"{file.name}: expected the same number of heights in every row, got no rows")
    text = with_point("\n".join(map("\t".join, rows[start:])), decimal)
    table = pd.read_csv(io.StringIO(text), sep="\t", header=None, index_col=False)
    return table.apply(pd.to_numeric, errors="coerce").to_numpy(dtype="float64"), kept[first + start]


#: Columns of a table in which each row is one point of a map.
COORDINATES = (
    Column("x", "m"),
    Column("y", "m", ("Y",)),
    Column("z", "m", ("height",)),
)


def _coordinates(file: DataFile, lines: list[str], first: int, cells: FloatArray) -> tuple[tuple[int, str], ...]:
    """Return the index and the unit of each of the columns x, y and z. Return () if one of these columns is missing.

    If the columns have no names, row numbers are ignored, and three other columns are taken as x, y and z in this
    order. With fewer or more columns, return (). Also return () if the numbers of one of the three columns only rise or
    only fall, because the table is then a line scan.
    """
    try:
        sheet = read_sheet("\n".join(lines[: first + 10]), file.name)
    except DataError:
        sheet = None
    if sheet is not None and sheet.names:
        found: dict[str, tuple[int, str]] = {}
        for place, (name, unit) in enumerate(zip(sheet.names, sheet.units, strict=True)):
            column, written = match(name, unit, COORDINATES)
            if column is not None:
                found.setdefault(column.name, (place, written))
        return tuple(found[name] for name in "xyz") if len(found) == len(COORDINATES) else ()
    places = [k for k in range(cells.shape[1]) if not positions.is_numbered(cells[:, k])]
    has_line = positions.rising(cells[:, places].T).any()
    return tuple((k, "") for k in places) if len(places) == len(COORDINATES) and not has_line else ()


def _scattered(file: DataFile, lines: list[str], first: int, cells: FloatArray, stated: Units) -> _Grid:
    """Return the heights of a table whose rows contain x, y and z.

    The rows can be in any order. A grid point without a row is a missing point.
    """
    columns = _coordinates(file, lines, first, cells)
    if not columns:
        raise DataError(
            f"{file.name}: expected a map, or columns x, y and z, got {cells.shape[1]} columns: name the columns "
            "in a header line above the numbers, such as x [mm], y [mm], z [um]"
        )
    x, y, z = (cells[:, place] for place, _ in columns)
    units = [unit for _, unit in columns]
    if units[0] and units[1]:
        y = y * (_metre(file, units[1], "x_unit") / _metre(file, units[0], "x_unit"))
    try:
        rows, steps = positions.scattered(x, y, z)
    except DataError as problem:
        hint = "" if any(units) else ": without names, the order of the columns must be x, y, z"
        raise DataError(f"{file.name}: {problem}{hint}") from None
    return _Grid(rows, steps, stated._replace(position=units[0] or stated.position, height=units[2] or stated.height))


def _line_of_text(file: DataFile, units: Units) -> tuple[FloatArray, FloatArray]:
    """Return the positions and the heights of a line scan, both in m, from a table.

    If the columns have no names, the column whose numbers only rise or only fall contains the positions. If there are
    row numbers as well, the row numbers are ignored. A single column of numbers contains the heights, unless its name
    is that of the positions. The user must then give the spacing.
    """
    sheet = read_sheet(file.read_text(), file.name)
    columns = (
        Column("x", "m", needed=False, given_unit=units.position),
        Column("z", "m", ("height", "y", "Y", "profile"), given_unit=units.height),
    )
    is_named = any(match(*heading, columns)[0] for heading in zip(sheet.names, sheet.units, strict=False))
    filled = np.flatnonzero(np.any(sheet.cells != "", axis=0))
    if sheet.names and (is_named or filled.size > 1):
        table = read_columns(sheet, columns, allow_missing=True)
        if "x" in table and units.spacing is not None:
            raise DataError(f"{file.name}: the file has positions: leave out `spacing`")
        x, z = table.get("x"), table["z"]
    else:
        rows = numbers(sheet)[:, filled]
        count = rows.shape[1]
        rises = [k for k, one in enumerate(positions.rising(rows.T)) if one]
        along = [] if count == 1 else [k for k in rises if not positions.is_numbered(rows[:, k])] or rises
        across = [0] if count == 1 else [k for k in range(count) if k not in rises]
        if len(across) != 1 or len(along) > 1:
            raise DataError(
                f"{file.name}: expected one column of positions and one of heights, got {count} columns: name the "
                "columns in a header line above the numbers, such as x [mm], z [um]"
            )
        unit = _one_unit(file, "unit", sheet.units[filled[across[0]]], units.height)
        wanted = [("heights", "unit", unit), ("positions", "x_unit", units.position)][: 1 + len(along)]
        missing = [f"unit of its {what}: give `{option}`, such as um" for what, option, found in wanted if not found]
        if missing:
            raise DataError("\n".join(f"{file.name}: does not state the {what}" for what in missing))
        x = rows[:, along[0]] * _metre(file, units.position, "x_unit") if along else None
        z = rows[:, across[0]] * _metre(file, unit, "unit")
    if x is not None:
        return x, z
    if units.spacing is None:
        raise DataError(
            f"{file.name}: expected a column 'x': name the column, or give `spacing`, the distance between points"
        )
    return np.asarray(units.spacing * np.arange(z.size), dtype=np.float64), z
