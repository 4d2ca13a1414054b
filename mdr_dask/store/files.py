"""Bytes by name in a local directory or at a URL, the root attributes of a study, and its lock."""

from __future__ import annotations

import asyncio
import errno
import hashlib
import itertools
import json
import os
import uuid
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import zarr
from zarr.core.buffer import default_buffer_prototype
from zarr.core.sync import sync

from mdr_dask.errors import MdrDaskError, StoreError

#: How the study of a campaign without series is called where series stand beside it.
ROOT = "-"

#: Where the claims of runners lie in a store whose file system, or server, has no locks.
CLAIMS = ".claims/"
#: How the names of files end that were set aside.
ASIDE = ".aside"
#: What clearing a store that was never laid out leaves: its first document, and who is at work on it.
KEPT = ("zarr.json", CLAIMS.rstrip("/"))

#: Stamps of files that are not there, and of empty ones; and the largest of others.
GONE, EMPTY, MOST = 0, 1, 2**63 - 1
#: Requests to a server at a time.
AT_ONCE = 64
#: Threads that wait for a disk.
FLUSHERS = 8

#: Raised when the layout changes so that older code cannot go on with it. 2: chunks have digests, records lie together.
LAYOUT = 2


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
        return None if content is None else parsed(content)


def parsed(content: bytes) -> Any:
    """Return what a JSON document says; ValueError says why it is none."""
    try:
        return json.loads(content)
    except RecursionError:
        raise ValueError("nested too deep") from None


def read_many(url: str, files: Iterable[str]) -> Iterator[tuple[str, bytes | None]]:
    """Yield name and content of many files in order, None for those that are gone; from a server, many at once."""
    path = local(url)
    if path is not None:
        with guarded(url, "reading its files"):
            for name in files:
                yield name, _content(f"{path}/{name}")
        return

    async def gather(names: tuple[str, ...]) -> list[Any]:
        return await asyncio.gather(*[bytes_of(url).get(name, default_buffer_prototype()) for name in names])

    remaining = iter(files)
    while window := tuple(itertools.islice(remaining, AT_ONCE)):
        with guarded(url, f"reading {window[0]} and others"):
            found = sync(gather(window))
        yield from (
            (name, None if one is None else bytes(one.to_bytes())) for name, one in zip(window, found, strict=True)
        )


def _content(file: str) -> bytes | None:
    """Return what a file holds, None if there is none; of a hundred thousand, a Path and a stream each are slow."""
    try:
        descriptor = os.open(file, os.O_RDONLY)
    except (FileNotFoundError, NotADirectoryError):
        return None
    try:
        size = os.fstat(descriptor).st_size
        content = os.read(descriptor, size + 1)
    except IsADirectoryError:
        return None
    finally:
        os.close(descriptor)
    return content if len(content) == size else Path(file).read_bytes()


def stamps(url: str, files: Iterable[str]) -> Iterator[int]:
    """Yield a number for each file, in order, that differs after the file was written: `GONE` and `EMPTY` say so."""
    path = local(url)
    if path is None:
        store = bytes_of(url)
        with guarded(url, "listing it"):
            store.fs.invalidate_cache()
            found = sync(store.fs._find(store.path, detail=True))
        known = {name.removeprefix(f"{store.path}/"): _stamp_of(told) for name, told in found.items()}
        yield from (known.get(name, GONE) for name in files)
        return
    with guarded(url, "looking at its files"):
        for name in files:
            try:
                told = os.stat(f"{path}/{name}")  # noqa: PTH116 (of a hundred thousand, a Path each is slow)
            except (FileNotFoundError, NotADirectoryError):
                yield GONE
            else:
                yield hash((told.st_ino, told.st_size, told.st_mtime_ns)) & MOST if told.st_size else EMPTY


def _stamp_of(told: Mapping[str, Any]) -> int:
    """Return a number for what a server says of an object, its ETag and the time of writing among it."""
    text = repr(sorted(told.items())).encode()
    return int.from_bytes(hashlib.blake2b(text, digest_size=7).digest()) if told.get("size") else EMPTY


def write_bytes(url: str, name: str, content: bytes) -> None:
    """Replace what stands under a name, at once."""
    write_stages(url, [{name: content}])


def write_stages(url: str, stages: Iterable[Mapping[str, bytes]]) -> None:
    """Write files, those of each stage after those of the one before, each at once; all last when this returns.

    On a disk everything is flushed under other names first. The names are given in order, and flushed in the end: one
    wait for all contents, and one for all names.
    """
    path = local(url)
    if path is not None:
        _write_local(url, path, [item for stage in stages for item in stage.items()])
        return

    async def write(stage: Mapping[str, bytes]) -> None:
        buffer = default_buffer_prototype().buffer
        await asyncio.gather(*[bytes_of(url).set(name, buffer.from_bytes(data)) for name, data in stage.items()])

    for stage in stages:
        if stage:
            with guarded(url, f"writing {next(iter(stage))}"):
                sync(write(stage))


