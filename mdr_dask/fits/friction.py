"""The laws of steady sliding friction (thesis eqs. 3.11 to 3.18), fitted to a store.

`mdr_dask.bootstrap` defines the stacks from which intervals are computed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.aggregation import companion
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits import top
from mdr_dask.fits.base import FITTED_LAW_HOLDS, LAW_HOLDS, Fit, Fitted, excludes, fitted, require, short, verdict
from mdr_dask.physics.sliding import laws
from mdr_dask.physics.surfaces import roughness

Series = Mapping[str, xr.Dataset]
Variables = dict[str, xr.Variable]

MODELS = ("sliding_friction",)
ZONE_ONE = (0.01, 0.3)  # range of F_N / (G h L) in zone 1; other limits change alpha by up to 0.02, beta by up to 0.14
LINEAR = 0.05  # region I: mu / v changes by less than this fraction between neighbouring velocities
NEEDS_SLOPE = "not tested: the study has no output contact_slope"


def spectral_slope(data: xr.Dataset) -> xr.DataArray:
    """Return the spectral rms slope, from the store or from the parameters of a line without roll-off.

    It is NaN for a smooth line, for which friction over slope has no meaning.
    """
    if "rms_slope" in data:
        stored = data["rms_slope"].mean("realisation")
        return stored.where(stored > 0)
    if "hurst" not in data:
        raise FitError("expected the output rms_slope in the store of a measured surface, got none")
    require(data, "hurst", "points", "rms_roughness", "length")
    unit = xr.apply_ufunc(
        lambda hurst, points: roughness.spectral_slope(roughness.amplitudes(int(points) // 2, float(hurst))),
        data["hurst"],
        data["points"],
        vectorize=True,
    )
    slope: xr.DataArray = unit * data["rms_roughness"] / data["length"]
    return slope.where(slope > 0)


KELVIN = ("shear_modulus", "relaxation_time", "rms_roughness", "length")


def loads_and_velocities(data: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray]:
    """Return F_N / (G h L) and v tau slope / (sqrt 2 h) of all cases."""
    require(data, *KELVIN)
    slope = spectral_slope(data)
    force = laws.force_number(data["normal_force"], data["shear_modulus"], data["rms_roughness"], data["length"])
    velocity = laws.velocity_number(data["velocity"], data["relaxation_time"], slope, data["rms_roughness"])
    return xr.DataArray(force), xr.DataArray(velocity)


def numbers(data: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    """Return mu / slope, F_N / (G h L) and v tau slope / (sqrt 2 h) of all cases."""
    return data["friction_coefficient"] / spectral_slope(data), *loads_and_velocities(data)


def one_value(data: xr.Dataset, name: str) -> float:
    """Return the only value of a parameter; raise FitError if the study lacks it, or if it differs between cases."""
    require(data, name)
    values = data[name]
    if values.size != 1:
        raise FitError(
            f"expected one {name}, or an axis for it, got {values.size} values of a sampled study: each has its own law"
        )
    return float(values.item())


def constant(name: str, stack: FloatArray, count: int, long_name: str, positive: bool = False) -> Variables:
    """Return a constant and the ends of its interval as variables."""
    low, high = bootstrap.interval(stack, count, positive)
    values = {name: stack[0], f"{name}_low": low, f"{name}_high": high}
    return {key: xr.Variable((), value, {"units": "1", "long_name": long_name}) for key, value in values.items()}


def measure(name: str, value: float, long_name: str) -> Variables:
    """Return a number without an interval as a variable."""
    return {name: xr.Variable((), value, {"units": "1", "long_name": long_name})}


def text(name: str, sentence: str, long_name: str) -> Variables:
    """Return a sentence as a variable."""
    return {name: xr.Variable((), sentence, {"units": "1", "long_name": long_name})}


def holds(stated: str, with_fitted: str = "") -> Variables:
    """Return ``law_holds`` and, if given, ``fitted_law_holds`` as variables."""
    found = {"fitted_law_holds": xr.Variable((), with_fitted, FITTED_LAW_HOLDS)} if with_fitted else {}
    return found | {"law_holds": xr.Variable((), stated, LAW_HOLDS)}


def each(
    series: Series,
    inner: Callable[[xr.Dataset], list[str]],
    fit: Callable[[xr.Dataset], Variables],
    *outputs: str,
) -> xr.Dataset:
    """Fit a law separately at every point of the dimensions that the law itself does not contain.

    Parameters
    ----------
    series : mapping of str to Dataset
        One series.
    inner : callable
        Returns the dimensions that one fit needs, such as load and velocity.
    fit : callable
        Returns the results of the fit at one point of the other dimensions.
    *outputs : str
        Outputs that the fit needs; by default the coefficient of friction.
    """
    data = next(iter(series.values()))
    needed = outputs or ("friction_coefficient",)
    missing = [name for name in needed if name not in data]
    if missing:
        raise FitError(f"expected the outputs {', '.join(needed)} in the store, got none of {', '.join(missing)}")
    data = data.load()
    used = ["realisation", *inner(data)]
    outer = [str(dim) for dim in data[needed[0]].dims if dim not in used]
    sizes = [data.sizes[dim] for dim in outer]
    points = [fit(data.isel(dict(zip(outer, index, strict=True)))) for index in np.ndindex(*sizes)]
    found = {}
    for name in dict.fromkeys(name for point in points for name in point):
        known = next(point[name] for point in points if name in point)
        blank = "" if known.dtype.kind == "U" else np.nan
        values = np.stack([point[name].values if name in point else np.full(known.shape, blank) for point in points])
        found[name] = xr.Variable((*outer, *known.dims), values.reshape((*sizes, *known.shape)), known.attrs)
    return xr.Dataset(found, {dim: data[dim] for dim in outer if dim in data.coords})


def _varying(data: xr.Dataset, *names: str) -> list[str]:
    """Return the dimensions along which any of these parameters varies."""
    return sorted({str(dim) for name in names if name in data.coords for dim in data[name].dims})


def _velocity_axes(data: xr.Dataset) -> list[str]:
    return _varying(data, "velocity", "relaxation_time")


def load_and_velocity_axes(data: xr.Dataset) -> list[str]:
    """Return the dimensions along which loads and velocities vary."""
    return [*_varying(data, "normal_force", "shear_modulus", "rms_roughness"), *_velocity_axes(data)]


class Table(NamedTuple):
    """An output of all cases, divided by a scale.

    Attributes
    ----------
    values, error : array, shape (cases, realisations)
        The output and its discretisation error, both divided by the scale.
    columns : tuple of array, shape (cases,)
        Other numbers of the cases, such as load and velocity.
    """

    values: FloatArray
    error: FloatArray
    columns: tuple[FloatArray, ...]

    def stack(self, used: Any = slice(None)) -> FloatArray:
        """Return the stack of the means of some cases, shape (1 + RESAMPLES + 2 groups, cases)."""
        return self._moved(bootstrap.means(self.values[used].T), self._errors(used))

    def logarithms(self, used: Any = slice(None)) -> FloatArray:
        """Return the stack of the logarithms of the means; an infinite error counts as 100 % of the mean."""
        means = bootstrap.means(self.values[used].T)
        relative = self._errors(used) / means[0]
        return self._moved(bootstrap.logarithms(means), np.where(np.isinf(relative), 1.0, relative))

    def _errors(self, used: Any) -> FloatArray:
        known = ~np.isnan(self.error[used])
        total = np.where(known, np.abs(self.error[used]), 0.0).sum(axis=1)
        mean: FloatArray = total / np.maximum(known.sum(axis=1), 1)
        return mean

    @staticmethod
    def _moved(stack: FloatArray, error: FloatArray) -> FloatArray:
        return np.concatenate([stack, bootstrap.moved(stack[0], error)]) if np.any(error > 0) else stack

    def count(self, used: Any = slice(None)) -> int:
        """Return the smallest number of successful realisations among some cases."""
        return int(np.isfinite(self.values[used]).sum(axis=1).min())

    def mean(self) -> FloatArray:
        """Return the mean of every case; NaN without any successful realisation."""
        mean: FloatArray = bootstrap.means(self.values.T)[0]
        return mean


def table_of(data: xr.Dataset, scale: Any, *columns: xr.DataArray, output: str = "friction_coefficient") -> Table:
    """Return an output of all cases divided by a scale, with other numbers of the cases as columns."""
    values = data[output]
    error = companion(data, output)
    arrays = xr.broadcast(values / scale, (0 * values if error is None else error) / scale, *columns)
    cases = [dim for dim in arrays[0].dims if dim != "realisation"]
    count = arrays[0].sizes["realisation"]
    flat = [
        np.asarray(array.transpose(*cases, "realisation").values, dtype=np.float64).reshape(-1, count)
        for array in arrays
    ]
    return Table(flat[0], flat[1], tuple(column[:, 0] for column in flat[2:]))


def power_law(x: FloatArray, logs: FloatArray, count: int) -> Fitted:
    """Fit a straight line to a stack of logarithms against x; the constants are its slope and its value at x = 0."""
    design = np.vstack([x, np.ones(x.size)])
    solve = np.linalg.pinv(design)
    return fitted(lambda rows: rows @ solve, lambda rows, constants: rows - constants @ design, logs, count)


def stated_power(x: FloatArray, logs: FloatArray, power: float, count: int, where: Callable[[int], str]) -> str:
    """Return a sentence on whether a stack of logarithms follows a power law with a stated power and any factor."""
    rest = logs - power * x
    free = power_law(x, logs, count).constants[:, 0]
    if np.isnan(free[0]):
        return "not tested: the cases differ too little to determine the exponent"
    excluded = excludes(free, count, power)
    return verdict(rest - rest.mean(axis=1, keepdims=True), count, 1, where, excluded=excluded)


def at_load(force: FloatArray) -> Callable[[int], str]:
    """Return a function that describes a case by its load."""
    return lambda k: f"F_N / (G h L) = {short(force[k])}"


def _first_linear(friction: FloatArray, velocity: FloatArray) -> int | None:
    """Return the index of the lowest velocity at which friction is proportional to velocity.

    Friction at two neighbouring velocities is compared, using the realisations that succeeded at both velocities. The
    index is not always 0, because the time stepping of the papers gives a spurious lower limit of friction at low
    velocity. None if friction is not proportional to velocity anywhere.
    """
    if velocity.size == 1:
        return 0
    for k in range(velocity.size - 1):
        both = friction[k : k + 2, np.isfinite(friction[k : k + 2]).all(axis=0)]
        low, high = both.mean(axis=1) / velocity[k : k + 2] if both.size else (np.nan, np.nan)
        if abs(high / low - 1) < LINEAR:
            return k
    return None


def loads_of_zone_one(force: FloatArray, known: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Return the indices of the cases of each load in zone 1."""
    inside = (force >= ZONE_ONE[0]) & (force <= ZONE_ONE[1]) & known
    return [np.flatnonzero((force == load) & known) for load in np.unique(force[inside])]


