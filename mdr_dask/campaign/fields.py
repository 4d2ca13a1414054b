"""The fields of a parameter set: types, units and nested sets. Each field is a key of a campaign file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from mdr_dask.campaign.problems import Path
from mdr_dask.models.base import unit_of
from mdr_dask.models.data_file import DataFile


def walk(parameters: type[BaseModel], before: str = "") -> Iterator[tuple[str, type[BaseModel], FieldInfo]]:
    """Yield the dotted name, the parameter set and the field of every key, including the keys of nested sets.

    Keys with only one possible value, such as ``shape: cone``, are left out.
    """
    for name, info in parameters.model_fields.items():
        if name not in fixed(parameters):
            yield f"{before}{name}", parameters, info
            for structure in structures(info):
                yield from walk(structure, f"{before}{name}.")


def members(annotation: Any) -> tuple[Any, ...]:
    """Return the types that an annotation allows, with unions and ``Annotated`` resolved."""
    origin = get_origin(annotation)
    if origin is Annotated:
        return members(get_args(annotation)[0])
    if origin in (Union, UnionType):
        return tuple(found for part in get_args(annotation) for found in members(part))
    return (annotation,)


def holds_list(info: FieldInfo) -> bool:
    """Return whether a single value of this field may be a list. Only a list of lists then varies the field."""
    kinds = [get_origin(kind) or kind for kind in members(info.annotation)]
    return any(isinstance(kind, type) and issubclass(kind, Sequence) and kind is not str for kind in kinds)


def usual(info: FieldInfo) -> tuple[str, ...]:
    """Return the usual values of a field with their units. ``mdr-dask init`` writes the first value."""
    return tuple(map(str, info.examples or ()))


def structures(info: FieldInfo) -> tuple[type[BaseModel], ...]:
    """Return the parameter sets that a field accepts as its value."""
    kinds = [kind for kind in members(info.annotation) if isinstance(kind, type) and issubclass(kind, BaseModel)]
    return tuple(kind for kind in kinds if kind is not DataFile)


def listed(info: FieldInfo) -> tuple[type[BaseModel], ...]:
    """Return the parameter sets that a field accepts as the entries of a list."""
    lists = [kind for kind in members(info.annotation) if get_origin(kind) in (tuple, list)]
    kinds = [kind for each in lists for part in get_args(each) for kind in members(part)]
    return tuple(kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel) and kind != DataFile)


def structure(info: FieldInfo, value: Any) -> type[BaseModel] | None:
    """Return the parameter set that a mapping describes, found by keys such as ``shape: cone``, or None."""
    if not isinstance(value, dict):
        return None
    for kind in structures(info):
        if all(value.get(key, kind.model_fields[key].default) == only for key, only in fixed(kind).items()):
            return kind
    return None


def fixed(kind: type[BaseModel]) -> dict[str, Any]:
    """Return the name and the value of each field that has only one possible value."""
    return {
        key: get_args(info.annotation)[0]
        for key, info in kind.model_fields.items()
        if get_origin(info.annotation) is Literal and len(get_args(info.annotation)) == 1
    }


def required(kind: type[BaseModel]) -> list[str]:
    """Return the required fields of a parameter set, except fields with only one possible value."""
    return [name for name, info in kind.model_fields.items() if info.is_required() and name not in fixed(kind)]


def written(kind: type[BaseModel], values: Mapping[str, str]) -> str:
    """Return a parameter set with the given values as text on one line, such as ``{shape: power, radius: ...}``."""
    texts = {**values, **fixed(kind)}
    return "{" + ", ".join(f"{key}: {texts[key]}" for key in kind.model_fields if key in texts) + "}"


def owner(parameters: type[BaseModel], path: Path, data: Any) -> tuple[type[BaseModel], str] | None:
    """Return the parameter set that has the field at a path in the data, and the name of the field, or None."""
    kind: type[BaseModel] | None = parameters
    for depth, part in enumerate(path):
        if kind is None or not isinstance(part, str) or part not in kind.model_fields:
            return None
        data = data.get(part) if isinstance(data, dict) else None
        if depth == len(path) - 1 or isinstance(data, list):
            return kind, part
        kind = structure(kind.model_fields[part], data)
    return None


def field_at(parameters: type[BaseModel], path: Path, data: Any) -> FieldInfo | None:
    """Return the field at a path in the data, or None if there is no such field."""
    found = owner(parameters, path, data)
    return found[0].model_fields[found[1]] if found else None


def is_independent(parameters: type[BaseModel], path: Path, data: Any) -> bool:
    """Return whether the field at a path can be checked by its bounds alone, without other parameters."""
    pairs = (owner(parameters, path[:depth], data) for depth in range(1, len(path) + 1))
    decorators = [kind.__pydantic_decorators__ for kind in (parameters, *(pair[0] for pair in pairs if pair))]
    return not any(
        each.field_validators or any(check.info.mode != "before" for check in each.model_validators.values())
        for each in decorators
    )


def choices(parameters: type[BaseModel], path: Path) -> tuple[str, ...]:
    """Return the forms in which a nested parameter may be written, such as ``indenter: {shape: power, ...}``."""
    name, *rest = path
    if name not in parameters.model_fields or not rest:
        return ()
    found: list[str] = []
    for kind in structures(parameters.model_fields[str(name)]):
        if rest[0] in kind.model_fields:
            others = {key: "..." for key in required(kind) if key != rest[0]}
            deeper = [one.partition(": ") for one in choices(kind, tuple(rest))]
            inside = [{**others, key: text} for key, _, text in deeper] if len(rest) > 1 else [others]
            found += [f"{name}: {written(kind, texts)}" for texts in inside]
    return tuple(found)


def plain(number: float) -> str:
    """Return a number as text. An int is written in full, and a float with at most 12 significant digits."""
    return str(number) if isinstance(number, int) else f"{number:.12g}"


def yaml_text(value: Any) -> str:
    """Return a value as YAML on one line."""
    if isinstance(value, BaseModel):
        return yaml_text(value.model_dump(exclude_none=True))
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {yaml_text(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(yaml_text, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return plain(value) if isinstance(value, float) else str(value)


def unit_at(parameters: type[BaseModel], path: Path, data: Any) -> str | None:
    """Return the SI unit of the field at a path in the data, or None if the field is not a quantity."""
    found = owner(parameters, path, data)
    return unit_of(*found) if found else None
