"""Blocks and their ledger: what a task reads and writes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray

from mdr_dask.plan import BlockIndex
from mdr_dask.store.files import names, read_json, write_bytes


def write_values(url: str, series: str, region: tuple[slice, ...], values: Mapping[str, NDArray[np.float64]]) -> None:
    """Write a block of every output, each a whole chunk.

    Parameters
    ----------
    url, series : str
        Store and name of the group.
    region : tuple of slice
        The block's place over (axes..., realisation).
    values : mapping of str to array
        In the shape of the region, further dimensions behind.
    """
    group = _open_group(url, series)
    for name, array in values.items():
        group[name][region] = array


def write_status(url: str, series: str, region: tuple[slice, ...], status: NDArray[np.int8]) -> None:
    """Write a block of the ledger: the last act of a task, and the only proof that it is done."""
    _open_group(url, series)["status"][region] = status


def read_block(
    url: str, series: str, region: tuple[slice, ...], outputs: tuple[str, ...]
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.int8]]:
    """Return what stands in a block: its values and its part of the ledger, as arrays that may be changed."""
    group = _open_group(url, series)
    return {name: np.array(group[name][region]) for name in outputs}, np.array(group["status"][region])


def write_record(url: str, series: str, index: BlockIndex, attempt: int, record: Mapping[str, Any]) -> None:
    """Write what a block has to tell besides its numbers: times, versions, messages."""
    name = ".".join(map(str, index))
    write_bytes(url, f"{_records(series)}{name}-{attempt}.json", json.dumps(record, sort_keys=True).encode())


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
    return f"{series}/status/records/" if series else "status/records/"


def ledger(url: str, series: str) -> NDArray[np.int8]:
    """Return the ``status`` array of a group as it stands now."""
    return np.asarray(_open_group(url, series)["status"][...])


def values(url: str, series: str, output: str) -> NDArray[np.float64]:
    """Return one output of a group as it stands now, axes in the order of the store."""
    return np.asarray(_open_group(url, series)[output][...])


def forget_open_groups() -> None:
    """Drop the groups that this process holds open, after their shape has changed."""
    _open_group.cache_clear()


@lru_cache(maxsize=64)
def _open_group(url: str, series: str) -> Any:
    return zarr.open_group(url, path=series or None, mode="r+", use_consolidated=True)
