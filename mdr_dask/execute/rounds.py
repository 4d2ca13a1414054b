"""Run a campaign stage after stage and round after round, until no result is missing in the store.

A stage is the campaign with the present values of all adaptive axes. The first round of a stage computes the first
realisations of all cases. Further rounds add realisations to cases whose errors are too large. The stored results
determine the next stage and round. A run can therefore be stopped and repeated at any time.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mdr_dask import models, store
from mdr_dask.arrays import BoolArray, FloatArray, IntArray
from mdr_dask.campaign import Campaign
from mdr_dask.errors import StoreError
from mdr_dask.execute.cells import Cells, find_cells, owners, tasks
from mdr_dask.execute.events import Event, Progress, Tell, ended
from mdr_dask.execute.executors import Executor
from mdr_dask.execute.resources import Resources
from mdr_dask.execute.stages import Places, cases_of, following, stored_layout
from mdr_dask.plan import Template
from mdr_dask.refinement import Stage
from mdr_dask.replication import LEAST_GROWTH, growth_needed, known_scatter, next_round
from mdr_dask.store import Lock, Part
from mdr_dask.task import Outcome, Work

#: Time in s between two checks (`LOOK`) and between two messages (`PAUSE`) of the progress of other parts.
LOOK, PAUSE = 1.0, 4.0


@dataclass(frozen=True)
class _Job:
    """The arguments of a run: what to compute, where, and the functions that receive progress and events."""

    stage: Stage
    url: str
    lock: Lock
    execute: Executor
    part: Part | None
    retry_failed: bool
    report: Callable[[Progress], None]
    tell: Tell


@dataclass(frozen=True)
class _Round:
    # Shape, chunks and coordinates of every group of the store.
    layout: tuple[Template, ...]
    # Masks for each group. `asked`: cases of the stage. `needed`: cases that need the realisations of this round.
    asked: list[BoolArray]
    needed: list[BoolArray]
    # Index of the first realisation of the round, and index of the last realisation of the round plus 1.
    realisations: tuple[int, int]
    # For each group, the number of realisations of each case after the round.
    taken: tuple[IntArray, ...]


def run(
    campaign: Campaign,
    url: str,
    resources: Resources,
    report: Callable[[Progress], None],
    retry_failed: bool = False,
    part: Part | None = None,
    tell: Tell = lambda _: None,
) -> Progress:
    """Compute the results of a campaign that are missing in the store, and return the final progress.

    `report` receives the progress after every block. `tell` receives every event, from any thread. With a `part`, only
    the blocks of this part are computed and counted. Other parts may run at the same time.
    """
    if campaign.replication.answers:
        from mdr_dask.fits.answers import require_known

        require_known(campaign)
    models.require_current(campaign.model)
    stage = Stage.first(campaign)
    stored_layout(stage, url)  # an error raised here leaves nothing locked
    url = store.absolute(url)  # a model may change the working directory later
    with Executor(resources, campaign.model, tell) as execute:
        if not store.exists(url):
            execute.connect()  # after a failure here, no store is created
        with store.exclusive(url) if part is None else store.shared(url, part) as lock:
            if store.exists(url):
                store.require_undamaged(url, store.series_names(url), to_run=True)
            if lock.after_crash:
                execute.apart()
            job = _Job(stage, url, lock, execute, part, retry_failed, report, tell)
            progress = _run_stages(job)
            if progress.blocks:
                _merge(job)
            return progress


def _merge(job: _Job) -> None:
    """Merge the record files, and warn if different kinds of machine have computed the blocks."""
    names = store.series_names(job.url)
    for name in names:
        store.merge_records(job.url, name)
    kinds = store.kinds(job.url, names)
    if len(kinds) > 1:
        found = "; ".join(f"{kind} ({count} blocks)" for kind, count in kinds.items())
        sentence = f"blocks come from {len(kinds)} kinds of machine, last digits may differ: {found}"
        job.tell(Event("kinds of machine", kinds, sentence))


def outlook(campaign: Campaign, url: str) -> Progress:
    """Return how many results of a campaign are in the store and how many results are missing.

    The count includes the first round of every stage up to the first unfinished stage. If outputs have tolerances for
    standard errors, only the first stage is counted.
    """
    stage: Stage | None = Stage.first(campaign)
    count = campaign.replication.at_least
    progress = Progress()
    while stage is not None:
        layout, places = stored_layout(stage, url)
        asked = cases_of(stage, layout, places, stage.new)
        pairs = zip(layout, asked, strict=True)
        groups = [find_cells(url, template, mask, mask, (0, count), retry_failed=False) for template, mask in pairs]
        progress = _begin_round(progress, groups)
        if progress.to_do or campaign.replication.until or not stage.is_adaptive:
            break
        stage, _ = following(url, stage, layout, places, count)
    return progress


def _run_stages(job: _Job) -> Progress:
    start = time.monotonic()
    progress = Progress()

    def settle(work: Work, outcome: Outcome) -> None:
        nonlocal progress
        progress = progress.after(outcome, time.monotonic() - start)
        job.tell(ended(work, outcome))
        job.report(progress)

    def run_round(current: _Round, groups: list[Cells]) -> None:
        nonlocal progress
        progress = _begin_round(progress, groups)
        job.report(progress)
        if any(cells.new for cells in groups):
            with store.while_locked(job.url, job.lock):
                pass  # entering the context raises StoreError in a read-only store
            job.execute(tasks(job.url, groups, job.lock), settle)
            _require_seen(job, current)
        facts = {"realisations": current.realisations[1], "done": progress.done, "failed": progress.failed}
        job.tell(Event("round ended", facts))

    reached = 0
    while last := _run_rounds(_without_answers(job) if job.stage.is_adaptive else job, run_round):
        reached = max(reached, last.realisations[1])
        if not job.stage.is_adaptive:
            break
        after, event = following(job.url, job.stage, *stored_layout(job.stage, job.url), reached)
        job.tell(event)
        if after is None:
            _end_stages(job, run_round, reached)
            break
        job = replace(job, stage=after)
    return replace(progress, wall_seconds=time.monotonic() - start)


def _run_rounds(
    job: _Job, run_round: Callable[[_Round, list[Cells]], None], current: _Round | None = None
) -> _Round | None:
    """Run the rounds of a stage and return the last round. Return None if an unfinished part is not running."""
    replication = job.stage.campaign.replication
    while current is None or (replication.goes_on and current.realisations[1] < replication.at_most):
        further = _next(job, current)
        if not any(mask.any() for mask in further.needed):
            break
        current = further
        run_round(current, _find(job, current))
        is_last = current.realisations[1] == replication.at_most and not job.stage.is_adaptive
        if job.part and not is_last and not _others_are_done(job, job.part, current):
            return None
    if current and replication.answers:
        from mdr_dask.execute.answers import unanswered

        if short := list(unanswered(job.url, job.stage, current.layout, current.taken)):
            job.tell(Event("not answered", {"answers": len(short)}, "; ".join(short)))
    return current


def _end_stages(job: _Job, run_round: Callable[[_Round, list[Cells]], None], realisations: int) -> None:
    """After the last stage, add realisations for fitted constants, then mark missing results as not needed."""
    layout, places = stored_layout(job.stage, job.url)
    if job.stage.campaign.replication.answers:
        job = replace(job, stage=replace(job.stage, new=tuple(mesh.cases for mesh in job.stage.meshes)))
        asked = cases_of(job.stage, layout, places, job.stage.new)
        taken = tuple(np.where(mask, realisations, 0) for mask in asked)
        last = _run_rounds(job, run_round, _Round(layout, asked, asked, (0, realisations), taken))
        if last is None:
            return
        realisations = last.realisations[1]
        layout, places = stored_layout(job.stage, job.url)
    asked = cases_of(job.stage, layout, places, [np.ones(mesh.cases.shape, dtype=bool) for mesh in job.stage.meshes])
    nothing = [np.zeros_like(mask) for mask in asked]
    taken = tuple(mask.astype(np.int64) for mask in nothing)
    rest = _Round(layout, asked, nothing, (0, realisations), taken)
    run_round(rest, [replace(cells, kept=0, failed=0) for cells in _find(job, rest)])


def _without_answers(job: _Job) -> _Job:
    """Return the job without tolerances of fitted constants, for the stages before the last stage."""
    campaign = job.stage.campaign
    campaign = replace(campaign, replication=replace(campaign.replication, answers={}))
    return replace(job, stage=replace(job.stage, campaign=campaign))


def _next(job: _Job, last: _Round | None) -> _Round:
    """Return the next round, and extend the store if a case needs more realisations. Meanwhile, other parts wait."""
    replication = job.stage.campaign.replication
    with store.gate(job.url):
        layout, places = stored_layout(job.stage, job.url)
        asked = cases_of(job.stage, layout, places, job.stage.new)
        before, count, needed = 0, replication.at_least, asked
        if last:
            before = last.realisations[1]
            growth = _growth(job, layout, places, last)
            needed = [each > 1 for each in growth]
            count = next_round(replication, before, np.concatenate([each.ravel() for each in growth]))
        if any(mask.any() for mask in needed):
            layout = _laid_out(job, layout, count)
    earlier = last.taken if last else [np.zeros(mask.shape, dtype=np.int64) for mask in needed]
    taken = tuple(np.where(mask, count, number) for mask, number in zip(needed, earlier, strict=True))
    return _Round(layout, asked, needed, (before, count), taken)


def _laid_out(job: _Job, layout: tuple[Template, ...], count: int) -> tuple[Template, ...]:
    """Lay out a study for `count` realisations, unless this was done before."""
    sizes = [{**t.sizes, "realisation": max(t.sizes["realisation"], count)} for t in layout]
    layout = tuple(replace(template, sizes=each) for template, each in zip(layout, sizes, strict=True))
    if not store.is_laid_out(job.url, layout):
        job.tell(Event("laying out", {"realisations": count}))
        with store.while_locked(job.url, job.lock):
            store.lay_out(job.url, layout)
    blocks = {template.series.name or "-": list(template.grid) for template in layout}
    job.tell(Event("laid out", {"realisations": count, "blocks": blocks}))
    return layout


def _growth(job: _Job, layout: tuple[Template, ...], places: Places, last: _Round) -> list[FloatArray]:
    """Return the factor by which the realisations of each case must grow; at most 1 if the case has enough."""
    own = [
        np.where(mask, _growth_of(job.url, template, last.realisations[1]), 0.0) if mask.any() else np.zeros(mask.shape)
        for mask, template in zip(last.needed, layout, strict=True)
    ]
    if not job.stage.campaign.replication.answers:
        return own
    from mdr_dask.execute.answers import cases_that_narrow

    narrow = cases_that_narrow(job.url, job.stage, layout, places, last.taken)
    # least growth, because the number of realisations that a fitted constant needs cannot be estimated
    return [np.where(cases, np.maximum(each, LEAST_GROWTH), each) for each, cases in zip(own, narrow, strict=True)]


def _growth_of(url: str, template: Template, count: int) -> FloatArray:
    until, name = template.campaign.replication.until, template.series.name
    known = known_scatter(models.load(template.campaign.model), until, template.campaign.outputs)
    values = {output: store.values(url, name, output)[..., :count] for output in until}
    within = {output: store.values(url, name, own)[..., :count] for output, own in known.items()}
    return growth_needed(values, store.ledger(url, name, template.shape)[..., :count], until, within)


def _find(job: _Job, current: _Round) -> list[Cells]:
    own: list[BoolArray | None] = [None] * len(current.layout)
    if job.part:
        own = [numbers == job.part.number for numbers in owners(current.layout, job.part.count)]
    return [
        find_cells(job.url, template, asked, needed, current.realisations, job.retry_failed, own_here)
        for template, asked, needed, own_here in zip(current.layout, current.asked, current.needed, own, strict=True)
    ]


def _require_seen(job: _Job, current: _Round) -> None:
    """Raise StoreError if this process does not find all computed results in the store."""
    lost = sum(cells.new for cells in _find(replace(job, retry_failed=False), current))
    if lost:
        where = "workers need a shared file system or a URL"
        raise StoreError(f"{job.url}: {lost} results that were computed cannot be found from this machine; {where}")


def _others_are_done(job: _Job, part: Part, current: _Round) -> bool:
    """Wait until the other parts have finished a round; return False if an unfinished part is not running."""
    what = f"the round of {current.realisations[1]} realisations needs results of parts"
    reported = time.monotonic()
    while True:
        here = {other.number for other in store.at_work(job.url)[1]}
        groups = _find(replace(job, part=None, retry_failed=False), current)
        numbers = owners(current.layout, part.count)
        missing = (owner[cells.wanted | cells.spared] for owner, cells in zip(numbers, groups, strict=True))
        late = {int(number) for each in missing for number in each}
        if not late:
            return True
        if late - here:
            sentence = f"{what} that are not at work: {_named(late - here, part)}; start them, then this one again"
            job.tell(Event("round unfinished", {"parts": sorted(late - here)}, sentence))
            return False
        if time.monotonic() - reported > PAUSE:
            reported = time.monotonic()
            job.tell(Event("waiting for parts", {"parts": sorted(late)}, f"{what} {_named(late, part)}: waiting"))
        time.sleep(LOOK)


def _named(numbers: set[int], part: Part) -> str:
    return ", ".join(str(Part(number, part.count)) for number in sorted(numbers))


def _begin_round(progress: Progress, groups: list[Cells]) -> Progress:
    kept = sum(cells.kept for cells in groups)
    work = sum(cells.operations(index) for cells in groups if cells.new for index in cells.template.block_indices())
    return replace(
        progress,
        total=progress.total + kept + sum(cells.new for cells in groups),
        kept=progress.kept + kept,
        kept_failed=progress.kept_failed + sum(cells.failed for cells in groups),
        estimated=progress.estimated + work,
    )
