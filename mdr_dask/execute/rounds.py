"""A run: stage after stage, round after round, until nothing of a campaign is missing in its store."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mdr_dask import models, store
from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.campaign import Campaign
from mdr_dask.errors import StoreError
from mdr_dask.execute.cells import Cells, find_cells, owners, tasks
from mdr_dask.execute.events import Event, Tell, ended
from mdr_dask.execute.executors import Execute, check, executor
from mdr_dask.execute.progress import Progress
from mdr_dask.execute.resources import Resources
from mdr_dask.execute.stages import Places, cases_of, following, stored_layout
from mdr_dask.models.base import Status
from mdr_dask.plan import Template
from mdr_dask.refinement import Stage
from mdr_dask.replication import GROWTH, growth_needed, known_scatter, next_round
from mdr_dask.store import Hold, Part
from mdr_dask.task import Outcome, Rounds, Work

Masks = list[NDArray[np.bool_]]
#: Seconds between two looks at what other parts have still to do.
LOOK = 1.0
#: Seconds between two words about it.
PAUSE = 4.0


@dataclass(frozen=True)
class _Job:
    """What is to be run, and who is told; `seen` is the store before the run, by its `layout_mark`, and its shape."""

    stage: Stage
    seen: tuple[str | None, tuple[Template, ...], Places]
    url: str
    hold: Hold
    resources: Resources
    part: Part | None
    retry_failed: bool
    report: Callable[[Progress], None]
    tell: Tell


@dataclass(frozen=True)
class _Round:
    """One round: the shape of the store, its cases and those of them still needed, the realisations (from, to).

    `taken` is how many realisations each case has taken part in.
    """

    layout: tuple[Template, ...]
    places: Places
    asked: Masks
    needed: Masks
    realisations: tuple[int, int]
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
    part : Part, optional
        Only these blocks of it, while other parts run beside.
    tell : callable
        Called with every `Event`, from any thread.

    Returns
    -------
    Progress
        The state at the end, of the part if it is one.

    Raises
    ------
    StoreError
        If the store was made from another campaign; nothing is touched.
    StoreBusyError
        If another runner is at work on it.
    CampaignError
        If the campaign is too large to be run.
    ClusterError
        If a cluster cannot be started, goes away, or has no worker for too long.
    """
    check(resources)  # what is refused leaves no lock behind
    if campaign.replication.answers:
        from mdr_dask.fits.answers import require_known

        require_known(campaign)
    stage = Stage.first(campaign)
    seen = store.layout_mark(url), *stored_layout(stage, url)
    with store.alone(url) if part is None else store.beside(url, part) as hold:
        sealed = store.exists(url) and store.require_sound(url, store.series_names(url))
        job = _Job(stage, seen, url, hold, resources, part, retry_failed, report, tell)
        with executor(resources, tell) as execute:
            progress = _run_stages(job, execute)
        _settle(job, progress, sealed)
        return progress


def _settle(job: _Job, progress: Progress, sealed: bool) -> None:
    """Leave few files, and say what the last digits of the results may depend on if it is not the same for all."""
    names = store.series_names(job.url)
    for name in names:
        store.put_together(job.url, name)
        if progress.blocks or not sealed:
            store.seal(job.url, name)
    if progress.blocks:
        kinds = store.kinds(job.url, names)
        if len(kinds) > 1:
            told = "; ".join(f"{kind} ({count} blocks)" for kind, count in kinds.items())
            sentence = f"blocks come from {len(kinds)} kinds of machine, last digits may differ: {told}"
            job.tell(Event("kinds of machine", kinds, sentence))


def outlook(campaign: Campaign, url: str) -> Progress:
    """Return what a store holds of a campaign, without touching it; results kept and to do.

    Of realisations in rounds the first round counts, of adaptive axes all values that are known to be needed.

    Raises
    ------
    StoreError
        If the store was made from another campaign.
    CampaignError
        If the campaign is too large to be run.
    """
    stage: Stage | None = Stage.first(campaign)
    count = campaign.replication.at_least
    progress = Progress()
    while stage is not None:
        layout, places = stored_layout(stage, url)
        asked = cases_of(stage, layout, places, stage.new)
        groups = [
            find_cells(url, t, mask, mask, (0, count), retry_failed=False)
            for t, mask in zip(layout, asked, strict=True)
        ]
        progress = _begin_round(progress, groups)
        if progress.to_do or campaign.replication.until or not stage.is_adaptive:
            break
        stage, _ = following(url, stage, layout, places, count)
    return progress