def _zone_one(data: xr.Dataset) -> Variables:
    """Fit ln (mu / v) against ln F_N in zone 1 and region I."""
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
            f"expected three loads with F_N / (G h L) in {ZONE_ONE[0]}..{ZONE_ONE[1]} and velocities down to region I,"
            f" got {len(used)}: add lower loads or velocities"
        )
    x, count, stated = np.log(force[used]), table.count(used), laws.alpha(one_value(data, "hurst"))
    logs = table.logarithms(used) - np.log(np.sqrt(2) * velocity[used])
    found = power_law(x, logs, count)
    where = at_load(force[used])
    return {
        **constant("alpha", -found.constants[:, 0], count, "exponent of the force in zone 1"),
        **measure("alpha_stated", stated, "H / (1 + H) (eq. 3.13)"),
        **constant("beta", np.exp(found.constants[:, 1]), count, "factor of the law of zone 1", positive=True),
        **measure("rms_error", found.rms, "rms relative departure from the law with the fitted constants"),
        **measure("loads", len(used), "number of loads in zone 1"),
        **holds(stated_power(x, logs, -stated, count, where), found.holds(where)),
    }


def _velocity_of(place: FloatArray, x: FloatArray, count: int, meaning: str, unit: str) -> Variables:
    """Return the velocity of the largest friction, from a stack of the logarithms of this velocity.

    It is NaN if the maximum may lie outside the range of velocities.
    """
    outside = np.isinf(place[~np.isnan(place)])
    if outside[0] or outside.mean() > bootstrap.TAILS[0]:
        place = np.full_like(place, np.nan)
    found = constant("plateau_velocity", np.exp(np.clip(place, x[0], x[-1])), count, meaning, positive=True)
    return {name: xr.Variable((), each.values, {"units": unit, "long_name": meaning}) for name, each in found.items()}


