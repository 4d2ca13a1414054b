"""Laying out a study: arrays from templates, and the one write that makes a new shape visible."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import zarr
from numpy.typing import NDArray
from pydantic import BaseModel
from zarr.codecs import Crc32cCodec, ZstdCodec

from mdr_dask import __version__, models
from mdr_dask.campaign import Campaign
from mdr_dask.models.base import DataFile, Status, unit_of
from mdr_dask.plan import Template
from mdr_dask.store.blocks import forget_open_groups
from mdr_dask.store.files import LAYOUT, read_json, write_bytes

_COORDINATE_CHUNK = 4096
_Coordinate = tuple[tuple[str, ...], NDArray[Any], dict[str, Any]]


def lay_out(url: str, layout: Sequence[Template]) -> None:
    """Create the arrays of every template, or grow the ones that exist; readers see the old shape or the new one.

    Parameters
    ----------
    url : str
        Path or URL of the store.
    layout : sequence of Template
        All groups; existing ones only ever grow, at the end of a dimension.
    """
    if all(_is_laid_out(url, template) for template in layout):
        return
    root = _open_plainly(url, "")
    earlier = dict(root.attrs)
    shared = _study_attributes(layout[0].campaign, earlier)
    for template in layout:
        name = template.series.name
        group = _open_plainly(url, name)
        _lay_out_group(group, template)
        own = shared | _series_attributes(template)
        if name:
            _publish(url, name, _members(group, ""), own)
        else:
            shared = own
    members = _members(root, "")
    for name in sorted(root.group_keys()):
        members |= _members(_open_plainly(url, name), f"{name}/")
    _publish(url, "", members, shared)
    forget_open_groups()


def _open_plainly(url: str, series: str) -> zarr.Group:
    """Open or make a group by what its members say of themselves, not by consolidated metadata of an earlier shape."""
    marker: dict[str, Any] = {"mdr_dask_layout": LAYOUT}
    return zarr.open_group(url, path=series or None, mode="a", use_consolidated=False, attributes=marker)


def _is_laid_out(url: str, template: Template) -> bool:
    metadata = read_json(url, f"{template.series.name}/zarr.json" if template.series.name else "zarr.json")
    if metadata is None or "axes" not in metadata["attributes"]:
        return False
    wanted = json.loads(json.dumps(_series_attributes(template), default=_json_default))
    shape = metadata["consolidated_metadata"]["metadata"]["status"]["shape"]
    return bool(shape == list(template.shape) and wanted.items() <= metadata["attributes"].items())


def _lay_out_group(group: zarr.Group, template: Template) -> None:
    coordinates = _coordinates(template)
    for name, coordinate in coordinates.items():
        _require_coordinate(group, name, *coordinate)
    along = " ".join(name for name, (dims, _, _) in coordinates.items() if dims != (name,))
    for output in template.outputs:
        dims = (*template.dims, *output.dims)
        attrs = {"units": output.unit, "long_name": output.long_name, "coordinates": along}
        extra = template.extra_shape(output)
        _require_array(group, output.name, template, dims, extra, "float64", attrs)
    flags: dict[str, Any] = {"long_name": "state of the case", "units": "1", "coordinates": along}
    flags |= {
        "flag_values": [int(status) for status in Status],
        "flag_meanings": " ".join(s.name.lower() for s in Status),
    }
    _require_array(group, "status", template, template.dims, (), "int8", flags)


def _require_array(
    group: Any,
    name: str,
    template: Template,
    dims: tuple[str, ...],
    extra: tuple[int, ...],
    dtype: str,
    attrs: dict[str, Any],
) -> None:
    shape = (*template.shape, *extra)
    if name in group:
        array = group[name]
        if array.shape != shape:
            array.resize(shape)
        return
    group.create_array(
        name,
        shape=shape,
        chunks=tuple(max(1, length) for length in (*(template.chunks[dim] for dim in template.dims), *extra)),
        dtype=dtype,
        fill_value=np.nan if dtype == "float64" else int(Status.MISSING),
        compressors=[ZstdCodec(level=1), Crc32cCodec()],
        dimension_names=dims,
        attributes=attrs,
        config={"write_empty_chunks": True},
    )


def _require_coordinate(
    group: Any, name: str, dims: tuple[str, ...], values: NDArray[Any], attrs: dict[str, Any]
) -> None:
    if name in group:
        array = group[name]
        if array.shape != values.shape:
            array.resize(values.shape)
    else:
        array = group.create_array(
            name,
            shape=values.shape,
            chunks=(_COORDINATE_CHUNK,) * values.ndim,
            dtype="str" if values.dtype == object else values.dtype,
            dimension_names=dims,
            attributes=attrs,
            config={"write_empty_chunks": True},
        )
    array[...] = values


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
    for name, (value, unit, meaning) in _numbers(template.series.parameters, "").items():
        if name not in found and name not in template.sizes:
            found[name] = ((), np.array(value), _attrs(unit, meaning))
    return found


def _attrs(unit: str | None, long_name: str) -> dict[str, Any]:
    return {"units": unit, "long_name": long_name} if unit else {"long_name": long_name}


def _numbers(parameters: BaseModel, prefix: str) -> dict[str, tuple[float, str, str]]:
    """Return value, unit and meaning of every number in a parameter set, nested names joined by ``_``."""
    found: dict[str, tuple[float, str, str]] = {}
    for name, field in type(parameters).model_fields.items():
        value = getattr(parameters, name)
        if isinstance(value, BaseModel) and not isinstance(value, DataFile):
            found |= _numbers(value, f"{prefix}{name}_")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            found[prefix + name] = (value, unit_of(type(parameters), name) or "1", field.description or "")
    return found


def _study_attributes(campaign: Campaign, earlier: Mapping[str, Any]) -> dict[str, Any]:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    packages = ("numpy", "scipy", "numba", "dask", "zarr", "xarray")
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
        "source": Path(campaign.source).name,
        "host": platform.node(),
        "python": platform.python_version(),
        "versions": {"mdr_dask": __version__, **{name: version(name) for name in packages}},
        "created": earlier.get("created", now),
        "history": history,
    }


def _series_attributes(template: Template) -> dict[str, Any]:
    return {
        "series": template.series.name,
        "parameters": json.dumps(template.series.parameters.model_dump(mode="json"), sort_keys=True),
        "axes": [
            {"path": axis.path, "name": axis.name, "dim": axis.dim, "values": plain_values(axis.values)}
            for axis in template.series.axes
        ],
        "outputs": [output.name for output in template.outputs],
        "blocks": dict(template.chunks),
    }


def plain_values(values: tuple[Any, ...]) -> list[Any]:
    """Return axis values as JSON holds them."""
    return [value.model_dump(mode="json") if isinstance(value, BaseModel) else value for value in values]


def _members(group: Any, prefix: str) -> dict[str, Any]:
    """Return the metadata of a group's direct members, as they stand inside consolidated metadata."""
    found = {}
    for name, member in group.members():
        metadata = member.metadata.to_dict()
        metadata.pop("consolidated_metadata", None)
        found[prefix + name] = metadata
    return found


def _publish(url: str, path: str, members: dict[str, Any], attrs: dict[str, Any]) -> None:
    """Replace a group's metadata, attributes and all, in one write: the moment at which readers see a new shape."""
    document = {
        "zarr_format": 3,
        "node_type": "group",
        "attributes": attrs,
        "consolidated_metadata": {"kind": "inline", "must_understand": False, "metadata": members},
    }
    text = json.dumps(document, indent=1, default=_json_default)
    write_bytes(url, f"{path}/zarr.json" if path else "zarr.json", text.encode())


def _json_default(value: Any) -> Any:
    """Turn what zarr keeps in metadata (codecs, grids, enums) into plain JSON."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    return value.value if hasattr(value, "value") else value.item()