def _run_stages(job: _Job, execute: Execute) -> Progress:
    """Run a campaign, and again with what its adaptive axes still want, until they want nothing more."""
    start = time.monotonic()
    progress = Progress()
    whole: list[Outcome] = []

    def settle(work: Work, outcome: Outcome) -> None:
        nonlocal progress
        progress = progress.after(outcome, time.monotonic() - start)
        if work.rounds:
            whole.append(outcome)
        job.tell(ended(work, outcome))
        job.report(progress)

    def run_round(current: _Round, groups: list[Cells]) -> _Round:
        nonlocal progress
        progress = _begin_round(progress, groups)
        job.report(progress)
        execute(tasks(job.url, groups, job.hold, _rounds_of_block(job, groups)), settle)
        if job.resources.remote:
            _verify(job, current)
        if whole:
            current = _gone_on(job, current, whole.pop())
        facts = {"realisations": current.realisations[1], "done": progress.done, "failed": progress.failed}
        job.tell(Event("round ended", facts))
        return current

    reached, stage = 0, job.stage
    while last := _run_rounds(_before_answers(job) if stage.is_adaptive else job, run_round):
        reached = max(reached, last.realisations[1])
        if not stage.is_adaptive:
            break
        after, event = following(job.url, stage, *stored_layout(stage, job.url), reached)
        job.tell(event)
        if after is None:
            _end_stages(job, run_round, reached)
            break
        stage = after
        job = replace(job, stage=stage)
    return replace(progress, wall_seconds=time.monotonic() - start)


def _run_rounds(
    job: _Job, run_round: Callable[[_Round, list[Cells]], _Round], current: _Round | None = None
) -> _Round | None:
    """Run round after round, each over the cases that the one before left too uncertain.

    Returns the last round; None if this part leaves while others are not done with it.
    """
    replication = job.stage.campaign.replication
    while current is None or (replication.goes_on and current.realisations[1] < replication.at_most):
        further = _lay_out(job, current)
        if not any(mask.any() for mask in further.needed):
            break
        current = run_round(further, _find(job, further))
        is_last = current.realisations[1] == replication.at_most and not job.stage.is_adaptive
        if job.part and not is_last and not _others_are_done(job, job.part, current):
            return None
    if current and (short := _unanswered(job, current)):
        job.tell(Event("not answered", {"answers": len(short)}, "; ".join(short)))
    return current


def _end_stages(job: _Job, run_round: Callable[[_Round, list[Cells]], _Round], realisations: int) -> None:
    """Go on for fitted constants with all values there are, and write down as not needed what nothing has asked for."""
    if job.stage.campaign.replication.answers:
        job = replace(job, stage=replace(job.stage, new=tuple(mesh.cases for mesh in job.stage.meshes)))
        last = _run_rounds(job, run_round, _behind(job, realisations))
        if last is None:
            return
        realisations = last.realisations[1]
    layout, places = stored_layout(job.stage, job.url)
    asked = cases_of(job.stage, layout, places, [np.ones(mesh.cases.shape, dtype=bool) for mesh in job.stage.meshes])
    nothing = [np.zeros_like(mask) for mask in asked]
    rest = _Round(layout, places, asked, nothing, (0, realisations), tuple(mask.astype(np.int64) for mask in nothing))
    run_round(rest, [replace(cells, kept=0) for cells in _find(job, rest)])


def _before_answers(job: _Job) -> _Job:
    """Return a job whose cases get what they need for themselves; fits need all values of the axes."""
    campaign = job.stage.campaign
    campaign = replace(campaign, replication=replace(campaign.replication, answers={}))
    return replace(job, stage=replace(job.stage, campaign=campaign))


