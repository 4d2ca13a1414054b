"""Kinetic laws of friction after a jump of the velocity (thesis 4.3): jump, relaxation, rate-and-state terms."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from mdr_dask.errors import FitError
from mdr_dask.fit.base import Fit
from mdr_dask.fit.relaxation import RATE_FIELDS, relaxation_of

GROUPS = 10  # of the jackknife over realisations
LAW = 0.4  # constant of eq. 4.11 in the thesis
TRUSTED = 0.5  # relative half-width beyond which a rate is left out of the power law
INSTANT = 1e-9  # relaxing part over rms slope below which there is no relaxation to fit


def passing(data: xr.Dataset) -> xr.DataArray:
    """Return v_1 tau q_max, the relaxation time over the time to pass 1 / q_max; q_max = pi points / length."""
    number: xr.DataArray = (
        data["velocity"] * data["relaxation_time"] * np.pi * data["points"] / data["length"]
    ).rename("passing_number")
    number.attrs = {"units": "1", "long_name": "v_1 tau q_max"}
    return number


def law_rate(number: xr.DataArray, hurst: xr.DataArray) -> xr.DataArray:
    """Return the rate of eq. 4.12 with its powers 1 below and 1 - H above v_1 tau q_max = 1."""
    rate: xr.DataArray = number.where(number < 1, number ** (1 - hurst))
    return rate


def _flat(series: Mapping[str, xr.Dataset], needed: tuple[str, ...]) -> xr.Dataset:
    """Return all cases of all series along one dimension ``case``."""
    parts = []
    for name, data in series.items():
        missing = [variable for variable in needed if variable not in data]
        if missing:
            raise FitError(f"expected the outputs {', '.join(needed)} in the store, got none of {', '.join(missing)}")
        cases = data["friction_coefficient_before"].isel(realisation=0, drop=True)
        dims = list(cases.dims)
        data = (
            data[[*needed]]
            .assign_coords(realisation=np.arange(data.sizes["realisation"]))
            .assign_coords(
                {
                    key: data[key]
                    for key in ("velocity", "hurst", "points", "length", "relaxation_time", "velocity_change")
                }
            )
        )
        for key in ("velocity", "hurst", "points", "length", "relaxation_time", "velocity_change"):
            data = data.assign({f"_{key}": data[key].broadcast_like(cases)})
        data = data.expand_dims("only") if not dims else data
        data = data.stack(case=dims or ["only"], create_index=False)
        plain = data.drop_vars([key for key in data.coords if key not in ("relaxation_times", "realisation")])
        parts.append(plain.assign_coords(series=("case", np.full(plain.sizes["case"], name))))
    flat = xr.concat(parts, "case", join="outer") if len(parts) > 1 else parts[0]
    return flat.rename({key: str(key)[1:] for key in flat.data_vars if str(key).startswith("_")})


def _jackknife(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return means, and means without one group of realisations each; realisations lie along the first axis."""
    good = values[np.all(np.isfinite(values.reshape(values.shape[0], -1)), axis=1)]
    groups = min(GROUPS, good.shape[0])
    if groups < 2:
        raise FitError(f"expected at least two realisations that succeeded, got {good.shape[0]}")
    member = np.arange(good.shape[0]) % groups
    return good.mean(axis=0), np.stack([good[member != group].mean(axis=0) for group in range(groups)])


def _interval(value: float, without: np.ndarray) -> tuple[float, float]:
    """Return the 95 % interval of a jackknife over groups, by Student's t."""
    from scipy.stats import t

    groups = without.size
    error = np.sqrt((groups - 1) / groups * np.sum((without - without.mean()) ** 2))
    half = float(t.ppf(0.975, groups - 1) * error)
    return value - half, value + half


