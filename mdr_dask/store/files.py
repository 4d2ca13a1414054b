"""Bytes by name in a local directory or at a URL, the root attributes of a study, and its lock."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import zarr
from zarr.core.buffer import default_buffer_prototype
from zarr.core.sync import sync

from mdr_dask.errors import MdrDaskError, StoreBusyError, StoreError

#: How the study of a campaign without series is called where series stand beside it.
ROOT = "-"

#: Raised when the layout changes so that older code cannot read it.
LAYOUT = 1


def local(url: str) -> Path | None:
    """Return the path of a store on this machine, None for one at a URL."""
    path = url.removeprefix("file://")
    return None if "://" in path else Path(path)


@lru_cache(maxsize=16)
def bytes_of(url: str) -> Any:
    """Return the Zarr store, a map from names to bytes, at a path or URL."""
    path = local(url)
    if path is not None:
        return zarr.storage.LocalStore(path)
    try:
        return zarr.storage.FsspecStore.from_url(url)
    except (ImportError, ValueError) as error:
        raise StoreError(f"{url}: expected a path, or a URL that fsspec can open: {error}") from None


def absolute(url: str) -> str:
    """Return the same place for a process in another folder."""
    path = local(url)
    return url if path is None else str(path.absolute())


@contextmanager
def guarded(url: str, doing: str) -> Iterator[None]:
    """Turn what the file system or the network has to complain about into one sentence."""
    try:
        yield
    except MdrDaskError:
        raise
    except Exception as error:
        if local(url) is not None and not isinstance(error, OSError | ValueError):
            raise
        why = error.strerror if isinstance(error, OSError) and error.strerror else f"{type(error).__name__}: {error}"
        raise StoreError(f"{url}: {doing} failed: {why}") from None


def read_bytes(url: str, name: str) -> bytes | None:
    """Return what stands under a name, or None if nothing does."""
    path = local(url)
    with guarded(url, f"reading {name}"):
        if path is None:
            found = sync(bytes_of(url).get(name, default_buffer_prototype()))
            return None if found is None else bytes(found.to_bytes())
        return (path / name).read_bytes() if (path / name).is_file() else None


def read_json(url: str, name: str) -> dict[str, Any] | None:
    """Return a JSON document, or None if there is none of that name."""
    content = read_bytes(url, name)
    with guarded(url, f"reading {name}"):
        return None if content is None else json.loads(content)


def write_bytes(url: str, name: str, content: bytes) -> None:
    """Replace what stands under a name, at once."""
    with guarded(url, f"writing {name}"):
        sync(bytes_of(url).set(name, default_buffer_prototype().buffer.from_bytes(content)))


def clear(url: str) -> None:
    """Remove what a run left that took the place and got no further."""

    async def remove() -> None:
        for name in [name async for name in bytes_of(url).list_dir("") if name != "zarr.json"]:
            await bytes_of(url).delete_dir(name)

    with guarded(url, "clearing it"):
        sync(remove())


def sweep(url: str) -> None:
    """Remove the files that killed writers had not yet given their names; only for the holder of the lock."""
    path = local(url)
    if path is not None and path.is_dir():
        with guarded(url, "removing what a killed run left"):
            for leftover in path.rglob("*.partial"):
                if leftover.is_file():
                    leftover.unlink(missing_ok=True)


def names(url: str, prefix: str) -> list[str]:
    """Return the names of all JSON documents below a prefix, in order."""

    async def collect() -> list[str]:
        return sorted([name async for name in bytes_of(url).list_prefix(prefix) if name.endswith(".json")])

    with guarded(url, f"listing {prefix}"):
        return sync(collect())


def exists(url: str) -> bool:
    """Say whether there is a study at a path or URL, whoever made it.

    Raises
    ------
    StoreError
        If there is something else.
    """
    path = local(url)
    if path is not None and path.is_file():
        raise StoreError(f"{url}: a file, expected the folder of a store or nothing")
    found = _root_attributes(url)
    if found is None and path is not None and path.is_dir():
        others = sorted(entry.name for entry in path.iterdir() if entry.suffix != ".partial")
        if others:
            raise StoreError(f"{url}: a folder that holds something else ({others[0]}), expected a store or nothing")
    return found is not None and not only_claimed(found)


def is_study(url: str) -> bool:
    """Say whether there is a study of mdr_dask at a path or URL."""
    return "mdr_dask_layout" in (_root_attributes(url) or {})


def _root_attributes(url: str) -> dict[str, Any] | None:
    """Return the attributes of whatever Zarr there is, or None if there is none."""
    metadata = read_json(url, "zarr.json")
    if metadata is None:
        return None
    found = metadata.get("attributes", {}) if isinstance(metadata, dict) else {}
    return found if isinstance(found, dict) else {}


def only_claimed(found: Mapping[str, Any]) -> bool:
    """Say whether a run took the place and was stopped before its arrays were laid out."""
    return list(found) == ["mdr_dask_layout"]


def attributes(url: str) -> dict[str, Any]:
    """Return the attributes of a study.

    Raises
    ------
    StoreError
        If there is no study of mdr_dask at `url`, or one with a newer layout.
    """
    path = local(url)
    if path is not None and path.is_file():
        raise StoreError(f"{url}: a file, expected the folder of a store; 'mdr-dask run {url}' runs a campaign")
    found = _root_attributes(url)
    if found is None:
        raise StoreError(f"{url}: no store here; 'mdr-dask run CAMPAIGN' makes one")
    if "mdr_dask_layout" not in found:
        raise StoreError(f"{url}: Zarr, but not a study that mdr_dask made")
    if found["mdr_dask_layout"] > LAYOUT:
        raise StoreError(f"{url}: made by a newer mdr_dask (layout {found['mdr_dask_layout']}, known: {LAYOUT})")
    if only_claimed(found):
        raise StoreError(f"{url}: still empty, its first run has not come far enough; run the campaign")
    return found


def series_names(url: str) -> list[str]:
    """Return the names of the groups of a study, ``""`` for one without series and `ROOT` if series stand beside it."""
    root = "axes" in attributes(url)
    metadata = read_json(url, "zarr.json") or {}
    members = metadata["consolidated_metadata"]["metadata"]
    names = [name for name, member in members.items() if member["node_type"] == "group"]
    return ([ROOT] if names else [""]) * root + names


def group_name(series: str, member: str = "") -> str:
    """Return the path of a member of a series' group, or of the group itself; arrays without series are at the root."""
    return "/".join(part for part in ("" if series == ROOT else series, member) if part)


