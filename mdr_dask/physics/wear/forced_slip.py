"""Partial slip under constant force as the equations of one step for `evolution.march`.

The depth d grows, and the stick border b moves outwards until the image jumps there; then it stands. The image of what
sticks is frozen: g(b) = d - eta at the time when the border passed. The slip is s = (f - f_star) / eta, and f_star, the
plateau behind the border, only changes as df_star = (2/pi) arccos(b / r) dd, so that the path (b, d) is all there is to
remember of the annulus between the first border c and the present one.

Every radius gathers its worn depth over eta. Squared radii are counted from c^2 in units of the virgin 1 - c^2, and the
depth from 1 in units of eta: all unknowns are of the order of one, next to full stick too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numba import njit

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.half_integrals import Panels, interpolate
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear.evolution import Moment, settled
from mdr_dask.physics.wear.slip import PartialSlip, partial_slip

#: How much more closely steps follow the border than the depth: f rises beyond it as a root.
BORDER_WEIGHT = 30.0
#: Floor of (r^2 - c^2) / (1 - c^2).
SMALLEST = 1e-30


@dataclass(frozen=True, eq=False)
class Pressed(Moment):
    """A moment under constant force.

    Parameters
    ----------
    path : array, shape (2, k)
        All pairs of border and depth up to this moment, joined by straight lines; the last is that of the moment.
    moved : array, shape (n,)
        `plateau_rise` of the part of the path on which the border moved, at the nodes.
    """

    path: FloatArray
    moved: FloatArray

    @property
    def border(self) -> float:
        """The border."""
        return float(self.path[0, -1])


@dataclass(frozen=True, eq=False)
class ForcedSlip:
    """Slip outside the stick border under constant force.

    Unknowns: y = 1 - (d - g) / eta at the nodes but the last, the width of the panels, the depth, and the border unless
    `border` says where it stands; `stood` is then the number of the pair of the path that it stands from, and
    `frozen` the worn depth at it. Loads are half
    forces over eta; `virgin_load` is that of the virgin slip zone.
    """

    virgin: PartialSlip
    virgin_load: float
    border: float | None = None
    stood: int = 0
    frozen: float = 0.0
    newton: ClassVar[float] = 1e-5

    @property
    def panels(self) -> Panels:
        """The panels between the border and the edge."""
        return self.virgin.panels

    @property
    def profile(self) -> Profile:
        """The virgin body."""
        return self.virgin.profile

    @property
    def eta(self) -> float:
        """The share of the first depth that the amplitude makes slip."""
        return self.virgin.eta

    def split(self, unknowns: FloatArray) -> tuple[FloatArray, float, float, float]:
        """Return y at all nodes, the width, the depth and the border."""
        size = self.panels.nodes.size
        y = unknowns[:size].copy()
        y[-1] = 1.0
        border = float(unknowns[-1]) if self.border is None else self.border
        return y, float(unknowns[size - 1]), float(unknowns[size]), border

    def holds(self, unknowns: FloatArray) -> bool:
        """Tell whether unknowns describe a contact."""
        _, width, _, border = self.split(unknowns)
        return width > 0.0 and self.virgin.virgin_width * border > -0.5 * self.virgin.inner_radius**2

    def places(self, unknowns: FloatArray) -> FloatArray:
        """Return the squared radii of the nodes, counted from c^2."""
        _, width, _, border = self.split(unknowns)
        return np.asarray(border + width * self.panels.nodes)

    def radius(self, place: float) -> float:
        """Return the radius at a squared radius counted from c^2."""
        return float(np.sqrt(self.virgin.inner_radius**2 + self.virgin.virgin_width * place))

    def start(self) -> Pressed:
        """Return the virgin contact."""
        first = self.virgin.start()
        return Pressed(0.0, np.append(first.unknowns, 0.0), first.gathered, np.zeros((2, 1)), first.gathered)

    def move(self, moment: Pressed) -> tuple[ForcedSlip, Pressed]:
        """Return the problem, and its first moment, in which the border moves."""
        moved = self.plateau_rise(moment.path, self.places(moment.unknowns))
        return replace(self, border=None), replace(
            moment, unknowns=np.append(moment.unknowns, moment.border), moved=moved
        )

    def stand(self, moment: Pressed) -> tuple[ForcedSlip, Pressed]:
        """Return the problem, and its first moment, in which the border stays where it is."""
        frozen = float(self.frozen_depth(moment.path, np.array([moment.border]))[0])
        still = replace(self, border=moment.border, stood=moment.path.shape[1] - 1, frozen=frozen)
        return still, replace(moment, unknowns=moment.unknowns[:-1])

    def memory(self, past: Sequence[Pressed], shares: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Return, as a function of the unknowns, what is known of s, of the worn depth, and of the load that sticks."""

        def known(unknowns: FloatArray) -> FloatArray:
            _, _, depth, border = self.split(unknowns)
            q = self.places(unknowns)
            worn = sum(share * self.worn_depth(moment, q) for moment, share in zip(past, shares, strict=True))
            worn[-1] = 0.0  # nothing is worn at the edge
            slip = self.virgin_slip(q) - self._rise(past[0], border, depth, q) + worn
            return np.concatenate([slip, worn, [self.sticking_load(past[0].path, border, depth)]])

        return known

    def virgin_slip(self, place: FloatArray) -> FloatArray:
        """Return s of the virgin body at its first stick border."""
        return np.exp(self.virgin.virgin_slip(self.virgin.virgin_width * np.maximum(place, SMALLEST)))

    def plateau_rise(self, path: FloatArray, place: FloatArray) -> FloatArray:
        """Return (2/pi) int arccos(b / r) dd along a path, at places beyond it."""
        result = np.zeros_like(place)
        _plateau_rise(self.virgin.inner_radius, self.virgin.virgin_width, path, place, *gauss(3), result)
        return result

    def _rise(self, moment: Pressed, border: float, depth: float, place: FloatArray) -> FloatArray:
        """Return `plateau_rise` along the path of a moment and on, from its values at the moment's nodes."""
        turn = self._turn(moment.path)
        z = _share(moment, self.split(moment.unknowns)[1], place)
        rise = interpolate(self.panels, moment.moved, z)
        beyond = z >= 1.0
        rise[beyond] = self.plateau_rise(moment.path[:, : turn + 1], place[beyond])
        onward = _onward(moment.path[:, turn : turn + 1], border, depth)
        return np.asarray(rise + self.plateau_rise(onward, place))

    def _turn(self, path: FloatArray) -> int:
        """Return the number of the last pair of the path on which the border moved."""
        return path.shape[1] - 1 if self.border is None else self.stood

    def worn_depth(self, moment: Pressed, place: FloatArray) -> FloatArray:
        """Return the worn depth of a moment over eta, between its border and its edge, 0 beyond."""
        z = _share(moment, self.split(moment.unknowns)[1], place)
        if self.border is None:
            return interpolate(self.panels, moment.gathered, z)
        rooted = (moment.gathered - self.frozen) / np.sqrt(self.panels.nodes)
        inside = np.maximum(z, 0.0)
        return np.where(z < 1.0, self.frozen + np.sqrt(inside) * interpolate(self.panels, rooted, inside), 0.0)

    def frozen_depth(self, path: FloatArray, place: FloatArray) -> FloatArray:
        """Return the worn depth over eta that the border left at places it passed."""
        reached, depths = rising(path)
        result = np.zeros_like(place)
        for i, q in enumerate(place):
            if q > 0.0:
                before = reached < q
                d = np.interp(q, reached, depths)
                part = np.stack([np.append(reached[before], q), np.append(depths[before], d)])
                result[i] = (self.plateau_rise(part, place[i : i + 1]) - self.virgin_slip(place[i : i + 1]))[0]
        return result

    def slip(self, unknowns: FloatArray) -> FloatArray:
        """Return s at the nodes."""
        y, *_ = self.split(unknowns)
        return np.asarray(self.panels.inner @ (y * self._factor(unknowns)))

    def rate(self, unknowns: FloatArray) -> FloatArray:
        """Return p / eta at the nodes."""
        y, width, *_ = self.split(unknowns)
        return np.asarray(self.panels.outer @ y / np.sqrt(self.virgin.virgin_width * width))

    def _factor(self, unknowns: FloatArray) -> FloatArray:
        """Return sqrt(a^2 - b^2) / r at the nodes."""
        _, width, _, border = self.split(unknowns)
        whole = self.virgin.virgin_width
        return 1.0 / np.sqrt((self.virgin.inner_radius**2 + whole * border) / (whole * width) + self.panels.nodes)

    def at_border(self) -> FloatArray:
        """Return the weights that continue the first panel to the border."""
        order = self.panels.order
        nodes, weights = self.panels.nodes[:order], self.panels.barycentric[0, -order:]
        shares = np.zeros(self.panels.nodes.size)
        shares[:order] = weights / nodes / np.sum(weights / nodes)
        return shares

    def residual(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        """Return s - known - theta (p / eta) s at the nodes; then continuity at the edge, force, and y = 0 at b."""
        y, *_ = self.split(unknowns)
        slip, size = self.slip(unknowns), self.panels.nodes.size
        rows = np.zeros(unknowns.size)
        rate = theta * self.rate(unknowns)
        rate[-1] = 0.0
        rows[:size] = slip - known[:size] - rate * slip
        rows[size] = known[-1] + self.slipping_load(unknowns) - self.virgin_load
        if self.border is None:
            rows[-1] = self.at_border() @ y
        return rows

    def jacobian(self, unknowns: FloatArray, theta: float) -> FloatArray:
        """Return the derivatives by y."""
        _, width, *_ = self.split(unknowns)
        size, root, factor = self.panels.nodes.size, np.sqrt(self.virgin.virgin_width * width), self._factor(unknowns)
        slip, rate = self.slip(unknowns), self.rate(unknowns)
        rate[-1], slip[-1] = 0.0, 0.0
        result = np.zeros((unknowns.size, unknowns.size))
        result[:size, :size] = (1.0 - theta * rate)[:, None] * self.panels.inner * factor
        result[:size, :size] -= theta / root * slip[:, None] * self.panels.outer
        result[size, :size] = -0.5 * root * self.panels.weights * factor
        if self.border is None:
            result[-1, :size] = self.at_border()
        return result

    def sticking_load(self, path: FloatArray, border: float, depth: float) -> float:
        """Return int_0^b (d - g) dx - int_0^c (1 - g) dx over eta, on what sticks."""
        b, d = _onward(path, border, depth)
        radius = np.sqrt(self.virgin.inner_radius**2 + self.virgin.virgin_width * b)
        widths = self.virgin.virgin_width * np.diff(b) / (radius[1:] + radius[:-1])
        return float(self.virgin.inner_radius * depth + widths @ (depth - 0.5 * (d[1:] + d[:-1]) + 1.0))

    def slipping_load(self, unknowns: FloatArray) -> float:
        """Return int_b^a (d - g) dx over eta, on the slip zone."""
        y, width, *_ = self.split(unknowns)
        root = np.sqrt(self.virgin.virgin_width * width)
        return float(0.5 * root * self.panels.weights @ ((1.0 - y) * self._factor(unknowns)))

    def worn(self, unknowns: FloatArray) -> FloatArray:
        """Return s at the nodes, the depth, and the border: what the error of a step is judged by."""
        weight = BORDER_WEIGHT * (1.0 - self.virgin.inner_radius) / self.eta
        tail = unknowns[self.panels.nodes.size :] * ([1.0, weight] if self.border is None else 1.0)
        return np.append(self.slip(unknowns), tail)

    def moment(
        self, time: float, unknowns: FloatArray, theta: float, known: FloatArray, past: Sequence[Pressed]
    ) -> Pressed:
        """Return the moment that a solved step ends in; its worn depth is what came before and what the step wore."""
        size = self.panels.nodes.size
        _, _, depth, border = self.split(unknowns)
        worn = known[size : 2 * size] + theta * self.rate(unknowns) * self.slip(unknowns)
        worn[-1] = 0.0
        path = _onward(past[0].path, border, depth)
        moved = self.plateau_rise(path[:, : self._turn(path) + 1], self.places(unknowns))
        return Pressed(time, unknowns, worn, path, moved)

    def wear_rate(self, unknowns: FloatArray) -> float:
        """Return dV/dN = 2 int_b^a (d - g) y dx, the dissipation of a cycle over mu."""
        y, width, *_ = self.split(unknowns)
        root = np.sqrt(self.virgin.virgin_width * width)
        return float(self.eta * root * self.panels.weights @ (y * (1.0 - y) * self._factor(unknowns)))


def forced_slip(profile: Profile, stick_radius: float, panels: Panels, reach: float) -> ForcedSlip:
    """Prepare partial slip under the force of the virgin contact."""
    virgin = partial_slip(profile, stick_radius, panels, reach)
    y, factor = virgin.image(settled(virgin).unknowns)
    load = 0.5 * np.sqrt(virgin.virgin_width) * panels.weights @ ((1.0 - y) * factor)
    return ForcedSlip(virgin, float(load), 0.0)


def rising(path: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the places that the border passed, and the depths at which it left them."""
    furthest = np.maximum.accumulate(path[0])
    new = np.append(True, np.diff(furthest) > 0.0)
    return furthest[new], path[1, new]


def _share(moment: Pressed, width: float, place: FloatArray) -> FloatArray:
    """Return where places lie on the panels of a moment."""
    return np.asarray((place - moment.border) / width)


def _onward(path: FloatArray, border: float, depth: float) -> FloatArray:
    """Return a path with one more pair."""
    return np.append(path, [[border], [depth]], axis=1)


@njit(nogil=True, cache=True, error_model="numpy")
def _plateau_rise(c, width, path, place, abscissa, weight, result):  # type: ignore[no-untyped-def]
    """Integrate over each straight piece of the path, in the root of r^2 - b^2, in which arccos(b / r) is smooth."""
    for i in range(place.size):
        square, total = c * c + width * place[i], 0.0
        first = np.sqrt(max(place[i] - path[0, 0], 0.0))
        for k in range(1, path.shape[1]):
            rise = path[1, k] - path[1, k - 1]
            last = np.sqrt(max(place[i] - path[0, k], 0.0))
            mean, whole = 0.0, 0.0
            for node in range(abscissa.size):
                root = first + (last - first) * abscissa[node]
                gap = np.sqrt(width) * root
                mean += weight[node] * root * np.arctan2(gap, np.sqrt(max(square - gap * gap, 0.0)))
                whole += weight[node] * root
            if whole > 0.0:
                total += mean / whole * rise
            first = last
        result[i] = 2.0 / np.pi * total
