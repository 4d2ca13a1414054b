"""Steady states to an accuracy: which grids a case is solved on, and what is known of its errors.

A ladder climbs from grid to grid until the errors estimated are small enough, for every case on its own. Cases go from
node to node first (`vectorised`) where that is cheaper, and through cubic cells (`kelvin`) where it is not enough.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding import steady as sliding
from mdr_dask.physics.sliding import vectorised
from mdr_dask.physics.sliding.steady import Scheme, Steady
from mdr_dask.physics.sliding.vectorised import Change
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.shapes import Shape


class Settings(NamedTuple):
    """What was tuned, with ``python -m benchmarks.honesty_friction`` on seeds other than those of docs/friction.md."""

    finest: int = 64  # oversampling beyond which a case is given up
    safety: float = 3.0  # of the difference between two grids of cubic cells
    close: float = 0.005  # relative change of the depth between grids that is taken from the tangent
    rounding: float = 1e-8  # bound of the error of the search for the depth, and of rounding
    hardly: int = 2  # nodes in contact that see a peak by its curvature only
    of_a_peak: float = 0.1  # the error of that, times the oversampling squared
    restart: int = 4  # oversampling of the cubic cells that take over
    sampled: int = 2  # oversampling of a line that cases go along from node to node
    refinements: tuple[int, ...] = (1, 2, 4, 8, 16, 32, 64, 128, 256)  # of the cells of half the width
    quickest: float = 2e-3  # accuracy that needs more than going from node to node
    quick_safety: float = 0.6  # of the last change of the drag between grids
    quick_memory: float = 0.06  # of the change before that
    hope: int = 2  # refinement from which on a grid without a solution ends the way from node to node
    few: int = 10  # nodes in contact that are too few to go from node to node
    profile: float = 1e-5  # of the profile between nodes, under the lightest contacts
    many: int = 1000  # nodes in contact whose errors are an average
    safety_of_many: float = 0.4
    # on the first three grids, with so many nodes: of the changes of drag and contact, and of those before
    of_drag: float = 0.12
    of_contact: float = 0.15
    of_drag_before: float = 0.02
    of_contact_before: float = 0.03
    of_first_contact: float = 0.5  # of the change of the contact on the first two grids
    roughly: float = 0.5  # of the accuracy, that the search for the depth may leave on the second grid
    trusted: float = 0.1  # and on finer ones


SETTINGS = Settings()


class Errors(NamedTuple):
    """Estimated absolute discretisation errors of the columns of a `Steady`, in their units."""

    drag: FloatArray
    depth: FloatArray
    contact_fraction: FloatArray
    contact_slope: FloatArray

    @classmethod
    def unknown(cls, cases: int) -> Errors:
        """Return infinite errors."""
        return cls(*(np.full(cases, np.inf) for _ in cls._fields))

    def replaced(self, cases: NDArray[Any], other: Errors) -> Errors:
        """Return all cases, some of them from another estimate."""
        columns = [column.copy() for column in self]
        for column, found in zip(columns, other, strict=True):
            column[cases] = found
        return Errors(*columns)


COLUMNS = Errors._fields


def relative(steady: Steady, errors: Errors, columns: Collection[str] = COLUMNS) -> FloatArray:
    """Return errors over the size of what they belong to, a row for every column."""
    with np.errstate(all="ignore"):
        rows = [getattr(errors, name) / np.abs(getattr(steady, name)) for name in columns]
    sizes = np.array(rows).reshape(len(rows), steady.status.size)
    return np.where(np.isnan(sizes), np.inf, sizes)


@dataclass(frozen=True)
class Ladder:
    """Cases on a line, and the grids they are solved on.

    Parameters
    ----------
    line : RoughLine
        The line.
    scheme : {"hermite", "piecewise_linear", "backward_euler"}
        Cubic cells, straight cells, or the papers' time steps.
    deborah, loads : array, shape (cases,)
        v tau / L and F_N / (4 G L), in the unit of height.
    columns : collection of str
        The columns of a `Steady` that are wanted: what an accuracy is asked of.
    """

    line: RoughLine
    scheme: Scheme
    deborah: FloatArray
    loads: FloatArray
    columns: Collection[str] = COLUMNS

    def only(self, cases: NDArray[Any]) -> Ladder:
        """Return some of the cases."""
        return replace(self, deborah=self.deborah[cases], loads=self.loads[cases])

    def on_grid(self, oversampling: int) -> Steady:
        """Solve the cases on one grid, without an estimate of their errors."""
        slopes = self.line.slopes(self.line.points * oversampling) if self.scheme == "hermite" else None
        return self._solve((self.line.heights(self.line.points * oversampling), slopes))

    def with_errors(self, oversampling: int) -> tuple[Steady, Errors]:
        """Solve the cases on one grid and estimate their errors."""
        steady = self.on_grid(oversampling)
        return steady, self._errors(steady, self._nodes(2 * oversampling))

    def to_accuracy(self, accuracy: float) -> tuple[Steady, Errors]:
        """Solve every case on the coarsest grid on which the errors of all columns wanted meet a relative accuracy."""
        if self.scheme != "hermite":
            return self._swept(accuracy, 1)
        if not goes_from_node_to_node(self.line.body, accuracy):
            return self._swept(accuracy, 2)
        steady, errors = self._sampled(accuracy)
        missing = ~self._met(steady, errors, accuracy)
        if np.any(missing):
            found, found_errors = self.only(missing)._swept(accuracy, SETTINGS.restart)
            steady, errors = steady.replaced(missing, found), errors.replaced(missing, found_errors)
        return steady, errors

    def _met(self, steady: Steady, errors: Errors, accuracy: float) -> NDArray[np.bool_]:
        """Return which cases meet the accuracy in every column wanted."""
        met: NDArray[np.bool_] = np.all(relative(steady, errors, self.columns) <= accuracy, axis=0)
        return met

    def _nodes(self, oversampling: int) -> tuple[FloatArray, FloatArray]:
        """Return heights and slopes on a grid."""
        nodes = self.line.points * oversampling
        return self.line.heights(nodes), self.line.slopes(nodes)

    def _solve(
        self,
        nodes: tuple[FloatArray, FloatArray | None],
        scheme: Scheme | None = None,
        near: Steady | None = None,
        close: float = 0.0,
    ) -> Steady:
        """Solve the cases on a grid, beginning near a solution on another one."""
        height, slope = nodes
        scheme = scheme or self.scheme
        slopes = slope if scheme == "hermite" else None
        line = self.line.through(height, slopes)
        if scheme == "backward_euler":
            contact = not {"contact_fraction", "contact_slope"}.isdisjoint(self.columns)
            return sliding.stepped_sliding(line, self.deborah, self.loads, contact)
        guesses = None if near is None else near.depth
        return sliding.steady_sliding(line, self.deborah, self.loads, guesses, close)

    def _sampled(self, accuracy: float) -> tuple[Steady, Errors]:
        """Solve cases from node to node; the errors are infinite where that gives nothing."""
        settings = SETTINGS
        steady, errors = sliding.unsolved(self.loads.size), Errors.unknown(self.loads.size)
        left = np.flatnonzero(sliding.valid(self.deborah, self.loads))
        height, slope = self._nodes(settings.sampled)
        cases = self.deborah[left], self.loads[left]
        coarse, fine = vectorised.begin(height, slope, *cases, settings.roughly * accuracy)
        before = Change(np.zeros(left.size), np.zeros(left.size))
        for grids, refinement in enumerate(settings.refinements, 2):
            found, change = vectorised.extrapolated(coarse, fine)
            touching = fine.contact_fraction * self.line.points * 2 * refinement
            doubt = settings.profile + fine.doubt + vectorised.EXTRAPOLATED * coarse.doubt
            estimate = _estimate(grids, touching, change, before) + doubt
            estimate = np.where(np.isfinite(estimate), estimate, np.inf)
            known = _changes(coarse, fine, found, estimate)
            steady, errors = steady.replaced(left, found), errors.replaced(left, known)
            still = ~self._met(found, known, accuracy) & (np.isfinite(fine.drag) | (refinement <= settings.hope))
            left, before = left[still], change.only(still)
            coarse, fine = coarse.only(still), fine.only(still)
            if not left.size or refinement == settings.refinements[-1]:
                break
            cases = self.deborah[left], self.loads[left]
            if refinement == settings.refinements[0]:
                line = vectorised.finer(height, slope)
            grid = vectorised.settle(line, refinement, *cases, (coarse, fine), settings.trusted * accuracy)
            coarse, fine = fine, grid
        return steady, errors

    def _swept(self, accuracy: float, oversampling: int) -> tuple[Steady, Errors]:
        """Solve every case by sweeps on the coarsest of finer and finer grids that meets the accuracy."""
        steady = self.on_grid(oversampling)
        finer = self._nodes(2 * oversampling)
        errors = self._errors(steady, finer)
        while oversampling < SETTINGS.finest:
            missing = ~self._met(steady, errors, accuracy) & (steady.status == Outcome.CONVERGED)
            if not np.any(missing):
                break
            oversampling *= 2
            some = self.only(missing)
            found = some._solve(finer, near=steady.only(missing))
            finer = self._nodes(2 * oversampling)
            errors = errors.replaced(missing, some._errors(found, finer))
            steady = steady.replaced(missing, found)
        return steady, errors

    def _errors(self, steady: Steady, finer: tuple[FloatArray, FloatArray]) -> Errors:
        """Compare a solution with the exact sweep over cubic cells of half the width.

        The finer grid has a small part of the error of the coarser one; a coarser grid has many times its error. Where
        a peak is touched on less than two nodes the curvature of its cubic counts, on both grids.
        """
        other, points = self._solve(finer, "hermite", steady, SETTINGS.close), self.line.points
        oversampling = finer[0].size // (2 * points)
        hardly = other.contact_fraction * points * oversampling < SETTINGS.hardly
        least = np.where(hardly, SETTINGS.of_a_peak / oversampling**2, 0.0)
        with np.errstate(all="ignore"):
            drag = np.abs(steady.drag / other.drag - 1)
        # where a coarse grid has no solution nothing is known
        lost = np.isnan(drag) & (other.status == Outcome.CONVERGED)
        drag = np.where(lost, np.inf, np.maximum(drag, SETTINGS.rounding))
        return _changes(steady, other, steady, np.maximum(SETTINGS.safety * drag, least))


def goes_from_node_to_node(body: Shape | None, accuracy: float) -> bool:
    """Return whether cubic cells are left to cases that are too hard from node to node."""
    return body is None and accuracy >= SETTINGS.quickest


def _changes(coarse: Any, fine: Any, steady: Steady, drag: FloatArray) -> Errors:
    """Return the errors of a solution: of its drag as estimated, of the rest from the change between two grids."""
    with np.errstate(all="ignore"):
        rest = [SETTINGS.safety * np.abs(getattr(fine, name) - getattr(coarse, name)) for name in COLUMNS[1:]]
        return Errors(drag * steady.drag, *rest)


def _estimate(grids: int, touching: FloatArray, change: Change, before: Change) -> FloatArray:
    """Return the relative error of the drag extrapolated from the last of some grids, infinite if too few nodes touch.

    Two grids may agree by chance, hardly three, and hardly in the length in contact as well.
    """
    settings = SETTINGS
    many = touching > settings.many
    if grids == 2:
        estimate = np.maximum(change.drag, settings.of_first_contact * change.contact)
        return np.where(many, estimate, np.inf)
    safety = np.where(many, settings.safety_of_many, settings.quick_safety)
    estimate = np.maximum(safety * change.drag, settings.quick_memory * before.drag)
    if grids == 3:
        memory = np.maximum(settings.of_drag_before * before.drag, settings.of_contact_before * before.contact)
        seen = np.where(many, settings.of_drag, settings.quick_safety) * change.drag
        estimate = np.maximum(np.maximum(seen, settings.of_contact * change.contact), memory)
    return np.where(touching > settings.few, estimate, np.inf)
