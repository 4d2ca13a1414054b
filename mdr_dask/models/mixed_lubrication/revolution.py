"""One realisation of a case: intimate contact in one revolution of the rollers, its error, and the points needed."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.models.mixed_lubrication.declaration import LEAST_PER_WAVE, MOST_POINTS, POSITIONS
from mdr_dask.models.mixed_lubrication.lines import Measured
from mdr_dask.models.mixed_lubrication.operation import Operation
from mdr_dask.physics.lubrication import breakthrough, film_formulas
from mdr_dask.physics.lubrication.clusters import find_clusters
from mdr_dask.physics.surfaces.splines import heights

#: Relative error if the campaign states no accuracy.
ACCURACY = 0.01
#: The error of a probability below this value is relative to this value, because a probability of 0 is normal.
FLOOR = 0.1
#: Outputs that follow from the lengths in contact of the windows.
OF_LENGTH = {
    "contact_length",
    "contact_conductance",
    "contact_resistance",
    "contact_length_trace",
    "upper_profile",
    "lower_profile",
}
#: Windows per window width in rolling with creep. Windows at a smaller distance would have nearly the same contact.
STRIDES = 8
#: `PARTS` is the largest number of parts of a revolution. The other spline is computed in the fraction 1/`SAMPLE` of
#: the parts, but in at least `FEWEST` parts.
PARTS, SAMPLE, FEWEST = 16, 4, 4
#: Factor on the standard deviation, among parts, of the changes between the two splines, in the estimated error.
SCATTER = 0.75
#: Number of clusters close to breaking for which all splines give the wrong result, times (points per shortest
#: wave)^(3/2).
CLUSTERS = 18.0
#: First guess of the error with the fewest points: `FIRST` r^`COARSE`, where r is the length of the shortest wave
#: divided by the length of the pieces that break the layer. `ORDER` is the order with which the error falls with the
#: spacing. The guess only sets the points of the first line; the stated error is estimated from results.
FIRST, COARSE, ORDER = 0.2, 0.6, 3.6
#: The number of points increases in `STEPS` steps per factor of two, so that cases can share lines, up to `MOST_TIMES`
#: times the first number.
STEPS, MOST_TIMES = 4, 4


@dataclass(frozen=True)
class Revolution:
    """Intimate contact of the window during one revolution of the rollers.

    Parameters
    ----------
    contact : int array, shape (windows,)
        Length in intimate contact at equal time steps, in the unit of `breakthrough.contact_lengths`.
    spacing : float
        Distance between nodes of the lines in m.
    per_wave : float
        Nodes per shortest wave.
    apart : int
        Number of time steps after which a window no longer overlaps the window at the start.
    parts : int
        Number of parts of the revolution in which contact is counted. A part is at least two windows long, unless there
        is only one part.
    overlaps : bool
        Whether the lines overlap anywhere.
    """

    contact: NDArray[np.int32] | NDArray[np.int64]
    spacing: float
    per_wave: float
    apart: int
    parts: int
    overlaps: bool

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
        """Length in m of one count of contact."""
        return self.spacing / breakthrough.PARTS

    @property
    def standard_error(self) -> float:
        """Standard error of the probability, from the scatter among parts; NaN for a single part."""
        return float(self._means()[0].std(ddof=1) / np.sqrt(self.parts)) if self.parts > 1 else np.nan

    def errors(self, other: Revolution) -> FloatArray:
        """Return the errors of the probability and of the length in m.

        The errors follow from the difference to a revolution with another spline of the same waves, in the first parts
        of the revolution. Two errors that this difference does not show are added: contact begins and ends between two
        time steps, and all splines may give the wrong result for a cluster close to breaking.
        """
        changes = self._means()[:, : other.parts] - other._means()
        change = np.abs(changes.mean(axis=1))
        if self.parts >= FEWEST:
            change += SCATTER * changes.std(axis=1, ddof=1)
        steps = 2 * np.sqrt(self._counts.ends.sum() / 12)  # two standard errors; each end is uniform in its step
        clusters = CLUSTERS / self.per_wave**1.5 * self.apart if self.overlaps else 0.0
        in_contact = self.length / self.probability if self.length else self.spacing * min(self.per_wave, STRIDES)
        return np.asarray(change + (steps + clusters) / self.contact.size * np.array([1, in_contact]))

    def sizes(self) -> dict[str, float]:
        """Return the values to which the errors of probability and length are relative; they have a lower limit."""
        probability = max(self.probability, FLOOR)
        length = self.length * probability / self.probability if self.length else np.inf
        return {"breakthrough_probability": probability, "contact_length": length}

    def _means(self) -> FloatArray:
        """Return the fraction of windows in contact and the mean length in m, for each part."""
        ends = np.arange(self.parts + 1) * self.contact.size // self.parts
        return np.asarray(np.array(self._counts[:2]) / np.diff(ends) * [[1], [self.unit]])


def _course(operation: Operation, points: int, sample: bool) -> tuple[float, float, int, int]:
    """Return the spacing in m, the window width in spacings, and the numbers of positions and parts of a revolution.

    If `sample`, the positions and parts are those of the first parts of the revolution.
    """
    spacing = operation.length / points
    parts = whole = max(1, min(PARTS, int(operation.length / (2 * operation.width))))
    if sample:
        parts = max(min(FEWEST, whole), whole // SAMPLE)
    return spacing, operation.width / spacing, parts * points // whole, parts


def rolling(operation: Operation, line: FloatArray, sample: bool = False) -> Revolution:
    """Return a revolution of pure rolling, or its first parts if `sample`, from the spline of the sum of both lines."""
    spacing, width, positions, parts = _course(operation, line.size, sample)
    stretch = line[: positions + int(width) + 2] if sample else line
    clusters = find_clusters(stretch, operation.level, spacing, operation.strength)
    contact = breakthrough.contact_lengths(clusters, width, operation.case.edge_rule)[:positions]
    per_wave = operation.source.per_wave
    return Revolution(contact, spacing, per_wave, int(np.ceil(width)), parts, clusters.start.size > 0)


def creeping(operation: Operation, lines: tuple[FloatArray, FloatArray], sample: bool = False) -> Revolution:
    """Return a revolution with creep, or its first parts if `sample`, from the splines of both lines."""
    spacing, width, positions, parts = _course(operation, lines[0].size, sample)
    stride = max(1, int(width / STRIDES))
    begin = stride // 2 if sample else 0  # shifted, so that the difference includes the error of the window positions
    steps = np.arange(begin, positions, stride)
    starts = breakthrough.creep_positions(steps, lines[0].size, operation.case.slide_roll_ratio)
    contact = breakthrough.judge_windows(operation.pair(lines), width, starts, operation.case.edge_rule)
    overlaps = bool(lines[0].max() + lines[1].max() > operation.level)
    per_wave = operation.source.per_wave
    return Revolution(contact, spacing, per_wave, int(np.ceil(width / stride)), parts, overlaps)


def values(
    operation: Operation, revolution: Revolution, errors: Callable[[], FloatArray], wanted: Collection[str]
) -> dict[str, float]:
    """Return the requested scalar outputs of a realisation and their errors.

    Conductance and resistance are those of the whole roller width, across which the squares conduct in parallel.
    """
    specific = operation.case.resistivity / operation.squares
    length = revolution.length
    found: dict[str, Callable[[], float]] = {
        "breakthrough_probability": lambda: revolution.probability,
        "contact_length": lambda: length,
        "revolution_error": lambda: revolution.standard_error,
        "contact_conductance": lambda: length / specific,
        "contact_resistance": lambda: float(breakthrough.contact_resistance(specific, length)),
    }
    result = {name: value() for name, value in found.items() if name in wanted}
    if {f"{name}_error" for name in result} & set(wanted):
        of_probability, off = errors().tolist()
        result |= {
            "breakthrough_probability_error": of_probability,
            "contact_length_error": off,
            "contact_conductance_error": off / specific,
            "contact_resistance_error": specific / (length - off) - specific / length if off < length else np.inf,
        }
    return result


def trace(
    operation: Operation, revolution: Revolution, lines: Callable[[], tuple[FloatArray, FloatArray]]
) -> FloatArray:
    """Return the contact length at the angles of the trace."""
    case, points = operation.case, operation.source.points
    steps = np.arange(case.trace_points) * points // case.trace_points
    if case.slide_roll_ratio == 0:
        return np.asarray(revolution.contact[steps] * revolution.unit, dtype=np.float64)
    starts = breakthrough.creep_positions(steps, points, case.slide_roll_ratio)
    window = operation.width / operation.spacing
    contact = breakthrough.judge_windows(operation.pair(lines()), window, starts, case.edge_rule)
    return np.asarray(contact * revolution.unit, dtype=np.float64)


def profiles(
    operation: Operation, revolution: Revolution, lines: tuple[FloatArray, FloatArray]
) -> dict[str, FloatArray]:
    """Return both surfaces around the contact, at the time step with the largest length in intimate contact."""
    case, points = operation.case, operation.source.points
    steps = np.linspace(0, points, revolution.contact.size, endpoint=False)
    starts = breakthrough.creep_positions(steps[[np.argmax(revolution.contact)]], points, case.slide_roll_ratio)
    half_width = float(operation.contact.half_width)
    x = POSITIONS * half_width
    nodes = (x + operation.width / 2) / operation.spacing
    upper, lower = (
        operation.scale * np.interp(nodes + start[0], np.arange(points), heights(line), period=points)
        for start, line in zip(starts, lines, strict=True)
    )
    gap = operation.film + film_formulas.hertz_gap(x, half_width, case.roller_radius / 2)
    return {"upper_profile": gap - upper, "lower_profile": lower}


def with_first_points(operation: Operation, accuracy: float | None) -> Operation:
    """Return the case with the expected number of points; a number that the user gives is not changed.

    The expected number follows from the strength of the layer and the shortest wave.
    """
    source = operation.source
    if isinstance(source, Measured) or operation.case.points != "auto":
        return operation
    expected = FIRST * (operation.coarseness * source.per_wave) ** COARSE
    return _on(operation, (expected / (accuracy or ACCURACY)) ** (1 / ORDER))


def with_more_points(
    operation: Operation,
    revolution: Revolution,
    errors: Callable[[], FloatArray],
    accuracy: float | None,
    outputs: Collection[str],
) -> Operation | None:
    """Return the case with more points if its revolution misses the accuracy and more points are allowed, otherwise
    None.
    """
    here = operation.source
    if accuracy is None or isinstance(here, Measured) or operation.case.points != "auto":
        return None
    most = with_first_points(operation, accuracy).source.points * MOST_TIMES
    if here.points >= min(most, MOST_POINTS):
        return None
    of_probability, of_length = errors() / list(revolution.sizes().values())
    relative = max(of_probability, of_length) if OF_LENGTH & set(outputs) else of_probability
    if relative <= accuracy:
        return None
    # the error falls at least with the square of the spacing, even if it is due to single clusters
    wanted = min(float(relative / accuracy) ** 0.5 * here.points, most)
    return _on(operation, wanted / (LEAST_PER_WAVE * here.modes))


def _on(operation: Operation, times: float) -> Operation:
    """Return the case with at least `times` times the fewest points, rounded up to a step and a fast FFT length."""
    from scipy.fft import next_fast_len

    assert not isinstance(operation.source, Measured)
    steps = np.ceil(STEPS * np.log2(max(times, 1.0)) - 1e-6)
    points = LEAST_PER_WAVE * operation.source.modes * 2 ** (steps / STEPS)
    number = min(4 * next_fast_len(int(np.ceil(points / 4 - 1e-9)), real=True), MOST_POINTS)
    return operation.on(replace(operation.source, points=number))
