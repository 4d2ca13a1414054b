"""Semismooth Newton method for pressure and central film of a lubricated line contact on a given grid, in Hertz units.

The film obeys ``d/dX( rho H^3/eta dP/dX ) = K d(rho H)/dX`` with ``K = (3 pi^2/4) U/W^2`` (thesis eq. B.15), which is
integrated over finite volumes around the nodes. Because of cavitation, ``P >= 0``, ``R <= 0`` and ``P R = 0``. Here, P
is the pressure at a node, and R is the inflow minus the outflow of the volume around this node. The unknowns are the
pressures at the nodes and the film at ``X = 0``. The load gives one more equation, ``int P dX = pi/2``.
"""

from __future__ import annotations

from math import exp
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.linear import SLOWEST, factorise
from mdr_dask.physics.lubrication.deformation import influence_matrix
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import CLOSE, EPS, MOST_ITERATIONS

_FILM_SHARE = 0.8  # one Newton step may reduce the film at a node by at most this fraction; chosen by trial


class Grid(NamedTuple):
    """Node positions in half widths, weights of the trapezoidal rule, and the result of `influence_matrix`."""

    nodes: FloatArray
    weights: FloatArray
    influence: FloatArray

    @classmethod
    def of(cls, nodes: FloatArray) -> Grid:
        """Return the grid with the given nodes, which must be ascending."""
        weights = np.zeros_like(nodes)
        weights[:-1] += np.diff(nodes) / 2
        weights[1:] += np.diff(nodes) / 2
        return cls(nodes, weights, influence_matrix(nodes))


class Iterate(NamedTuple):
    """Result of an iteration: outcome, pressure and film at the nodes, film at ``X = 0``."""

    outcome: Outcome
    pressure: FloatArray
    central: float
    film: FloatArray


class Liquid(NamedTuple):
    """Viscosity and density as functions of pressure, in Hertz units.

    `alpha` is the pressure-viscosity coefficient times p0. `pole` is the pressure p_r of Roelands' law divided by p0,
    and `exponent` is the exponent z of Roelands' law, or zero for Barus' law. The relative density ``rho/rho0`` is
    ``1 + density_rise P/(1 + density_saturation P)``.
    """

    alpha: float
    pole: float
    exponent: float
    density_rise: float
    density_saturation: float


@jit
def log_viscosity_at(P: float, liquid: Liquid) -> tuple[float, float]:
    """Return ``ln(eta/eta0)``, and the derivative with respect to P, at the pressure P in units of p0."""
    if liquid.exponent == 0.0:
        return liquid.alpha * P, liquid.alpha
    ratio = 1.0 + P / liquid.pole
    power = ratio ** (liquid.exponent - 1.0)
    return liquid.alpha * liquid.pole / liquid.exponent * (power * ratio - 1.0), liquid.alpha * power


@jit
def log_viscosities(pressure: FloatArray, liquid: Liquid) -> FloatArray:
    """Return ``ln(eta/eta0)`` at every pressure in units of p0."""
    result = np.empty_like(pressure)
    for i in range(pressure.size):
        result[i] = log_viscosity_at(pressure[i], liquid)[0]
    return result


@jit
def _mobility(left: float, right: float) -> tuple[float, float, float]:
    """Return the mean of 1/eta between two nodes, and the derivatives of this mean with respect to `left` and `right`.

    `left` and `right` are the values of ln(eta) at the two nodes. The mean is exact if ln(eta) is linear between the
    nodes.
    """
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


class Imbalance(NamedTuple):
    """Inflow minus outflow of every volume, shape (n,), and the derivatives of this difference, shape (n, 4).

    Row i of `by_pressure` contains the derivatives with respect to the pressures at the four nodes from i - 2 to i + 1.
    Row i of `by_film` contains the derivatives with respect to the films at the same nodes.
    """

    value: FloatArray
    by_pressure: FloatArray
    by_film: FloatArray


