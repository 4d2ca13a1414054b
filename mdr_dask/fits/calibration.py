"""Unknown parameters from measured points: the posterior over the grid of a study, and what the data leave open."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from scipy.stats import chi2

from mdr_dask.arrays import FloatArray
from mdr_dask.campaign.measured import Measured, read_measured, unknowns
from mdr_dask.errors import DataError, FitError
from mdr_dask.fits import determined
from mdr_dask.fits.base import DOUBTFUL, Fit
from mdr_dask.fits.misfit import Residuals, law_holds
from mdr_dask.fits.posterior import DEVIATIONS, Likelihood, Noise, Posterior, distance, posterior
from mdr_dask.fits.prediction import Prediction, prediction

#: Share of the residuals below which the measurement is not held to be better.
LEAST = 0.2
#: Fewest numbers that a sum of squares can be told from rounding in.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Calibration:
    """What measured points say of the unknowns of a study.

    Parameters
    ----------
    measured : Measured
    prediction : Prediction
        What the study predicts at the measured points.
    posterior : Posterior
    noises : list of Noise
        Errors of measurement that were held possible.
    units : dict of str to str
        Of unknowns, conditions and the output.
    contradicted : Residuals or None
        What the errors of the table do not explain, and the intervals therefore hold as errors of measurement.
    """

    measured: Measured
    prediction: Prediction
    posterior: Posterior
    noises: list[Noise]
    units: Mapping[str, str]
    contradicted: Residuals | None = None

    @property
    def unknowns(self) -> list[str]:
        """Names of the axes that the table does not name."""
        return [*self.prediction.unknowns]

    @cached_property
    def values(self) -> FloatArray:
        """The unknowns in SI, shape (cells, unknowns)."""
        return self.prediction.values(self.posterior.places)

    @cached_property
    def ends(self) -> list[determined.Ends]:
        """At which ends of its axis each unknown is open."""
        return determined.open_ends(self.posterior)

    @cached_property
    def free(self) -> list[int]:
        """Places of the unknowns that the data do not determine."""
        return determined.undetermined(self.posterior, self.ends)

    @cached_property
    def products(self) -> list[determined.Product]:
        """What they determine of those."""
        return determined.products(self.posterior, self.values, self.free)

    @cached_property
    def residuals(self) -> Residuals:
        """What the best prediction leaves."""
        return self.contradicted or _residuals(self)

    @property
    def law_holds(self) -> str:
        """Whether the model explains the points, in words."""
        return law_holds(self.residuals, self.measured.conditions)

    @cached_property
    def noise(self) -> tuple[FloatArray, bool]:
        """Standard deviations of the measured points at the best cell, and whether they are shares of the values."""
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
        """Prediction of the best cell, shape (points,)."""
        place = self.posterior.places[self.posterior.best]
        best: FloatArray = self.prediction(place[None]).mean[0]
        return best


def calibrate(dataset: xr.Dataset, measured: Measured) -> Calibration:
    """Return the posterior of the unknowns of a study from measured points.

    Parameters
    ----------
    dataset : Dataset
        A group of a study that is a grid. Its axes that are not among the conditions measured are the unknowns, one to
        four; each is held to be evenly likely over its axis beforehand, on its natural scale.
    measured : Measured

    Raises
    ------
    FitError, DataError
        If the study cannot be compared with the table.

    Notes
    -----
    The likelihood is normal. Its covariance is the sum of errors of measurement, of the scatter of the lines, which all
    cases share, and of half of the estimated errors of grid and interpolation, once for all points with one sign and
    once for each alone. Errors of measurement that are not given are equal, or equal shares of the values, of a size
    that is evenly likely in its logarithm.
    """
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
    return posterior(Likelihood(predicted, measured.values, noises), len(predicted.unknowns))


def _unknown_noises(predicted: Prediction, measured: Measured) -> list[Noise]:
    """Return errors of measurement of about the size of the residuals, equal ones and equal shares of the values."""
    values, count = measured.values, measured.values.size
    unknowns = len(predicted.unknowns)
    if count <= unknowns:
        raise FitError(
            f"{count} measured points without errors cannot tell {unknowns} unknowns; add points, or a column "
            "standard_error"
        )
    shares = bool(np.all(values > 0))
    least = np.full(2, np.inf)

    def by_residuals(places: FloatArray) -> FloatArray:
        mean = predicted(places).mean
        size = np.maximum(np.abs(mean), _ROUNDING * np.abs(values).max())
        squares = np.stack([((values - mean) ** 2).mean(axis=1), ((values / size - 1) ** 2).mean(axis=1)], axis=1)
        squares = np.maximum(squares, _ROUNDING**2 * np.array([np.mean(values**2), 1.0]))
        least[:] = np.minimum(least, squares.min(axis=0))
        density: FloatArray = -count / 2 * np.log(squares)
        density[:, 1] -= np.log(size).sum(axis=1)
        return density if shares else density[:, :1]

    posterior(by_residuals, unknowns)
    equal, relative = (_sizes(float(size), count, unknowns) for size in np.sqrt(least))
    return [Noise(equal, np.ones(count)), *([Noise(relative, None)] if shares else [])]


def _sizes(residual: float, count: int, unknowns: int) -> FloatArray:
    """Return standard deviations around that of residuals, up to those that leave so little once in 1000 times."""
    spare = max(1, count - unknowns)
    most = min(100.0, float(np.sqrt(count / chi2.ppf(0.001, spare))))
    return np.asarray(residual * np.geomspace(LEAST, most, DEVIATIONS))


def _residuals(found: Calibration) -> Residuals:
    """Return what the best prediction leaves of measured points."""
    place = found.posterior.places[found.posterior.best]
    predicted = found.prediction(place[None])
    noise, _ = found.noise
    left = found.measured.values - predicted.mean[0]
    variance = noise**2 + predicted.alone[0] + (predicted.together[0] ** 2).sum(axis=-1)
    squares = distance(found.measured.values, predicted, noise[None] ** 2)[0]
    known = found.measured.errors is not None
    freedom = left.size - (len(found.unknowns) - len(found.free) + len(found.products))
    relative = float(np.sqrt(np.mean(left**2) / np.mean(found.measured.values**2)))
    return Residuals(left / np.sqrt(variance), relative, float(squares[0]) if known else np.nan, freedom)


def measured_of(dataset: xr.Dataset) -> Measured:
    """Return the table that a study carries, or that was given to it.

    Raises
    ------
    FitError, DataError
        If there is none, or it is of no output of the study.
    """
    table = dataset.attrs.get("measured")
    if not table:
        raise FitError("no table of measurements: give measured: {table: rig.csv} in the campaign, or --measured FILE")
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
    parameters = json.loads(dataset.attrs.get("parameters", "{}"))
    structures = [key for key, value in parameters.items() if isinstance(value, dict)]
    return read_measured(table["text"], table["name"], conditions, outputs, structures)


def with_table(groups: Mapping[str, xr.Dataset], table: Any) -> dict[str, xr.Dataset]:
    """Return the groups of a study with another table of measurements: its path, or a pandas DataFrame."""
    named = {"name": "measured", "text": table.to_csv(index=False)} if hasattr(table, "to_csv") else read_file(table)
    return {key: data.assign_attrs(measured=named) for key, data in groups.items()}


def read_file(path: str | Path) -> dict[str, str]:
    """Return the table of a file as a study carries it."""
    path = Path(path)
    try:
        return {"name": path.name, "text": path.read_text(encoding="utf-8-sig")}
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: expected text in UTF-8: {error.reason} at {error.start}") from None
    except OSError as error:
        raise DataError(f"{path}: {error.strerror}") from None


def calibration(groups: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Return values, intervals and correlations of the unknowns of a series, and what its data do not determine."""
    (dataset,) = groups.values()
    return summary(calibrate(dataset, measured_of(dataset)))


