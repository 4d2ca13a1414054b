"""Kinetic laws of friction after a jump of the velocity (thesis 4.3): jump, relaxation, rate-and-state terms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import LAW_HOLDS, Fit, fitted, law_holds, require
from mdr_dask.fits.kinetic_cases import LEAST, LEVELS, Cases, jump_numbers, law_rate, rms
from mdr_dask.fits.relaxation import (
    AMPLITUDE_FIELDS,
    LAWS,
    RATE_FIELDS,
    SHAPE_FIELDS,
    Left,
    enough,
    relaxation_of,
    window,
)

Series = Mapping[str, xr.Dataset]

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


class Relaxations(NamedTuple):
    """The relaxation of every case: stacks of its constants, shape (rows, cases), what laws leave, windows.

    The last rows are moved by what one exponential leaves, those before by the errors of the grid.
    """

    stacks: dict[str, FloatArray]
    left: list[dict[str, Left]]
    window: FloatArray

    def measure(self, law: str, name: str) -> FloatArray:
        """Return an entry of what a law leaves of every case."""
        return np.array([getattr(left[law], name) if law in left else np.nan for left in self.left])

    def verdicts(self) -> NDArray[np.str_]:
        """Say of every case whether one exponential is enough."""
        return np.array([_says(left, "one") for left in self.left])


def _says(left: Mapping[str, Left], *laws: str) -> str:
    """Say which of some laws hold."""
    if not set(laws) <= set(left):
        return "not tested: nothing relaxes" if not left else "not tested: one exponential is enough"
    good = [law for law in laws if enough(left[law])]
    parts = [
        f"{LAWS[law]} leaves {left[law].unexplained:.2g} of the square, at most {left[law].largest:.2g} of the"
        f" relaxing part; by scatter alone with probability {left[law].probability:.2g}"
        for law in good or laws
    ]
    return f"{'yes' if good else 'no'}: {', '.join(parts)}"


def _relaxations(cases: Cases, shaped: bool = False) -> Relaxations:
    """Fit the relaxation of every case."""
    time = np.concatenate([[0.0], cases.data["relaxation_times"].values])
    expected, slope = law_rate(cases.passing, cases.column("hurst")), cases.slope
    fields = RATE_FIELDS | AMPLITUDE_FIELDS | SHAPE_FIELDS
    size = 1 + bootstrap.RESAMPLES + 4 * bootstrap.GROUPS + 2
    stacks = {name: np.full((size, expected.size), np.nan) for name in fields}
    lefts: list[dict[str, Left]] = []
    for k, (relaxing, grid) in enumerate(zip(cases.relaxing(), cases.relaxing_error(), strict=True)):
        good = relaxing[np.all(np.isfinite(relaxing), axis=1)]
        if len(good) < LEAST or not np.abs(good.mean(axis=0)).max() > INSTANT * slope[k]:
            lefts.append({})
            continue
        means = bootstrap.means(bootstrap.complete(relaxing))
        traces = np.concatenate([means, bootstrap.moved(means[0], grid)])
        error = good.std(axis=0, ddof=1) / np.sqrt(len(good))
        found, left = relaxation_of(time, traces, error, len(good), float(expected[k]), shaped)
        lefts.append(left)
        for name, values in found.items():
            stacks[name][:, k] = values[0]
            stacks[name][: len(values), k] = values
    windows = [window(time, rate) if left else np.nan for rate, left in zip(expected, lefts, strict=True)]
    return Relaxations(stacks, lefts, np.array(windows))


def _lengths(cases: Cases, rate: FloatArray) -> dict[str, FloatArray]:
    """Return samples of the characteristic time and length of rates b; infinite where nothing relaxes."""
    with np.errstate(divide="ignore"):
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
    result = xr.Dataset(cases.constants(jump_numbers(cases), JUMP_FIELDS))
    reason = "not tested: numbers of one jump; jump_law, jump_limits and jump_linearity compare laws with them"
    return result.assign(law_holds=reason)


def _relaxation(series: Series) -> xr.Dataset:
    """Return the rate, length and time of the relaxation of every case, and how good one exponential is."""
    cases = Cases.of(series, *_needed())
    found = _relaxations(cases)
    stacks = found.stacks | _lengths(cases, found.stacks["rate"])
    constants = cases.constants(stacks, RATE_FIELDS | LENGTH_FIELDS, POSITIVE)
    law = law_rate(cases.passing, cases.column("hurst"))
    first = {"passing_number": cases.found(cases.passing, "1", "v_1 tau q_max")}
    measures = {"law_rate": cases.found(law, "1", "(v_1 tau q_max)^a with a = 1 below and 1 - H above 1, eq. 4.12")}
    for name, meaning in LEFT_FIELDS.items():
        measures[name] = cases.found(found.measure("one", name), "1", f"{meaning} one exponential leaves")
    first |= {name: constants[name] for name in ("rate", "rate_low", "rate_high")}
    last = {
        "window": cases.found(found.window, "1", "last t' of the fit"),
        "law_holds": cases.found(found.verdicts(), "1", LAW_HOLDS["long_name"]),
    }
    return xr.Dataset(first | measures | constants | last, attrs={"window": WINDOW_TEXT})


LEFT_FIELDS = {
    "unexplained": "weighted share of the squared relaxing part that",
    "largest": "largest part of the relaxing part that",
    "probability": "how often scatter and errors alone leave as much as",
}


def _shape(series: Series) -> xr.Dataset:
    """Return more laws of the relaxation where one exponential is not enough; no interval of one that does not hold."""
    cases = Cases.of(series, *_needed())
    found = _relaxations(cases, shaped=True)
    if not any("two" in left for left in found.left):
        raise FitError("one exponential is enough in every case")
    result = xr.Dataset(cases.constants(found.stacks, SHAPE_FIELDS, POSITIVE))
    for law, names in SHAPES.items():
        held = np.array([law in left and enough(left[law]) for left in found.left])
        for name in (f"{name}_{end}" for name in names for end in ("low", "high")):
            result[name] = result[name].where(cases.found(held, "1", "")).assign_attrs(result[name].attrs)
    for law, meaning in LAWS.items():
        share = found.measure(law, "unexplained")
        name = "unexplained" if law == "one" else f"{law}_unexplained"
        result[name] = cases.found(share, "1", f"weighted share of the squared relaxing part that {meaning} leaves")
    verdicts = np.array([_says(left, "stretched", "two") for left in found.left])
    result["law_holds"] = cases.found(verdicts, "1", LAW_HOLDS["long_name"])
    result.attrs["window"] = WINDOW_TEXT
    return result


SHAPES = {
    "stretched": ("stretched_rate", "stretched_exponent"),
    "two": ("fast_rate", "slow_rate", "fast_share"),
}


def relaxation_curves(data: xr.Dataset) -> xr.Dataset:
    """Return the laws fitted to the only case of a series, over rms slope, over t within the window, with a band."""
    cases = Cases.of({"": data}, *_needed())
    fitted_here = _relaxations(cases, shaped=True)
    t = np.append(0.0, np.geomspace(1e-4, 1, 200)) * fitted_here.window[0]
    found = {name: values[:, 0] for name, values in fitted_here.stacks.items()}
    one = found["amplitude"][:, None] * np.exp(-found["rate"][:, None] * t) / cases.slope[0]
    alike = found["amplitude_unweighted"][0] * np.exp(-found["rate_unweighted"][0] * t) / cases.slope[0]
    low, high = bootstrap.interval(one, cases.count())
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
    require(cases.data, "relaxation_time", "length")
    along = {dim for name in ("velocity", "relaxation_time", "points", "length") for dim in cases.data[name].dims}
    rows = [dim for dim in cases.template.dims if dim not in along]
    samples = _relaxations(cases).stacks
    known = 1 + bootstrap.RESAMPLES + 2 * min(bootstrap.GROUPS, 1 + cases.data["relaxation_times"].size)
    samples = {name: samples[name][:known] for name in RATE_FIELDS}  # without what one exponential leaves
    x, place = np.log(cases.passing), cases.places(rows)
    hurst = cases.column("hurst")
    table = np.full((place.max() + 1, 2, len(POWER_FIELDS)), np.nan)
    verdicts = np.empty(table.shape[:2], dtype=object)
    for i in range(len(table)):
        for j, side in enumerate((x < 0, x > 0)):
            inside = side & (place == i)
            law, counts = (1.0, 1 - hurst[place == i][0])[j], cases.counts[inside]
            rates = {name: samples[name][:, inside] for name in RATE_FIELDS}
            table[i, j], verdicts[i, j] = _powers(x[inside], rates, law, counts)
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
    result["law_holds"] = ((*rows, "regime"), verdicts.reshape(shape).astype(str), LAW_HOLDS)
    result.attrs["law"] = "b = factor (v_1 tau q_max)^power; thesis: 1 below, 1 - H above v_1 tau q_max = 1"
    result.attrs["window"] = f"{WINDOW_TEXT}; rates whose ln is known within {TRUSTED}"
    return result


def _powers(
    x: FloatArray, rates: Mapping[str, FloatArray], law: float, counts: NDArray[np.int64]
) -> tuple[list[float], str]:
    """Return the entries of `POWER_FIELDS` for the rates of one regime, and whether the power law holds."""
    power, factor, deviation, number, verdict = _power(x, rates["rate"], counts)
    alike = _power(x, rates["rate_unweighted"], counts)[0]
    count = int(counts.min(initial=2**31 - 1))
    ends = [float(end) for samples in (power, alike) for end in bootstrap.interval(samples, count)]
    return [power[0], *ends[:2], law, factor, deviation, alike[0], *ends[2:], number], verdict


def well_known(low: FloatArray, high: FloatArray) -> NDArray[np.bool_]:
    """Return which rates are known well enough for the power law, from the ends of their intervals."""
    with np.errstate(invalid="ignore", divide="ignore"):
        known: NDArray[np.bool_] = 0.5 * np.log(high / low) < TRUSTED
    return known


def _power(x: FloatArray, rates: FloatArray, counts: NDArray[np.int64]) -> tuple[FloatArray, float, float, int, str]:
    """Return a stack of the power, factor, rms deviation, how many rates were known well, and whether the law holds."""
    low, high = bootstrap.interval(rates, counts, positive=True)
    good = well_known(low, high)
    number = int(np.count_nonzero(good))
    if number < 3 or np.ptp(x[good]) < TRUSTED:
        reason = f"not tested: {number} rates known to a factor of 1.6; three over different v_1 tau q_max are needed"
        return np.full(len(rates), np.nan), np.nan, np.nan, number, reason
    quarter = 0.25 * np.log(high[good] / low[good])
    weights = 1 / (quarter**2 + SURE**2)
    weights /= weights.sum()
    centred = x[good] - weights @ x[good]
    design = np.stack([centred, np.ones(number)])
    solve = np.stack([weights * centred / (weights @ centred**2), weights], axis=1)
    found = fitted(
        lambda logs: logs @ solve,
        lambda logs, constants: logs - constants @ design,
        bootstrap.regrouped(bootstrap.logarithms(rates[:, good])),
        int(counts[good].min()),
    )
    power, level = found.constants.T
    factor = float(np.exp(level[0] - power[0] * (weights @ x[good])))
    worst = f"v_1 tau q_max = {np.exp(x[good][np.argmax(np.abs(found.departures))]):.2g}"
    verdict = law_holds(found.departures, found.chance, 2, worst, within=SURE)
    return power, factor, rms(found.departures), number, verdict


def _rate_and_state(series: Series) -> xr.Dataset:
    """Return direct effect, evolution effect and slip length of every case."""
    cases = Cases.of(series, *_needed())
    before, jump, after = cases.levels()
    logarithm = np.log1p(cases.column("velocity_change"))
    relaxing = _relaxations(cases)
    lengths = _lengths(cases, relaxing.stacks["rate"])
    samples = {
        "direct_effect": jump / logarithm,
        "evolution_effect": (before + jump - after) / logarithm,
        "velocity_dependence": (after - before) / logarithm,
        "slip_length": lengths["relaxation_length"],
        "slip_length_times_wavenumber": lengths["length_times_wavenumber"],
    }
    result = xr.Dataset(cases.constants(samples, STATE_FIELDS, POSITIVE))
    result["law_holds"] = cases.found(relaxing.verdicts(), "1", LAW_HOLDS["long_name"])
    result.attrs["law"] = "mu = mu_1 + a ln(v_2 / v_1) - b ln(v_2 / v_1) (1 - exp(-s / D_c)), s slipped since the jump"
    result.attrs["window"] = WINDOW_TEXT
    return result


_MODELS = ("velocity_jump",)
FITS: tuple[Fit, ...] = (
    Fit(
        "kinetics",
        _MODELS,
        "jump of every case: d_mu_0 v_1 / (dv s), zeta, xi, relaxing part",
        _kinetics,
        apart=True,
        constants=tuple(JUMP_FIELDS),
    ),
    Fit(
        "relaxation",
        _MODELS,
        "mu = mu_2 + mu* exp(-b t') of every case, integral rate, length and time, whether one is enough",
        _relaxation,
        apart=True,
        constants=(*RATE_FIELDS, *LENGTH_FIELDS),
    ),
    Fit(
        "relaxation_shape",
        _MODELS,
        "exp(-(b t')^beta) and two exponentials where one is not enough",
        _shape,
        apart=True,
        constants=tuple(SHAPE_FIELDS),
    ),
    Fit(
        "rate_power",
        _MODELS,
        "b = factor (v_1 tau q_max)^a for every H, below and above v_1 tau q_max = 1",
        _rate_power,
        apart=True,
        constants=("power", "power_unweighted"),
    ),
    Fit(
        "rate_and_state",
        _MODELS,
        "a ln(v_2 / v_1) at once, - b ln(v_2 / v_1) over the slip length D_c, of every case",
        _rate_and_state,
        apart=True,
        constants=tuple(STATE_FIELDS),
    ),
)
