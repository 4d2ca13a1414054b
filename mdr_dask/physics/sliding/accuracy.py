"""Steady states to an accuracy: which grids a case is solved on, and what is known of its errors.

A ladder climbs from grid to grid until the errors estimated are small enough, for every case on its own. Cases go from
node to node first (`vectorised`) where that is cheaper, and through cubic cells (`kelvin`) where it is not enough.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding import full_contact, vectorised
from mdr_dask.physics.sliding import steady as sliding
from mdr_dask.physics.sliding.cases import Cases, Scheme, Steady, valid
from mdr_dask.physics.surfaces.rough_line import RoughLine
from mdr_dask.physics.surfaces.shapes import Shape


class Settings(NamedTuple):
    """What was tuned, with ``python -m benchmarks friction honesty``, on seeds other than those of the evidence."""

    finest: int = 64  # oversampling beyond which a case is given up
    safety: float = 3.0  # of the difference between two grids of cubic cells
    close: float = 0.005  # relative change of the depth between grids that is taken from the tangent
    near: float = 0.05  # accuracy of what straight cells and steps on a grid are held against first
    rounding: float = 1e-8  # bound of the error of the search for the depth, and of rounding
    hardly: int = 2  # nodes in contact that see a peak by its curvature only
    of_a_peak: float = 0.1  # the error of that, times the oversampling squared
    restart: int = 4  # oversampling of the cubic cells that take over
    sampled: int = full_contact.SEEN  # oversampling of a line that cases go along from node to node
    refinements: tuple[int, ...] = (2, 4, 8, 16, 32, 64, 128, 256, 512)  # of its cells, where they are touched
    quickest: float = 1e-4  # accuracy that needs more than going from node to node
    # from node to node, for every column: of the last change between grids, of the one before it over that, and of the
    # largest relative change of any column but the depth (of the depth in rms heights): the last one, that of the
    # first two grids in slow sliding, however many nodes touch, and the one before
    of_change: tuple[float, ...] = (0.07, 0.2, 0.2, 0.2)
    of_change_before: float = 0.1
    of_any_change: tuple[float, ...] = (0.04, 0.01, 0.2, 0.2)
    of_any_first: tuple[float, ...] = (0.4, 0.02, 0.5, 0.3)
    of_any_before: tuple[float, ...] = (0.01, 0.001, 0.1, 0.1)
    averaged: float = 300.0  # nodes whose errors are an average: fewer of them are trusted less
    by_chance: float = 0.3  # over the nodes in contact: what agrees on the first two grids by chance
    few: int = 5  # nodes in contact that are too few to go from node to node
    # of the profile between nodes, under the lightest contacts: relative errors, and of the depth in rms heights
    profile: tuple[float, ...] = (5e-5, 8e-6, 5e-5, 5e-5)
    lightest: float = 0.1  # Nyquist points in contact for which that is twice as large
    hope: int = 4  # refinement from which on a grid without a solution ends the way from node to node
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
DEPTH, FRACTION = 1, 2
RELATIVE = [0, 2, 3]  # columns whose changes are over their size


def relative(steady: Steady, errors: Errors, columns: Collection[str] = COLUMNS) -> FloatArray:
    """Return errors over the size of what they belong to, a row for every column."""
    shape = len(columns), steady.status.size
    absolute, values = (np.reshape([getattr(each, name) for name in columns], shape) for each in (errors, steady))
    with np.errstate(all="ignore"):
        sizes = absolute / np.abs(values)
    sizes[absolute == 0] = 0.0  # of what is 0 and known to be, too
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
        """Solve the cases on one grid and estimate their errors.

        Straight cells and steps are held against cubic cells to some accuracy first: that costs less than an exact
        sweep, and where they are further away than what it is in doubt by, it is enough.
        """
        steady = self.on_grid(oversampling)
        if self.scheme == "hermite" or self.line.body is not None:
            return steady, self._errors(steady, self._nodes(2 * oversampling))
        other, doubts = replace(self, scheme="hermite").to_accuracy(SETTINGS.near)
        far, doubt = _changes(_columns(steady), _columns(other)), np.array(doubts)
        with np.errstate(all="ignore"):
            larger = np.fmax(_columns(steady) / _columns(other), 1.0)  # errors are told over what is found
        errors = Errors(*((far + SETTINGS.safety * doubt) * larger))
        wanted = [COLUMNS.index(name) for name in self.columns]
        left = ~np.all((doubt <= far)[wanted], axis=0)
        if np.any(left):
            some = self.only(left)
            errors = errors.replaced(left, some._errors(steady.only(left), self._nodes(2 * oversampling)))
        return steady, errors

    def to_accuracy(self, accuracy: float) -> tuple[Steady, Errors]:
        """Solve every case on the coarsest grid on which the errors of all columns wanted meet a relative accuracy."""
        if self.scheme != "hermite":
            return self._swept(accuracy, 1)
        if self.line.body is not None:
            return self._swept(accuracy, 2)
        nodes = self._nodes(full_contact.SEEN)
        closed = in_full_contact(self.line, (), nodes, self.deborah, self.loads)
        if closed is None:
            return self._partly(accuracy, nodes)
        steady, errors = closed
        left = steady.status != Outcome.CONVERGED
        if np.any(left):
            found, found_errors = self.only(left)._partly(accuracy, nodes)
            steady, errors = steady.replaced(left, found), errors.replaced(left, found_errors)
        return steady, errors

    def _partly(self, accuracy: float, nodes: tuple[FloatArray, FloatArray]) -> tuple[Steady, Errors]:
        """Solve cases on a plane that lift off somewhere, from node to node where that is cheaper."""
        if not goes_from_node_to_node(self.line.body, accuracy):
            return self._swept(accuracy, 2)
        steady, errors = self._sampled(accuracy, nodes)
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

    def _sampled(self, accuracy: float, nodes: tuple[FloatArray, FloatArray]) -> tuple[Steady, Errors]:
        """Solve cases from node to node; the errors are infinite where that gives nothing."""
        settings, points = SETTINGS, self.line.points
        values, errors = np.full((2, len(COLUMNS), self.loads.size), np.nan)
        good = valid(self.deborah, self.loads)
        left = np.flatnonzero(good)
        cases = Cases(self.deborah[left], self.loads[left])
        line, coarse, fine = vectorised.begin(*nodes, *cases, settings.roughly * accuracy)
        before, refinement = np.zeros((len(COLUMNS), left.size)), 1
        wanted = [COLUMNS.index(name) for name in self.columns]
        by_chance = bool(set(wanted) & set(RELATIVE))
        with np.errstate(all="ignore"):
            for finer in (*settings.refinements, None):
                grid = settings.sampled * refinement
                change = _changes(coarse.columns, fine.columns)
                seen = Seen(fine.contact_fraction * points, cases.deborah * points * grid)
                known = np.full_like(change, np.inf)
                if grid > settings.sampled or not by_chance or _may_be_met(seen, grid, accuracy):
                    known = _sampled_errors(fine.columns, seen, grid, change, before)
                    known += np.where(np.isnan(fine.doubts), 0.0, fine.doubts)
                values[:, left], errors[:, left] = fine.columns, known
                met = (known[wanted] <= accuracy * np.abs(fine.columns[wanted])).all(axis=0)
                still = ~met & (np.isfinite(fine.drag) | (refinement <= settings.hope))
                if finer is None or not np.any(still):
                    break
                left, before, coarse, fine = left[still], change[:, still], coarse.only(still), fine.only(still)
                cases, refinement = Cases(cases.deborah[still], cases.loads[still]), finer
                grids, trusted = (coarse, fine), settings.trusted * accuracy
                coarse, fine = fine, vectorised.settle(line, refinement, *cases, grids, trusted)
        return _found(values, good), Errors(*np.where(np.isnan(errors), np.inf, errors))

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
            drag = np.maximum(np.abs(steady.drag / other.drag - 1), SETTINGS.rounding)
            errors = SETTINGS.safety * _changes(_columns(steady), _columns(other))
            of_drag = np.maximum(SETTINGS.safety * drag, least) * np.abs(steady.drag)
        errors[COLUMNS.index("drag")] = np.where(steady.drag == 0, errors[COLUMNS.index("drag")], of_drag)
        # where one of the grids has no solution nothing is known
        errors = np.where(np.isnan(errors), np.inf, errors)
        return Errors(*errors)


def in_full_contact(
    line: RoughLine,
    arms: tuple[tuple[float, float], ...],
    nodes: tuple[FloatArray, FloatArray],
    deborah: FloatArray,
    loads: FloatArray,
) -> tuple[Steady, Errors] | None:
    """Return steady states and errors of what is in full contact with a plane, NaN of what is not; None without any."""
    steady = full_contact.steady_full_contact(line.roughness, arms, nodes, deborah, loads)
    return None if steady is None else (steady, Errors(*full_contact.ROUNDING * np.abs(_columns(steady))))


def goes_from_node_to_node(body: Shape | None, accuracy: float) -> bool:
    """Return whether cubic cells are left to cases that are too hard from node to node."""
    return body is None and accuracy >= SETTINGS.quickest


def _columns(steady: Steady) -> FloatArray:
    """Return the columns of steady states, a row for each."""
    return np.array([getattr(steady, name) for name in COLUMNS])


def _changes(coarse: FloatArray, fine: FloatArray) -> FloatArray:
    """Return the changes of the columns between two grids, infinite where either has no solution."""
    changes = np.abs(fine - coarse)
    return np.where(np.isfinite(changes), changes, np.inf)


def _found(values: FloatArray, good: NDArray[np.bool_]) -> Steady:
    """Return steady states of good cases from their columns, NaN where there is no drag."""
    found = np.isfinite(values[0]) & (values[0] > 0)
    status = np.where(good, np.int8(Outcome.DEPTH_NOT_FOUND), np.int8(Outcome.INVALID))
    status[found] = Outcome.CONVERGED
    drag, depth, fraction, slope = np.where(found, values, np.nan)
    return Steady(drag, depth, fraction, slope, status)


@lru_cache
def _column(factors: tuple[float, ...]) -> FloatArray:
    """Return one factor a row."""
    return np.array(factors)[:, None]


class Seen(NamedTuple):
    """What a grid sees of cases: the Nyquist points in contact, and the Deborah number v tau in cells."""

    touched: FloatArray
    deborah: FloatArray


def _may_be_met(seen: Seen, oversampling: int, accuracy: float) -> bool:
    """Return whether the first two grids can have agreed otherwise than by chance, in any of the cases."""
    return bool(np.any(seen.touched * oversampling >= SETTINGS.by_chance / accuracy))


def _sampled_errors(
    columns: FloatArray, seen: Seen, oversampling: int, change: FloatArray, before: FloatArray
) -> FloatArray:
    """Return the errors of the finer of two grids from the changes of the columns, infinite if too few nodes touch.

    Two grids may agree by chance: hardly in all columns, hardly twice, and hardly where many nodes touch, or for the
    contact where many do not. Where the first two agree it tells the less the slower the sliding: an element averages
    over the cells in which it recovers, but the contact fraction does not.
    """
    settings, is_first = SETTINGS, oversampling == SETTINGS.sampled
    of_change, of_any, profile = map(_column, (settings.of_change, settings.of_any_change, settings.profile))
    sizes, touched, fraction = columns.copy(), seen.touched, columns[FRACTION]
    sizes[DEPTH] = 1.0
    touching = touched * oversampling
    apart = np.clip(touching * (1 / fraction - 1), settings.few, touching)
    nodes = np.array([touching, touching, apart, apart])
    any_change, any_before = ((each / sizes)[RELATIVE].max(axis=0) for each in (change, before))
    errors = np.maximum(of_change * change, of_change * settings.of_change_before * before)
    errors = np.maximum(errors, of_any * any_change * sizes) * (1 + np.sqrt(settings.averaged / nodes))
    if is_first:
        slow = 1 / np.sqrt(1 + seen.deborah)
        of_first = _column(settings.of_any_first) * np.array([slow, slow, np.ones(slow.size), slow])
        errors = np.maximum(errors, of_first * any_change * sizes)
        errors[RELATIVE] = np.maximum(errors, settings.by_chance / nodes * sizes)[RELATIVE]
    else:
        errors = np.maximum(errors, _column(settings.of_any_before) * any_before * sizes)
    errors += profile * (1 + settings.lightest / touched) * sizes
    return np.where((touching > settings.few) & np.isfinite(errors), errors, np.inf)
