"""Plan and store through Dask: resume, retries, failures, progress. The only module that knows Dask."""

from __future__ import annotations

import itertools
import logging
import os
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask import store
from mdr_dask.campaign import Campaign
from mdr_dask.errors import ClusterError
from mdr_dask.models.base import Status
from mdr_dask.plan import BlockIndex, Template, templates
from mdr_dask.replication import needs_more, rounds
from mdr_dask.store import Place
from mdr_dask.task import Outcome, Work, run_block, versions, write_off

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
        Threads of this process; None for one a core.
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


@dataclass(frozen=True)
class Progress:
    """The state of a run, in results (one case in one realisation).

    Parameters
    ----------
    total, kept, done, failed, not_needed : int
        All results of the campaign so far, those found in the store, and those of this run.
    blocks, solves : int
        Blocks run and solutions really computed in this run.
    estimated, finished : float
        Seconds of work by the model's estimate: that of all rounds so far, and that of the blocks run.
    compute_seconds, write_seconds, wall_seconds : float
        Time in models and in writing, summed over threads, and time since the start.
    """

    total: int = 0
    kept: int = 0
    done: int = 0
    failed: int = 0
    not_needed: int = 0
    blocks: int = 0
    solves: int = 0
    estimated: float = 0.0
    finished: float = 0.0
    compute_seconds: float = 0.0
    write_seconds: float = 0.0
    wall_seconds: float = 0.0

    @property
    def to_do(self) -> int:
        """Results still to come in this round."""
        return self.total - self.kept - self.done - self.failed - self.not_needed

    @property
    def seconds_left(self) -> float | None:
        """Time until the end of this round at the pace so far, each block weighted by its estimate; None before any."""
        if not self.finished > 0:
            return None
        return self.wall_seconds * max(self.estimated / self.finished - 1, 0.0)


def run(
    campaign: Campaign,
    url: str,
    resources: Resources,
    report: Callable[[Progress], None],
    retry_failed: bool = False,
) -> Progress:
    """Run a campaign into a store, or whatever of it is not there yet.

    Parameters
    ----------
    campaign : Campaign
        What to compute.
    url : str
        Path or URL of the store; made, resumed or extended.
    resources : Resources
        Where to compute it.
    report : callable
        Called with the progress after every block.
    retry_failed : bool
        Compute the cases again that failed or did not converge.

    Returns
    -------
    Progress
        The state at the end.

    Raises
    ------
    StoreError
        If the store was made from another campaign; nothing is touched.
    StoreBusyError
        If another runner is at work on it.
    CampaignError
        If the campaign is too large to be run.
    """
    with store.lock(url):
        layout, asked = _plan(campaign, url)
        store.sweep(url)
        with _executor(resources) as execute:
            return _run_rounds(url, layout, asked, execute, report, retry_failed)


def outlook(campaign: Campaign, url: str) -> Progress:
    """Return what a store holds of the first round of a campaign, without touching it; results kept and to do.

    Raises
    ------
    StoreError
        If the store was made from another campaign.
    CampaignError
        If the campaign is too large to be run.
    """
    layout, asked = _plan(campaign, url)
    first = (0, next(rounds(campaign.replication)))
    found = [_cells(url, t, mask, mask, first, retry_failed=False) for t, mask in zip(layout, asked, strict=True)]
    return _begin_round(Progress(), layout, found)


def _plan(campaign: Campaign, url: str) -> tuple[tuple[Template, ...], list[NDArray[np.bool_]]]:
    """Lay out a campaign together with what is stored of it; say which cases it asks for."""
    if not store.exists(url):
        layout = templates(campaign, campaign.replication.at_least)
        return layout, [np.ones(template.shape[:-1], dtype=bool) for template in layout]
    stored = store.reconcile(url, campaign)
    layout = templates(stored.campaign, max(campaign.replication.at_least, stored.realisations), stored.chunks)
    asked = [stored.asked.get(t.series.name, np.ones(t.shape[:-1], dtype=bool)) for t in layout]
    return layout, asked


_Execute = Callable[[Iterable[Work], Callable[[Outcome], None]], None]


