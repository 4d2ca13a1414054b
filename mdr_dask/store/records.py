"""What blocks have to tell besides their numbers: times, versions, messages, and the digests of what was written.

While blocks come in, each has a file of its own; those are put together, so that no folder holds a hundred thousand.
"""

from __future__ import annotations

import hashlib
import json
import logging
import re
import uuid
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any

from mdr_dask.plan import RECORDS_TOGETHER, BlockIndex
from mdr_dask.store.files import group_name, listed, read_bytes, read_many, remove, write_stages

log = logging.getLogger("mdr_dask.store")

_LOOSE = re.compile(r"(\d+(?:\.\d+)*)-(\d+)\.json")


def digest(content: bytes) -> str:
    """Return the digest of bytes as they are stored.

    Not a checksum: chunks end with theirs, and the CRC of anything together with its own CRC is always the same.
    """
    return hashlib.blake2b(content, digest_size=8).hexdigest()


def folder(series: str) -> str:
    """Return the prefix of all records of a group."""
    return group_name(series, "status/records/")


def name_of(series: str, index: BlockIndex, attempt: int) -> str:
    """Return the name of the record of an attempt at a block."""
    return f"{folder(series)}{'.'.join(map(str, index))}-{attempt}.json"


def sealed(record: Mapping[str, Any]) -> bytes:
    """Return a record as one line that holds its own digest."""
    text = json.dumps(record, sort_keys=True)
    return json.dumps({**record, "digest": digest(text.encode())}, sort_keys=True).encode()


def opened(line: bytes) -> dict[str, Any] | None:
    """Return what a line says; None if it is not what was written. Records of version 0.1 have no digest."""
    try:
        record: dict[str, Any] = json.loads(line)
        if not _is_one(record):
            return None
        stated = record.pop("digest", None)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return None
    if stated is None or stated == digest(line.replace(f'"digest": "{stated}", '.encode(), b"", 1)):  # as it stands
        return record
    text = json.dumps(record, sort_keys=True)
    return record if stated == digest(text.encode()) else None


def _is_one(found: Mapping[str, Any]) -> bool:
    """Say whether a document has the shape of a record."""
    whole = type(found["attempt"]) is int and all(type(i) is int and i >= 0 for i in found["block"])
    texts = all(type(one) is str for one in found.get("chunks", {}).values()) and type(found.get("kind", "")) is str
    return whole and texts and type(found["messages"]) is list and all(map(_is_message, found["messages"]))


def _is_message(told: Mapping[str, Any]) -> bool:
    texts = type(told["message"]) is str and told["status"] in ("done", "not_converged", "failed", "not_needed")
    plain = all(isinstance(value, str | int | float | None) for value in told["case"].values())
    return texts and plain and all(type(i) is int and i >= 0 for i in told.get("place", ()))


def record(url: str, series: str, index: BlockIndex, attempt: int) -> dict[str, Any] | None:
    """Return what an attempt at a block had to tell, as long as it has a file of its own."""
    content = read_bytes(url, name_of(series, index, attempt))
    return None if content is None else opened(content)


def lines(url: str, series: str) -> Iterator[tuple[str, bytes]]:
    """Yield every record of a group as it is stored, and the name of the file that holds it."""
    names = [name for name in listed(url, folder(series)) if name.endswith((".json", ".jsonl"))]
    for name, content in read_many(url, names):
        for line in (content or b"").splitlines() if name.endswith(".jsonl") else [content]:
            if line is not None:
                yield name, line


def records(url: str, series: str) -> Iterator[dict[str, Any]]:
    """Yield the records of all blocks of a group, each once; those that are damaged are counted and left out."""
    seen: set[tuple[BlockIndex, int]] = set()
    damaged = 0
    for _, line in lines(url, series):
        record = opened(line)
        if record is None:
            damaged += 1
        elif (key := (tuple(record["block"]), record["attempt"])) not in seen:
            seen.add(key)
            yield record
    if damaged:
        _tell_damaged(url, damaged)


@lru_cache(maxsize=16)
def _tell_damaged(url: str, count: int) -> None:
    """Say once what is said of damaged records."""
    log.warning("%s: %d damaged records are left out; 'mdr-dask verify %s' names them", url, count, url)


def attempts(url: str, series: str) -> dict[BlockIndex, int]:
    """Return how often each block has been begun."""
    found: dict[BlockIndex, int] = {}
    for record in records(url, series):
        key = tuple(record["block"])
        found[key] = max(found.get(key, 0), record["attempt"])
    return found


def kinds(url: str, series: Sequence[str]) -> dict[str, int]:
    """Return how many blocks each kind of machine has computed, as far as records say so."""
    last = {(name, tuple(r["block"])): r.get("kind") for name in series for r in records(url, name)}
    return dict(Counter(kind for kind in last.values() if kind is not None))


def put_together(url: str, series: str) -> None:
    """Put the records of single blocks together in files of many, and remove theirs.

    Those of attempts that the ledger does not hold stay apart. Whoever does so beside others, or is killed on the way,
    leaves some records in two files; they count once.
    """
    prefix = folder(series)
    loose = [name for name in listed(url, prefix) if _LOOSE.fullmatch(name.removeprefix(prefix))]
    for first in range(0, len(loose), RECORDS_TOGETHER):
        some = loose[first : first + RECORDS_TOGETHER]
        found = {name: content for name, content in read_many(url, some) if content and opened(content) is not None}
        blocks = [_LOOSE.fullmatch(name.removeprefix(prefix))[1].replace(".", "/") for name in found]  # type: ignore[index]
        ledger = [content for _, content in read_many(url, [group_name(series, f"status/c/{b}") for b in blocks])]
        found = {name: line for (name, line), part in zip(found.items(), ledger, strict=True) if part is not None}
        packed = b"".join(content + b"\n" for content in found.values())
        if packed:
            write_stages(url, [{f"{prefix}{uuid.uuid4().hex[:12]}.jsonl": packed}])
            remove(url, found)
