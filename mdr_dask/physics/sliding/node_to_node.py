"""Fast, approximate solver for steady sliding of a Kelvin foundation along a periodic line, in many cases at once.

The unit of length is the cell width, which is the distance between neighbouring nodes. The Deborah number De is the
distance v tau divided by the cell width. Inside a cell, the penetration w (depth plus height) is a cubic. The places
where contact begins and ends are computed approximately. The load F_N / (4 G dx) is the integral of w over the contact,
plus the integral of the displacement u over the rest of the line. The drag F_x / (4 G) is the integral of De w'^2 over
the contact, plus the integral of u^2 / De over the rest. All integrands of the drag are positive, so that nothing
cancels in slow sliding.

If a block of cells is entirely in contact or entirely free in a case, the sums over the block have closed forms. In all
other blocks, the solver follows one element from cell to cell. The results of a case do not depend on other cases in
the same call.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit, jit_inline, jit_inline_fused, jit_uncounted
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import Solution
from mdr_dask.physics.sliding.cases import Cases, first_depths
from mdr_dask.physics.sliding.kelvin import TINY
from mdr_dask.physics.surfaces.cubic_line import STEEPEST_RISE, highest_point
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.waves import series

BLOCK = 32  # number of cells in a block, chosen by trial
WING = 4  # number of nodes on each side of a cell from which the finer nodes in the cell are interpolated
BEFORE, AFTER = WING + 1, WING + 2  # numbers of nodes that `refine` needs before and after the period

# Columns of `Nodes.blocks`. PEAK is an upper bound of the height. LOWEST is the smallest height at the
# nodes. STEEPEST is the steepest descent (the smallest slope) at the nodes.
# HEIGHTS and SQUARES are the integrals of the height and of the squared slope over a block.
PEAK, LOWEST, STEEPEST, HEIGHTS, SQUARES = range(5)
# Rows of a tile (a part of a line on a finer grid). HEIGHT and SLOPE begin at the node before the tile.
# MEAN and SQUARE are the integrals of the height and of the squared slope over each cell. TOP is the largest height
# in each cell. IN_A_TILE is the number of rows.
HEIGHT, SLOPE, MEAN, SQUARE, TOP, IN_A_TILE = range(6)


class Nodes(NamedTuple):
    """The heights and slopes of a periodic line at n nodes, with bounds and sums over blocks of cells.

    `height` is measured from the first node, which has the height `top` on the original line. `slope` is the rise per
    cell. `ends` contains the corrections from `_ends_of`, or is empty. The arrays `height`, `slope` and `ends` begin
    with the last `BEFORE` nodes of the previous period, and end with the first `AFTER` nodes of the next period. If no
    nodes of the original line are left out, the highest point is in the cell before the first node, and `rise` is the
    height of this point above the first node. On coarser grids, `rise` is 0.
    """

    height: FloatArray
    slope: FloatArray
    ends: FloatArray
    blocks: FloatArray
    top: float
    rise: float


def _ends_of(line: RoughLine) -> tuple[FloatArray, FloatArray]:
    """Return corrections of the trapezium rule for the integrals of the height and of the squared slope.

    The integral from node i to node j is exactly the trapezium sum, plus the correction at node i, minus the correction
    at node j. Corrections from local derivatives would miss the shortest waves, which are important for the integrals
    over small contacts.
    """
    waves, slope = line.roughness.coefficients, line.nodes[1]
    n = slope.size
    wave = 2 * np.pi / n * np.arange(1, n // 2 + 1)
    factors = 1j * (1 / wave - 0.5 / np.tan(wave / 2))
    squares = fft.rfft((slope / n) ** 2)
    return series(waves * factors[: waves.size], n), fft.irfft(squares * np.append(0.0, factors), n)


def nodes(line: RoughLine, first: int, stride: int) -> Nodes:
    """Return every `stride`-th node of a line with two nodes per Nyquist point, beginning at node `first`.

    If `stride` is 1, the highest point must be in the cell before node `first`. If `stride` > 2 (less than one node per
    Nyquist point), the slopes are computed from differences of the heights.
    """
    height, slope = line.nodes
    n = height.size // stride
    h, s = np.empty((2, BEFORE + n + AFTER))
    ends = np.empty((2, h.size if stride == 1 else 0))
    corrections = _ends_of(line) if stride == 1 else (ends[0], ends[1])
    taken, rise = Nodes(h, s, ends, np.empty((n // BLOCK, 5)), float(height[first]), 0.0), np.zeros(1)
    _write_nodes(height, slope, corrections, first, stride, taken)
    if stride == 1:
        _peaks(h[BEFORE - 2 :], s[BEFORE - 2 :], 1, rise)
    return taken._replace(rise=float(rise[0]))


@jit
def _write_nodes(
    height: FloatArray,
    slope: FloatArray,
    corrections: tuple[FloatArray, FloatArray],
    first: int,
    stride: int,
    line: Nodes,
) -> None:
    """Write the arrays of `line`. The argument `corrections` contains the results of `_ends_of`."""
    h, s, ends, blocks = line.height, line.slope, line.ends, line.blocks
    n = h.size - BEFORE - AFTER
    _write_periodic(height, first, stride, h)
    h -= line.top
    if stride <= 2:
        _write_periodic(slope, first, stride, s)
        s /= n
    else:
        s[1:-1] = 0.5 * (h[2:] - h[:-2])
        s[0], s[-1] = s[n], s[-1 - n]
    if ends.size > 0:
        _write_periodic(corrections[0], first, stride, ends[0])
        _write_periodic(corrections[1], first, stride, ends[1])
    mean, square = np.empty(BLOCK), np.empty(BLOCK + 1)
    for j in range(blocks.shape[0]):
        begin = BEFORE + j * BLOCK
        _integrals(h[begin - 1 :], s[begin - 1 :], ends[0, begin - 1 :], ends[1, begin - 1 :], BLOCK, mean, square)
        peak, lowest, steepest, heights, squares = -np.inf, np.inf, np.inf, 0.0, 0.0
        for k in range(BLOCK):
            i = begin + k
            above = max(h[i], h[i + 1]) + STEEPEST_RISE * (max(s[i], 0.0) + max(-s[i + 1], 0.0))
            peak, lowest = max(peak, above), min(lowest, min(h[i], h[i + 1]))
            steepest = min(steepest, min(s[i], s[i + 1]))
            heights += mean[k]
            squares += square[k]
        blocks[j, PEAK], blocks[j, LOWEST], blocks[j, STEEPEST] = peak, lowest, steepest
        blocks[j, HEIGHTS], blocks[j, SQUARES] = heights, squares


@jit
def _write_periodic(values: FloatArray, first: int, stride: int, written: FloatArray) -> None:
    """Write every `stride`-th value of one period from `first` on, with `BEFORE` values in front and `AFTER` behind."""
    n, place = written.size - BEFORE - AFTER, first
    for i in range(BEFORE, BEFORE + n):
        written[i] = values[place]
        place += stride
        if place >= values.size:
            place -= values.size
    written[:BEFORE] = written[n : n + BEFORE]
    written[BEFORE + n :] = written[BEFORE : BEFORE + AFTER]


@jit_uncounted
def _integrals(
    h: FloatArray,
    s: FloatArray,
    of_height: FloatArray,
    of_square: FloatArray,
    cells: int,
    mean: FloatArray,
    square: FloatArray,
) -> None:
    """Write the integral of the height over each cell to `mean`, and the integral of the squared slope to `square`.

    The input arrays begin one node before the first cell. `square` needs one entry more than there are cells. The
    trapezium rule is corrected with `of_height` and `of_square`, the results of `_ends_of`. If `of_height` is empty,
    the Euler-Maclaurin formula gives the corrections, with derivatives from heights and slopes at neighbouring nodes.
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


