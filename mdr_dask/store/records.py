"""Records of blocks: times, versions, messages, and the digest of every chunk.

A run writes one record file for each attempt to compute a block. From time to time, the run merges many record files
into one file, because a folder with a hundred thousand files would be slow.
"""

from __future__ import annotations

import logging
import re
import uuid
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

from mdr_dask.plan import RECORDS_TOGETHER, BlockIndex
from mdr_dask.store.files import (
    chunk_name,
    group_name,
    listed,
    read_many,
    remove,
    without_digest,
    write_stages,
)

log = logging.getLogger("mdr_dask.store")

_LOOSE = re.compile(r"(\d+(?:\.\d+)*)-(\d+)\.json")


def folder(series: str) -> str:
    """Return the prefix of the file names of all records of a group."""
    return group_name(series, "status/records/")


def name_of(series: str, index: BlockIndex, attempt: int) -> str:
    """Return the file name of the record that an attempt to compute a block writes."""
    return f"{folder(series)}{'.'.join(map(str, index))}-{attempt}.json"


def decoded(line: bytes) -> dict[str, Any] | None:
    """Return a record, or None for a damaged record. Records of version 0.1 have no digest and count as undamaged."""
    record = without_digest(line)
    return record if record is not None and record.keys() >= {"block", "attempt", "messages"} else None


def lines(url: str, series: str) -> Iterator[tuple[str, bytes]]:
    """Yield the file name and the bytes of every record of a group."""
    names = [name for name in listed(url, folder(series)) if name.endswith((".json", ".jsonl"))]
    for name, content in read_many(url, names):
        for line in (content or b"").splitlines() if name.endswith(".jsonl") else [content]:
            if line is not None:
                yield name, line


def records(url: str, series: str) -> Iterator[dict[str, Any]]:
    """Yield each record of a group once. Damaged records are left out."""
    seen: set[tuple[BlockIndex, int]] = set()
    damaged = 0
    for _, line in lines(url, series):
        record = decoded(line)
        if record is None:
            damaged += 1
        elif (key := (tuple(record["block"]), record["attempt"])) not in seen:
            seen.add(key)
            yield record
    if damaged:
        _warn_of_damaged(url, damaged)


@lru_cache(maxsize=16)
def _warn_of_damaged(url: str, count: int) -> None:
    """Log a warning about damaged records. The warning is repeated only if the number of damaged records changes."""
    log.warning("%s: %d damaged records are left out; 'mdr-dask verify %s' names them", url, count, url)


def attempts(url: str, series: str) -> dict[BlockIndex, int]:
    """Return the largest number of an attempt in the records of each block. Blocks without a record are left out."""
    found: dict[BlockIndex, int] = {}
    for record in records(url, series):
        key = tuple(record["block"])
        found[key] = max(found.get(key, 0), record["attempt"])
    return found


def merge_records(url: str, series: str) -> None:
    """Merge record files of blocks whose ledger has been written. Each new file holds many records.

    A record can be in two files if a process is killed while merging, or if two processes merge the same files.
    """
    prefix = folder(series)
    loose = [name for name in listed(url, prefix) if _LOOSE.fullmatch(name.removeprefix(prefix))]
    for first in range(0, len(loose), RECORDS_TOGETHER):
        some = loose[first : first + RECORDS_TOGETHER]
        records = {name: content for name, content in read_many(url, some) if content}
        blocks = {name: found["block"] for name, content in records.items() if (found := decoded(content))}
        chunks = [chunk_name(series, "status", block) for block in blocks.values()]
        in_ledger = [content is not None for _, content in read_many(url, chunks)]
        finished = [name for name, is_finished in zip(blocks, in_ledger, strict=True) if is_finished]
        if finished:
            merged = b"".join(records[name] + b"\n" for name in finished)
            write_stages(url, [{f"{prefix}{uuid.uuid4().hex[:12]}.jsonl": merged}])
            remove(url, finished)
