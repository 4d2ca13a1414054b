"""Worn contacts under constant force: exact, their end, and the fast rule with the depth that keeps the force.

See `mdr_dask.physics.wear.forced_slip` for the equations. Units are those of the virgin contact, as in
`mdr_dask.physics.wear.worn`; the force kept is that of the virgin contact under the depth d0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.half_integrals import graded_panels, interpolate
from mdr_dask.physics.mdr.revolution import Profile, bisect
from mdr_dask.physics.wear import evolution
from mdr_dask.physics.wear.exact import Fretted
from mdr_dask.physics.wear.forced_slip import ForcedSlip, Pressed, forced_slip, virgin_areas
from mdr_dask.physics.wear.worn import Worn, check_stick_radius, worn_height, worn_volume

#: The border stands when y rises so far in the panel next to it, or a tenth of it and the border would return.
_JUMP = 0.1
#: Stick radius below which the panels become no finer: the border soon leaves it.
_NEAREST = 0.1
#: Error over the distance from a solution with a four times wider tolerance.
_SAFETY = 3.0
#: Wider steps than this tolerance asks for do not follow the edge.
_COARSEST = 1e-3
#: N by which the image jumps at the border, with much to spare.
_LATEST_JUMP = 1e3


@dataclass(frozen=True, eq=False)
class _March:
    """Both parts of an evolution: while the border moves, and while it stands."""

    moving: ForcedSlip
    first: list[Pressed]
    standing: ForcedSlip
    second: list[Pressed]

    def parts(self, time: float) -> tuple[ForcedSlip, list[Pressed]]:
        """Return the problem and the moments that a time belongs to."""
        return (self.moving, self.first) if time <= self.first[-1].time else (self.standing, self.second)


def exact_forced(
    profile: Profile, stick_radius: float, cycles: Sequence[float], tolerance: float = 1e-4
) -> list[Fretted]:
    """Return the worn contact after each number of cycles under constant force, by the exact rule.

    Parameters
    ----------
    profile : Profile
        The virgin body.
    stick_radius : float
        The first c, between 0 and 1.
    cycles : sequence of float
        N >= 0, in units of N0 of the virgin contact; any order.
    tolerance : float
        Error of depth and border wanted, in eta d0, at most 1e-3; f rises as a root at the border and is less exact
        there.

    Returns
    -------
    list of Fretted
        In the order of `cycles`, with depth and border. The error is 3 times the distance from a solution with a
        four times wider tolerance, or the tolerance if that is more.

    Raises
    ------
    ValueError
        Without partial slip, or if the scar would leave the table of the profile in the end.
    NotConvergedError
        If the evolution cannot be advanced.
    """
    check_stick_radius(stick_radius)
    wanted = sorted({float(n) for n in cycles})
    fine, coarse = (_forced(profile, stick_radius, wanted, t) for t in _tolerances(tolerance))
    judged = {n: replace(fine[n], error=_error(profile, fine[n], coarse[n], tolerance)) for n in wanted}
    return [judged[float(n)] for n in cycles]


def limit_forced(profile: Profile, stick_radius: float, tolerance: float = 1e-4) -> Worn:
    """Return the shape that ends all wear under constant force.

    Once the image jumps at the border c, the border stands and what sticks is frozen, so that the end is known: g = d
    beyond c, with the depth d = (F/2 + int_0^c g dx) / c under which the stick zone carries the force alone, and the
    scar's radius from int_0^a (g - g0) / sqrt(a^2 - x^2) dx = 0. Only c and the frozen g need the evolution, up to the
    jump.

    Parameters, errors and the error estimate are those of `exact_forced`.
    """
    check_stick_radius(stick_radius)
    fine, coarse = (_end(*_jumped(profile, stick_radius, t)) for t in _tolerances(tolerance))
    return replace(fine, error=_error(profile, fine, coarse, tolerance))


def _tolerances(tolerance: float) -> tuple[float, float]:
    """Return the tolerance of the answer, and of the solution that it is judged by."""
    fine = min(tolerance, _COARSEST)
    return fine, 4.0 * fine


def _problem(profile: Profile, stick_radius: float, tolerance: float) -> ForcedSlip:
    """Prepare the evolution, with panels fine enough for a tolerance."""
    digits = max(-np.log10(tolerance), 3.0)
    levels = round(2.7 * digits - 3.3)
    near = round(-2.0 * np.log2(max(stick_radius, _NEAREST)))
    panels = graded_panels(levels + near + 5, levels, 4 if tolerance > 3e-5 else 6)
    return forced_slip(profile, stick_radius, panels, farthest_contact(profile, stick_radius))


def farthest_contact(profile: Profile, stick_radius: float) -> float:
    """Return a radius that no contact under constant force exceeds: that of the end, had the border not moved."""
    if np.isfinite(profile.largest_radius):
        return profile.largest_radius
    deepest = 1.0 + virgin_areas(profile, stick_radius)[1] / stick_radius
    radius = 2.0
    while float(profile.height(np.array([radius]))[0]) < deepest:
        radius *= 1.5
    return radius


def _until_jump(profile: Profile, stick_radius: float, tolerance: float) -> tuple[ForcedSlip, list[Pressed], float]:
    """March while the border moves; return problem, moments and the error allowed in a step."""
    problem = _problem(profile, stick_radius, tolerance)
    step_error = 0.2 * tolerance * problem.eta
    moving, start = problem.move(evolution.settled(problem))
    last = problem.panels.order - 1

    def stops(moment: Pressed) -> bool:
        returns = moment.border < np.max(moment.path[0]) - 1e-2 * tolerance
        jumps = moment.unknowns[last] > (0.1 * _JUMP if returns else _JUMP)
        return bool(jumps or moment.edge > profile.largest_radius)

    return moving, evolution.march(moving, _LATEST_JUMP, step_error, start, stops), step_error


def _forced(profile: Profile, c: float, wanted: Sequence[float], tolerance: float) -> dict[float, Fretted]:
    """Solve once and describe every wanted time."""
    moving, first, step_error = _until_jump(profile, c, tolerance)
    _end(moving, first[-1])  # the table must hold it, however few cycles are wanted
    standing, start = moving.stand(first[-1])
    second = evolution.march(standing, max(wanted), step_error, start)
    march = _March(moving, first, standing, second)
    early = evolution.integral_along(first, [moving.wear_rate(m.unknowns) for m in first])
    late = early[-1] + evolution.integral_along(second, [standing.wear_rate(m.unknowns) for m in second])
    result = {}
    for time in wanted:
        problem, history = march.parts(time)
        spent = evolution.value_at(history, early if problem is moving else late, time)
        steps = int(np.searchsorted([m.time for m in history], time)) + (len(first) if problem is standing else 0)
        result[time] = replace(_describe(problem, history, time), energy_volume=spent, steps=steps)
    return result


def _jumped(profile: Profile, c: float, tolerance: float) -> tuple[ForcedSlip, Pressed]:
    """Return the problem and its last moment before the border stands."""
    problem, moments, _ = _until_jump(profile, c, tolerance)
    return problem, moments[-1]


def _end(problem: ForcedSlip, moment: Pressed) -> Worn:
    """Return what a contact ends in whose border stands from a moment on."""
    profile, c, eta = problem.profile, problem.virgin.inner_radius, problem.eta
    border, (reached, depths) = moment.border, _rising(moment.path)
    stuck = problem.virgin_area + float(np.trapezoid(depths - eta, reached))
    depth = (0.5 * problem.force + stuck) / border

    def change(x: FloatArray) -> FloatArray:
        frozen = np.interp(x, reached, depths) - 1.0 - profile.rise(x, c)
        return np.asarray(np.where(x < border, frozen, depth - profile.image(x)))

    def change_slope(x: FloatArray) -> FloatArray:
        return np.asarray(_frozen_slope(x, reached, depths) - profile.image_slope(x))

    breaks = _breaks(c, border)

    def excess(radius: float) -> float:
        return -float(worn_height(change, c, np.array([radius]), breaks)[0])

    high = min(2.0, profile.largest_radius)
    while not excess(high) > 0.0:
        if high == profile.largest_radius or moment.edge > profile.largest_radius:
            raise ValueError(
                f"the contact reaches beyond the table, which ends at r = {profile.largest_radius:.4g} contact radii; "
                f"extend it, got stick radius {c!r} under constant force"
            )
        high = min(1.5 * high, profile.largest_radius)
    a = bisect(excess, border, high)
    volume = worn_volume(change, c, a, breaks)
    return Worn(
        profile, c, a, border, volume, problem.force, np.nan, change, change_slope, breaks, depth=depth, border=border
    )


def _describe(problem: ForcedSlip, history: Sequence[Pressed], time: float) -> Fretted:
    """Turn the nodal values at one time into a worn contact."""
    unknowns = evolution.unknowns_at(history, time)
    y, a, depth, border = problem.split(unknowns)
    panels, profile, eta, c = problem.panels, problem.profile, problem.eta, problem.virgin.inner_radius
    length, slope = problem.length(unknowns), panels.slope @ y
    before = history[max(int(np.searchsorted([m.time for m in history], time)) - 1, 0)].path
    path = np.append(before, [[border], [depth]], axis=1)
    reached, depths = _rising(path)

    def place(x: FloatArray) -> FloatArray:
        return np.clip((x - border) * (x + border) / length, 0.0, 1.0 - 1e-15).ravel()

    def change(x: FloatArray) -> FloatArray:
        slipping = depth - eta + eta * interpolate(panels, y, place(x)).reshape(x.shape)
        image = np.where(x < border, np.interp(x, reached, depths) - eta, slipping)
        return np.asarray(image - (1.0 - eta) - profile.rise(x, c))

    def change_slope(x: FloatArray) -> FloatArray:
        slipping = 2.0 * eta * x / length * interpolate(panels, slope, place(x)).reshape(x.shape)
        image = np.where(x < border, _frozen_slope(x, reached, depths), slipping)
        return np.asarray(image - profile.image_slope(x))

    breaks = (*_breaks(c, border), *(float(x) for x in np.sqrt(border**2 + length * panels.edges[1:-1])))
    volume = worn_volume(change, c, a, breaks) if time > 0.0 else 0.0
    force = problem.sticking_force(before, border, depth) + problem.slipping_force(unknowns)
    return Fretted(
        profile, c, a, a, volume, force, np.nan, change, change_slope, breaks, depth=depth, border=max(border, c)
    )


def _rising(path: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the places c that the border passed, and the depths at which it left them."""
    furthest = np.maximum.accumulate(path[0])
    new = np.append(True, np.diff(furthest) > 0.0)
    return furthest[new], path[1, new]


