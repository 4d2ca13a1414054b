"""A line over the elements at one moment: heights, the depth for a mean displacement, and the forces.

The edges of the contact lie inside the cells between elements. Where contact grows, the edge is where the gap to the
displacement without contact vanishes; where it shrinks, where the force vanishes. If neither decides, because the force
of a dashpot has jumped since, the edge stays where the force put it last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.surfaces.cubic_line import CubicLine


class Edges(NamedTuple):
    """Place in the cell before each element where the force last put an edge, -1 for none, and the gap outside then."""

    place: FloatArray
    gap: FloatArray


class Contact(NamedTuple):
    """Elements under a line at one moment, shape (n,) each, and the edges of their contact.

    Parameters
    ----------
    gaps, slope : array
        From the line to the displacement that an element would have without contact, and the slope of the line.
    pulls, force, power : array
        Force of springs and Prony terms of elements at the line; the whole force, and that times the slope (written).
    touching : bool array
    edges : Edges
    """

    gaps: FloatArray
    pulls: FloatArray
    slope: FloatArray
    force: FloatArray
    power: FloatArray
    touching: BoolArray
    edges: Edges


class Drive(NamedTuple):
    """Deborah number and load of a moment, and the element at the start of a line that does not close, else -1."""

    deborah: float
    load: float
    first: int


@jit
def under_elements(line: CubicLine, travel: float, under: FloatArray, slope_under: FloatArray) -> int:
    """Write height and slope over the line's length above every element after a travel; return its whole cells."""
    n = under.size
    cells = travel * n
    shift = int(np.floor(cells))
    y = cells - shift
    a0, a1 = (1 + 2 * y) * (1 - y) ** 2, y * y * (3 - 2 * y)
    b0, b1 = y * (1 - y) ** 2, y * y * (y - 1)
    g0, k0, k1 = 6 * y * (y - 1), (1 - y) * (1 - 3 * y), y * (3 * y - 2)
    i = shift % n
    for j in range(n):
        before, after, enter, leave = line.height[i], line.height[i + 1], line.enter[i], line.leave[i]
        under[j] = a0 * before + a1 * after + b0 * enter + b1 * leave
        slope_under[j] = n * (g0 * (before - after) + k0 * enter + k1 * leave)
        i = i + 1 if i + 1 < n else 0
    return shift


@jit
def depth_for(under: FloatArray, free: FloatArray, mean: float, depth: float) -> tuple[float, bool]:
    """Find the depth at which the mean displacement max(d + p, free) has its value; convex and increasing in d."""
    n = under.size
    for _ in range(200):
        total, touching = 0.0, 0
        for j in range(n):
            w = depth + under[j]
            if w > free[j]:
                total += w
                touching += 1
            else:
                total += free[j]
        if touching == 0:
            nearest = np.inf
            for j in range(n):
                nearest = min(nearest, free[j] - under[j])
            if abs(total - mean * n) <= 1e-12 * abs(mean) * n:
                return nearest, True
            depth = nearest + (mean * n - total)
            continue
        step = (mean * n - total) / touching
        depth += step
        if abs(step) <= 1e-12 * (abs(depth) + abs(mean)):
            return depth, True
    return depth, False


@jit_inline
def _whole(values: FloatArray, j: int) -> float:
    """Return the integral over the cell before node j of the cubic through four nodes."""
    n = values.size
    return float((13 * (values[j - 1] + values[j]) - values[j - 2] - values[(j + 1) % n]) / 24)


@jit_inline
def _limit(inner: float, outer: float, place: float, gap: float) -> float:
    """Return the part of a cell up to the edge, seen from the element in contact."""
    if place < 0:
        inner = max(inner, 0.0)
        return inner / (inner - outer) if outer < 0 else 1.0
    return place + (1 - place) * np.sqrt(max(1 - outer / gap, 0.0)) if gap < 0 else place


@jit_inline
def _cell(
    j: int, gaps: FloatArray, force: FloatArray, touching: BoolArray, edges: Edges, keep: bool
) -> tuple[float, float]:
    """Return begin and end of contact in the cell before element j, as parts of the cell."""
    f0, f1 = force[j - 1], force[j]
    before, after = touching[j - 1], touching[j]
    if keep and before == after:
        edges.place[j] = -1.0
    if f0 <= 0 and f1 <= 0:
        return 0.0, 0.0
    low, high = 0.0, 1.0
    if not after:
        high = _limit(gaps[j - 1], gaps[j], edges.place[j], edges.gap[j])
    elif not before:
        low = 1 - _limit(gaps[j], gaps[j - 1], edges.place[j], edges.gap[j])
    zero = f0 / (f0 - f1) if (f0 < 0) != (f1 < 0) else -1.0
    by_force = (f0 < 0 and zero > low) or (f1 < 0 and zero < high)
    if by_force and f0 < 0:
        low = zero
    elif by_force:
        high = zero
    if keep and by_force and before != after and high > low:
        edges.place[j], edges.gap[j] = (high, gaps[j]) if before else (1 - low, gaps[j - 1])
    return low, high


@jit
def _forces(contact: Contact, first: int, keep: bool) -> tuple[float, float, float]:
    """Return mean load, drag and fraction in contact; `first` has no element before it. Write the edges if `keep`."""
    force, power, slope, touching, edges = contact.force, contact.power, contact.slope, contact.touching, contact.edges
    n = force.size
    load, drag, length = 0.0, 0.0, 0.0
    for j in range(n):
        if j == first or not (touching[j - 1] or touching[j]):
            edges.place[j] = -1.0
            continue
        low, high = _cell(j, contact.gaps, force, touching, edges, keep)
        width, middle = high - low, 0.5 * (low + high)
        if width >= 1:
            load += _whole(force, j)
            drag += _whole(power, j)
            length += 1
        elif width > 0:
            rise, bend = force[j] - force[j - 1], slope[j] - slope[j - 1]
            f, s = force[j - 1] + rise * middle, slope[j - 1] + bend * middle
            load += width * f
            drag += width * (f * s + width * width / 12 * rise * bend)
            length += width
    return load / n, drag / n, length / n


@jit
def _pressing_rate(contact: Contact, weight: float, deborah: float) -> float:
    """Return the least rate at which the force on every element in contact is positive."""
    rate = -np.inf
    for j in range(contact.force.size):
        if contact.touching[j]:
            rate = max(rate, -contact.pulls[j] / weight - deborah * contact.slope[j])
    return rate


@jit
def carrying_rate(contact: Contact, weight: float, rate: float, drive: Drive) -> tuple[float, float, float]:
    """Return the rate of the depth at which the load is carried, drag and fraction in contact; write the edges.

    The force of an element pressed to the line is `pulls` and `weight` times ``rate + deborah * slope``: with a dashpot
    its viscosity and the rate of the depth, without one the glass modulus and a correction of the depth, deborah 0.
    """
    force, power, slope = contact.force, contact.power, contact.slope
    drag, length = 0.0, 0.0
    for iteration in range(60):
        for j in range(force.size):
            force[j] = contact.pulls[j] + weight * (rate + drive.deborah * slope[j])
            power[j] = force[j] * slope[j]
        carried, drag, length = _forces(contact, drive.first, False)
        if abs(carried - drive.load) <= 1e-11 * drive.load or iteration == 59:
            break
        if length > 0:
            rate += (drive.load - carried) / (length * weight)
        else:
            rate = max(rate, _pressing_rate(contact, weight, drive.deborah)) + drive.load / weight
    _forces(contact, drive.first, True)
    return rate, drag, length
