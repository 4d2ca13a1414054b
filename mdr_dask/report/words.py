"""Convert labels of figures to HTML: mathtext becomes subscripts and superscripts, all other text is unchanged."""

from __future__ import annotations

import re
from html import escape

#: Commands of mathtext that occur in labels of this package, and the characters that replace them.
_CHARACTERS = {
    "alpha": "α",
    "beta": "β",
    "gamma": "γ",
    "delta": "δ",
    "Delta": "Δ",
    "eta": "η",
    "lambda": "λ",
    "mu": "μ",
    "nu": "ν",
    "pi": "π",
    "rho": "ρ",
    "sigma": "σ",
    "tau": "τ",
    "xi": "ξ",
    "zeta": "ζ",
    "nabla": "∇",
    "infty": "∞",
    "cdot": "·",
    "times": "×",
    "approx": "≈",
    "pm": "±",
    "sqrt": "√",
}
_INDEX = re.compile(r"([_^])(?:\{([^{}]*)\}|(.))")


def markup(label: str) -> str:
    """Return a label as HTML: in ``$F_N$``, N becomes a subscript. The only elements are ``sub`` and ``sup``."""
    parts = label.split("$")
    if len(parts) % 2 == 0:  # one dollar sign has no partner
        return escape(label)
    return "".join(_formula(part) if k % 2 else escape(part) for k, part in enumerate(parts))


def plain(label: str) -> str:
    """Return a label without markup, for screen readers."""
    return re.sub(r"</?su[bp]>", "", markup(label)).replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")


def _formula(text: str) -> str:
    text = re.sub(r"\\([A-Za-z]+) ?", lambda found: _CHARACTERS.get(found[1], found[1]), text)
    text = escape(re.sub(r" *\\[,;!: ] *", " ", text))
    while (raised := _INDEX.sub(_placed, text)) != text:
        text = raised
    return text.replace("{", "").replace("}", "")


def _placed(found: re.Match[str]) -> str:
    tag = "sub" if found[1] == "_" else "sup"
    return f"<{tag}>{found[2] if found[2] is not None else found[3]}</{tag}>"
