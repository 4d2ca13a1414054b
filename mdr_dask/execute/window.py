"""A window of tasks on a Dask cluster: only as many blocks are submitted as keep all workers busy."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from functools import lru_cache
from queue import Empty, SimpleQueue
from typing import Any

from distributed import Client, Future, KilledWorker, get_worker
from distributed.client import ClosedClientError
from distributed.comm import CommClosedError
from distributed.protocol.pickle import dumps, loads

from mdr_dask.errors import LOOK, PAUSE, ClusterError, ModelError
from mdr_dask.execute.children import Child, children, compute_apart
from mdr_dask.execute.events import Event, Settle, Tell, of_block
from mdr_dask.plan import BlockIndex
from mdr_dask.task import Outcome, Work, one_blas_thread, run_block, write_off

#: Name of the Dask topic under which workers report blocks that they begin.
TOPIC = "mdr_dask"
KEPT = "what is in the store is kept: run the campaign again"

#: `_OPEN`: context that keeps the child process of a worker until the worker ends. `_APART`: lock held while the child
#: process computes.
_OPEN, _APART = ExitStack(), threading.Lock()

Outcomes = list[tuple[Work, Outcome]]


class TaskWindow:
    """The blocks that are submitted to a cluster at the same time: about twice as many as the cluster has threads.

    For an adaptive cluster, `most` is the largest number of threads, and about ``2 * most`` blocks are submitted. For
    other clusters, `most` is 0. The run ends with an error after `patience` seconds without any worker. `case_timeout`
    is the time limit in s for each result (see `mdr_dask.execute.resources.Resources`), or None. The function
    `replace_lost`, if given, replaces lost workers. The function `last_message` returns the last error message of the
    cluster.
    """

    def __init__(
        self,
        client: Client,
        tell: Tell,
        patience: float,
        most: int,
        replace_lost: Callable[[], None] | None,
        last_message: Callable[[], str],
        case_timeout: float | None,
    ) -> None:
        self._client, self._tell, self._patience, self._most = client, tell, patience, most
        self._replace_lost, self._last_message, self._case_timeout = replace_lost, last_message, case_timeout
        self._ended: SimpleQueue[Future] = SimpleQueue()
        self._running: dict[Future, Work] = {}
        self._threads = 0
        self._had_workers = False
        self._checked_at = self._had_worker_at = self._reported_at = time.monotonic()
        client.subscribe_topic(TOPIC, lambda event: tell(Event("block begun", event[1])))
        client.subscribe_topic("all", self._report_worker)

    def run(self, works: Iterable[Work], settle: Settle) -> None:
        """Compute blocks. If the worker of a block dies, compute the block once more, in a child process.

        If the worker dies again, the results of the block are marked as failed.
        """
        remaining = iter(works)
        suspects: set[tuple[str, BlockIndex]] = set()

        def fill() -> None:
            free = 2 * max(self._threads, self._most, 1) - len(self._running)
            for _, work in zip(range(free), remaining, strict=False):
                self._submit(_run_apart if self._case_timeout else _run, work)

        try:
            self._check()
            fill()
            while self._running:
                if time.monotonic() - self._checked_at > LOOK:
                    self._check()
                    fill()
                try:
                    future = self._ended.get(timeout=LOOK)
                    outcomes = _outcomes(future)
                except Empty:
                    continue
                except TimeoutError:  # the worker with the result has disappeared: wait again
                    future.add_done_callback(self._ended.put)
                    continue
                work = self._running.pop(future)
                future.release()
                block = work.place.series, work.place.index
                if outcomes is None and block not in suspects:
                    suspects.add(block)
                    self._submit(_run_apart, work)
                    continue
                if outcomes is None:
                    outcomes = [(work, write_off(work, "its workers died repeatedly: often out of memory"))]
                for part, outcome in outcomes:
                    settle(part, outcome)
                fill()
        except (CommClosedError, ClosedClientError):
            raise ClusterError(f"the scheduler went away; {KEPT}") from None

    def _submit(self, function: Callable[..., Outcomes], work: Work) -> None:
        # as bytes, because the scheduler would import the module of a user's model, and report no useful error
        future = self._client.submit(function, dumps(work), self._case_timeout, pure=False)
        self._running[future] = work
        future.add_done_callback(self._ended.put)

    def _check(self) -> None:
        """Count the threads of the cluster, and replace lost workers.

        Raise ClusterError if the scheduler has disappeared, if the cluster reports an error before its first worker
        starts, or if there was no worker for too long.
        """
        if self._client.status != "running":
            raise ClusterError(f"the scheduler went away; {KEPT}")
        if self._replace_lost is not None:
            self._replace_lost()
        try:
            found = self._client.sync(self._client.scheduler.ncores, callback_timeout=PAUSE)
            self._threads, what = sum(found.values()), "no worker"
        except TimeoutError:
            self._threads, what = 0, "no answer from the scheduler"
        now = self._checked_at = time.monotonic()
        if self._threads:
            self._had_worker_at = self._reported_at = now
            self._had_workers = True
            return
        waited, complaint = now - self._had_worker_at, self._last_message()
        if complaint and not self._had_workers:
            raise ClusterError(f"the cluster starts no worker: {complaint}")
        why = f" ({complaint})" if complaint else ""
        if waited > self._patience:
            raise ClusterError(f"{what} for {waited:.0f} s{why}; {KEPT}, if necessary with a larger --patience")
        if now - self._reported_at >= PAUSE:
            self._reported_at = now
            what = "all workers are gone" if self._had_workers and what == "no worker" else f"{what} yet"
            sentence = f"{what}, waiting for {waited:.0f} s{why}; giving up after {self._patience:.0f} s"
            self._tell(Event("waiting for workers", {"seconds": round(waited, 1), "complaint": complaint}, sentence))

    def _report_worker(self, event: tuple[float, dict[str, Any]]) -> None:
        facts = event[1]
        if facts.get("action") == "add-worker":
            self._tell(Event("worker joined", {"worker": facts["worker"]}))
        elif facts.get("action") == "remove-worker":
            self._tell(Event("worker lost", {"worker": facts["worker"], "expected": facts.get("expected", False)}))


def _outcomes(future: Future) -> Outcomes | None:
    """Return the outcomes of a task, or None if workers died. Turn other known errors into a ClusterError.

    Raise TimeoutError if the outcomes do not arrive within `PAUSE` seconds.
    """
    from concurrent.futures import CancelledError

    try:
        outcomes: Outcomes = future.result(timeout=PAUSE)
    except KilledWorker:
        return None
    except CancelledError:
        raise ClusterError(f"the scheduler went away; {KEPT}") from None
    except ModuleNotFoundError as error:
        remedy = "install its package on the workers, or start them with its folder on PYTHONPATH"
        raise ClusterError(f"a worker lacks the Python module {error.name!r}: {remedy}; {KEPT}") from None
    except (AttributeError, TypeError) as error:
        raise ClusterError(f"a worker has another version of mdr_dask: {error}; install the same on both") from None
    return outcomes


def _run(packed: bytes, _: float | None) -> Outcomes:
    work = loads(packed)
    _report(work)
    one_blas_thread()
    return [(work, run_block(work))]


def _run_apart(packed: bytes, limit: float | None) -> Outcomes:
    work = loads(packed)
    _report(work)
    try:
        with _APART:
            return list(compute_apart(_child(work.model), work, limit))
    except (ImportError, ModelError):  # the child process cannot import the model: compute here
        return _run(packed, limit)


def _report(work: Work) -> None:
    worker = get_worker()
    worker.log_event(TOPIC, {**of_block("begun", work).facts, "worker": worker.address})


@lru_cache(maxsize=1)
def _child(model: str) -> Child:
    """Return the child process of this worker. The child ends when the worker ends."""
    return _OPEN.enter_context(children(1, model))[0]
