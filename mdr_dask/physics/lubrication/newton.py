"""Semismooth Newton for the pressure and central film of a lubricated line contact on a given grid.

Hertz units as in :mod:`mdr_dask.physics.lubrication.deformation`. The film obeys (thesis eq. B.15)

    d/dX( rho H^3/eta dP/dX ) = K d(rho H)/dX,   K = (3 pi^2/4) U/W^2,

in finite volumes around the nodes; cavitation is the complementarity ``P >= 0``, ``R <= 0``, ``P R = 0`` of pressure
and balance R; the load ``int P dX = pi/2`` is the last equation. Unknowns are the nodal pressures and the film at
``X = 0``.
"""

from __future__ import annotations

from math import exp
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray

#: What became of an iteration: values of the status that `newton` returns, and that it has not ended.
CONVERGED, TOO_MANY_STEPS, SINGULAR, FILM_COLLAPSED, UNDER_WAY = range(5)

#: Share of the quadratic (QUICK) face value in the second-order upwind Couette flux; the rest is linear from upstream.
_QUADRATIC = 1.0 / 3.0
#: A step may close at most this share of the film at any node.
_FILM_SHARE = 0.8


class Liquid(NamedTuple):
    """Viscosity and density over pressure in Hertz units.

    Parameters
    ----------
    alpha : float
        Slope of ``ln eta`` at ambient pressure, ``alpha p0``.
    pole : float
        Roelands' pressure over p0; not used if `exponent` is zero.
    exponent : float
        Roelands' exponent z; zero for Barus.
    density_rise, density_saturation : float
        ``rho/rho0 = 1 + rise P/(1 + saturation P)``; zero for an incompressible liquid.
    """

    alpha: float
    pole: float
    exponent: float
    density_rise: float
    density_saturation: float


@njit(nogil=True, cache=True)
def log_viscosity(P: float, liquid: Liquid) -> tuple[float, float]:
    """Return ``ln(eta/eta0)`` at the pressure P (in p0) and its derivative: Barus, or Roelands with an exponent."""
    if liquid.exponent == 0.0:
        return liquid.alpha * P, liquid.alpha
    ratio = 1.0 + P / liquid.pole
    power = ratio ** (liquid.exponent - 1.0)
    return liquid.alpha * liquid.pole / liquid.exponent * (power * ratio - 1.0), liquid.alpha * power


@njit(nogil=True, cache=True)
def log_viscosities(pressure: FloatArray, liquid: Liquid) -> FloatArray:
    """Return ``ln(eta/eta0)`` at every pressure (in p0)."""
    result = np.empty_like(pressure)
    for i in range(pressure.size):
        result[i] = log_viscosity(pressure[i], liquid)[0]
    return result


@njit(nogil=True, cache=True)
def _mobility(left: float, right: float) -> tuple[float, float, float]:
    """Return the mean of 1/eta between two log-viscosities, exact for an exponential law, and its two derivatives."""
    rise = right - left
    if abs(rise) < 1e-3:
        mean = 1.0 - rise / 2 + rise * rise / 6 - rise**3 / 24
        slope = -0.5 + rise / 3 - rise * rise / 8 + rise**3 / 30
    else:
        decay = exp(-rise)
        mean = (1.0 - decay) / rise
        slope = (decay * (1.0 + rise) - 1.0) / (rise * rise)
    scale = exp(-left)
    return scale * mean, -scale * (mean + slope), scale * slope


@njit(nogil=True, cache=True)
def _couette_weights(nodes: FloatArray, f: int) -> tuple[float, float, float]:
    """Return the weights of nodes f-1, f, f+1 for the value at the face between f and f+1, flow to the right."""
    if f == 0:
        return 0.0, 0.5, 0.5
    dx = nodes[f + 1] - nodes[f]
    upstream = nodes[f] - nodes[f - 1]
    first = -dx * dx / (4.0 * upstream * (upstream + dx))
    last = (0.5 * dx + upstream) / (2.0 * (upstream + dx))
    linear = -0.5 * dx / upstream
    w0 = linear + _QUADRATIC * (first - linear)
    w2 = _QUADRATIC * last
    return w0, 1.0 - w0 - w2, w2


