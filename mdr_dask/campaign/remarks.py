"""Questions about numbers without a unit: they are read in SI, but are far from the usual values in SI."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel

from mdr_dask.campaign import fields
from mdr_dask.campaign.document import Document
from mdr_dask.campaign.problems import Path, Problem, dotted
from mdr_dask.campaign.variation import RANGES
from mdr_dask.units import is_far, likely


@dataclass(frozen=True)
class _Bare:
    """A number without a unit: its parameter, and its position in the file."""

    field: Path
    value: float
    at: Path


def remarks(
    document: Document,
    parameters: type[BaseModel],
    data: Mapping[str, Any],
    paths: Mapping[str, Path],
    units: Mapping[str, str],
) -> Iterator[Problem]:
    """Yield a question for each parameter with a number that has no unit and is far from the usual value.

    Parameters
    ----------
    document : Document
        The campaign file.
    parameters : type
        The parameter set of the model.
    data : mapping
        Values of the parameters as read from the file, by name.
    paths : mapping of str to path
        Path of each parameter in the document.
    units : mapping of str to str
        Units that differ from the declared units of parameters, as in a dimensionless campaign.
    """
    reported: set[Path] = set()
    for name, value in data.items():
        for bare in _bare_numbers((name,), value, paths[name]):
            found = fields.owner(parameters, bare.field, data)
            if found is None or bare.field in reported:
                continue
            unit = units.get(dotted(bare.field), fields.unit_at(parameters, bare.field, data) or "1")
            usual = fields.usual(found[0].model_fields[found[1]])
            if usual and unit != "1" and is_far(bare.value, unit, usual):
                reported.add(bare.field)
                yield Problem(document.place(bare.at), dotted(bare.at), _question(bare.value, unit, usual))


def _question(value: float, unit: str, usual: str) -> str:
    meant = likely(value, unit, usual)
    read = f"{value:g} {unit}"
    if meant:
        return f"{value:g} is read as {read}: write {meant!r} if you mean that, {read!r} if not"
    return f"{value:g} is read as {read}, far from a usual {usual}: write {read!r} if you mean it"


def _bare_numbers(field: Path, value: Any, at: Path) -> Iterator[_Bare]:
    """Yield the numbers in one parameter: its value, the values of a list, the ends of a range, and nested numbers."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        yield _Bare(field, value, at)
    elif isinstance(value, list):
        for index, entry in enumerate(value):
            if not isinstance(entry, dict):
                yield from _bare_numbers(field, entry, (*at, index))
    elif isinstance(value, dict):
        for key, inner in value.items():
            if key in RANGES and isinstance(inner, list):
                yield from _bare_numbers(field, inner if key == "values" else inner[:2], (*at, key))
            else:
                yield from _bare_numbers((*field, key), inner, (*at, key))
