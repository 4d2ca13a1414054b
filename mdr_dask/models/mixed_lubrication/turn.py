"""One realisation of a case: what the contact window meets while the rollers turn once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mdr_dask.models.base import FloatArray
from mdr_dask.models.mixed_lubrication.operation import Operation, friction

if TYPE_CHECKING:
    from mdr_dask.physics.breakthrough import Excursions, Windows

STRIDES = 8  # windows with creep that overlap by more than 1 - 1/8 tell the same
#: Places of the profiles in half widths of the contact.
POSITIONS = np.linspace(-1.5, 1.5, 1501)


@dataclass(frozen=True)
class Turn:
    """One realisation of a case: what the window meets while the rollers turn once."""

    contact_points: NDArray[np.int32] | NDArray[np.int64]
    overlap: float  # mean sum in the window, in units of the lines
    coarse: float  # probability on every second point


def rolling(operation: Operation, above: Excursions) -> Turn:
    """Return a turn of pure rolling, from the excursions of the combined line above the film or less."""
    from mdr_dask.physics import breakthrough

    level, spacing, rule = operation.level, operation.spacing, operation.case.edge_rule
    clusters = breakthrough.find_clusters(above, level, spacing, operation.strength)
    halved = breakthrough.find_clusters(above.every_second(), level, 2 * spacing, operation.strength)
    window = operation.window
    return Turn(
        breakthrough.contact_points(clusters, window, rule),
        breakthrough.mean_overlap(clusters, window),
        _share(breakthrough.contact_points(halved, (window + 1) // 2, rule)),
    )


def creeping(operation: Operation, lines: tuple[FloatArray, FloatArray]) -> Turn:
    """Return a turn with creep, from windows an eighth of their width apart."""
    stride = max(2, operation.window // STRIDES // 2 * 2)
    fine = _windows(operation, lines, stride)
    even = lines[0].size // 2 * 2
    halved = _windows(operation, (lines[0][:even:2].copy(), lines[1][:even:2].copy()), stride // 2, 2)
    return Turn(fine.contact_points, float(fine.overlap.mean()), _share(halved.contact_points))


def _windows(operation: Operation, lines: tuple[FloatArray, FloatArray], stride: int, coarser: int = 1) -> Windows:
    from mdr_dask.physics import breakthrough

    points = lines[0].size
    return breakthrough.judge_windows(
        *lines,
        operation.level,
        coarser * operation.spacing,
        operation.strength,
        (operation.window + coarser - 1) // coarser,
        breakthrough.creep_positions(np.arange(0, points, stride), points, operation.case.slide_roll_ratio),
        operation.case.edge_rule,
    )


def _share(contact_points: NDArray[np.int32] | NDArray[np.int64]) -> float:
    """Return the share of windows in intimate contact."""
    return np.count_nonzero(contact_points) / contact_points.size


def turn_values(operation: Operation, turn: Turn) -> dict[str, float]:
    """Return the scalar outputs of a realisation."""
    from mdr_dask.physics import breakthrough

    case = operation.case
    probability = _share(turn.contact_points)
    length = float(turn.contact_points.sum(dtype=np.int64)) / turn.contact_points.size * operation.spacing
    force = operation.E_star * operation.spacing * operation.scale * turn.overlap
    return {
        "breakthrough_probability": probability,
        "contact_length": length,
        "load_share": force / case.normal_force,
        "discretisation_error": probability - turn.coarse,
        "contact_conductance": length / case.resistivity,
        "contact_resistance": float(breakthrough.contact_resistance(case.resistivity, length)),
        "friction_coefficient": friction(operation, length / (operation.window * operation.spacing)),
    }


def trace(operation: Operation, turn: Turn, lines: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return the contact length at the angles of the trace."""
    from mdr_dask.physics import breakthrough

    case, points = operation.case, operation.source.points
    way = np.arange(case.trace_points) * points // case.trace_points
    if case.slide_roll_ratio == 0:
        return np.asarray(turn.contact_points[way] * operation.spacing, dtype=np.float64)
    windows = breakthrough.judge_windows(
        *lines,
        operation.level,
        operation.spacing,
        operation.strength,
        operation.window,
        breakthrough.creep_positions(way, points, case.slide_roll_ratio),
        case.edge_rule,
    )
    return np.asarray(windows.contact_points * operation.spacing, dtype=np.float64)


def profiles(operation: Operation, turn: Turn, lines: tuple[FloatArray, FloatArray]) -> dict[str, FloatArray]:
    """Return both surfaces around the contact at the moment when most of it is in intimate contact."""
    from mdr_dask.physics import breakthrough, film

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
    gap = operation.film + film.hertz_gap(x, half_width, case.roller_radius / 2)
    return {"upper_profile": gap - upper, "lower_profile": lower}