@jit_uncounted
def _peaks(h: FloatArray, s: FloatArray, cells: int, peak: FloatArray) -> None:
    """Write the largest height in each cell to `peak`. The first cell begins at the second node of `h`."""
    for k in range(cells):
        h0, h1, s0, s1 = h[k + 1], h[k + 2], s[k + 1], s[k + 2]
        rise = h1 - h0
        a, b = 3 * rise - 2 * s0 - s1, s0 + s1 - 2 * rise
        inside = a * a - 3 * s0 * b
        root = math.sqrt(inside) if inside > 0 else 0.0
        above, below = (s0, root - a) if a <= 0 else (a + root, -3 * b)  # x = above / below, without cancellation
        x = above / below if below > 0 else 0.0
        x = x if (x > 0) & (x < 1) else 0.0
        top, ends = h0 + x * (s0 + x * (a + x * b)), max(h0, h1)
        peak[k] = top if top > ends else ends


@jit_inline
def fill(line: Nodes, first: int, cells: int, weights: FloatArray, tile: FloatArray) -> int:
    """Write the tile for `cells` cells of the line, and return the number of cells of the tile.

    The first cell begins at the node with the index `first` in the arrays of `line`. Each cell of the line is divided
    into ``weights.shape[1]`` cells of the tile.
    """
    refinement, h, s = weights.shape[1], tile[HEIGHT], tile[SLOPE]
    # the exact corrections in `ends` are known only at the nodes of the line, not at the nodes of a finer tile
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
    """Return the weights that interpolate a line to a finer grid, shape (2, refinement, 4 * WING).

    The first index is 0 for the interpolated height and 1 for the slope. The second index numbers the finer nodes
    inside a cell. The third index runs over the heights at the `WING` nodes on each side of the cell, and then over the
    slopes at these nodes. The interpolating Hermite polynomial has degree 15. With two nodes per Nyquist point, the
    error is below 1e-7 times the amplitude of the shortest wave.
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


@jit_uncounted
def refine(line: Nodes, first: int, cells: int, weights: FloatArray, height: FloatArray, slope: FloatArray) -> None:
    """Write heights and slopes at the nodes of a finer grid in the given cells, and at one fine node on each side."""
    refinement = weights.shape[1]
    for step in range(refinement):
        # the first fine node is in the cell before the given cells, and the last two are in the cell after them
        for cell in range(-1 if step == refinement - 1 else 0, cells + 1 if step < 2 else cells):
            h, s = line.height[first + cell + 1 - WING :], line.slope[first + cell + 1 - WING :]
            value, rate = 0.0, 0.0
            for k in range(2 * WING):
                value += weights[0, step, k] * h[k] + weights[0, step, 2 * WING + k] * s[k]
                rate += weights[1, step, k] * h[k] + weights[1, step, 2 * WING + k] * s[k]
            place = cell * refinement + step + 1
            height[place], slope[place] = value, rate / refinement


ITERATIONS = 25  # largest number of sweeps, chosen by trial; a case that has no solution on a grid needs all of them
COARSENING, COARSEST = 4, 64  # chosen by trial; the search starts on a grid of at most COARSENING * COARSEST nodes
LANES = 64  # number of cases that are computed together, chosen by trial
RESOLVED = 10  # chosen by trial; a grid is fine enough only if at least this number of cells is in contact

ORDER = 3.0  # order of convergence; measured: 3.3 (the order is 4 inside cells, and lower where contact begins or ends)
ARITHMETIC = 5e-5  # relative error of the integrals over cells that are partly in contact, on any grid

# Offset of each quantity of a case in the workspace of a sweep.
# State: displacement (U), derivative of U with respect to the depth (FADE), and CONTACT (1 in contact, 0 if free).
# Sums: load, stiffness (RATE), drag (LOSS), length in contact, and integral of the squared slope in contact (STRETCH).
# Constants: depth, De, exp(-1 / De), 1 / De, decay over a block (THROUGH), and U at the start of the period (BEGAN).
# CALM is 1 if the current block is entirely in contact or entirely free. SIZE is the size of the workspace.
U, FADE, CONTACT, LOAD, RATE, LOSS, LENGTH, STRETCH = range(0, 8 * LANES, LANES)
DEPTH, DEBORAH, DECAY, INVERSE, THROUGH, BEGAN, CALM, SIZE = range(8 * LANES, 16 * LANES, LANES)
# Indices of the results that are extrapolated over the last step of the depth, and the number of these results
DRAG, FRACTION, CONTACT_SLOPE, SECANTS = range(4)


@jit_inline_fused
def _fading(time: float) -> float:
    """Return exp(-time) for time >= 0, with an error of at most 1e-4 for times up to 1, and 1e-3 for larger times."""
    y = time * 0.125
    y = y if y < 1.0 else 1.0
    e = 1.0 + y * (-1.0 + y * (0.5 - y * (1 / 6)))
    e *= e
    e *= e
    return e * e


class Cell(NamedTuple):
    """Penetration w = w0 + s0 x + a x^2 + b x^3 of one case in a cell. At x = 1, w is w1 and w' is s1."""

    w0: float
    s0: float
    a: float
    b: float
    w1: float
    s1: float


