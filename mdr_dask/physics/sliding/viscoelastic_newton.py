"""Newton's method for the depth and the stretches of the Prony terms in steady sliding, in the units of the sweep."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.sliding.viscoelastic_sweep import CLOSED, Passage, Travelling, multiply, sweep_line

DEEPEST_STEP = 0.7
"""Largest relative decrease of the depth in a step, on a line that is not periodic."""

LINEAR = 1e-10
"""Relative residual of the linear equations of a step; much smaller than the error that remains after the step."""


class Swept(NamedTuple):
    """Contacts and free recoveries of a sweep, and the solid.

    Parameters
    ----------
    decayed : array, shape (pieces, terms)
        1 - exp(-length / decay length), for every recovery mode in each free recovery, and for every Prony term in each
        contact.
    lengths : array, shape (pieces,)
        Lengths of free recoveries and contacts alternately, as in `Passage`.
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
    """Write the changes of the integrals of the stretches e_m and of u over the line for given changes of the unknowns.

    Contacts and free recoveries of fixed lengths act linearly on the stretches. The shift of the places where contact
    begins and ends has an effect of second order only, because u is continuous there. Each free recovery costs three
    products of a matrix and a vector.

    Parameters
    ----------
    direction : array, shape (terms + 1,)
        Changes of the stretches e_m at the start of the line, and change of the depth.
    swept : Swept
        Contacts and free recoveries.
    periodic : bool
        Whether the line is periodic; otherwise the recovery behind the line is included.
    product : array, shape (terms + 1,), output
        Changes of the integrals of e_m, and of the integral of u.
    workspace : array, shape (3, terms)
    """
    decayed, lengths, solid = swept
    moduli, deborah, times, stretch_of, amplitude_of = solid
    terms, pieces = moduli.size, decayed.shape[0]
    depth, glass = direction[terms], 1.0 + moduli.sum()
    stretch, modes, integral = workspace[0], workspace[1], workspace[2]
    product[:] = 0.0
    stretch[:terms] = direction[:terms]
    for piece in range(pieces):
        if piece % 2 == 1:
            product[terms] += depth * lengths[piece]
            for m in range(terms):
                product[m] += deborah[m] * decayed[piece, m] * stretch[m]
                stretch[m] *= 1 - decayed[piece, m]
        elif lengths[piece] > 0:
            _take_stress(stretch, depth, moduli, glass)
            multiply(amplitude_of, stretch, modes)
            strain = 0.0
            for k in range(terms):
                integral[k] = modes[k] * times[k] * decayed[piece, k]
                product[terms] += integral[k] if periodic or piece < pieces - 1 else modes[k] * times[k]
                modes[k] *= 1 - decayed[piece, k]
                strain += modes[k]
            multiply(stretch_of, modes, stretch)
            multiply(stretch_of, integral, modes)
            for m in range(terms):
                product[m] += modes[m]
                stretch[m] += depth - strain


@jit
def _take_stress(stretch: FloatArray, depth: float, moduli: FloatArray, glass: float) -> None:  # pragma: no cover
    """Change the strain instantly so that the change of the stress becomes 0, as at the start of free recovery.

    The strains of the dashpots do not change.
    """
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
    """Return `Swept.decayed` for contacts and free recoveries of the given lengths, shape (pieces, terms)."""
    decayed = np.empty((lengths.size, deborah.size))
    for piece in range(lengths.size):
        scales = deborah if piece % 2 == 1 else times
        for m in range(deborah.size):
            decayed[piece, m] = -np.expm1(-lengths[piece] / scales[m])
    return decayed


