"""Read the ledger of a group (the array ``status``), and find the chunks of the blocks of the group."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from zarr.core.buffer import default_buffer_prototype

from mdr_dask.errors import StoreError
from mdr_dask.models.base import Status
from mdr_dask.plan import BlockIndex
from mdr_dask.store.files import chunk_name, group_name, guarded, listed, read_many
from mdr_dask.store.identity import block_digests, of_other_campaign
from mdr_dask.store.integrity import RECORD
from mdr_dask.store.layout import layout_faults
from mdr_dask.store.records import records
from mdr_dask.store.study import array_of, document


@dataclass(frozen=True)
class Blocks:
    """The blocks of a group."""

    series: str
    # `grid`: number of blocks along each dimension. `lengths`: length of a block along each dimension.
    grid: tuple[int, ...]
    lengths: tuple[int, ...]
    # Number of dimensions that each array has in addition to those of the ledger. The first array is the ledger.
    further: Mapping[str, int]

    @classmethod
    def of(cls, series: str, metadata: Mapping[str, Any]) -> Blocks:
        """Return the blocks of a group from its metadata."""
        arrays = metadata["consolidated_metadata"]["metadata"]
        status = arrays["status"]
        lengths = tuple(status["chunk_grid"]["configuration"]["chunk_shape"])
        grid = tuple(math.ceil(size / length) for size, length in zip(status["shape"], lengths, strict=True))
        names = ("status", *metadata["attributes"]["outputs"])
        return cls(series, grid, lengths, {name: len(arrays[name]["shape"]) - len(grid) for name in names})

    @property
    def indices(self) -> Iterator[BlockIndex]:
        """The indices of all blocks."""
        return itertools.product(*map(range, self.grid))

    def chunk(self, array: str, block: BlockIndex) -> str:
        """Return the file name of the chunk of a block in an array."""
        return chunk_name(self.series, array, block, self.further[array])

    def has(self, block: BlockIndex) -> bool:
        """Return whether the group has a block with this index."""
        return len(block) == len(self.grid) and all(0 <= i < n for i, n in zip(block, self.grid, strict=True))


def ledger(url: str, series: str, shape: tuple[int, ...] | None = None) -> NDArray[np.int8]:
    """Return the ledger of a group. If `shape` is given, the ledger is cut or padded with "missing" to this shape.

    If the group does not exist, return a ledger of the given `shape` in which all results are missing. Raise StoreError
    if the group does not exist and no `shape` is given, or if the ledger is damaged.
    """
    metadata = document(url, series)
    if metadata is None:
        if shape is None:
            raise StoreError(f"{url}: {group_name(series, 'zarr.json')} is missing")
        return np.full(shape, Status.MISSING, dtype=np.int8)
    if "axes" not in metadata.get("attributes", {}):
        raise StoreError(
            f"{url}: {group_name(series, 'zarr.json')} is damaged; 'mdr-dask verify {url}' names all faults"
        )
    status = _read(url, Blocks.of(series, metadata), metadata["consolidated_metadata"]["metadata"]["status"])
    if shape is None:
        return status
    found = np.full(shape, Status.MISSING, dtype=np.int8)
    common = tuple(map(slice, np.minimum(shape, status.shape)))
    found[common] = status[common]
    return found


def _read(url: str, blocks: Blocks, metadata: Mapping[str, Any]) -> NDArray[np.int8]:
    """Read the ledger. Equal chunks are decoded only once, because most chunks are equal and decoding is slow."""
    different: dict[bytes | None, int] = {None: 0}
    names = (blocks.chunk("status", block) for block in blocks.indices)
    numbers = [different.setdefault(content, len(different)) for _, content in read_many(url, names)]
    which = np.array(numbers, dtype=np.int64).reshape(blocks.grid)
    buffer, below = default_buffer_prototype().buffer, "/0" * (len(blocks.grid) - 1)
    files = {f"c/{i}{below}": buffer.from_bytes(content) for content, i in different.items() if content is not None}
    stacked = [len(different) * blocks.lengths[0], *blocks.lengths[1:]]
    try:
        with guarded(url, "reading status"):
            decoded = array_of({**metadata, "shape": stacked}, zarr.storage.MemoryStore(files))[...]
    except StoreError as error:
        raise StoreError(f"{error}; 'mdr-dask verify {url}' names what is damaged") from None
    parts = np.asarray(decoded).reshape(-1, *blocks.lengths)[which]
    dims = which.ndim
    beside = parts.transpose([axis for dim in range(dims) for axis in (dim, dims + dim)])
    whole = beside.reshape([count * length for count, length in zip(which.shape, blocks.lengths, strict=True)])
    return np.asarray(whole[tuple(map(slice, metadata["shape"]))])


def require_undamaged(url: str, series: Sequence[str], to_run: bool = False) -> None:
    """Raise StoreError if a file of the layout is damaged or missing, or a chunk of a block with results is missing.

    The values are not read. A missing record of the layout is no fault. If `to_run` is true, other missing files of the
    layout are no fault either, because the run writes them again, but results of another campaign are a fault.
    """
    if any(_faults(url, series, to_run)):  # check again: a run may have changed a file meanwhile
        first = next(_faults(url, series, to_run), None)
        if first:
            remedy = (
                f"'mdr-dask verify {url}' names all faults; with --repair it removes what is damaged, and the next run "
                "writes it again"
            )
            raise StoreError(f"{url}: damaged: {first}; {remedy}")


def _faults(url: str, series: Sequence[str], to_run: bool) -> Iterator[str]:
    for fault in layout_faults(url):
        if fault.kind == "damaged" or not (to_run or fault.name == RECORD):
            yield f"{fault.name} is {fault.kind}"
    for name in series:
        metadata = document(url, name) or {}
        blocks = Blocks.of(name, metadata)
        if to_run:
            digests = block_digests(metadata["attributes"])
            others = (record["block"] for record in records(url, name) if of_other_campaign(record, digests))
            yield from (f"block {block} has results of another campaign" for block in others)
        if metadata["attributes"]["mdr_dask_layout"] < 2:  # version 0.1 wrote no chunk if all its values were NaN
            continue
        done = _has_done(ledger(url, name), blocks.lengths)
        # first read the ledger, then list the chunks: a run writes the ledger of a block after all chunks of the block
        present = set(listed(url, group_name(name)))
        for array in list(blocks.further)[1:]:
            chunks = (blocks.chunk(array, tuple(block)) for block in np.argwhere(done).tolist())
            yield from (f"{chunk} is missing" for chunk in chunks if chunk not in present)


def _has_done(status: NDArray[np.int8], lengths: Sequence[int]) -> NDArray[np.bool_]:
    """Return a mask of the blocks that have at least one result that is done."""
    done = status == Status.DONE
    for axis, length in enumerate(lengths):
        if done.shape[axis]:
            done = np.logical_or.reduceat(done, range(0, done.shape[axis], length), axis=axis)
    return np.asarray(done)
