"""Friction under any course of velocity and load: every element followed in time, at second order in the step.

This is the general and slow way; a single jump on a periodic line is solved by `velocity_jump`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces.shapes import Shape
from mdr_dask.physics.transients.elements.edges import Edges, Line, under_elements
from mdr_dask.physics.transients.elements.foundation import KELVIN, Foundation
from mdr_dask.physics.transients.elements.steps import (
    ROWS,
    Schedule,
    State,
    follow_elements,
    mean_after,
    note_edges,
    orbit,
)

TURNS = 3000  # of an element around the line before it is as it was
STEADY = 1e-14  # of the depth at the start
NEARLY = 1e-6  # of the load: what the steady state at the start may miss
TOUCHING = 1e-12  # of its height: what touches but for rounding


class Response(NamedTuple):
    """State at every moment of a protocol, energies in height squared.

    Parameters
    ----------
    drag, depth, rate, contact : array, shape (moments,)
        F_x / (4 G L) in the unit of height squared over length; depth; its derivative by t / tau; fraction in contact.
    stored : array, shape (moments,)
        Energy stored over 4 G L.
    work, lost : array, shape (moments,)
        Work done on the elements and energy lost since the first moment, over 4 G L; their difference is what the
        stored energy has grown by, but for rounding. An element that leaves a line that does not close counts with
        all that it will lose.
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
    lost: FloatArray
    displacement: FloatArray
    status: Outcome
    state: State


def closed_nodes(height: FloatArray, slope: FloatArray) -> Line:
    """Return a periodic line of unit length from heights and slopes at its n nodes."""
    return Line(np.append(height, height[0]), np.append(slope, slope[0]), True)


def indented_nodes(height: FloatArray, slope: FloatArray, body: Shape) -> Line:
    """Return the line of a rough indenter, which does not close.

    Parameters
    ----------
    height, slope : array, shape (n + 1,)
        The roughness and its derivative at the nodes of a line of unit length, both ends included.
    body : Shape
        What is under the roughness, its tip at node n // 2. The kink of a cone is rounded over one cell.
    """
    n = height.size - 1
    smooth, left, right = body.at((np.arange(n + 1) - n // 2) / n)
    return Line(height + smooth, slope + 0.5 * (left + right), False)


def untouched(elements: int, arms: int) -> State:
    """Return elements that have never been touched."""
    edges = Edges(np.full(elements, -1.0), np.zeros(elements))
    strains = np.zeros((2, elements, arms))
    touching = np.zeros(elements, np.bool_)
    return State(np.zeros(elements), strains[0], np.zeros(elements), strains[1], touching, edges)


def _copy(state: State) -> State:
    """Return a state that may be moved on."""
    return State(
        state.displacement.copy(),
        state.arms.copy(),
        state.free.copy(),
        state.free_arms.copy(),
        state.touching.copy(),
        Edges(state.edges.place.copy(), state.edges.gap.copy()),
    )


def steady_start(line: Line, solid: Foundation, deborah: float, load: float) -> tuple[State, float, Outcome]:
    """Return the steady state of the elements at the nodes, sliding at constant speed under a constant load.

    One element is carried around the line until it comes back as it was, in steps of half a cell by the method of
    :func:`follow_line`; the depth is the root of a mean displacement that increases with it. At ``deborah = 0`` the
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


def _halved(line: Line) -> Line:
    """Return the same cubic line with a node more in the middle of every cell."""
    n = line.height.size - 1
    height, slope = np.empty(2 * n + 1), np.empty(2 * n + 1)
    height[::2], slope[::2] = line.height, line.slope
    height[1::2] = 0.5 * (line.height[:-1] + line.height[1:]) - np.diff(line.slope) / (8 * n)
    slope[1::2] = 1.5 * n * np.diff(line.height) - 0.25 * (line.slope[:-1] + line.slope[1:])
    return Line(height, slope, line.periodic)


def _resting(line: Line, state: State, depth: float) -> float:
    """Fill all elements of a body at rest; return the load."""
    w = depth + line.height[:-1]
    state.displacement[:] = np.maximum(w, 0)
    state.arms[:] = state.displacement[:, None]
    state.free[:] = 0.0
    state.free_arms[:] = 0.0
    state.touching[:] = w > 0
    return float(state.displacement.mean())


def _sliding(line: Line, solid: Foundation, state: State, deborah: float, depth: float) -> float:
    """Fill all elements in the steady state at a depth; return the load that makes their mean what it is."""
    if depth + line.height[:-1].max() <= 0:
        return 0.0
    n = state.displacement.size
    good, last = orbit(solid, line, deborah, depth, state, TURNS)
    if not good:
        return np.nan
    step, modes = 1 / (n * deborah), np.empty(solid.rates.size)
    mean = float(state.displacement.mean()) + (0.0 if line.periodic else last / n)
    without = mean_after(solid, state, 0.0, 0.0, step, modes)
    return (mean - without) / (mean_after(solid, state, 1.0, 1.0, step, modes) - without)


def follow_line(
    line: Line,
    solid: Foundation,
    schedule: Schedule,
    state: State,
    depth: float,
) -> Response:
    """Follow every element of any linear foundation under any line through a course of velocity and load.

    Within a step an element in contact is moved at constant speed, one in flight recovers by the modes of the solid,
    and it is let go or touched inside the step where force or gap vanish. The total of the loads decides the mean
    displacement, whatever is in contact, so that the depth is the root of a convex sum.

    Parameters
    ----------
    line : Line
        From :func:`closed_nodes` or :func:`indented_nodes`; elements enter the latter undeformed.
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
    drag, depths, rate, contact, stored, work, lost = out
    return Response(drag, depths, rate, contact, stored, work, lost, now.displacement, Outcome(status), now)


def follow_kelvin(
    height: FloatArray,
    slope: FloatArray,
    schedule: Schedule,
    displacement: FloatArray,
    depth: float,
) -> Response:
    """Follow every element of a Kelvin foundation on a periodic line; time in tau.

    Parameters
    ----------
    height, slope : array, shape (n,)
        Profile of unit length, as in :func:`mdr_dask.physics.transients.patches.cubic_profile`.
    schedule : Schedule
        As in :func:`follow_line`; time in tau.
    displacement : array, shape (n,)
        Of every element at the first moment; the profile stands over element j at ``x_j + travel``.
    depth : float
        Depth at the first moment.
    """
    line = closed_nodes(height, slope)
    under, grade = np.empty(height.size), np.empty(height.size)
    under_elements(line, float(schedule.travels[0]), under, grade)
    w = depth + under
    touching = np.abs(w - displacement) < TOUCHING * (abs(depth) + np.abs(under) + displacement)
    u = np.where(touching, w, displacement)
    state = untouched(u.size, 0)._replace(displacement=u, free=u.copy(), touching=touching)
    return follow_line(line, KELVIN, schedule, state, depth)
