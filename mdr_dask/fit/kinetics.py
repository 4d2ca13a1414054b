"""Kinetic laws of friction after a jump of the velocity (thesis 4.3): jump, relaxation, rate-and-state terms."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fit.base import Fit
from mdr_dask.fit.kinetic_cases import LEVELS, Cases, law_rate
from mdr_dask.fit.relaxation import (
    AMPLITUDE_FIELDS,
    GOODNESS_FIELDS,
    RATE_FIELDS,
    SHAPE_FIELDS,
    one_is_enough,
    relaxation_of,
)

Series = Mapping[str, xr.Dataset]

LAW = 0.4  # constant of eqs. 4.10 and 4.11 in the thesis
REGION_ONE = 0.1  # mu_1 / rms slope below which eqs. 4.9 and 4.11 differ by less than 3 %
PLATEAU = 1.1  # mu_1 / rms slope from which friction is on its plateau, of 1.26 to 1.44
TRUSTED = 0.5  # half-width of the interval of ln b beyond which a rate is left out of the power law
SURE = 0.1  # deviation of ln b below which a rate counts no more: no power law is meant to hold better
INSTANT = 1e-9  # relaxing part over rms slope below which there is no relaxation to fit
WINDOW_TEXT = (
    "one exponential over 0 <= (t - t_0) / tau <= 8 / b_law; weights of every stretch of time: 1 / variance of the "
    "mean trace, with a hundredth of its largest value for the grid"
)
JUMP_FIELDS = {
    "before_over_slope": ("1", "mu_1 / rms_slope"),
    "jump_over_slope": ("1", "d_mu_0 v_1 / (dv rms_slope)"),
    "zeta": ("1", "zeta = (d_mu_0 / mu_1) / (dv / v_1), eq. 4.8"),
    "xi": ("1", "xi = ((mu_2 - mu_1) / mu_1) / (dv / v_1), eq. 4.8"),
    "relaxing_over_slope": ("1", "relaxing part mu(t_0+) - mu_2 over rms_slope"),
}
LENGTH_FIELDS = {
    "relaxation_duration": ("s", "tau / b"),
    "relaxation_length": ("m", "v_2 tau / b"),
    "length_times_wavenumber": ("1", "q_max v_2 tau / b"),
}
STATE_FIELDS = {
    "direct_effect": ("1", "a = d_mu_0 / ln(v_2 / v_1)"),
    "evolution_effect": ("1", "b = (mu(t_0+) - mu_2) / ln(v_2 / v_1)"),
    "velocity_dependence": ("1", "a - b = (mu_2 - mu_1) / ln(v_2 / v_1): above 0 friction grows with the velocity"),
    "slip_length": ("m", "D_c = v_2 tau / rate, slip in which a fraction 1 / e of the evolution is left"),
    "slip_length_times_wavenumber": ("1", "D_c q_max: 1 where the slip length is that of the smallest asperities"),
}
LEFT = ("rate", "rate_unweighted", *LENGTH_FIELDS, "stretched_rate", "fast_rate", "slow_rate", "slip_length")
POSITIVE = (*LEFT, "slip_length_times_wavenumber")


def _numbers(cases: Cases) -> dict[str, FloatArray]:
    """Return samples of what follows from mu_1, d_mu_0 and mu_2."""
    before, jump, after = cases.levels()
    change, slope = cases.column("velocity_change"), cases.slope
    return {
        "before_over_slope": before / slope,
        "jump_over_slope": jump / change / slope,
        "zeta": jump / before / change,
        "xi": (after / before - 1) / change,
        "relaxing_over_slope": (before + jump - after) / slope,
    }


def _relaxations(cases: Cases, shaped: bool = False) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Fit the relaxation of every case: samples of its constants, and goodness of fit."""
    time = np.concatenate([[0.0], cases.data["relaxation_times"].values])
    expected, slope = law_rate(cases.passing, cases.column("hurst")), cases.slope
    size = expected.size
    fields = RATE_FIELDS | AMPLITUDE_FIELDS | SHAPE_FIELDS
    samples = {name: np.full((1 + bootstrap.RESAMPLES, size), np.nan) for name in fields}
    goodness = {name: np.full(size, np.nan) for name in GOODNESS_FIELDS}
    for k, relaxing in enumerate(cases.relaxing()):
        traces = bootstrap.means(bootstrap.complete(relaxing))
        good = relaxing[np.all(np.isfinite(relaxing), axis=1)]
        if not np.nanmax(np.abs(traces[0]), initial=0.0) > INSTANT * slope[k]:
            continue
        error = good.std(axis=0, ddof=1) / np.sqrt(len(good))
        found, measures = relaxation_of(time, traces, error, float(expected[k]), shaped)
        for name, values in found.items():
            samples[name][: len(values), k] = values
        for name, value in measures.items():
            goodness[name][k] = value
    return samples, goodness


