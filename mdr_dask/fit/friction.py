"""The laws of sliding friction fitted to a store; intervals by bootstrap over realisations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, cast

import numpy as np
import xarray as xr

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fit.base import Fit
from mdr_dask.fit.bootstrap import weights
from mdr_dask.physics.sliding import laws
from mdr_dask.physics.surfaces import roughness
from mdr_dask.physics.surfaces import shapes as indenter

Series = Mapping[str, xr.Dataset]

MODELS = ("sliding_friction",)
INTERVAL = (0.025, 0.975)
ZONE_ONE = (0.01, 0.3)  # F_N / (G h L) over which alpha and beta are fitted; they depend on it by up to 0.02 and 0.14
LINEAR = 0.05  # change of mu / v between the two lowest velocities that still counts as region I
FLAT = 0.05  # of the largest friction that still counts as plateau
BODY = 0.3  # rms slope of an indenter over its contact, over that of the roughness, beyond which its law does not hold
LAW_FROM = 0.1  # F_N / (G h L) above which the interpolation law is fitted


def spectral_slope(data: xr.Dataset) -> xr.DataArray:
    """Return the spectral rms slope: from the store, or from the parameters of a line without roll-off."""
    if "rms_slope" in data:
        return data["rms_slope"].mean("realisation")
    unit = xr.apply_ufunc(
        lambda hurst, points: roughness.spectral_slope(roughness.amplitudes(int(points) // 2, float(hurst))),
        data["hurst"],
        data["points"],
        vectorize=True,
    )
    slope: xr.DataArray = unit * data["rms_roughness"] / data["length"]
    return slope


def _require_kelvin(data: xr.Dataset) -> None:
    missing = [name for name in ("shear_modulus", "relaxation_time", "rms_roughness", "length") if name not in data]
    if missing:
        raise FitError(f"the laws hold for a Kelvin body on a generated line: the store has no {', '.join(missing)}")


def numbers(data: xr.Dataset) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    """Return mu / slope, F_N / (G h L) and v tau slope / (sqrt 2 h)."""
    _require_kelvin(data)
    slope = spectral_slope(data)
    force = laws.force_number(data["normal_force"], data["shear_modulus"], data["rms_roughness"], data["length"])
    velocity = laws.velocity_number(data["velocity"], data["relaxation_time"], slope, data["rms_roughness"])
    return data["friction_coefficient"] / slope, xr.DataArray(force), xr.DataArray(velocity)


def _resampled(values: FloatArray) -> FloatArray:
    """Return means over the last axis, realisations: of all of them first, then of bootstrap samples."""
    drawn = weights(values.shape[-1]).T
    known = np.isfinite(values)
    total = np.where(known, values, 0.0) @ drawn
    number = known @ drawn
    with np.errstate(invalid="ignore", divide="ignore"):
        means: FloatArray = np.moveaxis(total / number, -1, 0)
    return means


def _interval(name: str, samples: FloatArray, long_name: str, unit: str = "1") -> dict[str, xr.Variable]:
    """Return a constant and its interval: the first sample is the estimate, the others the bootstrap."""
    low, high = np.nanquantile(samples[1:], INTERVAL, axis=0)
    names = {name: samples[0], f"{name}_low": low, f"{name}_high": high}
    return {key: xr.Variable((), value, {"units": unit, "long_name": long_name}) for key, value in names.items()}


def _measure(name: str, value: float, long_name: str) -> dict[str, xr.Variable]:
    return {name: xr.Variable((), value, {"units": "1", "long_name": long_name})}


def _groups(value: xr.DataArray, inner: list[str]) -> Iterator[dict[str, Any]]:
    """Yield a selection for every point of the dimensions that are not `inner`."""
    outer = [str(dim) for dim in value.dims if dim not in inner]
    for index in np.ndindex(*(value.sizes[dim] for dim in outer)):
        yield dict(zip(outer, index, strict=True))


def _each(
    series: Series, inner: Callable[[xr.Dataset], list[str]], fit: Callable[[xr.Dataset], dict[str, xr.Variable]]
) -> xr.Dataset:
    """Fit every point of the dimensions of a series that the fit does not use up."""
    data = next(iter(series.values())).load()
    parts = []
    for where in _groups(data["friction_coefficient"], ["realisation", *inner(data)]):
        part = data.isel(where)
        point = {key: part.coords.get(key, index) for key, index in where.items()}
        parts.append(xr.Dataset(fit(part), coords=point).expand_dims(list(where)))
    return cast(xr.Dataset, xr.combine_by_coords(parts, combine_attrs="override"))


def _varying(data: xr.Dataset, *names: str) -> list[str]:
    """Return the dimensions that any of some parameters vary along."""
    return sorted({str(dim) for name in names if name in data.coords for dim in data[name].dims})


def _load_axes(data: xr.Dataset) -> list[str]:
    return _varying(data, "normal_force", "shear_modulus", "rms_roughness")


def _zone_one_axes(data: xr.Dataset) -> list[str]:
    return [*_load_axes(data), *_varying(data, "velocity", "relaxation_time")]


def _table(data: xr.Dataset, *columns: xr.DataArray) -> list[FloatArray]:
    """Flatten friction first, realisations last, and other columns beside it over the cases."""
    friction, *others = xr.broadcast(*columns)
    cases = [dim for dim in friction.dims if dim != "realisation"]
    shaped = [column.transpose(*cases, "realisation") for column in (friction, *others)]
    count = friction.sizes["realisation"]
    flat = [np.asarray(column.values, dtype=np.float64).reshape(-1, count) for column in shaped]
    return [flat[0], *(column[:, 0] for column in flat[1:])]


def _region_one(rate: FloatArray) -> int | None:
    """Return where friction begins to go with the velocity: the lowest one, but for the floor of the papers' method."""
    if rate.size == 1:
        return 0
    linear = np.flatnonzero(np.abs(rate[1:] / rate[:-1] - 1) < LINEAR)
    return int(linear[0]) if linear.size else None


