"""Lay out a study: create or extend arrays from templates. The last write makes the new shape visible."""

from __future__ import annotations

import json
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from pydantic import BaseModel
from zarr.codecs import Crc32cCodec, ZstdCodec

from mdr_dask import models
from mdr_dask.campaign import Campaign
from mdr_dask.models.base import Output, Status
from mdr_dask.models.data_file import DataFile
from mdr_dask.models.numbers import numbers_of
from mdr_dask.plan import Template
from mdr_dask.store.files import (
    CLAIMS,
    LAYOUT,
    digest,
    group_name,
    listed,
    read_bytes,
    read_many,
    remove,
    write_bytes,
    write_stages,
)
from mdr_dask.store.integrity import RECORD, LayoutRecord, read_record
from mdr_dask.store.study import document, members_of, only_claimed
from mdr_dask.version import __version__

#: Number of values in a chunk of a coordinate. With this large number, chosen by trial, nearly every axis
#: has a single chunk. The number never changes. A program can therefore read an axis while a run extends it.
_COORDINATE_CHUNK = 4096
#: Packages whose versions are written to the store.
PACKAGES = ("numpy", "scipy", "numba", "dask", "zarr", "xarray")
_Coordinate = tuple[tuple[str, ...], NDArray[Any], dict[str, Any]]


def lay_out(url: str, layout: Sequence[Template]) -> None:
    """Create the arrays of every template, or extend existing arrays. Readers see either the old or the new shape.

    Files are written in this order: the record of the layout with the digests of all other files; coordinates and
    metadata of arrays; metadata of groups; finally ``zarr.json``. In a new store, a ``zarr.json`` without arrays is
    written before all these files (see `mdr_dask.store.study.only_claimed`). If the store already has the shape and the
    attributes of the templates, ``zarr.json`` does not change, and missing or damaged files are written again.
    """
    held = document(url)
    if held is None:
        write_bytes(url, "zarr.json", group_document({}, {"mdr_dask_layout": LAYOUT}))
    elif only_claimed(held["attributes"]):
        remove(url, [name for name in listed(url) if name != "zarr.json" and not name.startswith(CLAIMS)])
    root = json.loads(json.dumps(held)) if held else {"attributes": {}, "consolidated_metadata": {"metadata": {}}}
    members, earlier = root["consolidated_metadata"]["metadata"], root["attributes"]
    coordinates: dict[str, bytes] = {}
    attributes: dict[str, Any] = {}
    is_new = held is None or not all(_has_shape(url, held, template) for template in layout)
    study = _study_attributes(layout[0].campaign, earlier)
    for template in layout:
        series, own = template.series.name, _series_attributes(template)
        arrays, chunks = _arrays_and_coordinates(template)
        members |= {group_name(series, name): array for name, array in arrays.items()}
        coordinates |= {group_name(series, name): content for name, content in chunks.items()}
        if series:
            members[series] = {"zarr_format": 3, "node_type": "group", "attributes": {**study, **own}}
        else:
            attributes = own
    content = read_bytes(url, "zarr.json") or b""
    if is_new:
        content = group_document(members, study | attributes | _signpost(members))
    _write(url, content, coordinates)


def _write(url: str, root: bytes, coordinates: Mapping[str, bytes]) -> None:
    """Write the files of a layout in the order of `lay_out`; `root` is the content of ``zarr.json``."""
    metadata = metadata_files(json.loads(root))
    members = json.loads(root)["consolidated_metadata"]["metadata"]
    groups = {name: metadata.pop(name) for name in [f"{group}/zarr.json" for group in group_names(members)]}
    files = {**coordinates, **metadata, **groups, "zarr.json": root}
    record = read_record(url)
    recorded = files if record else {*files, *coordinate_files(json.loads(root), listed(url))}
    before = dict(read_many(url, recorded))
    known = record.files if record else {name: [digest(old)] for name, old in before.items() if old is not None}
    versions = {name: [*dict.fromkeys([*known.get(name, ()), digest(new)])] for name, new in files.items()}
    first = {RECORD: LayoutRecord({**known, **versions}, root.decode()).content}
    changed = {name: new for name, new in {**coordinates, **metadata}.items() if new != before[name]}
    write_stages(url, [first, changed, groups, {"zarr.json": root}])


def is_laid_out(url: str, layout: Sequence[Template]) -> bool:
    """Return whether a store has the shape and the attributes of all templates, and its layout has no fault."""
    root = document(url)
    is_whole = root is not None and all(_has_shape(url, root, template) for template in layout)
    return is_whole and not any(layout_faults(url))


def _has_shape(url: str, root: Mapping[str, Any], template: Template) -> bool:
    held = document(url, template.series.name)
    if held is None or "axes" not in held["attributes"]:
        return False
    if root["attributes"].get("measured") != _measured(template.campaign).get("measured"):
        return False
    wanted = json.loads(json.dumps(_series_attributes(template)))
    shown = root["consolidated_metadata"]["metadata"].get(group_name(template.series.name, "status"), {"shape": None})
    return bool(
        shown["shape"] == list(template.shape)
        and _by_content(wanted).items() <= _by_content(held["attributes"]).items()
    )


