"""Lay out a study: create or extend its arrays from templates, and make the new shape visible by one write."""

from __future__ import annotations

import base64
import json
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
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
from mdr_dask.errors import StoreError
from mdr_dask.models.base import Status
from mdr_dask.models.numbers import numbers_of
from mdr_dask.plan import Template
from mdr_dask.store.files import LAYOUT, clear, digest, group_name, read_bytes, read_many, write_bytes, write_stages
from mdr_dask.store.study import document, only_claimed
from mdr_dask.version import __version__

_COORDINATE_CHUNK = 4096
#: Attributes that `_series_attributes` writes. If series are added to a store without series, these attributes stay at
#: the root.
OF_SERIES = ("series", "parameters", "axes", "outputs", "blocks", "notes")
_Coordinate = tuple[tuple[str, ...], NDArray[Any], dict[str, Any]]


def lay_out(url: str, layout: Sequence[Template]) -> None:
    """Create the arrays of every template, or extend existing ones. Readers see either the old shape or the new one.

    Files are written in this order: a copy of the layout of each group, arrays and coordinates, the metadata of groups,
    and finally the metadata of the study. This last write makes the new shape visible.

    Parameters
    ----------
    url : str
        Path or URL of the store.
    layout : sequence of Template
        All groups; existing groups are extended at the ends of their dimensions.

    Raises
    ------
    StoreError
        If the store cannot be written.
    """
    if is_laid_out(url, layout):
        return
    held = document(url)
    if held is None:
        write_bytes(url, "zarr.json", group_document({}, {"mdr_dask_layout": LAYOUT}))
    elif only_claimed(held["attributes"]):
        clear(url)
    members = dict(held["consolidated_metadata"]["metadata"]) if held else {}
    study = _study_attributes(layout[0].campaign, held["attributes"] if held else {})
    root = {name: held["attributes"][name] for name in OF_SERIES if name in held["attributes"]} if held else {}
    files: dict[str, dict[str, bytes]] = {}
    groups = {}
    for template in layout:
        series, own = template.series.name, _series_attributes(template)
        found = _laid_out_files(template)
        arrays = {name.removesuffix("/zarr.json"): json.loads(found[name]) for name in found if "zarr.json" in name}
        files[series] = {group_name(series, name): content for name, content in found.items()}
        members |= {group_name(series, name): array for name, array in arrays.items()}
        if series:
            attributes = {**study, **own}
            members[series] = {"zarr_format": 3, "node_type": "group", "attributes": attributes}
            groups[group_name(series, "zarr.json")] = group_document(arrays, attributes)
        else:
            root = own
    document_of_root = {"zarr.json": group_document(members, study | root | _signpost(members))}
    copies: dict[str, bytes] = {}
    changed: dict[str, bytes] = {}
    for series, own_files in files.items():
        group = {name: groups[name] for name in [group_name(series, "zarr.json")] if name in groups}
        laid_out = {**own_files, **group, **document_of_root}
        before = {name: digest(content) for name, content in read_many(url, laid_out) if content is not None}
        copies |= copy_of(series, laid_out, before)
        changed |= {name: content for name, content in own_files.items() if before.get(name) != digest(content)}
    write_stages(url, [copies, changed, groups, document_of_root])


def is_laid_out(url: str, layout: Sequence[Template]) -> bool:
    """Return whether a store already has the shape and the attributes of all templates."""
    root = document(url)
    return root is not None and all(_has_shape(url, root, template) for template in layout)


def _has_shape(url: str, root: Mapping[str, Any], template: Template) -> bool:
    held = document(url, template.series.name)
    if held is None or "axes" not in held["attributes"]:
        return False
    if root["attributes"].get("measured") != _measured(template.campaign).get("measured"):
        return False
    wanted = json.loads(json.dumps(_series_attributes(template)))
    shown = root["consolidated_metadata"]["metadata"].get(group_name(template.series.name, "status"), {"shape": None})
    return bool(shown["shape"] == list(template.shape) and wanted.items() <= held["attributes"].items())


