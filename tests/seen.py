"""What a reader sees of a figure, as rows of a record: texts, looks, limits, and where everything lies."""

from __future__ import annotations

import re
from itertools import groupby

import numpy as np
from matplotlib.collections import LineCollection, PathCollection, PolyCollection, QuadMesh
from matplotlib.colors import to_hex
from matplotlib.ticker import FixedLocator
from record import weights_of

#: Numbers of one row of a record: of more, a change of one would not be seen in their mean.
MOST = 60
#: What is left of a difference of equal numbers, and where.
NOISE = r"\d(\.\d+)?e-1[4-9]([ |]at[ |]mu_1[ |]/[ |]rms_slope[ |]=[ |][\d.e+-]+)?"


def of(figure) -> dict[str, object]:
    """Rows of a record: the words of a figure, and its numbers, as many in a row as a change can be seen among."""
    told, numbers = [], [*figure.get_size_inches()]
    for text in (figure._suptitle, figure._supxlabel):
        if text is not None:
            told.append(text.get_text())
            numbers.append(text.get_fontsize())
    for axes in figure.axes:
        told.append(_words(axes))
        numbers += _numbers(axes)
    for bar in getattr(figure, "bars", ()):
        told.append(f"bar: {bar.drawn.cmap.name}, {type(bar.drawn.norm).__name__}, beside {len(bar.panels)}")
        numbers += [bar.drawn.vmin, bar.drawn.vmax]
    scaled = np.arcsinh(1e12 * np.array(numbers, dtype=float))
    parts = np.array_split(scaled, -(-scaled.size // MOST))
    words = re.sub(NOISE, "0", " / ".join(told).replace("\n", "|"))
    return {"words": words} | {f"numbers {k}": part for k, part in enumerate(parts, start=1)}


def _words(axes) -> str:
    parts = [axes.get_label(), axes.get_title(), axes.get_xlabel(), axes.get_ylabel()]
    parts += [f"{axis.get_scale()}{_ticks(axis)}" for axis in (axes.xaxis, axes.yaxis)]
    parts += [text.get_text() for text in axes.texts]
    if legend := axes.get_legend():
        names = [text.get_text() for text in legend.get_texts()]
        parts.append(f"legend {legend._loc}, {legend._ncols}: {'; '.join([legend.get_title().get_text(), *names])}")
    if axes.get_label() == "<colorbar>":
        return "; ".join(parts)
    looks = [_look(artist, axes) for artist in (*axes.lines, *axes.collections)]
    parts += [f"{len([*alike])} {look}" for look, alike in groupby(looks)]
    return "; ".join(part for part in parts if part)


def _ticks(axis) -> str:
    """Texts of the ticks that a figure sets itself."""
    if not isinstance(axis.get_major_locator(), FixedLocator):
        return ""
    places = axis.get_major_locator()()
    return f" {' '.join(axis.get_major_formatter().format_ticks(places))}"


def _look(artist, axes) -> str:
    """Whose it is, how far in front, how solid, and its line, colour and marker."""
    alpha = artist.get_alpha()
    what = [artist.get_gid() or "", f"{artist.get_zorder():g}", "" if alpha is None else f"a{alpha:g}"]
    if artist in axes.lines:
        line, marker, width, size = (
            getattr(artist, f"get_{name}")() for name in ("linestyle", "marker", "linewidth", "markersize")
        )
        what += ["across"] if artist.get_transform() != axes.transData else []
        what += [] if line == "None" else [f"{line}{width:g}"]
        what += [] if marker in ("None", "") else [f"{marker}{size:g}{_face(artist)}"]
        return " ".join([*filter(None, what), _colour(artist.get_color(), axes)])
    what += [type(artist).__name__.removesuffix("Collection"), *(f"{width:g}" for width in artist.get_linewidths()[:1])]
    if artist.get_array() is not None:
        return " ".join([*filter(None, what), artist.get_cmap().name, type(artist.norm).__name__])
    colours = artist.get_edgecolor() if isinstance(artist, LineCollection) else artist.get_facecolor()
    return " ".join([*filter(None, what), *(_colour(colour, axes) for colour in colours[:1])])


def _face(line) -> str:
    """The inside of markers where it is not that of the line."""
    return "" if line.get_markerfacecolor() == line.get_color() else f" {line.get_markerfacecolor()}"


def _colour(colour, axes) -> str:
    """The colour of one of a few; that of many is a matter of a colour bar."""
    few = colour if isinstance(colour, str) else to_hex(colour)
    return few if isinstance(colour, str) or not axes.get_figure().bars else "shade"


def _numbers(axes) -> list[float]:
    if axes.get_label() == "<colorbar>":
        return [axes.yaxis.label.get_fontsize()]
    found = [*axes.get_xlim(), *axes.get_ylim(), axes.title.get_fontsize(), axes.yaxis.label.get_fontsize()]
    for text in axes.texts:
        found += [*text.get_position(), text.get_fontsize()]
    if legend := axes.get_legend():
        place = axes.transAxes.inverted().transform(legend.get_bbox_to_anchor().get_points())
        found += [*place.ravel(), *(text.get_fontsize() for text in legend.get_texts()[:1])]
        found += [legend.get_title().get_fontsize(), legend.get_frame().get_alpha()]
    for patch in axes.patches:
        found += [*patch.get_path().get_extents(patch.get_patch_transform()).extents, patch.get_linewidth()]
    for line in axes.lines:
        found += _lies(np.c_[line.get_xdata(orig=False), line.get_ydata(orig=False)])
    for part in axes.collections:
        if isinstance(part, QuadMesh):
            found += [*_lies(part.get_coordinates().reshape(-1, 2)), *_lies(part.get_array().reshape(-1, 1))]
            found += [*part.get_clim()]
        elif isinstance(part, PathCollection):
            found += [*_lies(part.get_offsets()), *_lies(np.reshape(part.get_sizes(), (-1, 1)))]
            found += [] if part.get_array() is None else [*_lies(part.get_array().reshape(-1, 1)), *part.get_clim()]
        elif isinstance(part, PolyCollection | LineCollection):
            found += _lies(np.concatenate([np.zeros((0, 2)), *(path.vertices for path in part.get_paths())]))
    return found


def _lies(points) -> list[float]:
    """Weighted means of the logarithms of coordinates: points in each other's place have others."""
    points = np.ma.filled(np.ma.asarray(points, dtype=float), np.nan)
    scaled, weights = np.arcsinh(1e12 * points), weights_of(len(points))
    known = np.isfinite(scaled)
    return [
        float(np.sinh(np.average(column[here], weights=weights[here]))) * 1e-12 if here.any() else 0.0
        for column, here in zip(scaled.T, known.T, strict=True)
    ]
