"""Is a chunk the one that was written? What the records of its block say, for whoever reads."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterable, Mapping
from operator import itemgetter
from typing import Any

from zarr.abc.store import ByteRequest, Store
from zarr.core.buffer import Buffer, BufferPrototype
from zarr.storage import WrapperStore

from mdr_dask.errors import StoreError
from mdr_dask.plan import BlockIndex
from mdr_dask.store.files import group_name, read_bytes
from mdr_dask.store.records import digest, records
from mdr_dask.store.study import document

#: Digests of the chunks that each attempt at a block has written, by array, in the order of the attempts.
History = tuple[Mapping[str, str], ...]


def histories(found: Iterable[Mapping[str, Any]]) -> dict[BlockIndex, History]:
    """Return the history of every block, from its records; those of earlier versions wrote no digests."""
    known: dict[BlockIndex, History] = {}
    attempts = [(int(record["attempt"]), tuple(record["block"]), record.get("chunks", {})) for record in found]
    for _, block, chunks in sorted(attempts, key=itemgetter(0)):
        known[block] = (*known.get(block, ()), chunks)
    return known


def allowed(history: History, status: str | None, name: str) -> set[str]:
    """Return the digests that the chunk of an array may have beside a chunk of the ledger; none if nobody knows.

    It belongs to the last attempt that wrote this ledger, or to a later one that was killed before it wrote its own.
    """
    first = next((i for i, chunks in enumerate(history) if chunks.get("status") == status), len(history))
    found: set[str] = set()
    last: set[str] = set()
    for i, chunks in enumerate(history):
        last = {chunks[name]} if name in chunks else last
        found |= last if i >= first else set()
    return found


class Checked(WrapperStore[Store]):
    """A store that refuses to read a chunk of a group that is gone, or is not what was written there."""

    def __init__(self, store: Store, url: str, series: str) -> None:
        super().__init__(store)
        self._url, self._series = url, series
        self._prefix = group_name(series, "status").removesuffix("status")
        self._arrays = {"status", *((document(url, series) or {}).get("attributes", {}).get("outputs", ()))}
        self._known: dict[BlockIndex, History] | None = None
        self._lock = threading.Lock()

    def _with_store(self, store: Store) -> Checked:
        return Checked(store, self._url, self._series)

    async def get(self, key: str, prototype: BufferPrototype, byte_range: ByteRequest | None = None) -> Buffer | None:
        """Return what stands under a name."""
        found = await self._store.get(key, prototype, byte_range)
        if byte_range is None and "/c/" in key:
            name, block = self._place(key)
            if name not in self._arrays:  # a coordinate, which belongs to the layout
                return found
            content = None if found is None else found.to_bytes()
            if self._known is None or not self._is_latest(name, block, content):
                await asyncio.to_thread(self._require, key, name, block, content)
        return found

    def _place(self, key: str) -> tuple[str, BlockIndex]:
        name, _, place = key.removeprefix(self._prefix).rpartition("/c/")
        return name, tuple(map(int, place.split("/")))

    def _history(self, block: BlockIndex) -> History:
        """Return the history of a block, by the place of one of its chunks, which may have further dimensions."""
        known = self._known or {}
        length = len(next(iter(known), ()))
        return known.get(block[:length], ())

    def _is_latest(self, name: str, block: BlockIndex, content: bytes | None) -> bool:
        history = self._history(block)
        if content is None or not history:
            return content is None and not history
        return history[-1].get(name) == digest(content)

    def _require(self, key: str, name: str, block: BlockIndex, content: bytes | None) -> None:
        with self._lock:
            if self._known is None:
                self._known = histories(records(self._url, self._series))
            if self._is_fit(name, block, content):
                return
            self._known = histories(records(self._url, self._series))  # it may have been written since
        if not self._is_fit(name, block, read_bytes(self._url, key)):
            what = "is gone" if content is None else "is not what was written there"
            raise StoreError(f"{self._url}: damaged, {key} {what}; 'mdr-dask verify {self._url}' names all that is")

    def _is_fit(self, name: str, block: BlockIndex, content: bytes | None) -> bool:
        history = self._history(block)
        if name == "status":
            written = {chunks["status"] for chunks in history if "status" in chunks}
            return content is None or not written or digest(content) in written
        place = "/".join(map(str, block[: len(next(iter(self._known or {}), ()))]))
        ledger = read_bytes(self._url, group_name(self._series, f"status/c/{place}"))
        if ledger is None:
            return True
        expected = allowed(history, digest(ledger), name)
        return not expected or (content is not None and digest(content) in expected)
