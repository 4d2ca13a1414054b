"""Fit the laws of steady sliding friction (thesis eqs. 3.11 to 3.18) to a store.

Symbols: mu is the coefficient of friction, F_N is the normal force, and v is the velocity. The line has the length L
and the rms height h. The body has the shear modulus G and the relaxation time tau.

Friction against velocity has four regions. Friction is proportional to the velocity in region I, grows more slowly in
region II, is at its plateau in region III, and falls in region IV. The loads fall into two zones. In zone 1, at low
loads, the line is in partial contact. In zone 2, the line is in full contact.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits import top
from mdr_dask.fits.base import WITHIN, Fit, require, short, verdict
from mdr_dask.fits.cases import (
    Variables,
    constant,
    dimensions,
    each,
    holds,
    measure,
    nonlinear,
    one_value,
    power_law,
    stated_power,
    table_of,
)
from mdr_dask.physics.sliding import laws
from mdr_dask.physics.surfaces import roughness

MODELS = ("sliding_friction",)
FRICTION = "friction_coefficient"
# smallest and largest load F_N / (G h L) of the fit in zone 1. Other limits change alpha by up to 0.02 and beta by up
# to 0.14.
ZONE_ONE = (0.01, 0.3)
NEEDS_SLOPE = "not tested: the study has no output contact_slope"


def spectral_slope(data: xr.Dataset) -> xr.DataArray:
    """Return the rms slope of the line, read from the store or computed from the spectrum; NaN for a smooth line."""
    if "rms_slope" in data:
        stored = data["rms_slope"].mean("realisation")
        return stored.where(stored > 0)
    if "hurst" not in data:
        raise FitError("expected the output rms_slope in the store of a measured surface, got none")
    require(data, "hurst", "points", "rms_roughness", "length")
    cutoffs = [data.coords.get(name, xr.DataArray(np.nan)) for name in ("rolloff_wavelength", "longest_wavelength")]

    def of_unit_line(hurst: float, points: float, *harmonics: float) -> float:
        known = (harmonic if np.isfinite(harmonic) else 0.0 for harmonic in harmonics)
        return roughness.spectral_slope(roughness.amplitudes(int(points) // 2, hurst, *known))

    harmonics = (data["length"] / cutoff for cutoff in cutoffs)
    unit = xr.apply_ufunc(of_unit_line, data["hurst"], data["points"], *harmonics, vectorize=True)
    slope: xr.DataArray = unit * data["rms_roughness"] / data["length"]
    return slope.where(slope > 0)


KELVIN = ("shear_modulus", "relaxation_time", "rms_roughness", "length")


def loads_and_velocities(data: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray]:
    """Return the dimensionless load F_N / (G h L) and velocity v tau slope / (sqrt 2 h) of all cases."""
    require(data, *KELVIN)
    slope = spectral_slope(data)
    force = laws.force_number(data["normal_force"], data["shear_modulus"], data["rms_roughness"], data["length"])
    velocity = laws.velocity_number(data["velocity"], data["relaxation_time"], slope, data["rms_roughness"])
    return xr.DataArray(force), xr.DataArray(velocity)


def _velocity_axes(data: xr.Dataset) -> list[str]:
    return dimensions(data, "velocity", "relaxation_time")


def load_and_velocity_axes(data: xr.Dataset) -> list[str]:
    """Return the dimensions along which loads and velocities vary."""
    return [*dimensions(data, "normal_force", "shear_modulus", "rms_roughness"), *_velocity_axes(data)]


def at_load(force: FloatArray) -> Callable[[int], str]:
    """Return a function that describes a case by its load."""
    return lambda k: f"F_N / (G h L) = {short(force[k])}"


def _first_linear(friction: FloatArray, velocity: FloatArray) -> int | None:
    """Return the index of the lowest velocity at which friction is proportional to the velocity; None if it never is.

    Friction counts as proportional if mu / v at the next velocity differs by less than the fraction `WITHIN`. A single
    velocity is accepted without this test. The index may be above 0, because the time stepping of the original papers
    makes friction at very low velocities too large.
    """
    if velocity.size == 1:
        return 0
    for k in range(velocity.size - 1):
        both = friction[k : k + 2, np.isfinite(friction[k : k + 2]).all(axis=0)]
        low, high = both.mean(axis=1) / velocity[k : k + 2] if both.size else (np.nan, np.nan)
        if abs(high / low - 1) < WITHIN:
            return k
    return None


def loads_of_zone_one(force: FloatArray, known: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Return, for each load in zone 1, the indices of the `known` cases with this load."""
    inside = (force >= ZONE_ONE[0]) & (force <= ZONE_ONE[1]) & known
    return [np.flatnonzero((force == load) & known) for load in np.unique(force[inside])]