@dataclass(frozen=True)
class Copy:
    """A copy of the layout of a group: metadata and coordinates.

    The copy is written before the files of the layout. A run may be killed between these writes, so a file is intact if
    it equals its copy or if it is still the previous version.

    Parameters
    ----------
    files : mapping of str to bytes
        Contents of the files, including the metadata of the study, by their names in the store.
    before : mapping of str to str
        Digests of the previous versions of the files.
    """

    files: Mapping[str, bytes]
    before: Mapping[str, str]

    def accepts(self, name: str, content: bytes | None, root: bytes | None) -> bool:
        """Return whether a file is intact.

        A new file may be missing as long as `root`, the metadata of the study, is still the previous version.
        """
        if content is None:
            return name not in self.before and root is not None and digest(root) == self.before.get("zarr.json")
        return content == self.files[name] or digest(content) == self.before.get(name)

    @property
    def age(self) -> int:
        """Number of times that the study had been laid out when the copy was made."""
        return len(json.loads(self.files["zarr.json"])["attributes"]["history"])


def copy_name(series: str) -> str:
    """Return the name of the copy of the layout of a group."""
    return group_name(series, "status/layout.json")


def copy_of(series: str, files: Mapping[str, bytes], before: Mapping[str, str]) -> dict[str, bytes]:
    """Return name and content of the file with the copy of the layout of a group."""
    encoded = {name: base64.b64encode(content).decode() for name, content in files.items()}
    held = {"files": encoded, "before": before}
    stated = digest(json.dumps(held, sort_keys=True).encode())
    return {copy_name(series): json.dumps({**held, "digest": stated}, sort_keys=True).encode()}


def read_copy(url: str, series: str) -> Copy | None:
    """Return the copy of the layout of a group, or None if the store has no copy.

    Raises
    ------
    StoreError
        If the copy is damaged.
    """
    content = read_bytes(url, copy_name(series))
    if content is None:
        return None
    try:
        held = json.loads(content)
        stated = held.pop("digest")
        if stated != digest(json.dumps(held, sort_keys=True).encode()):
            raise ValueError
        files = {name: base64.b64decode(text) for name, text in held["files"].items()}
        if group_name(series, "status/zarr.json") not in files:
            raise ValueError
        return Copy(files, dict(held["before"]))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        raise StoreError(f"{url}: {copy_name(series)} is damaged") from None


