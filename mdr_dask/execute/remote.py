"""What a worker process does with a block that it is sent."""

from __future__ import annotations

from distributed import get_worker

from mdr_dask.execute.events import of_block
from mdr_dask.task import Outcome, Work, finished, run_block

#: Where workers tell what happens to blocks.
TOPIC = "mdr_dask"


def run_on_worker(work: Work) -> Outcome:
    """Run a block, unless a worker did so before that died before it was told."""
    worker = get_worker()
    facts = {**of_block("begun", work).facts, "worker": worker.address}
    worker.log_event(TOPIC, {**facts, "key": worker.get_current_task()})
    return finished(work) or run_block(work)
