"""Cases of a Kelvin foundation that go along a periodic line together, from node to node.

In a cell the line is a cubic through heights and slopes at its ends, w = d + h + s x + ..., and De its Deborah number
v tau in cells. An element leaves where the force w + De w' falls to 0 and touches where the gap closes. A cell that is
partly in contact adds positive terms only, so that nothing cancels in slow sliding: of the piece in contact the
integrals of w and of De w'^2, of a flight those of u and u^2 / De. Cells wholly in contact are integrated exactly, so
that full contact is exact on any grid. Everything is measured in cells, as in `kelvin`. The cases of a line pass a tile
of it together: by closed sums, in vector instructions over the cases, or one after the other from event to event, past
the cells that they touch all along or cannot reach. Each does the same arithmetic whatever runs beside it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.sliding.nodes import (
    AFTER,
    BEFORE,
    BLOCK,
    HEIGHT,
    HEIGHTS,
    LOWEST,
    MEAN,
    PEAK,
    SLOPE,
    SQUARE,
    SQUARES,
    STEEPEST,
    TOP,
    Nodes,
    fill,
)

LANES = 64  # cases that go along the line together
SMALL, LARGE = 1e-300, 1e12
CLOSED = 1e-9  # relative difference of the displacement before and after a turn

ROWS = 15
# Where what a sweep holds of its cases begins, in this order: their state, sums, and what does not change
U, FADE, CONTACT, LOAD, RATE, LOSS, LENGTH, STRETCH = range(0, 8 * LANES, LANES)
DEPTH, DEBORAH, DECAY, INVERSE, THROUGH, BEGAN, CALM = range(8 * LANES, ROWS * LANES, LANES)


@jit_inline
def _fading(time: float) -> float:
    """Return exp(-time), to 1e-4 up to 1 and small where it is small."""
    y = time * 0.125
    y = y if y < 1.0 else 1.0
    e = 1.0 + y * (-1.0 + y * (0.5 - y * (1 / 6)))
    e *= e
    e *= e
    return e * e


class Cell(NamedTuple):
    """The penetration w = w0 + s0 x + a x^2 + b x^3 of a case in a cell, and its value and slope at the end."""

    w0: float
    s0: float
    a: float
    b: float
    w1: float
    s1: float


@jit_inline
def _cell(tile: FloatArray, i: int, depth: float) -> Cell:
    """Return a case in cell i of a tile."""
    h0, h1, s0, s1 = tile[HEIGHT, i + 1], tile[HEIGHT, i + 2], tile[SLOPE, i + 1], tile[SLOPE, i + 2]
    rise = h1 - h0
    return Cell(depth + h0, s0, 3 * rise - 2 * s0 - s1, s0 + s1 - 2 * rise, depth + h1, s1)


@jit_inline
def _at(cell: Cell, x: float) -> float:
    """Return w at a place."""
    return cell.w0 + x * (cell.s0 + x * (cell.a + x * cell.b))


@jit_inline
def _tilt(cell: Cell, x: float) -> float:
    """Return w' at a place."""
    return cell.s0 + x * (2 * cell.a + x * 3 * cell.b)


@jit_inline
def _leaves(
    cell: Cell, r: float, begins: float, force: float, force_end: float, inverse: float
) -> tuple[float, float, float]:
    """Return where the force falls to 0 in a cell, w there, and the share of it that is left at the end of the cell.

    A secant from where it begins to fall, and one step of Newton.
    """
    fall = (1 - begins) / (force - force_end)
    x = begins + force * fall
    w, s = _at(cell, x), _tilt(cell, x)
    tangent = s + r * (2 * cell.a + 6 * cell.b * x)
    tangent = -1 / tangent if tangent * fall < -0.5 else fall
    x += (w + r * s) * tangent
    x = x if x > begins else begins
    x = x if x < 1 else 1.0
    steepest = max(max(-cell.s0, -cell.s1), 0.25 * (cell.s0 + cell.s1) - 1.5 * (cell.w1 - cell.w0))
    crest = max(min(_at(cell, x), r * max(steepest, 0.0)), 0.0)
    return x, crest, _fading((1 - x) * inverse)


