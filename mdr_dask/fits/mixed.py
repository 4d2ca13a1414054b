"""Fit of one unknown of mixed lubrication to a table of measured contact probabilities, by simulation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, FitError
from mdr_dask.fits.base import DOUBTFUL, Fit
from mdr_dask.models.base import DataFile
from mdr_dask.tables import Column, read_table

PROBABILITY = "breakthrough_probability"
ERROR = "standard_error"
#: What can be fitted; of layer strength and thickness only the ratio is in the data, so one at a time.
UNKNOWNS = ("layer_shear_strength", "layer_thickness", "pressure_viscosity", "rms_roughness")
#: Increase of chi squared at the ends of a 95 % interval of one unknown, where all errors are known.
_REACH = 3.841459
_GRID = 4001


class Estimate(NamedTuple):
    """Best value of the unknown, its 95 % interval (NaN where it leaves the range simulated), and goodness of fit.

    `law_holds` says in words whether the simulation explains the measurements.
    """

    value: float
    low: float
    high: float
    chi_squared: float
    degrees_of_freedom: int
    rms_residual: float
    law_holds: str


def estimate(
    unknown: FloatArray, simulated: FloatArray, simulated_error: FloatArray, measured: FloatArray, error: FloatArray
) -> Estimate:
    """Return the value of an unknown at which simulated probabilities fit measured ones best.

    Parameters
    ----------
    unknown : array, shape (k,)
        Values simulated, positive and ascending.
    simulated, simulated_error : array, shape (n, k)
        Probability of every measured case at each value, and its error, of statistics and grid together.
    measured, error : array, shape (n,)
        Measured probabilities and their standard errors; NaN errors mean that the scatter about the fit is the error.

    Returns
    -------
    Estimate
        Of weighted least squares over a monotone cubic interpolation in the logarithm of the unknown. The interval is
        where chi squared rises by 3.84. Where the errors are unknown or do not explain the residuals, it rises by
        Student's t squared times chi squared per degree of freedom.

    Raises
    ------
    FitError
        If fewer than four values were simulated, fewer than two cases measured, or the best value lies at the end of
        the range simulated.
    """
    from scipy.interpolate import PchipInterpolator
    from scipy.stats import chi2, t

    if unknown.size < 4 or measured.size < 2:
        raise FitError(
            f"expected at least four values of the unknown and two measured cases, "
            f"got {unknown.size} and {measured.size}"
        )
    place = np.log(unknown)
    fine = np.linspace(place[0], place[-1], _GRID)
    curves = PchipInterpolator(place, simulated, axis=1)(fine)
    known = bool(np.all(np.isfinite(error)))
    variance = PchipInterpolator(place, simulated_error**2, axis=1)(fine) + (error[:, None] ** 2 if known else 0.0)
    if not known:
        variance = np.ones_like(variance)
    residual = measured[:, None] - curves
    chi = np.sum(residual**2 / np.maximum(variance, np.finfo(float).tiny), axis=0)
    best = int(np.argmin(chi))
    if best in (0, _GRID - 1):
        raise FitError(
            f"the best value lies at the end of the range simulated, {np.exp(fine[best]):.4g}; widen the range"
        )
    freedom = measured.size - 1
    chance = float(chi2.sf(chi[best], freedom)) if known else np.nan
    # scatter that is estimated from the residuals is itself known from so many only
    reach = _REACH if chance >= DOUBTFUL else t.ppf(0.975, freedom) ** 2 * chi[best] / freedom
    inside = chi <= chi[best] + reach
    low = np.nan if inside[0] else float(np.exp(fine[int(np.argmax(inside))]))
    high = np.nan if inside[-1] else float(np.exp(fine[_GRID - 1 - int(np.argmax(inside[::-1]))]))
    rms = float(np.sqrt(np.mean(residual[:, best] ** 2)))
    chi_squared = float(chi[best]) if known else np.nan
    return Estimate(
        float(np.exp(fine[best])), low, high, chi_squared, freedom, rms, _law_holds(rms, chi_squared, freedom, chance)
    )


def _law_holds(rms: float, chi_squared: float, freedom: int, chance: float) -> str:
    """Say in words whether the simulation explains the measurements."""
    residuals = f"residuals of {rms:.2g} rms"
    if np.isnan(chance):
        return f"not tested: the table gives no standard errors; {residuals}"
    compared = f"{residuals}, chi squared {chi_squared:.3g} of {freedom} (probability {chance:.2g})"
    if chance >= DOUBTFUL:
        return f"yes: the errors explain {compared}"
    return f"no: the errors do not explain {compared}"


def read_measured(file: DataFile, units: Mapping[str, str]) -> dict[str, FloatArray]:
    """Return the columns of a table of measured probabilities in SI.

    Parameters
    ----------
    file : DataFile
        A table with a heading; a column is a parameter of the model, ``breakthrough_probability`` or
        ``standard_error``, each with its unit in brackets: ``temperature [degC]``, ``breakthrough_probability [%]``.
    units : mapping of str to str
        SI units of the columns allowed.

    Raises
    ------
    DataError
        If a column is unknown, missing or holds something else than numbers.
    """
    least, above = {PROBABILITY: 0.0}, {ERROR: 0.0}
    columns = [
        Column(name, unit, needed=name == PROBABILITY, least=least.get(name), above=above.get(name))
        for name, unit in units.items()
    ]
    return read_table(file.read_text(), file.name, columns)


def fit_breakthrough(groups: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return the unknowns that make the simulation fit the measured table that the campaign names."""
    found = xr.Dataset()
    for name, dataset in groups.items():
        if PROBABILITY not in dataset:
            continue
        unknowns = [axis for axis in UNKNOWNS if axis in dataset[PROBABILITY].dims]
        if len(unknowns) == 1:
            _add(found, dataset, unknowns[0], _measured(dataset, name))
    if not found:
        raise FitError(f"expected a series that varies exactly one of {', '.join(UNKNOWNS)}, got none")
    return found