@jit_inline_fused
def _cell(tile: FloatArray, i: int, depth: float) -> Cell:
    """Return the penetration in cell i of a tile at a given depth."""
    h0, h1, s0, s1 = tile[HEIGHT, i + 1], tile[HEIGHT, i + 2], tile[SLOPE, i + 1], tile[SLOPE, i + 2]
    rise = h1 - h0
    return Cell(depth + h0, s0, 3 * rise - 2 * s0 - s1, s0 + s1 - 2 * rise, depth + h1, s1)


@jit_inline_fused
def _at(cell: Cell, x: float) -> float:
    """Return w at x."""
    return cell.w0 + x * (cell.s0 + x * (cell.a + x * cell.b))


@jit_inline_fused
def _tilt(cell: Cell, x: float) -> float:
    """Return w' at x."""
    return cell.s0 + x * (2 * cell.a + x * 3 * cell.b)


@jit_inline_fused
def _contact_end(
    cell: Cell, r: float, begins: float, force: float, force_end: float, inverse: float
) -> tuple[float, float, float]:
    """Return where contact ends in a cell, w at this place, and the fraction of w that remains at the end of the cell.

    The Deborah number is `r`, and `inverse` is 1 / r. The force falls from `force` at the place `begins` to `force_end`
    at the end of the cell. One Newton step improves the place that is found by linear interpolation of the force.
    """
    fall = (1 - begins) / (force - force_end)
    x = begins + force * fall
    w, s = _at(cell, x), _tilt(cell, x)
    tangent = s + r * (2 * cell.a + 6 * cell.b * x)
    tangent = -1 / tangent if tangent * fall < -0.5 else fall
    x += (w + r * s) * tangent
    x = x if x > begins else begins
    x = x if x < 1 else 1.0
    # where contact ends, w = -De w'; w is therefore at most De times the steepest descent (at start, middle or end)
    steepest = max(max(-cell.s0, -cell.s1), 0.25 * (cell.s0 + cell.s1) - 1.5 * (cell.w1 - cell.w0))
    crest = max(min(_at(cell, x), r * max(steepest, 0.0)), 0.0)
    return x, crest, _fading((1 - x) * inverse)


