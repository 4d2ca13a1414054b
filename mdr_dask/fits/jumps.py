"""Size and law of the friction jump that a velocity jump causes (thesis eqs. 4.8 to 4.11).

Symbols: The velocity jumps at the time t_0 from v_1 to v_2 = v_1 + dv. The coefficient of friction mu is mu_1 before
the jump and mu_2 long after the jump. The coefficient of friction changes by d_mu_0 at t_0, and then relaxes from
mu(t_0+) = mu_1 + d_mu_0 to mu_2. The rms slope is s.

Eq. 4.11 is d_mu_0 v_1 / (dv s) = [(s / mu_1)^2 + 1 / c^2]^(-1/2) with the constant c = 0.4. For slow sliding (region
I), eq. 4.11 becomes eq. 4.9, d_mu_0 / mu_1 = dv / v_1. On the plateau of friction, eq. 4.11 becomes eq. 4.10,
d_mu_0 v_1 / (dv s) = c.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import SMALL, Fit, verdict
from mdr_dask.fits.cases import (
    Series,
    Variables,
    constant,
    each,
    holds,
    measure,
    nonlinear,
    table_of,
)

MODELS = ("velocity_jump",)
LEVELS = ("friction_coefficient_before", "friction_coefficient_jump", "friction_coefficient_after")

LAW = 0.4  # the constant c of eq. 4.11, as stated in the thesis
# a case with mu_1 / s below this value is in region I; there, eqs. 4.9 and 4.11 differ by less than WITHIN
REGION_ONE = LAW * SMALL
PLATEAU = LAW / SMALL  # above this value of mu_1 / s, eqs. 4.10 and 4.11 differ by less than WITHIN

NUMBERS = {
    "before_over_slope": "mu_1 / rms_slope",
    "jump_over_slope": "d_mu_0 v_1 / (dv rms_slope)",
    "zeta": "zeta = (d_mu_0 / mu_1) / (dv / v_1), eq. 4.8",
    "xi": "xi = ((mu_2 - mu_1) / mu_1) / (dv / v_1), eq. 4.8",
    "relaxing_over_slope": "(mu(t_0+) - mu_2) / rms_slope: the relaxing part of friction",
    "direct_effect": "a = d_mu_0 / ln(v_2 / v_1)",
    "evolution_effect": "b = (mu(t_0+) - mu_2) / ln(v_2 / v_1)",
    "velocity_dependence": "a - b = (mu_2 - mu_1) / ln(v_2 / v_1); positive if friction grows with the velocity",
}


def is_jump(data: xr.Dataset) -> bool:
    """Return whether the loading history is a velocity jump in every case of a series."""
    varied = any(axis["path"].split(".")[0] == "protocol" for axis in data.attrs.get("axes", []))
    history = json.loads(data.attrs.get("parameters", "{}")).get("protocol") or {}
    return not varied and history.get("shape", "jump") == "jump"


def each_jump(
    series: Series, inner: Callable[[xr.Dataset], list[str]], fit: Callable[[xr.Dataset], Variables], *outputs: str
) -> xr.Dataset:
    """Check that a series has jumps of the velocity and two or more realisations; then fit a law as `each` does."""
    (data,) = series.values()
    if "realisation" in data.sizes and data.sizes["realisation"] < 2:
        raise FitError(f"expected at least two realisations, got {data.sizes['realisation']}")
    if not is_jump(data):
        raise FitError("expected a jump of the velocity, got another loading history")
    return each(series, inner, fit, *LEVELS, "rms_slope", *outputs)


class Jumps(NamedTuple):
    """Stacks of mu_1, d_mu_0 and mu_2, shape (rows, cases); `change` is dv / v_1 of each case.

    `slope`, the rms slope, is NaN for smooth lines. `counts` is the number of successful realisations of each case.
    """

    before: FloatArray
    jump: FloatArray
    after: FloatArray
    change: FloatArray
    slope: FloatArray
    counts: NDArray[np.intp]

    def count(self, used: NDArray[np.bool_]) -> int:
        """Return the smallest number of successful realisations of the `used` cases.

        If no case is used, return the largest integer.
        """
        return int(self.counts[used].min(initial=np.iinfo(np.intp).max))

    def numbers(self) -> dict[str, FloatArray]:
        """Return the stacks of all `NUMBERS`, indexed by name; zeta and xi are infinite or NaN if mu_1 is 0."""
        before, jump, after, change, slope, _ = self
        logarithm = np.log1p(change)
        with np.errstate(divide="ignore", invalid="ignore"):
            of_before = jump / before / change, (after / before - 1) / change
        found = (
            before / slope,
            jump / change / slope,
            *of_before,
            (before + jump - after) / slope,
            jump / logarithm,
            (before + jump - after) / logarithm,
            (after - before) / logarithm,
        )
        return dict(zip(NUMBERS, found, strict=True))


def jumps_of(data: xr.Dataset) -> Jumps:
    """Return the `Jumps` of friction in all cases of a series."""
    tables = [table_of(data, 1.0, data["velocity_change"], output=name) for name in LEVELS]
    values = np.stack([table.values.T for table in tables], axis=1)
    values = values + 0 * values.sum(axis=1, keepdims=True)  # if one of the three `LEVELS` is NaN, all three become NaN
    errors = np.stack([table.mean_error() for table in tables])
    slopes = table_of(data, 1.0, output="rms_slope").values
    known = np.isfinite(slopes) & (slopes > 0)
    slope = np.where(known, slopes, 0.0).sum(axis=1) / np.where(known.any(axis=1), known.sum(axis=1), np.nan)
    before, jump, after = np.moveaxis(bootstrap.with_errors(bootstrap.means(values), errors), 1, 0)
    (change,) = tables[0].columns
    return Jumps(before, jump, after, change, slope, np.isfinite(values[:, 0]).sum(axis=0))


def _kinetics(case: xr.Dataset) -> Variables:
    """Return the quantities `NUMBERS` of a case, each with its interval."""
    jumps = jumps_of(case)
    found: Variables = {}
    for name, stack in jumps.numbers().items():
        found |= constant(name, stack[:, 0], int(jumps.counts[0]), NUMBERS[name])
    return found


def jump_law(before: FloatArray, constant: float | FloatArray) -> FloatArray:
    """Return d_mu_0 v_1 / (dv s) from mu_1 / s (eq. 4.11)."""
    law: FloatArray = before / np.hypot(1.0, before / np.asarray(constant))
    return law


def _jump_law(data: xr.Dataset) -> Variables:
    """Fit the constant c of eq. 4.11 to all cases in which friction does not fall significantly with the velocity.

    The fit leaves out cases in which mu_1 or d_mu_0 / dv is zero or negative in a row of the stack. The function also
    tests eq. 4.9 in region I, and eq. 4.10 on the plateau of friction.
    """
    jumps = jumps_of(data)
    numbers = jumps.numbers()
    before, jump, zeta = numbers["before_over_slope"], numbers["jump_over_slope"], numbers["zeta"]
    highest = bootstrap.interval(numbers["xi"], jumps.counts)[1]
    rising = np.isfinite(highest) & (highest >= 0)  # cases in which friction does not fall significantly
    known = rising & ~np.any(before <= 0, axis=0) & ~np.any(jump <= 0, axis=0)
    slow, fast = (before[0] < REGION_ONE) & np.isfinite(zeta[0]), (before[0] > PLATEAU) & rising
    if np.count_nonzero(known) < 2 and not slow.any() and not fast.any():
        raise FitError(
            "expected two or more cases in which friction jumps and does not fall with the velocity, got "
            f"{int(known.sum())}"
        )
    of_zeta = "mean zeta in region I; 1 by eq. 4.9", "whether zeta = 1 in region I (eq. 4.9)"
    of_plateau = (
        f"mean {NUMBERS['jump_over_slope']} on the plateau; 0.4 by eq. 4.10",
        f"whether {NUMBERS['jump_over_slope']} = 0.4 on the plateau (eq. 4.10)",
    )
    return {
        **_constant(before[:, known], jump[:, known], jumps.count(known)),
        **_limit("zeta", "zeta_holds", 1.0, zeta[:, slow], jumps.count(slow), *of_zeta),
        **_limit("plateau_jump", "plateau_holds", LAW, jump[:, fast], jumps.count(fast), *of_plateau),
    }


def _constant(before: FloatArray, jump: FloatArray, count: int) -> Variables:
    """Fit the constant c of eq. 4.11 to stacks of mu_1 / s and of d_mu_0 v_1 / (dv s)."""
    measured = measure("constant_stated", LAW, "constant c by the thesis")
    measured |= measure("cases", jump.shape[1], "number of cases in regions I to III")
    if jump.shape[1] < 2:
        reason = "not tested: the constant needs two cases"
        return measured | holds(reason, reason)

    def model(constants: FloatArray) -> FloatArray:
        # if `fitted` repeats the fit for shifted data, mu_1 of the first row is used for all rows
        law: FloatArray = np.log(jump_law(before if len(constants) == len(before) else before[:1], np.exp(constants)))
        return law

    def where(k: int) -> str:
        return f"mu_1 / rms_slope = {before[0, k]:.2g}"

    found, verdicts = nonlinear(model, np.log([LAW]), np.log(jump), count, where)
    if np.isnan(found.constants[0, 0]):
        reason = f"not tested: mu_1 / rms_slope is at most {before[0].max():.2g}; the constant has no effect there"
        verdicts = verdicts | holds(reason)
    stack = np.exp(found.constants[:, 0])
    return constant("constant", stack, count, "constant c of eq. 4.11", positive=True) | measured | verdicts


def _limit(
    name: str, verdict_name: str, stated: float, stack: FloatArray, count: int, meaning: str, question: str
) -> Variables:
    """Return the mean over the cases of a `stack`, and a sentence on whether the cases have the `stated` value."""
    if not stack.shape[1]:
        nothing = constant(name, np.full(1 + bootstrap.RESAMPLES, np.nan), count, meaning)
        return nothing | measure(verdict_name, "not tested: no case in this region", question)
    mean = constant(name, stack.mean(axis=1), count, meaning)
    return mean | measure(verdict_name, verdict(stack / stated - 1, count), question)


FITS: tuple[Fit, ...] = (
    Fit(
        "kinetics",
        MODELS,
        "numbers of the jump of every case: d_mu_0 v_1 / (dv s), zeta, xi, relaxing part, a and b of rate and state",
        lambda series: each_jump(series, lambda data: [], _kinetics),
    ),
    Fit(
        "jump_law",
        MODELS,
        "d_mu_0 v_1 / (dv s) = [(s / mu_1)^2 + 1 / c^2]^(-1/2) for all cases (eq. 4.11), and its limits 4.9 and 4.10",
        lambda series: each_jump(series, lambda data: [str(dim) for dim in data.dims], _jump_law),
    ),
)
