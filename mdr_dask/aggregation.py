"""Reduce results over realisations to means, standard deviations, quantiles and intervals.

The companion of an output is a variable with the discretisation errors of the output.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.errors import DataError, did_you_mean
from mdr_dask.models.base import Status

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
#: The text for cases with failed and successful realisations (see `has_biased_means`).
BIASED = "means over the other realisations of these cases may be biased"


@dataclass(frozen=True)
class Statistic:
    """A statistic over realisations: its name, its meaning and the function that computes it.

    The arguments of the function are an output, and its companion or None. The function returns None if it needs a
    companion and there is none.
    """

    name: str
    meaning: str
    compute: Callable[[xr.DataArray, xr.DataArray | None], xr.DataArray | None]


def has_biased_means(status: xr.DataArray) -> bool:
    """Return whether any case has both failed and successful realisations; the mean of such a case may be biased.

    A realisation that did not converge counts as failed.
    """
    if "realisation" not in status.dims:
        return False
    failed = status.isin([Status.FAILED.value, Status.NOT_CONVERGED.value]).any("realisation")
    return bool((failed & (status == Status.DONE.value).any("realisation")).any())


def count(array: xr.DataArray) -> xr.DataArray:
    """Return the number of successful realisations."""
    return array.count("realisation")


def mean(array: xr.DataArray) -> xr.DataArray:
    """Return the mean of the successful realisations; NaN for a case without a successful realisation."""
    return array.mean("realisation")


def standard_deviation(array: xr.DataArray) -> xr.DataArray:
    """Return the standard deviation of the successful realisations; NaN if fewer than two succeeded."""
    spare = count(array) - 1
    squares: xr.DataArray = (array - mean(array)) ** 2
    variance: xr.DataArray = squares.sum("realisation") / spare.where(spare > 0)
    return variance**0.5


def standard_error(array: xr.DataArray) -> xr.DataArray:
    """Return the standard error of the mean; NaN for fewer than two realisations."""
    number = count(array)
    return standard_deviation(array) / number.where(number > 0) ** 0.5


def grid_error(error: xr.DataArray) -> xr.DataArray:
    """Return the discretisation error of the mean: the mean of the known absolute errors; NaN if none is known."""
    return mean(abs(error))


def interval(array: xr.DataArray, error: xr.DataArray | None) -> xr.DataArray:
    """Return the lower and the upper end of the 95 % interval of the mean, along a new dimension ``bound``.

    The interval includes the discretisation errors `error`; an unknown error counts as 0. The ends are NaN for a case
    with fewer than two successful realisations.
    """
    count = array.sizes["realisation"]
    if error is not None:
        array = xr.concat([array.drop_vars("realisation", errors="ignore"), grid_error(error)], "realisation")
    bounds = _reduce(array, _interval, {"count": count}, "bound", 2)
    return bounds.assign_coords(bound=np.array(["low", "high"], dtype=object))


def mean_and_ends(array: xr.DataArray, error: xr.DataArray | None) -> tuple[xr.DataArray, xr.DataArray, xr.DataArray]:
    """Return the mean, the lower end and the upper end of the interval of the mean (see `interval`).

    If only one realisation of a case succeeded, the interval is the mean plus or minus the discretisation error. If
    this error is unknown, the ends are NaN.
    """
    array, error = array.compute(), None if error is None else error.compute()
    middle, ends = mean(array), interval(array, error)
    low, high = ends.isel(bound=0, drop=True), ends.isel(bound=1, drop=True)
    if error is None:
        return middle, low, high
    grid = grid_error(error)
    return middle, low.fillna(middle - grid), high.fillna(middle + grid)


def _interval(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return the ends of the 95 % intervals of means, shape (..., 2).

    The last axis of `values` contains the values of `count` realisations. One more entry may follow: the discretisation
    error of the mean, which counts as 0 if it is NaN.
    """
    flat = values.reshape(-1, values.shape[-1])
    bounds = np.full((len(flat), 2), np.nan)
    step = 2**20 // bootstrap.RESAMPLES  # number of rows in one step, limited to save memory
    for start in range(0, len(flat), step):
        rows = flat[start : start + step].T
        stack = bootstrap.means(rows[:count])
        error = np.where(np.isnan(rows[count:]), 0.0, rows[count:])
        stack = np.concatenate([stack, stack[0] + error, stack[0] - error])
        number = np.isfinite(rows[:count]).sum(axis=0)
        bounds[start : start + step] = np.transpose(bootstrap.interval(stack, number))
    return bounds.reshape(*values.shape[:-1], 2)


