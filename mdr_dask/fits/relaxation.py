"""Relaxation of friction after a jump of the velocity: one exponential, and laws of its rate (thesis eqs. 4.5 to 4.15).

For the symbols v_1, v_2, dv, mu_1, mu_2, d_mu_0 and s see `mdr_dask.fits.jumps`. The relaxation time of the body is
tau, and t' is (t - t_0) / tau. The largest wave number of the roughness is q_max.

By eqs. 4.13 to 4.15, mu - mu_2 begins at mu_1 + d_mu_0 - mu_2, with d_mu_0 by eq. 4.11, and is proportional to exp(-b
t'). By eq. 4.12, the rate b is (v_1 tau q_max)^p. The power p is 1 if v_1 tau q_max < 1, and 1 - H if v_1 tau q_max >
1, with the Hurst exponent H. This rate is unknown (NaN) if v_1 tau q_max > 1 on a measured surface, which has no H.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import DOUBTFUL, Fit, excludes, fitted, law_holds, short, verdict
from mdr_dask.fits.cases import (
    Series,
    Variables,
    constant,
    dimensions,
    holds,
    measure,
    one_value,
    rms,
    table_of,
)
from mdr_dask.fits.jumps import LAW, LEVELS, MODELS, each_jump, jump_law, jumps_of
from mdr_dask.physics.refine import CLOSE

# the following four numbers were chosen by trial
WINDOW = 8.0  # the exponential is fitted up to t' = WINDOW / (rate by eq. 4.12)
FLOOR = 0.01  # assumed grid error of mu - mu_2, as a fraction of the largest mu - mu_2 (docs/kinetics.md)

TRUSTED = 0.5  # the fit of the power law uses a rate if the half width of the interval of ln(rate) is below this value
# the weights of the power-law fit are 1 / (e^2 + SURE^2) with the error e of ln(rate), so that no single rate dominates
SURE = 0.1

TRACE = "friction_coefficient"
#: Constants that describe the relaxation of a case: the unit and the meaning of each constant.
FIELDS = {
    "rate": ("1", "rate b of one exponential exp(-b t') with t' = (t - t_0) / tau (eq. 4.5)"),
    "integral_rate": ("1", "mu - mu_2 just after t_0, divided by its integral over t': a rate that needs no law"),
    "relaxation_duration": ("s", "tau / b: time in which mu - mu_2 decreases by the factor e"),
    "relaxation_length": ("m", "v_2 tau / b: slip length D_c of rate-and-state laws"),
}


class Relaxation(NamedTuple):
    """One exponential fitted to a trace. A trace is the mean of mu - mu_2 over realisations as a function of time.

    `rate` is the stack of the fitted rate; it is NaN if the times of the trace do not resolve the rate. `integral_rate`
    is the stack of the rate that follows from the integral of the trace. `holds` is the verdict on the exponential.
    """

    rate: FloatArray
    integral_rate: FloatArray
    holds: str


def widths(time: FloatArray) -> FloatArray:
    """Return the weights of values at the times `time` in an integral by the trapezoidal rule."""
    step = np.diff(time)
    weights: FloatArray = 0.5 * (np.append(step, 0.0) + np.append(0.0, step))
    return weights


def tried_rates(time: FloatArray) -> FloatArray:
    """Return the rates that are tried for a trace; the times of the trace do not resolve lower or higher rates."""
    rates: FloatArray = np.geomspace(0.02 / time[-1], 2 / time[time > 0][0], 400)
    return rates


def exponential(time: FloatArray, traces: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Fit one exponential to each trace (a row of `traces`) by weighted least squares; return rates and amplitudes.

    The sum of squares is computed for each of the `tried_rates`, with the best amplitude for this rate. A parabola
    through the sums of squares at the best rate and at its two neighbours refines the rate to a relative error of about
    1e-4.
    """
    logs = np.log(tried_rates(time))
    shapes = np.exp(-np.exp(logs)[:, None] * time)
    gain = ((weights * traces) @ shapes.T) ** 2 / (shapes**2 @ weights)
    best = 1 + np.argmax(gain[:, 1:-1], axis=1)
    left, middle, right = (gain[np.arange(len(gain)), best + k] for k in (-1, 0, 1))
    bend = left - 2 * middle + right
    shift = 0.5 * (left - right) / np.where(bend < 0, bend, -np.inf)
    rate = np.exp(logs[best] + (logs[1] - logs[0]) * np.clip(shift, -1, 1))
    curves = np.exp(-rate[:, None] * time)
    return rate, np.sum(weights * traces * curves, axis=1) / (curves**2 @ weights)


