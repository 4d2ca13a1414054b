"""The ends of a jump on one line: steady sliding before and after it, and the instant at which the velocity changes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.kelvin import SUMS as SWEEP_SUMS
from mdr_dask.physics.sliding.kelvin import Blocks, blocks_of, patches_at
from mdr_dask.physics.sliding.steady import steady_sliding
from mdr_dask.physics.surfaces.cubic_line import Cells, CubicLine, cut
from mdr_dask.physics.transients.patches import (
    DRAG,
    LENGTH,
    LOAD,
    SUMS,
    TILT,
    Barriers,
    Patches,
    Track,
    barriers_for,
    height_at,
    released,
    track_of,
)

NEWTON_STEPS = 60
EXACT, NEARLY = 1e-13, 1e-9  # of the load: where the search for the rate ends, and what it may miss


class Line(NamedTuple):
    """One line as the sweep takes it, and as the march does."""

    cells: Cells
    blocks: Blocks
    track: Track


def line_of(line: CubicLine) -> Line:
    """Return a periodic line prepared for both."""
    cells = cut(line)
    return Line(cells, blocks_of(cells), track_of(cells))


class Ends(NamedTuple):
    """The ends of jumps on one line, one entry for every case; drags are F_x / (4 G L) in height squared over length.

    Parameters
    ----------
    before, after : array, shape (cases,)
        Drag in steady sliding at v_1 and at v_2.
    at : array, shape (cases,)
        Drag right after the jump.
    rate, tilt : array, shape (cases,)
        Rate of the depth right after the jump, by t / tau, and the derivative of `at` by it.
    depth : array, shape (cases, 2)
        Depth before and long after.
    contact : array, shape (cases, 2)
        Fraction in contact there.
    outcome : array, shape (cases,)
    """

    before: FloatArray
    at: FloatArray
    after: FloatArray
    rate: FloatArray
    tilt: FloatArray
    depth: FloatArray
    contact: FloatArray
    outcome: NDArray[np.int8]

    def only(self, cases: NDArray[np.int64]) -> Ends:
        """Return some of the cases."""
        columns: list[Any] = [column[cases] for column in self]
        return Ends(*columns)

    def replaced(self, cases: NDArray[np.int64], other: Ends) -> Ends:
        """Return all cases, some of them from another solution."""
        columns: list[Any] = [column.copy() for column in self]
        for column, found in zip(columns, other, strict=True):
            column[cases] = found
        return Ends(*columns)


def ends_on(line: CubicLine, loads: FloatArray, deborah: FloatArray, near: Ends | None = None) -> Ends:
    """Solve the ends of jumps on one line.

    At the instant of a jump displacements and depth do not change, but the rate of the depth does, and elements whose
    force would be negative are let go.

    Parameters
    ----------
    line : CubicLine
        Periodic.
    loads : array, shape (cases,)
        F_N / (4 G L), in the unit of height.
    deborah : array, shape (cases, 2)
        v_1 tau / L and v_2 tau / L.
    near : Ends, optional
        On another grid, where the searches for the depth begin; the answer does not depend on it.
    """
    guesses = None if near is None else near.depth.ravel()
    steady = steady_sliding(line, deborah.ravel(), np.repeat(loads, 2), guesses)
    drag, depth, contact = (column.reshape(-1, 2) for column in (steady.drag, steady.depth, steady.contact_fraction))
    outcome = steady.status.reshape(-1, 2).max(axis=1)
    at, rate, tilt = np.full((3, loads.size), np.nan)
    good = np.flatnonzero(outcome == Outcome.CONVERGED)
    if good.size:
        prepared = line_of(line)
        n = prepared.track.cells
        barriers = barriers_for(prepared.track)
        for k in good:
            first = contact_before(prepared, depth[k, 0], deborah[k, 0] * n)
            barriers.block[:] = np.nan
            found = _release(prepared.track, first, barriers, deborah[k, 1] * n, loads[k] * n)
            at[k], rate[k], tilt[k], outcome[k] = found
    return Ends(drag[:, 0].copy(), at, drag[:, 1].copy(), rate, tilt, depth, contact, outcome)


def contact_before(line: Line, depth: float, deborah: float) -> Patches:
    """Return the patches of steady sliding at a depth of the line and a Deborah number in cells."""
    depth += line.cells.top
    start, end = patches_at(line.cells, line.blocks, deborah, depth, np.empty(SWEEP_SUMS))
    return Patches(start, end, _pressed(line.track, end, depth), start.size, depth, deborah, np.zeros(1, np.int64))


@njit(nogil=True, cache=True)
def _pressed(track: Track, end: FloatArray, depth: float) -> FloatArray:
    """Return the displacements with which elements leave patches."""
    pressed = np.empty(end.size)
    for k in range(end.size):
        pressed[k] = depth + height_at(track, end[k])[0]
    return pressed


@njit(nogil=True, cache=True)
def _release(
    track: Track, first: Patches, barriers: Barriers, deborah: float, load: float
) -> tuple[float, float, float, int]:
    """Return the drag right after a jump, the rate of the depth that carries the load, their slope, and the outcome."""
    rate, sums = 0.0, np.empty(SUMS)
    for _ in range(NEWTON_STEPS):
        released(track, first, barriers, deborah, rate, sums)
        if abs(sums[LOAD] - load) <= EXACT * load or sums[LENGTH] <= 0:
            break
        rate += (load - sums[LOAD]) / sums[LENGTH]
    found = abs(sums[LOAD] - load) <= NEARLY * load
    return sums[DRAG], rate, sums[TILT], Outcome.CONVERGED if found else Outcome.DEPTH_NOT_FOUND
