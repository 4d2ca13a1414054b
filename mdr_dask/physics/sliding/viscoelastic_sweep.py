"""Exact sweep of a linear viscoelastic foundation along a line of straight cells.

The unit of length is the cell width, and stresses are divided by the static modulus. The stretch e_m of the spring in
Prony term m obeys de_m/ds = du/ds - e_m / deborah_m, where u is the displacement, s is the travelled distance, and
deborah_m is the distance tau_m v. In contact, u is the penetration w, and the stretches have closed forms. The
displacement of a free element is a sum of exponential modes. The sweep neglects only contacts that begin and end inside
one cell.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.refine import CLOSE, MOST_ITERATIONS


class Travelling(NamedTuple):
    """A sliding solid and the recovery modes of the solid.

    Stresses are divided by the static modulus, and lengths by the cell width. The Prony terms are in ascending order of
    the Deborah number tau_m v / dx. `times` are the decay lengths v t of the recovery modes, where t is the decay time
    of a mode. Row k of `stretch_of` contains the stretches of all Prony terms if recovery mode k alone has the
    strain 1. Row m of `amplitude_of` contains the strains of all recovery modes if Prony term m alone has the
    stretch 1.
    """

    moduli: FloatArray
    deborah: FloatArray
    times: FloatArray
    stretch_of: FloatArray
    amplitude_of: FloatArray


@jit
def multiply(columns: FloatArray, vector: FloatArray, product: FloatArray) -> None:
    """Write the product of a matrix and a vector. ``columns[k]`` is column k of the matrix."""
    product[:] = 0.0
    for k in range(vector.size):
        factor = vector[k]
        for m in range(product.size):
            product[m] += columns[k, m] * factor


@jit
def step_factors(length: float, deborah: FloatArray, decay: FloatArray, gain: FloatArray, area: FloatArray) -> None:
    """Write the factors `decay`, `gain` and `area` of every Prony term for a straight piece of the given length.

    If e is the stretch at the start of the piece, the stretch at the end is decay * e + gain * slope, and the integral
    of the stretch over the piece is gain * e + area * slope.
    """
    for m in range(deborah.size):
        x = length / deborah[m]
        if x < 0.02:  # the closed form of `area` would lose digits; the series is exact to rounding
            loss = x * (1 - x / 2 * (1 - x / 3 * (1 - x / 4 * (1 - x / 5 * (1 - x / 6)))))
            decay[m] = 1 - loss
            gain[m] = deborah[m] * loss
            area[m] = length * length * (0.5 - x / 6 * (1 - x / 4 * (1 - x / 5 * (1 - x / 6 * (1 - x / 7)))))
        else:
            decay[m] = np.exp(-x)
            gain[m] = deborah[m] * (1 - decay[m])
            area[m] = deborah[m] * (length - gain[m])


@jit
def _pressure_inside(
    length: float, start: float, slope: float, stretch: FloatArray, moduli: FloatArray, deborah: FloatArray
) -> tuple[float, float]:
    """Return the stress and d(stress)/ds at the distance s = `length` from the start of a straight piece."""
    pressure, rate = start + slope * length, slope
    for m in range(moduli.size):
        decayed = -np.expm1(-length / deborah[m])
        pressure += moduli[m] * ((1 - decayed) * stretch[m] + slope * deborah[m] * decayed)
        rate += moduli[m] * (1 - decayed) * (slope - stretch[m] / deborah[m])
    return pressure, rate


@jit
def separation_point(
    end: float, start: float, slope: float, stretch: FloatArray, moduli: FloatArray, deborah: FloatArray
) -> float:
    """Return the place between 0 and `end` where the stress falls to zero, by Newton's method and bisection."""
    low, high = 0.0, end
    point = min(0.5 * end, deborah[0]) if deborah.size else 0.5 * end  # deborah[0] is the shortest decay length
    for _ in range(MOST_ITERATIONS):
        pressure, rate = _pressure_inside(point, start, slope, stretch, moduli, deborah)
        if pressure > 0:
            low = point
        else:
            high = point
        following = point - pressure / rate if rate < 0 else -1.0
        if not low < following < high:
            following = 0.5 * (low + high)
        if abs(following - point) <= CLOSE * point:
            return following
        point = following
    return point


@jit
def _strain_of(distance: float, modes: FloatArray, times: FloatArray) -> tuple[float, float]:
    """Return the strain of a free element after a distance, and the derivative of the strain along the distance."""
    strain, rate = 0.0, 0.0
    for k in range(times.size):
        term = modes[k] * np.exp(-distance / times[k])
        strain += term
        rate -= term / times[k]
    return strain, rate


