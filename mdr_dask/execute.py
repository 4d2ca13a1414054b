"""Plan and store through Dask: resume, retries, failures, progress. The only module that knows Dask."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask import store
from mdr_dask.campaign import Campaign
from mdr_dask.models.base import Status
from mdr_dask.plan import Template, templates
from mdr_dask.replication import needs_more, rounds
from mdr_dask.task import Outcome, Work, run_block, write_off

if TYPE_CHECKING:
    from distributed import Client, Future

#: Blocks handed to the threads at a time: the graph never grows with the study.
THREAD_WINDOW = 64


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
    compute_seconds: float = 0.0
    write_seconds: float = 0.0
    wall_seconds: float = 0.0

    @property
    def to_do(self) -> int:
        """Results still to come in this round."""
        return self.total - self.kept - self.done - self.failed - self.not_needed


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
        chunks: Mapping[str, Mapping[str, int]] = {}
        realisations = 0
        if store.exists(url):
            stored = store.reconcile(url, campaign)
            campaign, chunks, realisations = stored.campaign, stored.chunks, stored.realisations
        layout = templates(campaign, max(campaign.replication.at_least, realisations), chunks)
        with _executor(resources) as execute:
            return _run_rounds(url, layout, execute, report, retry_failed)


_Execute = Callable[[Iterable[Work], Callable[[Outcome], None]], None]


def _run_rounds(
    url: str, layout: tuple[Template, ...], execute: _Execute, report: Callable[[Progress], None], retry_failed: bool
) -> Progress:
    """Run round after round, each over the cases that the one before left too uncertain."""
    campaign = layout[0].campaign
    start = time.monotonic()
    progress = Progress()
    needed = [np.ones(template.shape[:-1], dtype=bool) for template in layout]
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
        found = [_cells(url, t, mask, (before, count), retry_failed) for t, mask in zip(layout, needed, strict=True)]
        progress = _begin_round(progress, found)
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
    return needs_more(values, store.ledger(url, template.series.name)[..., :count], until)


@dataclass(frozen=True)
class _Cells:
    """Which results of a group a round has to compute, and which only need a word in the ledger."""

    wanted: NDArray[np.bool_]
    unsettled: NDArray[np.bool_]
    kept: int


def _cells(
    url: str, template: Template, needed: NDArray[np.bool_], realisations: tuple[int, int], retry_failed: bool
) -> _Cells:
    status = store.ledger(url, template.series.name)
    open_states = [Status.MISSING, Status.NOT_NEEDED]
    if retry_failed:
        open_states += [Status.FAILED, Status.NOT_CONVERGED]
    in_round = np.zeros(status.shape, dtype=bool)
    in_round[..., slice(*realisations)] = True
    wanted = in_round & needed[..., None] & np.isin(status, open_states)
    unsettled = in_round & ~wanted & (status == Status.MISSING)
    return _Cells(wanted, unsettled, int(np.count_nonzero(in_round & ~wanted & ~unsettled)))


def _begin_round(progress: Progress, found: list[_Cells]) -> Progress:
    kept = sum(cells.kept for cells in found)
    new = sum(int(np.count_nonzero(cells.wanted) + np.count_nonzero(cells.unsettled)) for cells in found)
    return replace(progress, total=progress.total + kept + new, kept=progress.kept + kept)


def _work(url: str, layout: tuple[Template, ...], found: list[_Cells]) -> Iterator[Work]:
    """Yield the tasks of a round, lazily, so that only a window of them exists at a time."""
    for template, cells in zip(layout, found, strict=True):
        attempts = store.attempts(url, template.series.name)
        for index in template.block_indices():
            region = template.region(index)
            wanted = cells.wanted[region]
            if wanted.any() or cells.unsettled[region].any():
                yield Work(
                    url=url,
                    model=template.campaign.model,
                    series=template.series.name,
                    index=index,
                    region=region,
                    block=template.block(index),
                    wanted=None if wanted.all() else wanted,
                    attempt=attempts.get(index, 0) + 1,
                )


def _add(progress: Progress, outcome: Outcome, wall_seconds: float) -> Progress:
    return replace(
        progress,
        done=progress.done + outcome.counts[Status.DONE],
        failed=progress.failed + outcome.counts[Status.FAILED] + outcome.counts[Status.NOT_CONVERGED],
        not_needed=progress.not_needed + outcome.counts[Status.NOT_NEEDED],
        blocks=progress.blocks + 1,
        solves=progress.solves + outcome.solves,
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
    """Run on Dask's threaded scheduler: no server, no sockets; a window of blocks is a graph."""
    import dask
    from dask.callbacks import Callback

    def finished(_key: object, value: object, *_: object) -> None:
        if isinstance(value, Outcome):
            account(value)

    task = dask.delayed(run_block, pure=False, traverse=False)
    remaining = iter(works)
    with Callback(posttask=finished):
        while window := list(itertools.islice(remaining, THREAD_WINDOW * threads)):
            dask.compute(
                [task(work) for work in window], scheduler="threads", num_workers=threads, optimize_graph=False
            )


@contextmanager
def _client(resources: Resources) -> Iterator[Client]:
    from distributed import Client, LocalCluster

    if resources.scheduler is not None:
        with Client(resources.scheduler, set_as_default=False) as client:
            yield client
        return
    if resources.cluster is not None:
        package, _, name = resources.cluster["class"].rpartition(".")
        cluster = getattr(import_module(package), name)(**resources.cluster.get("arguments", {}))
        cluster.scale(**resources.cluster.get("scale", {}))
    else:
        cluster = LocalCluster(
            n_workers=resources.workers,
            threads_per_worker=1,
            dashboard_address="127.0.0.1:0",
            scheduler_port=0,
            protocol="tcp://",
        )
    with cluster, Client(cluster, set_as_default=False) as client:
        yield client


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
            account(future.result())
        except KilledWorker:
            suspects.append(work)
        future.release()
        fill()
    for work in suspects:
        _run_suspect(client, work, account)


def _run_suspect(client: Client, work: Work, account: Callable[[Outcome], None]) -> None:
    """Run one block with nothing else on the cluster; if it kills its workers again, it is written down as failed."""
    from distributed import KilledWorker

    try:
        account(client.submit(run_block, work, pure=False).result())
    except KilledWorker as error:
        account(
            write_off(
                work, f"its worker died again and again ({error.allowed_failures} times), memory is the usual cause"
            )
        )
