"""Jumps on the grids that their accuracy needs, with the errors that are left.

The ends and the instant of the jump are quantities of one line: they are solved on finer and finer grids until two agree.
The transient between them is marched on one grid, and counts from the steady state of that grid: so it keeps its digits
however small it is beside friction itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.surfaces.cubic_line import CubicLine
from mdr_dask.physics.transients.ends import Ends, ends_on
from mdr_dask.physics.transients.velocity_jump import Course, Jump, velocity_jumps


class Settings(NamedTuple):
    """Factors of the estimates, chosen by ``python -m benchmarks.honesty_kinetics``.

    Parameters
    ----------
    finest : int
        Oversampling beyond which the ends are not refined.
    of_change, of_change_before : float
        Of the change of an end between the last two grids, and between the two before.
    of_transient : float
        Of the change of the transient from half the nodes and half the steps.
    hardly, of_a_peak : float
        Nodes in contact that see a peak by its curvature only, and the error of that times the oversampling squared.
    rounding : float
        Least relative error.
    """

    finest: int = 64
    of_change: float = 0.5
    of_change_before: float = 0.05
    of_transient: float = 1.4
    hardly: float = 2.0
    of_a_peak: float = 0.1
    rounding: float = 1e-8


SETTINGS = Settings()
ENDS = ("before", "jump", "after")


class Problem(NamedTuple):
    """Jumps on one line, without dimensions: heights over the rms height, lengths over that of the line.

    Parameters
    ----------
    line_on : callable, int -> CubicLine
        The line with so many nodes for every Nyquist point.
    points : int
        Nyquist points.
    loads : array, shape (cases,)
        F_N / (4 G L h).
    deborah : array, shape (cases, 2)
        v_1 tau / L and v_2 tau / L.
    """

    line_on: Callable[[int], CubicLine]
    points: int
    loads: FloatArray
    deborah: FloatArray

    def only(self, cases: np.ndarray) -> Problem:
        """Return some of the cases."""
        return self._replace(loads=self.loads[cases], deborah=self.deborah[cases])


class Wanted(NamedTuple):
    """What is asked for: which ends decide the grid, a transient, and its error; relative accuracies for both."""

    ends: tuple[str, ...]
    transient: bool
    transient_error: bool
    accuracy: float
    transient_accuracy: float


class Solved(NamedTuple):
    """One case; drags are F_x / (4 G L h) in units of h / L, errors absolute.

    Parameters
    ----------
    value, error : dict of str to float or array
        ``before``, ``jump``, ``after``, and of a transient ``trace`` and ``depth``.
    outcome : Outcome
    """

    value: dict[str, FloatArray]
    error: dict[str, FloatArray]
    outcome: Outcome


def levels(ends: Ends) -> FloatArray:
    """Return drag before, its jump, drag after and depth after, shape (4, cases)."""
    return np.stack([ends.before, ends.at - ends.before, ends.after, ends.depth[:, 1]])


def solve_jumps(problem: Problem, oversampling: int, course: Course, wanted: Wanted) -> list[Solved]:
    """Return the jumps of a line: ends to an accuracy, the transient on the grid given.

    Parameters
    ----------
    problem : Problem
    oversampling : int
        Even number of nodes for every Nyquist point of the march; the ends may take more.
    course : Course
        Its accuracy is that of the transient.
    wanted : Wanted
    """
    half, whole = problem.line_on(oversampling // 2), problem.line_on(oversampling)
    coarse = ends_on(half, problem.loads, problem.deborah)
    fine = ends_on(whole, problem.loads, problem.deborah, coarse)
    found, error = _refined(problem, oversampling, (coarse, fine), wanted)
    solved = [
        Solved(
            dict(zip((*ENDS, "depth_after"), found[0][:, k], strict=True)),
            dict(zip((*ENDS, "depth_after"), error[:, k], strict=True)),
            Outcome(found[1][k]),
        )
        for k in range(problem.loads.size)
    ]
    if not wanted.transient:
        return solved
    jumps = velocity_jumps(whole, problem.loads, problem.deborah, fine, course)
    rough: list[Jump | None] = [None] * len(jumps)
    if wanted.transient_error:
        # what is left out on one grid is left out on the other
        skipped = np.array([np.inf if jump.left_out > 0 else 0.0 for jump in jumps])
        rough = list(velocity_jumps(half, problem.loads, problem.deborah, coarse, _halved(course), skipped))
    return [_with_transient(*each) for each in zip(solved, jumps, rough, strict=True)]