@njit(nogil=True, cache=True)
def balance(
    nodes: FloatArray,
    liquid: Liquid,
    K: float,
    P: FloatArray,
    H: FloatArray,
    state: FloatArray,
    R: FloatArray,
    by_pressure: FloatArray,
    by_film: FloatArray,
) -> None:
    """Fill the balance R of every volume and its derivatives by P and H of the nodes i-2 to i+1, shape (n, 4)."""
    rho, rho_slope, viscosity, viscosity_slope = state
    for i in range(P.size):
        rho[i] = 1.0 + liquid.density_rise * P[i] / (1.0 + liquid.density_saturation * P[i])
        rho_slope[i] = liquid.density_rise / (1.0 + liquid.density_saturation * P[i]) ** 2
        viscosity[i], viscosity_slope[i] = log_viscosity(P[i], liquid)
    R[:] = 0.0
    by_pressure[:] = 0.0
    by_film[:] = 0.0
    for f in range(P.size - 1):
        g = f + 1
        dx = nodes[g] - nodes[f]
        gradient = (P[g] - P[f]) / dx
        mobility, by_left, by_right = _mobility(viscosity[f], viscosity[g])
        film = 0.5 * (H[f] + H[g])
        density = 0.5 * (rho[f] + rho[g])
        conductance = film**3 / K
        w0, w1, w2 = _couette_weights(nodes, f)
        e = f - 1 if f > 0 else 0  # w0 is zero at the first face
        couette = w0 * rho[e] * H[e] + w1 * rho[f] * H[f] + w2 * rho[g] * H[g]
        flux = density * conductance * mobility * gradient - couette
        steeper = 1.5 * density * film**2 / K * mobility * gradient
        h0, h1, h2 = -w0 * rho[e], steeper - w1 * rho[f], steeper - w2 * rho[g]
        denser = 0.5 * conductance * mobility * gradient
        p0 = -w0 * rho_slope[e] * H[e]
        p1 = density * conductance * (by_left * viscosity_slope[f] * gradient - mobility / dx)
        p1 += rho_slope[f] * (denser - w1 * H[f])
        p2 = density * conductance * (by_right * viscosity_slope[g] * gradient + mobility / dx)
        p2 += rho_slope[g] * (denser - w2 * H[g])
        R[f] += flux
        R[g] -= flux
        for derivative, d0, d1, d2 in ((by_pressure, p0, p1, p2), (by_film, h0, h1, h2)):
            derivative[f, 1] += d0
            derivative[f, 2] += d1
            derivative[f, 3] += d2
            derivative[g, 0] -= d0
            derivative[g, 1] -= d1
            derivative[g, 2] -= d2


@njit(nogil=True, cache=True)
def _jacobian_row(i: int, matrix: FloatArray, by_pressure: FloatArray, by_film: FloatArray, row: FloatArray) -> None:
    """Fill the derivative of the balance of volume i by every pressure, through the film too."""
    c0, c1, c2, c3 = by_film[i]
    far, near, own, next_ = matrix[max(i - 2, 0)], matrix[i - 1], matrix[i], matrix[i + 1]
    for j in range(row.size):
        row[j] = c0 * far[j] + c1 * near[j] + c2 * own[j] + c3 * next_[j]
    for k in range(4):
        if i - 2 + k >= 0:
            row[i - 2 + k] += by_pressure[i, k]


@njit(nogil=True, cache=True)
def _fill_active(P: FloatArray, R: FloatArray, scale: FloatArray, active: NDArray[np.int64]) -> int:
    """List the inner nodes that carry pressure, ``P + R/scale > 0``; return their number."""
    count = 0
    for i in range(1, P.size - 1):
        if P[i] + R[i] / scale[i] > 0.0:
            active[count] = i
            count += 1
    return count


