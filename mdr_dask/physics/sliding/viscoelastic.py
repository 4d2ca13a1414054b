"""Steady sliding of any linear viscoelastic foundation along a rough line or under an indenter.

The stretch (elongation of the spring) of Prony term m is e_m = u - a_m, where u is the displacement of the element and
a_m the displacement of the dashpot of the term. On a periodic line, Newton's method finds the depth and the stretches
at the first node. These stretches must be the same after one period. Under an indenter, only the depth is unknown.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import CLOSE, EPS, MOST_ITERATIONS, Solution
from mdr_dask.physics.sliding.viscoelastic_sweep import (
    Passage,
    Travelling,
    begin_recovery,
    multiply,
    sweep_line,
)
from mdr_dask.physics.solids import LinearSolid, recovery_times

ORDER = 2.0  # order of convergence without extrapolation; with extrapolation, higher if many cells are in contact

DRAG, DEPTH, FRACTION, SLOPE = range(4)


class ViscoelasticCase:
    """One case, solved on finer and finer grids. Each grid has twice as many cells as the previous grid."""

    def __init__(self, solid: LinearSolid, load: float) -> None:
        if not (np.isfinite(load) and load > 0):
            raise ValueError(f"the load must be positive and finite, got {load!r}")
        self._solid, self._load = solid, load
        # stretches of the Prony terms at the first node, and penetration of the highest node
        self._state: FloatArray | None = None
        self._before: FloatArray | None = None  # results on the previous grid

    def on(self, height: FloatArray, periodic: bool) -> Solution:
        """Solve the case on the next finer grid.

        From the second grid on, each result is extrapolated from the last two grids, unless the difference between the
        grids exceeds the result. A periodic line begins and ends at the highest node. This node must be a node of every
        grid.
        """
        cells = height.size - 1
        summit = float(np.max(height))
        below, load = np.ascontiguousarray(height - summit), self._load * cells
        solid = travelling(self._solid, 1 / cells)
        for start in [None] if self._state is None else [self._state, None]:
            outcome, state, values, imbalance = self._solve(below, load, solid, periodic, start)
            if outcome != Outcome.DEPTH_NOT_FOUND:
                break
        self._state = state if outcome == Outcome.CONVERGED else None
        mean = float(np.mean(below[:-1])) if periodic else -summit
        values[DEPTH] += mean
        result = values.copy()
        if self._before is not None:
            change = values - self._before
            # if the change exceeds the value, the extrapolation might reverse the sign of the value
            extrapolated = np.abs(change) <= np.abs(values)
            result[extrapolated] += change[extrapolated] / 3
            result[FRACTION] = min(max(result[FRACTION], 0.0), 1.0)
        self._before = values
        return Solution(list(result[:, None]), np.array([outcome], np.int8), imbalance)

    def _solve(
        self, below: FloatArray, load: float, solid: Travelling, periodic: bool, start: FloatArray | None
    ) -> tuple[Outcome, FloatArray, FloatArray, float]:
        """Return the outcome, the state, the four results, and the relative error of the carried load on one grid.

        The state contains the stretches at the first node and the depth. The depth is the penetration of the highest
        node. The search starts from `start`, the state on the previous grid. If `start` is None or has another number
        of Prony terms, the search starts from the contact at rest.
        """
        terms, cells = solid.moduli.size, below.size - 1
        if start is None or start.size != terms + 1:
            inner = below[:-1] if periodic else below
            depth = static_depth(inner, load)
            start = np.append(np.full(terms, depth - load / inner.size), depth)
        unknown, totals = start.copy(), np.empty(6)
        outcome = Outcome(solve_sliding(below, load, periodic, solid, unknown, totals))
        if outcome == Outcome.CONVERGED and not unknown[-1] > 0:
            outcome = Outcome.DEPTH_NOT_FOUND
        slope = cells * np.sqrt(totals[4] / totals[3]) if totals[3] > 0 else 0.0
        values = np.array([totals[2], unknown[-1], totals[3] / cells, slope])
        return outcome, unknown, values, abs(float(totals[1]) / load - 1)


def travelling(solid: LinearSolid, cell: float) -> Travelling:
    """Return a solid with lengths divided by the cell width and stresses divided by the static modulus.

    The relaxation times of `solid` must be given as distances tau_m v, in the unit of the cell width `cell`.

    The dashpot, and all Prony terms that relax within the fraction `CLOSE` of a cell, are replaced by one Prony term
    that relaxes within this fraction and has the same viscosity.
    """
    static = solid.static_modulus
    fast = solid.times <= CLOSE * cell
    moduli, deborah = solid.moduli[~fast] / static, solid.times[~fast] / cell
    viscosity = (solid.viscosity + solid.moduli[fast] @ solid.times[fast]) / static
    if viscosity > 0:
        moduli = np.append(viscosity / cell / CLOSE, moduli)
        deborah = np.append(CLOSE, deborah)
    times, distance = recovery_times(moduli * deborah, deborah)
    stretch = deborah[:, None] / distance  # row m, column k: stretch of Prony term m if recovery mode k has strain 1
    # the modes are orthogonal with the weights moduli / deborah, so that the inverse of `stretch` has a closed form
    norm = np.sum((moduli * deborah)[:, None] / distance**2, axis=0)
    return Travelling(moduli, deborah, times, stretch.T.copy(), moduli[:, None] / distance / norm)


def static_depth(profile: FloatArray, strain_area: float) -> float:
    """Return the depth at which the positive entries of depth + profile have the sum `strain_area`."""
    falling = np.sort(profile)[::-1]
    depths = (strain_area - np.cumsum(falling)) / np.arange(1, profile.size + 1)  # for 1, 2, ... positive entries
    return float(depths[np.flatnonzero(depths + falling > 0)[-1]])


class Swept(NamedTuple):
    """A solid, and the pieces of a sweep, which are alternately free recoveries and contacts.

    `decayed`, shape (pieces, terms), is 1 - exp(-length / decay length). The decay lengths of a free recovery are
    `solid.times`, and the decay lengths of a contact are `solid.deborah`. `lengths` contains the lengths of the pieces.
    """

    decayed: FloatArray
    lengths: FloatArray
    solid: Travelling


@jit
def follow(direction: FloatArray, swept: Swept, periodic: bool, product: FloatArray, workspace: FloatArray) -> None:
    """Multiply the matrix of derivatives of a Newton step by given changes of the unknowns.

    `direction` contains the changes of the stretches e_m at the start of the line, then the change of the depth.
    `product` receives the changes of the integrals of all e_m, then the change of the integral of u. Shifts of the
    places where contact begins and ends are neglected, because the effect of a shift is of second order. If the line is
    not periodic, the integral of u includes the recovery beyond the end of the line. `workspace`, shape (3, terms), is
    overwritten.
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
            stress = depth
            for m in range(terms):
                stress += moduli[m] * stretch[m]
            begin_recovery(depth, stress / glass, stretch, moduli, modes, amplitude_of)
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
def _decays(lengths: FloatArray, deborah: FloatArray, times: FloatArray) -> FloatArray:
    """Return `Swept.decayed`, shape (pieces, terms), for contacts and free recoveries of the given lengths."""
    decayed = np.empty((lengths.size, deborah.size))
    for piece in range(lengths.size):
        scales = deborah if piece % 2 == 1 else times
        for m in range(deborah.size):
            decayed[piece, m] = -np.expm1(-lengths[piece] / scales[m])
    return decayed


