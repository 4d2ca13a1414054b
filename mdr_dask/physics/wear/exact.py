"""Worn contacts by the exact evolution: fretting and sliding, at constant depth and under constant force."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.half_integrals import Panels, graded_panels, interpolate
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.transforms import Function, gauss
from mdr_dask.physics.wear.evolution import GROWTH, at, march, settled
from mdr_dask.physics.wear.rules import ERROR, limit, limit_radius
from mdr_dask.physics.wear.slip import BORDER_WEIGHT, GrossSlip, Moment, PartialSlip, SlipMoment, partial_slip, rising
from mdr_dask.physics.wear.worn import (
    Scar,
    Worn,
    beyond_table,
    check_stick_radius,
    closed,
    contact_pressure,
    deepest,
    virgin_load,
    worn_by,
    worn_image,
    worn_volume,
)

COARSEST = 1.6e-2  # largest `accuracy`, with two nodes in a panel (see `Resolution.order`); chosen by trial
#: If N / sqrt(a^2 - c^2) reaches this value, where a is an upper bound of the contact radius, the limiting profile is
#: returned. The difference from the limiting profile falls at least as fast as exp(-N / (5 sqrt(a^2 - c^2))), and is
#: then below the rounding error.
ENDED = 1e4
JUMP = 0.1  # the border no longer moves if y = 1 - (d - g) / eta at the outer end of the first panel exceeds this value


class Resolution(NamedTuple):
    """Panels and time steps for a given `accuracy` (see `exact`)."""

    accuracy: float

    @property
    def order(self) -> int:
        """Number of nodes in a panel.

        If the allowed error falls to a quarter, a panel has one more node, because the panels far from the border and
        the edge do not become narrower. There are at most six nodes, because time steps may fail with more nodes.
        """
        return min(2 + round(float(np.log(COARSEST / self.accuracy) / np.log(4.0))), 6)

    @property
    def step(self) -> float:
        """The error allowed in a time step."""
        return 0.2 * self.accuracy

    @property
    def flat(self) -> float:
        """Largest rise (d - 1) / eta of the depth for which the stick border is computed from the virgin body."""
        return self.step / BORDER_WEIGHT

    def panels(self, near: int) -> Panels:
        """Return the panels for partial slip, halved `near` times more often at the stick border than at the edge."""
        digits = -np.log10(self.accuracy)
        levels = round(2.7 * digits - 3.3)
        return graded_panels(levels + near, levels, self.order)

    def panels_in_gross_slip(self, sharpness: float) -> Panels:
        """Return panels that resolve the pressure jump at the edge, and the tip of a sharp body (see `_slid`)."""
        digits = -np.log10(self.accuracy)
        # the error at the tip is the height of the profile within the innermost panel
        tip = max(round(2.0 * digits) + 1, 3.3 * digits - 2.2)
        return graded_panels(round(sharpness * tip), round(2.0 * digits) + 4, self.order)


def exact(
    profile: Profile,
    stick_radius: float,
    amounts: Sequence[float],
    accuracy: float = 1e-3,
    *,
    constant_force: bool = False,
) -> list[Worn]:
    """Return the worn contact after each amount of wear, by the exact rule df/dN = p (f - f_star) / eta.

    The module `slip` defines the profile f_star.

    Parameters
    ----------
    profile : Profile
        The virgin body, pressed to the depth 1.
    stick_radius : float
        Stick radius c of the virgin contact, between 0 and 1. A value of 0 means gross slip in one direction, with
        df/ds = p in the whole contact.
    amounts : sequence of float
        Cycles N >= 0 in units of N0, or, in gross slip, s = k E* l / (sigma0 a0) for the sliding distances l. The
        amounts may be in any order. In partial slip, an infinite value gives the limiting profile.
    accuracy : float
        Allowed error of f, divided by eta d0 in partial slip (where the worn depth is of the order of eta d0), and by
        d0 in gross slip. Errors below `ERROR` are not reached, because round-off accumulates over the time steps. A
        value above `COARSEST` is replaced by `COARSEST`.
    constant_force : bool
        Whether the force of the virgin contact is kept constant instead of the depth.

    Returns
    -------
    list of Worn
        The contacts in the order of `amounts`. The result for one amount does not depend on the other amounts.

    Raises
    ------
    ValueError
        If the stick radius is not at least 0 and below 1, or if, in partial slip, the contact reaches beyond the table
        of the profile.
    NotConvergedError
        If the evolution cannot be advanced, for example because, in gross slip, the contact reaches beyond the table of
        the profile.

    Examples
    --------
    >>> from mdr_dask.physics.mdr.revolution import PowerProfile
    >>> few, many = exact(PowerProfile(2.0), 0.5, [1.0, 100.0])
    >>> print(f"{few.wear_volume:.3f} {many.wear_volume:.3f}")
    0.131 0.759
    """
    wanted, resolution = sorted({float(amount) for amount in amounts}), Resolution(min(accuracy, COARSEST))
    if stick_radius == 0.0:
        contacts = _slid(profile, wanted, constant_force, resolution)
    else:
        check_stick_radius(stick_radius)
        contacts = _fretted(profile, stick_radius, wanted, constant_force, resolution)
    return [contacts[float(amount)] for amount in amounts]


def operations(accuracy: float, *, constant_force: bool) -> float:
    """Return the approximate number of operations in partial slip, with n^3 operations per time step for n nodes."""
    resolution = Resolution(min(accuracy, COARSEST))
    # time steps that grow by the factor `GROWTH`, plus time steps of a length limited by an error of third order
    steps = float(np.log(1.0 / resolution.step) / np.log(GROWTH) + resolution.step**-0.25)
    return (2.0 if constant_force else 1.0) * steps * resolution.panels(5 if constant_force else 2).nodes.size ** 3


def _fretted(
    profile: Profile, stick_radius: float, wanted: Sequence[float], constant_force: bool, resolution: Resolution
) -> dict[float, Worn]:
    """Return the contact after each wanted number of cycles.

    After very many cycles (see `ENDED`), the contact is the limiting profile. All earlier contacts are taken from the
    same solution. Under constant force, this solution consists of two marches: first with a moving stick border, then
    with a fixed one.
    """
    c = _moved(profile, stick_radius, resolution.flat) if constant_force else stick_radius
    reach = profile.largest_radius
    if np.isinf(reach):
        reach = farthest_contact(profile, c) if constant_force else 1.05 * limit_radius(profile, c)
    ended = ENDED * np.sqrt((reach - c) * (reach + c))
    late = [time for time in wanted if time >= ended]
    early = [time for time in wanted if time < ended]
    if not (constant_force or early):
        return dict.fromkeys(late, limit(profile, c))
    panels = resolution.panels(round(-2.0 * np.log2(max(c, 0.1))) + 5 if constant_force else round(-2.0 * np.log2(c)))
    problem = partial_slip(profile, c, panels, reach)
    first = resolution.step * float(np.sqrt(problem.body.width))

    def stops(moment: SlipMoment) -> bool:
        if problem.edge(moment.unknowns) > profile.largest_radius:
            raise beyond_table(profile, c)
        return problem.border is None and bool(moment.unknowns[panels.mesh.order - 1] > JUMP)

    legs, start = [], None
    if constant_force:
        problem, start = problem.under_force(settled(problem))
        moments = march(problem, np.inf if late else early[-1], resolution.step, first, start, stops)
        legs.append((problem, moments))
        problem, start = problem.stop(moments[-1])
    if early and not (legs and moments[-1].time >= early[-1]):
        legs.append((problem, march(problem, early[-1], resolution.step, first, start, stops)))
    contacts = {}
    for time in early:
        contact = _contact(*next(leg for leg in legs if time <= leg[1][-1].time), time)
        rise = (contact.depth - 1.0) / problem.eta
        if constant_force and rise < resolution.flat:
            contact = replace(contact, stick_border=_moved(profile, stick_radius, rise))
        contacts[time] = contact
    if late:
        contacts |= dict.fromkeys(late, _end(problem, start) if start else limit(profile, c))
    return contacts


def _moved(profile: Profile, c: float, rise: float) -> float:
    """Return the stick border b of the virgin body pressed deeper by rise * eta, from g0(b) = g0(c) + rise * eta.

    Because of rounding errors, `rise` can be negative, or the computed b slightly smaller than c. The result is then c.
    """
    level = float(profile.image(np.array(c)))
    return max(profile.inside(level + max(rise, 0.0) * (1.0 - level)), c)


def farthest_contact(profile: Profile, stick_radius: float) -> float:
    """Return an upper bound of the contact radius under constant force."""
    slipping = virgin_load(profile, 1.0) - virgin_load(profile, stick_radius)
    deepest = 1.0 + slipping / stick_radius
    radius = 1.0 + 4.0 * (1.0 - stick_radius)  # enlarged until the profile is as high as the largest possible depth
    while float(profile.height(np.array([radius]))[0]) < deepest:
        radius *= 1.5
    return radius


def _frozen(problem: PartialSlip, path: FloatArray) -> tuple[FloatArray, FloatArray, Function]:
    """Return the radii that the stick border has passed, and the depth d1 (unit d0) when it passed each radius.

    At these radii the image is d1 - eta. The third result is the slope of this image as a function of position.
    """
    places, depths = rising(path)
    radii, first = np.unique(np.sqrt(problem.body.square + problem.body.width * places), return_index=True)
    reached = 1.0 + problem.eta * depths[first]
    slopes = np.diff(reached) / np.diff(radii) if radii.size > 1 else np.zeros(1)

    def slope(x: FloatArray) -> FloatArray:
        return np.asarray(slopes[np.clip(np.searchsorted(radii, x) - 1, 0, slopes.size - 1)])

    return radii, reached, slope


def _end(problem: PartialSlip, moment: SlipMoment) -> Worn:
    """Return the limiting profile of a contact whose stick border no longer moves after `moment`.

    In the limit, the stick zone carries the whole force. Therefore g = d = (F/2 + int_0^b g dx) / b beyond the border
    b. The radius a of the scar is the root of int_0^a (g - g0) / sqrt(a^2 - x^2) dx = 0.
    """
    profile, c, eta = problem.profile, problem.inner_radius, problem.eta
    border, (radii, reached, frozen_slope) = problem.radius(moment.path[0, -1]), _frozen(problem, moment.path)
    # in int_0^b g dx, the image between c and b is g = d1 - eta (see `_frozen`)
    annulus = float(np.trapezoid((reached - 1.0) / eta - 1.0, radii))
    load = float(problem.load or 0.0)
    depth = 1.0 + eta * (load + annulus) / border

    def change(x: FloatArray) -> FloatArray:
        inside = np.interp(x, radii, reached) - 1.0 - profile.rise(x - c, c)
        return np.asarray(np.where(x < border, inside, depth - 1.0 + eta - profile.rise(x - c, c)))

    def slope(x: FloatArray) -> FloatArray:
        return np.asarray(frozen_slope(x) * (x < border) - profile.image_slope(x))

    scar = closed(profile, Scar(c, np.nan, change, slope, _breaks(c, border)))
    force = 2.0 * (virgin_load(profile, c) + eta * load)
    return worn_by(profile, scar, border, scar.radius, depth, force, worn_volume(scar))


def _contact(problem: PartialSlip, moments: Sequence[SlipMoment], time: float) -> Worn:
    """Return the worn contact at one time in partial slip, computed from the values at the nodes."""
    moment = at(problem, moments, time)
    profile, panels, eta, c = problem.profile, problem.panels, problem.eta, problem.inner_radius
    square, unknowns, path = problem.body.width, moment.unknowns, moment.path
    y, (place, width, deeper) = problem.image(unknowns), problem.place(unknowns)
    (radii, reached, frozen_slope), slope = _frozen(problem, path), panels.slope @ y
    border, a, depth = problem.radius(max(place, 0.0)), problem.edge(unknowns), 1.0 + eta * deeper

    def height(radius: FloatArray) -> FloatArray:
        result, q = profile.height(radius), (radius - c) * (radius + c) / square
        scar = (q > 0.0) & (q < place + width)
        if time > 0.0:
            result[scar] += np.maximum(eta * problem.worn_depth(moment, q[scar]), 0.0)
        return result

    def nodal(values: FloatArray, x: FloatArray) -> FloatArray:
        z = np.clip((x - border) * (x + border) / (square * width), 0.0, 1.0 - 1e-15)
        return interpolate(panels.mesh, values, z.ravel()).reshape(x.shape)

    def change(x: FloatArray) -> FloatArray:
        slipping = depth - 1.0 + eta * nodal(y, x)
        sticking = np.interp(x, radii, reached) - 1.0
        return np.asarray(np.where(x < border, sticking, slipping) - profile.rise(x - c, c))

    def change_slope(x: FloatArray) -> FloatArray:
        slipping = 2.0 * eta * x / (square * width) * nodal(slope, x)
        return np.asarray(np.where(x < border, frozen_slope(x), slipping) - profile.image_slope(x))

    breaks = (*_breaks(c, border), *(float(x) for x in np.sqrt(border**2 + square * width * panels.mesh.edges[1:-1])))
    scar = Scar(c, a, change, change_slope, breaks)
    abscissa, weight = gauss(24)
    annulus = max(place, 0.0) * eta * float(problem.worn_depth(moment, max(place, 0.0) * abscissa) @ weight)
    fine = np.sqrt(c * c + square * (place + width) * np.linspace(0.0, 1.0, 200, endpoint=False))
    load = problem.slipping_load(unknowns) if problem.load is None else problem.load
    return Worn(
        contact_radius=a,
        stick_border=border,
        depth=depth,
        normal_force=2.0 * (virgin_load(profile, c) + eta * load),
        wear_volume=float(np.pi * square * (annulus + width * eta * panels.weights @ moment.accumulated)),
        worn_depth=deepest(lambda r: height(r) - profile.height(r), fine),
        height=height,
        image=worn_image(profile, scar),
        pressure=contact_pressure(profile, scar, a, depth, border),
        relative_error=ERROR,
    )


def _breaks(c: float, border: float) -> tuple[float, ...]:
    """Return radii from c to the border at which integrals are split, closer together near the border.

    If the border is still at c, no radii are returned.
    """
    if not border > c * (1.0 + 1e-12):
        return ()
    return (*(border - (border - c) * 0.25**k for k in range(1, 8)), border)


def _slid(profile: Profile, wanted: Sequence[float], constant_force: bool, resolution: Resolution) -> dict[float, Worn]:
    """Return the contact after each wanted sliding distance. All contacts are taken from the same solution."""
    # near the axis f ~ r^n = (r^2)^(n/2); a body with n < 2 needs smaller panels there
    near, far = profile.image(np.array([1e-5, 2e-5]))
    sharpness = max(2.0 / float(np.log2(far / near)), 1.0) if near > 0.0 else 1.0
    problem = GrossSlip(profile, resolution.panels_in_gross_slip(sharpness))
    if constant_force:
        problem = replace(problem, force=problem.normal_force(problem.start().unknowns))
    moments = march(problem, wanted[-1], resolution.step, resolution.step)
    # the radius has an error that may be equal at all accuracies: a point that the edge passes within a time step wears
    # only after this step
    return {
        path: replace(contact, radius_error=resolution.accuracy * contact.contact_radius)
        for path, contact in ((path, _slid_contact(problem, at(problem, moments, path))) for path in wanted)
    }


def _slid_contact(problem: GrossSlip, moment: Moment) -> Worn:
    """Return the worn contact after one sliding distance. Outside the contact, the image is NaN."""
    profile, panels, unknowns, worn = problem.profile, problem.panels, moment.unknowns, moment.accumulated
    image, a = problem.image(unknowns), problem.edge(unknowns)

    # at constant force, the wear law gives V = int F ds
    volume = np.pi * a**2 * panels.weights @ worn if problem.force is None else problem.force * moment.time

    def inside(values: FloatArray, beyond: float) -> Callable[[FloatArray], FloatArray]:
        def function(place: FloatArray) -> FloatArray:
            share = (place / a) ** 2
            within = interpolate(panels.mesh, values, np.minimum(share, 1.0 - 1e-15))
            return np.where(share < 1.0, within, beyond)

        return function

    depths = inside(worn, 0.0)
    changes = inside(image - profile.image(a * np.sqrt(panels.nodes)), np.nan)
    return Worn(
        contact_radius=a,
        stick_border=0.0,
        depth=float(image[-1]),
        normal_force=problem.normal_force(unknowns),
        wear_volume=float(volume),
        worn_depth=deepest(depths, a * np.sqrt(np.append(0.0, panels.nodes))),
        height=lambda r: np.asarray(profile.height(r) + depths(r)),
        image=lambda x: np.asarray(profile.image(np.abs(x)) + changes(np.abs(x))),
        pressure=inside(problem.rate(unknowns), 0.0),
        relative_error=ERROR,
    )
