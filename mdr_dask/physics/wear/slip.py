"""The equations of one time step of partial slip and of gross slip, for `evolution.march`.

In partial slip, squared radii are given as q = (r^2 - c^2) / (1 - c^2), depths as (d - 1) / eta, and worn depths are
divided by eta. With these definitions, the unknowns are of the order of one even near full stick.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.jit import jit, jit_inline
from mdr_dask.physics.mdr.half_integrals import Mesh, Panels, interpolate, value_at
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.refine import CLOSE

#: In the error of a time step, the weight of the stick border is this factor times (1 - c) / eta, and the weight of the
#: depth is 1. The factor is large because f rises like a square root beyond the border.
BORDER_WEIGHT = 30.0
_ABSCISSA, _WEIGHT = gauss(3)


@dataclass(frozen=True, eq=False)
class Moment:
    """The contact at one `time`: the number of cycles N in partial slip, or the sliding distance s in gross slip.

    `unknowns`, all of the order of one, begin with the image at all nodes except the last. The next unknown is the
    difference of r^2 between the edge and the inner border, divided by this difference in the virgin contact. The other
    unknowns depend on the problem. `accumulated`, shape (nodes,), is the worn depth, which is zero at the edge.
    """

    time: float
    unknowns: FloatArray
    accumulated: FloatArray


class VirginBody(NamedTuple):
    """The virgin body for compiled code: `square` = c^2, `width` = 1 - c^2, and a cubic spline of ln s0 against ln q.

    `first` and `step` are the first knot and the knot spacing of the spline. The virgin slip is s0(r) = (2/pi) int_c^r
    (g0(x) - g0(c)) / (eta sqrt(r^2 - x^2)) dx.
    """

    square: float
    width: float
    first: float
    step: float
    coefficients: FloatArray


class Place(NamedTuple):
    """Border b and width of the slip zone, and depth d.

    `border` is (b^2 - c^2) / (1 - c^2), `width` is (a^2 - b^2) / (1 - c^2), and `depth` is (d - 1) / eta.
    """

    border: float
    width: float
    depth: float


class Past(NamedTuple):
    """Past contacts, the newest first. `shares` are the weights of these contacts in the BDF formula of one time step.

    `worn` has the shape (contacts, nodes). At constant depth (`is_growth` is True), `worn` contains ln(s / s0), because
    s grows exponentially from a very small s0. Under constant force, `worn` contains the worn depths as long as the
    stick border moves, and `frozen` is NaN. If the border no longer moves, `frozen` is the worn depth at the border,
    and `worn` contains (worn depth - `frozen`) / sqrt(z), where z is the position on the panels. `path` and `moved`
    belong to the newest contact (see `SlipMoment`), and `carried` is the result of `PartialSlip.carried`.
    """

    shares: FloatArray
    borders: FloatArray
    widths: FloatArray
    worn: FloatArray
    is_growth: bool
    frozen: float
    moved: FloatArray
    path: FloatArray
    carried: float


@dataclass(frozen=True, eq=False)
class SlipMoment(Moment):
    """A contact in partial slip at one time.

    `path`, shape (2, k), contains the stick border and the depth (see `Place`) at the start, and after every time step
    in which the border could move. Between these points, the depth is a linear function of the border. `moved`, one
    value per node, is the rise of f_star along the whole path (see `PartialSlip`).
    """

    path: FloatArray
    moved: FloatArray


@dataclass(frozen=True, eq=False)
class PartialSlip:
    """Partial slip: outside the stick border b, the slip is s = (f - f_star) / eta, where f is the worn profile.

    If the border passes a radius when the depth is d1, the image there is g = d1 - eta from then on. At the depth d,
    f_star is the profile of an image that equals g up to b, and d - eta beyond b (the plateau). While the plateau rises
    by dd, f_star rises by (2/pi) arccos(b / r) dd. Therefore only the path (b, d) is stored. At constant depth, the
    border b stays at the stick radius c of the virgin contact. Under constant force, the border moves outwards until
    the image has a jump at the border.

    The unknowns are y = 1 - (d - g) / eta at all nodes except the last node (where y = 1), and the width of the slip
    zone. Under constant force, the depth is a further unknown. As long as the border moves, the last unknown is the
    border. `load` is half of the force on the virgin slip zone, divided by eta. At constant depth, `load` is None. If
    the border does not move, `border` is the value of q at the border, and `frozen` is the worn depth there. If the
    border moves, `border` is None.
    """

    profile: Profile
    inner_radius: float
    eta: float
    body: VirginBody
    panels: Panels
    load: float | None = None
    border: float | None = 0.0
    frozen: float = 0.0

    @cached_property
    def size(self) -> int:
        """The number of nodes."""
        return self.panels.nodes.size

    def image(self, unknowns: FloatArray) -> FloatArray:
        """Return y (see `PartialSlip`) at all nodes."""
        y = unknowns[: self.size].copy()
        y[-1] = 1.0
        return y

    def place(self, unknowns: FloatArray) -> Place:
        """Return border and width of the slip zone, and the depth."""
        border = float(unknowns[-1]) if self.border is None else self.border
        return Place(border, float(unknowns[self.size - 1]), 0.0 if self.load is None else float(unknowns[self.size]))

    def holds(self, unknowns: FloatArray) -> bool:
        """Return whether the slip zone has a positive width, and b^2 > c^2 / 2 for the border b."""
        place = self.place(unknowns)
        return place.width > 0.0 and self.body.width * place.border > -0.5 * self.body.square

    def admits(self, unknowns: FloatArray) -> bool:
        """Return whether y >= 0 in the slip zone (if the border moves), or s >= 0 (if the border does not move).

        Values down to -`CLOSE` are admitted.
        """
        positive = unknowns[: self.size - 1] if self.border is None else self.slip(unknowns)
        return bool(np.min(positive) >= -CLOSE)

    def radius(self, place: float) -> float:
        """Return the radius r for a value of q."""
        return math.sqrt(self.body.square + self.body.width * place)

    def edge(self, unknowns: FloatArray) -> float:
        """Return the contact radius."""
        place = self.place(unknowns)
        return self.radius(place.border + place.width)

    def start(self) -> SlipMoment:
        """Return the virgin contact."""
        y, c = np.ones(self.size), self.inner_radius
        square = self.body.width * self.panels.nodes
        gap = square / (np.sqrt(c * c + square) + c)
        y[:-1] = self.profile.rise(gap, c)[:-1] / self.eta
        return SlipMoment(0.0, y, np.zeros(self.size), np.zeros((2, 1)), np.zeros(self.panels.nodes.size))

    def under_force(self, virgin: SlipMoment) -> tuple[PartialSlip, SlipMoment]:
        """Return the problem with constant force instead of constant depth, and the contact with which it starts.

        `virgin` is the virgin contact as a solution of the discrete equations.
        """
        forced = replace(self, load=self.slipping_load(virgin.unknowns), border=None, frozen=np.nan)
        return forced, replace(virgin, unknowns=np.append(virgin.unknowns, [0.0, 0.0]))

    def stop(self, moment: SlipMoment) -> tuple[PartialSlip, SlipMoment]:
        """Return the problem in which the border no longer moves, and the contact with which this problem starts."""
        border = moment.path[0, -1:]
        still = replace(self, border=float(border[0]), frozen=float(self.frozen_depth(moment.path, border)[0]))
        return still, replace(moment, unknowns=moment.unknowns[:-1])

    def memory(self, past: Sequence[SlipMoment], shares: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Return a function that computes from the unknowns how past contacts contribute to the residual.

        The function returns the contributions to s and to the worn depth, and the increase of the load of the stick
        zone.
        """
        places = [self.place(moment.unknowns) for moment in past]
        worn = np.array([moment.accumulated for moment in past])
        if self.load is None:
            virgin = np.array([_virgin_slip(self.body, place.width * self.panels.nodes) for place in places])
            worn = np.log1p(np.maximum(worn, 0.0) / virgin)
        elif self.border is not None:
            worn = (worn - self.frozen) / np.sqrt(self.panels.nodes)
        earlier = Past(
            shares,
            np.array([place.border for place in places]),
            np.array([place.width for place in places]),
            worn,
            self.load is None,
            self.frozen,
            past[0].moved,
            past[0].path,
            self.carried(past[0].path),
        )
        return lambda unknowns: _known(self.panels.mesh, self.body, earlier, self.place(unknowns))

    def frozen_depth(self, path: FloatArray, place: FloatArray) -> FloatArray:
        """Return the worn depth at values of q that the border has passed. For q <= 0, the worn depth is 0."""
        depth = _plateau_rise(self.body, np.stack(rising(path)), place) - _virgin_slip(self.body, place)
        return np.where(place > 0.0, depth, 0.0)

    def worn_depth(self, moment: SlipMoment, q: FloatArray) -> FloatArray:
        """Return the worn depth at values of q. The worn depth beyond the edge is 0."""
        place = self.place(moment.unknowns)
        z = (q - place.border) / place.width
        inside = np.clip(z, 0.0, 1.0)
        if self.border is None:
            slipping = interpolate(self.panels.mesh, moment.accumulated, inside)
        else:
            rooted = (moment.accumulated - self.frozen) / np.sqrt(self.panels.nodes)
            slipping = self.frozen + np.sqrt(inside) * interpolate(self.panels.mesh, rooted, inside)
        frozen = self.frozen_depth(moment.path, np.minimum(q, place.border))
        return np.where(z < 0.0, frozen, np.where(z < 1.0, slipping, 0.0))

    def slip(self, unknowns: FloatArray) -> FloatArray:
        """Return the slip s at the nodes."""
        return np.asarray(self.panels.inner @ (self.image(unknowns) * self._factor(self.place(unknowns))))

    def rate(self, unknowns: FloatArray) -> FloatArray:
        """Return p / eta at the nodes. The value at the edge is set to zero, because nothing wears there."""
        result = self.panels.outer @ self.image(unknowns) / np.sqrt(self.body.width * self.place(unknowns).width)
        result[-1] = 0.0
        return np.asarray(result)

    def _factor(self, place: Place) -> FloatArray:
        """Return sqrt(a^2 - b^2) / r at the nodes."""
        inner = (self.body.square + self.body.width * place.border) / (self.body.width * place.width)
        return 1.0 / np.sqrt(inner + self.panels.nodes)

    @cached_property
    def at_border(self) -> FloatArray:
        """The weights that extrapolate values at the nodes of the first panel to the border."""
        mesh = self.panels.mesh
        weights = mesh.barycentric[0, -mesh.order :] / mesh.nodes[: mesh.order]
        shares = np.zeros(mesh.nodes.size)
        shares[: mesh.order] = weights / np.sum(weights)
        return shares

    def residual(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        """Return s - known - theta (p / eta) s at the nodes. The value at the edge is zero if s is continuous there.

        `theta` is the weight of the wear rate in the BDF formula, and `known` is computed by the function of `memory`.
        Under constant force, the next value is the computed load minus `load`. If the border moves, the last value is y
        at the border.
        """
        size, y, place = self.size, self.image(unknowns), self.place(unknowns)
        root, factor = math.sqrt(self.body.width * place.width), self._factor(place)
        slip, rate = self.panels.inner @ (y * factor), self.panels.outer @ y
        rate[-1] = 0.0
        rows = np.empty(unknowns.size)
        rows[:size] = slip * (1.0 - theta / root * rate) - known[:size]
        if self.load is not None:
            rows[size] = known[-1] + 0.5 * root * (self.panels.weights @ ((1.0 - y) * factor)) - self.load
        if self.border is None:
            rows[-1] = self.at_border @ y
        return rows

    def jacobian(self, unknowns: FloatArray, theta: float) -> FloatArray:
        """Return the derivatives of the residual with respect to y. The other columns are set in `evolution`."""
        place = self.place(unknowns)
        size, root, factor = self.size, np.sqrt(self.body.width * place.width), self._factor(place)
        slip, rate = self.slip(unknowns), self.rate(unknowns)
        slip[-1] = 0.0
        result = np.zeros((unknowns.size, unknowns.size))
        result[:size, :size] = (1.0 - theta * rate)[:, None] * self.panels.inner * factor
        result[:size, :size] -= theta / root * slip[:, None] * self.panels.outer
        if self.load is not None:
            result[size, :size] = -0.5 * root * self.panels.weights * factor
        if self.border is None:
            result[-1, :size] = self.at_border
        return result

    def carried(self, path: FloatArray) -> float:
        """Return the integral of (1 - d) over the border radius b along a path, where d is `Place.depth`."""
        radii = np.sqrt(self.body.square + self.body.width * path[0])
        steps = self.body.width * np.diff(path[0]) / (radii[1:] + radii[:-1])
        return float(steps @ (1.0 - 0.5 * (path[1, 1:] + path[1, :-1])))

    def slipping_load(self, unknowns: FloatArray) -> float:
        """Return the load of the slip zone, int_b^a (d - g) dx / eta."""
        place = self.place(unknowns)
        share = (1.0 - self.image(unknowns)) * self._factor(place)
        return float(0.5 * np.sqrt(self.body.width * place.width) * self.panels.weights @ share)

    def worn(self, unknowns: FloatArray) -> FloatArray:
        """Return the quantities whose errors limit the time step.

        These are s, under constant force also the depth, and, as long as the border moves, the weighted border.
        """
        weight = BORDER_WEIGHT * (1.0 - self.inner_radius) / self.eta
        tail = unknowns[self.size :] * ([1.0, weight] if self.border is None else 1.0)
        return np.append(self.slip(unknowns), tail)

    def moment(
        self, time: float, unknowns: FloatArray, theta: float, known: FloatArray, past: Sequence[SlipMoment]
    ) -> SlipMoment:
        """Return the contact at the end of a solved time step."""
        size, place = self.size, self.place(unknowns)
        worn = known[size : 2 * size] + theta * self.rate(unknowns) * self.slip(unknowns)
        path = past[0].path
        if self.border is None:
            path = np.append(path, [[place.border], [place.depth]], axis=1)
        moved = _plateau_rise(self.body, path, place.border + place.width * self.panels.nodes)
        return SlipMoment(time, unknowns, worn, path, moved)


def partial_slip(profile: Profile, stick_radius: float, panels: Panels, reach: float) -> PartialSlip:
    """Return the problem at constant depth, with the virgin slip tabulated up to the radius `reach`."""
    c, width = stick_radius, (1.0 - stick_radius) * (1.0 + stick_radius)
    eta = float(profile.rise(np.array(1.0 - c), c))
    table = np.linspace(np.log(0.5 * panels.nodes[0]), np.log((reach - c) * (reach + c) / width), 300)
    root = np.sqrt(width) * np.exp(0.5 * table)
    r = np.hypot(c, root)
    abscissa, weight = gauss(40)
    span = np.arctan2(root, c)
    angle = span[:, None] * abscissa
    # x - c = r (cos(angle) - cos(span)), written as a product to avoid cancellation
    gap = 2.0 * r[:, None] * np.sin(0.5 * (span[:, None] + angle)) * np.sin(0.5 * (span[:, None] - angle))
    slip = 2.0 / np.pi * span * (profile.rise(gap, c) @ weight) / eta
    coefficients = np.ascontiguousarray(CubicSpline(table, np.log(slip)).c)
    body = VirginBody(c * c, width, float(table[0]), float(table[1] - table[0]), coefficients)
    return PartialSlip(profile, c, eta, body, panels)


def rising(path: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return border and depth at the points of a path where the border is farther out than at all earlier points."""
    furthest = np.maximum.accumulate(path[0])
    new = np.append(True, np.diff(furthest) > 0.0)
    return furthest[new], path[1, new]


@jit
def _known(mesh: Mesh, body: VirginBody, past: Past, place: Place) -> FloatArray:
    """Return the contributions described in `PartialSlip.memory` in one array."""
    nodes, path, is_still = past.worn.shape[1], past.path, past.frozen == past.frozen
    result = np.empty(2 * nodes + 1)
    border, depth = path[0, -1], path[1, -1]
    for i in range(nodes):
        q = place.border + place.width * mesh.nodes[i]
        virgin, worn = _slip_at(body, q), 0.0
        for k in range(past.shares.size if i < nodes - 1 else 0):  # the worn depth at the edge is zero
            z = (q - past.borders[k]) / past.widths[k]
            if z < 1.0:
                value = value_at(mesh, past.worn[k], z)
                if past.is_growth:
                    value = virgin * math.expm1(value)
                elif is_still:
                    value = past.frozen + math.sqrt(z) * value
                worn += past.shares[k] * value
        z = (q - past.borders[0]) / past.widths[0]
        rise = value_at(mesh, past.moved, z) if z < 1.0 else _rise(body, path, q)
        rise += _piece(body, border, place.border, place.depth - depth, q)
        result[i] = virgin - rise + worn
        result[nodes + i] = worn
    first, last = math.sqrt(body.square + body.width * border), math.sqrt(body.square + body.width * place.border)
    step = body.width * (place.border - border) / (first + last)
    # b d + int (1 - d) db along the path, d = `Place.depth`; terms of the last step are combined to avoid cancellation
    result[2 * nodes] = first * place.depth + past.carried + step * (1.0 + 0.5 * (place.depth - depth))
    return result


@jit_inline
def _slip_at(body: VirginBody, q: float) -> float:
    """Return the virgin slip s0 at q."""
    place = math.log(max(q, 1e-30)) - body.first
    cell = min(max(int(place / body.step), 0), body.coefficients.shape[1] - 1)
    local, k = place - cell * body.step, body.coefficients
    return math.exp(((k[0, cell] * local + k[1, cell]) * local + k[2, cell]) * local + k[3, cell])


@jit
def _virgin_slip(body: VirginBody, places: FloatArray) -> FloatArray:
    result = np.empty_like(places)
    for i in range(places.size):
        result[i] = _slip_at(body, places[i])
    return result


@jit
def _plateau_rise(body: VirginBody, path: FloatArray, places: FloatArray) -> FloatArray:
    result = np.empty_like(places)
    for i in range(places.size):
        result[i] = _rise(body, path, places[i])
    return result


@jit
def _rise(body: VirginBody, path: FloatArray, q: float) -> float:
    """Return the rise of f_star at q: 2/pi times the integral of arccos(b / r) over the depth, where b < r."""
    total = 0.0
    for k in range(1, path.shape[1]):
        total += _piece(body, path[0, k - 1], path[0, k], path[1, k] - path[1, k - 1], q)
    return total


@jit_inline
def _piece(body: VirginBody, first: float, last: float, change: float, q: float) -> float:
    """Return the rise of f_star at q on a straight piece of the path. Along the piece, the depth rises by `change`."""
    low, high = min(first, last), max(first, last)
    if low >= q:
        return 0.0
    if high > q:
        change *= (q - low) / (high - low)
    # the integrand is a smooth function of sqrt(r^2 - b^2)
    scale = math.sqrt(body.width / (body.square + body.width * q))
    begin, end = math.sqrt(max(q - first, 0.0)), math.sqrt(max(q - last, 0.0))
    mean, weights = 0.0, 0.0
    for node in range(_ABSCISSA.size):
        root = begin + (end - begin) * _ABSCISSA[node]
        mean += _WEIGHT[node] * root * math.asin(min(scale * root, 1.0))
        weights += _WEIGHT[node] * root
    return 2.0 / math.pi * change * mean / weights


@dataclass(frozen=True, eq=False)
class GrossSlip:
    """Slip in the whole contact. The nodes lie at r^2 = z a^2, where z are the nodes of `panels`, between 0 and 1.

    The unknowns are the image g at all nodes except the last node (where g = d), the squared contact radius a^2 and, if
    the force is given, the depth d. The accumulated quantity is the worn depth int p ds.
    """

    profile: Profile
    panels: Panels
    force: float | None = None

    def edge(self, unknowns: FloatArray) -> float:
        """Return the contact radius a."""
        return math.sqrt(unknowns[self.panels.nodes.size - 1])

    def holds(self, unknowns: FloatArray) -> bool:
        """Return whether the squared contact radius is positive."""
        return bool(unknowns[self.panels.nodes.size - 1] > 0.0)

    def admits(self, unknowns: FloatArray) -> bool:
        """Return True, because all known solutions of the equations are possible contacts."""
        return True

    def start(self) -> Moment:
        """Return the virgin contact."""
        unknowns = np.ones(self.panels.nodes.size + (self.force is not None))
        unknowns[: self.panels.nodes.size - 1] = self.profile.image(np.sqrt(self.panels.nodes[:-1]))
        return Moment(0.0, unknowns, np.zeros(self.panels.nodes.size))

    def memory(self, past: Sequence[Moment], shares: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Return a function that computes, from the unknowns, the weighted sum of the past worn depths at the nodes."""
        last = self.panels.nodes.size - 1

        def known(unknowns: FloatArray) -> FloatArray:
            result = np.zeros(self.panels.nodes.size)
            for share, moment in zip(shares, past, strict=True):
                stretch = unknowns[last] / moment.unknowns[last]
                result += share * interpolate(self.panels.mesh, moment.accumulated, self.panels.nodes * stretch)
            return result

        return known

    def moment(
        self, time: float, unknowns: FloatArray, theta: float, known: FloatArray, past: Sequence[Moment]
    ) -> Moment:
        """Return the contact at the end of a solved time step. `known` is the contribution of the past contacts."""
        return Moment(time, unknowns, self._accumulated(unknowns, theta, known))

    def image(self, unknowns: FloatArray) -> FloatArray:
        """Return the image g at all nodes. The last value is the depth."""
        return np.append(unknowns[: self.panels.nodes.size - 1], 1.0 if self.force is None else unknowns[-1])

    def rate(self, unknowns: FloatArray) -> FloatArray:
        """Return the pressure p at the nodes, to which the rate of wear is proportional."""
        return np.asarray(self.panels.outer @ self.image(unknowns) / self.edge(unknowns))

    def worn(self, unknowns: FloatArray) -> FloatArray:
        """Return the worn profile f at the nodes."""
        return np.asarray(self.panels.full @ self.image(unknowns))

    def normal_force(self, unknowns: FloatArray) -> float:
        """Return the normal force F_N = 2 int_0^a (d - g) dx."""
        image = self.image(unknowns)
        # the last row of `full` times the values u sqrt(1 - z) is the integral of u / (pi sqrt(z)) over z from 0 to 1
        load = (image[-1] - image) * np.sqrt(1.0 - self.panels.nodes)
        return float(np.pi * self.edge(unknowns) * self.panels.full[-1] @ load)

    def _accumulated(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        accumulated = known + theta * self.rate(unknowns)
        accumulated[-1] = 0.0
        return accumulated

    def residual(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        """Return f - f0 - known - theta p at the nodes and, if the force is given, the computed force minus the given
        force.

        The last node is the edge. The value at the edge is zero if f is continuous there.
        """
        virgin = self.profile.height(self.edge(unknowns) * np.sqrt(self.panels.nodes))
        rows = self.worn(unknowns) - virgin - self._accumulated(unknowns, theta, known)
        return rows if self.force is None else np.append(rows, self.normal_force(unknowns) - self.force)

    def jacobian(self, unknowns: FloatArray, theta: float) -> FloatArray:
        """Return the derivatives of the residual with respect to g. The other columns are set in `evolution`."""
        a, nodes = self.edge(unknowns), self.panels.nodes.size
        result = np.zeros((unknowns.size, unknowns.size))
        result[:nodes, :nodes] = self.panels.full
        result[: nodes - 1, :nodes] -= theta / a * self.panels.outer[:-1]
        if self.force is not None:
            result[-1, :nodes] = -np.pi * a * self.panels.full[-1] * np.sqrt(1.0 - self.panels.nodes)
        return result
