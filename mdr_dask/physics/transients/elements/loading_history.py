"""Friction under any loading history, from the motion of every element, with an error of second order in the time step.

Times are in the unit of time of the solid. Travel is divided by the length of the line. Loads are F_N / (4 G_inf L) in
the unit of height.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import CLOSE
from mdr_dask.physics.sliding.viscoelastic import solve_sliding, static_depth, travelling
from mdr_dask.physics.solids import LinearSolid
from mdr_dask.physics.surfaces.cubic_line import CubicLine
from mdr_dask.physics.transients.elements.foundation import (
    Foundation,
    advance,
    free_after,
    lapse_of,
    recover,
    release,
)
from mdr_dask.physics.transients.elements.steps import Edges, Schedule, State, follow_elements, note_edges


class Response(NamedTuple):
    """Forces and depth at every instant of a loading history, and the state of the elements at the end.

    The drag is F_x / (4 G_inf L), in the unit of height squared divided by the unit of length. `contact` is the
    fraction of the line in contact. If a time step fails, all values from this step on are NaN.
    """

    drag: FloatArray
    depth: FloatArray
    contact: FloatArray
    status: Outcome
    state: State


def untouched(elements: int, terms: int) -> State:
    """Return the state of elements that have never been in contact."""
    edges = Edges(np.full(elements, -1.0), np.zeros(elements))
    strains = np.zeros((2, elements, terms))
    touching = np.zeros(elements, np.bool_)
    return State(np.zeros(elements), strains[0], np.zeros(elements), strains[1], touching, edges)


def steady_start(line: CubicLine, solid: Foundation, deborah: float, load: float) -> tuple[State, float, Outcome]:
    """Return the state of the elements at the nodes in steady sliding, the depth, and the outcome.

    The solver of steady sliding finds the depth and, on a periodic line, the stretches of the Prony terms at the
    highest node. One element is then moved along the line, by the method of :func:`follow_line`. Both calculations use
    a line with an additional node in the middle of every cell. At ``deborah = 0`` the elements are in equilibrium at
    rest under the load.
    """
    state, outcome = untouched(line.height.size - 1, solid.times.size), Outcome.CONVERGED
    if deborah > 0:
        depth, outcome = _slide(_halved(line), solid, deborah, load, state)
    else:
        depth = _rest(line, load, state)
    if outcome == Outcome.CONVERGED:
        note_edges(solid, line, state, depth, deborah, load)
        if not line.periodic and (state.touching[0] or state.touching[-1]):
            outcome = Outcome.OUTSIDE_LINE
    return state, depth, outcome


def _halved(line: CubicLine) -> CubicLine:
    """Return the same line with an additional node in the middle of every cell."""
    n = line.enter.size
    height, enter, leave = np.empty(2 * n + 1), np.empty(2 * n), np.empty(2 * n)
    height[::2] = line.height
    height[1::2] = 0.5 * (line.height[:-1] + line.height[1:]) + (line.enter - line.leave) / 8
    enter[::2], leave[1::2] = line.enter / 2, line.leave / 2
    leave[::2] = enter[1::2] = 0.75 * np.diff(line.height) - (line.enter + line.leave) / 8
    return CubicLine(height, enter, leave, line.periodic, line.smooth)


def _rest(line: CubicLine, load: float, state: State) -> float:
    """Write the state of all elements in equilibrium under a body at rest. Return the depth."""
    height = line.height[:-1]
    depth = static_depth(height, load * height.size)
    state.displacement[:] = np.maximum(depth + height, 0)
    state.terms[:] = state.displacement[:, None]
    state.touching[:] = depth + height > 0
    return depth


def _slide(line: CubicLine, solid: Foundation, deborah: float, load: float, state: State) -> tuple[float, Outcome]:
    """Write the state of all elements in steady sliding. Return the depth and the outcome."""
    cells, summit = line.height.size - 1, float(line.height.max())
    first, height = 0, line.height
    if line.periodic:
        first = int(np.argmax(height))
        height = np.roll(height[:-1], -first)
        height = np.append(height, summit)
    below = height - summit
    sliding = travelling(LinearSolid(1.0, solid.moduli, solid.times * deborah, solid.viscosity * deborah), 1 / cells)
    at_rest = static_depth(below[:-1], load * cells)
    unknown = np.append(np.full(sliding.moduli.size, at_rest - load), at_rest)
    outcome = Outcome(solve_sliding(below, load * cells, line.periodic, sliding, unknown, np.empty(6)))
    depth, strains = float(unknown[-1]) - summit, np.zeros(solid.times.size)
    if line.periodic:
        strains[:] = unknown[-1]
        slow = sliding.deborah > CLOSE  # the stretches of all other Prony terms of `solid` have relaxed
        strains[strains.size - np.count_nonzero(slow) :] -= unknown[:-1][slow]
    if outcome == Outcome.CONVERGED:
        _pass_along(line, solid, deborah, depth, first, strains, state)
    return depth, outcome


@jit
def _pass_along(
    line: CubicLine, solid: Foundation, deborah: float, depth: float, first: int, strains: FloatArray, state: State
) -> None:
    """Move one element along the line at constant depth, and write the state of all elements.

    At the node `first`, the dashpots of the Prony terms have the given `strains`. On a periodic line, the element is
    moved along the line twice, because its state as a free element is known only after the first period.
    """
    n = line.height.size - 1
    # every k-th node belongs to an element, with k = `every`
    every, step = n // state.displacement.size, 1 / (n * deborah)
    lapse = lapse_of(solid, step)
    terms, free_terms = np.zeros((1, strains.size)), np.zeros((1, strains.size))
    terms[0][:] = strains
    u, free = max(depth + line.height[first], 0.0), 0.0
    touching = u > 0
    for cell in range(2 * n if line.periodic else n):
        i = (first + cell) % n
        if not touching:
            free = u
            free_terms[0][:] = terms[0]
        if i % every == 0:
            j = i // every
            state.displacement[j], state.touching[j], state.free[j] = u, touching, free
            state.terms[j][:] = terms[0]
            state.free_terms[j][:] = free_terms[0]
        w0, w1 = depth + line.height[i], depth + line.height[i + 1]
        part, leaves = 0.0, u
        if touching:
            rates = deborah * n * line.enter[i], deborah * n * line.leave[i]
            part, leaves = release(solid, lapse, w0, w1, rates[0], rates[1], terms, 0)
        after = free_after(solid, lapse, u, part if part < 1 else 0.0, leaves, terms, 0)
        free = recover(solid, free, free_terms, 0, lapse.decay, lapse.modes)
        u, touching = advance(solid, lapse, w0, w1, u, touching, part, leaves, after, terms, 0)


def follow_line(line: CubicLine, solid: Foundation, schedule: Schedule, state: State, depth: float) -> Response:
    """Compute the motion of every element of a linear foundation under a line.

    During a time step, an element in contact moves at constant speed, and a free element recovers by the modes of the
    solid. The mean displacement depends on the load, but not on which elements are in contact. The depth for this mean
    is the root of a convex function. If the line is not periodic, elements enter undeformed. Between two elements, the
    force is interpolated linearly. In cells with full contact, the integrals are corrected for the curvature of the
    force where it is known. The integrals are most accurate if the line has no kinks. `state` and `depth` describe the
    first instant and are not overwritten.
    """
    now, out = deepcopy(state), np.full((3, schedule.instants.size), np.nan)
    status = follow_elements(solid, line, schedule, now, depth, out)
    drag, depths, contact = out
    return Response(drag, depths, contact, Outcome(status), now)


MOST_STEPS = 400_000  # largest number of time steps in one piece of a history
# CELLS and PART are divided by the number of steps per decade
CELLS = 6.0  # largest number of cells that the line travels in a time step
# A time step is at most this fraction of the duration of a ramp, or of the period of an oscillation. The first time
# step is this fraction of the longest step, or of the unit of time if that is shorter.
PART = 0.12


@dataclass(frozen=True)
class Piece:
    """Velocity and load between the times `start` and `end`: linear in time, plus an optional sine from `start` on."""

    start: float
    end: float
    velocity: tuple[float, float]
    force: tuple[float, float]
    swing: tuple[float, float, float] = (0.0, 0.0, 0.0)  # the sine: amplitudes of velocity and load, angular frequency

    def scaled(self, time: float, velocity: float, force: float) -> Piece:
        """Return the piece in units of the given time, velocity and force."""
        swing = self.swing[0] / velocity, self.swing[1] / force, self.swing[2] * time
        ends = (
            (self.velocity[0] / velocity, self.velocity[1] / velocity),
            (self.force[0] / force, self.force[1] / force),
        )
        return Piece(self.start / time, self.end / time, *ends, swing)

    def at(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the travel since `start`, the velocity and the load at given times."""
        late = time - self.start
        width = self.end - self.start
        part = late / width if np.isfinite(width) else 0 * late
        rise = self.velocity[1] - self.velocity[0]
        speed = self.velocity[0] + rise * part
        travel = late * (self.velocity[0] + 0.5 * rise * part)
        force = self.force[0] + (self.force[1] - self.force[0]) * part
        amplitude, load, omega = self.swing
        if omega:
            speed = speed + amplitude * np.sin(omega * late)
            travel = travel + amplitude / omega * (1 - np.cos(omega * late))
            force = force + load * np.sin(omega * late)
        return travel, speed, force

    @property
    def changes_in(self) -> float:
        """Period of the sine or, without a sine, duration of the ramp; infinity if velocity and load are constant."""
        if self.swing[2]:
            return 2 * np.pi / self.swing[2]
        same = self.velocity[0] == self.velocity[1] and self.force[0] == self.force[1]
        return np.inf if same else self.end - self.start

    def longest_step(self, nodes: int, per_decade: float) -> float:
        """Return the longest time step that resolves the travel of the line and the changes of velocity and load."""
        fastest = max(abs(self.velocity[0]), abs(self.velocity[1])) + self.swing[0]
        most = CELLS / (nodes * fastest) if fastest else np.inf
        return min(most, PART * self.changes_in) / per_decade

    def instants(self, end: float, nodes: int, per_decade: float) -> FloatArray | None:
        """Return the times of all steps from the start of the piece to `end`, or None if there would be too many steps.

        After a short first time step, the time since the start of the piece grows in a constant ratio, until the time
        steps are as long as the longest time step. All further time steps are equal. If `end` is not after the start of
        the piece, the only time is the start.
        """
        span = end - self.start
        if span <= 0:
            return np.array([self.start])
        most = min(self.longest_step(nodes, per_decade), span)
        if span / most > MOST_STEPS:
            return None
        first, ratio = PART / per_decade * min(most, 1.0), 10 ** (1 / per_decade)
        grown = first * ratio ** np.arange(int(np.ceil(np.log(most / (first * (ratio - 1)) + 1) / np.log(ratio))) + 1)
        grown = grown[(grown < span) & (np.diff(grown, append=np.inf) < most)]
        late = grown[-1] if grown.size else 0.0
        count = max(int(np.ceil((span - late) / most)), 1)
        rest = late + (span - late) * np.arange(1, count + 1) / count
        instants: FloatArray = self.start + np.concatenate([[0.0], grown, rest])
        instants[-1] = end  # without rounding error: the next piece begins at `end`, and `end` may be requested
        return instants


