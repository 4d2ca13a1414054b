"""The page that figures are drawn for: its size, its units and its style, for whatever is drawn meanwhile."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mdr_dask.errors import DataError, did_you_mean
from mdr_dask.units import to_si

#: Letters and lines of a figure whose size is asked for, in points: journals print it as it is.
LETTERS: dict[Any, Any] = {
    "font.size": 8.5,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
}
#: Metres to an inch, and the least and greatest width and height.
INCH = 0.0254
LEAST, MOST = 0.02, 1.0


@dataclass(frozen=True)
class Page:
    """What a user asks of the look of a figure: width and height in inches, and units by the name of a quantity.

    `used` names the quantities that were shown in a unit asked for, `cycle` has what a style says of one curve after
    the other.
    """

    width: float | None = None
    height: float | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)
    cycle: tuple[Mapping[str, str], ...] = ()

    def unit(self, name: str) -> str | None:
        """Return the unit that a quantity is to be shown in, None for its usual one."""
        if name in self.units:
            self.used.add(name)
        return self.units.get(name)


_NOTHING_ASKED = Page()
_PAGE: ContextVar[Page] = ContextVar("page", default=_NOTHING_ASKED)


@contextmanager
def drawing_for(asked: Page, file: str | None = None) -> Iterator[None]:
    """Draw figures for a page: in its size, with letters for it, in its units, in a style of matplotlib.

    Parameters
    ----------
    asked : Page
        Size and units.
    file : str, optional
        A style file of matplotlib, or the name of one of its own styles; it has the last word.

    Raises
    ------
    DataError
        If there is no such style.
    """
    from matplotlib import rc_context, rc_params_from_file
    from matplotlib.style import context, library

    if file is not None and not (Path(file).is_file() or file in library):
        hint = did_you_mean(file, [*library])
        near = hint if "mean" in hint else " (such as 'grayscale' or 'seaborn-v0_8-paper')"
        raise DataError(f"expected a style file, or the name of a style of matplotlib{near}, got {file!r}")
    said = {} if file is None else library.get(file) or rc_params_from_file(file, use_default_template=False)
    token = _PAGE.set(replace(asked, cycle=tuple(said.get("axes.prop_cycle", ()))))
    try:
        with rc_context(LETTERS if asked.width else {}), context([file] if file else []):
            yield
    finally:
        _PAGE.reset(token)


@contextmanager
def with_units(units: Mapping[str, str]) -> Iterator[None]:
    """Show quantities in units, unless others were asked for."""
    token = _PAGE.set(replace(_PAGE.get(), units={**units, **_PAGE.get().units}))
    try:
        yield
    finally:
        _PAGE.reset(token)


def asked() -> Page:
    """Return the page that is drawn for."""
    return _PAGE.get()


def size(text: str) -> tuple[float, float | None]:
    """Return width and height in inches from a text such as ``85mm``, a width alone, or ``85x60mm``.

    Raises
    ------
    DataError
        If it is no size, or none between 20 mm and 1 m.
    """
    match = re.fullmatch(r"([\d.]+)\s*([a-z]*)(?:\s*x\s*([\d.]+)\s*([a-z]+))?", text.strip())
    if match is None or not (match[2] or match[4]):
        raise DataError(f"expected a width such as '85mm', or width and height such as '85x60mm', got {text!r}")
    try:
        sides = [to_si(f"{match[1]} {match[2] or match[4]}", "m")]
        sides += [to_si(f"{match[3]} {match[4]}", "m")] if match[3] else []
    except ValueError as error:
        raise DataError(f"size: {error}") from None
    if not all(LEAST <= side <= MOST for side in sides):
        raise DataError(f"expected a size between 20 mm and 1 m, got {text!r}")
    inches = [side / INCH for side in sides]
    return inches[0], inches[1] if len(inches) > 1 else None
