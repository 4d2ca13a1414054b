"""Bytes by name in a local directory or at a URL, the root attributes of a study, and its lock."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import zarr
from zarr.core.buffer import default_buffer_prototype
from zarr.core.sync import sync

from mdr_dask.errors import StoreBusyError, StoreError

#: Raised when the layout changes so that older code cannot read it.
LAYOUT = 1


@lru_cache(maxsize=16)
def bytes_of(url: str) -> Any:
    """Return the Zarr store, a map from names to bytes, at a path or URL."""
    return zarr.storage.FsspecStore.from_url(url) if "://" in url else zarr.storage.LocalStore(url)


def read_json(url: str, name: str) -> dict[str, Any] | None:
    """Return a JSON document, or None if there is none of that name."""
    if "://" not in url and not Path(url, name).is_file():
        return None
    content = sync(bytes_of(url).get(name, default_buffer_prototype()))
    return None if content is None else json.loads(content.to_bytes())


def write_bytes(url: str, name: str, content: bytes) -> None:
    """Replace what stands under a name, at once."""
    sync(bytes_of(url).set(name, default_buffer_prototype().buffer.from_bytes(content)))


def names(url: str, prefix: str) -> list[str]:
    """Return the names of everything below a prefix, in order."""

    async def collect() -> list[str]:
        return sorted([name async for name in bytes_of(url).list_prefix(prefix)])

    return sync(collect())


def exists(url: str) -> bool:
    """Say whether there is something at a path or URL that a run has to respect."""
    metadata = read_json(url, "zarr.json")
    return metadata is not None and list(metadata["attributes"]) != ["mdr_dask_layout"]


def attributes(url: str) -> dict[str, Any]:
    """Return the attributes of a study.

    Raises
    ------
    StoreError
        If there is no study of mdr_dask at `url`, or one with a newer layout.
    """
    metadata = read_json(url, "zarr.json")
    if metadata is None:
        raise StoreError(f"{url}: no store here; 'mdr-dask run CAMPAIGN' makes one")
    found: dict[str, Any] = metadata["attributes"]
    if "mdr_dask_layout" not in found:
        raise StoreError(f"{url}: a Zarr group, but not one that mdr_dask made")
    if found["mdr_dask_layout"] > LAYOUT:
        raise StoreError(f"{url}: made by a newer mdr_dask (layout {found['mdr_dask_layout']}, known: {LAYOUT})")
    return found


@contextmanager
def lock(url: str) -> Iterator[None]:
    """Hold a study for one runner; the operating system lets go of it however the runner ends.

    Parameters
    ----------
    url : str
        Path of the store. A store at a URL has no lock: do not start two runners on it.

    Raises
    ------
    StoreBusyError
        If another runner holds it; the message names that runner.
    """
    if "://" in url:
        yield
        return
    from filelock import FileLock, Timeout

    path = Path(url).resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    holder = path.with_name(f".{path.name}.runner")
    try:
        with FileLock(path.with_name(f".{path.name}.lock"), timeout=0):
            holder.write_text(f"process {os.getpid()} on {platform.node()}")
            yield
            holder.unlink(missing_ok=True)
    except Timeout:
        who = holder.read_text() if holder.exists() else "another process"
        raise StoreBusyError(f"{url}: {who} is running on this store; wait for it, or stop it") from None