def _plateau(data: xr.Dataset) -> Variables:
    """Return the largest friction over all velocities, and the velocity at which it occurs."""
    require(data, "shear_modulus", "relaxation_time")
    velocities, name, unit = _velocities(data)
    table = table_of(data, spectral_slope(data), velocities)
    known = np.flatnonzero(np.isfinite(table.mean()))
    velocity = table.columns[0][known]
    if velocity.size < 3 or not table.mean()[known].max() > 0:
        raise FitError("expected friction at three or more velocities, for a maximum over them")
    known = known[np.argsort(velocity)]
    x, count, stack = np.log(table.columns[0][known]), table.count(known), table.stack(known)
    found = top.highest(x, stack, count)
    ends = bootstrap.interval(found.rise, count)
    reached = _reached(x, found, (float(ends[0]), float(ends[1])), f"{name} = {{:.2g}}{unit}")
    flat = stack[0] > (1 - top.FLAT) * stack[0].max()
    height = constant("plateau", found.height, count, "largest friction coefficient over rms slope of the line")
    if reached.startswith("no:"):
        height |= {f"plateau_{end}": xr.Variable((), np.nan, height["plateau"].attrs) for end in ("low", "high")}
    return {
        **height,
        **measure("plateau_stated", math.sqrt(2), "sqrt 2 (eq. 3.15)"),
        **_velocity_of(top.place(x, stack), x, count, f"{name} of the largest friction", unit.strip() or "1"),
        **measure("decades", float(np.ptp(x[flat]) / np.log(10)), f"decades of velocity within {top.FLAT:.0%} of it"),
        **text("reached", reached, "whether friction reaches its largest value within the velocities"),
        **_root_two(data, found.height, known[flat], count, reached),
    }