@njit(nogil=True, cache=True)
def solve_linear(A: FloatArray, b: FloatArray, n: int) -> bool:
    """Solve ``A x = b`` of order n in place by LU with partial pivoting; False if A is singular.

    Written out, and not LAPACK's, because a threaded BLAS gives other last bits with another number of threads.
    """
    for first in range(0, n, 4):
        last = min(first + 4, n)
        for k in range(first, last):
            if not _eliminate_column(A, b, n, k, last):
                return False
        if last == n:
            break
        for k in range(first + 1, last):
            for m in range(first, k):
                factor, upper, lower = A[k, m], A[m], A[k]
                for j in range(last, n):
                    lower[j] -= factor * upper[j]
        u0, u1, u2, u3 = A[first], A[first + 1], A[first + 2], A[first + 3]
        for i in range(last, n):
            row = A[i]
            f0, f1, f2, f3 = row[first], row[first + 1], row[first + 2], row[first + 3]
            for j in range(last, n):
                row[j] -= f0 * u0[j] + f1 * u1[j] + f2 * u2[j] + f3 * u3[j]
    for i in range(n - 1, -1, -1):
        total = b[i]
        for j in range(i + 1, n):
            total -= A[i, j] * b[j]
        b[i] = total / A[i, i]
    return True


@njit(nogil=True, cache=True)
def _eliminate_column(A: FloatArray, b: FloatArray, n: int, k: int, last: int) -> bool:
    """Pivot and eliminate column k, updating only the columns before `last` and the right side."""
    pivot, largest = k, abs(A[k, k])
    for i in range(k + 1, n):
        if abs(A[i, k]) > largest:
            pivot, largest = i, abs(A[i, k])
    if not largest > 0.0:
        return False
    if pivot != k:
        for j in range(n):
            A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
        b[k], b[pivot] = b[pivot], b[k]
    for i in range(k + 1, n):
        factor = A[i, k] / A[k, k]
        A[i, k] = factor
        for j in range(k + 1, last):
            A[i, j] -= factor * A[k, j]
        b[i] -= factor * b[k]
    return True


@njit(nogil=True, cache=True)
def nodal_film(nodes: FloatArray, matrix: FloatArray, P: FloatArray, central: float, H: FloatArray) -> None:
    """Fill the film H at the nodes, given their matrix, the pressure and the film at ``X = 0``."""
    for i in range(P.size):
        total = central + 0.5 * nodes[i] ** 2
        for j in range(P.size):
            total += matrix[i, j] * P[j]
        H[i] = total


@njit(nogil=True, cache=True)
def _fill_film_step(matrix: FloatArray, step: FloatArray, central: float, film_step: FloatArray) -> None:
    """Fill the change of the film at the nodes by a step of the pressures and of the film at ``X = 0``."""
    for i in range(step.size):
        change = central
        for j in range(step.size):
            change += matrix[i, j] * step[j]
        film_step[i] = change


@njit(nogil=True, cache=True)
def _step_length(film_step: FloatArray, P: FloatArray, H: FloatArray, step: FloatArray, clip: float) -> float:
    """Return the share of a step that neither moves a pressure by more than `clip` nor closes the film."""
    largest = np.max(np.abs(step))
    share = min(1.0, clip * np.max(P) / largest) if largest > 0.0 else 1.0
    for i in range(P.size):
        if film_step[i] < 0.0:
            share = min(share, -_FILM_SHARE * H[i] / film_step[i])
    return share


@njit(nogil=True, cache=True)
def _is_settled(P: FloatArray, step: FloatArray, central: float, change: float, tolerance: float) -> bool:
    """Return whether a step changes pressure and central film by less than the tolerance."""
    return bool(np.max(np.abs(step)) < tolerance * np.max(P) and abs(change) < tolerance * central)


@njit(nogil=True, cache=True)
def take_step(
    P: FloatArray,
    central: float,
    H: FloatArray,
    step: FloatArray,
    change: float,
    film_step: FloatArray,
    clip: float,
    tolerance: float,
) -> tuple[int, float]:
    """Change P and `central` by as much of a Newton step as the film allows; return the status and the new `central`.

    CONVERGED, or UNDER_WAY, or FILM_COLLAPSED where hardly anything of the step is allowed, and P is left alone.
    """
    share = _step_length(film_step, P, H, step, clip)
    if not share > 1e-9:
        return FILM_COLLAPSED, central
    done = share == 1.0 and _is_settled(P, step, central, change, tolerance)
    for i in range(P.size):
        P[i] = max(0.0, P[i] + share * step[i])
    return (CONVERGED if done else UNDER_WAY), central + share * change


