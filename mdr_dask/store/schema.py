"""Check the metadata of a study before Zarr opens anything, because a store may come from an unknown source."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, Json, ValidationError

from mdr_dask.plan import MOST_CASES

Count = Annotated[int, Field(ge=1)]


class _Document(BaseModel):
    model_config = ConfigDict(strict=True, frozen=True, protected_namespaces=())


class _Codec(_Document):
    """A codec of an array. Only codecs that this program uses are accepted, because other codecs might run code."""

    name: Literal["bytes", "crc32c", "vlen-utf8", "zstd"]


class _Chunks(_Document):
    chunk_shape: list[Count]


class _Grid(_Document):
    configuration: _Chunks


class _Array(_Document):
    zarr_format: Literal[3]
    node_type: Literal["array"]
    data_type: str
    shape: list[Annotated[int, Field(ge=0)]]
    chunk_grid: _Grid
    dimension_names: list[str] | None = None
    codecs: Annotated[list[_Codec], Field(min_length=1)]
    storage_transformers: Annotated[list[Any], Field(max_length=0)] = []
    attributes: dict[str, Any] = {}


class _Member(_Document):
    zarr_format: Literal[3]
    node_type: Literal["group"]
    attributes: dict[str, Any] = {}


class _Axis(_Document):
    path: str
    name: str
    dim: str
    values: list[Any]
    labels: list[str] | None


class _Study(_Document):
    mdr_dask_layout: int
    model: str
    model_version: int
    seed: int
    accuracy: float | None
    title: str
    history: list[str]


class _Group(_Study):
    axes: list[_Axis]
    outputs: Annotated[list[str], Field(min_length=1)]
    blocks: dict[str, Count]
    parameters: Json[dict[str, Any]]


class _Members(_Document):
    metadata: dict[str, dict[str, Any]]


class _Root(_Document):
    zarr_format: Literal[3]
    consolidated_metadata: _Members


def faults(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield the faults of the metadata of a group; if every part is valid, also contradictions between the parts."""
    attributes = found["attributes"]
    wrong = [*_unlike(_Root, found, ""), *_unlike(_Group if "axes" in attributes else _Study, attributes, "")]
    if not wrong:
        members = found["consolidated_metadata"]["metadata"]
        for name, member in members.items():
            wrong += _unlike(_Member if member.get("node_type") == "group" else _Array, member, f"{name}: ")
            if name.startswith("/") or ".." in name.split("/"):
                wrong.append(f"{name}: expected a name inside the study")
        if "axes" in attributes and not wrong:
            wrong += _disagreements(
                attributes, {name: m for name, m in members.items() if "shape" in m and "/" not in name}
            )
    yield from wrong


def _unlike(kind: type[_Document], found: Mapping[str, Any], where: str) -> Iterator[str]:
    try:
        kind.model_validate(found)
    except ValidationError as error:
        for fault in error.errors(include_url=False, include_context=False):
            place = ".".join(map(str, fault["loc"]))
            got = "nothing" if fault["type"] == "missing" else f"{fault['input']!r:.60}"
            yield f"{where}{place}: {fault['msg'].replace('Input should be', 'expected').lower()}, got {got}"


def _disagreements(attributes: Mapping[str, Any], arrays: Mapping[str, Any]) -> Iterator[str]:
    """Yield contradictions between the arrays of a group, their dimensions and the axes."""
    wanted = ["status", "realisation", *attributes["outputs"], *(axis["name"] for axis in attributes["axes"])]
    lacking = [name for name in wanted if name not in arrays]
    if lacking:
        yield f"expected the arrays {', '.join(lacking)!s:.80}"
        return
    sizes: dict[str, int] = {}
    for name, array in arrays.items():
        shape, dims, chunk = _dimensions(array)
        is_odd = not len(shape) == len(dims) == len(chunk)
        if is_odd or math.prod(chunk) > MOST_CASES or math.prod(shape) > MOST_CASES**2:
            yield f"{name}: expected a length, a name and a chunk for each dimension, got {shape!r:.60}, {dims!r:.60}"
        elif any(sizes.setdefault(dim, length) != length for dim, length in zip(dims, shape, strict=True)):
            yield f"{name}: expected the lengths of the other arrays, got {dict(zip(dims, shape, strict=True))!r:.60}"
    shape, names, chunk = _dimensions(arrays["status"])
    blocks = dict(zip(names, chunk, strict=False))
    wanted = [*dict.fromkeys(axis["dim"] for axis in attributes["axes"]), "realisation"]
    if sorted(blocks) != sorted(wanted) or attributes["blocks"] != blocks:
        yield f"status: expected blocks over {', '.join(wanted)!s:.80}, got {blocks!r:.60}"
    elif math.prod(shape) > MOST_CASES:
        yield f"status: expected at most {MOST_CASES:.0e} results, got {shape!r:.60}"


def _dimensions(array: Mapping[str, Any]) -> tuple[list[int], list[str], list[int]]:
    """Return the lengths and names of the dimensions of an array, and the lengths of its chunks."""
    return array["shape"], array.get("dimension_names") or [], array["chunk_grid"]["configuration"]["chunk_shape"]
