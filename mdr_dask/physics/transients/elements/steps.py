"""All elements of a viscoelastic foundation through the moments of a loading history.

Units: the static modulus is 1, heights are in any unit, lengths in that of the line, times in one time of the material.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces.cubic_line import CubicLine
from mdr_dask.physics.transients.elements.edges import Contact, Drive, Edges, carrying_rate, depth_for, under_elements
from mdr_dask.physics.transients.elements.foundation import (
    ElementWorkspace,
    Foundation,
    Lapse,
    Release,
    Rise,
    advance,
    at_rest,
    element_workspace,
    fading,
    free_after,
    pull,
    recover,
    release,
    stored,
)

DRAG, DEPTH, RATE, CONTACT, STORED, WORK, DISSIPATED = range(7)
ROWS = 7
CORRECTIONS = 2  # of the times of separation and the depth within a step


class State(NamedTuple):
    """All elements at one moment.

    Parameters
    ----------
    displacement, arms : array, shape (n,) and (n, arms)
        u, and the strain of the arms.
    free, free_arms : array, shape (n,) and (n, arms)
        The same without contact; `free_arms` is valid only for elements in contact.
    touching : array, shape (n,)
        Whether in contact.
    edges : Edges
    """

    displacement: FloatArray
    arms: FloatArray
    free: FloatArray
    free_arms: FloatArray
    touching: BoolArray
    edges: Edges


@jit
def mean_after(solid: Foundation, state: State, load: float, next_load: float, step: float, modes: FloatArray) -> float:
    """Return the mean displacement after a step: the load decides it, whatever is in contact."""
    n, extra = state.displacement.size, 1 if solid.viscosity > 0 else 0
    count, arms = solid.rates.size, solid.times.size
    inward, strain, mean = solid.inward, state.arms, state.displacement.sum() / n
    for k in range(count):
        modes[k] = inward[k, 0] * mean if extra else 0.0
    for m in range(arms):
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
    for m in range(arms):
        glass += solid.moduli[m]
        for k in range(count):
            total += solid.moduli[m] * solid.outward[m, k] * modes[k]
    return (next_load + total) / glass


@jit
def _instant(
    solid: Foundation, state: State, under: FloatArray, load: float, depth: float
) -> tuple[float, float, bool]:
    """Load elements without a dashpot at once; return the depth, the work, all of which is stored, and success."""
    n = under.size
    mean, work, glass = 0.0, 0.0, 1.0 + solid.moduli.sum()
    for j in range(n):
        state.free[j] = at_rest(solid, state.arms, j)
        mean += state.free[j] / n
    depth, good = depth_for(under, state.free, mean + load / glass, depth)
    for j in range(n):
        before = stored(solid, state.displacement[j], state.arms, j)
        w = depth + under[j]
        state.touching[j] = w > state.free[j]
        state.displacement[j] = max(w, state.free[j])
        work += stored(solid, state.displacement[j], state.arms, j) - before
    return depth, work / n, good


@jit
def _forget(solid: Foundation, state: State, old: int, new: int) -> float:
    """Replace elements that have left the line by undeformed ones; return the energy that they will dissipate."""
    n, dissipated = state.displacement.size, 0.0
    for j in range(n):
        if (j + old) // n != (j + new) // n:
            dissipated += stored(solid, state.displacement[j], state.arms, j)
            state.displacement[j] = state.free[j] = 0.0
            state.arms[j, :] = 0.0
            state.edges.place[j] = -1.0
            state.touching[j] = False
    return dissipated / n


class Schedule(NamedTuple):
    """Travel, velocity and load at the moments of a loading history, shape (moments,) each.

    Parameters
    ----------
    moments : array
        Times, increasing, in the unit of the solid. Velocity and load may jump at the first one.
    travels, deborahs : array
        Distance travelled over L, and its derivative, of either sign.
    loads : array
        F_N / (4 G_inf L), positive; linear between the moments.
    """

    moments: FloatArray
    travels: FloatArray
    deborahs: FloatArray
    loads: FloatArray


class Step(NamedTuple):
    """Duration of a step, the depth at its start, and v tau / L at its start and end."""

    time: float
    depth: float
    deborah: float
    next_deborah: float


class StepWorkspace(NamedTuple):
    """Arrays of one step: heights and slopes over the elements at its end and start, displacements at the end without
    contact, times and places of separation, gaps and forces, and the decay over the whole step.
    """

    under: FloatArray
    slope: FloatArray
    old_under: FloatArray
    old_slope: FloatArray
    after: FloatArray
    after_arms: FloatArray
    parts: FloatArray
    leaves: FloatArray
    gaps: FloatArray
    pulls: FloatArray
    force: FloatArray
    power: FloatArray
    decay: FloatArray
    fades: FloatArray
    element: ElementWorkspace


@jit
def _workspace_for(solid: Foundation, n: int) -> StepWorkspace:
    rows = np.empty((11, n))
    return StepWorkspace(
        rows[0],
        rows[1],
        rows[2],
        rows[3],
        rows[4],
        np.empty((n, solid.times.size)),
        rows[5],
        rows[6],
        rows[7],
        rows[8],
        rows[9],
        rows[10],
        np.empty(solid.rates.size),
        np.empty(solid.times.size),
        element_workspace(solid),
    )


@jit
def _separate(solid: Foundation, state: State, workspace: StepWorkspace, step: Step, depth: float) -> None:
    """Write which elements separate within a step that ends at a depth, and their displacements at its end."""
    plain, damping, fall = solid.times.size == 0, solid.viscosity, (depth - step.depth) / step.time
    lapse = Lapse(step.time, workspace.decay, workspace.fades, workspace.element)
    for j in range(workspace.under.size):
        if not state.touching[j]:
            continue
        u, w1 = state.displacement[j], depth + workspace.under[j]
        rise0, rise1 = fall + step.deborah * workspace.old_slope[j], fall + step.next_deborah * workspace.slope[j]
        if plain and u + damping * rise0 > 0 and w1 + damping * rise1 >= 0:
            workspace.parts[j], workspace.leaves[j], workspace.after[j] = 1.0, w1, u * workspace.decay[0]
            continue
        part, leaves = release(solid, lapse, Rise(u, w1, rise0, rise1), state.arms, j)
        if part < 1 or workspace.parts[j] < 1:
            workspace.after[j] = free_after(solid, lapse, u, part if part < 1 else 0.0, leaves, state.arms, j)
        workspace.parts[j], workspace.leaves[j] = part, leaves


@jit
def _move(solid: Foundation, state: State, workspace: StepWorkspace, step: Step, depth: float) -> tuple[float, float]:
    """Move all elements through a step; return mean work and dissipation."""
    n, plain, damping = workspace.under.size, solid.times.size == 0, solid.viscosity
    u, touching, after = state.displacement, state.touching, workspace.after
    lapse = Lapse(step.time, workspace.decay, workspace.fades, workspace.element)
    work, dissipated = 0.0, 0.0
    for j in range(n):
        w0, w1, was = step.depth + workspace.old_under[j], depth + workspace.under[j], touching[j]
        if not was:
            state.free[j] = after[j]
            for m in range(solid.times.size):
                state.free_arms[j, m] = workspace.after_arms[j, m]
        elif plain:
            state.free[j] *= workspace.decay[0]
        elif damping > 0:
            state.free[j] = recover(solid, state.free[j], state.free_arms, j, workspace.decay, workspace.element.modes)
        if not was and w1 <= after[j]:
            if plain:
                dissipated += 0.5 * (u[j] * u[j] - after[j] * after[j])
            else:
                dissipated += stored(solid, u[j], state.arms, j) - stored(solid, after[j], workspace.after_arms, j)
            u[j] = after[j]
            for m in range(solid.times.size):
                state.arms[j, m] = workspace.after_arms[j, m]
            continue
        if was and plain and w1 > after[j]:
            gone = damping * (w1 - u[j]) ** 2 / step.time
            work += 0.5 * (w1 * w1 - u[j] * u[j]) + gone
            dissipated += gone
            u[j] = w1
            continue
        separation = Release(workspace.parts[j], workspace.leaves[j], after[j])
        u[j], touching[j], done, gone = advance(solid, lapse, (w0, w1), (u[j], was), separation, state.arms, j)
        if not touching[j]:
            state.free[j] = u[j]
        work += done
        dissipated += gone
    return work / n, dissipated / n


@jit
def _step(
    solid: Foundation,
    state: State,
    workspace: StepWorkspace,
    step: Step,
    mean: float,
    guess: float,
) -> tuple[float, float, float, bool]:
    """Move all elements through a step to a mean displacement; return depth, work, dissipation, and success."""
    plain = solid.times.size == 0
    for j in range(workspace.under.size):
        workspace.parts[j] = 1.0 if state.touching[j] else 0.0
        if plain:
            workspace.after[j] = state.displacement[j] * workspace.decay[0]
            continue
        for m in range(solid.times.size):
            workspace.after_arms[j, m] = state.arms[j, m]
        workspace.after[j] = recover(
            solid, state.displacement[j], workspace.after_arms, j, workspace.decay, workspace.element.modes
        )
    depth = guess
    for _ in range(CORRECTIONS):
        depth, good = depth_for(workspace.under, workspace.after, mean, depth)
        if not good:
            return depth, 0.0, 0.0, False
        _separate(solid, state, workspace, step, depth)
    depth, good = depth_for(workspace.under, workspace.after, mean, depth)
    if not good:
        return depth, 0.0, 0.0, False
    work, dissipated = _move(solid, state, workspace, step, depth)
    return depth, work, dissipated, True


@jit
def _state_energy(solid: Foundation, state: State) -> float:
    energy, n = 0.0, state.displacement.size
    if solid.times.size == 0:
        for j in range(n):
            energy += 0.5 * state.displacement[j] * state.displacement[j] / n
        return energy
    for j in range(n):
        energy += stored(solid, state.displacement[j], state.arms, j) / n
    return energy


@jit
def forces_now(
    solid: Foundation, state: State, workspace: StepWorkspace, depth: float, rate: float, drive: Drive
) -> tuple[float, float, float, float]:
    """Return the depth and its rate at which the load is carried, drag and fraction in contact; write the edges.

    Without a dashpot the depth follows from the load here, because the depth from the mean displacement is only as
    exact as a sum over the elements.
    """
    plain = solid.times.size == 0
    for j in range(workspace.under.size):
        w = depth + workspace.under[j]
        workspace.pulls[j] = w if plain else pull(solid, w, state.arms, j)
        workspace.gaps[j] = w - state.free[j] if solid.viscosity > 0 else workspace.pulls[j]
    contact = Contact(
        workspace.gaps,
        workspace.pulls,
        workspace.slope,
        workspace.force,
        workspace.power,
        state.touching,
        state.edges,
    )
    if solid.viscosity > 0:
        rate, drag, length = carrying_rate(contact, solid.viscosity, rate, drive)
        return depth, rate, drag, length
    still = Drive(0.0, drive.load, drive.first)
    more, drag, length = carrying_rate(contact, 1 + solid.moduli.sum(), 0.0, still)
    return depth + more, rate, drag, length


@jit
def follow_elements(
    solid: Foundation,
    line: CubicLine,
    schedule: Schedule,
    state: State,
    depth: float,
    out: FloatArray,
) -> int:
    """March all elements through the moments and write `out`, shape (ROWS, moments)."""
    moments, travels, deborahs, loads = schedule
    n = line.height.size - 1
    workspace, modes = _workspace_for(solid, n), np.empty(solid.rates.size)
    shift = under_elements(line, travels[0], workspace.under, workspace.slope)
    rate, work, dissipated = 0.0, 0.0, 0.0
    if solid.viscosity == 0:
        depth, work, good = _instant(solid, state, workspace.under, loads[0], depth)
        if not good:
            return Outcome.DEPTH_NOT_FOUND
    for now in range(moments.size):
        if now > 0:
            time = moments[now] - moments[now - 1]
            workspace.old_under[:] = workspace.under
            workspace.old_slope[:] = workspace.slope
            old_depth, old_shift = depth, shift
            shift = under_elements(line, travels[now], workspace.under, workspace.slope)
            if not line.periodic and shift != old_shift:
                dissipated += _forget(solid, state, old_shift, shift)
            fading(solid, time, workspace.decay, workspace.fades)
            mean = mean_after(solid, state, loads[now - 1], loads[now], time, modes)
            step = Step(time, old_depth, deborahs[now - 1], deborahs[now])
            depth, done, gone, good = _step(solid, state, workspace, step, mean, depth + rate * time)
            if not good:
                return Outcome.DEPTH_NOT_FOUND
            work, dissipated = work + done, dissipated + gone
            if solid.viscosity == 0:
                rate = (depth - old_depth) / time
        first = -1 if line.periodic else (-shift) % n
        if not line.periodic and (state.touching[first] or state.touching[(first - 1) % n]):
            return Outcome.OUTSIDE_LINE
        drive = Drive(deborahs[now], loads[now], first)
        exact, rate, drag, length = forces_now(solid, state, workspace, depth, rate, drive)
        if length <= 0 and now > 0 and drive.load > 0:  # elements with a dashpot carry load at once
            return Outcome.DEPTH_NOT_FOUND
        out[DRAG, now], out[DEPTH, now], out[RATE, now], out[CONTACT, now] = drag, exact, rate, length
        out[STORED, now], out[WORK, now], out[DISSIPATED, now] = _state_energy(solid, state), work, dissipated
    return Outcome.CONVERGED


@jit
def note_edges(solid: Foundation, line: CubicLine, state: State, depth: float, deborah: float, load: float) -> None:
    """Write the edges of contact in a steady state."""
    workspace = _workspace_for(solid, line.height.size - 1)
    under_elements(line, 0.0, workspace.under, workspace.slope)
    forces_now(solid, state, workspace, depth, 0.0, Drive(deborah, load, -1 if line.periodic else 0))
