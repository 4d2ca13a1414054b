"""One realisation of a rough line and the cases on it, on the grids that their accuracy needs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray

if TYPE_CHECKING:
    from mdr_dask.physics.sliding.steady import Scheme, Steady
    from mdr_dask.physics.sliding.vectorised import Change

FINEST = 64  # oversampling beyond which `auto` gives up
SAFETY = 3.0  # see docs/friction.md for how honest it makes the estimate
CLOSE = 0.005  # change of the depth between grids that is taken from the tangent
SEARCH = 1e-8  # bound of the error of the search for the depth, and of rounding
# nodes in contact that see a peak by its curvature only, and the error of that times the oversampling squared
HARDLY, OF_A_PEAK = 2, 0.1
RESTART = 4  # oversampling of the sweeps over what is left
SAMPLED = 2  # oversampling of a line that cases go along from node to node
REFINEMENTS = (1, 2, 4, 8, 16, 32, 64, 128, 256)  # of the cells of half the width, where they are touched
QUICKEST = 2e-3  # accuracy that needs more than that
# of the last change of the drag between grids, and of the one before; see docs/friction.md
QUICK_SAFETY, QUICK_MEMORY = 0.6, 0.06
HOPE = 2  # of them, from which on a grid without a solution ends the way from node to node
FEW = 10  # nodes in contact that are too few to go from node to node
PROFILE = 1e-5  # of the profile between nodes, under the lightest contacts
MANY, SAFETY_OF_MANY = 1000, 0.4  # nodes in contact whose errors are an average
# on the first three grids: of the change of the drag with so many nodes, of that of the contact, and of those before
OF_DRAG, OF_CONTACT, OF_DRAG_BEFORE, OF_CONTACT_BEFORE = 0.12, 0.15, 0.02, 0.03
OF_FIRST_CONTACT = 0.5  # of the change of the contact on the first two
# of the accuracy, that the search for the depth may leave on the second grid and on finer ones
ROUGHLY, TRUSTED = 0.5, 0.1


@dataclass(frozen=True)
class Line:
    """What fixes a line but for its phases, in units of its length and rms height."""

    hurst: float
    points: int
    rolloff: float
    longest: float
    coefficient: float  # of the indenter c |x|^n, 0 for a plane
    exponent: float

    def amplitudes(self) -> FloatArray:
        """Return the amplitudes of its harmonics."""
        return _amplitudes(self.points // 2, self.hurst, self.rolloff, self.longest)

    def sampled(self, accuracy: float) -> bool:
        """Return whether the cubic cells of `auto` are left to the cases that are too hard from node to node."""
        return self.coefficient == 0 and accuracy >= QUICKEST

    def slope(self) -> float:
        """Return the spectral rms slope."""
        return _slope(self)


@lru_cache(maxsize=32)
def _amplitudes(modes: int, hurst: float, rolloff: float, longest: float) -> FloatArray:
    from mdr_dask.physics.surfaces import roughness

    return roughness.amplitudes(modes, hurst, rolloff, longest)


@lru_cache(maxsize=1024)
def _slope(line: Line) -> float:
    from mdr_dask.physics.surfaces import roughness

    return roughness.spectral_slope(line.amplitudes())


@dataclass(frozen=True)
class Task:
    """Cases on one realisation of a line, in units of its length and rms height."""

    line: Line
    turned: NDArray[np.complex128]  # exp(i phi) of its harmonics
    scheme: Scheme
    reaches: FloatArray  # v tau / L
    loads: FloatArray  # F_N / (4 G L h)
    contact: bool  # whether fraction and slope of the contact are wanted

    def only(self, cases: NDArray[Any]) -> Task:
        """Return some of the cases."""
        return replace(self, reaches=self.reaches[cases], loads=self.loads[cases])

    def nodes(self, oversampling: int, scheme: Scheme) -> tuple[FloatArray, FloatArray]:
        """Return heights and slopes of the roughness on a grid; a scheme without slopes gets the heights again."""
        from mdr_dask.physics.surfaces import roughness

        amplitude, count = self.line.amplitudes(), self.line.points * oversampling
        height = roughness.turned_line(amplitude, self.turned, count)
        slope = roughness.turned_line(amplitude, self.turned, count, 1) if scheme == "hermite" else height
        if self.line.coefficient == 0:
            return height, slope
        return np.append(height, height[0]), np.append(slope, slope[0])

    def solve(
        self, nodes: tuple[FloatArray, FloatArray], scheme: Scheme, near: Steady | None = None, close: float = 0.0
    ) -> Steady:
        """Solve the cases on a grid, beginning near a solution on another one."""
        from mdr_dask.physics.sliding import steady as sliding
        from mdr_dask.physics.surfaces.cubic_line import indented_line, periodic_line
        from mdr_dask.physics.surfaces.shapes import PowerLaw

        height, slope = nodes
        slopes = slope if scheme == "hermite" else None
        body = PowerLaw(self.line.coefficient, self.line.exponent)
        line = indented_line(height, slopes, body) if self.line.coefficient else periodic_line(height, slopes)
        if scheme == "backward_euler":
            return sliding.stepped_sliding(line, self.reaches, self.loads, self.contact)
        guesses = None if near is None else near.depth
        return sliding.steady_sliding(line, self.reaches, self.loads, guesses, close)

    def on_grid(self, oversampling: int) -> Steady:
        """Solve the cases on one grid, without an estimate of the error."""
        return self.solve(self.nodes(oversampling, self.scheme), self.scheme)

    def with_error(self, oversampling: int) -> tuple[Steady, FloatArray]:
        """Solve the cases on one grid and estimate the relative error of their friction."""
        steady = self.on_grid(oversampling)
        return steady, self._error(steady, self.nodes(2 * oversampling, "hermite"))

    def to_accuracy(self, accuracy: float) -> tuple[Steady, FloatArray]:
        """Solve every case on the coarsest grid whose error estimate meets the accuracy."""
        if self.scheme != "hermite":
            return self._swept(accuracy, 1)
        if not self.line.sampled(accuracy):
            return self._swept(accuracy, 2)
        steady, error = self._sampled(accuracy)
        wanting = ~(error <= accuracy)
        if np.any(wanting):
            found, error[wanting] = self.only(wanting)._swept(accuracy, RESTART)
            steady = steady.replaced(wanting, found)
        return steady, error

    def _sampled(self, accuracy: float) -> tuple[Steady, FloatArray]:
        """Solve cases from node to node; the error is infinite where that gives nothing."""
        from mdr_dask.physics.sliding import steady as sliding
        from mdr_dask.physics.sliding import vectorised as sampled

        steady, error = sliding.unsolved(self.loads.size), np.full(self.loads.size, np.inf)
        left = np.flatnonzero(sliding.valid(self.reaches, self.loads))
        height, slope = self.nodes(SAMPLED, "hermite")
        coarse, fine = sampled.begin(height, slope, self.reaches[left], self.loads[left], ROUGHLY * accuracy)
        before = sampled.Change(np.zeros(left.size), np.zeros(left.size))
        for grids, refinement in enumerate(REFINEMENTS, 2):
            found, change = sampled.extrapolated(coarse, fine)
            touching = fine.contact_fraction * self.line.points * 2 * refinement
            estimate = _estimate(grids, touching, change, before) + PROFILE
            estimate += fine.doubt + sampled.EXTRAPOLATED * coarse.doubt
            error[left] = np.where(np.isfinite(estimate), estimate, np.inf)
            steady = steady.replaced(left, found)
            still = ~(error[left] <= accuracy) & (np.isfinite(fine.drag) | (refinement <= HOPE))
            left, before = left[still], change.only(still)
            coarse, fine = coarse.only(still), fine.only(still)
            if not left.size or refinement == REFINEMENTS[-1]:
                break
            cases = self.reaches[left], self.loads[left]
            if refinement == REFINEMENTS[0]:
                line = sampled.finer(height, slope)
            coarse, fine = fine, sampled.settle(line, refinement, *cases, (coarse, fine), TRUSTED * accuracy)
        return steady, error

    def _swept(self, accuracy: float, oversampling: int) -> tuple[Steady, FloatArray]:
        """Solve every case by sweeps on the coarsest of finer and finer grids that meets the accuracy."""
        steady = self.on_grid(oversampling)
        finer = self.nodes(2 * oversampling, "hermite")
        error = self._error(steady, finer)
        while oversampling < FINEST:
            wanting = ~(error <= accuracy) & (steady.status == 0)
            if not np.any(wanting):
                break
            oversampling *= 2
            some = self.only(wanting)
            found = some.solve(finer, self.scheme, steady.only(wanting))
            finer = self.nodes(2 * oversampling, "hermite")
            error[wanting] = some._error(found, finer)
            steady = steady.replaced(wanting, found)
        return steady, error

    def _error(self, steady: Steady, finer: tuple[FloatArray, FloatArray]) -> FloatArray:
        """Compare a solution with the exact sweep over cubic cells of half the width.

        The finer grid has a small part of the error of the coarser one; a coarser grid has many times its error. Where
        a peak is touched on less than two nodes the curvature of its cubic counts, on both grids.
        """
        other, points = self.solve(finer, "hermite", steady, CLOSE), self.line.points
        oversampling = finer[0].size // (2 * points)
        hardly = other.contact_fraction * points * oversampling < HARDLY
        least = np.where(hardly, OF_A_PEAK / oversampling**2, 0.0)
        return np.maximum(SAFETY * _difference(steady, other), least)


def _difference(one: Steady, other: Steady) -> FloatArray:
    with np.errstate(all="ignore"):
        change = np.abs(one.drag / other.drag - 1)
    # where a coarse grid has no solution nothing is known
    return np.where(np.isnan(change) & (other.status == 0), np.inf, np.maximum(change, SEARCH))


def _estimate(grids: int, touching: FloatArray, change: Change, before: Change) -> FloatArray:
    """Return the relative error of the drag extrapolated from the last of some grids, infinite if too few nodes touch.

    Two grids may agree by chance, hardly three, and hardly in the length in contact as well.
    """
    many = touching > MANY
    if grids == 2:
        estimate = np.maximum(change.drag, OF_FIRST_CONTACT * change.contact)
        return np.where(many, estimate, np.inf)
    safety = np.where(many, SAFETY_OF_MANY, QUICK_SAFETY)
    estimate = np.maximum(safety * change.drag, QUICK_MEMORY * before.drag)
    if grids == 3:
        memory = np.maximum(OF_DRAG_BEFORE * before.drag, OF_CONTACT_BEFORE * before.contact)
        seen = np.where(many, OF_DRAG, QUICK_SAFETY) * change.drag
        estimate = np.maximum(np.maximum(seen, OF_CONTACT * change.contact), memory)
    return np.where(touching > FEW, estimate, np.inf)
