"""The ends of a jump on one line: steady sliding before and after it, and the instant at which the velocity changes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.sliding.kelvin import DRAG as SWEEP_DRAG
from mdr_dask.physics.sliding.kelvin import SUMS as SWEEP_SUMS
from mdr_dask.physics.sliding.kelvin import Barriers, Blocks, barriers_for, blocks_of, patches_at
from mdr_dask.physics.sliding.steady import Kept, Touching, steady_on_cells, touching_for
from mdr_dask.physics.surfaces.cubic_line import Cells, CubicLine, cut
from mdr_dask.physics.transients.patches import (
    DRAG,
    LENGTH,
    LOAD,
    SUMS,
    TILT,
    Patches,
    Track,
    height_at,
    released,
    track_of,
)

KEPT, PER_CELL = 2**20, 1 / 8  # places of patches kept at once, 16 bytes each, and those that a case has room for
MOVED = 1e-3  # of a cell: a step of an edge from the lattice depth to the depth itself, whose square is left out
KNOWN, FEWEST = 2**21, 4  # cells whose barriers are kept, 16 bytes each, at least those of some Deborah numbers
NEWTON_STEPS = 60
NEARLY = 1e-6  # of the load: what the last step of Newton may still find missing, whose square is left out


class PreparedLine(NamedTuple):
    """One periodic line as the sweep takes it and as the march does, with the barriers of some Deborah numbers."""

    cells: Cells
    blocks: Blocks
    track: Track
    known: dict[float, Barriers]

    @classmethod
    def of(cls, line: CubicLine) -> PreparedLine:
        """Prepare a line."""
        cells = cut(line)
        return cls(cells, blocks_of(cells), track_of(cells), {})

    def barriers(self, deborah: float) -> Barriers:
        """Return what is known of the barriers at a Deborah number in cells; cases in a row often share it."""
        if deborah not in self.known:
            if len(self.known) >= max(KNOWN // self.cells.mean.size, FEWEST):
                self.known.clear()
            self.known[deborah] = barriers_for(int(self.track.cells))
        return self.known[deborah]

    def patches(self, depth: float, deborah: float, sums: FloatArray) -> Patches:
        """Return what touches in steady sliding at a depth of the highest point; write the sums of the sweep."""
        barriers = self.barriers(deborah)
        start, end = patches_at(self.cells, self.blocks, barriers, deborah, depth, sums)
        return Patches(start, end, _pressed(self.track, end, depth), start.size, depth, deborah, np.zeros(1, np.int64))

    def patches_near(self, touching: Touching, row: int, depth: float, deborah: float) -> Patches | None:
        """Return what touches in steady sliding, from what touched close to the depth; None if that is not enough."""
        count = touching.patches[row]
        if count > touching.end.shape[1]:
            return None
        start, end, pressed = touching.start[row, :count].copy(), touching.end[row, :count].copy(), np.empty(count)
        if not _moved(self.track, deborah, depth, start, end, pressed):
            return None
        return Patches(start, end, pressed, start.size, depth, deborah, np.zeros(1, np.int64))


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
    first : array of Patches, shape (cases,)
        What touches before.
    slower : array of Patches, shape (cases,)
        What touches in steady sliding at the lower velocity.
    outcome : array, shape (cases,)
    """

    before: FloatArray
    at: FloatArray
    after: FloatArray
    rate: FloatArray
    tilt: FloatArray
    depth: FloatArray
    contact: FloatArray
    first: NDArray[np.object_]
    slower: NDArray[np.object_]
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


