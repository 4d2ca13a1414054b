"""One realisation of a case: what the contact window meets while the rollers turn once."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.models.mixed_lubrication.declaration import POSITIONS
from mdr_dask.models.mixed_lubrication.operation import Operation
from mdr_dask.physics.lubrication import breakthrough, film_formulas
from mdr_dask.physics.lubrication.clusters import Excursions, find_clusters

#: Windows with creep that overlap by more than one part in this many tell the same.
STRIDES = 8


class Settings(NamedTuple):
    """Numbers of the error of a turn, chosen with ``python -m benchmarks mixed honesty`` on seeds kept apart.

    The error is a share of the change from the line of every `coarser`-th point, a share of the value itself, and a
    multiple of the change's scatter.

    Parameters
    ----------
    coarser : int
        A power of two. Every second point costs twice as much, and its change is lost in its scatter sooner.
    smooth, few : float
        The share where clusters have many points, and what a single point in contact adds to it: few points converge
        at less than first order.
    single : float
        The share of a value that single points make wrong, over the square of the number of points in contact together.
    scatter : float
        Standard errors of the change, from the parts of the turn.
    parts, fewest : int
        Number of parts at most; with fewer than `fewest`, each two windows long, the error is the change.
    resolved : float
        Spacing, over the length of the pieces that break, from which on points tell nothing: the error is then all
        that a value could be wrong by.
    """

    coarser: int = 4
    smooth: float = 0.1
    few: float = 1.0
    single: float = 1.5
    scatter: float = 1.5
    parts: int = 16
    fewest: int = 4
    resolved: float = 0.5


SETTINGS = Settings()


@dataclass(frozen=True)
class Turn:
    """One realisation of a case: what the window meets while the rollers turn once."""

    contact_points: NDArray[np.int32] | NDArray[np.int64]
    apart: int  # positions after which windows share no point
    parts: int  # of the turn, in which its values are counted
    overlaps: bool  # points of the lines anywhere

    @cached_property
    def _counts(self) -> tuple[IntArray, IntArray]:
        return breakthrough.occupied(self.contact_points, self.parts)

    @property
    def probability(self) -> float:
        """Share of windows in intimate contact."""
        return int(self._counts[0].sum()) / self.contact_points.size

    @property
    def points(self) -> float:
        """Mean number of points in intimate contact."""
        return int(self._counts[1].sum()) / self.contact_points.size

    @property
    def scatter(self) -> float:
        """Standard error of the probability, from that of the parts; NaN of a single part."""
        return float(self._means()[0].std(ddof=1) / np.sqrt(self.parts)) if self.parts > 1 else np.nan

    def errors(self, coarse: Turn) -> FloatArray:
        """Return the errors of probability and number of points in contact, from the turn of a coarser line."""
        changes = self._means() - coarse._means() * [[1], [SETTINGS.coarser]]
        change = np.abs(changes.mean(axis=1))
        if self.overlaps and not self.points:  # on a finer line some point might break
            change = np.maximum(change, self.apart / self.contact_points.size)
        if self.parts < SETTINGS.fewest:
            return np.asarray(change)
        together = max(1.0, self.points / self.probability) if self.points else 1.0
        from_change = (SETTINGS.smooth + SETTINGS.few / together) * change
        from_points = SETTINGS.single / together**2 * np.array([self.probability, self.points])
        scatter = changes.std(axis=1, ddof=1) / np.sqrt(self.parts)
        return np.asarray(from_change + from_points + SETTINGS.scatter * scatter)

    def _means(self) -> FloatArray:
        """Return the shares of windows and the mean numbers of points in contact, part by part."""
        ends = np.arange(self.parts + 1) * self.contact_points.size // self.parts
        return np.asarray(np.array(self._counts) / np.diff(ends))


def rolling(operation: Operation, above: Excursions, coarser: int = 1) -> Turn:
    """Return a turn of pure rolling, from the excursions of the combined line above the film or less.

    With ``coarser = 4`` it is that of every fourth point.
    """
    window = _window(operation, coarser)
    clusters = find_clusters(above, operation.level, coarser * operation.spacing, operation.strength, coarser)
    contact_points = breakthrough.contact_points(clusters, window, operation.case.edge_rule)
    return Turn(contact_points, window, _parts(operation), clusters.start.size > 0)


def creeping(operation: Operation, lines: tuple[FloatArray, FloatArray], coarser: int = 1) -> Turn:
    """Return a turn with creep, from windows an eighth of their width apart, or that of every fourth point."""
    even = lines[0].size // coarser * coarser
    line_1, line_2 = (np.ascontiguousarray(line[:even:coarser]) for line in lines)
    least = SETTINGS.coarser
    stride = max(least, operation.window // STRIDES // least * least) // coarser
    window = _window(operation, coarser)
    pair = breakthrough.Pair(line_1, line_2, operation.level, coarser * operation.spacing, operation.strength)
    way, creep = np.arange(0, line_1.size, stride), operation.case.slide_roll_ratio
    positions = breakthrough.creep_positions(way, line_1.size, creep)
    contact_points = breakthrough.judge_windows(pair, window, positions, operation.case.edge_rule)
    overlaps = bool(line_1.max() + line_2.max() > operation.level)
    return Turn(contact_points, -(-window // stride), _parts(operation), overlaps)


def _window(operation: Operation, coarser: int) -> int:
    return -(-operation.window // coarser)


def _parts(operation: Operation) -> int:
    """Return into how many parts, two windows long or longer, a turn is cut."""
    return max(1, min(SETTINGS.parts, operation.source.points // (2 * operation.window)))


def turn_errors(operation: Operation, turn: Turn, coarser: Callable[[], Turn]) -> FloatArray:
    """Return the errors of probability and number of points in contact, from the turn of a coarser line."""
    if operation.coarseness < SETTINGS.resolved:
        return turn.errors(coarser())
    return np.array(
        [max(turn.probability, 1 - turn.probability), max(turn.points, operation.window - turn.points)], dtype=float
    )


def turn_values(
    operation: Operation, turn: Turn, errors: Callable[[], FloatArray], wanted: Collection[str]
) -> dict[str, float]:
    """Return the scalar outputs of a realisation that are wanted, and their errors from those of `turn_errors`."""
    resistivity = operation.case.resistivity
    length = turn.points * operation.spacing
    found: dict[str, Callable[[], float]] = {
        "breakthrough_probability": lambda: turn.probability,
        "contact_length": lambda: length,
        "turn_error": lambda: turn.scatter,
        "contact_conductance": lambda: length / resistivity,
        "contact_resistance": lambda: float(breakthrough.contact_resistance(resistivity, length)),
    }
    values = {name: value() for name, value in found.items() if name in wanted}
    if {f"{name}_error" for name in values} & set(wanted):
        of_probability, of_points = errors().tolist()
        off = of_points * operation.spacing
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
        return np.asarray(turn.contact_points[way] * operation.spacing, dtype=np.float64)
    pair = breakthrough.Pair(*lines(), operation.level, operation.spacing, operation.strength)
    positions = breakthrough.creep_positions(way, points, case.slide_roll_ratio)
    contact_points = breakthrough.judge_windows(pair, operation.window, positions, case.edge_rule)
    return np.asarray(contact_points * operation.spacing, dtype=np.float64)


def profiles(operation: Operation, turn: Turn, lines: tuple[FloatArray, FloatArray]) -> dict[str, FloatArray]:
    """Return both surfaces around the contact at the moment when most of it is in intimate contact."""
    case, points = operation.case, operation.source.points
    way = np.linspace(0, points, turn.contact_points.size, endpoint=False)
    moment = np.array([way[np.argmax(turn.contact_points)]])
    half_width = float(operation.contact.half_width)
    x = POSITIONS * half_width
    steps = x / operation.spacing + operation.window / 2
    upper, lower = (
        operation.scale * np.interp(steps + start[0], np.arange(points), line, period=points)
        for start, line in zip(breakthrough.creep_positions(moment, points, case.slide_roll_ratio), lines, strict=True)
    )
    gap = operation.film + film_formulas.hertz_gap(x, half_width, case.roller_radius / 2)
    return {"upper_profile": gap - upper, "lower_profile": lower}