def _behind(job: _Job, count: int) -> _Round:
    """Return the round that all cases of a stage have behind them."""
    layout, places = stored_layout(job.stage, job.url)
    asked = cases_of(job.stage, layout, places, job.stage.new)
    return _Round(layout, places, asked, asked, (0, count), tuple(np.where(mask, count, 0) for mask in asked))


def _lay_out(job: _Job, last: _Round | None) -> _Round:
    """Lay the next round out, if any case takes part in it, while no other part does."""
    with store.entrance(job.url):
        layout, places = _layout_before(job, last)
        asked = cases_of(job.stage, layout, places, job.stage.new)
        before, count = 0, job.stage.campaign.replication.at_least
        needed = asked
        if last:
            before = last.realisations[1]
            growth = _growth(job, layout, places, last)
            needed = [each > 1 for each in growth]
            count = next_round(
                job.stage.campaign.replication, before, np.concatenate([each.ravel() for each in growth])
            )
        if any(mask.any() for mask in needed):
            layout = _laid_out(job, layout, count)
    earlier = last.taken if last else [np.zeros(mask.shape, dtype=np.int64) for mask in needed]
    taken = tuple(np.where(mask, count, number) for mask, number in zip(needed, earlier, strict=True))
    return _Round(layout, places, asked, needed, (before, count), taken)


def _laid_out(job: _Job, layout: tuple[Template, ...], count: int) -> tuple[Template, ...]:
    """Lay a study out for so many realisations."""
    job.tell(Event("laying out", {"realisations": count}))
    layout = _grow(layout, count)
    with store.holding(job.url, job.hold):
        store.lay_out(job.url, layout)
    blocks = {template.series.name or "-": list(template.grid) for template in layout}
    job.tell(Event("laid out", {"realisations": count, "blocks": blocks}))
    return layout


def _rounds_of_block(job: _Job, groups: list[Cells]) -> Rounds | None:
    """Return the rounds that a block may go through by itself, if it is the whole of a study that nothing is known of.

    Whatever else has a say in them, another group, a fitted constant, a refined axis, is not seen from a block.
    """
    replication, (first, *others) = job.stage.campaign.replication, groups
    alone = math.prod(first.template.grid) == 1 and bool(first.wanted.all()) and not others
    if not (replication.until and alone) or replication.answers or job.stage.is_adaptive or job.part:
        return None
    return Rounds(replication, first.template.chunks["realisation"])


def _gone_on(job: _Job, last: _Round, outcome: Outcome) -> _Round:
    """Return a round together with those that its block has gone through by itself, and let the store show them."""
    count = last.realisations[1] + outcome.further // last.needed[0].size
    taken, layout = last.taken, last.layout
    if outcome.further:
        with store.entrance(job.url):
            layout = _laid_out(job, layout, count)
        (template,) = layout
        status = store.ledger(job.url, template.series.name, template.shape)
        taken = (np.count_nonzero(status != Status.NOT_NEEDED, axis=-1),)
    needed = [(each == count) & (not outcome.settled) for each in taken]
    return replace(last, layout=layout, needed=needed, realisations=(last.realisations[0], count), taken=taken)


def _layout_before(job: _Job, last: _Round | None) -> tuple[tuple[Template, ...], Places]:
    """Return the shape of the store, and where the cases of a stage lie in it."""
    if last and not job.part:  # other parts may have changed the store
        return last.layout, last.places
    mark, layout, places = job.seen
    if not job.stage.is_adaptive and store.layout_mark(job.url) == mark:
        return layout, places
    return stored_layout(job.stage, job.url)


def _growth(job: _Job, layout: tuple[Template, ...], places: Places, last: _Round) -> list[FloatArray]:
    """Return how many times as many realisations each case of a round needs; at most 1 where it has enough."""
    narrow = _narrow(job, layout, places, last)
    own = [
        np.where(mask, _growth_of(job.url, template, last.realisations[1]), 0.0) if mask.any() else np.zeros(mask.shape)
        for mask, template in zip(last.needed, layout, strict=True)
    ]
    return [np.where(cases, np.maximum(each, GROWTH), each) for each, cases in zip(own, narrow, strict=True)]