def _rates(series: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Fit jump and relaxation of every case."""
    names = ("before", "jump", "after")
    needed = ("friction_coefficient", *(f"friction_coefficient_{name}" for name in names), "rms_slope")
    flat = _flat(series, needed).transpose("case", "realisation", ..., "relaxation_times")
    number = passing(flat)
    expected = law_rate(number, flat["hurst"])
    time = np.concatenate([[0.0], flat["relaxation_times"].values])
    columns: dict[str, list[float]] = {}
    for k in range(flat.sizes["case"]):
        case = flat.isel(case=k)
        before, jump, after = (case[f"friction_coefficient_{name}"].values for name in names)
        start = (before + jump - after)[:, None]
        relaxing = np.concatenate([start, case["friction_coefficient"].values - after[:, None]], axis=1)
        change = float(case["velocity_change"])
        row = _case_row(np.column_stack([before, jump, after]), relaxing, time, change, float(expected[k]), case)
        for name, value in row.items():
            columns.setdefault(name, []).append(value)
    result = xr.Dataset({name: ("case", np.array(column)) for name, column in columns.items()})
    speed = flat["velocity"] * (1 + flat["velocity_change"])
    result["relaxation_length"] = speed * flat["relaxation_time"] / result["rate"]
    result["relaxation_duration"] = flat["relaxation_time"] / result["rate"]
    result["length_times_wavenumber"] = result["relaxation_length"] * np.pi * flat["points"] / flat["length"]
    result["passing_number"] = number
    result["law_rate"] = expected
    for name, (unit, meaning) in (RATE_FIELDS | OWN_FIELDS).items():
        if name in result:
            result[name].attrs = {"units": unit, "long_name": meaning}
    kept = [name for name in flat.data_vars if flat[name].dims == ("case",)]
    return result.assign_coords({str(name): flat[name] for name in kept} | {"series": flat["series"]})


OWN_FIELDS = {
    "jump": ("1", "immediate change d_mu_0 of the coefficient of friction"),
    "jump_over_slope": ("1", "d_mu_0 v_1 / (dv rms_slope)"),
    "before_over_slope": ("1", "mu_1 / rms_slope"),
    "zeta": ("1", "zeta = (d_mu_0 / mu_1) / (dv / v_1), eq. 4.8"),
    "xi": ("1", "xi = ((mu_2 - mu_1) / mu_1) / (dv / v_1), eq. 4.8"),
    "relaxing_over_slope": ("1", "relaxing part mu(t_0+) - mu_2 over rms_slope"),
    "relaxation_length": ("m", "v_2 tau / b"),
    "relaxation_duration": ("s", "tau / b"),
    "length_times_wavenumber": ("1", "q_max v_2 tau / b"),
    "passing_number": ("1", "v_1 tau q_max"),
    "law_rate": ("1", "(v_1 tau q_max)^a with a = 1 below and 1 - H above 1, eq. 4.12"),
}


def _case_row(
    levels: np.ndarray, relaxing: np.ndarray, time: np.ndarray, change: float, expected: float, case: xr.Dataset
) -> dict[str, float]:
    """Return the constants of one case with their intervals."""
    slope = float(case["rms_slope"].mean())
    row: dict[str, float] = {}
    try:
        levels_mean, without = _jackknife(levels)
        mean, others = _jackknife(relaxing)
    except FitError:
        return dict.fromkeys((*LEVEL_NAMES, *RATE_FIELDS), np.nan)
    of_others = _level_numbers(without, change, slope)
    for name, value in _level_numbers(levels_mean, change, slope).items():
        low, high = _interval(float(value), of_others[name])
        row |= {name: float(value), f"{name}_low": low, f"{name}_high": high}
    error = relaxing.std(axis=0, ddof=1) / np.sqrt(relaxing.shape[0])
    if np.nanmax(np.abs(mean)) < INSTANT * slope:
        return row | dict.fromkeys(RATE_FIELDS, np.nan)
    return row | relaxation_of(time, mean, others, error, expected, _interval)


def _level_numbers(levels: np.ndarray, change: float, slope: float) -> dict[str, np.ndarray]:
    """Return the numbers that follow from mu_1, d_mu_0 and mu_2, which lie along the last axis."""
    before, jump, after = np.moveaxis(levels, -1, 0)
    return {
        "jump": jump,
        "jump_over_slope": jump / change / slope,
        "before_over_slope": before / slope,
        "zeta": jump / before / change,
        "xi": (after / before - 1) / change,
        "relaxing_over_slope": (before + jump - after) / slope,
    }


LEVEL_NAMES = tuple(
    f"{name}{suffix}"
    for name in ("jump", "jump_over_slope", "before_over_slope", "zeta", "xi", "relaxing_over_slope")
    for suffix in ("", "_low", "_high")
)


def _jump_law(series: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Fit the constant of eq. 4.11 for every Hurst exponent and for all cases."""
    needed = ("friction_coefficient_before", "friction_coefficient_jump", "rms_slope")
    flat = _flat(series, needed)
    mean = flat[list(needed)].mean("realisation")
    jump = (mean["friction_coefficient_jump"] / mean["rms_slope"] / flat["velocity_change"]).values
    before = (mean["friction_coefficient_before"] / mean["rms_slope"]).values
    hurst = flat["hurst"].values
    values = np.unique(hurst[np.isfinite(jump)])
    if values.size == 0:
        raise FitError("expected at least one case that succeeded")
    rows = np.array([_constant(before[hurst == value], jump[hurst == value]) for value in values])
    whole = _constant(before, jump)
    result = xr.Dataset(coords={"hurst": values})
    for k, name in enumerate(("constant", "constant_low", "constant_high", "rms_deviation", "rms_deviation_of_thesis")):
        result[name] = ("hurst", rows[:, k])
        result[f"{name}_of_all"] = whole[k]
        result[name].attrs["units"] = result[f"{name}_of_all"].attrs["units"] = "1"
    result.attrs["law"] = f"d_mu_0 v_1 / (dv s) = [(s / mu_1)^2 + 1 / c^2]^(-1/2), s = rms_slope; thesis: c = {LAW}"
    result.attrs["window"] = "all cases that succeeded, equal weights of the relative deviations"
    return result


def jump_law(before: np.ndarray, constant: float) -> np.ndarray:
    """Return d_mu_0 v_1 / (dv rms_slope) over mu_1 / rms_slope (eq. 4.11)."""
    law: np.ndarray = (before**-2.0 + constant**-2.0) ** -0.5
    return law


def _constant(before: np.ndarray, jump: np.ndarray) -> tuple[float, float, float, float, float]:
    """Return c, its interval, and the rms relative deviations with it and with the one of the thesis."""
    from scipy.optimize import least_squares
    from scipy.stats import t

    good = np.isfinite(before) & np.isfinite(jump) & (before > 0) & (jump > 0)
    x, y = before[good], jump[good]
    if x.size < 2:
        return np.nan, np.nan, np.nan, np.nan, np.nan

    def deviations(log_c: np.ndarray) -> np.ndarray:
        ratio: np.ndarray = np.log(jump_law(x, float(np.exp(log_c[0]))) / y)
        return ratio

    found = least_squares(deviations, [np.log(LAW)])
    freedom = x.size - 1
    sensitivity = (deviations(found.x + 1e-6) - deviations(found.x - 1e-6)) / 2e-6
    variance = float(np.sum(found.fun**2)) / freedom / float(sensitivity @ sensitivity)
    half = t.ppf(0.975, freedom) * np.sqrt(variance)
    centre = float(found.x[0])
    deviation = np.sqrt(np.mean(found.fun**2))
    other = np.sqrt(np.mean(np.log(jump_law(x, LAW) / y) ** 2))
    return np.exp(centre), np.exp(centre - half), np.exp(centre + half), float(deviation), float(other)


def _rate_power(series: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Fit the power of the rate over v_1 tau q_max below and above 1 for every Hurst exponent."""
    rates = _rates(series)
    half = (rates["rate_high"] - rates["rate_low"]) / 2
    good = (rates["rate"] > 0) & (half < TRUSTED * rates["rate"])
    x, y = np.log(rates["passing_number"].values), np.log(rates["rate"].where(good).values)
    hurst = rates["hurst"].values
    values = np.unique(hurst)
    result = xr.Dataset(coords={"hurst": values, "regime": ["below", "above"]})
    table = np.array(
        [
            [_line(x[near], y[near]) for near in ((hurst == value) & good.values & side for side in (x < 0, x > 0))]
            for value in values
        ]
    )
    for k, name in enumerate(("power", "power_low", "power_high", "factor", "rms_deviation", "cases")):
        result[name] = (("hurst", "regime"), table[:, :, k], {"units": "1"})
    result["law_power"] = (
        ("hurst", "regime"),
        np.column_stack([np.ones(values.size), 1 - values]),
        {"units": "1"},
    )
    result.attrs["law"] = "b = factor (v_1 tau q_max)^power; thesis: 1 below, 1 - H above v_1 tau q_max = 1"
    result.attrs["window"] = f"{WINDOW_TEXT}; rates known within {TRUSTED:.0%}"
    return result


WINDOW_TEXT = "one exponential over 0 <= (t - t_0) / tau <= 8 / b_law, equal weights in time"


def _line(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float, float, float, float]:
    """Return slope, its interval, exp(intercept), rms deviation and number of a straight line."""
    from scipy.stats import linregress, t

    if x.size < 3 or np.ptp(x) < 0.5:
        return np.nan, np.nan, np.nan, np.nan, np.nan, float(x.size)
    line = linregress(x, y)
    half = t.ppf(0.975, x.size - 2) * line.stderr
    deviation = np.sqrt(np.mean((y - line.intercept - line.slope * x) ** 2))
    return line.slope, line.slope - half, line.slope + half, np.exp(line.intercept), float(deviation), float(x.size)


def _kinetics(series: Mapping[str, xr.Dataset]) -> xr.Dataset:
    result = _rates(series)
    result.attrs["window"] = WINDOW_TEXT
    return result


def _rate_and_state(series: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return direct effect, evolution effect and slip length of every case."""
    rates = _rates(series)
    logarithm = np.log1p(rates["velocity_change"])
    scale = rates["jump"] / rates["zeta"]  # mu_1 dv / v_1
    result = xr.Dataset(
        {
            "direct_effect": rates["jump"] / logarithm,
            "evolution_effect": (rates["zeta"] - rates["xi"]) * scale / logarithm,
            "slip_length": rates["relaxation_length"],
            "slip_length_of_law": rates["length"] / (np.pi * rates["points"]),
        }
    )
    for end in ("low", "high"):
        result[f"direct_effect_{end}"] = rates[f"jump_{end}"] / logarithm
        part = rates[f"relaxing_over_slope_{end}"] / rates["relaxing_over_slope"]
        result[f"evolution_effect_{end}"] = result["evolution_effect"] * part
        other = "high" if end == "low" else "low"
        result[f"slip_length_{end}"] = rates["relaxation_length"] * rates["rate"] / rates[f"rate_{other}"]
    for name in result.data_vars:
        result[name].attrs["units"] = "m" if "length" in str(name) else "1"
    result.attrs["law"] = "mu = mu_1 + a ln(v_2 / v_1) - b ln(v_2 / v_1) (1 - exp(-s / D_c)), s slipped since the jump"
    result.attrs["window"] = WINDOW_TEXT
    return result


_MODELS = ("velocity_jump",)
FITS: tuple[Fit, ...] = (
    Fit("kinetics", _MODELS, "d_mu_0, zeta, xi, and mu(t) = mu_2 + mu* exp(-b t') of every case", _kinetics),
    Fit("jump_law", _MODELS, "d_mu_0 v_1 / (dv s) = [(s / mu_1)^2 + 1 / c^2]^(-1/2) with the constant c", _jump_law),
    Fit(
        "rate_power",
        _MODELS,
        "b = factor (v_1 tau q_max)^a for every H, below and above v_1 tau q_max = 1",
        _rate_power,
    ),
    Fit(
        "rate_and_state",
        _MODELS,
        "direct effect a, evolution effect b and slip length D_c of every case",
        _rate_and_state,
    ),
)