@jit
def contact_point(low: float, high: float, start: float, slope: float, modes: FloatArray, times: FloatArray) -> float:
    """Return the distance t after which a free element meets the straight line start + slope (t - low).

    The distance is counted from the place where the free recovery began, and lies between `low` and `high`. Newton's
    method converges from `low` without overshooting, because the strain of a free element is convex in t.
    """
    point = low
    for _ in range(MOST_ITERATIONS):
        strain, rate = _strain_of(point, modes, times)
        gap, rate = strain - (start + slope * (point - low)), rate - slope
        if gap <= 0 or rate >= 0:
            return point
        step = -gap / rate
        point += step
        if point >= high:
            return high
        if step <= CLOSE * high:
            return point
    return point


@jit
def _next_contact(
    place: float, node: int, modes: FloatArray, times: FloatArray, penetration: FloatArray, last: int
) -> float:
    """Return the position beyond `place` where a free element meets the line again, or -1 if contact does not begin.

    Contact is detected where the line is above the free element at a node. The search begins in the cell that ends at
    `node`. If contact ended inside a cell, the search must begin in the next cell, because the convex strain does not
    meet the same straight cell again. The logarithm of the strain is convex, so that a tangent exponential function is
    a lower bound of the strain. Nodes below this lower bound are skipped.
    """
    strain, rate = _strain_of(0.0, modes, times)
    bound = strain
    ratio = np.exp(rate / strain) if strain > 0 else 1.0
    bound *= ratio ** (node - place)
    while node <= last:
        if penetration[node] > bound:
            strain, rate = _strain_of(node - place, modes, times)
            if penetration[node] > strain:
                before = max(node - 1.0 - place, 0.0)
                slope = penetration[node] - penetration[node - 1]
                start = penetration[node] - slope * (node - place - before)
                return place + contact_point(before, node - place, start, slope, modes, times)
            bound = strain
            ratio = np.exp(rate / strain) if strain > 0 else 1.0
        bound *= ratio
        node += 1
    return -1.0


class Passage(NamedTuple):
    """The results of a sweep.

    In `lengths`, entries 0, 2, ... are the lengths of free recoveries, and entries 1, 3, ... are the lengths of
    contacts. Entry 0 may be 0. For n nodes, `lengths` needs at least 2 n + 2 entries, of which a sweep uses only the
    first ones (see `sweep_line`). `imbalance` contains the integral of each e_m over the line, which is 0 in the steady
    state on a periodic line. The six entries of `totals` are: integral of u; integral of the stress; integral of the
    stress times the slope; length in contact; integral of slope^2 over the length in contact; and integral of u beyond
    the end of the line (0 if the element is in contact at the last node).
    """

    lengths: FloatArray
    imbalance: FloatArray
    totals: FloatArray


@jit
def sweep_line(
    penetration: FloatArray,
    start: FloatArray,
    solid: Travelling,
    undeformed: bool,
    passage: Passage,
    workspace: FloatArray,
) -> tuple[int, bool]:
    """Move an element once along the line, and write the lengths and integrals to `passage`.

    `start` contains the stretches e_m at the first node, where the displacement is equal to the penetration. If
    `undeformed` is True, `start` is ignored, and the element enters undeformed and out of contact. `workspace` has the
    shape (10, max(terms, 1)). Return the number of entries written to `lengths`, and whether the element is in
    contact at the last node.
    """
    # local names, because reading an array from a tuple takes more time than computing a cell
    moduli, deborah, times, stretch_of, amplitude_of = solid
    lengths, imbalance, totals = passage
    terms, last = moduli.size, penetration.size - 1
    e, modes = workspace[0], workspace[1]
    step_factors(1.0, deborah, workspace[3], workspace[4], workspace[5])
    imbalance[:] = 0.0
    totals[:] = 0.0
    glass, push = 1.0, penetration[0]
    for m in range(terms):
        e[m] = 0.0 if undeformed else start[m]
        glass += moduli[m]
        push += moduli[m] * e[m]
        modes[m] = 0.0
    place, pieces, node = 0.0, 0, 1
    is_free, left = undeformed or push < 0, True
    if is_free and not undeformed:
        begin_recovery(penetration[0], push / glass, e, moduli, modes, amplitude_of)
    while True:
        contact = _next_contact(place, node, modes, times, penetration, last) if is_free else place
        goal = contact if contact >= 0 else float(last)
        lengths[pieces] = goal - place
        pieces += 1
        if is_free:
            _add_recovery(goal - place, modes, times, stretch_of, e, imbalance, totals)
        if contact < 0:
            for k in range(terms):
                totals[5] += modes[k] * times[k]
            return pieces, False
        if int(goal) >= last:
            return pieces, True
        place, strain, pressure, left = _contact(goal, penetration, moduli, deborah, imbalance, totals, workspace)
        lengths[pieces] = place - goal
        pieces += 1
        if not left:
            return pieces, True
        node = int(workspace[2, 0])
        begin_recovery(strain, pressure / glass, e, moduli, modes, amplitude_of)
        is_free = True


