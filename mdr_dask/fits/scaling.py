"""What stands behind the law of sliding friction: growth of the contact, its slope, and the general scaling."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import DOUBTFUL, Fit, fitted, law_holds
from mdr_dask.fits.friction import (
    MODELS,
    ZONE_ONE,
    Table,
    Variables,
    constant,
    each,
    holds,
    loads_and_velocities,
    measure,
    one_value,
    peak_velocity,
    spectral_slope,
    table_of,
    zone_one_axes,
)
from mdr_dask.physics.sliding import laws

KNOTS = 2  # of the common curve of a collapse for every decade of velocity
BEND = 0.3  # change of d ln mu / d ln v along a curve, below which it could lie anywhere on a straight common curve


def _one(value: float | FloatArray) -> xr.DataArray:
    return xr.DataArray(value)


def _slowest(force: FloatArray, velocity: FloatArray, known: BoolArray) -> list[int]:
    """Return the case of the lowest velocity for every load of zone 1."""
    loads = np.unique(force[(force >= ZONE_ONE[0]) & (force <= ZONE_ONE[1]) & known])
    same = [np.flatnonzero((force == load) & known) for load in loads]
    return [int(cases[np.argmin(velocity[cases])]) for cases in same]


def _contact_growth(data: xr.Dataset) -> Variables:
    """Fit the power of the length in contact over the load, at the lowest velocity."""
    forces, velocities = loads_and_velocities(data)
    table = table_of(data, _one(1.0), forces, velocities, output="contact_fraction")
    force, velocity = table.columns
    used = _slowest(force, velocity, table.mean() > 0)
    if len(used) < 3:
        raise FitError(f"expected three loads with F_N / (G h L) in {ZONE_ONE[0]}..{ZONE_ONE[1]}, got {len(used)}")
    x, count, hurst = np.log(force[used]), table.count(used), one_value(data, "hurst")
    design = np.vstack([x, np.ones(x.size)])
    found = fitted(
        lambda logs: logs @ np.linalg.pinv(design),
        lambda logs, constants: logs - constants @ design,
        table.logarithms(used),
        count,
    )
    worst = f"F_N / (G h L) = {force[used][np.argmax(np.abs(found.departures))]:.2g}"
    power, level = found.constants.T
    return {
        **constant("exponent", power, count, "exponent of the length in contact over the load"),
        **measure("exponent_stated", 1 / (1 + hurst), "1 / (1 + H) (after eq. 3.12)"),
        **constant("factor", np.exp(level), count, "L_cont / L at F_N = G h L, by the power law", positive=True),
        **_balance(data, used),
        **measure("rms_error", float(np.sqrt(np.mean(found.departures**2))), "rms relative deviation from the law"),
        **measure("loads", len(used), "number of loads in zone 1"),
        **holds(law_holds(found.departures, found.chance, 2, worst)),
    }


def _balance(data: xr.Dataset, used: list[int]) -> Variables:
    """Return the slope in contact over the slope, and mu over eq. 3.12, of the cases used, where the store has both."""
    if not {"contact_slope", "friction_coefficient"} <= set(data.data_vars):
        return {}
    slope = spectral_slope(data)
    ratio = table_of(data, slope, output="contact_slope")
    force, velocity = loads_and_velocities(data)
    law = laws.full_contact(force, velocity) * data["contact_fraction"] * (data["contact_slope"] / slope) ** 2
    balance = table_of(data, slope * law)
    found = {
        "slope_in_contact": (ratio, "rms slope in contact over that of the line, mean over the loads"),
        "mu_over_law": (balance, "mu over 4 eta v L_cont slope_cont^2 / F_N (eq. 3.12), mean over the loads"),
    }
    return {
        key: value
        for name, (table, meaning) in found.items()
        for key, value in constant(name, table.stack(used).mean(axis=1), table.count(used), meaning).items()
    }


def contact_slope_law(fraction: FloatArray, hurst: float, points: float) -> FloatArray:
    """Return the slope in contact over that of the line by eq. 3.21; NaN where the contact is shorter than a wave.

    Parameters
    ----------
    fraction : array
        Length in contact over that of the line.
    hurst, points : float
        Hurst exponent and number of Nyquist points of the line.
    """
    power = 2 * (1 - hurst)
    longest, shortest = 1 / np.clip(fraction, 1e-300, 1.0), points / 2  # 2 pi / L_cont and q_max over 2 pi / L
    if power < 1e-9:
        share = np.log(shortest / longest) / np.log(shortest)
    else:
        share = (shortest**power - longest**power) / (shortest**power - 1)
    law: FloatArray = np.sqrt(np.where(share > 0, share, np.nan))
    return law


def _contact_slope(data: xr.Dataset) -> Variables:
    """Compare the slope in contact with eq. 3.21 over the size of the contact."""
    hurst, points = one_value(data, "hurst"), one_value(data, "points")
    slopes = table_of(data, spectral_slope(data), output="contact_slope")
    fractions = table_of(data, _one(1.0), output="contact_fraction")
    law = contact_slope_law(fractions.mean(), hurst, points)
    used = np.flatnonzero((slopes.mean() > 0) & np.isfinite(law))
    if used.size < 3:
        raise FitError(f"expected three cases whose contact is longer than the shortest wave, got {used.size}")
    count = min(slopes.count(used), fractions.count(used))
    pairs = _pairs(slopes, fractions, used, lambda log: np.log(contact_slope_law(np.exp(log), hurst, points)))
    found = fitted(
        lambda rows: (rows[:, 0] - rows[:, 1]).mean(axis=1, keepdims=True),
        lambda rows, level: np.stack([rows[:, 0] - rows[:, 1] - level, 0 * rows[:, 1]], axis=1),
        pairs,
        count,
    )
    spread = float(np.ptp(pairs[0, 1]))
    worst = f"L_cont / L = {fractions.mean()[used][np.argmax(np.abs(found.departures[0]))]:.2g}"
    return {
        **constant("factor", np.exp(found.constants[:, 0]), count, "slope in contact over eq. 3.21", positive=True),
        **constant("power", _slope_of(pairs), count, "power of the slope in contact over eq. 3.21; 1 if it holds"),
        **measure("range", np.exp(spread), "largest over smallest slope by eq. 3.21"),
        **measure("rms_error", float(np.sqrt(np.mean(found.departures[0] ** 2))), "rms relative deviation"),
        **measure("cases", int(used.size), "cases whose contact is longer than the shortest wave"),
        **holds(law_holds(found.departures[0], found.chance, 1, worst)),
    }


def _pairs(
    slopes: Table, fractions: Table, used: NDArray[np.int64], law: Callable[[FloatArray], FloatArray]
) -> FloatArray:
    """Return the stack of logarithms of slopes and of what the law says of the contact, shape (rows, 2, cases)."""
    plain = 1 + bootstrap.RESAMPLES
    one, other = slopes.logarithms(used), fractions.logarithms(used)
    rows = [np.stack([one[:plain], law(other[:plain])], axis=1)]
    rows.append(np.stack([one[plain:], np.broadcast_to(law(other[0]), one[plain:].shape)], axis=1))
    rows.append(np.stack([np.broadcast_to(one[0], other[plain:].shape), law(other[plain:])], axis=1))
    both: FloatArray = np.concatenate(rows)
    return both


def _slope_of(pairs: FloatArray) -> FloatArray:
    """Return the slope of the straight line through the pairs of every row."""
    y, x = (pairs[:, k] - pairs[:, k].mean(axis=1, keepdims=True) for k in (0, 1))
    with np.errstate(invalid="ignore", divide="ignore"):
        slope: FloatArray = np.sum(x * y, axis=1) / np.sum(x**2, axis=1)
    return slope


class Collapse(NamedTuple):
    """Curves shifted into one.

    Attributes
    ----------
    shifts : array, shape (rows, 2, curves)
        Stack of the shifts along ln velocity and ln friction, the reference's 0.
    residuals : array, shape (rows, points)
        Stack of the distances of the points from the common curve.
    constants : int
        How many heights of the common curve and shifts were fitted.
    """

    shifts: FloatArray
    residuals: FloatArray
    constants: int

    @property
    def tested(self) -> bool:
        """Whether there are more points than constants."""
        return bool(self.residuals.shape[1] > self.constants)


def collapse(x: FloatArray, rows: FloatArray, curve: FloatArray, start: FloatArray, reference: int) -> Collapse:
    """Shift curves along both axes into a common curve without a form of its own, by least squares.

    Parameters
    ----------
    x : array, shape (points,)
        Logarithms of velocity.
    rows : array, shape (rows, points)
        Stack of logarithms of friction.
    curve : int array, shape (points,)
        Which curve a point is on.
    start : array, shape (curves,)
        Shifts along x from which the search starts.
    reference : int
        The curve that stays.
    """
    tries = (_collapsed_from(x, rows[0], curve, shift, reference) for shift in (start - start[reference], 0 * start))
    jacobian, residuals, shift, _ = min(tries, key=lambda found: found.cost)
    inverse = np.linalg.pinv(jacobian, rcond=1e-8)
    change = rows - rows[0]
    steps = change @ inverse[:, : x.size].T
    free = np.delete(np.arange(start.size), reference)
    shifts = np.zeros((len(rows), 2, start.size))
    shifts[:, :, free] = shift + steps[:, -shift.size :].reshape(len(rows), *shift.shape)
    return Collapse(shifts, residuals[: x.size] + change - steps @ jacobian[: x.size].T, jacobian.shape[1])


class _Minimum(NamedTuple):
    """A least-squares solution: how the common curve moves with what is unknown, its residuals, the shifts, the sum."""

    jacobian: FloatArray
    residuals: FloatArray
    shift: FloatArray
    cost: float


def _collapsed_from(x: FloatArray, row: FloatArray, curve: FloatArray, start: FloatArray, reference: int) -> _Minimum:
    """Fit a common curve, of natural splines that are held against bending where no point is, and the shifts to it."""
    from scipy.optimize import least_squares

    free = np.delete(np.arange(start.size), reference)
    member = (curve[:, None] == free).astype(float)
    ends = (x + start[curve]).min() - 0.5, (x + start[curve]).max() + 0.5
    knots = np.linspace(*ends, 2 + int(np.ceil(KNOTS * (ends[1] - ends[0]) / np.log(10))))
    bends = 1e-3 * np.diff(np.eye(knots.size), 2, axis=0)
    stiff = np.hstack([bends, np.zeros((len(bends), 2 * free.size))])
    splines = _splines(knots)

    def residuals(unknown: FloatArray) -> FloatArray:
        height, along, up = np.split(unknown, [knots.size, knots.size + free.size])
        common = splines(x + member @ along)[0] @ height
        return np.concatenate([row + member @ up - common, -bends @ height])

    def jacobian(unknown: FloatArray) -> FloatArray:
        height, along, _ = np.split(unknown, [knots.size, knots.size + free.size])
        basis, slopes = splines(x + member @ along)
        return np.vstack([np.hstack([-basis, -(slopes @ height)[:, None] * member, member]), -stiff])

    basis, _ = splines(x + start[curve])
    height = np.linalg.lstsq(np.vstack([basis, bends]), np.concatenate([row, np.zeros(len(bends))]))[0]
    found = least_squares(residuals, np.concatenate([height, start[free], 0 * start[free]]), jacobian, method="lm")
    shift = found.x[knots.size :].reshape(2, -1)
    return _Minimum(-jacobian(found.x), found.fun, shift, float(found.cost))


def _splines(knots: FloatArray) -> Callable[[FloatArray], tuple[FloatArray, FloatArray]]:
    """Return natural cubic splines of unit height at each knot, and their slopes, as a function of places."""
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(knots, np.eye(knots.size), bc_type="natural")

    def at(place: FloatArray) -> tuple[FloatArray, FloatArray]:
        inside = np.clip(place, knots[0], knots[-1])
        slopes = spline(inside, 1)
        return spline(inside) + slopes * (place - inside)[:, None], slopes

    return at


def _collapse(data: xr.Dataset) -> Variables:
    """Shift the curves of friction over velocity for every load into one, regions I to III."""
    forces, velocities = loads_and_velocities(data)
    table = table_of(data, spectral_slope(data), forces, velocities)
    force, velocity = table.columns
    mean = np.nan_to_num(table.mean())
    loads: list[float] = []
    used: list[int] = []
    curve: list[int] = []
    for load in np.unique(force):
        same = np.flatnonzero((force == load) & (mean > 0))
        same = same[velocity[same] <= peak_velocity(velocity[same], mean[same])] if same.size else same
        if same.size >= 3:
            used.extend(same)
            curve.extend([len(loads)] * same.size)
            loads.append(float(load))
    if len(loads) < 2:
        raise FitError(f"expected two loads with three velocities or more up to the largest friction, got {len(loads)}")
    x, which, count = np.log(velocity[used]), np.array(curve), table.count(used)
    stack = table.logarithms(used)
    reference = len(loads) // 2
    start = -np.log(laws.crossover(np.array(loads), laws.alpha(one_value(data, "hurst")), laws.BETA))
    found = collapse(x, stack, which, start, reference)
    if not bootstrap.chance(found.residuals, count) >= DOUBTFUL:
        missed = np.concatenate([stack[:1], bootstrap.moved(stack[0], found.residuals[0])])
        further = collapse(x, missed, which, start, reference).shifts[1:]
        found = found._replace(shifts=np.concatenate([found.shifts, further]))
    result = _collapsed(found, _spread(x, stack[0]), np.array(loads), start - start[reference], count)
    return _for_all(np.unique(force), np.array(loads), result | _where(found, x, stack[0], which, count))


def _spread(x: FloatArray, row: FloatArray) -> float:
    """Return the rms distance of the points from a common curve before they are shifted."""
    knots = np.linspace(x.min(), x.max(), 2 + int(np.ceil(KNOTS * np.ptp(x) / np.log(10))))
    basis, _ = _splines(knots)(x)
    left = row - basis @ np.linalg.lstsq(basis, row)[0]
    return float(np.sqrt(np.mean(left**2)))


def _collapsed(found: Collapse, spread: float, loads: FloatArray, stated: FloatArray, count: int) -> Variables:
    """Return how well curves collapse, and whether they do."""
    chance = bootstrap.chance(found.residuals, count)
    rms = float(np.sqrt(np.mean(found.residuals[0] ** 2)))
    names = {
        "force_number": (loads, "F_N / (G h L) of every curve"),
        "horizontal_stated": (stated / np.log(10), "shift along log velocity by eqs. 3.17 and 3.23"),
    }
    return {
        **measure("rms_error", rms, "rms relative distance of the points from the common curve"),
        **measure("rms_before", spread, "the same before shifting"),
        **measure("collapsed", 1 - (rms / spread) ** 2, "share of the spread that shifting takes away"),
        **measure("cases", found.residuals.shape[1], "number of cases shifted"),
        **{
            name: xr.Variable("curve", value, {"units": "1", "long_name": text})
            for name, (value, text) in names.items()
        },
        **holds(law_holds(found.residuals[0], chance, found.constants)),
    }


def _for_all(forces: FloatArray, loads: FloatArray, result: Variables) -> Variables:
    """Return variables of curves as those of all loads of a study, NaN where friction falls too soon for a curve."""
    wide: Variables = {}
    for name, variable in result.items():
        wide[name] = variable
        if variable.dims == ("curve",):
            values = np.full(forces.size, np.nan)
            values[np.searchsorted(forces, loads)] = variable.values
            wide[name] = xr.Variable("curve", forces if name == "force_number" else values, variable.attrs)
    return wide


def _where(found: Collapse, x: FloatArray, row: FloatArray, curve: FloatArray, count: int) -> Variables:
    """Return the shifts in decades with their intervals; NaN ends where the points cannot tell them apart."""
    straight = [_bend(x[curve == k], row[curve == k]) < BEND for k in range(found.shifts.shape[2])]
    vague = np.array(straight) | (not found.tested)
    result = {}
    for k, name in enumerate(("horizontal", "vertical")):
        low, high = bootstrap.interval(found.shifts[:, k] / np.log(10), count)
        ends = {"": found.shifts[0, k] / np.log(10), "_low": low, "_high": high}
        for end, value in ends.items():
            known = value if not end else np.where(vague, np.nan, value)
            meaning = f"shift along the {'velocity' if k == 0 else 'friction'} in decades"
            result[name + end] = xr.Variable("curve", known, {"units": "1", "long_name": meaning})
    return result


def _bend(x: FloatArray, y: FloatArray) -> float:
    """Return how much the logarithmic slope changes along a curve."""
    slopes = np.diff(y) / np.diff(x)
    return float(np.ptp(slopes))


FITS: tuple[Fit, ...] = (
    Fit(
        "contact_growth",
        MODELS,
        "L_cont / L = factor (F_N / (G h L))^exponent in zone 1, beside 1 / (1 + H), and mu over eq. 3.12",
        lambda series: each(series, zone_one_axes, _contact_growth, "contact_fraction"),
        apart=True,
        constants=("exponent", "factor", "slope_in_contact", "mu_over_law"),
    ),
    Fit(
        "contact_slope",
        MODELS,
        "rms slope in contact over its size, slope_cont^2 ~ q_max^(2 - 2H) - (2 pi / L_cont)^(2 - 2H) (eq. 3.21)",
        lambda series: each(series, zone_one_axes, _contact_slope, "contact_slope", "contact_fraction"),
        apart=True,
        constants=("factor", "power"),
    ),
    Fit(
        "collapse",
        MODELS,
        "mu = slope g(F_N) q(v f(F_N)): curves over log v shifted along both axes into one (eqs. 3.22, 3.23)",
        lambda series: each(series, zone_one_axes, _collapse),
        apart=True,
        constants=("horizontal", "vertical"),
    ),
)
