"""The threads, processes or cluster of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Resources:
    """The threads, processes or cluster that a run uses: by default, all cores of this machine.

    `threads` is the number of threads, and `workers` the number of child processes. Models in plain Python use child
    processes instead of threads, unless `threads` is given. `scheduler` is the address of a running Dask scheduler.
    `cluster` is a description from `mdr_dask.campaign.cluster.load_cluster`. `client` is a Dask client, which the run
    does not close. A run on a cluster ends with an error after `patience` seconds without any worker.

    If `case_timeout` is given, blocks are computed in child processes, and a result of a plain Python model that takes
    longer than this time in s fails. For other models, only blocks are timed: a block that takes longer than this time
    multiplied by the number of its results is halved, or fails if it has a single result.
    """

    threads: int | None = None
    workers: int | None = None
    scheduler: str | None = None
    cluster: Mapping[str, Any] | None = None
    client: Any = None
    patience: float = 600.0
    case_timeout: float | None = None

    @property
    def remote(self) -> bool:
        """Whether a Dask cluster computes the blocks."""
        return any(each is not None for each in (self.scheduler, self.cluster, self.client))