def relaxation_of(time: FloatArray, traces: FloatArray, error: FloatArray, count: int, expected: float) -> Relaxation:
    """Fit one exponential to the relaxation of friction up to t' = `WINDOW` / `expected`.

    `expected` is the rate by eq. 4.12, or a lower bound of it. `traces` is a stack of mu - mu_2 at the times t'; the
    first time is 0. `error` is the standard error of the mean of mu - mu_2.
    """
    inside = time <= max(WINDOW / expected, time[min(8, time.size - 1)])  # the fit uses at least nine points in time
    t, y = time[inside], traces[:, inside]
    # The weight of a value is proportional to the length of the time interval around it, because values at neighbouring
    # times contain nearly the same information.
    weights = widths(t) / (error[inside] ** 2 + (FLOOR * np.abs(y[0]).max()) ** 2)
    weights /= weights.sum()
    rate, amplitude = exponential(t, y, weights)
    residuals = y - amplitude[:, None] * np.exp(-rate[:, None] * t)
    chance = min(bootstrap.chance(residuals * weight, count) for weight in (np.sqrt(weights), 1.0))
    integral = traces[:, 0] / (traces @ widths(time))
    slowest, fastest = tried_rates(t)[[1, -2]]
    outside = (rate < 1.001 * slowest) | (rate > 0.999 * fastest)
    if not chance >= DOUBTFUL:
        rates, _ = exponential(t, bootstrap.moved(y[0], residuals[0]), weights)
        rate = np.concatenate([rate, rates, integral[:1], rate[:1]])
    # a rate at an end of the range of tried rates is not an estimate
    if outside[0] or outside.mean() > bootstrap.TAILS[0]:
        rate = np.full_like(rate, np.nan)
    relative = residuals / np.abs(y[0]).max()
    holds = law_holds(relative[0], chance, 2, scatter=bootstrap.scatter(relative, count))
    return Relaxation(rate, integral, holds)


def law_rate(case: xr.Dataset) -> float:
    """Return the rate of a case by eq. 4.12; NaN if eq. 4.12 needs the Hurst exponent, and the surface has none."""
    number = _passing_number(case)
    if number < 1:
        return number
    return float(number ** (1 - one_value(case, "hurst"))) if "hurst" in case.variables else np.nan


def _passing_number(case: xr.Dataset) -> float:
    """Return v_1 tau q_max: the relaxation time divided by the time in which the body slides by 1 / q_max."""
    wavenumber = np.pi * one_value(case, "points") / one_value(case, "length")
    return one_value(case, "velocity") * one_value(case, "relaxation_time") * wavenumber


