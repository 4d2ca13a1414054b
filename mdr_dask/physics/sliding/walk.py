"""Cases of a Kelvin foundation that go along a periodic line together, from node to node.

In a cell the line is a cubic through heights and slopes at its ends, w = d + h + s x + ..., and De its Deborah number
v tau in cells. An element leaves where the force w + De w' falls to 0 and touches where the gap closes. A cell that is
partly in contact adds positive terms only, so that nothing cancels in slow sliding: of the piece in contact the
integrals of w and of De w'^2, of a flight those of u and u^2 / De. Cells wholly in contact are integrated exactly, so
that full contact is exact on any grid. Everything is measured in cells, as in `kelvin`. The inner loops run over
cases, so that they are vector instructions; each case does the same arithmetic whatever runs beside it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.sliding.nodes import (
    ABOVE,
    AFTER,
    BEFORE,
    BLOCK,
    HEIGHTS,
    LOWEST,
    PEAK,
    SQUARES,
    STEEPEST,
    Nodes,
    end_term,
    refine,
)

LANES = 64  # cases that go along the line together
VECTOR = 8
SMALL, LARGE = 1e-300, 1e12
CLOSED = 1e-9  # relative difference of the displacement before and after a turn

# What a sweep holds of a case, in this order: its state, sums, and what does not change
U, FADE, CONTACT, LOAD, RATE, LOSS, LENGTH, STRETCH = range(8)
DEPTH, DEBORAH, DECAY, INVERSE, THROUGH, BEGAN = range(8, 14)
CALM, LEAVES, CREST, GAP, HELD, LEFT, TOUCHES, WAITED = range(14, 22)
ROWS = 22
STATES, MOVED = DEPTH, CALM

_inlined = njit(nogil=True, cache=True, error_model="numpy", forceinline=True, fastmath={"contract", "nsz"})


@njit(nogil=True, cache=True, inline="always")
def _fading(time: float) -> float:
    """Return exp(-time), to 1e-4 up to 1 and small where it is small."""
    y = time * 0.125
    y = y if y < 1.0 else 1.0
    e = 1.0 + y * (-1.0 + y * (0.5 - y * (1 / 6)))
    e *= e
    e *= e
    return e * e


class Cell(NamedTuple):
    """The line in a cell: h + s x + a x^2 + b x^3, its end, mean height, integral of the slope squared, and summit."""

    h: float
    s: float
    a: float
    b: float
    h_end: float
    s_end: float
    mean: float
    square: float
    summit: float
    h_summit: float
    steepest: float


@_inlined
def _pass_cell(cell: Cell, above: float, workspace: FloatArray, count: int) -> tuple[int, int]:
    """Take cases over a cell that are in contact or in flight all along; return how many may leave, and may touch."""
    leaving, touching = 0, 0
    for k in range(count):
        d, r, decay = workspace[DEPTH * LANES + k], workspace[DEBORAH * LANES + k], workspace[DECAY * LANES + k]
        u, fade, was = workspace[U * LANES + k], workspace[FADE * LANES + k], workspace[CONTACT * LANES + k] > 0
        w, kept, lost = d + cell.h_end, decay * u, 1 - decay
        force = w + r * cell.s_end
        stays = was & (force > 0)
        flies = (not was) & (d + above <= kept)
        calm = stays | flies
        leaving += 0 if calm | (force > 0) else 1
        touching += 0 if calm | was else 1
        load = r * lost * u if flies else 0.0
        loss = 0.5 * lost * (1 + decay) * u * u if flies else 0.0
        rate = r * lost * fade if flies else 0.0
        workspace[LOAD * LANES + k] += cell.mean + d if stays else load
        workspace[LOSS * LANES + k] += r * cell.square if stays else loss
        workspace[RATE * LANES + k] += 1.0 if stays else rate
        workspace[LENGTH * LANES + k] += 1.0 if stays else 0.0
        workspace[STRETCH * LANES + k] += cell.square if stays else 0.0
        then = kept if flies else u
        workspace[U * LANES + k] = w if stays else then
        faded = decay * fade if flies else fade
        workspace[FADE * LANES + k] = 1.0 if stays else faded
        workspace[CALM * LANES + k], workspace[LEFT * LANES + k] = 1.0 if calm else 0.0, 0.0
    return leaving, touching


@_inlined
def _leave(cell: Cell, workspace: FloatArray, count: int) -> None:
    """Write where cases leave whose force falls to 0 in a cell, or would if they touched before."""
    s2, s3 = 2 * cell.a, 3 * cell.b
    for k in range(count):
        d, r, inverse = workspace[DEPTH * LANES + k], workspace[DEBORAH * LANES + k], workspace[INVERSE * LANES + k]
        u, was = workspace[U * LANES + k], workspace[CONTACT * LANES + k] > 0
        w0 = d + cell.h
        # before the summit of the cell it falls only where it is positive from the first node on
        f0, f1 = w0 + r * cell.s, d + cell.h_end + r * cell.s_end
        begins = 0.0 if f0 > 0 else cell.summit
        f0 = f0 if f0 > 0 else d + cell.h_summit
        peaked, fall = (f0 > 0) & (f1 <= 0), (1 - begins) / (f0 - f1)
        x = begins + f0 * fall if peaked else 1.0
        w, s = w0 + x * (cell.s + x * (cell.a + x * cell.b)), cell.s + x * (s2 + x * s3)
        tangent = s + r * (s2 + 2 * s3 * x)
        tangent = -1 / tangent if tangent * fall < -0.5 else fall
        x += (w + r * s) * tangent if peaked else 0.0
        x = x if x > begins else begins
        x = x if x < 1 else 1.0
        peak = w0 + x * (cell.s + x * (cell.a + x * cell.b))
        peak = peak if peak < r * cell.steepest else r * cell.steepest
        peak = peak if peak > 0 else 0.0
        gap = u * _fading(x * inverse) - peak
        workspace[LEAVES * LANES + k], workspace[CREST * LANES + k], workspace[GAP * LANES + k] = x, peak, gap
        workspace[HELD * LANES + k] = _fading((1 - x) * inverse)
        workspace[LEFT * LANES + k] = 1.0 if peaked & (was | (gap < 0)) else 0.0


@_inlined
def _touch(cell: Cell, workspace: FloatArray, count: int) -> None:
    """Write where cases in flight touch in a cell: a parabola through the gap at its ends, and one step of Newton."""
    for k in range(count):
        d, decay, inverse = workspace[DEPTH * LANES + k], workspace[DECAY * LANES + k], workspace[INVERSE * LANES + k]
        u, left = workspace[U * LANES + k], workspace[LEFT * LANES + k] > 0
        w0 = d + cell.h
        last = workspace[LEAVES * LANES + k] if left else 1.0
        gap, closing = u - w0, cell.s + u * inverse
        closed = workspace[GAP * LANES + k] if left else decay * u - (d + cell.h_end)
        bow = (gap - closing * last - closed) / (last * last + SMALL)
        steep = math.sqrt(abs(closing * closing + 4 * gap * bow)) + SMALL
        root = 2 * gap / (closing + steep)
        root = root if root > 0 else 0.0
        root = root if root < last else last
        w, waited = w0 + root * (cell.s + root * (cell.a + root * cell.b)), _fading(root * inverse)
        step = (u * waited - w) / steep
        low, high = -0.5 * root, 0.5 * (last - root)
        step = step if step > low else low
        step = step if step < high else high
        workspace[TOUCHES * LANES + k] = root + step
        workspace[WAITED * LANES + k] = waited * max(1 - step * inverse, 0.0)


@_inlined
def _add(cell: Cell, workspace: FloatArray, count: int) -> None:
    """Add what a cell gives to the cases that touch or leave in it."""
    s2, s3 = 2 * cell.a, 3 * cell.b
    for k in range(count):
        d, r, decay = workspace[DEPTH * LANES + k], workspace[DEBORAH * LANES + k], workspace[DECAY * LANES + k]
        u, fade, was = workspace[U * LANES + k], workspace[FADE * LANES + k], workspace[CONTACT * LANES + k] > 0
        calm = workspace[CALM * LANES + k] > 0
        w0, w1, kept = d + cell.h, d + cell.h_end, decay * u
        now = (w1 + r * cell.s_end > 0) & (was | (w1 >= kept))
        left = (workspace[LEFT * LANES + k] > 0) & (not now)
        touching = (not was) & (now | left)
        contact = was | touching
        start = workspace[TOUCHES * LANES + k] if touching else 0.0
        leaves = workspace[LEAVES * LANES + k] if left else 0.0
        stop = 1.0 if now else leaves
        part, x = stop - start, 0.5 * (start + stop)
        w_start = w0 + start * (cell.s + start * (cell.a + start * cell.b))
        w_middle = w0 + x * (cell.s + x * (cell.a + x * cell.b))
        w_stop = w1 if now else workspace[CREST * LANES + k]
        s_start, s_middle = cell.s + start * (s2 + start * s3), cell.s + x * (s2 + x * s3)
        s_stop = cell.s + stop * (s2 + stop * s3)
        force = part / 6 * (w_start + 4 * w_middle + w_stop)
        square = part / 6 * (s_start * s_start + 4 * s_middle * s_middle + s_stop * s_stop)
        # in flight: what it forgets before it touches, and after it left
        keeps = workspace[WAITED * LANES + k] if touching else 1.0
        keeps = keeps if contact else decay
        held = workspace[HELD * LANES + k] if left else 1.0
        forgets, loses = 1 - keeps, 1 - held
        load = force + r * (u * forgets + w_stop * loses)
        loss = r * square + 0.5 * (u * u * forgets * (1 + keeps) + w_stop * w_stop * loses * (1 + held))
        rate = part + r * (fade * forgets + loses)
        workspace[LOAD * LANES + k] += 0.0 if calm else load
        workspace[LOSS * LANES + k] += 0.0 if calm else loss
        workspace[RATE * LANES + k] += 0.0 if calm else rate
        workspace[LENGTH * LANES + k] += 0.0 if calm else part
        workspace[STRETCH * LANES + k] += 0.0 if calm else square
        then, faded = w_stop * held if contact else kept, held if contact else decay * fade
        then, faded = w1 if now else then, 1.0 if now else faded
        workspace[U * LANES + k] = u if calm else then
        workspace[FADE * LANES + k] = fade if calm else faded
        landed = 1.0 if now else 0.0
        workspace[CONTACT * LANES + k] = workspace[CONTACT * LANES + k] if calm else landed


@njit(nogil=True, cache=True, error_model="numpy")
def _walk(height: FloatArray, slope: FloatArray, first: int, end: int, workspace: FloatArray, count: int) -> None:
    """Take cases from node to node; `workspace` holds row after row of `LANES`."""
    term = end_term(height, slope, first)
    for i in range(first, end):
        h0, h1, s0, s1 = height[i], height[i + 1], slope[i], slope[i + 1]
        rise, fall = h1 - h0, s0 - s1
        mean = 0.5 * (h0 + h1) + fall / 12
        next_term = end_term(height, slope, i + 1)
        square, term = 0.5 * (s0 * s0 + s1 * s1) + term - next_term, next_term
        a, b = 3 * rise - 2 * s0 - s1, s0 + s1 - 2 * rise
        summit = s0 / fall if (s0 > 0) & (s1 < 0) else 0.0
        h_summit = h0 + summit * (s0 + summit * (a + summit * b))
        steepest = max(-s0, -s1, 0.25 * (s0 + s1) - 1.5 * rise, 0.0)
        cell = Cell(h0, s0, a, b, h1, s1, mean, square, summit, h_summit, steepest)
        leaving, touching = _pass_cell(cell, max(h0, h1) + ABOVE * (max(s0, 0.0) + max(-s1, 0.0)), workspace, count)
        if leaving + touching == 0:
            continue
        if leaving > 0:
            _leave(cell, workspace, count)
        if touching > 0:
            _touch(cell, workspace, count)
        _add(cell, workspace, count)


@njit(nogil=True, cache=True)
def _pass_block(
    block: FloatArray, last: float, refinement: int, workspace: FloatArray, count: int, queue: NDArray[np.int64]
) -> int:
    """Take cases over a block by closed sums; queue those that touch or leave in it, and return their number."""
    peak, lowest, steepest = block[PEAK], block[LOWEST], block[STEEPEST]
    steepest /= refinement
    cells, heights, squares = BLOCK * refinement, block[HEIGHTS] * refinement, block[SQUARES] / refinement
    for k in range(count):
        d, r, was = workspace[DEPTH * LANES + k], workspace[DEBORAH * LANES + k], workspace[CONTACT * LANES + k] > 0
        u, fade, through = workspace[U * LANES + k], workspace[FADE * LANES + k], workspace[THROUGH * LANES + k]
        kept, lost = u * through, 1 - through
        memory = r * lost
        flies = (not was) & (peak + d <= kept)
        stays = was & (lowest + d + r * steepest > 0)
        load, rate, loss = workspace[LOAD * LANES + k], workspace[RATE * LANES + k], workspace[LOSS * LANES + k]
        length, stretch = workspace[LENGTH * LANES + k], workspace[STRETCH * LANES + k]
        flown_load = load + u * memory if flies else load
        flown_rate = rate + fade * memory if flies else rate
        flown_loss = loss + 0.5 * u * u * lost * (1 + through) if flies else loss
        kept = kept if kept > SMALL else 0.0
        flown, faded = kept if flies else u, fade * through if flies else fade
        workspace[LOAD * LANES + k] = load + (heights + cells * d) if stays else flown_load
        workspace[RATE * LANES + k] = rate + cells if stays else flown_rate
        workspace[LOSS * LANES + k] = loss + r * squares if stays else flown_loss
        workspace[LENGTH * LANES + k] = length + cells if stays else length
        workspace[STRETCH * LANES + k] = stretch + squares if stays else stretch
        workspace[U * LANES + k] = last + d if stays else flown
        workspace[FADE * LANES + k] = 1.0 if stays else faded
        workspace[CALM * LANES + k] = 1.0 if stays | flies else 0.0
    queued = 0
    for k in range(count):
        queue[queued] = k
        queued += 0 if workspace[CALM * LANES + k] > 0 else 1
    return queued


@njit(nogil=True, cache=True)
def _move(source: FloatArray, target: FloatArray, queue: NDArray[np.int64], queued: int) -> None:
    """Bring the cases of a queue together."""
    for row in range(MOVED):
        for q in range(queued):
            target[row * LANES + q] = source[row * LANES + queue[q]]


@njit(nogil=True, cache=True)
def _return(source: FloatArray, target: FloatArray, queue: NDArray[np.int64], queued: int) -> None:
    """Bring the states of the cases of a queue back."""
    for row in range(STATES):
        for q in range(queued):
            target[row * LANES + queue[q]] = source[row * LANES + q]


@njit(nogil=True, cache=True, error_model="numpy")
def sweep(
    line: Nodes,
    weights: FloatArray,
    local: FloatArray,
    workspace: FloatArray,
    near: FloatArray,
    queue: NDArray[np.int64],
    count: int,
) -> None:
    """Follow one element of every case along the line, from its summit back to it.

    Blocks that a case touches or leaves in are gone along on the finer grid that the weights make, in `local`.
    """
    refinement, blocks = weights.shape[1], line.blocks
    n = line.height.size - BEFORE - AFTER
    full = -(-count // VECTOR) * VECTOR
    # the summit, where every case touches, lies in the cell before the first one
    refine(line, BEFORE - 1, 1, weights, local[0], local[1])
    for k in range(count):
        w = workspace[DEPTH * LANES + k] + line.height[BEFORE - 1]
        force = w + workspace[DEBORAH * LANES + k] / refinement * line.slope[BEFORE - 1]
        workspace[U * LANES + k], workspace[FADE * LANES + k] = max(w, 0.0), 1.0
        workspace[CONTACT * LANES + k] = 1.0 if w > 0 and force > 0 else 0.0
    _walk(local[0], local[1], 1, 1 + refinement, workspace, full)
    workspace[BEGAN * LANES : MOVED * LANES] = workspace[U * LANES : FADE * LANES]
    workspace[LOAD * LANES : STATES * LANES] = 0.0
    for j in range(blocks.shape[0]):
        first, end = BEFORE + j * BLOCK, BEFORE + (j + 1) * BLOCK
        queued = _pass_block(blocks[j], line.height[end], refinement, workspace, count, queue)
        if queued == 0:
            continue
        _move(workspace, near, queue, queued)
        lanes = -(-queued // VECTOR) * VECTOR
        if refinement == 1:
            _walk(line.height, line.slope, first, end, near, lanes)
        else:
            refine(line, first, BLOCK, weights, local[0], local[1])
            _walk(local[0], local[1], 1, 1 + BLOCK * refinement, near, lanes)
        _return(near, workspace, queue, queued)
    first = blocks.shape[0] * BLOCK
    refine(line, BEFORE + first, n - first, weights, local[0], local[1])
    _walk(local[0], local[1], 1, 1 + (n - first) * refinement, workspace, full)


@njit(nogil=True, cache=True)
def load_case(workspace: FloatArray, k: int, depth: float, deborah: float, cells: int) -> None:
    """Write what does not change of a case on a grid."""
    workspace[DEPTH * LANES + k], workspace[DEBORAH * LANES + k] = depth, deborah
    workspace[INVERSE * LANES + k] = min(1 / deborah, LARGE)
    workspace[DECAY * LANES + k], workspace[THROUGH * LANES + k] = math.exp(-1 / deborah), math.exp(-cells / deborah)


@njit(nogil=True, cache=True, inline="always")
def closed(workspace: FloatArray, k: int) -> bool:
    """Return whether a case ended its turn as it began it: not so where the first cell is not touched."""
    same: bool = abs(workspace[U * LANES + k] - workspace[BEGAN * LANES + k]) <= CLOSED * workspace[U * LANES + k]
    return same
