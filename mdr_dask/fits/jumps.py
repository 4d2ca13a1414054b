"""The law of the jump of friction at a jump of the velocity, and its limits (thesis eqs. 4.8 to 4.11)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import LAW_HOLDS, Fit, fitted, law_holds
from mdr_dask.fits.kinetic_cases import LEVELS, Cases, jump_numbers, rms, rows_of

Series = Mapping[str, xr.Dataset]

LAW = 0.4  # constant of eqs. 4.10 and 4.11 in the thesis
REGION_ONE = 0.1  # mu_1 / rms slope below which eqs. 4.9 and 4.11 differ by less than 3 %
PLATEAU = 1.1  # mu_1 / rms slope from which friction is on its plateau, of 1.26 to 1.44


def _jump_law(series: Series) -> xr.Dataset:
    """Fit the constant of eq. 4.11 for every Hurst exponent and for all cases."""
    cases = Cases.of(series, *LEVELS, "rms_slope")
    numbers = jump_numbers(cases)
    before, jump = numbers["before_over_slope"], numbers["jump_over_slope"]
    known = _rising(cases, numbers) & ~np.any(before <= 0, axis=0) & ~np.any(jump <= 0, axis=0)
    if np.count_nonzero(known) < 2 or not np.any(before[0, known] > REGION_ONE):
        raise FitError(f"expected two or more cases whose friction jumps, not all with mu_1 / rms_slope < {REGION_ONE}")
    rows = rows_of(cases)
    table: dict[str, list[float | str]] = {}
    for _, chosen in rows:
        for name, value in _constant(before, jump, chosen & known, cases).items():
            table.setdefault(name, []).append(value)
    result = xr.Dataset({name: ("hurst", column, {"units": "1"}) for name, column in table.items()})
    result["deviation"].attrs["long_name"] = "rms of the relative deviations from the law with the constant fitted"
    result["law_holds"].attrs |= LAW_HOLDS
    result.attrs["law"] = f"d_mu_0 v_1 / (dv s) = [(s / mu_1)^2 + 1 / c^2]^(-1/2), s = rms_slope; thesis: c = {LAW}"
    result.attrs["window"] = "regions I to III, where friction does not fall; equal weights of the relative deviations"
    return result.assign_coords(hurst=[label for label, _ in rows])


def _constant(before: FloatArray, jump: FloatArray, used: NDArray[np.bool_], cases: Cases) -> dict[str, float | str]:
    """Return a row of the table of `_jump_law`."""
    pairs = np.log(np.stack([before[:, used], jump[:, used]], axis=1))
    count = cases.count(used)
    nothing = f"not tested: no case with mu_1 / rms_slope > {REGION_ONE}, where the law depends on its constant"
    stated = _left(pairs[:1], np.array([[LAW]]))[0, 1]
    row: dict[str, float | str] = {"constant_of_thesis": LAW, "deviation_of_thesis": rms(stated)}
    if not np.any(pairs[0, 0] > np.log(REGION_ONE)):
        ends = dict.fromkeys(("constant", "constant_low", "constant_high", "deviation"), np.nan)
        return ends | row | {"cases": pairs.shape[2], "law_holds": nothing}
    found = fitted(_constants, _left, pairs, count)
    low, high = bootstrap.interval(found.constants[:, 0], count, positive=True)
    worst = f"mu_1 / rms_slope = {np.exp(pairs[0, 0, np.argmax(np.abs(found.departures[1]))]):.2g}"
    return {
        "constant": float(found.constants[0, 0]),
        "constant_low": float(low),
        "constant_high": float(high),
        **row,
        "deviation": rms(found.departures[1]),
        "cases": pairs.shape[2],
        "law_holds": law_holds(found.departures[1], found.chance, 1, worst),
    }


def _rising(cases: Cases, numbers: Mapping[str, FloatArray]) -> NDArray[np.bool_]:
    """Return which cases lie in regions I to III, those of eqs. 4.9-4.11: friction does not fall with velocity."""
    highest = bootstrap.interval(numbers["xi"], cases.counts)[1]
    rising: NDArray[np.bool_] = np.isfinite(highest) & (highest >= 0)
    return rising


def jump_law(before: FloatArray, constant: float | FloatArray) -> FloatArray:
    """Return d_mu_0 v_1 / (dv rms_slope) over mu_1 / rms_slope (eq. 4.11)."""
    law: FloatArray = before / np.hypot(1.0, before / np.asarray(constant))
    return law


def _left(pairs: FloatArray, constant: FloatArray) -> FloatArray:
    """Return ln d_mu_0 less the law, shape (rows, 2, cases), beside zeros for ln mu_1, which no law gives."""
    left = pairs[:, 1] - np.log(jump_law(np.exp(pairs[:, 0]), constant))
    return np.stack([0 * left, left], axis=1)


def _constants(pairs: FloatArray) -> FloatArray:
    """Return the constant c that fits ln d_mu_0 best in every row of ln mu_1 and ln d_mu_0, by Gauss and Newton."""
    constant = np.full((len(pairs), 1), LAW)
    for _ in range(30):
        slope = (jump_law(np.exp(pairs[:, 0]), constant) / constant) ** 2  # d ln law / d ln c
        left = _left(pairs, constant)[:, 1]
        step = np.sum(slope * left, axis=1, keepdims=True) / np.sum(slope**2, axis=1, keepdims=True)
        constant = constant * np.exp(np.clip(step, -1, 1))
    return constant


def _jump_limits(series: Series) -> xr.Dataset:
    """Return d_mu_0 in region I over that of eq. 4.9, and on the plateau beside eq. 4.10, for every Hurst exponent."""
    cases = Cases.of(series, *LEVELS, "rms_slope")
    numbers = jump_numbers(cases)
    before = numbers["before_over_slope"][0]
    law = jump_law(before, LAW)
    limits = {
        "region I": (before < REGION_ONE, numbers["zeta"], 1.0, 1 / np.hypot(1.0, before / LAW)),
        "plateau": ((before > PLATEAU) & _rising(cases, numbers), numbers["jump_over_slope"], LAW, law),
    }
    if not any(np.any(inside) for inside, *_ in limits.values()):
        raise FitError(f"expected cases with mu_1 / rms_slope below {REGION_ONE} or above {PLATEAU}")
    rows = rows_of(cases)
    table = np.full((len(rows), len(limits), len(LIMIT_FIELDS)), np.nan)
    verdicts = np.empty(table.shape[:2], dtype=object)
    for i, (_, chosen) in enumerate(rows):
        for j, (inside, samples, limit, interpolated) in enumerate(limits.values()):
            within = inside & chosen & np.isfinite(samples[0])
            count = cases.count(within)
            table[i, j] = _limit(samples, within, limit, interpolated, count)
            verdicts[i, j] = _limit_holds(samples[:, within] / limit - 1, count)
    result = xr.Dataset(
        {
            name: (("hurst", "limit"), table[..., k], {"units": "1", "long_name": meaning})
            for k, (name, meaning) in enumerate(LIMIT_FIELDS.items())
        },
        {"hurst": [label for label, _ in rows], "limit": list(limits)},
    )
    result["law_holds"] = (("hurst", "limit"), verdicts.astype(str), LAW_HOLDS)
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
    if not np.any(inside):
        return [np.nan, np.nan, np.nan, limit, np.nan, np.nan, np.nan, 0]
    mean = samples[:, inside].mean(axis=1)
    low, high = bootstrap.interval(mean, count)
    ends = samples[0, inside].min(), samples[0, inside].max()
    return [mean[0], float(low), float(high), limit, interpolated[inside].mean(), *ends, np.count_nonzero(inside)]


def _limit_holds(departures: FloatArray, count: int) -> str:
    """Say whether a limit holds in the cases of its region, from the stack of their relative departures."""
    if not departures.shape[1]:
        return "not tested: no case in this region"
    return law_holds(departures[0], bootstrap.chance(departures, count))


_MODELS = ("velocity_jump",)
FITS: tuple[Fit, ...] = (
    Fit(
        "jump_law",
        _MODELS,
        "d_mu_0 v_1 / (dv s) = [(s / mu_1)^2 + 1 / c^2]^(-1/2) with the constant c for every H",
        _jump_law,
        apart=True,
        constants=("constant",),
    ),
    Fit(
        "jump_limits",
        _MODELS,
        "zeta in region I beside 1, and d_mu_0 v_1 / (dv s) on the plateau beside 0.4, for every H",
        _jump_limits,
        apart=True,
        constants=("found",),
    ),
)
