"""Friction after a velocity jump at constant load, on one periodic line.

The march (the sequence of time steps) starts from steady sliding at v_1 and ends when sliding is steady at v_2. The
method is described in section 4.2 of the thesis. In contrast to the thesis, the velocity of the elements includes the
rate of the depth.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.jit import jit, last_until
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.transients.contact_search import Reachable, Workspace, workspace_for
from mdr_dask.physics.transients.limits import PreparedLine, SteadyLimits
from mdr_dask.physics.transients.march import Marching, Trajectory, march_depth
from mdr_dask.physics.transients.patches import Patches, Track

NEGLIGIBLE = 1e-5  # smallest assumed change of the steady depth, as a fraction of the mean displacement
MEMORY = 7.0  # relaxation times until a march ends; the displacements at the jump have then decayed to less than 0.1 %
STEEPEST = 3.0  # a cubic does not overshoot if both end slopes are at most 3 times the secant (Fritsch and Carlson)


class MarchRequest(NamedTuple):
    """Requested times and time steps of a march.

    `times` are increasing times after the jump, (t - t_0) / tau. `wavenumber` is q_max L, the largest wavenumber of the
    line times the length of the line. The first time step depends on `wavenumber`. `per_decade` is the number of time
    steps per factor of ten in time.
    """

    times: FloatArray
    wavenumber: float
    per_decade: float


class Path(NamedTuple):
    """Drag and depth at the instants of a march, and the rates of drag and depth, shape (2, instants) each.

    Times since the jump are divided by the relaxation time, and rates are derivatives with respect to these times. The
    first rate of the drag is unknown and is NaN. `falls` is True if the velocity falls.
    """

    time: FloatArray
    values: FloatArray
    rates: FloatArray
    falls: bool

    def at(self, times: FloatArray, after: FloatArray) -> FloatArray:
        """Return drag and depth at increasing times, shape (2, times).

        Between instants, drag and depth are cubic in log(1 + t / t_1), where t_1 is the first instant after the jump.
        If the velocity falls, contact grows as sqrt(t) at the trailing edge of every patch. In this case, t / t_1 is
        replaced by sqrt(t / t_1). After the last instant, drag and depth are the steady values in `after`.
        """
        power = 0.5 if self.falls else 1.0
        passed, wanted = (self.time / self.time[1]) ** power, (times / self.time[1]) ** power
        pace = self.time[1] / power * (1 + passed) * passed ** (1 / power - 1)
        curve = _limited_cubic(np.log1p(passed), self.values, self.rates * pace, np.log1p(wanted))
        return np.where(times > self.time[-1], after[:, None], curve)


@jit
def _limited_cubic(x: FloatArray, rows: FloatArray, slopes: FloatArray, places: FloatArray) -> FloatArray:
    """Interpolate curves by cubics with given slopes, and return the values at `places`.

    Each row of `rows` contains the values of one curve at `x`. If the first slope of a row is NaN, the first piece is a
    parabola. A slope is reduced if the cubic would overshoot, for example where a single asperity enters or leaves
    contact. The reduced slopes are written to `slopes`.
    """
    curves = np.empty((rows.shape[0], places.size))
    for r in range(rows.shape[0]):
        row, slope = rows[r], slopes[r]
        first = before = (row[1] - row[0]) / (x[1] - x[0])
        starts_as_parabola = np.isnan(slope[0])
        for k in range(x.size):
            after = (row[k + 1] - row[k]) / (x[k + 1] - x[k]) if k + 1 < x.size else before
            most = STEEPEST * min(abs(before), abs(after))
            slope[k], before = min(max(slope[k], -most), most), after
        if starts_as_parabola:
            slope[0] = 2 * first - slope[1]
        for i in range(places.size):
            k = last_until(x, places[i], x.size - 1)
            length, rise = x[k + 1] - x[k], row[k + 1] - row[k]
            t, begin, end = (places[i] - x[k]) / length, length * slope[k], length * slope[k + 1]
            curves[r, i] = row[k] + t * (begin + t * (3 * rise - 2 * begin - end + t * (begin + end - 2 * rise)))
    return curves


class Jump(NamedTuple):
    """Drag F_x / (4 G L) and depth at the requested times after a velocity jump.

    `path` is None in full contact, where there is no transient, and if the jump was not solved. In the second case,
    drag and depth are NaN.
    """

    trace: FloatArray
    depth: FloatArray
    path: Path | None
    outcome: Outcome


def jump_between(
    line: PreparedLine, load: float, deborah: FloatArray, limits: SteadyLimits, request: MarchRequest
) -> Jump:
    """Return the friction of a Kelvin foundation after one velocity jump at constant load, given the steady limits.

    The load is F_N / (4 G L), in the unit of height. `deborah` contains v_1 tau / L and v_2 tau / L.
    """
    times = request.times
    if limits.outcome != Outcome.CONVERGED:
        return _failed(times, limits.outcome)
    if limits.is_full:  # in full contact u = d + h and the depth is constant; therefore there is no transient
        return Jump(np.full(times.size, limits.after), np.full(times.size, limits.depth[1]), None, limits.outcome)
    _, found, _, outcome = march(line, load, deborah, limits, request)
    if outcome != Outcome.CONVERGED:
        return _failed(times, outcome)
    values = np.stack([found.drag, found.depth - line.cells.top])  # depth relative to the mean line
    path = Path(found.time, values, np.stack([found.drag_rate, found.rate]), bool(deborah[1] < deborah[0]))
    trace, depth = path.at(times, np.array([limits.after, limits.depth[1]]))
    return Jump(trace, depth, path, limits.outcome)


def _failed(times: FloatArray, outcome: Outcome) -> Jump:
    nothing = np.full(times.size, np.nan)
    return Jump(nothing, nothing, None, outcome)


def march(
    line: PreparedLine, load: float, deborah: FloatArray, limits: SteadyLimits, request: MarchRequest
) -> tuple[Marching, Trajectory, Workspace, Outcome]:
    """March from the steady state before the jump. Return constants, trajectory and workspace, and the outcome.

    In the march, lengths are in cells, and the load is F_N / (4 G dx). The depth may leave the interval between the two
    steady depths by a margin, which is at first as large as the interval, but not below a minimum (`NEGLIGIBLE`). If
    the march fails, it is repeated with 4 times and then with 16 times this margin, because the margin may have been
    too small.
    """
    cells = line.track.cells
    load, deborah = load * cells, deborah * cells
    change = max(abs(float(np.diff(limits.depth)[0])), NEGLIGIBLE * load / cells)
    for widening in (1, 4, 16):
        marching, found, work = _begun(line, load, deborah, limits, request, change, widening * change)
        outcome = Outcome(march_depth(marching, found, work))
        if outcome == Outcome.CONVERGED:
            break
    return marching, found, work, outcome


def _begun(
    line: PreparedLine,
    load: float,
    deborah: FloatArray,
    limits: SteadyLimits,
    request: MarchRequest,
    change: float,
    margin: float,
) -> tuple[Marching, Trajectory, Workspace]:
    """Return the constants, trajectory and workspace of a march. Lengths are in cells.

    `change` is the magnitude of the change of the steady depth, or a minimum (`NEGLIGIBLE`) if that is larger. The
    depth may leave the interval between the steady depths by `margin`. The march ends at the last requested time, but
    after `MEMORY` relaxation times at the latest. The times are equidistant in log(1 + t / onset). The onset is the
    time in which the line travels 1 / q_max at the larger of the speeds v_2 and v_1 - v_2, but at most one relaxation
    time. If the velocity falls, the onset is also so small that the first time step ends no later than the first
    requested time after the jump.
    """
    assert limits.first is not None
    assert limits.slower is not None
    before, after = deborah / line.track.cells
    onset = min(1.0, 1 / (request.wavenumber * max(after, before - after)))
    if after < before:  # contact grows as sqrt(t), and the first step must not end after the first requested time
        onset = min(onset, float(request.times[request.times > 0][0]) / (10 ** (1 / request.per_decade) - 1))
    until = min(request.times[-1], MEMORY)
    last = np.log1p(until / onset)
    steps = int(np.ceil(last / np.log(10) * request.per_decade))
    found = Trajectory(onset * np.expm1(np.linspace(0, last, steps + 1)), *np.empty((4, steps + 1)))
    found.time[-1] = until  # without rounding error, because a result may be requested at this time
    ends = limits.depth + line.cells.top  # depths of the highest point
    for column, value in zip(found[1:], (ends[0], limits.rate, limits.at, np.nan), strict=True):
        column[0] = value
    low, high = max(ends.min() - margin, 0.0), ends.max() + margin
    runs, free_until = _runs(line.track, limits.slower, low, high)
    begin, end = int(np.ceil(limits.slower.end[0])), int(limits.slower.start[-1])
    reachable = Reachable(runs, float(np.max(line.track.peak[begin:end], initial=-np.inf)))
    # with this limit, the error of Newton's method is of fourth order in the time step
    close = change / request.per_decade**2
    marching = Marching(line.track, limits.first, reachable, deborah[1], load, low, high, onset, last / steps, close)
    return marching, found, workspace_for(line.barriers(deborah[1]), free_until)


@jit
def _runs(track: Track, slower: Patches, low: float, high: float) -> tuple[IntArray, FloatArray]:
    """Return the first and the last node of each run of cells where contact is possible at depths from `low` to `high`.

    A run also contains the neighbouring cell on each side. Also return, for each cell, the largest depth at which the
    cell is certainly out of contact, or -inf if no such depth is known.
    """
    cells, decay = track.peak.size, np.exp(-1 / slower.deborah)
    bound = np.full(cells + 1, -np.inf)
    for k in range(slower.start.size):
        first = int(slower.end[k]) + 1  # first node beyond the patch
        last = int(np.ceil(slower.start[k + 1])) - 1 if k + 1 < slower.start.size else cells
        free = slower.pressed[k] * np.exp(-(first - slower.end[k]) / slower.deborah)
        for i in range(first, last):
            free *= decay
            # at a smaller depth, displacements are smaller by at most the difference of the two depths
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
