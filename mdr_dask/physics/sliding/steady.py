"""Search for the depth at which a Kelvin foundation carries a given load in steady sliding over a line."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import MOST_ITERATIONS
from mdr_dask.physics.sliding import backward_euler
from mdr_dask.physics.sliding.cases import Cases, Steady, valid
from mdr_dask.physics.sliding.kelvin import (
    DISPLACEMENT,
    DRAG,
    DRAG_RATE,
    LENGTH,
    OUTSIDE,
    STIFFNESS,
    STRETCH,
    SUMS,
    Barriers,
    Blocks,
    barriers_for,
    blocks_of,
    sweep_cells,
)
from mdr_dask.physics.surfaces.cubic_line import Cells, CubicLine, cut

# If the line rises by less than this fraction of its heights from the begin of contact to its highest point, rounding
# errors of this rise exceed 0.2 % (see `_is_lost`).
LOST = 1e-13
# A lattice depth is a depth with this number of significant binary digits. The search tries lattice depths only. The
# relative errors of contact fraction and contact slope are then about 2^-20, below every accuracy that a user needs.
LATTICE_BITS = 20


@jit
def _floor(depth: float) -> float:
    """Return the largest lattice depth (see `LATTICE_BITS`) that does not exceed a positive depth."""
    mantissa, exponent = math.frexp(depth)
    return math.ldexp(math.floor(math.ldexp(mantissa, LATTICE_BITS)), exponent - LATTICE_BITS)


@jit
def _next(depth: float) -> float:
    """Return the next larger lattice depth."""
    mantissa, exponent = math.frexp(depth)
    return math.ldexp(math.ldexp(mantissa, LATTICE_BITS) + 1, exponent - LATTICE_BITS)


class _Swept(NamedTuple):
    """Cells and blocks of a line, barriers at one Deborah number, and mean height relative to the highest point."""

    cells: Cells
    blocks: Blocks
    barriers: Barriers
    mean: float


@jit
def _solve(
    line: _Swept, deborah: float, load: float, guess: float, sums: FloatArray, places: FloatArray
) -> tuple[float, bool]:
    """Return the largest lattice depth at which the carried load is at most `load`, and whether the depth was found.

    The carried load is a convex, increasing function of the depth. After the first step, Newton's method therefore
    approaches the depth from above. The depth cannot exceed the depth in full contact at this load. The result does not
    depend on the guess. `sums` receives the sums at the depth, if it was found.
    """
    cells, blocks, barriers, mean = line
    most, high = load / (cells.mean.size - 1) - mean, np.inf
    depth = _floor(min(guess, most))
    for _ in range(MOST_ITERATIONS):
        sweep_cells(cells, blocks, barriers, deborah, depth, sums, places)
        carried = sums[DISPLACEMENT]
        tangent = min(depth + (load - carried) / sums[STIFFNESS], most)
        if not (carried > 0 and tangent > 0):
            return depth, False
        if carried > load:
            high = depth
            depth = _floor(min(tangent, np.nextafter(depth, 0.0)))
            continue
        above = _next(depth)
        if tangent < above or above >= high:  # the next lattice depth carries more than `load`
            return depth, True
        depth = _floor(tangent) if _floor(tangent) < high else above
    return depth, False


@jit
def _guess(known: tuple[float, float, float], load: float) -> float:
    """Return a guess of the depth for a load. `known` contains depth, load and d(load)/d(depth) of another state.

    For similar loads, the depth is approximately a power of the load.
    """
    depth, carried, stiffness = known
    return float(depth * (load / carried) ** (carried / (stiffness * depth)))


@jit
def _states(
    line: _Swept,
    cases: Cases,
    guesses: FloatArray,
    first: tuple[float, float, float],
    results: FloatArray,
    status: NDArray[np.int8],
) -> tuple[float, float, float]:
    """Solve cases on one line at one Deborah number. The loads of the cases must be ascending.

    `results` has the columns `COLUMNS` of `cases.py`. The search for the depth starts from the entry of the case in
    `guesses`. If this entry is NaN, `_guess` computes the start from the last case that was solved, or from `first` if
    there is none. Return depth, load and d(load)/d(depth) of the first case that was solved, or `first` if there is
    none.
    """
    (cells, _, _, _), (deborahs, loads) = line, cases
    n, places = cells.mean.size - 1, np.empty((2, 0))
    sums, last, starts = np.empty(SUMS), first, True
    for k in range(loads.size):
        guess = guesses[k] if guesses[k] > 0 else _guess(last, loads[k])
        depth, is_found = _solve(line, deborahs[k], loads[k], guess, sums, places)
        if not is_found:
            status[k] = Outcome.DEPTH_NOT_FOUND
            continue
        last = depth, sums[DISPLACEMENT], sums[STIFFNESS]
        first, starts = last if starts else first, False
        shift = (loads[k] - sums[DISPLACEMENT]) / sums[STIFFNESS]
        status[k] = Outcome.OUTSIDE_LINE if sums[OUTSIDE] > 0 else Outcome.CONVERGED
        results[k, 0] = sums[DRAG] + shift * sums[DRAG_RATE]
        results[k, 1] = depth + shift
        results[k, 2] = sums[LENGTH] / n
        results[k, 3] = n * np.sqrt(sums[STRETCH] / sums[LENGTH]) if sums[LENGTH] > 0 else 0.0
    return first


def steady_sliding(
    line: CubicLine,
    deborah: FloatArray,
    loads: FloatArray,
    guesses: FloatArray | None = None,
) -> Steady:
    """Return the steady states of a Kelvin foundation on a line, by exact sweeps over the cells of the line.

    Parameters
    ----------
    line : CubicLine
        Line from :func:`~mdr_dask.physics.surfaces.cubic_line.periodic_line` or `indented_line`. An element of the
        foundation meets the nodes in ascending order of the index.
    deborah : array, shape (cases,)
        v tau / L.
    loads : array, shape (cases,)
        F_N / (4 G L), which is the mean displacement, in the unit of height.
    guesses : array, shape (cases,), optional
        Penetrations of the mean line at which the searches start, or NaN. The results do not depend on the guesses.

    Returns
    -------
    Steady
        The coefficient of friction is ``drag / (load L)`` if heights and the length L have the same unit. The status is
        `Outcome.OUTSIDE_LINE` if an end of a line that is not periodic is in contact.

    Examples
    --------
    >>> from mdr_dask.physics.surfaces import roughness
    >>> from mdr_dask.physics.surfaces.cubic_line import periodic_line
    >>> from mdr_dask.physics.surfaces.waves import Waves
    >>> amplitude, phase = roughness.amplitudes(500, hurst=0.7), roughness.phases(seed=1, realisation=0, modes=500)
    >>> waves = Waves(0.5 * amplitude * np.exp(1j * phase), points=1000)
    >>> line = periodic_line(waves.heights(2000), waves.slopes(2000))
    >>> found = steady_sliding(line, np.array([1e-4, 1e-3]), np.array([0.5, 0.5]))
    >>> print((found.drag / 0.5).round(3))
    [0.243 2.408]
    """
    cells = cut(line)
    return steady_on_cells(cells, blocks_of(cells), deborah, loads, guesses)


def steady_on_cells(
    cells: Cells,
    blocks: Blocks,
    deborah: FloatArray,
    loads: FloatArray,
    guesses: FloatArray | None = None,
) -> Steady:
    """Return the results of :func:`steady_sliding` for a line that is already cut into cells and blocks."""
    start = np.full(loads.size, np.nan) if guesses is None else guesses
    return _solved(cells, deborah, loads, lambda good, cases: _swept(cells, blocks, cases, start[good] + cells.top))


def stepped_sliding(line: CubicLine, deborah: FloatArray, loads: FloatArray, contact: bool = True) -> Steady:
    """Return the steady states by backward Euler, the time-stepping method of the thesis.

    See `steady_sliding` for the first three arguments. Only the heights of the nodes are used. In each time step the
    body travels one cell. The error is proportional to the cell width. Contact fraction and contact slope take extra
    computing time. They are computed only if `contact` is True, and are NaN otherwise.
    """
    return _solved(line, deborah, loads, lambda _, cases: _stepped(line, cases, contact))


def _solved(
    line: CubicLine | Cells,
    deborah: FloatArray,
    loads: FloatArray,
    solve: Callable[..., tuple[FloatArray, NDArray[np.int8]]],
) -> Steady:
    """Solve the cases in which the Deborah number and the load are valid. All other cases are `INVALID`.

    The function `solve` receives the selection of valid cases, and the cases with the Deborah number v tau / dx and the
    load F_N / (4 G dx). If the line contains a number that is not finite, all cases are `INVALID`.
    """
    n = line.enter.size if isinstance(line, CubicLine) else line.mean.size - 1
    with np.errstate(over="ignore"):
        good = valid(deborah * n, loads * n)
    good &= bool(np.all(np.isfinite(line.height)) and np.all(np.isfinite(line.enter)))
    results = np.full((4, loads.size), np.nan)
    status = np.full(loads.size, Outcome.INVALID, np.int8)
    if np.any(good):
        results[:, good], status[good] = solve(good, Cases(deborah[good] * n, loads[good] * n))
    return Steady.of(results, status)


def _swept(cells: Cells, blocks: Blocks, cases: Cases, guesses: FloatArray) -> tuple[FloatArray, NDArray[np.int8]]:
    """Solve cases by sweeps over cells.

    Deborah numbers are v tau / dx, loads are F_N / (4 G dx), and guesses are penetrations of the highest point or NaN.
    """
    order = np.lexsort((cases.loads, cases.deborah))
    ordered, ordered_status = np.full((order.size, 4), np.nan), np.zeros(order.size, np.int8)
    deborah, loads, starts = cases.deborah[order], cases.loads[order], guesses[order]
    n, mean = cells.mean.size - 1, float(np.mean(cells.mean[:-1]))
    first = float(loads[0] / n - mean), float(loads[0]), float(n)  # depth, load, d(load)/d(depth) in full contact
    barriers = barriers_for(n)
    edges = np.flatnonzero(np.diff(deborah, prepend=-1.0, append=-1.0))
    for some in (slice(*ends) for ends in pairwise(edges)):
        barriers.block.fill(np.nan)  # barriers are valid for one Deborah number only
        line, alike = _Swept(cells, blocks, barriers, mean), Cases(deborah[some], loads[some])
        first = _states(line, alike, starts[some], first, ordered[some], ordered_status[some])
    results, status = np.empty_like(ordered), np.empty_like(ordered_status)
    results[order], status[order] = ordered, ordered_status
    highest = int(np.argmax(cells.peak[:-1]))
    status[_is_lost(cases, cells.height[highest : highest + 2], results[:, 1])] = Outcome.DEPTH_NOT_FOUND
    results[:, 1] -= cells.top
    return results.T, status


def _is_lost(cases: Cases, near: FloatArray, depth: FloatArray) -> NDArray[np.bool_]:
    """Return for each case whether the results are lost to rounding.

    The results are lost if the line rises very little, compared with `LOST`, from the place where contact begins to the
    highest point. If the dashpots carry the load, this rise is `loads` / `deborah`. `near` contains the heights of the
    two nodes next to the highest point, relative to the highest point. `depth` is the penetration of the highest point.
    """
    fall = -np.min(near)
    with np.errstate(over="ignore"):
        lost: NDArray[np.bool_] = (cases.loads / cases.deborah < LOST * (fall + depth)) & (fall > 0)
    return lost


def _stepped(line: CubicLine, cases: Cases, contact: bool) -> tuple[FloatArray, NDArray[np.int8]]:
    """Solve cases by time steps of one cell. Deborah numbers are v tau / dx, and loads are F_N / (4 G dx)."""
    n = line.enter.size
    nodes = line.height[:n] if line.periodic else line.height
    highest = int(np.argmax(nodes))
    top = nodes[highest]
    below = (np.roll(nodes, -1 - highest) if line.periodic else nodes) - top
    results = np.full((4, cases.loads.size), np.nan)
    depths, results[0], outside = backward_euler.steady_by_steps(below, line.periodic, *cases)
    results[1] = depths - top
    near = np.take(nodes, (highest - 1, highest + 1), mode="wrap") - top
    results[0, _is_lost(cases, near, depths)] = np.nan
    if contact:
        backward_euler.contact(below, line.periodic, cases.deborah, depths, results[2], results[3])
        results[2] /= n
        results[3] *= n
    status = np.where(
        np.isnan(results[0]), Outcome.DEPTH_NOT_FOUND, np.where(outside, Outcome.OUTSIDE_LINE, Outcome.CONVERGED)
    )
    return results, status.astype(np.int8)
