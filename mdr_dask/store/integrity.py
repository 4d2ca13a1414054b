"""Check metadata, and read the record of the layout, which holds the digests of all metadata and coordinates."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mdr_dask.store.files import RECORD_FOLDER, parsed, read_bytes, with_digest

#: File with the record of the layout. It has the form of an empty Zarr group, because Zarr warns about other files.
RECORD = f"{RECORD_FOLDER}/zarr.json"
#: Codecs of the arrays of a study. Other codecs might run code, and are refused.
CODECS = {"bytes", "crc32c", "vlen-utf8", "zstd"}


@dataclass(frozen=True)
class LayoutRecord:
    """The record of the layout of a study."""

    # For each file of the layout, the digests of all versions of the file, the newest version last. The file in the
    # store may be an older version, because a run may be killed after writing the record and before writing the file.
    files: Mapping[str, list[str]]
    # The content of the newest ``zarr.json``, for `mdr_dask.store.repair`.
    root: str

    @property
    def content(self) -> bytes:
        """The content of the file `RECORD`."""
        record = json.loads(with_digest({"files": self.files, "root": self.root}))
        return json.dumps({"zarr_format": 3, "node_type": "group", "attributes": record}).encode()


def read_record(url: str) -> LayoutRecord | None:
    """Return the record of the layout, or None if the record is missing or damaged."""
    content = read_bytes(url, RECORD)
    try:
        held = parsed(content or b"{}")["attributes"]
        record = LayoutRecord(dict(held["files"]), str(held["root"]))
        is_valid = record.content == content and all(map(is_inside, record.files)) and "zarr.json" in record.files
    except (TypeError, KeyError, ValueError):
        return None
    return record if is_valid and all(isinstance(versions, list) for versions in record.files.values()) else None


def is_inside(name: str) -> bool:
    """Return whether a name found in a store refers to a file inside this store."""
    return not name.startswith("/") and ".." not in name.split("/")


def is_safe(group: Mapping[str, Any]) -> bool:
    """Return whether it is safe to open a group with Zarr: format 3, known codecs, names inside the store."""
    try:
        members = group["consolidated_metadata"]["metadata"]
        return group["zarr_format"] == 3 and all(is_inside(name) and _is_safe(members[name]) for name in members)
    except (KeyError, TypeError, AttributeError):
        return False


def _is_safe(member: Mapping[str, Any]) -> bool:
    codecs = {codec["name"] for codec in member.get("codecs", ())}
    return member["zarr_format"] == 3 and codecs <= CODECS and not member.get("storage_transformers")
