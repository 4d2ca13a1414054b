"""The jump of friction at a jump of the velocity: its law, its limits, and its linearity (thesis eqs. 4.8 to 4.11).

`mdr_dask.fits.kinetic_cases` defines the symbols.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import FITTED_LAW_HOLDS, LAW_HOLDS, Fit, excludes, fitted, verdict
from mdr_dask.fits.kinetic_cases import LEVELS, Cases, jump_numbers, rows_of

Series = Mapping[str, xr.Dataset]

LAW = 0.4  # constant of eqs. 4.10 and 4.11 in the thesis
REGION_ONE = 0.1  # mu_1 / rms slope up to which eqs. 4.9 and 4.11 differ by less than 3 %
PLATEAU = 1.1  # mu_1 / rms slope above which friction counts as on its plateau; the plateau is at 1.26 to 1.44

JUMP_FIELDS = {
    "constant": "constant c of eq. 4.11",
    "constant_of_thesis": "0.4",
    "deviation": "rms relative departure from the law with the fitted constant",
    "deviation_of_thesis": "rms relative departure from the law with 0.4",
    "cases": "cases in regions I to III",
    "zeta": "mean zeta of the cases in region I; 1 by eq. 4.9",
    "zeta_holds": "whether zeta = 1 in region I (eq. 4.9)",
    "plateau_jump": "mean d_mu_0 v_1 / (dv rms_slope) of the cases on the plateau; 0.4 by eq. 4.10",
    "plateau_holds": "whether it is 0.4 on the plateau (eq. 4.10)",
    "fitted_law_holds": FITTED_LAW_HOLDS["long_name"],
    "law_holds": LAW_HOLDS["long_name"],
}


def jump_law(before: FloatArray, constant: float | FloatArray) -> FloatArray:
    """Return d_mu_0 v_1 / (dv rms_slope) from mu_1 / rms_slope (eq. 4.11)."""
    law: FloatArray = before / np.hypot(1.0, before / np.asarray(constant))
    return law


def _jump_law(series: Series) -> xr.Dataset:
    """Fit the constant of eq. 4.11 for every Hurst exponent and for all cases, and test the limits 4.9 and 4.10."""
    cases = Cases.of(series, *LEVELS, "rms_slope")
    numbers = jump_numbers(cases)
    before, jump, zeta = numbers["before_over_slope"], numbers["jump_over_slope"], numbers["zeta"]
    highest = bootstrap.interval(numbers["xi"], cases.counts)[1]
    rising = np.isfinite(highest) & (highest >= 0)  # regions I to III: friction does not fall with the velocity
    known = rising & ~np.any(before <= 0, axis=0) & ~np.any(jump <= 0, axis=0)
    limits = {
        "zeta": (zeta, 1.0, (before[0] < REGION_ONE) & np.isfinite(zeta[0])),
        "plateau": (jump, LAW, (before[0] > PLATEAU) & rising),
    }
    if np.count_nonzero(known) < 2 and not any(np.any(region) for _, _, region in limits.values()):
        raise FitError(f"expected two or more cases in regions I to III whose friction jumps, got {int(known.sum())}")
    rows = rows_of(cases)
    table: dict[str, list[float | str]] = {}
    for _, chosen in rows:
        row = _constant(before[:, chosen & known], jump[:, chosen & known], cases.count(chosen & known))
        row |= _limit("zeta", "zeta_holds", *limits["zeta"], chosen, cases)
        row |= _limit("plateau_jump", "plateau_holds", *limits["plateau"], chosen, cases)
        for name, value in row.items():
            table.setdefault(name, []).append(value)
    result = xr.Dataset({name: ("hurst", column, {"units": "1"}) for name, column in table.items()})
    for name, meaning in JUMP_FIELDS.items():
        result[name].attrs["long_name"] = meaning
    result.attrs["law"] = f"d_mu_0 v_1 / (dv s) = [(s / mu_1)^2 + 1 / c^2]^(-1/2), s = rms_slope; thesis: c = {LAW}"
    result.attrs["window"] = "regions I to III, where friction does not fall; equal weights of the relative departures"
    return result.assign_coords(hurst=[label for label, _ in rows])


def _constant(before: FloatArray, jump: FloatArray, count: int) -> dict[str, float | str]:
    """Return the constant of eq. 4.11 for some cases, from stacks of mu_1 / slope and of the jump / slope."""
    row: dict[str, float | str] = {"cases": jump.shape[1], "constant_of_thesis": LAW}
    if jump.shape[1] < 2:
        reason = "not tested: the constant needs two cases"
        names = ("constant", "constant_low", "constant_high", "deviation", "deviation_of_thesis")
        return dict.fromkeys(names, np.nan) | row | {"fitted_law_holds": reason, "law_holds": reason}
    logs = np.log(jump)

    def before_of(rows: FloatArray) -> FloatArray:
        return before if len(rows) == len(before) else before[:1]  # rows shifted by departures use mu_1 of row 0

    def left(rows: FloatArray, constant: FloatArray) -> FloatArray:
        return rows - np.log(jump_law(before_of(rows), np.exp(constant)))

    def fit(rows: FloatArray) -> FloatArray:
        constant = np.full((len(rows), 1), np.log(LAW))
        for _ in range(30):  # Gauss-Newton steps in ln c
            slope = (jump_law(before_of(rows), np.exp(constant)) / np.exp(constant)) ** 2
            step = np.sum(slope * left(rows, constant), axis=1, keepdims=True) / np.sum(slope**2, axis=1, keepdims=True)
            constant = constant + np.clip(step, -1, 1)
        return constant

    def where(k: int) -> str:
        return f"mu_1 / rms_slope = {before[0, k]:.2g}"

    found = fitted(fit, left, logs, count, np.log([LAW]))
    stated = left(logs, np.full((len(logs), 1), np.log(LAW)))
    constant = np.exp(found.constants[:, 0])
    low, high = bootstrap.interval(constant, count, positive=True)
    holds = verdict(stated, count, 0, where, excluded=excludes(found.constants[:, 0], count, np.log(LAW)))
    if np.isnan(constant[0]):
        holds = f"not tested: mu_1 / rms_slope is at most {before[0].max():.2g}, where the constant plays no part"
    return row | {
        "constant": float(constant[0]),
        "constant_low": float(low),
        "constant_high": float(high),
        "deviation": found.rms,
        "deviation_of_thesis": float(np.sqrt(np.mean(stated[0] ** 2))),
        "fitted_law_holds": found.holds(where),
        "law_holds": holds,
    }


def _limit(
    name: str,
    holds: str,
    stack: FloatArray,
    limit: float,
    region: NDArray[np.bool_],
    chosen: NDArray[np.bool_],
    cases: Cases,
) -> dict[str, float | str]:
    """Return the mean of a number over the cases of a region, and a sentence on whether it equals its limit there."""
    inside = region & chosen
    if not np.any(inside):
        return dict.fromkeys((name, f"{name}_low", f"{name}_high"), np.nan) | {
            holds: "not tested: no case in this region"
        }
    count, mean = cases.count(inside), stack[:, inside].mean(axis=1)
    low, high = bootstrap.interval(mean, count)
    sentence = verdict(stack[:, inside] / limit - 1, count)
    return {name: float(mean[0]), f"{name}_low": float(low), f"{name}_high": float(high), holds: sentence}


LINEAR_FIELDS = {
    "zeta": "zeta of eq. 4.8 in the limit of a small jump",
    "zeta_trend": "relative change of zeta with dv / v_1",
    "xi": "xi of eq. 4.8 in the limit of a small jump",
    "xi_trend": "change of xi with dv / v_1, over zeta",
}


def _jump_linearity(series: Series) -> xr.Dataset:
    """Fit straight lines to zeta and xi against dv / v_1; by eq. 4.8 both are constant."""
    cases = Cases.of(series, *LEVELS, "rms_slope")
    outer = [dim for dim in cases.template.dims if dim not in cases.data["velocity_change"].dims]
    change, place, numbers = cases.column("velocity_change"), cases.places(outer), jump_numbers(cases)
    both = np.stack([numbers["zeta"], numbers["xi"]], axis=1)
    both[~np.isfinite(both)] = np.nan
    rows = []
    for i in range(int(place.max()) + 1):
        used = np.flatnonzero((place == i) & np.all(np.isfinite(both[0]), axis=0))
        rows.append(_lines(both[:, :, used], change[used], cases.count(used)))
    if all(np.isnan(row["rms_error"]) for row in rows):
        raise FitError("expected a series with jumps dv / v_1 of three sizes or more")
    shape = [cases.template.sizes[dim] for dim in outer]
    axes = {dim: cases.template[dim] for dim in outer if dim in cases.template.coords}
    columns = {name: np.reshape([row[name] for row in rows], shape) for name in rows[0]}
    meanings = LINEAR_FIELDS | {"law_holds": LAW_HOLDS["long_name"]}
    result = xr.Dataset(
        {
            name: (outer, column, {"units": "1", "long_name": meanings.get(name, name)})
            for name, column in columns.items()
        },
        axes,
    )
    result.attrs["law"] = "eq. 4.8: d_mu_0 / mu_1 = zeta dv / v_1, (mu_2 - mu_1) / mu_1 = xi dv / v_1"
    return result


def _lines(numbers: FloatArray, change: FloatArray, count: int) -> dict[str, Any]:
    """Return zeta and xi with their trends and intervals, and a sentence on whether both are constant.

    Parameters
    ----------
    numbers : array, shape (rows, 2, jumps)
        Stack of zeta and xi.
    change : array, shape (jumps,)
        dv / v_1.
    count : int
        Realisations.
    """
    names = [f"{name}{end}" for name in LINEAR_FIELDS for end in ("", "_low", "_high")]
    if change.size < 3:
        empty: dict[str, Any] = dict.fromkeys([*names, "rms_error"], np.nan)
        return empty | {"law_holds": f"not tested: {change.size} jumps, three are needed"}
    scale, both = numbers[0, 0].mean(), np.concatenate([numbers[:, 0], numbers[:, 1]], axis=1)

    def levels(rows: FloatArray) -> FloatArray:
        means: FloatArray = rows.reshape(len(rows), 2, -1).mean(axis=2)
        return means

    def left(rows: FloatArray, constants: FloatArray) -> FloatArray:
        return rows - np.repeat(constants, change.size, axis=1)

    flat = fitted(levels, left, both / scale, count)
    line = numbers @ np.linalg.pinv(np.vstack([np.ones(change.size), change]))
    moved = scale * (flat.constants[len(numbers) :] - flat.constants[0])  # departures from the mean count as errors
    level = np.concatenate([line[:, :, 0], line[0, :, 0] + moved])
    with np.errstate(divide="ignore", invalid="ignore"):  # zeta may be zero within its error
        trend = line[:, :, 1] / line[:, :1, 0]
    found: dict[str, Any] = {}
    stacks = (level[:, 0], trend[:, 0], level[:, 1], trend[:, 1])
    for name, stack in zip(LINEAR_FIELDS, stacks, strict=True):
        low, high = bootstrap.interval(stack, count)
        found |= {name: float(stack[0]), f"{name}_low": float(low), f"{name}_high": float(high)}
    sentence = flat.holds(lambda k: f"dv / v_1 = {change[k % change.size]:.2g}, relative to zeta")
    return found | {"rms_error": flat.rms, "law_holds": sentence}


_MODELS = ("velocity_jump",)
FITS: tuple[Fit, ...] = (
    Fit(
        "jump_law",
        _MODELS,
        "d_mu_0 v_1 / (dv s) = [(s / mu_1)^2 + 1 / c^2]^(-1/2) for every H (eq. 4.11), and its limits 4.9 and 4.10",
        _jump_law,
        apart=True,
        constants=("constant", "zeta", "plateau_jump"),
    ),
    Fit(
        "jump_linearity",
        _MODELS,
        "zeta and xi against dv / v_1: constant if the jump is proportional to the change of velocity (eq. 4.8)",
        _jump_linearity,
        apart=True,
        constants=tuple(LINEAR_FIELDS),
    ),
)
