"""Cases of a Kelvin foundation that go along a periodic line together, from node to node.

In a cell the force of contact, f = w + reach w', and the slope run straight between the nodes; it leaves where f falls
to 0, which raises exp(s / reach) w to its peak, and touches where a parabola meets what is free. With
integral(u + reach u') = integral(f) and integral(reach u'^2) = integral(f w') - change of u^2 / 2 a cell that is
partly in contact adds what the force alone gives; cells wholly in contact are integrated exactly, so that full contact
is exact on any grid. Everything is measured in cells, as in `kelvin`. The inner loops run over
cases, so that they are vector instructions; each case does the same arithmetic whatever runs beside it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.sliding.nodes import (
    AFTER,
    BEFORE,
    BLOCK,
    HEIGHTS,
    LOWEST,
    PEAK,
    SQUARES,
    STEEPEST,
    Nodes,
    refine,
    slope_square,
)

LANES = 64  # cases that go along the line together
VECTOR = 8
SMALL, LARGE = 1e-300, 1e12
CLOSED = 1e-9  # relative difference of the displacement before and after a turn

# What a sweep holds of a case, in this order: its state, sums, and what does not change
U, FADE, CONTACT, LOAD, RATE, LOSS, LENGTH, STRETCH = range(8)
DEPTH, REACH, DECAY, INVERSE, THROUGH, BEGAN = range(8, 14)
ROOM = 14
STATES = DEPTH


@njit(nogil=True, cache=True, error_model="numpy")
def _walk(height: FloatArray, slope: FloatArray, first: int, end: int, room: FloatArray, count: int) -> None:
    """Take cases from node to node; `room` holds row after row of `LANES`."""
    for i in range(first, end):
        h0, h1, s0, s1 = height[i], height[i + 1], slope[i], slope[i + 1]
        bend = s1 - s0
        mean, square = 0.5 * (h0 + h1) - bend / 12, slope_square(slope, i)
        for k in range(count):
            d, r, decay, inverse = (
                room[DEPTH * LANES + k],
                room[REACH * LANES + k],
                room[DECAY * LANES + k],
                room[INVERSE * LANES + k],
            )
            u, fade, was = room[U * LANES + k], room[FADE * LANES + k], room[CONTACT * LANES + k] > 0
            w0, w1 = d + h0, d + h1
            f0, f1 = w0 + r * s0, w1 + r * s1
            # it leaves where the force falls to 0
            falls = f1 < 0
            peaked = (f0 > 0) & falls
            leaves = f0 / (f0 - f1)
            lead = w0 + (0.5 * leaves * f0 * inverse if peaked else 0.0)
            higher = lead - u
            top = lead if higher > 0 else u
            free = decay * top
            now = (w1 >= free) & (f1 > 0)
            whole, lifted = was & now, (higher > 0) & (not was)
            then = w1 if w1 > free else free
            # it touches where the gap, a parabola, does, with the slope `steep`
            below, q = u - w0, s0 + u * inverse
            curve = 0.5 * bend if falls else w1 - decay * u + below - q
            steep = math.sqrt(abs(q * q + 4 * below * curve))
            touches = 2 * below / (q + steep + SMALL)
            touches = touches if touches > 0 else 0.0
            touches = touches if touches < 1 else 1.0
            start = touches if now & (not was) else 0.0
            stays = leaves if peaked else 1.0
            stays = stays if was & (f0 > 0) else 0.0
            stop = 1.0 if now else stays
            lost = 1 - decay
            s_start, s_stop = s0 + start * bend, s0 + stop * bend
            f_start = f0 if was else u * (1 - start * lost) + r * s_start
            f_stop = f1 if now else 0.0
            part = stop - start
            force = 0.5 * part * (f_start + f_stop)
            work = part * (f_start * (2 * s_start + s_stop) + f_stop * (s_start + 2 * s_stop)) / 6
            load = force + r * (u - then)
            loss = work + 0.5 * (u - then) * (u + then)
            load = r * lost * (u + 0.5 * higher) if lifted else load
            loss = 0.5 * lost * (1 + decay) * u * u + r * higher * steep * (2 / 3) if lifted else loss
            room[LOAD * LANES + k] += mean + d if whole else load
            room[LOSS * LANES + k] += r * square if whole else loss
            remembered = r * lost * ((1 - stop) if was else start * fade)
            remembered = remembered if was | now else r * lost * fade
            room[RATE * LANES + k] += 1.0 if whole else part + remembered
            room[LENGTH * LANES + k] += part
            squared = part * (s_start * s_start + s_start * s_stop + s_stop * s_stop) / 3
            room[STRETCH * LANES + k] += square if whole else squared
            after = decay if was | lifted else decay * fade
            room[FADE * LANES + k] = 1.0 if now else after
            room[U * LANES + k] = then
            room[CONTACT * LANES + k] = 1.0 if now else 0.0


@njit(nogil=True, cache=True)
def _pass_block(
    block: FloatArray, last: float, refinement: int, room: FloatArray, count: int, queue: NDArray[np.int64]
) -> int:
    """Take cases over a block by closed sums; queue those that touch or leave in it, and return their number."""
    peak, lowest, steepest = block[PEAK], block[LOWEST], block[STEEPEST]
    steepest /= refinement
    cells, heights, squares = BLOCK * refinement, block[HEIGHTS] * refinement, block[SQUARES] / refinement
    queued = 0
    for k in range(count):
        d, r, u, touching = (
            room[DEPTH * LANES + k],
            room[REACH * LANES + k],
            room[U * LANES + k],
            room[CONTACT * LANES + k] > 0,
        )
        through = room[THROUGH * LANES + k]
        if not touching and peak + d <= u * through:
            memory = r * (1 - through)
            room[LOAD * LANES + k] += u * memory
            room[RATE * LANES + k] += room[FADE * LANES + k] * memory
            room[LOSS * LANES + k] += 0.5 * u * u * (1 - through) * (1 + through)
            room[U * LANES + k] = u * through if u * through > SMALL else 0.0
            room[FADE * LANES + k] *= through
        elif touching and lowest + d + r * steepest > 0:
            room[LOAD * LANES + k] += heights + cells * d
            room[RATE * LANES + k] += cells
            room[LOSS * LANES + k] += r * squares
            room[LENGTH * LANES + k] += cells
            room[STRETCH * LANES + k] += squares
            room[U * LANES + k] = last + d
            room[FADE * LANES + k] = 1.0
        else:
            queue[queued] = k
            queued += 1
    return queued


@njit(nogil=True, cache=True)
def _move(source: FloatArray, target: FloatArray, queue: NDArray[np.int64], queued: int) -> None:
    """Bring the cases of a queue together."""
    for row in range(ROOM):
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
    room: FloatArray,
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
        room[U * LANES + k] = max(room[DEPTH * LANES + k] + line.height[BEFORE - 1], 0.0)
        room[FADE * LANES + k] = room[CONTACT * LANES + k] = 1.0
    _walk(local[0], local[1], 1, 1 + refinement, room, full)
    room[BEGAN * LANES : ROOM * LANES] = room[U * LANES : FADE * LANES]
    room[LOAD * LANES : STATES * LANES] = 0.0
    for j in range(blocks.shape[0]):
        first, end = BEFORE + j * BLOCK, BEFORE + (j + 1) * BLOCK
        queued = _pass_block(blocks[j], line.height[end], refinement, room, count, queue)
        if queued == 0:
            continue
        _move(room, near, queue, queued)
        lanes = -(-queued // VECTOR) * VECTOR
        if refinement == 1:
            _walk(line.height, line.slope, first, end, near, lanes)
        else:
            refine(line, first, BLOCK, weights, local[0], local[1])
            _walk(local[0], local[1], 1, 1 + BLOCK * refinement, near, lanes)
        _return(near, room, queue, queued)
    first = blocks.shape[0] * BLOCK
    refine(line, BEFORE + first, n - first, weights, local[0], local[1])
    _walk(local[0], local[1], 1, 1 + (n - first) * refinement, room, full)


@njit(nogil=True, cache=True)
def load_case(room: FloatArray, k: int, depth: float, reach: float, cells: int) -> None:
    """Write what does not change of a case on a grid."""
    room[DEPTH * LANES + k], room[REACH * LANES + k], room[INVERSE * LANES + k] = depth, reach, min(1 / reach, LARGE)
    room[DECAY * LANES + k], room[THROUGH * LANES + k] = math.exp(-1 / reach), math.exp(-cells / reach)


@njit(nogil=True, cache=True, inline="always")
def closed(room: FloatArray, k: int) -> bool:
    """Return whether a case ended its turn as it began it: not so where the first cell is not touched."""
    same: bool = abs(room[U * LANES + k] - room[BEGAN * LANES + k]) <= CLOSED * room[U * LANES + k]
    return same
