"""What a run is given to compute with."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Resources:
    """Where to run: threads of this process by default.

    Parameters
    ----------
    threads : int or None
        Threads of this process; None for one per core.
    workers : int or None
        Processes of a local cluster instead.
    scheduler : str or None
        Address of a running Dask scheduler instead.
    cluster : mapping or None
        What a cluster file says, as `mdr_dask.campaign.cluster.load_cluster` reads it: any Dask cluster instead.
    patience : float
        Seconds without any worker after which a run on a cluster gives up.
    """

    threads: int | None = None
    workers: int | None = None
    scheduler: str | None = None
    cluster: Mapping[str, Any] | None = None
    patience: float = 600.0

    @property
    def remote(self) -> bool:
        """Whether blocks are run by other processes than this one."""
        return not (self.workers is None and self.scheduler is None and self.cluster is None)
