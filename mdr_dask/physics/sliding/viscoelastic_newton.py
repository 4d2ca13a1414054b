"""Newton's method for the depth and the arms' state of steady viscoelastic sliding, in the units of the sweep."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.sliding.viscoelastic_sweep import CLOSED, Passage, Travelling, multiply, sweep_arms

DEEPEST_STEP = 0.7
"""Largest step back of the depth on a line that elements enter undeformed, relative to it."""

LINEAR = 1e-10
"""Residual of a step of Newton's method, relative to what it is to remove: far below what the next one brings."""


class Swept(NamedTuple):
    """Contacts and flights of a sweep, and the solid that went through them.

    Parameters
    ----------
    decayed : array, shape (pieces, arms)
        1 - exp(-length / time) of every mode in flight and of every arm in contact.
    lengths : array, shape (pieces,)
        See `sweep_arms`.
    solid : Travelling
        The solid.
    """

    decayed: FloatArray
    lengths: FloatArray
    solid: Travelling


@jit
def follow(
    direction: FloatArray, swept: Swept, periodic: bool, product: FloatArray, workspace: FloatArray
) -> None:  # pragma: no cover
    """Differentiate a sweep along one direction: how the integrals of e_m and of u over the line change.

    Contacts and flights of fixed lengths act linearly on the arms, and u is continuous where they meet, so moving the
    meeting points does not matter to first order. A piece costs two products of a matrix and a vector.

    Parameters
    ----------
    direction : array, shape (arms + 1,)
        Change of e at the start and of the depth.
    swept : Swept
        The pieces.
    periodic : bool
        Whether the line closes; otherwise the recovery beyond the line counts.
    product : array, shape (arms + 1,), output
        Change of the integral of e_m, and of that of u.
    workspace : array, shape (3, arms)
    """
    decayed, lengths, solid = swept
    moduli, deborah, times, stretch_of, amplitude_of = solid
    arms, pieces = moduli.size, decayed.shape[0]
    depth, glass = direction[arms], 1.0 + moduli.sum()
    stretch, modes, integral = workspace[0], workspace[1], workspace[2]
    product[:] = 0.0
    stretch[:arms] = direction[:arms]
    for piece in range(pieces):
        if piece % 2 == 1:
            product[arms] += depth * lengths[piece]
            for m in range(arms):
                product[m] += deborah[m] * decayed[piece, m] * stretch[m]
                stretch[m] *= 1 - decayed[piece, m]
        elif lengths[piece] > 0:
            _take_stress(stretch, depth, moduli, glass)
            multiply(amplitude_of, stretch, modes)
            strain = 0.0
            for k in range(arms):
                integral[k] = modes[k] * times[k] * decayed[piece, k]
                product[arms] += integral[k] if periodic or piece < pieces - 1 else modes[k] * times[k]
                modes[k] *= 1 - decayed[piece, k]
                strain += modes[k]
            multiply(stretch_of, modes, stretch)
            multiply(stretch_of, integral, modes)
            for m in range(arms):
                product[m] += modes[m]
                stretch[m] += depth - strain


@jit
def _take_stress(stretch: FloatArray, depth: float, moduli: FloatArray, glass: float) -> None:  # pragma: no cover
    """Move the strain at fixed memory so that the derivative of the stress vanishes, as it does in flight."""
    if stretch.size == 0:
        return
    stress = depth
    for m in range(stretch.size):
        stress += moduli[m] * stretch[m]
    balance = depth - stress / glass
    for m in range(1, stretch.size):
        stretch[m] -= stress / glass
        balance += moduli[m] * stretch[m]
    stretch[0] = -balance / moduli[0]


@jit
def _decays(lengths: FloatArray, deborah: FloatArray, times: FloatArray) -> FloatArray:  # pragma: no cover
    """Return what modes lose in every flight and arms in every contact, shape (pieces, arms)."""
    decayed = np.empty((lengths.size, deborah.size))
    for piece in range(lengths.size):
        scales = deborah if piece % 2 == 1 else times
        for m in range(deborah.size):
            decayed[piece, m] = -np.expm1(-lengths[piece] / scales[m])
    return decayed


