"""What a run computes with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Resources:
    """Where to run. By default on all cores of this machine: in threads, or in processes for a model in plain Python.

    Parameters
    ----------
    threads : int or None
        Threads of this process.
    workers : int or None
        Processes of this machine instead; threads where the system cannot fork.
    scheduler : str or None
        Address of a running Dask scheduler instead.
    cluster : mapping or None
        Content of a cluster file, as `mdr_dask.campaign.cluster.load_cluster` reads it: any Dask cluster instead.
    client : distributed.Client or None
        A Dask client instead; it stays open.
    patience : float
        Seconds without any worker after which a run on a cluster gives up.
    case_timeout : float or None
        Seconds after which a case has failed. Blocks are then computed in processes of their own.
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
