"""Steady sliding of a Kelvin foundation from node to node, many cases of a periodic line at once.

The quick way to about a part in a thousand: see :mod:`mdr_dask.physics.sliding.walk` for what a cell adds. Heights and
slopes are exact at the nodes; the depth is searched for on finer and finer grids, and the drag extrapolated from two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.nodes import AFTER, BEFORE, BLOCK, Nodes, halved, nodes, summit, weights
from mdr_dask.physics.sliding.steady import Steady
from mdr_dask.physics.sliding.walk import (
    DEPTH,
    LANES,
    LENGTH,
    LOAD,
    LOSS,
    RATE,
    REACH,
    ROOM,
    STRETCH,
    closed,
    load_case,
    sweep,
)
from mdr_dask.physics.surfaces.cubic_line import highest_point

ITERATIONS = 25
COARSENING = 4
COARSEST = 64  # nodes of the grid that the search for the depth starts on
# relative step of the depth that a secant is trusted with, and what that may cost to start the next grid
ANSWER_STEP, START = 0.03, (0.1, 0.03)
# of the change of the depth between two grids, where the search on the next one begins, and how far off that may be
DEEPER_FIRST, DEEPER, NEAR = 0.21, 0.13, 0.3
EXTRAPOLATED = 1 / 7  # of the change between grids: the error falls by 8 where the cells are halved
DOUBTED = 0.1  # of the last step of the drag, which is taken along the secant
EXACT_STEP, ROUNDING = 1e-12, 3e-12


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
        As in :class:`mdr_dask.physics.sliding.steady.Steady`.
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


@njit(nogil=True, cache=True, error_model="numpy")
def _solve(
    line: Nodes,
    weights: FloatArray,
    rise: float,
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
    weights : array, shape (2, refinement, 12)
        From `weights`.
    rise : float
        Height of the summit over the highest node.
    reaches, loads : array, shape (cases,)
        v tau / L, and F_N / (4 G L) in the unit of height.
    near_step, trusted : float
        Bounds of the last relative step of the depth and of what it costs.
    depths, rates : array, shape (cases,)
        Penetration of the summit, and relative change of the drag with it, NaN where it is not known; read and
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
    last_step, last_drag = np.empty(LANES), np.empty(LANES)
    for begin in range(0, loads.size, LANES):
        count = min(LANES, loads.size - begin)
        for k in range(count):
            lanes[k] = begin + k
            last_step[k] = last_drag[k] = np.nan
            load_case(room, k, depths[begin + k] - rise, reaches[begin + k] * n, cells)
            results[begin + k] = np.nan
        for _ in range(ITERATIONS):
            if count == 0:
                break
            sweep(line, weights, local, room, near, queue, count)
            kept = 0
            for k in range(count):
                case = lanes[k]
                depth, drag = room[DEPTH * LANES + k] + rise, room[LOSS * LANES + k]
                step = (loads[case] * n - room[LOAD * LANES + k]) / room[RATE * LANES + k]
                size = abs(step) / depth
                rate = (1 - last_drag[k] / drag) / last_step[k]
                rate = rate if math.isfinite(rate) else rates[case]
                doubt = DOUBTED * abs(rate * step)
                if size < EXACT_STEP:
                    rate, doubt = (rate if math.isfinite(rate) else 0.0), 0.0
                if size <= near_step and doubt <= trusted and closed(room, k):
                    depths[case], rates[case] = depth + step, rate
                    length, stretch = room[LENGTH * LANES + k], room[STRETCH * LANES + k]
                    results[case, 0] = drag * (1 + rate * step)
                    results[case, 1] = length / n
                    results[case, 2] = n * math.sqrt(stretch / length) if length > 0 else 0.0
                    results[case, 3] = doubt + ROUNDING
                    continue
                ahead = depth + step if step > -0.7 * depth else 0.3 * depth
                last_step[kept], last_drag[kept], lanes[kept] = ahead - depth, drag, case
                load_case(room, kept, ahead - rise, room[REACH * LANES + k], cells)
                kept += 1
            count = kept


def begin(
    height: FloatArray, slope: FloatArray, reaches: FloatArray, loads: FloatArray, trusted: float
) -> tuple[Sampled, Sampled]:
    """Return the steady states on every other node of a periodic line, found roughly, and on all of them.

    Parameters
    ----------
    height, slope : array, shape (n,)
        Heights into the elastomer, and their derivative by position over the length of the line; two nodes or more
        for every Nyquist point.
    reaches, loads : array, shape (cases,)
        v tau / L and F_N / (4 G L), positive and finite.
    trusted : float
        Relative error of the drag on all nodes that the search may leave.
    """
    strides = [1, 2]
    while height.size > COARSENING * COARSEST * strides[-1]:
        strides.append(strides[-1] * COARSENING)
    depths, results = _shallow(loads), np.empty((loads.size, 4))
    rates = np.full(loads.size, np.nan)
    highest = int(np.argmax(height))
    found = []
    for stride in reversed(strides):
        line = nodes(height, slope, highest, stride, stride <= strides[1])
        bounds = (ANSWER_STEP, trusted) if stride == 1 else START
        _solve(line, weights(1), 0.0, reaches, loads, *bounds, depths, rates, results)
        if stride <= strides[1]:
            found.append(_sampled(line.top, depths, rates, results.copy()))
    return found[0], found[1]


def finer(height: FloatArray, slope: FloatArray) -> Nodes:
    """Return the line that :func:`begin` was given on cells of half the width, from its summit on."""
    height, slope = halved(height, slope)
    cell, _, _ = highest_point(height, slope)
    return nodes(height, slope, (cell + 1) % height.size, 1, True)


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
        The line that :func:`begin` was given, from :func:`finer`.
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
    ahead = (DEEPER_FIRST if refinement == 1 else DEEPER) * (fine.depth - coarse.depth)
    rise = summit(line)
    depths = fine.depth + (line.top + rise)
    depths += np.where(np.abs(ahead) < NEAR * depths, ahead, 0.0)
    depths = np.where(depths > 0, depths, _shallow(loads))
    rates, results = fine.rate.copy(), np.empty((loads.size, 4))
    _solve(line, weights(refinement), rise, reaches, loads, ANSWER_STEP, trusted, depths, rates, results)
    return _sampled(line.top + rise, depths, rates, results)


def _shallow(loads: FloatArray) -> FloatArray:
    """Return a penetration of the summit to begin with, where nothing is known."""
    return np.maximum(loads, loads ** (2 / 3))


def _sampled(top: float, depths: FloatArray, rates: FloatArray, results: FloatArray) -> Sampled:
    drag, fraction, slope, doubt = results.T
    return Sampled(depths - top, rates, drag, fraction, slope, doubt)


def extrapolated(coarse: Sampled, fine: Sampled) -> tuple[Steady, Change]:
    """Return the states on a grid with the drag extrapolated from one of twice its cells, and what changed.

    The change is infinite where either grid has no solution.
    """
    with np.errstate(all="ignore"):
        drag = fine.drag + EXTRAPOLATED * (fine.drag - coarse.drag)
        change = np.abs(fine.drag / coarse.drag - 1), np.abs(fine.contact_fraction / coarse.contact_fraction - 1)
    good = np.isfinite(change[0]) & (drag > 0)
    status = np.where(good, Outcome.CONVERGED, Outcome.DEPTH_NOT_FOUND).astype(np.int8)
    known = (fine.depth, fine.contact_fraction, fine.contact_slope)
    depth, fraction, slope = (np.where(good, column, np.nan) for column in known)
    known_change = Change(*(np.where(good & np.isfinite(part), part, np.inf) for part in change))
    return Steady(np.where(good, drag, np.nan), depth, fraction, slope, status), known_change