class Trace(NamedTuple):
    """Friction during a history.

    The friction is F_x / F_N, in the unit of height divided by the unit of length. `before` is the friction in the
    steady state before t = 0. `at` is the friction just after t = 0. `after` is the friction in the final steady state.
    `after` is NaN if the history does not end in steady forward sliding, or if this steady state is not found. At a
    jump, `friction` and `depth` are the values just after the jump. `contact` is the largest fraction of the line in
    contact from t = 0 to the last requested time. If the outcome is not CONVERGED, all numbers are NaN.
    """

    before: float
    at: float
    after: float
    friction: FloatArray
    depth: FloatArray
    contact: float
    outcome: Outcome


def trace(
    line: CubicLine,
    solid: Foundation,
    before: tuple[float, float],
    pieces: Sequence[Piece],
    times: FloatArray,
    per_decade: float,
) -> Trace:
    """Compute the friction of a body during a history, from the motion of every element.

    Until t = 0 the body slides steadily with the velocity and the load in `before`, or is at rest if the velocity is 0.
    Velocity and load may jump at t = 0. The pieces are in the order of time, and the `end` of the last piece is
    infinite. The requested times increase. `per_decade` is the number of time steps per factor of ten in the time since
    the start of a piece.
    """
    times = _snapped(times, np.array([piece.start for piece in pieces]))
    velocity, load_before = before
    state, depth, status = steady_start(line, solid, velocity, load_before)
    if status != Outcome.CONVERGED:
        return _failed(times, status)
    first, travel = _steady_friction(line, solid, velocity, load_before, state, depth), 0.0
    found: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]] = []
    for piece in pieces:
        if piece.start > times[-1]:
            break
        instants = piece.instants(min(piece.end, float(times[-1])), line.height.size - 1, per_decade)
        if instants is None:
            return _failed(times, Outcome.TOO_MANY_STEPS)
        instants = _with_times(instants, times)
        way, speed, load = piece.at(instants)
        part = follow_line(line, solid, Schedule(instants, travel + way, speed, load), state, depth)
        if part.status != Outcome.CONVERGED:
            return _failed(times, part.status)
        found.append((instants, part.drag / load, part.depth, part.contact))
        state, depth, travel = part.state, float(part.depth[-1]), float(travel + way[-1])
    instant, friction, depths, contact = (np.concatenate(column) for column in zip(*found, strict=True))
    at, after = float(friction[0]), _end(line, solid, pieces[-1])
    last = np.searchsorted(instant, times, side="right") - 1  # for the time of a jump, the instant just after the jump
    return Trace(first, at, after, friction[last], depths[last], float(contact.max()), Outcome.CONVERGED)