def _outputs(case: xr.Dataset) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the times t', a table with one row for each realisation, and the grid errors of the means of its columns.

    The columns are mu_1, d_mu_0, mu_2, and mu at all times except the first time, which is 0.
    """
    tables = [table_of(case, 1.0, output=name) for name in (*LEVELS, TRACE)]
    values = np.concatenate([table.values for table in tables]).T
    error = np.concatenate([table.mean_error() for table in tables])
    return np.concatenate([[0.0], case["relaxation_times"].values]), values, error


def _fit_case(case: xr.Dataset) -> Relaxation | None:
    """Fit one exponential to a case; return None for too few realisations, or if friction does not relax."""
    time, values, error = _outputs(case)
    before, jump, after = values[:, :3].T
    relaxing = np.column_stack([before + jump - after, values[:, 3:] - after[:, None]])
    whole, of_after = error[3:], error[2]
    trace_error = np.where(
        np.isinf(whole), np.inf, np.maximum(whole - np.where(np.isinf(of_after), 0.0, of_after), 0.0)
    )
    good = relaxing[np.all(np.isfinite(relaxing), axis=1)]
    rounding = CLOSE * jumps_of(case).slope[0]
    if len(good) < 2 or not np.abs(good.mean(axis=0)).max() > rounding:
        return None
    means = bootstrap.means(bootstrap.complete(relaxing))
    traces = np.concatenate([means, bootstrap.moved(means[0], np.append(error[1], trace_error))])
    expected = np.nan_to_num(law_rate(case), nan=1.0)  # above v_1 tau q_max = 1, the rate is at least 1 for any H
    return relaxation_of(time, traces, good.std(axis=0, ddof=1) / np.sqrt(len(good)), len(good), expected)


def _closed_law(case: xr.Dataset, rate: float) -> Variables:
    """Compare the friction of a case after the jump with eqs. 4.13 to 4.15."""
    time, values, error = _outputs(case)
    means = bootstrap.means(bootstrap.complete(values))
    rms_error = np.nan
    sentence = "not tested: fewer than two realisations succeeded, or their friction does not jump"
    if np.isnan(rate):
        sentence = "not tested: eq. 4.12 needs the Hurst exponent of a generated line"
    elif np.all(np.isfinite(values), axis=1).sum() >= 2 and means[0, 1] != 0:
        jumps = jumps_of(case)
        stack = np.concatenate([means, bootstrap.moved(means[0], error)])
        before, jump, after = stack[:, :3].T
        transient = np.column_stack([before + jump, stack[:, 3:]])
        slope, change = float(jumps.slope[0]), float(jumps.change[0])
        start = before + slope * change * jump_law(before / slope, LAW)
        law = after[:, None] + (start - after)[:, None] * np.exp(-rate * time)
        departures = (law - transient) / abs(jump[0])
        rms_error = rms(departures[0])
        sentence = verdict(departures, int(jumps.counts[0]), 0, lambda j: f"t' = {time[j]:.2g}, relative to the jump")
    return {
        **measure("rms_error", rms_error, "rms deviation of mu from eqs. 4.13 to 4.15 at all times, divided by d_mu_0"),
        **holds(sentence),
    }


def _relaxation(case: xr.Dataset) -> Variables:
    """Return the constants of the relaxation of a case, and compare the case with eqs. 4.13 to 4.15."""
    found, count = _fit_case(case), int(jumps_of(case).counts[0])
    nothing = np.full(1 + bootstrap.RESAMPLES, np.nan)
    rate, integral = (found.rate, found.integral_rate) if found else (nothing, nothing)
    with np.errstate(divide="ignore"):  # if a trace does not relax, its rate is zero
        duration = one_value(case, "relaxation_time") / rate
    length = one_value(case, "velocity") * (1 + one_value(case, "velocity_change")) * duration
    stacks = (rate, integral, duration, length)
    constants: Variables = {}
    for (name, (unit, meaning)), stack in zip(FIELDS.items(), stacks, strict=True):
        constants |= constant(name, stack, count, meaning, name != "integral_rate", unit)
    expected = law_rate(case)
    return {
        **measure(
            "passing_number",
            _passing_number(case),
            "v_1 tau q_max: relaxation time divided by time to slide by 1 / q_max",
        ),
        **constants,
        **measure("law_rate", expected, "rate b by eq. 4.12"),
        **_closed_law(case, expected),
        **measure(
            "fitted_law_holds",
            found.holds if found else "not tested: too few realisations, or nothing relaxes",
            "whether one exponential fits",
        ),
    }


def _rate_power(data: xr.Dataset) -> Variables:
    """Fit a power law of v_1 tau q_max to the rates, separately for v_1 tau q_max below 1 and above 1."""
    axes = [str(dim) for dim in data[LEVELS[0]].dims if dim != "realisation"]
    cells = np.ndindex(*(data.sizes[dim] for dim in axes))
    cases = [data.isel(dict(zip(axes, cell, strict=True))) for cell in cells]
    x = np.log([_passing_number(case) for case in cases])
    counts, rates = jumps_of(data).counts, _side_by_side([_fit_case(case) for case in cases])
    low, high = bootstrap.interval(rates, counts, positive=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        error = 0.25 * np.log(high / low)
    known = error < TRUSTED / 2
    rows = []
    for side, stated in ((x < 0, 1.0), (x > 0, 1 - one_value(data, "hurst"))):
        used = side & known
        count = int(counts[used].min(initial=data.sizes["realisation"]))
        rows.append(_power(x[used], rates[:, used], error[used], stated, count))
    return {
        name: xr.Variable("regime", [row[name].values.item() for row in rows], value.attrs)
        for name, value in rows[0].items()
    }


def _side_by_side(found: list[Relaxation | None]) -> FloatArray:
    """Return an array with one column for each case: the stack of the rate.

    The end of a short stack is filled up with the first value of the stack. A long stack is cut off after the number of
    rows that a stack with discretisation errors can have.
    """
    most = 1 + bootstrap.RESAMPLES + 2 * bootstrap.GROUPS
    stacks = [one.rate[:most] if one else np.full(1, np.nan) for one in found]
    columns = np.empty((max(1 + bootstrap.RESAMPLES, *(stack.size for stack in stacks)), len(stacks)))
    for k, stack in enumerate(stacks):
        columns[:, k] = stack[0]
        columns[: stack.size, k] = stack
    return columns


def _power(x: FloatArray, rates: FloatArray, error: FloatArray, stated: float, count: int) -> Variables:
    """Fit a power law to rates on one side of v_1 tau q_max = 1; `x` is ln(v_1 tau q_max).

    `rates` is a stack. `error` contains the standard errors of ln(rate). `stated` is the exponent by eq. 4.12.
    With fewer than three rates, the fitted constants are NaN.
    """
    power, factor, error_of_fit = np.full(1 + bootstrap.RESAMPLES, np.nan), np.nan, np.nan
    of_fitted = of_stated = f"not tested: {x.size} rates are known to a factor of 1.6, three are needed"
    if x.size >= 3:
        weights = 1 / (error**2 + SURE**2)
        weights /= weights.sum()
        centre = weights @ x
        design = np.stack([x - centre, np.ones(x.size)])
        solve = np.stack([weights * (x - centre) / (weights @ (x - centre) ** 2), weights], axis=1)
        logs = bootstrap.regrouped(bootstrap.logarithms(rates))
        found = fitted(lambda rows: rows @ solve, lambda rows, constants: rows - constants @ design, logs, count)
        power, factor, error_of_fit = found.constants[:, 0], np.exp(found.constants[0] @ [-centre, 1]), found.rms
        rest = logs - stated * x
        rest = rest - (rest @ weights)[:, None]
        excluded = excludes(power, count, stated)

        def where(k: int) -> str:
            return f"v_1 tau q_max = {short(np.exp(x[k]))}"

        of_fitted, of_stated = found.holds(where), verdict(rest, count, 1, where, excluded=excluded, logarithmic=True)
    return {
        **constant("power", power, count, "exponent of v_1 tau q_max in the law of the rate b"),
        **measure("power_stated", stated, "1 below v_1 tau q_max = 1, and 1 - H above it"),
        **measure("factor", float(factor), "b at v_1 tau q_max = 1 by the fitted power law"),
        **measure("rms_error", error_of_fit, "rms relative deviation from the law with the fitted power"),
        **measure("cases", x.size, "number of rates that are known well enough"),
        **holds(of_stated, of_fitted),
    }


def _fit_power(series: Series) -> xr.Dataset:
    result = each_jump(series, _axes_of_passing_number, _rate_power, TRACE).assign_coords(regime=["below", "above"])
    if result["power"].isnull().all():
        raise FitError("expected three or more rates, known to a factor of 1.6, at different v_1 tau q_max")
    return result


def _axes_of_passing_number(data: xr.Dataset) -> list[str]:
    return dimensions(data, "velocity", "relaxation_time", "points", "length")


FITS: tuple[Fit, ...] = (
    Fit(
        "relaxation",
        MODELS,
        "mu = mu_2 + mu* exp(-b t') for every case: rate b, duration, slip length; law of eqs. 4.13 to 4.15",
        lambda series: each_jump(series, lambda data: [], _relaxation, TRACE),
    ),
    Fit(
        "rate_power",
        MODELS,
        "b = factor (v_1 tau q_max)^power, below and above v_1 tau q_max = 1 (eq. 4.12)",
        _fit_power,
    ),
)
