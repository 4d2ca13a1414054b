"""Kinetic laws of friction after a jump of the velocity (thesis 4.3): size of the jump, relaxation, rate.

`mdr_dask.fits.kinetic_cases` defines the symbols; t' = (t - t_0) / tau.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import FITTED_LAW_HOLDS, LAW_HOLDS, Fit, excludes, fitted, require, short, verdict
from mdr_dask.fits.jumps import LAW, jump_law
from mdr_dask.fits.kinetic_cases import LEAST, LEVELS, Cases, jump_numbers, law_rate
from mdr_dask.fits.relaxation import RATE_FIELDS, Relaxation, relaxation_of, window

Series = Mapping[str, xr.Dataset]

TRUSTED = 0.5  # a rate is used to fit the power law if the half width of the interval of ln(rate) is below this
SURE = 0.1  # added in quadrature to the error of ln(rate) in the weights, so that no single rate dominates the fit
INSTANT = 1e-9  # no relaxation is fitted if the relaxing part of friction is below this times the rms slope
WINDOW_TEXT = (
    "one exponential over 0 <= (t - t_0) / tau <= 8 / b_law; weights: duration of every moment over the "
    "variance of the mean trace, to which the square of a hundredth of its largest value is added for the grid"
)
JUMP_FIELDS = {
    "before_over_slope": ("1", "mu_1 / rms_slope"),
    "jump_over_slope": ("1", "d_mu_0 v_1 / (dv rms_slope)"),
    "zeta": ("1", "zeta = (d_mu_0 / mu_1) / (dv / v_1), eq. 4.8"),
    "xi": ("1", "xi = ((mu_2 - mu_1) / mu_1) / (dv / v_1), eq. 4.8"),
    "relaxing_over_slope": ("1", "relaxing part mu(t_0+) - mu_2 over rms_slope"),
    "direct_effect": ("1", "a = d_mu_0 / ln(v_2 / v_1)"),
    "evolution_effect": ("1", "b = (mu(t_0+) - mu_2) / ln(v_2 / v_1)"),
    "velocity_dependence": ("1", "a - b = (mu_2 - mu_1) / ln(v_2 / v_1): above 0 friction grows with the velocity"),
}
LENGTH_FIELDS = {
    "relaxation_duration": ("s", "tau / b"),
    "relaxation_length": ("m", "v_2 tau / b: slip length D_c of rate and state"),
    "length_times_wavenumber": ("1", "q_max v_2 tau / b: 1 if the length is that of the smallest asperities"),
}


def _kinetics(series: Series) -> xr.Dataset:
    """Return the dimensionless numbers of the jump of every case, and the effects a and b of rate and state."""
    cases = Cases.of(series, *LEVELS, "rms_slope")
    before, jump, after = cases.levels()
    logarithm = np.log1p(cases.column("velocity_change"))
    stacks = jump_numbers(cases) | {
        "direct_effect": jump / logarithm,
        "evolution_effect": (before + jump - after) / logarithm,
        "velocity_dependence": (after - before) / logarithm,
    }
    return xr.Dataset(cases.constants(stacks, JUMP_FIELDS))


def _needed() -> tuple[str, ...]:
    return (*LEVELS, "friction_coefficient", "rms_slope")


def _relaxations(cases: Cases) -> list[Relaxation | None]:
    """Fit one exponential to every case; None for cases with too few realisations or without relaxation."""
    time = cases.times
    expected, slope = law_rate(cases.passing, cases.column("hurst")), cases.slope
    found: list[Relaxation | None] = []
    for k, (relaxing, grid) in enumerate(zip(cases.relaxing(), cases.relaxing_error(), strict=True)):
        good = relaxing[np.all(np.isfinite(relaxing), axis=1)]
        if len(good) < LEAST or not np.abs(good.mean(axis=0)).max() > INSTANT * slope[k]:
            found.append(None)
            continue
        means = bootstrap.means(bootstrap.complete(relaxing))
        traces = np.concatenate([means, bootstrap.moved(means[0], grid)])
        error = good.std(axis=0, ddof=1) / np.sqrt(len(good))
        found.append(relaxation_of(time, traces, error, len(good), float(expected[k])))
    return found


def _stacked(stacks: list[FloatArray | None]) -> FloatArray:
    """Return stacks of different length as columns of one array; missing rows of a column repeat its first row."""
    rows = max((stack.size for stack in stacks if stack is not None), default=1 + bootstrap.RESAMPLES)
    columns = np.full((rows, len(stacks)), np.nan)
    for k, stack in enumerate(stacks):
        if stack is not None:
            columns[:, k] = stack[0]
            columns[: stack.size, k] = stack
    return columns


def relaxation_law(
    before: FloatArray, after: FloatArray, slope: float, change: float, rate: float, time: FloatArray
) -> FloatArray:
    """Return mu(t) after a jump by eqs. 4.13 and 4.14, shape (rows, times).

    Parameters
    ----------
    before, after : array, shape (rows,)
        mu_1 and mu_2.
    slope, change, rate : float
        Rms slope, dv / v_1, and rate b of eq. 4.12.
    time : array
        (t - t_0) / tau.
    """
    start = before + slope * change * jump_law(before / slope, LAW)
    transient: FloatArray = after[:, None] + (start - after)[:, None] * np.exp(-rate * time)
    return transient


def _closed_laws(cases: Cases) -> tuple[FloatArray, FloatArray, list[str]]:
    """Compare every transient with the closed law of eqs. 4.13 to 4.15.

    Returns
    -------
    whole, of_rate : array, shape (cases,)
        Rms difference between law and computed transient over all times, divided by d_mu_0. For `whole`, the law has
        the jump of eq. 4.11. For `of_rate`, it has the computed jump, so that only the rate of eq. 4.12 is tested.
    sentences : list of str
        For each case, whether the law holds.
    """
    rate, slope, change = law_rate(cases.passing, cases.column("hurst")), cases.slope, cases.column("velocity_change")
    outputs = [*LEVELS, "friction_coefficient"]
    values = np.concatenate([np.atleast_3d(cases.output(name)) for name in outputs], axis=2)
    errors = np.concatenate([cases.error(name).reshape(len(values), -1) for name in outputs], axis=1)
    whole, of_rate, sentences = np.full(len(values), np.nan), np.full(len(values), np.nan), []
    for k, (case, error) in enumerate(zip(values, errors, strict=True)):
        means = bootstrap.means(bootstrap.complete(case))
        if np.all(np.isfinite(case), axis=1).sum() < LEAST or means[0, 1] == 0:
            sentences.append("not tested: fewer than two realisations succeeded, or their friction does not jump")
            continue
        stack = np.concatenate([means, bootstrap.moved(means[0], error)])
        before, jump, after = stack[:, :3].T
        transient = np.column_stack([before + jump, stack[:, 3:]])
        law = relaxation_law(before, after, float(slope[k]), float(change[k]), float(rate[k]), cases.times)
        decay = after[:, None] + (before + jump - after)[:, None] * np.exp(-rate[k] * cases.times)
        departures = (law - transient) / abs(jump[0])
        whole[k] = np.sqrt(np.mean(departures[0] ** 2))
        of_rate[k] = np.sqrt(np.mean((decay - transient)[0] ** 2)) / abs(jump[0])
        count = int(cases.counts[k])
        sentences.append(verdict(departures, count, 0, lambda j: f"t' = {cases.times[j]:.2g}, relative to the jump"))
    return whole, of_rate, sentences


def _relaxation(series: Series) -> xr.Dataset:
    """Return rate, time and length of the relaxation of every case, and compare with the law of eqs. 4.13 to 4.15."""
    cases = Cases.of(series, *_needed())
    found = _relaxations(cases)
    stacks = {
        "rate": _stacked([each and each.rate for each in found]),
        "integral_rate": _stacked([each and each.integral_rate for each in found]),
    }
    with np.errstate(divide="ignore"):  # the rate of a trace that does not relax is zero
        duration = cases.column("relaxation_time") / stacks["rate"]
    length = cases.column("velocity") * (1 + cases.column("velocity_change")) * duration
    lengths = [duration, length, length * cases.wavenumber]
    stacks |= dict(zip(LENGTH_FIELDS, lengths, strict=True))
    constants = cases.constants(stacks, RATE_FIELDS | LENGTH_FIELDS, ("rate", *LENGTH_FIELDS))
    expected = law_rate(cases.passing, cases.column("hurst"))
    windows = [window(cases.times, rate) if each else np.nan for rate, each in zip(expected, found, strict=True)]
    whole, of_rate, stated = _closed_laws(cases)
    one = [each.holds if each else "not tested: nothing relaxes" for each in found]
    return xr.Dataset(
        {
            "passing_number": cases.found(cases.passing, "1", "v_1 tau q_max"),
            **constants,
            "law_rate": cases.found(expected, "1", "(v_1 tau q_max)^a with a = 1 below and 1 - H above 1, eq. 4.12"),
            "window": cases.found(np.array(windows), "1", "last t' of the fit"),
            "rms_error": cases.found(whole, "1", "rms over the times of transient less closed law, over d_mu_0"),
            "rms_error_of_rate": cases.found(of_rate, "1", "the same with the computed jump: error of the rate alone"),
            "fitted_law_holds": cases.found(np.array(one), "1", "whether one exponential fits"),
            "law_holds": cases.found(np.array(stated), "1", LAW_HOLDS["long_name"]),
        },
        attrs={
            "law": "mu = mu_2 + (mu_1 + d_mu_0 - mu_2) exp(-b t'), d_mu_0 of eq. 4.11 with 0.4, b of eq. 4.12",
            "window": WINDOW_TEXT,
        },
    )


def relaxation_curves(data: xr.Dataset) -> xr.Dataset:
    """Return the exponential fitted to the only case of a series, with its band: mu / rms slope against t'."""
    cases = Cases.of({"": data}, *_needed())
    (found,) = _relaxations(cases)
    if found is None:
        raise FitError("expected a case that relaxes, got one without relaxation or with too few realisations")
    expected = float(law_rate(cases.passing, cases.column("hurst"))[0])
    t = np.append(0.0, np.geomspace(1e-4, 1, 200)) * window(cases.times, expected)
    rows = found.amplitude.size
    one = found.amplitude[:, None] * np.exp(-found.rate[:rows, None] * t) / cases.slope[0]
    low, high = bootstrap.interval(one, cases.count())
    curves = {"one": ("t", one[0]), "one_low": ("t", low), "one_high": ("t", high)}
    return _relaxation({"": data}).squeeze().assign(curves).assign_coords(t=t)