def damaged_layout(url: str, series: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield name and fault (``missing`` or ``damaged``) of every layout file that is not intact."""
    root = document(url) or {}
    copies = []
    for name in series:
        try:
            copy = read_copy(url, name)
        except StoreError:
            yield copy_name(name), "damaged"
            continue
        if copy is not None:
            copies.append(copy)
        elif ((document(url, name) or root).get("attributes", {})).get("mdr_dask_layout", 0) > 1:
            yield copy_name(name), "missing"
    names, held = list(dict.fromkeys(name for copy in copies for name in copy.files)), read_bytes(url, "zarr.json")
    for name, content in read_many(url, names):
        if not any(copy.accepts(name, content, held) for copy in copies if name in copy.files):
            yield name, "missing" if content is None else "damaged"


def _signpost(members: Mapping[str, Any]) -> dict[str, str]:
    """Return a comment for a study with series, because such a study looks empty when opened as one dataset."""
    series = sorted(name for name, member in members.items() if member["node_type"] == "group")
    groups = " or ".join(f"group={name!r}" for name in series)
    text = f"the results of each series are in a group: open_datatree, or open_zarr with {groups}"
    return {"comment": text} if series else {}


def _laid_out_files(template: Template) -> dict[str, bytes]:
    """Return the metadata of all arrays of a group, and the chunks of its coordinates."""
    coordinates = _coordinates(template)
    held = [_coordinate_files(name, *coordinate) for name, coordinate in coordinates.items()]
    along = " ".join(name for name, (dims, _, _) in coordinates.items() if dims != (name,))
    arrays = {}
    for output in template.outputs:
        attrs = {"units": output.unit, "long_name": output.long_name, "coordinates": along}
        if output.has_error and output.error in template.outputs:
            attrs["ancillary_variables"] = output.error.name
        if output.comment:
            attrs["comment"] = output.comment
        arrays[output.name] = _array_file(template, output.dims, template.extra_shape(output), "float64", attrs)
    flags: dict[str, Any] = {
        "long_name": "state of the case",
        "units": "1",
        "coordinates": along,
        "flag_values": [int(status) for status in Status],
        "flag_meanings": " ".join(status.name.lower() for status in Status),
    }
    arrays["status"] = _array_file(template, (), (), "int8", flags)
    files = {f"{name}/zarr.json": content for name, content in arrays.items()}
    return {name: content for each in (*held, files) for name, content in each.items()}


def _array_file(
    template: Template, further: tuple[str, ...], extra: tuple[int, ...], dtype: str, attrs: dict[str, Any]
) -> bytes:
    """Return the metadata of an output or of the ledger."""
    files: dict[str, Any] = {}
    zarr.create_array(
        zarr.storage.MemoryStore(files),
        shape=(*template.shape, *extra),
        chunks=tuple(max(1, length) for length in (*(template.chunks[dim] for dim in template.dims), *extra)),
        dtype=dtype,
        fill_value=np.nan if dtype == "float64" else int(Status.MISSING),
        compressors=_compressors(),
        dimension_names=(*template.dims, *further),
        attributes=attrs,
    )
    return bytes(files["zarr.json"].to_bytes())


def _coordinate_files(
    name: str, dims: tuple[str, ...], values: NDArray[Any], attrs: dict[str, Any]
) -> dict[str, bytes]:
    """Return the files of a coordinate."""
    files: dict[str, Any] = {}
    array = zarr.create_array(
        zarr.storage.MemoryStore(files),
        name=name,
        shape=values.shape,
        chunks=(_COORDINATE_CHUNK,) * values.ndim,
        dtype="str" if values.dtype == object else values.dtype,
        compressors=_compressors(),
        dimension_names=dims,
        attributes=attrs,
    )
    array[...] = values
    return {file: content.to_bytes() for file, content in files.items() if file.startswith(f"{name}/")}


def _compressors() -> list[Any]:
    return [ZstdCodec(level=1), Crc32cCodec()]


def _coordinates(template: Template) -> dict[str, _Coordinate]:
    """Return dims, values and attrs of every coordinate: axes, realisation, further dimensions, fixed parameters."""
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


@cache
def _packages() -> dict[str, str]:
    """Return the versions of packages that are written to the store."""
    return {name: version(name) for name in ("numpy", "scipy", "numba", "dask", "zarr", "xarray")}


def _study_attributes(campaign: Campaign, earlier: Mapping[str, Any]) -> dict[str, Any]:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    what = "grown" if "history" in earlier else "laid out"
    history = [*earlier.get("history", []), f"{now} {what} on {platform.node()}"]
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
        "source": Path(campaign.source).name,
        "host": platform.node(),
        "python": platform.python_version(),
        "versions": {"mdr_dask": __version__, **_packages()},
        "created": earlier.get("created", now),
        "history": history,
    }


def _measured(campaign: Campaign) -> dict[str, Any]:
    """Return the table of measured points of a campaign, which is stored with the results."""
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
    """Return axis values in a form that JSON can hold."""
    return [_plain(value) for value in values]


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    return value.model_dump(mode="json") if isinstance(value, BaseModel) else value


def group_document(members: Mapping[str, Any], attrs: Mapping[str, Any]) -> bytes:
    """Return the metadata of a group and of its members as one file, so that one write makes a new shape visible."""
    held = {
        "zarr_format": 3,
        "node_type": "group",
        "attributes": attrs,
        "consolidated_metadata": {"kind": "inline", "must_understand": False, "metadata": members},
    }
    return json.dumps(held).encode()