def _lengths(cases: Cases, rate: FloatArray) -> dict[str, FloatArray]:
    """Return samples of the characteristic time and length of rates b."""
    duration = cases.column("relaxation_time") / rate
    length = cases.column("velocity") * (1 + cases.column("velocity_change")) * duration
    return {
        "relaxation_duration": duration,
        "relaxation_length": length,
        "length_times_wavenumber": length * cases.wavenumber,
    }


def _needed() -> tuple[str, ...]:
    return (*LEVELS, "friction_coefficient", "rms_slope")


def _kinetics(series: Series) -> xr.Dataset:
    """Return the jump of every case."""
    cases = Cases.of(series, *LEVELS, "rms_slope")
    return xr.Dataset(cases.constants(_numbers(cases), JUMP_FIELDS))


def _relaxation(series: Series) -> xr.Dataset:
    """Return the rate, length and time of the relaxation of every case, and how good one exponential is."""
    cases = Cases.of(series, *_needed())
    samples, goodness = _relaxations(cases)
    samples |= _lengths(cases, samples["rate"])
    constants = cases.constants(samples, RATE_FIELDS | LENGTH_FIELDS, POSITIVE)
    law = law_rate(cases.passing, cases.column("hurst"))
    left, probability = goodness["unexplained"], goodness["probability"]
    enough = np.where(one_is_enough(left, probability), "yes", np.where(np.isnan(left), "nothing relaxes", "no"))
    first = {"passing_number": cases.found(cases.passing, "1", "v_1 tau q_max")}
    measures = {
        "law_rate": cases.found(law, "1", "(v_1 tau q_max)^a with a = 1 below and 1 - H above 1, eq. 4.12"),
        "one_is_enough": cases.found(enough, "1", "whether one exponential is enough"),
    }
    measures |= {name: cases.found(goodness[name], *GOODNESS_FIELDS[name]) for name in ("unexplained", "probability")}
    first |= {name: constants[name] for name in ("rate", "rate_low", "rate_high")}
    window = {"window": cases.found(goodness["window"], *GOODNESS_FIELDS["window"])}
    return xr.Dataset(first | measures | constants | window, attrs={"window": WINDOW_TEXT})


def _shape(series: Series) -> xr.Dataset:
    """Return a stretched exponential and two exponentials where one is not enough."""
    cases = Cases.of(series, *_needed())
    samples, goodness = _relaxations(cases, shaped=True)
    if np.all(np.isnan(goodness["two_unexplained"])):
        raise FitError("one exponential is enough in every case")
    result = xr.Dataset(cases.constants(samples, SHAPE_FIELDS, POSITIVE))
    for name in ("unexplained", "stretched_unexplained", "two_unexplained"):
        result[name] = cases.found(goodness[name], *GOODNESS_FIELDS[name])
    result.attrs["window"] = WINDOW_TEXT
    return result


def relaxation_curves(data: xr.Dataset) -> xr.Dataset:
    """Return the laws fitted to the only case of a series, over rms slope, over t within the window, with a band."""
    cases = Cases.of({"": data}, *_needed())
    samples, goodness = _relaxations(cases, shaped=True)
    t = np.append(0.0, np.geomspace(1e-4, 1, 200)) * goodness["window"][0]
    found = {name: values[:, 0] for name, values in samples.items()}
    one = found["amplitude"][:, None] * np.exp(-found["rate"][:, None] * t) / cases.slope[0]
    alike = found["amplitude_unweighted"][0] * np.exp(-found["rate_unweighted"][0] * t) / cases.slope[0]
    low, high = bootstrap.interval(one, cases.count)
    curves = {"one": one[0], "one_low": low, "one_high": high, "alike": alike}
    if np.isfinite(found["two_amplitude"][0]):
        share, total = found["fast_share"][0], found["two_amplitude"][0] / cases.slope[0]
        slow, fast = np.exp(-found["slow_rate"][0] * t), np.exp(-found["fast_rate"][0] * t)
        curves["two"] = total * ((1 - share) * slow + share * fast)
    return (
        _relaxation({"": data})
        .squeeze()
        .assign({name: ("t", curve) for name, curve in curves.items()})
        .assign_coords(t=t)
    )


