"""The appearance that the user requests for figures: printed size, title, units and style."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mdr_dask.errors import DataError, similar
from mdr_dask.units import to_si

#: Sizes of letters and lines, in points, for a figure that is printed at the requested size, without scaling.
LETTERS: dict[Any, Any] = {
    "font.size": 8,
    "axes.labelsize": 8,
    "axes.titlesize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.0,
    "lines.markersize": 3,
}
#: Sizes of letters and lines, in points, for a figure on a screen.
SCREEN: dict[Any, Any] = {"legend.fontsize": 8, "lines.linewidth": 1.2, "lines.markersize": 4}
INCH = 0.0254  # m
#: Width of a column and height of a page of a journal in inches.
COLUMN, TALLEST = 0.085 / INCH, 0.23 / INCH


@dataclass(frozen=True)
class Page:
    """The requested appearance of a figure.

    `width` and `height` are in inches. Without a requested height, the height follows from the content. If `title` is
    None, the title is a description of the figure, or empty if a width is requested. `style` is the name of a style of
    matplotlib or a style file, and `cycle` holds the colours, lines and markers of this style. `units` maps names of
    quantities to the units in which they are shown, and `symbols` maps names of coordinates to their labels. `used`
    collects the names of all quantities that figures have shown.
    """

    width: float | None = None
    height: float | None = None
    title: str | None = None
    style: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    symbols: Mapping[str, str] = field(default_factory=dict)
    used: set[str] = field(default_factory=set)
    cycle: tuple[Mapping[str, str], ...] = ()

    def unit(self, name: str) -> str | None:
        """Return the unit in which figures show a quantity, or None for its own unit. Add the name to `used`."""
        self.used.add(name)
        return self.units.get(name)


_PAGE: ContextVar[Page | None] = ContextVar("page", default=None)


def requested(
    size: str | None = None,
    title: str | None = None,
    style: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Page:
    """Return the `Page` for the options of a command. `size` is a text such as ``85x60mm`` (see `sides`)."""
    width, height = sides(size) if size else (None, None)
    return Page(width, height, title, style, units or {})


@contextmanager
def drawing_for(page: Page) -> Iterator[None]:
    """Apply the settings of a page to all figures that are drawn within a ``with`` statement.

    DataError is raised if the style is neither a file nor the name of a style of matplotlib.
    """
    from matplotlib import rc_context, rc_params_from_file
    from matplotlib.style import context, library

    style = page.style
    if style is not None and not (Path(style).is_file() or style in library):
        near = similar(style, [*library]) or " (such as 'grayscale' or 'seaborn-v0_8-paper')"
        raise DataError(f"expected a style file, or the name of a style of matplotlib{near}, got {style!r}")
    given = {} if style is None else library.get(style) or rc_params_from_file(style, use_default_template=False)
    token = _PAGE.set(replace(page, cycle=tuple(given.get("axes.prop_cycle", ()))))
    try:
        with rc_context(LETTERS if page.width else SCREEN), context([style] if style else []):
            yield
    finally:
        _PAGE.reset(token)


@contextmanager
def with_labels(units: Mapping[str, str], symbols: Mapping[str, str]) -> Iterator[None]:
    """Within a ``with`` statement, use these symbols, and these units unless the user requested other units."""
    token = _PAGE.set(replace(current(), units={**units, **current().units}, symbols=symbols))
    try:
        yield
    finally:
        _PAGE.reset(token)


def current() -> Page:
    """Return the page for which figures are currently drawn."""
    return _PAGE.get() or Page()


def sides(text: str) -> tuple[float, float | None]:
    """Return width and height in inches from a text such as ``85x60mm``. For ``85mm``, the height is None.

    DataError is raised if the text has another form, or if a side is not between 20 mm and 1 m.
    """
    match = re.fullmatch(r"([\d.]+)\s*([a-z]*)(?:\s*x\s*([\d.]+)\s*([a-z]+))?", text.strip())
    if match is None or not (match[2] or match[4]):
        raise DataError(f"expected a width such as '85mm', or width and height such as '85x60mm', got {text!r}")
    try:
        sides = [to_si(f"{match[1]} {match[2] or match[4]}", "m")]
        sides += [to_si(f"{match[3]} {match[4]}", "m")] if match[3] else []
    except ValueError as error:
        raise DataError(f"size: {error}") from None
    if not all(0.02 <= side <= 1.0 for side in sides):
        raise DataError(f"expected a size between 20 mm and 1 m, got {text!r}")
    inches = [side / INCH for side in sides]
    return inches[0], inches[1] if len(inches) > 1 else None