def _zone_one(data: xr.Dataset) -> Variables:
    """Fit a power law to mu / v as a function of the load, with one case in region I for each load in zone 1."""
    table = table_of(data, spectral_slope(data), *loads_and_velocities(data))
    force, velocity = table.columns
    rate = table.mean() / (np.sqrt(2) * velocity)
    used = []
    for same in loads_of_zone_one(force, rate > 0):
        ordered = same[np.argsort(velocity[same])]
        at = _first_linear(table.values[ordered], velocity[ordered])
        if at is not None:
            used.append(ordered[at])
    if len(used) < 3:
        raise FitError(
            f"expected at least three loads with F_N / (G h L) in {ZONE_ONE[0]}..{ZONE_ONE[1]} and velocities down to"
            f" region I, got {len(used)}: add lower loads or velocities"
        )
    x, count, stated = np.log(force[used]), table.count(used), laws.alpha(one_value(data, "hurst"))
    logs = table.logarithms(used) - np.log(np.sqrt(2) * velocity[used])
    found = power_law(x, logs, count)
    where = at_load(force[used])
    return {
        **constant("alpha", -found.constants[:, 0], count, "exponent alpha of the law of zone 1"),
        **measure("alpha_stated", stated, "alpha = H / (1 + H) by eq. 3.13"),
        **constant("beta", np.exp(found.constants[:, 1]), count, "factor beta of the law of zone 1", positive=True),
        **measure("rms_error", found.rms, "rms relative deviation from the law with the fitted constants"),
        **measure("loads", len(used), "number of loads in zone 1"),
        **holds(stated_power(x, logs, -stated, count, where), found.holds(where)),
    }


def _plateau(data: xr.Dataset) -> Variables:
    """Compare the largest friction over all velocities with the rms slope of the line and the rms slope in contact."""
    require(data, "shear_modulus", "relaxation_time")
    velocities, form = _velocities(data)
    table = table_of(data, spectral_slope(data), velocities)
    known = np.flatnonzero(np.isfinite(table.mean()))
    velocity = table.columns[0][known]
    if velocity.size < 3 or not table.mean()[known].max() > 0:
        raise FitError(
            f"expected friction at three or more velocities, with a positive maximum, got {velocity.size} velocities"
        )
    known = known[np.argsort(velocity)]
    x, count, stack = np.log(table.columns[0][known]), table.count(known), table.stack(known)
    found = top.highest(x, stack, count)
    ends = bootstrap.interval(found.rise, count)
    reached = _reached(x, found, (float(ends[0]), float(ends[1])), form)
    flat = stack[0] > (1 - WITHIN) * stack[0].max()
    height = constant("plateau", found.height, count, "largest mu divided by the rms slope of the line")
    if reached.startswith("no:"):
        height |= {f"plateau_{end}": xr.Variable((), np.nan, height["plateau"].attrs) for end in ("low", "high")}
    return {
        **height,
        **measure("plateau_stated", math.sqrt(2), "sqrt 2, the plateau by eq. 3.15"),
        **measure(
            "decades",
            float(np.ptp(x[flat]) / np.log(10)),
            f"decades of velocity with mu within {WITHIN:.0%} of the plateau",
        ),
        **measure("reached", reached, "whether friction reaches its maximum within the range of velocities"),
        **_root_two(data, found.height, known[flat], count, reached),
    }


def _root_two(data: xr.Dataset, height: FloatArray, flat: NDArray[np.intp], count: int, reached: str) -> Variables:
    """Test whether mu is sqrt 2 times the rms slope in contact (eq. 3.15), or sqrt 2 times the rms slope of the line.

    `height` is a stack of the largest mu divided by the rms slope of the line. `flat` contains the indices of the cases
    on the plateau.
    """
    meaning = "largest mu divided by the rms slope in contact"
    if "contact_slope" in data:
        friction, slope = table_of(data, 1.0), table_of(data, 1.0, output="contact_slope")
        ratio = np.exp(bootstrap.difference(friction.logarithms(flat), slope.logarithms(flat)).mean(axis=1))
    else:
        ratio = np.full(1 + bootstrap.RESAMPLES, np.nan)
    if not reached.startswith("yes"):
        of_line = of_contact = f"not tested: {reached.partition(': ')[2]}"
    else:
        of_line = verdict(height[:, None] / math.sqrt(2) - 1, count)
        of_contact = verdict(ratio[:, None] / math.sqrt(2) - 1, count) if "contact_slope" in data else NEEDS_SLOPE
    return {
        **constant("plateau_of_contact", ratio, count, meaning, positive=True),
        **measure("line_slope_holds", of_line, "whether mu = sqrt 2 times the rms slope of the whole line"),
        **holds(of_contact),
    }