def _rows_of(hurst: FloatArray) -> list[tuple[str, NDArray[np.bool_]]]:
    """Return a label and the cases of every Hurst exponent, and of all."""
    rows = [(f"{value:.4g}", hurst == value) for value in np.unique(hurst)]
    return [*rows, ("all", np.ones(hurst.size, dtype=bool))] if len(rows) > 1 else rows


def _jump_law(series: Series) -> xr.Dataset:
    """Fit the constant of eq. 4.11 for every Hurst exponent and for all cases."""
    cases = Cases.of(series, *LEVELS, "rms_slope")
    numbers = _numbers(cases)
    before, jump = numbers["before_over_slope"], numbers["jump_over_slope"]
    known = _rising(cases, numbers) & np.all(before > 0, axis=0) & np.all(jump > 0, axis=0)
    if np.count_nonzero(known) < 2 or not np.any(before[0, known] > REGION_ONE):
        raise FitError(f"expected two or more cases whose friction jumps, not all with mu_1 / rms_slope < {REGION_ONE}")
    rows = _rows_of(cases.column("hurst"))
    table: dict[str, list[float]] = {}
    for _, chosen in rows:
        x, y = before[:, chosen & known], jump[:, chosen & known]
        samples = _constants(x, y)
        low, high = bootstrap.interval(samples, cases.count, positive=True)
        deviation, of_thesis = (_deviation(x[0], y[0], c) for c in (samples[0], LAW))
        names = ("constant", "constant_low", "constant_high", "constant_of_thesis", "deviation", "deviation_of_thesis")
        for name, value in zip(names, (samples[0], low, high, LAW, deviation, of_thesis), strict=True):
            table.setdefault(name, []).append(float(value))
        table.setdefault("cases", []).append(x.shape[1])
    result = xr.Dataset({name: ("hurst", column, {"units": "1"}) for name, column in table.items()})
    result["deviation"].attrs["long_name"] = "rms of the relative deviations from the law with the constant fitted"
    result.attrs["law"] = f"d_mu_0 v_1 / (dv s) = [(s / mu_1)^2 + 1 / c^2]^(-1/2), s = rms_slope; thesis: c = {LAW}"
    result.attrs["window"] = "regions I to III, where friction does not fall; equal weights of the relative deviations"
    return result.assign_coords(hurst=[label for label, _ in rows])


def _rising(cases: Cases, numbers: Mapping[str, FloatArray]) -> NDArray[np.bool_]:
    """Return which cases lie in regions I to III, those of eqs. 4.9-4.11: friction does not fall with velocity."""
    highest = bootstrap.interval(numbers["xi"], cases.count)[1]
    rising: NDArray[np.bool_] = np.isfinite(highest) & (highest >= 0)
    return rising


def jump_law(before: FloatArray, constant: float | FloatArray) -> FloatArray:
    """Return d_mu_0 v_1 / (dv rms_slope) over mu_1 / rms_slope (eq. 4.11)."""
    law: FloatArray = (before**-2.0 + np.asarray(constant) ** -2.0) ** -0.5
    return law


def _deviation(before: FloatArray, jump: FloatArray, constant: float) -> float:
    return float(np.sqrt(np.mean(np.log(jump_law(before, constant) / jump) ** 2))) if before.size else np.nan


def _constants(before: FloatArray, jump: FloatArray) -> FloatArray:
    """Return samples of the constant c that fits log d_mu_0 best, by Gauss and Newton's steps in ln c.

    In region I the law does not depend on it: NaN where all cases lie there.
    """
    if not np.any(before[0] > REGION_ONE):
        return np.full(len(before), np.nan)
    constant = np.full((len(before), 1), LAW)
    for _ in range(30):
        law = jump_law(before, constant)
        slope = (law / constant) ** 2  # d ln law / d ln c
        step = np.sum(slope * np.log(jump / law), axis=1, keepdims=True) / np.sum(slope**2, axis=1, keepdims=True)
        constant = constant * np.exp(np.clip(step, -1, 1))
    return constant[:, 0]