def _zone_one(data: xr.Dataset) -> dict[str, xr.Variable]:
    """Fit log (mu / v) over log force in zone 1, at the low end of the velocities."""
    friction, force, velocity = _table(data, *numbers(data))
    rate = friction / (np.sqrt(2) * velocity[:, None])
    points, loads = [], []
    for load in np.unique(force[(force >= ZONE_ONE[0]) & (force <= ZONE_ONE[1])]):
        same = np.flatnonzero(force == load)
        same = same[np.argsort(velocity[same])]
        at = _region_one(np.nanmean(rate[same], axis=1))
        if at is not None:
            points.append(rate[same[at]])
            loads.append(load)
    if len(points) < 3:
        raise FitError(
            f"expected three loads with F_N / (G h L) in {ZONE_ONE[0]}..{ZONE_ONE[1]} and velocities down to region I,"
            f" got {len(points)}: add lower loads or velocities"
        )
    logs, x = np.log(_resampled(np.array(points))), np.log(loads)
    slope = (logs - logs.mean(axis=1, keepdims=True)) @ (x - x.mean()) / np.sum((x - x.mean()) ** 2)
    offset = logs.mean(axis=1) - slope * x.mean()
    residual = logs[0] - offset[0] - slope[0] * x
    return {
        **_interval("alpha", -slope, "exponent of the force in zone 1"),
        **_measure("alpha_stated", laws.alpha(float(data["hurst"])), "H / (1 + H)"),
        **_interval("beta", np.exp(offset), "factor of the law of zone 1"),
        **_measure("rms_error", float(np.sqrt(np.mean(residual**2))), "rms relative deviation from the law"),
        **_measure("loads", len(points), "number of loads in zone 1"),
    }


def _plateau(data: xr.Dataset) -> dict[str, xr.Variable]:
    """Take the largest mean friction over the velocities."""
    friction, _, velocity = _table(data, *numbers(data))
    means = _resampled(friction)
    if velocity.size < 3 or not np.any(np.isfinite(means[0])):
        raise FitError("expected three velocities or more with friction, for a maximum over them")
    best = np.nanmax(means, axis=1)
    at = int(np.nanargmax(means[0]))
    inside = 0 < np.argsort(np.argsort(velocity))[at] < velocity.size - 1
    flat = velocity[means[0] > (1 - FLAT) * best[0]]
    return {
        **_interval("plateau", best, "largest friction coefficient over rms slope"),
        **_measure("plateau_velocity", float(velocity[at]), "v tau slope / (sqrt 2 h) of the largest friction"),
        **_measure("decades", float(np.log10(flat.max() / flat.min())), f"decades of velocity within {FLAT:.0%} of it"),
        **_measure("bracketed", float(inside), "1 if the largest friction is not at an end of the velocities"),
    }


