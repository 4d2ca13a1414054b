"""Cheap checks: that a study is laid out as it was, and that each case in the ledger as done has its chunks."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.errors import StoreError
from mdr_dask.models.base import Status
from mdr_dask.plan import BlockIndex
from mdr_dask.store.blocks import ledger
from mdr_dask.store.copies import Copy, copy_name, read_copy, root_of
from mdr_dask.store.digests import allowed, histories
from mdr_dask.store.files import ROOT, group_name, read_many, sizes
from mdr_dask.store.records import digest, records
from mdr_dask.store.study import document

#: Groups of at most so many chunks, and so many bytes, are read whole: that is cheap.
FEW, SMALL = 2000, 2**26
#: Most faults that a message names.
NAMED = 3


def require_sound(url: str, series: Sequence[str]) -> None:
    """Refuse a study that the cheap checks find damaged.

    Raises
    ------
    StoreError
        If it is; the first faults are named.
    """
    require_laid_out(url, series)
    for name in series:
        chunks = _chunks(url, name)
        _refuse(url, (f"{chunk} is {what}" for chunk, what in _lacking(url, chunks)))
        if len(chunks) <= FEW:
            _refuse(url, (f"{chunk} is not what was written there" for chunk in _changed(url, name, chunks)))


def require_laid_out(url: str, series: Sequence[str]) -> None:
    """Refuse a study whose metadata or coordinates are damaged; what changes meanwhile is looked at again.

    Raises
    ------
    StoreError
        If they are; the first faults are named.
    """
    if any(_unsound(url, series)):
        _refuse(url, _unsound(url, series))


def _refuse(url: str, faults: Iterator[str]) -> None:
    first = list(itertools.islice(faults, NAMED + 1))
    if first:
        more = ", and more" if len(first) > NAMED else ""
        remedy = f"'mdr-dask verify {url}' names all of it, and with --repair mends it"
        raise StoreError(f"{url}: damaged: {'; '.join(first[:NAMED])}{more}; {remedy}")


def _unsound(url: str, series: Sequence[str]) -> Iterator[str]:
    root = document(url) or {}
    copies = []
    for name in series:
        try:
            copy = read_copy(url, name)
        except StoreError:
            yield f"{copy_name(name)} is damaged"
            continue
        if copy is not None:
            copies.append(copy)
            yield from (f"{file} is {what}" for file, what, _ in unsound_files(url, copy))
        elif root.get("attributes", {}).get("mdr_dask_layout", 0) > 1 and has_digests(root, name):
            yield f"{copy_name(name)} is missing"
    if copies and not is_root_sound(root, copies):
        yield "zarr.json is damaged"


def has_digests(root: dict[str, Any], series: str) -> bool:
    """Say whether a group was laid out by a version that keeps a copy of its layout."""
    members = root.get("consolidated_metadata", {}).get("metadata", {})
    attributes = root["attributes"] if series in ("", ROOT) else members.get(series, {}).get("attributes", {})
    return bool(attributes.get("mdr_dask_layout", 1) > 1)


def unsound_files(url: str, copy: Copy) -> Iterator[tuple[str, str, bytes | None]]:
    """Yield name, fault and content of every file of a layout that is not as it was made."""
    for name, content in read_many(url, copy.files):
        if not copy.is_sound(name, content):
            yield name, "missing" if content is None else "damaged", content


def is_root_sound(root: dict[str, Any], copies: list[Copy]) -> bool:
    """Say whether the root's metadata are those of the copies, or of a layout that was not finished after it."""
    members, attributes = root_of(copies)
    try:
        if len(root["attributes"]["history"]) < len(attributes["history"]):
            return bool(root["attributes"] | {"history": []}) and "metadata" in root["consolidated_metadata"]
        held = root["consolidated_metadata"]["metadata"]
        mine = json.loads(json.dumps(members))
        return bool(root["attributes"] == json.loads(json.dumps(attributes))) and all(
            held.get(name) == document for name, document in mine.items()
        )
    except (KeyError, TypeError, AttributeError):
        return False


def _chunks(url: str, series: str) -> dict[str, tuple[str, BlockIndex]]:
    """Return the chunks, with array and block, that the ledger says there are: those of blocks with cases done."""
    held = document(url, series) or {}
    if held["attributes"]["mdr_dask_layout"] == 1:  # then chunks of nothing but nan were not written
        return {}
    arrays = held["consolidated_metadata"]["metadata"]
    status = arrays["status"]
    states = ledger(url, series, tuple(status["shape"]))
    blocks = done_blocks(states, status["chunk_grid"]["configuration"]["chunk_shape"])
    found: dict[str, tuple[str, BlockIndex]] = {}
    for name in held["attributes"]["outputs"]:
        prefix = group_name(series, f"{name}/c/")
        further = "/0" * (len(arrays[name]["shape"]) - blocks.ndim)
        for block in np.argwhere(blocks).tolist():
            found[f"{prefix}{'/'.join(map(str, block))}{further}"] = name, tuple(block)
    return found


def _lacking(url: str, chunks: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield the chunks that are gone or empty."""
    for name, size in sizes(url, chunks):
        if not size:
            yield name, "missing" if size is None else "empty"


def _changed(url: str, series: str, chunks: Mapping[str, tuple[str, BlockIndex]]) -> Iterator[str]:
    """Yield the chunks that are not what was written, if they are small together."""
    if sum(size or 0 for _, size in sizes(url, chunks)) > SMALL:
        return
    history = histories(records(url, series))
    ledgers = {block: group_name(series, f"status/c/{'/'.join(map(str, block))}") for _, block in chunks.values()}
    parts = dict(zip(ledgers, (content for _, content in read_many(url, ledgers.values())), strict=True))
    for block, name in ledgers.items():
        written = {attempt["status"] for attempt in history.get(block, ()) if "status" in attempt}
        if written and digest(parts[block] or b"") not in written:
            yield name
    for (chunk, (name, block)), (_, content) in zip(chunks.items(), read_many(url, chunks), strict=True):
        expected = allowed(history.get(block, ()), digest(parts[block] or b""), name)
        if expected and digest(content or b"") not in expected:
            yield chunk


def done_blocks(status: NDArray[np.int8], chunks: Sequence[int]) -> NDArray[np.bool_]:
    """Return which blocks have a case that is done."""
    done = status == Status.DONE
    for axis, length in enumerate(chunks):
        if done.shape[axis]:
            done = np.logical_or.reduceat(done, range(0, done.shape[axis], length), axis=axis)
    return np.asarray(done)