def _jump_limits(series: Series) -> xr.Dataset:
    """Return d_mu_0 in region I over that of eq. 4.9, and on the plateau beside eq. 4.10, for every Hurst exponent."""
    cases = Cases.of(series, *LEVELS, "rms_slope")
    numbers = _numbers(cases)
    before = numbers["before_over_slope"][0]
    law = jump_law(before, LAW)
    limits = {
        "region I": (before < REGION_ONE, numbers["zeta"], 1.0, law / before),
        "plateau": ((before > PLATEAU) & _rising(cases, numbers), numbers["jump_over_slope"], LAW, law),
    }
    if not any(np.any(inside) for inside, *_ in limits.values()):
        raise FitError(f"expected cases with mu_1 / rms_slope below {REGION_ONE} or above {PLATEAU}")
    rows = _rows_of(cases.column("hurst"))
    table = np.full((len(rows), len(limits), len(LIMIT_FIELDS)), np.nan)
    for i, (_, chosen) in enumerate(rows):
        for j, (inside, samples, limit, interpolated) in enumerate(limits.values()):
            table[i, j] = _limit(samples, inside & chosen, limit, interpolated, cases.count)
    result = xr.Dataset(
        {
            name: (("hurst", "limit"), table[..., k], {"units": "1", "long_name": meaning})
            for k, (name, meaning) in enumerate(LIMIT_FIELDS.items())
        },
        {"hurst": [label for label, _ in rows], "limit": list(limits)},
    )
    result.attrs["law"] = f"eq. 4.9: zeta = 1 in region I; eq. 4.10: d_mu_0 v_1 / (dv rms_slope) = {LAW} on the plateau"
    result.attrs["window"] = f"region I: mu_1 / rms_slope < {REGION_ONE}; plateau: > {PLATEAU}, and not falling"
    return result


LIMIT_FIELDS = {
    "found": "mean over the cases: of zeta in region I, of d_mu_0 v_1 / (dv rms_slope) on the plateau",
    "found_low": "lower end of its 95 % interval",
    "found_high": "upper end of its 95 % interval",
    "limit_of_law": "1 of eq. 4.9, 0.4 of eq. 4.10",
    "interpolated": "mean of eq. 4.11 over the same cases",
    "smallest": "of the cases",
    "greatest": "of the cases",
    "cases": "how many",
}


def _limit(
    samples: FloatArray, inside: NDArray[np.bool_], limit: float, interpolated: FloatArray, count: int
) -> list[float]:
    """Return the entries of `LIMIT_FIELDS` for the cases inside a region."""
    inside = inside & np.isfinite(samples[0])
    if not np.any(inside):
        return [np.nan, np.nan, np.nan, limit, np.nan, np.nan, np.nan, 0]
    mean = samples[:, inside].mean(axis=1)
    low, high = bootstrap.interval(mean, count)
    ends = samples[0, inside].min(), samples[0, inside].max()
    return [mean[0], float(low), float(high), limit, interpolated[inside].mean(), *ends, np.count_nonzero(inside)]


POWER_FIELDS = {
    "power": "power a of b over v_1 tau q_max",
    "power_low": "lower end of its 95 % interval",
    "power_high": "upper end of its 95 % interval",
    "law_power": "1 below and 1 - H above v_1 tau q_max = 1",
    "factor": "b at v_1 tau q_max = 1, by the power law",
    "deviation": "rms of the relative deviations from the power law",
    "power_unweighted": "power of the rates fitted with every stretch of time alike",
    "power_unweighted_low": "lower end of its 95 % interval",
    "power_unweighted_high": "upper end of its 95 % interval",
    "cases": "rates known well enough",
}


def _rate_power(series: Series) -> xr.Dataset:
    """Fit the power of the rate over v_1 tau q_max below and above 1, for every value of the other axes."""
    cases = Cases.of(series, *_needed())
    along = {dim for name in ("velocity", "relaxation_time", "points", "length") for dim in cases.data[name].dims}
    rows = [dim for dim in cases.template.dims if dim not in along]
    samples, _ = _relaxations(cases)
    x, place = np.log(cases.passing), cases.places(rows)
    hurst = cases.column("hurst")
    table = np.full((place.max() + 1, 2, len(POWER_FIELDS)), np.nan)
    for i in range(len(table)):
        for j, side in enumerate((x < 0, x > 0)):
            inside = side & (place == i)
            law = (1.0, 1 - hurst[place == i][0])[j]
            table[i, j] = _powers(x[inside], {name: samples[name][:, inside] for name in RATE_FIELDS}, law, cases.count)
    if np.all(np.isnan(table[..., 0])):
        raise FitError("expected three or more rates, known to a factor of 1.6, over different v_1 tau q_max")
    shape = *(cases.template.sizes[dim] for dim in rows), 2
    result = xr.Dataset(
        {
            name: ((*rows, "regime"), table[..., k].reshape(shape), {"units": "1", "long_name": meaning})
            for k, (name, meaning) in enumerate(POWER_FIELDS.items())
        },
        {dim: cases.template[dim] for dim in rows} | {"regime": ["below", "above"]},
    )
    result.attrs["law"] = "b = factor (v_1 tau q_max)^power; thesis: 1 below, 1 - H above v_1 tau q_max = 1"
    result.attrs["window"] = f"{WINDOW_TEXT}; rates whose ln is known within {TRUSTED}"
    return result


