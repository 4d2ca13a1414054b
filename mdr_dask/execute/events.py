"""Events of a run, for its log and for the terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from mdr_dask.models.base import Status
from mdr_dask.task import Outcome, Work


@dataclass(frozen=True)
class Event:
    """Something that happened in a run."""

    name: str
    # Details, as values that JSON can represent.
    facts: Mapping[str, Any] = field(default_factory=dict)
    # A message for the user; empty for an event that is only written to the log.
    sentence: str = ""


#: Function that receives events, from any thread.
Tell = Callable[[Event], None]
#: Function that receives a task that has ended, with its outcome.
Settle = Callable[[Work, Outcome], None]


def of_block(name: str, work: Work, **facts: Any) -> Event:
    """Return an event about a block."""
    own = {"series": work.place.series, "block": list(work.place.index), "attempt": work.attempt}
    return Event(f"block {name}", {**own, **facts})


def ended(work: Work, outcome: Outcome) -> Event:
    """Return an event about a block that has ended. The block counts as failed if any of its results has failed."""
    counts = {state.name.lower(): outcome.counts[state] for state in Status if outcome.counts[state]}
    failed = outcome.counts[Status.FAILED] + outcome.counts[Status.NOT_CONVERGED]
    seconds = outcome.compute_seconds + outcome.write_seconds
    return of_block("failed" if failed else "done", work, results=counts, seconds=round(seconds, 6))
