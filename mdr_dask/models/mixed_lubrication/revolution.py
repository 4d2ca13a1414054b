"""Intimate contact of two rough lines during one revolution of the rollers."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.models.mixed_lubrication.declaration import POSITIONS
from mdr_dask.models.mixed_lubrication.operation import Operation
from mdr_dask.physics.lubrication import breakthrough, film_formulas
from mdr_dask.physics.lubrication.clusters import find_clusters
from mdr_dask.physics.surfaces.splines import heights

#: Largest number of parts of a revolution. The scatter between the parts gives the standard error.
PARTS = 16
#: Width of a window divided by the distance between windows, for sliding rollers on the coarsest grid. The value was
#: chosen by trial.
WINDOWS = 4


@dataclass(frozen=True)
class Revolution:
    """Intimate contact during one revolution of the rollers.

    A window is the part of both lines that is in the Hertzian contact at one instant. The windows are equidistant in
    time. The distance between neighbouring windows is `stride` points. `contact` times `unit` is the length in intimate
    contact in each window, in m. `parts` is the number of equal parts into which the revolution is divided.
    """

    contact: IntArray
    stride: int
    unit: float
    parts: int

    @property
    def probability(self) -> float:
        """Fraction of the windows in which there is intimate contact."""
        return np.count_nonzero(self.contact) / self.contact.size

    @property
    def length(self) -> float:
        """Length in intimate contact in m, averaged over the windows."""
        return float(self.contact.mean()) * self.unit

    @property
    def standard_error(self) -> float:
        """Standard error of the probability, from the scatter between the parts, or NaN if there is only one part."""
        if self.parts < 2:
            return np.nan
        shares = [np.count_nonzero(part) / part.size for part in np.array_split(self.contact, self.parts)]
        return float(np.std(shares, ddof=1) / np.sqrt(self.parts))


def revolve(operation: Operation, lines: FloatArray) -> Revolution:
    """Find the intimate contact during one revolution.

    `lines` contains the spline coefficients of both lines, shape (2, points).
    """
    case, points = operation.case, lines.shape[1]
    spacing, creep = operation.source.length / points, case.slide_roll_ratio
    width, stride = operation.width / spacing, 1
    if creep == 0:
        clusters = find_clusters(lines.sum(axis=0), operation.film / operation.scale, spacing, operation.strength)
        contact: IntArray = breakthrough.contact_lengths(clusters, width)
    else:
        # a finer grid has more windows, so that the change between two grids includes the error of the window spacing
        stride = max(1, int(operation.width / operation.source.length * operation.source.points[0] / WINDOWS))
        contact = _windows(operation, lines, np.arange(0, points, stride))
    parts = max(1, min(PARTS, int(operation.source.length / (2 * operation.width))))
    return Revolution(contact, stride, spacing / breakthrough.PARTS, parts)


def _windows(operation: Operation, lines: FloatArray, travels: ArrayLike) -> IntArray:
    """Return the length in intimate contact, as in `Revolution.contact`, after each travelled distance in `travels`.

    The distances in `travels` are divided by the spacing of the points.
    """
    spacing = operation.source.length / lines.shape[1]
    pair = breakthrough.Pair(lines[0], lines[1], operation.film / operation.scale, spacing, operation.strength)
    starts = breakthrough.creep_positions(travels, lines.shape[1], operation.case.slide_roll_ratio)
    return breakthrough.judge_windows(pair, operation.width / spacing, starts)


def values(operation: Operation, revolution: Revolution, errors: FloatArray) -> dict[str, float]:
    """Return the scalar outputs that need rough lines, and their errors, for one realisation.

    `errors` contains the error of the probability and the error of the length in m. Conductance and resistance are
    computed for all independent squares across the rollers, connected in parallel.
    """
    specific, length = operation.case.resistivity / operation.squares, revolution.length
    of_probability, off = errors.tolist()
    return {
        "breakthrough_probability": revolution.probability,
        "contact_length": length,
        "revolution_error": revolution.standard_error,
        "contact_conductance": length / specific,
        "contact_resistance": specific / length if length > 0 else np.inf,
        "breakthrough_probability_error": of_probability,
        "contact_length_error": off,
        "contact_conductance_error": off / specific,
        "contact_resistance_error": specific / (length - off) - specific / length if off < length else np.inf,
    }


def drawn(
    operation: Operation, revolution: Revolution, lines: FloatArray, wanted: Collection[str]
) -> dict[str, FloatArray]:
    """Return the requested outputs that are arrays: the trace of the contact length, and the profiles."""
    case, points, found = operation.case, lines.shape[1], {}
    if "contact_length_trace" in wanted:
        travels = np.arange(case.trace_points) * points // case.trace_points
        whole = case.slide_roll_ratio == 0
        contact = revolution.contact[travels] if whole else _windows(operation, lines, travels)
        found["contact_length_trace"] = np.asarray(contact * revolution.unit, dtype=np.float64)
    if {"upper_profile", "lower_profile"} & set(wanted):
        travel = revolution.stride * int(np.argmax(revolution.contact))
        starts = breakthrough.creep_positions([travel], points, case.slide_roll_ratio)
        half_width = float(operation.contact.half_width)
        x = POSITIONS * half_width
        nodes = (x + half_width) / operation.source.length * points
        upper, lower = (
            operation.scale * np.interp(nodes + start[0], np.arange(points), heights(line), period=points)
            for start, line in zip(starts, lines, strict=True)
        )
        gap = operation.film + film_formulas.hertz_gap(x, half_width, case.radius)
        found |= {"upper_profile": gap - upper, "lower_profile": lower}
    return found
