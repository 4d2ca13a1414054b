"""A periodic line at equidistant nodes, with what is known of it between them."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit

from mdr_dask.arrays import FloatArray

BLOCK = 32  # cells
BEFORE, AFTER = 4, 5  # nodes of the turns before and after, as many as `refine` reads
SUMMIT = 64  # nodes in a cell that its highest point is taken from
WING = 4  # nodes to either side that the middle of a cell follows from

# What is known of a block of cells, in this order
PEAK, LOWEST, STEEPEST, HEIGHTS, SQUARES = range(5)
KNOWN = 5


class Nodes(NamedTuple):
    """A periodic line on a grid of n cells.

    Parameters
    ----------
    height, slope : array, shape (BEFORE + n + AFTER,)
        With nodes of the turns before and after; heights from the first, rise over a cell.
    blocks : array, shape (n // BLOCK, KNOWN)
        Bounds and sums over the cells of a block.
    top : float
        The height of the first node.
    """

    height: FloatArray
    slope: FloatArray
    blocks: FloatArray
    top: float


@njit(nogil=True, cache=True)
def _close(turn: FloatArray) -> None:
    """Write the nodes of the turns before and after."""
    n = turn.size - BEFORE - AFTER
    turn[:BEFORE] = turn[n : n + BEFORE]
    turn[n + BEFORE :] = turn[BEFORE : BEFORE + AFTER]


@njit(nogil=True, cache=True, inline="always")
def bend(h: FloatArray, s: FloatArray, i: int) -> float:
    """Return the second derivative at a node from heights and slopes around it, to fourth order."""
    second: float = 2 * ((h[i + 1] - h[i]) - (h[i] - h[i - 1])) - 0.5 * (s[i + 1] - s[i - 1])
    return second


@njit(nogil=True, cache=True)
def nodes(height: FloatArray, slope: FloatArray, first: int, stride: int, resolved: bool) -> Nodes:
    """Take every stride-th node of a line; differences for slopes if it is not resolved.

    Parameters
    ----------
    height, slope : array, shape (n,)
        Heights and derivatives by position over the length of the line.
    first : int
        The node to begin with; heights are from there.
    """
    n = height.size // stride
    h, s = np.empty(n + BEFORE + AFTER), np.empty(n + BEFORE + AFTER)
    top = height[first]
    source = first
    for i in range(BEFORE, n + BEFORE):
        h[i] = height[source] - top
        s[i] = slope[source] / n
        source += stride
        source = source if source < height.size else source - height.size
    _close(h)
    if not resolved:
        for i in range(BEFORE, n + BEFORE):
            s[i] = 0.5 * (h[i + 1] - h[i - 1])
    _close(s)
    blocks = np.empty((n // BLOCK, KNOWN))
    for j in range(blocks.shape[0]):
        last = BEFORE + (j + 1) * BLOCK
        peak, lowest, steepest, heights, squares = -np.inf, h[last], s[last], 0.0, 0.0
        b_before = bend(h, s, last - BLOCK)
        for i in range(last - BLOCK, last):
            fall = s[i] - s[i + 1]
            above = max(h[i], h[i + 1]) + 0.15 * max(fall, 0.0)
            peak, lowest, steepest = max(peak, above), min(lowest, h[i]), min(steepest, s[i])
            heights += 0.5 * (h[i] + h[i + 1]) + fall / 12
            b = bend(h, s, i + 1)
            squares += 0.5 * (s[i] * s[i] + s[i + 1] * s[i + 1]) + (s[i] * b_before - s[i + 1] * b) / 6
            b_before = b
        blocks[j, PEAK], blocks[j, LOWEST], blocks[j, STEEPEST] = peak, lowest, steepest
        blocks[j, HEIGHTS], blocks[j, SQUARES] = heights, squares
    return Nodes(h, s, blocks, top)


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
    """Return how the nodes of a finer grid follow from three nodes to either side, shape (2, refinement, 12).

    Rows are as in `_hermite`, for every node in a cell.
    """
    return np.stack([_hermite(np.arange(-2.0, 4.0), step / refinement) for step in range(refinement)], axis=1)


def halved(height: FloatArray, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return heights and slopes of a periodic line on cells of half the width.

    The polynomial of degree 15 through four nodes to either side: with two nodes a Nyquist point the error is below
    1e-7 of the shortest wave.

    Parameters
    ----------
    height, slope : array, shape (n,)
        Heights and derivatives by position over the length of the line.
    """
    n, finer = height.size, np.empty((2, 2 * height.size))
    table = _middle().copy()
    table[:, 2 * WING :] /= n
    table[1] *= n
    _halve(np.pad(height, WING, mode="wrap"), np.pad(slope, WING, mode="wrap"), table, finer[0], finer[1])
    return finer[0], finer[1]


@lru_cache
def _middle() -> FloatArray:
    """Return the middle of a cell from the nodes to either side, as in `_hermite`."""
    return _hermite(np.arange(1.0 - WING, 1.0 + WING), 0.5)


@njit(nogil=True, cache=True)
def _halve(h: FloatArray, s: FloatArray, table: FloatArray, height: FloatArray, slope: FloatArray) -> None:
    """Write every node and, from the sums and differences of those around it, the middle of the cell after it."""
    for i in range(height.size // 2):
        value, rate = 0.0, 0.0
        for k in range(WING):
            before, after = i + 1 + k, i + 2 * WING - k
            value += table[0, k] * (h[before] + h[after]) + table[0, 2 * WING + k] * (s[before] - s[after])
            rate += table[1, k] * (h[before] - h[after]) + table[1, 2 * WING + k] * (s[before] + s[after])
        height[2 * i], slope[2 * i] = h[i + WING], s[i + WING]
        height[2 * i + 1], slope[2 * i + 1] = value, rate


@njit(nogil=True, cache=True)
def refine(line: Nodes, first: int, cells: int, weights: FloatArray, height: FloatArray, slope: FloatArray) -> None:
    """Write heights and slopes of the finer grid over cells of a line, from the node before to the second one after."""
    refinement = weights.shape[1]
    h, s = line.height, line.slope
    for place in range(-1, cells * refinement + 2):
        cell = place // refinement
        step, i = place - cell * refinement, first + cell - 2
        value, rate = 0.0, 0.0
        for k in range(6):
            value += weights[0, step, k] * h[i + k] + weights[0, step, 6 + k] * s[i + k]
            rate += weights[1, step, k] * h[i + k] + weights[1, step, 6 + k] * s[i + k]
        height[place + 1], slope[place + 1] = value, rate / refinement


def summit(line: Nodes) -> float:
    """Return how high over the first node the line reaches in the cell before it."""
    table = weights(SUMMIT)
    height, slope = np.empty((2, SUMMIT + 3))
    refine(line, BEFORE - 1, 1, table, height, slope)
    return max(float(np.max(height[1:-1])), 0.0)