def _least_squares(
    model: Callable[[FloatArray], FloatArray], start: tuple[float, ...], data: FloatArray, steps: int = 30
) -> FloatArray:
    """Fit the data of every sample, shape (samples, points), by damped Gauss-Newton; return (samples, constants)."""
    constants = np.tile(np.array(start), (data.shape[0], 1))
    for _ in range(steps):
        value = model(constants)
        jacobian = np.stack([(model(constants + shift) - value) / 1e-6 for shift in 1e-6 * np.eye(len(start))], axis=-1)
        normal = np.einsum("spi,spj->sij", jacobian, jacobian) + 1e-12 * np.eye(len(start))
        gradient = np.einsum("spi,sp->si", jacobian, data - value)
        constants = constants + np.clip(np.linalg.solve(normal, gradient[..., None])[..., 0], -0.3, 0.3)
    return constants


def _law_error(law: FloatArray, data: FloatArray, suffix: str, which: str) -> dict[str, xr.Variable]:
    """Return how far a law is from the data, both in units of the plateau sqrt 2 slope."""
    away = np.abs(law - data)
    rms, largest = float(np.sqrt(np.mean(away**2))), float(np.max(away))
    return {
        **_measure(f"rms_error{suffix}", rms, f"rms error of the law over its plateau, {which}"),
        **_measure(f"largest_error{suffix}", largest, f"largest error of the law over its plateau, {which}"),
    }


def _interpolation(data: xr.Dataset) -> dict[str, xr.Variable]:
    """Fit alpha and beta of eq. 3.18 to regions I to III."""
    friction, force, velocity = _table(data, *numbers(data))
    mean = np.nanmean(friction, axis=1)
    peak = {load: velocity[force == load][np.argmax(mean[force == load])] for load in np.unique(force)}
    used = (force >= LAW_FROM) & (velocity <= np.array([peak[load] for load in force])) & (mean > 0)
    if np.count_nonzero(used) < 5:
        raise FitError(
            f"expected five cases with F_N / (G h L) above {LAW_FROM} below region IV, got {int(used.sum())}"
        )
    means, force, velocity = _resampled(friction[used]) / np.sqrt(2), force[used], velocity[used]

    def model(constants: FloatArray) -> FloatArray:
        law: FloatArray = laws.interpolation(force, velocity, constants[:, :1], np.exp(constants[:, 1:]))
        return law

    hurst = float(data["hurst"])
    constants = _least_squares(model, (laws.alpha(hurst), np.log(laws.BETA)), means)
    stated = model(np.array([[laws.alpha(hurst), np.log(laws.BETA)]]))[0]
    return {
        **_interval("alpha", constants[:, 0], "exponent of the force in the interpolation law"),
        **_measure("alpha_stated", laws.alpha(hurst), "H / (1 + H)"),
        **_interval("beta", np.exp(constants[:, 1]), "factor of the interpolation law"),
        **_law_error(model(constants[:1])[0], means[0], "", "constants fitted"),
        **_law_error(stated, means[0], "_stated", "with H / (1 + H) and 1.6"),
        **_measure("cases", int(used.sum()), "number of cases fitted"),
    }


def _body(data: xr.Dataset) -> tuple[Any, float]:
    """Return coefficient and exponent of the line c |x|^n of a store's indenter."""
    if "indenter_angle" in data.coords:
        return indenter.mapped(1.0) * np.tan(data["indenter_angle"]), 1.0
    if "indenter_radius" in data.coords:
        return 1 / data["indenter_radius"], 2.0
    if "indenter_coefficient" in data.coords and data["indenter_exponent"].ndim == 0:
        exponent = float(data["indenter_exponent"])
        return indenter.mapped(exponent) * data["indenter_coefficient"], exponent
    raise FitError("expected a store with an indenter: cone, parabola or power")


def _half_width(data: xr.Dataset) -> Any:
    """Return the half width of the static contact without roughness."""
    coefficient, exponent = _body(data)
    load = data["normal_force"] / (4 * data["shear_modulus"])
    return ((exponent + 1) * load / (2 * exponent * coefficient)) ** (1 / (exponent + 1))


