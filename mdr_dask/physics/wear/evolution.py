"""The exact evolution of a fretted or sliding contact of revolution at constant depth or constant force.

Every radius remembers what it has gathered: in partial slip the logarithm of its slip s over the slip s0 of the virgin
body, int p dN / eta; in gross slip its worn depth, int p ds. Beyond the contact that is exactly zero. The contact
c < r < a is mapped onto graded panels in r^2, which follow the moving edge; each step is a stiff backward
differentiation formula along fixed radii, solved by Newton's method for the image g and the edge together.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.linear import solve_in_place
from mdr_dask.physics.mdr.half_integrals import Panels, interpolate_weighted
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.transforms import gauss

#: Local error of a BDF step of order 1, 2, 3 over its distance from the extrapolated past.
_ERROR_SHARE = (1.0 / 3.0, 2.0 / 11.0, 3.0 / 25.0)
_MOST_STEPS = 20000
_MOST_ITERATIONS = 10
#: Newton's method squares its error: what is left after so small a change is round-off.
_LAST_CHANGE = 1e-7


class NotConvergedError(ArithmeticError):
    """A time step that no smaller step could rescue."""


@dataclass(frozen=True, eq=False)
class Moment:
    """The contact at one time.

    Parameters
    ----------
    time : float
        Cycles N in partial slip, sliding path s in gross slip.
    unknowns : array, shape (n,)
        The unknowns of the problem: values of the image at all nodes but the last, the edge a, in some problems more.
    gathered : array, shape (n,)
        What the radii of the nodes have gathered; zero at the edge.
    edge : float
        a.
    """

    time: float
    unknowns: FloatArray
    gathered: FloatArray
    edge: float


class Problem(Protocol):
    """One kind of slip, as the equations of one step."""

    @property
    def panels(self) -> Panels:
        """Return the panels between the inner border and the edge."""

    def inner(self, unknowns: FloatArray) -> float:
        """Return the radius of the inner border."""

    def start(self) -> Moment:
        """Return the virgin contact."""

    def memory(self, past: Sequence[Any], shares: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Return, as a function of the unknowns, what past moments in these shares had gathered at the nodes."""

    def moment(self, time: float, unknowns: FloatArray, theta: float, known: FloatArray, past: Sequence[Any]) -> Moment:
        """Return the moment that a solved step ends in."""

    def residual(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        """Return gathered - known - theta * rate at every node, and the conditions at the edge."""

    def jacobian(self, unknowns: FloatArray, theta: float) -> FloatArray:
        """Return its derivatives by the nodal unknowns."""

    def worn(self, unknowns: FloatArray) -> FloatArray:
        """Return the quantity in d0 whose step error is controlled."""


class FixedBorder(ABC):
    """What problems with a fixed inner border share: the memory of a radius is a value of a function on the panels."""

    panels: Panels
    inner_radius: float

    def inner(self, unknowns: FloatArray) -> float:
        """Return the radius of the inner border."""
        return self.inner_radius

    @abstractmethod
    def gathered(self, unknowns: FloatArray) -> FloatArray:
        """Return what the radii have gathered."""

    def memory(self, past: Sequence[Moment], shares: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Return, as a function of the unknowns, what past moments in these shares had gathered at the nodes."""
        memories = np.array([moment.gathered for moment in past])
        squares = np.array([moment.edge for moment in past]) ** 2 - self.inner_radius**2
        last = self.panels.nodes.size - 1

        def known(unknowns: FloatArray) -> FloatArray:
            lengths = (unknowns[last] ** 2 - self.inner_radius**2) / squares
            return interpolate_weighted(self.panels, memories, shares, lengths)

        return known

    def moment(
        self, time: float, unknowns: FloatArray, theta: float, known: FloatArray, past: Sequence[Moment]
    ) -> Moment:
        """Return the moment that a solved step ends in."""
        return Moment(time, unknowns, self.gathered(unknowns), float(unknowns[self.panels.nodes.size - 1]))


@dataclass(frozen=True, eq=False)
class PartialSlip(FixedBorder):
    """Slip outside the stick radius c at constant depth; unknowns y = (g - g_c) / eta at the nodes, and a.

    `virgin` are the coefficients of a cubic spline of ln s0 over ln(r^2 - c^2) from `first` on, `step` apart.
    """

    profile: Profile
    inner_radius: float
    panels: Panels
    first: float
    step: float
    virgin: FloatArray
    eta: float

    def radii(self, edge: float) -> FloatArray:
        """Return the radii of the nodes for an edge."""
        c = self.inner_radius
        return np.asarray(np.sqrt(c * c + (edge - c) * (edge + c) * self.panels.nodes))

    def start(self) -> Moment:
        """Return the virgin contact."""
        y = self.profile.rise(self.radii(1.0), self.inner_radius) / self.eta
        return Moment(0.0, np.append(y[:-1], 1.0), np.zeros_like(y), 1.0)

    def split(self, unknowns: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Return y at all nodes, the factor sqrt(L) / r that turns it into a half-integrand, and L = a^2 - c^2."""
        a, c = unknowns[-1], self.inner_radius
        length = (a - c) * (a + c)
        y = unknowns.copy()
        y[-1] = 1.0
        return y, np.sqrt(length) / self.radii(a), length

    def slip(self, unknowns: FloatArray) -> FloatArray:
        """Return s at the nodes."""
        y, factor, _ = self.split(unknowns)
        return np.asarray(self.panels.inner @ (y * factor))

    def residual(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        """Return ln s - ln s0 - known - theta p / eta; the last row says that s is continuous at the edge."""
        return np.asarray(self._rows(unknowns, theta, known)[0])

    def _rows(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        rows, panels, table = np.empty((4, unknowns.size)), self.panels, (self.first, self.step, self.virgin)
        _slip_rows(unknowns, self.inner_radius, panels.nodes, panels.inner, panels.outer, *table, theta, known, rows)
        return rows

    def jacobian(self, unknowns: FloatArray, theta: float) -> FloatArray:
        """Return the derivatives by y."""
        result, size = np.empty((unknowns.size, unknowns.size)), unknowns.size
        _, _, factor, slip = self._rows(unknowns, theta, np.zeros(size))
        length = (unknowns[-1] - self.inner_radius) * (unknowns[-1] + self.inner_radius)
        _slip_jacobian(self.panels.inner, self.panels.outer, factor, slip, theta / np.sqrt(length), result)
        return result

    def gathered(self, unknowns: FloatArray) -> FloatArray:
        """Return ln(s / s0)."""
        gain = np.asarray(self._rows(unknowns, 0.0, np.zeros_like(unknowns))[0])
        gain[-1] = 0.0
        return gain

    def worn(self, unknowns: FloatArray) -> FloatArray:
        """Return the slip times eta: the part of f that changes."""
        return self.eta * self.slip(unknowns)

    def wear_rate(self, unknowns: FloatArray) -> float:
        """Return dV/dN = 2 int_c^a (1 - g)(g - g_c) / eta dx, the dissipation of a cycle over mu."""
        y, factor, length = self.split(unknowns)
        return float(self.eta * np.sqrt(length) * self.panels.weights @ (y * (1.0 - y) * factor))


@njit(nogil=True, cache=True)
def _slip_rows(unknowns, c, nodes, inner, outer, first, step, coefficients, theta, known, rows):  # type: ignore[no-untyped-def]
    """Put the residual of `PartialSlip`, y, the factor of `split` and the slip into the rows."""
    size = nodes.size
    residual, y, factor, slips = rows[0], rows[1], rows[2], rows[3]
    a = unknowns[size - 1]
    length = (a - c) * (a + c)
    root = np.sqrt(length)
    for i in range(size):
        y[i] = unknowns[i] if i < size - 1 else 1.0
        factor[i] = root / np.sqrt(c * c + length * nodes[i])
    for i in range(size):
        slip, pressure = 0.0, 0.0
        for j in range(size):
            slip += inner[i, j] * factor[j] * y[j]
            pressure += outer[i, j] * y[j]
        slips[i] = slip
        place = np.log(length * nodes[i]) - first
        cell = min(max(int(place / step), 0), coefficients.shape[1] - 1)
        virgin = coefficients[0, cell]
        for power in range(1, 4):
            virgin = virgin * (place - cell * step) + coefficients[power, cell]
        gain = np.log(max(slip, 1e-300)) - virgin
        residual[i] = gain - known[i] - theta * pressure / root if i < size - 1 else gain


@njit(nogil=True, cache=True)
def _slip_jacobian(inner, outer, factor, slip, share, result):  # type: ignore[no-untyped-def]
    """Put the derivatives of `PartialSlip.residual` by y into `result`."""
    size = factor.size
    for i in range(size):
        rate = share if i < size - 1 else 0.0
        for j in range(size):
            result[i, j] = inner[i, j] * factor[j] / slip[i] - rate * outer[i, j]


def partial_slip(profile: Profile, stick_radius: float, panels: Panels, reach: float) -> PartialSlip:
    """Prepare partial slip: tabulate ln s0 over ln(r^2 - c^2) up to the radius `reach`.

    s0(r) = (2/pi) int_c^r (g0 - g_c) / (eta sqrt(r^2 - x^2)) dx, free of cancellation next to c.
    """
    c = stick_radius
    eta = float(profile.rise(np.array(1.0), c))
    smallest = 0.5 * panels.nodes[0] * (1.0 - c) * (1.0 + c)
    table = np.linspace(np.log(smallest), np.log((reach - c) * (reach + c)), 600)
    r = np.sqrt(c * c + np.exp(table))
    abscissa, weight = gauss(40)
    span = np.arctan2(np.exp(0.5 * table), c)
    x = np.maximum(r[:, None] * np.cos(span[:, None] * abscissa), c)
    slip = 2.0 / np.pi * span * (profile.rise(x, c) @ weight) / eta
    coefficients = np.ascontiguousarray(CubicSpline(table, np.log(slip)).c)
    return PartialSlip(profile, c, panels, table[0], table[1] - table[0], coefficients, eta)


def march(
    problem: Problem,
    end: float,
    tolerance: float,
    start: Moment | None = None,
    stops: Callable[[Any], bool] = lambda moment: False,
) -> list[Any]:
    """Advance a contact until the first step that ends at or beyond a time.

    The steps do not depend on that time, so that a longer march repeats the shorter one exactly.

    Parameters
    ----------
    problem : Problem
        The kind of slip.
    end : float
        Time to reach.
    tolerance : float
        Error of f in d0 allowed in one step.
    start : Moment, optional
        Where to start from, in place of the virgin contact.
    stops : callable, Moment -> bool
        Tells after which moment to stop before that time.

    Returns
    -------
    list of Moment
        All accepted steps; the first is the start.

    Raises
    ------
    NotConvergedError
        If a step fails however short it is.
    """
    history = [settled(problem) if start is None else start]
    step = 0.1 * tolerance
    while history[-1].time < end and not stops(history[-1]):
        if len(history) > _MOST_STEPS:
            raise NotConvergedError(f"the wear law needed more than {_MOST_STEPS} steps")
        moment, error = _try_step(problem, history, step)
        power = 1.0 / (min(len(history), 3) + 1)
        if moment is None or error > tolerance:
            step *= 0.25 if moment is None else max(0.2, 0.8 * (tolerance / error) ** power)
            if step < 1e-13 * (1.0 + history[-1].time):
                raise NotConvergedError(f"the wear law could not be advanced beyond {history[-1].time:.6g}")
            continue
        history.append(moment)
        growth = min(1.8, 0.85 * (tolerance / max(error, 1e-300)) ** power)
        step *= growth if growth > 1.1 or growth < 0.9 else 1.0
    return history


def unknowns_at(history: Sequence[Moment], time: float) -> FloatArray:
    """Return the unknowns at any time marched through, by the polynomial of the step that passed it."""
    return _extrapolate(time, neighbours(history, time))


def value_at(history: Sequence[Moment], values: FloatArray, time: float) -> float:
    """Return a number known at all moments at any time marched through, as `unknowns_at` does."""
    numbers = {id(m): float(v) for m, v in zip(history, values, strict=True)}
    near = neighbours(history, time)
    marked = [Moment(m.time, np.array([numbers[id(m)]]), m.gathered, m.edge) for m in near]
    return float(_extrapolate(time, marked)[0])


def neighbours(history: Sequence[Moment], time: float) -> Sequence[Moment]:
    """Return the moment at or after a time and up to three before it."""
    last = int(np.searchsorted([m.time for m in history], time))
    return history[max(last - 3, 0) : last + 1]


def integral_along(history: Sequence[Moment], rates: Sequence[float]) -> FloatArray:
    """Integrate a rate over the steps with the formulas of the steps themselves, shape (steps + 1,)."""
    total = np.zeros(len(history))
    for number in range(1, len(history)):
        order = min(number, 3)
        shares = _backward_shares([m.time for m in history[number - order : number + 1]][::-1])
        past = total[number - order : number][::-1]
        total[number] = (rates[number] - shares[1:] @ past) / shares[0]
    return total


def settled(problem: Problem) -> Any:
    """Return the virgin contact as the panels see it, so that the first step starts without a jump."""
    virgin = problem.start()
    known = problem.memory([virgin], np.zeros(1))
    unknowns = _newton(problem, virgin.unknowns, 0.0, known)
    return virgin if unknowns is None else problem.moment(0.0, unknowns, 0.0, known(unknowns), [virgin])


def _try_step(problem: Problem, history: Sequence[Moment], length: float) -> tuple[Moment | None, float]:
    """Make one step of the highest order that the past allows; return None if Newton's method fails."""
    time = history[-1].time + length
    past = list(history[-1:-4:-1])
    order = len(past)
    shares = _backward_shares([time, *(m.time for m in past)])
    theta, shares = 1.0 / shares[0], -shares[1:] / shares[0]
    guess = _extrapolate(time, history[-1 : -order - 2 : -1])
    known = problem.memory(past, shares)
    unknowns = _newton(problem, guess, theta, known)
    if unknowns is None:
        unknowns = _newton(problem, past[0].unknowns.copy(), theta, known)
    if unknowns is None:
        return None, np.inf
    gap = np.max(np.abs(problem.worn(unknowns) - problem.worn(guess)))
    return problem.moment(time, unknowns, theta, known(unknowns), past), float(gap) * _ERROR_SHARE[order - 1]


def _newton(
    problem: Problem, guess: FloatArray, theta: float, known: Callable[[FloatArray], FloatArray]
) -> FloatArray | None:
    """Solve one step; columns of the edge and what follows it are differences, renewed twice."""
    nodes = problem.panels.nodes.size
    unknowns = guess.copy()
    columns = np.empty((unknowns.size, unknowns.size - nodes + 1))
    for iteration in range(_MOST_ITERATIONS):
        past = known(unknowns)
        residual = problem.residual(unknowns, theta, past)
        matrix = problem.jacobian(unknowns, theta)
        for column in range(nodes - 1, unknowns.size):
            if iteration < 3:
                moved = unknowns.copy()
                moved[column] += 1e-7
                shifted = problem.residual(moved, theta, known(moved))
                columns[:, column - nodes + 1] = (shifted - residual) / 1e-7
            matrix[:, column] = columns[:, column - nodes + 1]
        if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(residual))):
            return None
        change = -residual
        if not solve_in_place(matrix, change):
            return None
        unknowns += change
        if not unknowns[nodes - 1] > problem.inner(unknowns) >= 0.0:
            return None
        if np.max(np.abs(change)) < _LAST_CHANGE:
            return unknowns if np.all(np.isfinite(problem.worn(unknowns))) else None
    return None


def _backward_shares(times: Sequence[float]) -> FloatArray:
    """Return the weights of the derivative at times[0] of the polynomial through all the times."""
    t = np.asarray(times, dtype=float) - times[0]
    powers = np.ascontiguousarray(np.vander(t / t[-1], increasing=True).T)
    target = np.zeros(t.size)
    target[1] = 1.0 / t[-1]
    solve_in_place(powers, target)
    return target


def _extrapolate(time: float, past: Sequence[Moment]) -> FloatArray:
    """Return the unknowns of the polynomial through the past moments at a time."""
    result = np.zeros_like(past[0].unknowns)
    for moment in past:
        others = [other.time for other in past if other is not moment]
        result += moment.unknowns * np.prod([(time - t) / (moment.time - t) for t in others])
    return result
