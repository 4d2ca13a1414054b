"""The laws of sliding friction fitted to a store; intervals by bootstrap over realisations."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple, cast

import numpy as np
import xarray as xr

from mdr_dask import bootstrap
from mdr_dask.aggregation import companion
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits import top
from mdr_dask.fits.base import LAW_HOLDS, Fit, fitted, law_holds, require
from mdr_dask.physics.sliding import laws
from mdr_dask.physics.surfaces import roughness

Series = Mapping[str, xr.Dataset]
Variables = dict[str, xr.Variable]

MODELS = ("sliding_friction",)
ZONE_ONE = (0.01, 0.3)  # F_N / (G h L) over which alpha and beta are fitted; they depend on it by up to 0.02 and 0.14
LINEAR = 0.05  # change of mu / v between the two lowest velocities that still counts as region I


def spectral_slope(data: xr.Dataset) -> xr.DataArray:
    """Return the spectral rms slope: from the store, or from the parameters of a line without roll-off.

    It is NaN for a smooth line, whose friction has no slope to be compared with.
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
    """Return F_N / (G h L) and v tau slope / (sqrt 2 h)."""
    require(data, *KELVIN)
    slope = spectral_slope(data)
    force = laws.force_number(data["normal_force"], data["shear_modulus"], data["rms_roughness"], data["length"])
    velocity = laws.velocity_number(data["velocity"], data["relaxation_time"], slope, data["rms_roughness"])
    return xr.DataArray(force), xr.DataArray(velocity)


