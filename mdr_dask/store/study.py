"""What stands at a path or URL: a study, something else, or nothing; and what a study says of itself."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import zarr
from zarr.abc.store import Store
from zarr.storage import StorePath

from mdr_dask.errors import StoreError
from mdr_dask.store.copies import groups_laid_out, groups_with
from mdr_dask.store.expected import faults
from mdr_dask.store.files import KEPT, LAYOUT, ROOT, group_name, guarded, local, parsed, read_bytes


def document(url: str, series: str = "") -> Mapping[str, Any] | None:
    """Return the metadata of a group, or None if there are none; Zarr opens nothing that has not passed here.

    They are shared by all who read them.

    Raises
    ------
    StoreError
        If they are not such as this program writes.
    """
    name = group_name(series, "zarr.json")
    content = read_bytes(url, name)
    if content is None:
        return None
    with guarded(url, f"reading {name}"):
        found, fault = _looked_through(content)
    if fault is not None:
        raise StoreError(f"{url}: {name}{fault}; {_remedy(url)}")
    return found


@lru_cache(maxsize=16)
def _looked_through(content: bytes) -> tuple[dict[str, Any], str | None]:
    """Return the metadata of a group, and the first thing that is wrong with them; a run reads them many times."""
    found = parsed(content)
    if not isinstance(found, dict) or not isinstance(found.get("attributes", {}), dict):
        return found, " is damaged"
    attributes = found.get("attributes", {})
    layout = attributes.get("mdr_dask_layout")
    is_newer = isinstance(layout, int) and layout > LAYOUT  # which is said in its own words
    if "mdr_dask_layout" in attributes and not only_claimed(attributes) and not is_newer:
        return found, next((f": {fault}" for fault in faults(found)), None)
    return found, None


def array_of(shown: Mapping[str, Any], store: Store, path: str = "") -> Any:
    """Return the array that metadata show; Zarr opens a group with the metadata of all arrays, which takes longer."""
    return zarr.Array(zarr.AsyncArray(dict[str, Any](shown), StorePath(store, path)))  # type: ignore[call-overload]


def _remedy(url: str) -> str:
    return f"'mdr-dask verify {url}' looks into it"


def laying_out_again(url: str) -> str:
    """Return what mends a store whose metadata are lost, copies included."""
    return f"'mdr-dask verify --repair --campaign FILE {url}' lays it out again"


def refuse_file(url: str, expected: str = "the folder of a store") -> None:
    """Refuse a file, and a place below one, where a store is expected."""
    path = local(url)
    for place in () if path is None else (path, *path.parents):
        if place.is_file():
            found = "a file" if place == path else f"{place} is a file"
            raise StoreError(f"{url}: {found}, expected {expected}{_HINTS.get(place.suffix, '').format(place)}")


_HINTS = {".yaml": "; 'mdr-dask run {}' runs a campaign", ".zip": "; unpack it first"}


def exists(url: str) -> bool:
    """Say whether there is a study at a path or URL, whoever made it.

    Raises
    ------
    StoreError
        If there is something else.
    """
    refuse_file(url, "the folder of a store or nothing")
    path, found = local(url), _root_attributes(url)
    if found is None and path is not None and path.is_dir():
        others = sorted(entry.name for entry in path.iterdir() if entry.suffix != ".partial" and entry.name not in KEPT)
        if others:
            raise StoreError(f"{url}: a folder that holds something else ({others[0]}), expected a store or nothing")
    return found is not None and not only_claimed(found)


def is_study(url: str) -> bool:
    """Say whether there is a study of mdr_dask at a path or URL."""
    return "mdr_dask_layout" in (_root_attributes(url) or {})


def _root_attributes(url: str) -> dict[str, Any] | None:
    """Return the attributes of whatever Zarr there is, or None if there is none."""
    found = document(url)
    if found is None and groups_laid_out(url):
        raise StoreError(f"{url}: zarr.json is gone; 'mdr-dask verify --repair {url}' puts it back")
    if found is None and any(not _is_root(url, group) for group in groups_with(url, "status/zarr.json")):
        raise StoreError(f"{url}: zarr.json is gone, and the copy of it, too; {laying_out_again(url)}")
    return None if found is None else dict(found.get("attributes", {}))


def _is_root(url: str, group: str) -> bool:
    """Say whether a group is a study of its own, in a folder of studies."""
    held = document(f"{url}/{group}") if group else None
    return "mdr_dask_layout" in (held or {}).get("attributes", {})


def only_claimed(found: Mapping[str, Any]) -> bool:
    """Say whether a run took the place and was stopped before its arrays were laid out."""
    return list(found) == ["mdr_dask_layout"]


def attributes(url: str) -> dict[str, Any]:
    """Return the attributes of a study.

    Raises
    ------
    StoreError
        If there is no study of mdr_dask at `url`, or one with a newer layout.
    """
    refuse_file(url)
    found = _root_attributes(url)
    if found is None:
        raise StoreError(f"{url}: no store here; 'mdr-dask run CAMPAIGN' makes one")
    if "mdr_dask_layout" not in found:
        raise StoreError(f"{url}: Zarr, but not a study that mdr_dask made")
    if found["mdr_dask_layout"] > LAYOUT:
        raise StoreError(f"{url}: made by a newer mdr_dask (layout {found['mdr_dask_layout']}, known: {LAYOUT})")
    if only_claimed(found):
        raise StoreError(f"{url}: still empty, its first run has not come far enough; run the campaign")
    return found


def series_names(url: str) -> list[str]:
    """Return the names of the groups of a study, ``""`` for one without series and `ROOT` if series stand beside it."""
    root = "axes" in attributes(url)
    members = (document(url) or {})["consolidated_metadata"]["metadata"]
    names = [name for name, member in members.items() if member["node_type"] == "group"]
    return ([ROOT] if names else [""]) * root + names