def _frozen_slope(x: FloatArray, reached: FloatArray, depths: FloatArray) -> FloatArray:
    """Return the slope of the image that the border left behind it."""
    if reached.size == 1:
        return np.zeros_like(x)
    slopes = np.diff(depths) / np.diff(reached)
    return np.asarray(slopes[np.clip(np.searchsorted(reached, x) - 1, 0, slopes.size - 1)])


def _breaks(c: float, border: float) -> tuple[float, ...]:
    """Return places that crowd towards the border, where the frozen image becomes steep."""
    if not border > c * (1.0 + 1e-12):
        return ()
    return (*(border - (border - c) * 0.25**k for k in range(1, 8)), border)


def _error(profile: Profile, fine: Worn, coarse: Worn, tolerance: float) -> float:
    """Return the error expected of f: not below the tolerance, which both solutions may miss alike at the edge."""
    eta = float(profile.rise(np.array(1.0), fine.stick_radius))
    return max(_SAFETY * _distance(fine, coarse), _tolerances(tolerance)[0] * eta)


def _distance(fine: Worn, coarse: Worn) -> float:
    """Return the largest difference of two worn profiles."""
    border, a, c = fine.stick_border, fine.contact_radius, fine.stick_radius
    shares = np.sin(0.5 * np.pi * np.arange(1, 80) / 80.0) ** 4
    r = np.concatenate([c + (border - c) * (1.0 - shares[::-2]), border + (a - border) * shares])
    return float(np.max(np.abs(fine.height(r) - coarse.height(r))))
