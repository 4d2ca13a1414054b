"""Blocks and their ledger: what a task reads and writes."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from mdr_dask.errors import StoreError
from mdr_dask.models.base import Status
from mdr_dask.plan import BlockIndex
from mdr_dask.store.files import bytes_of, group_name, guarded, names, read_bytes, read_json, write_bytes


@dataclass(frozen=True)
class Place:
    """Where a block stands.

    Parameters
    ----------
    url, series : str
        Store and name of the group.
    index : tuple of int
        The block's place in the grid of blocks.
    region : tuple of slice
        The block's place over (axes..., realisation).
    layout : str
        The `layout_mark` of the store that the driver sees, so that nobody writes into another one, or into a shape of
        yesterday.
    """

    url: str
    series: str
    index: BlockIndex
    region: tuple[slice, ...]
    layout: str


def write_values(place: Place, values: Mapping[str, NDArray[np.float64]]) -> None:
    """Write a block of every output, each a whole chunk: its shape is that of the region, further dimensions behind."""
    arrays = _arrays(place.url, place.series, place.layout)
    for name, array in values.items():
        with guarded(place.url, f"writing {name}"):
            arrays[name][place.region] = array


def write_status(place: Place, status: NDArray[np.int8]) -> None:
    """Write a block of the ledger: the last act of a task, and the only proof that it is done."""
    with guarded(place.url, "writing status"):
        _arrays(place.url, place.series, place.layout)["status"][place.region] = status


def read_block(place: Place, outputs: tuple[str, ...]) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int8]]:
    """Return what stands in a block: its values and its part of the ledger, as arrays that may be changed."""
    arrays = _arrays(place.url, place.series, place.layout)
    with guarded(place.url, f"reading block {place.index}"):
        return {name: np.array(arrays[name][place.region]) for name in outputs}, np.array(
            arrays["status"][place.region]
        )


def write_record(place: Place, attempt: int, record: Mapping[str, Any]) -> None:
    """Write what a block has to tell besides its numbers: times, versions, messages."""
    write_bytes(place.url, _record_name(place, attempt), json.dumps(record, sort_keys=True).encode())


def record(place: Place, attempt: int) -> dict[str, Any] | None:
    """Return what an attempt at a block had to tell, None if it never came so far."""
    return read_json(place.url, _record_name(place, attempt))


def _record_name(place: Place, attempt: int) -> str:
    return f"{_records(place.series)}{'.'.join(map(str, place.index))}-{attempt}.json"


def records(url: str, series: str) -> Iterator[dict[str, Any]]:
    """Yield the records of all blocks of a group."""
    for name in names(url, _records(series)):
        record = read_json(url, name)
        if record is not None:
            yield record


def attempts(url: str, series: str) -> dict[BlockIndex, int]:
    """Return how often each block has been computed, from the names of its records."""
    found: dict[BlockIndex, int] = {}
    for name in names(url, _records(series)):
        index, _, attempt = name.rpartition("/")[2].removesuffix(".json").partition("-")
        key = tuple(map(int, index.split(".")))
        found[key] = max(found.get(key, 0), int(attempt))
    return found


def _records(series: str) -> str:
    return group_name(series, "status/records/")


def ledger(url: str, series: str, shape: tuple[int, ...]) -> NDArray[np.int8]:
    """Return the ``status`` array of a group as it stands now, with what the shape has beyond it as missing.

    Another part may have grown it beyond the shape meanwhile.
    """
    found = np.full(shape, Status.MISSING, dtype=np.int8)
    if read_json(url, group_name(series, "zarr.json")) is None:
        return found
    with guarded(url, "reading status"):
        status = _open(url, series)["status"]
        common = tuple(map(slice, np.minimum(shape, status.shape)))
        found[common] = status[common]
    return found


def values(url: str, series: str, output: str) -> NDArray[np.float64]:
    """Return one output of a group as it stands now, axes in the order of the store."""
    with guarded(url, f"reading {output}"):
        return np.asarray(_open(url, series)[output][...])


def _open(url: str, series: str) -> Any:
    return zarr.open_group(bytes_of(url), path=group_name(series) or None, mode="r", use_consolidated=True)


@lru_cache(maxsize=64)
def _arrays(url: str, series: str, layout: str) -> dict[str, Any]:
    """Hold the arrays of a group open for as long as its layout stands."""
    seen = layout_mark(url)
    if seen != layout:
        raise StoreError(f"{url}: {_other_store(seen)}")
    with guarded(url, "opening it"):
        group = zarr.open_group(bytes_of(url), path=group_name(series) or None, mode="r+", use_consolidated=True)
        return dict(group.arrays())


def _other_store(seen: str | None) -> str:
    here = platform.node()
    if seen is None:
        return f"not seen from {here}; the workers need a shared file system or a URL"
    return f"{here} sees another store of that name, or a later shape; the workers need a shared file system or a URL"


def layout_mark(url: str) -> str | None:
    """Return what tells a layout of a store from every other one; None where there is no store."""
    document = read_bytes(url, "zarr.json")
    return None if document is None else hashlib.blake2b(document, digest_size=16).hexdigest()
