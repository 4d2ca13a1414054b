"""Courses of velocity and load as a campaign names them, and the friction along them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError
from mdr_dask.models.base import NamedFile, Parameters, quantity
from mdr_dask.models.parts.tables import parse_table

if TYPE_CHECKING:
    from mdr_dask.physics.transients.element import Foundation
    from mdr_dask.physics.transients.forces import Line

Numbers = Annotated[tuple[float, ...], Field(strict=False)]
MOST_STEPS = 400_000
CELLS = 0.5  # of the line passed in a step, at 12 steps per decade
PART = 0.01  # of a ramp or a period in a step, at 12 steps per decade
NEARLY = 1e-2  # of a step
ROUNDING = 1e-12  # of a time
FIRST = 1e-3  # of the time in which a step's cells are passed, or of the relaxation time


class Jump(Parameters):
    """One jump of the velocity by `velocity_change` out of steady sliding."""

    shape: Literal["jump"] = "jump"


class _Course(Parameters):
    """What every other course has."""

    start: Literal["steady", "rest"] = Field(
        default="steady", description="before t = 0: slides steadily at `velocity`, or rests, under `normal_force`"
    )


class Steps(_Course):
    """Velocity and load that are constant between times."""

    shape: Literal["steps"]
    times: Numbers = quantity("s", "times from which on the values hold, from 0 on", min_length=1)
    velocities: Numbers = quantity("m/s", "velocity from each time on", min_length=1)
    forces: Numbers | None = quantity("N", "normal force from each time on; else `normal_force`", default=None)

    @model_validator(mode="after")
    def _rows(self) -> Steps:
        _check_rows(self.times, self.velocities, self.forces)
        return self


class Ramp(_Course):
    """Velocity and load that change linearly from t = 0 on, and are constant then."""

    shape: Literal["ramp"]
    duration: float = quantity("s", "time that the ramp takes", gt=0)
    velocity: float | None = quantity("m/s", "velocity at its end; else `velocity`", default=None)
    force: float | None = quantity("N", "normal force at its end; else the same", default=None, gt=0)


class Oscillation(_Course):
    """A velocity that oscillates about `velocity`, and perhaps a load about `normal_force`."""

    shape: Literal["oscillation"]
    amplitude: float = quantity("m/s", "amplitude of the velocity", ge=0)
    frequency: float = quantity("Hz", "frequency", gt=0)
    force_amplitude: float = quantity("N", "amplitude of the normal force, below it", default=0.0, ge=0)


class TableFile(_Course):
    """Velocity and load from a table, linear between its rows; two rows of the same time are a jump."""

    shape: Literal["table"]
    file: NamedFile = Field(description="columns time (s), velocity (m/s) and perhaps normal force (N)")


Protocol = Annotated[Jump | Steps | Ramp | Oscillation | TableFile, Field(discriminator="shape")]


def _check_rows(times: tuple[float, ...], velocities: tuple[float, ...], forces: tuple[float, ...] | None) -> None:
    if len(velocities) != len(times) or (forces is not None and len(forces) != len(times)):
        raise ValueError(f"expected a velocity and a force for each of {len(times)} times")
    if times[0] < 0 or any(b <= a for a, b in pairwise(times)):
        raise ValueError(f"expected increasing times from 0 on, got {times!r}")
    if forces is not None and min(forces) <= 0:
        raise ValueError(f"expected positive forces, got {forces!r}")


@dataclass(frozen=True)
class Piece:
    """Smooth velocity and load between two times: linear, and perhaps a sine from `start` on."""

    start: float
    end: float
    velocity: tuple[float, float]
    force: tuple[float, float]
    swing: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the velocity, of the load, angular frequency

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
    def scale(self) -> float:
        """Time in which it changes."""
        if self.swing[2]:
            return 2 * np.pi / self.swing[2]
        same = self.velocity[0] == self.velocity[1] and self.force[0] == self.force[1]
        return np.inf if same else self.end - self.start


def pieces(protocol: Protocol, velocity: float, force: float, change: float) -> tuple[float, list[Piece]]:
    """Return the velocity before t = 0, and the course from there on for ever.

    Raises
    ------
    DataError
        If a table does not hold a course.
    """
    if isinstance(protocol, Jump):
        after = velocity * (1 + change)
        return velocity, [Piece(0.0, np.inf, (after, after), (force, force))]
    before = velocity if protocol.start == "steady" else 0.0
    if isinstance(protocol, Oscillation):
        if protocol.force_amplitude >= force:
            raise DataError(f"expected a force_amplitude below the normal force, got {protocol.force_amplitude!r}")
        swing = protocol.amplitude, protocol.force_amplitude, 2 * np.pi * protocol.frequency
        return before, [Piece(0.0, np.inf, (velocity, velocity), (force, force), swing)]
    if isinstance(protocol, Ramp):
        last = (velocity if protocol.velocity is None else protocol.velocity, protocol.force or force)
        rows = [(0.0, before, force), (protocol.duration, *last)]
    elif isinstance(protocol, Steps):
        forces = protocol.forces or (force,) * len(protocol.times)
        rows, now = [(0.0, before, force)], (before, force)
        for time, *then in zip(protocol.times, protocol.velocities, forces, strict=True):
            rows += [(time, *now), (time, then[0], then[1])]
            now = then[0], then[1]
    else:
        rows = _table_rows(protocol.file, force)
    found = [Piece(a[0], b[0], (a[1], b[1]), (a[2], b[2])) for a, b in pairwise(rows) if b[0] > a[0]]
    end = rows[-1]
    return before, [*found, Piece(end[0], np.inf, (end[1], end[1]), (end[2], end[2]))]


@lru_cache(maxsize=16)
def _table_rows(file: NamedFile, force: float) -> list[tuple[float, float, float]]:
    values = parse_table(file.read_text(), file.name).values
    if values.shape[1] < 2:
        raise DataError(f"{file.name}: expected columns time, velocity and perhaps force, got one")
    load = values[:, 2] if values.shape[1] > 2 else np.full(len(values), force)
    if not np.all(np.isfinite(values)) or np.any(np.diff(values[:, 0]) < 0) or values[0, 0] != 0 or load.min() <= 0:
        raise DataError(f"{file.name}: expected times that start at 0 and do not fall, and positive forces")
    return [(float(t), float(v), float(f)) for t, v, f in zip(values[:, 0], values[:, 1], load, strict=True)]


@dataclass(frozen=True)
class Trace:
    """Friction along a course: F_x / (4 G L) and depth in units of the height; before, at t = 0+, at the end's steady
    state, and at the times asked for.
    """

    before: float
    at: float
    after: float
    drag: FloatArray
    depth: FloatArray
    load: FloatArray
    load_at: float
    status: int
    message: str = ""


@dataclass(frozen=True)
class Scale:
    """Units in which a course is made dimensionless: time, length, and force 4 G L h."""

    time: float
    length: float
    force: float

    @property
    def reach(self) -> float:
        """Travel over L in a unit of time at 1 m/s."""
        return self.time / self.length


def trace(
    line: Line,
    solid: Foundation,
    course: tuple[float, list[Piece]],
    force: float,
    scale: Scale,
    times: FloatArray,
    per_decade: float,
) -> Trace:
    """Follow a line through a course; `times` in units of `scale.time`."""
    from mdr_dask.physics.transients.elements import CONVERGED, NOT_CONVERGED
    from mdr_dask.physics.transients.protocol import MESSAGES, follow_line, steady_start

    before, parts = course
    times = _snapped(times, np.array([part.start for part in parts]) / scale.time)
    none = np.full(times.size, np.nan)
    state, depth, status = steady_start(line, solid, abs(before) * scale.reach, force / scale.force)
    if status != CONVERGED:
        return Trace(np.nan, np.nan, np.nan, none, none, none, np.nan, status, MESSAGES[status])
    one = np.ones(1)
    first = follow_line(
        line, solid, 0 * one, 0 * one, before * scale.reach * one, force / scale.force * one, state, depth
    )
    columns: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    travel, last = 0.0, float(times[-1])
    for part in parts:
        begin, end = part.start / scale.time, min(part.end / scale.time, last)
        if begin > last or (begin == last and columns):
            break
        moments = _moments(part, begin, end, scale, line.height.size - 1, per_decade)
        if moments is None:
            sentence = f"the course needs more than {MOST_STEPS} steps: fewer points or a shorter time"
            return Trace(np.nan, np.nan, np.nan, none, none, none, np.nan, NOT_CONVERGED, sentence)
        moments = _with_times(moments, times)
        way, speed, load = part.at(moments * scale.time)
        travels = travel + way / scale.length
        found = follow_line(line, solid, moments, travels, speed * scale.reach, load / scale.force, state, depth)
        if found.status != CONVERGED:
            return Trace(np.nan, np.nan, np.nan, none, none, none, np.nan, found.status, MESSAGES[found.status])
        columns.append((moments, found.drag, found.depth))
        state, depth, travel = found.state, float(found.depth[-1]), float(travels[-1])
    moment, drag, depths = (np.concatenate(column) for column in zip(*columns, strict=True))
    loads = np.empty(times.size)
    for part in parts:
        inside = times >= part.start / scale.time
        loads[inside] = part.at(times[inside] * scale.time)[2] / scale.force
    return Trace(
        float(first.drag[0]),
        float(drag[0]),
        _end(line, solid, parts[-1], scale),
        _at(times, moment, drag),
        _at(times, moment, depths),
        loads,
        parts[0].force[0] / scale.force,
        CONVERGED,
    )


def _snapped(times: FloatArray, starts: FloatArray) -> FloatArray:
    """Return times of which those that miss the start of a piece by rounding alone are at it."""
    nearest = starts[np.abs(times[:, None] - starts).argmin(axis=1)]
    found: FloatArray = np.where(np.abs(times - nearest) <= ROUNDING * nearest, nearest, times)
    return found


def _with_times(moments: FloatArray, times: FloatArray) -> FloatArray:
    """Return moments among which are the times wanted; moments of the course that nearly meet one make way."""
    inside = times[(times > moments[0]) & (times < moments[-1])]
    if inside.size == 0:
        return moments
    gaps = np.diff(moments)
    near = inside[np.clip(np.searchsorted(inside, moments), 0, inside.size - 1)]
    before = inside[np.clip(np.searchsorted(inside, moments) - 1, 0, inside.size - 1)]
    room = NEARLY * np.append(gaps[0], gaps)
    apart = (np.abs(moments - near) > room) & (np.abs(moments - before) > room)
    apart[[0, -1]] = True
    return np.union1d(moments[apart], inside)


def _at(times: FloatArray, moments: FloatArray, values: FloatArray) -> FloatArray:
    """Return the values at times that are moments; at a jump the value after it."""
    found: FloatArray = values[np.searchsorted(moments, times, side="right") - 1]
    return found


def _end(line: Line, solid: Foundation, part: Piece, scale: Scale) -> float:
    """Return the drag over the load in the steady state in which a course ends; NaN if it does not or ends at rest."""
    from mdr_dask.physics.transients.elements import CONVERGED
    from mdr_dask.physics.transients.protocol import follow_line, steady_start

    reach, load = part.velocity[1] * scale.reach, part.force[1] / scale.force
    if part.swing[2] or reach <= 0:
        return np.nan
    state, depth, status = steady_start(line, solid, reach, load)
    if status != CONVERGED:
        return np.nan
    one = np.ones(1)
    return float(follow_line(line, solid, 0 * one, 0 * one, reach * one, load * one, state, depth).drag[0]) / load


def _moments(part: Piece, begin: float, end: float, scale: Scale, nodes: int, per_decade: float) -> FloatArray | None:
    """Return moments that begin finely, grow in a constant ratio, and pass a part of a cell at most."""
    finer = 12 / per_decade
    fastest = (max(abs(part.velocity[0]), abs(part.velocity[1])) + part.swing[0]) * scale.reach
    most = min(CELLS * finer / (nodes * fastest) if fastest else np.inf, PART * finer * part.scale / scale.time)
    most = min(most, max(end - begin, 1e-300))
    first, ratio = FIRST * finer * min(most, 1.0), 10 ** (1 / per_decade)
    if (end - begin) / most > MOST_STEPS:
        return None
    grown = first * ratio ** np.arange(int(np.ceil(np.log(most / (first * (ratio - 1)) + 1) / np.log(ratio))) + 1)
    grown = grown[np.diff(grown, append=np.inf) < most] if grown.size > 1 else grown
    grown = grown[grown < end - begin]
    late = grown[-1] if grown.size else 0.0
    count = max(int(np.ceil((end - begin - late) / most)), 1)
    rest = late + (end - begin - late) * np.arange(1, count + 1) / count
    moments: FloatArray = begin + np.concatenate([[0.0], grown, rest])
    return moments if end > begin else np.array([begin])