def quantiles(array: xr.DataArray) -> xr.DataArray:
    """Return the `QUANTILES` of the successful realisations along a new last dimension, interpolated linearly."""
    return _reduce(array, _quantiles, {}, "quantile", len(QUANTILES)).assign_coords(quantile=list(QUANTILES))


def _reduce(
    array: xr.DataArray, function: Callable[..., NDArray[np.float64]], arguments: dict[str, int], dim: str, size: int
) -> xr.DataArray:
    """Apply a function that replaces the dimension ``realisation`` by the dimension `dim`."""
    reduced: xr.DataArray = xr.apply_ufunc(
        function,
        array.chunk(realisation=-1) if array.chunks else array,
        kwargs=arguments,
        input_core_dims=[["realisation"]],
        output_core_dims=[[dim]],
        dask="parallelized",
        output_dtypes=[float],
        dask_gufunc_kwargs={"output_sizes": {dim: size}},
    )
    return reduced


def _quantiles(values: NDArray[np.float64]) -> NDArray[np.float64]:
    ordered = np.sort(values, axis=-1)
    last = np.maximum(np.isfinite(values).sum(axis=-1, keepdims=True) - 1, 0)
    position = np.asarray(QUANTILES) * last
    below = np.floor(position).astype(int)
    low = np.take_along_axis(ordered, below, axis=-1)
    high = np.take_along_axis(ordered, np.minimum(below + 1, last), axis=-1)
    return np.asarray(low + (position - below) * (high - low))


STATISTICS = (
    Statistic("mean", "mean over realisations", lambda array, _: mean(array)),
    Statistic("standard_deviation", "standard deviation over realisations", lambda array, _: standard_deviation(array)),
    Statistic("standard_error", "standard error of the mean over realisations", lambda array, _: standard_error(array)),
    Statistic(
        "grid_error",
        "discretisation error of the mean",
        lambda _, error: None if error is None else grid_error(error),
    ),
    Statistic("quantile", "quantiles over realisations", lambda array, _: quantiles(array)),
    Statistic("interval", "95 % interval of the mean over realisations, with discretisation errors", interval),
    Statistic("count", "number of realisations that succeeded", lambda array, _: count(array)),
)
NAMES = tuple(statistic.name for statistic in STATISTICS)


def companion(dataset: xr.Dataset, output: str) -> xr.DataArray | None:
    """Return the discretisation errors of an output, or None if the dataset does not contain these errors."""
    name = dataset[output].attrs.get("ancillary_variables")
    return dataset[name] if name in dataset.data_vars else None


def aggregate(dataset: xr.Dataset, statistics: Sequence[str] = NAMES) -> xr.Dataset:
    """Return statistics over the realisations of a dataset, as variables ``<output>_<statistic>``.

    The variable ``status``, the companions, and outputs without the dimension ``realisation`` are left out. Raise
    DataError if a statistic does not exist.
    """
    for name in statistics:
        if name not in NAMES:
            raise DataError(f"no statistic is called {name!r}{did_you_mean(name, NAMES)}")
    wanted = [statistic for statistic in STATISTICS if statistic.name in statistics]
    reduced = {}
    errors = {name: companion(dataset, name) for name in map(str, dataset.data_vars)}
    aside = {"status", *(str(error.name) for error in errors.values() if error is not None)}
    for name, error in errors.items():
        array = dataset[name]
        if name in aside or "realisation" not in array.dims:
            continue
        for statistic in wanted:
            result = statistic.compute(array, error)
            if result is None:
                continue
            units = "1" if statistic.name == "count" else array.attrs.get("units", "1")
            meaning = f"{array.attrs.get('long_name', name)}, {statistic.meaning}"
            reduced[f"{name}_{statistic.name}"] = result.assign_attrs(units=units, long_name=meaning)
    coordinates = {name: value for name, value in dataset.coords.items() if "realisation" not in value.dims}
    return xr.Dataset(reduced, attrs=dataset.attrs).assign_coords(coordinates)
