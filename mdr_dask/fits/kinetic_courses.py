"""Courses of friction after a jump of the velocity beside the closed laws of eqs. 4.13 to 4.15, and eq. 4.8."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import LAW_HOLDS, Fit, fitted, law_holds
from mdr_dask.fits.jumps import LAW, jump_law
from mdr_dask.fits.kinetic_cases import LEAST, LEVELS, Cases, jump_numbers, law_rate

Series = Mapping[str, xr.Dataset]
_MODELS = ("velocity_jump",)

COURSE_FIELDS = {
    "rms_error": "rms over the times of law less course, over the jump d_mu_0",
    "start_error": "law less course at t_0+, over d_mu_0: the error of eq. 4.11 with 0.4",
    "end_error": "law less course at the last time, over d_mu_0",
    "rms_error_of_rate": "rms as above of the law with the jump that was found: the error of its rate and form",
}


class Course(NamedTuple):
    """Departures of the closed law from a course, over d_mu_0; stacks, shape (rows, 1 + times)."""

    whole: FloatArray
    of_rate: FloatArray


def relaxation_law(
    before: FloatArray, after: FloatArray, slope: float, change: float, rate: float, time: FloatArray
) -> FloatArray:
    """Return mu(t) after a jump by eqs. 4.13 and 4.14, shape (rows, times).

    Parameters
    ----------
    before, after : array, shape (rows,)
        mu_1 and mu_2.
    slope, change, rate : float
        Rms slope, dv / v_1, and b: v_1 tau q_max below 1, its power 1 - H above.
    time : array
        (t - t_0) / tau.
    """
    start = before + slope * change * jump_law(before / slope, LAW)
    course: FloatArray = after[:, None] + (start - after)[:, None] * np.exp(-rate * time)
    return course


def _courses(cases: Cases) -> list[Course | None]:
    """Return how far the closed law is from the course of every case; None of too few lines, or without a jump."""
    time = np.concatenate([[0.0], cases.data["relaxation_times"].values])
    rate, slope, change = law_rate(cases.passing, cases.column("hurst")), cases.slope, cases.column("velocity_change")
    outputs = [*LEVELS, "friction_coefficient"]
    values = np.concatenate([np.atleast_3d(cases.output(name)) for name in outputs], axis=2)
    errors = np.concatenate([cases.error(name).reshape(len(values), -1) for name in outputs], axis=1)
    found: list[Course | None] = []
    for k, (case, error) in enumerate(zip(values, errors, strict=True)):
        means = bootstrap.means(bootstrap.complete(case))
        if np.all(np.isfinite(case), axis=1).sum() < LEAST or means[0, 1] == 0:
            found.append(None)
            continue
        stack = np.concatenate([means, bootstrap.moved(means[0], error)])
        before, jump, after = stack[:, :3].T
        course = np.column_stack([before + jump, stack[:, 3:]])
        law = relaxation_law(before, after, float(slope[k]), float(change[k]), float(rate[k]), time)
        decay = after[:, None] + (before + jump - after)[:, None] * np.exp(-rate[k] * time)
        found.append(Course((law - course) / abs(jump[0]), (decay - course) / abs(jump[0])))
    return found


def _relaxation_course(series: Series) -> xr.Dataset:
    """Return how far the closed law is from the simulated course of every case."""
    cases = Cases.of(series, *LEVELS, "friction_coefficient", "rms_slope")
    time = np.concatenate([[0.0], cases.data["relaxation_times"].values])
    courses = _courses(cases)
    rows = 1 + bootstrap.RESAMPLES + 2 * bootstrap.GROUPS
    stacks = {name: np.full((rows, len(courses)), np.nan) for name in COURSE_FIELDS}
    verdicts = []
    for k, course in enumerate(courses):
        if course is None:
            verdicts.append("not tested: fewer than two lines succeeded, or their friction does not jump")
            continue
        whole, of_rate = course
        numbers = np.sqrt(np.mean(whole**2, axis=1)), whole[:, 0], whole[:, -1], np.sqrt(np.mean(of_rate**2, axis=1))
        for name, values in zip(COURSE_FIELDS, numbers, strict=True):
            stacks[name][:, k] = values[0]
            stacks[name][: len(values), k] = values
        worst = f"t' = {time[np.argmax(np.abs(whole[0]))]:.2g}, of d_mu_0"
        verdicts.append(law_holds(whole[0], bootstrap.chance(whole, int(cases.counts[k])), where=worst))
    result = xr.Dataset(cases.constants(stacks, {name: ("1", text) for name, text in COURSE_FIELDS.items()}))
    result["law_holds"] = cases.found(np.array(verdicts), "1", LAW_HOLDS["long_name"])
    result.attrs["law"] = (
        "mu = mu_2 + (mu_1 + d_mu_0 - mu_2) exp(-b t'), d_mu_0 of eq. 4.11 with 0.4,"
        " b = v_1 tau q_max below 1, (v_1 tau q_max)^(1 - H) above"
    )
    return result


LINEAR_FIELDS = {
    "zeta": "zeta of eq. 4.8 in the limit of a small jump",
    "zeta_trend": "relative change of zeta with dv / v_1",
    "xi": "xi of eq. 4.8 in the limit of a small jump",
    "xi_trend": "change of xi with dv / v_1, over zeta",
}


def _jump_linearity(series: Series) -> xr.Dataset:
    """Fit zeta and xi as straight lines over dv / v_1; the law is that they are constant."""
    cases = Cases.of(series, *LEVELS, "rms_slope")
    rows = [dim for dim in cases.template.dims if dim not in cases.data["velocity_change"].dims]
    change, place = cases.column("velocity_change"), cases.places(rows)
    found_numbers = jump_numbers(cases)
    numbers = np.stack([found_numbers["zeta"], found_numbers["xi"]], axis=1)
    numbers[~np.isfinite(numbers)] = np.nan
    found: dict[str, list[float]] = {}
    verdicts = []
    for i in range(int(place.max()) + 1):
        used = np.flatnonzero((place == i) & np.all(np.isfinite(numbers[0]), axis=0))
        row, verdict = _lines(numbers[:, :, used], change[used], cases.count(used))
        verdicts.append(verdict)
        for name, value in row.items():
            found.setdefault(name, []).append(value)
    if all(verdict.startswith("not tested") for verdict in verdicts):
        raise FitError("expected a series with jumps dv / v_1 of three sizes or more")
    shape = [cases.template.sizes[dim] for dim in rows]
    axes = {dim: cases.template[dim] for dim in rows if dim in cases.template.coords}
    result = xr.Dataset(
        {name: (rows, np.reshape(values, shape), {"units": "1"}) for name, values in found.items()}, axes
    )
    for name, meaning in LINEAR_FIELDS.items():
        result[name].attrs["long_name"] = meaning
    result["law_holds"] = (rows, np.reshape(verdicts, shape), LAW_HOLDS)
    result.attrs["law"] = "eq. 4.8: d_mu_0 / mu_1 = zeta dv / v_1, (mu_2 - mu_1) / mu_1 = xi dv / v_1"
    return result


def _lines(numbers: FloatArray, change: FloatArray, count: int) -> tuple[dict[str, float], str]:
    """Return zeta and xi with their trends and intervals, and whether both are constant."""
    names = [f"{name}{end}" for name in LINEAR_FIELDS for end in ("", "_low", "_high")]
    empty = dict.fromkeys([*names, "rms_error"], np.nan) | {"jumps": float(change.size)}
    if change.size < 3:
        return empty, f"not tested: {change.size} jumps, three are needed"
    scale = numbers[0, 0].mean()
    design = np.vstack([np.ones(change.size), change])
    line = numbers @ np.linalg.pinv(design)
    with np.errstate(divide="ignore", invalid="ignore"):  # an error as large as zeta leaves none to compare with
        of_zeta = line[:, :, 1] / line[:, :1, 0]
    constants = {"zeta": line[:, 0, 0], "zeta_trend": of_zeta[:, 0], "xi": line[:, 1, 0], "xi_trend": of_zeta[:, 1]}
    flat = fitted(
        lambda rows: rows.mean(axis=2),
        lambda rows, level: rows - level[..., None],
        numbers / scale,
        count,
    )
    for name in ("zeta", "xi"):
        moved = scale * flat.constants[len(numbers) :, 0 if name == "zeta" else 1]
        mean = scale * flat.constants[0, 0 if name == "zeta" else 1]
        constants[name] = np.concatenate([constants[name], constants[name][0] + moved - mean])
    found: dict[str, float] = {}
    for name, stack in constants.items():
        low, high = bootstrap.interval(stack, count)
        found |= {name: float(stack[0]), f"{name}_low": float(low), f"{name}_high": float(high)}
    found |= {"rms_error": float(np.sqrt(np.mean(flat.departures**2))), "jumps": float(change.size)}
    at = int(np.argmax(np.abs(flat.departures))) % change.size
    return found, law_holds(flat.departures, flat.chance, 2, f"dv / v_1 = {change[at]:.2g}, of zeta")


FITS: tuple[Fit, ...] = (
    Fit(
        "relaxation_course",
        _MODELS,
        "mu(t) after the jump beside the closed law: jump of eq. 4.11, rate of eq. 4.12 (eqs. 4.13 to 4.15)",
        _relaxation_course,
        apart=True,
        constants=tuple(COURSE_FIELDS),
    ),
    Fit(
        "jump_linearity",
        _MODELS,
        "zeta and xi over dv / v_1: constant if the jump goes with the change of velocity (eq. 4.8)",
        _jump_linearity,
        apart=True,
        constants=tuple(LINEAR_FIELDS),
    ),
)