@jit
def newton_step(residual: FloatArray, scale: FloatArray, swept: Swept, workspace: FloatArray, step: FloatArray) -> None:
    """Solve the linear system of a Newton step on a periodic line by the method of generalised conjugate residuals.

    `residual`, which is overwritten, contains the required changes of the integrals of e_m and of u. `scale` contains
    an estimate of the derivative of each integral with respect to the matching unknown. `step` receives the changes of
    the unknowns. If every row is divided by the scale of the row, the matrix is the identity plus a smooth operator
    with fast decreasing singular values. Four to seven products of the matrix and a vector are therefore enough for any
    number of terms.
    """
    n = residual.size
    directions, products, norms = np.empty((n, n)), np.empty((n, n)), np.empty(n)
    residual /= scale
    step[:] = 0.0
    wanted = CLOSE * CLOSE * _dot(residual, residual)
    for j in range(n):
        if not _dot(residual, residual) > wanted:  # the residual is small enough, or not finite
            break
        direction, product = directions[j], products[j]
        direction[:] = residual
        follow(direction, swept, True, product, workspace)
        product /= scale
        for _ in range(2):  # after one orthogonalisation, rounding errors would remain
            for i in range(j):
                share = _dot(product, products[i]) / norms[i]
                for k in range(n):
                    product[k] -= share * products[i, k]
                    direction[k] -= share * directions[i, k]
        norms[j] = _dot(product, product)
        share = _dot(residual, product) / norms[j]
        for k in range(n):
            step[k] += share * direction[k]
            residual[k] -= share * product[k]