class Krylov(NamedTuple):
    """Workspace of a Newton step: directions, the triangle they lead to, its rotations, and that of `follow`.

    Parameters
    ----------
    basis, triangle : array, shape (n + 1, n)
    rotations : array, shape (3, n + 1)
    workspace : array, shape (3, n - 1)
    """

    basis: FloatArray
    triangle: FloatArray
    rotations: FloatArray
    workspace: FloatArray


@jit
def newton_step(
    residual: FloatArray,
    scale: FloatArray,
    swept: Swept,
    krylov: Krylov,
    step: FloatArray,
) -> None:  # pragma: no cover
    """Solve the linear system of a step by minimal residuals over a Krylov space (GMRES with Givens rotations).

    Rows divided by `scale`, the derivative is the identity and a smooth operator over the relaxation times, whose
    singular values fall off fast: four to seven products whatever the number of arms.

    Parameters
    ----------
    residual, scale : array, shape (n,)
        What the integrals of e_m and u are to change by, n = arms + 1, and the size of the change for a unit of each.
    swept : Swept
        The pieces.
    krylov : Krylov
        The workspace.
    step : array, shape (n,), output
    """
    basis, triangle, rotations, workspace = krylov
    size = residual.size
    right = rotations[2]
    step[:] = 0.0
    square = 0.0
    for k in range(size):  # an expression of whole arrays would compile the words of its error, for seconds
        basis[0, k] = residual[k] / scale[k]
        square += basis[0, k] * basis[0, k]
    norm = np.sqrt(square)
    if not norm > 0:
        return
    for k in range(size):
        basis[0, k] /= norm
    right[0] = norm
    used = 0
    for j in range(size):
        column = basis[j + 1]
        follow(basis[j], swept, True, column, workspace)
        for k in range(size):
            column[k] /= scale[k]
        used = j + 1
        _orthogonalise(basis, triangle, j)
        _rotate(triangle, rotations, j)
        if abs(right[j + 1]) <= LINEAR * norm or not np.isfinite(right[j + 1]):
            break
    for i in range(used - 1, -1, -1):
        for j in range(i + 1, used):
            right[i] -= triangle[i, j] * right[j]
        right[i] /= triangle[i, i]
        for k in range(size):
            step[k] += right[i] * basis[i, k]


@jit
def _orthogonalise(basis: FloatArray, triangle: FloatArray, j: int) -> None:  # pragma: no cover
    """Take the earlier rows out of row j + 1, twice against rounding, and leave the coefficients in column j."""
    column = basis[j + 1]
    for i in range(j + 1):
        triangle[i, j] = 0.0
    for _ in range(2):
        for i in range(j + 1):
            part = 0.0
            for k in range(column.size):
                part += column[k] * basis[i, k]
            triangle[i, j] += part
            for k in range(column.size):
                column[k] -= part * basis[i, k]
    square = 0.0
    for k in range(column.size):
        square += column[k] * column[k]
    norm = np.sqrt(square)
    triangle[j + 1, j] = norm
    if norm > 0:
        for k in range(column.size):
            column[k] /= norm


@jit
def _rotate(triangle: FloatArray, rotations: FloatArray, j: int) -> None:  # pragma: no cover
    """Turn column j into one of a triangle, and the right side with it; its last entry is the residual left."""
    cosine, sine, right = rotations[0], rotations[1], rotations[2]
    for i in range(j):
        upper, lower = triangle[i, j], triangle[i + 1, j]
        triangle[i, j] = cosine[i] * upper + sine[i] * lower
        triangle[i + 1, j] = cosine[i] * lower - sine[i] * upper
    length = np.sqrt(triangle[j, j] ** 2 + triangle[j + 1, j] ** 2)
    cosine[j], sine[j] = triangle[j, j] / length, triangle[j + 1, j] / length
    triangle[j, j] = length
    right[j + 1] = -sine[j] * right[j]
    right[j] *= cosine[j]


