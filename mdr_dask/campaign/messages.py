"""Turn validation errors of pydantic into messages, each with its position in the file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from mdr_dask.campaign import fields
from mdr_dask.campaign.problems import Path, shown
from mdr_dask.errors import did_you_mean, similar
from mdr_dask.models.data_file import DataFile, NamedByFile
from mdr_dask.units import expected, likely, spelt

#: Function that adds a problem. Its arguments are the path in the data, the message, and a truth value: true if the key
#: is wrong, and false if the value is wrong.
Report = Callable[[Path, str, bool], None]

_BOUNDS = {"greater_than": ("gt", "above"), "greater_than_equal": ("ge", "of at least")}
_BOUNDS |= {"less_than": ("lt", "below"), "less_than_equal": ("le", "of at most")}
_KINDS = {
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "bool_type": "true or false",
    "string_type": "a string",
    "dict_type": "a mapping",
    "tuple_type": "a list",
    "list_type": "a list",
    "finite_number": "a finite number",
}


def report_errors(error: ValidationError, kind: type[BaseModel], data: Any, report: Report) -> None:
    """Report every error of ``kind.model_validate(data)``. All errors of the same value become one message."""
    groups: dict[Path, list[ErrorDetails]] = {}
    for details in error.errors(include_url=False):
        groups.setdefault(path_into(data, details), []).append(details)
    for path, group in groups.items():
        inside = any(len(other) > len(path) and other[: len(path)] == path for other in groups)
        # a list or mapping gets no message of its own if other messages name the mistakes inside it
        if inside and group[0]["type"] in ("too_short", "literal_error"):
            continue
        _report_group(path, group, kind, data, report)


def path_into(data: Any, details: ErrorDetails) -> Path:
    """Return the path of a wrong value in the data. Unlike ``loc`` of pydantic, the path lacks the names of types."""
    path: Path = ()
    location = details["loc"]
    for depth, part in enumerate(location):
        inside_list = isinstance(data, list | tuple) and isinstance(part, int) and part < len(data)
        if inside_list or (isinstance(data, Mapping) and part in data):
            path, data = (*path, part), data[part]
        elif details["type"] == "missing" and depth == len(location) - 1:
            path = (*path, part)
    if details["type"] == "union_tag_invalid":
        path = (*path, *[key for key, value in data.items() if str(value) == details["ctx"]["tag"]][:1])
    return path


def value_at(data: Any, path: Path) -> Any:
    """Return the plain value at a path."""
    for part in path:
        data = data[part]
    return data


def _report_group(path: Path, group: list[ErrorDetails], kind: type[BaseModel], data: Any, report: Report) -> None:
    first = group[0]
    own = next((details for details in group if details["type"] in ("value_error", "assertion_error")), None)
    if own is not None:
        what = str(own["ctx"]["error"])
        report((*path, *_entry(value_at(data, path), what)), what, False)
    elif first["type"] == "missing":
        report(path, _missing(path, kind, data), False)
    elif first["type"] == "extra_forbidden":
        report(path, _unknown(path, kind, data), True)
    else:
        value = value_at(data, path)
        wanted = " or ".join(dict.fromkeys(_wanted(details, path, kind, data) for details in group))
        hint = _hint(group, value) or _forgotten_unit(group, path, kind, data) or _meant(path, kind, data)
        report(path, f"expected {wanted}, got {shown(value)}{hint}", False)


def _entry(value: Any, what: str) -> Path:
    """Return the index of the list entry that a message quotes, as a path, or ``()`` if the message quotes no entry."""
    entries = value if isinstance(value, list) else []
    return tuple(index for index, entry in enumerate(entries) if what.endswith(f"got {entry!r}"))[:1]


def _hint(group: list[ErrorDetails], value: Any) -> str:
    types = {details["type"] for details in group}
    choices = [choice for details in group for choice in _choices(details)]
    if isinstance(value, str):
        return similar(value, choices) or (spelt(value) if types & {"int_type", "float_type"} else "")
    if isinstance(value, float) and value.is_integer() and types & {"int_type", "int_from_float"}:
        return f" (write {value:.0f})"
    if isinstance(value, dict) and types & {"float_type", "int_type"}:
        return " (a range is {linear: [a, b, n]} or {geometric: [a, b, n]})"
    return ""


def _forgotten_unit(group: list[ErrorDetails], path: Path, kind: type[BaseModel], data: Any) -> str:
    """Return a hint with the unit that a number out of bounds may lack, or an empty text."""
    value, info, unit = value_at(data, path), fields.field_at(kind, path, data), fields.unit_at(kind, path, data)
    usual = fields.usual(info) if info else ()
    if not isinstance(value, int | float) or group[0]["type"] not in _BOUNDS:
        return ""
    if unit == "1" and value in range(1, 101) and next(iter(group[0]["ctx"].values())) == 1:
        return f" (write '{value:g} %' if you mean that)"
    meant = likely(value, unit, usual) if usual and unit else ""
    return f" (write {meant!r} if you mean that)" if meant else ""


def _meant(path: Path, kind: type[BaseModel], data: Any) -> str:
    """Return a hint on how to write a mapping or a list, if the user wrote a word instead."""
    value, info = value_at(data, path), fields.field_at(kind, path, data)
    if not info or not isinstance(value, str):
        return ""
    for one in fields.structures(info):
        if value in one.model_fields:
            return f" (write {{{value}: ...}})"
        if value in fields.fixed(one).values():
            return f" (write {fields.written(one, dict.fromkeys(fields.required(one), '...'))})"
    if fields.holds_list(info):
        return f" (write [{value}])"
    first = next((name for one in fields.structures(info) for name in one.model_fields), "")
    inside = [first] if first == "path" else _of_file(info) if "." in value else []
    written = " or ".join(f"{{{name}: {value}}}" for name in inside)
    return f" (write {written})" if written else ""


def _of_file(info: FieldInfo) -> list[str]:
    """Return the keys whose values are names of files, in all parameter sets that a field accepts."""
    inner = [entry for one in fields.structures(info) for entry in one.model_fields.items()]
    named = (DataFile, NamedByFile)
    return [
        name
        for name, entry in inner
        if any(isinstance(one, type) and issubclass(one, named) for one in fields.members(entry.annotation))
    ]


def _wanted(details: ErrorDetails, path: Path, kind: type[BaseModel], data: Any) -> str:
    error, context = details["type"], details.get("ctx", {})
    unit = fields.unit_at(kind, path, data)
    if error in _BOUNDS:
        key, words = _BOUNDS[error]
        bound = context[key]
        noun = "whole number" if isinstance(bound, int) else "number"
        behind = f" {unit}" if bound and unit not in (None, "1") else ""
        return f"a {noun} {words} {fields.plain(bound)}{behind}"
    if error == "float_type" and unit is not None:
        return _quantity(path, kind, data)
    if context.get("class_name") == "DataFile":
        return "the name of a file"
    if error in ("literal_error", "enum"):
        return str(context["expected"])
    if error == "union_tag_invalid":
        return _listed(_choices(details))
    if error in ("union_tag_not_found", "model_type", "model_attributes_type"):
        return _kinds(path, kind, data)
    if error in ("too_short", "too_long"):
        size, words = ("min_length", "at least") if error == "too_short" else ("max_length", "at most")
        return f"{words} {context[size]} {'entry' if context[size] == 1 else 'entries'}"
    return _KINDS.get(error) or re.sub(r"^(Input|Value) should be ", "", details["msg"])


def _kinds(path: Path, kind: type[BaseModel], data: Any) -> str:
    """Return the kinds of mappings that a parameter accepts, such as ``a mapping with shape: 'cone' or 'plane'``."""
    info = fields.field_at(kind, path, data)
    structures = fields.structures(info) if info else ()
    keys = [(key, value) for one in structures for key, value in fields.fixed(one).items()]
    if not keys:
        return "a mapping"
    name = keys[0][0]
    return f"a mapping with {name}: {_listed(value for key, value in keys if key == name)}"


def _choices(details: ErrorDetails) -> list[str]:
    context = details.get("ctx", {})
    return re.findall(r"'([^']*)'", str(context.get("expected_tags") or context.get("expected") or ""))


def _listed(words: Iterable[str]) -> str:
    quoted = [repr(word) for word in words]
    return " or ".join([", ".join(quoted[:-1]), quoted[-1]] if len(quoted) > 1 else quoted)


def _missing(path: Path, kind: type[BaseModel], data: Any) -> str:
    info, wanted = fields.field_at(kind, path, data), _quantity(path, kind, data)
    what = f"missing, expected {wanted}" if wanted else "missing"
    return f"{what}: {info.description}" if info and info.description else what


def _quantity(path: Path, kind: type[BaseModel], data: Any) -> str:
    """Return the name and a usual value of the quantity of a field, or an empty text for a field without a unit."""
    info, unit = fields.field_at(kind, path, data), fields.unit_at(kind, path, data)
    return expected(unit, "".join(fields.usual(info)[:1])) if info and unit else ""


def _unknown(path: Path, kind: type[BaseModel], data: Any) -> str:
    """Return the message about an unknown key.

    If the key has been renamed or removed, the message says what to write instead. If the key belongs in a mapping
    inside or outside this one, the message says where. In all other cases, the message suggests a similar key or lists
    the known keys.
    """
    around = _structure_around(path, kind, data)
    instead = getattr(around, "renamed", {}).get(path[-1])
    if instead:
        return f"{path[-1]} has been renamed or removed: {instead}"
    known = around.model_fields if around else {}
    holding = [name for name, info in known.items() for one in fields.structures(info) if path[-1] in one.model_fields]
    inside = f" (write {holding[0]}: {{{path[-1]}: ...}})" if holding else ""
    return f"unknown key{inside or _further_out(path, kind, data) or did_you_mean(path[-1], list(known))}"


def _further_out(path: Path, kind: type[BaseModel], data: Any) -> str:
    """Return a hint if an unknown key belongs in one of the mappings around its own mapping."""
    for depth in range(len(path) - 2, -1, -1):
        around = _structure_around((*path[:depth], path[-1]), kind, data)
        if around and path[-1] in around.model_fields:
            return f" (write it beside {str(path[depth])!r}, not inside)"
    return ""


def _structure_around(path: Path, kind: type[BaseModel], data: Any) -> type[BaseModel] | None:
    if len(path) == 1:
        return kind
    info = fields.field_at(kind, path[:-1], data)
    return fields.structure(info, value_at(data, path[:-1])) if info else None