def _narrow(job: _Job, layout: tuple[Template, ...], places: Places, last: _Round) -> list[NDArray[np.bool_]]:
    """Return the cases that constants follow from whose intervals are too wide."""
    if not job.stage.campaign.replication.answers:
        return [np.zeros(each.shape, dtype=bool) for each in last.taken]
    from mdr_dask.execute.answers import cases_that_narrow  # with the fits and what they stand on

    return cases_that_narrow(job.url, job.stage, layout, places, last.taken)


def _unanswered(job: _Job, last: _Round) -> list[str]:
    """Return a sentence for every constant that is not known as well as it should be."""
    if not job.stage.campaign.replication.answers:
        return []
    from mdr_dask.execute.answers import unanswered

    return list(unanswered(job.url, job.stage, last.layout, last.taken))


def _find(job: _Job, current: _Round) -> list[Cells]:
    own: list[NDArray[np.bool_] | None] = [None] * len(current.layout)
    if job.part:
        own = [numbers == job.part.number for numbers in owners(current.layout, job.part.count)]
    return [
        find_cells(job.url, template, asked, needed, current.realisations, job.retry_failed, own_here)
        for template, asked, needed, own_here in zip(current.layout, current.asked, current.needed, own, strict=True)
    ]


def _verify(job: _Job, current: _Round) -> None:
    """See whether everything that workers wrote has come into the store that is seen from here."""
    lost = sum(cells.new for cells in _find(replace(job, retry_failed=False), current))
    if lost:
        where = "the workers need a shared file system or a URL"
        raise StoreError(f"{job.url}: {lost} results that workers wrote are not seen from here; {where}")
    job.tell(Event("verified", {"realisations": current.realisations[1]}))


def _others_are_done(job: _Job, part: Part, current: _Round) -> bool:
    """Wait until the other parts have done their share of a round; not for one that nobody is at work on."""
    what = f"the round of {current.realisations[1]} realisations needs results of parts"
    told = time.monotonic()
    while True:
        here = {other.number for other in store.at_work(job.url)[1]}
        late = _late(job, part, current)
        if not late:
            return True
        if late - here:
            sentence = f"{what} that are not at work: {_parts(late - here, part)}; start them, then this one again"
            job.tell(Event("round unfinished", {"parts": sorted(late - here)}, sentence))
            return False
        if time.monotonic() - told > PAUSE:
            told = time.monotonic()
            job.tell(Event("waiting for parts", {"parts": sorted(late)}, f"{what} {_parts(late, part)}: waiting"))
        time.sleep(LOOK)


def _late(job: _Job, part: Part, current: _Round) -> set[int]:
    """Return the numbers of the parts that a round still needs results of."""
    groups = _find(replace(job, part=None, retry_failed=False), current)
    numbers = owners(current.layout, part.count)
    return {int(n) for cells, owner in zip(groups, numbers, strict=True) for n in owner[cells.wanted | cells.spared]}


def _parts(numbers: set[int], part: Part) -> str:
    return ", ".join(str(Part(number, part.count)) for number in sorted(numbers))


def _grow(layout: tuple[Template, ...], realisations: int) -> tuple[Template, ...]:
    return tuple(
        replace(t, sizes={**t.sizes, "realisation": max(t.sizes["realisation"], realisations)}) for t in layout
    )


def _growth_of(url: str, template: Template, count: int) -> FloatArray:
    until, name = template.campaign.replication.until, template.series.name
    known = known_scatter(models.load(template.campaign.model), until, template.campaign.outputs)
    values, within = (
        {output: store.values(url, name, array)[..., :count] for output, array in arrays.items()}
        for arrays in (dict(zip(until, until, strict=True)), known)
    )
    return growth_needed(values, store.ledger(url, name, template.shape)[..., :count], until, within)


def _begin_round(progress: Progress, groups: list[Cells]) -> Progress:
    kept = sum(cells.kept for cells in groups)
    work = sum(cells.seconds(index) for cells in groups if cells.new for index in cells.template.block_indices())
    return replace(
        progress,
        total=progress.total + kept + sum(cells.new for cells in groups),
        kept=progress.kept + kept,
        estimated=progress.estimated + work,
    )
