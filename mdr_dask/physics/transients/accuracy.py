"""Jumps on the grids that their accuracy needs, with the errors that are left.

The ends and the instant of a jump are solved on finer and finer grids until two agree. The transient between them is
marched on one grid, and counts from the steady state of that grid: so it keeps its digits, however small it is beside
friction itself.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.transients.ends import Ends, PreparedLine, ends_on
from mdr_dask.physics.transients.velocity_jump import EVERY, Jump, Transient, retraced, velocity_jumps


class Settings(NamedTuple):
    """Factors of the estimates, chosen by ``python -m benchmarks kinetics honesty`` on seeds other than its own.

    Parameters
    ----------
    finest : int
        Oversampling beyond which the ends are not refined.
    of_first_change, of_change, of_change_before : float
        Of the change of a level between the first two grids, any later two, and the two before.
    of_others, of_contact : float
        Of the larger relative change of friction before and after, and of that of the length in contact: two grids may
        agree by chance in one number.
    of_ends : float
        Of the larger error of friction before and after, for their difference at the jump.
    of_transient : float
        Of the change of the transient from half the nodes and half the steps.
    few, of_few, of_a_peak : float
        Nodes in contact that see little of the peaks, and the error of that times the number of them squared, or at
        most times the oversampling squared.
    rounding : float
        Least relative error.
    """

    finest: int = 64
    of_first_change: float = 2.0
    of_change: float = 1.0
    of_change_before: float = 0.1
    of_others: float = 0.5
    of_contact: float = 0.1
    of_ends: float = 0.1
    of_transient: float = 4.0
    few: float = 20.0
    of_few: float = 0.3
    of_a_peak: float = 1.0
    rounding: float = 1e-8


SETTINGS = Settings()


class JumpProblem(NamedTuple):
    """Jumps on one line without dimensions.

    Parameters
    ----------
    line : RoughLine
    loads : array, shape (cases,)
        F_N / (4 G L h).
    deborah : array, shape (cases, 2)
        v_1 tau / L and v_2 tau / L.
    """

    line: RoughLine
    loads: FloatArray
    deborah: FloatArray

    def only(self, cases: NDArray[np.int64]) -> JumpProblem:
        """Return some of the cases."""
        return self._replace(loads=self.loads[cases], deborah=self.deborah[cases])

    def on(self, oversampling: int) -> PreparedLine:
        """Return the line with so many nodes for every Nyquist point."""
        return PreparedLine.of(self.line.cubic(self.line.points * oversampling))


class JumpAim(NamedTuple):
    """What is wanted of the jumps of a line.

    Parameters
    ----------
    levels : collection of str
        Fields of `Levels` that an accuracy is asked of.
    accuracy : float or None
        Relative error allowed for each of them; None where neither that nor errors are wanted: the grid of the march
        must do.
    oversampling : int
        Even number of nodes for every Nyquist point that the march takes, and the ends at least.
    transient : Transient or None
        Of the transient, with the error allowed for it; None if it is not wanted.
    with_errors : bool
        Whether the error of the transient is wanted, which takes an accuracy.
    """

    levels: Collection[str]
    accuracy: float | None
    oversampling: int
    transient: Transient | None
    with_errors: bool


class Levels(NamedTuple):
    """Drag before the jump, its change at the jump, drag and depth long after; or errors of these; shape (cases,)."""

    before: FloatArray
    jump: FloatArray
    after: FloatArray
    depth: FloatArray

    @classmethod
    def of(cls, ends: Ends) -> Levels:
        """Return the levels of ends."""
        return cls(ends.before, ends.at - ends.before, ends.after, ends.depth[:, 1])


class Jumps(NamedTuple):
    """The jumps of a line; drags are F_x / (4 G L h) in units of h / L, depths in h.

    Parameters
    ----------
    levels, errors : Levels
        And their estimated absolute errors.
    trace, depth : array, shape (cases, times)
        Drag and depth after the jump: the level long after, and what the march has beyond its own.
    trace_error, depth_error : array, shape (cases, times)
        Estimated absolute errors; NaN where they are not wanted.
    outcome : array, shape (cases,)
    """

    levels: Levels
    errors: Levels
    trace: FloatArray
    depth: FloatArray
    trace_error: FloatArray
    depth_error: FloatArray
    outcome: NDArray[np.int8]


def solve_jumps(problem: JumpProblem, aim: JumpAim) -> Jumps:
    """Return the jumps of a line: their levels to an accuracy, the transient on the grid given."""
    whole, near = problem.on(aim.oversampling), None
    if aim.accuracy is not None:
        half = problem.on(aim.oversampling // 2)
        near = ends_on(half, problem.loads, problem.deborah)
    fine = ends_on(whole, problem.loads, problem.deborah, near)
    levels, errors = Levels.of(fine), Levels(*np.full((4, problem.loads.size), np.nan))
    if near is not None:
        levels, errors = _refined(problem, aim, near, fine)
    shape = problem.loads.size, aim.transient.times.size if aim.transient else 0
    trace, depth, trace_error, depth_error = (np.full(shape, np.nan) for _ in range(4))
    jumps = Jumps(levels, errors, trace, depth, trace_error, depth_error, fine.outcome.copy())
    if aim.transient is None:
        return jumps
    marched = velocity_jumps(whole, problem.loads, problem.deborah, fine, aim.transient)
    for k, jump in enumerate(marched):
        jumps.outcome[k] = jump.outcome
        jumps.trace[k] = levels.after[k] + (jump.trace - jump.after)
        jumps.depth[k] = levels.depth[k] + (jump.depth - fine.depth[k, 1])
    if aim.with_errors and near is not None:
        paths = retraced(half, problem.loads, problem.deborah, near, marched, aim.transient)
        for k, (jump, path) in enumerate(zip(marched, paths, strict=True)):
            change, sinking = SETTINGS.of_transient * _changes(jump, path, (fine, near), k, aim.transient.times)
            jumps.trace_error[k], jumps.depth_error[k] = change + errors.after[k], sinking + errors.depth[k]
    return jumps


def _changes(jump: Jump, path: FloatArray, grids: tuple[Ends, Ends], k: int, times: FloatArray) -> FloatArray:
    """Return how far transients of drag and depth on two grids differ from each time on, or what is left out.

    Both are counted from their own ends, of which these are the k-th. Nothing is known where one has no solution.
    """
    moments, both = np.zeros(1), [np.array([[ends.at[k]], [ends.depth[k, 0]]]) for ends in grids]
    if jump.moments:
        moments, both = path[0], [jump.path[1:, ::EVERY], path[1:]]
    fine, coarse = (rows - [[ends.after[k]], [ends.depth[k, 1]]] for rows, ends in zip(both, grids, strict=True))
    change = np.abs(fine - coarse)
    change[np.isnan(change)] = np.inf
    later = np.maximum.accumulate(change[:, ::-1], axis=1)[:, ::-1]
    found: FloatArray = later[:, np.searchsorted(moments, times, "right") - 1]
    if jump.left_out > 0:
        depth = grids[0].depth[k]
        found = np.maximum(found, [[jump.left_out], [abs(depth[1] - depth[0])]])
    return found


def _refined(problem: JumpProblem, aim: JumpAim, coarse: Ends, fine: Ends) -> tuple[Levels, Levels]:
    """Return the levels on the coarsest grid on which all that are wanted meet the accuracy, and their errors."""
    points, oversampling, allowed = problem.line.points, aim.oversampling, aim.accuracy or 0.0
    levels, change = np.stack(Levels.of(fine)), _change(coarse, fine)
    errors = _errors(SETTINGS.of_first_change * change, _least(fine, points, oversampling), levels)
    wanted = np.array([name in aim.levels for name in Levels._fields])
    while oversampling < SETTINGS.finest:
        late = ~(errors <= allowed * np.abs(levels)) & wanted[:, None]
        missing = np.flatnonzero(late.any(axis=0) & (fine.outcome == Outcome.CONVERGED))
        if not missing.size:
            break
        oversampling *= 2
        some, near, before = problem.only(missing), fine.only(missing), change[:, missing]
        finer = ends_on(some.on(oversampling), some.loads, some.deborah, near)
        change[:, missing] = _change(near, finer)
        levels[:, missing] = np.stack(Levels.of(finer))
        known = np.maximum(SETTINGS.of_change * change[:, missing], SETTINGS.of_change_before * before)
        errors[:, missing] = _errors(known, _least(finer, points, oversampling), levels[:, missing])
        fine = fine.replaced(missing, finer)
    return Levels(*levels), Levels(*errors)


def _errors(change: FloatArray, least: FloatArray, levels: FloatArray) -> FloatArray:
    """Return absolute errors of levels from what counts of their relative changes; the jump shares that of its ends."""
    errors = np.maximum(change, least) * np.abs(levels)
    before, jump, after = (Levels._fields.index(name) for name in ("before", "jump", "after"))
    errors[jump] = np.maximum(errors[jump], SETTINGS.of_ends * np.maximum(errors[before], errors[after]))
    return errors


def _change(coarse: Ends, fine: Ends) -> FloatArray:
    """Return the relative changes of levels between two grids; infinite where one has no solution."""
    with np.errstate(all="ignore"):
        change = np.abs(1 - np.stack(Levels.of(coarse)) / np.stack(Levels.of(fine)))
        contact = np.abs(1 - coarse.contact / fine.contact).max(axis=1)
    common = np.maximum(SETTINGS.of_others * np.maximum(change[0], change[2]), SETTINGS.of_contact * contact)
    change = np.maximum(change, common)
    return np.where(np.isnan(change), np.inf, change)


def _least(ends: Ends, points: int, oversampling: int) -> FloatArray:
    """Return the least relative errors: rounding, and of contacts on few nodes, which see little of the peaks."""
    touching = ends.contact.min(axis=1) * points * oversampling
    with np.errstate(all="ignore"):
        peak = np.minimum(SETTINGS.of_few / touching**2, SETTINGS.of_a_peak / oversampling**2)
    return SETTINGS.rounding + np.where(touching < SETTINGS.few, peak, 0.0)
