"""The page: one HTML file that contains all data and scripts.

Nothing in a store can run as a script. The template escapes texts. Data are a block of JSON. The content security
policy admits only the scripts of this package, identified by the digests of the scripts.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Sequence
from functools import lru_cache
from importlib.resources import files
from typing import Any

from mdr_dask.report.study import Study
from mdr_dask.report.subjects import Equation
from mdr_dask.version import __version__

#: The scripts of the page, in the order in which they run.
SCRIPTS = ("plotly-cartesian.min.js", "look.js", "figure.js", "choose.js", "page.js")


def page(studies: Sequence[Study]) -> str:
    """Return the page of studies as HTML that needs no other file and no network."""
    scripts = [asset(name) for name in SCRIPTS]
    data = [
        {"key": f"s{k}", "title": study.title, "url": study.url, "figures": study.figures, "cases": study.cases}
        for k, study in enumerate(studies)
    ]
    written: str = _template().render(
        studies=studies,
        title=", ".join(dict.fromkeys(study.title for study in studies)),
        data=harmless(data),
        scripts=scripts,
        style=asset("page.css"),
        policy=policy(),
        version=__version__,
        mathml=mathml,
    )
    return written


def policy() -> str:
    """Return the content security policy, which allows no network and only the scripts of this package."""
    digests = [base64.b64encode(hashlib.sha256(asset(name).encode()).digest()).decode() for name in SCRIPTS]
    scripts = " ".join(f"'sha256-{digest}'" for digest in digests)
    return "; ".join(
        [
            "default-src 'none'",
            f"script-src {scripts}",
            "style-src 'unsafe-inline'",  # the plotting library sets its own styles
            "img-src data: blob:",
            "connect-src 'none'",
            "base-uri 'none'",
            "form-action 'none'",
        ]
    )


def harmless(data: Any) -> str:
    """Return data as JSON that cannot end the HTML element ``script`` around the JSON."""
    text = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026").replace("\u2028", "\\u2028")


@lru_cache(maxsize=16)
def asset(name: str) -> str:
    """Return the text of a file of this package."""
    return (files("mdr_dask.report") / "assets" / name).read_text(encoding="utf-8")


@lru_cache(maxsize=64)
def mathml(equation: Equation) -> str:
    """Return an equation as MathML, or as LaTeX if latex2mathml is not installed."""
    try:
        from latex2mathml.converter import convert
    except ModuleNotFoundError:
        return f"<code>{html.escape(equation.latex)}</code>"
    return str(convert(equation.latex, display="block"))


@lru_cache(maxsize=1)
def _template() -> Any:
    from jinja2 import Environment, StrictUndefined

    room = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return room.from_string(asset("page.html.jinja"))