@jit_inline_fused
def _contact_begin(cell: Cell, u: float, inverse: float, last: float, gap_last: float) -> tuple[float, float]:
    """Return the place where a free element meets the line, and the fraction of u that remains at this place.

    At the start of the cell, the displacement of the element is u. `inverse` is 1 / De. At the place `last`, an element
    that stayed free would have the gap u - w = `gap_last` <= 0. The first guess of the place is the zero of a parabola
    that has the gap and the slope of the gap at the start of the cell, and the gap at `last`. One Newton step improves
    this guess.
    """
    gap, closing = u - cell.w0, cell.s0 + u * inverse
    bow = (gap - closing * last - gap_last) / (last * last + TINY)
    steep = math.sqrt(abs(closing * closing + 4 * gap * bow)) + TINY
    root = 2 * gap / (closing + steep)
    root = root if root > 0 else 0.0
    root = root if root < last else last
    w, waited = _at(cell, root), _fading(root * inverse)
    step = (u * waited - w) / steep
    low, high = -0.5 * root, 0.5 * (last - root)
    step = step if step > low else low
    step = step if step < high else high
    return root + step, waited * max(1 - step * inverse, 0.0)


@jit_inline_fused
def _contact_in_cell(
    cell: Cell, r: float, u: float, kept: float, inverse: float
) -> tuple[bool, float, float, float, float]:
    """Return whether a free element comes into contact in a cell, and four numbers about the end of the contact.

    At the start of the cell, the displacement of the element is u. If no contact began, the displacement at the end of
    the cell would be `kept`. The Deborah number is `r`, and `inverse` is 1 / r. The four numbers are: the place where
    the contact ends (1 if contact continues in the next cell); w at this place; the fraction of w that remains at the
    end of the cell; and the gap u - w that an element without contact would have at this place. If no contact begins,
    the four numbers have no meaning.
    """
    force, gap = cell.w1 + r * cell.s1, kept - cell.w1
    if force > 0:
        return gap <= 0, 1.0, cell.w1, 1.0, gap
    begins, falls = 0.0, cell.w0 + r * cell.s0
    if falls <= 0 and cell.s0 > 0 and cell.s1 < 0:
        # approximate place of the highest point in the cell
        begins = cell.s0 / (cell.s0 - cell.s1)
        falls = _at(cell, begins)
    if falls <= 0:
        return False, 1.0, cell.w1, 1.0, gap
    stop, crest, held = _contact_end(cell, r, begins, falls, force, inverse)
    gap = u * _fading(stop * inverse) - crest
    return gap < 0, stop, crest, held, gap


