"""Steady sliding of any linear viscoelastic foundation along a rough line or under an indenter, solved directly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.sliding.steady import CONVERGED, NOT_CONVERGED, OUTSIDE_LINE
from mdr_dask.physics.sliding.viscoelastic_newton import solve_sliding, static_depth
from mdr_dask.physics.solids import LinearSolid, recovery

TOLERANCE = 1e-11
"""Last step of Newton's method, relative to the depth: far below any discretisation error, above rounding."""

SHORTEST_REACH = 1e-9
"""Arms that relax within this part of a cell count as a dashpot, which is an arm of a tenth of it.

The error is of that relative size.
"""

BALANCE = 1e-3
"""Largest relative difference between the load carried and the load wanted, which counts as error.

It is rounding but for contacts far shorter than a cell, whose ends are known to 1e-13 of the line.
"""

RESOLVED = 0.5
"""Largest relative change of a number between two grids that is extrapolated."""

HARDLY = 1.5
"""Cells in contact below which the change between two grids is a part of the error only, which is their share of it."""

CELLS_OF_A_PEAK = 16
"""Cells in contact for every peak of the line beyond which their errors are not independent."""

BY_CHANCE = 0.03
"""Part of the last change between grids that the estimate is never below: three grids may agree by chance."""

GRIDS = (1, 2, 4)
"""Every point, every second and every fourth: extrapolation and its error estimate."""

SAFETY = 2.4
"""Of the error estimate; see docs/materials.md for how honest it is."""


@dataclass(frozen=True)
class ViscoelasticSteady:
    """A steady state; every number is NaN unless it converged.

    Parameters
    ----------
    friction_coefficient : float
        F_x / F_N, positive when it resists.
    depth : float
        Penetration of the mean line (of z = 0 for an indenter), m.
    contact_fraction : float
        Length in contact over length of the line.
    contact_slope : float
        rms slope of the line over the contact.
    error : float
        Estimated relative error of the friction coefficient.
    status : int
        `CONVERGED`, `NOT_CONVERGED` or `OUTSIDE_LINE`, with messages in `steady.MESSAGES`.
    sweeps : int
        Sweeps of the finest line.
    """

    friction_coefficient: float
    depth: float
    contact_fraction: float
    contact_slope: float
    error: float
    status: int
    sweeps: int


def steady_viscoelastic_sliding(
    height: FloatArray,
    spacing: float,
    solid: LinearSolid,
    velocity: float,
    normal_force: float,
    periodic: bool = True,
) -> ViscoelasticSteady:
    """Return the steady state of a foundation of independent elements that slides along a line.

    An element that has travelled s along the line is pressed by ``w(s) = d + h(s)``; in contact u = w, free f = 0, with
    f = 4 dx [G_inf u + sum G_m (u - a_m) + eta v u'] (thesis 3.3.3 for any linear rheology).

    Parameters
    ----------
    height : array, shape (points,)
        Heights h, m, positive into the elastomer, in the order in which an element meets them. A multiple of four
        points
        if `periodic`, one more otherwise, so that every fourth point spans the same line.
    spacing : float
        Distance of points, m.
    solid : LinearSolid
        The material.
    velocity, normal_force : float
        v, m/s, and F_N, N; positive.
    periodic : bool
        Whether the line closes; otherwise elements enter undeformed at its first point.

    Raises
    ------
    ValueError
        If a number is not finite or not positive, or the number of points is not one of those allowed.

    Notes
    -----
    The line is straight between points and swept exactly; the result is extrapolated from the same line with every
    second
    point. The answer depends on nothing but the arguments: the coarsest grid starts from the statics.
    """
    heights = np.asarray(height, dtype=np.float64)
    _check(heights, spacing, velocity, normal_force, periodic)
    top = int(np.argmax(heights))
    below = heights - heights[top]
    below = np.append(np.roll(below, -top), 0.0) if periodic else below
    load = _Load.of(solid, velocity, normal_force, spacing)
    solutions: list[_Solution] = []
    for step in reversed(GRIDS):
        start = solutions[-1].start if solutions else None
        found = _solve(below[::step], step, load, periodic, start)
        if found.status == NOT_CONVERGED and start is not None:
            found = _solve(below[::step], step, load, periodic, None)
        solutions.append(found)
    mean = float(heights.mean()) if periodic else 0.0
    peaks = int(np.count_nonzero((below[1:-1] > below[:-2]) & (below[1:-1] >= below[2:]))) + 1
    return _extrapolated(solutions, mean - float(heights[top]), below.size - 1, peaks)


