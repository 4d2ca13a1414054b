"""Ways to run tasks: threads of this process, or any Dask cluster."""

from __future__ import annotations

import itertools
import logging
import os
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

from mdr_dask.errors import ClusterError
from mdr_dask.task import Outcome, Work, run_block, write_off

if TYPE_CHECKING:
    from dask.delayed import Delayed
    from distributed import Client, Future

#: Blocks handed to the threads at a time: the graph never grows with the study.
THREAD_WINDOW = 64
#: Run in every worker process: Ctrl-C reaches them too, and it is for the driver to end them.
IGNORE_INTERRUPTS = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
#: Seconds that a scheduler is given to answer.
SCHEDULER_PATIENCE = 10


@dataclass(frozen=True)
class Resources:
    """Where to run: threads of this process by default.

    Parameters
    ----------
    threads : int or None
        Threads of this process; None for one per core.
    workers : int or None
        Processes of a local cluster instead.
    scheduler : str or None
        Address of a running Dask scheduler instead.
    cluster : mapping or None
        ``{"class": "package.Cluster", "arguments": {...}, "scale": {...}}`` of any Dask cluster instead.
    """

    threads: int | None = None
    workers: int | None = None
    scheduler: str | None = None
    cluster: Mapping[str, Any] | None = None


#: Runs tasks and tells of each that has ended, in whatever order.
Execute = Callable[[Iterable[Work], Callable[[Outcome], None]], None]


@contextmanager
def executor(resources: Resources) -> Iterator[Execute]:
    """Yield the function that runs tasks on the resources named."""
    if resources.workers is None and resources.scheduler is None and resources.cluster is None:
        yield lambda works, account: _run_threads(works, account, resources.threads or _cores())
        return
    with _client(resources) as client:
        yield lambda works, account: _run_distributed(client, works, account)


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _run_threads(works: Iterable[Work], account: Callable[[Outcome], None], threads: int) -> None:
    """Run on Dask's threaded scheduler: no server, no sockets; a window of blocks is a graph.

    However it ends, the blocks that have begun are finished first, for the store is still ours.
    """
    import dask
    from dask.callbacks import Callback

    def finished(_key: object, value: object, *_: object) -> None:
        if isinstance(value, Outcome):
            account(value)

    def task(work: Work) -> Delayed:
        """Make a task that Dask does not look into for tasks to wait for, which takes longer than all the rest."""
        return dask.delayed(partial(run_block, work), name=f"block-{uuid.uuid4().hex}", traverse=False)()

    remaining = iter(works)
    with ThreadPoolExecutor(threads) as pool, Callback(posttask=finished):
        while window := list(itertools.islice(remaining, THREAD_WINDOW * threads)):
            dask.compute([task(work) for work in window], scheduler="threads", pool=pool, optimize_graph=False)


@contextmanager
def _client(resources: Resources) -> Iterator[Client]:
    from distributed import Client

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # its tracebacks end up in our errors, in one sentence
    if resources.scheduler is not None:
        with _connected(resources.scheduler) as client:
            yield client
        return
    with _cluster(resources) as cluster, Client(cluster, set_as_default=False) as client:
        yield client


def _connected(address: str) -> Client:
    from distributed import Client
    from distributed.comm import get_address_host_port

    try:
        get_address_host_port(address)
        return Client(address, timeout=SCHEDULER_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ClusterError(f"no Dask scheduler answers at {address!r}: {str(error) or type(error).__name__}") from None


def _cluster(resources: Resources) -> Any:
    from distributed import LocalCluster

    if resources.cluster is None:
        return LocalCluster(
            n_workers=resources.workers,
            threads_per_worker=1,
            dashboard_address="127.0.0.1:0",
            scheduler_port=0,
            protocol="tcp://",
            silence_logs=logging.CRITICAL,
            preload=[IGNORE_INTERRUPTS],
        )
    package, _, name = resources.cluster["class"].rpartition(".")
    try:
        cluster = getattr(import_module(package), name)(**resources.cluster.get("arguments", {}))
        if "scale" in resources.cluster:
            cluster.scale(**resources.cluster["scale"])
    except (ImportError, AttributeError, TypeError, ValueError, OSError, RuntimeError) as error:
        raise ClusterError(f"cannot start {resources.cluster['class']!r}: {type(error).__name__}: {error}") from None
    return cluster


def _run_distributed(client: Client, works: Iterable[Work], account: Callable[[Outcome], None]) -> None:
    """Keep a window of tasks on the cluster; a block under suspicion of killing workers is tried again alone."""
    from distributed import KilledWorker, as_completed

    client.wait_for_workers(1)
    remaining = iter(works)
    queue = as_completed(loop=client.loop)
    running: dict[Future, Work] = {}
    suspects: list[Work] = []

    def fill() -> None:
        room = 2 * sum(client.nthreads().values()) + 2 - len(running)
        for work in itertools.islice(remaining, max(room, 1)):
            future = client.submit(run_block, work, pure=False)
            running[future] = work
            queue.add(future)

    fill()
    for future in queue:
        work = running.pop(future)
        try:
            account(_outcome(future))
        except KilledWorker:
            suspects.append(work)
        future.release()
        fill()
    for work in suspects:
        _run_suspect(client, work, account)


def _outcome(future: Future) -> Outcome:
    """Return what a task sent home; a scheduler that went away is no fault of the task."""
    from concurrent.futures import CancelledError

    try:
        outcome: Outcome = future.result()
    except (CancelledError, ModuleNotFoundError) as error:
        what = "the scheduler went away" if isinstance(error, CancelledError) else f"a worker lacks {error.name!r}"
        raise ClusterError(f"{what}; what is in the store is kept: run the campaign again") from None
    return outcome


def _run_suspect(client: Client, suspect: Work, account: Callable[[Outcome], None]) -> None:
    """Run a block with nothing else on the cluster, by halves if it kills its workers, down to the result to blame."""
    from distributed import KilledWorker

    pieces = [suspect]
    attempts = itertools.count(suspect.attempt)
    while pieces:
        work = replace(pieces.pop(), attempt=next(attempts))
        try:
            account(_outcome(client.submit(run_block, work, pure=False)))
        except KilledWorker as error:
            halves = work.halves()
            pieces += reversed(halves)
            if not halves:
                died = f"its worker died again and again ({error.allowed_failures + 1} times)"
                account(write_off(work, f"{died}, memory is the usual cause"))
