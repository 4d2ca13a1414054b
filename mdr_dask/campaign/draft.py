"""Write a first campaign file for a model: every parameter with a usual value, its unit and its meaning."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from mdr_dask.campaign import fields
from mdr_dask.errors import LISTED
from mdr_dask.models.base import Model, Parameters, describe, unit_of
from mdr_dask.models.data_file import DataFile, NamedFile
from mdr_dask.units import is_unit, shown

_HEAD = """\
# yaml-language-server: $schema=campaign.schema.json
#
# {summary}
#   mdr-dask schema -o campaign.schema.json    lets an editor complete and check this file
#   mdr-dask check {file}
#   mdr-dask run {file}
#
# Write numbers with their units; a number without a unit is in SI. To vary a parameter, write a list,
# {{linear: [a, b, n]}} or {{geometric: [a, b, n]}}. A line that begins with # is optional: it shows the default, or an
# example.
name: {name}
model: {model}
seed: 1
realisations: 1                     # samples of each case, with different random numbers; for a mean, 20 or more
# sampling: zip                     # or {{sobol: 100}}, {{latin_hypercube: 100}}, {{table: cases.csv}}; default: a grid
# accuracy: 1 %                     # error allowed for the outputs

parameters:
"""
#: Column in which comments begin, as in `_HEAD`.
_COMMENTS = 36
_EXAMPLE_FILE = "table.csv"
_BOUNDS = ("gt", "ge", "lt", "le")


def draft(name: str, model: Model[Any], file: str) -> str:
    """Return the text of a campaign file. The file passes every check, unless the model needs a data file."""
    short = re.sub(r"[^A-Za-z0-9_]+", "_", model.name)
    summary = f"{model.summary[:1].upper()}{model.summary[1:].rstrip('.')}."
    head = _HEAD.format(summary=summary, file=file, name=short, model=name)
    wanted = [output.name for output in model.outputs if output.default]
    more = [output.name for output in model.outputs if not output.default]
    lines = [*_entries(model.parameters), "", f"outputs: [{', '.join(wanted)}]"]
    lines += [f"# also: {', '.join(more)}"] if more else []
    return head + "\n".join(lines) + "\n"


def _entries(parameters: type[Parameters]) -> Iterator[str]:
    """Yield the lines of all parameters. The lines of optional parameters are comments."""
    needed = _needed(parameters)
    written: dict[str, None] = {}
    for group in parameters.alternatives:
        yield from textwrap.wrap(f"{describe(group)}:", 110, initial_indent="  # ", subsequent_indent="  # ")
        names = {name.partition(".")[0]: None for member in group for name in member}
        for name in [name for name in names if name not in written]:
            yield from _entry(parameters, name, needed)
        written |= names
        yield ""
    rest = [name for name in parameters.model_fields if name not in written]
    for name in sorted(rest, key=lambda name: name not in needed):
        yield from _entry(parameters, name, needed)


def _needed(parameters: type[BaseModel]) -> set[str]:
    """Return the dotted names of required parameters, and of parameters in the first alternative of each group."""
    groups = getattr(parameters, "alternatives", ())
    return {*fields.required(parameters), *(name for group in groups for name in group[0])}


def _entry(parameters: type[BaseModel], name: str, needed: set[str]) -> Iterator[str]:
    info = parameters.model_fields[name]
    inner = {path.partition(".")[2] for path in needed if path.startswith(f"{name}.")}
    mark = "" if name in needed or inner else "# "
    first, *others = _values(parameters, name, inner)
    start = f"  {mark}{name}: {first}"
    choices = ", ".join(choice for choice in _choices(info) if choice != first)
    yield f"{start:{_COMMENTS - 2}s}  # {'; or '.join(filter(None, [info.description, choices]))}".rstrip()
    yield from (f"  # or {name}: {other}" for other in others)


def _choices(info: FieldInfo) -> list[str]:
    """Return the words that a field accepts."""
    kinds = [kind for kind in fields.members(info.annotation) if get_origin(kind) is Literal]
    return [str(choice) for kind in kinds for choice in get_args(kind)]


def _values(parameters: type[BaseModel], name: str, inner: set[str]) -> list[str]:
    """Return examples of the value of a field as texts, at least one for each parameter set that the field accepts."""
    info = parameters.model_fields[name]
    kinds = list(fields.structures(info))
    if inner:
        kinds.sort(key=lambda kind: not inner <= set(kind.model_fields))
    found = [text for kind in kinds for text in _structures(kind, inner)]
    if not found or isinstance(info.default, str):
        found.insert(0, _scalar(parameters, name))
    return list(dict.fromkeys(found))


def _structures(kind: type[BaseModel], inner: set[str]) -> list[str]:
    """Return one example of a parameter set, or one for each alternative in its first group of alternatives."""
    group = next(iter(getattr(kind, "alternatives", ())), ())
    wanted = [{*fields.required(kind), *member} for member in group] or [_needed(kind)]
    open_keys = [key for key in kind.model_fields if key not in fields.fixed(kind)]
    texts = {key: _values(kind, key, set())[0] for key in open_keys if key in inner.union(*wanted)}
    return [fields.written(kind, {key: texts[key] for key in texts if key in keys | inner}) for keys in wanted]


def _scalar(parameters: type[BaseModel], name: str) -> str:
    """Return a value of a field as text: the default, a usual value, or another value that the field may have."""
    info = parameters.model_fields[name]
    kinds = fields.members(info.annotation)
    unit = unit_of(parameters, name)
    if listed := fields.listed(info):
        return f"[{_structures(listed[0], set())[0]}]"
    default = None if info.is_required() else info.get_default(call_default_factory=True, validated_data={})
    if isinstance(default, int | float) and not isinstance(default, bool) and unit is not None:
        return shown(default, unit, 12)
    if default is not None:
        return "[...]" if isinstance(default, tuple) and len(default) > LISTED else fields.yaml_text(default)
    if usual := fields.usual(info):
        return f"[{usual[0]}]" if fields.holds_list(info) else usual[0]
    if DataFile in kinds or info.annotation == tuple[NamedFile, ...]:
        return f"[{_EXAMPLE_FILE}]" if fields.holds_list(info) else _EXAMPLE_FILE
    if bool in kinds:
        return "true"
    if _choices(info):
        return _choices(info)[0]
    number = _inside(info)
    text = f"{number:g} {unit}" if unit and unit != "1" and is_unit(unit) else f"{number:g}"
    return f"[{text}]" if fields.holds_list(info) else text if {int, float} & set(kinds) else "text"


def _inside(info: FieldInfo) -> float:
    """Return 1 if it lies between the bounds of a field. Otherwise return another number between the bounds."""
    bounds = {key: getattr(part, key) for part in info.metadata for key in _BOUNDS if hasattr(part, key)}
    low = bounds.get("ge", bounds.get("gt", -math.inf))
    high = bounds.get("le", bounds.get("lt", math.inf))
    if low < 1 < high:
        return 1.0
    return float(low + 1 if math.isinf(high) else high - 1 if math.isinf(low) else (low + high) / 2)
