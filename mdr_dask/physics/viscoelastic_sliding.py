"""Steady sliding of any linear viscoelastic foundation along a rough line or under an indenter, solved directly."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from mdr_dask.physics.rheology import LinearSolid, Recovery, recovery
from mdr_dask.physics.viscoelastic_sweep import solve_sliding, static_depth

FloatArray = NDArray[np.float64]

TOLERANCE = 1e-11
"""Last step of Newton's method, relative to the depth: far below any discretisation error, above rounding."""

SHORTEST_REACH = 1e-9
"""Arms that relax within this part of a cell are a dashpot, and the dashpot an arm ten times shorter: an error of that size."""

BALANCE = 1e-7
"""Largest relative difference between the load carried and the load wanted: events inside cells are found to 1e-15."""


class Outcome(IntEnum):
    """What became of a solve."""

    DONE = 0
    NOT_CONVERGED = 1
    LEAVES_LINE = 2


@dataclass(frozen=True)
class SteadySliding:
    """A steady state; every number is NaN unless the outcome is DONE.

    Parameters
    ----------
    friction_coefficient : float
        F_x / F_N, positive when it resists.
    indentation_depth : float
        Penetration of the highest point of the line, m.
    contact_fraction : float
        Part of the line in contact.
    contact_slope : float
        Root mean square slope in contact.
    discretisation_error : float
        Estimated error of the friction coefficient, absolute, from the same line with every second point.
    outcome : Outcome
        Whether it converged inside the line.
    sweeps : int
        Sweeps of the full line.
    """

    friction_coefficient: float
    indentation_depth: float
    contact_fraction: float
    contact_slope: float
    discretisation_error: float
    outcome: Outcome
    sweeps: int


def steady_sliding(
    profile: FloatArray,
    spacing: float,
    solid: LinearSolid,
    velocity: float,
    normal_force: float,
    periodic: bool = True,
) -> SteadySliding:
    """Return the steady state of a foundation of independent elements that slides along a line.

    An element that has travelled s along the line is pressed by ``w(s) = d - z(s)`` below the highest point; in contact
    u = w, free f = 0, with f = 4 dx [G_inf u + sum G_m (u - a_m) + eta v u'] (thesis 3.3.3 for any linear rheology).

    Parameters
    ----------
    profile : array, shape (points,)
        Heights z, m, positive out of the elastomer, in the order in which an element meets them; an even number of them if
        `periodic`, odd otherwise, so that every second point spans the same line.
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
        If a number is not finite or not positive, or the number of points is odd (even) where it must not be.
    """
    heights = np.asarray(profile, dtype=np.float64)
    _check(heights, spacing, velocity, normal_force, periodic)
    top = int(np.argmin(heights))
    depth_profile = heights[top] - heights
    if periodic:
        depth_profile = np.append(np.roll(depth_profile, -top), 0.0)
    coarse = _solve(depth_profile[::2], 2 * spacing, solid, velocity, normal_force, periodic, None)
    fine = _solve(depth_profile, spacing, solid, velocity, normal_force, periodic, coarse.start)
    return _result(fine, coarse)


@dataclass(frozen=True)
class _Solution:
    values: FloatArray
    start: FloatArray
    outcome: Outcome
    sweeps: int


def _solve(
    profile: FloatArray,
    spacing: float,
    solid: LinearSolid,
    velocity: float,
    normal_force: float,
    periodic: bool,
    start: FloatArray | None,
) -> _Solution:
    profile = np.ascontiguousarray(profile)
    moduli, reach, modes = _in_cells(solid, velocity, spacing)
    strain_area = normal_force / (4 * solid.static_modulus * spacing)
    if start is None:
        inner = profile[:-1] if periodic else profile
        start = np.append(np.full(moduli.size, strain_area / inner.size), static_depth(inner, strain_area))
    unknown, totals = start.copy(), np.empty(6)
    arrays = moduli, reach, modes.times, modes.stretch, modes.amplitude, modes.memory
    converged, sweeps, inside = solve_sliding(profile, strain_area, periodic, *arrays, TOLERANCE, unknown, totals)
    balanced = abs(totals[1] / strain_area - 1) < BALANCE
    outcome = Outcome.DONE if converged and balanced else Outcome.NOT_CONVERGED
    return _Solution(
        _values(totals, strain_area, spacing, unknown[-1], profile.size - 1),
        unknown,
        outcome if inside else Outcome.LEAVES_LINE,
        sweeps,
    )


def _values(totals: FloatArray, strain_area: float, spacing: float, depth: float, cells: int) -> FloatArray:
    contact = totals[3]
    slope = np.sqrt(totals[4] / contact) / spacing if contact > 0 else 0.0
    return np.array([totals[2] / strain_area / spacing, depth, contact / cells, slope])


def _in_cells(
    solid: LinearSolid, velocity: float, spacing: float, fast_time: float
) -> tuple[FloatArray, FloatArray, Recovery]:
    """Return moduli over the static one, reaches tau v / cell and recovery modes; fast arms and the dashpot become one arm."""
    moduli, reach = solid.moduli / solid.static_modulus, solid.times * velocity / spacing
    fast = solid.times <= fast_time
    viscosity = solid.viscosity * velocity / (spacing * solid.static_modulus) + float(moduli[fast] @ reach[fast])
    moduli, reach = moduli[~fast], reach[~fast]
    if viscosity > 0:
        moduli, reach = np.append(10 * viscosity / SHORTEST_REACH, moduli), np.append(SHORTEST_REACH / 10, reach)
    return moduli, reach, recovery(moduli, reach)


def _result(fine: _Solution, coarse: _Solution) -> SteadySliding:
    """Extrapolate: the sweep is of second order, so a third of the difference is both correction and error estimate."""
    if fine.outcome is not Outcome.DONE:
        return SteadySliding(np.nan, np.nan, np.nan, np.nan, np.nan, fine.outcome, fine.sweeps)
    correction = (fine.values - coarse.values) / 3 if coarse.outcome is Outcome.DONE else np.full(4, np.nan)
    friction, depth, fraction, slope = (float(value) for value in fine.values + correction)
    return SteadySliding(
        friction, depth, min(max(fraction, 0.0), 1.0), slope, float(abs(correction[0])), fine.outcome, fine.sweeps
    )


def _check(heights: FloatArray, spacing: float, velocity: float, normal_force: float, periodic: bool) -> None:
    if heights.ndim != 1 or not np.all(np.isfinite(heights)):
        raise ValueError("the profile must be one row of finite heights")
    if heights.size < 4 or heights.size % 2 == periodic:
        raise ValueError(f"a line needs an {'even' if periodic else 'odd'} number of points, got {heights.size}")
    for name, value in (("spacing", spacing), ("velocity", velocity), ("normal force", normal_force)):
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"the {name} must be positive and finite, got {value!r}")
