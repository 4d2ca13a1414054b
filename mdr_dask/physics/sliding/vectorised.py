"""Steady sliding of a Kelvin foundation from node to node, many cases of a periodic line at once.

See :mod:`mdr_dask.physics.sliding.walk` for what a cell adds. Heights and slopes are exact at the nodes; the depth is
searched for on finer and finer grids, each from the answer of the one before.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.sliding.cases import Cases
from mdr_dask.physics.sliding.nodes import (
    AFTER,
    BEFORE,
    BLOCK,
    IN_A_TILE,
    NO_ENDS,
    Nodes,
    ends_of,
    nodes,
    weights,
    with_summit,
)
from mdr_dask.physics.sliding.walk import (
    BEGAN,
    CLOSED,
    DEBORAH,
    DEPTH,
    LANES,
    LENGTH,
    LOAD,
    LOSS,
    RATE,
    ROWS,
    STRETCH,
    U,
    load_case,
    sweep,
)
from mdr_dask.physics.surfaces.cubic_line import highest_point


class Settings(NamedTuple):
    """What was tuned for the fewest sweeps: ``python -m benchmarks friction work_precision``."""

    iterations: int = 25
    coarsening: int = 4
    coarsest: int = 64  # nodes of the grid that the search for the depth starts on
    answer_step: float = 0.03  # relative step of the depth that a secant is trusted with
    start: tuple[float, float] = (0.1, 0.03)  # the same to start the next grid, and what that step may cost
    ahead: float = 0.06  # of the change of the depth between two grids, where the search on the next one begins
    near: float = 0.3  # how far off that may be
    doubted: float = 0.1  # of the last step of a column, which is taken along its secant
    doubted_rate: float = 3e-3  # of the last step of the depth, which is taken along the tangent
    exact_step: float = 1e-12
    rounding: float = 3e-12


SETTINGS = Settings()
# what a search writes of a case: three columns that have secants, their relative errors, and that of the depth
DRAG, FRACTION, SLOPE, DOUBTS, DOUBT_OF_DEPTH = 0, 1, 2, 3, 6
SECANTS, RESULTS = 3, 7


class Sampled(NamedTuple):
    """Steady states on a grid, one entry for every case; all but the depth are NaN where no depth was found.

    Parameters
    ----------
    rates : array, shape (cases, 3)
        Relative changes of drag, contact fraction and contact slope with the depth.
    columns : array, shape (4, cases)
        Drag, depth, contact fraction and contact slope, as in :class:`mdr_dask.physics.sliding.cases.Steady`.
    doubts : array, shape (4, cases)
        What the search for the depth may have left in them.
    """

    rates: FloatArray
    columns: FloatArray
    doubts: FloatArray

    @property
    def drag(self) -> FloatArray:
        """The drag."""
        drag: FloatArray = self.columns[0]
        return drag

    @property
    def depth(self) -> FloatArray:
        """Penetration of the mean line."""
        depth: FloatArray = self.columns[1]
        return depth

    @property
    def contact_fraction(self) -> FloatArray:
        """Length in contact over that of the line."""
        contact_fraction: FloatArray = self.columns[2]
        return contact_fraction

    @property
    def contact_slope(self) -> FloatArray:
        """The rms slope over the contact."""
        contact_slope: FloatArray = self.columns[3]
        return contact_slope

    def only(self, cases: NDArray[np.bool_]) -> Sampled:
        """Return some of the cases."""
        return Sampled(self.rates[cases], self.columns[:, cases], self.doubts[:, cases])


class Search(NamedTuple):
    """What a search starts from and finds.

    Parameters
    ----------
    depths : array, shape (cases,)
        Penetration of the summit.
    rates : array, shape (cases, SECANTS)
        Relative changes of the results with it, NaN where they are not known.
    results : array, shape (cases, RESULTS)
        The results, bounds of their relative errors from the search, and that of the depth; NaN where none is found.
    """

    depths: FloatArray
    rates: FloatArray
    results: FloatArray


class _Workspace(NamedTuple):
    """What a search works in: a tile of the line, the states of `walk`, queues, and what the last sweep has found."""

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
        """Return one for a grid."""
        tile, (queue, lanes) = np.empty((IN_A_TILE, BLOCK * refinement + 3)), np.empty((2, LANES), np.int64)
        last_step, last, (now, rate) = np.empty(LANES), np.empty((LANES, SECANTS)), np.empty((2, SECANTS))
        return cls(tile, np.empty(ROWS * LANES), queue, lanes, last_step, last, now, rate)


@jit
def _solve(
    line: Nodes,
    weights: FloatArray,
    cases: Cases,
    bounds: tuple[float, float],
    search: Search,
    place: _Workspace,
) -> None:
    """Find the states of cases on a grid by Newton steps; the last one is taken without another sweep.

    Parameters
    ----------
    line : Nodes
        The line on a grid.
    weights : array, shape (2, refinement, 12)
        From `weights`.
    cases : Cases
        v tau / L, and F_N / (4 G L) in the unit of height.
    bounds : tuple of float
        Bounds of the last relative step of the depth and of what it costs.
    search : Search
        Read and written.
    place : _Workspace
        On this grid.
    """
    (deborah, loads), rise = cases, line.rise
    near_step, trusted = bounds
    depths, rates, results = search
    refinement = weights.shape[1]
    n, cells = (line.height.size - BEFORE - AFTER) * refinement, BLOCK * refinement
    workspace, lanes = place.states, place.lanes
    last_step, last, now, rate = place.last_step, place.last, place.now, place.rate
    settings = SETTINGS
    for begin in range(0, loads.size, LANES):
        rest = loads.size - begin
        count = LANES if rest > LANES else rest
        for k in range(count):
            lanes[k] = begin + k
            last_step[k] = np.nan
            load_case(workspace, k, depths[begin + k] - rise, deborah[begin + k] * n, cells)
        for _ in range(settings.iterations):
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
                now[SLOPE] = n * math.sqrt(stretch / length) if length > 0 else 0.0
                for j in range(SECANTS):
                    rate[j] = (1 - last[k, j] / now[j]) / last_step[k]
                    rate[j] = rate[j] if math.isfinite(rate[j]) else rates[case, j]
                    if size < settings.exact_step and not math.isfinite(rate[j]):
                        rate[j] = 0.0
                doubt = settings.doubted * abs(rate[DRAG] * step)
                closes = abs(workspace[U + k] - workspace[BEGAN + k]) <= CLOSED * workspace[U + k]
                if size <= near_step and doubt <= trusted and closes:
                    depths[case] = depth + step
                    for j in range(SECANTS):
                        rates[case, j] = rate[j]
                        results[case, j] = now[j] * (1 + rate[j] * step)
                        results[case, DOUBTS + j] = settings.doubted * abs(rate[j] * step) + settings.rounding
                    results[case, DOUBT_OF_DEPTH] = (settings.doubted_rate + 0.5 * size) * abs(
                        step
                    ) + settings.rounding * depth
                    continue
                ahead = depth + step if step > -0.7 * depth else 0.3 * depth
                last_step[kept], lanes[kept] = ahead - depth, case
                for j in range(SECANTS):
                    last[kept, j] = now[j]
                load_case(workspace, kept, ahead - rise, workspace[DEBORAH + k], cells)
                kept += 1
            count = kept


def begin(
    height: FloatArray, slope: FloatArray, deborah: FloatArray, loads: FloatArray, trusted: float
) -> tuple[Nodes, Sampled, Sampled]:
    """Return a periodic line from its summit on, and the steady states on every other node of it and on all of them.

    Parameters
    ----------
    height, slope : array, shape (n,)
        Heights into the elastomer, and their derivative by position over the length of the line; two nodes or more
        for every Nyquist point.
    deborah, loads : array, shape (cases,)
        v tau / L and F_N / (4 G L), positive and finite.
    trusted : float
        Relative error of the drag on all nodes that the search may leave.
    """
    strides = [2]
    while height.size > SETTINGS.coarsening * SETTINGS.coarsest * strides[-1]:
        strides.append(strides[-1] * SETTINGS.coarsening)
    search = Search(_shallow(loads), np.full((loads.size, SECANTS), np.nan), np.empty((loads.size, RESULTS)))
    highest, cases = int(np.argmax(height)), Cases(deborah, loads)
    for stride in reversed(strides):
        search.results.fill(np.nan)
        line = nodes(height, slope, highest, stride, stride == strides[0], NO_ENDS)
        _solve(line, weights(1), cases, SETTINGS.start, search, _Workspace.on(1))
    coarse = _sampled(line.top, search._replace(rates=search.rates.copy()))
    cell, _, _ = highest_point(height, slope)
    line = with_summit(nodes(height, slope, (cell + 1) % height.size, 1, True, ends_of(height, slope)))
    return line, coarse, _settled(line, 1, cases, coarse.depth, search.rates, trusted)


def settle(
    line: Nodes,
    refinement: int,
    deborah: FloatArray,
    loads: FloatArray,
    grids: tuple[Sampled, Sampled],
    trusted: float,
) -> Sampled:
    """Return the steady states on a grid that is finer where the line is touched.

    Parameters
    ----------
    line : Nodes
        From :func:`begin`.
    refinement : int
        Cells of the finer grid for each of the line.
    deborah, loads : array, shape (cases,)
        As in :func:`begin`.
    grids : tuple of Sampled
        The states on two coarser grids, the finer one last.
    trusted : float
        Relative error of the drag that the search may leave.
    """
    coarse, fine = grids
    ahead = SETTINGS.ahead * (fine.depth - coarse.depth)
    top = line.top + line.rise
    depths = fine.depth + np.where(np.abs(ahead) < SETTINGS.near * (fine.depth + top), ahead, 0.0)
    return _settled(line, refinement, Cases(deborah, loads), depths, fine.rates.copy(), trusted)


def _settled(
    line: Nodes,
    refinement: int,
    cases: Cases,
    depths: FloatArray,
    rates: FloatArray,
    trusted: float,
) -> Sampled:
    """Return the steady states on a grid, searched for from some depths of the mean line on."""
    top = line.top + line.rise
    penetration = np.where(depths + top > 0, depths + top, _shallow(cases.loads))
    search = Search(penetration, rates, np.full((depths.size, RESULTS), np.nan))
    _solve(line, weights(refinement), cases, (SETTINGS.answer_step, trusted), search, _Workspace.on(refinement))
    return _sampled(top, search)


def _shallow(loads: FloatArray) -> FloatArray:
    """Return a penetration of the summit to begin with, where nothing is known."""
    return np.maximum(loads, loads ** (2 / 3))


def _sampled(top: float, search: Search) -> Sampled:
    results, depth = search.results.T, search.depths - top
    drag, fraction, slope = results[:SECANTS]
    of_drag, of_fraction, of_slope, of_depth = results[DOUBTS:]
    doubts = np.array([of_drag * drag, of_depth, of_fraction * fraction, of_slope * slope])
    return Sampled(search.rates, np.array([drag, depth, fraction, slope]), doubts)