@jit_uncounted
def _walk(tile: FloatArray, cells: int, workspace: FloatArray, k: int) -> None:
    """Move one element of case k along a tile, and add the integrals over the tile to the sums of this case."""
    d, r = workspace[DEPTH + k], workspace[DEBORAH + k]
    decay, inverse = workspace[DECAY + k], workspace[INVERSE + k]
    u, fade = workspace[U + k], workspace[FADE + k]
    contact = workspace[CONTACT + k] > 0
    load, rate, loss, length, stretch = 0.0, 0.0, 0.0, 0.0, 0.0
    free_load, free_rate, free_loss = 0.0, 0.0, 0.0
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
            stop, w_stop, held = _contact_end(cell, r, 0.0, cell.w0 + r * cell.s0, cell.w1 + r * cell.s1, inverse)
            start, keeps = 0.0, 1.0
            contact = False
        else:
            met = False
            while i < cells:
                if tile[TOP, i] + d > decay * u:
                    cell = _cell(tile, i, d)
                    met, stop, w_stop, held, gap = _contact_in_cell(cell, r, u, decay * u, inverse)
                    if met:
                        break
                free_load += u
                free_rate += fade
                free_loss += u * u
                u *= decay
                fade *= decay
                i += 1
            if not met:
                break
            start, keeps = _contact_begin(cell, u, inverse, stop, gap)
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
    workspace[LOAD + k] += load + r * lost * free_load
    workspace[RATE + k] += rate + r * lost * free_rate
    workspace[LOSS + k] += loss + r * stretch + 0.5 * lost * (1 + decay) * free_loss
    workspace[LENGTH + k] += length
    workspace[STRETCH + k] += stretch


