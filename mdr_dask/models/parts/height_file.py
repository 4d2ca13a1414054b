"""Heights from files as instruments and people write them: maps and line scans, in text, numpy or an own format."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any, NamedTuple

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.data_file import DataFile
from mdr_dask.tables import Column, read_table
from mdr_dask.units import shown, to_si

if TYPE_CHECKING:
    import pandas as pd

    from mdr_dask.physics.surfaces.maps import SurfaceMap

#: Ends of the names of plain text.
TEXT = (".csv", ".txt", ".dat", ".xyz", ".asc", ".tsv", ".grd", ".prn")
SAME = 1e-3
"""Relative difference up to which two lengths, or the steps between positions, count as equal: files round them."""


class Units(NamedTuple):
    """What a user says of a file: units of heights and of positions, and distances of points, m; empty if unsaid."""

    height: str = ""
    position: str = ""
    spacing: float | None = None
    spacing_y: float | None = None


class Recorded(NamedTuple):
    """A map as it was recorded, NaN where points are missing, and what was done to read it."""

    surface: SurfaceMap
    remarks: tuple[str, ...]


def read_map(file: DataFile, units: Units) -> Recorded:
    """Return the heights of a map.

    What the file says about itself is used. Rows of text and npy run along x, one below the other along y.

    Parameters
    ----------
    file : DataFile
        Text, npy, or any format that SurfaceTopography reads.
    units : Units
        What the file does not say.

    Raises
    ------
    DataError
        If the file holds no map, if a unit or spacing is missing, or if the file says something else than `units`.
    """
    axes: tuple[float, float] | None = None
    remarks: tuple[str, ...] = ()
    if file.name.lower().endswith(".npy"):
        rows = _array(file)
    elif (channel := _channel(file)) is not None:
        if channel.dim != 2:
            raise DataError(f"{file.name}: expected a map, got a line scan: name it by `scan` instead of `map`")
        return _of_channel(file, channel, units)
    else:
        rows, axes, remarks = _grid_of_text(file)
    unsaid = []
    if axes is None and units.spacing is None:
        unsaid.append("its spacing: give `spacing`, such as 1 um")
    if not units.height:
        unsaid.append("the unit of its heights: give `unit`, such as um")
    if axes is not None and not units.position:
        unsaid.append("the unit of its positions: give `x_unit`, such as um")
    if unsaid:
        raise DataError("\n".join(f"{file.name}: does not say {what}" for what in unsaid))
    metre = _metre(file, units.height, "unit")
    if axes is None:
        assert units.spacing is not None
        steps = units.spacing, units.spacing_y or units.spacing
    else:
        position = _metre(file, units.position, "x_unit")
        steps = axes[0] * position, axes[1] * position
        _agree(file, "spacing", units.spacing, steps[0])
        _agree(file, "spacing_y", units.spacing_y, steps[1])
    return _without_codes(rows.T * metre, (rows.shape[1] * steps[0], rows.shape[0] * steps[1]), remarks)


def read_scan(file: DataFile, units: Units) -> tuple[FloatArray, FloatArray]:
    """Return positions and heights of a line scan, m, as they were recorded.

    Parameters
    ----------
    file : DataFile
        Table of x and z, or any format that SurfaceTopography reads.
    units : Units
        What the file does not say.

    Raises
    ------
    DataError
        If the file does not hold a line, or a unit is missing.
    """
    if file.name.lower().endswith(".npy"):
        raise DataError(f"{file.name}: expected a table of x and z, got an array: name it by `map` instead of `scan`")
    channel = _channel(file)
    if channel is None:
        columns = (
            Column("x", "m", ("position", "distance", "length", "X"), given_unit=units.position),
            Column("z", "m", ("height", "h", "y", "profile"), given_unit=units.height),
        )
        table = read_table(file.read_text(), file.name, columns)
        return table["x"], table["z"]
    if channel.dim != 1:
        points = " x ".join(map(str, channel.nb_grid_pts))
        raise DataError(f"{file.name}: expected a line scan, got a map of {points} points: name it by `map`")
    line, metre = _topography(file, channel, units)
    x, z = line.positions_and_heights()
    return x * metre, z * metre


def dimensions(file: DataFile) -> int:
    """Return 2 if a file holds a map, 1 if it holds a line scan or another table of few columns."""
    if file.name.lower().endswith(".npy"):
        return 2
    if (channel := _channel(file)) is not None:
        return int(channel.dim)
    try:
        rows, _, _ = _grid_of_text(file)
    except DataError:
        return 1
    return 2 if rows.shape[1] > 2 else 1


def _metre(file: DataFile, unit: str, option: str) -> float:
    """Return a unit of length in m."""
    try:
        return to_si(f"1 {unit}", "m")
    except ValueError as error:
        raise DataError(f"{file.name}: {option}: {error}") from None


def _agree(file: DataFile, option: str, given: float | None, found: float) -> None:
    """Refuse an option that contradicts the file."""
    if given is not None and abs(given - found) > SAME * found:
        raise DataError(
            f"{file.name}: has a {option} of {shown(found, 'm')}, got {shown(given, 'm')}: leave out `{option}`"
        )


def _channel(file: DataFile) -> Any:
    """Return the main channel of a file as SurfaceTopography finds it, or None if the file is text for our own reader.

    Plain text belongs to our own readers unless it says sizes or units in a way that SurfaceTopography knows.
    """
    file.read_bytes()  # refuses a file that has changed
    is_text = file.name.lower().endswith(TEXT)
    try:
        import SurfaceTopography
    except ImportError:
        if is_text:
            return None
        raise DataError(f"{file.name}: this format needs SurfaceTopography: pip install 'mdr_dask[formats]'") from None
    try:
        channel = SurfaceTopography.open_topography(file.path).default_channel
    except Exception as problem:  # each of its readers raises errors of its own
        if is_text:
            return None
        reason = type(problem).__name__
        raise DataError(f"{file.name}: SurfaceTopography cannot read it: {reason}") from None
    return None if is_text and channel.unit is None else channel


def _topography(file: DataFile, channel: Any, units: Units) -> tuple[Any, float]:
    """Return the map or line of a channel, and its unit of length in m."""
    sizes = channel.physical_sizes
    if channel.unit is not None:
        metre = to_si(f"1 {channel.unit}", "m")
        if units.height and abs(_metre(file, units.height, "unit") - metre) > SAME * metre:
            raise DataError(f"{file.name}: the file says {channel.unit}, got {units.height!r}: leave out `unit`")
    elif not units.height:
        raise DataError(f"{file.name}: does not say its unit: give `unit`, such as um")
    else:
        metre = _metre(file, units.height, "unit")
    if sizes is None:
        if units.spacing is None:
            raise DataError(f"{file.name}: does not say its spacing: give `spacing`, such as 1 um")
        steps = (units.spacing, units.spacing_y or units.spacing)
        sizes = tuple(n * step / metre for n, step in zip(channel.nb_grid_pts, steps, strict=False))
        return channel.topography(physical_sizes=sizes), metre
    for option, given, size, points in zip(
        ("spacing", "spacing_y"), (units.spacing, units.spacing_y), sizes, channel.nb_grid_pts, strict=False
    ):
        _agree(file, option, given, size / points * metre)
    return channel.topography(), metre


def _of_channel(file: DataFile, channel: Any, units: Units) -> Recorded:
    import numpy as np

    surface, metre = _topography(file, channel, units)
    height = np.ma.filled(np.ma.asarray(surface.heights(), dtype=np.float64), np.nan) * metre
    x, y = (length * metre for length in surface.physical_sizes)
    return _without_codes(height, (x, y), ())


def _array(file: DataFile) -> FloatArray:
    """Return the rows of an array of numpy."""
    import numpy as np

    try:
        array: Any = np.load(io.BytesIO(file.read_bytes()), allow_pickle=False)
    except (ValueError, EOFError, OSError) as problem:
        raise DataError(f"{file.name}: expected an array of numpy: {problem}") from None
    if array.dtype.kind not in "iuf":
        raise DataError(f"{file.name}: expected heights, got numbers of the type {array.dtype}")
    if array.ndim != 2:
        raise DataError(f"{file.name}: expected rows and columns of heights, got {array.ndim} dimensions")
    return np.asarray(array, dtype=np.float64)


Grid = tuple[FloatArray, tuple[float, float] | None, tuple[str, ...]]


def _grid_of_text(file: DataFile) -> Grid:
    """Return rows of heights, the steps along x and y where the file has positions, and remarks."""
    lines = file.read_text().splitlines()
    head = lines[0].split() if lines else []
    if head[:1] == ["DSAA"]:
        return _surfer(file, lines)
    if head[:1] and head[0].lower() == "ncols":
        return _esri(file, lines)
    cells, before = _block(file, lines)
    words = cells.size - int(cells.notna().to_numpy().sum())
    remarks = [f"lines before the heights, not used: {before}"] if before else []
    rows = cells.to_numpy(dtype="float64")
    if rows.shape[1] == 3 and rows.shape[0] > rows.shape[1] ** 2:
        return _scattered(file, rows, remarks)
    if words:
        remarks.append(f"cells without a number, taken as missing points: {words}")
    rows, found = _without_positions(rows)
    return rows, None, (*remarks, *found)


def _block(file: DataFile, lines: list[str]) -> tuple[pd.DataFrame, int]:
    """Return the rows of numbers of a text as a table, NaN for words, and how many lines come before them."""
    import pandas as pd

    kept = [line for line in lines if line.strip() and line.lstrip()[0] not in "#%"]
    sample = kept[len(kept) // 2] if kept else ""
    separator = next((mark for mark in "\t;" if mark in sample), None)
    tokens = sample.split()
    if separator is None and "," in sample and (len(tokens) == 1 or tokens[0].endswith(",")):
        separator = ","
    decimal = "," if separator != "," and "," in sample else "."
    number = re.compile(rf"[+-]?(\d+\{decimal}?\d*|\{decimal}\d+)([eE][+-]?\d+)?|[+-]?(nan|inf)", re.IGNORECASE)

    def is_row(line: str) -> bool:
        found = [cell for cell in map(str.strip, line.split(separator)) if cell]
        return bool(found) and 2 * sum(number.fullmatch(cell) is not None for cell in found) > len(found)

    first = next((k for k, line in enumerate(kept) if is_row(line)), len(kept))
    last = next((k for k in range(len(kept) - 1, first - 1, -1) if is_row(kept[k])), first - 1)
    width = [len(line.rstrip(separator).split(separator)) for line in kept[first : last + 1]]
    common = max(set(width), key=width.count, default=0)
    while width and width[0] != common:  # numbers in a preamble
        first, width = first + 1, width[1:]
    try:
        table = pd.read_csv(
            io.StringIO("\n".join(line.rstrip(separator) for line in kept[first : last + 1])),
            sep=separator or r"\s+",
            decimal=decimal,
            header=None,
            names=range(common) if common else None,
            skipinitialspace=True,
            on_bad_lines="error",
            index_col=False,
        )
    except (ValueError, pd.errors.ParserError) as problem:
        raise DataError(f"{file.name}: expected rows of heights of one length: {problem}") from None
    odd = [first + k for k, n in enumerate(width) if n != common]
    if table.empty or odd:
        line = f": line {lines.index(kept[odd[0]]) + 1} has {width[odd[0] - first]}, others {common}" if odd else ""
        raise DataError(f"{file.name}: expected rows of heights of one length{line}")
    return table.apply(pd.to_numeric, errors="coerce"), first


def _surfer(file: DataFile, lines: list[str]) -> Grid:
    """Return the grid of a text of Surfer: DSAA, numbers of points, ranges of x, y and z, rows from the lowest y on."""
    import numpy as np

    try:
        numbers = np.array(" ".join(lines[1:]).split(), dtype=np.float64)
        nx, ny = (int(n) for n in numbers[:2])
        rows = numbers[8:].reshape(ny, nx)
    except ValueError:
        raise DataError(f"{file.name}: expected a grid of Surfer with as many heights as its head says") from None
    steps = (numbers[3] - numbers[2]) / (nx - 1), (numbers[5] - numbers[4]) / (ny - 1)
    return rows, (float(steps[0]), float(steps[1])), ()


def _esri(file: DataFile, lines: list[str]) -> Grid:
    """Return the grid of an ESRI text: names and numbers, then rows from the highest y on."""
    import numpy as np

    head = {
        line.split()[0].lower(): line.split()[-1] for line in lines[:6] if line.strip() and line.strip()[0].isalpha()
    }
    try:
        shape = int(head["nrows"]), int(head["ncols"])
        rows = np.array(" ".join(lines[len(head) :]).split(), dtype=np.float64).reshape(shape)
        step = float(head["cellsize"])
    except (KeyError, ValueError):
        raise DataError(f"{file.name}: expected an ESRI grid with ncols, nrows, cellsize and as many heights") from None
    rows[rows == float(head.get("nodata_value", "nan"))] = np.nan
    return rows[::-1], (step, step), ()


def _scattered(file: DataFile, points: FloatArray, remarks: list[str]) -> Grid:
    """Return the grid of rows x, y, z in any order; points of the grid that have no row are missing."""
    import numpy as np

    places, steps = [], []
    for axis in range(2):
        values = np.unique(points[:, axis])
        gaps = np.diff(values)
        step = float(np.median(gaps[gaps > SAME * gaps.max(initial=0.0)])) if gaps.size else 0.0
        place = np.rint((points[:, axis] - values[0]) / step) if step else points[:, axis]
        if not step or np.max(np.abs(points[:, axis] - values[0] - place * step)) > 0.1 * step:
            raise DataError(f"{file.name}: expected x, y and z on a regular grid")
        places.append(place.astype(int))
        steps.append(step)
    shape = places[1].max() + 1, places[0].max() + 1
    if shape[0] * shape[1] > 4 * len(points):
        raise DataError(f"{file.name}: expected x, y and z on a regular grid")
    rows = np.full(shape, np.nan)
    rows[places[1], places[0]] = points[:, 2]
    return rows, (steps[0], steps[1]), tuple(remarks)


def _without_positions(rows: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Leave out a first row of positions, and a first column of positions or row numbers."""
    remarks = []
    if min(rows.shape) > 3 and _ascends(rows[0, 1:]) and not _ascends(rows[1, 1:]):
        rows = rows[1:]
        remarks.append("the first row holds positions and was left out")
        if _ascends(rows[:, 0]):
            return rows[:, 1:], ("the first row and column hold positions and were left out",)
    if min(rows.shape) > 3 and _ascends(rows[:, 0]) and not _ascends(rows[:, 1]):
        rows = rows[:, 1:]
        remarks.append("the first column holds positions or row numbers and was left out")
    return rows, tuple(remarks)


