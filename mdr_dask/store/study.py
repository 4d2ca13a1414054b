"""What stands at a path or URL: a study, something else, or nothing; and what a study says of itself."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from mdr_dask.errors import StoreError
from mdr_dask.store.copies import groups_laid_out
from mdr_dask.store.files import KEPT, LAYOUT, ROOT, group_name, local, read_json

#: What this program and its earlier versions write. Another codec might run code, and is not opened.
CODECS = {"bytes", "vlen-utf8", "zstd", "crc32c"}
#: What the attributes of a study hold, and those of a group of results besides, and of what type.
_STUDY = {"model": str, "model_version": int, "seed": int, "title": str, "history": list}
_GROUP = {"axes": list, "outputs": list, "blocks": dict, "parameters": str}


def document(url: str, series: str = "") -> dict[str, Any] | None:
    """Return the metadata of a group, or None if there are none; Zarr opens nothing that has not passed here.

    Raises
    ------
    StoreError
        If they are not such as this program writes.
    """
    name = group_name(series, "zarr.json")
    found = read_json(url, name)
    if found is None:
        return None
    if not isinstance(found, dict) or not isinstance(found.get("attributes", {}), dict):
        raise StoreError(f"{url}: {name} is damaged; {_remedy(url)}")
    attributes = found.get("attributes", {})
    if "mdr_dask_layout" in attributes and not only_claimed(attributes):
        for fault in _faults(found, attributes):
            raise StoreError(f"{url}: {name}: {fault}; {_remedy(url)}")
    return found


def _remedy(url: str) -> str:
    return f"'mdr-dask verify {url}' looks into it"


def _faults(found: Mapping[str, Any], attributes: Mapping[str, Any]) -> Iterator[str]:
    """Yield what is wrong with the metadata of a group."""
    if found.get("zarr_format") != 3:
        yield f"expected zarr_format 3, got {found.get('zarr_format')!r}"
    if not isinstance(attributes["mdr_dask_layout"], int):
        yield f"expected a number as mdr_dask_layout, got {attributes['mdr_dask_layout']!r}"
    elif attributes["mdr_dask_layout"] > LAYOUT:
        return  # said in its own words
    expected = _STUDY | (_GROUP if "axes" in attributes else {})
    for key, kind in expected.items():
        if not isinstance(attributes.get(key), kind):
            yield f"expected {key!r} among the attributes as {kind.__name__}, got {attributes.get(key)!r:.60}"
    consolidated = found.get("consolidated_metadata")
    members = consolidated.get("metadata") if isinstance(consolidated, dict) else None
    if not isinstance(members, dict) or not all(isinstance(member, dict) for member in members.values()):
        yield "expected consolidated metadata of all members"
        return
    for name, member in members.items():
        yield from (f"{name}: {fault}" for fault in _member_faults(member))


def _member_faults(member: Mapping[str, Any]) -> Iterator[str]:
    if member.get("zarr_format") != 3:
        yield f"expected zarr_format 3, got {member.get('zarr_format')!r}"
    elif member.get("node_type") == "array":
        codecs = member.get("codecs")
        names = [codec.get("name") if isinstance(codec, dict) else codec for codec in codecs or ()]
        if not names or not all(isinstance(name, str) and name in CODECS for name in names):
            yield f"expected codecs of {', '.join(sorted(CODECS))}, got {names!r:.80}"
        if member.get("storage_transformers"):
            yield f"expected no storage transformers, got {member['storage_transformers']!r:.60}"
    elif member.get("node_type") != "group":
        yield f"expected an array or a group, got {member.get('node_type')!r:.60}"


def exists(url: str) -> bool:
    """Say whether there is a study at a path or URL, whoever made it.

    Raises
    ------
    StoreError
        If there is something else.
    """
    path = local(url)
    if path is not None and path.is_file():
        raise StoreError(f"{url}: a file, expected the folder of a store or nothing")
    found = _root_attributes(url)
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
    return None if found is None else dict(found.get("attributes", {}))


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
    path = local(url)
    if path is not None and path.is_file():
        raise StoreError(f"{url}: a file, expected the folder of a store; 'mdr-dask run {url}' runs a campaign")
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
