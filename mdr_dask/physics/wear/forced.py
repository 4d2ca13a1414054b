"""The exact evolution of wear under constant force, and the limiting profile.

The evolution has two parts: first the stick border moves, then it no longer moves.

See `mdr_dask.physics.wear.forced_slip` for the equations. The constant force is the force of the virgin contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.half_integrals import interpolate
from mdr_dask.physics.mdr.revolution import Profile, bisect
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear.evolution import Dense, Resolution, integral_along, march, settled
from mdr_dask.physics.wear.forced_slip import ForcedSlip, Pressed, forced_slip, onward, rising
from mdr_dask.physics.wear.worn import Scar, Worn, contact_pressure, virgin_load, worn_by, worn_height, worn_image


class Settings(NamedTuple):
    """Tuned numbers of the two parts of the evolution.

    Parameters
    ----------
    jump : float
        The border stops when y in the panel next to the border exceeds this value. If the border moves back, a tenth
        of this value is enough.
    nearest : float
        Stick radius below which the panels are not refined further, because the border soon moves away.
    finer : int
        Number of additional halvings of the panels at the border, compared with constant depth.
    latest_jump : float
        A number of cycles N much larger than the N at which the image jumps at the border.
    lowest : float
        A step that gives y below minus this value is rejected, and the border stops at the moment before this step.
    coarsest : float
        Accuracies above this value are replaced by this value. Longer steps do not follow the border, so that more
        steps fail and the solution takes longer.
    rougher : tuple of float
        Factors on the step tolerance in the two rougher solutions.
    thinned : int
        Largest number of nodes by which each panel of the rougher solutions is reduced. The border must be resolved
        even in the roughest solution.
    slowness : float
        Factor on the differences from the rougher solutions. It exceeds 1, because the error falls more slowly than
        usual.
    least_edge_error : float
        Least stated error of the radii, as a fraction of the accuracy times the width 1 - c of the virgin slip zone.
        Near full stick the border stops at the same place in all three solutions, so their difference does not show the
        error.
    """

    jump: float = 0.1
    nearest: float = 0.1
    finer: int = 5
    latest_jump: float = 1e3
    lowest: float = 1e-2
    coarsest: float = 3e-4
    rougher: tuple[float, float] = (4.0, 8.0)
    thinned: int = 1
    slowness: float = 2.0
    least_edge_error: float = 0.1


SETTINGS = Settings()


def forced_contacts(
    profile: Profile, stick_radius: float, wanted: Sequence[float], resolution: Resolution
) -> dict[float, Worn]:
    """Return the contacts at all wanted times, from one solution."""
    tabulated = bool(np.isfinite(profile.largest_radius))
    until = SETTINGS.latest_jump if tabulated else max(wanted)
    moving, first = _until_jump(profile, stick_radius, resolution, until)
    if tabulated:
        _end(moving, first[-1])  # raises if the limit exceeds the table, even if only few cycles are wanted
    stopped, start = moving.stop(first[-1])
    second = march(stopped, max(wanted), resolution.step, _first(moving, resolution), start)
    early, late = Dense(first), Dense(second)
    energy = integral_along(first, [moving.wear_rate(moment.unknowns) for moment in first])
    more = energy[-1] + integral_along(second, [stopped.wear_rate(moment.unknowns) for moment in second])
    contacts = {}
    for time in wanted:
        if time <= first[-1].time:
            contacts[time] = _contact(moving, early, time, early.number(time, energy), early.steps(time))
        else:
            steps = len(first) + late.steps(time)
            contacts[time] = _contact(stopped, late, time, late.number(time, more), steps)
    return contacts


def forced_end(profile: Profile, stick_radius: float, resolution: Resolution) -> Worn:
    """Return the limiting profile under constant force.

    In the limit the shape of the stick zone no longer changes, and this zone carries the whole force. So g = d beyond
    the border b, where d = (F/2 + int_0^b g dx) / b is the depth. The radius of the scar follows from int_0^a (g - g0)
    / sqrt(a^2 - x^2) dx = 0.
    """
    problem, moments = _until_jump(profile, stick_radius, resolution, SETTINGS.latest_jump)
    return _end(problem, moments[-1])


def forced_resolution(accuracy: float) -> Resolution:
    """Return the resolution for an accuracy under constant force."""
    finest = min(accuracy, SETTINGS.coarsest)
    order = 4 if finest > 2e-4 else 5 if finest > 3e-5 else 6
    return Resolution(finest, thinned=SETTINGS.thinned, order=order, rough=SETTINGS.rougher, slowness=SETTINGS.slowness)


def border_moves(stick_radius: float, accuracy: float) -> bool:
    """Return whether wear under constant force must be distinguished from wear at constant depth.

    Near full stick the border hardly moves, and the two cases agree within the accuracy.

    The depth grows by up to (1 - c) eta / 2, and the squared
    radius of the border by up to (1 - c) / 2 times 1 - c^2. The relative change of f next to the border is the square
    root of (1 - c) / 2.
    """
    return 0.5 * (1.0 - stick_radius) > accuracy**2


def least_edge_error(stick_radius: float, accuracy: float) -> float:
    """Return the least stated error of the radii under constant force."""
    return SETTINGS.least_edge_error * min(accuracy, SETTINGS.coarsest) * (1.0 - stick_radius)


def farthest_contact(profile: Profile, stick_radius: float) -> float:
    """Return an upper bound of the contact radius.

    The bound is the end of a table, or, for other bodies, the radius at the largest possible depth.
    """
    if np.isfinite(profile.largest_radius):
        return profile.largest_radius
    abscissa, weight = gauss(64)
    x = stick_radius + (1.0 - stick_radius) * abscissa
    slipping = (1.0 - stick_radius) * float((1.0 - profile.image(x)) @ weight)
    deepest = 1.0 + slipping / stick_radius
    radius = 1.0 + 4.0 * (1.0 - stick_radius)
    while float(profile.height(np.array([radius]))[0]) < deepest:
        radius *= 1.5
    return radius


def _first(problem: ForcedSlip, resolution: Resolution) -> float:
    return resolution.first * float(np.sqrt(problem.virgin.virgin_width))


def _until_jump(
    profile: Profile, stick_radius: float, resolution: Resolution, end: float
) -> tuple[ForcedSlip, list[Pressed]]:
    """March until the border stops or the time `end` is reached; return the problem and the accepted moments."""
    near = round(-2.0 * np.log2(max(stick_radius, SETTINGS.nearest)))
    panels = resolution.panels(near + SETTINGS.finer, fewest_digits=3.0)
    problem = forced_slip(profile, stick_radius, panels, farthest_contact(profile, stick_radius), resolution.newton)
    moving, start = problem.move(settled(problem))
    last, size = panels.mesh.order - 1, panels.nodes.size

    def is_rejected(moment: Pressed) -> bool:
        return bool(np.min(moment.unknowns[: size - 1]) < -SETTINGS.lowest)

    def stops(moment: Pressed) -> bool:
        returns = moment.border < np.max(moment.path[0]) - 5e-2 * resolution.step
        jumps = moment.unknowns[last] > (0.1 * SETTINGS.jump if returns else SETTINGS.jump)
        beyond = problem.radius(moment.border + moment.unknowns[size - 1]) > profile.largest_radius
        return bool(jumps or beyond or is_rejected(moment))

    moments = march(moving, end, resolution.step, _first(problem, resolution), start, stops)
    return moving, moments[:-1] if is_rejected(moments[-1]) else moments


class _Frozen(NamedTuple):
    """The image in the annulus that the border has passed.

    It follows from pairs of values: a radius that the border reached, and the depth, divided by d0, at that moment.
    """

    reached: FloatArray
    depths: FloatArray

    def slope(self, x: FloatArray) -> FloatArray:
        """Return the slope of the image in the annulus at x."""
        if self.reached.size == 1:
            return np.zeros_like(x)
        slopes = np.diff(self.depths) / np.diff(self.reached)
        return np.asarray(slopes[np.clip(np.searchsorted(self.reached, x) - 1, 0, slopes.size - 1)])


def _frozen(problem: ForcedSlip, path: FloatArray) -> _Frozen:
    places, depths = rising(path)
    radii = np.sqrt(problem.virgin.inner_radius**2 + problem.virgin.virgin_width * places)
    return _Frozen(radii, 1.0 + problem.eta * depths)


def _end(problem: ForcedSlip, moment: Pressed) -> Worn:
    """Return the limiting profile of a contact whose stick border stops at `moment`."""
    profile, c, eta = problem.profile, problem.virgin.inner_radius, problem.eta
    border, frozen = problem.radius(moment.border), _frozen(problem, moment.path)
    # the stick zone takes over the load of the virgin slip zone: b d = ... - int_c^b (d' - eta) db'
    annulus = float(np.trapezoid((frozen.depths - 1.0) / eta - 1.0, frozen.reached))
    depth = 1.0 + eta * (problem.virgin_load + annulus) / border

    def change(x: FloatArray) -> FloatArray:
        inside = np.interp(x, frozen.reached, frozen.depths) - 1.0 - profile.rise(x - c, c)
        return np.asarray(np.where(x < border, inside, depth - 1.0 + eta - profile.rise(x - c, c)))

    def slope(x: FloatArray) -> FloatArray:
        return np.asarray(frozen.slope(x) * (x < border) - profile.image_slope(x))

    virgin = Scar(c, border, change, slope, _breaks(c, border))

    def excess(radius: float) -> float:
        return -float(worn_height(virgin, np.array([radius]))[0])

    high = min(border + 4.0 * (1.0 - c), profile.largest_radius)
    while not excess(high) > 0.0:
        if high == profile.largest_radius:
            raise ValueError(
                f"the contact reaches beyond the table, which ends at r = {profile.largest_radius:.4g} contact radii; "
                f"extend it, got stick radius {c!r} under constant force"
            )
        high = min(1.5 * high, profile.largest_radius)
    scar = virgin._replace(radius=bisect(excess, border, high))
    force = 2.0 * (virgin_load(profile, c) + eta * problem.virgin_load)
    return worn_by(profile, scar, border, scar.radius, depth, force)


def _contact(problem: ForcedSlip, dense: Dense, time: float, energy: float, steps: int) -> Worn:
    """Turn the nodal values at one time into a worn contact."""
    profile, panels, eta, c = problem.profile, problem.panels, problem.eta, problem.virgin.inner_radius
    unknowns = dense.unknowns(time)
    y, (place, width, deeper) = problem.image(unknowns), problem.place(unknowns)
    before, after = dense.around(time)
    path = onward(before.path, problem.place(unknowns))
    moment = replace(before, time=time, unknowns=unknowns, accumulated=dense.accumulated(time), path=path)
    frozen, slope = _frozen(problem, path), panels.slope @ y
    border, a, depth = problem.radius(max(place, 0.0)), problem.radius(place + width), 1.0 + eta * deeper
    square = problem.virgin.virgin_width

    def worn(q: FloatArray) -> FloatArray:
        inner = problem.frozen_depth(path, np.where(q < place, q, 0.0))
        return np.asarray(eta * np.where(q < place, inner, problem.worn_depth(moment, np.maximum(q, place))))

    def height(radius: FloatArray) -> FloatArray:
        result, q = profile.height(radius), (radius - c) * (radius + c) / square
        scar = (q > 0.0) & (q < place + width)
        if time > 0.0:
            result[scar] += np.maximum(worn(q[scar]), 0.0)
        return result

    def nodal(values: FloatArray, x: FloatArray) -> FloatArray:
        z = np.clip((x - border) * (x + border) / (square * width), 0.0, 1.0 - 1e-15)
        return interpolate(panels.mesh, values, z.ravel()).reshape(x.shape)

    def change(x: FloatArray) -> FloatArray:
        slipping = depth - 1.0 + eta * nodal(y, x)
        sticking = np.interp(x, frozen.reached, frozen.depths) - 1.0
        return np.asarray(np.where(x < border, sticking, slipping) - profile.rise(x - c, c))

    def change_slope(x: FloatArray) -> FloatArray:
        slipping = 2.0 * eta * x / (square * width) * nodal(slope, x)
        return np.asarray(np.where(x < border, frozen.slope(x), slipping) - profile.image_slope(x))

    breaks = (*_breaks(c, border), *(float(x) for x in np.sqrt(border**2 + square * width * panels.mesh.edges[1:-1])))
    scar = Scar(c, a, change, change_slope, breaks)
    load = problem.slipping_load(unknowns) + problem.sticking_load(before, problem.place(unknowns))
    abscissa, weight = gauss(24)
    annulus = max(place, 0.0) * float(worn(place * abscissa) @ weight)
    fine = np.sqrt(c * c + square * (place + width) * np.linspace(0.0, 1.0, 200, endpoint=False))
    return Worn(
        contact_radius=a,
        stick_border=border,
        depth=depth,
        normal_force=2.0 * (virgin_load(profile, c) + eta * load),
        wear_volume=float(np.pi * square * (annulus + width * eta * panels.weights @ moment.accumulated)),
        worn_depth=float(np.max(height(fine) - profile.height(fine))),
        height=height,
        image=worn_image(profile, scar),
        pressure=contact_pressure(profile, scar, a, depth, border),
        energy_volume=energy,
        steps=steps,
        edge_step=abs(_edge(problem, after) - _edge(problem, before)),
    )


def _edge(problem: ForcedSlip, moment: Pressed) -> float:
    place = problem.place(moment.unknowns)
    return problem.radius(place.border + place.width)


def _breaks(c: float, border: float) -> tuple[float, ...]:
    """Return limits of integration that are dense inside the border, where the frozen image becomes steep."""
    if not border > c * (1.0 + 1e-12):
        return ()
    return (*(border - (border - c) * 0.25**k for k in range(1, 8)), border)
