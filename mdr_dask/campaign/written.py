"""Find the units in which the numbers of a campaign file are written, and ask about numbers without a unit."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any

from pydantic import BaseModel

from mdr_dask.campaign import fields
from mdr_dask.campaign.document import Document, parse
from mdr_dask.campaign.problems import Path, Problem, dotted
from mdr_dask.campaign.variation import RANGES
from mdr_dask.models.base import MOST
from mdr_dask.units import likely, unit_behind


@lru_cache(maxsize=16)
def written_units(text: str) -> dict[str, str]:
    """Return `units_in` for the text of a campaign in a store. If the text cannot be read, the result is empty."""
    data = parse(text, "").data
    return units_in(data) if isinstance(data, dict) else {}


def units_in(data: Mapping[str, Any]) -> dict[str, str]:
    """Return the unit in which the values of each parameter are written.

    Values without a unit are ignored. Parameters with several units are left out. The keys are names of coordinates,
    such as ``indenter_radius``.
    """
    series = data.get("series")
    found: dict[str, set[str]] = {}
    for parameters in (data.get("parameters"), *(series.values() if isinstance(series, dict) else ())):
        for field, _, value in _scalars(parameters, (), ()):
            if isinstance(value, str) and (unit := unit_behind(value)):
                found.setdefault("_".join(map(str, field)), set()).add(unit)
    return {name: unit for name, (unit, *others) in found.items() if not others}


def questions(
    document: Document,
    parameters: type[BaseModel],
    data: Mapping[str, Any],
    paths: Mapping[str, Path],
    units: Mapping[str, str],
) -> Iterator[str]:
    """Yield a question for each parameter with a number that has no unit and is perhaps not meant in SI.

    `paths` contains the path of each parameter in the document. `units` maps the dotted name of a
    parameter to its unit, if this unit is not the unit that the model declares.
    """
    asked: set[Path] = set()
    for name, given in data.items():
        for field, at, value in _scalars(given, (name,), paths[name]):
            info = fields.field_at(parameters, field, data)
            is_number = isinstance(value, int | float) and not isinstance(value, bool)
            if info is None or field in asked or not is_number or not abs(value) <= MOST:
                continue
            unit = units.get(dotted(field), fields.unit_at(parameters, field, data) or "1")
            usual = fields.usual(info)
            if usual and document.place(at) not in document.problems and (meant := likely(value, unit, usual)):
                asked.add(field)
                yield str(Problem(document.place(at), dotted(at), _question(value, unit, meant)))


def _question(value: float, unit: str, meant: str) -> str:
    read = f"{value:g} {unit}".removesuffix(" 1")
    return f"{value:g} is read as {read}: write {meant!r} if you mean that, {read!r} if not"


def _scalars(value: Any, field: Path, at: Path) -> Iterator[tuple[Path, Path, Any]]:
    """Yield every number or text, also in lists, with the path of its parameter and its own path in the document."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if key in RANGES and isinstance(inner, list):
                yield from _scalars(inner if key == "values" else inner[:2], field, (*at, key))
            else:
                yield from _scalars(inner, (*field, key), (*at, key))
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from _scalars(inner, field, (*at, index))
    else:
        yield field, at, value