def well_known(low: FloatArray, high: FloatArray) -> NDArray[np.bool_]:
    """Return which rates have an interval narrow enough for the power law."""
    with np.errstate(invalid="ignore", divide="ignore"):
        known: NDArray[np.bool_] = 0.5 * np.log(high / low) < TRUSTED
    return known


POWER_FIELDS = {
    "power": "power a of b against v_1 tau q_max",
    "power_low": "lower end of its 95 % interval",
    "power_high": "upper end of its 95 % interval",
    "law_power": "1 below and 1 - H above v_1 tau q_max = 1",
    "factor": "b at v_1 tau q_max = 1 by the power law",
    "deviation": "rms relative departure from the law with the fitted power",
    "cases": "rates known well enough",
}


def _rate_power(series: Series) -> xr.Dataset:
    """Fit rate ~ (v_1 tau q_max)^power below and above v_1 tau q_max = 1, for every value of the other axes."""
    cases = Cases.of(series, *_needed())
    require(cases.data, "relaxation_time", "length")
    along = {dim for name in ("velocity", "relaxation_time", "points", "length") for dim in cases.data[name].dims}
    outer = [dim for dim in cases.template.dims if dim not in along]
    rates = _stacked(
        [each and each.rate[: 1 + bootstrap.RESAMPLES + 2 * bootstrap.GROUPS] for each in _relaxations(cases)]
    )
    low, high = bootstrap.interval(rates, cases.counts, positive=True)
    good = well_known(low, high)
    x, place, hurst = np.log(cases.passing), cases.places(outer), cases.column("hurst")
    table = np.full((place.max() + 1, 2, len(POWER_FIELDS)), np.nan)
    sentences = np.empty((2, *table.shape[:2]), dtype=object)
    for i in range(len(table)):
        for j, side in enumerate((x < 0, x > 0)):
            used = side & (place == i) & good
            law = (1.0, 1 - hurst[place == i][0])[j]
            quarter = 0.25 * np.log(high[used] / low[used])
            table[i, j], sentences[:, i, j] = _power(x[used], rates[:, used], quarter, law, cases.count(used))
    if np.all(np.isnan(table[..., 0])):
        raise FitError("expected three or more rates, known to a factor of 1.6, at different v_1 tau q_max")
    shape = *(cases.template.sizes[dim] for dim in outer), 2
    result = xr.Dataset(
        {
            name: ((*outer, "regime"), table[..., k].reshape(shape), {"units": "1", "long_name": meaning})
            for k, (name, meaning) in enumerate(POWER_FIELDS.items())
        },
        {dim: cases.template[dim] for dim in outer} | {"regime": ["below", "above"]},
    )
    for name, words, about in zip(
        ("fitted_law_holds", "law_holds"), sentences, (FITTED_LAW_HOLDS, LAW_HOLDS), strict=True
    ):
        result[name] = ((*outer, "regime"), words.reshape(shape).astype(str), about)
    result.attrs["law"] = "b = factor (v_1 tau q_max)^power; thesis: 1 below, 1 - H above v_1 tau q_max = 1"
    result.attrs["window"] = f"{WINDOW_TEXT}; rates whose logarithm is known within {TRUSTED}"
    return result


