"""Worn contacts solved to a requested accuracy, with estimated errors (:mod:`mdr_dask.physics.refine`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray, IntArray
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import Solution, refine
from mdr_dask.physics.wear.evolution import NotConvergedError
from mdr_dask.physics.wear.exact import COARSEST, exact
from mdr_dask.physics.wear.history import LoadBlock, history
from mdr_dask.physics.wear.worn import FUNCTIONS, Worn

# Each level has a quarter of the tolerance of the level before. DEFAULT is the level with the default tolerance of
# `exact`. Round-off prevents a smaller tolerance than that of the level FINEST.
DEFAULT, FINEST = 2, 5
# With a quarter of the tolerance, most errors fall to a third or a fourth, but the error of a radius may fall only to a
# half, as at order 1. The error of `history` is usually proportional to the width of a cell.
ORDER = 1


class Checked(NamedTuple):
    """A worn contact, and the estimated absolute error of every requested attribute of `Worn`.

    The error of a function of position is the largest error at the requested positions.
    """

    worn: Worn
    errors: dict[str, float]


def checked(worn: Worn, outputs: Sequence[str], places: FloatArray) -> Checked:
    """Return a contact in closed form with its known errors."""
    errors = {}
    for name in outputs:
        size = np.abs(worn.value(name, places))
        errors[name] = worn.known_error(name) * float(np.max(size, initial=0.0, where=np.isfinite(size)))
    return Checked(worn, errors)


def checked_exact(
    profile: Profile,
    stick_radius: float,
    amounts: Sequence[float],
    outputs: Sequence[str],
    places: FloatArray,
    accuracy: float | None = None,
    *,
    constant_force: bool = False,
) -> list[Checked]:
    """Return the worn contact after each amount of wear by the exact rule, solved to an accuracy.

    Parameters
    ----------
    profile, stick_radius, amounts, constant_force
        See `mdr_dask.physics.wear.exact.exact`.
    outputs : sequence of str
        Attributes of `Worn` whose errors are estimated, for example ``["wear_volume", "height"]``. If there are none,
        one solution with the default tolerance is returned, and no errors are estimated.
    places : array
        Positions at which functions of position are compared, in units of a0.
    accuracy : float, optional
        Allowed error of every output relative to its largest value. If no tolerance meets the accuracy, the solution
        with the smallest tolerance is returned. Without an accuracy, the solution with the default tolerance is
        returned. In all three cases, the errors of the returned solution are estimated.

    Raises
    ------
    ValueError
        If the stick radius is not at least 0 and below 1, or if, in partial slip, the contact reaches beyond the table
        of the profile.
    NotConvergedError
        If the evolution cannot be advanced at any tolerance, for example because, in gross slip, the contact reaches
        beyond the table of the profile.
    """

    def solve(level: int, which: IntArray) -> list[Worn]:
        tolerance = COARSEST / 4**level
        return exact(profile, stick_radius, [amounts[k] for k in which], tolerance, constant_force=constant_force)

    levels = range(1 + (FINEST if accuracy else DEFAULT)) if outputs else (DEFAULT,)
    return _checked(solve, len(amounts), levels, accuracy or 0.0, outputs, places)


def checked_history(
    profile: Profile, blocks: Sequence[LoadBlock], outputs: Sequence[str], places: FloatArray, cells: int, reach: float
) -> list[Checked]:
    """Return the contact at the end of every block of load on a grid with `cells` cells up to the radius `reach`.

    The errors are estimated from solutions with 1/2 and 1/4 of the cells, unless `outputs` is empty. `outputs` and
    `places` are those of `checked_exact`. A ValueError is raised if the contact reaches beyond the grid.
    """

    def solve(cells: int, which: IntArray) -> list[Worn]:
        contacts = history(profile, blocks, cells=cells, reach=reach)
        return [contacts[k] for k in which]

    levels = (cells // 4, cells // 2, cells) if outputs else (cells,)
    return _checked(solve, len(blocks), levels, 0.0, outputs, places)


def _checked(
    solve: Callable[[int, IntArray], list[Worn]],
    contacts: int,
    levels: Sequence[int],
    accuracy: float,
    outputs: Sequence[str],
    places: FloatArray,
) -> list[Checked]:
    """Return each contact from the coarsest level on which all its outputs meet the accuracy.

    A contact that does not meet the accuracy on any level is taken from the finest level with a solution. If a contact
    has no solution on any level, NotConvergedError is raised.
    """
    found: dict[tuple[int, int], Worn] = {}
    problems = []

    def solution(level: int, which: IntArray) -> Solution:
        try:
            solved = solve(level, which)
        except NotConvergedError as problem:
            problems.append(problem)
            shapes = [(which.size, places.size) if name in FUNCTIONS else (which.size,) for name in outputs]
            return Solution([np.full(one, np.nan) for one in shapes], np.full(which.size, Outcome.STEP_TOO_SMALL))
        found.update({(level, int(k)): one for k, one in zip(which, solved, strict=True)})
        values = [np.array([one.value(name, places) for one in solved]) for name in outputs]
        for value in values:
            value[~np.isfinite(value)] = np.nan  # the pressure is infinite at a sharp tip
        known = np.array([[one.known_error(name) for one in solved] for name in outputs])
        return Solution(values, np.zeros(which.size, np.int8), known)

    refined = refine(solution, contacts, levels, accuracy, ORDER, shared=False)
    if np.any(refined.outcome != Outcome.CONVERGED):
        raise problems[-1]
    return [
        Checked(found[int(refined.level[k]), k], dict(zip(outputs, refined.errors[:, k], strict=True)))
        for k in range(contacts)
    ]
