"""Points of a parameter space that are not a grid: drawn from intervals, or read from a table."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from mdr_dask.campaign import fields
from mdr_dask.campaign.problems import Place, Problems, did_you_mean, dotted
from mdr_dask.campaign.spec import LatinHypercubeSpec, SobolSpec
from mdr_dask.campaign.variation import Item, Origin, Variation
from mdr_dask.models.base import Parameters

_HEADING = re.compile(r"\s*(?P<path>[A-Za-z_][\w.]*)\s*(?:\[(?P<unit>[^\]]*)\])?\s*\Z")
_NOT_A_HEADING = "expected the name of a parameter, perhaps with a unit in brackets, such as velocity [mm/s]"


def drawn(design: SobolSpec | LatinHypercubeSpec, seed: int, variations: Sequence[Variation]) -> tuple[Variation, ...]:
    """Draw values for parameters that vary over intervals.

    Parameters
    ----------
    design : SobolSpec or LatinHypercubeSpec
        The design and its number of points. Sobol points keep their order: a larger number adds some and moves none.
    seed : int
        Seed of the scrambling.
    variations : sequence of Variation
        Each with an interval.

    Returns
    -------
    tuple of Variation
        The same, each with one value a point.
    """
    import numpy as np
    from scipy.stats import qmc

    generator = np.random.Generator(np.random.Philox(seed))
    if isinstance(design, SobolSpec):
        number = design.sobol
        points = qmc.Sobol(len(variations), seed=generator).random_base2((number - 1).bit_length())[:number]
    else:
        points = qmc.LatinHypercube(len(variations), seed=generator).random(design.latin_hypercube)
    return tuple(variation.drawn(column) for variation, column in zip(variations, points.T, strict=True))


def tabled(
    name: str,
    directory: str,
    origin: Origin,
    parameters: type[Parameters],
    data: Mapping[str, Any],
    problems: Problems,
) -> tuple[Variation, ...] | None:
    """Return the parameters that vary along the lines of a CSV file, or None if something is wrong with it.

    Parameters
    ----------
    name, directory : str
        The file, relative to the directory.
    origin : Origin
        Where the campaign names it.
    parameters : type
        The parameter set of the model.
    data : mapping
        Plain data of the other parameters.
    problems : Problems
        Receives what is wrong with the file: unknown columns, units, missing cells.
    """
    try:
        text = Path(directory, name).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8"
        problems.add(origin.place, origin.name, f"cannot read {Path(directory, name)}: {reason}")
        return None
    reader = csv.reader(text.splitlines())
    rows = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    if len(rows) < 2:
        problems.add(Place(name, 1, 1), "", "expected a line of headings and at least one line of values")
        return None
    headings = [_heading(cell, _place(name, rows[0], index)) for index, cell in enumerate(rows[0][1])]
    malformed = [(place, _NOT_A_HEADING) for path, _, place in headings if not path]
    malformed += [(Place(name, line, 1), f"expected {len(headings)} values as in line {rows[0][0]}, got {len(row)}")
                  for line, row in rows[1:] if len(row) != len(headings)]  # fmt: skip
    for place, what in malformed:
        problems.add(place, "", what)
    if malformed:
        return None
    columns = [
        Variation(path, Origin(dotted(path), place), tuple(_cell(name, row, index, path, unit) for row in rows[1:]))
        for index, (path, unit, place) in enumerate(headings)
    ]
    return tuple(columns) if _are_sound(columns, parameters, data, problems) else None


def _heading(cell: str, place: Place) -> tuple[tuple[str, ...], str, Place]:
    match = _HEADING.match(cell)
    return (tuple(match["path"].split(".")), (match["unit"] or "").strip(), place) if match else ((), "", place)


def _place(name: str, row: tuple[int, list[str]], index: int) -> Place:
    return Place(name, row[0], 1 + sum(len(cell) + 1 for cell in row[1][:index]))


def _cell(name: str, row: tuple[int, list[str]], index: int, path: tuple[str, ...], unit: str) -> Item:
    text = row[1][index].strip()
    return Item(_value(text, unit), text, Origin(dotted(path), _place(name, row, index)))


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


def _are_sound(
    columns: Sequence[Variation], parameters: type[Parameters], data: Mapping[str, Any], problems: Problems
) -> bool:
    seen: set[tuple[str, ...]] = set()
    sound = True
    for column in columns:
        found = fields.owner(parameters, column.path, data)
        given: Any = data
        for part in column.path:
            given = given.get(part) if isinstance(given, dict) else None
        twice = given is not None or column.path in seen
        if found is None:
            hint = did_you_mean(column.origin.name, list(parameters.model_fields))
            problems.add(column.origin.place, column.origin.name, f"no such parameter{hint}")
        elif twice:
            problems.add(column.origin.place, column.origin.name, "given twice (remove it from one of the two places)")
        sound = sound and found is not None and not twice
        seen.add(column.path)
    return sound
