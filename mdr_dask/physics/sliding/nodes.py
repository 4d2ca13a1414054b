"""A periodic line at equidistant nodes, with what is known of it between them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.compiling import compiled, copy_into, inlined, kernel

BLOCK = 32  # cells
WING = 4  # nodes to either side that a finer grid follows from
BEFORE, AFTER = WING + 1, WING + 2  # nodes of the turns before and after, as many as `refine` reads
ABOVE = 4 / 27  # of its slopes at both ends, that a cubic cell reaches above its ends at most
SUMMIT = 64  # nodes in a cell that its highest point is taken from

NO_ENDS: FloatArray = np.empty((2, 0))
# What is known of a block of cells, in this order
PEAK, LOWEST, STEEPEST, HEIGHTS, SQUARES = range(5)
KNOWN = 5
# What a tile holds, in this order: at nodes, from the one before it on, and of cells
HEIGHT, SLOPE, MEAN, SQUARE, TOP = range(5)
IN_A_TILE = 5


class Nodes(NamedTuple):
    """A periodic line on a grid of n cells.

    Parameters
    ----------
    height, slope : array, shape (BEFORE + n + AFTER,)
        With nodes of the turns before and after; heights from the first, rise over a cell.
    ends : array, shape (2, BEFORE + n + AFTER) or (2, 0)
        From `ends_of`, likewise.
    blocks : array, shape (n // BLOCK, KNOWN)
        Bounds and sums over the cells of a block.
    top : float
        The height of the first node.
    """

    height: FloatArray
    slope: FloatArray
    ends: FloatArray
    blocks: FloatArray
    top: float


@compiled
def _close(turn: FloatArray) -> None:
    """Write the nodes of the turns before and after."""
    n = turn.size - BEFORE - AFTER
    copy_into(turn[:BEFORE], turn[n : n + BEFORE])
    copy_into(turn[n + BEFORE :], turn[BEFORE : BEFORE + AFTER])


@inlined
def _end_term(h: FloatArray, s: FloatArray, i: int) -> float:
    """Return what Euler and Maclaurin add to the trapezium of the slope squared at its first node, in cells.

    The derivatives come from heights and slopes at the nodes beside; over a whole line the terms cancel.
    """
    rise, fall = h[i + 1] - h[i - 1], (h[i + 1] - h[i]) - (h[i] - h[i - 1])
    tilt, bow = s[i + 1] + s[i - 1], s[i + 1] - s[i - 1]
    second, third, fourth = 2 * fall - 0.5 * bow, 7.5 * rise - 1.5 * (tilt + 8 * s[i]), 6 * bow - 12 * fall
    term: float = s[i] * second / 6 - (s[i] * fourth + 3 * second * third) / 360
    return term


def ends_of(height: FloatArray, slope: FloatArray) -> FloatArray:
    """Return what the trapezia over nodes leave of the integrals of height and slope squared, shape (2, n).

    At its first node less that at its last one, for any stretch; exact, and slopes are rises over a cell. Local
    derivatives do not see the shortest waves, whose slopes are all that a clipped peak has.
    """
    n = height.size
    wave = 2 * np.pi / n * np.arange(1, n // 2 + 1)
    parts = np.fft.rfft([height, (slope / n) ** 2])
    parts[:, 0] = 0.0
    parts[:, 1:] *= 1j * (1 / wave - 0.5 / np.tan(wave / 2))
    return np.asarray(np.fft.irfft(parts, n), dtype=np.float64)


@kernel
def nodes(height: FloatArray, slope: FloatArray, first: int, stride: int, resolved: bool, ends: FloatArray) -> Nodes:
    """Take every stride-th node of a line; differences for slopes if it is not resolved.

    Parameters
    ----------
    height, slope : array, shape (n,)
        Heights and derivatives by position over the length of the line.
    first : int
        The node to begin with; heights are from there.
    ends : array, shape (2, n) or (2, 0)
        From `ends_of`; integrals over cells come from the nodes beside without.
    """
    n = height.size // stride
    terms = np.empty((2, ends.shape[1] and n + BEFORE + AFTER))
    for i in range(terms.shape[1]):
        place = (first + i - BEFORE) % n
        terms[0, i], terms[1, i] = ends[0, place], ends[1, place]
    h, s = np.empty(n + BEFORE + AFTER), np.empty(n + BEFORE + AFTER)
    top = height[first]
    turned = min(-(-(height.size - first) // stride), n)  # nodes up to the end of the line as it is given
    for i in range(turned):
        h[BEFORE + i] = height[first + i * stride] - top
        s[BEFORE + i] = slope[first + i * stride] / n
    first -= height.size
    for i in range(turned, n):
        h[BEFORE + i] = height[first + i * stride] - top
        s[BEFORE + i] = slope[first + i * stride] / n
    _close(h)
    if not resolved:
        for i in range(BEFORE, n + BEFORE):
            s[i] = 0.5 * (h[i + 1] - h[i - 1])
    _close(s)
    blocks, square, above, mean = np.empty((n // BLOCK, KNOWN)), np.empty(BLOCK + 1), np.empty(BLOCK), np.empty(BLOCK)
    for j in range(blocks.shape[0]):
        begin, last = BEFORE + j * BLOCK, BEFORE + (j + 1) * BLOCK
        # cell by cell, so that these are vector instructions, and then their sums
        _integrals(h, s, (terms[0], terms[1]), begin, BLOCK, mean, square)
        for k in range(BLOCK):
            i = begin + k
            above[k] = max(h[i], h[i + 1]) + ABOVE * (max(s[i], 0.0) + max(-s[i + 1], 0.0))
        peak, lowest, steepest, heights, squares = -np.inf, h[last], s[last], 0.0, 0.0
        for k in range(BLOCK):
            peak, lowest, steepest = max(peak, above[k]), min(lowest, h[begin + k]), min(steepest, s[begin + k])
            heights += mean[k]
            squares += square[k]
        blocks[j, PEAK], blocks[j, LOWEST], blocks[j, STEEPEST] = peak, lowest, steepest
        blocks[j, HEIGHTS], blocks[j, SQUARES] = heights, squares
    return Nodes(h, s, terms, blocks, top)


@compiled
def _integrals(
    h: FloatArray,
    s: FloatArray,
    ends: tuple[FloatArray, FloatArray],
    first: int,
    cells: int,
    mean: FloatArray,
    square: FloatArray,
) -> None:
    """Write the integrals of the height and of the slope squared over cells; `square` is one longer."""
    of_height, of_square = ends
    if of_height.size > 0:
        for k in range(cells):
            i = first + k
            mean[k] = 0.5 * (h[i] + h[i + 1]) + of_height[i] - of_height[i + 1]
            square[k] = 0.5 * (s[i] * s[i] + s[i + 1] * s[i + 1]) + of_square[i] - of_square[i + 1]
        return
    for k in range(cells + 1):
        square[k] = _end_term(h, s, first + k)
    for k in range(cells):
        i = first + k
        mean[k] = 0.5 * (h[i] + h[i + 1]) + (s[i] - s[i + 1]) / 12
        square[k] = 0.5 * (s[i] * s[i] + s[i + 1] * s[i + 1]) + square[k] - square[k + 1]


@compiled
def _peaks(h: FloatArray, s: FloatArray, first: int, cells: int, peak: FloatArray) -> None:
    """Write the highest point of cells."""
    for k in range(cells):
        i = first + k
        rise = h[i + 1] - h[i]
        a, b = 3 * rise - 2 * s[i] - s[i + 1], s[i] + s[i + 1] - 2 * rise
        inside = a * a - 3 * s[i] * b
        x = s[i] / ((math.sqrt(inside) if inside > 0 else 0.0) - a)
        x = x if (x > 0) & (x < 1) else 0.0
        top, ends = h[i] + x * (s[i] + x * (a + x * b)), max(h[i], h[i + 1])
        peak[k] = top if top > ends else ends


@compiled
def fill(line: Nodes, first: int, cells: int, weights: FloatArray, tile: FloatArray) -> int:
    """Write a tile of a line, on the finer grid that weights make, and return the number of its cells.

    Parameters
    ----------
    line : Nodes
    first, cells : int
        First node, and number of the cells of the line.
    weights : array, shape (2, refinement, 4 WING)
        From :func:`weights`.
    tile : array, shape (IN_A_TILE, cells refinement + 3)
        Written, row by row: heights and slopes, a node before the first one and one behind the last one too; integrals
        of the height and of the slope squared over each cell, and its highest point.
    """
    refinement = weights.shape[1]
    # exact ones stand at the nodes of the line only
    here = first - 1 if refinement == 1 else line.ends.shape[1]
    ends = line.ends[0, here:], line.ends[1, here:]
    if refinement == 1:
        copy_into(tile[HEIGHT, : cells + 3], line.height[first - 1 : first + cells + 2])
        copy_into(tile[SLOPE, : cells + 3], line.slope[first - 1 : first + cells + 2])
    else:
        refine(line, first, cells, weights, tile[HEIGHT], tile[SLOPE])
    cells *= refinement
    _integrals(tile[HEIGHT], tile[SLOPE], ends, 1, cells, tile[MEAN], tile[SQUARE])
    _peaks(tile[HEIGHT], tile[SLOPE], 1, cells, tile[TOP])
    return cells


def _hermite(places: FloatArray, x: float) -> FloatArray:
    """Return height and slope at a place from heights and slopes at others, by the polynomial of least degree.

    Rows are the height and the slope, columns the heights and then the slopes at the places.
    """
    table = np.empty((2, 2 * places.size))
    for i, place in enumerate(places):
        others = np.delete(places, i)
        value = np.prod((x - others) / (place - others))
        rate = sum(np.prod(np.delete(x - others, k)) for k in range(others.size)) / np.prod(place - others)
        tilt, away = 2 * np.sum(1 / (place - others)), x - place
        table[0, i] = (1 - tilt * away) * value**2
        table[0, places.size + i] = away * value**2
        table[1, i] = -tilt * value**2 + 2 * (1 - tilt * away) * value * rate
        table[1, places.size + i] = value**2 + 2 * away * value * rate
    return table


@lru_cache
def weights(refinement: int) -> FloatArray:
    """Return how the nodes of a finer grid follow from `WING` nodes to either side, shape (2, refinement, 4 WING).

    Rows are as in `_hermite`, for every node in a cell. The polynomial is of degree 15: with two nodes a Nyquist point
    its error is below 1e-7 of the shortest wave.
    """
    places = np.arange(1.0 - WING, 1.0 + WING)
    return np.stack([_hermite(places, step / refinement) for step in range(refinement)], axis=1)


@compiled
def refine(line: Nodes, first: int, cells: int, weights: FloatArray, height: FloatArray, slope: FloatArray) -> None:
    """Write heights and slopes of the finer grid over cells of a line, from the node before to the second one after."""
    refinement = weights.shape[1]
    h, s = line.height, line.slope
    for place in range(-1, cells * refinement + 2):
        cell = place // refinement
        step, i = place - cell * refinement, first + cell + 1 - WING
        value, rate = 0.0, 0.0
        for k in range(2 * WING):
            value += weights[0, step, k] * h[i + k] + weights[0, step, 2 * WING + k] * s[i + k]
            rate += weights[1, step, k] * h[i + k] + weights[1, step, 2 * WING + k] * s[i + k]
        height[place + 1], slope[place + 1] = value, rate / refinement


def summit_rise(line: Nodes) -> float:
    """Return how high over the first node the line reaches in the cell before it."""
    table = weights(SUMMIT)
    height, slope = np.empty((2, SUMMIT + 3))
    refine(line, BEFORE - 1, 1, table, height, slope)
    return max(float(np.max(height[1:-1])), 0.0)
