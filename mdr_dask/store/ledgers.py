"""The ledger of a group, read at once: which results there are, and in which state."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.core.buffer import default_buffer_prototype

from mdr_dask.errors import StoreError
from mdr_dask.models.base import Status
from mdr_dask.store.files import group_name, guarded, read_many
from mdr_dask.store.records import digest
from mdr_dask.store.seals import Chunks, Contents, Seal, read_seal
from mdr_dask.store.study import array_of, document


def ledger(url: str, series: str, shape: tuple[int, ...]) -> NDArray[np.int8]:
    """Return the ``status`` array of a group as it stands now, with what the shape has beyond it as missing.

    Another part may have grown it beyond the shape meanwhile.
    """
    found = np.full(shape, Status.MISSING, dtype=np.int8)
    held = document(url, series)
    if held is None:
        return found
    if "axes" not in held.get("attributes", {}):  # of an array, say
        raise StoreError(f"{url}: {group_name(series, 'zarr.json')} is damaged; 'mdr-dask verify {url}' looks into it")
    chunks = Chunks.of(series, held)
    seal = read_seal(url, series)
    if seal is None:
        known = read_ledger(url, chunks, Seal.nothing(series, chunks.grid), None)
    else:
        known = read_ledger(url, chunks, seal, chunks.stamps(url, "status"))
    status = known.decoded(url, held)
    common = tuple(map(slice, np.minimum(shape, status.shape)))
    found[common] = status[common]
    return found


def read_ledger(url: str, chunks: Chunks, seal: Seal, stamps: NDArray[np.int64] | None) -> Ledger:
    """Read the ledger of a group: what has not the stamps of a seal, or all of it."""
    which = seal.contents(chunks.grid)
    unread = np.ones(chunks.grid, dtype=bool) if stamps is None else stamps != seal.known("status", chunks.grid)
    different = {content: number for number, content in enumerate(seal.different)}
    names = itertools.compress(chunks.names("status"), unread.flat)
    which[unread] = [different.setdefault(content, len(different)) for _, content in read_many(url, names)]
    return Ledger(tuple(different), which)


@dataclass(frozen=True)
class Ledger:
    """The ledger as it is stored: each different chunk once, since those of blocks that are done are alike.

    Parameters
    ----------
    different : tuple of bytes or None
        Each different content; the first is that of chunks that are not there.
    which : int64 array, shape of the grid of blocks
        The content of every chunk, by its number.
    """

    different: Contents
    which: NDArray[np.int64]

    @property
    def digests(self) -> list[str]:
        """The digest of each different content; empty for that of chunks that are not there."""
        return ["" if content is None else digest(content) for content in self.different]

    def only(self, mask: NDArray[np.bool_]) -> Ledger:
        """Return the ledger with some of its chunks alone."""
        used = np.unique(self.which[mask])
        numbers = np.zeros(len(self.different), dtype=np.int64)
        numbers[used[used > 0]] = 1 + np.arange(np.count_nonzero(used))
        different = [self.different[number] for number in used if number > 0]
        return Ledger((None, *different), np.where(mask, numbers[self.which], 0))

    def decoded(self, url: str, held: Mapping[str, Any]) -> NDArray[np.int8]:
        """Return the array that the metadata of its group tell of; its contents are decoded as chunks of one array."""
        status = held["consolidated_metadata"]["metadata"]["status"]
        shape, chunk = status["shape"], status["chunk_grid"]["configuration"]["chunk_shape"]
        try:
            with guarded(url, "reading status"):
                parts = _contents(self.different, json.dumps({**status, "shape": None}))[self.which]
        except StoreError as error:
            raise StoreError(f"{error}; 'mdr-dask verify {url}' names what is damaged") from None
        dims = self.which.ndim
        beside = parts.transpose([axis for dim in range(dims) for axis in (dim, dims + dim)])
        whole = beside.reshape([count * length for count, length in zip(self.which.shape, chunk, strict=True)])
        return np.asarray(whole[tuple(map(slice, shape))])


@lru_cache(maxsize=4)
def _contents(different: Contents, status: str) -> NDArray[np.int8]:
    """Return what chunks of the ledger hold, decoded as those of one array; a run reads each round's several times."""
    shown = json.loads(status)
    chunk = shown["chunk_grid"]["configuration"]["chunk_shape"]
    if different == (None,):
        return np.full((1, *chunk), Status.MISSING, dtype=np.int8)
    buffer = default_buffer_prototype().buffer
    below = "/0" * (len(chunk) - 1)
    files = {f"c/{i}{below}": buffer.from_bytes(one) for i, one in enumerate(different) if one is not None}
    stacked = [len(different) * chunk[0], *chunk[1:]]
    opened = array_of({**shown, "shape": stacked}, zarr.storage.MemoryStore(files))
    return np.asarray(opened[...]).reshape(-1, *chunk)


def done_blocks(status: NDArray[np.int8], chunks: Iterable[int]) -> NDArray[np.bool_]:
    """Return which blocks have a case that is done."""
    done = status == Status.DONE
    for axis, length in enumerate(chunks):
        if done.shape[axis]:
            done = np.logical_or.reduceat(done, range(0, done.shape[axis], length), axis=axis)
    return np.asarray(done)
