"""Motion of all elements of a viscoelastic foundation in the time steps of a loading history.

The static modulus and the length of the line are 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import CLOSE, MOST_ITERATIONS
from mdr_dask.physics.surfaces.cubic_line import CubicLine
from mdr_dask.physics.transients.elements.foundation import (
    Foundation,
    Lapse,
    advance,
    at_rest,
    free_after,
    lapse_of,
    pull,
    recover,
    release,
)


class Edges(NamedTuple):
    """The last known edges of contact at which the force is zero, with at most one edge in the cell before each
    element.

    The element at one end of the cell is in contact. `place` is the distance between this element and the edge, in
    cells, or -1 if there is no edge. `gap` is the gap at the other end of the cell when the edge was found.
    """

    place: FloatArray
    gap: FloatArray


class Drive(NamedTuple):
    """Deborah number and load at one instant.

    `first` is the first element of a line that is not periodic, or -1 if the line is periodic.
    """

    deborah: float
    load: float
    first: int


@jit
def under_elements(line: CubicLine, travel: float, under: FloatArray, slope_under: FloatArray) -> int:
    """Write height and slope (d/d(x / L)) of the line at every element, when the line has travelled by `travel`.

    Return the number of whole cells that the line has travelled.
    """
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
    """Return the depth d at which the mean displacement is `mean`, and whether this depth was found.

    The displacement of an element is max(d + h, free). Here `under` contains the height h of the line, and `free` the
    displacement of the element without contact. The mean displacement is a convex, increasing function of d. If the
    mean of `free` is equal to `mean`, the largest depth without contact is returned.
    """
    n = under.size
    for _ in range(MOST_ITERATIONS):
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
            if abs(total - mean * n) <= CLOSE * abs(mean) * n:
                return nearest, True
            depth = nearest + (mean * n - total)
            continue
        step = (mean * n - total) / touching
        depth += step
        if abs(step) <= CLOSE * (abs(depth) + abs(mean)):
            return depth, True
    return depth, False


@jit_inline
def _whole(values: FloatArray, is_smooth: BoolArray, j: int) -> float:
    """Return the mean of `values` over the cell before node j, by the trapezium rule with a correction for curvature.

    The correction uses the mean of the curvatures at the two ends of the cell. The curvature at an end is known only if
    the values at both neighbours of this node are smooth (see `StepWorkspace`). If neither curvature is known, there is
    no correction.
    """
    n, bend, ends = values.size, 0.0, 0
    for i in (j - 1, j):
        if is_smooth[i - 1] and is_smooth[(i + 1) % n]:
            bend += values[i - 1] - 2 * values[i] + values[(i + 1) % n]
            ends += 1
    return float(0.5 * (values[j - 1] + values[j]) - bend / (12 * max(ends, 1)))


@jit_inline
def _limit(inner: float, outer: float, place: float, gap: float) -> float:
    """Return the distance between the edge of contact and the element in contact, in cells.

    `inner` and `outer` are the gaps of the elements in contact and out of contact. `place` and `gap` are entries of
    `Edges`.
    """
    if place < 0:
        inner = max(inner, 0.0)
        return inner / (inner - outer) if outer < 0 else 1.0
    return place + (1 - place) * np.sqrt(max(1 - outer / gap, 0.0)) if gap < 0 else place


@jit_inline
def _cell(
    j: int, gaps: FloatArray, force: FloatArray, touching: BoolArray, edges: Edges, keep: bool
) -> tuple[float, float]:
    """Return where contact starts and ends in the cell before element j, as positions from 0 to 1.

    Both positions are 0 if the force is positive at neither end of the cell. If `keep` is True, the edge of this cell
    in `edges` is deleted if both elements are in contact or both are free, and is updated if the force vanishes in the
    part of the cell that is in contact.
    """
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
def _forces(state: State, workspace: StepWorkspace, first: int, keep: bool) -> tuple[float, float, float]:
    """Return mean load, mean drag and the fraction of the line in contact.

    Edges are deleted in cells between two free elements, and in the cell before the element `first`. If `keep` is True,
    all other edges are updated.
    """
    force, power, slope, gaps = workspace.force, workspace.power, workspace.slope, workspace.gaps
    n, touching, edges = force.size, state.touching, state.edges
    load, drag, length = 0.0, 0.0, 0.0
    for j in range(n):
        if j == first or not (touching[j - 1] or touching[j]):
            edges.place[j] = -1.0
            continue
        low, high = _cell(j, gaps, force, touching, edges, keep)
        width, middle = high - low, 0.5 * (low + high)
        if width >= 1:
            load += _whole(force, workspace.is_smooth, j)
            drag += _whole(power, workspace.is_smooth, j)
            length += 1
        elif width > 0:
            rise, bend = force[j] - force[j - 1], slope[j] - slope[j - 1]
            f, s = force[j - 1] + rise * middle, slope[j - 1] + bend * middle
            load += width * f
            drag += width * (f * s + width * width / 12 * rise * bend)
            length += width
    return load / n, drag / n, length / n


@jit
def _pressing_rate(state: State, workspace: StepWorkspace, weight: float, deborah: float) -> float:
    """Return the smallest rate of the depth at which no element in contact has a negative force."""
    rate, pulls, slope = -np.inf, workspace.pulls, workspace.slope
    for j in range(pulls.size):
        if state.touching[j]:
            rate = max(rate, -pulls[j] / weight - deborah * slope[j])
    return rate


@jit
def _carrying_rate(
    state: State, workspace: StepWorkspace, weight: float, rate: float, drive: Drive
) -> tuple[float, float, float]:
    """Return (1) the `rate` at which the elements carry the load, (2) the drag and (3) the fraction of the line in
    contact.

    The force of an element pressed to the line is `pulls` plus `weight` times ``rate + deborah * slope``. With a
    dashpot, `weight` is the viscosity and `rate` is the rate of the depth. Without a dashpot, `weight` is the glass
    modulus, `rate` is a correction of the depth, and `deborah` is 0. The edges of contact are written to `state`.
    """
    force, power, slope, pulls = workspace.force, workspace.power, workspace.slope, workspace.pulls
    drag, length = 0.0, 0.0
    for _ in range(MOST_ITERATIONS):
        for j in range(force.size):
            force[j] = pulls[j] + weight * (rate + drive.deborah * slope[j])
            power[j] = force[j] * slope[j]
        carried, drag, length = _forces(state, workspace, drive.first, False)
        if abs(carried - drive.load) <= CLOSE * drive.load:
            break
        if length > 0:
            rate += (drive.load - carried) / (length * weight)
        else:
            rate = max(rate, _pressing_rate(state, workspace, weight, drive.deborah)) + drive.load / weight
    _forces(state, workspace, drive.first, True)
    return rate, drag, length


DRAG, DEPTH, CONTACT = range(3)


class State(NamedTuple):
    """State of all elements at one instant: displacement u, strains of the dashpots of the Prony terms, contact or not.

    `free` and `free_terms` are the displacement and the strains that an element in contact would have if it had stayed
    free. During contact, they are updated only if the solid has a dashpot. For a free element, `free` is the
    displacement, and `free_terms` is not used.
    """

    displacement: FloatArray
    terms: FloatArray
    free: FloatArray
    free_terms: FloatArray
    touching: BoolArray
    edges: Edges


@jit
def mean_after(solid: Foundation, state: State, load: float, next_load: float, step: float, modes: FloatArray) -> float:
    """Return the mean displacement after a time step. The set of elements in contact does not affect this mean."""
    n, extra = state.displacement.size, 1 if solid.viscosity > 0 else 0
    count, terms = solid.rates.size, solid.times.size
    inward, strain, mean = solid.inward, state.terms, state.displacement.sum() / n
    for k in range(count):
        modes[k] = inward[k, 0] * mean if extra else 0.0
    for m in range(terms):
        total = 0.0
        for j in range(n):
            total += strain[j, m]
        for k in range(count):
            modes[k] += inward[k, m + extra] * total / n
    for k in range(count):
        z = solid.rates[k] * step
        one = -np.expm1(-z) / z
        late = (1 - one) / z if z > 1e-3 else 0.5 - z / 6 + z * z / 24
        modes[k] = modes[k] * np.exp(-z) + solid.push[k] * step * (load * (one - late) + next_load * late)
    glass, total = 1.0, 0.0
    if extra:
        for k in range(count):
            total += solid.outward[0, k] * modes[k]
        return total
    for m in range(terms):
        glass += solid.moduli[m]
        for k in range(count):
            total += solid.moduli[m] * solid.outward[m, k] * modes[k]
    return (next_load + total) / glass


@jit
def _load_instantly(
    solid: Foundation, state: State, under: FloatArray, load: float, depth: float
) -> tuple[float, bool]:
    """Apply a load suddenly to elements without a dashpot. Return the depth, and whether the depth was found."""
    n, mean = under.size, 0.0
    for j in range(n):
        state.free[j] = at_rest(solid, state.terms, j)
        mean += state.free[j] / n
    depth, good = depth_for(under, state.free, mean + load / (1.0 + solid.moduli.sum()), depth)
    for j in range(n):
        state.touching[j] = depth + under[j] > state.free[j]
        state.displacement[j] = max(depth + under[j], state.free[j])
    return depth, good


@jit
def _renew(state: State, old: int, new: int) -> None:
    """Replace elements that have left the line by undeformed elements."""
    n = state.displacement.size
    for j in range(n):
        if (j + old) // n != (j + new) // n:
            state.displacement[j] = state.free[j] = 0.0
            state.terms[j, :] = 0.0
            state.edges.place[j] = -1.0
            state.touching[j] = False


class Schedule(NamedTuple):
    """Travel, velocity and load at the instants of a loading history, shape (instants,) each.

    Velocity and load may jump at the first time. Travel and velocity are divided by L, and may be negative. Loads are
    F_N / (4 G_inf L). Loads are positive, and vary linearly between the instants.
    """

    instants: FloatArray
    travels: FloatArray
    deborahs: FloatArray
    loads: FloatArray


class StepWorkspace(NamedTuple):
    """Work arrays of one time step, with one entry per element. `after_terms` has one row per element.

    `under` and `slope` are height and slope of the line at the end of the time step. `old_under` and `old_slope` are
    height and slope at the start. `after` is the displacement without contact at the end of the time step. `parts` and
    `leaves` are results of :func:`release`. If the solid has a dashpot, `gaps` is depth + h minus the displacement that
    an element would have without contact. Otherwise, `gaps` is a copy of `pulls`. `pulls` is the force of spring and
    Prony terms of an element that follows the line. `force` is the total force of this element, and `power` is the
    product of total force and slope. `is_smooth` is True for elements in contact, and for all elements of a solid
    without Prony terms. With Prony terms, `force` has a kink at the edges of contact.
    """

    under: FloatArray
    slope: FloatArray
    old_under: FloatArray
    old_slope: FloatArray
    after: FloatArray
    after_terms: FloatArray
    parts: FloatArray
    leaves: FloatArray
    gaps: FloatArray
    pulls: FloatArray
    force: FloatArray
    power: FloatArray
    is_smooth: BoolArray


@jit
def _workspace_for(solid: Foundation, n: int) -> StepWorkspace:
    a, terms = np.empty((11, n)), np.empty((n, solid.times.size))
    is_smooth = np.empty(n, np.bool_)
    return StepWorkspace(a[0], a[1], a[2], a[3], a[4], terms, a[5], a[6], a[7], a[8], a[9], a[10], is_smooth)


@jit
def _separate(
    solid: Foundation,
    state: State,
    workspace: StepWorkspace,
    lapse: Lapse,
    old_depth: float,
    depth: float,
    deborah: tuple[float, float],
) -> None:
    """Write `parts`, `leaves` and `after` of `StepWorkspace` for elements that separate during a step."""
    parts, leaves, fall = workspace.parts, workspace.leaves, (depth - old_depth) / lapse.time
    for j in range(workspace.under.size):
        if state.touching[j]:
            u, before, w = state.displacement[j], parts[j], depth + workspace.under[j]
            rise0 = fall + deborah[0] * workspace.old_slope[j]
            rise1 = fall + deborah[1] * workspace.slope[j]
            parts[j], leaves[j] = release(solid, lapse, u, w, rise0, rise1, state.terms, j)
            if parts[j] < 1 or before < 1:
                part = parts[j] if parts[j] < 1 else 0.0
                workspace.after[j] = free_after(solid, lapse, u, part, leaves[j], state.terms, j)


@jit
def _move(
    solid: Foundation, state: State, workspace: StepWorkspace, lapse: Lapse, old_depth: float, depth: float
) -> None:
    u, touching, after = state.displacement, state.touching, workspace.after
    for j in range(workspace.under.size):
        was = touching[j]
        if not was:
            state.free[j] = after[j]
            for m in range(solid.times.size):
                state.free_terms[j, m] = workspace.after_terms[j, m]
        elif solid.viscosity > 0:
            state.free[j] = recover(solid, state.free[j], state.free_terms, j, lapse.decay, lapse.modes)
        w0, w1 = old_depth + workspace.old_under[j], depth + workspace.under[j]
        if not was and w1 <= after[j]:  # the displacement after free recovery is already known
            u[j] = after[j]
            for m in range(solid.times.size):
                state.terms[j, m] = workspace.after_terms[j, m]
            continue
        part, leaves = workspace.parts[j], workspace.leaves[j]
        u[j], touching[j] = advance(solid, lapse, w0, w1, u[j], was, part, leaves, after[j], state.terms, j)
        if not touching[j]:
            state.free[j] = u[j]


@jit
def _step(
    solid: Foundation,
    state: State,
    workspace: StepWorkspace,
    lapse: Lapse,
    mean: float,
    old_depth: float,
    guess: float,
    deborah: tuple[float, float],
) -> tuple[float, bool]:
    """Move all elements through a time step. Return the depth at the end, and whether this depth was found.

    `mean` is the mean displacement at the end of the time step. `deborah` contains the velocities of `Schedule` at the
    start and at the end.
    """
    for j in range(workspace.under.size):
        workspace.parts[j] = 1.0 if state.touching[j] else 0.0
        for m in range(solid.times.size):
            workspace.after_terms[j, m] = state.terms[j, m]
        workspace.after[j] = recover(solid, state.displacement[j], workspace.after_terms, j, lapse.decay, lapse.modes)
    depth, good = depth_for(workspace.under, workspace.after, mean, guess)
    if good:  # correct the times of separation and the depth once
        _separate(solid, state, workspace, lapse, old_depth, depth, deborah)
        depth, good = depth_for(workspace.under, workspace.after, mean, depth)
    if good:
        _move(solid, state, workspace, lapse, old_depth, depth)
    return depth, good


@jit
def forces_now(
    solid: Foundation, state: State, workspace: StepWorkspace, depth: float, rate: float, drive: Drive
) -> tuple[float, float, float, float]:
    """Return the depth, the rate of the depth, the drag and the fraction of the line in contact.

    The edges of contact are written to `state`. If the solid has a dashpot, the rate of the depth is corrected until
    the elements carry the load. If the solid has no dashpot, the depth is corrected instead.
    """
    gaps, pulls = workspace.gaps, workspace.pulls
    for j in range(workspace.under.size):
        w = depth + workspace.under[j]
        pulls[j] = pull(solid, w, state.terms, j)
        gaps[j] = w - state.free[j] if solid.viscosity > 0 else pulls[j]
        workspace.is_smooth[j] = state.touching[j] or solid.times.size == 0
    if solid.viscosity > 0:
        rate, drag, length = _carrying_rate(state, workspace, solid.viscosity, rate, drive)
        return depth, rate, drag, length
    still = Drive(0.0, drive.load, drive.first)
    more, drag, length = _carrying_rate(state, workspace, 1 + solid.moduli.sum(), 0.0, still)
    return depth + more, rate, drag, length


@jit
def follow_elements(
    solid: Foundation, line: CubicLine, schedule: Schedule, state: State, depth: float, out: FloatArray
) -> int:
    """March all elements through the time steps. Return an `Outcome`.

    `out`, shape (3, instants), receives the drag, the depth, and the fraction of the line in contact.
    """
    instants, travels, deborahs, loads = schedule
    workspace, modes = _workspace_for(solid, line.height.size - 1), np.empty(solid.rates.size)
    shift, rate = under_elements(line, travels[0], workspace.under, workspace.slope), 0.0
    if solid.viscosity == 0:
        depth, good = _load_instantly(solid, state, workspace.under, loads[0], depth)
        if not good:
            return Outcome.DEPTH_NOT_FOUND
    for now in range(instants.size):
        if now > 0:
            time = instants[now] - instants[now - 1]
            workspace.old_under[:] = workspace.under
            workspace.old_slope[:] = workspace.slope
            old_depth, old_shift = depth, shift
            shift = under_elements(line, travels[now], workspace.under, workspace.slope)
            if not line.periodic and shift != old_shift:
                _renew(state, old_shift, shift)
            lapse = lapse_of(solid, time)
            mean = mean_after(solid, state, loads[now - 1], loads[now], time, modes)
            both = deborahs[now - 1], deborahs[now]
            depth, good = _step(solid, state, workspace, lapse, mean, old_depth, depth + rate * time, both)
            if not good:
                return Outcome.DEPTH_NOT_FOUND
            if solid.viscosity == 0:
                rate = (depth - old_depth) / time
        first = -1 if line.periodic else (-shift) % workspace.under.size
        if not line.periodic and (state.touching[first] or state.touching[first - 1]):
            return Outcome.OUTSIDE_LINE
        drive = Drive(deborahs[now], loads[now], first)
        exact, rate, drag, length = forces_now(solid, state, workspace, depth, rate, drive)
        if length <= 0 and now > 0 and drive.load > 0:  # a loaded body must be in contact
            return Outcome.DEPTH_NOT_FOUND
        out[DRAG, now], out[DEPTH, now], out[CONTACT, now] = drag, exact, length
    return Outcome.CONVERGED


@jit
def note_edges(solid: Foundation, line: CubicLine, state: State, depth: float, deborah: float, load: float) -> None:
    """Write the edges of contact of a steady state to `state`."""
    workspace = _workspace_for(solid, line.height.size - 1)
    under_elements(line, 0.0, workspace.under, workspace.slope)
    forces_now(solid, state, workspace, depth, 0.0, Drive(deborah, load, -1 if line.periodic else 0))
