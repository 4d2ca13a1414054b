"""The exact evolution of a fretted contact under constant force.

The depth d grows, and the stick border c moves outwards until the image jumps there; then it stands. The image of what
sticks is frozen: g(c) = d - eta at the time when c passed. The slip is s = (f - f_star) / eta, and f_star, the plateau
behind the border, only changes as df_star = (2/pi) arccos(c / r) dd, so that the path (c, d) is all there is to
remember of the annulus between the first stick border and the present one.

Every radius keeps its worn depth w. Units are those of `mdr_dask.physics.wear.worn`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.half_integrals import Panels, interpolate
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear.evolution import Moment, PartialSlip, partial_slip

#: How much more closely steps follow the border than the depth: f rises beyond it as a root.
BORDER_WEIGHT = 30.0
#: Floor of r^2 - c^2.
SMALLEST = 1e-30


@dataclass(frozen=True, eq=False)
class Pressed(Moment):
    """A moment under constant force.

    Parameters
    ----------
    border : float
        The stick border c.
    path : array, shape (2, k)
        All pairs (c, d) up to this moment, joined by straight lines.
    moved : array, shape (n,)
        `plateau_rise` of the part of the path on which the border moved, at the nodes.
    """

    border: float
    path: FloatArray
    moved: FloatArray


@dataclass(frozen=True, eq=False)
class ForcedSlip:
    """Slip outside the stick border under constant force.

    Unknowns: y = 1 - (d - g) / eta at the nodes but the last, a, d, and c unless `border` says where it stands; `stood`
    is then the number of the pair of the path that it stands from. `virgin_area` is int g dx up to the first border.
    """

    virgin: PartialSlip
    virgin_area: float
    force: float
    border: float | None = None
    stood: int = 0

    @property
    def panels(self) -> Panels:
        """Return the panels between the border and the edge."""
        return self.virgin.panels

    @property
    def profile(self) -> Profile:
        """Return the virgin body."""
        return self.virgin.profile

    @property
    def eta(self) -> float:
        """Return the share of the first depth that the amplitude makes slip."""
        return self.virgin.eta

    def split(self, unknowns: FloatArray) -> tuple[FloatArray, float, float, float]:
        """Return y at all nodes, a, d and c."""
        size = self.panels.nodes.size
        y = unknowns[:size].copy()
        y[-1] = 1.0
        border = float(unknowns[-1]) if self.border is None else self.border
        return y, float(unknowns[size - 1]), float(unknowns[size]), border

    def inner(self, unknowns: FloatArray) -> float:
        """Return the stick border."""
        return self.split(unknowns)[3]

    def radii(self, unknowns: FloatArray) -> FloatArray:
        """Return the radii of the nodes."""
        _, a, _, c = self.split(unknowns)
        return np.asarray(np.sqrt(c * c + (a - c) * (a + c) * self.panels.nodes))

    def start(self) -> Pressed:
        """Return the virgin contact."""
        first, c = self.virgin.start(), self.virgin.inner_radius
        return Pressed(
            0.0, np.append(first.unknowns, 1.0), first.gathered, 1.0, c, np.array([[c], [1.0]]), first.gathered
        )

    def move(self, moment: Pressed) -> tuple[ForcedSlip, Pressed]:
        """Return the problem, and its first moment, in which the border moves."""
        moved = plateau_rise(moment.path, self.radii(moment.unknowns))
        unknowns = np.append(moment.unknowns, moment.border)
        return replace(self, border=None), replace(moment, unknowns=unknowns, moved=moved)

    def stand(self, moment: Pressed) -> tuple[ForcedSlip, Pressed]:
        """Return the problem, and its first moment, in which the border stays where it is."""
        still = replace(self, border=moment.border, stood=moment.path.shape[1] - 1)
        return still, replace(moment, unknowns=moment.unknowns[:-1])

    def memory(self, past: Sequence[Pressed], shares: FloatArray) -> Callable[[FloatArray], FloatArray]:
        """Return, as a function of the unknowns, what is known of eta s at the nodes, and the force on what sticks."""

        def known(unknowns: FloatArray) -> FloatArray:
            _, _, d, c = self.split(unknowns)
            r = self.radii(unknowns)
            worn = sum(share * self._worn(moment, r) for moment, share in zip(past, shares, strict=True))
            worn[-1] = 0.0  # nothing is worn at the edge
            slip = self.virgin_slip(r) - self._rise(past[0], c, d, r) + worn
            return np.append(slip, self.sticking_force(past[0].path, c, d))

        return known

    def virgin_slip(self, radius: FloatArray) -> FloatArray:
        """Return eta s of the virgin body at its first stick border."""
        c, table = self.virgin.inner_radius, self.virgin
        place = np.log(np.maximum((radius - c) * (radius + c), SMALLEST)) - table.first
        cell = np.clip((place / table.step).astype(int), 0, table.virgin.shape[1] - 1)
        local = place - cell * table.step
        k = table.virgin[:, cell]
        return np.asarray(self.eta * np.exp(((k[0] * local + k[1]) * local + k[2]) * local + k[3]))

    def _rise(self, moment: Pressed, border: float, depth: float, radius: FloatArray) -> FloatArray:
        """Return `plateau_rise` along the path of a moment and on, from its values at the moment's nodes."""
        turn = self._turn(moment.path)
        z = _share(moment, radius)
        rise = interpolate(self.panels, moment.moved, z)
        beyond = z >= 1.0
        rise[beyond] = plateau_rise(moment.path[:, : turn + 1], radius[beyond])
        return np.asarray(rise + plateau_rise(_onward(moment.path[:, turn : turn + 1], border, depth), radius))

    def _turn(self, path: FloatArray) -> int:
        """Return the number of the last pair of the path on which the border moved."""
        return path.shape[1] - 1 if self.border is None else self.stood

    def _worn(self, moment: Pressed, radius: FloatArray) -> FloatArray:
        """Return the worn depth of a moment between its border and the present edge."""
        z = _share(moment, radius)
        if self.border is None:
            return interpolate(self.panels, moment.gathered, z)
        at_border = self._frozen_depth(moment)
        rooted = (moment.gathered - at_border) / np.sqrt(self.panels.nodes)
        return np.where(z < 1.0, at_border + np.sqrt(z) * interpolate(self.panels, rooted, z), 0.0)

    def _frozen_depth(self, moment: Pressed) -> float:
        """Return the worn depth at the border."""
        c = np.array([moment.border])
        if not moment.border > self.virgin.inner_radius:
            return 0.0
        return float((plateau_rise(moment.path, c) - self.virgin_slip(c))[0])

    def slip(self, unknowns: FloatArray) -> FloatArray:
        """Return s at the nodes."""
        y, a, _, c = self.split(unknowns)
        return np.asarray(self.panels.inner @ (y * (np.sqrt((a - c) * (a + c)) / self.radii(unknowns))))

    def pressure(self, unknowns: FloatArray) -> FloatArray:
        """Return p at the nodes."""
        y, a, _, c = self.split(unknowns)
        return np.asarray(self.eta / np.sqrt((a - c) * (a + c)) * (self.panels.outer @ y))

    def at_border(self) -> FloatArray:
        """Return the weights that continue the first panel to the border."""
        order = self.panels.order
        nodes, weights = self.panels.nodes[:order], self.panels.barycentric[0, -order:]
        shares = np.zeros(self.panels.nodes.size)
        shares[:order] = weights / nodes / np.sum(weights / nodes)
        return shares

    def residual(self, unknowns: FloatArray, theta: float, known: FloatArray) -> FloatArray:
        """Return eta s - known - theta p s at the nodes, continuity at the edge, the force, and y = 0 at the border."""
        y, *_ = self.split(unknowns)
        slip, size = self.slip(unknowns), self.panels.nodes.size
        rows = np.zeros(unknowns.size)
        rows[:size] = self.eta * slip - known[:size] - theta * self.pressure(unknowns) * slip
        rows[size - 1] = self.eta * slip[-1] - known[size - 1]
        rows[size] = 0.5 * (known[size] + self.slipping_force(unknowns) - self.force)
        if self.border is None:
            rows[-1] = self.at_border() @ y
        return rows

    def jacobian(self, unknowns: FloatArray, theta: float) -> FloatArray:
        """Return the derivatives by y."""
        size, length = self.panels.nodes.size, self.length(unknowns)
        factor = np.sqrt(length) / self.radii(unknowns)
        slip, pressure = self.slip(unknowns), self.pressure(unknowns)
        pressure[-1], slip[-1] = 0.0, 0.0
        result = np.zeros((unknowns.size, unknowns.size))
        result[:size, :size] = (self.eta - theta * pressure)[:, None] * self.panels.inner * factor
        result[:size, :size] -= theta * self.eta / np.sqrt(length) * slip[:, None] * self.panels.outer
        result[size, :size] = -0.5 * self.eta * np.sqrt(length) * self.panels.weights * factor
        if self.border is None:
            result[-1, :size] = self.at_border()
        return result

    def length(self, unknowns: FloatArray) -> float:
        """Return a^2 - c^2."""
        _, a, _, c = self.split(unknowns)
        return (a - c) * (a + c)

    def slipping_force(self, unknowns: FloatArray) -> float:
        """Return the force on the slip zone, 2 int_c^a (d - g) dx."""
        y, *_ = self.split(unknowns)
        root = np.sqrt(self.length(unknowns))
        return float(self.eta * root * self.panels.weights @ ((1.0 - y) * (root / self.radii(unknowns))))

    def sticking_force(self, path: FloatArray, border: float, depth: float) -> float:
        """Return the force on the stick zone, 2 int_0^c (d - g) dx."""
        c, d = _onward(path, border, depth)
        virgin = self.virgin.inner_radius * depth - self.virgin_area
        return 2.0 * (virgin + float(np.trapezoid(depth - (d - self.eta), c)))

    def worn(self, unknowns: FloatArray) -> FloatArray:
        """Return eta s at the nodes, the depth, and the border: what the error of a step is judged by."""
        tail = unknowns[self.panels.nodes.size :] * ([1.0, BORDER_WEIGHT] if self.border is None else 1.0)
        return np.append(self.eta * self.slip(unknowns), tail)

    def moment(
        self, time: float, unknowns: FloatArray, theta: float, known: FloatArray, past: Sequence[Pressed]
    ) -> Pressed:
        """Return the moment that a solved step ends in; its worn depth is what came before and what the step wore."""
        slip = self.slip(unknowns)
        _, a, d, c = self.split(unknowns)
        r = self.radii(unknowns)
        path = _onward(past[0].path, c, d)
        turn = self._turn(path)
        moved = plateau_rise(path[:, : turn + 1], r)
        worn = self.eta * slip - self.virgin_slip(r) + moved + plateau_rise(path[:, turn:], r)
        worn[-1] = 0.0
        return Pressed(time, unknowns, worn, a, c, path, moved)

    def wear_rate(self, unknowns: FloatArray) -> float:
        """Return dV/dN = 2 int_c^a (d - g) y dx, the dissipation of a cycle over mu."""
        y, *_ = self.split(unknowns)
        root = np.sqrt(self.length(unknowns))
        return float(self.eta * root * self.panels.weights @ (y * (1.0 - y) * (root / self.radii(unknowns))))


