"""The equations of one time step of partial slip under constant force, for `evolution.march`.

The depth d grows, and the stick border b moves outwards until the image jumps there; then it no longer moves. Inside
the border the image is frozen: g(b) = d - eta at the time when the border passed. The slip is s = (f - f_star) / eta.
In the annulus between the virgin stick border c and the present border b, the plateau f_star changes only by
df_star = (2/pi) arccos(b / r) dd. So only the path (b, d) has to be stored for this annulus.

The accumulated quantity is the worn depth divided by eta. Squared radii are counted from c^2 in units of 1 - c^2, the
width of the virgin slip zone, and the depth is counted from 1 in units of eta. So all unknowns are of the order of one,
even near full stick.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.mdr.half_integrals import Mesh, Panels, interpolate, value_at
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear.evolution import Moment, settled
from mdr_dask.physics.wear.slip import LogTable, PartialSlip, log_slip, partial_slip

#: Weight of the border relative to the depth in the step error. It is large, because f rises like a square root beyond
#: the border.
BORDER_WEIGHT = 30.0
#: Position on the panels up to which the rise of the plateau is stored; the border is at 0, the edge at 1.
BEYOND = 1.25


#: Lower limit of (r^2 - c^2) / (1 - c^2), so that the logarithm of this quantity is finite.
SMALLEST = 1e-30
#: `_mean_angle` uses a series if (r1 - r2) / (r1 + r2) is below this value, where r1 and r2 are the values of
#: sqrt(r^2 - b^2) at the two ends of a straight piece of the path.
SHORT = 0.02
_ABSCISSA, _WEIGHT = gauss(3)


class VirginBody(NamedTuple):
    """The virgin body: its slip `slip`, c^2 (`square`) and 1 - c^2 (`width`)."""

    slip: LogTable
    square: float
    width: float


class Place(NamedTuple):
    """Border and width of the slip zone, and the depth, in the units of the module.

    `border` is (b^2 - c^2) / (1 - c^2), `width` is (a^2 - b^2) / (1 - c^2), and `depth` is (d - 1) / eta.
    """

    border: float
    width: float
    depth: float


class Past(NamedTuple):
    """Past moments, with their weights in the formula of one step.

    Parameters
    ----------
    shares, borders, widths : array, shape (m,)
        One entry for each moment: its weight, border and width.
    worn : array, shape (m, n)
        Worn depth divided by eta at the nodes. If the border no longer moves: this value minus `frozen`, divided by
        sqrt(z), where z is the position on the panels.
    frozen : float
        The worn depth divided by eta at a border that no longer moves; NaN while the border moves.
    moved : array, shape (n + order,)
        `plateau_rise` along the path, at the nodes of the newest past moment and at those of one panel beyond the edge.
    path : array, shape (2, k)
        Pairs of border and depth up to the last moment at which the border moved.
    carried : float
        The integral `carried` of the newest past moment, see `Pressed`.
    """

    shares: FloatArray
    borders: FloatArray
    widths: FloatArray
    worn: FloatArray
    frozen: float
    moved: FloatArray
    path: FloatArray
    carried: float


@dataclass(frozen=True, eq=False)
class Pressed(Moment):
    """A moment under constant force.

    Parameters
    ----------
    path : array, shape (2, k)
        All pairs of border and depth up to and including this moment, joined by straight lines.
    moved : array, shape (n + order,)
        `plateau_rise` along the part of the path on which the border moved, at the nodes and in one panel beyond
        the edge.
    carried : float
        int (1 - d) db along the path, where d is counted from 1 in units of eta, and b is the radius of the border.
    """

    path: FloatArray
    moved: FloatArray
    carried: float

    @property
    def border(self) -> float:
        """The stick border, (b^2 - c^2) / (1 - c^2)."""
        return float(self.path[0, -1])


@dataclass(frozen=True, eq=False)
class ForcedSlip:
    """Slip outside the stick border under constant force.

    The unknowns are y = 1 - (d - g) / eta at all nodes except the last, the width of the slip zone, the depth, and the
    border while it moves. A border that no longer moves is given as `border`. In this case `since` is the index of the
    pair in the path at which the border stopped, and `frozen` is the worn depth divided by eta at the border. `newton`
    is the tolerance of Newton's method as a fraction of the step tolerance. Loads are half forces over eta;
    `virgin_load` is the load of the virgin slip zone.
    """

    virgin: PartialSlip
    virgin_load: float
    border: float | None = None
    since: int = 0
    frozen: float = np.nan
    newton: float = 1e-5

    @cached_property
    def panels(self) -> Panels:
        """The panels between the border and the edge."""
        return self.virgin.panels

    @property
    def profile(self) -> Profile:
        """The virgin body."""
        return self.virgin.profile

    @property
    def eta(self) -> float:
        """The quantity G* U0 / (mu E* d0), with the amplitude U0 and the first depth d0."""
        return self.virgin.eta

    @cached_property
    def size(self) -> int:
        """The number of nodes."""
        return self.panels.nodes.size

    @cached_property
    def body(self) -> VirginBody:
        """The virgin body for compiled code."""
        return VirginBody(self.virgin.virgin_slip, self.virgin.inner_radius**2, self.virgin.virgin_width)

    @cached_property
    def mesh(self) -> Mesh:
        """The panels between border and edge, and one more panel beyond the edge."""
        return self.panels.mesh.extended(BEYOND)

    def image(self, unknowns: FloatArray) -> FloatArray:
        """Return y at all nodes."""
        y = unknowns[: self.size].copy()
        y[-1] = 1.0
        return y

    def place(self, unknowns: FloatArray) -> Place:
        """Return border, width and depth of the contact."""
        border = float(unknowns[-1]) if self.border is None else self.border
        return Place(border, float(unknowns[self.size - 1]), float(unknowns[self.size]))

    def holds(self, unknowns: FloatArray) -> bool:
        """Return whether the unknowns describe a possible contact."""
        place = self.place(unknowns)
        return place.width > 0.0 and self.body.width * place.border > -0.5 * self.body.square

    def radius(self, place: float) -> float:
        """Return the radius that belongs to a squared radius, which is counted from c^2 in units of 1 - c^2."""
        return float(np.sqrt(self.body.square + self.body.width * place))

    def start(self) -> Pressed:
        """Return the virgin contact."""
        first, nodes = self.virgin.start(), self.mesh.nodes.size
        return Pressed(0.0, np.append(first.unknowns, 0.0), first.accumulated, np.zeros((2, 1)), np.zeros(nodes), 0.0)

    def move(self, moment: Pressed) -> tuple[ForcedSlip, Pressed]:
        """Return the problem in which the border moves, and its first moment."""
        return replace(self, border=None, frozen=np.nan), replace(
            moment, unknowns=np.append(moment.unknowns, moment.border)
        )

    def stop(self, moment: Pressed) -> tuple[ForcedSlip, Pressed]:
        """Return the problem in which the border no longer moves, and its first moment."""
        frozen = float(self.frozen_depth(moment.path, np.array([moment.border]))[0])
        still = replace(self, border=moment.border, since=moment.path.shape[1] - 1, frozen=frozen)
        return still, replace(moment, unknowns=moment.unknowns[:-1])

    def memory(self, past: Sequence[Pressed], shares: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Return a function of the unknowns that gives the part of the residual that follows from the past moments.

        These are the past contributions to s and to the worn depth at the nodes, and the additional load of the stick
        zone.
        """
        places = [self.place(moment.unknowns) for moment in past]
        worn = np.array([moment.accumulated for moment in past])
        earlier = Past(
            shares,
            np.array([place.border for place in places]),
            np.array([place.width for place in places]),
            worn if self.border is None else (worn - self.frozen) / np.sqrt(self.panels.nodes),
            self.frozen,
            past[0].moved,
            np.ascontiguousarray(past[0].path[:, : self._last_move(past[0].path) + 1]),
            past[0].carried,
        )

        def known(unknowns: FloatArray) -> FloatArray:
            result = np.empty(2 * self.size + 1)
            fill_known(self.mesh, self.body, earlier, self.place(unknowns), result)
            return result

        return known

    def plateau_rise(self, path: FloatArray, place: FloatArray) -> FloatArray:
        """Return (2/pi) int arccos(b / r) dd along a path, at radii r outside all borders b of the path."""
        result = np.empty_like(place)
        plateau_rise(self.body, np.ascontiguousarray(path), place, result)
        return result

    def frozen_depth(self, path: FloatArray, place: FloatArray) -> FloatArray:
        """Return the worn depth divided by eta at positions that the border has passed."""
        result = np.empty_like(place)
        frozen_depth(self.body, np.stack(rising(path)), place, result)
        return result

    def _last_move(self, path: FloatArray) -> int:
        """Return the index of the last pair of the path for which the border moved."""
        return path.shape[1] - 1 if self.border is None else self.since

    def worn_depth(self, moment: Pressed, q: FloatArray) -> FloatArray:
        """Return the worn depth divided by eta at a moment, at positions between border and edge; 0 beyond the edge."""
        place = self.place(moment.unknowns)
        z = (q - place.border) / place.width
        if self.border is None:
            return interpolate(self.panels.mesh, moment.accumulated, z)
        rooted = (moment.accumulated - self.frozen) / np.sqrt(self.panels.nodes)
        inside = np.maximum(z, 0.0)
        return np.where(z < 1.0, self.frozen + np.sqrt(inside) * interpolate(self.panels.mesh, rooted, inside), 0.0)

    def slip(self, unknowns: FloatArray) -> FloatArray:
        """Return s at the nodes."""
        return np.asarray(self.panels.inner @ (self.image(unknowns) * self._factor(self.place(unknowns))))

    def rate(self, unknowns: FloatArray) -> FloatArray:
        """Return p / eta at the nodes; zero at the edge, where nothing wears."""
        result = self.panels.outer @ self.image(unknowns) / np.sqrt(self.body.width * self.place(unknowns).width)
        result[-1] = 0.0
        return np.asarray(result)

    def _factor(self, place: Place) -> FloatArray:
        """Return sqrt(a^2 - b^2) / r at the nodes."""
        inner = (self.body.square + self.body.width * place.border) / (self.body.width * place.width)
        return 1.0 / np.sqrt(inner + self.panels.nodes)

    @cached_property
    def at_border(self) -> FloatArray:
        """The weights that extrapolate from the nodes of the first panel to the border."""
        mesh = self.panels.mesh
        weights = mesh.barycentric[0, -mesh.order :] / mesh.nodes[: mesh.order]
        shares = np.zeros(mesh.nodes.size)
        shares[: mesh.order] = weights / np.sum(weights)
        return shares

    def residual(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        """Return s - known - theta (p / eta) s at the nodes, then the deviation of the force.

        If the border moves, the last row is y at the border, which has to be zero.
        """
        size, y, place = self.size, self.image(unknowns), self.place(unknowns)
        root, factor = math.sqrt(self.body.width * place.width), self._factor(place)
        slip, rate = self.panels.inner @ (y * factor), self.panels.outer @ y
        rate[-1] = 0.0
        rows = np.empty(unknowns.size)
        rows[:size] = slip * (1.0 - theta / root * rate) - known[:size]
        rows[size] = known[-1] + 0.5 * root * (self.panels.weights @ ((1.0 - y) * factor)) - self.virgin_load
        if self.border is None:
            rows[-1] = self.at_border @ y
        return rows

    def jacobian(self, unknowns: FloatArray, theta: float) -> FloatArray:
        """Return the derivatives of the residual with respect to y."""
        place = self.place(unknowns)
        size, root, factor = self.size, np.sqrt(self.body.width * place.width), self._factor(place)
        slip, rate = self.slip(unknowns), self.rate(unknowns)
        slip[-1] = 0.0
        result = np.zeros((unknowns.size, unknowns.size))
        result[:size, :size] = (1.0 - theta * rate)[:, None] * self.panels.inner * factor
        result[:size, :size] -= theta / root * slip[:, None] * self.panels.outer
        result[size, :size] = -0.5 * root * self.panels.weights * factor
        if self.border is None:
            result[-1, :size] = self.at_border
        return result

    def sticking_load(self, before: Pressed, place: Place) -> float:
        """Return (int_0^b (d - g) dx - int_0^c (1 - g) dx) / eta, the additional load of the stick zone.

        The moment `before` precedes the border and depth of `place`.
        """
        border, depth = before.path[:, -1]
        return float(sticking_load(self.body, border, depth, before.carried, place))

    def slipping_load(self, unknowns: FloatArray) -> float:
        """Return int_b^a (d - g) dx / eta, the load of the slip zone."""
        place = self.place(unknowns)
        share = (1.0 - self.image(unknowns)) * self._factor(place)
        return float(0.5 * np.sqrt(self.body.width * place.width) * self.panels.weights @ share)

    def worn(self, unknowns: FloatArray) -> FloatArray:
        """Return the quantities whose step error is controlled: s at the nodes, the depth, and a moving border."""
        weight = BORDER_WEIGHT * (1.0 - self.virgin.inner_radius) / self.eta
        tail = unknowns[self.size :] * ([1.0, weight] if self.border is None else 1.0)
        return np.append(self.slip(unknowns), tail)

    def moment(
        self, time: float, unknowns: FloatArray, theta: float, known: FloatArray, past: Sequence[Pressed]
    ) -> Pressed:
        """Return the moment at the end of a solved step.

        Its worn depth is the past contribution plus the wear in the step.
        """
        size, place, before = self.size, self.place(unknowns), past[0]
        worn = known[size : 2 * size] + theta * self.rate(unknowns) * self.slip(unknowns)
        path = onward(before.path, place)
        moved = self.plateau_rise(path[:, : self._last_move(path) + 1], place.border + place.width * self.mesh.nodes)
        further = self.radius(place.border) - self.radius(before.border)
        carried = before.carried + further * (1.0 - 0.5 * (before.path[1, -1] + place.depth))
        return Pressed(time, unknowns, worn, path, moved, carried)

    def wear_rate(self, unknowns: FloatArray) -> float:
        """Return dV/dN = 2 int_b^a (d - g) y dx, the energy dissipated per cycle, divided by mu."""
        y, place = self.image(unknowns), self.place(unknowns)
        root = np.sqrt(self.body.width * place.width)
        return float(self.eta * root * self.panels.weights @ (y * (1.0 - y) * self._factor(place)))


def forced_slip(
    profile: Profile, stick_radius: float, panels: Panels, reach: float, newton: float = 1e-5
) -> ForcedSlip:
    """Return the problem of partial slip under the constant force of the virgin contact."""
    virgin = partial_slip(profile, stick_radius, panels, reach)
    y, factor = virgin.image(settled(virgin).unknowns)
    load = 0.5 * np.sqrt(virgin.virgin_width) * panels.weights @ ((1.0 - y) * factor)
    return ForcedSlip(virgin, float(load), 0.0, frozen=0.0, newton=newton)


def rising(path: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the positions that the border reached for the first time, and the depths at these moments."""
    furthest = np.maximum.accumulate(path[0])
    new = np.append(True, np.diff(furthest) > 0.0)
    return furthest[new], path[1, new]


def onward(path: FloatArray, place: Place) -> FloatArray:
    """Return the path with the border and depth of `place` appended."""
    return np.append(path, [[place.border], [place.depth]], axis=1)


@jit
def fill_known(mesh: Mesh, body: VirginBody, past: Past, place: Place, result: FloatArray) -> None:
    """Write the past contributions to s and to the worn depth at the nodes, and the sticking load, to `result`."""
    nodes, path, stopped = result.size // 2, past.path, past.frozen == past.frozen
    last = path.shape[1] - 1
    for i in range(nodes):
        q = place.border + place.width * mesh.nodes[i]
        worn = 0.0
        for k in range(past.shares.size if i < nodes - 1 else 0):  # the worn depth at the edge is zero
            z = (q - past.borders[k]) / past.widths[k]
            if z < 1.0:
                value = value_at(mesh, past.worn[k], z)
                worn += past.shares[k] * (past.frozen + math.sqrt(z) * value if stopped else value)
        z = (q - past.borders[0]) / past.widths[0]
        rise = value_at(mesh, past.moved, z) if z < mesh.edges[-1] else _rise(body, path, last, q)
        square = body.square + body.width * q
        angle = _mean_angle(square, body.width, _root(q, path[0, last]), _root(q, place.border))
        rise += 2.0 / math.pi * angle * (place.depth - path[1, last])
        result[i] = math.exp(log_slip(body.slip, body.width * max(q, SMALLEST))) - rise + worn
        result[nodes + i] = worn
    result[2 * nodes] = sticking_load(body, path[0, last], path[1, last], past.carried, place)


@jit_inline
def sticking_load(body: VirginBody, border: float, depth: float, carried: float, place: Place) -> float:
    """Return (int_0^b (d - g) dx - int_0^c (1 - g) dx) / eta, the additional load of the stick zone."""
    radius = math.sqrt(body.square + body.width * border)
    further = body.width * (place.border - border) / (radius + math.sqrt(body.square + body.width * place.border))
    return radius * place.depth + carried + further * (0.5 * (place.depth - depth) + 1.0)


@jit
def plateau_rise(body: VirginBody, path: FloatArray, place: FloatArray, result: FloatArray) -> None:
    """Write (2/pi) int arccos(b / r) dd along a path of straight pieces to `result`, at radii outside all borders."""
    for i in range(place.size):
        result[i] = _rise(body, path, path.shape[1] - 1, place[i])


@jit
def frozen_depth(body: VirginBody, path: FloatArray, place: FloatArray, result: FloatArray) -> None:
    """Write the worn depth divided by eta, at positions that the border has passed, to `result`.

    The border must only grow along the path.
    """
    for i in range(place.size):
        q = place[i]
        if q <= 0.0:
            result[i] = 0.0
            continue
        before = np.searchsorted(path[0], q) - 1
        rise = _rise(body, path, before, q)
        if before + 1 < path.shape[1]:
            share = (q - path[0, before]) / (path[0, before + 1] - path[0, before])
            angle = _mean_angle(body.square + body.width * q, body.width, _root(q, path[0, before]), 0.0)
            rise += 2.0 / math.pi * angle * share * (path[1, before + 1] - path[1, before])
        result[i] = rise - math.exp(log_slip(body.slip, body.width * max(q, SMALLEST)))


@jit
def _rise(body: VirginBody, path: FloatArray, last: int, q: float) -> float:
    """Return the rise of the plateau at the position q, along the path up to the pair with the index `last`."""
    square, total = body.square + body.width * q, 0.0
    first = _root(q, path[0, 0])
    for k in range(1, last + 1):
        end = _root(q, path[0, k])
        total += _mean_angle(square, body.width, first, end) * (path[1, k] - path[1, k - 1])
        first = end
    return 2.0 / math.pi * total


@jit_inline
def _root(q: float, border: float) -> float:
    return math.sqrt(max(q - border, 0.0))


@jit_inline
def _mean_angle(square: float, width: float, first: float, last: float) -> float:
    """Return the mean of arccos(b / r) along a straight piece of the path.

    The integration variable is sqrt(r^2 - b^2), because the integrand is smooth in it; `first` and `last` are its
    values at the ends of the piece.
    """
    scale = math.sqrt(width / square)
    whole = first + last
    spread = (first - last) / whole if whole > 0.0 else 0.0
    if abs(spread) < SHORT:
        return math.asin(min(0.5 * scale * whole, 1.0)) * (1.0 + spread * spread / 3.0)
    mean, weights = 0.0, 0.0
    for node in range(_ABSCISSA.size):
        root = first + (last - first) * _ABSCISSA[node]
        mean += _WEIGHT[node] * root * math.asin(min(scale * root, 1.0))
        weights += _WEIGHT[node] * root
    return mean / weights
