"""Steady sliding on one line before and after a velocity jump, and the state just after the jump."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import CLOSE, MOST_ITERATIONS
from mdr_dask.physics.sliding.kelvin import DRAG as SWEEP_DRAG
from mdr_dask.physics.sliding.kelvin import SUMS as SWEEP_SUMS
from mdr_dask.physics.sliding.kelvin import Barriers, Blocks, barriers_for, blocks_of, patches_at
from mdr_dask.physics.sliding.steady import steady_on_cells
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


class PreparedLine(NamedTuple):
    """One periodic line, prepared for the steady sweep and for the march.

    `known` contains the :class:`Barriers` for at most two Deborah numbers, before and after a jump.
    """

    cells: Cells
    blocks: Blocks
    track: Track
    known: dict[float, Barriers]

    @classmethod
    def of(cls, line: CubicLine) -> PreparedLine:
        """Return a prepared line. Its barriers are computed later, when needed for the first time."""
        cells = cut(line)
        return cls(cells, blocks_of(cells), track_of(cells), {})

    def barriers(self, deborah: float) -> Barriers:
        """Return the barriers for a Deborah number, which is the distance v tau in cells."""
        if deborah not in self.known:
            if len(self.known) == 2:
                self.known.clear()
            self.known[deborah] = barriers_for(int(self.track.cells))
        return self.known[deborah]

    def patches(self, depth: float, deborah: float) -> tuple[Patches, float]:
        """Return patches and drag in steady sliding, given the penetration of the mean line and v tau / L."""
        depth, deborah, sums = depth + self.cells.top, deborah * self.track.cells, np.empty(SWEEP_SUMS)
        start, end = patches_at(self.cells, self.blocks, self.barriers(deborah), deborah, depth, sums)
        return Patches(start, end, _pressed(self.track, end, depth), depth, deborah), float(sums[SWEEP_DRAG])


class SteadyLimits(NamedTuple):
    """Steady states before and after a jump, and the state just after the jump.

    `before` is the drag F_x / (4 G L) in steady sliding at v_1, `at` the drag just after the jump, and `after` the drag
    in steady sliding at v_2. The unit of the drag is the unit of height squared divided by the unit of length. Just
    after the jump, `rate` is the derivative of the depth with respect to t / tau, and `tilt` is the derivative of the
    drag with respect to `rate`. `depth` and `contact` (fraction of the line) are pairs of steady values, before and
    after the jump. `first` contains the contact patches before the jump, and `slower` the patches in steady sliding at
    the lower of the two velocities. If one of the two steady states was not found, `first` and `slower` are None, and
    all numbers are NaN. If only the state just after the jump was not found, `at`, `rate` and `tilt` are invalid.
    `is_full` states whether the whole line is in contact in both steady states.
    """

    before: float
    at: float
    after: float
    rate: float
    tilt: float
    depth: FloatArray
    first: Patches | None
    slower: Patches | None
    contact: FloatArray
    is_full: bool
    outcome: Outcome


def steady_limits(
    line: PreparedLine, loads: FloatArray, deborah: FloatArray, guesses: FloatArray | None = None
) -> list[SteadyLimits]:
    """Solve the steady states before and after jumps on one line, and the states just after the jumps.

    At the instant of a jump, displacements and depth do not change, but the rate of the depth changes. Elements
    separate if the force on them would become negative.

    Loads are F_N / (4 G L), in the unit of height. `deborah`, shape (cases, 2), contains v_1 tau / L and v_2 tau / L.
    `guesses`, shape (cases, 2), are penetrations of the mean line at which the searches start, or NaN. The guesses do
    not affect the results.
    """
    guess = None if guesses is None else guesses.ravel()
    steady = steady_on_cells(line.cells, line.blocks, deborah.ravel(), np.repeat(loads, 2), guess)
    drags, depths, contacts, outcomes = (
        each.reshape(-1, 2) for each in (steady.drag, steady.depth, steady.contact_fraction, steady.status)
    )
    found, n = [], line.track.cells
    for k, load in enumerate(loads):
        outcome = Outcome(int(outcomes[k].max()))
        if outcome != Outcome.CONVERGED:
            no = np.nan
            found.append(SteadyLimits(no, no, no, no, no, np.full(2, no), None, None, np.full(2, no), False, outcome))
            continue
        before, after = (float(each) for each in deborah[k])
        first, drag = line.patches(float(depths[k, 0]), before)
        slower, is_full = first, False
        if after < before or first.start.size == 1:  # one patch: full contact (a period begins and ends in contact)
            last, _ = line.patches(float(depths[k, 1]), after)
            slower, is_full = last if after < before else first, first.start.size == last.start.size == 1
        fast = after * n
        at, rate, tilt, end = _release(line.track, first, line.barriers(fast), fast, float(load * n))
        found.append(
            SteadyLimits(
                drag, at, float(drags[k, 1]), rate, tilt, depths[k], first, slower, contacts[k], is_full, Outcome(end)
            )
        )
    return found


@jit
def _pressed(track: Track, end: FloatArray, depth: float) -> FloatArray:
    """Return the displacement of an element at the end of each patch."""
    pressed = np.empty(end.size)
    for k in range(end.size):
        pressed[k] = depth + height_at(track, end[k])[0]
    return pressed


@jit
def _release(
    track: Track, first: Patches, barriers: Barriers, deborah: float, load: float
) -> tuple[float, float, float, int]:
    """Return `at`, `rate` and `tilt` of `SteadyLimits`, and the outcome."""
    rate, sums = 0.0, np.empty(SUMS)
    for _ in range(MOST_ITERATIONS):
        released(track, first, barriers, deborah, rate, sums)
        if sums[LENGTH] <= 0:
            break
        miss = load - sums[LOAD]
        step = miss / sums[LENGTH]  # the length in contact is the derivative of the load with respect to the rate
        rate += step
        if abs(miss) <= CLOSE * load:
            return sums[DRAG] + step * sums[TILT], rate, sums[TILT], Outcome.CONVERGED
    return sums[DRAG], rate, sums[TILT], Outcome.DEPTH_NOT_FOUND
