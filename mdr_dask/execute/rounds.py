"""Run a campaign stage after stage and round after round, until no result is missing in the store.

A stage is the campaign with the present values of all adaptive axes. The first round of a stage computes the first
realisations of all cases that earlier stages lack. Further rounds add realisations to cases whose standard errors are
too large. The stored results determine the next stage and round. A run can therefore be stopped and repeated at any
time.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from mdr_dask import models, store
from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.campaign import Campaign
from mdr_dask.errors import LOOK, PAUSE, StoreError
from mdr_dask.execute.cells import Cells, find_cells, owners, tasks
from mdr_dask.execute.events import Event, Progress, Tell, ended
from mdr_dask.execute.executors import Executor
from mdr_dask.execute.resources import Resources
from mdr_dask.execute.stages import cases_of, following, stored_layout
from mdr_dask.plan import Template
from mdr_dask.refinement import Stage
from mdr_dask.replication import growth_needed, known_scatter, next_round
from mdr_dask.store import Lock, Part
from mdr_dask.task import Outcome, Work


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

    If `retry_failed` is true, results that failed or did not converge are computed again. `report` receives the
    progress at the start of every round and after every block. `tell` receives every event, from any thread. With a
    `part`, only the blocks of this part are computed and counted. Other parts may run at the same time.
    """
    models.require_current(campaign.model)
    stored_layout(Stage.first(campaign), url)  # an error is raised here, before anything is locked
    url = store.absolute(url)  # a model may change the working directory later
    with Executor(resources, campaign.model, tell) as execute:
        if not store.exists(url):
            execute.connect()  # after a failure here, no store is created
        with store.exclusive(url) if part is None else store.shared(url, part) as lock:
            if store.exists(url):
                store.require_undamaged(url, store.series_names(url), to_run=True)
            if lock.after_crash:
                execute.apart()
            job = _Run(url, lock, execute, part, retry_failed, report, tell)
            job.run_stages(campaign)
            if job.progress.blocks:
                for name in store.series_names(url):
                    store.merge_records(url, name)
            return replace(job.progress, wall_seconds=time.monotonic() - job.started)


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
        progress = _with_round(progress, _Round(layout, asked, asked, (0, count)).cells(url))
        if progress.to_do or campaign.replication.goes_on or not stage.is_adaptive:
            break
        stage, _ = following(url, stage, layout, places, count)
    return progress


@dataclass(frozen=True)
class _Round:
    # Shape, chunks and coordinates of every group of the store.
    layout: tuple[Template, ...]
    # Masks for each group. `asked`: cases whose results the round computes or marks as not needed. `needed`: cases that
    # need the realisations of this round.
    asked: list[BoolArray]
    needed: list[BoolArray]
    # Index of the first realisation of the round, and the index that follows its last realisation.
    realisations: tuple[int, int]

    def cells(self, url: str, retry_failed: bool = False, part: Part | None = None) -> list[Cells]:
        """Return the results that are missing for this round, of all parts or of one part."""
        own: list[BoolArray | None] = [None] * len(self.layout)
        if part:
            own = [numbers == part.number for numbers in owners(self.layout, part.count)]
        groups = zip(self.layout, self.asked, self.needed, own, strict=True)
        return [
            find_cells(url, template, asked, needed, self.realisations, retry_failed, mask)
            for template, asked, needed, mask in groups
        ]


