"""Read and write blocks."""

from __future__ import annotations

import asyncio
import hashlib
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.core.buffer import Buffer
from zarr.core.sync import sync

from mdr_dask.errors import StoreError
from mdr_dask.plan import BlockIndex
from mdr_dask.store.files import (
    chunk_name,
    digest,
    group_name,
    guarded,
    read_bytes,
    with_digest,
    write_stages,
)
from mdr_dask.store.identity import block_digests
from mdr_dask.store.locks import Lock, while_locked
from mdr_dask.store.records import name_of
from mdr_dask.store.study import array_of, chunks_of, document


@dataclass(frozen=True)
class Place:
    """The position of a block in a store."""

    url: str
    series: str
    index: BlockIndex
    # The part of the ledger that the block fills: one slice for each dimension, the last one for ``realisation``.
    region: tuple[slice, ...]
    # The digest of the layout when the round began (`layout_mark`). A worker that finds another layout raises
    # StoreError.
    layout: str
    lock: Lock


def write_block(
    place: Place,
    attempt: int,
    values: Mapping[str, NDArray[np.float64]],
    status: NDArray[np.int8],
    record: Mapping[str, Any],
) -> None:
    """Write a block: first the record, then one whole chunk of every output, and finally the chunk of the ledger.

    Each array in `values` has the dimensions of the region, then the further dimensions of its output. `values` is
    empty if only the ledger changes. Raise StoreBusyError, and write nothing, if the run no longer holds its lock.
    """
    arrays, encoded = _in_memory(place.url, place.series, place.layout)
    given = {**values, "status": status}

    async def encode() -> None:
        await asyncio.gather(*[arrays[name].async_array.setitem(place.region, array) for name, array in given.items()])

    with guarded(place.url, f"encoding block {place.index}"):
        sync(encode())
    further = {name: arrays[name].ndim - len(place.index) for name in given}
    keys = {name: chunk_name(place.series, name, place.index, dims) for name, dims in further.items()}
    chunks = {name: (key, encoded.pop(key).to_bytes()) for name, key in keys.items()}
    region = [[part.start, part.stop] for part in place.region]
    of_block = {"region": region, "campaign": _digests(place.url, place.series, place.layout)(region)}
    digests = {name: digest(content) for name, (_, content) in chunks.items()}
    line = with_digest({**record, **of_block, "chunks": digests})
    ledger = dict([chunks.pop("status")])
    with while_locked(place.url, place.lock):
        write_stages(place.url, [{name_of(place.series, place.index, attempt): line}, dict(chunks.values()), ledger])


def read_block(place: Place, outputs: tuple[str, ...]) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int8]]:
    """Return the values of a block and its part of the ledger, as arrays that the caller may change."""
    arrays = _arrays(place.url, place.series, place.layout)

    async def read() -> list[Any]:
        return await asyncio.gather(*[arrays[name].async_array.getitem(place.region) for name in (*outputs, "status")])

    with guarded(place.url, f"reading block {place.index}"):
        *values, status = map(np.array, sync(read()))
    return dict(zip(outputs, values, strict=True)), status


def values(url: str, series: str, output: str) -> NDArray[np.float64]:
    """Return the current values of one output of a group. The order along each axis is the stored order."""
    (held,) = _opened(url, series, [output]).values()
    with guarded(url, f"reading {output}"):
        return np.asarray(held[...])


def _opened(url: str, series: str, names: Iterable[str] = ()) -> dict[str, Any]:
    """Return the named arrays of a group, or the ledger and all outputs if no name is given."""
    held = document(url, series)
    if held is None:
        raise StoreError(f"{url}: this store, or one of its groups, has been removed")
    shown = held["consolidated_metadata"]["metadata"]
    wanted = names or ("status", *held["attributes"]["outputs"])
    chunks = chunks_of(url)
    return {name: array_of(shown[name], chunks, group_name(series, name)) for name in wanted}


@lru_cache(maxsize=64)
def _arrays(url: str, series: str, layout: str) -> dict[str, Any]:
    """Return the arrays of a group, cached for each layout. Raise StoreError if this machine finds another layout."""
    found, here = layout_mark(url), platform.node()
    if found != layout:
        what = f"{here} finds another store or another layout" if found else f"not seen from {here}"
        raise StoreError(f"{url}: {what}; the workers need a shared file system or a URL")
    return _opened(url, series)


@lru_cache(maxsize=64)
def _in_memory(url: str, series: str, layout: str) -> tuple[dict[str, Any], dict[str, Buffer]]:
    """Return empty arrays in memory, like the arrays of a group, and the dict that receives the encoded chunks."""
    shown, encoded = _arrays(url, series, layout), dict[str, Buffer]()
    memory, empty = zarr.storage.MemoryStore(encoded), {}
    for name, array in shown.items():
        # round the shape up to whole chunks
        shape = [-(-size // length) * length for size, length in zip(array.shape, array.chunks, strict=True)]
        larger = array_of({**array.metadata.to_dict(), "shape": shape}, memory, array.path)
        empty[name] = larger.with_config({"write_empty_chunks": True})
    return empty, encoded


@lru_cache(maxsize=64)
def _digests(url: str, series: str, layout: str) -> Callable[[Sequence[Sequence[int]]], str]:
    return block_digests((document(url, series) or {})["attributes"])


def layout_mark(url: str) -> str | None:
    """Return a text that changes whenever ``zarr.json`` changes, or None if there is no store."""
    content = read_bytes(url, "zarr.json")
    return None if content is None else hashlib.blake2b(content, digest_size=16).hexdigest()
