"""Steady sliding of any linear viscoelastic foundation along a rough line or under an indenter, solved directly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.viscoelastic_newton import solve_sliding, static_depth
from mdr_dask.physics.sliding.viscoelastic_sweep import Travelling
from mdr_dask.physics.solids import LinearSolid, recovery
from mdr_dask.physics.surfaces.cubic_line import CubicLine


class Settings(NamedTuple):
    """What was tuned with ``python -m benchmarks friction honesty_bodies``, on seeds other than those of the docs."""

    tolerance: float = 1e-11  # last step of Newton's method, of the depth: above rounding
    shortest: float = 1e-9  # of a cell: arms that relax within count as a dashpot, which is an arm of a tenth of it
    balance: float = 1e-3  # largest relative difference of the load carried, which counts as error: rounding mostly
    resolved: float = 0.5  # largest relative change of a number between two grids that is extrapolated
    hardly: float = 1.5  # cells in contact below which the change between two grids is a part of the error only
    cells_of_a_peak: int = 16  # cells in contact for every peak of the line whose errors are independent
    safety: float = 3.3
    # of the last change of drag, depth, contact fraction and slope, which their errors are never below
    by_chance: tuple[float, ...] = (0.03, 0.03, 0.15, 0.15)
    of_before: float = 0.15  # of the change before, which the last one is never taken for less than
    of_others: tuple[float, ...] = (0.02, 0.0, 0.04, 0.04)  # of the largest relative change of the four
    of_a_cell: tuple[float, ...] = (0.0, 0.0, 0.2, 0.1)  # over cells in contact: edges move within their cells
    near_a_node: int = 16  # cells in contact below which the height of the highest peak between nodes counts in full


SETTINGS = Settings()

GRIDS = (1, 2, 4)
"""Every node, every second and every fourth: extrapolation and its error estimate."""

DRAG, DEPTH, FRACTION, SLOPE = range(4)


@dataclass(frozen=True)
class ViscoelasticSteady:
    """A steady state; every number is NaN unless it converged.

    Parameters
    ----------
    values : array, shape (4,)
        F_x / (4 G_inf) in the unit of height squared, penetration of the mean line (of z = 0 under an indenter), length
        in contact over length of the line, rms slope of the line over the contact: the columns of a `Steady`.
    errors : array, shape (4,)
        Their estimated absolute discretisation errors.
    status : Outcome
        How it ended.
    sweeps : int
        Sweeps of the finest line.
    """

    values: FloatArray
    errors: FloatArray
    status: Outcome
    sweeps: int


def steady_viscoelastic_sliding(line: CubicLine, solid: LinearSolid, load: float) -> ViscoelasticSteady:
    """Return the steady state of a foundation of independent elements that slides along a line.

    An element that has travelled s along the line is pressed by ``w(s) = d + h(s)``. In contact u = w, free f = 0, with
    f = 4 dx [G_inf u + sum G_m (u - a_m) + eta v u'] (thesis 3.3.3 for any linear rheology).

    Parameters
    ----------
    line : CubicLine
        Its nodes: the line is straight between them here. The number of cells is a multiple of four, so that every
        fourth node spans the same line.
    solid : LinearSolid
        The material, its times in units of L / v: Deborah numbers of its arms.
    load : float
        F_N / (4 G_inf L), in the unit of height.

    Raises
    ------
    ValueError
        If a number is not finite or not positive, or the number of cells is not one of those allowed.

    Notes
    -----
    The line is swept exactly; the result is extrapolated from the same line with every second node. The answer depends
    on nothing but the arguments: the coarsest grid starts from the statics.
    """
    return ViscoelasticLadder(solid, load).on(line)


class ViscoelasticLadder:
    """One case on a line of ever finer nodes: each grid is solved once, and the last three tell state and error.

    Parameters
    ----------
    solid, load
        As in :func:`steady_viscoelastic_sliding`.
    """

    def __init__(self, solid: LinearSolid, load: float) -> None:
        if not (np.isfinite(load) and load > 0):
            raise ValueError(f"the load must be positive and finite, got {load!r}")
        self._solid, self._load = solid, load
        self._first: tuple[int, int, _Load] | None = None  # cells of the first line, its highest node, the case there
        self._solutions: tuple[_Solution, ...] = ()

    def on(self, line: CubicLine) -> ViscoelasticSteady:
        """Return the steady state on a line; on a second one, which has twice its cells, only the finest grid is new.

        A periodic line is followed from the highest node of the first one on, which has to be that of all.
        """
        _check(line)
        cells = line.enter.size
        heights = line.height[:cells] if line.periodic else line.height
        if self._first is None:
            self._first = cells, int(np.argmax(heights)), _Load.of(self._solid, self._load, 1 / cells)
        coarsest, begins, load = self._first
        top = begins * cells // coarsest if line.periodic else int(np.argmax(heights))
        summit = float(heights[top])
        below = heights - summit
        below = np.append(np.roll(below, -top), 0.0) if line.periodic else below
        for step in reversed(GRIDS[: 1 if self._solutions else None]):
            start = self._solutions[-1].from_summit(summit).start if self._solutions else None
            args = below[::step], summit, step * coarsest / cells, load, line.periodic
            found = _solve(*args, start)
            if found.status == Outcome.DEPTH_NOT_FOUND and start is not None:
                found = _solve(*args, None)
            self._solutions = (*self._solutions, found)[-len(GRIDS) :]
        mean = float(heights.mean()) if line.periodic else 0.0
        solutions = [each.from_summit(summit) for each in self._solutions]
        return _extrapolated(solutions, _Top.of(below, mean - summit, line.periodic))


@dataclass(frozen=True)
class _Load:
    """A cell of the first line, the static load in these times height, and the arms as they travel over them."""

    cell: float
    strain_area: float
    solid: Travelling

    @classmethod
    def of(cls, solid: LinearSolid, load: float, cell: float) -> _Load:
        """Measure a solid in cells and static moduli; arms much shorter than a cell and the dashpot are one arm."""
        static = solid.static_modulus
        fast = solid.times < SETTINGS.shortest * cell
        moduli, deborah = solid.moduli[~fast] / static, solid.times[~fast] / cell
        viscosity = (solid.viscosity + solid.moduli[fast] @ solid.times[fast]) / static
        if viscosity > 0:
            shortest = SETTINGS.shortest / 10
            moduli = np.append(viscosity / cell / shortest, moduli)
            deborah = np.append(shortest, deborah)
        modes = recovery(moduli, deborah)
        columns = modes.stretch.T.copy(), modes.amplitude.T.copy()
        return cls(cell, load / cell, Travelling(moduli, deborah, modes.times, *columns))


@dataclass(frozen=True)
class _Solution:
    values: FloatArray
    start: FloatArray
    imbalance: float
    status: Outcome
    sweeps: int
    summit: float  # the height that depths are counted from

    def from_summit(self, summit: float) -> _Solution:
        """Return it with depths from another height."""
        if summit == self.summit:
            return self
        values, start = self.values.copy(), self.start.copy()
        values[DEPTH] += summit - self.summit
        start[-1] += summit - self.summit
        return replace(self, values=values, start=start, summit=summit)


def _solve(
    profile: FloatArray, summit: float, step: float, load: _Load, periodic: bool, start: FloatArray | None
) -> _Solution:
    """Solve on cells `step` times those of the first line, from the statics or from the state on the grid before."""
    profile, strain_area = np.ascontiguousarray(profile), load.strain_area / step
    cell = load.cell * step
    if start is None or not np.all(np.isfinite(start)):
        inner = profile[:-1] if periodic else profile
        depth = static_depth(inner, strain_area)
        start = np.append(np.full(load.solid.moduli.size, depth - strain_area / inner.size), depth)
    unknown, totals = start.copy(), np.empty(6)
    solid = load.solid._replace(deborah=load.solid.deborah / step, times=load.solid.times / step)
    converged, sweeps, inside = solve_sliding(
        profile, strain_area, periodic, solid, SETTINGS.tolerance, unknown, totals
    )
    imbalance = abs(float(totals[1]) / strain_area - 1)
    good = converged and imbalance < SETTINGS.balance and unknown[-1] > 0
    status = Outcome.CONVERGED if good else Outcome.DEPTH_NOT_FOUND
    status = status if inside else Outcome.OUTSIDE_LINE
    slope = np.sqrt(totals[4] / totals[3]) / cell if totals[3] > 0 else 0.0
    values = np.array([totals[2], unknown[-1], totals[3] / (profile.size - 1), slope])
    return _Solution(values, unknown, imbalance, status, sweeps, summit)


class _Top(NamedTuple):
    """Cells and peaks of a line, its mean from the highest node, and by how much the peak there rises over it."""

    cells: int
    peaks: int
    mean: float
    rise: float

    @classmethod
    def of(cls, below: FloatArray, mean: float, periodic: bool) -> _Top:
        """Return them from heights below the highest node, at which a periodic line begins and ends."""
        peaks = int(np.count_nonzero((below[1:-1] > below[:-2]) & (below[1:-1] >= below[2:]))) + 1
        top = int(np.argmax(below))
        before, after = below[top - 1 if top or not periodic else -2], below[min(top + 1, below.size - 1)]
        bend = -(before + after)
        rise = float((after - before) ** 2 / (8 * bend)) if bend > 0 else 0.0  # of the parabola through three nodes
        return cls(below.size - 1, peaks, mean, rise)


def _extrapolated(solutions: list[_Solution], top: _Top) -> ViscoelasticSteady:
    """Extrapolate the two finest grids by their second order; the coarsest tells how well that works.

    An error is estimated by a geometric mean of the last change of the extrapolation, counted twice, and of the last
    change of the grids, since the former may be small by accident. That of the drag falls with the number of cells in
    contact, whose errors are independent. One number may agree on three grids by chance, hardly all four. Where hardly
    a cell is in contact numbers halve with the cells, and the exact ones may lie far below. All grids share the highest
    node: by how much a peak rises over it they do not see.
    """
    settings = SETTINGS
    coarsest, coarse, fine = solutions
    if any(solution.status != Outcome.CONVERGED for solution in solutions):
        status = fine.status if fine.status != Outcome.CONVERGED else Outcome.DEPTH_NOT_FOUND
        return ViscoelasticSteady(np.full(4, np.nan), np.full(4, np.nan), status, fine.sweeps)
    size, touching = np.abs(fine.values), float(fine.values[FRACTION]) * top.cells
    change, before = np.abs(fine.values - coarse.values), np.abs(coarse.values - coarsest.values)
    resolved = change <= settings.resolved * size
    values = np.where(resolved, fine.values + (fine.values - coarse.values) / 3, fine.values)
    if touching < 1 or (touching < settings.hardly and not resolved[DRAG]):
        errors = change * (settings.hardly / touching if touching > 0 else np.inf)
    else:
        again = np.abs(values - (coarse.values + (coarse.values - coarsest.values) / 3))
        change = np.maximum(change, settings.of_before * before)
        estimate = settings.safety * np.cbrt(again**2 * change)
        estimate[DRAG] /= min(touching, settings.cells_of_a_peak * top.peaks) ** 0.25
        others = np.max(change[size > 0] / size[size > 0], initial=0.0) * np.array(settings.of_others)
        least = np.maximum(others, np.array(settings.of_a_cell) / touching) * size
        estimate = np.maximum(np.maximum(estimate, np.array(settings.by_chance) * change), least)
        errors = np.where(resolved, estimate, change)
    errors[DEPTH] += top.rise * min(1.0, settings.near_a_node / touching if touching > 0 else 1.0)
    errors += fine.imbalance * np.abs(values)
    values[DEPTH] += top.mean
    values[FRACTION] = min(max(values[FRACTION], 0.0), 1.0)
    return ViscoelasticSteady(values, errors, fine.status, fine.sweeps)


def _check(line: CubicLine) -> None:
    if not np.all(np.isfinite(line.height)):
        raise ValueError("the heights must be finite")
    cells = line.enter.size
    if cells < 8 or cells % GRIDS[-1]:
        raise ValueError(f"a line needs a multiple of four cells and at least eight, got {cells}")