def _root_two(data: xr.Dataset, height: FloatArray, flat: NDArray[np.intp], count: int, reached: str) -> Variables:
    """Test mu = sqrt 2 slope with the slope in contact, as in eq. 3.15, and with the slope of the whole line."""
    meaning = "largest friction coefficient over rms slope in contact"
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
        **text("line_slope_holds", of_line, LINE_SLOPE),
        **holds(of_contact),
    }


LINE_SLOPE = "whether mu = sqrt 2 times the rms slope of the whole line"


def _velocities(data: xr.Dataset) -> tuple[xr.DataArray, str, str]:
    """Return velocities, their name and unit: the velocity number, or v tau for a measured surface (no rms height)."""
    if "rms_roughness" in data:
        return loads_and_velocities(data)[1], "v tau slope / (sqrt 2 h)", ""
    return data["velocity"] * data["relaxation_time"], "v tau", " m"


def _reached(x: FloatArray, found: top.Top, ends: tuple[float, float], place: str) -> str:
    """Return a sentence on whether friction has a maximum or levels off, or still changes at an end of the range."""
    at, rise = float(found.place[0]), float(found.rise[0])
    change = f"d ln mu / d ln v = {rise:.2g}"
    known = bool(np.isfinite(ends[0]))
    if known:
        change += f" ({ends[0]:.2g}, {ends[1]:.2g})"
    end = "still rises at the largest velocity" if max(ends, key=abs) > 0 else "already falls at the lowest velocity"
    if abs(rise) > top.FLAT and not (known and ends[0] <= 0 <= ends[1]):
        end = "still rises at the largest velocity" if rise > 0 else "already falls at the lowest velocity"
        return f"no: the plateau is not reached, friction {end}, {change}"
    if abs(rise) > top.FLAT or (known and max(map(abs, ends)) > top.FLAT):
        return f"not tested: because of the scatter it is open whether friction {end}, {change}"
    if x[0] < at < x[-1] and abs(rise) < 1e-9:
        return f"yes: friction is largest at {place.format(np.exp(at))}"
    return f"yes: friction is level at the end of the velocities, {change}"


def least_squares(
    model: Callable[[FloatArray], FloatArray], start: FloatArray, data: FloatArray, steps: int = 40
) -> FloatArray:
    """Fit every row of the data, shape (rows, cases), by Levenberg-Marquardt steps; return (rows, constants).

    Each call of the model evaluates all rows; this is a hundred times faster than one scipy fit for each row.
    """
    size = np.eye(start.size)
    constants = np.tile(start, (data.shape[0], 1))
    damping = np.full(data.shape[0], 1e-6)
    value = model(constants)
    cost = np.sum((data - value) ** 2, axis=1)
    for _ in range(steps):
        jacobian = np.stack([(model(constants + shift) - value) / 1e-6 for shift in 1e-6 * size], axis=-1)
        normal = np.swapaxes(jacobian, 1, 2) @ jacobian
        normal = normal + (damping * np.einsum("sii->s", normal) + 1e-12)[:, None, None] * size
        gradient = np.swapaxes(jacobian, 1, 2) @ (data - value)[..., None]
        step = np.clip(np.linalg.solve(normal, gradient)[..., 0], -0.3, 0.3)
        trial = model(constants + step)
        cost_there = np.sum((data - trial) ** 2, axis=1)
        better = cost_there <= cost
        constants = np.where(better[:, None], constants + step, constants)
        value, cost = np.where(better[:, None], trial, value), np.where(better, cost_there, cost)
        damping = np.clip(np.where(better, damping / 10, damping * 10), 1e-9, 1e9)
        if np.abs(step).max() < 1e-9:
            break
    return constants


