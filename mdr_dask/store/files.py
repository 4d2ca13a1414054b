"""Read and write files by name, in a local folder or at a URL."""

from __future__ import annotations

import asyncio
import errno
import hashlib
import itertools
import json
import os
import uuid
from collections.abc import Awaitable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import zarr
from zarr.core.buffer import default_buffer_prototype
from zarr.core.sync import sync

from mdr_dask.errors import MdrDaskError, StoreError

T = TypeVar("T")

#: Name that stands for the group at the root of a store if the store also has series.
ROOT = "-"
#: Folder with claims: lock files for servers and file systems that have no locks of their own.
CLAIMS = ".claims/"
#: Folder with the record of the layout (`mdr_dask.store.integrity`).
RECORD_FOLDER = ".layout"
#: Files and folders that a store may contain if its first run was stopped before it created the arrays.
KEPT = ("zarr.json", RECORD_FOLDER, CLAIMS.rstrip("/"))
#: Time in s between two heartbeats of a run with a claim (`mdr_dask.store.locks`). A run counts as
#: ended if it writes no heartbeat in 4 times this time. A request fails if the server does not answer in 4 times this
#: time. Chosen by trial: a server may answer late, and the clocks of two machines may differ by some seconds.
BEAT = 20.0
#: Version of the layout. Stores of a later version are refused. Since version 2, records hold digests of all chunks.
LAYOUT = 2


def local(url: str) -> Path | None:
    """Return the path of a store on this machine, or None for a store at a URL."""
    path = url.removeprefix("file://")
    return None if "://" in path else Path(path)


async def _answered(request: Awaitable[T]) -> T:
    try:
        return await asyncio.wait_for(request, 4 * BEAT)
    except TimeoutError:
        raise TimeoutError(f"the server has not answered for {4 * BEAT:g} s") from None


class _RemoteStore(zarr.storage.FsspecStore):
    """A Zarr store at a URL. A request fails if the server does not answer in time."""

    async def get(self, *arguments: Any, **options: Any) -> Any:
        return await _answered(super().get(*arguments, **options))

    async def set(self, *arguments: Any, **options: Any) -> None:
        await _answered(super().set(*arguments, **options))

    async def delete(self, key: str) -> None:
        await _answered(super().delete(key))


@lru_cache(maxsize=16)
def bytes_of(url: str) -> Any:
    """Return the Zarr store at a path or URL. A Zarr store maps names of files to bytes."""
    path = local(url)
    if path is not None:
        return zarr.storage.LocalStore(path)
    try:
        return _RemoteStore.from_url(url)
    except (ImportError, ValueError) as error:
        raise StoreError(f"{url}: expected a path, or a URL that fsspec can open: {error}") from None


def absolute(url: str) -> str:
    """Return a path or URL that is valid in every working directory."""
    path = local(url)
    return url if path is None else str(path.absolute())


@contextmanager
def guarded(url: str, doing: str) -> Iterator[None]:
    """Turn errors of the file system, the network or a file's content into a StoreError.

    The message contains the store, the action and the cause.
    """
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
    """Return the content of a file, or None if the file does not exist."""
    path = local(url)
    with guarded(url, f"reading {name}"):
        if path is None:
            found = sync(bytes_of(url).get(name, default_buffer_prototype()))
            return None if found is None else bytes(found.to_bytes())
        return _content(path / name)


def read_json(url: str, name: str) -> dict[str, Any] | None:
    """Return the content of a JSON file, or None if the file does not exist."""
    content = read_bytes(url, name)
    with guarded(url, f"reading {name}"):
        return None if content is None else parsed(content)


def parsed(content: bytes) -> Any:
    """Return the content of a JSON text; raise ValueError if the text is not JSON or is nested too deep."""
    try:
        return json.loads(content)
    except RecursionError:
        raise ValueError("nested too deep") from None