@jit_uncounted
def _pass_block(
    block: FloatArray, last: float, refinement: int, workspace: FloatArray, count: int, queue: NDArray[np.int64]
) -> int:
    """Add the sums of a block in all cases in which bounds show that it is entirely in contact or entirely free.

    In these cases, also update u and du/d(depth) to the end of the block. Write the indices of all remaining cases to
    the queue, and return the number of remaining cases.
    """
    peak, lowest, steepest = block[PEAK], block[LOWEST], block[STEEPEST]
    steepest /= refinement
    cells, heights, squares = BLOCK * refinement, block[HEIGHTS] * refinement, block[SQUARES] / refinement
    for k in range(count):
        d, r, was = workspace[DEPTH + k], workspace[DEBORAH + k], workspace[CONTACT + k] > 0
        u, fade, through = workspace[U + k], workspace[FADE + k], workspace[THROUGH + k]
        kept, lost = u * through, 1 - through
        memory = r * lost
        is_free = (not was) & (peak + d <= kept)
        is_pressed = was & (lowest + d + r * steepest > 0)
        load, rate, loss = workspace[LOAD + k], workspace[RATE + k], workspace[LOSS + k]
        length, stretch = workspace[LENGTH + k], workspace[STRETCH + k]
        passed_load = load + u * memory if is_free else load
        free_rate = rate + fade * memory if is_free else rate
        free_loss = loss + 0.5 * u * u * lost * (1 + through) if is_free else loss
        kept = kept if kept > TINY else 0.0
        free_load, faded = kept if is_free else u, fade * through if is_free else fade
        workspace[LOAD + k] = load + (heights + cells * d) if is_pressed else passed_load
        workspace[RATE + k] = rate + cells if is_pressed else free_rate
        workspace[LOSS + k] = loss + r * squares if is_pressed else free_loss
        workspace[LENGTH + k] = length + cells if is_pressed else length
        workspace[STRETCH + k] = stretch + squares if is_pressed else stretch
        workspace[U + k] = last + d if is_pressed else free_load
        workspace[FADE + k] = 1.0 if is_pressed else faded
        workspace[CALM + k] = 1.0 if is_pressed | is_free else 0.0
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
    """Move one element of every case through the cell of the summit, and then along one period of the line.

    The sums in the workspace are those of the period. Blocks in which contact may begin or end, and the cells after the
    last block, are computed on a grid with ``weights.shape[1]`` times as many nodes.
    """
    refinement, blocks = weights.shape[1], line.blocks
    n = line.height.size - BEFORE - AFTER
    for k in range(count):
        w = workspace[DEPTH + k] + line.height[BEFORE - 1]
        force = w + workspace[DEBORAH + k] / refinement * line.slope[BEFORE - 1]
        workspace[U + k], workspace[FADE + k] = max(w, 0.0), 1.0
        workspace[CONTACT + k] = 1.0 if w > 0 and force > 0 else 0.0
    # j = 0: the cell of the summit, in which every case is in contact somewhere, and whose sums are discarded; then the
    # blocks, and finally the cells after the last block
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
    """Write the constants of case k to the workspace. The argument `cells` is the number of cells in a block."""
    workspace[DEPTH + k], workspace[DEBORAH + k] = depth, deborah
    workspace[INVERSE + k] = 1 / deborah
    workspace[DECAY + k], workspace[THROUGH + k] = math.exp(-1 / deborah), math.exp(-cells / deborah)


