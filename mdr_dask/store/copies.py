"""A second copy of what lays a group out: its metadata and coordinates, as they were made from the campaign.

It is written before the files themselves. A file is sound if it is as in the copy, or as in the one before: so also
while a study is laid out anew, and after a run that was killed meanwhile.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from mdr_dask.errors import StoreError
from mdr_dask.store.files import ROOT, group_name, listed, local, read_bytes
from mdr_dask.store.records import digest

_NAME = "status/layout.json"


@dataclass(frozen=True)
class Copy:
    """What lays a group out.

    Parameters
    ----------
    series : str
        Name of the group; empty for that of a study without series.
    files : mapping of str to bytes
        Metadata of its arrays and chunks of its coordinates, and of a series the metadata of its group, by their names
        in the store.
    study, own : mapping
        Attributes of the study as of then, and of the group.
    before : mapping of str to str
        Digests of the files of the copy before.
    """

    series: str
    files: Mapping[str, bytes]
    study: Mapping[str, Any]
    own: Mapping[str, Any]
    before: Mapping[str, str] = field(default_factory=dict)

    @property
    def members(self) -> dict[str, Any]:
        """What the root's consolidated metadata have to say of the group."""
        own = group_name(self.series, "zarr.json")
        suffix = "/zarr.json"
        arrays = {
            name.removesuffix(suffix): json.loads(content)
            for name, content in self.files.items()
            if name.endswith(suffix) and name != own
        }
        if not self.series:
            return arrays
        attributes = {**self.study, **self.own}
        return {**arrays, self.series: {"zarr_format": 3, "node_type": "group", "attributes": attributes}}

    def is_sound(self, name: str, content: bytes | None) -> bool:
        """Say whether a file is as it was made, now or before."""
        return content is not None and (content == self.files[name] or digest(content) == self.before.get(name))

    def stands(self, name: str) -> bool:
        """Say whether a file was there already, as it is now."""
        return digest(self.files[name]) == self.before.get(name)

    def file(self) -> tuple[str, bytes]:
        """Return the name and the content of the file that holds the copy."""
        held = {
            "series": self.series,
            "study": self.study,
            "own": self.own,
            "files": {name: base64.b64encode(content).decode() for name, content in self.files.items()},
            "before": self.before,
        }
        text = json.dumps(held, sort_keys=True)
        return copy_name(self.series), json.dumps({**held, "digest": digest(text.encode())}, sort_keys=True).encode()


def copy_name(series: str) -> str:
    """Return the name of the copy of a group."""
    return group_name(series, _NAME)


def read_copy(url: str, series: str) -> Copy | None:
    """Return the copy of a group, None if there is none.

    Raises
    ------
    StoreError
        If it is damaged.
    """
    content = read_bytes(url, copy_name(series))
    if content is None:
        return None
    damaged = StoreError(f"{url}: {copy_name(series)} is damaged")
    try:
        held = json.loads(content)
        stated = held.pop("digest")
        files = {name: base64.b64decode(text) for name, text in held["files"].items()}
        study, own, before = (dict(held[name]) for name in ("study", "own", "before"))
        of_group = held["series"] == ("" if series == ROOT else series)
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise damaged from None
    if not of_group or stated != digest(json.dumps(held, sort_keys=True).encode()):
        raise damaged
    return Copy(held["series"], files, study, own, before)


def groups_laid_out(url: str) -> list[str]:
    """Return the names of the groups of a study by their copies alone, which are no other study's in a folder below."""
    return [series for series in groups_with(url, _NAME) if _is_readable(url, series)]


def groups_with(url: str, member: str) -> list[str]:
    """Return the names of the groups that have a file of a certain name, whatever the metadata say."""
    path = local(url)
    if path is None:
        names = [name for name in listed(url) if name.endswith(member)]
    else:
        names = [found.relative_to(path).as_posix() for depth in ("", "*/") for found in path.glob(f"{depth}{member}")]
    return [name.removesuffix(member).rstrip("/") for name in names]


def _is_readable(url: str, series: str) -> bool:
    try:
        return read_copy(url, series) is not None
    except StoreError:
        return False


def root_of(copies: list[Copy], others: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return members and attributes of the root's metadata, put together from copies, and others where none is left."""
    latest = max(copies, key=lambda copy: len(copy.study["history"]))
    root = next((copy.own for copy in copies if not copy.series), {})
    members = dict(others)
    for copy in copies:
        members |= copy.members
    return members, {**latest.study, **root, **signpost(members)}


def signpost(members: Mapping[str, Any]) -> dict[str, str]:
    """Return what a root with series says of where their results are: opened as one dataset, it looks empty."""
    series = sorted(name for name, member in members.items() if member["node_type"] == "group")
    groups = " or ".join(f"group={name!r}" for name in series)
    return (
        {"comment": f"results of series stand in groups: open_datatree, or open_zarr with {groups}"} if series else {}
    )