def read_many(url: str, files: Iterable[str]) -> Iterator[tuple[str, bytes | None]]:
    """Yield the name and the content (None if missing) of many files, in the given order."""
    path = local(url)
    if path is not None:
        with guarded(url, "reading its files"):
            for name in files:
                yield name, _content(path / name)
        return

    async def gather(names: tuple[str, ...]) -> list[Any]:
        return await asyncio.gather(*[bytes_of(url).get(name, default_buffer_prototype()) for name in names])

    remaining, together = iter(files), zarr.config.get("async.concurrency")
    while window := tuple(itertools.islice(remaining, together)):
        with guarded(url, f"reading {window[0]} and others"):
            found = sync(gather(window))
        yield from (
            (name, None if one is None else bytes(one.to_bytes())) for name, one in zip(window, found, strict=True)
        )


def _content(file: Path) -> bytes | None:
    try:
        return file.read_bytes()
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
        return None


def write_bytes(url: str, name: str, content: bytes) -> None:
    """Replace a file in one step: readers see either the old content or the new content."""
    write_stages(url, [{name: content}])


def write_stages(url: str, stages: Iterable[Mapping[str, bytes]]) -> None:
    """Write files in stages. Every file is replaced in one step, after all files of the earlier stages.

    On a disk, all files are first written under temporary names and flushed. Files of the last stage are renamed only
    after the renaming of all earlier files has reached the disk.
    """
    stages = [stage for stage in stages if stage]
    path = local(url)
    if path is not None:
        _write_local(url, path, stages)
        return

    async def write(stage: Mapping[str, bytes]) -> None:
        buffer = default_buffer_prototype().buffer
        await asyncio.gather(*[bytes_of(url).set(name, buffer.from_bytes(data)) for name, data in stage.items()])

    for stage in stages:
        with guarded(url, f"writing {next(iter(stage))}"):
            sync(write(stage))


def _write_local(url: str, root: Path, stages: Sequence[Mapping[str, bytes]]) -> None:
    mark = uuid.uuid4().hex
    temporary = {root / name: Path(f"{root / name}.{mark}.partial") for stage in stages for name in stage}
    made: dict[Path, None] = {}
    try:
        for stage in stages:
            for name, content in stage.items():
                with guarded(url, f"writing {name}"):
                    made |= dict.fromkeys(_make((root / name).parent))
                    put(temporary[root / name], content)
        with guarded(url, f"writing {', '.join(name for stage in stages for name in stage)}"):
            _flush([*temporary.values()])
            for group in (stages[:-1], stages[-1:]):
                targets = [root / name for stage in group for name in stage]
                for target in targets:
                    give_name(temporary[target], target)
                _flush([*dict.fromkeys([*(target.parent for target in targets), *made])])
                made = {}
    except BaseException:
        for leftover in temporary.values():
            with suppress(OSError):  # report only the first error
                leftover.unlink()
        raise


def put(path: Path, content: bytes) -> None:
    """Write a new file."""
    with open(path, "wb") as file:  # noqa: PTH123 (Path.open is slower, and there are many files)
        file.write(content)


def give_name(leftover: Path, target: Path) -> None:
    """Rename a complete temporary file to its final name, replacing an existing file."""
    os.replace(leftover, target)  # noqa: PTH105 (Path.replace is slower)


def _make(folder: Path) -> list[Path]:
    """Make a folder and the missing parents of the folder. Return the folders that have a new entry."""
    if folder.is_dir():
        return []
    above = [*_make(folder.parent), folder.parent]
    folder.mkdir(exist_ok=True)
    return above


def _flush(paths: Sequence[Path]) -> None:
    with ThreadPoolExecutor() as pool:
        list(pool.map(flush, paths))


