"""How far a study has come: results in each state, and what failed results and warnings have in common."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mdr_dask import store
from mdr_dask.models.base import Status

if TYPE_CHECKING:
    import xarray as xr

    from mdr_dask.store import Look


class Group(NamedTuple):
    """Messages of one series that say the same.

    Attributes
    ----------
    series, kind, reason : str
        Where, ``warning`` or the state of the results, and the message.
    results : int
        How many it was said of.
    cases : str
        The range that each varied parameter takes among them.
    """

    series: str
    kind: str
    reason: str
    results: int
    cases: str


def looks(url: str) -> list[Look]:
    """Look at every series of a study, at no chunk but those of the ledger."""
    names = store.series_names(url)
    store.require_laid_out(url, names)
    return [store.look(url, name) for name in names]


def counts(look: Look) -> dict[str, Any]:
    """Return the name of a series, the number of its results, and how many of them are in each state."""
    counted = {state.name.lower(): int((look.status == state).sum()) for state in Status}
    return {"series": look.chunks.series or "-", "results": look.status.size, **counted}


def messages(url: str, series: str, dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return what still holds of the messages of a series: the last attempt's, where the ledger says the same."""
    last: dict[tuple[int, ...], dict[str, Any]] = {}
    telling = [record for record in store.records(url, series) if record["messages"]]
    for record in sorted(telling, key=lambda record: record["attempt"]):
        for message in (told for told in record["messages"] if "place" in told):  # as since version 0.2
            last[tuple(message["place"])] = {"series": series, "attempt": record["attempt"], **message}
    ledger = store.ledger(url, series, dataset["status"].shape)
    inside = [place for place in last if len(place) == ledger.ndim and np.less(place, ledger.shape).all()]
    return [last[place] for place in inside if ledger[place] == Status[last[place]["status"].upper()]]


def grouped(found: Sequence[dict[str, Any]]) -> list[Group]:
    """Return messages that say the same together, in the order in which they came."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for message in found:
        groups.setdefault((message["series"], message["message"]), []).append(message)
    return [
        Group(
            series,
            "warning" if alike[0]["status"] == "done" else alike[0]["status"],
            reason,
            len(alike),
            _shared(alike),
        )
        for (series, reason), alike in groups.items()
    ]


def _shared(alike: list[dict[str, Any]]) -> str:
    """Return the range that each varied parameter takes among messages."""
    parts = []
    for path in alike[0]["case"]:
        values = sorted({message["case"].get(path) for message in alike}, key=lambda v: (str(type(v)), v))
        if len(values) == 1:
            parts.append(f"{path} = {_brief(values[0])}")
        else:
            parts.append(f"{path} {_brief(values[0])} .. {_brief(values[-1])} ({len(values)} values)")
    return ", ".join(parts) or "the only case"


def _brief(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
