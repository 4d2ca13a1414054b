"""The equations of one time step of partial slip at constant depth and of gross slip, for `evolution.march`.

Nodes lie at r^2 = c^2 + z (a^2 - c^2), where z is the position on the panels, from 0 to 1. The unknown for the edge is
the width a^2 - c^2 divided by its value in the virgin contact. So the equations are well conditioned even near full
stick.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.mdr.half_integrals import Panels, interpolate_weighted
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear.evolution import Moment


class FixedBorder(ABC):
    """Base of the problems in which the inner border of the slip zone does not move.

    Accumulated values are interpolated on the panels.
    """

    panels: Panels
    inner_radius: float
    newton = 1e-2

    def holds(self, unknowns: FloatArray) -> bool:
        """Return whether the unknowns describe a possible contact."""
        return bool(unknowns[self.panels.nodes.size - 1] > 0.0)

    @property
    def virgin_width(self) -> float:
        """The width a^2 - c^2 of the virgin contact."""
        return (1.0 - self.inner_radius) * (1.0 + self.inner_radius)

    def width(self, unknowns: FloatArray) -> float:
        """Return a^2 - c^2."""
        return float(self.virgin_width * unknowns[self.panels.nodes.size - 1])

    def radii(self, unknowns: FloatArray) -> FloatArray:
        """Return the radii of the nodes."""
        return np.asarray(np.sqrt(self.inner_radius**2 + self.width(unknowns) * self.panels.nodes))

    @abstractmethod
    def rate(self, unknowns: FloatArray) -> FloatArray:
        """Return the rate of the accumulated quantity at the nodes."""

    def memory(self, past: Sequence[Moment], shares: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Return a function of the unknowns: the weighted sum of past accumulated values at the nodes."""
        last = self.panels.nodes.size - 1
        memories = np.array([moment.accumulated for moment in past])
        widths = np.array([moment.unknowns[last] for moment in past])

        def known(unknowns: FloatArray) -> FloatArray:
            return interpolate_weighted(self.panels.mesh, memories, shares, unknowns[last] / widths)

        return known

    def moment(
        self, time: float, unknowns: FloatArray, theta: float, known: FloatArray, past: Sequence[Moment]
    ) -> Moment:
        """Return the moment at the end of a solved step; `known` is the contribution of the past moments."""
        accumulated = known + theta * self.rate(unknowns)
        accumulated[-1] = 0.0
        return Moment(time, unknowns, accumulated)


class LogTable(NamedTuple):
    """The slip of the virgin body, ln s0 as a function of ln(r^2 - c^2).

    s0(r) = (2/pi) int_c^r (g0 - g_c) / (eta sqrt(r^2 - x^2)) dx. The coefficients belong to a cubic spline in
    ln(r^2 - c^2), whose first knot is `first` and whose knot spacing is `step`.
    """

    first: float
    step: float
    coefficients: FloatArray

    def __call__(self, squares: FloatArray) -> FloatArray:
        """Return ln s0 where r^2 - c^2 > 0 has the values `squares`."""
        result = np.empty(squares.size)
        _look_up(self, squares.ravel(), result)
        return result.reshape(squares.shape)


@jit_inline
def log_slip(table: LogTable, square: float) -> float:
    """Return ln s0 for one value `square` of r^2 - c^2."""
    place = math.log(square) - table.first
    cell = min(max(int(place / table.step), 0), table.coefficients.shape[1] - 1)
    local, k = place - cell * table.step, table.coefficients
    return float(((k[0, cell] * local + k[1, cell]) * local + k[2, cell]) * local + k[3, cell])


@jit
def _look_up(table: LogTable, squares: FloatArray, result: FloatArray) -> None:
    for i in range(squares.size):
        result[i] = log_slip(table, squares[i])


class _Step(NamedTuple):
    """The data of one time step of `PartialSlip`.

    `share` is theta divided by sqrt(a^2 - c^2), `squares` is r^2 - c^2 at the nodes, and `known` is the contribution of
    the past moments at the nodes.
    """

    share: float
    squares: FloatArray
    known: FloatArray


