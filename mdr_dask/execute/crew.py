"""The workers of a Dask cluster: blocks go out to them, and what becomes of them is told."""

from __future__ import annotations

import itertools
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
ANSWER = 5.0
KEPT = "what is in the store is kept: run the campaign again"


class Crew:
    """Blocks in the hands of workers, as many as keep them busy.

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
        self._running: dict[Future, Work] = {}
        self._begun: set[str] = set()
        self._threads = 0
        self._had_workers = False
        self._looked = self._seen = self._told = time.monotonic()
        client.subscribe_topic(TOPIC, self._hear_of_block)
        client.subscribe_topic("all", self._hear_of_worker)

    @property
    def busy(self) -> bool:
        """Whether any block is out."""
        return bool(self._running)

    @property
    def room(self) -> int:
        """How many more blocks to give out: a few ahead of what is being computed."""
        return max(2 * max(self._threads, self._most) + 2 - len(self._running), 1)

    def give(self, work: Work) -> None:
        """Give out a block."""
        future = self._client.submit(run_on_worker, work, pure=False)
        self._running[future] = work
        future.add_done_callback(self._ended.put)

    def take(self) -> tuple[Work, Outcome | KilledWorker]:
        """Wait for a block to end; look after the cluster meanwhile.

        Raises
        ------
        ClusterError
            If the scheduler goes away, there is no worker for too long, or a worker cannot do what it is sent.
        StoreError
            If the store cannot be read or written.
        """
        while True:
            if time.monotonic() - self._looked > LOOK:
                self._look()
            try:
                future = self._ended.get(timeout=LOOK)
            except Empty:
                continue
            try:
                outcome = _outcome(future)
            except TimeoutError:  # its worker went away with what it had to say
                future.add_done_callback(self._ended.put)
                continue
            work = self._running.pop(future)
            self._begun.discard(future.key)
            future.release()
            return work, outcome

    def _look(self) -> None:
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
        key = facts.pop("key")
        self._tell(Event("block retried" if key in self._begun else "block begun", facts))
        self._begun.add(key)

    def _hear_of_worker(self, event: tuple[float, dict[str, Any]]) -> None:
        facts = event[1]
        if facts.get("action") == "add-worker":
            self._tell(Event("worker joined", {"worker": facts["worker"]}))
        elif facts.get("action") == "remove-worker":
            self._tell(Event("worker lost", {"worker": facts["worker"], "expected": facts.get("expected", False)}))
            lost = set(facts.get("processing-tasks", ()))
            for future, work in list(self._running.items()):
                if future.key in lost & self._begun:
                    self._tell(of_block("lost", work, worker=facts["worker"]))


def _outcome(future: Future) -> Outcome | KilledWorker:
    """Return what a task sent home; what is no fault of the task ends the run in one sentence."""
    from concurrent.futures import CancelledError

    try:
        outcome: Outcome = future.result(timeout=ANSWER)
    except KilledWorker as killed:
        return killed
    except CancelledError:
        raise ClusterError(f"the scheduler went away; {KEPT}") from None
    except ModuleNotFoundError as error:
        raise ClusterError(f"a worker lacks {error.name!r}; {KEPT}") from None
    except (AttributeError, TypeError) as error:
        raise ClusterError(f"a worker has another version of mdr_dask: {error}; install the same on both") from None
    return outcome


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
        for work in itertools.islice(remaining, crew.room):
            crew.give(work)

    with _connected():
        fill()
        while crew.busy:
            work, outcome = crew.take()
            if isinstance(outcome, KilledWorker):
                suspects.append(work)
            else:
                settle(work, outcome)
            fill()
        for work in suspects:
            _run_suspect(crew, work, settle)


def _run_suspect(crew: Crew, suspect: Work, settle: Settle) -> None:
    """Run a block with nothing else on the cluster, by halves if it kills its workers, down to the result to blame."""
    pieces = [suspect]
    attempts = itertools.count(suspect.attempt)
    while pieces:
        crew.give(replace(pieces.pop(), attempt=next(attempts)))
        work, outcome = crew.take()
        if not isinstance(outcome, KilledWorker):
            settle(work, outcome)
            continue
        halves = work.halves()
        pieces += reversed(halves)
        if not halves:
            died = f"its worker died again and again ({outcome.allowed_failures + 1} times)"
            settle(work, write_off(work, f"{died}, memory is the usual cause"))
