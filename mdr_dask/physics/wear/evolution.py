"""Time integration of a worn contact with backward differentiation formulas (BDF) of order 1 to 3.

The equations are stiff. The nodes move with the contact edge. In every time step, Newton's method solves for all
unknowns together: the image, the position of the edge and, under constant force, the depth and a moving stick border.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit
from mdr_dask.physics.linear import SLOWEST, Factors, factorise
from mdr_dask.physics.outcome import Outcome
from mdr_dask.physics.refine import CLOSE, MOST_ITERATIONS
from mdr_dask.physics.wear.slip import GrossSlip, Moment, PartialSlip

#: The local errors of BDF steps of order 1, 2 and 3 after steps of equal length, as fractions of the difference between
#: the result and the value extrapolated from the previous steps.
_ERROR_SHARE = (1.0 / 3.0, 2.0 / 11.0, 3.0 / 25.0)
#: Largest ratio of a time step to the previous one, chosen by trial. BDF of order 3 is unstable only if the ratio stays
#: above 1.618 in many successive steps. With 1.8, more estimated errors exceed the true errors than with 1.618.
GROWTH = 1.8

Problem = PartialSlip | GrossSlip


class NotConvergedError(ArithmeticError):
    """Raised if even a very short time step fails."""


def march(
    problem: Problem,
    end: float,
    tolerance: float,
    first: float,
    start: Moment | None = None,
    stops: Callable[[Any], bool] = lambda moment: False,
) -> list[Any]:
    """Return the contact at the start of the march, and the contact at the end of every accepted time step.

    The march ends with the first contact for which the time is at least `end`, or `stops` returns True. `tolerance` is
    the allowed error of the results of ``problem.worn`` in one time step. `first` is the length of the first time step
    that is tried. If `start` is None, the march starts with the virgin contact (see `settled`). If even a very short
    time step fails, NotConvergedError is raised.
    """
    newton = _Newton(problem)
    history = [settled(problem) if start is None else start]
    step = first
    while history[-1].time < end and not stops(history[-1]):
        time = history[-1].time
        if time + step == time:
            raise NotConvergedError(
                f"{Outcome.STEP_TOO_SMALL.sentence} in the wear law, after {time:.6g} (cycles N or path s)"
            )
        moment, error = _try_step(problem, newton, history, time + step)
        change = 0.8 * (tolerance / max(error, 1e-300)) ** (1.0 / (min(len(history), 3) + 1))
        if moment is not None and error <= tolerance:
            history.append(moment)
        step *= min(max(0.2, change), GROWTH)
    return history


def settled(problem: Problem) -> Any:
    """Return the virgin contact as a solution of the discrete equations, to avoid a jump in the first time step.

    If Newton's method fails, return the virgin contact as the problem gives it.
    """
    virgin: Any = problem.start()
    known = problem.memory([virgin], np.zeros(1))
    unknowns = _Newton(problem).solve(virgin.unknowns, 0.0, known)
    return virgin if unknowns is None else problem.moment(0.0, unknowns, 0.0, known(unknowns), [virgin])


def at(problem: Problem, history: Sequence[Any], time: float) -> Any:
    """Return the contact at a time within the history, by additional time steps if the history lacks this time.

    If even a very short time step fails, NotConvergedError is raised.
    """
    before = int(np.searchsorted([moment.time for moment in history], time))
    if history[before].time == time:
        return history[before]
    if time < np.finfo(np.float64).tiny:  # such a time counts as 0, because 1 / time would overflow
        return history[0]
    newton, past, next_time = _Newton(problem), list(history[:before]), time
    while past[-1].time < time:
        moment, _ = _try_step(problem, newton, past, next_time)
        if moment is not None:
            past.append(moment)
            next_time = time
            continue
        next_time = 0.5 * (past[-1].time + next_time)
        if next_time == past[-1].time:
            raise NotConvergedError(
                f"{Outcome.STEP_TOO_SMALL.sentence} in the wear law, after {next_time:.6g} (cycles N or path s)"
            )
    return past[-1]


def _try_step(problem: Problem, newton: _Newton, history: Sequence[Any], time: float) -> tuple[Any, float]:
    """Take one time step with the BDF formula of the highest possible order.

    Return the contact at the end of the step, and the estimated error of ``problem.worn`` in this step. The order is
    the number of past contacts, but at most 3. If the step fails, None is returned instead of the contact,
    and the error is infinite.
    """
    past = list(history[-1:-4:-1])
    order = len(past)
    shares = _backward_shares(np.array([time, *(m.time for m in past)]))
    theta, shares = 1.0 / shares[0], -shares[1:] / shares[0]
    known = problem.memory(past, shares)
    near = history[-1 : -order - 2 : -1]
    guess = _lagrange(np.array([m.time for m in near]), time) @ np.array([m.unknowns for m in near])
    if not problem.holds(guess):
        guess = past[0].unknowns
    unknowns = newton.solve(guess, theta, known)
    if unknowns is None:
        unknowns = newton.solve(past[0].unknowns, theta, known)
    if unknowns is None or not problem.admits(unknowns):
        return None, np.inf
    gap = np.max(np.abs(problem.worn(unknowns) - problem.worn(guess)))
    return problem.moment(time, unknowns, theta, known(unknowns), past), float(gap) * _ERROR_SHARE[order - 1]


class _Newton:
    """Newton's method with a Jacobian that is reused in later time steps while the iteration converges."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.factors: Factors | None = None

    def solve(self, guess: FloatArray, theta: float, known: Callable[[FloatArray], FloatArray]) -> FloatArray | None:
        """Return the unknowns of one time step, or None if the iteration fails."""
        if self.factors is not None:
            found = self._iterate(guess, theta, known)
            if found is not None:
                return found
        self.factors = None
        return self._iterate(guess, theta, known)

    def _iterate(
        self, unknowns: FloatArray, theta: float, known: Callable[[FloatArray], FloatArray]
    ) -> FloatArray | None:
        """Return the solution, or None if the iteration fails.

        The iteration fails if the residual is not finite, the Jacobian is singular, the unknowns become impossible (see
        `holds` of the problem), the changes of the unknowns grow or, with a reused Jacobian, shrink too slowly, or if
        `MOST_ITERATIONS` steps are not sufficient.
        """
        is_reused, last = self.factors is not None, np.inf
        for _ in range(MOST_ITERATIONS):
            residual = self.problem.residual(unknowns, theta, known(unknowns))
            if not np.isfinite(residual).all():
                return None
            if self.factors is None:
                self._renew(unknowns, theta, known, residual)
            if self.factors is None:
                return None
            change = self.factors.solve(residual)
            unknowns = unknowns - change
            size = float(np.abs(change).max())
            if not (np.isfinite(size) and self.problem.holds(unknowns)):
                return None
            rate = size / last
            # the sum of all further changes at the same ratio, or the last change if the changes shrink too slowly
            left = size * rate / (1.0 - rate) if 0.0 < rate <= SLOWEST else size
            if left < CLOSE:
                return unknowns
            if rate > (SLOWEST if is_reused else 1.0):
                return None
            if rate > SLOWEST:
                self.factors = None
            last = size
        return None

    def _renew(
        self, unknowns: FloatArray, theta: float, known: Callable[[FloatArray], FloatArray], residual: FloatArray
    ) -> None:
        """Factorise the Jacobian. If it is singular, `factors` is None.

        Derivatives with respect to unknowns other than the image are finite differences.
        """
        matrix = self.problem.jacobian(unknowns, theta)
        for column in range(self.problem.panels.nodes.size - 1, unknowns.size):
            moved = unknowns.copy()
            moved[column] += CLOSE
            shifted = self.problem.residual(moved, theta, known(moved))
            matrix[:, column] = (shifted - residual) / CLOSE
        self.factors = factorise(matrix)


@jit
def _backward_shares(times: FloatArray) -> FloatArray:
    """Return the weights with which values at `times` give the slope of their interpolating polynomial at times[0]."""
    weights = np.zeros(times.size)
    for j in range(1, times.size):
        weights[j] = 1.0 / (times[j] - times[0])
        for m in range(1, times.size):
            if m != j:
                weights[j] *= (times[0] - times[m]) / (times[j] - times[m])
        weights[0] -= weights[j]
    return weights


@jit
def _lagrange(times: FloatArray, time: float) -> FloatArray:
    """Return the weights with which values at `times` give the value of their interpolating polynomial at `time`."""
    weights = np.ones(times.size)
    for j in range(times.size):
        for m in range(times.size):
            if m != j:
                weights[j] *= (time - times[m]) / (times[j] - times[m])
    return weights