@jit
def _search(
    line: Nodes,
    weights: FloatArray,
    cases: Cases,
    accuracy: float,
    depths: FloatArray,
    rates: FloatArray,
    results: FloatArray,
) -> None:
    """Find the depths of cases on a grid by Newton's method, and extrapolate the results over the last Newton step.

    The search ends if the last Newton step changes the depth and the extrapolated drag by at most the fraction
    `accuracy`, and the displacement is periodic to this accuracy. `depths` contains guesses of the penetration of the
    summit, which are replaced by the solutions. `rates`, shape (cases, SECANTS), contains the derivatives of the
    logarithms of the results with respect to the depth, or NaN if unknown, and is updated. `results`, shape (cases,
    SECANTS), receives drag, contact fraction and contact slope. If no depth is found within `ITERATIONS` sweeps, the
    entries of the case are not changed.
    """
    (deborah, loads), rise = cases, line.rise
    refinement = weights.shape[1]
    n, cells = (line.height.size - BEFORE - AFTER) * refinement, BLOCK * refinement
    tile, workspace = np.empty((IN_A_TILE, cells + 3)), np.empty(SIZE)
    queue, lanes = np.empty(LANES, np.int64), np.empty(LANES, np.int64)
    step_before, last, now, rate = np.empty(LANES), np.empty((LANES, SECANTS)), np.empty(SECANTS), np.empty(SECANTS)
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
            sweep(line, weights, tile, workspace, queue, count)
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
                    if depth + step == depth and not math.isfinite(rate[j]):
                        rate[j] = 0.0
                closes = abs(workspace[U + k] - workspace[BEGAN + k]) <= accuracy * workspace[U + k]
                if size <= accuracy and abs(rate[DRAG] * step) <= accuracy and closes:
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
    """Cases on a rough plane that are solved on finer and finer grids to a relative accuracy."""

    def __init__(self, line: RoughLine, cases: Cases, accuracy: float) -> None:
        self._rough, self._cases, self._accuracy = line, cases, accuracy
        loads = cases.loads
        self._rates = np.full((loads.size, SECANTS), np.nan)
        self._depth = np.full(loads.size, np.nan)  # penetration of the mean line

    def solve(self, level: int, cases: IntArray) -> Solution:
        """Solve cases on a grid of `level` nodes per Nyquist point.

        The levels must be solved in the order 1, 2, 4, ... On level 1, all cases are solved, whatever `cases` contains.
        Above level 2, the grid is interpolated from 2 nodes per Nyquist point, and is finer only in blocks in which
        contact may begin or end.
        """
        if level == 1:
            return self._start()
        if level == 2:
            cell, _ = highest_point(*self._rough.nodes)
            self._line = nodes(self._rough, (cell + 1) % (2 * self._rough.points), 1)
        some, top = self._cases.only(cases), self._line.top + self._line.rise
        depths, rates, results = self._depth[cases] + top, self._rates[cases], np.full((cases.size, SECANTS), np.nan)
        depths = np.where(depths > 0, depths, first_depths(some.loads))
        _search(self._line, weights(level // 2), some, self._accuracy, depths, rates, results)
        self._depth[cases], self._rates[cases] = depths - top, rates
        return self._solution(results, depths - top, level)

    def _start(self) -> Solution:
        """Solve all cases on finer and finer grids, and return the solution with one node per Nyquist point."""
        height, loads = self._rough.nodes[0], self._cases.loads
        depths, results = first_depths(loads), np.empty((loads.size, SECANTS))
        highest = int(np.argmax(height))
        strides = [2]
        while height.size > COARSENING * COARSEST * strides[-1]:
            strides.append(strides[-1] * COARSENING)
        for stride in reversed(strides):
            results.fill(np.nan)
            line = nodes(self._rough, highest, stride)
            _search(line, weights(1), self._cases, self._accuracy, depths, self._rates, results)
        self._depth = depths - line.top
        return self._solution(results, self._depth, 1)

    def _solution(self, results: FloatArray, depth: FloatArray, level: int) -> Solution:
        """Return the results on a grid, with the errors that may be equal on two grids (`Solution.unseen`).

        If no depth was found, or fewer than `RESOLVED` cells are in contact, the outcome of a case is
        `DEPTH_NOT_FOUND`.

        Every result has the error `ARITHMETIC`. Contact fraction and contact slope have an additional error: a contact
        patch of at most about one cell may lie between two nodes, and be missing on two successive grids. The missing
        patch makes the length in contact too small. Because the slope is small near a summit, the missing patch makes
        the rms slope in contact too large. The relative error of the rms slope is at most half the relative error of
        the length.
        """
        drag, fraction, slope = results.T
        with np.errstate(invalid="ignore", divide="ignore"):
            cells = fraction * (self._rough.points * level)
            resolved = (drag > 0) & (cells >= RESOLVED)
            patch = np.where(resolved, 1.0 / cells, np.inf)
        outcome = np.where(resolved, np.int8(Outcome.CONVERGED), np.int8(Outcome.DEPTH_NOT_FOUND))
        unseen = np.full((4, drag.size), ARITHMETIC)
        unseen[2:] += patch, 0.5 * patch
        return Solution([drag, depth, fraction, slope], outcome, unseen)