def _failed(times: FloatArray, outcome: Outcome) -> Trace:
    nothing = np.full(times.size, np.nan)
    return Trace(np.nan, np.nan, np.nan, nothing, nothing, np.nan, outcome)


def _steady_friction(
    line: CubicLine, solid: Foundation, velocity: float, load: float, state: State, depth: float
) -> float:
    now = Schedule(np.zeros(1), np.zeros(1), np.array([velocity]), np.array([load]))
    return float(follow_line(line, solid, now, state, depth).drag[0]) / load


def _end(line: CubicLine, solid: Foundation, piece: Piece) -> float:
    """Return the friction in the final steady state.

    The friction is NaN if the history ends in an oscillation, at rest or in backward sliding, or if the steady state is
    not found.
    """
    velocity, load = piece.velocity[1], piece.force[1]
    if piece.swing[2] or velocity <= 0:
        return np.nan
    state, depth, status = steady_start(line, solid, velocity, load)
    if status != Outcome.CONVERGED:
        return np.nan
    return _steady_friction(line, solid, velocity, load, state, depth)


def _snapped(times: FloatArray, starts: FloatArray) -> FloatArray:
    """Return the times; a time that is a start of a piece except for rounding becomes exactly this start."""
    nearest = starts[np.abs(times[:, None] - starts).argmin(axis=1)]
    found: FloatArray = np.where(np.isclose(times, nearest, rtol=1e-12, atol=0), nearest, times)
    return found


def _with_times(instants: FloatArray, times: FloatArray) -> FloatArray:
    """Replace the times of the steps that are nearest to requested times by the requested times.

    The first and the last time of the steps are kept. Requested times outside this interval are left out.
    """
    inside = times[(times > instants[0]) & (times < instants[-1])]
    kept = np.ones(instants.size, np.bool_)
    kept[np.searchsorted(0.5 * (instants[1:] + instants[:-1]), inside)] = False
    kept[[0, -1]] = True
    return np.union1d(instants[kept], inside)
