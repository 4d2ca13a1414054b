"""Numbers as people write them: with decimal points or commas, and with marks between thousands."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

#: Characters that may separate thousands, in addition to the point or comma that is not the decimal mark.
_GROUPS = "'\N{RIGHT SINGLE QUOTATION MARK} \N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}"
#: For each decimal mark, the pattern of a number with this mark. The other mark may separate thousands.
_DECIMALS = {
    mark: rf"[+-]?(?:(?:\d+|[1-9]\d{{0,2}}(?:[{other}{_GROUPS}]\d{{3}})+)(?:[{mark}]\d*)?|[{mark}]\d+)(?:[eE][+-]?\d+)?"
    for mark, other in (".,", ",.")
}
_NUMBER = re.compile(rf"(?=.{{1,60}}\Z)(?:{_DECIMALS['.']}|{_DECIMALS[',']})")
_MISSING = re.compile(
    r"(?=.{0,20}\Z)[\s.,/*#_<>–—-]*(n[\s.,/]*a[.,]?n?|no[\s_]*data|null|none)?[\s.,/*#_<>–—-]*", re.IGNORECASE
)


def is_number(text: str) -> bool:
    """Return whether a text is a number, with any decimal mark."""
    return _NUMBER.fullmatch(text) is not None


def is_missing(text: str) -> bool:
    """Return whether a text is empty or marks a missing number, such as ``n/a``, ``nan`` or ``--``."""
    return _MISSING.fullmatch(text) is not None


def floats(texts: Iterable[str]) -> list[float]:
    """Return texts with decimal points as numbers, with NaN for texts that are not numbers."""
    return [float(text) if is_number(text) else math.nan for text in texts]


def decimal_marks(texts: Sequence[str]) -> str:
    """Return which of ``.`` and ``,`` can be the decimal mark of all texts: ``,`` for ``30,0``, both for ``3,158``."""
    return "".join(mark for mark, form in _DECIMALS.items() if all(map(re.compile(form).fullmatch, texts)))


def decimal_mark(texts: Sequence[str]) -> str:
    """Return the decimal mark of some numbers, or an empty text if some have a decimal point and others a comma.

    The text is also empty if both characters occur and each of them could be the decimal mark of all numbers.
    """
    count = {mark: sum(mark in text for text in texts) for mark in ".,"}
    possible = decimal_marks(texts)
    if len(possible) == 2 and all(count.values()):
        return ""
    return max(possible, key=lambda mark: count[mark], default="")


def with_point(text: str, decimal: str) -> str:
    """Return a number, or a text of many numbers, with decimal points and without marks between thousands."""
    return text.translate(str.maketrans(decimal, ".", ".,".replace(decimal, "") + _GROUPS))
