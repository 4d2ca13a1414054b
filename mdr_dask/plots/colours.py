"""Colours, lines and markers of curves, and colour bars."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from mdr_dask.arrays import is_geometric
from mdr_dask.plots import page
from mdr_dask.plots.figure import Bar

if TYPE_CHECKING:
    from matplotlib.colors import Colormap, Normalize

#: Colours of Okabe and Ito, which colour-blind readers can distinguish.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
LINES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "^", "D")


def _cycle(key: str) -> tuple[str, ...]:
    return tuple(each[key] for each in page.current().cycle if key in each)


def most() -> int:
    """Return the number of curves that can be distinguished by colours."""
    return len(_cycle("color") or COLOURS)


def colour(number: int) -> str:
    """Return the colour of a curve."""
    from matplotlib.colors import to_hex

    colours = _cycle("color") or COLOURS
    return to_hex(colours[number % len(colours)])


def line_and_marker(number: int) -> tuple[str, str]:
    """Return the line style and the marker of a curve."""
    from matplotlib.colors import to_rgb

    greys = all(len(set(to_rgb(each))) == 1 for each in _cycle("color") or COLOURS)
    lines = _cycle("linestyle") or (LINES if greys else LINES[:1])
    markers = _cycle("marker") or (MARKERS if greys else MARKERS[:1])
    return lines[number % len(lines)], markers[(number + number // len(lines)) % len(markers)]


def bar(label: str, values: Any, log: bool | None = None) -> Bar:
    """Return a colour bar for the range of some values.

    If `log` is None, the bar is logarithmic if the values suit a logarithmic axis. If `log` is true, the bar is
    logarithmic if all values are positive.
    """
    values = np.asarray(values, dtype=np.float64)
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    log = is_geometric(values) if log is None else log and low > 0
    return Bar(label, low, high if high > low else low + (abs(low) or 1.0), log)


def scale(of: Bar) -> tuple[Colormap, Normalize]:
    """Return the colour map of a colour bar, and the matplotlib norm that maps values to this colour map."""
    from matplotlib import colormaps, rcParams
    from matplotlib.colors import LogNorm, Normalize

    return colormaps[rcParams["image.cmap"]], (LogNorm if of.log else Normalize)(of.low, of.high)


def shade(of: Bar, value: float) -> str:
    """Return the colour that a colour bar gives to a value."""
    from matplotlib.colors import to_hex

    how, norm = scale(of)
    return str(to_hex(how(norm(value))))
