"""Worn contacts by the exact evolution, with errors.

The conditions are fretting at constant depth, fretting at constant force, and sliding. Each contact is solved three
times, with coarser panels and longer steps each time, and the error is estimated from the differences.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.half_integrals import interpolate
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.wear.approach import nearly_limit
from mdr_dask.physics.wear.evolution import Dense, NotConvergedError, Resolution, integral_along, march
from mdr_dask.physics.wear.forced import (
    border_moves,
    forced_contacts,
    forced_end,
    forced_resolution,
    least_edge_error,
)
from mdr_dask.physics.wear.rules import limit, limit_radius
from mdr_dask.physics.wear.slip import FixedBorder, GrossSlip, PartialSlip, partial_slip
from mdr_dask.physics.wear.worn import Scar, Worn, check_stick_radius, contact_pressure, virgin_load, worn_image

#: Accuracies above this value are replaced by this value.
COARSEST = 1e-2
#: For fretting at constant depth. `WIDER` has pairs of accuracy and factor on the step tolerance. `THIN` is the width
#: 1 - c of the slip annulus below which this factor tends to 1. `SECOND` is the weight of the second rougher solution
#: in the error. See ``python -m benchmarks accuracy wear``.
WIDER, THIN, SECOND = ((1e-4, 1.0), (3e-4, 1.5), (1e-3, 4.0), (3e-3, 5.0), (1e-2, 3.0)), 0.1, 0.25
#: For fretting at constant depth, panels are chosen for `COARSER` times the accuracy. The product is limited to
#: `COARSER_UNTIL`, or to the accuracy if the accuracy is larger.
COARSER, COARSER_UNTIL = 1.6, 5e-3
#: The pairs of `WIDER` for gross slip at constant depth. If the panels are fine enough, only the error of the edge
#: remains.
SLID_WIDER = (1e-3, 1.0), (3e-3, 3.0), (1e-2, 1.0)
#: For gross slip. `NEAR_AXIS` is the radius, in units of a0, at which the exponent of a body is evaluated. `SHARPEST`
#: is the largest factor on the number of halvings of the panels at the tip of a sharp body.
NEAR_AXIS, SHARPEST = 1e-5, 8.0
Solver = Callable[[Profile, float, Sequence[float], Resolution], dict[float, Worn]]


def exact(
    profile: Profile,
    stick_radius: float,
    amounts: Sequence[float],
    accuracy: float = 1e-3,
    *,
    constant_force: bool = False,
    errors: bool = True,
) -> list[Worn]:
    """Return the worn contact after each amount of wear, by the exact rule df/dN = p (f - f_star) / eta.

    Parameters
    ----------
    profile : Profile
        The virgin body, pressed to the depth 1.
    stick_radius : float
        c of the virgin contact, between 0 and 1; 0 means gross slip in one direction, with df/ds = p in
        the whole contact.
    amounts : sequence of float
        Cycles N >= 0 in units of N0, or sliding paths s = k E* l / (sigma0 a0); any order.
    accuracy : float
        Wanted error of f, divided by eta d0, which is the order of magnitude of the wear. Values below 1e-5 are not
        reached, because round-off accumulates over the steps.
    constant_force : bool
        Keep the force of the virgin contact instead of its depth.
    errors : bool
        Whether to estimate the errors; this about doubles the computing time.

    Returns
    -------
    list of Worn
        The contacts in the order of `amounts`. A contact does not depend on the other amounts.

    Raises
    ------
    ValueError
        If the scar would reach beyond the table of the profile.
    NotConvergedError
        If the evolution cannot be advanced.

    Examples
    --------
    >>> from mdr_dask.physics.mdr.revolution import PowerProfile
    >>> few, many = exact(PowerProfile(2.0), 0.5, [1.0, 100.0])
    >>> print(f"{few.wear_volume:.3f} {many.wear_volume:.3f}")
    0.131 0.759
    """
    wanted = sorted({float(amount) for amount in amounts})
    if stick_radius == 0.0:
        solve: Solver = _slid_under_force if constant_force else _slid
        done: dict[float, Worn] = {}
    else:
        check_stick_radius(stick_radius)
        solve = forced_contacts if constant_force and border_moves(stick_radius, accuracy) else _fretted
        done = nearly_limit(profile, stick_radius, wanted, accuracy) if solve is _fretted else {}
    least = least_edge_error(stick_radius, accuracy) if constant_force and stick_radius > 0.0 else 0.0
    if left := [amount for amount in wanted if amount not in done]:
        done |= _evolved(
            partial(solve, profile, stick_radius, left),
            _resolution(solve, stick_radius, accuracy),
            least,
            errors=errors,
        )
    return [done[float(amount)] for amount in amounts]


def _evolved(
    solve: Callable[[Resolution], dict[float, Worn]], resolution: Resolution, least: float, *, errors: bool
) -> dict[float, Worn]:
    """Return contacts together with the rougher solutions from which their errors are estimated."""
    found, *rougher = _solutions(solve, resolution, errors)
    return {
        amount: replace(
            one,
            rougher=tuple(other[amount] for other in rougher),
            slowness=resolution.slowness,
            second=resolution.second,
            least_edge_error=least,
        )
        for amount, one in found.items()
    }


def limit_under_force(profile: Profile, stick_radius: float, accuracy: float = 1e-3, *, errors: bool = True) -> Worn:
    """Return the limiting profile under constant force.

    Once the image jumps at the stick border, the border no longer moves, and the shape inside the border no longer
    changes. The limiting profile follows from this shape, so the evolution is computed only up to the jump. Parameters
    and exceptions are those of `exact`.
    """
    check_stick_radius(stick_radius)
    if not border_moves(stick_radius, accuracy):
        return limit(profile, stick_radius)
    return _evolved(
        lambda resolution: {np.inf: forced_end(profile, stick_radius, resolution)},
        forced_resolution(accuracy),
        least_edge_error(stick_radius, accuracy),
        errors=errors,
    )[np.inf]


def _solutions(
    solve: Callable[[Resolution], dict[float, Worn]], resolution: Resolution, errors: bool
) -> list[dict[float, Worn]]:
    """Return the solutions at a resolution and, if `errors`, at two rougher resolutions.

    If one of the rougher solutions fails, it is left out; if both fail, NotConvergedError is raised.
    """
    found = [_first_of(solve, (resolution, resolution.finer(2.0), resolution.finer(4.0)))]
    reasons = []
    for rough in resolution.rougher() if errors else ():
        try:
            between = rough.halfway_to(resolution)
            found.append(_first_of(solve, (rough, between, between._replace(fewer=max(rough.fewer - 1, 0)))))
        except NotConvergedError as reason:
            reasons.append(reason)
    if len(reasons) > 1:
        raise NotConvergedError(f"the error of the worn contact is not known: {reasons[0]}")
    return found


def _first_of(solve: Callable[[Resolution], dict[float, Worn]], resolutions: Sequence[Resolution]) -> dict[float, Worn]:
    """Return the solution at the first resolution for which the evolution does not fail."""
    for resolution in resolutions[:-1]:
        try:
            return solve(resolution)
        except NotConvergedError:
            continue
    return solve(resolutions[-1])


def _resolution(solve: Solver, stick_radius: float, accuracy: float) -> Resolution:
    """Return the resolution with which a solver reaches an accuracy."""
    at_most = min(accuracy, COARSEST)
    if solve is forced_contacts:
        return forced_resolution(at_most)
    if solve is _slid:
        return Resolution(at_most, wider=_wider(at_most, SLID_WIDER))
    return fretted_resolution(stick_radius, at_most) if solve is _fretted else Resolution(at_most)


def _wider(accuracy: float, table: tuple[tuple[float, float], ...], power: float = 1.0) -> float:
    """Return the factor on the step tolerance at an accuracy, by linear interpolation of the logarithms of a table."""
    return float(np.exp(power * np.interp(np.log(accuracy), *np.log(table).T)))


def fretted_resolution(stick_radius: float, accuracy: float) -> Resolution:
    """Return the resolution for an accuracy at constant depth.

    The error of f is proportional to the square root of the step error. Steep bodies need more nodes per panel. A thin
    slip annulus is worn off in few steps, so its step tolerance is increased less.
    """
    order = 4 if accuracy > 2e-3 else 5 if accuracy > 5e-4 else 6
    wider = _wider(accuracy, WIDER, min((1.0 - stick_radius) / THIN, 1.0))
    return Resolution(accuracy, wider=wider, order=order, second=SECOND)


def _fretted(profile: Profile, c: float, wanted: Sequence[float], resolution: Resolution) -> dict[float, Worn]:
    """Return the contacts at all wanted times, from one solution of fretting at constant depth."""
    reach = limit_radius(profile, c)
    coarser = min(max(COARSER_UNTIL / resolution.accuracy, 1.0), COARSER)
    panels = resolution.panels(round(-2.0 * np.log2(c)), coarser=coarser)
    problem = partial_slip(profile, c, panels, 1.05 * reach if np.isinf(profile.largest_radius) else reach)
    dense = Dense(march(problem, max(wanted), resolution.step, resolution.first * np.sqrt(problem.virgin_width)))
    energy = integral_along(dense.history, [problem.wear_rate(moment.unknowns) for moment in dense.history])
    return {time: _fretted_contact(problem, dense, time, dense.number(time, energy)) for time in wanted}


def _fretted_contact(problem: PartialSlip, dense: Dense, time: float, energy: float) -> Worn:
    """Turn the nodal values at one time into a worn contact.

    The worn depth is eta s0 (exp(accumulated) - 1), a formula without cancellation. Where `accumulated` exceeds 1,
    eta (s - s0) is used instead, because the long late steps accumulate a larger error than the slip has. The worn
    depth divided by sqrt(r^2 - c^2) is interpolated: this quotient is smooth next to c, before and after the image
    jumps at c.
    """
    profile, panels, c, eta = problem.profile, problem.panels, problem.inner_radius, problem.eta
    unknowns = dense.unknowns(time) if time > 0.0 else problem.start().unknowns
    width, (y, factor), root = problem.width(unknowns), problem.image(unknowns), np.sqrt(panels.nodes)
    a = float(np.sqrt(c * c + width))
    virgin, accumulated = np.exp(problem.virgin_slip(width * panels.nodes)), dense.accumulated(time)
    little = virgin * np.expm1(np.minimum(accumulated, 1.0))
    rooted = eta * np.where(accumulated < 1.0, little, problem.slip(unknowns) - virgin) / root
    slope = panels.slope @ y

    def place(x: FloatArray) -> FloatArray:
        return np.asarray((x - c) * (x + c) / width)

    def height(radius: FloatArray) -> FloatArray:
        result, z = profile.height(radius), place(radius)
        scar = (z > 0.0) & (z < 1.0)
        result[scar] += np.sqrt(z[scar]) * np.maximum(interpolate(panels.mesh, rooted, z[scar]), 0.0)
        return result

    def nodal(values: FloatArray, x: FloatArray) -> FloatArray:
        return interpolate(panels.mesh, values, np.clip(place(x), 0.0, 1.0 - 1e-15).ravel()).reshape(x.shape)

    scar = Scar(
        c,
        a,
        lambda x: np.asarray(eta * nodal(y, x) - profile.rise(x - c, c)),
        lambda x: np.asarray(2.0 * eta * x / width * nodal(slope, x) - profile.image_slope(x)),
        tuple(float(x) for x in np.sqrt(c * c + width * panels.mesh.edges[1:-1])),
    )
    sticking = 2.0 * virgin_load(profile, c)
    slipping = float(np.sqrt(width) * eta * panels.weights @ ((1.0 - y) * factor))
    fine = np.sqrt(c * c + width * np.linspace(0.0, 1.0, 200, endpoint=False))
    return Worn(
        contact_radius=a,
        stick_border=c,
        depth=1.0,
        normal_force=sticking + slipping,
        wear_volume=float(np.pi * width * panels.weights @ (rooted * root)),
        worn_depth=float(np.max(height(fine) - profile.height(fine))),
        height=height,
        image=worn_image(profile, scar),
        pressure=contact_pressure(profile, scar, a, 1.0, c),
        energy_volume=energy,
        steps=dense.steps(time),
        edge_step=_edge_step(problem, dense, time),
    )


def _edge_step(problem: FixedBorder, dense: Dense, time: float) -> float:
    """Return the distance by which the edge moved in the step that contains a time."""
    before, after = (problem.radii(moment.unknowns)[-1] for moment in dense.around(time))
    return float(abs(after - before))


def _slid(profile: Profile, c: float, wanted: Sequence[float], resolution: Resolution) -> dict[float, Worn]:
    """Return the contacts after all wanted sliding paths, at constant depth."""
    panels = resolution.panels(3, sharpness=_sharpness(profile))
    return _slid_contacts(GrossSlip(profile, panels), wanted, resolution.step, resolution.first)


def _slid_under_force(profile: Profile, c: float, wanted: Sequence[float], resolution: Resolution) -> dict[float, Worn]:
    """Return the contacts after all wanted sliding paths, at constant force.

    After a long path the pressure is uniform and jumps to zero at the edge.
    """
    panels = resolution.panels_of_a_punch(_sharpness(profile))
    virgin = GrossSlip(profile, panels)
    problem = GrossSlip(profile, panels, virgin.normal_force(virgin.start().unknowns))
    return _slid_contacts(problem, wanted, resolution.step, resolution.first)


def _sharpness(profile: Profile) -> float:
    """Return the factor on the number of halvings at the axis, which is 1 for a parabola.

    At the axis f is the power n/2 of r^2, so a body with a smaller exponent n needs smaller panels.
    """
    near, far = profile.image(np.array([NEAR_AXIS, 2.0 * NEAR_AXIS]))
    return float(np.clip(2.0 / np.log2(far / near), 1.0, SHARPEST)) if near > 0.0 else 1.0


def _slid_contacts(problem: GrossSlip, wanted: Sequence[float], step: float, first: float) -> dict[float, Worn]:
    """Return the contacts after all wanted sliding paths, from one time integration."""
    dense = Dense(march(problem, max(wanted), step, first))
    energy = integral_along(dense.history, [problem.wear_rate(moment.unknowns) for moment in dense.history])
    return {path: _slid_contact(problem, dense, path, dense.number(path, energy)) for path in wanted}


def _slid_contact(problem: GrossSlip, dense: Dense, path: float, energy: float) -> Worn:
    """Turn the nodal values after one sliding path into a worn contact, whose image is NaN beyond the contact."""
    profile, panels = problem.profile, problem.panels
    unknowns, worn = problem.start().unknowns, np.zeros(panels.nodes.size)
    if path > 0.0:
        unknowns, worn = dense.unknowns(path), dense.accumulated(path)
    (image, depth), width, radii = problem.image(unknowns), problem.width(unknowns), problem.radii(unknowns)

    def inside(values: FloatArray, beyond: float) -> Callable[[FloatArray], FloatArray]:
        def function(place: FloatArray) -> FloatArray:
            share = place**2 / width
            within = interpolate(panels.mesh, values, np.minimum(share, 1.0 - 1e-15))
            return np.where(share < 1.0, within, beyond)

        return function

    depths, changes = inside(worn, 0.0), inside(image - profile.image(radii), np.nan)
    return Worn(
        contact_radius=float(np.sqrt(width)),
        stick_border=0.0,
        depth=depth,
        normal_force=problem.normal_force(unknowns),
        wear_volume=energy,  # in gross slip V = int F ds exactly
        worn_depth=float(max(np.max(worn), depths(np.zeros(1))[0])),
        height=lambda r: np.asarray(profile.height(r) + depths(r)),
        image=lambda x: np.asarray(profile.image(np.abs(x)) + changes(np.abs(x))),
        pressure=inside(problem.rate(unknowns), 0.0),
        energy_volume=energy,
        steps=dense.steps(path),
        edge_step=_edge_step(problem, dense, path),
    )
