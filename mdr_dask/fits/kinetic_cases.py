"""The cases of a series of velocity jumps, and the stacks of their means (`mdr_dask.bootstrap` defines stacks).

The velocity jumps at time t_0 from v_1 to v_2 = v_1 + dv. Friction is mu_1 before the jump and mu_2 long after the
jump, and d_mu_0 is its jump at t_0. The symbol tau means the relaxation time, H the Hurst exponent, and q_max the
largest wavenumber.
"""

from __future__ import annotations

import json
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.aggregation import companion
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.base import require

LEVELS = ("friction_coefficient_before", "friction_coefficient_jump", "friction_coefficient_after")
LEAST = 2  # smallest number of successful realisations of a case


@dataclass(frozen=True)
class Cases:
    """The cases of a series, with all axes flattened into one dimension.

    Attributes
    ----------
    data : Dataset
        The series. The last dimension is the realisation, or for transients the time, after the realisation.
    template : DataArray
        An array with the axes of the series; results get these axes.
    """

    data: xr.Dataset
    template: xr.DataArray

    @classmethod
    def of(cls, series: Mapping[str, xr.Dataset], *needed: str) -> Cases:
        """Return the cases of the only series; raise FitError if an output is missing."""
        data = next(iter(series.values()))
        missing = [name for name in needed if name not in data]
        if missing:
            raise FitError(f"expected the outputs {', '.join(needed)} in the store, got none of {', '.join(missing)}")
        if not is_jump(data):
            raise FitError("expected a jump of the velocity, got another loading history")
        if data.sizes["realisation"] < LEAST:
            raise FitError(f"expected at least {LEAST} realisations, got {data.sizes['realisation']}")
        template = data[LEVELS[0]].isel(realisation=0, drop=True)
        errors = [str(error.name) for name in needed if (error := companion(data, name)) is not None]
        data = data[[*needed, *errors]].load().transpose(*template.dims, "realisation", ...)
        return cls(data, template)

    @property
    def counts(self) -> NDArray[np.int64]:
        """Return the number of successful realisations of every case."""
        known = np.all(np.isfinite(np.stack([self.output(name) for name in LEVELS])), axis=0)
        counts: NDArray[np.int64] = known.sum(axis=1)
        return counts

    def count(self, used: Any = slice(None)) -> int:
        """Return the smallest number of successful realisations among some cases."""
        return int(self.counts[used].min(initial=self.data.sizes["realisation"]))

    def column(self, name: str) -> FloatArray:
        """Return a parameter for every case; raise FitError if the study does not have it."""
        require(self.data, name)
        column: FloatArray = np.asarray(self._like(self.data[name]), dtype=np.float64).ravel()
        return column

    def output(self, name: str) -> FloatArray:
        """Return an output, shape (cases, realisations, ...)."""
        array = np.asarray(self.data[name].values, dtype=np.float64)
        return array.reshape(-1, *array.shape[self.template.ndim :])

    def error(self, name: str) -> FloatArray:
        """Return the grid error of the mean of an output, shape (cases, ...); 0 if it is unknown."""
        error = companion(self.data, name)
        if error is None:
            return np.zeros_like(self.output(name)[:, 0])
        array = np.abs(self.output(str(error.name)))
        known = ~np.isnan(array)
        mean: FloatArray = np.where(known, array, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
        return mean

    def places(self, dims: Sequence[Hashable]) -> NDArray[np.int64]:
        """Return for every case the index of its values of some axes, in the flattened grid of these axes."""
        places = np.arange(int(np.prod([self.template.sizes[dim] for dim in dims], dtype=int)))
        shaped = xr.DataArray(places.reshape([self.template.sizes[dim] for dim in dims]), dims=list(dims))
        found: NDArray[np.int64] = np.asarray(self._like(shaped), dtype=np.int64).ravel()
        return found

    @property
    def times(self) -> FloatArray:
        """Return the times (t - t_0) / tau of the transient, from 0 on."""
        return np.concatenate([[0.0], self.data["relaxation_times"].values])

    @property
    def slope(self) -> FloatArray:
        """Return the rms slope of every case, which is the same for all its lines; NaN for smooth lines."""
        good = self.output("rms_slope")
        known = np.isfinite(good) & (good > 0)
        total: FloatArray = np.where(known, good, 0.0).sum(axis=1) / np.where(
            known.any(axis=1), known.sum(axis=1), np.nan
        )
        return total

    @property
    def passing(self) -> FloatArray:
        """Return v_1 tau q_max: the relaxation time over the time in which v_1 covers 1 / q_max."""
        return self.column("velocity") * self.column("relaxation_time") * self.wavenumber

    @property
    def wavenumber(self) -> FloatArray:
        """Return q_max = pi points / length of every case."""
        return np.pi * self.column("points") / self.column("length")

    def levels(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return stacks of mu_1, d_mu_0 and mu_2, shapes (1 + RESAMPLES + 2 groups, cases)."""
        outputs = np.stack([self.output(name).T for name in LEVELS], axis=1)
        stack = bootstrap.means(outputs + 0 * outputs.sum(axis=1, keepdims=True))  # a NaN in one makes all three NaN
        errors = np.stack([self.error(name) for name in LEVELS])
        if np.any(errors > 0):
            stack = np.concatenate([stack, bootstrap.moved(stack[0], errors)])
        before, jump, after = np.moveaxis(stack, 1, 0)
        return before, jump, after

    def relaxing(self) -> FloatArray:
        """Return mu - mu_2 of every realisation from t_0+ on, shape (cases, realisations, 1 + times)."""
        before, jump, after = (self.output(name) for name in LEVELS)
        start = (before + jump - after)[..., None]
        return np.concatenate([start, self.output("friction_coefficient") - after[..., None]], axis=-1)

    def relaxing_error(self) -> FloatArray:
        """Return the grid error of the mean of mu - mu_2, shape (cases, 1 + times).

        The error of mu includes the error of mu_2, which is therefore subtracted.
        """
        whole, after = self.error("friction_coefficient"), self.error(LEVELS[2])[:, None]
        trace = np.where(np.isinf(whole), np.inf, np.maximum(whole - np.where(np.isinf(after), 0.0, after), 0.0))
        return np.concatenate([self.error(LEVELS[1])[:, None], trace], axis=1)

    def _like(self, value: xr.DataArray) -> xr.DataArray:
        return value.broadcast_like(self.template).transpose(*self.template.dims)

    def found(self, values: NDArray[Any], unit: str, meaning: str) -> xr.DataArray:
        """Return values of all cases as an array with the axes of the series."""
        shaped = np.asarray(values).reshape(self.template.shape)
        axes = {dim: self.template[dim] for dim in self.template.dims if dim in self.template.coords}
        return xr.DataArray(shaped, axes, self.template.dims, attrs={"units": unit, "long_name": meaning})

    def constants(
        self, samples: Mapping[str, FloatArray], fields: Mapping[str, tuple[str, str]], positive: tuple[str, ...] = ()
    ) -> dict[str, xr.DataArray]:
        """Return constants and the ends of their intervals with the axes of the series, from stacks (rows, cases)."""
        result = {}
        for name, (unit, meaning) in fields.items():
            low, high = bootstrap.interval(samples[name], self.counts, name in positive)
            result[name] = self.found(samples[name][0], unit, meaning)
            result[f"{name}_low"] = self.found(low, unit, f"lower end of the 95 % interval of {name}")
            result[f"{name}_high"] = self.found(high, unit, f"upper end of the 95 % interval of {name}")
        return result


def is_jump(data: xr.Dataset) -> bool:
    """Return whether the loading history of all cases of a series is a sudden jump of the velocity."""
    varied = any(axis["path"].split(".")[0] == "protocol" for axis in data.attrs.get("axes", []))
    history = json.loads(data.attrs.get("parameters", "{}")).get("protocol") or {}
    return not varied and history.get("shape", "jump") == "jump"


def law_rate(number: FloatArray, hurst: FloatArray) -> FloatArray:
    """Return the rate of eq. 4.12 from v_1 tau q_max: its power is 1 below v_1 tau q_max = 1, and 1 - H above."""
    rate: FloatArray = np.where(number < 1, number, number ** (1 - hurst))
    return rate


def jump_numbers(cases: Cases) -> dict[str, FloatArray]:
    """Return stacks of the dimensionless numbers of the jump; zeta and xi are infinite or NaN where mu_1 is 0."""
    before, jump, after = cases.levels()
    change, slope = cases.column("velocity_change"), cases.slope
    with np.errstate(divide="ignore", invalid="ignore"):
        of_before = {"zeta": jump / before / change, "xi": (after / before - 1) / change}
    return {
        "before_over_slope": before / slope,
        "jump_over_slope": jump / change / slope,
        **of_before,
        "relaxing_over_slope": (before + jump - after) / slope,
    }


def rows_of(cases: Cases) -> list[tuple[str, NDArray[np.bool_]]]:
    """Return a label and a mask of cases for each Hurst exponent and for all cases together.

    A measured surface has no Hurst exponent, so the only label is ``all``.
    """
    if "hurst" not in cases.data:
        return [("all", np.ones(cases.counts.size, dtype=bool))]
    hurst = cases.column("hurst")
    rows = [(f"{value:.4g}", hurst == value) for value in np.unique(hurst)]
    return [*rows, ("all", np.ones(hurst.size, dtype=bool))] if len(rows) > 1 else rows
