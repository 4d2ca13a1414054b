"""The class `Fit`: a law, with a function that fits the constants of the law to a store and tests the law.

Every result has a sentence ``law_holds`` on whether the law holds. If the publication of the law states constants, the
law is tested with these constants. The sentence begins with *yes*, *approximately*, *no* or *not tested*. Some fits add
a sentence ``fitted_law_holds`` on whether the law holds with the fitted constants.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mdr_dask import bootstrap
from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.errors import CodeError, FitError, MdrDaskError
from mdr_dask.models.per_case import reason, where

#: A law holds if the relative deviations of the data from the law are small: rms at most this value, and the largest
#: deviation at most twice this value.
WITHIN = 0.05
#: A law holds approximately if the rms relative deviation is at most this value, and the largest relative deviation is
#: at most twice this value.
APPROXIMATE = 0.15
#: Deviations count against a law if scatter and errors alone would cause such deviations with a probability below this
#: value.
DOUBTFUL = 1 - bootstrap.CONFIDENCE
#: Largest x for which sqrt(1 + x^2) differs from 1 by at most `WITHIN`.
SMALL = float(np.sqrt((1 + WITHIN) ** 2 - 1))


@dataclass(frozen=True)
class Fit:
    """A law that ``mdr-dask fit STORE NAME`` fits to the stores of some `models`; an empty tuple means all models.

    `compute` takes the series of a store, indexed by name. A series has the dimensions (axes..., realisation, ...), and
    all scalar parameters as coordinates. `compute` returns constants, the ends of the 95 % intervals of the constants
    (``<name>_low`` and ``<name>_high``), measures of the goodness of fit, and ``law_holds``. Without ``law_holds``, the
    law counts as *not tested*. The attrs of each variable contain its unit. If `apart` is true, `compute` takes one
    series at a time.
    """

    name: str
    models: tuple[str, ...]
    summary: str
    compute: Callable[[Mapping[str, xr.Dataset]], xr.Dataset]
    apart: bool = True

    def results(self, groups: Mapping[str, xr.Dataset]) -> dict[str, xr.Dataset]:
        """Fit a store, and return the results, indexed by the name of the series (``""`` for all series together).

        If `apart` is true, a series that cannot be fitted is left out. FitError is raised if nothing can be fitted.
        """
        if not self.apart:
            return {"": self._result(groups)}
        found, reasons = {}, []
        for name, dataset in groups.items():
            try:
                found[name] = self._result({name: dataset})
            except FitError as error:
                reasons.append(f"{name}: {error}" if name else str(error))
        if not found:
            raise FitError("; ".join(dict.fromkeys(reasons)))
        return found

    def _result(self, groups: Mapping[str, xr.Dataset]) -> xr.Dataset:
        with faults_named(f"the law {self.name!r}", self.compute):
            return _judged(self.compute(groups))


@contextmanager
def faults_named(what: str, function: Callable[..., Any]) -> Iterator[None]:
    """Turn an unexpected exception of the function of a law or a figure into a CodeError that names the module.

    Exceptions of the classes MdrDaskError and OSError are expected, and are not changed.
    """
    try:
        yield
    except (MdrDaskError, OSError):
        raise
    except Exception as error:
        module = function.__module__
        advice = "; please report it with the campaign" if module.startswith("mdr_dask.") else ""
        text = f"internal error in {what} of the module {module}{advice}: {reason(error)}{where(error)}"
        raise CodeError(text) from error


def require(data: xr.Dataset, *names: str) -> None:
    """Raise FitError if a study lacks one of the parameters `names`."""
    missing = [name for name in names if name not in data.variables]
    if missing:
        raise FitError(
            f"the law holds for a Kelvin body on a generated line: expected {', '.join(names)},"
            f" got a study without {', '.join(missing)}"
        )


LAW_HOLDS = {"units": "1", "long_name": "whether the law holds"}
FITTED_LAW_HOLDS = {"units": "1", "long_name": "whether the law holds with the fitted constants"}


def _judged(result: xr.Dataset) -> xr.Dataset:
    """Return a result whose last variable is ``law_holds``; it is *not tested* if the fit gives no verdict."""
    sentence = result.get("law_holds", xr.DataArray("not tested: this fit compares no law with its data"))
    return result.drop_vars("law_holds", errors="ignore").assign(law_holds=sentence.assign_attrs(LAW_HOLDS))


@dataclass(frozen=True)
class Fitted:
    """A law fitted to a stack of data (see `mdr_dask.bootstrap`).

    `constants`, shape (rows, p), and `residuals` (data minus law), shape (rows, cases), are stacks. The stack of
    constants may have more rows, for data that are shifted by the residuals. Constants that the data do not determine
    are NaN. `count` is the smallest number of successful realisations of a case.
    """

    constants: FloatArray
    residuals: FloatArray
    count: int

    @property
    def rms(self) -> float:
        """Root mean square of the residuals of the data."""
        return float(np.sqrt(np.mean(self.residuals[0] ** 2)))

    def holds(self, where: Callable[[int], str] | None = None) -> str:
        """Return a sentence on whether the law with the fitted constants holds; ``where(k)`` describes case k."""
        if np.isnan(self.constants[0]).any():
            departs = _size(100 * self.rms, np.nan, logarithmic=True)
            return f"not tested: these cases do not determine all constants; departs by {departs} rms"
        return verdict(self.residuals, self.count, self.constants.shape[1], where, logarithmic=True)


def fitted(
    fit: Callable[[FloatArray], FloatArray],
    left: Callable[[FloatArray, FloatArray], FloatArray],
    data: FloatArray,
    count: int,
    stated: FloatArray | None = None,
) -> Fitted:
    """Fit a law to a stack of data, shape (rows, cases).

    `fit` returns the constants, shape (rows, p): exponents or logarithms of factors. `left` returns data minus law. If
    scatter and errors do not explain the residuals, or if the scatter is unknown, the law is also fitted to data that
    are shifted by the residuals. These fits make the intervals wider. A constant becomes NaN if the derivatives of the
    law, at the fitted or at the `stated` constants, show that it is `undetermined`.
    """
    constants = fit(data)
    residuals = left(data, constants)
    if not bootstrap.chance(residuals, count) >= DOUBTFUL:
        constants = np.concatenate([constants, fit(bootstrap.moved(data[0], residuals[0]))])
    size = float(np.cbrt(np.finfo(float).eps))
    step = size * np.eye(constants.shape[1])
    free = np.zeros(constants.shape[1], dtype=bool)
    for about in (constants[0], constants[0] if stated is None else stated):
        effects = [left(data[:1], about[None] - each) - left(data[:1], about[None] + each) for each in step]
        free |= undetermined(np.concatenate(effects).T / (2 * size))
    constants = np.where(free, np.nan, constants)
    return Fitted(constants, residuals, count)


def undetermined(effects: FloatArray) -> BoolArray:
    """Return which constants of a law the data do not determine, from the derivatives of the law, shape (cases, p).

    A constant is changed by 1, and the remaining constants are fitted again. If the values of the law then change by
    less than `WITHIN` in every case, the constant is undetermined, because such small deviations do not count against a
    law.
    """
    largest = np.empty(effects.shape[1])
    for k in range(largest.size):
        others = np.delete(effects, k, axis=1)
        left = effects[:, k] - others @ np.linalg.lstsq(others, effects[:, k])[0]
        largest[k] = np.abs(left).max(initial=0.0)
    free: BoolArray = largest < WITHIN
    return free


def verdict(
    residuals: FloatArray,
    count: int,
    constants: int = 0,
    where: Callable[[int], str] | None = None,
    *,
    excluded: bool = False,
    logarithmic: bool = False,
) -> str:
    """Return a sentence on whether a law holds, from a stack of the relative deviations of the data from the law.

    `constants` is the number of constants that were fitted to the data. ``where(k)`` describes case k in words.
    `excluded` is true if the interval of a fitted constant does not contain the stated value; scatter then does not
    explain the deviations. `logarithmic` is described in `law_holds`.
    """
    if residuals.shape[1] <= constants:
        return law_holds(residuals[0], np.nan, constants)
    place = where(int(np.argmax(np.abs(residuals[0])))) if where else ""
    chance = bootstrap.chance(residuals, count)
    by_chance = None if excluded and not np.isnan(chance) else chance
    scatter = bootstrap.scatter(residuals, count)
    return law_holds(residuals[0], by_chance, constants, place, scatter, logarithmic=logarithmic)


def excludes(stack: FloatArray, count: int, stated: float) -> bool:
    """Return whether a stated value lies outside the interval of a constant; false if the interval is unknown."""
    low, high = bootstrap.interval(stack, count)
    return bool(stated < low or stated > high)


def short(number: float) -> str:
    """Return a number as text with two significant digits, such as ``550`` or ``0.023``."""
    return f"{float(f'{number:.2g}'):g}"


def law_holds(
    departures: FloatArray,
    chance: float | None,
    constants: int = 0,
    where: str = "",
    scatter: float = 0.0,
    *,
    logarithmic: bool = False,
) -> str:
    """Return a sentence on whether a law holds, from the relative deviations of the data.

    `chance` is the probability that scatter and errors alone cause such deviations. `chance` is NaN if this probability
    is unknown, and None if scatter and errors cannot cause the deviations. `scatter` is the rms deviation that scatter
    and errors alone exceed with a probability of 5 %. `scatter` is NaN for too few realisations, and infinite if an
    error is infinite; the law is then *not tested*. The verdict can be *yes* only if `scatter` is at most `WITHIN`, and
    *approximately* only if `scatter` is at most `APPROXIMATE`. If `logarithmic` is true, the deviations are differences
    of natural logarithms, and a large difference is described by a factor.
    """
    if departures.size <= constants:
        return f"not tested: {departures.size} cases for {constants} constants leave nothing to compare"
    rms, largest = 100 * np.sqrt(np.mean(departures**2)), 100 * np.max(np.abs(departures))
    size = max(rms, largest / 2)
    limit = 100 * (WITHIN if max(size, 100 * scatter) <= 100 * WITHIN else APPROXIMATE)
    if departures.size == 1:
        one = 100 * float(departures.flat[0])
        departs = f"departs by {_size(one, limit, logarithmic, '-' if one < 0 else '+')}"
        limits = f"limit {limit:g} %"
    else:
        mean, most = _size(rms, limit, logarithmic), _size(largest, 2 * limit, logarithmic)
        departs = f"departs by {mean} rms, at most {most}{f' at {where}' if where else ''}"
        limits = f"limits {limit:g} % and {2 * limit:g} %"
    if np.isnan(scatter) or (chance is not None and np.isnan(chance) and size > limit):
        return f"not tested: too few realisations to estimate the scatter; {departs}"
    if np.isinf(scatter):
        return f"not tested: errors of the results are unknown; {departs}"
    hidden = f"scatter alone may cause {_size(100 * scatter, np.nan, logarithmic)} rms"
    if size > limit and (chance is None or chance < DOUBTFUL):
        because = limits if chance is None else f"scatter alone would cause this with {_probability(chance)}"
        return f"no: {departs}; {because}"
    if size > limit:
        return f"not tested: {departs}, which scatter explains ({_probability(chance)})"
    if 100 * scatter > limit:
        return f"not tested: {departs}, but {hidden}"
    if limit == 100 * WITHIN:
        return f"yes: {departs}; {limits}"
    return f"approximately: {departs}; {limits if size > 100 * WITHIN else hidden}"


def _probability(chance: float | None) -> str:
    return f"probability {chance:.2g}" if chance else f"probability below {1 / bootstrap.RESAMPLES:g}"


def _size(percent: float, limit: float, logarithmic: bool, sign: str = "") -> str:
    """Return a departure as text: a percentage, or a factor if it is a large difference of logarithms.

    A percentage has two digits, or four digits if two digits would make it look equal to the limit. It has no
    exponent, and a percentage below 1e-4 % becomes 0.
    """
    if logarithmic and abs(percent) > 200 * APPROXIMATE:
        return f"a factor of {short(np.exp(percent / 100))}"
    number = abs(percent)
    text = f"{number:.2g}"
    text = text if text != f"{limit:.2g}" else f"{number:.4g}"
    if "e-" in text or text == "0":
        return "0 %"
    return f"{sign}{f'{float(text):.0f}' if 'e+' in text else text} %"
