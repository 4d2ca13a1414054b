"""Run the blocks of a campaign: in threads or processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any

from mdr_dask import models
from mdr_dask.errors import ModelError
from mdr_dask.execute.events import Event, Settle, Tell, of_block
from mdr_dask.execute.resources import Resources
from mdr_dask.task import Outcome, Work, one_blas_thread, run_block

if TYPE_CHECKING:
    from mdr_dask.execute.children import Child
    from mdr_dask.execute.window import TaskWindow


class Executor(AbstractContextManager["Executor"]):
    """Compute blocks on the given resources.

    Without a cluster, the blocks of a plain Python model are computed in child processes unless `Resources.threads` is
    given, because only one thread of a process can run Python at a time, and because a crash would end the run. With
    `Resources.workers` or `Resources.case_timeout`, the blocks of all models are computed in child processes. On a
    system that cannot fork, threads compute all blocks.
    """

    def __init__(self, resources: Resources, model: str, tell: Tell) -> None:
        if resources.cluster is not None:
            from mdr_dask.execute.clusters import cluster_class

            cluster_class(resources.cluster["class"])
        self._resources, self._model, self._tell = resources, model, tell
        self._threads = resources.workers or resources.threads or _cores()
        is_python = resources.threads is None and getattr(models.load(model).compute, "is_plain_python", False)
        is_apart = is_python or resources.workers is not None or resources.case_timeout is not None
        self._is_apart = is_apart and hasattr(os, "fork")
        self._children: SimpleQueue[Child] | None = None
        self._stack = ExitStack()
        self._window: TaskWindow | None = None

    def __exit__(self, *reason: Any) -> None:
        self._stack.__exit__(*reason)

    def apart(self) -> None:
        """Choose child processes for all blocks, unless they are computed on a cluster or this system cannot fork.

        Call this method if a case may have crashed the last run.
        """
        if hasattr(os, "fork") and not self._resources.remote and not self._is_apart:
            self._is_apart = True
            sentence = "the last run was killed or crashed: blocks are computed in child processes, to find the cause"
            self._tell(Event("after a crash", {}, sentence))

    def connect(self) -> None:
        """If the resources name a cluster, start it or connect to it. Call this method before anything is written."""
        if self._resources.remote and self._window is None:
            from mdr_dask.execute.clusters import task_window

            self._window = self._stack.enter_context(task_window(self._resources, self._tell))

    def __call__(self, works: Iterable[Work], settle: Settle) -> None:
        """Compute blocks, and call `settle` for each block, or for each part of a halved block, when it ends."""
        self.connect()
        if self._window is not None:
            self._window.run(works, settle)
        else:
            if self._is_apart and self._children is None:
                from mdr_dask.execute.children import children

                self._children = SimpleQueue()
                for child in self._stack.enter_context(children(self._threads, self._model)):
                    self._children.put(child)
            with one_blas_thread():
                self._in_pool(works, settle)

    def _in_pool(self, works: Iterable[Work], settle: Settle) -> None:
        """Compute blocks in threads; after an error or an interrupt, wait for blocks that have started."""
        pool = ThreadPoolExecutor(self._threads)  # a `with` statement would wait after a second interrupt
        remaining = iter(works)
        running: set[Future[list[tuple[Work, Outcome]]]] = set()
        try:
            while True:
                # one more block than threads, so that no thread waits for a block
                more = itertools.islice(remaining, self._threads + 1 - len(running))
                running |= {pool.submit(self._compute, work) for work in more}
                if not running:
                    break
                ended, running = wait(running, return_when=FIRST_COMPLETED)
                for future in ended:
                    for work, outcome in future.result():
                        settle(work, outcome)
        except BaseException as error:
            begun = sum(not future.cancel() for future in running)
            if isinstance(error, KeyboardInterrupt) and begun:
                what = f"finishing {begun} blocks that have begun; a second interrupt stops at once"
                self._tell(Event("stopping", {"blocks": begun}, what))
            pool.shutdown()
            raise
        pool.shutdown()

    def _compute(self, work: Work) -> list[tuple[Work, Outcome]]:
        self._tell(of_block("begun", work))
        if self._children is None:
            return [(work, run_block(work))]
        from mdr_dask.execute.children import compute_apart

        child = self._children.get()
        try:
            return list(compute_apart(child, work, self._resources.case_timeout))
        except (AttributeError, ImportError, ModelError):  # the child cannot import a model that a script has defined
            return [(work, run_block(work))]
        finally:
            self._children.put(child)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
