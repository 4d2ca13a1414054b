"""One realisation of a case: what the contact window meets while the rollers turn once."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.models.mixed_lubrication.declaration import POSITIONS
from mdr_dask.models.mixed_lubrication.operation import Operation
from mdr_dask.physics.lubrication import breakthrough, film_formulas
from mdr_dask.physics.lubrication.clusters import Excursions, find_clusters

#: Windows with creep that overlap by more than one part in this many tell the same.
STRIDES = 8
#: Error over the change from every second point: clusters come in at first order of the spacing, where the change alone
#: is the error and holds it half of the time; slower on few points (`python -m benchmarks accuracy honesty`).
SAFETY = 2.0


@dataclass(frozen=True)
class Turn:
    """One realisation of a case: what the window meets while the rollers turn once."""

    contact_points: NDArray[np.int32] | NDArray[np.int64]
    apart: int  # positions after which windows share no point

    @cached_property
    def _occupied(self) -> tuple[int, int]:
        return breakthrough.occupied(self.contact_points)

    @property
    def probability(self) -> float:
        """Share of windows in intimate contact."""
        return self._occupied[0] / self.contact_points.size

    def contact_length(self, spacing: float) -> float:
        """Return the mean length in intimate contact in m, of points that far apart."""
        return self._occupied[1] / self.contact_points.size * spacing


def rolling(operation: Operation, above: Excursions, coarser: int = 1) -> Turn:
    """Return a turn of pure rolling, from the excursions of the combined line above the film or less.

    With ``coarser = 2`` it is that of every second point.
    """
    points = above if coarser == 1 else above.every_second()
    window = _window(operation, coarser)
    clusters = find_clusters(points, operation.level, coarser * operation.spacing, operation.strength)
    contact_points = breakthrough.contact_points(clusters, window, operation.case.edge_rule)
    return Turn(contact_points, window)


def creeping(operation: Operation, lines: tuple[FloatArray, FloatArray], coarser: int = 1) -> Turn:
    """Return a turn with creep, from windows an eighth of their width apart, or that of every second point."""
    even = lines[0].size // coarser * coarser
    line_1, line_2 = (np.ascontiguousarray(line[:even:coarser]) for line in lines)
    stride = max(2, operation.window // STRIDES // 2 * 2) // coarser
    window = _window(operation, coarser)
    pair = breakthrough.Pair(line_1, line_2, operation.level, coarser * operation.spacing, operation.strength)
    way, creep = np.arange(0, line_1.size, stride), operation.case.slide_roll_ratio
    positions = breakthrough.creep_positions(way, line_1.size, creep)
    contact_points = breakthrough.judge_windows(pair, window, positions, operation.case.edge_rule)
    return Turn(contact_points, -(-window // stride))


def _window(operation: Operation, coarser: int) -> int:
    return -(-operation.window // coarser)


def turn_values(
    operation: Operation, turn: Turn, halved: Callable[[], Turn], wanted: Collection[str]
) -> dict[str, float]:
    """Return the scalar outputs of a realisation that are wanted, and errors from the turn of every second point."""
    resistivity = operation.case.resistivity
    length = turn.contact_length(operation.spacing)
    found: dict[str, Callable[[], float]] = {
        "breakthrough_probability": lambda: turn.probability,
        "contact_length": lambda: length,
        "turn_error": lambda: breakthrough.probability_interval(turn.contact_points > 0, turn.apart).error,
        "contact_conductance": lambda: length / resistivity,
        "contact_resistance": lambda: float(breakthrough.contact_resistance(resistivity, length)),
    }
    values = {name: value() for name, value in found.items() if name in wanted}
    if {f"{name}_error" for name in values} & set(wanted):
        coarse = halved()
        other = coarse.contact_length(2 * operation.spacing)
        change = abs(resistivity / length - resistivity / other) if length * other else np.inf
        values |= {
            "breakthrough_probability_error": SAFETY * abs(turn.probability - coarse.probability),
            "contact_length_error": SAFETY * abs(length - other),
            "contact_conductance_error": SAFETY * abs(length - other) / resistivity,
            "contact_resistance_error": SAFETY * change,
        }
    return values


def trace(operation: Operation, turn: Turn, lines: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return the contact length at the angles of the trace."""
    case, points = operation.case, operation.source.points
    way = np.arange(case.trace_points) * points // case.trace_points
    if case.slide_roll_ratio == 0:
        return np.asarray(turn.contact_points[way] * operation.spacing, dtype=np.float64)
    pair = breakthrough.Pair(*lines, operation.level, operation.spacing, operation.strength)
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