def _ascends(numbers: FloatArray) -> bool:
    """Return whether numbers rise or fall in equal steps."""
    import numpy as np

    steps = np.diff(numbers)
    return bool(steps.size and steps[0] != 0 and np.all(np.abs(steps - steps.mean()) <= SAME * abs(steps.mean())))


def _without_codes(height: FloatArray, size: tuple[float, float], remarks: tuple[str, ...]) -> Recorded:
    """Return a map whose missing points are NaN also where the file has a code such as 9999 for them.

    A code is the highest or the lowest number, occurs twice or more, and is farther from all other heights than these
    are from each other.
    """
    import numpy as np

    from mdr_dask.physics.surfaces.maps import SurfaceMap

    height = np.array(height, dtype=np.float64)
    height[~np.isfinite(height)] = np.nan
    found = list(remarks)
    while np.any(finite := np.isfinite(height)):
        low, high = float(np.min(height[finite])), float(np.max(height[finite]))
        rest = height[finite & (height > low) & (height < high)]
        if not rest.size:
            break
        least, most = float(rest.min()), float(rest.max())
        codes = [
            code
            for code, distance in ((low, least - low), (high, high - most))
            if distance > most - least and np.count_nonzero(height == code) > 1
        ]
        if not codes:
            break
        for code in codes:
            there = height == code
            found.append(
                f"taken as missing: {np.count_nonzero(there)} points at {shown(code, 'm')}, far from all others"
            )
            height[there] = np.nan
    return Recorded(SurfaceMap(height, size), tuple(found))
