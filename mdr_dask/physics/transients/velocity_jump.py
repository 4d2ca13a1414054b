"""Friction after a jump of the velocity at constant load, marched from one steady state to the next on one line."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.kelvin import DRAG_RATE
from mdr_dask.physics.sliding.kelvin import SUMS as SWEEP_SUMS
from mdr_dask.physics.surfaces.cubic_line import CubicLine
from mdr_dask.physics.transients.clearance import clearance_from
from mdr_dask.physics.transients.contact_search import Reachable, Workspace, workspace_for
from mdr_dask.physics.transients.curve import curve_through
from mdr_dask.physics.transients.ends import Ends, PreparedLine, ends_on
from mdr_dask.physics.transients.march import LEFT_LIMITS, Finish, Marching, Stepping, Trajectory, march_depth, retrace
from mdr_dask.physics.transients.patches import Patches, Track


class Settings(NamedTuple):
    """Numbers of the march, chosen by ``python -m benchmarks kinetics grid`` and ``benchmarks.kinetics.honesty``.

    Parameters
    ----------
    first_step : float
        Of the time in which 1 / q_max is passed, and of tau, at 24 steps per decade.
    few : float
        Steps per decade below which the first one, of the time in which 1 / q_max is passed, grows as their cube: early
        steps cost most, and what they tell then is less than what the others leave out.
    miss : float
        Of the change of depth: what a step may differ from a parabola through the ones before, at 24 steps per decade.
    negligible : float
        Of the mean displacement: changes of depth that need no finer steps.
    newton : float
        Of the change of depth: the step of Newton whose square is left out, at 24 steps per decade.
    equilibrium : float
        Of depth and drag, where the march ends, at 24 steps per decade.
    share : float
        Of the accuracy: how near to its end friction is left.
    long, stray, leap : float
        Relaxation times after which friction has come so near to its end, of all its changes, or of itself, at 24 steps
        per decade: it leaps where a cell comes to touch as a whole, whose slope is summed otherwise than that of parts.
    margin : float
        Of the change of depth, by which a depth may leave its ends.
    widenings : int
        Times that those limits are widened.
    moments : int
        Most moments of a march.
    """

    first_step: float = 0.02
    few: float = 8.0
    miss: float = 0.01
    negligible: float = 1e-5
    newton: float = 1.5e-3
    equilibrium: float = 5e-5
    share: float = 0.1
    long: float = 15.0
    stray: float = 0.02
    leap: float = 1e-5
    margin: float = 0.25
    widenings: int = 3
    moments: int = 3000


SETTINGS = Settings()
WHOLE = 1 - 1e-12  # of a line in contact, but for rounding
SHALLOW = 0.01  # of the least depth of the ends: no march goes below
FINE_STEPS = 24.0  # steps per decade of which the settings speak
EVERY = 2  # of the moments of a path that are marched on another grid


class Transient(NamedTuple):
    """What is asked of a march.

    Parameters
    ----------
    times : array, shape (m,)
        (t - t_0) / tau at which friction and depth are wanted, increasing.
    wavenumber : float
        q_max L, which fixes the first step.
    per_decade : float
        Steps in a factor ten of the time.
    accuracy : float
        Error allowed for the trace, over the friction at the end: a transient that is smaller is not marched, another
        one ends when drag and depth have stayed within a tenth of it.
    """

    times: FloatArray
    wavenumber: float
    per_decade: float = FINE_STEPS
    accuracy: float = 0.0


class Jump(NamedTuple):
    """Friction before, at and after a jump of the velocity; drags are F_x / (4 G L), in height squared over length.

    Parameters
    ----------
    before, at, after : float
        Steady at v_1, at t_0+, and steady at v_2.
    trace, depth : array, shape (times,)
        Drag and depth at the times asked for.
    path : array, shape (3, moments)
        Time, drag and depth at the moments computed; the rest is in equilibrium.
    left_out : float
        Estimated size of a transient that is not computed, because all of it lies within the accuracy.
    outcome : Outcome
    """

    before: float
    at: float
    after: float
    trace: FloatArray
    depth: FloatArray
    path: FloatArray
    left_out: float
    outcome: Outcome

    @property
    def moments(self) -> int:
        """Number of moments computed."""
        return int(self.path.shape[1])


def pace_after(asked: Transient, deborah: FloatArray, change: float, load: float) -> Stepping:
    """Return steps from a part of the time in which 1 / q_max is passed, growing in a constant ratio.

    It is passed at v_2, or at v_1 - v_2: so fast does contact grow behind a patch when the velocity falls.

    Parameters
    ----------
    asked : Transient
    deborah : array, shape (2,)
        v_1 tau / L and v_2 tau / L.
    change, load : float
        Difference of the depths before and after, and F_N / (4 G L), in the same unit.
    """
    finer = FINE_STEPS / asked.per_decade
    fastest = max(deborah[1], deborah[0] - deborah[1])
    passed = max(1.0, SETTINGS.few / asked.per_decade) ** 2 / (asked.wavenumber * float(fastest))
    first = SETTINGS.first_step * finer * min(1.0, passed)
    scale = max(abs(change), SETTINGS.negligible * load)
    close = SETTINGS.newton * finer**2
    last = float(asked.times[-1])
    return Stepping(first, 10 ** (1 / asked.per_decade), SETTINGS.miss * finer**3 * scale, close * scale, last)


def velocity_jump(line: CubicLine, load: float, deborah: tuple[float, float], asked: Transient) -> Jump:
    """Return the friction of a Kelvin foundation on a periodic line through a jump of the velocity at constant load.

    The start is steady sliding at v_1; then the depth is marched by backward differentiation of order three over the
    logarithm of time, with every contact edge solved at every moment (thesis 4.2 with the indentation rate kept).

    Parameters
    ----------
    line : CubicLine
        Periodic.
    load : float
        F_N / (4 G L), in the unit of height.
    deborah : tuple of float
        v_1 tau / L and v_2 tau / L.
    asked : Transient
    """
    prepared, loads, numbers = PreparedLine.of(line), np.array([load]), np.array([deborah])
    return velocity_jumps(prepared, loads, numbers, ends_on(prepared, loads, numbers), asked)[0]


def velocity_jumps(
    line: PreparedLine,
    loads: FloatArray,
    deborah: FloatArray,
    ends: Ends,
    asked: Transient,
) -> list[Jump]:
    """Return the jumps of many cases on one line, of which none depends on the others.

    Parameters
    ----------
    line, loads, deborah
        As in :func:`~mdr_dask.physics.transients.ends.ends_on`.
    ends : Ends
        Of the same line.
    asked : Transient
        What is asked of the march.
    """
    jumps = []
    for k in range(loads.size):
        if ends.outcome[k] != Outcome.CONVERGED:
            jumps.append(_failed(asked.times, Outcome(ends.outcome[k])))
        else:
            jumps.append(_Relaxation.of(line, loads[k], deborah[k], ends, k, asked).solve())
    return jumps


def retraced(
    line: PreparedLine, loads: FloatArray, deborah: FloatArray, ends: Ends, jumps: list[Jump], asked: Transient
) -> list[FloatArray]:
    """Return the paths of jumps on another grid at every second of their moments, with NaN where none is found.

    Parameters
    ----------
    line, loads, deborah, ends, asked
        As in :func:`velocity_jumps`, on the other grid.
    jumps : list of Jump
        The same cases, whose paths are followed.
    """
    paths = []
    for k, jump in enumerate(jumps):
        path = jump.path[:, ::EVERY].copy()
        path[1:] = np.nan
        if jump.outcome == Outcome.CONVERGED == ends.outcome[k] and jump.moments:
            path = _Relaxation.of(line, loads[k], deborah[k], ends, k, asked).retrace(jump.path[:, ::EVERY])
        paths.append(path)
    return paths


def _failed(times: FloatArray, outcome: Outcome) -> Jump:
    nothing = np.full(times.size, np.nan)
    return Jump(np.nan, np.nan, np.nan, nothing, nothing, np.empty((3, 0)), 0.0, outcome)


class _Relaxation(NamedTuple):
    """One case between its ends, in units of cells; depths from the highest point of the line."""

    line: PreparedLine
    load: float
    deborah: FloatArray
    before: float
    at: float
    after: float
    rate: float
    tilt: float
    depth: FloatArray
    first: Patches
    slower: Patches
    is_full: bool
    asked: Transient
    pace: Stepping

    @classmethod
    def of(
        cls, line: PreparedLine, load: float, deborah: FloatArray, ends: Ends, k: int, asked: Transient
    ) -> _Relaxation:
        """Take the k-th case of some ends."""
        n, depth = line.track.cells, ends.depth[k]
        return cls(
            line,
            float(load * n),
            deborah * n,
            float(ends.before[k]),
            float(ends.at[k]),
            float(ends.after[k]),
            float(ends.rate[k]),
            float(ends.tilt[k]),
            depth + line.cells.top,
            ends.first[k],
            ends.slower[k],
            bool(np.all(ends.contact[k] >= WHOLE)),
            asked,
            pace_after(asked, deborah, float(depth[1] - depth[0]), float(load)),
        )

    def solve(self) -> Jump:
        """March from end to end, within limits of the depth that may widen."""
        times, constant = self.asked.times, np.ones(self.asked.times.size)
        jump = Jump(
            self.before,
            self.at,
            self.after,
            self.after * constant,
            (self.depth[1] - self.line.cells.top) * constant,
            np.empty((3, 0)),
            0.0,
            Outcome.CONVERGED,
        )
        if self.is_full:  # then u = d + h, d is constant and nothing relaxes
            return jump
        transient = self.transient() if self.asked.accuracy > 0 else np.inf
        if transient <= self.asked.accuracy * self.after:
            trace = np.where(times > 0, self.after, self.at)
            sinking = np.where(times > 0, self.depth[1], self.depth[0]) - self.line.cells.top
            return jump._replace(trace=trace, depth=sinking, left_out=transient)
        for limits in self.limits(self.depth):
            found = self.march(jump, limits, transient)
            if found is not None:
                return found
        return _failed(times, Outcome.DEPTH_NOT_FOUND)

    def limits(self, depths: FloatArray) -> Iterator[tuple[float, float]]:
        """Yield wider and wider limits around depths."""
        low, high = float(depths.min()), float(depths.max())
        margin = SETTINGS.margin * (high - low) + SETTINGS.negligible * self.load / self.line.track.cells
        for _ in range(SETTINGS.widenings):
            yield max(low - margin, SHALLOW * low), high + margin
            margin *= 4

    def transient(self) -> float:
        """Estimate the size of the transient: the difference of its ends alone does not bound one that crosses its end.

        To it come the friction of the depth's rate, and that of its change.
        """
        sums = np.empty(SWEEP_SUMS)
        self.line.patches(self.depth[1], self.deborah[1], sums)
        by_depth = abs(sums[DRAG_RATE] * (self.depth[1] - self.depth[0]))
        return float(abs(self.at - self.after) + abs(self.rate * self.tilt) + by_depth)

    def march(self, jump: Jump, limits: tuple[float, float], transient: float) -> Jump | None:
        """Return the jump with what a march between two depths finds, or None if it leaves them."""
        accuracy, asked = self.asked.accuracy, self.asked
        coarse = (FINE_STEPS / asked.per_decade) ** 3
        equilibrium = SETTINGS.equilibrium * coarse
        settled = max(equilibrium, SETTINGS.share * accuracy * self.after / max(transient, 1e-300))
        close = max(10 * equilibrium, settled) * abs(self.depth[1] - self.depth[0])
        marching, found, work = self.begun(limits, SETTINGS.moments)
        count, outcome = march_depth(
            marching, self.pace, Finish(self.depth[1], self.after, close, settled), found, work
        )
        if outcome == LEFT_LIMITS:
            return None
        time, _, depth, rate, drag, drag_rate = (column[:count] for column in found)
        near = max(SETTINGS.stray * np.ptp(drag), SETTINGS.leap * coarse * self.after)
        strayed = time[-1] >= SETTINGS.long and abs(drag[-1] - self.after) > near
        if outcome != Outcome.CONVERGED or strayed:
            return _failed(asked.times, Outcome(outcome) if outcome else Outcome.NOT_STEADY)
        ends = np.array([self.after, self.depth[1]])
        path = np.stack([time, drag, depth])
        rates, falls = np.stack([drag_rate, rate]), bool(self.deborah[1] < self.deborah[0])
        trace, sinking = _at_times(time, path[1:], rates, asked.times, ends, falls)
        path[2] -= self.line.cells.top
        return jump._replace(trace=trace, depth=sinking - self.line.cells.top, path=path)

    def begun(self, limits: tuple[float, float], moments: int) -> tuple[Marching, Trajectory, Workspace]:
        """Return a march between two depths at its first moment, with room for all of them."""
        found = Trajectory(*np.empty((6, moments)))
        for column, value in zip(found, (0.0, 0.0, self.depth[0], self.rate, self.at, np.nan), strict=True):
            column[0] = value
        reachable = _reachable(self.line.track, self.slower, limits)
        onset = self.pace.first / (self.pace.growth - 1)
        marching = Marching(self.line.track, self.first, reachable, self.deborah[1], self.load, *limits, onset)
        barriers, clearance = self.line.barriers(self.deborah[1]), clearance_from(reachable.from_depth - self.depth[0])
        return marching, found, workspace_for(self.first.count, barriers, clearance)

    def retrace(self, path: FloatArray) -> FloatArray:
        """Return the path on this grid at the moments of a path on another one, NaN where none is found."""
        top, found = self.line.cells.top, path.copy()
        depths = path[2] + top
        for limits in self.limits(np.append(depths + (self.depth[0] - depths[0]), self.depth)):
            marching, trajectory, work = self.begun(limits, path.shape[1])
            trajectory.time[:], trajectory.place[:] = path[0], np.log1p(path[0] / marching.onset)
            outcome = retrace(marching, depths, trajectory, work)
            if outcome == Outcome.CONVERGED:
                found[1], found[2] = trajectory.drag, trajectory.depth - top
                return found
        found[1:] = np.nan
        return found


def _reachable(track: Track, slower: Patches, limits: tuple[float, float]) -> Reachable:
    """Return where elements can be in contact between two depths."""
    begin, end = int(np.ceil(slower.end[0])), int(slower.start[-1])
    return Reachable(*_runs(track, slower, limits), float(np.max(track.peak[begin:end], initial=-np.inf)))


@jit
def _runs(track: Track, slower: Patches, limits: tuple[float, float]) -> tuple[IntArray, FloatArray]:
    """Return where elements can be in contact between two depths, and up to which depth those of a cell are not.

    The steady state at the lower velocity bounds them: where the depth is less by some length, displacements are less
    by that length at most.
    """
    (low, high), cells, decay = limits, track.peak.size, np.exp(-1 / slower.deborah)
    from_depth = np.full(cells + 1, -np.inf)
    for k in range(slower.count):
        first = int(slower.end[k]) + 1  # node in flight
        last = int(np.ceil(slower.start[k + 1])) - 1 if k + 1 < slower.count else cells
        free = slower.pressed[k] * np.exp(-(first - slower.end[k]) / slower.deborah)
        for i in range(first, last):
            free *= decay
            from_depth[i] = free - (slower.depth - low) - track.peak[i]
    runs, count = np.empty((cells // 2 + 1, 2), np.int64), 0
    for i in range(cells):
        if high > from_depth[i]:
            begin, end = max(i - 1, 0), min(i + 2, cells)
            if count > 0 and begin <= runs[count - 1, 1]:
                runs[count - 1, 1] = end
            else:
                runs[count, 0], runs[count, 1] = begin, end
                count += 1
    return runs[:count], from_depth


def _at_times(
    moments: FloatArray, rows: FloatArray, rates: FloatArray, times: FloatArray, after: FloatArray, falls: bool
) -> FloatArray:
    """Interpolate rows of values and their rates over log time.

    In the first step friction goes as the time; where the velocity falls as its root, as contact grows behind a patch.
    """
    scale, power = moments[1], 0.5 if falls else 1.0
    x, places = (np.log1p((each / scale) ** power) for each in (moments, times))
    grown = (moments / scale) ** power
    pace = scale / power * (1 + grown) * grown ** (1 / power - 1)
    traces = np.empty((len(rows), times.size))
    for row, rate, trace in zip(rows, rates, traces, strict=True):
        curve_through(x, row, rate * pace, places, trace)
    traces[:, times > moments[-1]] = after[:, None]
    return traces