def _share(moment: Pressed, radius: FloatArray) -> FloatArray:
    """Return where radii lie on the panels of a moment."""
    c, a = moment.border, moment.edge
    return np.asarray((radius - c) * (radius + c) / ((a - c) * (a + c)))


def forced_slip(profile: Profile, stick_radius: float, panels: Panels, reach: float) -> ForcedSlip:
    """Prepare partial slip under the force of the virgin contact."""
    area, slipping = virgin_areas(profile, stick_radius)
    force = 2.0 * (stick_radius - area + slipping)
    return ForcedSlip(partial_slip(profile, stick_radius, panels, reach), area, force, stick_radius)


def virgin_areas(profile: Profile, stick_radius: float) -> tuple[float, float]:
    """Return int_0^c g dx and int_c^1 (1 - g) dx of the virgin body; x = c t^4 smooths a power at the axis."""
    c = stick_radius
    abscissa, weight = gauss(64)
    eta = float(profile.rise(np.array(1.0), c))
    stuck = 4.0 * c * float((profile.image(c * abscissa**4) * abscissa**3) @ weight)
    x = c + (1.0 - c) * abscissa**4
    slipping = 4.0 * (1.0 - c) * float(((eta - profile.rise(x, c)) * abscissa**3) @ weight)
    return stuck, slipping