@dataclass(frozen=True)
class _Load:
    """A cell of the finest grid, the static load in these times height, and the arms as they travel over them."""

    cell: float
    strain_area: float
    moduli: FloatArray
    reach: FloatArray
    times: FloatArray
    stretch_of: FloatArray
    amplitude_of: FloatArray

    @classmethod
    def of(cls, solid: LinearSolid, velocity: float, normal_force: float, cell: float) -> _Load:
        """Measure a solid in cells and static moduli; arms much shorter than a cell and the dashpot are one arm."""
        static = solid.static_modulus
        fast = solid.times < SHORTEST_REACH * cell / velocity
        moduli, reach = solid.moduli[~fast] / static, solid.times[~fast] * velocity / cell
        viscosity = (solid.viscosity + solid.moduli[fast] @ solid.times[fast]) / static
        if viscosity > 0:
            shortest = SHORTEST_REACH / 10
            moduli = np.append(viscosity * velocity / cell / shortest, moduli)
            reach = np.append(shortest, reach)
        modes = recovery(moduli, reach)
        area = normal_force / (4 * static * cell)
        return cls(cell, area, moduli, reach, modes.times, modes.stretch.T.copy(), modes.amplitude.T.copy())


@dataclass(frozen=True)
class _Solution:
    values: FloatArray
    start: FloatArray
    imbalance: float
    status: int
    sweeps: int


def _solve(profile: FloatArray, step: int, load: _Load, periodic: bool, start: FloatArray | None) -> _Solution:
    """Solve on cells `step` times the finest, from the statics or from the state found on the grid before."""
    profile, strain_area = np.ascontiguousarray(profile), load.strain_area / step
    cell = load.cell * step
    if start is None or not np.all(np.isfinite(start)):
        inner = profile[:-1] if periodic else profile
        depth = static_depth(inner, strain_area)
        start = np.append(np.full(load.moduli.size, depth - strain_area / inner.size), depth)
    unknown, totals = start.copy(), np.empty(6)
    arms = load.moduli, load.reach / step, load.times / step, load.stretch_of, load.amplitude_of
    converged, sweeps, inside = solve_sliding(profile, strain_area, periodic, *arms, TOLERANCE, unknown, totals)
    imbalance = abs(float(totals[1]) / strain_area - 1)
    status = OUTSIDE_LINE if not inside else CONVERGED if converged and imbalance < BALANCE else NOT_CONVERGED
    slope = np.sqrt(totals[4] / totals[3]) / cell if totals[3] > 0 else 0.0
    values = np.array([totals[2] / strain_area / cell, unknown[-1], totals[3] / (profile.size - 1), slope])
    return _Solution(values, unknown, imbalance, status, sweeps)


def _extrapolated(solutions: list[_Solution], mean: float, cells: int, peaks: int) -> ViscoelasticSteady:
    """Extrapolate the two finest grids by their second order; the coarsest tells how well that works.

    The error is estimated by a geometric mean of the last change of the extrapolation, counted twice, and of the last
    change of the grids, since the former may be small by accident. It falls with the number of cells in contact, whose
    errors are independent. Where hardly a cell is in contact the friction halves with the cells, and the exact one may
    lie far below.
    """
    coarsest, coarse, fine = solutions
    if any(solution.status != CONVERGED for solution in solutions):
        status = fine.status if fine.status != CONVERGED else NOT_CONVERGED
        return ViscoelasticSteady(np.nan, np.nan, np.nan, np.nan, np.nan, status, fine.sweeps)
    correction = (fine.values - coarse.values) / 3
    before = coarse.values + (coarse.values - coarsest.values) / 3
    resolved = 3 * np.abs(correction) <= RESOLVED * np.abs(fine.values)
    values = np.where(resolved, fine.values + correction, fine.values)
    change, touching = 3 * float(abs(correction[0])), float(fine.values[2]) * cells
    if touching < 1 or (touching < HARDLY and not resolved[0]):
        change = change * HARDLY / touching if touching > 0 else np.inf
    elif resolved[0]:
        independent = min(touching, CELLS_OF_A_PEAK * peaks)
        extrapolated = SAFETY * float(np.cbrt((values[0] - before[0]) ** 2 * change) / independent**0.25)
        change = max(extrapolated, BY_CHANCE * change)
    friction, depth, fraction, slope = (float(value) for value in values)
    error = change / abs(friction) if friction else change
    fraction = min(max(fraction, 0.0), 1.0)
    return ViscoelasticSteady(friction, depth + mean, fraction, slope, error + fine.imbalance, fine.status, fine.sweeps)


def _check(heights: FloatArray, spacing: float, velocity: float, normal_force: float, periodic: bool) -> None:
    if heights.ndim != 1 or not np.all(np.isfinite(heights)):
        raise ValueError("the heights must be one row of finite numbers")
    cells = heights.size if periodic else heights.size - 1
    if cells < 8 or cells % GRIDS[-1]:
        wanted = "a multiple of four points" if periodic else "one point more than a multiple of four"
        raise ValueError(f"a line needs {wanted} and at least eight cells, got {heights.size} points")
    for name, value in (("spacing", spacing), ("velocity", velocity), ("normal force", normal_force)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"the {name} must be positive and finite, got {value!r}")