def _power(
    x: FloatArray, rates: FloatArray, error: FloatArray, law: float, count: int
) -> tuple[list[float], tuple[str, str]]:
    """Return the entries of `POWER_FIELDS` for one regime, and the sentences on the fitted and on the stated law."""
    if x.size < 3:
        reason = f"not tested: {x.size} rates are known to a factor of 1.6, three are needed"
        return [np.nan, np.nan, np.nan, law, np.nan, np.nan, x.size], (reason, reason)
    weights = 1 / (error**2 + SURE**2)
    weights /= weights.sum()
    centre = weights @ x
    design = np.stack([x - centre, np.ones(x.size)])
    solve = np.stack([weights * (x - centre) / (weights @ (x - centre) ** 2), weights], axis=1)
    logs = bootstrap.regrouped(bootstrap.logarithms(rates))
    found = fitted(lambda rows: rows @ solve, lambda rows, constants: rows - constants @ design, logs, count)
    power, level = found.constants.T
    rest = logs - law * x
    low, high = bootstrap.interval(power, count)
    numbers = [power[0], low, high, law, np.exp(level[0] - power[0] * centre), found.rms, x.size]

    def where(k: int) -> str:
        return f"v_1 tau q_max = {short(np.exp(x[k]))}"

    stated = verdict(rest - (rest @ weights)[:, None], count, 1, where, excluded=excludes(power, count, law))
    return [float(number) for number in numbers], (found.holds(where), stated)


_MODELS = ("velocity_jump",)
FITS: tuple[Fit, ...] = (
    Fit(
        "kinetics",
        _MODELS,
        "jump of every case: d_mu_0 v_1 / (dv s), zeta, xi, relaxing part, and a and b of rate and state",
        _kinetics,
        apart=True,
        constants=tuple(JUMP_FIELDS),
    ),
    Fit(
        "relaxation",
        _MODELS,
        "mu = mu_2 + mu* exp(-b t') of every case: rate b, time, slip length; closed law of eqs. 4.13 to 4.15",
        _relaxation,
        apart=True,
        constants=(*RATE_FIELDS, *LENGTH_FIELDS),
    ),
    Fit(
        "rate_power",
        _MODELS,
        "b = factor (v_1 tau q_max)^a for every H, below and above v_1 tau q_max = 1 (eq. 4.12)",
        _rate_power,
        apart=True,
        constants=("power",),
    ),
)