def plateau_rise(path: FloatArray, radius: FloatArray) -> FloatArray:
    """Return (2/pi) int arccos(c / r) dd along a path of pairs (c, d), at radii beyond it."""
    result = np.zeros_like(radius)
    _plateau_rise(path, radius, result)
    return result


def _onward(path: FloatArray, border: float, depth: float) -> FloatArray:
    """Return a path with one more pair."""
    return np.append(path, [[border], [depth]], axis=1)


@njit(nogil=True, cache=True)
def _plateau_rise(path, radius, result):  # type: ignore[no-untyped-def]
    """Integrate over each straight piece of the path: int arccos(c / r) dc = c arccos(c / r) - sqrt(r^2 - c^2)."""
    for i in range(radius.size):
        r, total = radius[i], 0.0
        c = path[0, 0]
        root = np.sqrt(max((r - c) * (r + c), 0.0))
        angle = np.arctan2(root, c)
        for k in range(1, path.shape[1]):
            next_c, rise = path[0, k], path[1, k] - path[1, k - 1]
            next_root = np.sqrt(max((r - next_c) * (r + next_c), 0.0))
            next_angle = np.arctan2(next_root, next_c)
            if next_c - c < 1e-6:
                total += 0.5 * (angle + next_angle) * rise
            else:
                area = next_c * next_angle - next_root - c * angle + root
                total += area / (next_c - c) * rise
            c, root, angle = next_c, next_root, next_angle
        result[i] = 2.0 / np.pi * total