def _velocities(data: xr.Dataset) -> tuple[xr.DataArray, str]:
    """Return the dimensionless velocities (v tau in m if the study has no rms height), and a format string for them."""
    if "rms_roughness" in data:
        return loads_and_velocities(data)[1], "v tau slope / (sqrt 2 h) = {:.2g}"
    return data["velocity"] * data["relaxation_time"], "v tau = {:.2g} m"


def _reached(x: FloatArray, found: top.Top, ends: tuple[float, float], place: str) -> str:
    """Return a sentence on whether friction reaches a maximum or a constant value within the range of velocities.

    `x` contains the logarithms of the velocities, and `ends` contains both ends of the interval of the slope
    `found.rise`.
    """
    at, rise = float(found.place[0]), float(found.rise[0])
    change = f"d ln mu / d ln v = {rise:.2g}"
    known = bool(np.isfinite(ends[0]))
    if known:
        change += f" ({ends[0]:.2g}, {ends[1]:.2g})"
    steepest = max(ends, key=abs) if known else rise
    end = "still rises at the largest velocity" if steepest > 0 else "already falls at the lowest velocity"
    if abs(rise) > WITHIN and not (known and ends[0] <= 0 <= ends[1]):
        return f"no: the plateau is not reached, friction {end}, {change}"
    if abs(rise) > WITHIN or (known and max(map(abs, ends)) > WITHIN):
        return f"not tested: because of the scatter, it is uncertain whether friction {end}, {change}"
    if x[0] < at < x[-1] and abs(rise) < 1e-9:
        return f"yes: friction is largest at {place.format(np.exp(at))}"
    return f"yes: friction is constant at the end of the range of velocities, {change}"


def rising(force: FloatArray, velocity: FloatArray, mean: FloatArray, known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which `known` cases are in regions I to III: up to the velocity of the largest friction at each load.

    The largest friction is found on a smoothed curve. Cases whose friction is not positive are left out.
    """
    used = known & (mean > 0)
    for load in np.unique(force[used]):
        same = np.flatnonzero(used & (force == load))
        ordered = same[np.argsort(velocity[same])]
        peak = velocity[ordered][np.argmax(top.smoothed(mean[ordered]))]
        used[same] = velocity[same] <= peak
    return used


def _interpolation(data: xr.Dataset) -> Variables:
    """Fit alpha and beta of eq. 3.17 to the logarithms of friction in regions I to III, without loads below zone 1."""
    table = table_of(data, np.sqrt(2) * spectral_slope(data), *loads_and_velocities(data))
    force, velocity = table.columns
    used = rising(force, velocity, np.nan_to_num(table.mean()), force >= ZONE_ONE[0])
    if np.count_nonzero(used) < 5 or np.unique(velocity[used]).size < 3:
        raise FitError(
            f"expected at least five cases with F_N / (G h L) >= {ZONE_ONE[0]} and velocities up to the maximum of "
            f"friction, at three or more velocities, got {int(used.sum())} at {np.unique(velocity[used]).size}"
        )
    force, velocity, count = force[used], velocity[used], table.count(used)

    def model(constants: FloatArray) -> FloatArray:
        law: FloatArray = np.log(laws.interpolation(force, velocity, constants[:, :1], np.exp(constants[:, 1:])))
        return law

    def where(k: int) -> str:
        return f"{at_load(force)(k)}, v tau slope / (sqrt 2 h) = {short(velocity[k])}"

    stated = laws.alpha(one_value(data, "hurst"))
    found, verdicts = nonlinear(model, np.array([stated, np.log(laws.BETA)]), table.logarithms(used), count, where)
    return {
        **constant("alpha", found.constants[:, 0], count, "exponent alpha of eq. 3.17"),
        **measure("alpha_stated", stated, "alpha = H / (1 + H) by eq. 3.13"),
        **constant("beta", np.exp(found.constants[:, 1]), count, "factor beta of eq. 3.17", positive=True),
        **measure("cases", int(used.sum()), "number of fitted cases"),
        **verdicts,
    }


FITS: tuple[Fit, ...] = (
    Fit(
        "zone_one",
        MODELS,
        "alpha and beta of mu / slope = beta (v tau slope / h) (G h L / F_N)^alpha (eq. 3.11)",
        lambda series: each(series, load_and_velocity_axes, _zone_one, FRICTION),
    ),
    Fit(
        "plateau",
        MODELS,
        "largest mu / slope over the velocities, compared with sqrt 2 (eq. 3.15)",
        lambda series: each(series, _velocity_axes, _plateau, FRICTION),
    ),
    Fit(
        "interpolation",
        MODELS,
        "alpha and beta of the law for both zones and regions I to III (eq. 3.17)",
        lambda series: each(series, load_and_velocity_axes, _interpolation, FRICTION),
    ),
)
