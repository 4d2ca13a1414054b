"""Find out whether there is a study at a path or URL, and read the metadata of the study."""

from __future__ import annotations

import re
from collections.abc import Mapping, Set
from functools import lru_cache
from typing import Any

import google_crc32c
import zarr
from zarr.abc.store import Store
from zarr.storage import StorePath

from mdr_dask.errors import StoreError
from mdr_dask.store.files import (
    KEPT,
    LAYOUT,
    ROOT,
    bytes_of,
    digest,
    group_name,
    local,
    parsed,
    read_bytes,
    require_bucket,
)
from mdr_dask.store.integrity import RECORD, is_safe, read_record

_HINTS = {".yaml": "; 'mdr-dask run {}' runs a campaign", ".zip": "; unpack it first"}


def document(url: str, series: str = "") -> Mapping[str, Any] | None:
    """Return the metadata of a group from ``zarr.json``, or None if there is no study or no such group.

    The returned metadata are cached: do not change the metadata. Raise StoreError if the metadata are damaged,
    or if it is not safe to open the arrays.
    """
    content = read_bytes(url, "zarr.json")
    if content is None:
        return None
    root = _checked(url, content)
    if root is None:
        raise StoreError(f"{url}: zarr.json is damaged; 'mdr-dask verify {url}' names all faults")
    return group_of(root, group_name(series))


@lru_cache(maxsize=32)
def _checked(url: str, content: bytes) -> dict[str, Any] | None:
    """Return the metadata of a study, or None if they are not JSON, unsafe, or not in the record of the layout."""
    try:
        root = parsed(content)
    except ValueError:
        return None
    if not isinstance(root, dict) or not isinstance(attributes := root.get("attributes", {}), dict):
        return None
    layout = attributes.get("mdr_dask_layout", LAYOUT + 1)
    if only_claimed(attributes) or (isinstance(layout, int) and layout > LAYOUT):
        return root  # `attributes` raises an error for these metadata
    record = read_record(url)
    is_known = record is None or digest(content) in record.files["zarr.json"]
    return root if is_known and is_safe(root) else None


def group_of(root: Mapping[str, Any], group: str) -> Mapping[str, Any] | None:
    """Return the metadata of a group from the metadata of the study, or None if there is no such group."""
    if not group:
        return root
    members = root.get("consolidated_metadata", {}).get("metadata", {})
    if members.get(group, {}).get("node_type") != "group":
        return None
    own = {"metadata": members_of(members, group)}
    return {**root, "attributes": members[group]["attributes"], "consolidated_metadata": own}


def members_of(members: Mapping[str, Any], group: str) -> dict[str, Any]:
    """Return the metadata of the members of a group, indexed by the names of the members inside the group."""
    return {name.removeprefix(f"{group}/"): each for name, each in members.items() if name.startswith(f"{group}/")}


def array_of(metadata: Mapping[str, Any], store: Store, path: str = "") -> Any:
    """Return the Zarr array with the given metadata, without reading the metadata again."""
    return zarr.Array(zarr.AsyncArray(dict[str, Any](metadata), StorePath(store, path)))  # type: ignore[call-overload]


class _Chunks(zarr.storage.WrapperStore[Store]):
    """A Zarr store for reading arrays. Reading a damaged chunk raises StoreError with the name of the chunk."""

    def __init__(self, store: Store, url: str, checked: Set[str]) -> None:
        super().__init__(store)
        # names of the arrays whose chunks end with a checksum
        self._url, self._checked = url, checked

    def _with_store(self, store: Store) -> _Chunks:
        return _Chunks(store, self._url, self._checked)

    async def get(self, key: str, *arguments: Any, **options: Any) -> Any:
        found = await super().get(key, *arguments, **options)
        if found is not None and _CHUNK.sub("", key) in self._checked:
            content = found.to_bytes()
            # as the codec `crc32c` writes it
            if google_crc32c.value(content[:-4]).to_bytes(4, "little") != content[-4:]:
                raise StoreError(f"{self._url}: {key} is damaged; 'mdr-dask verify {self._url}' names all faults")
        return found


