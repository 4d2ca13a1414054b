"""Friction under any loading history: every element followed in time, at second order in the step.

A single jump of a Kelvin body on a periodic line is solved much faster by `velocity_jump`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces.cubic_line import CubicLine
from mdr_dask.physics.transients.elements.edges import Edges
from mdr_dask.physics.transients.elements.foundation import (
    Foundation,
    Lapse,
    Release,
    Rise,
    advance,
    element_workspace,
    fading,
    free_after,
    recover,
    release,
)
from mdr_dask.physics.transients.elements.steps import (
    ROWS,
    Schedule,
    State,
    follow_elements,
    mean_after,
    note_edges,
)

PERIODS = 3000  # most periods of the line until an element repeats its state
STEADY = 1e-14  # part of the depth at the start: accuracy of the search
NEARLY = 1e-6  # part of the load that the steady state at the start may miss


class Response(NamedTuple):
    """State at every moment of a protocol, energies in height squared.

    Parameters
    ----------
    drag, depth, rate, contact : array, shape (moments,)
        F_x / (4 G L) in the unit of height squared over length; depth; its derivative by t / tau; fraction in contact.
    stored : array, shape (moments,)
        Energy stored over 4 G L.
    work, dissipated : array, shape (moments,)
        Work done on the elements and energy dissipated since the first moment, over 4 G L. Their difference is the
        increase of the stored energy, within rounding. An element that leaves a line that is not periodic counts with
        all that it will dissipate.
    displacement : array, shape (n,)
        Of every element at the end.
    status : Outcome
    state : State
        Of every element at the end, for going on from there.
    """

    drag: FloatArray
    depth: FloatArray
    rate: FloatArray
    contact: FloatArray
    stored: FloatArray
    work: FloatArray
    dissipated: FloatArray
    displacement: FloatArray
    status: Outcome
    state: State


def untouched(elements: int, arms: int) -> State:
    """Return elements that have never been in contact."""
    edges = Edges(np.full(elements, -1.0), np.zeros(elements))
    strains = np.zeros((2, elements, arms))
    touching = np.zeros(elements, np.bool_)
    return State(np.zeros(elements), strains[0], np.zeros(elements), strains[1], touching, edges)


def _copy(state: State) -> State:
    """Return a copy of a state."""
    return State(
        state.displacement.copy(),
        state.arms.copy(),
        state.free.copy(),
        state.free_arms.copy(),
        state.touching.copy(),
        Edges(state.edges.place.copy(), state.edges.gap.copy()),
    )


def steady_start(line: CubicLine, solid: Foundation, deborah: float, load: float) -> tuple[State, float, Outcome]:
    """Return the steady state of the elements at the nodes, sliding at constant speed under a constant load.

    One element is carried around the line until its state repeats, in steps of half a cell by the method of
    :func:`follow_line`. The depth is the root of the mean displacement, which increases with it. At ``deborah = 0`` the
    elements have rested under the load for ever.

    Returns
    -------
    state : State
    depth : float
    status : Outcome
    """
    n, arms = line.height.size - 1, solid.times.size
    state = untouched(n, arms)
    carrier = _halved(line) if deborah > 0 else line
    low = -float(carrier.height[:-1].max())

    def excess(depth: float) -> float:
        carried = _sliding(carrier, solid, state, deborah, depth) if deborah > 0 else _resting(line, state, depth)
        return carried / load - 1

    width = load
    while (found := excess(low + width)) < 0:
        low, width = low + width, 2 * width
    if not np.isfinite(found):
        return state, np.nan, Outcome.DEPTH_NOT_FOUND
    depth = brentq(excess, low, low + width, xtol=1e-15 * width, rtol=STEADY)
    if not abs(excess(depth)) < NEARLY:
        return state, depth, Outcome.DEPTH_NOT_FOUND
    outside = not line.periodic and bool(state.touching[0] or state.touching[-1])
    note_edges(solid, line, state, depth, deborah, load)
    return state, depth, Outcome.OUTSIDE_LINE if outside else Outcome.CONVERGED


def _halved(line: CubicLine) -> CubicLine:
    """Return the same line with an additional node in the middle of every cell."""
    n = line.enter.size
    height, enter, leave = np.empty(2 * n + 1), np.empty(2 * n), np.empty(2 * n)
    height[::2] = line.height
    height[1::2] = 0.5 * (line.height[:-1] + line.height[1:]) + (line.enter - line.leave) / 8
    enter[::2], leave[1::2] = line.enter / 2, line.leave / 2
    leave[::2] = enter[1::2] = 0.75 * np.diff(line.height) - (line.enter + line.leave) / 8
    return CubicLine(height, enter, leave, line.periodic, line.smooth)


def _resting(line: CubicLine, state: State, depth: float) -> float:
    """Write the state of all elements of a body at rest; return the load."""
    w = depth + line.height[:-1]
    state.displacement[:] = np.maximum(w, 0)
    state.arms[:] = state.displacement[:, None]
    state.free[:] = 0.0
    state.free_arms[:] = 0.0
    state.touching[:] = w > 0
    return float(state.displacement.mean())


def _sliding(line: CubicLine, solid: Foundation, state: State, deborah: float, depth: float) -> float:
    """Write the steady state of all elements at a depth; return the load that has their mean displacement."""
    if depth + line.height[:-1].max() <= 0:
        return 0.0
    n = state.displacement.size
    good, last = _orbit(solid, line, deborah, depth, state, PERIODS)
    if not good:
        return np.nan
    step, modes = 1 / (n * deborah), np.empty(solid.rates.size)
    mean = float(state.displacement.mean()) + (0.0 if line.periodic else last / n)
    without = mean_after(solid, state, 0.0, 0.0, step, modes)
    return (mean - without) / (mean_after(solid, state, 1.0, 1.0, step, modes) - without)


@jit
def _orbit(
    solid: Foundation, line: CubicLine, deborah: float, depth: float, state: State, periods: int
) -> tuple[bool, float]:
    """Carry one element along the line at constant depth until its state repeats, and write the state of all elements.

    The number of nodes may be a multiple of the number of elements. Return whether the state repeats, and the
    displacement at the end.
    """
    n = line.height.size - 1
    every, step = n // state.displacement.size, 1 / (n * deborah)
    lapse = Lapse(step, np.empty(solid.rates.size), np.empty(solid.times.size), element_workspace(solid))
    fading(solid, step, lapse.decay, lapse.fades)
    arms, free_arms, last = np.zeros((1, solid.times.size)), np.zeros((1, solid.times.size)), np.zeros(solid.times.size)
    top = int(np.argmax(line.height[:n])) if line.periodic else 0
    w0 = depth + line.height[top]
    u, touching = max(w0, 0.0), w0 > 0
    free = 0.0
    for _ in range(periods if line.periodic else 1):
        last[:] = arms[0]
        before = u
        for cell in range(n):
            i = (top + cell) % n
            if not touching:
                free = u
                free_arms[0][:] = arms[0]
            if i % every == 0:
                j = i // every
                state.displacement[j], state.touching[j], state.free[j] = u, touching, free
                state.arms[j][:] = arms[0]
                state.free_arms[j][:] = free_arms[0]
            w0, w1 = depth + line.height[i], depth + line.height[i + 1]
            part, leaves = 0.0, u
            if touching:
                rise = Rise(w0, w1, deborah * n * line.enter[i], deborah * n * line.leave[i])
                part, leaves = release(solid, lapse, rise, arms, 0)
            after = free_after(solid, lapse, u, part if part < 1 else 0.0, leaves, arms, 0)
            free = recover(solid, free, free_arms, 0, lapse.decay, lapse.workspace.modes)
            u, touching, _, _ = advance(solid, lapse, (w0, w1), (u, touching), Release(part, leaves, after), arms, 0)
        change = abs(u - before)
        for m in range(arms.size):
            change = max(change, abs(arms[0, m] - last[m]))
        if line.periodic and change <= 1e-13 * abs(u):
            return True, u
    return not line.periodic, u


def follow_line(
    line: CubicLine,
    solid: Foundation,
    schedule: Schedule,
    state: State,
    depth: float,
) -> Response:
    """Follow every element of any linear foundation under any line through a loading history.

    Within a step an element in contact moves at constant speed, and a free one recovers by the modes of the solid.
    Contact begins or ends inside the step, where gap or force vanish. The load decides the mean displacement, whatever
    is in contact, so that the depth is the root of a convex sum.

    Parameters
    ----------
    line : CubicLine
        Elements enter a line that is not periodic undeformed. Forces are linear between elements: a line
        :func:`~mdr_dask.physics.surfaces.cubic_line.without_kinks` is followed with the smallest error.
    solid : Foundation
    schedule : Schedule
        Travel, velocity and load at every moment.
    state, depth
        At the first moment, as :func:`steady_start` or an earlier `Response` gives them; left as they are.

    Returns
    -------
    Response
    """
    now = _copy(state)
    out = np.full((ROWS, schedule.moments.size), np.nan)
    status = follow_elements(solid, line, schedule, now, depth, out)
    drag, depths, rate, contact, stored, work, dissipated = out
    return Response(drag, depths, rate, contact, stored, work, dissipated, now.displacement, Outcome(status), now)