def _write_local(url: str, root: Path, files: list[tuple[str, bytes]]) -> None:
    unnamed: dict[Path, Path] = {}
    folders: dict[Path, None] = {}
    mark = uuid.uuid4().hex
    try:
        for name, content in files:
            target = root / name
            unnamed[target] = Path(f"{target}.{mark}.partial")
            with guarded(url, f"writing {name}"):
                if (folder := target.parent) not in folders:
                    folders |= dict.fromkeys([*_make(folder), folder])
                put(unnamed[target], content)
        with guarded(url, f"writing {', '.join(name for name, _ in files)}"):
            _flush([*unnamed.values()])
            for target, leftover in unnamed.items():
                give_name(leftover, target)
            _flush([*folders])
    except BaseException:
        for leftover in unnamed.values():
            with suppress(OSError):  # what went wrong first is what has to be told
                leftover.unlink()
        raise


def put(path: Path, content: bytes) -> None:
    """Write bytes to a new file."""
    with open(path, "wb") as file:  # noqa: PTH123 (of many, Path.open takes longer)
        file.write(content)


def give_name(leftover: Path, target: Path) -> None:
    """Make a file that is complete take the place of what stands under a name."""
    os.replace(leftover, target)  # noqa: PTH105 (of many)


def _make(folder: Path) -> list[Path]:
    """Make a folder; return those in which a new one stands."""
    if folder.is_dir():
        return []
    above = [*_make(folder.parent), folder.parent]
    folder.mkdir(exist_ok=True)
    return above


def _flush(paths: Sequence[Path]) -> None:
    """Wait until files, and the names in folders, are on the disk; together, since a disk writes them together."""
    shares = (paths[first::FLUSHERS] for first in range(min(FLUSHERS, len(paths))))
    list(_flushers().map(_flush_in_turn, shares))


def _flush_in_turn(paths: Sequence[Path]) -> None:
    for path in paths:
        flush(path)


def flush(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP) or not path.is_dir():  # some have no flush for folders
            raise
    finally:
        os.close(descriptor)


@lru_cache(maxsize=1)
def _flushers() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(FLUSHERS, thread_name_prefix="flush")


def create(url: str, name: str, content: bytes) -> bool:
    """Write bytes under a name that is free, and return True; leave one that is taken, and return False."""
    path = local(url)
    with guarded(url, f"writing {name}"):
        try:
            if path is None:
                store = bytes_of(url)
                sync(store.fs._pipe_file(f"{store.path}/{name}", content, mode="create"))
            else:
                (path / name).parent.mkdir(parents=True, exist_ok=True)
                with (path / name).open("xb") as file:
                    file.write(content)
        except FileExistsError:
            return False
    return True


def conditional(url: str) -> bool:
    """Say whether `create` is one act of the server, not a look before a write."""
    if local(url) is not None:
        return True
    from fsspec import AbstractFileSystem

    wrapped = getattr(bytes_of(url).fs, "sync_fs", None)
    return wrapped is None or type(wrapped).pipe_file is not AbstractFileSystem.pipe_file


def remove(url: str, files: Iterable[str]) -> None:
    """Remove files by name; those that are gone are no matter."""
    path = local(url)

    async def delete() -> None:
        for name in files:
            await bytes_of(url).delete(name)

    with guarded(url, "removing files"):
        if path is None:
            sync(delete())
        else:
            for name in files:
                (path / name).unlink(missing_ok=True)


def set_aside(url: str, files: Iterable[str]) -> None:
    """Rename files, so that nothing reads them and nothing is lost."""
    for name in files:
        content = read_bytes(url, name)
        if content is not None:
            write_bytes(url, f"{name}{ASIDE}", content)
            remove(url, [name])


def clear(url: str) -> None:
    """Remove what a run left that took the place and got no further."""

    async def remove() -> None:
        for name in [name async for name in bytes_of(url).list_dir("") if name not in KEPT]:
            await bytes_of(url).delete_dir(name)

    with guarded(url, "clearing it"):
        sync(remove())


def sweep(url: str) -> None:
    """Remove the files that killed writers had not yet given their names; only for the holder of the lock."""
    path = local(url)
    if path is not None and path.is_dir():
        with guarded(url, "removing what a killed run left"):
            for folder, _, names in os.walk(path):
                for name in names:
                    if name.endswith(".partial"):
                        Path(folder, name).unlink(missing_ok=True)


def listed(url: str, prefix: str = "") -> list[str]:
    """Return the names of all files below a prefix, in order."""
    path = local(url)
    if path is not None:
        with guarded(url, f"listing {prefix}"):
            found = os.walk(path / prefix, onerror=_raise_unless_gone)
            below = len(f"{path}/") if str(path) != "." else 0
            return sorted(f"{folder}/{name}"[below:] for folder, _, files in found for name in files)

    async def collect() -> list[str]:
        return sorted([name async for name in bytes_of(url).list_prefix(prefix)])

    with guarded(url, f"listing {prefix or 'it'}"):
        return sync(collect())


def _raise_unless_gone(error: OSError) -> None:
    if not isinstance(error, FileNotFoundError):
        raise error


def group_name(series: str, member: str = "") -> str:
    """Return the path of a member of a series' group, or of the group itself; arrays without series are at the root."""
    return "/".join(part for part in ("" if series == ROOT else series, member) if part)
