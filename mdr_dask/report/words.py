"""Convert labels of figures to HTML. Mathtext becomes subscripts and superscripts. All other text is unchanged."""

from __future__ import annotations

import re
from html import escape, unescape

_INDEX = re.compile(r"([_^])(?:\{([^{}]*)\}|(.))")


def markup(label: str) -> str:
    """Return a label as HTML: in ``$F_N$``, N becomes a subscript. The only elements are ``sub`` and ``sup``."""
    parts = label.split("$")
    if len(parts) % 2 == 0:  # an odd number of dollar signs is not mathtext
        return escape(label)
    return "".join(_formula(part) if k % 2 else escape(part) for k, part in enumerate(parts))


def _formula(text: str) -> str:
    text = re.sub(r"\\([A-Za-z]+) ?", _character, text)
    text = escape(re.sub(r" *\\[,;!: ] *", " ", text))
    while (raised := _INDEX.sub(_placed, text)) != text:
        text = raised
    return text.replace("{", "").replace("}", "")


def _character(command: re.Match[str]) -> str:
    """Return the character for a command of mathtext, such as α for the command ``alpha``. If HTML has no character of
    this name, the name itself is returned.
    """
    return unescape(f"&{command[1]};").removeprefix("&").removesuffix(";")


def _placed(found: re.Match[str]) -> str:
    tag = "sub" if found[1] == "_" else "sup"
    return f"<{tag}>{found[2] if found[2] is not None else found[3]}</{tag}>"
