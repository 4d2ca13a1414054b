"""Cases that do not form a grid, but are drawn from intervals or read from a table."""

from __future__ import annotations

import errno
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mdr_dask.campaign import fields
from mdr_dask.campaign.problems import Place, Problems, dotted
from mdr_dask.campaign.spec import Drawn, LatinHypercubeSpec, SaltelliSpec
from mdr_dask.campaign.variation import Item, Origin, Variation
from mdr_dask.errors import DataError, did_you_mean, similar
from mdr_dask.models.base import Parameters
from mdr_dask.tables import Sheet, decoded, read_sheet

if TYPE_CHECKING:
    from mdr_dask.arrays import FloatArray

_PATH = re.compile(r"[A-Za-z_][\w.]*\Z")
_NOT_A_HEADING = "expected the name of a parameter, perhaps with a unit in brackets, such as velocity [mm/s]"


def drawn(design: Drawn, seed: int, variations: Sequence[Variation]) -> tuple[Variation, ...]:
    """Return the varied parameters, each with one value from its interval for every point of the design."""
    import numpy as np
    from scipy.stats import qmc

    generator = np.random.Generator(np.random.Philox(seed))
    inputs = len(variations)

    def sequence(number: int, dimensions: int) -> FloatArray:
        points: FloatArray = qmc.Sobol(dimensions, seed=generator).random_base2((number - 1).bit_length())[:number]
        return points

    if isinstance(design, LatinHypercubeSpec):
        points = qmc.LatinHypercube(inputs, seed=generator).random(design.latin_hypercube)
    elif isinstance(design, SaltelliSpec):
        points = _exchanged(*np.hsplit(sequence(design.saltelli, 2 * inputs), 2))
    else:
        points = sequence(design.sobol, inputs)
    return tuple(variation.drawn(column) for variation, column in zip(variations, points.T, strict=True))


def _exchanged(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the points of a Saltelli design. `first` and `second` have the shape (points, inputs).

    Each row a of `first` and the row b of `second` with the same index are points of the design. For every input, the
    design also contains a copy of a, in which this input has its value from b.
    """
    import numpy as np

    number, inputs = first.shape
    points: FloatArray = np.repeat(first[:, np.newaxis], inputs + 2, axis=1)
    points[:, 1] = second
    for index in range(inputs):
        points[:, index + 2, index] = second[:, index]
    return points.reshape(number * (inputs + 2), inputs)


def tabled(
    name: str,
    directory: str,
    origin: Origin,
    parameters: type[Parameters],
    data: Mapping[str, Any],
    problems: Problems,
    remarks: list[str],
) -> tuple[Variation, ...] | None:
    """Read the varied parameters from a CSV file: each column is a parameter, and each line is a case.

    `origin` is the position of the file name in the campaign, and `data` contains the parameters outside the table. If
    the table is wrong, its problems are added to `problems`, and the result is None. The names of ignored columns are
    added to `remarks`.
    """
    path = Path(directory, name)
    try:
        if path.exists() and not path.is_file():
            raise OSError(errno.EINVAL, "not a regular file")
        text = decoded(path.read_bytes(), str(path))
        sheet = read_sheet(text, name, lambda heading: heading.split(".")[0] in parameters.model_fields)
    except (OSError, DataError) as error:
        what = f"cannot read {path}: {error.strerror}" if isinstance(error, OSError) else str(error)
        problems.add(origin.place, origin.name, what)
        return None
    indices = range(len(sheet.names))
    unused = [index for index in indices if _is_unused(sheet.names[index], sheet.cells[:, index], parameters)]
    used = [index for index in indices if index not in unused]
    malformed = [index for index in used if not _PATH.match(sheet.names[index])]
    for index in malformed:
        problems.add(Place(name, sheet.head.number), repr(sheet.names[index]), _NOT_A_HEADING)
    if not used:
        problems.add(Place(name, 1), "", _NOT_A_HEADING)
    if malformed or not used:
        return None
    if unused:
        named = [sheet.names[index] for index in unused if sheet.names[index]]
        remarks.append(f"table {name}: not used: {', '.join(named)}")
    columns = [_column(name, sheet, index) for index in used]
    return tuple(columns) if _are_valid(columns, parameters, data, problems) else None


def _is_unused(heading: str, entries: Iterable[str], parameters: type[Parameters]) -> bool:
    """Return whether a column is ignored, because its heading does not begin with the name of a parameter.

    A column with numbers is not ignored if its heading resembles the name of a parameter, so that the mistake is
    reported.
    """
    if heading.split(".")[0] in parameters.model_fields:
        return False
    has_numbers = any(isinstance(_value(entry, ""), int | float) for entry in entries)
    return not (has_numbers and similar(heading, list(parameters.model_fields)))


def _column(name: str, sheet: Sheet, index: int) -> Variation:
    path = tuple(sheet.names[index].split("."))
    items = [
        Item(_value(text, sheet.units[index]), Origin(dotted(path), Place(name, line.number)), text)
        for line, text in zip(sheet.lines, sheet.cells[:, index], strict=True)
    ]
    return Variation(path, Origin(dotted(path), Place(name, sheet.head.number)), tuple(items))


def _value(text: str, unit: str) -> Any:
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            number = kind(text)
        except ValueError:
            continue
        return f"{text} {unit}" if unit else number
    return text or None


def _are_valid(
    columns: Sequence[Variation], parameters: type[Parameters], data: Mapping[str, Any], problems: Problems
) -> bool:
    seen: set[tuple[str, ...]] = set()
    are_valid = True
    for column in columns:
        found = fields.owner(parameters, column.path, data)
        given: Any = data
        for part in column.path:
            given = given.get(part) if isinstance(given, dict) else None
        twice = given is not None or column.path in seen
        if found is None:
            problems.add(column.origin.place, column.origin.name, _unknown(column, parameters))
        elif twice:
            problems.add(
                column.origin.place, column.origin.name, "this parameter is given twice (delete one of the two)"
            )
        are_valid = are_valid and found is not None and not twice
        seen.add(column.path)
    return are_valid


def _unknown(column: Variation, parameters: type[Parameters]) -> str:
    """Return the message about a column that is not a parameter of this campaign."""
    choices = fields.choices(parameters, column.path)
    if choices:
        return f"expected {' or '.join(choices)} in the campaign file"
    return f"no such parameter{did_you_mean(column.origin.name, list(parameters.model_fields))}"
