"""Test whether shifted curves collapse onto a master curve, and which law the shift factors follow."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from scipy.special import fdtrc

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import LAW_HOLDS, law_holds
from mdr_dask.physics.superposition import laws as shift_laws
from mdr_dask.physics.superposition.laws import ShiftLaw
from mdr_dask.physics.superposition.master_curve import Superposition
from mdr_dask.units import conversion

DEGREES = range(1, 7)  # degrees of the polynomials that are fitted to each curve, in order to estimate the scatter
HOLDS = {"yes", "approximately"}
LOG = float(np.log(10.0))  # decades times LOG are natural logarithms; if small, these are relative deviations


def laws_of(
    result: Superposition, over: str, unit: str, reference: float, *, is_temperature: bool
) -> tuple[list[ShiftLaw], dict[str, str]]:
    """Fit laws of the shift factors. Return the fitted laws, and for each law a sentence on whether the law holds.

    `result.groups` contains the temperature, or the other number, that distinguishes each curve from the others. If the
    groups are temperatures, the laws are Arrhenius' law and the WLF law of log10 a_T. If the groups are other positive
    numbers, such as velocities, the law is a power law. All laws are fitted relative to the middle group, so that the
    fit does not depend on the reference. If one of the laws cannot be fitted, no law is returned, and the only sentence
    states the reason. If the groups are numbers that are not all positive, neither a law nor a sentence is returned.
    """
    size, anchor = result.groups.size, result.groups.size // 2
    groups, factors = result.groups, result.horizontal - result.horizontal[anchor]
    drawn = result.draws[:, :size] - result.draws[:, [anchor]]
    covariance = np.cov(drawn, rowvar=False)
    free = np.diag(covariance) > 0
    away = drawn[:, free] - drawn[:, free].mean(axis=0)
    scatter = LOG * float(np.quantile(np.sqrt(np.mean(away**2, axis=1)), 0.95))
    fits: list[ShiftLaw] = []
    try:
        if is_temperature:
            groups, sign = kelvins(groups, unit), sign_of(over)
            kelvin = float(kelvins(np.array([reference]), unit, groups=result.groups)[0])
            about = groups, sign * factors, covariance, anchor
            fits = [shift_laws.fit_arrhenius(*about), shift_laws.fit_wlf(*about, kelvin)]
        elif np.all(groups > 0):
            fits = [shift_laws.fit_power(groups, factors, covariance, anchor)]
    except FitError as problem:
        return [], {"law of the shifts": f"not tested: {problem}"}
    verdicts = {}
    for law in fits:
        where = f"{result.groups[np.argmax(np.abs(law.departures))]:.4g} {'' if unit == '1' else unit}".rstrip()
        departures, constants = LOG * law.departures[free], len(law.constants)
        verdicts[law.name] = law_holds(departures, law.chance, constants, where, scatter, logarithmic=True)
    return fits, verdicts


def sign_of(over: str) -> int:
    """Return the sign by which log10 a_T is multiplied to give a shift factor.

    The sign is -1 if the abscissa is a time, otherwise 1.
    """
    return -1 if over == "t" or over.lower().startswith("time") else 1


def kelvins(temperatures: FloatArray, unit: str, groups: FloatArray | None = None) -> FloatArray:
    """Return temperatures in K.

    Without a unit, the temperatures count as K if the median of the temperatures `groups` exceeds 250, otherwise as
    degC. If `groups` is None, the median of `temperatures` is used.
    """
    if unit in ("", "1", "-"):
        unit = "K" if np.median(temperatures if groups is None else groups) > 250 else "degC"
    factor, zero = conversion({"C": "degC", "F": "degF"}.get(unit.lstrip("°").upper(), unit), "K")
    return np.asarray(factor * temperatures + zero, dtype=np.float64)


def constants_of(laws: list[ShiftLaw]) -> dict[str, xr.Variable]:
    """Return the constants of the laws, their intervals, and the rms distance of the shift factors from each law."""
    units = {"activation_energy": "J/mol", "c2": "K"}
    meaning = {"units": "1", "long_name": "rms distance of the factors from the law, decades"}
    found = {}
    for law in laws:
        for key, numbers in law.constants.items():
            for suffix, number in zip(("", "_low", "_high"), numbers, strict=True):
                found[f"{law.name}_{key}{suffix}"] = xr.Variable((), number, {"units": units.get(key, "1")})
        found[f"{law.name}_residual"] = xr.Variable((), law.residual, meaning)
    return found


def with_verdict(curve: xr.Dataset, verdicts: dict[str, str]) -> xr.Dataset:
    """Add ``law_holds`` to a master curve: whether the curves collapse, and which law the shift factors follow.

    The verdict is *not tested* if the curves do not determine all shift factors.
    """
    open_steps = curve.attrs.get("undetermined", "")
    collapse = f"not tested: shift factors are {open_steps.partition(':')[0]}" if open_steps else _collapse(curve)
    answers = {"the curves collapse": collapse, **verdicts}
    words = [sentence.partition(":")[0] for sentence in answers.values()]
    described = words[1:] or ["yes"]
    if not open_steps and (words[0] == "no" or all(word == "no" for word in described)):
        word = "no"
    elif words[0] not in HOLDS or HOLDS.isdisjoint(described):
        word = "not tested"
    else:
        word = "yes" if words[0] == "yes" and "yes" in described else "approximately"
    sentence = f"{word}: " + ";\n".join(f"{name}: {reason}" for name, reason in answers.items())
    return curve.assign(law_holds=xr.Variable((), sentence, LAW_HOLDS))


def _collapse(curve: xr.Dataset) -> str:
    """Return a sentence on whether the curves collapse.

    If there are two ordinates, the sentence is about the ordinate that collapses less well.
    """
    names = [name for name in ("ordinate", "companion") if f"point_{name}" in curve]
    answers = [_collapse_of(curve, name) for name in names]
    worst = min(range(len(names)), key=lambda i: {"no": 0, "yes": 2}.get(answers[i].partition(":")[0], 1))
    word, _, reason = answers[worst].partition(": ")
    if len(names) > 1 and word != "yes":
        reason = f"{curve.attrs[names[worst]]} {reason}"
    return f"{word}: {reason}"


def _collapse_of(curve: xr.Dataset, name: str) -> str:
    x, y = np.log10(curve["point_abscissa"].to_numpy()), np.log10(curve[f"point_{name}"].to_numpy())
    off = y - np.interp(x, np.log10(curve["curve_abscissa"].to_numpy()), np.log10(curve[f"curve_{name}"].to_numpy()))
    group = curve["point_group"].to_numpy()
    members = [group == one for one in np.unique(group)]
    fewest = min(int(np.sum(places)) for places in members)
    found = [_scatter(x, y, members, degree) for degree in DEGREES if degree + 2 < fewest]
    chance = np.nan
    if found:
        _, within, freedom = min(found)
        squares = float(np.sum(off**2))
        more = max(min(squares / float(curve.attrs[f"{name}_noise"]) ** 2, x.size) - freedom, 1.0)
        excess = max(squares - within, 0.0) / more
        chance = float(fdtrc(more, freedom, excess * freedom / max(within, 1e-300)))
    worst = int(np.argmax(np.abs(off)))
    unit = curve["curve_abscissa"].attrs["units"]
    place = f"{curve.attrs['abscissa']} = {10 ** x[worst]:.3g} {'' if unit == '1' else unit}".rstrip()
    return law_holds(LOG * off, chance, 0, f"{place} of the merged curve", logarithmic=True)


def _scatter(x: FloatArray, y: FloatArray, members: list[Any], degree: int) -> tuple[float, float, int]:
    """Fit a polynomial to each curve; return Schwarz's criterion, the sum of squares and the degrees of freedom."""
    squares, freedom = 0.0, 0
    for places in members:
        fitted = np.polynomial.Polynomial.fit(x[places], y[places], degree)
        squares += float(np.sum((y[places] - fitted(x[places])) ** 2))
        freedom += int(np.sum(places)) - degree - 1
    criterion = x.size * np.log(max(squares, 1e-300) / x.size) + (x.size - freedom) * np.log(x.size)
    return float(criterion), squares, freedom