def summary(found: Calibration) -> xr.Dataset:
    """Return what was found as a Dataset without dimensions."""
    variables: dict[str, tuple[tuple[()], object, dict[str, str]]] = {}
    for k, name in enumerate(found.unknowns):
        attributes = {"units": found.units[name], "long_name": name.replace("_", " ")}
        ends = _intervals(found.values[:, k], found.posterior.weights)
        if k in found.free:
            ends = dict.fromkeys(ends, np.nan) | _bound(found, k)
        variables |= {name + end: ((), value, attributes) for end, value in ends.items()}
    for product in found.products:
        name = determined.written(found.unknowns, product.exponents)
        unit = determined.unit_of([found.units[each] for each in found.unknowns], product.exponents)
        ends = _intervals(product.values, found.posterior.weights)
        variables |= {name + end: ((), value, {"units": unit, "long_name": name}) for end, value in ends.items()}
    pure = {"units": "1"}
    for one, other in combinations((k for k in range(len(found.unknowns)) if k not in found.free), 2):
        name = f"correlation_{found.unknowns[one]}_{found.unknowns[other]}"
        variables[name] = ((), _correlation(found, one, other), pure)
    errors, are_shares = found.noise
    output = found.measured.output
    if found.measured.errors is None and are_shares:
        share = float(np.mean(errors / np.abs(found.best)))
        variables["relative_measurement_error"] = ((), share, {**pure, "long_name": "estimated from the residuals"})
    elif found.measured.errors is None:
        about = {"units": found.units[output], "long_name": "estimated from the residuals"}
        variables["measurement_error"] = ((), float(errors[0]), about)
    variables |= {
        "chi_squared": ((), found.residuals.chi_squared, pure),
        "degrees_of_freedom": ((), found.residuals.freedom, pure),
        "rms_residual": ((), found.residuals.relative, {**pure, "long_name": "rms residual over rms measured"}),
        "determined": ((), sentence(found), {**pure, "long_name": "what the data determine"}),
        "law_holds": ((), found.law_holds, pure),
    }
    counts = {"output": output, "points": found.measured.values.size, "realisations": found.prediction.realisations}
    return xr.Dataset(variables, attrs=counts)