def indenter_xi(data: xr.Dataset, slope: xr.DataArray) -> xr.DataArray:
    """Return mu at low velocity over sqrt 2 slope, the argument of the law of rough indenters (eq. 3.34, 3.38)."""
    _require_kelvin(data)
    low = laws.indenter_low(
        _half_width(data),
        data["velocity"],
        data["relaxation_time"],
        data["shear_modulus"],
        data["normal_force"],
        slope,
    )
    return xr.DataArray(low / (np.sqrt(2) * slope))


def within_indenter_law(data: xr.Dataset, slope: xr.DataArray) -> xr.DataArray:
    """Return where the law of rough indenters is meant to hold.

    The body is flat against the roughness and pressed in by more than its rms height, and the velocity is not beyond
    that of the largest friction, where region IV begins.
    """
    coefficient, exponent = _body(data)
    width = _half_width(data)
    flat = coefficient * exponent * width ** (exponent - 1) / np.sqrt(2 * exponent - 1) <= BODY * slope
    deep = coefficient * width**exponent >= data["rms_roughness"]
    within = flat & deep
    if "velocity" in data["friction_coefficient"].dims:
        mean = data["friction_coefficient"].mean("realisation").fillna(0.0)
        within = within & (data["velocity"] <= mean.idxmax("velocity"))
    return xr.DataArray(within)


def _indenter(data: xr.Dataset) -> dict[str, xr.Variable]:
    """Fit the exponent of eq. 3.40; constants are NaN where fewer than three cases lie within the law."""
    slope = spectral_slope(data)
    columns = data["friction_coefficient"] / (np.sqrt(2) * slope), indenter_xi(data, slope)
    friction, xi, within = _table(data, *columns, within_indenter_law(data, slope))
    used = (within > 0) & np.any(friction > 0, axis=1) & np.isfinite(xi) & (xi > 0)
    count = _measure("cases", int(used.sum()), "number of cases within the law")
    if np.count_nonzero(used) < 3:
        errors = [f"{which}_error{suffix}" for suffix in ("", "_stated") for which in ("rms", "largest")]
        names = ["exponent", "exponent_low", "exponent_high", *errors]
        return {name: xr.Variable((), np.nan, {"units": "1"}) for name in names} | count
    logs, xi = np.log(_resampled(friction[used])), xi[used]

    def model(constants: FloatArray) -> FloatArray:
        law: FloatArray = np.log(laws.indenter(xi, np.exp(constants)))
        return law

    constants = _least_squares(model, (np.log(laws.INDENTER_EXPONENT),), logs)
    stated = model(np.array([[np.log(laws.INDENTER_EXPONENT)]]))[0]
    return {
        **_interval("exponent", np.exp(constants[:, 0]), "exponent of the law of rough indenters"),
        **_law_error(np.exp(model(constants[:1])[0]), np.exp(logs[0]), "", "exponent fitted"),
        **_law_error(np.exp(stated), np.exp(logs[0]), "_stated", "exponent 1.5"),
        **count,
    }


def _indenter_axes(data: xr.Dataset) -> list[str]:
    return [str(dim) for dim in data["friction_coefficient"].dims if dim not in ("realisation", "hurst")]


FITS: tuple[Fit, ...] = (
    Fit(
        "zone_one",
        MODELS,
        "alpha and beta of mu / slope = beta (v tau slope / h) (G h L / F_N)^alpha (eq. 3.11)",
        lambda series: _each(series, _zone_one_axes, _zone_one),
        apart=True,
    ),
    Fit(
        "plateau",
        MODELS,
        "largest mu / slope over the velocity: sqrt 2 on the plateau (eq. 3.15)",
        lambda series: _each(series, lambda data: _varying(data, "velocity", "relaxation_time"), _plateau),
        apart=True,
    ),
    Fit(
        "interpolation",
        MODELS,
        "alpha and beta of the interpolation law through regions I to III and both zones (eq. 3.18)",
        lambda series: _each(series, _zone_one_axes, _interpolation),
        apart=True,
    ),
    Fit(
        "indenter",
        MODELS,
        "exponent of mu / (sqrt 2 slope) = (1 + xi^-alpha)^(-1/alpha) for rough indenters (eq. 3.40)",
        lambda series: _each(series, _indenter_axes, _indenter),
        apart=True,
    ),
)
