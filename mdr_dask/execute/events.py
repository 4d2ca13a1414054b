"""Events and progress of a run, for the log of the run and for the terminal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from mdr_dask.models.base import Status
from mdr_dask.task import Outcome, Work


@dataclass(frozen=True)
class Event:
    """Something that happened in a run."""

    name: str
    # Details, as values that JSON can represent.
    facts: Mapping[str, Any] = field(default_factory=dict)
    # A message for the user. The message is empty for an event that is only written to the log.
    sentence: str = ""


#: Function that receives events, from any thread.
Tell = Callable[[Event], None]
#: Function that receives a finished task and its outcome.
Settle = Callable[[Work, Outcome], None]


def of_block(name: str, work: Work, **facts: Any) -> Event:
    """Return an event about a block."""
    own = {"series": work.place.series, "block": list(work.place.index), "attempt": work.attempt}
    return Event(f"block {name}", {**own, **facts})


def ended(work: Work, outcome: Outcome) -> Event:
    """Return the event of a finished block.

    A block with at least one result that failed or did not converge counts as failed.
    """
    counts = {state.name.lower(): outcome.counts[state] for state in Status if outcome.counts[state]}
    failed = outcome.counts[Status.FAILED] + outcome.counts[Status.NOT_CONVERGED]
    seconds = outcome.compute_seconds + outcome.write_seconds
    return of_block("failed" if failed else "done", work, results=counts, seconds=round(seconds, 6))


@dataclass(frozen=True)
class Progress:
    """The progress of a run. A result is one case in one realisation."""

    # Numbers of results: in all rounds that have begun (`total`), in the store before the run (`kept`), and written by
    # this run (`done`, `failed` and `not_needed`). Results that are not converged count as failed.
    total: int = 0
    kept: int = 0
    done: int = 0
    failed: int = 0
    not_needed: int = 0
    # Number of failed results among `kept`.
    kept_failed: int = 0
    # Whether this part has ended early, because it needs results of parts that are not running.
    is_unfinished: bool = False
    # Number of results of this run that are done but have a warning.
    warned: int = 0
    # Number of blocks and number of solutions that this run has computed. Several results may share a solution.
    blocks: int = 0
    solves: int = 0
    # Approximate number of operations of the results that this run computes: in all rounds that have begun
    # (`estimated`), and in the finished blocks (`finished`).
    estimated: float = 0.0
    finished: float = 0.0
    # Times in s: for computing models, including compilation; for compiling kernels alone; for writing; and since the
    # start of the run. The first three times are sums over all threads.
    compute_seconds: float = 0.0
    compile_seconds: float = 0.0
    write_seconds: float = 0.0
    wall_seconds: float = 0.0

    @property
    def to_do(self) -> int:
        """Number of results that this round has not computed yet."""
        return self.total - self.kept - self.done - self.failed - self.not_needed

    @property
    def seconds_left(self) -> float | None:
        """Estimated time in s to the end of this round, without compilation; None before the first finished block."""
        busy = self.compute_seconds + self.write_seconds
        if not (self.finished > 0 and busy > 0 and self.wall_seconds > 0):
            return None
        pace = max(busy - self.compile_seconds, 0.0) / self.finished
        side_by_side = max(busy / self.wall_seconds, 1.0)
        return pace * max(self.estimated - self.finished, 0.0) / side_by_side

    def after(self, outcome: Outcome, wall_seconds: float) -> Progress:
        """Return the progress after one more block has ended, `wall_seconds` after the start of the run."""
        counts = outcome.counts
        return replace(
            self,
            done=self.done + counts[Status.DONE],
            failed=self.failed + counts[Status.FAILED] + counts[Status.NOT_CONVERGED],
            not_needed=self.not_needed + counts[Status.NOT_NEEDED],
            warned=self.warned + outcome.warned,
            blocks=self.blocks + 1,
            solves=self.solves + outcome.solves,
            finished=self.finished + outcome.operations,
            compute_seconds=self.compute_seconds + outcome.compute_seconds,
            compile_seconds=self.compile_seconds + min(outcome.compile_seconds, outcome.compute_seconds),
            write_seconds=self.write_seconds + outcome.write_seconds,
            wall_seconds=wall_seconds,
        )