def _intervals(values: FloatArray, weights: FloatArray) -> dict[str, float]:
    """Return the median and the ends of the intervals."""
    return dict(zip(determined.ENDS, determined.quantiles(values, weights, determined.SHARES).tolist(), strict=True))


def _bound(found: Calibration, k: int) -> dict[str, float]:
    """Return the interval of an unknown that is bounded on one side, where no other is free."""
    low, high = found.ends[k]
    if found.free != [k] or low == high:
        return {}
    likely = found.values[found.posterior.density > found.posterior.density.max() - determined.OPEN, k]
    return {"_low": float(likely.min()), "_high": np.inf} if high else {"_low": -np.inf, "_high": float(likely.max())}


def _correlation(found: Calibration, one: int, other: int) -> float:
    both = np.cov(found.posterior.places[:, [one, other]].T, aweights=found.posterior.weights, bias=True)
    return float(both[0, 1] / np.sqrt(both[0, 0] * both[1, 1]))


def sentence(found: Calibration) -> str:
    """Say what the data determine, and what they do not."""
    free = [found.unknowns[k] for k in found.free]
    if not free:
        return "every unknown is determined"
    known = [name for name in found.unknowns if name not in free]
    for product in found.products:
        name = determined.written(found.unknowns, product.exponents)
        unit = determined.unit_of([found.units[each] for each in found.unknowns], product.exponents)
        ends = _intervals(product.values, found.posterior.weights)
        half = (ends["_high"] - ends["_low"]) / 2 / ends[""]
        known.append(f"{name} ({ends['']:.3g}{'' if unit == '1' else ' ' + unit} +- {half:.2g} of it)")
    for k in found.free:
        bound = _bound(found, k)
        if bound:
            side = (
                f"from below, at {bound['_low']:.4g}" if found.ends[k].high else f"from above, at {bound['_high']:.4g}"
            )
            return " and ".join([*known, f"{free[0]} is bounded {side}, only"])
    lost = f"no number is given for {' and '.join(free)}"
    if not known:
        return f"nothing is determined within the ranges of the study; {lost}"
    return f"only {' and '.join(known)} {'is' if len(known) == 1 else 'are'} determined; {lost}"


FITS: tuple[Fit, ...] = (
    Fit(
        "calibration",
        (),
        "axes that the table `measured` does not name, from the measured points: values, intervals, what is open",
        calibration,
        apart=True,
        constants=unknowns,
    ),
)
