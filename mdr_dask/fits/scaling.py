"""Fit three laws of sliding friction: contact growth, slope in contact, and general scaling (thesis eqs. 3.12 to 3.23).

`mdr_dask.fits.friction` defines the zones of the load and the regions of the velocity. L is the length of the line,
L_cont is the length in contact, and q_max is the largest wave number of the roughness.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import DOUBTFUL, WITHIN, Fit, undetermined, verdict
from mdr_dask.fits.cases import (
    Variables,
    constant,
    each,
    holds,
    linear,
    measure,
    one_value,
    power_law,
    rms,
    stated_power,
    table_of,
)
from mdr_dask.fits.friction import (
    FRICTION,
    KELVIN,
    MODELS,
    NEEDS_SLOPE,
    ZONE_ONE,
    at_load,
    load_and_velocity_axes,
    loads_and_velocities,
    loads_of_zone_one,
    rising,
    spectral_slope,
)
from mdr_dask.physics.sliding import laws

KNOTS = 2  # number of knots of the common curve per decade of velocity; chosen by trial
SLOPE_FOLLOWED = "whether friction beyond its maximum is proportional to the slope in contact"


def _contact_growth(data: xr.Dataset) -> Variables:
    """Fit a power law to the length in contact against the load, at the lowest velocity of each load in zone 1."""
    table = table_of(data, 1.0, *loads_and_velocities(data), output="contact_fraction")
    force, velocity = table.columns
    used = [int(same[np.argmin(velocity[same])]) for same in loads_of_zone_one(force, table.mean() > 0)]
    if len(used) < 3:
        raise FitError(
            f"expected at least three loads with F_N / (G h L) in {ZONE_ONE[0]}..{ZONE_ONE[1]}, got {len(used)}"
        )
    x, count, stated = np.log(force[used]), table.count(used), 1 / (1 + one_value(data, "hurst"))
    logs, where = table.logarithms(used), at_load(force[used])
    found = power_law(x, logs, count)
    level = np.exp(found.constants[:, 1])
    return {
        **constant("exponent", found.constants[:, 0], count, "exponent of the load in the law of the contact length"),
        **measure("exponent_stated", stated, "exponent 1 / (1 + H) by the thesis (after eq. 3.12)"),
        **constant("factor", level, count, "L_cont / L at F_N = G h L by the fitted power law", positive=True),
        **_balance(data, used),
        **measure("rms_error", found.rms, "rms relative deviation from the law with the fitted constants"),
        **measure("loads", len(used), "number of loads in zone 1"),
        **holds(stated_power(x, logs, stated, count, where), found.holds(where)),
    }


def _balance(data: xr.Dataset, used: list[int]) -> Variables:
    """Return two ratios: slope in contact divided by slope of the line, and computed mu divided by mu of eq. 3.12.

    Return no variables if the study contains no slope in contact or no friction.
    """
    if not {"contact_slope", "friction_coefficient"} <= set(data.data_vars):
        return {}
    slope = spectral_slope(data)
    law = laws.full_contact(*loads_and_velocities(data)) * data["contact_fraction"]
    found = {
        "slope_in_contact": (
            table_of(data, slope, output="contact_slope"),
            "rms slope in contact divided by that of the line, mean over the loads",
        ),
        "mu_over_law": (
            table_of(data, slope * law * (data["contact_slope"] / slope) ** 2),
            "mu divided by 4 eta v L_cont slope_cont^2 / F_N (eq. 3.12), mean over the loads",
        ),
    }
    return {
        key: value
        for name, (table, meaning) in found.items()
        for key, value in constant(name, table.stack(used).mean(axis=1), table.count(used), meaning).items()
    }


def contact_slope_law(fraction: FloatArray, hurst: float, points: float) -> FloatArray:
    """Return the slope in contact divided by the slope of the line, according to eq. 3.21.

    `fraction` is the length in contact divided by the length of the line. Only waves that are shorter than the length
    in contact contribute. If there is no such wave, the result is NaN. The line has `points` points, and the shortest
    wave is as long as two spacings of the points.
    """
    power = 2 * (1 - hurst)
    # wave numbers of the longest and the shortest wave, 2 pi / L_cont and q_max, both divided by 2 pi / L
    longest, shortest = 1 / np.clip(fraction, 1e-300, 1.0), points / 2
    if power < 1e-9:
        share = np.log(shortest / longest) / np.log(shortest)
    else:
        share = (shortest**power - longest**power) / (shortest**power - 1)
    law: FloatArray = np.sqrt(np.where(share > 0, share, np.nan))
    return law


def _contact_slope(data: xr.Dataset) -> Variables:
    """Compare the slope in contact with eq. 3.21 times a fitted factor. Compare friction with the slope in contact."""
    hurst, points = one_value(data, "hurst"), one_value(data, "points")
    slopes = table_of(data, spectral_slope(data), output="contact_slope")
    fractions = table_of(data, 1.0, output="contact_fraction")
    used = np.flatnonzero((slopes.mean() > 0) & np.isfinite(contact_slope_law(fractions.mean(), hurst, points)))
    if used.size < 3:
        raise FitError(f"expected at least three cases whose contact is longer than the shortest wave, got {used.size}")
    count = min(slopes.count(used), fractions.count(used))
    law = np.log(contact_slope_law(np.exp(fractions.logarithms(used)), hurst, points))
    found = linear(np.ones((1, used.size)), bootstrap.difference(slopes.logarithms(used), law), count)
    fraction = fractions.mean()[used]
    holding = found.holds(lambda k: f"L_cont / L = {fraction[k]:.2g}")
    # if all lengths in contact are nearly equal, any law with a fitted factor explains the slopes
    if np.ptp(np.log(fraction)) < WITHIN:
        holding = f"not tested: the lengths in contact of these cases differ by less than {WITHIN:.0%}"
    return {
        **constant("factor", np.exp(found.constants[:, 0]), count, "slope in contact divided by eq. 3.21", True),
        **measure("rms_error", found.rms, "rms relative deviation from eq. 3.21 with the fitted factor"),
        **measure("cases", int(used.size), "number of cases whose contact is longer than the shortest wave"),
        **_friction_of_slope(data),
        **holds(holding),
    }


def _friction_of_slope(data: xr.Dataset) -> Variables:
    """Test whether friction in region IV (velocities beyond the maximum) is proportional to the slope in contact.

    Return no variables if the study contains no friction, or lacks a parameter in `KELVIN`.
    """
    if not {"friction_coefficient", *KELVIN} <= set(data.variables):
        return {}
    table = table_of(data, 1.0, *loads_and_velocities(data))
    slopes = table_of(data, 1.0, output="contact_slope")
    force, velocity = table.columns
    mean = np.nan_to_num(table.mean())
    known = (mean > 0) & (np.nan_to_num(slopes.mean()) > 0)
    beyond = np.flatnonzero(known & ~rising(force, velocity, mean, known))
    if not beyond.size:
        return measure("friction_follows", "not tested: no velocity beyond the largest friction", SLOPE_FOLLOWED)
    count = table.count(beyond)
    ratios = bootstrap.difference(table.logarithms(beyond), slopes.logarithms(beyond))
    found = linear(np.ones((1, beyond.size)), ratios, count)
    ratio = np.exp(found.constants[:, 0])
    where = at_load(force[beyond])
    meaning = "mu divided by the slope in contact, beyond the largest friction; 2 / sqrt 3 for one parabolic tip"
    return {
        **constant("friction_over_slope", ratio, count, meaning, positive=True),
        **measure(
            "fall",
            float(mean[beyond].max() / mean[beyond].min()),
            "largest mu divided by smallest mu, beyond the maximum",
        ),
        **measure("friction_follows", found.holds(where), SLOPE_FOLLOWED),
    }


class Collapse(NamedTuple):
    """The shifts of several curves onto a common curve.

    `shifts` is a stack, shape (rows, 2, curves), of the shifts along ln(velocity) and ln(friction). `residuals` is the
    stack of the distances of the points from the common curve. `constants` is the number of fitted constants: values of
    the common curve, and shifts. `vague` marks the curves whose shift the data do not determine, such as straight
    curves.
    """

    shifts: FloatArray
    residuals: FloatArray
    constants: int
    vague: BoolArray


def collapse(
    x: FloatArray, rows: FloatArray, curve: NDArray[np.intp], start: FloatArray, reference: int, vertical: bool = True
) -> Collapse:
    """Shift curves of ln(friction) against ln(velocity) onto a common natural cubic spline by least squares.

    The shifts are fitted to the first of the stacked `rows`. The shifts for the remaining rows follow by linearisation.
    `curve` contains, for each point, the index of its curve. `start` contains a first estimate of the shifts along
    ln(velocity). The curve with the index `reference` is not shifted. If `vertical` is false, curves are shifted along
    ln(velocity) only.
    """
    from scipy.optimize import OptimizeResult, least_squares

    free = np.delete(np.arange(start.size), reference)
    member = (curve[:, None] == free).astype(float)
    axes = 2 if vertical else 1

    def from_start(begin: FloatArray) -> OptimizeResult:
        place = x + begin[curve]
        ends = place.min() - 0.5, place.max() + 0.5
        knots = np.linspace(*ends, 2 + int(np.ceil(KNOTS * (ends[1] - ends[0]) / np.log(10))))
        # a weak penalty on bends makes the common curve straight where it has no points
        bends = 1e-3 * np.diff(np.eye(knots.size), 2, axis=0)

        def residuals(unknown: FloatArray) -> FloatArray:
            height, shift = unknown[: knots.size], unknown[knots.size :].reshape(axes, free.size)
            common = _natural(knots, x + member @ shift[0]) @ height
            up = member @ shift[1] if vertical else 0.0
            return np.concatenate([rows[0] + up - common, -bends @ height])

        right = np.concatenate([rows[0], np.zeros(len(bends))])
        height = np.linalg.lstsq(np.vstack([_natural(knots, place), bends]), right)[0]
        unknown = np.concatenate([height, begin[free], np.zeros((axes - 1) * free.size)])
        return least_squares(residuals, unknown, method="lm")

    tries = (from_start(begin) for begin in (start - start[reference], 0 * start))
    best = min(tries, key=lambda found: float(found.cost))
    change = rows - rows[0]
    steps = -change @ np.linalg.pinv(best.jac, rcond=1e-8)[:, : x.size].T
    shifts = np.zeros((len(rows), 2, start.size))
    last = (best.x + steps)[:, best.x.size - axes * free.size :]
    shifts[:, :axes, free] = last.reshape(len(rows), axes, free.size)
    count = best.jac.shape[1]
    open_shifts = undetermined(best.jac[: x.size])[count - axes * free.size :].reshape(axes, free.size)
    vague = np.full(start.size, x.size <= count)
    vague[free] |= open_shifts.any(axis=0)
    return Collapse(shifts, best.fun[: x.size] + change + steps @ best.jac[: x.size].T, count, vague)


def _natural(knots: FloatArray, place: FloatArray) -> FloatArray:
    """Return the matrix, shape (places, knots), that maps values at the knots to values of the natural cubic spline.

    Outside the range of the knots, the spline continues as a straight line.
    """
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(knots, np.eye(knots.size), bc_type="natural")
    inside = np.clip(place, knots[0], knots[-1])
    found: FloatArray = spline(inside) + spline(inside, 1) * (place - inside)[:, None]
    return found


def _collapse(data: xr.Dataset) -> Variables:
    """Shift the curves of friction against velocity onto one common curve.

    Each load has one curve, which ends at the largest friction. Curves with fewer than three velocities are left out.
    """
    table = table_of(data, spectral_slope(data), *loads_and_velocities(data))
    force, velocity = table.columns
    known = rising(force, velocity, np.nan_to_num(table.mean()), np.ones(force.size, dtype=bool))
    loads = np.array([load for load in np.unique(force) if np.count_nonzero(known & (force == load)) >= 3])
    if loads.size < 2:
        raise FitError(
            "expected at least two loads, each with three or more velocities up to the maximum of friction, got "
            f"{loads.size}"
        )
    used = np.flatnonzero(known & np.isin(force, loads))
    x, curve, count = np.log(velocity[used]), np.searchsorted(loads, force[used]), table.count(used)
    stack, reference = table.logarithms(used), loads.size // 2
    start = -np.log(laws.crossover(loads, laws.alpha(one_value(data, "hurst")), laws.BETA))
    found = collapse(x, stack, curve, start, reference)
    if not bootstrap.chance(found.residuals, count) >= DOUBTFUL:
        moved = np.concatenate([stack[:1], bootstrap.moved(stack[0], found.residuals[0])])
        further = collapse(x, moved, curve, start, reference).shifts[1:]
        found = found._replace(shifts=np.concatenate([found.shifts, further]))

    where = at_load(force[used])
    stated = NEEDS_SLOPE
    if "contact_slope" in data:
        slopes = table_of(data, spectral_slope(data), output="contact_slope").logarithms(used)
        of_contact = collapse(x, bootstrap.difference(stack, slopes), curve, start, reference, vertical=False)
        stated = verdict(of_contact.residuals, count, of_contact.constants, where, logarithmic=True)
    before = collapse(x, stack[:1], np.zeros_like(curve), np.zeros(1), 0).residuals
    return {
        **measure("rms_error", rms(found.residuals[0]), "rms relative distance of the points from the common curve"),
        **measure(
            "rms_before", rms(before[0]), "rms relative distance of the points from a common curve before shifting"
        ),
        **measure("cases", int(used.size), "number of points of the shifted curves"),
        **_shifts(np.unique(force), loads, found, start - start[reference], count),
        **holds(stated, verdict(found.residuals, count, found.constants, where, logarithmic=True)),
    }


def _shifts(forces: FloatArray, loads: FloatArray, found: Collapse, stated: FloatArray, count: int) -> Variables:
    """Return the shifts in decades for each load; NaN if a shift is undetermined, or if a load has no curve."""
    decades = np.where(found.vague, np.nan, found.shifts / np.log(10))
    columns = {"horizontal_stated": (stated / np.log(10), "shift along log velocity by eqs. 3.17 and 3.23")}
    for k, name in enumerate(("horizontal", "vertical")):
        low, high = bootstrap.interval(decades[:, k], count)
        meaning = f"shift along log {'velocity' if k == 0 else 'friction'} in decades"
        values = {name: decades[0, k], f"{name}_low": low, f"{name}_high": high}
        columns |= {key: (value, meaning) for key, value in values.items()}
    result = {"force_number": xr.Variable("curve", forces, {"units": "1", "long_name": "F_N / (G h L) of every curve"})}
    for name, (values, meaning) in columns.items():
        wide = np.full(forces.size, np.nan)
        wide[np.searchsorted(forces, loads)] = values
        result[name] = xr.Variable("curve", wide, {"units": "1", "long_name": meaning})
    return result


FITS: tuple[Fit, ...] = (
    Fit(
        "contact_growth",
        MODELS,
        "L_cont / L = factor (F_N / (G h L))^exponent in zone 1 (thesis: exponent 1 / (1 + H)); mu against eq. 3.12",
        lambda series: each(series, load_and_velocity_axes, _contact_growth, "contact_fraction"),
    ),
    Fit(
        "contact_slope",
        MODELS,
        "rms slope in contact against L_cont: slope_cont^2 ~ q_max^(2 - 2H) - (2 pi / L_cont)^(2 - 2H) (eq. 3.21)",
        lambda series: each(series, load_and_velocity_axes, _contact_slope, "contact_slope", "contact_fraction"),
    ),
    Fit(
        "collapse",
        MODELS,
        "mu = slope_cont(F_N) g(v f(F_N)): the curves of all loads shifted onto one (eqs. 3.22, 3.23)",
        lambda series: each(series, load_and_velocity_axes, _collapse, FRICTION),
    ),
)