def flush(path: Path) -> None:
    """Wait until a file, or the entries of a folder, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    except OSError as error:
        # some file systems cannot flush folders
        if error.errno not in (errno.EINVAL, errno.ENOTSUP) or not path.is_dir():
            raise
    finally:
        os.close(descriptor)


def create(url: str, name: str, content: bytes) -> bool:
    """Write a new file and return True. If a file of this name exists, return False and leave the file unchanged.

    If `conditional` returns False, two processes that create the file at the same time may both get True.
    """
    path = local(url)
    with guarded(url, f"writing {name}"):
        try:
            if path is None:
                store = bytes_of(url)
                sync(_answered(store.fs._pipe_file(f"{store.path}/{name}", content, mode="create")))
            else:
                (path / name).parent.mkdir(parents=True, exist_ok=True)
                with (path / name).open("xb") as file:
                    file.write(content)
        except FileExistsError:
            return False
    return True


def conditional(url: str) -> bool:
    """Return False if `create` is not atomic, because fsspec first looks for the file and then writes it.

    Return True for local files and for all other servers. Some of these servers may ignore the condition.
    """
    if local(url) is not None:
        return True
    from fsspec import AbstractFileSystem

    wrapped = getattr(bytes_of(url).fs, "sync_fs", None)
    return wrapped is None or type(wrapped).pipe_file is not AbstractFileSystem.pipe_file


def remove(url: str, files: Iterable[str]) -> None:
    """Remove files; missing files are ignored."""
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


def require_bucket(url: str) -> None:
    """Raise StoreError if a store at a URL would lie in a bucket that does not exist or cannot be read."""
    if local(url) is None and "://" not in bytes_of(url).path:
        bucket = bytes_of(url).path.partition("/")[0]
        with guarded(url, f"reading {bucket!r}"):
            sync(_answered(bytes_of(url).fs._ls(bucket)))


def sweep(url: str) -> None:
    """Remove temporary files of killed processes. Call this only while no other run is active in the store."""
    path = local(url)
    if path is not None and path.is_dir():
        with guarded(url, "removing the temporary files of a killed run"):
            for folder, _, names in os.walk(path):
                for name in names:
                    if name.endswith(".partial"):
                        Path(folder, name).unlink(missing_ok=True)


def listed(url: str, prefix: str = "") -> list[str]:
    """Return the names of all files below a prefix, sorted."""
    path = local(url)
    if path is not None:
        with guarded(url, f"listing {prefix}"):
            found = os.walk(path / prefix, onerror=_raise_unless_gone)
            below = len(f"{path}/") if str(path) != "." else 0
            return sorted(f"{folder}/{name}"[below:] for folder, _, files in found for name in files)

    async def collect() -> list[str]:
        return sorted([name async for name in bytes_of(url).list_prefix(prefix)])

    with guarded(url, f"listing {prefix or 'its files'}"):
        return sync(_answered(collect()))


def _raise_unless_gone(error: OSError) -> None:
    if not isinstance(error, FileNotFoundError):
        raise error


def group_name(series: str, member: str = "") -> str:
    """Return the path of the group of a series, or of a member of this group. The root has an empty path."""
    return "/".join(part for part in ("" if series == ROOT else series, member) if part)


def chunk_name(series: str, array: str, block: Iterable[int], further: int = 0) -> str:
    """Return the name of the chunk of a block in an array that has `further` dimensions in addition to the ledger's."""
    return group_name(series, "/".join([array, "c", *map(str, block), *["0"] * further]))


def digest(content: bytes) -> str:
    """Return the digest of the content of a file."""
    # not a CRC: the CRC of a whole chunk is always the same, because a chunk ends with the CRC of its other bytes
    return hashlib.blake2b(content, digest_size=8).hexdigest()


def with_digest(document: Mapping[str, Any]) -> bytes:
    """Return a document as one line of JSON that includes the digest of the document."""
    text = json.dumps(document, sort_keys=True)
    return json.dumps({**document, "digest": digest(text.encode())}, sort_keys=True).encode()


def without_digest(line: bytes) -> dict[str, Any] | None:
    """Return the document in a line of JSON without its digest, or None if it is damaged.

    A document without a digest counts as undamaged.
    """
    try:
        document: dict[str, Any] = parsed(line)
        stated = document.pop("digest", None)
    except (ValueError, TypeError, AttributeError):
        return None
    whole = line.replace(f'"digest": "{stated}", '.encode(), b"", 1)
    return document if stated is None or stated == digest(whole) else None
