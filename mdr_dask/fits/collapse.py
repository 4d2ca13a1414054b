"""Whether shifted curves collapse, and whether a law describes their shifts: constants, and a verdict in words."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.special import fdtrc

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import LAW_HOLDS, law_holds
from mdr_dask.physics.superposition import laws as shift_laws
from mdr_dask.physics.superposition.master_curve import Superposition

ABSOLUTE_ZERO = -273.15
DEGREES = range(1, 7)  # of the polynomials that tell the scatter within curves
LOG = float(np.log(10.0))  # a departure in decades, times this, is a relative one


def laws_of(
    result: Superposition, over: str, unit: str, *, is_temperature: bool
) -> tuple[dict[str, xr.Variable], dict[str, str]]:
    """Fit the laws that suit the groups: a power of velocities, Arrhenius and WLF for temperatures.

    Returns
    -------
    constants : dict of str to Variable
    verdicts : dict of str to str
        Of each law, in words.
    """
    size = result.groups.size
    covariance = result.covariance[:size, :size]
    fits = []
    try:
        if is_temperature:
            sign = -1 if over == "t" or over.lower() == "time" else 1
            kelvin = 0.0 if unit.upper() in ("K", "KELVIN", "") and np.all(result.groups > 0) else -ABSOLUTE_ZERO
            temperatures = result.groups + kelvin, sign * result.horizontal, covariance, result.reference + kelvin
            fits = [shift_laws.fit_arrhenius(*temperatures), shift_laws.fit_wlf(*temperatures)]
        elif np.all(result.groups > 0):
            fits = [shift_laws.fit_power(result.groups, result.horizontal, covariance, result.reference)]
    except FitError as problem:
        return {}, {"law of the shifts": f"not tested: {problem}"}
    constants = {name: value for law in fits for name, value in _constants(law).items()}
    verdicts = {}
    for law in fits:
        worst, free = int(np.argmax(np.abs(law.departures))), np.diag(covariance) > 0
        where = f"{result.groups[worst]:.4g}"
        verdicts[law.name] = law_holds(LOG * law.departures[free], law.chance, len(law.constants), where)
    return constants, verdicts


def _constants(law: shift_laws.ShiftLaw) -> dict[str, xr.Variable]:
    units = {"activation_energy": "J/mol", "c2": "K"}
    found = {}
    for key, (value, low, high) in law.constants.items():
        for suffix, number in (("", value), ("_low", low), ("_high", high)):
            found[f"{law.name}_{key}{suffix}"] = xr.Variable((), number, {"units": units.get(key, "1")})
    meaning = {"units": "1", "long_name": "rms distance of the factors from the law, decades"}
    found[f"{law.name}_residual"] = xr.Variable((), law.residual, meaning)
    return found


def with_verdict(curve: xr.Dataset, verdicts: dict[str, str]) -> xr.Dataset:
    """Return a master curve that says in words whether its curves collapse and which law its shifts follow."""
    told = {"the curves collapse": _collapse(curve), **verdicts}
    words = [sentence.partition(":")[0] for sentence in told.values()]
    described = words[1:] or ["yes"]
    if words[0] == "no" or all(word == "no" for word in described):
        word = "no"
    else:
        word = "yes" if words[0] == "yes" and "yes" in described else "not tested"
    sentence = f"{word}: " + "; ".join(f"{name}: {reason}" for name, reason in told.items())
    return curve.assign(law_holds=xr.Variable((), sentence, LAW_HOLDS))


def _collapse(curve: xr.Dataset) -> str:
    """Compare the scatter about the merged curve with that within the curves, which polynomials tell."""
    x, y = (np.log10(curve[f"point_{name}"].to_numpy()) for name in ("abscissa", "ordinate"))
    merged = np.log10(curve["curve_abscissa"].to_numpy()), np.log10(curve["curve_ordinate"].to_numpy())
    off = y - np.interp(x, *merged)
    keys = [curve[name].to_numpy() for name in ("point_group", "point_second") if name in curve]
    members = [
        np.all([key == one for key, one in zip(keys, row, strict=True)], axis=0) for row in set(zip(*keys, strict=True))
    ]
    fewest = min(int(np.sum(places)) for places in members)
    found = [_within(x, y, members, degree) for degree in DEGREES if degree + 2 < fewest]
    chance = np.nan
    if found:
        within = min(found, key=lambda each: each.criterion(x.size))
        more = max(float(curve.attrs["freedom"]) - within.freedom, 1.0)
        excess = max(float(np.sum(off**2)) - within.squares, 0.0) / more
        chance = float(fdtrc(more, within.freedom, excess * within.freedom / max(within.squares, 1e-300)))
    worst = int(np.argmax(np.abs(off)))
    return law_holds(LOG * off, chance, 0, f"{curve.attrs['abscissa']} = {10 ** x[worst]:.3g} of the merged curve")


class _Within(NamedTuple):
    """The sum of squares about a polynomial of each curve, and its degrees of freedom."""

    squares: float
    freedom: int

    def criterion(self, points: int) -> float:
        """Return Schwarz's criterion, the least of which chooses the degree."""
        mean = max(self.squares, 1e-300) / points
        return float(points * np.log(mean) + (points - self.freedom) * np.log(points))


def _within(x: FloatArray, y: FloatArray, members: list[Any], degree: int) -> _Within:
    squares, freedom = 0.0, 0
    for places in members:
        fitted = np.polynomial.Polynomial.fit(x[places], y[places], degree)
        squares += float(np.sum((y[places] - fitted(x[places])) ** 2))
        freedom += int(np.sum(places)) - degree - 1
    return _Within(squares, freedom)