@jit
def _slip_rows(table: LogTable, step: _Step, stress: FloatArray, slip: FloatArray) -> None:
    """Replace the slip by the residual of `PartialSlip`.

    The last row is the condition that s is continuous at the edge.
    """
    last = slip.size - 1
    for i in range(slip.size):
        slip[i] = math.log(max(slip[i], 1e-300)) - log_slip(table, step.squares[i])
        if i < last:
            slip[i] -= step.known[i] + step.share * stress[i]


@dataclass(frozen=True, eq=False)
class PartialSlip(FixedBorder):
    """Slip outside the stick radius c at constant depth.

    The unknowns are y = (g - g_c) / eta at all nodes except the last, where y = 1, and the relative width of the slip
    zone, which gives the edge. The slip is s = (f - f_star) / eta, where f_star is the profile whose image is the
    plateau g = g_c beyond c. The accumulated quantity is ln(s / s0) = int p dN / eta, where s0 is the slip of the
    virgin body.
    """

    profile: Profile
    inner_radius: float
    panels: Panels
    virgin_slip: LogTable
    eta: float

    def start(self) -> Moment:
        """Return the virgin contact."""
        y = np.ones(self.panels.nodes.size)
        gap = self.width(y) * self.panels.nodes / (self.radii(y) + self.inner_radius)
        y[:-1] = self.profile.rise(gap, self.inner_radius)[:-1] / self.eta
        return Moment(0.0, y, np.zeros_like(y))

    def image(self, unknowns: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return y at all nodes, and the factor sqrt(a^2 - c^2) / r by which the half-integral multiplies it."""
        y = unknowns.copy()
        y[-1] = 1.0
        return y, 1.0 / np.sqrt(self.inner_radius**2 / self.width(unknowns) + self.panels.nodes)

    def slip(self, unknowns: FloatArray) -> FloatArray:
        """Return s at the nodes."""
        y, factor = self.image(unknowns)
        return np.asarray(self.panels.inner @ (y * factor))

    def rate(self, unknowns: FloatArray) -> FloatArray:
        """Return p / eta at the nodes."""
        y, _ = self.image(unknowns)
        return np.asarray(self.panels.outer @ y / np.sqrt(self.width(unknowns)))

    def residual(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        """Return ln s - ln s0 - known - theta p / eta; the last row makes s continuous at the edge."""
        y, factor = self.image(unknowns)
        slip, stress, width = self.panels.inner @ (y * factor), self.panels.outer @ y, self.width(unknowns)
        _slip_rows(self.virgin_slip, _Step(theta / np.sqrt(width), width * self.panels.nodes, known), stress, slip)
        return np.asarray(slip)

    def jacobian(self, unknowns: FloatArray, theta: float) -> FloatArray:
        """Return the derivatives of the residual with respect to y."""
        _, factor = self.image(unknowns)
        result = self.panels.inner * (factor / self.slip(unknowns)[:, None])
        result[:-1] -= theta / np.sqrt(self.width(unknowns)) * self.panels.outer[:-1]
        return result

    def worn(self, unknowns: FloatArray) -> FloatArray:
        """Return the slip s = (f - f_star) / eta; wear changes f, but not f_star."""
        return self.slip(unknowns)

    def wear_rate(self, unknowns: FloatArray) -> float:
        """Return dV/dN = 2 int_c^a (1 - g)(g - g_c) / eta dx, the energy dissipated per cycle, divided by mu."""
        y, factor = self.image(unknowns)
        return float(self.eta * np.sqrt(self.width(unknowns)) * self.panels.weights @ (y * (1.0 - y) * factor))


def partial_slip(profile: Profile, stick_radius: float, panels: Panels, reach: float) -> PartialSlip:
    """Return the problem of partial slip, with the virgin slip tabulated up to the radius `reach`.

    The table is computed without cancellation next to c.
    """
    c = stick_radius
    eta = float(profile.rise(np.array(1.0 - c), c))
    smallest = 0.5 * panels.nodes[0] * (1.0 - c) * (1.0 + c)
    table = np.linspace(np.log(smallest), np.log((reach - c) * (reach + c)), 300)
    step = table[1] - table[0]
    r = np.sqrt(c * c + np.exp(table))
    abscissa, weight = gauss(40)
    span = np.arctan2(np.exp(0.5 * table), c)
    angle = span[:, None] * abscissa
    # x - c = r (cos(angle) - cos(span)), written as a product to avoid cancellation
    gap = 2.0 * r[:, None] * np.sin(0.5 * (span[:, None] + angle)) * np.sin(0.5 * (span[:, None] - angle))
    slip = 2.0 / np.pi * span * (profile.rise(gap, c) @ weight) / eta
    coefficients = np.ascontiguousarray(CubicSpline(table, np.log(slip)).c)
    return PartialSlip(profile, c, panels, LogTable(float(table[0]), float(step), coefficients), eta)


@dataclass(frozen=True, eq=False)
class GrossSlip(FixedBorder):
    """Slip in the whole contact.

    The unknowns are the image g at all nodes except the last (at the edge, g equals the depth d), the relative width
    a^2 of the contact, and, if the force is given, the depth d. The accumulated quantity is the worn depth, int p ds.
    """

    profile: Profile
    panels: Panels
    force: float | None = None
    inner_radius: float = 0.0

    def start(self) -> Moment:
        """Return the virgin contact."""
        unknowns = np.ones(self.panels.nodes.size + (self.force is not None))
        unknowns[: self.panels.nodes.size - 1] = self.profile.image(np.sqrt(self.panels.nodes[:-1]))
        return Moment(0.0, unknowns, np.zeros(self.panels.nodes.size))

    def image(self, unknowns: FloatArray) -> tuple[FloatArray, float]:
        """Return g at all nodes, and the depth."""
        last = self.panels.nodes.size - 1
        depth = 1.0 if self.force is None else float(unknowns[-1])
        return np.append(unknowns[:last], depth), depth

    def rate(self, unknowns: FloatArray) -> FloatArray:
        """Return p at the nodes."""
        return np.asarray(self.panels.outer @ self.image(unknowns)[0] / np.sqrt(self.width(unknowns)))

    def worn(self, unknowns: FloatArray) -> FloatArray:
        """Return f at the nodes."""
        return np.asarray(self.panels.full @ self.image(unknowns)[0])

    def normal_force(self, unknowns: FloatArray) -> float:
        """Return F_N = 2 int_0^a (d - g) dx."""
        g, depth = self.image(unknowns)
        # int_0^1 u dz / sqrt(z) is the last row of the full half-integral of u sqrt(1 - z)
        load = (depth - g) * np.sqrt(1.0 - self.panels.nodes)
        return float(np.pi * np.sqrt(self.width(unknowns)) * self.panels.full[-1] @ load)

    wear_rate = normal_force

    def residual(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        """Return f - f0 - known - theta p at the nodes, then the deviation of the force if the force is given.

        The row of the last node is the condition that f is continuous at the edge.
        """
        accumulated = known + theta * self.rate(unknowns)
        accumulated[-1] = 0.0
        rows = self.worn(unknowns) - self.profile.height(self.radii(unknowns)) - accumulated
        return rows if self.force is None else np.append(rows, self.normal_force(unknowns) - self.force)

    def jacobian(self, unknowns: FloatArray, theta: float) -> FloatArray:
        """Return the derivatives of the residual with respect to g."""
        a, nodes = np.sqrt(self.width(unknowns)), self.panels.nodes.size
        result = np.zeros((unknowns.size, unknowns.size))
        result[:nodes, :nodes] = self.panels.full
        result[: nodes - 1, :nodes] -= theta / a * self.panels.outer[:-1]
        if self.force is not None:
            result[-1, :nodes] = -np.pi * a * self.panels.full[-1] * np.sqrt(1.0 - self.panels.nodes)
        return result
