"""Any history of velocity and load without dimensions, its moments, and the friction along it.

Times are in the unit of the solid, travel is in lengths of the line, loads are F_N / (4 G_inf L) in the unit of height.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces.cubic_line import CubicLine
from mdr_dask.physics.transients.elements.follow import Response, follow_line, steady_start
from mdr_dask.physics.transients.elements.foundation import Foundation
from mdr_dask.physics.transients.elements.steps import Schedule, State

MOST_STEPS = 400_000  # of one piece, beyond which it is given up
# Of steps at 12 in a decade; with more steps in a decade they are shorter in proportion
CELLS = 0.5  # cells of the line in a step, at most
PART = 0.01  # of a ramp or a period in a step, at most
FIRST = 1e-3  # of the longest step or of the unit of time: the first step
STEPS_PER_DECADE = 12.0
NEARLY = 1e-2  # of a step: a moment so near to a requested time is replaced by it
ROUNDING = 1e-12  # part of a time


@dataclass(frozen=True)
class Piece:
    """Smooth velocity and load between two times: linear, and perhaps a sine from `start` on."""

    start: float
    end: float
    velocity: tuple[float, float]
    force: tuple[float, float]
    swing: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the velocity, of the load, angular frequency

    def scaled(self, time: float, velocity: float, force: float) -> Piece:
        """Return the piece in other units."""
        swing = self.swing[0] / velocity, self.swing[1] / force, self.swing[2] * time
        ends = (
            (self.velocity[0] / velocity, self.velocity[1] / velocity),
            (self.force[0] / force, self.force[1] / force),
        )
        return Piece(self.start / time, self.end / time, *ends, swing)

    def at(self, time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return travel since `start`, velocity and load."""
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
        """Duration of its changes: the period or the length of a ramp, infinite if it is constant."""
        if self.swing[2]:
            return 2 * np.pi / self.swing[2]
        same = self.velocity[0] == self.velocity[1] and self.force[0] == self.force[1]
        return np.inf if same else self.end - self.start

    def moments(self, begin: float, end: float, nodes: int, per_decade: float) -> FloatArray | None:
        """Return moments whose steps begin small and grow in a constant ratio up to a part of a cell.

        None if there would be too many.
        """
        finer = STEPS_PER_DECADE / per_decade
        fastest = max(abs(self.velocity[0]), abs(self.velocity[1])) + self.swing[0]
        most = CELLS * finer / (nodes * fastest) if fastest else np.inf
        most = min(most, PART * finer * self.changes_in, max(end - begin, 1e-300))
        first, ratio = FIRST * finer * min(most, 1.0), 10 ** (1 / per_decade)
        if (end - begin) / most > MOST_STEPS:
            return None
        grown = first * ratio ** np.arange(int(np.ceil(np.log(most / (first * (ratio - 1)) + 1) / np.log(ratio))) + 1)
        grown = grown[np.diff(grown, append=np.inf) < most] if grown.size > 1 else grown
        grown = grown[grown < end - begin]
        late = grown[-1] if grown.size else 0.0
        count = max(int(np.ceil((end - begin - late) / most)), 1)
        rest = late + (end - begin - late) * np.arange(1, count + 1) / count
        if end <= begin:
            return np.array([begin])
        moments: FloatArray = begin + np.concatenate([[0.0], grown, rest])
        moments[-1] = end  # without a rounding error: the next piece begins there, and a time may be requested there
        return moments


class Trace(NamedTuple):
    """Friction along a history: drag F_x / (4 G L) over the load, in units of height over length; depths in height.

    Parameters
    ----------
    before, at, after : float
        Steady before t = 0, at t = 0+, and in the steady state in which the history ends, NaN if it ends in none.
    friction, depth : array, shape (times,)
        At the requested times; at a jump the value after it.
    contact : float
        Largest fraction of the line in contact from t = 0 to the last requested time.
    outcome : Outcome
    """

    before: float
    at: float
    after: float
    friction: FloatArray
    depth: FloatArray
    contact: float
    outcome: Outcome


class _Junction(NamedTuple):
    """State of all elements, depth and travel between two pieces."""

    state: State
    depth: float
    travel: float