def _powers(x: FloatArray, rates: Mapping[str, FloatArray], law: float, count: int) -> list[float]:
    """Return the entries of `POWER_FIELDS` for the rates of one regime."""
    power, factor, deviation, number = _power(x, rates["rate"], count)
    alike = _power(x, rates["rate_unweighted"], count)[0]
    ends = [float(end) for samples in (power, alike) for end in bootstrap.interval(samples, count)]
    return [power[0], *ends[:2], law, factor, deviation, alike[0], *ends[2:], number]


def well_known(low: FloatArray, high: FloatArray) -> NDArray[np.bool_]:
    """Return which rates are known well enough for the power law, from the ends of their intervals."""
    with np.errstate(invalid="ignore", divide="ignore"):
        known: NDArray[np.bool_] = 0.5 * np.log(high / low) < TRUSTED
    return known


def _power(x: FloatArray, rates: FloatArray, count: int) -> tuple[FloatArray, float, float, int]:
    """Return samples of the power, the factor, the rms deviation, and how many rates were known well enough."""
    low, high = bootstrap.interval(rates, count, positive=True)
    good = well_known(low, high)
    number = int(np.count_nonzero(good))
    if number < 3 or np.ptp(x[good]) < TRUSTED:
        return np.full(len(rates), np.nan), np.nan, np.nan, number
    quarter = 0.25 * np.log(high[good] / low[good])
    y, weights = np.log(rates[:, good]), 1 / (quarter**2 + SURE**2)
    weights /= weights.sum()
    centred = x[good] - weights @ x[good]
    power = y @ (weights * centred) / (weights @ centred**2)
    level = float(y[0] @ weights)
    off = y[0] - level - power[0] * centred
    factor = float(np.exp(level - power[0] * (weights @ x[good])))
    return power, factor, float(np.sqrt(np.mean(off**2))), number


def _rate_and_state(series: Series) -> xr.Dataset:
    """Return direct effect, evolution effect and slip length of every case."""
    cases = Cases.of(series, *_needed())
    before, jump, after = cases.levels()
    logarithm = np.log1p(cases.column("velocity_change"))
    lengths = _lengths(cases, _relaxations(cases)[0]["rate"])
    samples = {
        "direct_effect": jump / logarithm,
        "evolution_effect": (before + jump - after) / logarithm,
        "velocity_dependence": (after - before) / logarithm,
        "slip_length": lengths["relaxation_length"],
        "slip_length_times_wavenumber": lengths["length_times_wavenumber"],
    }
    result = xr.Dataset(cases.constants(samples, STATE_FIELDS, POSITIVE))
    result.attrs["law"] = "mu = mu_1 + a ln(v_2 / v_1) - b ln(v_2 / v_1) (1 - exp(-s / D_c)), s slipped since the jump"
    result.attrs["window"] = WINDOW_TEXT
    return result


_MODELS = ("velocity_jump",)
FITS: tuple[Fit, ...] = (
    Fit("kinetics", _MODELS, "jump of every case: d_mu_0 v_1 / (dv s), zeta, xi, relaxing part", _kinetics, apart=True),
    Fit(
        "relaxation",
        _MODELS,
        "mu = mu_2 + mu* exp(-b t') of every case, integral rate, length and time, whether one is enough",
        _relaxation,
        apart=True,
    ),
    Fit(
        "relaxation_shape",
        _MODELS,
        "exp(-(b t')^beta) and two exponentials where one is not enough",
        _shape,
        apart=True,
    ),
    Fit(
        "jump_law",
        _MODELS,
        "d_mu_0 v_1 / (dv s) = [(s / mu_1)^2 + 1 / c^2]^(-1/2) with the constant c for every H",
        _jump_law,
        apart=True,
    ),
    Fit(
        "jump_limits",
        _MODELS,
        "zeta in region I beside 1, and d_mu_0 v_1 / (dv s) on the plateau beside 0.4, for every H",
        _jump_limits,
        apart=True,
    ),
    Fit(
        "rate_power",
        _MODELS,
        "b = factor (v_1 tau q_max)^a for every H, below and above v_1 tau q_max = 1",
        _rate_power,
        apart=True,
    ),
    Fit(
        "rate_and_state",
        _MODELS,
        "a ln(v_2 / v_1) at once, - b ln(v_2 / v_1) over the slip length D_c, of every case",
        _rate_and_state,
        apart=True,
    ),
)