def _run_rounds(
    url: str,
    layout: tuple[Template, ...],
    asked: list[NDArray[np.bool_]],
    execute: _Execute,
    report: Callable[[Progress], None],
    retry_failed: bool,
) -> Progress:
    """Run round after round, each over the cases that the one before left too uncertain."""
    campaign = layout[0].campaign
    start = time.monotonic()
    progress = Progress()
    needed = asked
    before = 0

    def account(outcome: Outcome) -> None:
        nonlocal progress
        progress = _add(progress, outcome, time.monotonic() - start)
        report(progress)

    for count in rounds(campaign.replication):
        if before:
            needed = [mask & _still_wide(url, t, before) for mask, t in zip(needed, layout, strict=True)]
            if not any(mask.any() for mask in needed):
                break
            layout = _grow(layout, count)
        store.lay_out(url, layout)
        found = [
            _cells(url, template, asked_here, needed_here, (before, count), retry_failed)
            for template, asked_here, needed_here in zip(layout, asked, needed, strict=True)
        ]
        progress = _begin_round(progress, layout, found)
        report(progress)
        execute(_work(url, layout, found), account)
        before = count
    return replace(progress, wall_seconds=time.monotonic() - start)


def _grow(layout: tuple[Template, ...], realisations: int) -> tuple[Template, ...]:
    return tuple(
        replace(t, sizes={**t.sizes, "realisation": max(t.sizes["realisation"], realisations)}) for t in layout
    )


def _still_wide(url: str, template: Template, count: int) -> NDArray[np.bool_]:
    until = template.campaign.replication.until
    values = {name: store.values(url, template.series.name, name)[..., :count] for name in until}
    return needs_more(values, store.ledger(url, template.series.name, template.shape)[..., :count], until)


@dataclass(frozen=True)
class _Cells:
    """Which results of a group a round has to compute, and which only need a word in the ledger."""

    wanted: NDArray[np.bool_]
    spared: NDArray[np.bool_]
    kept: int


def _cells(
    url: str,
    template: Template,
    asked: NDArray[np.bool_],
    needed: NDArray[np.bool_],
    realisations: tuple[int, int],
    retry_failed: bool,
) -> _Cells:
    status = store.ledger(url, template.series.name, template.shape)
    open_states = [Status.MISSING, Status.NOT_NEEDED]
    if retry_failed:
        open_states += [Status.FAILED, Status.NOT_CONVERGED]
    in_round = np.zeros(status.shape, dtype=bool)
    in_round[..., slice(*realisations)] = asked[..., None]
    wanted = in_round & needed[..., None] & np.isin(status, open_states)
    spared = in_round & ~wanted & (status == Status.MISSING)
    return _Cells(wanted, spared, int(np.count_nonzero(in_round & ~wanted & ~spared)))


def _begin_round(progress: Progress, layout: tuple[Template, ...], found: list[_Cells]) -> Progress:
    kept = sum(cells.kept for cells in found)
    new = sum(int(np.count_nonzero(cells.wanted) + np.count_nonzero(cells.spared)) for cells in found)
    work = sum(
        _estimate(template, index, cells)
        for template, cells in zip(layout, found, strict=True)
        for index in template.block_indices()
    )
    return replace(
        progress, total=progress.total + kept + new, kept=progress.kept + kept, estimated=progress.estimated + work
    )


def _estimate(template: Template, index: BlockIndex, cells: _Cells) -> float:
    """Return the seconds that a block should take, in proportion to what is wanted of it."""
    wanted = cells.wanted[template.region(index)]
    part = float(np.mean(wanted))
    return part * template.seconds(index) if part else 0.0


def _work(url: str, layout: tuple[Template, ...], found: list[_Cells]) -> Iterator[Work]:
    """Yield the tasks of a round, lazily, so that only a window of them exists at a time."""
    laid_out = uuid.uuid4().hex
    for template, cells in zip(layout, found, strict=True):
        attempts = store.attempts(url, template.series.name)
        for index in template.block_indices():
            region = template.region(index)
            wanted, spared = cells.wanted[region], cells.spared[region]
            if wanted.any() or spared.any():
                yield Work(
                    place=Place(url, template.series.name, index, region, laid_out),
                    model=template.campaign.model,
                    versions=versions(template.campaign.model),
                    block=template.block(index),
                    wanted=wanted,
                    spared=spared,
                    attempt=attempts.get(index, 0) + 1,
                    estimate=_estimate(template, index, cells),
                )


def _add(progress: Progress, outcome: Outcome, wall_seconds: float) -> Progress:
    return replace(
        progress,
        done=progress.done + outcome.counts[Status.DONE],
        failed=progress.failed + outcome.counts[Status.FAILED] + outcome.counts[Status.NOT_CONVERGED],
        not_needed=progress.not_needed + outcome.counts[Status.NOT_NEEDED],
        blocks=progress.blocks + 1,
        solves=progress.solves + outcome.solves,
        finished=progress.finished + outcome.estimate,
        compute_seconds=progress.compute_seconds + outcome.compute_seconds,
        write_seconds=progress.write_seconds + outcome.write_seconds,
        wall_seconds=wall_seconds,
    )


# --- ways to run tasks ---


@contextmanager
def _executor(resources: Resources) -> Iterator[_Execute]:
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
