"""Calibration: estimate unknown parameters of a study from measured points.

The unknowns are the axes of the study that are not columns of the table of measured points.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.special import chdtri

from mdr_dask import models
from mdr_dask.arrays import BoolArray, FloatArray
from mdr_dask.campaign.measured import ZERO, Measured, read_measured, scatter
from mdr_dask.errors import DataError, FitError
from mdr_dask.fits.base import DOUBTFUL, Fit
from mdr_dask.fits.interpolation import FEWEST
from mdr_dask.fits.misfit import Residuals, law_holds
from mdr_dask.fits.posterior import (
    OPEN,
    Noise,
    Posterior,
    Product,
    at_ends,
    distance,
    intervals,
    likelihood,
    posterior,
    products,
    undetermined,
    unit_of,
    written,
)
from mdr_dask.fits.prediction import Prediction, prediction
from mdr_dask.physics.refine import CLOSE
from mdr_dask.tables import decoded
from mdr_dask.units import shown

#: If the table contains no measurement errors, or errors that do not explain the residuals, a calibration tries
#: `DEVIATIONS` sizes of the measurement error. The smallest size is `LEAST` times the rms residual of the best
#: prediction, because the scatter of the lines may cause most of the residual. No size is smaller than the measurement
#: error in the table. Chosen by trial.
LEAST, DEVIATIONS = 0.2, 14


@dataclass(frozen=True)
class Calibration:
    """The result of a calibration.

    `noises` are the possible measurement errors, and `units` the units of unknowns, conditions and output. If the
    measurement errors in the table do not explain the residuals, `contradicted` contains the residuals of a calibration
    with these errors. The posterior then uses larger measurement errors, and the intervals include the misfit.
    """

    measured: Measured
    prediction: Prediction
    posterior: Posterior
    noises: list[Noise]
    units: Mapping[str, str]
    contradicted: Residuals | None = None

    @property
    def unknowns(self) -> list[str]:
        """Names of the unknowns."""
        return [*self.prediction.unknowns]

    @cached_property
    def values(self) -> FloatArray:
        """The unknowns in SI units at the centre of each cell of the posterior, shape (cells, unknowns)."""
        return self.prediction.values(self.posterior.places)

    @cached_property
    def ends(self) -> BoolArray:
        """For each unknown, whether the lower and the upper end of its axis are open (see `OPEN`)."""
        return at_ends(self.posterior) > -OPEN

    @cached_property
    def free(self) -> list[int]:
        """Indices of the unknowns that the data do not determine."""
        return undetermined(self.posterior, self.ends)

    @cached_property
    def products(self) -> list[Product]:
        """Products of powers of undetermined unknowns; the data determine the products, but not the unknowns."""
        return products(self.posterior, self.values, self.free)

    def name_and_unit(self, product: Product) -> tuple[str, str]:
        """Return a product as text, and the unit of the product."""
        units = [self.units[name] for name in self.unknowns]
        return written(self.unknowns, product.exponents), unit_of(units, product.exponents)

    @cached_property
    def residuals(self) -> Residuals:
        """Residuals of the prediction for the most probable unknowns; `contradicted` if it is not None."""
        if self.contradicted is not None:
            return self.contradicted
        measured, predicted = self.measured, self.prediction(self.posterior.places[[self.posterior.best]])
        noise, _ = self.noise
        left = measured.values - predicted.mean[0]
        variance = noise**2 + predicted.alone[0] + (predicted.together[0] ** 2).sum(axis=-1)
        squares, _ = distance(measured.values, predicted, noise[None] ** 2)
        freedom = left.size - (len(self.unknowns) - len(self.free) + len(self.products))
        relative, errors = np.sqrt(np.array([np.mean(left**2), np.mean(variance)]) / np.mean(measured.values**2))
        chi_squared = float(squares[0]) if measured.errors is not None else np.nan
        return Residuals(left / np.sqrt(variance), float(relative), chi_squared, freedom, float(errors))

    @property
    def law_holds(self) -> str:
        """Sentence on whether the model explains the measured points."""
        return law_holds(self.residuals, self.measured.conditions)

    @cached_property
    def noise(self) -> tuple[FloatArray, bool]:
        """Standard errors of the measured points, and whether these errors are proportional to the predicted values."""
        shares = self.posterior.weights @ self.posterior.noise
        cuts = np.cumsum([noise.sizes.size for noise in self.noises])[:-1]
        parts = np.split(shares, cuts)
        likely = int(np.argmax([part.sum() for part in parts]))
        noise, part = self.noises[likely], parts[likely]
        size = float(part @ noise.sizes / part.sum())
        pattern = np.abs(self.best) if noise.pattern is None else noise.pattern
        return size * pattern, noise.pattern is None

    @cached_property
    def best(self) -> FloatArray:
        """Prediction for the most probable unknowns, shape (points,)."""
        place = self.posterior.places[self.posterior.best]
        best: FloatArray = self.prediction(place[None]).mean[0]
        return best


def calibrate(dataset: xr.Dataset, measured: Measured) -> Calibration:
    """Estimate the one to four unknowns of a grid study from measured points.

    The prior of an unknown is uniform over the range of its axis. If the axis is spaced logarithmically, the logarithm
    of the unknown has the uniform prior. The measured values are assumed to be normally distributed about the
    prediction. The covariance of the measured values has three parts: measurement errors; scatter of the rough lines,
    most of which is common to all points; and errors of grid and interpolation. The error of grid and interpolation of
    a point is the sum of two equal parts: one part is common to all points, and the other part is independent for each
    point.

    If the table contains no measurement errors, the logarithm of the size of the measurement errors has a uniform
    prior. The measurement errors are then assumed to be either equal for all points or, if all measured values are
    positive, proportional to the predicted values.

    If the table contains measurement errors that do not explain the residuals, the calibration is repeated with larger
    measurement errors. Raise FitError if a measurement error in the table is 0, if there are too few points, or if the
    study is not suitable (see `prediction`).
    """
    if measured.errors is not None and not measured.errors.all():
        raise FitError(f"{measured.source}: {ZERO}")
    predicted = prediction(dataset, measured)
    named = (*predicted.unknowns, *measured.conditions, measured.output)
    units = {name: str(dataset[name].attrs.get("units", "1")) for name in named}
    if measured.errors is None:
        noises = _unknown_noises(predicted, measured)
        return Calibration(measured, predicted, _posterior(predicted, measured, noises), noises, units)
    noises = [Noise(np.ones(1), measured.errors)]
    found = Calibration(measured, predicted, _posterior(predicted, measured, noises), noises, units)
    if not found.residuals.chance < DOUBTFUL:
        return found
    sizes = _sizes(np.sqrt(found.residuals.chi_squared / measured.values.size), measured.values.size, 1)
    noises = [Noise(np.maximum(sizes, 1.0), measured.errors)]
    wider = _posterior(predicted, measured, noises)
    return Calibration(measured, predicted, wider, noises, units, found.residuals)


def _posterior(predicted: Prediction, measured: Measured, noises: list[Noise]) -> Posterior:
    return posterior(likelihood(predicted, measured.values, noises), len(predicted.unknowns))


def _unknown_noises(predicted: Prediction, measured: Measured) -> list[Noise]:
    """Return possible measurement errors that are about as large as the residuals.

    In the first item of the result, the errors of all points have the same size. If all measured values are positive, a
    second item has errors that are proportional to the predicted values.
    """
    values, count = measured.values, measured.values.size
    unknowns = len(predicted.unknowns)
    if count <= unknowns:
        raise FitError(
            f"expected more than {unknowns} measured points for {unknowns} unknowns, got {count}, and the table has no "
            "measurement errors; add points, or a column standard_error"
        )
    shares = bool(np.all(values > 0))
    least = np.full(2, np.inf)

    def by_residuals(places: FloatArray) -> FloatArray:
        mean = predicted(places).mean
        size = np.maximum(np.abs(mean), CLOSE * np.abs(values).max())
        squares = np.stack([((values - mean) ** 2).mean(axis=1), ((values / size - 1) ** 2).mean(axis=1)], axis=1)
        squares = np.maximum(squares, CLOSE**2 * np.array([np.mean(values**2), 1.0]))
        least[:] = np.minimum(least, squares.min(axis=0))
        density: FloatArray = -count / 2 * np.log(squares)
        density[:, 1] -= np.log(size).sum(axis=1)
        return density if shares else density[:, :1]

    posterior(by_residuals, unknowns)
    equal, relative = (_sizes(float(size), count, unknowns) for size in np.sqrt(least))
    return [Noise(equal, np.ones(count)), *([Noise(relative, None)] if shares else [])]


def _sizes(residual: float, count: int, unknowns: int) -> FloatArray:
    """Return possible sizes of the measurement error, from the rms `residual` of the best prediction.

    The true error exceeds the largest size with a probability of 0.1 %.
    """
    most = float(np.sqrt(count / chdtri(max(1, count - unknowns), 0.999)))
    return np.asarray(residual * np.geomspace(LEAST, most, DEVIATIONS))


def measured_of(dataset: xr.Dataset, wanted: Collection[str] = ()) -> Measured:
    """Return the measured points stored with a study; of several measured outputs, use the one in `wanted`.

    Raise FitError if the study has no table of measurements.
    """
    table = dataset.attrs.get("measured")
    if not table:
        raise FitError(
            "expected a table of measurements: give measured: {table: rig.csv} in the campaign, or --measured FILE"
        )
    companions = {dataset[name].attrs.get("ancillary_variables") for name in dataset.data_vars}
    outputs = {
        str(name): str(array.attrs.get("units", "1"))
        for name, array in dataset.data_vars.items()
        if name != "status" and name not in companions
    }
    conditions = {
        str(name): str(axis.attrs.get("units", "1"))
        for name, axis in dataset.coords.items()
        if name not in ("realisation", "case") and axis.dtype.kind in "fiu"
    }
    varied = {axis["name"] for axis in dataset.attrs.get("axes", ())}  # a selection may have left one value of an axis
    axes = {name: dataset[name].to_numpy() for name in conditions if dataset[name].ndim or name in varied}
    declared = models.load(dataset.attrs["model"]).outputs if "model" in dataset.attrs else ()
    dims = {each.name: each.dims for each in declared}
    return read_measured(table["text"], table["name"], conditions, outputs, axes, dims, wanted)


def with_table(groups: Mapping[str, xr.Dataset], table: Any) -> dict[str, xr.Dataset]:
    """Return the series of a study with another table of measured points, given as a path or a pandas DataFrame."""
    if hasattr(table, "to_csv"):
        named = {"name": "measured", "text": table.to_csv(index=False)}
    else:
        try:
            named = {"name": Path(table).name, "text": decoded(Path(table).read_bytes(), str(table))}
        except OSError as error:
            raise DataError(f"{table}: {error.strerror}") from None
    return {key: data.assign_attrs(measured=named) for key, data in groups.items()}


def calibration(groups: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Calibrate a series. Return the values, intervals and correlations of the unknowns."""
    (dataset,) = groups.values()
    measured = measured_of(dataset)
    meaning = dataset[measured.output].attrs.get("long_name", measured.output)
    compared = f"{measured.values.size} points, compared with {measured.output}: {meaning}"
    few = {name: dataset[name] for name in measured.conditions if dataset[name].size < FEWEST}
    units = {name: str(held.attrs.get("units", "1")) for name, held in few.items()}
    compared = "; ".join(filter(None, [compared, measured.remark, *scatter(measured, few, units)]))
    return summary(calibrate(dataset, measured)).assign(measured=((), compared, {"units": "1"}))


