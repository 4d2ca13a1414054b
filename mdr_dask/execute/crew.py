"""The workers of a Dask cluster: blocks go out to them, and what becomes of them is told."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from queue import Empty, SimpleQueue
from typing import Any

from distributed import Client, Future, KilledWorker
from distributed.client import ClosedClientError
from distributed.comm import CommClosedError

from mdr_dask.errors import ClusterError
from mdr_dask.execute.events import Event, Settle, Tell, of_block
from mdr_dask.execute.remote import TOPIC, run_on_worker
from mdr_dask.task import Outcome, Work, write_off

#: Seconds between two looks at the cluster.
LOOK = 1.0
#: Seconds after which a user is told that there is no worker, and between two such words.
SILENCE = 3.0
#: Seconds that a scheduler is given for a short answer.
ANSWER = 3.0
#: Tasks that a scheduler is given in a second: half of what it can take.
PACE = 80
#: Most blocks of a task.
MOST_TOGETHER = 100
KEPT = "what is in the store is kept: run the campaign again"


class Crew:
    """Blocks in the hands of workers, as many as keep them busy; where workers are many, several blocks to a task.

    Parameters
    ----------
    client : Client
        Connection to the cluster.
    tell : callable
        Takes events.
    patience : float
        Seconds without any worker after which to give up.
    most : int
        Threads that the cluster may grow to if it sees work for them, 0 if it does not grow by itself.
    replace_lost : callable
        Asks the cluster for new workers in place of lost ones.
    last_word : callable
        Returns what the cluster had to complain about last, if anything.
    """

    def __init__(
        self,
        client: Client,
        tell: Tell,
        patience: float,
        most: int,
        replace_lost: Callable[[], None],
        last_word: Callable[[], str],
    ) -> None:
        self._client = client
        self._tell = tell
        self._patience = patience
        self._most = most
        self._replace_lost = replace_lost
        self._last_word = last_word
        self._ended: SimpleQueue[Future] = SimpleQueue()
        self._running: dict[Future, tuple[Work, ...]] = {}
        self._begun: dict[str, list[int]] = {}  # by task, which of its blocks
        self._blocks, self._seconds = 0, 0.0
        self._threads = 0
        self._had_workers = False
        self._looked = self._seen = self._told = time.monotonic()
        client.subscribe_topic(TOPIC, self._hear_of_block)
        client.subscribe_topic("all", self._hear_of_worker)

    @property
    def busy(self) -> bool:
        """Whether any task is out."""
        return bool(self._running)

    @property
    def room(self) -> int:
        """How many more tasks to give out: a few ahead of what is being computed."""
        return max(2 * max(self._threads, self._most) + 2 - len(self._running), 0)

    @property
    def together(self) -> int:
        """How many blocks to a task, so that all workers together do not end more tasks than a scheduler can take."""
        if not self._seconds:
            return 1
        wanted = math.ceil(self._threads / PACE * self._blocks / self._seconds)
        return max(1, min(wanted, MOST_TOGETHER))

    def give(self, works: tuple[Work, ...]) -> None:
        """Give out some blocks as one task."""
        future = self._client.submit(run_on_worker, works, pure=False)
        self._running[future] = works
        future.add_done_callback(self._ended.put)

    def take(self, refill: Callable[[], None] = lambda: None) -> tuple[tuple[Work, ...], list[Outcome] | KilledWorker]:
        """Wait for a task to end; meanwhile look after the cluster, and give out more as workers come.

        Raises
        ------
        ClusterError
            If the scheduler goes away, there is no worker for too long, or a worker cannot do what it is sent.
        StoreError
            If the store cannot be read or written.
        """
        while True:
            if time.monotonic() - self._looked > LOOK:
                self.look()
                refill()
            try:
                future = self._ended.get(timeout=LOOK)
            except Empty:
                continue
            try:
                outcomes = _outcomes(future)
            except TimeoutError:  # its worker went away with what it had to say
                future.add_done_callback(self._ended.put)
                continue
            works = self._running.pop(future)
            self._begun.pop(future.key, None)
            future.release()
            if not isinstance(outcomes, KilledWorker):
                self._blocks += len(outcomes)
                self._seconds += sum(outcome.seconds for outcome in outcomes)
            return works, outcomes

    def look(self) -> None:
        """See whether the scheduler is there and has workers; give up when there has been none for too long."""
        if self._client.status != "running":
            raise ClusterError(f"the scheduler went away; {KEPT}")
        self._replace_lost()
        try:
            found = self._client.sync(self._client.scheduler.ncores, callback_timeout=ANSWER)
            self._threads, what = sum(found.values()), "no worker"
        except TimeoutError:
            self._threads, what = 0, "no answer of the scheduler"
        now = self._looked = time.monotonic()
        if self._threads:
            self._seen = self._told = now
            self._had_workers = True
            return
        waited, complaint = now - self._seen, self._last_word()
        if complaint and not self._had_workers:
            raise ClusterError(f"the cluster starts no worker: {complaint}")
        why = f" ({complaint})" if complaint else ""
        if waited > self._patience:
            raise ClusterError(f"{what} for {waited:.0f} s{why}; {KEPT}, with more --patience if need be")
        if now - self._told >= SILENCE:
            self._told = now
            what = "all workers are gone" if self._had_workers and what == "no worker" else f"{what} yet"
            sentence = f"{what}, waiting for {waited:.0f} s{why}; giving up after {self._patience:.0f} s"
            self._tell(Event("waiting for workers", {"seconds": round(waited, 1), "complaint": complaint}, sentence))

    def _hear_of_block(self, event: tuple[float, dict[str, Any]]) -> None:
        facts = event[1]
        begun, number = self._begun.setdefault(facts.pop("key"), []), facts.pop("number")
        self._tell(Event("block retried" if number in begun else "block begun", facts))
        begun.append(number)

    def _hear_of_worker(self, event: tuple[float, dict[str, Any]]) -> None:
        facts = event[1]
        if facts.get("action") == "add-worker":
            self._tell(Event("worker joined", {"worker": facts["worker"]}))
        elif facts.get("action") == "remove-worker":
            self._tell(Event("worker lost", {"worker": facts["worker"], "expected": facts.get("expected", False)}))
            lost = set(facts.get("processing-tasks", ()))
            for future, works in list(self._running.items()):
                if future.key in lost and (begun := self._begun.get(future.key)):
                    self._tell(of_block("lost", works[begun[-1]], worker=facts["worker"]))


def _outcomes(future: Future) -> list[Outcome] | KilledWorker:
    """Return what a task sent home; what is no fault of the task ends the run in one sentence."""
    from concurrent.futures import CancelledError

    try:
        outcomes: list[Outcome] = future.result(timeout=ANSWER)
    except KilledWorker as killed:
        return killed
    except CancelledError:
        raise ClusterError(f"the scheduler went away; {KEPT}") from None
    except ModuleNotFoundError as error:
        raise ClusterError(f"a worker lacks {error.name!r}; {KEPT}") from None
    except (AttributeError, TypeError) as error:
        raise ClusterError(f"a worker has another version of mdr_dask: {error}; install the same on both") from None
    return outcomes


@contextmanager
def _connected() -> Iterator[None]:
    """Say in one sentence that the scheduler went away, wherever that is noticed."""
    try:
        yield
    except (CommClosedError, ClosedClientError):
        raise ClusterError(f"the scheduler went away; {KEPT}") from None


def run_distributed(crew: Crew, works: Iterable[Work], settle: Settle) -> None:
    """Keep a window of tasks on the cluster; a block under suspicion of killing workers is tried again alone."""
    remaining = iter(works)
    suspects: list[Work] = []

    def fill() -> None:
        for _ in range(crew.room):
            if together := tuple(itertools.islice(remaining, crew.together)):
                crew.give(together)

    with _connected():
        crew.look()
        fill()
        while crew.busy:
            together, outcomes = crew.take(fill)
            if isinstance(outcomes, KilledWorker):
                suspects += together
            else:
                for work, outcome in zip(together, outcomes, strict=True):
                    settle(work, outcome)
            fill()
        for work in suspects:
            _run_suspect(crew, work, settle)


def _run_suspect(crew: Crew, suspect: Work, settle: Settle) -> None:
    """Run a block with nothing else on the cluster, by halves if it kills its workers, down to the result to blame."""
    pieces = [suspect]
    attempts = itertools.count(suspect.attempt)
    while pieces:
        crew.give((replace(pieces.pop(), attempt=next(attempts)),))
        (work,), outcomes = crew.take()
        if not isinstance(outcomes, KilledWorker):
            settle(work, *outcomes)
            continue
        halves = work.halves()
        pieces += reversed(halves)
        if not halves:
            died = f"its worker died again and again ({outcomes.allowed_failures + 1} times)"
            settle(work, write_off(work, f"{died}, memory is the usual cause"))
