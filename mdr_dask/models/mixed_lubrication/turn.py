"""One realisation of a case: what the contact window meets while the rollers turn once."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.models.mixed_lubrication.declaration import POSITIONS
from mdr_dask.models.mixed_lubrication.operation import Operation
from mdr_dask.physics.lubrication import breakthrough, film_formulas
from mdr_dask.physics.lubrication.clusters import find_clusters
from mdr_dask.physics.surfaces.splines import heights

#: Windows with creep that overlap by more than one part in this many tell the same.
STRIDES = 8


class Settings(NamedTuple):
    """Numbers of the error of a turn, chosen with ``python -m benchmarks mixed honesty`` on seeds kept apart.

    Parameters
    ----------
    change, scatter : float
        Shares of the change from the other lines, and of its standard deviation from part to part of the turn. This
        share is the same however many parts are compared, so that more of them only know both better.
    ends : float
        Standard errors of a sum of as many places, each known to a step, as where contact begins or ends.
    clusters : float
        Clusters that other lines would judge otherwise, times the power 3/2 of the points of the shortest wave.
    parts, fewest, sample : int
        Number of parts at most, one in `sample` of which are compared at first, and at least `fewest`; with fewer
        parts, each two windows long, the error is the change.
    """

    change: float = 1.0
    scatter: float = 0.75
    ends: float = 2.0
    clusters: float = 18.0
    parts: int = 16
    fewest: int = 4
    sample: int = 4


SETTINGS = Settings()


@dataclass(frozen=True)
class Turn:
    """One realisation of a case: what the window meets while the rollers turn once.

    `contact` has the length in intimate contact at equal steps, as `breakthrough.contact_lengths` counts it, on nodes
    `spacing` metres apart, `per_wave` of them in the shortest wave. Windows `apart` steps from each other share none.
    """

    contact: NDArray[np.int32] | NDArray[np.int64]
    spacing: float
    per_wave: float
    apart: int
    parts: int  # of the turn, in which its values are counted
    overlaps: bool  # anywhere

    @cached_property
    def _counts(self) -> breakthrough.Occupied:
        return breakthrough.occupied(self.contact, self.parts)

    @property
    def probability(self) -> float:
        """Share of windows in intimate contact."""
        return int(self._counts.windows.sum()) / self.contact.size

    @property
    def length(self) -> float:
        """Mean length in intimate contact in m."""
        return int(self._counts.lengths.sum()) / self.contact.size * self.unit

    @property
    def unit(self) -> float:
        """Metres of one count of contact."""
        return self.spacing / breakthrough.PARTS

    @property
    def scatter(self) -> float:
        """Standard error of the probability, from that of the parts; NaN of a single part."""
        return float(self._means()[0].std(ddof=1) / np.sqrt(self.parts)) if self.parts > 1 else np.nan

    def errors(self, other: Turn) -> FloatArray:
        """Return the errors of probability and length, from the first parts of the turn on other lines."""
        changes = self._means()[:, : other.parts] - other._means()
        change = np.abs(changes.mean(axis=1))
        if self.parts >= SETTINGS.fewest:
            change = SETTINGS.change * change + SETTINGS.scatter * changes.std(axis=1, ddof=1)
        in_contact = self.length / self.probability if self.length else self.spacing * min(self.per_wave, STRIDES)
        return np.asarray(change + self._unseen() * np.array([1, in_contact]))

    def _unseen(self) -> float:
        """Return the error of the probability that no change tells: of steps in time, of clusters next to breaking."""
        places = SETTINGS.ends * np.sqrt(self._counts.ends.sum() / 12)
        clusters = SETTINGS.clusters / self.per_wave**1.5 * self.apart if self.overlaps else 0.0
        return float(places + clusters) / self.contact.size

    def _means(self) -> FloatArray:
        """Return the shares of windows in contact and the mean lengths in m, part by part."""
        ends = np.arange(self.parts + 1) * self.contact.size // self.parts
        return np.asarray(np.array(self._counts[:2]) / np.diff(ends) * [[1], [self.unit]])


class _Course(NamedTuple):
    """How a turn, or the first parts of it, goes over lines: `width` is that of the window in nodes."""

    spacing: float
    width: float
    positions: int
    parts: int


def _course(operation: Operation, points: int, compared: int) -> _Course:
    """Return the course of a turn in parts two windows long or longer, or of the first of them to be compared."""
    spacing = operation.length / points
    parts = whole = max(1, min(SETTINGS.parts, int(operation.length / (2 * operation.width))))
    if compared:
        parts = max(min(SETTINGS.fewest, whole), whole // compared)
    return _Course(spacing, operation.width / spacing, parts * points // whole, parts)


def rolling(operation: Operation, line: FloatArray, compared: int = 0) -> Turn:
    """Return a turn of pure rolling, from the spline of both lines together, of any number of nodes.

    Where another one is to be `compared` with it, the first parts of the turn do: one in so many.
    """
    course = _course(operation, line.size, compared)
    stretch = line[: course.positions + int(course.width) + 2] if compared else line
    clusters = find_clusters(stretch, operation.level, course.spacing, operation.strength)
    contact = breakthrough.contact_lengths(clusters, course.width, operation.case.edge_rule)[: course.positions]
    apart, per_wave = int(np.ceil(course.width)), operation.source.per_wave
    return Turn(contact, course.spacing, per_wave, apart, course.parts, clusters.start.size > 0)


def creeping(operation: Operation, lines: tuple[FloatArray, FloatArray], compared: int = 0) -> Turn:
    """Return a turn with creep, from windows an eighth of their width apart, of the splines of both lines."""
    points = lines[0].size
    course = _course(operation, points, compared)
    stride = max(1, int(course.width / STRIDES))
    begin = stride // 2 if compared else 0  # what the places of windows and their rounding do is part of the change
    way, creep = np.arange(begin, course.positions, stride), operation.case.slide_roll_ratio
    positions = breakthrough.creep_positions(way, points, creep)
    contact = breakthrough.judge_windows(operation.pair(lines), course.width, positions, operation.case.edge_rule)
    overlaps = bool(lines[0].max() + lines[1].max() > operation.level)
    apart, per_wave = int(np.ceil(course.width / stride)), operation.source.per_wave
    return Turn(contact, course.spacing, per_wave, apart, course.parts, overlaps)


def turn_values(
    operation: Operation, turn: Turn, errors: Callable[[], FloatArray], wanted: Collection[str]
) -> dict[str, float]:
    """Return the scalar outputs of a realisation that are wanted, and their errors from those of `Turn.errors`."""
    resistivity = operation.case.resistivity / operation.squares  # the squares conduct in parallel
    length = turn.length
    found: dict[str, Callable[[], float]] = {
        "breakthrough_probability": lambda: turn.probability,
        "contact_length": lambda: length,
        "turn_error": lambda: turn.scatter,
        "contact_conductance": lambda: length / resistivity,
        "contact_resistance": lambda: float(breakthrough.contact_resistance(resistivity, length)),
    }
    values = {name: value() for name, value in found.items() if name in wanted}
    if {f"{name}_error" for name in values} & set(wanted):
        of_probability, off = errors().tolist()
        values |= {
            "breakthrough_probability_error": of_probability,
            "contact_length_error": off,
            "contact_conductance_error": off / resistivity,
            "contact_resistance_error": resistivity / (length - off) - resistivity / length if off < length else np.inf,
        }
    return values


def trace(operation: Operation, turn: Turn, lines: Callable[[], tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Return the contact length at the angles of the trace."""
    case, points = operation.case, operation.source.points
    way = np.arange(case.trace_points) * points // case.trace_points
    if case.slide_roll_ratio == 0:
        return np.asarray(turn.contact[way] * turn.unit, dtype=np.float64)
    positions = breakthrough.creep_positions(way, points, case.slide_roll_ratio)
    window = operation.width / operation.spacing
    contact = breakthrough.judge_windows(operation.pair(lines()), window, positions, case.edge_rule)
    return np.asarray(contact * turn.unit, dtype=np.float64)


def profiles(operation: Operation, turn: Turn, lines: tuple[FloatArray, FloatArray]) -> dict[str, FloatArray]:
    """Return both surfaces around the contact at the moment when most of it is in intimate contact."""
    case, points = operation.case, operation.source.points
    way = np.linspace(0, points, turn.contact.size, endpoint=False)
    moment = np.array([way[np.argmax(turn.contact)]])
    half_width = float(operation.contact.half_width)
    x = POSITIONS * half_width
    steps = (x + operation.width / 2) / operation.spacing
    upper, lower = (
        operation.scale * np.interp(steps + start[0], np.arange(points), heights(line), period=points)
        for start, line in zip(breakthrough.creep_positions(moment, points, case.slide_roll_ratio), lines, strict=True)
    )
    gap = operation.film + film_formulas.hertz_gap(x, half_width, case.roller_radius / 2)
    return {"upper_profile": gap - upper, "lower_profile": lower}
