"""Ways to run tasks: threads of this process, or any Dask cluster."""

from __future__ import annotations

import itertools
import os
import uuid
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial

from mdr_dask.execute.events import Settle, Tell, of_block
from mdr_dask.execute.resources import Resources
from mdr_dask.task import Outcome, Work, run_block

#: Blocks handed to the threads at a time: the graph never grows with the study.
THREAD_WINDOW = 64


#: Runs tasks and settles each that has ended, in whatever order.
Execute = Callable[[Iterable[Work], Settle], None]


def check(resources: Resources) -> None:
    """Refuse a cluster file that names no Dask cluster, before anything is touched.

    Raises
    ------
    ClusterError
        If it does not.
    """
    if resources.cluster is not None:
        from mdr_dask.execute.clusters import cluster_class

        cluster_class(resources.cluster["class"])


@contextmanager
def executor(resources: Resources, tell: Tell) -> Iterator[Execute]:
    """Yield the function that runs tasks on the resources named."""
    if not resources.remote:
        yield partial(_run_threads, resources.threads or _cores(), tell)
        return
    from mdr_dask.execute.clusters import crew
    from mdr_dask.execute.crew import run_distributed

    with crew(resources, tell) as workers:
        yield partial(run_distributed, workers)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _run_threads(threads: int, tell: Tell, works: Iterable[Work], settle: Settle) -> None:
    """Run on Dask's threaded scheduler: no server, no sockets; a window of blocks is a graph.

    However it ends, the blocks that have begun are finished first, for the store is still ours.
    """
    from dask import threaded  # its name alone would load the distributed scheduler
    from dask.callbacks import Callback

    def finished(_key: object, value: object, *_: object) -> None:
        if isinstance(value, tuple):
            settle(*value)

    def compute(work: Work) -> tuple[Work, Outcome]:
        tell(of_block("begun", work))
        return work, run_block(work)

    remaining = iter(works)
    with ThreadPoolExecutor(threads) as pool, Callback(posttask=finished):
        while window := list(itertools.islice(remaining, THREAD_WINDOW * threads)):
            graph = {f"block-{uuid.uuid4().hex}": (partial(compute, work),) for work in window}
            threaded.get(graph, list(graph), pool=pool)
