"""The JSON schema of the campaign file, for editors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mdr_dask import models
from mdr_dask.campaign.spec import CampaignSpec, RefinedSpec
from mdr_dask.models.base import Model, Parameters

Schema = dict[str, Any]

#: Pattern of the name of a model that the user wrote: ``package.module:NAME``.
_OWN_MODEL = r"^[A-Za-z_][\w.]*:[A-Za-z_][\w.]*$"
#: Schema of a quantity with a unit: a text that begins like a number. The schema does not check the unit.
_QUANTITY = {"type": "string", "pattern": r"^\s*[+-]?(\d|\.\d)", "description": "a number with its unit"}
_QUANTITY_REFERENCE = {"$ref": "#/$defs/quantity"}


def json_schema() -> Schema:
    """Return the JSON schema (draft 2020-12) of campaign files of all models."""
    root = _readable(CampaignSpec.model_json_schema())
    definitions = {**root.pop("$defs"), **_ranges()}
    choices = []
    for name in models.names():
        model = models.load(name)
        definitions[name] = parameters_schema(model.parameters, f"#/$defs/{name}/$defs/{{model}}")
        choices.append(_choice(model))
    root["properties"]["model"] |= {"anyOf": [{"enum": list(models.names())}, {"pattern": _OWN_MODEL}]}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "mdr_dask campaign",
        **root,
        "allOf": choices,
        "$defs": definitions,
    }


def parameters_schema(parameters: type[Parameters], references: str = "#/$defs/{model}") -> Schema:
    """Return the schema of the key ``parameters`` for a model.

    `references` is the form of a reference to a nested parameter set. ``{model}`` stands for the name of the set.
    """
    own: Schema = _readable(parameters.model_json_schema(ref_template=references))
    own.pop("required", None)
    for name, value in own["properties"].items():
        own["properties"][name] = _varied(value)
    for key, structure in own.get("$defs", {}).items():
        properties = structure.get("properties", {})
        structure["required"] = [name for name, value in properties.items() if "const" in value]
        for name, value in properties.items():
            if "const" not in value:
                properties[name] = _varied(value)
        if structure.pop("bare_name", False):
            own["$defs"][key] = {"anyOf": [structure, {"type": "string"}]}
    return own


def _choice(model: Model[Any]) -> Schema:
    reference = {"$ref": f"#/$defs/{model.name}"}
    return {
        "if": {"properties": {"model": {"const": model.name}}, "required": ["model"]},
        "then": {
            "properties": {
                "model": {"description": model.summary},
                "parameters": reference,
                "series": {"additionalProperties": reference},
                "outputs": {"items": {"enum": [output.name for output in model.outputs]}},
            }
        },
    }


def _varied(value: Schema) -> Schema:
    outside: Schema = {key: value.pop(key) for key in ("description", "default") if key in value}
    branches = [value, {"$ref": "#/$defs/linear"}, {"$ref": "#/$defs/geometric"}, {"$ref": "#/$defs/values"}]
    branches += [{"$ref": "#/$defs/adaptive"}, {"type": "array", "items": value, "minItems": 1}]
    return {**outside, "anyOf": branches}


def _ranges() -> Schema:
    ends = {"anyOf": [{"type": "number"}, _QUANTITY_REFERENCE]}
    count = {"type": "integer", "minimum": 2}
    found: Schema = {"quantity": _QUANTITY}
    for kind in ("linear", "geometric"):
        ends_and_count = {"type": "array", "prefixItems": [ends, ends, count], "minItems": 2, "maxItems": 3}
        found[kind] = _alone(kind, ends_and_count, f"{kind} range [first, last, count]")
    found["adaptive"] = _readable(RefinedSpec.model_json_schema(ref_template="#/$defs/{model}"))
    found["adaptive"].pop("$defs")
    found["values"] = _alone("values", {"type": "array", "minItems": 1}, "list of the values")
    return found


def _alone(key: str, value: Schema, description: str) -> Schema:
    return {
        "type": "object",
        "description": description,
        "properties": {key: value},
        "required": [key],
        "additionalProperties": False,
    }


def _readable(node: Any, unit: bool = False) -> Any:
    """Return a schema without titles, in which every quantity may be a string with a unit."""
    if isinstance(node, list):
        return [_readable(item, unit) for item in node]
    if not isinstance(node, Mapping):
        return node
    unit = unit or "unit" in node
    kept: Schema = {}
    for key, value in node.items():
        if key in ("properties", "$defs"):
            kept[key] = {name: _readable(inner) for name, inner in value.items()}
        elif key == "items" or key.endswith("Of"):
            kept[key] = _readable(value, unit)
        elif key not in ("title", "discriminator"):
            kept[key] = _readable(value)
    return _with_unit(kept) if unit and kept.get("type") == "number" else kept


def _with_unit(number: Schema) -> Schema:
    outside: Schema = {key: number.pop(key) for key in ("description", "default", "unit") if key in number}
    return {**outside, "anyOf": [number, _QUANTITY_REFERENCE]}
