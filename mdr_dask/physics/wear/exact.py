"""Worn contacts by the exact evolution, with an error estimate: fretting at constant depth, and sliding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mdr_dask.arrays import FloatArray
from mdr_dask.physics.mdr.half_integrals import Panels, graded_panels, interpolate
from mdr_dask.physics.mdr.revolution import Profile
from mdr_dask.physics.mdr.transforms import gauss
from mdr_dask.physics.wear import evolution
from mdr_dask.physics.wear.gross_slip import GrossSlip
from mdr_dask.physics.wear.worn import Worn, check_stick_radius, limit_radius, worn_height, worn_volume

#: Error over the distance from a solution with a four times wider tolerance: it falls about as the tolerance's square
#: root, sometimes as its cube root.
_SAFETY = 1.5


@dataclass(frozen=True, eq=False)
class Fretted(Worn):
    """A worn contact that also knows the energy lost: `wear_volume` from the shape, `energy_volume` from the slip.

    Parameters
    ----------
    energy_volume : float
        The energy dissipated since the first cycle over mu, in units in which it equals the wear volume.
    steps : int
        Time steps taken.
    """

    energy_volume: float = np.nan
    steps: int = 0


def exact(profile: Profile, stick_radius: float, cycles: Sequence[float], tolerance: float = 1e-4) -> list[Fretted]:
    """Return the worn contact after each number of cycles, by the exact rule df/dN = p (f - f_star) / eta.

    Parameters
    ----------
    profile : Profile
        The virgin body.
    stick_radius : float
        c, between 0 and 1.
    cycles : sequence of float
        N >= 0, in units of N0; any order.
    tolerance : float
        Error of f wanted, in eta d0, the scale of what can wear; below 1e-5 round-off gathered over the steps grows.

    Returns
    -------
    list of Fretted
        In the order of `cycles`. The error is 1.5 times the distance from a solution with a four times wider
        tolerance.

    Raises
    ------
    ValueError
        Without partial slip, or if the scar would leave the table of the profile.
    NotConvergedError
        If the evolution cannot be advanced.
    """
    check_stick_radius(stick_radius)
    wanted = sorted({float(n) for n in cycles if n > 0.0})
    fine = _fretted(profile, stick_radius, wanted, tolerance)
    coarse = _fretted(profile, stick_radius, wanted, 4.0 * tolerance)
    judged = {n: replace(fine[n], error=_SAFETY * _distance(fine[n], coarse[n])) for n in fine}
    return [judged[float(n)] for n in cycles]


def exact_without_error(profile: Profile, stick_radius: float, cycles: float, tolerance: float = 1e-4) -> Fretted:
    """Return one worn contact as `exact` does, at a fifth less cost, without the estimate of its error (NaN)."""
    check_stick_radius(stick_radius)
    return replace(_fretted(profile, stick_radius, [cycles], tolerance)[cycles], error=np.nan)


@dataclass(frozen=True, eq=False)
class Slid:
    """A contact worn by gross slip.

    Parameters
    ----------
    contact_radius, depth, wear_volume, normal_force : float
        a, d, V (from the shape), F_N.
    force_path : float
        int F_N ds, equal to V.
    radius, height, image, pressure : array
        r, f, g, p at the nodes, the last of which is the edge.
    profile : Profile
        The virgin body.
    panels : Panels
        Interpolation between the nodes.
    worn_depth : float
        Largest f - f0.
    error : float
        Error expected of f, in d0: 1.5 times the distance from a solution with a four times wider tolerance.
    stick_radius : float
        0: everything slips.
    """

    contact_radius: float
    depth: float
    wear_volume: float
    normal_force: float
    force_path: float
    radius: FloatArray
    height: FloatArray
    image: FloatArray
    pressure: FloatArray
    profile: Profile
    panels: Panels
    worn_depth: float
    error: float = np.nan
    stick_radius: float = 0.0

    def curve(self, name: str, place: FloatArray) -> FloatArray:
        """Return height, image or pressure anywhere; beyond the contact f = f0, p = 0 and the image is NaN."""
        share = (place / self.contact_radius) ** 2
        virgin = {"height": self.profile.height, "image": self.profile.image}.get(name, np.zeros_like)
        inner = interpolate(self.panels, getattr(self, name) - virgin(self.radius), np.minimum(share, 1.0 - 1e-15))
        beyond = np.nan if name == "image" else 0.0
        return np.asarray(virgin(place) + np.where(share < 1.0, inner, beyond))


def gross(
    profile: Profile, paths: Sequence[float], *, constant_force: bool = False, tolerance: float = 1e-4
) -> list[Slid]:
    """Return the contact after sliding, df/ds = p in all of the contact.

    Parameters
    ----------
    profile : Profile
        The virgin body, pressed to the depth 1.
    paths : sequence of float
        s = k E* l / (sigma0 a0) >= 0.
    constant_force : bool
        Keep the force of the virgin contact instead of its depth.
    tolerance : float
        Error of f in one time step, in d0.

    Returns
    -------
    list of Slid
        One for each path.
    """
    fine = _sliding(profile, paths, constant_force, tolerance)
    coarse = _sliding(profile, paths, constant_force, 4.0 * tolerance)
    return [replace(one, error=_SAFETY * _slid_distance(one, other)) for one, other in zip(fine, coarse, strict=True)]


def _sliding(profile: Profile, paths: Sequence[float], constant_force: bool, tolerance: float) -> list[Slid]:
    """Solve once and describe every path.

    Under constant force the pressure tends to a jump at the edge: short panels there, and steps no finer than the
    panels, or the steps follow the panels' noise.
    """
    panels, step_error, force = _panels(tolerance, 0.3), 0.2 * tolerance, None
    if constant_force:
        doubled = round(2.0 * max(-np.log10(tolerance), 2.0))
        panels, step_error = graded_panels(doubled + 1, doubled + 4, 4), tolerance
        virgin = GrossSlip(profile, panels)
        force = virgin.normal_force(virgin.start().unknowns)
    problem = GrossSlip(profile, panels, force)
    history = evolution.march(problem, max(paths), step_error)
    loads = evolution.integral_along(history, [problem.normal_force(m.unknowns) for m in history])
    return [
        _slid(problem, evolution.unknowns_at(history, path), evolution.value_at(history, loads, path)) for path in paths
    ]


def _slid_distance(fine: Slid, coarse: Slid) -> float:
    """Return the largest difference of two worn profiles at the nodes of the finer."""
    return float(np.max(np.abs(fine.height - coarse.curve("height", fine.radius))))


def _slid(problem: GrossSlip, unknowns: FloatArray, force_path: float) -> Slid:
    image, a, depth = problem.split(unknowns)
    gathered = problem.gathered(unknowns)
    return Slid(
        contact_radius=a,
        depth=depth,
        wear_volume=np.pi * a * a * float(problem.panels.weights @ gathered),
        normal_force=problem.normal_force(unknowns),
        force_path=force_path,
        radius=problem.radii(a),
        height=problem.worn(unknowns),
        image=image,
        pressure=problem.pressure(unknowns),
        profile=problem.profile,
        panels=problem.panels,
        worn_depth=float(np.max(gathered)),
    )


def _panels(tolerance: float, smallest: float) -> Panels:
    """Choose panels fine enough for a tolerance; next to the inner border they resolve the length `smallest`."""
    digits = max(-np.log10(tolerance), 2.0)
    levels = round(2.7 * digits - 3.3)  # fewer at the moving edge, and short steps follow the panels' noise
    near = round(-2.0 * np.log2(smallest))
    order = 4 if tolerance > 3e-5 else 6
    return graded_panels(levels + near, levels, order)


def _fretted(profile: Profile, c: float, wanted: Sequence[float], tolerance: float) -> dict[float, Fretted]:
    """Solve once and describe every wanted time."""
    panels = _panels(tolerance, c)
    reach = limit_radius(profile, c)
    problem = evolution.partial_slip(profile, c, panels, 1.05 * reach if np.isinf(profile.largest_radius) else reach)
    history = evolution.march(problem, max(wanted, default=0.0), 0.2 * tolerance * problem.eta)
    energy = evolution.integral_along(history, [problem.wear_rate(m.unknowns) for m in history])
    result = {}
    for time in (0.0, *wanted):
        unknowns = evolution.unknowns_at(history, time)
        steps = int(np.searchsorted([m.time for m in history], time))
        spent = evolution.value_at(history, energy, time)
        result[time] = replace(_describe(problem, unknowns, time), energy_volume=spent, steps=steps)
    return result


def _describe(problem: evolution.PartialSlip, unknowns: FloatArray, time: float) -> Fretted:
    """Turn the nodal values at one time into a worn contact."""
    c, a, panels = problem.inner_radius, float(unknowns[-1]), problem.panels
    profile, eta = problem.profile, problem.eta
    y, _, length = problem.split(unknowns)
    slope = panels.slope @ y

    def place(x: FloatArray) -> FloatArray:
        return np.clip((x - c) * (x + c) / length, 0.0, 1.0 - 1e-15)

    def change(x: FloatArray) -> FloatArray:
        shares = interpolate(panels, y, place(x).ravel()).reshape(x.shape)
        return np.asarray(eta * shares - profile.rise(x, c))

    def change_slope(x: FloatArray) -> FloatArray:
        slopes = interpolate(panels, slope, place(x).ravel()).reshape(x.shape)
        return np.asarray(2.0 * eta * x / length * slopes - profile.image_slope(x))

    breaks = tuple(float(x) for x in np.sqrt(c * c + length * panels.edges[1:-1]))
    abscissa, weight = gauss(32)
    stuck = 2.0 * c * float((1.0 - profile.image(c * abscissa)) @ weight)
    slipping = float(np.sqrt(length) * eta * panels.weights @ ((1.0 - y) * np.sqrt(length) / problem.radii(a)))
    volume = worn_volume(change, c, a, breaks) if time > 0.0 else 0.0
    return Fretted(profile, c, a, a, volume, stuck + slipping, 0.0, change, change_slope, breaks)


def _distance(fine: Worn, coarse: Worn) -> float:
    """Return the largest difference of two worn profiles."""
    c = fine.stick_radius
    r = c + (fine.contact_radius - c) * np.sin(0.5 * np.pi * np.arange(1, 80) / 80.0) ** 4
    first = worn_height(fine.change, c, r, fine.breaks)
    outer = r < coarse.contact_radius
    second = np.where(outer, worn_height(coarse.change, c, r, coarse.breaks), 0.0)
    return float(np.max(np.abs(first - second)))
