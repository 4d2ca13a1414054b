"""Friction after a velocity jump at constant load, on one periodic line.

The march (the sequence of time steps) starts from steady sliding at v_1 and ends when sliding is steady at v_2. The
method is that of section 4.2 of the thesis, except that the velocity of the elements includes the rate of the depth.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.kelvin import DRAG_RATE
from mdr_dask.physics.transients.contact_search import Reachable, Workspace, workspace_for
from mdr_dask.physics.transients.limits import PreparedLine, SteadyLimits
from mdr_dask.physics.transients.march import LEFT_LIMITS, Finish, Marching, Stepping, Trajectory, march_depth
from mdr_dask.physics.transients.patches import Patches, Track

# The steps grow in a constant ratio after ONSET times the time in which the line travels 1 / q_max, where q_max is the
# largest wavenumber.
ONSET = 0.5
ROOT = 10.0  # the first step is smaller by this factor if the velocity falls, because contact then grows as sqrt(t)
# NEWTON and SETTLED are divided by the number of steps per decade
NEWTON = 0.2  # largest last Newton step of the depth, divided by the change of the steady depth
# A march ends if depth and drag differ from the steady values by less than a certain fraction of their change. The
# fraction is SETTLED or, if larger, OF_ACCURACY times the allowed error of the drag divided by the estimated transient.
SETTLED = 0.04
OF_ACCURACY = 0.1
NEGLIGIBLE = 1e-5  # least change of the steady depth that is used, divided by the mean displacement
# the march has failed if, after LONG relaxation times, the drag differs from the steady drag by more than
# NOT_STEADY[0] times the range of the drag plus NOT_STEADY[1] times the steady drag
LONG, NOT_STEADY = 15.0, (0.02, 1e-3)
# The depth may leave the interval between the steady depths by MARGIN times the length of this interval. If the depth
# leaves the interval by more, the march is repeated with four times this margin. At most WIDENINGS attempts are made.
MARGIN, WIDENINGS = 0.25, 3
SHALLOW = 0.01  # least depth of a march, divided by the smaller steady depth
MOMENTS = 3000  # largest number of instants of a march
STEEPEST = 3.0  # largest ratio of a slope to the smaller slope of the adjacent secants; steeper cubics may overshoot


class MarchRequest(NamedTuple):
    """Requested times and accuracy of a march.

    `times` are increasing times after the jump, (t - t_0) / tau. `wavenumber` is the largest wavenumber of the line
    times its length, q_max L; it determines the first step. `per_decade` is the number of steps per factor of ten in
    time. `accuracy` is the allowed error of the friction, divided by the steady friction after the jump. A transient
    below this error is not marched, and a larger allowed error lets a march end earlier. With ``accuracy = 0`` every
    transient is marched.
    """

    times: FloatArray
    wavenumber: float
    per_decade: float = 24.0
    accuracy: float = 0.0


class Path(NamedTuple):
    """Drag and depth at the instants of a march, and their rates, shape (2, instants) each.

    Times since the jump are divided by the relaxation time. The first rate of the drag is unknown and is NaN. `falls`
    is True if the velocity falls.
    """

    time: FloatArray
    values: FloatArray
    rates: FloatArray
    falls: bool

    def at(self, times: FloatArray, after: FloatArray) -> FloatArray:
        """Return drag and depth at increasing times, shape (2, times).

        Between instants both are cubic in log(1 + t / t_1), where t_1 is the first instant after the jump. If the
        velocity falls, t / t_1 is replaced by its square root, because contact then grows as sqrt(t) at the trailing
        edge of every patch. After the last instant drag and depth are equal to the steady values in `after`.
        """
        power = 0.5 if self.falls else 1.0
        moments, wanted = (self.time / self.time[1]) ** power, (times / self.time[1]) ** power
        pace = self.time[1] / power * (1 + moments) * moments ** (1 / power - 1)
        curve = _limited_cubic(np.log1p(moments), self.values, self.rates * pace, np.log1p(wanted))
        return np.where(times > self.time[-1], after[:, None], curve)


def _limited_cubic(x: FloatArray, rows: FloatArray, slopes: FloatArray, places: FloatArray) -> FloatArray:
    """Interpolate curves by cubics with given slopes, and return the values at `places`.

    Each row contains the points of one curve. If the first slope of a row is NaN, the first piece is a parabola. A
    slope that is much steeper than the secants at its point is due to a single asperity that enters or leaves contact.
    Such a slope is reduced, so that the cubic does not overshoot.
    """
    secants = np.diff(rows) / np.diff(x)
    beside = np.abs(secants)[:, [0, *range(x.size - 1), -1]]
    most = STEEPEST * np.minimum(beside[:, :-1], beside[:, 1:])
    tangents = np.clip(slopes, -most, most)
    tangents[:, 0] = np.where(np.isnan(slopes[:, 0]), 2 * secants[:, 0] - tangents[:, 1], tangents[:, 0])
    # importing scipy.interpolate would take longer than a small study
    piece = np.clip(np.searchsorted(x, places, side="right") - 1, 0, x.size - 2)
    length = np.diff(x)[piece]
    t = (places - x[piece]) / length
    rise = rows[:, piece + 1] - rows[:, piece]
    begin, end = length * tangents[:, piece], length * tangents[:, piece + 1]
    curve: FloatArray = rows[:, piece] + t * (begin + t * (3 * rise - 2 * begin - end + t * (begin + end - 2 * rise)))
    return curve


class Jump(NamedTuple):
    """Drag F_x / (4 G L) and depth at the requested times after a velocity jump.

    `path` is None if there was no march. `left_out` is the estimated size of a transient that was not marched because
    it is smaller than the allowed error; otherwise 0.
    """

    trace: FloatArray
    depth: FloatArray
    path: Path | None
    left_out: float
    outcome: Outcome


def jump_between(
    line: PreparedLine, load: float, deborah: FloatArray, limits: SteadyLimits, request: MarchRequest
) -> Jump:
    """Return the friction of a Kelvin foundation after one velocity jump at constant load, from its steady limits.

    The load is F_N / (4 G L), in the unit of height. `deborah` contains v_1 tau / L and v_2 tau / L.
    """
    times = request.times
    if limits.outcome != Outcome.CONVERGED:
        return _failed(times, limits.outcome)
    after, depth = np.full(times.size, limits.after), np.full(times.size, limits.depth[1])
    settled = Jump(after, depth, None, 0.0, limits.outcome)
    if limits.is_full:  # in full contact u = d + h and the depth is constant: there is no transient
        return settled
    relaxation = _Relaxation(line, load * line.track.cells, deborah * line.track.cells, limits, request)
    transient = relaxation.transient() if request.accuracy > 0 else np.inf
    if transient <= request.accuracy * limits.after:
        trace = np.where(times > 0, limits.after, limits.at)
        return settled._replace(trace=trace, depth=limits.depth[np.int64(times > 0)], left_out=transient)
    path, outcome = relaxation.march(transient)
    if path is None:
        return _failed(times, outcome)
    trace, depth = path.at(times, np.array([limits.after, limits.depth[1]]))
    return settled._replace(trace=trace, depth=depth, path=path)


def _failed(times: FloatArray, outcome: Outcome) -> Jump:
    nothing = np.full(times.size, np.nan)
    return Jump(nothing, nothing, None, 0.0, outcome)


class _Relaxation(NamedTuple):
    """One jump: the line, the load, the two Deborah numbers, and the steady states; lengths are in cells."""

    line: PreparedLine
    load: float
    deborah: FloatArray
    limits: SteadyLimits
    request: MarchRequest

    @property
    def ends(self) -> FloatArray:
        """Steady depth of the highest point before and after the jump."""
        ends: FloatArray = self.limits.depth + self.line.cells.top
        return ends

    @property
    def change(self) -> float:
        """Change of the steady depth due to the jump; allowed errors of the depth are fractions of this change."""
        return max(abs(float(np.diff(self.limits.depth)[0])), NEGLIGIBLE * self.load / self.line.track.cells)

    @property
    def stepping(self) -> Stepping:
        """Sizes of the time steps.

        The steps grow in a constant ratio after `ONSET` times the time in which the line travels 1 / q_max at the speed
        v_2, but at the latest after `ONSET` relaxation times. If the velocity falls, contact at the trailing edge of a
        patch grows at the speed v_1 - v_2; this speed replaces v_2 if it is larger.
        """
        before, after = self.deborah / self.line.track.cells
        growth = 10 ** (1 / self.request.per_decade)
        onset = ONSET * min(1.0, 1 / (self.request.wavenumber * max(after, before - after)))
        times = self.request.times
        if after < before:
            onset = min(onset / ROOT, float(times[times > 0][0]) / (growth - 1))
        part = self.change / self.request.per_decade
        return Stepping(onset * (growth - 1), growth, part, NEWTON * part, float(times[-1]))

    def transient(self) -> float:
        """Estimate the size of the transient, with a safety factor of two.

        As the drag may cross its steady value, three terms are added: the change of the drag after the jump, the drag
        due to the rate of the depth just after the jump, and the drag due to the change of the depth.
        """
        _, sums = self.line.patches(self.ends[1], self.deborah[1])
        by_depth = abs(sums[DRAG_RATE] * (self.ends[1] - self.ends[0]))
        limits = self.limits
        return float(2 * (abs(limits.at - limits.after) + abs(limits.rate * limits.tilt) + by_depth))

    @property
    def intervals(self) -> Iterator[tuple[float, float]]:
        """Wider and wider intervals around the steady depths."""
        low, high = float(self.ends.min()), float(self.ends.max())
        margin = MARGIN * (high - low) + NEGLIGIBLE * self.load / self.line.track.cells
        for _ in range(WIDENINGS):
            yield max(low - margin, SHALLOW * low), high + margin
            margin *= 4

    def march(self, transient: float) -> tuple[Path | None, Outcome]:
        """March from one steady state to the next; return the path (None if the march failed) and the outcome."""
        after, request = self.limits.after, self.request
        near = max(SETTLED / request.per_decade, OF_ACCURACY * request.accuracy * after / max(transient, 1e-300))
        finish = Finish(float(self.ends[1]), after, near * self.change, near)
        for interval in self.intervals:
            marching, found, work = self.begun(interval)
            count, outcome = march_depth(marching, self.stepping, finish, found, work)
            if outcome != LEFT_LIMITS:
                break
        else:
            return None, Outcome.DEPTH_NOT_FOUND
        found = Trajectory(*(column[:count] for column in found))
        values = np.stack([found.drag, found.depth - self.line.cells.top])  # depth relative to the mean line
        falls = bool(self.deborah[1] < self.deborah[0])
        path = Path(found.time, values, np.stack([found.drag_rate, found.rate]), falls)
        if outcome != Outcome.CONVERGED:
            return None, Outcome(outcome)
        drag = path.values[0]
        if path.time[-1] >= LONG and abs(drag[-1] - after) > NOT_STEADY[0] * np.ptp(drag) + NOT_STEADY[1] * after:
            return None, Outcome.NOT_STEADY
        return path, Outcome.CONVERGED

    def begun(self, interval: tuple[float, float]) -> tuple[Marching, Trajectory, Workspace]:
        """Return the constants, trajectory and workspace of a march whose depth stays in an interval.

        Only the first instant of the trajectory is filled in.
        """
        line, limits, stepping = self.line, self.limits, self.stepping
        assert limits.first is not None
        assert limits.slower is not None
        found = Trajectory(*np.empty((6, MOMENTS)))
        for column, value in zip(found, (0.0, 0.0, self.ends[0], limits.rate, limits.at, np.nan), strict=True):
            column[0] = value
        runs, bound = _runs(line.track, limits.slower, *interval)
        begin, end = int(np.ceil(limits.slower.end[0])), int(limits.slower.start[-1])
        reachable = Reachable(runs, float(np.max(line.track.peak[begin:end], initial=-np.inf)))
        onset = stepping.first / (stepping.growth - 1)
        marching = Marching(line.track, limits.first, reachable, self.deborah[1], self.load, *interval, onset)
        patches, barriers = limits.first.start.size, line.barriers(self.deborah[1])
        return marching, found, workspace_for(patches, barriers, bound - self.ends[0])


@jit
def _runs(track: Track, slower: Patches, low: float, high: float) -> tuple[IntArray, FloatArray]:
    """Return the runs of cells where contact is possible at depths from `low` to `high`, and a bound for each cell.

    A run is given by its first and last node. The bound is the largest depth at which the cell is certainly out of
    contact. It follows from the steady state at the lower velocity: at a smaller depth, the displacements are smaller
    by at most the difference of the two depths.
    """
    cells, decay = track.peak.size, np.exp(-1 / slower.deborah)
    bound = np.full(cells + 1, -np.inf)
    for k in range(slower.start.size):
        first = int(slower.end[k]) + 1  # first node beyond the patch
        last = int(np.ceil(slower.start[k + 1])) - 1 if k + 1 < slower.start.size else cells
        free = slower.pressed[k] * np.exp(-(first - slower.end[k]) / slower.deborah)
        for i in range(first, last):
            free *= decay
            bound[i] = free - (slower.depth - low) - track.peak[i]
    runs, count = np.empty((cells // 2 + 1, 2), np.int64), 0
    for i in range(cells):
        if high > bound[i]:
            begin, end = max(i - 1, 0), min(i + 2, cells)
            if count > 0 and begin <= runs[count - 1, 1]:
                runs[count - 1, 1] = end
            else:
                runs[count, 0], runs[count, 1] = begin, end
                count += 1
    return runs[:count], bound
