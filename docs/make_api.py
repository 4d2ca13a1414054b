"""Write the reference of the public functions from docstrings: ``python docs/make_api.py > docs/api.md``."""

from __future__ import annotations

import inspect
import re
import sys
from importlib import import_module
from typing import Any

_HEAD = """\
# Python reference

Made by `python docs/make_api.py > docs/api.md`; do not edit. [Python](python.md) shows how to run a study. The
functions of the physics take and return numpy arrays in the units that each of them states. All examples are tested.
"""

#: For each subject and module, the names of public functions and classes, separated by blanks.
PUBLIC: dict[str, dict[str, str]] = {
    "Studies": {"mdr_dask.studies": "run check open_study table aggregate fit plot master_curve StudyAccessor"},
    "Steady sliding": {
        "mdr_dask.physics.sliding.steady": "steady_sliding",
        "mdr_dask.physics.sliding.cases": "Steady",
        "mdr_dask.physics.surfaces.cubic_line": "periodic_line indented_line",
    },
    "Solids": {"mdr_dask.physics.solids": "kelvin prony complex_modulus fit_series wlf_factor"},
    "Roughness": {
        "mdr_dask.physics.surfaces.roughness": "amplitudes phases spectral_slope",
        "mdr_dask.physics.surfaces.waves": "Waves",
    },
    "Transforms of the method of dimensionality reduction": {
        "mdr_dask.physics.mdr.transforms": "forward_transform",
        "mdr_dask.physics.mdr.power_law_contact": "contact_radius depth normal_force",
    },
    "Fretting wear": {
        "mdr_dask.physics.wear.exact": "exact",
        "mdr_dask.physics.wear.rules": "limit fast",
        "mdr_dask.physics.wear.worn": "Worn",
    },
    "Lubricated line contact": {
        "mdr_dask.physics.lubrication.line_contact": "line_contact solve_film",
        "mdr_dask.physics.lubrication.film_formulas": "hertz_line dimensionless_groups moes_parameters",
    },
    "Oils": {"mdr_dask.physics.lubrication.oil": "Oil walther_constants pressure_viscosity"},
    "Superposition": {"mdr_dask.physics.superposition.master_curve": "superpose Superposition rereference"},
}


def api_page() -> str:
    """Return the text of ``docs/api.md``."""
    parts = [_HEAD]
    for subject, rooms in PUBLIC.items():
        parts.append(f"## {subject}\n")
        parts += [_entry(module, name) for module, names in rooms.items() for name in names.split()]
    return "\n".join(parts)


def _entry(module: str, name: str) -> str:
    thing = getattr(import_module(module), name)
    text = inspect.getdoc(thing) or ""
    head = "" if inspect.isclass(thing) else re.sub(r"'|mdr_dask\.", "", str(inspect.signature(thing)))
    methods = _methods(thing) if inspect.isclass(thing) else ""
    return f"### `{name}`\n\n```python\nfrom {module} import {name}\n{name}{head}\n```\n\n{_markdown(text)}{methods}"


def _methods(thing: Any) -> str:
    """Return the first sentence of every public method of a class."""
    found = [
        f"* `{name}`: {(inspect.getdoc(member) or '').splitlines()[0]}"
        for name, member in vars(thing).items()
        if not name.startswith("_") and (inspect.isfunction(member) or isinstance(member, property))
    ]
    return "\n".join(["", *found, ""]) if found else ""


def _markdown(docstring: str) -> str:
    """Turn a numpydoc docstring into Markdown."""
    lines = re.sub(r"^(\w[\w ]*)\n-{3,}$", r"**\1**", docstring, flags=re.M).splitlines()
    shown: list[str] = []
    section, in_code = "", False
    for line in lines:
        if (line.startswith(">>>") or (in_code and bool(line))) != in_code:
            shown.append("```" if in_code else "```pycon")
            in_code = not in_code
        if line.startswith("**"):
            section = line.strip("*")
            shown += [line, ""]
        elif section in ("Parameters", "Returns", "Attributes", "Raises") and line and not line.startswith(" "):
            name, colon, kind = line.partition(" : ")
            shown.append(f"* `{name}`{', ' + kind if colon else ''}" if colon or " " not in line else f"* {line}")
        else:
            shown.append(line)
    text = "\n".join([*shown, *(["```"] if in_code else [])])
    text = re.sub(r":(?:func|class):`~?(?:[\w.]*\.)?(\w+)`", r"`\1`", text)
    return re.sub(r"(?<!`)``([^`]+)``(?!`)", r"`\1`", text) + "\n"


if __name__ == "__main__":
    sys.stdout.write(api_page())