def summary(found: Calibration) -> xr.Dataset:
    """Return a calibration as a Dataset without dimensions."""
    variables: dict[str, tuple[tuple[()], object, dict[str, str]]] = {}
    for k, name in enumerate(found.unknowns):
        attributes = {"units": found.units[name], "long_name": name.replace("_", " ")}
        ends = intervals(found.values[:, k], found.posterior.weights)
        if k in found.free:
            ends = dict.fromkeys(ends, np.nan) | _bound(found, k)
        variables |= {name + end: ((), value, attributes) for end, value in ends.items()}
    for product in found.products:
        name, unit = found.name_and_unit(product)
        ends = intervals(product.values, found.posterior.weights)
        variables |= {name + end: ((), value, {"units": unit, "long_name": name}) for end, value in ends.items()}
    pure = {"units": "1"}
    for one, other in combinations((k for k in range(len(found.unknowns)) if k not in found.free), 2):
        name = f"correlation_{found.unknowns[one]}_{found.unknowns[other]}"
        variables[name] = ((), _correlation(found, one, other), pure)
    errors, are_shares = found.noise
    output = found.measured.output
    if found.measured.errors is None and are_shares:
        share = float(np.mean(errors / np.abs(found.best)))
        about = {**pure, "long_name": "relative error of measurement, estimated from the residuals"}
        variables["relative_measurement_error"] = ((), share, about)
    elif found.measured.errors is None:
        about = {"units": found.units[output], "long_name": "error of measurement, estimated from the residuals"}
        variables["measurement_error"] = ((), float(errors[0]), about)
    if np.isfinite(found.residuals.chi_squared):
        variables["chi_squared"] = ((), found.residuals.chi_squared, pure)
    variables |= {
        "degrees_of_freedom": ((), found.residuals.freedom, pure),
        "rms_residual": ((), found.residuals.relative, {**pure, "long_name": "rms residual over rms measured value"}),
        "determined": ((), sentence(found), {**pure, "long_name": "unknowns that the data determine"}),
        "law_holds": ((), found.law_holds, pure),
    }
    counts = {"output": output, "points": found.measured.values.size, "realisations": found.prediction.realisations}
    return xr.Dataset(variables, attrs=counts)