def numbers(data: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    """Return mu / slope, F_N / (G h L) and v tau slope / (sqrt 2 h)."""
    return data["friction_coefficient"] / spectral_slope(data), *loads_and_velocities(data)


def one_value(data: xr.Dataset, name: str) -> float:
    """Return a parameter of which a law has one value; raise FitError where there is none or the cases differ."""
    require(data, name)
    values = data[name]
    if values.size != 1:
        raise FitError(
            f"expected one {name}, or an axis of its own for it, got {values.size} values of a sampled study: "
            "each has constants of its own"
        )
    return float(values.item())


def constant(name: str, stack: FloatArray, count: int, long_name: str, positive: bool = False) -> Variables:
    """Return a constant and the ends of its interval."""
    low, high = bootstrap.interval(stack, count, positive)
    names = {name: stack[0], f"{name}_low": low, f"{name}_high": high}
    return {key: xr.Variable((), value, {"units": "1", "long_name": long_name}) for key, value in names.items()}


def holds(sentence: str) -> Variables:
    """Return the sentence that says whether a law holds."""
    return {"law_holds": xr.Variable((), sentence, LAW_HOLDS)}


def measure(name: str, value: float, long_name: str, unit: str = "1") -> Variables:
    """Return a number without an interval."""
    return {name: xr.Variable((), value, {"units": unit, "long_name": long_name})}


def _groups(value: xr.DataArray, inner: list[str]) -> Iterator[dict[str, Any]]:
    """Yield a selection for every point of the dimensions that are not `inner`."""
    outer = [str(dim) for dim in value.dims if dim not in inner]
    for index in np.ndindex(*(value.sizes[dim] for dim in outer)):
        yield dict(zip(outer, index, strict=True))


def each(
    series: Series,
    inner: Callable[[xr.Dataset], list[str]],
    fit: Callable[[xr.Dataset], Variables],
    *outputs: str,
) -> xr.Dataset:
    """Fit every point of the dimensions of a series that the fit does not use up.

    Parameters
    ----------
    series : mapping of str to Dataset
        One series.
    inner : callable
        Returns the dimensions that the fit uses up.
    fit : callable
        Returns the variables of one point.
    *outputs : str
        Outputs that the fit needs; the coefficient of friction if none is named.
    """
    data = next(iter(series.values()))
    needed = outputs or ("friction_coefficient",)
    missing = [name for name in needed if name not in data]
    if missing:
        raise FitError(f"expected the outputs {', '.join(needed)} in the store, got none of {', '.join(missing)}")
    data, parts = data.load(), []
    for where in _groups(data[needed[0]], ["realisation", *inner(data)]):
        part = data.isel(where)
        point = {key: part.coords.get(key, index) for key, index in where.items()}
        parts.append(xr.Dataset(fit(part), coords=point).expand_dims(list(where)))
    return cast(xr.Dataset, xr.combine_by_coords(parts, combine_attrs="override"))


def _varying(data: xr.Dataset, *names: str) -> list[str]:
    """Return the dimensions that any of some parameters vary along."""
    return sorted({str(dim) for name in names if name in data.coords for dim in data[name].dims})


def _load_axes(data: xr.Dataset) -> list[str]:
    return _varying(data, "normal_force", "shear_modulus", "rms_roughness")


def zone_one_axes(data: xr.Dataset) -> list[str]:
    """Return the dimensions along which loads and velocities vary."""
    return [*_load_axes(data), *_varying(data, "velocity", "relaxation_time")]


class Table(NamedTuple):
    """An output over its scale and its error, shape (cases, realisations), and columns of numbers beside them."""

    friction: FloatArray
    error: FloatArray
    columns: tuple[FloatArray, ...]

    def stack(self, used: Any = slice(None)) -> FloatArray:
        """Return the stack of the means of some cases, with their errors."""
        return self._moved(bootstrap.means(self.friction[used].T), self._errors(used))

    def logarithms(self, used: Any = slice(None)) -> FloatArray:
        """Return the stack of the logarithms of the means, which relative errors move: a mean may err by its size."""
        means = bootstrap.means(self.friction[used].T)
        relative = self._errors(used) / means[0]
        return self._moved(bootstrap.logarithms(means), np.where(np.isinf(relative), 1.0, relative))

    def _errors(self, used: Any) -> FloatArray:
        known = ~np.isnan(self.error[used])
        total = np.where(known, np.abs(self.error[used]), 0.0).sum(axis=1)
        mean: FloatArray = total / np.maximum(known.sum(axis=1), 1)
        return mean

    @staticmethod
    def _moved(stack: FloatArray, error: FloatArray) -> FloatArray:
        moved: FloatArray = np.concatenate([stack, bootstrap.moved(stack[0], error)]) if np.any(error > 0) else stack
        return moved

    def count(self, used: Any = slice(None)) -> int:
        """Return the least number of realisations that any of some cases has."""
        return int(np.isfinite(self.friction[used]).sum(axis=1).min())

    def mean(self) -> FloatArray:
        """Return the mean of every case; NaN where no realisation has any."""
        mean: FloatArray = bootstrap.means(self.friction.T)[0]
        return mean


def table_of(
    data: xr.Dataset, scale: xr.DataArray, *columns: xr.DataArray, output: str = "friction_coefficient"
) -> Table:
    """Flatten the cases of an output over a scale, realisations last."""
    values = data[output]
    error = companion(data, output)
    friction, errors, *others = xr.broadcast(values / scale, (0 * values if error is None else error) / scale, *columns)
    cases = [dim for dim in friction.dims if dim != "realisation"]
    count = friction.sizes["realisation"]
    flat = [
        np.asarray(column.transpose(*cases, "realisation").values, dtype=np.float64).reshape(-1, count)
        for column in (friction, errors, *others)
    ]
    return Table(flat[0], flat[1], tuple(column[:, 0] for column in flat[2:]))


def _region_one(friction: FloatArray, velocity: FloatArray) -> int | None:
    """Return where friction begins to go with the velocity: the lowest one, but for the floor of the papers' method.

    Neighbours are compared on the lines that both have.
    """
    if velocity.size == 1:
        return 0
    for k in range(velocity.size - 1):
        both = friction[k : k + 2, np.isfinite(friction[k : k + 2]).all(axis=0)]
        low, high = both.mean(axis=1) / velocity[k : k + 2] if both.size else (np.nan, np.nan)
        if abs(high / low - 1) < LINEAR:
            return k
    return None


def _zone_one(data: xr.Dataset) -> Variables:
    """Fit log (mu / v) over log force in zone 1, at the low end of the velocities."""
    forces, velocities = loads_and_velocities(data)
    table = table_of(data, spectral_slope(data), forces, velocities)
    force, velocity = table.columns
    rate = table.mean() / (np.sqrt(2) * velocity)
    used = []
    for load in np.unique(force[(force >= ZONE_ONE[0]) & (force <= ZONE_ONE[1]) & (rate > 0)]):
        same = np.flatnonzero((force == load) & (rate > 0))
        same = same[np.argsort(velocity[same])]
        at = _region_one(table.friction[same], velocity[same])
        if at is not None:
            used.append(same[at])
    if len(used) < 3:
        raise FitError(
            f"expected three loads with F_N / (G h L) in {ZONE_ONE[0]}..{ZONE_ONE[1]} and velocities down to region I,"
            f" got {len(used)}: add lower loads or velocities"
        )
    x, count = np.log(force[used]), table.count(used)
    design = np.vstack([-x, np.ones(x.size)])
    found = fitted(
        lambda logs: logs @ np.linalg.pinv(design),
        lambda logs, constants: logs - constants @ design,
        table.logarithms(used) - np.log(np.sqrt(2) * velocity[used]),
        count,
    )
    alpha, offset = found.constants.T
    worst = f"F_N / (G h L) = {np.exp(x[np.argmax(np.abs(found.departures))]):.2g}"
    return {
        **constant("alpha", alpha, count, "exponent of the force in zone 1"),
        **measure("alpha_stated", laws.alpha(one_value(data, "hurst")), "H / (1 + H)"),
        **constant("beta", np.exp(offset), count, "factor of the law of zone 1", positive=True),
        **measure("rms_error", float(np.sqrt(np.mean(found.departures**2))), "rms relative deviation from the law"),
        **measure("loads", len(used), "number of loads in zone 1"),
        **holds(law_holds(found.departures, found.chance, 2, worst)),
    }


def _velocity_of(top: FloatArray, x: FloatArray, count: int, meaning: str, unit: str) -> Variables:
    """Return the velocity of the largest friction from the stack of its logarithm; no ends where it may lie beyond."""
    beyond = np.isinf(top[~np.isnan(top)])
    found = constant("plateau_velocity", np.exp(np.clip(top, x[0], x[-1])), count, meaning, positive=True)
    if beyond[0] or beyond.mean() > bootstrap.TAILS[0]:
        found |= {f"plateau_velocity_{end}": xr.Variable((), np.nan) for end in ("low", "high")}
    return {name: xr.Variable((), each.values, {"units": unit, "long_name": meaning}) for name, each in found.items()}


def _plateau(data: xr.Dataset) -> Variables:
    """Return how high friction comes against velocity, and where."""
    require(data, "shear_modulus", "relaxation_time")
    velocities, name, unit = _velocities(data)
    table = table_of(data, spectral_slope(data), velocities)
    known = np.flatnonzero(np.isfinite(table.mean()))
    velocity = table.columns[0][known]
    if velocity.size < 3 or not table.mean()[known].max() > 0:
        raise FitError("expected three velocities or more with friction, for a maximum over them")
    order = np.argsort(velocity)
    x, count = np.log(velocity[order]), table.count(known)
    stack = table.stack(known[order])
    found = top.highest(x, stack, count)
    ends = bootstrap.interval(found.rise, count)
    place = f"{name} = {{:.2g}}{unit}"
    verdict = _reached(x, float(found.place[0]), float(found.rise[0]), (float(ends[0]), float(ends[1])), place)
    flat = x[stack[0] > (1 - top.FLAT) * stack[0].max()]
    height = constant("plateau", found.height, count, "largest friction coefficient over rms slope")
    if verdict.startswith("no:"):
        height |= {f"plateau_{end}": xr.Variable((), np.nan, height["plateau"].attrs) for end in ("low", "high")}
    return {
        **height,
        **measure("plateau_stated", math.sqrt(2), "sqrt 2 (eq. 3.15)"),
        **_velocity_of(top.place(x, stack), x, count, f"{name} of the largest friction", unit.strip() or "1"),
        **measure("decades", float(np.ptp(flat) / np.log(10)), f"decades of velocity within {top.FLAT:.0%} of it"),
        **holds(verdict),
    }


def _velocities(data: xr.Dataset) -> tuple[xr.DataArray, str, str]:
    """Return velocities, what they are, and their unit: no store holds the rms height of a measured surface."""
    if "rms_roughness" in data:
        return loads_and_velocities(data)[1], "v tau slope / (sqrt 2 h)", ""
    return data["velocity"] * data["relaxation_time"], "v tau", " m"


def _reached(x: FloatArray, at: float, rise: float, ends: tuple[float, float], place: str) -> str:
    """Say whether the largest friction is a plateau or top, or lies at an end of the velocities and changes there."""
    inside = x[0] < at < x[-1] and abs(rise) < 1e-9
    change = f"d ln mu / d ln v = {rise:.2g} ({ends[0]:.2g}, {ends[1]:.2g})"
    if inside:
        return f"yes: friction falls to both sides of {place.format(np.exp(at))}"
    if abs(rise) <= top.FLAT:
        return f"yes: friction is level at the end of the velocities, {change}"
    end = "still rises at the largest velocity" if rise > 0 else "still falls at the lowest velocity"
    if np.isfinite(ends[0]) and ends[0] <= 0 <= ends[1]:
        return f"not tested: the scatter leaves open whether friction {end}, {change}"
    return f"no: the plateau is not reached, friction {end}, {change}"


def least_squares(
    model: Callable[[FloatArray], FloatArray], start: tuple[float, ...], data: FloatArray, steps: int = 40
) -> FloatArray:
    """Fit the data of every row, shape (rows, points), by Levenberg and Marquardt's steps; return (rows, constants)."""
    size = np.eye(len(start))
    constants = np.tile(np.array(start), (data.shape[0], 1))
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


def law_error(departures: FloatArray, suffix: str, unit: str, which: str) -> Variables:
    """Return the rms and the largest departure of the data from a law."""
    away = np.abs(departures)
    rms, largest = float(np.sqrt(np.mean(away**2))), float(np.max(away))
    return {
        **measure(f"rms_error{suffix}", rms, f"rms error of the law, {unit}, {which}"),
        **measure(f"largest_error{suffix}", largest, f"largest error of the law, {unit}, {which}"),
    }


def peak_velocity(velocity: FloatArray, mean: FloatArray) -> float:
    """Return the velocity of the largest friction, where region IV begins."""
    order = np.argsort(velocity)
    return float(velocity[order][np.argmax(top.smoothed(mean[order]))])


def _interpolation(data: xr.Dataset) -> Variables:
    """Fit alpha and beta of eq. 3.18 to the logarithms of friction in regions I to III."""
    forces, velocities = loads_and_velocities(data)
    table = table_of(data, np.sqrt(2) * spectral_slope(data), forces, velocities)
    force, velocity = table.columns
    mean = np.nan_to_num(table.mean())
    used = (force >= ZONE_ONE[0]) & (mean > 0)
    for load in np.unique(force[used]):
        same = used & (force == load)
        used[same] = velocity[same] <= peak_velocity(velocity[same], mean[same])
    if np.count_nonzero(used) < 5:
        raise FitError(
            f"expected five cases with F_N / (G h L) above {ZONE_ONE[0]} below region IV, got {int(used.sum())}"
        )
    force, velocity, count = force[used], velocity[used], table.count(used)

    def model(constants: FloatArray) -> FloatArray:
        law: FloatArray = np.log(laws.interpolation(force, velocity, constants[:, :1], np.exp(constants[:, 1:])))
        return law

    hurst = one_value(data, "hurst")
    start = (laws.alpha(hurst), float(np.log(laws.BETA)))
    stack = table.logarithms(used)
    found = fitted(
        lambda rows: least_squares(model, start, rows), lambda rows, found: rows - model(found), stack, count
    )
    at = int(np.argmax(np.abs(found.departures)))
    worst = f"F_N / (G h L) = {force[at]:.2g}, v tau slope / (sqrt 2 h) = {velocity[at]:.2g}"
    return {
        **constant("alpha", found.constants[:, 0], count, "exponent of the force in the interpolation law"),
        **measure("alpha_stated", laws.alpha(hurst), "H / (1 + H)"),
        **constant("beta", np.exp(found.constants[:, 1]), count, "factor of the interpolation law", positive=True),
        **law_error(found.departures, "", "relative", "constants fitted"),
        **law_error(stack[0] - model(np.array([start]))[0], "_stated", "relative", "with H / (1 + H) and 1.6"),
        **measure("cases", int(used.sum()), "number of cases fitted"),
        **holds(law_holds(found.departures, found.chance, 2, worst)),
    }


FITS: tuple[Fit, ...] = (
    Fit(
        "zone_one",
        MODELS,
        "alpha and beta of mu / slope = beta (v tau slope / h) (G h L / F_N)^alpha (eq. 3.11)",
        lambda series: each(series, zone_one_axes, _zone_one),
        apart=True,
        constants=("alpha", "beta"),
    ),
    Fit(
        "plateau",
        MODELS,
        "largest mu / slope over the velocity: sqrt 2 on the plateau (eq. 3.15)",
        lambda series: each(series, lambda data: _varying(data, "velocity", "relaxation_time"), _plateau),
        apart=True,
        constants=("plateau", "plateau_velocity"),
    ),
    Fit(
        "interpolation",
        MODELS,
        "alpha and beta of the interpolation law through regions I to III and both zones (eq. 3.18)",
        lambda series: each(series, zone_one_axes, _interpolation),
        apart=True,
        constants=("alpha", "beta"),
    ),
)