class Krylov(NamedTuple):
    """Work arrays of a Newton step with n unknowns.

    Parameters
    ----------
    basis, triangle : array, shape (n + 1, n)
        Orthogonal directions, and the triangular matrix.
    rotations : array, shape (3, n + 1)
        Cosines and sines of the Givens rotations, and the right side.
    workspace : array, shape (3, n - 1)
        The workspace of `follow`.
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
    """Solve the linear system of a step by GMRES with Givens rotations.

    After division of its rows by `scale`, the matrix of derivatives is the identity plus an operator that is smooth as
    a function of the relaxation time. The singular values of such an operator decrease fast, so that four to seven
    products are enough for any number of terms.

    Parameters
    ----------
    residual, scale : array, shape (n,)
        Required changes of the integrals of e_m and u (n = terms + 1), and the magnitude of the derivatives of these
        integrals.
    swept : Swept
        Contacts and free recoveries.
    krylov : Krylov
        Work arrays.
    step : array, shape (n,), output
    """
    basis, triangle, rotations, workspace = krylov
    size = residual.size
    right = rotations[2]
    step[:] = 0.0
    square = 0.0
    for k in range(size):  # a loop compiles some seconds faster than an array expression
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
    """Make row j + 1 of the basis orthogonal to the earlier rows; write the coefficients to column j of the triangle.

    This is done twice because of rounding errors.
    """
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
    """Rotate column j so that the matrix is triangular, and rotate the right side.

    The last entry of the rotated right side is the residual.
    """
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
    """Return the depth at which sum max(0, depth + profile) is `strain_area` (> 0), by Newton's method from above."""
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
    """Find the depth that carries the load, and for a periodic line the stretches that repeat after one period.

    In the steady state the integral of the stress is equal to the integral of u, so that the load prescribes the
    integral of u. The strain is a convex, increasing function of the unknowns (in contact it is the larger of two
    convex, increasing functions). Newton's method therefore converges from any start, and from above after its first
    step.

    Parameters
    ----------
    profile : array, shape (nodes,)
        Heights, positive towards the elastomer, relative to the highest node. A periodic line starts at the highest
        node and repeats it at the end.
    strain_area : float
        F_N / (4 G_inf dx) with the length dx of a cell; equal to the integral of u, in cells times height.
    periodic : bool
        Whether the line is periodic. On any other line, elements enter undeformed and recover behind the end of the
        line.
    solid : Travelling
        The solid.
    tolerance : float
        The iteration ends when a step, relative to the depth, is at most this.
    unknown : array, shape (terms + 1,), input and output
        First guess, replaced by the solution: the stretches e_m at the first node, then the depth.
    totals : array, shape (6,), output
        See `sweep_line`.

    Returns
    -------
    converged, sweeps, inside : bool, int, bool
        `inside` is False if an element is in contact at the end of a line that is not periodic.
    """
    moduli, deborah, times = solid.moduli, solid.deborah, solid.times
    terms, nodes = moduli.size, profile.size
    size = terms + 1
    passage, penetration = Passage(np.empty(2 * nodes + 4), np.empty(terms), totals), np.empty(nodes)
    of_sweep, workspace = np.empty((10, max(terms, 1))), np.empty((3, terms))
    residual, scale, step, product = np.empty(size), np.empty(size), np.zeros(size), np.empty(size)
    triangle, rotations = np.empty((size + 1, size)), np.empty((3, size + 1))
    krylov = Krylov(np.empty((size + 1, size)), triangle, rotations, workspace)
    for m in range(terms):
        scale[m] = -deborah[m] * np.expm1(-(nodes - 1) / deborah[m])
    steepest = 0.0
    for i in range(nodes - 1):
        steepest = max(steepest, abs(profile[i + 1] - profile[i]))
    rounding = 1e-15 * nodes * steepest  # error of a height due to the rounding of a place
    for sweeps in range(1, 81):
        for i in range(nodes):
            penetration[i] = unknown[terms] + profile[i]
        start = unknown[:terms]
        pieces, end = sweep_line(penetration, start, solid, not periodic, passage, of_sweep)
        found = passage.lengths[:pieces]
        swept = Swept(_decays(found, deborah, times), found, solid)
        if periodic:
            for m in range(terms):
                residual[m] = -passage.imbalance[m]
            residual[terms] = strain_area - totals[0]
            scale[terms] = totals[3]
            newton_step(residual, scale, swept, krylov, step)
        else:
            residual[:] = 1.0  # a unit change of the depth, while elements enter undeformed
            follow(residual, swept, False, product, workspace)
            # the load is the integral of the stress: u behind the line is unknown if its end is in contact
            step[terms] = max((strain_area - totals[1]) / product[terms], -DEEPEST_STEP * unknown[terms])
        largest = 0.0
        for j in range(size):
            weight = min(1.0, moduli[j]) if j < terms else 1.0  # the stretch of a soft Prony term has little influence
            largest = max(largest, weight * abs(step[j]))
            unknown[j] += step[j]
        if not np.isfinite(largest):
            return False, sweeps, True
        if largest <= tolerance * unknown[terms] + rounding:
            return True, sweeps, periodic or end == CLOSED
    return False, 80, True