def _measured(dataset: xr.Dataset, series: str) -> dict[str, FloatArray]:
    parameters = json.loads(dataset.attrs.get("parameters", "{}"))
    if not parameters.get("measured"):
        raise DataError(f"series {series!r} names no table of measured probabilities; set `measured` in the campaign")
    units = {str(axis): dataset[axis].attrs.get("units", "1") for axis in _conditions(dataset)}
    return read_measured(DataFile.model_validate(parameters["measured"]), units | {PROBABILITY: "1", ERROR: "1"})


def _conditions(dataset: xr.Dataset) -> list[str]:
    """Return the axes on which measured cases lie."""
    return [str(dim) for dim in dataset[PROBABILITY].dims if dim != "realisation" and dim not in UNKNOWNS]


def _add(found: xr.Dataset, dataset: xr.Dataset, unknown: str, measured: Mapping[str, FloatArray]) -> None:
    """Fit one unknown and add its variables."""
    array = dataset[PROBABILITY].transpose(*_conditions(dataset), unknown, "realisation")
    places = tuple(_places(dataset, axis, measured) for axis in _conditions(dataset))
    values = array.values[places]
    if not places:
        raise FitError("expected measured cases along load, speed or temperature, got no such axis in the store")
    count = np.sum(np.isfinite(values), axis=-1)
    if np.any(count < 2):
        raise FitError("expected at least two realisations of every case that was measured")
    mean = np.nansum(values, axis=-1) / count
    variance = np.nansum((values - mean[..., None]) ** 2, axis=-1) / (count - 1) / count
    if f"{PROBABILITY}_error" in dataset:
        grid = dataset[f"{PROBABILITY}_error"].transpose(*array.dims).values[places]
        variance = variance + (np.nansum(grid, axis=-1) / count) ** 2
    error = np.sqrt(variance)
    probability = measured[PROBABILITY]
    result = estimate(
        dataset[unknown].values.astype(np.float64),
        mean,
        error,
        probability,
        measured.get(ERROR, np.full(probability.size, np.nan)),
    )
    attrs = {name: dataset[unknown].attrs[name] for name in ("units", "long_name") if name in dataset[unknown].attrs}
    for suffix, value in (("", result.value), ("_low", result.low), ("_high", result.high)):
        found[unknown + suffix] = ((), value, attrs)
    one = {"units": "1"}
    found[f"{unknown}_chi_squared"] = ((), result.chi_squared, one | {"long_name": "chi squared of the fit"})
    found[f"{unknown}_degrees_of_freedom"] = ((), result.degrees_of_freedom, one)
    found[f"{unknown}_rms_residual"] = ((), result.rms_residual, one | {"long_name": "rms of measured less simulated"})
    found["law_holds"] = ((), result.law_holds)


def _places(dataset: xr.Dataset, axis: str, measured: Mapping[str, FloatArray]) -> NDArray[np.intp]:
    """Return where the measured cases lie on an axis of the store."""
    values = dataset[axis].values.astype(np.float64)
    if axis not in measured:
        raise DataError(f"expected a column {axis} in the measured table, for the store varies it")
    distance = np.abs(measured[axis][:, None] - values)
    nearest = np.argmin(distance, axis=1)
    off = distance[np.arange(nearest.size), nearest] > 1e-6 * np.maximum(np.abs(measured[axis]), 1e-300)
    if np.any(off):
        raise DataError(f"the store has no {axis} of {measured[axis][off][0]:.6g}; add it to the campaign's axis")
    return np.asarray(nearest)


FITS: tuple[Fit, ...] = (
    Fit(
        "breakthrough",
        ("mixed_lubrication",),
        "one of tau0, h_c, alpha, rms from a table of measured contact probabilities",
        fit_breakthrough,
        apart=True,
    ),
)
