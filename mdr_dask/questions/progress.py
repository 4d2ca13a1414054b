"""The progress of a study: the number of results in each state, and groups of messages that differ only in numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mdr_dask import store
from mdr_dask.models.base import Status
from mdr_dask.questions.units import as_written
from mdr_dask.units import shown

if TYPE_CHECKING:
    import xarray as xr


class Group(NamedTuple):
    """Messages of one series that differ only in their numbers.

    `kind` is the state of the results, or ``warning`` if the results are done. `cases` is a text with the range
    of each varied parameter over the results.
    """

    series: str
    kind: str
    reason: str
    results: int
    cases: str


def counts(url: str) -> list[dict[str, Any]]:
    """Return, for each series, the name, the number of results, and the number of results in each state."""
    found = []
    for name in store.series_names(url):
        status = store.ledger(url, name)
        states = {state.name.lower(): int((status == state).sum()) for state in Status}
        found.append({"series": name or "-", "results": status.size, **states})
    return found


def messages(url: str, series: str, dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the last message about each result of a series. Messages about earlier states are left out."""
    last: dict[tuple[int, ...], dict[str, Any]] = {}
    telling = [record for record in store.records(url, series) if record["messages"]]
    for record in sorted(telling, key=lambda record: record["attempt"]):
        # stores of version 0.1 lack the key "place"
        for message in (each for each in record["messages"] if "place" in each):
            last[tuple(message["place"])] = {"series": series, "attempt": record["attempt"], **message}
    ledger = store.ledger(url, series, dataset["status"].shape)
    inside = [place for place in last if len(place) == ledger.ndim and np.less(place, ledger.shape).all()]
    return [last[place] for place in inside if ledger[place] == Status[last[place]["status"].upper()]]


def grouped(found: Sequence[dict[str, Any]], studies: Mapping[str, xr.Dataset]) -> list[Group]:
    """Group messages that differ only in their numbers. Each warning of a result is a separate message.

    Quantities are converted to the units of the campaign file, as far as `_units` finds these units. The text of the
    campaign file is an attribute of each dataset in `studies`.
    """
    wanted = {name: _units(study) for name, study in studies.items()}
    groups: dict[tuple[str, str, str], list[tuple[str, Any]]] = {}
    for message in found:
        series, status = message["series"], message["status"]
        for text in message["message"].split("; ") if status == "done" else [message["message"]]:
            text = _converted(text, wanted.get(series, {}))
            groups.setdefault((series, status, _NUMBER.sub("#", text)), []).append((text, message["case"]))
    return [
        Group(
            series,
            "warning" if status == "done" else status,
            _merged([text for text, _ in alike]),
            len(alike),
            _cases([case for _, case in alike], studies.get(series)),
        )
        for (series, status, _), alike in groups.items()
    ]


def warnings(found: Sequence[dict[str, Any]]) -> dict[str, int]:
    """Return the number of cases with each warning. Warnings are cut at the colon before the details."""
    groups: dict[str, dict[tuple[Any, ...], str]] = {}
    for message in (each for each in found if each["status"] == "done"):
        for text in dict.fromkeys(text.partition(": ")[0] for text in message["message"].split("; ")):
            groups.setdefault(_NUMBER.sub("#", text), {})[message["series"], *message["place"][:-1]] = text
    return {_merged(list(alike.values())): len(alike) for alike in groups.values()}


#: Numbers and ranges with an SI unit for which campaign files often use another unit.
_QUANTITY = re.compile(
    r"(?<![\w.])(-?[\d.]+(?:e[-+]?\d+)?)((?:,? (?:to|and|or) -?[\d.]+(?:e[-+]?\d+)?)?) (K|rad/s|m/s|m|N|Pa)\b(?!\^)"
)


def _units(study: xr.Dataset) -> dict[str, str]:
    """Map SI units to the units that the campaign file uses instead.

    An SI unit is left out if the campaign file uses several units instead of it. K is mapped to degC if the campaign
    file contains no temperature with a unit.
    """
    found: dict[str, set[str]] = {"K": {"degC"}}
    written = as_written(study)
    for name, unit in written.items():
        found.setdefault(str(study[name].attrs.get("units", "1")), set()).add(unit)
    own = {unit for name, unit in written.items() if str(study[name].attrs.get("units", "1")) == "K"}
    return {unit: min(each) for unit, each in (found | ({"K": own} if own else {})).items() if len(each) == 1}


def _converted(text: str, units: Mapping[str, str]) -> str:
    """Return a message in which every quantity with a unit in `units` is converted to the unit assigned to it."""

    def convert(found: re.Match[str]) -> str:
        first, rest, unit = found.groups()
        if unit not in units:
            return found[0]
        return f"{_in(first, unit, units)}{_NUMBER.sub(lambda number: _in(number[0], unit, units), rest)} {units[unit]}"

    return _QUANTITY.sub(convert, text)


def _in(number: str, unit: str, units: Mapping[str, str]) -> str:
    return shown(float(number), unit, 6, units[unit]).partition(" ")[0]


_NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")


def _merged(texts: Sequence[str]) -> str:
    """Return one text, such as ``a film ratio of 0.2 to 0.4``, for texts that differ only in their numbers."""
    columns = iter(list(zip(*map(_NUMBER.findall, texts), strict=True)))

    def ends(_: re.Match[str]) -> str:
        numbers = sorted(set(next(columns)), key=float)
        return numbers[0] if len(numbers) == 1 else f"{numbers[0]} to {numbers[-1]}"

    return _NUMBER.sub(ends, texts[0])


def _cases(cases: Sequence[Mapping[str, Any]], study: xr.Dataset | None) -> str:
    """Return a text with the range of each varied parameter over some cases, in the units of the campaign file."""
    wanted = {} if study is None else as_written(study)
    parts = []
    for path in cases[0]:
        name = path.replace(".", "_")
        unit = "1" if study is None or name not in study.coords else str(study[name].attrs.get("units", "1"))
        values = sorted({case.get(path) for case in cases}, key=lambda value: (str(type(value)), value))
        first, *_, last = [_shown(value, unit, wanted.get(name, "")) for value in (values[0], values[-1])]
        more = f" to {last}, {len(values)} values" if len(values) > 1 else ""
        parts.append(f"{path} = {first}{more}")
    return "; ".join(parts) or "the single case"


def _shown(value: Any, unit: str, wanted: str) -> str:
    return shown(value, unit, written=wanted) if isinstance(value, int | float) else str(value)
