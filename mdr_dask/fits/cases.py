"""Functions that many fits use: collect the cases of a series in arrays, fit laws to them, make result variables.

For stacks, see `mdr_dask.bootstrap`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from scipy.optimize import OptimizeResult, least_squares

from mdr_dask import bootstrap
from mdr_dask.aggregation import companion
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import FITTED_LAW_HOLDS, LAW_HOLDS, Fitted, excludes, fitted, require, undetermined, verdict

Series = Mapping[str, xr.Dataset]
Variables = dict[str, xr.Variable]


def each(
    series: Series,
    inner: Callable[[xr.Dataset], list[str]],
    fit: Callable[[xr.Dataset], Variables],
    *outputs: str,
) -> xr.Dataset:
    """Divide the cases of a series into groups, fit a law to each group, and return the results as one Dataset.

    A group contains all cases along the dimensions that the function `inner` returns. There is one group for each
    combination of values along the other dimensions. A variable that `fit` does not return for a group is NaN or an
    empty text there. The first output must have no dimensions except the axes of the study and ``realisation``. Raise
    FitError if the series lacks one of the outputs.
    """
    data = next(iter(series.values()))
    missing = [name for name in outputs if name not in data]
    if missing:
        raise FitError(f"expected the outputs {', '.join(outputs)}, got a store without {', '.join(missing)}")
    data = data.load()
    used = ["realisation", *inner(data)]
    outer = [str(dim) for dim in data[outputs[0]].dims if dim not in used]
    sizes = [data.sizes[dim] for dim in outer]
    points = [fit(data.isel(dict(zip(outer, index, strict=True)))) for index in np.ndindex(*sizes)]
    found = {}
    for name in dict.fromkeys(name for point in points for name in point):
        known = next(point[name] for point in points if name in point)
        blank = "" if known.dtype.kind == "U" else np.nan
        values = np.stack([point[name].values if name in point else np.full(known.shape, blank) for point in points])
        found[name] = xr.Variable((*outer, *known.dims), values.reshape((*sizes, *known.shape)), known.attrs)
    return xr.Dataset(found, {dim: data[dim] for dim in outer if dim in data.coords})


def dimensions(data: xr.Dataset, *names: str) -> list[str]:
    """Return the dimensions along which any of the parameters `names` varies."""
    return sorted({str(dim) for name in names if name in data.coords for dim in data[name].dims})


def one_value(data: xr.Dataset, name: str) -> float:
    """Return the value of a parameter that is equal in all cases; raise FitError if this value is missing or varies."""
    require(data, name)
    values = data[name]
    if values.size != 1:
        raise FitError(
            f"expected the same {name} in all cases, or a separate axis for it, got {values.size} values that vary "
            "together with other parameters"
        )
    return float(values.item())


class Table(NamedTuple):
    """Values of an output and their discretisation errors, both divided by a scale, shape (cases, realisations).

    `columns` contains further numbers of each case, such as the load and the velocity.
    """

    values: FloatArray
    error: FloatArray
    columns: tuple[FloatArray, ...]

    def stack(self, used: Any = slice(None)) -> FloatArray:
        """Return the stack of the means of the `used` cases, shape (rows, cases)."""
        return bootstrap.with_errors(bootstrap.means(self.values[used].T), self.mean_error(used))

    def logarithms(self, used: Any = slice(None)) -> FloatArray:
        """Return the logarithms of the means of the `used` cases, as a stack.

        In the last rows of the stack, the logarithms are shifted by the relative discretisation errors. A logarithm
        with an infinite error is shifted by 1.
        """
        means = bootstrap.means(self.values[used].T)
        relative = self.mean_error(used) / means[0]
        return bootstrap.with_errors(bootstrap.logarithms(means), np.where(np.isinf(relative), 1.0, relative))

    def mean_error(self, used: Any = slice(None)) -> FloatArray:
        """Return the discretisation errors of the means of the `used` cases; 0 if every error of a case is unknown."""
        known = ~np.isnan(self.error[used])
        total = np.where(known, np.abs(self.error[used]), 0.0).sum(axis=1)
        mean: FloatArray = total / np.maximum(known.sum(axis=1), 1)
        return mean

    def count(self, used: Any = slice(None)) -> int:
        """Return the smallest number of successful realisations of the `used` cases."""
        return int(np.isfinite(self.values[used]).sum(axis=1).min())

    def mean(self) -> FloatArray:
        """Return the mean of every case; NaN for a case in which every realisation failed."""
        mean: FloatArray = bootstrap.means(self.values.T)[0]
        return mean


def table_of(data: xr.Dataset, scale: Any, *columns: xr.DataArray, output: str = "friction_coefficient") -> Table:
    """Return the values of an output in all cases, divided by a scale such as the rms slope, and further `columns`.

    If the study contains no discretisation errors of the output, the errors are 0.
    """
    values = data[output]
    error = companion(data, output)
    arrays = xr.broadcast(values / scale, (0 * values if error is None else error) / scale, *columns)
    cases = [dim for dim in arrays[0].dims if dim != "realisation"]
    count = arrays[0].sizes["realisation"]
    flat = [
        np.asarray(array.transpose(*cases, "realisation").values, dtype=np.float64).reshape(-1, count)
        for array in arrays
    ]
    return Table(flat[0], flat[1], tuple(column[:, 0] for column in flat[2:]))


def linear(design: FloatArray, logs: FloatArray, count: int) -> Fitted:
    """Fit a law that is linear in its constants to a stack of logarithms of data.

    `design` contains the derivatives of the law with respect to its constants, shape (constants, cases).
    """
    solve = np.linalg.pinv(design)
    return fitted(lambda rows: rows @ solve, lambda rows, constants: rows - constants @ design, logs, count)


def power_law(x: FloatArray, logs: FloatArray, count: int) -> Fitted:
    """Fit a straight line against x to a stack of logarithms; the constants are the slope and the value at x = 0."""
    return linear(np.vstack([x, np.ones(x.size)]), logs, count)


def stated_power(x: FloatArray, logs: FloatArray, power: float, count: int, where: Callable[[int], str]) -> str:
    """Return a sentence on whether data follow a power law with a stated exponent; the factor is fitted.

    `x` contains the logarithms of the abscissa, and `logs` is a stack of logarithms of the data.
    """
    rest = logs - power * x
    free = power_law(x, logs, count).constants[:, 0]
    if np.isnan(free[0]):
        return "not tested: the cases differ too little to determine the exponent"
    excluded = excludes(free, count, power)
    return verdict(rest - rest.mean(axis=1, keepdims=True), count, 1, where, excluded=excluded, logarithmic=True)


def nonlinear(
    model: Callable[[FloatArray], FloatArray],
    stated: FloatArray,
    logs: FloatArray,
    count: int,
    where: Callable[[int], str],
) -> tuple[Fitted, Variables]:
    """Fit a law to a stack of logarithms, and test the law with the stated and with the fitted constants.

    The function `model` takes constants, shape (rows, p), and returns the logarithms of the values of the law, shape
    (rows, cases). The constants `stated` are exponents or logarithms of factors. The law is fitted to the first row of
    `logs`. The constants of the other rows follow by linearisation. The second value returned contains the result
    variables of the deviations and of both tests.
    """

    def misfit(constants: FloatArray) -> FloatArray:
        residuals: FloatArray = (logs[0] - model(constants[None]))[0]
        return residuals

    best: OptimizeResult = least_squares(misfit, stated, method="lm")
    # an undetermined constant keeps its value in all rows, because even a small residual could change it by any amount
    solve = -np.linalg.pinv(np.where(undetermined(best.jac), 0.0, best.jac)).T

    def fit(rows: FloatArray) -> FloatArray:
        constants: FloatArray = best.x + (rows - model(np.broadcast_to(best.x, (len(rows), stated.size)))) @ solve
        return constants

    found = fitted(fit, lambda rows, constants: rows - model(constants), logs, count, stated)
    rest = logs - model(np.broadcast_to(stated, (len(logs), stated.size)))
    excluded = excludes(found.constants[:, 0], count, stated[0])
    sentence = verdict(rest, count, 0, where, excluded=excluded, logarithmic=True)
    errors: Variables = {}
    for end, which, left in (("", "fitted", found.residuals[0]), ("_stated", "stated", rest[0])):
        errors |= measure(f"rms_error{end}", rms(left), f"rms relative deviation with the {which} constants")
        errors |= measure(
            f"largest_error{end}", float(np.abs(left).max()), f"largest relative deviation with the {which} constants"
        )
    return found, errors | holds(sentence, found.holds(where))


def rms(left: FloatArray) -> float:
    """Return the root mean square of the residuals `left`."""
    return float(np.sqrt(np.mean(left**2)))


def constant(
    name: str, stack: FloatArray, count: int, long_name: str, positive: bool = False, unit: str = "1"
) -> Variables:
    """Return the result variables of a constant: the value of the constant and the ends of the interval."""
    low, high = bootstrap.interval(stack, count, positive)
    values = {name: stack[0], f"{name}_low": low, f"{name}_high": high}
    return {key: xr.Variable((), value, {"units": unit, "long_name": long_name}) for key, value in values.items()}


def measure(name: str, value: float | str, long_name: str) -> Variables:
    """Return the result variable of a number without a confidence interval, or of a sentence such as a verdict."""
    return {name: xr.Variable((), value, {"units": "1", "long_name": long_name})}


def holds(stated: str, with_fitted: str = "") -> Variables:
    """Return the result variable ``law_holds`` and, if `with_fitted` is given, ``fitted_law_holds``."""
    found = {"fitted_law_holds": xr.Variable((), with_fitted, FITTED_LAW_HOLDS)} if with_fitted else {}
    return found | {"law_holds": xr.Variable((), stated, LAW_HOLDS)}
