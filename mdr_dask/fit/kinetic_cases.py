"""The cases of a series of velocity jumps, with means over resamples of their realisations."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mdr_dask import bootstrap
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError

LEVELS = ("friction_coefficient_before", "friction_coefficient_jump", "friction_coefficient_after")
LEAST = 2  # realisations of a case that must have succeeded


@dataclass(frozen=True)
class Cases:
    """A series, its axes flattened.

    Attributes
    ----------
    data : Dataset
        The series, realisations last but for the times.
    template : DataArray
        Its axes, for what is found.
    """

    data: xr.Dataset
    template: xr.DataArray

    @classmethod
    def of(cls, series: Mapping[str, xr.Dataset], *needed: str) -> Cases:
        """Take the only series; raise FitError where it lacks an output."""
        data = next(iter(series.values()))
        missing = [name for name in needed if name not in data]
        if missing:
            raise FitError(f"expected the outputs {', '.join(needed)} in the store, got none of {', '.join(missing)}")
        if data.sizes["realisation"] < LEAST:
            raise FitError(f"expected at least {LEAST} realisations, got {data.sizes['realisation']}")
        template = data[LEVELS[0]].isel(realisation=0, drop=True)
        data = data[[*needed]].load().transpose(*template.dims, "realisation", ...)
        return cls(data, template)

    @property
    def count(self) -> int:
        """Return the number of realisations."""
        return int(self.data.sizes["realisation"])

    def column(self, name: str) -> FloatArray:
        """Return a parameter for every case."""
        column: FloatArray = np.asarray(self._like(self.data[name]), dtype=np.float64).ravel()
        return column

    def output(self, name: str) -> FloatArray:
        """Return an output, shape (cases, realisations, ...)."""
        array = np.asarray(self.data[name].values, dtype=np.float64)
        return array.reshape(-1, *array.shape[self.template.ndim :])

    def places(self, dims: Sequence[Hashable]) -> NDArray[np.int64]:
        """Return which point of some of the axes every case lies at."""
        places = np.arange(int(np.prod([self.template.sizes[dim] for dim in dims], dtype=int)))
        shaped = xr.DataArray(places.reshape([self.template.sizes[dim] for dim in dims]), dims=list(dims))
        found: NDArray[np.int64] = np.asarray(self._like(shaped), dtype=np.int64).ravel()
        return found

    @property
    def slope(self) -> FloatArray:
        """Return the rms slope of every case, which all its lines have."""
        good = self.output("rms_slope")
        known = np.isfinite(good)
        total: FloatArray = np.where(known, good, 0.0).sum(axis=1) / np.where(
            known.any(axis=1), known.sum(axis=1), np.nan
        )
        return total

    @property
    def passing(self) -> FloatArray:
        """Return v_1 tau q_max, the relaxation time over the time to pass 1 / q_max; q_max = pi points / length."""
        return self.column("velocity") * self.column("relaxation_time") * self.wavenumber

    @property
    def wavenumber(self) -> FloatArray:
        """Return q_max of every case."""
        return np.pi * self.column("points") / self.column("length")

    def levels(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return means of mu_1, d_mu_0 and mu_2 and of their resamples, shapes (1 + RESAMPLES, cases)."""
        stacked = np.stack([self.output(name) for name in LEVELS], axis=-1)
        before, jump, after = np.moveaxis(
            np.stack([bootstrap.means(bootstrap.complete(case)) for case in stacked], axis=1), -1, 0
        )
        return before, jump, after

    def relaxing(self) -> FloatArray:
        """Return mu - mu_2 of every realisation from t_0+ on, shape (cases, realisations, 1 + times)."""
        before, jump, after = (self.output(name) for name in LEVELS)
        start = (before + jump - after)[..., None]
        return np.concatenate([start, self.output("friction_coefficient") - after[..., None]], axis=-1)

    def _like(self, value: xr.DataArray) -> xr.DataArray:
        return value.broadcast_like(self.template).transpose(*self.template.dims)

    def found(self, values: FloatArray, unit: str, meaning: str) -> xr.DataArray:
        """Return what was found for every case over the axes of the series."""
        shaped = np.asarray(values).reshape(self.template.shape)
        axes = {dim: self.template[dim] for dim in self.template.dims if dim in self.template.coords}
        return xr.DataArray(shaped, axes, self.template.dims, attrs={"units": unit, "long_name": meaning})

    def constants(
        self, samples: Mapping[str, FloatArray], fields: Mapping[str, tuple[str, str]], positive: tuple[str, ...] = ()
    ) -> dict[str, xr.DataArray]:
        """Return constants and the ends of their intervals over the axes, from samples of shape (n, cases)."""
        result = {}
        for name, (unit, meaning) in fields.items():
            low, high = bootstrap.interval(samples[name], self.count, name in positive)
            result[name] = self.found(samples[name][0], unit, meaning)
            result[f"{name}_low"] = self.found(low, unit, f"lower end of the 95 % interval of {name}")
            result[f"{name}_high"] = self.found(high, unit, f"upper end of the 95 % interval of {name}")
        return result


def law_rate(number: FloatArray, hurst: FloatArray) -> FloatArray:
    """Return the rate of eq. 4.12 with its powers 1 below and 1 - H above v_1 tau q_max = 1."""
    rate: FloatArray = np.where(number < 1, number, number ** (1 - hurst))
    return rate
