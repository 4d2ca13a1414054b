"""Steady states of a Kelvin foundation in many cases on one line, by backward Euler as in the thesis.

The displacement at node i is u_i = max(w_i, lambda u_(i-1)), with the penetration w = depth + height. The decay per
time step is lambda = 1 / (1 + dt / tau), where dt is the time in which the body travels the distance dx between two
nodes. The forces are sums over the nodes:

    F_N / (4 G dx) = sum of u_i
    F_x / (4 G) = sum of (w_i - w_(i-1)) (u_i - lambda u_(i-1)) / (1 - lambda)

On a line that is not periodic, the sum of u_i also includes the free recovery beyond the last node.

If bounds show that a block of nodes is entirely in contact or entirely free in a case, the sums over the block have
closed forms. In all other blocks, one vector instruction treats several cases.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.refine import CLOSE, MOST_ITERATIONS
from mdr_dask.physics.sliding.cases import Cases, first_depths, strides

BLOCK = 256  # number of nodes in a block, chosen by trial
LANES = 8  # number of cases in one vector instruction: the widest vector registers hold eight numbers

# Rows of `Lanes.sums`, and the number of these rows
CARRIED, STIFFNESS, DRAG, SUMS = range(4)
# Columns of `Nodal.blocks`: largest and smallest height, smallest rise (negative if the line falls), height before the
# block, and the sums of height, rise, height times rise, and rise squared over the nodes of the block
PEAK, LOWEST, STEEPEST, BEFORE, HEIGHTS, RISES, WORK, SQUARES = range(8)
# Rows of `Lanes.state`, and their number. U is the displacement u, and FADE is du/d(depth). THROUGH is the factor by
# which u decays over a free block. MEMORY is the sum of u over a free block if u is 1 just before the block. LOAD, RATE
# and LOSS are the sums over the nodes of a block: of u, of FADE, and of the terms of (1 - lambda) F_x / (4 G).
U, FADE, THROUGH, MEMORY, LOAD, RATE, LOSS, ROWS = range(8)


class Nodal(NamedTuple):
    """Heights of a line at the nodes, and the rise from the previous node to each node.

    Row j of `blocks` contains the quantities `PEAK` to `SQUARES` of block j. A periodic line ends at the highest node.
    """

    height: FloatArray
    rise: FloatArray
    blocks: FloatArray
    periodic: bool


class Moving(NamedTuple):
    """Distance v tau in cell widths, decay lambda per time step, and penetration of the highest node, for each case."""

    deborah: FloatArray
    decay: FloatArray
    depth: FloatArray


class Lanes(NamedTuple):
    """Work arrays of a sweep.

    `state`, shape (ROWS, cases), has the rows `U` to `LOSS`, of which the last three are used only in `packed`. After
    the sweep, the rows `U` and `FADE` contain u and du/d(depth) at the end of the line. `queue` contains the indices of
    the cases in which contact may begin or end in the current block. `packed` has one column for each case in the
    queue, with the same rows as `state` (`THROUGH` and `MEMORY` are not used), followed by decay and depth. `sums`,
    shape (SUMS, cases), contains the sum of u, the sum of du/d(depth), and (1 - lambda) F_x / (4 G).
    """

    state: FloatArray
    packed: FloatArray
    queue: IntArray
    sums: FloatArray


@jit
def _step(h: float, t: float, decay: float, depth: float, u: float, fade: float) -> tuple[float, float, float]:
    """Return u and du/d(depth) at a node of height h, and the contribution of this node to (1 - lambda) F_x / (4 G).

    At the previous node, the height is h - t, the displacement is `u`, and du/d(depth) is `fade`.
    """
    free = decay * u
    w = h + depth
    is_pressed = w > free
    now = w if is_pressed else free
    return now, 1.0 if is_pressed else decay * fade, (now - free) * t


def _blocks(height: FloatArray, rise: FloatArray, periodic: bool) -> FloatArray:
    """Return `Nodal.blocks`, shape (n // BLOCK, 8)."""
    whole = height.size // BLOCK * BLOCK
    h, t = height[:whole].reshape(-1, BLOCK), rise[:whole].reshape(-1, BLOCK)
    before = np.roll(height, 1)[:whole:BLOCK]
    if not periodic:
        before[:1] = -np.inf  # before the first node of the line, elements are out of contact
    sums = h.sum(1), t.sum(1), (h * t).sum(1), (t * t).sum(1)
    return np.array([h.max(1), h.min(1), t.min(1), before, *sums]).T.copy()


@jit
def _pass_block(block: FloatArray, last: float, moving: Moving, lanes: Lanes) -> int:
    """Add the sums of a block in all cases in which bounds show that it is entirely in contact or entirely free.

    In these cases, also update u and du/d(depth) to the end of the block. Write the indices of all remaining cases to
    the queue, and return the number of remaining cases.
    """
    peak, lowest, steepest, before = block[PEAK], block[LOWEST], block[STEEPEST], block[BEFORE]
    heights, rises, work, squares = block[HEIGHTS], block[RISES], block[WORK], block[SQUARES]
    deborah, decay, depth = moving
    workspace, sums, queue, queued = lanes.state, lanes.sums, lanes.queue, 0
    for k in range(depth.size):
        d, u = depth[k], workspace[U, k]
        if peak + d <= u * workspace[THROUGH, k]:
            sums[CARRIED, k] += u * workspace[MEMORY, k]
            sums[STIFFNESS, k] += workspace[FADE, k] * workspace[MEMORY, k]
            workspace[U, k] = u * workspace[THROUGH, k]
            workspace[FADE, k] *= workspace[THROUGH, k]
        elif u == before + d and lowest + d + deborah[k] * steepest > 0:
            sums[CARRIED, k] += heights + BLOCK * d
            sums[STIFFNESS, k] += BLOCK
            sums[DRAG, k] += (1 - decay[k]) * (work + d * rises) + decay[k] * squares
            workspace[U, k] = last + d
            workspace[FADE, k] = 1.0
        else:
            queue[queued] = k
            queued += 1
    return queued


@jit
def _walk(height: FloatArray, rise: FloatArray, decay: FloatArray, depth: FloatArray, workspace: FloatArray) -> None:
    """Move one element per case from node to node, and update the sums `LOAD`, `RATE` and `LOSS` of each case."""
    whole = height.size // 4 * 4
    for i in range(0, whole, 4):
        h0, h1, h2, h3 = height[i], height[i + 1], height[i + 2], height[i + 3]
        t0, t1, t2, t3 = rise[i], rise[i + 1], rise[i + 2], rise[i + 3]
        for k in range(depth.size):
            u0, a0, x0 = _step(h0, t0, decay[k], depth[k], workspace[U, k], workspace[FADE, k])
            u1, a1, x1 = _step(h1, t1, decay[k], depth[k], u0, a0)
            u2, a2, x2 = _step(h2, t2, decay[k], depth[k], u1, a1)
            u3, a3, x3 = _step(h3, t3, decay[k], depth[k], u2, a2)
            workspace[U, k] = u3
            workspace[FADE, k] = a3
            workspace[LOAD, k] += (u0 + u1) + (u2 + u3)
            workspace[RATE, k] += (a0 + a1) + (a2 + a3)
            workspace[LOSS, k] += (x0 + x1) + (x2 + x3)
    for i in range(whole, height.size):
        for k in range(depth.size):
            u0, a0, x0 = _step(height[i], rise[i], decay[k], depth[k], workspace[U, k], workspace[FADE, k])
            workspace[U, k] = u0
            workspace[FADE, k] = a0
            workspace[LOAD, k] += u0
            workspace[RATE, k] += a0
            workspace[LOSS, k] += x0


@jit
def _walk_some(height: FloatArray, rise: FloatArray, moving: Moving, lanes: Lanes, queued: int) -> None:
    """Move the elements of the cases in the queue from node to node, several cases in one vector instruction."""
    decay, depth = moving.decay, moving.depth
    workspace, packed, queue, sums = lanes
    for q in range(queued):
        k = queue[q]
        packed[U, q], packed[FADE, q] = workspace[U, k], workspace[FADE, k]
        packed[ROWS, q], packed[ROWS + 1, q] = decay[k], depth[k]
        packed[LOAD, q] = packed[RATE, q] = packed[LOSS, q] = 0.0
    # fill the last vector instruction with zeros, because full instructions are faster
    full = -(-queued // LANES) * LANES
    packed[:, queued:full] = 0.0
    _walk(height, rise, packed[ROWS, :full], packed[ROWS + 1, :full], packed)
    for q in range(queued):
        k = queue[q]
        workspace[U, k], workspace[FADE, k] = packed[U, q], packed[FADE, q]
        sums[CARRIED, k] += packed[LOAD, q]
        sums[STIFFNESS, k] += packed[RATE, q]
        sums[DRAG, k] += packed[LOSS, q]


@jit
def _sweep(line: Nodal, moving: Moving, lanes: Lanes) -> None:
    """Move one element of every case along the line, and write the sums.

    Elements start in contact at the highest node of a periodic line, or undeformed before the first node of any other
    line.
    """
    height, rise, blocks, periodic = line
    deborah, depth = moving.deborah, moving.depth
    workspace, sums = lanes.state, lanes.sums
    for k in range(depth.size):
        workspace[U, k] = depth[k] if periodic else 0.0
        workspace[FADE, k] = 1.0 if periodic else 0.0
        lost = -math.expm1(-BLOCK * math.log1p(1 / deborah[k]))
        workspace[THROUGH, k], workspace[MEMORY, k] = 1 - lost, deborah[k] * lost
        sums[CARRIED, k] = sums[STIFFNESS, k] = sums[DRAG, k] = 0.0
    for j in range(blocks.shape[0]):
        first, end = j * BLOCK, (j + 1) * BLOCK
        queued = _pass_block(blocks[j], height[end - 1], moving, lanes)
        if queued:
            _walk_some(height[first:end], rise[first:end], moving, lanes, queued)
    first = blocks.shape[0] * BLOCK
    for k in range(depth.size):
        lanes.queue[k] = k
    _walk_some(height[first:], rise[first:], moving, lanes, depth.size)


@jit
def _newton(
    line: Nodal,
    cases: Cases,
    depths: FloatArray,
    drags: FloatArray,
    outside: NDArray[np.bool_],
) -> None:
    """Find the depth and the drag of every case, and replace the guesses in `depths` by the solutions.

    After the first step, Newton's method approaches the solution from above, because the load is a convex, increasing
    function of the depth. The drag is extrapolated from the last two sweeps to the final depth. `outside` receives
    whether an end of a line that is not periodic is in contact. If no depth is found, the drag is NaN, and the entries
    of the case in `depths` and `outside` are not changed.
    """
    count = depths.size
    active, before = np.arange(count), np.full((2, count), np.nan)
    packed, queue = np.empty((ROWS + 2, count + LANES)), np.empty(count, np.int64)
    lanes = Lanes(np.empty((ROWS, count)), packed, queue, np.empty((SUMS, count)))
    depth, load, deborah = depths.copy(), cases.loads.copy(), cases.deborah.copy()
    decay = deborah / (1 + deborah)
    workspace, sums = lanes.state, lanes.sums
    drags[:] = np.nan
    ends = 0.0 if line.periodic else 1.0
    for _ in range(MOST_ITERATIONS):
        _sweep(line, Moving(deborah[:count], decay[:count], depth[:count]), lanes)
        kept = 0
        for k in range(count):
            case = active[k]
            # beyond the end of a line that is not periodic, both u and du/d(depth) decay by lambda per node
            carried = sums[CARRIED, k] + ends * deborah[k] * workspace[U, k]
            step = (load[k] - carried) / (sums[STIFFNESS, k] + ends * deborah[k] * workspace[FADE, k])
            drag = sums[DRAG, k] * (1 + deborah[k])
            earlier = before[0, k] - depth[k]
            if abs(step * earlier) <= CLOSE * depth[k] ** 2:  # estimated relative error of the extrapolated drag
                change = (before[1, k] - drag) / earlier * step if abs(earlier) > 0 else 0.0
                depths[case] = depth[k] + step
                drags[case] = drag + change
                outside[case] = not line.periodic and (workspace[FADE, k] == 1 or line.height[0] + depth[k] > 0)
                continue
            active[kept], decay[kept], load[kept], deborah[kept] = case, decay[k], load[k], deborah[k]
            before[0, kept], before[1, kept] = depth[k], drag
            depth[kept] = depth[k] + step
            kept += 1
        count = kept
        if count == 0:
            return


@jit
def contact(
    height: FloatArray,
    periodic: bool,
    deborah: FloatArray,
    depths: FloatArray,
    touched: FloatArray,
    slope: FloatArray,
) -> None:
    """Write, for every case, the number of nodes in contact to `touched`, and the rms rise to these nodes to `slope`.

    The rise to a node is counted from the previous node. Without a node in contact, `slope` is 0.
    """
    for k in range(depths.size):
        decay, count, square = deborah[k] / (1 + deborah[k]), 0, 0.0
        u = depths[k] if periodic else 0.0
        for i in range(height.size):
            w = height[i] + depths[k]
            if w > decay * u:
                u = w
                rise = height[i] - height[i - 1]
                count += 1
                square += rise * rise
            else:
                u *= decay
        touched[k] = count
        slope[k] = np.sqrt(square / max(count, 1))


def steady_by_steps(
    height: FloatArray, periodic: bool, deborah: FloatArray, loads: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Return for each case the penetration of the highest node, F_x / (4 G), and whether an end is in contact.

    Heights are relative to the highest node. Deborah numbers are v tau / dx. Loads are F_N / (4 G dx), in the unit of
    height. A periodic line must end at the highest node, and the third result is then False. If no depth is found, the
    second result is NaN, and the first is only a guess.
    """
    depths = first_depths(loads / height.size)
    drags, outside = np.empty(loads.size), np.zeros(loads.size, np.bool_)
    top = int(np.argmax(height))
    for stride in strides(height.size):
        coarse = np.ascontiguousarray(height[top % stride :: stride])
        rise = coarse - np.roll(coarse, 1)
        line = Nodal(coarse, rise, _blocks(coarse, rise, periodic), periodic)
        _newton(line, Cases(deborah / stride, loads / stride), depths, drags, outside)
    return depths, drags, outside
