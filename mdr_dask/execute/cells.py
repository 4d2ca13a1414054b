"""Find the results that a round has to compute, and the tasks that compute them."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mdr_dask import store
from mdr_dask.errors import StoreError
from mdr_dask.models.base import Status
from mdr_dask.plan import RECORDS_TOGETHER, BlockIndex, Template
from mdr_dask.store import Lock, Part, Place
from mdr_dask.task import Work, versions


@dataclass(frozen=True)
class Cells:
    """The results of one group that a round computes or marks as not needed."""

    template: Template
    # Masks with the shape of the group. `wanted`: results to compute. `spared`: results to mark as not needed.
    wanted: NDArray[np.bool_]
    spared: NDArray[np.bool_]
    # `kept`: number of results of the round that are left unchanged in the store. `failed`: number of those among them
    # that failed or did not converge.
    kept: int
    failed: int

    @property
    def new(self) -> int:
        """Number of results to compute or to mark as not needed."""
        return int(np.count_nonzero(self.wanted) + np.count_nonzero(self.spared))

    def operations(self, index: BlockIndex) -> float:
        """Return the approximate number of operations that the round needs for a block."""
        part = float(np.mean(self.wanted[self.template.region(index)]))
        return part * self.template.operations(index) if part else 0.0


def find_cells(
    url: str,
    template: Template,
    asked: NDArray[np.bool_],
    needed: NDArray[np.bool_],
    realisations: tuple[int, int],
    retry_failed: bool,
    own: NDArray[np.bool_] | None = None,
) -> Cells:
    """Compare a round with the ledger to find the results that the round still has to compute.

    `asked` marks the cases whose results are computed or marked as not needed. `needed` marks the cases that need the
    realisations of the round. These realisations are ``realisations[0]`` to ``realisations[1] - 1``. The round also
    computes earlier realisations of the needed cases that have the state "not needed" in the ledger. If `retry_failed`
    is true, results of the round that failed or did not converge are computed again. `own` marks the results that
    belong to this part of the campaign; None means all results.
    """
    status = store.ledger(url, template.series.name, template.shape)
    open_states = [Status.MISSING, Status.NOT_NEEDED]
    if retry_failed:
        open_states += [Status.FAILED, Status.NOT_CONVERGED]
    in_round = np.zeros(status.shape, dtype=bool)
    in_round[..., slice(*realisations)] = asked[..., None]
    in_round[..., : realisations[0]] |= needed[..., None] & (status[..., : realisations[0]] == Status.NOT_NEEDED)
    if own is not None:
        in_round &= own
    wanted = in_round & needed[..., None] & np.isin(status, open_states)
    spared = in_round & ~wanted & (status == Status.MISSING)
    kept = in_round & ~wanted & ~spared
    failed = kept & np.isin(status, [Status.FAILED, Status.NOT_CONVERGED])
    return Cells(template, wanted, spared, int(np.count_nonzero(kept)), int(np.count_nonzero(failed)))


def owners(layout: Iterable[Template], count: int) -> Iterator[NDArray[np.int32]]:
    """Yield, for each group, an array with the number of the part (1 to `count`) to which each result belongs."""
    position = itertools.count()
    for template in layout:
        numbers = np.zeros(template.shape, dtype=np.int32)
        for index in template.block_indices():
            numbers[template.region(index)] = Part.of(next(position), count).number
        yield numbers


def tasks(url: str, groups: Iterable[Cells], lock: Lock) -> Iterator[Work]:
    """Yield the tasks of a round one by one, to save memory. From time to time, merge the records of blocks.

    Raise StoreError if the store has been removed.
    """
    laid_out = store.layout_mark(url)
    if laid_out is None:
        raise StoreError(f"{url}: the store has been removed")
    begun = itertools.count(1)
    for cells in groups:
        if not cells.new:
            continue
        template = cells.template
        attempts = store.attempts(url, template.series.name)
        for index in template.block_indices():
            region = template.region(index)
            wanted, spared = cells.wanted[region], cells.spared[region]
            if wanted.any() or spared.any():
                if next(begun) % RECORDS_TOGETHER == 0:
                    store.merge_records(url, template.series.name)
                yield Work(
                    place=Place(url, template.series.name, index, region, laid_out, lock),
                    model=template.campaign.model,
                    versions=versions(template.campaign.model),
                    block=template.block(index),
                    wanted=wanted,
                    spared=spared,
                    attempt=attempts.get(index, 0) + 1,
                    operations=cells.operations(index),
                )
