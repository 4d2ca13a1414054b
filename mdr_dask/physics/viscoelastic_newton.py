"""Newton's method for the depth and the arms' state of steady viscoelastic sliding, in the units of the sweep."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mdr_dask.physics.viscoelastic_sweep import CLOSED, sweep

FloatArray = NDArray[np.float64]


@njit(nogil=True, cache=True, error_model="numpy")
def tangent(
    lengths: FloatArray,
    pieces: int,
    moduli: FloatArray,
    reach: FloatArray,
    times: FloatArray,
    stretch_of: FloatArray,
    amplitude_of: FloatArray,
    memory_of: FloatArray,
    periodic: bool,
    change: FloatArray,
    strain_area: FloatArray,
    scratch: FloatArray,
) -> None:  # pragma: no cover
    """Differentiate a sweep: change of a_m over the line, and integral of u, by (e at the start..., depth).

    Contacts and flights of fixed lengths act linearly on the arms, and u is continuous where they meet, so moving the
    meeting points does not matter to first order.

    Parameters
    ----------
    lengths, pieces, moduli, reach, times, stretch_of, amplitude_of
        As in `sweep`.
    memory_of : array, shape (arms, arms)
        a_m in each mode.
    periodic : bool
        Whether the line closes; otherwise there is only the column of the depth, and the recovery beyond the line
        counts.
    change : array, shape (arms, columns), output
        Derivative of a(end) - a(start); the last column belongs to the depth, the others to e(start).
    strain_area : array, shape (columns,), output
        Derivative of the integral of u.
    scratch : array, shape (2, arms, columns)
    """
    arms, columns = change.shape
    depth, glass = columns - 1, 1.0 + moduli.sum()
    stretch, modes = scratch[0], scratch[1]
    change[:] = 0.0
    strain_area[:] = 0.0
    stretch[:] = 0.0
    for m in range(arms):
        if periodic:
            stretch[m, m] = 1.0
        else:
            stretch[m, depth] = 1.0
    for piece in range(pieces):
        length = lengths[piece]
        if piece % 2 == 1:
            strain_area[depth] += length
            for m in range(arms):
                lost = -np.expm1(-length / reach[m])
                for j in range(columns):
                    change[m, j] += lost * stretch[m, j]
                    stretch[m, j] *= 1 - lost
        elif length > 0:
            _take_stress(stretch, moduli, glass)
            np.dot(amplitude_of, stretch, modes)
            np.dot(stretch_of, modes * np.exp(-length / times).reshape(-1, 1), stretch)
            stretch[:, depth] += 1.0
            for k in range(arms):
                lost = -np.expm1(-length / times[k])
                weight = times[k] * (lost if periodic or piece < pieces - 1 else 1.0)
                for j in range(columns):
                    strain_area[j] += weight * modes[k, j]
                    after = modes[k, j] * (1 - lost)
                    modes[k, j] *= -lost
                    for m in range(arms):
                        stretch[m, j] -= after
                        change[m, j] += memory_of[m, k] * modes[k, j]


@njit(nogil=True, cache=True, error_model="numpy")
def _take_stress(stretch: FloatArray, moduli: FloatArray, glass: float) -> None:  # pragma: no cover
    """Move the strain at fixed memory so that the derivative of the stress vanishes, as it does in flight."""
    arms, columns = stretch.shape
    if arms == 0:
        return
    for j in range(columns):
        strain = 1.0 if j == columns - 1 else 0.0
        stress = strain
        for m in range(arms):
            stress += moduli[m] * stretch[m, j]
        balance = strain - stress / glass
        for m in range(1, arms):
            stretch[m, j] -= stress / glass
            balance += moduli[m] * stretch[m, j]
        stretch[0, j] = -balance / moduli[0]


@njit(nogil=True, cache=True, error_model="numpy")
def solve_in_place(matrix: FloatArray, vector: FloatArray) -> bool:  # pragma: no cover
    """Overwrite `vector` by the solution of a small dense system; False if the matrix is singular."""
    size = vector.size
    for j in range(size):
        pivot = j
        for i in range(j + 1, size):
            if abs(matrix[i, j]) > abs(matrix[pivot, j]):
                pivot = i
        if not abs(matrix[pivot, j]) > 0:
            return False
        if pivot != j:
            for c in range(j, size):
                matrix[j, c], matrix[pivot, c] = matrix[pivot, c], matrix[j, c]
            vector[j], vector[pivot] = vector[pivot], vector[j]
        for i in range(j + 1, size):
            factor = matrix[i, j] / matrix[j, j]
            for c in range(j + 1, size):
                matrix[i, c] -= factor * matrix[j, c]
            vector[i] -= factor * vector[j]
    for j in range(size - 1, -1, -1):
        for c in range(j + 1, size):
            vector[j] -= matrix[j, c] * vector[c]
        vector[j] /= matrix[j, j]
    return True


@njit(nogil=True, cache=True, error_model="numpy")
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


@njit(nogil=True, cache=True, error_model="numpy")
def solve_sliding(
    profile: FloatArray,
    strain_area: float,
    periodic: bool,
    moduli: FloatArray,
    reach: FloatArray,
    times: FloatArray,
    stretch_of: FloatArray,
    amplitude_of: FloatArray,
    memory_of: FloatArray,
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
    moduli, reach, times, stretch_of, amplitude_of, memory_of
        The solid, see `sweep` and `tangent`.
    tolerance : float
        Largest last step, relative to the depth.
    unknown : array, shape (arms + 1,), input and output
        Start and solution: e_m at the first node, then the depth.
    totals : array, shape (6,), output
        See `sweep`.

    Returns
    -------
    converged, sweeps, inside : bool, int, bool
        `inside` is False if an element is in contact at the end of a line that is not periodic.
    """
    arms, nodes = moduli.size, profile.size
    columns = arms + 1 if periodic else 1
    lengths, penetration = np.empty(2 * nodes + 4), np.empty(nodes)
    imbalance, work = np.empty(arms), np.empty((10, max(arms, 1)))
    change, row, scratch = np.empty((arms, columns)), np.empty(columns), np.empty((2, arms, columns))
    matrix, residual = np.empty((columns, columns)), np.empty(columns)
    steepest = 0.0
    for i in range(nodes - 1):
        steepest = max(steepest, abs(profile[i + 1] - profile[i]))
    rounding = 1e-15 * nodes * steepest  # of a place on the line, as a height
    for sweeps in range(1, 81):
        for i in range(nodes):
            penetration[i] = unknown[arms] + profile[i]
        pieces, end = sweep(
            penetration,
            unknown[:arms],
            moduli,
            reach,
            times,
            stretch_of,
            amplitude_of,
            not periodic,
            lengths,
            imbalance,
            totals,
            work,
        )
        tangent(
            lengths,
            pieces,
            moduli,
            reach,
            times,
            stretch_of,
            amplitude_of,
            memory_of,
            periodic,
            change,
            row,
            scratch,
        )
        total = totals[0] if periodic else totals[0] + totals[5]
        residual[columns - 1] = strain_area - total
        matrix[columns - 1] = row
        if periodic:
            for m in range(arms):
                scale = change[m, m]
                residual[m] = -imbalance[m] / reach[m] / scale
                for j in range(columns):
                    matrix[m, j] = change[m, j] / scale
        if not solve_in_place(matrix, residual):
            return False, sweeps, True
        largest = 0.0
        for j in range(columns):
            weight = min(1.0, moduli[j]) if j < columns - 1 else 1.0  # a soft arm cannot matter
            largest = max(largest, weight * abs(residual[j]))
            unknown[unknown.size - columns + j] += residual[j]
        if not np.isfinite(largest):
            return False, sweeps, True
        if largest <= tolerance * unknown[arms] + rounding:
            return True, sweeps, periodic or end == CLOSED
    return False, 80, True
