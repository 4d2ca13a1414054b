"""The reference page of campaign files, made by ``python -m mdr_dask.campaign.reference > docs/campaign-file.md``."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterable, Iterator
from functools import lru_cache
from typing import Any

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from mdr_dask import models
from mdr_dask.campaign import fields
from mdr_dask.campaign.spec import CampaignSpec
from mdr_dask.models.base import Model, describe, unit_of
from mdr_dask.units import DEFINITIONS

_HEAD = """\
# The campaign file

A campaign file is YAML 1.2. It names a model, its parameters, which of them vary, and the outputs to compute.
All problems of a file are reported at once as `file:line:column: key: message, got value (hint)`.
Made by `python -m mdr_dask.campaign.reference > docs/campaign-file.md`; do not edit. `mdr-dask schema` prints a JSON
schema, with which editors check and complete campaign files: put
`# yaml-language-server: $schema=campaign.schema.json` in the first line.

```yaml
name: force-sweep
model: sliding_friction
seed: 2013
realisations: 200                  # or {at_least: 20, at_most: 2000, until: {friction_coefficient: 1 %}}
parameters:
  length: 20 mm                    # with a unit; a bare number is in SI units
  hurst: 0.7
  normal_force: {geometric: [1 mN, 100 N, 20]}
  velocity: {geometric: [1e-4, 1e2, 36]}
series:                            # optional: each replaces some parameters and is a group of the store
  roughness: {rms_roughness: {geometric: [1 nm, 10 um, 20]}}
  spacing: {points: [2000, 5000, 20000]}
outputs: [friction_coefficient, contact_fraction]
```
"""

_VARIATION = """\
## What varies

| written | means |
|---|---|
| `[1 N, 3 N, 10 N]` | these values; also possible for a nested parameter, such as `angle` of `indenter` |
| `[[1 ms], [1 ms, 1 s]]` | two values of a parameter that is itself a list; in the store, their names are these texts |
| `{values: [...]}` | the same as a list |
| `{linear: [a, b, n]}` | `n` values at equal distances from `a` to `b`, both included |
| `{geometric: [a, b, n]}` | `n` values at equal ratios; both ends above 0 |
| `{adaptive: [a, b], until: 1 %, at_most: 60}` | the study [chooses the values](adaptive.md) between `a` and `b` |
| `[{shape: cone, angle: 10 deg}, {shape: plane}]` | two values of `indenter`, named by these texts in the store |
| `{shape: cone, angle: {linear: [5 deg, 75 deg, 20]}}` | 20 angles of a cone; the axis is called `indenter_angle` |

The ends of a range are exact, the values between them are rounded to 14 digits. Values that agree to 12 digits count as
the same value. In a range of whole numbers, values are rounded, and each value appears once.

Each of the `series` replaces some of the `parameters`. A campaign without `series` has one series without a name.

| `sampling` | means |
|---|---|
| `grid` | all combinations of the values of the varied parameters: one dimension for each of them |
| `zip` | the first values of all varied parameters together, then the second values, ...: one dimension `case` |
| `{sobol: n}` | `n` points of a scrambled Sobol sequence in the ranges |
| `{latin_hypercube: n}` | `n` points, one in each of `n` intervals of every range |
| `{saltelli: n}` | `n` (d + 2) points for [Sobol indices](sensitivity.md) of `d` varied parameters |
| `{table: cases.csv}` | a case for each line of a CSV file |