def ends_on(line: PreparedLine, loads: FloatArray, deborah: FloatArray, near: Ends | None = None) -> Ends:
    """Solve the ends of jumps on one line.

    At the instant of a jump displacements and depth do not change, but the rate of the depth does, and elements whose
    force would be negative are let go.

    Parameters
    ----------
    line : PreparedLine
        From :meth:`PreparedLine.of`.
    loads : array, shape (cases,)
        F_N / (4 G L), in the unit of height.
    deborah : array, shape (cases, 2)
        v_1 tau / L and v_2 tau / L.
    near : Ends, optional
        On another grid, where the searches for the depth begin; the answer does not depend on it.
    """
    guesses = np.full(deborah.shape, np.nan) if near is None else near.depth
    room = int(PER_CELL * line.track.cells) + 2
    together = max(KEPT // (2 * room), 1)
    parts = [
        _ends(line, loads[some], deborah[some], guesses[some], room)
        for some in (slice(k, k + together) for k in range(0, max(loads.size, 1), together))
    ]
    columns: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return Ends(*columns)


def _ends(line: PreparedLine, loads: FloatArray, deborah: FloatArray, guesses: FloatArray, room: int) -> Ends:
    """Solve the ends of a few jumps, with room for so many patches of each."""
    cells, n, sums, touching = line.cells, line.track.cells, np.empty(SWEEP_SUMS), touching_for(deborah.size, room)
    steady = steady_on_cells(
        cells, line.blocks, deborah.ravel(), np.repeat(loads, 2), guesses.ravel(), 0.0, Kept(line.barriers, touching)
    )
    drag, depth, contact = (column.reshape(-1, 2) for column in (steady.drag, steady.depth, steady.contact_fraction))
    outcome = steady.status.reshape(-1, 2).max(axis=1)
    at, rate, tilt = np.full((3, loads.size), np.nan)
    first, slower = np.full((2, loads.size), None, dtype=object)
    for k in np.flatnonzero(outcome == Outcome.CONVERGED):
        speeds, both = deborah[k] * n, []
        for end, speed in enumerate(speeds):
            # at the depth itself: the lattice depth is near it, where other cells may be in contact as a whole
            sinking = float(depth[k, end] + cells.top)
            patches = line.patches_near(touching, 2 * int(k) + end, sinking, speed)
            if patches is None:
                patches = line.patches(sinking, speed, sums)
                drag[k, end] = sums[SWEEP_DRAG]
            both.append(patches)
        first[k], slower[k] = both[0], both[int(np.argmin(speeds))]
        at[k], rate[k], tilt[k], outcome[k] = _release(
            line.track, first[k], line.barriers(speeds[1]), speeds[1], loads[k] * n
        )
    return Ends(drag[:, 0].copy(), at, drag[:, 1].copy(), rate, tilt, depth, contact, first, slower, outcome)


@jit
def _pressed(track: Track, end: FloatArray, depth: float) -> FloatArray:
    """Return the displacements with which elements leave patches."""
    pressed = np.empty(end.size)
    for k in range(end.size):
        pressed[k] = depth + height_at(track, end[k])[0]
    return pressed


@jit
def _moved(track: Track, deborah: float, depth: float, start: FloatArray, end: FloatArray, pressed: FloatArray) -> bool:
    """Move the places of patches close to a depth to it, by a step of Newton; write with what elements leave them.

    Return whether none moves far or into another cell, or meets another one: else the sums of the cells change, too.
    """
    last, left, free = start.size - 1, -np.inf, 0.0
    for k in range(start.size):
        if k > 0:
            x = start[k]
            h, slope, _ = height_at(track, x)
            flying = free * np.exp((left - x) / deborah)
            rise = slope + flying / deborah
            step = (flying - depth - h) / rise if rise > 0 else np.inf
            if not (abs(step) < MOVED and int(x + step) == int(x) and x + step > left):
                return False
            start[k] = x + step
        if k < last:
            x = end[k]
            h, slope, bend = height_at(track, x)
            falls = slope + deborah * bend
            step = -(depth + h + deborah * slope) / falls if falls < 0 else np.inf
            if not (abs(step) < MOVED and int(x + step) == int(x) and x + step > start[k]):
                return False
            end[k] = x + step
        left = end[k]
        free = pressed[k] = depth + height_at(track, left)[0]
    return True


@jit
def _release(
    track: Track, first: Patches, barriers: Barriers, deborah: float, load: float
) -> tuple[float, float, float, int]:
    """Return the drag right after a jump, the rate of the depth that carries the load, their slope, and the outcome."""
    rate, sums = 0.0, np.empty(SUMS)
    for _ in range(NEWTON_STEPS):
        released(track, first, barriers, deborah, rate, sums)
        if sums[LENGTH] <= 0:
            break
        miss = load - sums[LOAD]
        step = miss / sums[LENGTH]
        rate += step
        if abs(miss) <= NEARLY * load:
            return sums[DRAG] + step * sums[TILT], rate, sums[TILT], Outcome.CONVERGED
    return sums[DRAG], rate, sums[TILT], Outcome.DEPTH_NOT_FOUND
