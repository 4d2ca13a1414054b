"""What a worker process does with the blocks that it is sent."""

from __future__ import annotations

from distributed import get_worker

from mdr_dask.execute.events import of_block
from mdr_dask.task import Outcome, Work, finished, run_block

#: Where workers tell what happens to blocks.
TOPIC = "mdr_dask"


def run_on_worker(works: tuple[Work, ...]) -> list[Outcome]:
    """Run blocks one after the other, but for those that a worker has finished that died before it was told."""
    return [finished(work) or _run(number, work) for number, work in enumerate(works)]


def _run(number: int, work: Work) -> Outcome:
    worker = get_worker()
    facts = {**of_block("begun", work).facts, "worker": worker.address}
    worker.log_event(TOPIC, {**facts, "key": worker.get_current_task(), "number": number})
    return run_block(work)