def _bound(found: Calibration, k: int) -> dict[str, float]:
    """Return the ends of the one-sided interval of unknown `k`.

    The result is empty unless `k` is the only undetermined unknown and exactly one end of its axis is open.
    """
    low, high = found.ends[k]
    if found.free != [k] or low == high:
        return {}
    likely = found.values[found.posterior.density > found.posterior.density.max() - OPEN, k]
    if high:
        return {"_low": float(likely.min()), "_high": np.inf}
    least = 0.0 if found.prediction.scales[k].logarithmic else -np.inf
    return {"_low": least, "_high": float(likely.max())}


def _correlation(found: Calibration, one: int, other: int) -> float:
    both = np.cov(found.posterior.places[:, [one, other]].T, aweights=found.posterior.weights, bias=True)
    return float(both[0, 1] / np.sqrt(both[0, 0] * both[1, 1]))


def sentence(found: Calibration) -> str:
    """Return a sentence on which unknowns the data determine; it also says if the model does not explain the data."""
    start = (
        "the model does not explain the measured points; with errors large enough to explain the residuals, "
        if found.law_holds.startswith("no:")
        else ""
    )
    free = [found.unknowns[k] for k in found.free]
    if not free:
        return f"{start}every unknown is determined"
    known = [name for name in found.unknowns if name not in free]
    for product in found.products:
        name, unit = found.name_and_unit(product)
        ends = intervals(product.values, found.posterior.weights)
        half = (ends["_high"] - ends["_low"]) / 2 / ends[""]
        known.append(f"{name} ({ends['']:.3g}{'' if unit == '1' else ' ' + unit} +- {100 * half:.2g} %)")
    only = f"only {' and '.join(known)} {'is' if len(known) == 1 else 'are'} determined; " if known else ""
    bound = _bound(found, found.free[0])
    if bound:
        side, end = ("below", bound["_low"]) if found.ends[found.free[0], 1] else ("above", bound["_high"])
        at = shown(end, found.units[free[0]])
        return f"{start}{only}{free[0]} is only bounded from {side}, at {at}"
    no_number = f"no number is given for {' and '.join(free)}"
    return f"{start}{only or 'nothing is determined within the ranges of the study; '}{no_number}"


FITS: tuple[Fit, ...] = (
    Fit(
        "calibration",
        (),
        "unknown parameters from the table `measured`: the axes of the study that are not columns of this table",
        calibration,
    ),
)
