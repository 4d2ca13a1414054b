"""Laying out a study: arrays from templates, and the one write that makes a new shape visible."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import cache, lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import zarr
from numpy.typing import NDArray
from pydantic import BaseModel
from zarr.codecs import Crc32cCodec, ZstdCodec

from mdr_dask import models
from mdr_dask.campaign import Campaign
from mdr_dask.models.base import Status
from mdr_dask.models.numbers import numbers_of
from mdr_dask.plan import Template
from mdr_dask.store.copies import Copy, signpost
from mdr_dask.store.files import LAYOUT, clear, group_name, read_many, write_bytes, write_stages
from mdr_dask.store.records import digest
from mdr_dask.store.study import document, only_claimed
from mdr_dask.version import __version__

_COORDINATE_CHUNK = 4096
#: What `_series_attributes` writes; at the root it outlasts campaigns of which that study is no part.
OF_SERIES = ("series", "parameters", "axes", "outputs", "blocks", "notes")
_Coordinate = tuple[tuple[str, ...], NDArray[Any], dict[str, Any]]


def lay_out(url: str, layout: Sequence[Template]) -> None:
    """Create the arrays of every template, or grow the ones that exist; readers see the old shape or the new one.

    Everything is laid out in memory first. Then arrays and coordinates are written, behind them each group, and last
    of all the root: whoever opens a group sees what its one document says, however far the writing got.

    Parameters
    ----------
    url : str
        Path or URL of the store.
    layout : sequence of Template
        All groups; existing ones only ever grow, at the end of a dimension.

    Raises
    ------
    StoreError
        If it cannot be written.
    """
    if all(_is_laid_out(url, template) for template in layout):
        return
    held = document(url)
    if held is None:
        write_bytes(url, "zarr.json", group_document({}, {"mdr_dask_layout": LAYOUT}))
    elif only_claimed(held["attributes"]):
        clear(url)
    members = dict(held["consolidated_metadata"]["metadata"]) if held else {}
    study = _study_attributes(layout[0].campaign, held["attributes"] if held else {})
    root = {name: held["attributes"][name] for name in OF_SERIES if name in held["attributes"]} if held else {}
    copies = [_copy(url, template, study) for template in layout]
    for copy in copies:
        members |= copy.members
        root = root if copy.series else dict(copy.own)
    own = {copy.series: group_name(copy.series, "zarr.json") for copy in copies if copy.series}
    files = {name: content for copy in copies for name, content in copy.files.items() if not copy.stands(name)}
    groups = {name: files.pop(name) for name in own.values() if name in files}
    root_document = {"zarr.json": group_document(members, study | root | signpost(members))}
    write_stages(url, [dict(copy.file() for copy in copies), files, groups, root_document])


def _copy(url: str, template: Template, study: Mapping[str, Any]) -> Copy:
    series, own = template.series.name, _series_attributes(template)
    path = group_name(series, "zarr.json").removesuffix("zarr.json")
    files = laid_out_files(template)
    if series:
        arrays = {file.removesuffix("/zarr.json"): json.loads(files[file]) for file in files if "zarr.json" in file}
        files["zarr.json"] = group_document(arrays, {**study, **own})
    held = read_many(url, [f"{path}{name}" for name in files])
    before = {name: digest(content) for name, content in held if content is not None}
    return Copy(series, {f"{path}{name}": content for name, content in files.items()}, study, own, before)


def _is_laid_out(url: str, template: Template) -> bool:
    held, root = document(url, template.series.name), document(url)
    if held is None or root is None or "axes" not in held["attributes"]:
        return False
    if root["attributes"]["mdr_dask_layout"] < LAYOUT:
        return False
    if root["attributes"].get("measured") != _measured(template.campaign).get("measured"):
        return False
    wanted = json.loads(json.dumps(_series_attributes(template)))
    status = group_name(template.series.name, "status")
    shown = root["consolidated_metadata"]["metadata"].get(status, {"shape": None})
    return bool(shown["shape"] == list(template.shape) and wanted.items() <= held["attributes"].items())


def laid_out_files(template: Template) -> dict[str, bytes]:
    """Return the files of a group before anything is computed: metadata of all arrays, chunks of the coordinates."""
    coordinates = _coordinates(template)
    held = [_coordinate_files(name, _Numbers.of(*coordinate)) for name, coordinate in coordinates.items()]
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


def _contents(files: dict[str, Any]) -> dict[str, bytes]:
    """Return the files of a group in memory, without its own."""
    del files["zarr.json"]
    return {name: content.to_bytes() for name, content in files.items()}


def _array_file(
    template: Template, further: tuple[str, ...], extra: tuple[int, ...], dtype: str, attrs: dict[str, Any]
) -> bytes:
    """Return the metadata of an array of blocks."""
    chunks = tuple(max(1, length) for length in (*(template.chunks[dim] for dim in template.dims), *extra))
    held = json.loads(_one_block(chunks, (*template.dims, *further), dtype, json.dumps(attrs)))
    return json.dumps({**held, "shape": [*template.shape, *extra]}, indent=2).encode()


@lru_cache(maxsize=64)
def _one_block(chunks: tuple[int, ...], dims: tuple[str, ...], dtype: str, attrs: str) -> bytes:
    """Return the metadata of an array that is one block; a round changes nothing of them but the shape."""
    files: dict[str, Any] = {}
    zarr.create_array(
        zarr.storage.MemoryStore(files),
        shape=chunks,
        chunks=chunks,
        dtype=dtype,
        fill_value=np.nan if dtype == "float64" else int(Status.MISSING),
        compressors=[ZstdCodec(level=1), Crc32cCodec()],
        dimension_names=dims,
        attributes=json.loads(attrs),
    )
    return bytes(files["zarr.json"].to_bytes())


class _Numbers(NamedTuple):
    """A coordinate, such that equal ones are known for equal."""

    dims: tuple[str, ...]
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    values: bytes | tuple[str, ...]
    attrs: str

    @classmethod
    def of(cls, dims: tuple[str, ...], values: NDArray[Any], attrs: dict[str, Any]) -> _Numbers:
        """Take dimensions, values and attributes."""
        held = tuple(values.tolist()) if values.dtype == object else values.tobytes()
        return cls(dims, values.dtype, values.shape, held, json.dumps(attrs))

    def array(self) -> NDArray[Any]:
        """Return the values."""
        if isinstance(self.values, tuple):
            return np.array(self.values, dtype=object)
        return np.frombuffer(self.values, self.dtype).reshape(self.shape)


@lru_cache(maxsize=64)
def _coordinate_files(name: str, numbers: _Numbers) -> dict[str, bytes]:
    """Return the files of a coordinate; of all of them a round changes one."""
    files: dict[str, Any] = {}
    group = zarr.create_group(zarr.storage.MemoryStore(files))
    array = group.create_array(
        name,
        shape=numbers.shape,
        chunks=(_COORDINATE_CHUNK,) * len(numbers.shape),
        dtype="str" if numbers.dtype == object else numbers.dtype,
        compressors=[ZstdCodec(level=1), Crc32cCodec()],
        dimension_names=numbers.dims,
        attributes=json.loads(numbers.attrs),
    )
    array[...] = numbers.array()
    return _contents(files)


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


@cache
def _packages() -> dict[str, str]:
    """Return the versions of the packages that a store names: looked up once, which takes as long as laying out."""
    return {name: version(name) for name in ("numpy", "scipy", "numba", "dask", "zarr", "xarray")}


def _study_attributes(campaign: Campaign, earlier: Mapping[str, Any]) -> dict[str, Any]:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    what = "grown" if "history" in earlier else "laid out"
    history = [*earlier.get("history", []), f"{now} {what} on {platform.node()}"]
    return {
        "Conventions": "CF-1.11",
        "mdr_dask_layout": LAYOUT,
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
    """Return the table of a campaign as a store holds it: whole, so that it stays with the results."""
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
    """Return axis values as JSON holds them."""
    return [_plain(value) for value in values]


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    return value.model_dump(mode="json") if isinstance(value, BaseModel) else value


def group_document(members: Mapping[str, Any], attrs: Mapping[str, Any]) -> bytes:
    """Return the metadata of a group, attributes and all: written at once, it is what makes a new shape visible."""
    held = {
        "zarr_format": 3,
        "node_type": "group",
        "attributes": attrs,
        "consolidated_metadata": {"kind": "inline", "must_understand": False, "metadata": members},
    }
    return json.dumps(held).encode()
