"""Run the blocks of a campaign: in threads or processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import itertools
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack
from queue import SimpleQueue
from typing import TYPE_CHECKING

from mdr_dask import models, store
from mdr_dask.errors import ModelError
from mdr_dask.execute.events import Event, Settle, Tell, of_block
from mdr_dask.execute.resources import Resources
from mdr_dask.store import Lock
from mdr_dask.task import Outcome, Work, one_blas_thread, run_block

if TYPE_CHECKING:
    from mdr_dask.execute.children import Child
    from mdr_dask.execute.window import TaskWindow

#: Number of blocks for each thread that are submitted at the same time, so that no thread is idle.
AHEAD = 2
#: Time in s for which a plain Python model is first computed in this process. Processes are started only for longer
#: runs, because starting them takes time.
SHORT = 2.0

Compute = Callable[[Work], list[tuple[Work, Outcome]]]


def check(resources: Resources) -> None:
    """Raise ClusterError if the class in a cluster file is not a class of Dask clusters."""
    if resources.cluster is not None:
        from mdr_dask.execute.clusters import cluster_class

        cluster_class(resources.cluster["class"])


class Executor(AbstractContextManager["Executor"]):
    """Compute blocks on the given resources. Processes and clusters are started when there is work for them.

    Parameters
    ----------
    resources : Resources
        Where to compute the blocks.
    model : str
        Name of the model.
    url : str
        The store.
    tell : callable
        Receives events.
    """

    def __init__(self, resources: Resources, model: str, url: str, tell: Tell) -> None:
        self._resources, self._url, self._tell = resources, url, tell
        self._model = model
        self._threads = resources.workers or resources.threads or _cores()
        is_python = getattr(models.load(model).compute, "is_plain_python", False)
        self._may_fork = hasattr(os, "fork")
        self._needs_processes = resources.workers is not None or resources.case_timeout is not None
        self._prefers_processes = is_python and resources.threads is None and self._threads > 1
        self._children: SimpleQueue[Child] = SimpleQueue()
        self._has_children = False
        self._noting = threading.Lock()
        self._stack = ExitStack()
        self._window: TaskWindow | None = None

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def hold(self, lock: Lock) -> None:
        """Set the lock of the run. The blocks that a crashed run had begun will be computed in a child process."""
        self._lock = lock
        self._suspects, self._begun = set(lock.begun), set(lock.begun)

    def connect(self) -> None:
        """Start the cluster or connect to it, if the resources name one. Call this before anything is written."""
        if self._resources.remote and self._window is None:
            from mdr_dask.execute.clusters import task_window

            self._window = self._stack.enter_context(task_window(self._resources, self._tell))

    def __call__(self, works: Iterable[Work], settle: Settle) -> None:
        """Compute blocks, and call `settle` for each block when it ends. Blocks may end in any order."""
        remaining = iter(works)
        first = next(remaining, None)
        if first is None:
            return
        remaining = itertools.chain([first], remaining)
        with store.while_locked(self._url, self._lock):
            pass  # entering the context raises StoreError in a read-only store
        if self._resources.remote:
            self._on_cluster(remaining, settle)
            return
        self._stack.enter_context(one_blas_thread())
        ordinary = self._without_suspects(remaining, settle)
        if self._needs_processes and self._may_fork:
            self._in_pool(ordinary, self._in_child, settle)
        elif self._prefers_processes and self._may_fork:
            self._in_pool(_for_a_while(ordinary), self._here, settle)
            self._in_pool(ordinary, self._in_child, settle)
        else:
            self._in_pool(ordinary, self._here, settle)

    def _without_suspects(self, works: Iterator[Work], settle: Settle) -> Iterator[Work]:
        """Yield all blocks except those that a crashed run had begun. These are computed here, in a child process."""
        for work in works:
            if (key := work.key) in self._suspects and self._may_fork:
                sentence = f"an earlier run ended while it computed block {key}: it is computed in a process of its own"
                self._tell(Event("block suspected", {"block": key}, sentence))
                try:
                    outcomes = self._in_child(work)
                except (ImportError, ModelError):  # the child process cannot import the model
                    outcomes = self._here(work)
                for part, outcome in outcomes:
                    settle(part, outcome)
                self._suspects.discard(key)
                self._note(key, is_begun=False)
            else:
                yield work

    def _on_cluster(self, works: Iterable[Work], settle: Settle) -> None:
        self.connect()
        assert self._window is not None
        self._window.run(works, settle)

    def _in_pool(self, works: Iterable[Work], compute: Compute, settle: Settle) -> None:
        """Compute blocks in threads. After an error, the blocks that have started are still finished."""
        remaining = iter(works)
        running: set[Future[list[tuple[Work, Outcome]]]] = set()
        with ThreadPoolExecutor(self._threads) as pool:
            try:
                while True:
                    more = itertools.islice(remaining, AHEAD * self._threads - len(running))
                    running |= {pool.submit(compute, work) for work in more}
                    if not running:
                        return
                    ended, running = wait(running, return_when=FIRST_COMPLETED)
                    for future in ended:
                        for work, outcome in future.result():
                            settle(work, outcome)
            except BaseException as error:
                begun = sum(not future.cancel() for future in running)
                if isinstance(error, KeyboardInterrupt) and begun:
                    what = f"finishing {begun} blocks that have begun; a second interrupt stops at once"
                    self._tell(Event("stopping", {"blocks": begun}, what))
                raise

    def _here(self, work: Work) -> list[tuple[Work, Outcome]]:
        self._tell(of_block("begun", work))
        self._note(work.key, is_begun=True)
        try:
            return [(work, run_block(work))]
        finally:
            self._note(work.key, is_begun=False)

    def _note(self, key: str, is_begun: bool) -> None:
        """Record which blocks are being computed. If this process crashes, the next run reads this record."""
        with self._noting:
            (self._begun.add if is_begun else self._begun.discard)(key)
            store.note_begun(self._url, self._lock, sorted(self._begun))

    def _in_child(self, work: Work) -> list[tuple[Work, Outcome]]:
        from mdr_dask.execute.children import compute_apart

        self._tell(of_block("begun", work))
        child = self._free_child()
        try:
            return list(compute_apart(child, work, self._resources.case_timeout))
        finally:
            self._children.put(child)

    def _free_child(self) -> Child:
        """Return an idle child process. All child processes are started when the first of them is needed."""
        from mdr_dask.execute.children import children

        with self._noting:
            if not self._has_children:
                for child in self._stack.enter_context(children(self._threads, self._model)):
                    self._children.put(child)
                self._has_children = True
        return self._children.get()


def _for_a_while(works: Iterator[Work]) -> Iterator[Work]:
    """Yield blocks until `SHORT` seconds have passed."""
    start = time.monotonic()
    for work in works:
        yield work
        if time.monotonic() - start > SHORT:
            return


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
