"""A line over the elements at one moment: heights, the depth for a mean displacement, and the forces.

The edges of the contact lie inside the cells between elements: where touched by the gap to the displacement that an
element would have without contact, where let go by the force, and where neither decides (the force of a dashpot has
jumped since) where the edge was when the force decided last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.physics.compiling import compiled


class Line(NamedTuple):
    """Heights and slopes at n + 1 nodes of a line of unit length, and whether it closes."""

    height: FloatArray
    slope: FloatArray
    periodic: bool


class Edges(NamedTuple):
    """Where the force last put an edge in the cell before each element, and the gap outside then; -1 for nowhere."""

    place: FloatArray
    gap: FloatArray


@compiled
def under_elements(line: Line, travel: float, under: FloatArray, slope_under: FloatArray) -> int:
    """Write height and slope over every element after a travel, from cubic cells; return the whole cells of it."""
    n = under.size
    cells = travel * n
    shift = int(np.floor(cells))
    y = cells - shift
    a0, a1 = (1 + 2 * y) * (1 - y) ** 2, y * y * (3 - 2 * y)
    b0, b1 = y * (1 - y) ** 2 / n, y * y * (y - 1) / n
    g0, k0, k1 = 6 * y * (y - 1) * n, (1 - y) * (1 - 3 * y), y * (3 * y - 2)
    i = shift % n
    for j in range(n):
        under[j] = a0 * line.height[i] + a1 * line.height[i + 1] + b0 * line.slope[i] + b1 * line.slope[i + 1]
        slope_under[j] = g0 * (line.height[i] - line.height[i + 1]) + k0 * line.slope[i] + k1 * line.slope[i + 1]
        i = i + 1 if i + 1 < n else 0
    return shift


@compiled
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


@compiled
def _whole(values: FloatArray, j: int) -> float:
    """Return the integral over the cell before node j of the cubic through four nodes."""
    n = values.size
    return float((13 * (values[j - 1] + values[j]) - values[j - 2] - values[(j + 1) % n]) / 24)


@compiled
def _limit(inner: float, outer: float, place: float, gap: float) -> float:
    """Return the part of a cell up to the edge, seen from the element in contact."""
    if place < 0:
        inner = max(inner, 0.0)
        return inner / (inner - outer) if outer < 0 else 1.0
    return place + (1 - place) * np.sqrt(max(1 - outer / gap, 0.0)) if gap < 0 else place


@compiled
def _cell(
    j: int, gaps: FloatArray, force: FloatArray, touching: BoolArray, edges: Edges, keep: bool
) -> tuple[float, float]:
    """Return from where to where there is contact in the cell before element j, as parts of it."""
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


@compiled
def _forces(
    gaps: FloatArray,
    force: FloatArray,
    power: FloatArray,
    slope: FloatArray,
    touching: BoolArray,
    edges: Edges,
    keep: bool,
    first: int,
) -> tuple[float, float, float]:
    """Return mean load, drag and fraction in contact.

    `power` is force times slope. `first` is the element at the start of the line, behind which there is none if the
    line does not close, else -1. The edges are noted if `keep`.
    """
    n = gaps.size
    load, drag, length = 0.0, 0.0, 0.0
    for j in range(n):
        if j == first or not (touching[j - 1] or touching[j]):
            edges.place[j] = -1.0
            continue
        low, high = _cell(j, gaps, force, touching, edges, keep)
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


@compiled
def carrying_rate(
    weight: float,
    gaps: FloatArray,
    pulls: FloatArray,
    slope: FloatArray,
    touching: BoolArray,
    edges: Edges,
    rate: float,
    deborah: float,
    load: float,
    first: int,
    force: FloatArray,
    power: FloatArray,
) -> tuple[float, float, float]:
    """Return the rate at which the load is carried, drag and fraction in contact.

    The force of an element pressed to the line is `pulls` and `weight` times ``rate + deborah * slope``: with a dashpot
    its viscosity and the rate of the depth, without one the glass modulus and a correction of the depth, deborah 0.
    """
    carried, drag, length = 0.0, 0.0, 0.0
    for turn in range(60):
        for j in range(gaps.size):
            force[j] = pulls[j] + weight * (rate + deborah * slope[j])
            power[j] = force[j] * slope[j]
        carried, drag, length = _forces(gaps, force, power, slope, touching, edges, False, first)
        if length <= 0 or abs(carried - load) <= 1e-11 * load or turn == 59:
            break
        rate += (load - carried) / (length * weight)
    _forces(gaps, force, power, slope, touching, edges, True, first)
    return rate, drag, length