@jit
def _dot(one: FloatArray, other: FloatArray) -> float:
    total = 0.0
    for k in range(one.size):
        total += one[k] * other[k]
    return total


@jit
def solve_sliding(
    profile: FloatArray,
    strain_area: float,
    periodic: bool,
    solid: Travelling,
    unknown: FloatArray,
    totals: FloatArray,
) -> int:
    """Find the depth at a given load, and on a periodic line also the stretches e_m at the first node.

    In the steady state, the integral of the stress is equal to the integral of u. Both integrals must be equal to the
    load, `strain_area` = F_N / (4 G_inf dx). After the first step, Newton's method approaches the solution from above,
    because the displacement is a convex, increasing function of the unknowns.

    Heights are relative to the highest node. A periodic line begins and ends at the highest node. On any other line,
    elements enter undeformed and recover beyond the end of the line, and the depth is the only unknown. `unknown`
    contains first guesses of the stretches e_m at the first node, then of the depth. The guesses are replaced by the
    solution. `totals` receives `Passage.totals` of the last sweep. Return an `Outcome`, which is `OUTSIDE_LINE` if an
    element is in contact at an end of a line that is not periodic.
    """
    moduli, deborah, times = solid.moduli, solid.deborah, solid.times
    terms, nodes = moduli.size, profile.size
    size = terms + 1
    passage, penetration = Passage(np.empty(2 * nodes + 4), np.empty(terms), totals), np.empty(nodes)
    of_sweep, workspace = np.empty((10, max(terms, 1))), np.empty((3, terms))
    residual, scale, step, product = np.empty(size), np.empty(size), np.zeros(size), np.empty(size)
    for m in range(terms):
        scale[m] = -deborah[m] * np.expm1(-(nodes - 1) / deborah[m])
    steepest = 0.0
    for i in range(nodes - 1):
        steepest = max(steepest, abs(profile[i + 1] - profile[i]))
    rounding = EPS * nodes * steepest  # error of a height due to the rounding error of a position
    is_last = False
    for _ in range(MOST_ITERATIONS):
        for i in range(nodes):
            penetration[i] = unknown[terms] + profile[i]
        start = unknown[:terms]
        pieces, ends_in_contact = sweep_line(penetration, start, solid, not periodic, passage, of_sweep)
        if is_last:
            leaves_line = not periodic and (penetration[0] > 0 or ends_in_contact)
            return Outcome.OUTSIDE_LINE if leaves_line else Outcome.CONVERGED
        found = passage.lengths[:pieces]
        swept = Swept(_decays(found, deborah, times), found, solid)
        if periodic:
            for m in range(terms):
                residual[m] = -passage.imbalance[m]
            residual[terms] = strain_area - totals[0]
            scale[terms] = totals[3]
            newton_step(residual, scale, swept, workspace, step)
        else:
            # if the depth changes suddenly, each stretch changes by the same amount as the depth
            residual[:] = 1.0
            follow(residual, swept, False, product, workspace)
            # use the integral of the stress as the load, because the integral of u beyond the end may be unknown
            step[terms] = max((strain_area - totals[1]) / product[terms], -0.5 * unknown[terms])
        largest = 0.0
        for j in range(size):
            # an error in the stretch of a soft Prony term hardly matters
            weight = min(1.0, moduli[j]) if j < terms else 1.0
            largest = max(largest, weight * abs(step[j]))
            unknown[j] += step[j]
        if not np.isfinite(largest):
            break
        is_last = largest <= CLOSE * unknown[terms] + rounding
    return Outcome.DEPTH_NOT_FOUND
