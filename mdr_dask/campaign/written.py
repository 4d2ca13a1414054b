"""The units in which a campaign file is written, for tables and figures."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

from mdr_dask.campaign.document import parse
from mdr_dask.campaign.problems import Problems
from mdr_dask.campaign.variation import RANGES
from mdr_dask.units import unit_behind


@lru_cache(maxsize=16)
def written_units(text: str) -> dict[str, str]:
    """Return the unit of every parameter whose values are all written in the same unit.

    Parameters
    ----------
    text : str
        The text of a campaign file; if it cannot be read, no units are returned.

    Returns
    -------
    dict of str to str
        Units by the name of the parameter's coordinate: ``{"rotation_speed": "rpm", "indenter_radius": "mm"}``.
    """
    whole = parse(text, "", Problems()).data
    data = whole if isinstance(whole, dict) else {}
    series = data.get("series")
    found: dict[str, set[str]] = {}
    for parameters in (data.get("parameters"), *(series.values() if isinstance(series, dict) else ())):
        for name, unit in _below("", parameters):
            found.setdefault(name, set()).add(unit)
    return {name: unit for name, (unit, *others) in found.items() if not others}


def _below(name: str, value: Any) -> Iterator[tuple[str, str]]:
    """Yield parameter and unit of every quantity; lists and ranges belong to the parameter that they vary."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _below(name if key in RANGES else f"{name}_{key}".strip("_"), inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _below(name, inner)
    elif isinstance(value, str) and (unit := unit_behind(value)):
        yield name, unit