All except `grid` have the single dimension `case`. A range from which points are drawn states no number of values:
`{linear: [a, b]}` is uniform, `{geometric: [a, b]}` is uniform in the logarithm. The same `seed` draws the same points,
and a larger `sobol` keeps the points of a smaller one. The headings of a table are names of parameters, with units if
needed:
`velocity [mm/s],indenter.angle [deg]`.
"""


def reference_page() -> str:
    """Return the text of ``docs/campaign-file.md``."""
    parts = [_HEAD, "## Keys\n", _table(_rows(CampaignSpec, "key")), _VARIATION, _units()]
    parts += [_model(models.load(name)) for name in models.NAMES]
    return "\n".join(parts)


def parameter_rows(model: Model[Any]) -> list[dict[str, str]]:
    """Return name, unit, default, allowed values and meaning of every parameter of a model, including nested ones."""
    return list(_rows(model.parameters, "parameter"))


def alternatives_of(model: Model[Any]) -> list[str]:
    """Return one line for each group of alternative parameters, such as ``length with rms_roughness, or profile``."""
    nested = [(f"{path}.", kind) for path, _, info in fields.walk(model.parameters) for kind in fields.structures(info)]
    return [
        describe(tuple(tuple(f"{before}{name}" for name in member) for member in group))
        for before, kind in [("", model.parameters), *nested]
        for group in getattr(kind, "alternatives", ())
    ]


def output_rows(model: Model[Any]) -> list[dict[str, str]]:
    """Return a row for each output of a model: name, unit, dimensions within a case, default, error and meaning."""
    return [
        {
            "output": output.name,
            "unit": output.unit,
            "dimensions": ", ".join(output.dims),
            "default": "yes" if output.default else "no",
            "error": f"`{output.error.name}`" if output.has_error else "",
            "meaning": output.long_name,
        }
        for output in model.outputs
    ]


def number_rows(model: Model[Any]) -> list[dict[str, str]]:
    """Return name, formula and meaning of every dimensionless number of a model."""
    return [{"number": number.name, "formula": number.formula, "meaning": number.meaning} for number in model.numbers]


def _model(model: Model[Any]) -> str:
    summary = f"{model.summary[:1].upper()}{model.summary[1:].rstrip('.')}."
    tables = [_table(rows) for rows in (parameter_rows(model), output_rows(model), number_rows(model)) if rows]
    together = [f"* {line}" for line in alternatives_of(model)]
    together = ["Exactly one alternative of each line is required:", "", *together, ""] if together else []
    return "\n".join([f"## `{model.name}`", "", summary, "", *together, *tables])


def _table(rows: Iterable[dict[str, str]]) -> str:
    rows = list(rows)
    name = next(iter(rows[0]))
    lines = [f"| {' | '.join(rows[0])} |", "|---" * len(rows[0]) + "|"]
    lines += [f"| {' | '.join([f'`{row[name]}`', *list(row.values())[1:]])} |" for row in rows]
    return "\n".join([*lines, ""])


def _units() -> str:
    lines = [re.sub(r"; offset: [0-9.]+", "", line) for line in DEFINITIONS.split("\n") if line]
    prefixes = [line.split("=")[-1].strip().rstrip("-") for line in lines if line.split("=")[0].strip().endswith("-")]
    names = [_symbols(line) for line in lines if not line.split("=")[0].strip().endswith("-")]
    return "\n".join(
        [
            "## Units",
            "",
            "A number without a unit is in SI units. With a unit it is a string: `20 mm`, `10 mPa s`, `870 kg/m^3`. An",
            "angle is not a pure number: `5 deg`, not `5 %`. `check` asks about a number without a unit that would be",
            "nearer to the usual value in a common unit, such as mm (`length: 20`), rpm, degrees or Celsius.",
            "",
            f"Prefixes: {', '.join(f'`{prefix}`' for prefix in prefixes)}, and their names.",
            "",
            f"Units: `%`, {', '.join(names)}.",
            "",
        ]
    )


def _symbols(line: str) -> str:
    name, _, *others = (part.strip() for part in line.split("="))
    return "/".join(f"`{word}`" for word in [name, *others] if word != "_")


def _rows(parameters: type[BaseModel], first: str) -> Iterator[dict[str, str]]:
    for path, kind, info in fields.walk(parameters):
        name = path.rpartition(".")[2]
        condition = ", ".join(f"{key}: {value}" for key, value in fields.fixed(kind).items())
        allowed = _allowed(_properties(kind)[name]).removesuffix(": ")  # drops the colon of ``list, each: ``
        nested, entries = (
            [fields.written(each, dict.fromkeys(each.model_fields, "...")).replace(": ...", "") for each in kinds]
            for kinds in (fields.structures(info), fields.listed(info))
        )
        yield {
            first: path,
            "unit": unit_of(kind, name) or "",
            "default": _default(info),
            "allowed": " or ".join(filter(None, [": ".join(filter(None, [allowed, *entries])), *nested])),
            "meaning": f"({condition}) {info.description}" if condition else info.description or "",
        }
        for each in fields.listed(info):
            yield from ({**row, first: f"{path}[].{row[first]}"} for row in _rows(each, first))


@lru_cache
def _properties(kind: type[BaseModel]) -> dict[str, Any]:
    found: dict[str, Any] = kind.model_json_schema()["properties"]
    return found


def _default(info: FieldInfo) -> str:
    if info.is_required():
        return "required"
    value = info.get_default(call_default_factory=True, validated_data={})
    return "" if value is None or value == {} else fields.yaml_text(value)


def _allowed(node: dict[str, Any]) -> str:
    for key in ("anyOf", "oneOf"):
        if key in node:
            return " or ".join(dict.fromkeys(filter(None, map(_allowed, node[key]))))
    if "enum" in node or "const" in node:
        return ", ".join(map(str, node.get("enum", [node.get("const")])))
    kind = node.get("type")
    if kind == "array":
        return f"list, each: {_allowed(node.get('items', {}))}"
    if kind in ("number", "integer"):
        return " ".join(filter(None, [_NOUNS[kind], ", ".join(_bounds(node))]))
    return _NOUNS.get(str(kind), "")


_NOUNS = {
    "number": "number",
    "integer": "whole number",
    "boolean": "true, false",
    "string": "string",
    "object": "mapping",
}


def _bounds(node: dict[str, Any]) -> list[str]:
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    return [f"{sign} {fields.plain(node[key])}" for key, sign in signs.items() if key in node]


if __name__ == "__main__":
    sys.stdout.write(reference_page())