@dataclass
class _Run:
    """The arguments of a run, and its progress."""

    url: str
    lock: Lock
    execute: Executor
    part: Part | None
    retry_failed: bool
    report: Callable[[Progress], None]
    tell: Tell
    started: float = field(default_factory=time.monotonic)
    progress: Progress = field(default_factory=Progress)

    def run_stages(self, campaign: Campaign) -> None:
        """Run all rounds of all stages. Stop if the run needs results of a part that is not running."""
        stage: Stage | None = Stage.first(campaign)
        most = 0
        while stage is not None:
            count = self.run_rounds(stage)
            if count is None or not stage.is_adaptive:
                return
            most = max(most, count)
            after, event = following(self.url, stage, *stored_layout(stage, self.url), most)
            self.tell(event)
            if after is None:
                self.mark_rest(stage, most)
            stage = after

    def run_rounds(self, stage: Stage) -> int | None:
        """Run the rounds of a stage; return the number of realisations, or None if a needed part is not running."""
        replication = stage.campaign.replication
        current = self.plan_round(stage, None)
        while any(mask.any() for mask in current.needed):
            self.run_round(current, current.cells(self.url, self.retry_failed, self.part))
            count = current.realisations[1]
            is_last = count == replication.at_most
            if self.part and not (is_last and not stage.is_adaptive) and not self.others_are_done(self.part, current):
                return None
            if is_last or not replication.goes_on:
                return count
            current = self.plan_round(stage, current)
        return current.realisations[0]

    def plan_round(self, stage: Stage, last: _Round | None) -> _Round:
        """Return the next round. If any case needs this round, lay out the store for it. Other parts wait meanwhile."""
        replication = stage.campaign.replication
        with store.gate(self.url):
            layout, places = stored_layout(stage, self.url)
            asked = cases_of(stage, layout, places, stage.new)
            before, count, needed = 0, replication.at_least, asked
            if last:
                before = last.realisations[1]
                pairs = zip(layout, last.needed, strict=True)
                growth = [_growth(self.url, template, mask, before) for template, mask in pairs]
                needed = [each > 1 for each in growth]
                count = next_round(replication, before, np.concatenate([each.ravel() for each in growth]))
            if any(mask.any() for mask in needed):
                layout = self.laid_out(layout, count)
        return _Round(layout, asked, needed, (before, count))

    def laid_out(self, layout: tuple[Template, ...], count: int) -> tuple[Template, ...]:
        """Lay out a study for at least `count` realisations, unless this was done before; return the layout."""
        sizes = [{**t.sizes, "realisation": max(t.sizes["realisation"], count)} for t in layout]
        layout = tuple(replace(template, sizes=each) for template, each in zip(layout, sizes, strict=True))
        if not store.is_laid_out(self.url, layout):
            self.tell(Event("laying out", {"realisations": count}))
            with store.while_locked(self.url, self.lock):
                store.lay_out(self.url, layout)
        blocks = {template.series.name or "-": list(template.grid) for template in layout}
        self.tell(Event("laid out", {"realisations": count, "blocks": blocks}))
        return layout

    def run_round(self, current: _Round, groups: list[Cells]) -> None:
        """Compute the missing results of a round, and check that this process finds them in the store."""
        self.progress = _with_round(self.progress, groups)
        self.report(self.progress)
        if any(cells.new for cells in groups):
            with store.while_locked(self.url, self.lock):
                pass  # entering the context raises StoreError in a read-only store
            self.execute(tasks(self.url, groups, self.lock), self.settle)
            lost = sum(cells.new for cells in current.cells(self.url, part=self.part))
            if lost:
                where = "workers need a shared file system or a URL"
                what = f"{lost} results that were computed cannot be found from this machine"
                raise StoreError(f"{self.url}: {what}; {where}")
        done, failed = self.progress.done, self.progress.failed
        self.tell(Event("round ended", {"realisations": current.realisations[1], "done": done, "failed": failed}))

    def settle(self, work: Work, outcome: Outcome) -> None:
        """Count a finished block."""
        self.progress = self.progress.after(outcome, time.monotonic() - self.started)
        self.tell(ended(work, outcome))
        self.report(self.progress)

    def others_are_done(self, part: Part, current: _Round) -> bool:
        """Wait until the other parts have finished a round; return False if an unfinished part is not running."""
        what = f"the round of {current.realisations[1]} realisations needs results of parts"
        reported = time.monotonic()
        while True:
            here = {other.number for other in store.at_work(self.url)[1]}
            numbers = owners(current.layout, part.count)
            groups = zip(numbers, current.cells(self.url), strict=True)
            late = {int(number) for owner, cells in groups for number in owner[cells.wanted | cells.spared]}
            if not late:
                return True
            if late - here:
                sentence = (
                    f"{what} that are not running: {_named(late - here, part)}; start these, then this part again"
                )
                self.tell(Event("round unfinished", {"parts": sorted(late - here)}, sentence))
                self.progress = replace(self.progress, is_unfinished=True)
                return False
            if time.monotonic() - reported > PAUSE:
                reported = time.monotonic()
                self.tell(Event("waiting for parts", {"parts": sorted(late)}, f"{what} {_named(late, part)}: waiting"))
            time.sleep(LOOK)

    def mark_rest(self, stage: Stage, realisations: int) -> None:
        """After the last stage, give the state "not needed" to the results that no stage has computed."""
        layout, places = stored_layout(stage, self.url)
        asked = cases_of(stage, layout, places, [np.ones(mesh.cases.shape, dtype=bool) for mesh in stage.meshes])
        rest = _Round(layout, asked, [np.zeros_like(mask) for mask in asked], (0, realisations))
        found = rest.cells(self.url, self.retry_failed, self.part)
        self.run_round(rest, [replace(cells, kept=0, failed=0) for cells in found])


def _growth(url: str, template: Template, cases: BoolArray, count: int) -> FloatArray:
    """Return the factor by which the number of realisations of each case must grow; at most 1 if there are enough.

    Cases that `cases` does not mark get 0.
    """
    if not cases.any():
        return np.zeros(cases.shape)
    until, name = template.campaign.replication.until, template.series.name
    known = known_scatter(models.load(template.campaign.model), until, template.campaign.outputs)
    values = {output: store.values(url, name, output)[..., :count] for output in until}
    within = {output: store.values(url, name, own)[..., :count] for output, own in known.items()}
    growth = growth_needed(values, store.ledger(url, name, template.shape)[..., :count], until, within)
    return np.where(cases, growth, 0.0)


def _named(numbers: set[int], part: Part) -> str:
    return ", ".join(str(Part(number, part.count)) for number in sorted(numbers))


def _with_round(progress: Progress, groups: list[Cells]) -> Progress:
    """Return the progress after a round has begun."""
    kept = sum(cells.kept for cells in groups)
    work = sum(cells.operations(index) for cells in groups if cells.new for index in cells.template.block_indices())
    return replace(
        progress,
        total=progress.total + kept + sum(cells.new for cells in groups),
        kept=progress.kept + kept,
        kept_failed=progress.kept_failed + sum(cells.failed for cells in groups),
        estimated=progress.estimated + work,
    )
