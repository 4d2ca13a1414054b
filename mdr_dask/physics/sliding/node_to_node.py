"""Steady sliding of a Kelvin foundation from node to node of a periodic line, for many cases at once.

In a cell the line is a cubic through heights and slopes at its ends, w = d + h + s x + ..., and De is the Deborah
number v tau in cells. An element leaves contact where the force w + De w' falls to 0 and touches where the gap closes.
A cell that is partly in contact adds positive terms only, so that nothing cancels in slow sliding: over the piece in
contact the integrals of w and of De w'^2, over a free piece those of u and u^2 / De. Cells wholly in contact are
integrated exactly, so that full contact is exact on any grid. Everything is measured in cells, as in `kelvin`.

The cases pass the line together, block by block. Whether a block is wholly in contact or wholly free is decided for
all cases at once by vector instructions, and its integrals are closed sums. Through the other blocks each case goes
from cell to cell. Every case does the same arithmetic whichever cases run beside it. The depth that carries the load
is found by Newton's method, on finer and finer grids, each from the depth on the grid before.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import Solution
from mdr_dask.physics.sliding.cases import Cases
from mdr_dask.physics.sliding.nodes import (
    AFTER,
    BEFORE,
    BLOCK,
    HEIGHT,
    HEIGHTS,
    IN_A_TILE,
    LOWEST,
    MEAN,
    NO_ENDS,
    PEAK,
    SLOPE,
    SQUARE,
    SQUARES,
    STEEPEST,
    TOP,
    Nodes,
    ends_of,
    fill,
    nodes,
    weights,
    with_summit,
)
from mdr_dask.physics.surfaces.cubic_line import highest_point

LANES = 64  # cases that pass the line together
SMALL, LARGE = 1e-300, 1e12
CLOSED = 1e-9  # relative difference of the displacement before and after a period that counts as a closed period
RESOLVED = 10  # cells in contact below which a grid does not resolve the contact

ITERATIONS = 25
COARSENING, COARSEST = 4, 64  # the search starts on a grid of at most so many times so many nodes
LAST_STEP = 0.03  # relative step of the depth that may be the last: its results are extrapolated along their secants
SECANT_ERROR = 0.1  # relative error of such an extrapolation
FIRST_STEP, FIRST_ERROR = 0.1, 0.03  # the last step on a grid that only starts the next one, and its error of the drag
ROUNDING = 1e-12  # relative step of the depth that is rounding
AHEAD = 1 / 16  # of the last change of the depth between grids, expected of the next one: fourth order

ROWS = 15
# Where each quantity of the cases begins in the workspace of a sweep: state, sums, and constants of a case
U, FADE, CONTACT, LOAD, RATE, LOSS, LENGTH, STRETCH = range(0, 8 * LANES, LANES)
DEPTH, DEBORAH, DECAY, INVERSE, THROUGH, BEGAN, CALM = range(8 * LANES, ROWS * LANES, LANES)
# Results of a case that are extrapolated along secants
DRAG, FRACTION, CONTACT_SLOPE = range(3)
SECANTS = 3


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


class _Workspace(NamedTuple):
    """Arrays of a search: a tile of the line, the state of the cases, and the results of the last sweep."""

    tile: FloatArray
    states: FloatArray
    queue: NDArray[np.int64]
    lanes: NDArray[np.int64]
    last_step: FloatArray
    last: FloatArray
    now: FloatArray
    rate: FloatArray

    @classmethod
    def on(cls, refinement: int) -> _Workspace:
        """Return the arrays for a grid."""
        tile, (queue, lanes) = np.empty((IN_A_TILE, BLOCK * refinement + 3)), np.empty((2, LANES), np.int64)
        last_step, last, (now, rate) = np.empty(LANES), np.empty((LANES, SECANTS)), np.empty((2, SECANTS))
        return cls(tile, np.empty(ROWS * LANES), queue, lanes, last_step, last, now, rate)


@jit
def _search(
    line: Nodes,
    weights: FloatArray,
    cases: Cases,
    last_step: float,
    error: float,
    depths: FloatArray,
    rates: FloatArray,
    results: FloatArray,
    place: _Workspace,
) -> None:
    """Find the depths of cases on a grid by Newton's method; the last step is taken without another sweep.

    Parameters
    ----------
    line : Nodes
        The line on a grid.
    weights : array, shape (2, refinement, 4 WING)
        From `weights`.
    cases : Cases
        v tau / L, and F_N / (4 G L) in the unit of height.
    last_step, error : float
        Largest relative last step of the depth, and the error of the drag that it may leave.
    depths : array, shape (cases,)
        Penetration of the summit: the start on entry, the solution on return.
    rates : array, shape (cases, SECANTS)
        Relative changes of the results with the depth, NaN where they are not known; updated.
    results : array, shape (cases, SECANTS)
        Written where a depth is found.
    place : _Workspace
        On this grid.
    """
    (deborah, loads), rise = cases, line.rise
    refinement = weights.shape[1]
    n, cells = (line.height.size - BEFORE - AFTER) * refinement, BLOCK * refinement
    workspace, lanes = place.states, place.lanes
    step_before, last, now, rate = place.last_step, place.last, place.now, place.rate
    for begin in range(0, loads.size, LANES):
        rest = loads.size - begin
        count = LANES if rest > LANES else rest
        for k in range(count):
            lanes[k] = begin + k
            step_before[k] = np.nan
            load_case(workspace, k, depths[begin + k] - rise, deborah[begin + k] * n, cells)
        for _ in range(ITERATIONS):
            if count == 0:
                break
            sweep(line, weights, place.tile, workspace, place.queue, count)
            kept = 0
            for k in range(count):
                case = lanes[k]
                depth = workspace[DEPTH + k] + rise
                step = (loads[case] * n - workspace[LOAD + k]) / workspace[RATE + k]
                size = abs(step) / depth
                length, stretch = workspace[LENGTH + k], workspace[STRETCH + k]
                now[DRAG], now[FRACTION] = workspace[LOSS + k], length / n
                now[CONTACT_SLOPE] = n * math.sqrt(stretch / length) if length > 0 else 0.0
                for j in range(SECANTS):
                    rate[j] = (1 - last[k, j] / now[j]) / step_before[k]
                    rate[j] = rate[j] if math.isfinite(rate[j]) else rates[case, j]
                    if size < ROUNDING and not math.isfinite(rate[j]):
                        rate[j] = 0.0
                closes = abs(workspace[U + k] - workspace[BEGAN + k]) <= CLOSED * workspace[U + k]
                if size <= last_step and SECANT_ERROR * abs(rate[DRAG] * step) <= error and closes:
                    depths[case] = depth + step
                    for j in range(SECANTS):
                        rates[case, j] = rate[j]
                        results[case, j] = now[j] * (1 + rate[j] * step)
                    continue
                ahead = depth + step if step > -0.7 * depth else 0.3 * depth
                step_before[kept], lanes[kept] = ahead - depth, case
                for j in range(SECANTS):
                    last[kept, j] = now[j]
                load_case(workspace, kept, ahead - rise, workspace[DEBORAH + k], cells)
                kept += 1
            count = kept


class NodeToNode:
    """Cases on one line, solved on one grid after the other.

    Parameters
    ----------
    height, slope : array, shape (nodes,)
        Heights of a periodic line and their derivative by position over its length, at two nodes per Nyquist point.
    cases : Cases
        v tau / L and F_N / (4 G L), positive and finite.
    error : float
        Relative error of the drag that the search for the depth may leave.
    """

    def __init__(self, height: FloatArray, slope: FloatArray, cases: Cases, error: float) -> None:
        self._height, self._slope, self._cases, self._error = height, slope, cases, error
        loads = cases.loads
        self._rates = np.full((loads.size, SECANTS), np.nan)
        self._depth, self._change = np.full((2, loads.size), np.nan)  # of the mean line, and from the grid before

    def solve(self, level: int, cases: IntArray) -> Solution:
        """Solve cases on a grid of so many nodes per Nyquist point: 1 for all, then 2, 4, 8, ... for any.

        Beyond 2 the grid is finer only in blocks where contact begins or ends; it follows from the heights and slopes
        of the grid of 2.
        """
        if level == 1:
            return self._start()
        if level == 2:
            cell, _, _ = highest_point(self._height, self._slope)
            ends, first = ends_of(self._height, self._slope), (cell + 1) % self._height.size
            self._line = with_summit(nodes(self._height, self._slope, first, 1, True, ends))
        some, top = Cases(*(column[cases] for column in self._cases)), self._line.top + self._line.rise
        depth, ahead = self._depth[cases] + top, AHEAD * self._change[cases]
        depth += np.where(np.abs(ahead) < depth, ahead, 0.0)
        start = np.where(depth > 0, depth, _shallow(some.loads))
        rates, results = self._rates[cases], np.full((cases.size, SECANTS), np.nan)
        refinement = level // 2
        _search(
            self._line, weights(refinement), some, LAST_STEP, self._error, start, rates, results,
            _Workspace.on(refinement),
        )  # fmt: skip
        self._change[cases] = start - top - self._depth[cases] if level > 2 else np.nan
        self._depth[cases], self._rates[cases] = start - top, rates
        return self._solution(results, start - top, level)

    def _start(self) -> Solution:
        """Solve all cases on coarser and coarser grids from the coarsest on; return the results on the last."""
        height, loads = self._height, self._cases.loads
        strides = [2]
        while height.size > COARSENING * COARSEST * strides[-1]:
            strides.append(strides[-1] * COARSENING)
        depths, results = _shallow(loads), np.empty((loads.size, SECANTS))
        highest = int(np.argmax(height))
        for stride in reversed(strides):
            results.fill(np.nan)
            line = nodes(height, self._slope, highest, stride, stride == strides[0], NO_ENDS)
            _search(
                line, weights(1), self._cases, FIRST_STEP, FIRST_ERROR, depths, self._rates, results, _Workspace.on(1)
            )
        self._depth = depths - line.top
        return self._solution(results, self._depth, 1)

    def _solution(self, results: FloatArray, depth: FloatArray, level: int) -> Solution:
        drag, fraction, slope = results.T
        with np.errstate(invalid="ignore"):
            resolved = (drag > 0) & (fraction * (self._height.size // 2 * level) >= RESOLVED)
        outcome = np.where(resolved, np.int8(Outcome.CONVERGED), np.int8(Outcome.DEPTH_NOT_FOUND))
        return Solution([drag, depth, fraction, slope], outcome)


def _shallow(loads: FloatArray) -> FloatArray:
    """Return a penetration of the summit from which a search can start."""
    return np.maximum(loads, loads ** (2 / 3))