def law_error(departures: FloatArray, suffix: str, which: str) -> Variables:
    """Return the rms and the largest relative departure of the data from a law."""
    return {
        **measure(f"rms_error{suffix}", float(np.sqrt(np.mean(departures**2))), f"rms relative departure, {which}"),
        **measure(f"largest_error{suffix}", float(np.max(np.abs(departures))), f"largest relative departure, {which}"),
    }


def rising(force: FloatArray, velocity: FloatArray, mean: FloatArray, known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which known cases are in regions I to III: at each load, velocities up to that of the largest friction."""
    used = known & (mean > 0)
    for load in np.unique(force[used]):
        same = np.flatnonzero(used & (force == load))
        ordered = same[np.argsort(velocity[same])]
        peak = velocity[ordered][np.argmax(top.smoothed(mean[ordered]))]
        used[same] = velocity[same] <= peak
    return used


def _interpolation(data: xr.Dataset) -> Variables:
    """Fit alpha and beta of eq. 3.17 to the logarithms of friction in regions I to III."""
    table = table_of(data, np.sqrt(2) * spectral_slope(data), *loads_and_velocities(data))
    force, velocity = table.columns
    used = rising(force, velocity, np.nan_to_num(table.mean()), force >= ZONE_ONE[0])
    if np.count_nonzero(used) < 5 or np.unique(velocity[used]).size < 3:
        raise FitError(
            f"expected five cases with F_N / (G h L) above {ZONE_ONE[0]} at three velocities or more below region IV,"
            f" got {int(used.sum())}"
        )
    force, velocity, count = force[used], velocity[used], table.count(used)

    def model(constants: FloatArray) -> FloatArray:
        law: FloatArray = np.log(laws.interpolation(force, velocity, constants[:, :1], np.exp(constants[:, 1:])))
        return law

    stated = laws.alpha(one_value(data, "hurst"))
    start = np.array([stated, np.log(laws.BETA)])
    stack = table.logarithms(used)
    found = fitted(
        lambda rows: least_squares(model, start, rows), lambda rows, best: rows - model(best), stack, count, start
    )
    of_stated = stack - model(start[None])
    excluded = excludes(found.constants[:, 0], count, stated)

    def where(k: int) -> str:
        return f"{at_load(force)(k)}, v tau slope / (sqrt 2 h) = {short(velocity[k])}"

    return {
        **constant("alpha", found.constants[:, 0], count, "exponent of the force in the interpolation law"),
        **measure("alpha_stated", stated, "H / (1 + H) (eq. 3.13)"),
        **constant("beta", np.exp(found.constants[:, 1]), count, "factor of the interpolation law", positive=True),
        **law_error(found.residuals[0], "", "constants fitted"),
        **law_error(of_stated[0], "_stated", f"with H / (1 + H) and {laws.BETA}"),
        **measure("cases", int(used.sum()), "number of cases fitted"),
        **holds(verdict(of_stated, count, 0, where, excluded=excluded), found.holds(where)),
    }


FITS: tuple[Fit, ...] = (
    Fit(
        "zone_one",
        MODELS,
        "alpha and beta of mu / slope = beta (v tau slope / h) (G h L / F_N)^alpha (eq. 3.11)",
        lambda series: each(series, load_and_velocity_axes, _zone_one),
        apart=True,
        constants=("alpha", "beta"),
    ),
    Fit(
        "plateau",
        MODELS,
        "largest mu / slope over the velocities, beside sqrt 2 (eq. 3.15)",
        lambda series: each(series, _velocity_axes, _plateau),
        apart=True,
        constants=("plateau", "plateau_of_contact", "plateau_velocity"),
    ),
    Fit(
        "interpolation",
        MODELS,
        "alpha and beta of the law of regions I to III and both zones (eq. 3.17)",
        lambda series: each(series, load_and_velocity_axes, _interpolation),
        apart=True,
        constants=("alpha", "beta"),
    ),
)
