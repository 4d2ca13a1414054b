"""A run: round after round, until nothing of a campaign is missing in its store."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mdr_dask import store
from mdr_dask.campaign import Campaign
from mdr_dask.execute.cells import Cells, find_cells, tasks
from mdr_dask.execute.executors import Execute, Resources, executor
from mdr_dask.execute.progress import Progress
from mdr_dask.plan import Template, templates
from mdr_dask.replication import needs_more, rounds
from mdr_dask.task import Outcome


def run(
    campaign: Campaign,
    url: str,
    resources: Resources,
    report: Callable[[Progress], None],
    retry_failed: bool = False,
) -> Progress:
    """Run a campaign into a store: everything, or what is missing.

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
    _plan(campaign, url)  # what is refused leaves no lock behind
    with store.lock(url) as runner:
        layout, asked = _plan(campaign, url)
        store.sweep(url)
        with executor(resources) as execute:
            return _run_rounds(url, runner, layout, asked, execute, report, retry_failed)


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
    groups = [find_cells(url, t, mask, mask, first, retry_failed=False) for t, mask in zip(layout, asked, strict=True)]
    return _begin_round(Progress(), groups)


def _plan(campaign: Campaign, url: str) -> tuple[tuple[Template, ...], list[NDArray[np.bool_]]]:
    """Lay out a campaign together with what is stored of it; say which cases it asks for."""
    if not store.exists(url):
        layout = templates(campaign, campaign.replication.at_least)
        return layout, [np.ones(template.shape[:-1], dtype=bool) for template in layout]
    stored = store.reconcile(url, campaign)
    layout = templates(stored.campaign, max(campaign.replication.at_least, stored.realisations), stored.chunks)
    asked = [stored.asked.get(t.series.name, np.ones(t.shape[:-1], dtype=bool)) for t in layout]
    return layout, asked


def _run_rounds(
    url: str,
    runner: str,
    layout: tuple[Template, ...],
    asked: list[NDArray[np.bool_]],
    execute: Execute,
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
        progress = progress.after(outcome, time.monotonic() - start)
        report(progress)

    for count in rounds(campaign.replication):
        if before:
            needed = [mask & _still_wide(url, t, before) for mask, t in zip(needed, layout, strict=True)]
            if not any(mask.any() for mask in needed):
                break
            layout = _grow(layout, count)
        with store.holding(url, runner):
            store.lay_out(url, layout)
        groups = [
            find_cells(url, template, asked_here, needed_here, (before, count), retry_failed)
            for template, asked_here, needed_here in zip(layout, asked, needed, strict=True)
        ]
        progress = _begin_round(progress, groups)
        report(progress)
        execute(tasks(url, groups, runner), account)
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


def _begin_round(progress: Progress, groups: list[Cells]) -> Progress:
    kept = sum(cells.kept for cells in groups)
    work = sum(cells.seconds(index) for cells in groups for index in cells.template.block_indices())
    return replace(
        progress,
        total=progress.total + kept + sum(cells.new for cells in groups),
        kept=progress.kept + kept,
        estimated=progress.estimated + work,
    )
