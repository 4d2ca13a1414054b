"""What the metadata of a study have to look like, whoever wrote them, before anything is made of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, Json, ValidationError

from mdr_dask.plan import MOST_CASES

#: What this program and its earlier versions write. Another codec might run code, and is not opened.
CODECS = ("bytes", "crc32c", "vlen-utf8", "zstd")
Length = Annotated[int, Field(ge=0)]
Count = Annotated[int, Field(ge=1)]


class _Document(BaseModel):
    model_config = ConfigDict(strict=True, frozen=True)


class _Codec(_Document):
    name: Literal["bytes", "crc32c", "vlen-utf8", "zstd"]


class _Chunks(_Document):
    chunk_shape: list[Count]


class _Grid(_Document):
    configuration: _Chunks


class _Array(_Document):
    zarr_format: Literal[3]
    node_type: Literal["array"]
    data_type: str
    shape: list[Length]
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
    """Yield what is wrong with the metadata of a group; how its parts fit together only if each is right."""
    attributes = found["attributes"]
    told = list(_unlike(_Root, found, "")) + list(_unlike(_Group if "axes" in attributes else _Study, attributes, ""))
    if told:
        yield from told
        return
    members: Mapping[str, Mapping[str, Any]] = found["consolidated_metadata"]["metadata"]
    for name, member in members.items():
        told += _unlike(_Member if member.get("node_type") == "group" else _Array, member, f"{name}: ")
        if name.startswith("/") or ".." in name.split("/"):
            told.append(f"{name}: expected a name inside the study")
    yield from told
    if "axes" in attributes and not told:
        yield from _unfit(attributes, {name: member for name, member in members.items() if "/" not in name})


def _unlike(kind: type[_Document], found: Mapping[str, Any], where: str) -> Iterator[str]:
    try:
        kind.model_validate(found)
    except ValidationError as error:
        for fault in error.errors(include_url=False, include_context=False):
            place = ".".join(map(str, fault["loc"]))
            got = "nothing" if fault["type"] == "missing" else f"{fault['input']!r:.60}"
            yield f"{where}{place}: {fault['msg'].replace('Input should be', 'expected').lower()}, got {got}"


def _unfit(attributes: Mapping[str, Any], arrays: Mapping[str, Any]) -> Iterator[str]:
    """Yield what does not fit together in a group: its arrays, their dimensions, its axes."""
    sizes: dict[str, int] = {}
    arrays = {name: member for name, member in arrays.items() if "shape" in member}
    for name, array in arrays.items():
        shape, dims = array["shape"], array.get("dimension_names") or []
        chunk = array["chunk_grid"]["configuration"]["chunk_shape"]
        if not len(shape) == len(dims) == len(chunk):
            yield f"{name}: expected a length and a name for each dimension, got {shape!r:.60} and {dims!r:.60}"
        elif math.prod(chunk) > MOST_CASES:
            yield f"{name}: expected chunks of at most {MOST_CASES:.0e} numbers, got {chunk!r:.60}"
        elif any(sizes.setdefault(dim, length) != length for dim, length in zip(dims, shape, strict=True)):
            yield f"{name}: expected the lengths of the other arrays, got {dict(zip(dims, shape, strict=True))!r:.60}"
    wanted = ["status", "realisation", *attributes["outputs"], *(axis["name"] for axis in attributes["axes"])]
    lacking = [name for name in wanted if name not in arrays]
    if lacking:
        yield f"expected the arrays {', '.join(lacking)!s:.80}"
        return
    dims = [*dict.fromkeys(axis["dim"] for axis in attributes["axes"]), "realisation"]
    if sorted(arrays["status"].get("dimension_names") or []) != sorted(dims):
        yield f"status: expected the dimensions {', '.join(dims)!s:.80}"
    elif attributes["blocks"] != dict(zip(*_blocks(arrays["status"]), strict=True)):
        yield f"blocks: expected those of status, got {attributes['blocks']!r:.60}"
    elif math.prod(arrays["status"]["shape"]) > MOST_CASES:
        yield f"status: expected at most {MOST_CASES:.0e} results, got {arrays['status']['shape']!r:.60}"


def _blocks(status: Mapping[str, Any]) -> tuple[list[str], list[int]]:
    """Return the dimensions of the ledger, and the length of a block along each."""
    return status["dimension_names"], status["chunk_grid"]["configuration"]["chunk_shape"]