@jit
def _contact(
    begin: float,
    penetration: FloatArray,
    moduli: FloatArray,
    deborah: FloatArray,
    imbalance: FloatArray,
    totals: FloatArray,
    workspace: FloatArray,
) -> tuple[float, float, float, bool]:
    """Move an element in contact from `begin` until the stress falls to zero or the line ends (see `sweep_line`).

    Return the final place of the element, the strain and the stress at this place, and whether contact ends before the
    end of the line. The stretches are written to ``workspace[0]``. The node at which the search for the next contact
    begins is ``workspace[2, 0]``.
    """
    terms, last = moduli.size, penetration.size - 1
    e, following = workspace[0], workspace[9]
    place, node = begin, int(begin) + 1
    rise = penetration[node] - penetration[node - 1]
    first = strain = penetration[node] - rise * (node - place)
    pressure, left = 0.0, False
    while node <= last and not left:
        slope = penetration[node] - penetration[node - 1]
        length = node - place
        factors = workspace[3:6]
        if length != 1.0:
            factors = workspace[6:9]
            step_factors(length, deborah, factors[0], factors[1], factors[2])
        pressure = _stretch(penetration[node], slope, e, following, moduli, factors)
        if pressure < 0:
            left = True
            length = separation_point(length, strain, slope, e, moduli, deborah)
            factors = workspace[6:9]
            step_factors(length, deborah, factors[0], factors[1], factors[2])
            pressure = _stretch(strain + slope * length, slope, e, following, moduli, factors)
        viscous = 0.0
        for m in range(terms):
            integral = factors[1, m] * e[m] + factors[2, m] * slope
            imbalance[m] += integral
            viscous += moduli[m] * integral
            e[m] = following[m]
        elastic = length * (strain + 0.5 * slope * length)
        totals[0] += elastic
        totals[1] += elastic + viscous
        totals[2] += viscous * slope
        totals[4] += slope * slope * length
        strain = strain + slope * length if left else penetration[node]
        place = place + length if left else float(node)
        node += 1
    totals[2] += 0.5 * (strain - first) * (strain + first)
    totals[3] += place - begin
    workspace[2, 0] = node
    return place, strain, pressure, left


@jit
def _stretch(
    strain: float, slope: float, e: FloatArray, following: FloatArray, moduli: FloatArray, factors: FloatArray
) -> float:
    """Write the stretches at the end of a straight piece with the final strain `strain`. Return the final stress."""
    pressure = strain
    for m in range(moduli.size):
        following[m] = factors[0, m] * e[m] + factors[1, m] * slope
        pressure += moduli[m] * following[m]
    return pressure


@jit
def begin_recovery(
    strain: float, excess: float, e: FloatArray, moduli: FloatArray, modes: FloatArray, amplitude_of: FloatArray
) -> None:
    """Write the amplitudes of the recovery modes after the strain has suddenly decreased from `strain` by `excess`.

    `e` contains the stretches before the decrease, and is changed to the stretches after it. The stretch of the fastest
    Prony term is adjusted so that the stress is exactly zero.
    """
    stress = strain - excess
    for m in range(moduli.size):
        e[m] -= excess
        if m > 0:
            stress += moduli[m] * e[m]
    if moduli.size:
        e[0] = -stress / moduli[0]
        multiply(amplitude_of, e, modes)


@jit
def _add_recovery(
    length: float,
    modes: FloatArray,
    times: FloatArray,
    stretch_of: FloatArray,
    e: FloatArray,
    imbalance: FloatArray,
    totals: FloatArray,
) -> None:
    """Advance the modes over a free recovery.

    The integral of u is added to `totals`, the integrals of the stretches are added to `imbalance`, and the final
    stretches are written to `e`.
    """
    for m in range(e.size):
        e[m] = 0.0
    for k in range(times.size):
        decayed = -np.expm1(-length / times[k])
        integral = modes[k] * times[k] * decayed
        totals[0] += integral
        modes[k] *= 1 - decayed
        after = modes[k]
        for m in range(e.size):
            imbalance[m] += stretch_of[k, m] * integral
            e[m] += stretch_of[k, m] * after