def _by_content(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes of a series in which digests replace the names of files."""
    return {
        name: of_files(json.loads(each) if name == "parameters" else each, "sha256")
        for name, each in attributes.items()
    }


def is_file(value: Any) -> bool:
    """Return whether a stored value describes a data file."""
    return isinstance(value, Mapping) and value.keys() == DataFile.model_fields.keys()


def of_files(value: Any, key: str) -> Any:
    """Return a value in which each file is replaced by its digest (`key` is ``sha256``) or by its name (``name``).

    Studies are compared by digests, because a study whose files were moved is still the same study.
    """
    if isinstance(value, list):
        return [of_files(each, key) for each in value]
    if isinstance(value, Mapping):
        return value[key] if is_file(value) else {name: of_files(each, key) for name, each in value.items()}
    return value


def group_names(members: Mapping[str, Any]) -> list[str]:
    """Return the names of the groups among the members of a study."""
    return [name for name, member in members.items() if member["node_type"] == "group"]


def metadata_files(root: Mapping[str, Any]) -> dict[str, bytes]:
    """Return the contents of the metadata files of all groups and arrays below the root, from the root's metadata."""
    members = root["consolidated_metadata"]["metadata"]
    names = group_names(members)
    groups = {name: group_document(members_of(members, name), members[name]["attributes"]) for name in names}
    arrays = {name: json.dumps(member).encode() for name, member in members.items() if name not in groups}
    return {f"{name}/zarr.json": content for name, content in (arrays | groups).items()}


def coordinate_files(root: Mapping[str, Any], names: Iterable[str]) -> list[str]:
    """Return those of the given file names that are chunks of coordinates, according to the metadata of the study."""
    members = root["consolidated_metadata"]["metadata"]
    groups = {"": root["attributes"]} | {name: members[name]["attributes"] for name in group_names(members)}
    data = {group_name(name, array) for name, of in groups.items() for array in ("status", *of.get("outputs", ()))}
    chunks = tuple(f"{name}/c" for name in members if name not in data and name not in groups)
    return [name for name in names if name.startswith(chunks)]


@dataclass(frozen=True)
class Finding:
    """A file that is damaged (not as it was written), missing, or foreign (not part of the study)."""

    # ``damaged``, ``missing`` or ``foreign``.
    kind: str
    name: str
    what: str


def layout_faults(url: str) -> Iterator[Finding]:
    """Yield every file of the layout that is missing or has a digest that is not in the record of the layout.

    If the record is damaged, or missing from a store of layout 2, only the record is yielded. Stores of layout 1 have
    no record, and nothing is yielded. If a run was stopped while it wrote the layout, missing files are not yielded.
    """
    record, content = read_record(url), read_bytes(url, "zarr.json")
    if record is None:
        is_damaged = read_bytes(url, RECORD) is not None
        if is_damaged or (document(url) or {"attributes": {}})["attributes"].get("mdr_dask_layout", 0) > 1:
            yield Finding("damaged" if is_damaged else "missing", RECORD, "the record of the layout")
        return
    is_older = content is not None and digest(content) in record.files["zarr.json"][:-1]
    for name, content in read_many(url, record.files):
        if content is None:
            if not is_older:  # if ``zarr.json`` is older, a run was stopped before it wrote all files
                yield Finding("missing", name, "part of the layout; --repair or the next run writes it again")
        elif digest(content) not in record.files[name]:
            yield Finding("damaged", name, "not what was written")


def _signpost(members: Mapping[str, Any]) -> dict[str, str]:
    """Return the attribute ``comment`` of a study with series, which says how to open the study.

    Such a study looks empty if it is opened as one dataset. Without series, the returned dictionary is empty.
    """
    series = group_names(members)
    groups = " or ".join(f"group={name!r}" for name in sorted(series))
    text = f"the results of each series are in a group: use open_datatree, or open_zarr with {groups}"
    return {"comment": text} if series else {}


def _arrays_and_coordinates(template: Template) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Return the metadata of the arrays of a group, and the chunks of the coordinates of the group."""
    coordinates = _coordinates(template)
    files: dict[str, Any] = {}
    store = zarr.storage.MemoryStore(files)
    for name, (dims, values, attrs) in coordinates.items():
        array = zarr.create_array(
            store,
            name=name,
            shape=values.shape,
            chunks=(_COORDINATE_CHUNK,) * values.ndim,
            dtype="str" if values.dtype == object else values.dtype,
            compressors=_compressors(),
            dimension_names=dims,
            attributes=attrs,
        )
        array[...] = values
    along = " ".join(name for name, (dims, _, _) in coordinates.items() if dims != (name,))
    flags: dict[str, Any] = {
        "long_name": "state of the case",
        "units": "1",
        "coordinates": along,
        "flag_values": [int(status) for status in Status],
        "flag_meanings": " ".join(status.name.lower() for status in Status),
    }
    outputs = [
        (output.name, output.dims, template.extra_shape(output), np.nan, _attributes_of(output, template, along))
        for output in template.outputs
    ]
    for name, further, extra, missing, attrs in [*outputs, ("status", (), (), np.int8(Status.MISSING), flags)]:
        zarr.create_array(
            store,
            name=name,
            shape=(*template.shape, *extra),
            chunks=tuple(max(1, length) for length in (*(template.chunks[dim] for dim in template.dims), *extra)),
            dtype=np.asarray(missing).dtype,
            fill_value=missing,
            compressors=_compressors(),
            dimension_names=(*template.dims, *further),
            attributes=attrs,
        )
    end = "/zarr.json"
    found = {name: content.to_bytes() for name, content in files.items() if name != "zarr.json"}
    arrays = {name.removesuffix(end): json.loads(content) for name, content in found.items() if name.endswith(end)}
    return arrays, {name: content for name, content in found.items() if not name.endswith(end)}


def _attributes_of(output: Output, template: Template, along: str) -> dict[str, Any]:
    attrs = {"units": output.unit, "long_name": output.long_name, "coordinates": along}
    if output.has_error and output.error in template.outputs:
        attrs["ancillary_variables"] = output.error.name
    if output.comment:
        attrs["comment"] = output.comment
    return attrs


def _compressors() -> list[Any]:
    return [ZstdCodec(level=1), Crc32cCodec()]


def _coordinates(template: Template) -> dict[str, _Coordinate]:
    """Return dims, values and attrs of every coordinate: axes, realisation, further dimensions, fixed numbers."""
    found: dict[str, _Coordinate] = {}
    for axis in template.series.axes:
        values = np.array(axis.labels or axis.values, dtype=object if axis.labels else None)
        found[axis.name] = ((axis.dim,), values, _attrs(axis.unit, axis.long_name))
    count = np.arange(template.sizes["realisation"])
    found["realisation"] = (("realisation",), count, _attrs("1", "index of the independent realisation"))
    for dim, coordinate in template.extra.items():
        found[dim] = ((dim,), coordinate.values, _attrs(coordinate.unit, coordinate.long_name))
    for name, (value, unit, meaning) in numbers_of(template.series.parameters).items():
        if name not in found and name not in template.sizes:
            found[name] = ((), np.array(value), _attrs(unit, meaning))
    for name, unit in models.load(template.campaign.model).units(template.series.parameters).items():
        if name in found:
            found[name][2]["units"] = unit
    return found


def _attrs(unit: str | None, long_name: str) -> dict[str, Any]:
    return {"units": unit, "long_name": long_name} if unit else {"long_name": long_name}


def _study_attributes(campaign: Campaign, earlier: Mapping[str, Any]) -> dict[str, Any]:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    what = "grown" if "history" in earlier else "laid out"
    history = [*earlier.get("history", []), f"{now} {what} on {platform.node()}"]
    source = earlier.get("model_source", models.source_digest(campaign.model))
    return {
        "Conventions": "CF-1.11",
        "mdr_dask_layout": earlier.get("mdr_dask_layout", LAYOUT),
        "title": campaign.name,
        "model": campaign.model,
        "model_version": models.load(campaign.model).version,
        "seed": campaign.seed,
        "accuracy": campaign.accuracy,
        "campaign": campaign.text,
        **_measured(campaign),
        **({"model_source": source} if source else {}),
        "source": Path(campaign.source).name,
        "host": platform.node(),
        "python": platform.python_version(),
        "versions": {"mdr_dask": __version__, **{name: version(name) for name in PACKAGES}},
        "created": earlier.get("created", now),
        "history": history,
    }


def _measured(campaign: Campaign) -> dict[str, Any]:
    table = campaign.measured
    return {"measured": {"name": table.name, "text": table.read_text()}} if table else {}


def _series_attributes(template: Template) -> dict[str, Any]:
    return {
        "series": template.series.name,
        "parameters": json.dumps(template.series.parameters.model_dump(mode="json"), sort_keys=True),
        "axes": [
            {
                "path": axis.path,
                "name": axis.name,
                "dim": axis.dim,
                "values": plain_values(axis.values),
                "labels": axis.labels and list(axis.labels),
            }
            for axis in template.series.axes
        ],
        "outputs": [output.name for output in template.outputs],
        "blocks": dict(template.chunks),
        **({"notes": list(template.notes)} if template.notes else {}),
    }


def plain_values(values: tuple[Any, ...]) -> list[Any]:
    """Return the values of an axis as values that JSON can represent."""
    return [_plain(value) for value in values]


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    return value.model_dump(mode="json") if isinstance(value, BaseModel) else value


def group_document(members: Mapping[str, Any], attrs: Mapping[str, Any]) -> bytes:
    """Return the metadata of a group and of its members as the content of one file."""
    held = {
        "zarr_format": 3,
        "node_type": "group",
        "attributes": attrs,
        "consolidated_metadata": {"kind": "inline", "must_understand": False, "metadata": members},
    }
    return json.dumps(held).encode()