def trace(
    line: CubicLine,
    solid: Foundation,
    before: tuple[float, float],
    pieces: Sequence[Piece],
    times: FloatArray,
    per_decade: float,
) -> Trace:
    """Follow every element of a body through a history.

    Parameters
    ----------
    line, solid
        As in :func:`~mdr_dask.physics.transients.elements.follow.follow_line`.
    before : tuple of float
        Velocity and load until t = 0: the body slides steadily, or rests where the velocity is 0. Both may jump at
        t = 0.
    pieces : sequence of Piece
        From t = 0 on for ever.
    times : array, shape (m,)
        Requested times, increasing.
    per_decade : float
        Steps in a factor ten of the time after every change.
    """
    times = _snapped(times, np.array([piece.start for piece in pieces]))
    velocity, load_before = before
    state, depth, status = steady_start(line, solid, abs(velocity), load_before)
    if status != Outcome.CONVERGED:
        return _failed(times, Outcome(status))
    first = _still(line, solid, velocity, load_before, state, depth)
    junction = _Junction(state, depth, 0.0)
    found: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]] = []
    for piece in pieces:
        begin, end = piece.start, min(piece.end, float(times[-1]))
        if begin > times[-1]:
            break
        moments = piece.moments(begin, end, line.height.size - 1, per_decade)
        if moments is None:
            return _failed(times, Outcome.TOO_MANY_STEPS)
        moments = _with_times(moments, times)
        way, speed, load = piece.at(moments)
        travels = junction.travel + way
        part = follow_line(line, solid, Schedule(moments, travels, speed, load), junction.state, junction.depth)
        if part.status != Outcome.CONVERGED:
            return _failed(times, Outcome(part.status))
        found.append((moments, part.drag / load, part.depth, part.contact))
        junction = _Junction(part.state, float(part.depth[-1]), float(travels[-1]))
    moment, friction, depths, contact = (np.concatenate(column) for column in zip(*found, strict=True))
    return Trace(
        float(first.drag[0]) / load_before,
        float(friction[0]),
        _end(line, solid, pieces[-1]),
        _at(times, moment, friction),
        _at(times, moment, depths),
        float(contact.max()),
        Outcome.CONVERGED,
    )


def _failed(times: FloatArray, outcome: Outcome) -> Trace:
    nothing = np.full(times.size, np.nan)
    return Trace(np.nan, np.nan, np.nan, nothing, nothing, np.nan, outcome)


def _still(line: CubicLine, solid: Foundation, velocity: float, load: float, state: State, depth: float) -> Response:
    """Return the response at one moment of steady sliding."""
    one = np.ones(1)
    return follow_line(line, solid, Schedule(0 * one, 0 * one, velocity * one, load * one), state, depth)


def _end(line: CubicLine, solid: Foundation, piece: Piece) -> float:
    """Return the friction of the steady state in which a history ends; NaN if it ends in none or at rest."""
    velocity, load = piece.velocity[1], piece.force[1]
    if piece.swing[2] or velocity <= 0:
        return np.nan
    state, depth, status = steady_start(line, solid, velocity, load)
    if status != Outcome.CONVERGED:
        return np.nan
    return float(_still(line, solid, velocity, load, state, depth).drag[0]) / load


def _snapped(times: FloatArray, starts: FloatArray) -> FloatArray:
    """Return times with those that miss the start of a piece by rounding moved to it."""
    nearest = starts[np.abs(times[:, None] - starts).argmin(axis=1)]
    found: FloatArray = np.where(np.abs(times - nearest) <= ROUNDING * nearest, nearest, times)
    return found


def _with_times(moments: FloatArray, times: FloatArray) -> FloatArray:
    """Return moments that include the requested times, without other moments very near to these."""
    inside = times[(times > moments[0]) & (times < moments[-1])]
    if inside.size == 0:
        return moments
    gaps = np.diff(moments)
    near = inside[np.clip(np.searchsorted(inside, moments), 0, inside.size - 1)]
    before = inside[np.clip(np.searchsorted(inside, moments) - 1, 0, inside.size - 1)]
    close = NEARLY * np.append(gaps[0], gaps)
    apart = (np.abs(moments - near) > close) & (np.abs(moments - before) > close)
    apart[[0, -1]] = True
    return np.union1d(moments[apart], inside)


def _at(times: FloatArray, moments: FloatArray, values: FloatArray) -> FloatArray:
    """Return the values at times that are among the moments; at a jump the value after it."""
    found: FloatArray = values[np.searchsorted(moments, times, side="right") - 1]
    return found