@contextmanager
def lock(url: str, name: str = "") -> Iterator[None]:
    """Hold a lock beside a study; the operating system lets go of it however its holder ends.

    Parameters
    ----------
    url : str
        Path of the store. A store at a URL has no lock: do not start two runners on it.
    name : str
        Which of its locks; that of a runner alone has no name.

    Raises
    ------
    StoreBusyError
        If another process holds it; the message names that process.
    StoreError
        If nothing can be written there.
    """
    if local(url) is None:
        yield
        return
    from filelock import FileLock, Timeout

    file = lock_file(url, name)
    guard = FileLock(file, timeout=0)
    with guarded(url, "making it"):
        if not file.parent.exists():
            file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()  # where this fails, the lock would say that somebody else holds it
        try:
            guard.acquire()
        except Timeout:
            raise StoreBusyError(f"{url}: {holder(file)} is running on this store; wait for it, or stop it") from None
    try:
        with guarded(url, "making it"):
            _holder_file(file).write_text(f"process {os.getpid()} on {platform.node()}")
        yield
    finally:
        _holder_file(file).unlink(missing_ok=True)
        guard.release()


def lock_file(url: str, name: str = "") -> Path:
    """Return the file of a lock beside a store on this machine."""
    path = Path(url.removeprefix("file://"))
    try:
        path = path.resolve()
    except (OSError, RuntimeError, ValueError) as error:  # a link to itself, a null character
        raise StoreError(f"{url}: expected a path: {error}") from None
    return path.with_name(".".join(["", path.name, *filter(None, [name]), "lock"]))


def holder(file: Path) -> str:
    """Return who holds a lock that is held."""
    told = _holder_file(file)
    return told.read_text() if told.exists() else "another process"


def _holder_file(file: Path) -> Path:
    return file.with_suffix(".runner")
