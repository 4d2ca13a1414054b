"""The threads, processes or cluster of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Resources:
    """The threads, processes or cluster that a run uses. By default, it uses all cores of this machine.

    By default, compiled models are computed in threads, and plain Python models in processes.

    Parameters
    ----------
    threads : int or None
        Number of threads of this process that compute blocks.
    workers : int or None
        Number of processes of this machine that compute blocks, instead of threads. If the system cannot fork
        processes, threads are used.
    scheduler : str or None
        Address of a running Dask scheduler, whose workers compute the blocks.
    cluster : mapping or None
        Description of a Dask cluster to start, as `mdr_dask.campaign.cluster.load_cluster` returns it.
    client : distributed.Client or None
        A Dask client whose workers compute the blocks. It stays open after the run.
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