@jit_inline
def _touches(cell: Cell, u: float, inverse: float, last: float, gap_last: float) -> tuple[float, float]:
    """Return where the gap closes before a place where it is known to be, and what is left of u there.

    A parabola through the gap at both ends, and one step of Newton.
    """
    gap, closing = u - cell.w0, cell.s0 + u * inverse
    bow = (gap - closing * last - gap_last) / (last * last + SMALL)
    steep = math.sqrt(abs(closing * closing + 4 * gap * bow)) + SMALL
    root = 2 * gap / (closing + steep)
    root = root if root > 0 else 0.0
    root = root if root < last else last
    w, waited = _at(cell, root), _fading(root * inverse)
    step = (u * waited - w) / steep
    low, high = -0.5 * root, 0.5 * (last - root)
    step = step if step > low else low
    step = step if step < high else high
    return root + step, waited * max(1 - step * inverse, 0.0)


@jit_inline
def _meets(cell: Cell, r: float, u: float, kept: float, inverse: float) -> tuple[bool, float, float, float, float]:
    """Return whether an element in flight meets the line in a cell, and where that piece of contact ends.

    With w there, the share of it that is left at the end of the cell, and the gap if there had been no contact.
    """
    force, gap = cell.w1 + r * cell.s1, kept - cell.w1
    if force > 0:
        return gap <= 0, 1.0, cell.w1, 1.0, gap
    begins, falls = 0.0, cell.w0 + r * cell.s0
    if falls <= 0 and cell.s0 > 0 and cell.s1 < 0:
        # before the summit of the cell
        begins = cell.s0 / (cell.s0 - cell.s1)
        falls = _at(cell, begins)
    if falls <= 0:
        return False, 1.0, cell.w1, 1.0, gap
    stop, crest, held = _leaves(cell, r, begins, falls, force, inverse)
    gap = u * _fading(stop * inverse) - crest
    return gap < 0, stop, crest, held, gap


@jit
def _walk(tile: FloatArray, cells: int, workspace: FloatArray, k: int) -> None:
    """Take a case over the cells of a tile."""
    d, r = workspace[DEPTH + k], workspace[DEBORAH + k]
    decay, inverse = workspace[DECAY + k], workspace[INVERSE + k]
    u, fade = workspace[U + k], workspace[FADE + k]
    contact = workspace[CONTACT + k] > 0
    load, rate, loss, length, stretch = 0.0, 0.0, 0.0, 0.0, 0.0
    flown, flown_rate, flown_loss = 0.0, 0.0, 0.0
    i = 0
    while i < cells:
        if contact:
            begun = i
            while i < cells and d + tile[HEIGHT, i + 2] + r * tile[SLOPE, i + 2] > 0:
                load += tile[MEAN, i] + d
                stretch += tile[SQUARE, i]
                i += 1
            length += i - begun
            rate += i - begun
            if i == cells:
                u, fade = (d + tile[HEIGHT, i + 1], 1.0) if i > begun else (u, fade)
                break
            cell = _cell(tile, i, d)
            stop, w_stop, held = _leaves(cell, r, 0.0, cell.w0 + r * cell.s0, cell.w1 + r * cell.s1, inverse)
            start, keeps = 0.0, 1.0
            contact = False
        else:
            met = False
            while i < cells:
                if tile[TOP, i] + d > decay * u:
                    cell = _cell(tile, i, d)
                    met, stop, w_stop, held, gap = _meets(cell, r, u, decay * u, inverse)
                    if met:
                        break
                flown += u
                flown_rate += fade
                flown_loss += u * u
                u *= decay
                fade *= decay
                i += 1
            if not met:
                break
            start, keeps = _touches(cell, u, inverse, stop, gap)
            contact = cell.w1 + r * cell.s1 > 0
        i += 1
        part, middle = stop - start, 0.5 * (start + stop)
        s_start, s_middle, s_stop = _tilt(cell, start), _tilt(cell, middle), _tilt(cell, stop)
        forgets, loses = 1 - keeps, 1 - held
        load += part / 6 * (_at(cell, start) + 4 * _at(cell, middle) + w_stop) + r * (u * forgets + w_stop * loses)
        rate += part + r * (fade * forgets + loses)
        length += part
        stretch += part / 6 * (s_start * s_start + 4 * s_middle * s_middle + s_stop * s_stop)
        loss += 0.5 * (u * u * forgets * (1 + keeps) + w_stop * w_stop * loses * (1 + held))
        u, fade = w_stop * held, held
    lost = 1 - decay
    workspace[U + k], workspace[FADE + k] = u, fade
    workspace[CONTACT + k] = 1.0 if contact else 0.0
    workspace[LOAD + k] += load + r * lost * flown
    workspace[RATE + k] += rate + r * lost * flown_rate
    workspace[LOSS + k] += loss + r * stretch + 0.5 * lost * (1 + decay) * flown_loss
    workspace[LENGTH + k] += length
    workspace[STRETCH + k] += stretch


