"""A periodic line at equidistant nodes, with what is known of it between them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline

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
    rise : float
        How high over it the line reaches in the cell before: that of a coarse grid is not told.
    """

    height: FloatArray
    slope: FloatArray
    ends: FloatArray
    blocks: FloatArray
    top: float
    rise: float


@jit
def _take(given: FloatArray, first: int, stride: int, turn: FloatArray) -> None:
    """Write every stride-th number of a turn from the first one on, and those of the turns before and after."""
    n = turn.size - BEFORE - AFTER
    given_yet = -(-(given.size - first) // stride)
    turned = given_yet if given_yet < n else n  # up to the end of the turn as it is given
    for i in range(turned):
        turn[BEFORE + i] = given[first + i * stride]
    first -= given.size
    for i in range(turned, n):
        turn[BEFORE + i] = given[first + i * stride]
    for i in range(BEFORE):
        turn[i] = turn[n + i]
    for i in range(n + BEFORE, turn.size):
        turn[i] = turn[i - n]


@lru_cache(maxsize=4)
def _end_factors(n: int) -> NDArray[np.complex128]:
    """Return the factors of `ends_of` for every wave of a line of n nodes, from the mean on."""
    wave = 2 * np.pi / n * np.arange(1, n // 2 + 1)
    return np.append(0.0, 1j * (1 / wave - 0.5 / np.tan(wave / 2)))


def ends_of(height: FloatArray, slope: FloatArray) -> FloatArray:
    """Return what the trapezia over nodes leave of the integrals of height and slope squared, shape (2, n).

    At its first node less that at its last one, for any stretch; exact, and slopes are rises over a cell. Local
    derivatives do not see the shortest waves, whose slopes are all that a clipped peak has.
    """
    n = height.size
    parts = fft.rfft([height, (slope / n) ** 2])
    parts *= _end_factors(n)
    return np.asarray(fft.irfft(parts, n, overwrite_x=True), dtype=np.float64)


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
    h, s = np.empty((2, BEFORE + n + AFTER))
    terms = np.empty((2, ends.shape[1] and h.size))
    line = Nodes(h, s, terms, np.empty((n // BLOCK, KNOWN)), float(height[first]), 0.0)
    _take_line(height, slope if resolved else slope[:0], ends, first, stride, line, np.empty((3, BLOCK + 1)))
    return line


@jit
def _take_line(
    height: FloatArray,
    slope: FloatArray,
    ends: FloatArray,
    first: int,
    stride: int,
    line: Nodes,
    cells: FloatArray,
) -> None:
    """Write the nodes and blocks of a line; differences for slopes where none are given."""
    h, s, of_height, of_square, blocks = line.height, line.slope, line.ends[0], line.ends[1], line.blocks
    n = h.size - BEFORE - AFTER
    _take(height, first, stride, h)
    for i in range(h.size):
        h[i] -= line.top
    if slope.size > 0:
        _take(slope, first, stride, s)
        for i in range(s.size):
            s[i] /= n
    else:
        for i in range(1, s.size - 1):
            s[i] = 0.5 * (h[i + 1] - h[i - 1])
        s[0], s[s.size - 1] = s[n], s[s.size - 1 - n]
    if of_height.size > 0:
        _take(ends[0], first, stride, of_height)
        _take(ends[1], first, stride, of_square)
    mean, square, above = cells[0], cells[1], cells[2]
    for j in range(blocks.shape[0]):
        before, begin, last = BEFORE + j * BLOCK - 1, BEFORE + j * BLOCK, BEFORE + (j + 1) * BLOCK
        # cell by cell, so that these are vector instructions, and then their sums
        _integrals(h[before:], s[before:], of_height[before:], of_square[before:], BLOCK, mean, square)
        for k in range(BLOCK):
            i = begin + k
            above[k] = max(h[i], h[i + 1]) + ABOVE * (max(s[i], 0.0) + max(-s[i + 1], 0.0))
        peak, lowest, steepest, heights, squares = -np.inf, h[last], s[last], 0.0, 0.0
        for k in range(BLOCK):
            peak, lowest, steepest = (
                max(peak, above[k]),
                min(lowest, h[begin + k]),
                min(steepest, s[begin + k]),
            )
            heights += mean[k]
            squares += square[k]
        blocks[j, PEAK], blocks[j, LOWEST], blocks[j, STEEPEST] = peak, lowest, steepest
        blocks[j, HEIGHTS], blocks[j, SQUARES] = heights, squares


@jit
def _integrals(
    h: FloatArray,
    s: FloatArray,
    of_height: FloatArray,
    of_square: FloatArray,
    cells: int,
    mean: FloatArray,
    square: FloatArray,
) -> None:
    """Write the integrals of the height and of the slope squared over cells; `square` is one longer.

    Nodes are given from the one before the first cell on: what is counted from there needs no look for its sign.
    Without exact ends there is, at every node, what Euler and Maclaurin add to the trapezium: the derivatives come from
    heights and slopes at the nodes beside, and over a whole line the terms cancel.
    """
    if of_height.size > 0:
        for k in range(cells):
            mean[k] = 0.5 * (h[k + 1] + h[k + 2]) + of_height[k + 1] - of_height[k + 2]
            square[k] = 0.5 * (s[k + 1] * s[k + 1] + s[k + 2] * s[k + 2]) + of_square[k + 1] - of_square[k + 2]
        return
    for k in range(cells + 1):
        rise, fall = h[k + 2] - h[k], (h[k + 2] - h[k + 1]) - (h[k + 1] - h[k])
        tilt, bow = s[k + 2] + s[k], s[k + 2] - s[k]
        second, third, fourth = 2 * fall - 0.5 * bow, 7.5 * rise - 1.5 * (tilt + 8 * s[k + 1]), 6 * bow - 12 * fall
        square[k] = s[k + 1] * second / 6 - (s[k + 1] * fourth + 3 * second * third) / 360
    for k in range(cells):
        mean[k] = 0.5 * (h[k + 1] + h[k + 2]) + (s[k + 1] - s[k + 2]) / 12
        square[k] = 0.5 * (s[k + 1] * s[k + 1] + s[k + 2] * s[k + 2]) + square[k] - square[k + 1]


@jit
def _peaks(h: FloatArray, s: FloatArray, cells: int, peak: FloatArray) -> None:
    """Write the highest point of cells, from the second node on."""
    for k in range(cells):
        h0, h1, s0, s1 = h[k + 1], h[k + 2], s[k + 1], s[k + 2]
        rise = h1 - h0
        a, b = 3 * rise - 2 * s0 - s1, s0 + s1 - 2 * rise
        inside = a * a - 3 * s0 * b
        root = math.sqrt(inside) if inside > 0 else 0.0
        above, below = (s0, root - a) if a <= 0 else (a + root, -3 * b)  # neither cancels
        x = above / below if below > 0 else 0.0
        x = x if (x > 0) & (x < 1) else 0.0
        top, ends = h0 + x * (s0 + x * (a + x * b)), max(h0, h1)
        peak[k] = top if top > ends else ends


@jit_inline
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
    refinement, h, s = weights.shape[1], tile[HEIGHT], tile[SLOPE]
    # exact ones stand at the nodes of the line only
    here = first - 1 if refinement == 1 else line.ends.shape[1]
    if refinement == 1:
        h[: cells + 3] = line.height[first - 1 : first + cells + 2]
        s[: cells + 3] = line.slope[first - 1 : first + cells + 2]
    else:
        refine(line, first, cells, weights, h, s)
    cells *= refinement
    _integrals(h, s, line.ends[0, here:], line.ends[1, here:], cells, tile[MEAN], tile[SQUARE])
    _peaks(h, s, cells, tile[TOP])
    return cells


@lru_cache
def weights(refinement: int) -> FloatArray:
    """Return how the nodes of a finer grid follow from `WING` nodes to either side, shape (2, refinement, 4 WING).

    The first index is 0 for the height and 1 for the slope, the second the node of the finer grid in a cell, the third
    the heights and then the slopes at the 2 WING nodes: the Hermite polynomial through them, of degree 15. With two
    nodes per Nyquist point its error is below 1e-7 of the shortest wave.
    """
    places, x = np.arange(1.0 - WING, 1.0 + WING), np.arange(refinement) / refinement
    table = np.empty((2, refinement, 4 * WING))
    for i, place in enumerate(places):
        others = np.delete(places, i)
        lagrange = np.poly(others) / np.prod(place - others)
        value, rate = np.polyval(lagrange, x), np.polyval(np.polyder(lagrange), x)
        tilt, away = 2 * np.sum(1 / (place - others)), x - place
        table[0, :, i] = (1 - tilt * away) * value**2
        table[0, :, places.size + i] = away * value**2
        table[1, :, i] = -tilt * value**2 + 2 * (1 - tilt * away) * value * rate
        table[1, :, places.size + i] = value**2 + 2 * away * value * rate
    return table


@jit
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


def with_summit(line: Nodes) -> Nodes:
    """Return a line whose highest point is in the cell before its first node, with how high it reaches there."""
    table = weights(SUMMIT)
    height, slope = np.empty((2, SUMMIT + 3))
    refine(line, BEFORE - 1, 1, table, height, slope)
    return line._replace(rise=max(float(np.max(height[1:-1])), 0.0))