_CHUNK = re.compile(r"/c(/\d+)*$")


def chunks_of(url: str) -> Store:
    """Return the Zarr store at a path or URL, for reading arrays."""
    members = (document(url) or {})["consolidated_metadata"]["metadata"]
    codecs = {name: [codec["name"] for codec in member.get("codecs", ())] for name, member in members.items()}
    return _Chunks(bytes_of(url), url, {name for name in codecs if "crc32c" in codecs[name]})


def refuse_file(url: str, expected: str = "the folder of a store") -> None:
    """Raise StoreError if a file, or a path below a file, is given where a store is expected."""
    path = local(url)
    for place in () if path is None else (path, *path.parents):
        if place.is_file():
            found = "a file" if place == path else f"{place} is a file"
            raise StoreError(f"{url}: {found}, expected {expected}{_HINTS.get(place.suffix, '').format(place)}")


def exists(url: str) -> bool:
    """Return whether there is a study at a path or URL; raise StoreError for a file or a folder with other files.

    Return False if the first run was stopped before it laid out the study. Return True also for a Zarr store of another
    program, for which `attributes` raises StoreError.
    """
    refuse_file(url, "the folder of a store, or a path that does not exist")
    path, found = local(url), _root_attributes(url)
    if found is None and path is not None and path.is_dir():
        others = sorted(entry.name for entry in path.iterdir() if entry.suffix != ".partial" and entry.name not in KEPT)
        if others:
            raise StoreError(f"{url}: a folder with other files ({others[0]}), expected a store or an empty folder")
    return found is not None and not only_claimed(found)


def is_study(url: str) -> bool:
    """Return whether there is a study of mdr_dask at a path or URL."""
    return "mdr_dask_layout" in (_root_attributes(url) or {})


def _root_attributes(url: str) -> dict[str, Any] | None:
    """Return the attributes of the Zarr group at a path or URL, or None if there is no group.

    Raise StoreError if a study has lost its ``zarr.json``, or if this file is damaged.
    """
    found = document(url)
    if found is None and read_bytes(url, RECORD) is not None:
        raise StoreError(f"{url}: zarr.json is missing; 'mdr-dask verify --repair {url}' writes it again")
    return None if found is None else dict(found.get("attributes", {}))


def only_claimed(found: Mapping[str, Any]) -> bool:
    """Return whether a study with these attributes was never laid out, because the first run was stopped."""
    return list(found) == ["mdr_dask_layout"]


def attributes(url: str) -> dict[str, Any]:
    """Return the attributes of a study.

    Raise StoreError if there is no study, if the layout has a later version, or if the study was never laid out.
    """
    refuse_file(url)
    found = _root_attributes(url)
    if found is None:
        require_bucket(url)
        raise StoreError(f"{url}: no store here; 'mdr-dask run CAMPAIGN' makes one")
    if "mdr_dask_layout" not in found:
        raise StoreError(f"{url}: a Zarr store, but not a study of mdr_dask")
    if found["mdr_dask_layout"] > LAYOUT:
        raise StoreError(f"{url}: made by a newer mdr_dask (layout {found['mdr_dask_layout']}, known: {LAYOUT})")
    if only_claimed(found):
        raise StoreError(f"{url}: still empty, its first run was stopped early; run the campaign")
    return found


def series_names(url: str) -> list[str]:
    """Return the names of the groups of a study.

    If the root contains results, its name is ``""``, or `ROOT` if the study also has series.
    """
    root = "axes" in attributes(url)
    members = (document(url) or {})["consolidated_metadata"]["metadata"]
    names = [name for name, member in members.items() if member["node_type"] == "group"]
    return ([ROOT] if names else [""]) * root + names