@jit
def _pass_block(
    block: FloatArray, last: float, refinement: int, workspace: FloatArray, count: int, queue: NDArray[np.int64]
) -> int:
    """Take cases over a block by closed sums; queue those that touch or leave in it, and return their number."""
    peak, lowest, steepest = block[PEAK], block[LOWEST], block[STEEPEST]
    steepest /= refinement
    cells, heights, squares = BLOCK * refinement, block[HEIGHTS] * refinement, block[SQUARES] / refinement
    for k in range(count):
        d, r, was = workspace[DEPTH + k], workspace[DEBORAH + k], workspace[CONTACT + k] > 0
        u, fade, through = workspace[U + k], workspace[FADE + k], workspace[THROUGH + k]
        kept, lost = u * through, 1 - through
        memory = r * lost
        flies = (not was) & (peak + d <= kept)
        stays = was & (lowest + d + r * steepest > 0)
        load, rate, loss = workspace[LOAD + k], workspace[RATE + k], workspace[LOSS + k]
        length, stretch = workspace[LENGTH + k], workspace[STRETCH + k]
        flown_load = load + u * memory if flies else load
        flown_rate = rate + fade * memory if flies else rate
        flown_loss = loss + 0.5 * u * u * lost * (1 + through) if flies else loss
        kept = kept if kept > SMALL else 0.0
        flown, faded = kept if flies else u, fade * through if flies else fade
        workspace[LOAD + k] = load + (heights + cells * d) if stays else flown_load
        workspace[RATE + k] = rate + cells if stays else flown_rate
        workspace[LOSS + k] = loss + r * squares if stays else flown_loss
        workspace[LENGTH + k] = length + cells if stays else length
        workspace[STRETCH + k] = stretch + squares if stays else stretch
        workspace[U + k] = last + d if stays else flown
        workspace[FADE + k] = 1.0 if stays else faded
        workspace[CALM + k] = 1.0 if stays | flies else 0.0
    queued = 0
    for k in range(count):
        queue[queued] = k
        queued += 0 if workspace[CALM + k] > 0 else 1
    return queued


@jit_inline
def sweep(
    line: Nodes,
    weights: FloatArray,
    tile: FloatArray,
    workspace: FloatArray,
    queue: NDArray[np.int64],
    count: int,
) -> None:
    """Follow one element of every case along the line, from its summit back to it.

    Blocks that a case touches or leaves in are gone along on the finer grid that the weights make.
    """
    refinement, blocks = weights.shape[1], line.blocks
    n = line.height.size - BEFORE - AFTER
    for k in range(count):
        w = workspace[DEPTH + k] + line.height[BEFORE - 1]
        force = w + workspace[DEBORAH + k] / refinement * line.slope[BEFORE - 1]
        workspace[U + k], workspace[FADE + k] = max(w, 0.0), 1.0
        workspace[CONTACT + k] = 1.0 if w > 0 and force > 0 else 0.0
    # the summit, where every case touches, lies in the cell before the first one; then blocks, and what is left
    first, cells = BEFORE - 1, 1
    for j in range(blocks.shape[0] + 2):
        if 0 < j <= blocks.shape[0]:
            queued = _pass_block(blocks[j - 1], line.height[first + cells], refinement, workspace, count, queue)
        else:
            queued = count
            for k in range(count):
                queue[k] = k
        if queued > 0:
            walked = fill(line, first, cells, weights, tile)
            for q in range(queued):
                _walk(tile, walked, workspace, queue[q])
        if j == 0:
            for k in range(count):
                workspace[BEGAN + k] = workspace[U + k]
            for k in range(LOAD, DEPTH):
                workspace[k] = 0.0
        first += cells
        rest = BEFORE + n - first
        cells = BLOCK if rest > BLOCK else rest


@jit
def load_case(workspace: FloatArray, k: int, depth: float, deborah: float, cells: int) -> None:
    """Write what does not change of a case on a grid."""
    workspace[DEPTH + k], workspace[DEBORAH + k] = depth, deborah
    workspace[INVERSE + k] = min(1 / deborah, LARGE)
    workspace[DECAY + k], workspace[THROUGH + k] = math.exp(-1 / deborah), math.exp(-cells / deborah)
