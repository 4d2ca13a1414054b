"""Velocity jumps solved to a requested accuracy, with estimated errors.

The steady states before and after a jump, and the drag just after the jump, are solved on finer and finer grids
(:mod:`mdr_dask.physics.refine`). The transient is computed by a march on one grid. From drag and depth in the march,
the steady values after the jump on the same grid are subtracted, and the accurate steady values are added. A transient
is therefore accurate even if it is much smaller than the friction. The error of the transient is estimated by a second
march with half as many nodes and half as many time steps.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import SAFETY, Solution, refine
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.transients.limits import PreparedLine, SteadyLimits, steady_limits
from mdr_dask.physics.transients.velocity_jump import MarchRequest, Path, jump_between

FINEST = 64  # largest number of nodes per Nyquist point in steady states


class Levels(NamedTuple):
    """Steady drag before the jump, change of the drag at the jump, steady drag and steady depth after the jump."""

    before: FloatArray
    jump: FloatArray
    after: FloatArray
    depth: FloatArray

    @classmethod
    def of(cls, limits: list[SteadyLimits]) -> Levels:
        """Return the levels of all cases, given the steady limits of every case."""
        rows = [(each.before, each.at - each.before, each.after, each.depth[1]) for each in limits]
        return cls(*np.array(rows).reshape(-1, 4).T)


class Jumps(NamedTuple):
    """Results of the velocity jumps on a line.

    Drags are F_x / (4 G L h) in units of h / L, and depths are in units of h, where h is the unit of height. `trace`
    and `depth`, shape (cases, times), are drag and depth at the requested times. All errors are absolute. `errors` is
    NaN if no accuracy was requested. `trace`, `depth` and their errors are NaN for cases without a solution. The errors
    `trace_error` and `depth_error` are also NaN if they were not requested, and infinite if there is no march on
    the coarse grid. `contact` is the larger of two fractions of the line: the fraction in contact in steady sliding
    before the jump, and the fraction after it.
    """

    levels: Levels
    errors: Levels
    trace: FloatArray
    depth: FloatArray
    trace_error: FloatArray
    depth_error: FloatArray
    contact: FloatArray
    outcome: NDArray[np.int8]


def solve_jumps(
    line: RoughLine,
    loads: FloatArray,
    deborah: FloatArray,
    accuracy: float | None,
    oversampling: int,
    march: MarchRequest | None,
    with_errors: bool,
) -> Jumps:
    """Solve the velocity jumps on a line.

    Loads are F_N / (4 G L h), where h is the unit of height. `deborah`, shape (cases, 2), contains v_1 tau / L and v_2
    tau / L. `accuracy` is the allowed relative error of all `Levels`. The error of a depth smaller than h is divided by
    h, not by the depth. If `accuracy` is None, the steady states are solved on the grid of the march only, and
    `with_errors` must be False. `oversampling` is the number of nodes per Nyquist point in the march, and must be even.
    The steady states use at least as many nodes. If `march` is None, no transient is computed. If `with_errors` is
    True, the errors of the transients are estimated.
    """
    cases, grid = loads.size, oversampling
    guesses = np.full((cases, 2), np.nan)
    lines: dict[int, PreparedLine] = {}
    limits: dict[tuple[int, int], SteadyLimits] = {}

    def solve(oversampling: int, which: IntArray) -> Solution:
        prepared = PreparedLine.of(line.cubic(line.points * oversampling))
        found = steady_limits(prepared, loads[which], deborah[which], guesses[which])
        guesses[which] = [each.depth for each in found]
        if oversampling <= grid:
            lines[oversampling] = prepared
            limits.update({(oversampling, int(k)): each for k, each in zip(which, found, strict=True)})
        return Solution(Levels.of(found), np.array([each.outcome for each in found], np.int8))

    grids = [grid] if accuracy is None else [grid // 2]
    while accuracy is not None and (grids[-1] < grid or 2 * grids[-1] <= FINEST):
        grids.append(2 * grids[-1])
    floors = [0.0, 0.0, 0.0, 1.0]
    # a contact of a few nodes converges irregularly, at second order or faster, hence twice the usual safety factor
    refined = refine(solve, cases, grids, accuracy or np.inf, order=2, safety=2 * SAFETY, floors=floors)
    levels = Levels(*refined.values)
    errors = Levels(*refined.errors if accuracy is not None else np.full((4, cases), np.nan))
    shape = cases, march.times.size if march else 0
    trace, depth, trace_error, depth_error = (np.full(shape, np.nan) for _ in range(4))
    contact = np.array([limits[grid, k].contact.max() if (grid, k) in limits else np.nan for k in range(cases)])
    jumps = Jumps(levels, errors, trace, depth, trace_error, depth_error, contact, refined.outcome)
    if march is None:
        return jumps
    half = march._replace(per_decade=march.per_decade / 2)
    for k in np.flatnonzero(refined.outcome == Outcome.CONVERGED):
        fine = limits[grid, int(k)]
        jump = jump_between(lines[grid], loads[k], deborah[k], fine, march)
        jumps.outcome[k] = jump.outcome
        trace[k] = levels.after[k] + (jump.trace - fine.after)
        depth[k] = levels.depth[k] + (jump.depth - fine.depth[1])
        if with_errors and jump.outcome == Outcome.CONVERGED:
            error = np.zeros((2, march.times.size))
            if jump.path is not None:
                coarse = limits[grid // 2, int(k)]
                other = jump_between(lines[grid // 2], loads[k], deborah[k], coarse, half).path
                # a transient converges at first order, because single asperities enter contact
                error = SAFETY * _change(jump.path, fine, other, coarse, march.times)
            trace_error[k], depth_error[k] = error + np.array([[errors.after[k]], [errors.depth[k]]])
    return jumps


def _change(
    fine: Path, limits: SteadyLimits, coarse: Path | None, others: SteadyLimits, times: FloatArray
) -> FloatArray:
    """Return the largest differences of the transients on the two grids at or after each of `times`, shape (2, times).

    The transients are drag and depth minus the steady values after the jump. The differences are infinite if there is
    no march on the coarse grid.
    """
    if coarse is None:
        return np.full((2, times.size), np.inf)
    everywhere = np.union1d(times, fine.time)
    ends = [np.array([each.after, each.depth[1]]) for each in (limits, others)]
    # the steady state on the same grid is subtracted from each path
    beyond = [path.at(everywhere, end) - end[:, None] for path, end in zip((fine, coarse), ends, strict=True)]
    change = np.abs(beyond[0] - beyond[1])
    later = np.maximum.accumulate(change[:, ::-1], axis=1)[:, ::-1]
    found: FloatArray = later[:, np.searchsorted(everywhere, times)]
    return found