@njit(nogil=True, cache=True)
def outcome(status: int, central: float, H: FloatArray) -> int:
    """Return the status of :func:`take_step`, or FILM_COLLAPSED where the step has left no film."""
    return FILM_COLLAPSED if status == UNDER_WAY and not (central > 0.0 and np.min(H) > 0.0) else status


@njit(nogil=True, cache=True)
def _linear_system(
    P: FloatArray,
    R: FloatArray,
    active: NDArray[np.int64],
    count: int,
    matrix: FloatArray,
    weights: FloatArray,
    by_pressure: FloatArray,
    by_film: FloatArray,
    A: FloatArray,
    b: FloatArray,
    row: FloatArray,
) -> None:
    """Fill the Newton equations of the active pressures and the central film; the other pressures go to zero."""
    released = P.copy()
    for k in range(count):
        released[active[k]] = 0.0
    for k in range(count):
        i = active[k]
        _jacobian_row(i, matrix, by_pressure, by_film, row)
        line = A[k]
        for m in range(count):
            line[m] = row[active[m]]
        line[count] = np.sum(by_film[i])
        b[k] = -R[i]
        for j in range(P.size):
            b[k] += row[j] * released[j]
    b[count] = 0.5 * np.pi
    for j in range(P.size):
        b[count] += weights[j] * (released[j] - P[j])
    for m in range(count):
        A[count, m] = weights[active[m]]
    A[count, count] = 0.0


@njit(nogil=True, cache=True)
def newton(
    nodes: FloatArray,
    matrix: FloatArray,
    weights: FloatArray,
    liquid: Liquid,
    K: float,
    P: FloatArray,
    central: float,
    clip: float,
    tolerance: float,
    most: int,
) -> tuple[int, int, float, FloatArray]:
    """Solve for the pressure on one grid, in place.

    Parameters
    ----------
    nodes, weights : array, shape (n,)
        Ascending nodes in half widths and their trapezoidal weights.
    matrix : array, shape (n, n)
        Of :func:`mdr_dask.physics.lubrication.deformation.influence_matrix` at the nodes.
    liquid : Liquid
        Its laws.
    K : float
        ``(3 pi^2/4) U/W^2``.
    P : array, shape (n,)
        Guess of the pressure on entry, the solution on return; zero at both ends, never negative.
    central : float
        Guess of the film at ``X = 0``, positive with P everywhere.
    clip : float
        Greatest change of a pressure in one step, in units of the greatest pressure.
    tolerance : float
        Relative size of the last step.
    most : int
        Greatest number of steps.

    Returns
    -------
    status, steps, central, H
        One of CONVERGED, TOO_MANY_STEPS, SINGULAR, FILM_COLLAPSED; steps done; films at ``X = 0`` and at the nodes.
    """
    n = P.size
    state, R, H, step, row, scale = (np.empty((4, n)), np.empty(n), np.empty(n), np.zeros(n), np.empty(n), np.ones(n))
    by_pressure, by_film = np.empty((n, 4)), np.empty((n, 4))
    A, b, active = np.empty((n, n)), np.empty(n), np.empty(n, np.int64)
    nodal_film(nodes, matrix, P, central, H)
    for steps in range(1, most + 1):
        balance(nodes, liquid, K, P, H, state, R, by_pressure, by_film)
        for i in range(1, n - 1):
            scale[i] = abs(by_pressure[i, 2])
            for k in range(4):
                scale[i] += abs(by_film[i, k] * matrix[max(i - 2 + k, 0), i])
        count = _fill_active(P, R, scale, active)
        _linear_system(P, R, active, count, matrix, weights, by_pressure, by_film, A, b, row)
        if not solve_linear(A, b, count + 1):
            return SINGULAR, steps, central, H
        for i in range(n):
            step[i] = -P[i]
        for k in range(count):
            step[active[k]] = b[k]
        change = b[count]
        _fill_film_step(matrix, step, change, row)
        status, central = take_step(P, central, H, step, change, row, clip, tolerance)
        nodal_film(nodes, matrix, P, central, H)
        status = outcome(status, central, H)
        if status != UNDER_WAY:
            return status, steps, central, H
    return TOO_MANY_STEPS, most, central, H