@jit
def balance(
    nodes: FloatArray, liquid: Liquid, K: float, P: FloatArray, H: FloatArray, state: FloatArray, found: Imbalance
) -> None:
    """Write the imbalance of every volume to `found`. `state` is workspace of shape (4, n)."""
    R, by_pressure, by_film = found
    rho, rho_slope, viscosity, viscosity_slope = state
    for i in range(P.size):
        rho[i] = 1.0 + liquid.density_rise * P[i] / (1.0 + liquid.density_saturation * P[i])
        rho_slope[i] = liquid.density_rise / (1.0 + liquid.density_saturation * P[i]) ** 2
        viscosity[i], viscosity_slope[i] = log_viscosity_at(P[i], liquid)
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
        # Couette flux: linear extrapolation from two nodes upstream of the face, or the value at the first node
        e = max(f - 1, 0)
        w0 = -0.5 * dx / (nodes[f] - nodes[e]) if f > 0 else 0.0
        w1 = 1.0 - w0
        couette = w0 * rho[e] * H[e] + w1 * rho[f] * H[f]
        flux = density * conductance * mobility * gradient - couette
        steeper = 1.5 * density * film**2 / K * mobility * gradient
        h0, h1, h2 = -w0 * rho[e], steeper - w1 * rho[f], steeper
        denser = 0.5 * conductance * mobility * gradient
        p0 = -w0 * rho_slope[e] * H[e]
        p1 = density * conductance * (by_left * viscosity_slope[f] * gradient - mobility / dx)
        p1 += rho_slope[f] * (denser - w1 * H[f])
        p2 = density * conductance * (by_right * viscosity_slope[g] * gradient + mobility / dx)
        p2 += rho_slope[g] * denser
        R[f] += flux
        R[g] -= flux
        for derivative, d0, d1, d2 in ((by_pressure, p0, p1, p2), (by_film, h0, h1, h2)):
            derivative[f, 1] += d0
            derivative[f, 2] += d1
            derivative[f, 3] += d2
            derivative[g, 0] -= d0
            derivative[g, 1] -= d1
            derivative[g, 2] -= d2


@jit
def _fill_jacobian_row(
    i: int, influence: FloatArray, by_pressure: FloatArray, by_film: FloatArray, row: FloatArray
) -> None:
    """Write to `row` the derivatives of the imbalance of volume i with respect to all pressures."""
    c0, c1, c2, c3 = by_film[i]
    far, near, own, next_ = influence[max(i - 2, 0)], influence[i - 1], influence[i], influence[i + 1]
    for j in range(row.size):
        row[j] = c0 * far[j] + c1 * near[j] + c2 * own[j] + c3 * next_[j]
    for k in range(4):
        if i - 2 + k >= 0:
            row[i - 2 + k] += by_pressure[i, k]


@jit
def _fill_active(influence: FloatArray, P: FloatArray, found: Imbalance, active: NDArray[np.int64]) -> int:
    """Write the indices of the active nodes to `active`, and return the number of active nodes.

    The pressures at active nodes are the unknowns of a Newton step. An inner node is active if ``P + R/d > 0``, where d
    estimates the size of dR/dP at this node.
    """
    R, by_pressure, by_film = found
    count = 0
    for i in range(1, P.size - 1):
        size = abs(by_pressure[i, 2])
        for k in range(4):
            size += abs(by_film[i, k] * influence[max(i - 2 + k, 0), i])
        if P[i] + R[i] / size > 0.0:
            active[count] = i
            count += 1
    return count


@jit
def _fill_equations(
    grid: Grid, P: FloatArray, found: Imbalance, active: NDArray[np.int64], A: FloatArray, b: FloatArray
) -> None:
    """Write the matrix `A` and right side `b` of the Newton equations for the active pressures and the central film.

    The step sets all inactive pressures to zero.
    """
    R, by_pressure, by_film = found
    count = active.size
    released, row = P.copy(), np.empty(P.size)
    for k in range(count):
        released[active[k]] = 0.0
    for k in range(count):
        i = active[k]
        _fill_jacobian_row(i, grid.influence, by_pressure, by_film, row)
        for m in range(count):
            A[k, m] = row[active[m]]
        A[k, count] = np.sum(by_film[i])
        b[k] = -R[i]
        for j in range(P.size):
            b[k] += row[j] * released[j]
    b[count] = 0.5 * np.pi
    for j in range(P.size):
        b[count] += grid.weights[j] * (released[j] - P[j])
    for m in range(count):
        A[count, m] = grid.weights[active[m]]
    A[count, count] = 0.0


@jit
def _fill_imbalance(grid: Grid, P: FloatArray, R: FloatArray, active: NDArray[np.int64], b: FloatArray) -> None:
    """Write the right-hand side of the equations to `b`, for a Newton step that reuses an earlier Jacobian.

    The pressures at all inactive nodes must be zero.
    """
    for k in range(active.size):
        b[k] = -R[active[k]]
    b[active.size] = 0.5 * np.pi
    for j in range(P.size):
        b[active.size] -= grid.weights[j] * P[j]