@jit
def static_depth(profile: FloatArray, strain_area: float) -> float:  # pragma: no cover
    """Return the depth at which sum max(0, depth + profile) is `strain_area` (> 0): Newton, falling from above."""
    depth = 0.0
    for value in profile:
        depth -= value
    depth = (depth + strain_area) / profile.size
    for _ in range(200):
        total, touching = 0.0, 0
        for value in profile:
            if depth + value > 0:
                total += depth + value
                touching += 1
        if touching == 0:
            depth = strain_area
            continue
        step = (total - strain_area) / touching
        depth -= step
        if abs(step) <= 1e-12 * depth:
            break
    return depth


@jit
def solve_sliding(
    profile: FloatArray,
    strain_area: float,
    periodic: bool,
    solid: Travelling,
    tolerance: float,
    unknown: FloatArray,
    totals: FloatArray,
) -> tuple[bool, int, bool]:  # pragma: no cover
    """Find the depth that carries the load, and for a periodic line the arms' state that returns after one period.

    In the steady state the integral of the stress is that of u, so the load prescribes the latter. The strain is convex
    and increasing in the unknowns (a contact takes the larger of two such functions), so Newton's method converges
    from any start, from above after its first step.

    Parameters
    ----------
    profile : array, shape (nodes,)
        Heights into the elastomer, the highest of them 0; a periodic line starts there and repeats it at the end.
    strain_area : float
        F_N / (4 G_inf cell), the integral of u wanted, in cells times height.
    periodic : bool
        Whether the line closes; otherwise elements enter undeformed and recover beyond its end.
    solid : Travelling
        The solid.
    tolerance : float
        Largest last step, relative to the depth.
    unknown : array, shape (arms + 1,), input and output
        Start and solution: e_m at the first node, then the depth.
    totals : array, shape (6,), output
        See `sweep_arms`.

    Returns
    -------
    converged, sweeps, inside : bool, int, bool
        `inside` is False if an element is in contact at the end of a line that is not periodic.
    """
    moduli, deborah, times = solid.moduli, solid.deborah, solid.times
    arms, nodes = moduli.size, profile.size
    size = arms + 1
    passage, penetration = Passage(np.empty(2 * nodes + 4), np.empty(arms), totals), np.empty(nodes)
    of_sweep, workspace = np.empty((10, max(arms, 1))), np.empty((3, arms))
    residual, scale, step, product = np.empty(size), np.empty(size), np.zeros(size), np.empty(size)
    triangle, rotations = np.empty((size + 1, size)), np.empty((3, size + 1))
    krylov = Krylov(np.empty((size + 1, size)), triangle, rotations, workspace)
    for m in range(arms):
        scale[m] = -deborah[m] * np.expm1(-(nodes - 1) / deborah[m])
    steepest = 0.0
    for i in range(nodes - 1):
        steepest = max(steepest, abs(profile[i + 1] - profile[i]))
    rounding = 1e-15 * nodes * steepest  # of a place on the line, as a height
    for sweeps in range(1, 81):
        for i in range(nodes):
            penetration[i] = unknown[arms] + profile[i]
        start = unknown[:arms]
        pieces, end = sweep_arms(penetration, start, solid, not periodic, passage, of_sweep)
        found = passage.lengths[:pieces]
        swept = Swept(_decays(found, deborah, times), found, solid)
        if periodic:
            for m in range(arms):
                residual[m] = -passage.imbalance[m]
            residual[arms] = strain_area - totals[0]
            scale[arms] = totals[3]
            newton_step(residual, scale, swept, krylov, step)
        else:
            residual[:] = 1.0  # a unit of depth while the memory stays: elements enter at rest
            follow(residual, swept, False, product, workspace)
            # a contact that reaches the end of the line is larger than the sweep sees
            step[arms] = max((strain_area - totals[1]) / product[arms], -DEEPEST_STEP * unknown[arms])
        largest = 0.0
        for j in range(size):
            weight = min(1.0, moduli[j]) if j < arms else 1.0  # a soft arm cannot matter
            largest = max(largest, weight * abs(step[j]))
            unknown[j] += step[j]
        if not np.isfinite(largest):
            return False, sweeps, True
        if largest <= tolerance * unknown[arms] + rounding:
            return True, sweeps, periodic or end == CLOSED
    return False, 80, True
