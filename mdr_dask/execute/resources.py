"""The threads, processes or cluster of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Resources:
    """Where a run computes. The default is all cores of this machine: in threads, or processes for plain Python models.

    Parameters
    ----------
    threads : int or None
        Number of threads of this process.
    workers : int or None
        Number of processes of this machine to use instead; threads if the system cannot fork.
    scheduler : str or None
        Address of a running Dask scheduler to use instead.
    cluster : mapping or None
        Content of a cluster file, as `mdr_dask.campaign.cluster.load_cluster` returns it, of a Dask cluster to start.
    client : distributed.Client or None
        A Dask client to use instead; it is not closed.
    patience : float
        Seconds without any worker after which a run on a cluster ends with an error.
    case_timeout : float or None
        Seconds after which a case fails. With a limit, blocks are computed in child processes.
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
