"""The law of a study as a table that any program can interpolate linearly, with its error beside it."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mdr_dask.aggregation import aggregate
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import DataError, FitError
from mdr_dask.questions.selection import written

#: Fewest values of an axis: every second one left out has to leave a curve.
FEWEST = 4
#: Numbers that a table holds at most, and pieces into which it cuts a cell of the study at most.
LARGEST, PIECES = 2_000_000, 16
#: What is left of the error of every second value when all are used: a quarter at second order, half at kinks.
LEFT = 0.25


def law(dataset: xr.Dataset, output: str) -> xr.Dataset:
    """Return an output as a dense table over the axes of its study, with its error.

    The mean over realisations is interpolated by monotone cubics (PCHIP), axis by axis, on the natural scale of each
    axis and of the output: logarithmic where that is what the values are spread evenly on. The table is dense enough
    to be interpolated linearly, as ``Dataset.interp`` does.

    Parameters
    ----------
    dataset : Dataset
        A group of a study that is a grid. Axes of one value become fixed parameters; axes of words stay as they are.
    output : str
        One of its outputs.

    Returns
    -------
    Dataset
        ``<output>`` and ``<output>_error``: half of the 95 % interval of the mean (scatter and grid) and the error of
        interpolation, added.

    Raises
    ------
    FitError
        If the study is no grid, has no axis of at least four numbers, or has cases without a value.

    Notes
    -----
    The error of interpolation is found by leaving out every second value of each axis, those of odd and those of even
    number, and predicting them.
    """
    if "case" in dataset.dims:
        raise FitError("expected a grid, this is a sampled study: its cases lie along no axes")
    mean, half = (array.squeeze() for array in _means(dataset, output))
    axes = [str(dim) for dim in mean.dims if _is_numeric(mean, str(dim))]
    if not axes:
        raise FitError(f"expected an axis of at least {FEWEST} numbers, got none")
    values = mean.transpose(..., *axes).to_numpy()
    half = half.transpose(*mean.transpose(..., *axes).dims)
    scale = _Scale.of(values.ravel(), spread=True)
    grids = [_dense(mean[axis].to_numpy(), _pieces(mean, axes)) for axis in axes]
    table, error = scale.of_values(values), half.to_numpy()
    missed = sum(_missed(scale, table, mean[axis].to_numpy(), axis=k - len(axes)) for k, axis in enumerate(axes))
    error = error + missed
    for k, (axis, grid) in enumerate(zip(axes, grids, strict=True)):
        place = mean[axis].to_numpy()
        table = _interpolated(place, table, grid, k - len(axes))
        error = _linear(place, error, grid, k - len(axes))
    table = scale.back(table)
    error = error + sum(_bent(table, grid, k - len(axes)) for k, grid in enumerate(grids))
    found = mean.transpose(..., *axes)
    coords: dict[str, Any] = {
        str(dim): found[dim] for dim in found.dims if str(dim) not in axes and dim in found.coords
    }
    coords |= {axis: ((axis,), grid, found[axis].attrs) for axis, grid in zip(axes, grids, strict=True)}
    coords |= {str(name): coord for name, coord in found.coords.items() if coord.ndim == 0}
    attributes = dataset[output].attrs
    named = {"units": attributes.get("units", "1"), "long_name": attributes.get("long_name", output)}
    about = {**named, "ancillary_variables": f"{output}_error"}
    beside = {**named, "long_name": f"95 % error of {named['long_name']}: scatter, grid and interpolation"}
    return xr.Dataset(
        {output: (found.dims, table, about), f"{output}_error": (found.dims, error, beside)},
        coords=coords,
        attrs={**_provenance(dataset), "measured_on": ", ".join(f"{found.sizes[axis]} {axis}" for axis in axes)},
    )


def _means(dataset: xr.Dataset, output: str) -> tuple[xr.DataArray, xr.DataArray]:
    """Return the mean of an output and half of its interval; 0 where one realisation knows none."""
    if "realisation" not in dataset[output].dims:
        return dataset[output], xr.zeros_like(dataset[output])
    kept = [name for name in (output, dataset[output].attrs.get("ancillary_variables")) if name in dataset]
    reduced = aggregate(dataset[kept], ("mean", "interval", "grid_error"))
    mean, ends = reduced[f"{output}_mean"].load(), reduced[f"{output}_interval"].load()
    lost = int(mean.isnull().sum())
    if lost:
        raise FitError(
            f"{output}: {lost} of {mean.size} cases have no value; finish the run, or keep a part that is whole by "
            "--select"
        )
    half = (ends.sel(bound="high", drop=True) - ends.sel(bound="low", drop=True)) / 2
    grid = reduced.get(f"{output}_grid_error")
    return mean, half.fillna(0.0 if grid is None else grid.fillna(0.0))


def _is_numeric(mean: xr.DataArray, dim: str) -> bool:
    return dim in mean.coords and mean[dim].dtype.kind in "fiu" and mean.sizes[dim] >= FEWEST


def _pieces(mean: xr.DataArray, axes: list[str]) -> int:
    """Return into how many pieces the cells of each axis are cut."""
    room = (LARGEST / mean.size) ** (1 / len(axes))
    return int(np.clip(room, 1, PIECES))


class _Scale:
    """A scale on which numbers are interpolated: as they are, or their logarithms."""

    def __init__(self, logarithmic: bool) -> None:
        self.logarithmic = logarithmic

    @classmethod
    def of(cls, numbers: FloatArray, spread: bool = False) -> _Scale:
        """Return the scale on which sorted numbers are more even; of values that are spread, over a decade or more."""
        if numbers.min() <= 0:
            return cls(False)
        if spread:
            return cls(bool(numbers.max() > 10 * numbers.min()))
        steps = (np.diff(numbers), np.diff(np.log(numbers)))
        even = [np.std(step) / np.mean(step) for step in steps]
        return cls(bool(even[1] < even[0]))

    def of_values(self, values: FloatArray) -> FloatArray:
        return np.log(values) if self.logarithmic else np.asarray(values, dtype=np.float64)

    def back(self, values: FloatArray) -> FloatArray:
        return np.exp(values) if self.logarithmic else values


def _dense(places: FloatArray, pieces: int) -> FloatArray:
    """Return places with each step cut into equal pieces on their natural scale; the places themselves stay."""
    scale = _Scale.of(places)
    cut = [np.linspace(a, b, pieces, endpoint=False) for a, b in pairwise(scale.of_values(places))]
    dense = scale.back(np.concatenate([*cut, scale.of_values(places[-1:])]))
    dense[::pieces] = places
    return dense


def _interpolated(places: FloatArray, values: FloatArray, wanted: FloatArray, axis: int) -> FloatArray:
    from scipy.interpolate import PchipInterpolator

    scale = _Scale.of(places)
    curve = PchipInterpolator(scale.of_values(places), values, axis=axis)
    return np.asarray(curve(scale.of_values(wanted)))


def _linear(places: FloatArray, values: FloatArray, wanted: FloatArray, axis: int) -> FloatArray:
    from scipy.interpolate import make_interp_spline

    scale = _Scale.of(places)
    return np.asarray(make_interp_spline(scale.of_values(places), values, k=1, axis=axis)(scale.of_values(wanted)))


def _missed(scale: _Scale, table: FloatArray, places: FloatArray, axis: int) -> FloatArray:
    """Return the error of interpolation along an axis at every place, from predicting the values left out."""
    values, truth = np.moveaxis(table, axis, -1), np.moveaxis(scale.back(table), axis, -1)
    missed = np.zeros_like(truth)
    number = len(places)
    for first in (0, 1):
        kept = np.unique([0, *range(first, number, 2), number - 1])
        predicted = scale.back(_interpolated(places[kept], values[..., kept], places, -1))
        missed = np.maximum(missed, np.abs(predicted - truth))
    around = np.pad(missed, [(0, 0)] * (missed.ndim - 1) + [(1, 1)], mode="edge")
    return np.moveaxis(LEFT * _largest(around), -1, axis)


def _bent(table: FloatArray, grid: FloatArray, axis: int) -> FloatArray:
    """Return by how much straight lines between the values of a table miss a curve: its second derivative h^2 / 8."""
    values, steps = np.moveaxis(table, axis, -1), np.diff(grid)
    bend = np.abs(np.diff(np.diff(values) / steps)) / (steps[1:] + steps[:-1])
    inside = bend * np.maximum(steps[1:], steps[:-1]) ** 2 / 4
    around = np.pad(inside, [(0, 0)] * (inside.ndim - 1) + [(2, 2)], mode="edge")
    return np.moveaxis(_largest(around), -1, axis)


def _largest(padded: FloatArray) -> FloatArray:
    """Return the largest of every three neighbours along the last axis."""
    return np.asarray(np.max([padded[..., :-2], padded[..., 1:-1], padded[..., 2:]], axis=0))


def _provenance(dataset: xr.Dataset) -> dict[str, str]:
    from mdr_dask.version import __version__

    kept = {
        name: str(dataset.attrs[name]) for name in ("title", "campaign", "model", "created") if name in dataset.attrs
    }
    return {
        "Conventions": "CF-1.11",
        "source": f"mdr_dask {__version__}",
        **kept,
        "comment": "interpolate linearly; valid inside the axes only; errors are half widths of 95 % intervals",
    }


class Law:
    """A law that was written by ``mdr-dask law``, to be evaluated at many points.

    Parameters
    ----------
    path : str or Path
        The netCDF file, or Zarr store.
    """

    def __init__(self, path: str | Path) -> None:
        from scipy.interpolate import RegularGridInterpolator

        with xr.open_dataset(path, engine="zarr" if str(path).endswith(".zarr") else None) as opened:
            self.table = opened.load()
        self.output = str(next(name for name, array in self.table.items() if "ancillary_variables" in array.attrs))
        value = self.table[self.output]
        words = [str(dim) for dim in value.dims if value[dim].dtype.kind not in "fiu"]
        if words:
            raise DataError(f"{path}: the axis {words[0]} has words; write a law of one of them by --select")
        self.axes = {str(dim): value[dim].to_numpy().astype(np.float64) for dim in value.dims}
        both = np.stack([value.to_numpy(), self.table[f"{self.output}_error"].to_numpy()], axis=-1)
        self._interpolate = RegularGridInterpolator(tuple(self.axes.values()), both)

    def __call__(self, **places: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return values and errors (half widths of 95 % intervals) at places.

        Parameters
        ----------
        **places : array_like
            A number or array for every axis, in SI; they are broadcast together.

        Raises
        ------
        DataError
            If an axis is missing or unknown, or a place lies outside.
        """
        points = np.broadcast_arrays(*self._checked(places).values())
        found = self._interpolate(np.stack([point.ravel() for point in points], axis=-1))
        shape = points[0].shape
        return found[:, 0].reshape(shape), found[:, 1].reshape(shape)

    def _checked(self, places: Mapping[str, ArrayLike]) -> dict[str, NDArray[Any]]:
        if set(places) != set(self.axes):
            raise DataError(f"expected {', '.join(self.axes)}, got {', '.join(places) or 'nothing'}")
        found = {axis: np.asarray(places[axis], dtype=np.float64) for axis in self.axes}
        for axis, values in found.items():
            ends = self.axes[axis][[0, -1]]
            outside = values[~((values >= ends[0]) & (values <= ends[1]))]
            if outside.size:
                unit = str(self.table[axis].attrs.get("units", "1"))
                low, high = (written(end, unit) for end in ends)
                raise DataError(f"expected {axis} from {low} to {high}, got {written(outside.flat[0], unit)}")
        return found