@jit
def _add_deformation(influence: FloatArray, P: FloatArray, H: FloatArray) -> None:
    """Add the deformation under the pressures P to the film H."""
    n = P.size
    for i in range(0, n - 3, 4):
        h0, h1, h2, h3 = H[i], H[i + 1], H[i + 2], H[i + 3]
        for j in range(n):
            p = P[j]
            h0 += influence[i, j] * p
            h1 += influence[i + 1, j] * p
            h2 += influence[i + 2, j] * p
            h3 += influence[i + 3, j] * p
        H[i], H[i + 1], H[i + 2], H[i + 3] = h0, h1, h2, h3
    for i in range(n - n % 4, n):
        for j in range(n):
            H[i] += influence[i, j] * P[j]


@jit
def film_on(grid: Grid, P: FloatArray, central: float) -> FloatArray:
    """Return the film at the nodes, given the nodal pressures and the film at ``X = 0``."""
    H = central + 0.5 * grid.nodes**2
    _add_deformation(grid.influence, P, H)
    return H


@jit
def _step_length(grid: Grid, P: FloatArray, H: FloatArray, step: FloatArray, change: float, clip: float) -> float:
    """Return the largest allowed fraction of a Newton step.

    The film must remain positive, and no pressure may change by more than `clip` times the largest pressure.
    """
    largest = np.max(np.abs(step))
    share = min(1.0, clip * np.max(P) / largest) if largest > 0.0 else 1.0
    film_step = np.full_like(H, change)
    _add_deformation(grid.influence, step, film_step)
    for i in range(P.size):
        if film_step[i] < 0.0:
            share = min(share, -_FILM_SHARE * H[i] / film_step[i])
    return share


@jit
def _take_step(
    grid: Grid, clip: float, P: FloatArray, central: float, H: FloatArray, step: FloatArray, change: float
) -> tuple[float, float]:
    """Change P, H and the film at ``X = 0`` by the allowed fraction of a Newton step.

    Return the film at ``X = 0`` and the relative size of the step. The size is infinite for a shortened step. The size
    is NaN if the allowed fraction is below the rounding error (then nothing is changed), or if the film closes.
    """
    share = _step_length(grid, P, H, step, change, clip)
    if not share > EPS:
        return central, np.nan
    size = max(np.max(np.abs(step)) / np.max(P), abs(change) / central) if share == 1.0 else np.inf
    for i in range(P.size):
        P[i] = max(0.0, P[i] + share * step[i])
    central += share * change
    H[:] = film_on(grid, P, central)
    return central, size if central > 0.0 and np.min(H) > 0.0 else np.nan


def newton(grid: Grid, liquid: Liquid, K: float, guess: FloatArray, central: float, clip: float) -> Iterate:
    """Solve for pressure and film on one grid. The outcome is CONVERGED, TOO_MANY_STEPS, SINGULAR or FILM_COLLAPSED.

    The guessed pressure must be zero at both ends and nowhere negative. The guessed central film must be so large that
    the film is positive at all nodes. One step may change a pressure by at most `clip` times the largest pressure.
    """
    n = guess.size
    P, H = guess.copy(), film_on(grid, guess, central)
    state, found = np.empty((4, n)), Imbalance(np.empty(n), np.empty((n, 4)), np.empty((n, 4)))
    listed, workspace = np.empty(n, np.int64), np.empty(n * n)
    solved, factors, b = listed[:0], None, np.empty(0)
    size, before = np.inf, 1.0
    for steps in range(MOST_ITERATIONS + 1):
        balance(grid.nodes, liquid, K, P, H, state, found)
        active = listed[: _fill_active(grid.influence, P, found, listed)]
        same = np.array_equal(active, solved)
        # at least two Newton steps are taken, because the first step may be small by chance
        if steps > 1 and size < CLOSE and same:
            return Iterate(Outcome.CONVERGED, P, central, H)
        if steps == MOST_ITERATIONS:
            break
        if same and size < SLOWEST * before:
            _fill_imbalance(grid, P, found.value, active, b)
        else:
            solved, b = active.copy(), np.empty(active.size + 1)
            A = workspace[: b.size**2].reshape(b.size, b.size)
            _fill_equations(grid, P, found, active, A, b)
            factors = factorise(A)
        if factors is None:
            return Iterate(Outcome.SINGULAR, P, central, H)
        solution = factors.solve(b)
        step = -P
        step[active] = solution[:-1]
        before = size if steps else 1.0
        central, size = _take_step(grid, clip, P, central, H, step, solution[-1])
        if np.isnan(size):
            return Iterate(Outcome.FILM_COLLAPSED, P, central, H)
    return Iterate(Outcome.TOO_MANY_STEPS, P, central, H)
