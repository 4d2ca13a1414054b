"""Steady sliding of a Kelvin foundation from node to node, many cases of a periodic line at once.

The quick way to about a part in a thousand. Heights and slopes are exact at the nodes. In a cell the force of
contact, f = w + reach w', and the slope run straight between the nodes; it leaves where f falls to 0, which raises
exp(s / reach) w to its peak, and touches where a parabola meets what is free. With integral(u + reach u') =
integral(f) and integral(reach u'^2) = integral(f w') - change of u^2 / 2 a cell that is partly in contact adds what
the force alone gives; cells wholly in contact are integrated exactly, so that full contact is exact on any grid.
Everything is measured in cells, as in :mod:`mdr_dask.physics.sweep`. The inner loops run over cases, so that they
are vector instructions; each case does the same arithmetic whatever runs beside it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mdr_dask.physics.sliding import CONVERGED, NOT_CONVERGED, Steady

FloatArray = NDArray[np.float64]

BLOCK = 32  # cells
BEFORE, AFTER = 3, 4  # nodes of the turns before and after
LANES = 64  # cases that go along the line together
VECTOR = 8
ITERATIONS = 25
COARSENING = 4
COARSEST = 64  # nodes of the grid that the search for the depth starts on
# relative step of the depth that a secant is trusted with, and what that may cost to start the next grid
ANSWER_STEP, START = 0.03, (0.1, 0.03)
EXTRAPOLATED = 1 / 7  # of the change between grids: the error falls by 8 where the cells are halved
DOUBTED = 0.1  # of the last step of the drag, which is taken along the secant
EXACT_STEP, ROUNDING = 1e-12, 3e-12
SMALL, LARGE = 1e-300, 1e12

# What is known of a block of cells, in this order
PEAK, LOWEST, STEEPEST, HEIGHTS, SQUARES = range(5)
KNOWN = 5
# What a sweep holds of a case, in this order: its state, sums, and what does not change
U, FADE, CONTACT, LOAD, RATE, LOSS, LENGTH, STRETCH = range(8)
DEPTH, REACH, DECAY, INVERSE, THROUGH = range(8, 13)
ROOM = 13
STATES = DEPTH


@dataclass(frozen=True)
class Sampled:
    """Steady states on a grid, one entry for every case; drag, fraction and slope are NaN where no depth was found.

    Parameters
    ----------
    depth : array
        Penetration of the mean line, in the unit of height.
    rate : array
        Relative change of the drag with the depth.
    drag, contact_fraction, contact_slope : array
        As in :class:`mdr_dask.physics.sliding.Steady`.
    doubt : array
        Bound of the relative error of the drag from the search for the depth.
    """

    depth: FloatArray
    rate: FloatArray
    drag: FloatArray
    contact_fraction: FloatArray
    contact_slope: FloatArray
    doubt: FloatArray

    def only(self, cases: NDArray[np.bool_]) -> Sampled:
        """Return some of the cases."""
        return Sampled(**{name: column[cases] for name, column in vars(self).items()})


@dataclass(frozen=True)
class Change:
    """Relative changes between two grids of the drag and of the length in contact, one entry for every case."""

    drag: FloatArray
    contact: FloatArray

    def only(self, cases: NDArray[np.bool_]) -> Change:
        """Return some of the cases."""
        return Change(self.drag[cases], self.contact[cases])


class Nodes(NamedTuple):
    """A periodic line from its highest node on a grid of n cells.

    Parameters
    ----------
    height, slope : array, shape (BEFORE + n + AFTER,)
        With nodes of the turns before and after; heights from the highest, rise over a cell.
    blocks : array, shape (n // BLOCK, KNOWN)
        Bounds and sums over the cells of a block.
    top : float
        The height of the highest node.
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


@njit(nogil=True, cache=True)
def nodes(height: FloatArray, slope: FloatArray, stride: int, resolved: bool) -> Nodes:
    """Take every stride-th node of a line, its highest among them; differences for slopes if it is not resolved.

    Parameters
    ----------
    height, slope : array, shape (n,)
        Heights and derivatives by position over the length of the line.
    """
    n = height.size // stride
    top = np.argmax(height)
    h, s = np.empty(n + BEFORE + AFTER), np.empty(n + BEFORE + AFTER)
    highest = height[top]
    source = top
    for i in range(BEFORE, n + BEFORE):
        h[i] = height[source] - highest
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
        first, last = BEFORE + j * BLOCK, BEFORE + (j + 1) * BLOCK
        peak, lowest, steepest, heights, squares = -np.inf, h[last], s[last], 0.0, 0.0
        for i in range(first, last):
            bend = s[i] - s[i + 1]
            above = max(h[i], h[i + 1]) + 0.125 * max(bend, 0.0)
            peak, lowest, steepest = max(peak, above), min(lowest, h[i]), min(steepest, s[i])
            heights += 0.5 * (h[i] + h[i + 1]) + bend / 12
            squares += _square(s, i)
        blocks[j, PEAK], blocks[j, LOWEST], blocks[j, STEEPEST] = peak, lowest, steepest
        blocks[j, HEIGHTS], blocks[j, SQUARES] = heights, squares
    return Nodes(h, s, blocks, highest)


def _weights(refinement: int) -> FloatArray:
    """Return how the nodes of a finer grid follow from the heights and slopes of two nodes to either side.

    The polynomial of degree 7 through them: rows are the nodes in a cell, columns 4 heights and 4 slopes, for the
    height and for the slope.
    """
    places = np.array([-1.0, 0.0, 1.0, 2.0])
    table = np.empty((2, refinement, 8))
    for step in range(refinement):
        x = step / refinement
        for i, place in enumerate(places):
            others = np.delete(places, i)
            value = np.prod((x - others) / (place - others))
            rate = sum(np.prod(np.delete(x - others, k)) for k in range(3)) / np.prod(place - others)
            tilt, away = 2 * np.sum(1 / (place - others)), x - place
            table[0, step, i] = (1 - tilt * away) * value**2
            table[0, step, 4 + i] = away * value**2
            table[1, step, i] = -tilt * value**2 + 2 * (1 - tilt * away) * value * rate
            table[1, step, 4 + i] = value**2 + 2 * away * value * rate
    return table


@njit(nogil=True, cache=True)
def _refine(line: Nodes, first: int, cells: int, weights: FloatArray, height: FloatArray, slope: FloatArray) -> None:
    """Write heights and slopes of the finer grid over cells of a line, from the node before to the second one after."""
    refinement = weights.shape[1]
    h, s = line.height, line.slope
    for place in range(-1, cells * refinement + 2):
        cell = place // refinement
        step, i = place - cell * refinement, first + cell
        value, rate = 0.0, 0.0
        for k in range(4):
            value += weights[0, step, k] * h[i - 1 + k] + weights[0, step, 4 + k] * s[i - 1 + k]
            rate += weights[1, step, k] * h[i - 1 + k] + weights[1, step, 4 + k] * s[i - 1 + k]
        height[place + 1], slope[place + 1] = value, rate / refinement


@njit(nogil=True, cache=True, inline="always")
def _square(s: FloatArray, i: int) -> float:
    """Return the integral of the slope squared over a cell by Euler and Maclaurin, exact over a whole line."""
    before, first, last, after = s[i - 1] * s[i - 1], s[i] * s[i], s[i + 1] * s[i + 1], s[i + 2] * s[i + 2]
    square: float = 0.5 * (first + last) + (first + last - before - after) / 24
    return square


@njit(nogil=True, cache=True, error_model="numpy")
def _walk(height: FloatArray, slope: FloatArray, first: int, end: int, room: FloatArray, count: int) -> None:
    """Take cases from node to node; `room` holds row after row of `LANES`."""
    for i in range(first, end):
        h0, h1, s0, s1 = height[i], height[i + 1], slope[i], slope[i + 1]
        bend = s1 - s0
        mean, square = 0.5 * (h0 + h1) - bend / 12, _square(slope, i)
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
            room[STRETCH * LANES + k] += (
                square if whole else part * (s_start * s_start + s_start * s_stop + s_stop * s_stop) / 3
            )
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
def _sweep(
    line: Nodes,
    weights: FloatArray,
    local: FloatArray,
    room: FloatArray,
    near: FloatArray,
    queue: NDArray[np.int64],
    count: int,
) -> None:
    """Follow one element of every case along the line, from its highest node back to it.

    Blocks that a case touches or leaves in are gone along on the finer grid that the weights make, in `local`.
    """
    refinement, blocks = weights.shape[1], line.blocks
    n = line.height.size - BEFORE - AFTER
    full = -(-count // VECTOR) * VECTOR
    # the highest point may lie in the cell before the highest node
    _refine(line, BEFORE - 1, 1, weights, local[0], local[1])
    for k in range(count):
        room[U * LANES + k] = max(room[DEPTH * LANES + k] + line.height[BEFORE - 1], 0.0)
        room[FADE * LANES + k] = room[CONTACT * LANES + k] = 1.0
    _walk(local[0], local[1], 1, 1 + refinement, room, full)
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
            _refine(line, first, BLOCK, weights, local[0], local[1])
            _walk(local[0], local[1], 1, 1 + BLOCK * refinement, near, lanes)
        _return(near, room, queue, queued)
    first = blocks.shape[0] * BLOCK
    _refine(line, BEFORE + first, n - first, weights, local[0], local[1])
    _walk(local[0], local[1], 1, 1 + (n - first) * refinement, room, full)


@njit(nogil=True, cache=True)
def _load_case(room: FloatArray, k: int, depth: float, reach: float, cells: int) -> None:
    """Write what does not change of a case on a grid."""
    room[DEPTH * LANES + k], room[REACH * LANES + k], room[INVERSE * LANES + k] = depth, reach, min(1 / reach, LARGE)
    room[DECAY * LANES + k], room[THROUGH * LANES + k] = math.exp(-1 / reach), math.exp(-cells / reach)


@njit(nogil=True, cache=True, error_model="numpy")
def _solve(
    line: Nodes,
    weights: FloatArray,
    reaches: FloatArray,
    loads: FloatArray,
    near_step: float,
    trusted: float,
    depths: FloatArray,
    rates: FloatArray,
    results: FloatArray,
) -> None:
    """Find the states of cases on a grid by Newton steps; the last one is taken without another sweep.

    Parameters
    ----------
    line : Nodes
        The line on a grid.
    weights : array, shape (2, refinement, 8)
        From `_weights`.
    reaches, loads : array, shape (cases,)
        v tau / L, and F_N / (4 G L) in the unit of height.
    near_step, trusted : float
        Bounds of the last relative step of the depth and of what it costs.
    depths, rates : array, shape (cases,)
        Penetration of the highest node, and relative change of the drag with it, NaN where it is not known; read and
        written.
    results : array, shape (cases, 4)
        Written: F_x / (4 G), length in contact over length of the line, rms slope over it, and a bound of the relative
        error of the search; NaN where no depth is found.
    """
    refinement = weights.shape[1]
    n, cells = (line.height.size - BEFORE - AFTER) * refinement, BLOCK * refinement
    local = np.empty((2, cells + 3))
    room, near = np.zeros(ROOM * LANES), np.zeros(ROOM * LANES)
    queue, lanes = np.empty(LANES, np.int64), np.empty(LANES, np.int64)
    last_step, last_drag, done = np.empty(LANES), np.empty(LANES), np.empty(LANES, np.int64)
    for begin in range(0, loads.size, LANES):
        count = min(LANES, loads.size - begin)
        for k in range(count):
            lanes[k], done[k] = begin + k, 0
            last_step[k] = last_drag[k] = np.nan
            _load_case(room, k, depths[begin + k], reaches[begin + k] * n, cells)
            results[begin + k] = np.nan
        for _ in range(ITERATIONS):
            if count == 0:
                break
            _sweep(line, weights, local, room, near, queue, count)
            kept = 0
            for k in range(count):
                case = lanes[k]
                depth, drag = room[DEPTH * LANES + k], room[LOSS * LANES + k]
                step = (loads[case] * n - room[LOAD * LANES + k]) / room[RATE * LANES + k]
                size = abs(step) / depth
                rate = (1 - last_drag[k] / drag) / last_step[k]
                rate = rate if math.isfinite(rate) else rates[case]
                doubt = DOUBTED * abs(rate * step)
                if size < EXACT_STEP:
                    rate, doubt = (rate if math.isfinite(rate) else 0.0), 0.0
                if size <= near_step and doubt <= trusted:
                    depths[case], rates[case] = depth + step, rate
                    length, stretch = room[LENGTH * LANES + k], room[STRETCH * LANES + k]
                    results[case, 0] = drag * (1 + rate * step)
                    results[case, 1] = length / n
                    results[case, 2] = n * math.sqrt(stretch / length) if length > 0 else 0.0
                    results[case, 3] = doubt + ROUNDING
                    continue
                ahead = depth + step if step > -0.7 * depth else 0.3 * depth
                last_step[kept], last_drag[kept], lanes[kept] = ahead - depth, drag, case
                _load_case(room, kept, ahead, room[REACH * LANES + k], cells)
                kept += 1
            count = kept


def begin(
    height: FloatArray, slope: FloatArray, reaches: FloatArray, loads: FloatArray, trusted: float
) -> tuple[Sampled, Sampled]:
    """Return the steady states on every fourth node of a periodic line, found roughly, and on every other node.

    Parameters
    ----------
    height, slope : array, shape (n,)
        Heights into the elastomer, and their derivative by position over the length of the line; four nodes or more
        for every Nyquist point.
    reaches, loads : array, shape (cases,)
        v tau / L and F_N / (4 G L), positive and finite.
    trusted : float
        Relative error of the drag on every other node that the search may leave.
    """
    strides = [2, 4]
    while height.size > COARSENING * COARSEST * strides[-1]:
        strides.append(strides[-1] * COARSENING)
    depths, results = np.maximum(loads, loads ** (2 / 3)), np.empty((loads.size, 4))
    rates = np.full(loads.size, np.nan)
    found = []
    for stride in reversed(strides):
        line = nodes(height, slope, stride, stride <= strides[1])
        bounds = (ANSWER_STEP, trusted) if stride == 2 else START
        _solve(line, _weights(1), reaches, loads, *bounds, depths, rates, results)
        if stride <= strides[1]:
            found.append(_sampled(line, depths, rates, results.copy()))
    return found[0], found[1]


def settle(
    line: Nodes,
    refinement: int,
    reaches: FloatArray,
    loads: FloatArray,
    grids: tuple[Sampled, Sampled],
    trusted: float,
) -> Sampled:
    """Return the steady states on a line, or on a finer grid where it is touched.

    Parameters
    ----------
    line : Nodes
        All the nodes of the line that :func:`begin` was given.
    refinement : int
        Cells of the finer grid for each of the line.
    reaches, loads : array, shape (cases,)
        As in :func:`begin`.
    grids : tuple of Sampled
        The states on two coarser grids, the finer one last.
    trusted : float
        Relative error of the drag that the search may leave.
    """
    coarse, fine = grids
    ahead = EXTRAPOLATED * (fine.depth - coarse.depth)
    depths = fine.depth + line.top
    depths += np.where(np.abs(ahead) < ANSWER_STEP * depths, ahead, 0.0)
    rates, results = fine.rate.copy(), np.empty((loads.size, 4))
    _solve(line, _weights(refinement), reaches, loads, ANSWER_STEP, trusted, depths, rates, results)
    return _sampled(line, depths, rates, results)


def _sampled(line: Nodes, depths: FloatArray, rates: FloatArray, results: FloatArray) -> Sampled:
    drag, fraction, slope, doubt = results.T
    return Sampled(depths - line.top, rates, drag, fraction, slope, doubt)


def extrapolated(coarse: Sampled, fine: Sampled) -> tuple[Steady, Change]:
    """Return the states on a grid with the drag extrapolated from one of twice its cells, and what changed.

    The change is infinite where either grid has no solution.
    """
    with np.errstate(all="ignore"):
        drag = fine.drag + EXTRAPOLATED * (fine.drag - coarse.drag)
        change = np.abs(fine.drag / coarse.drag - 1), np.abs(fine.contact_fraction / coarse.contact_fraction - 1)
    good = np.isfinite(change[0]) & (drag > 0)
    status = np.where(good, CONVERGED, NOT_CONVERGED).astype(np.int8)
    known = (fine.depth, fine.contact_fraction, fine.contact_slope)
    depth, fraction, slope = (np.where(good, column, np.nan) for column in known)
    known_change = Change(*(np.where(good & np.isfinite(part), part, np.inf) for part in change))
    return Steady(np.where(good, drag, np.nan), depth, fraction, slope, status), known_change
