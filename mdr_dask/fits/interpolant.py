"""Convert an output of a study to a law: a dense table of the output and its error, for linear interpolation."""

from __future__ import annotations

import numpy as np
import xarray as xr

from mdr_dask.aggregation import aggregate
from mdr_dask.arrays import FloatArray
from mdr_dask.errors import FitError
from mdr_dask.fits.interpolation import FEWEST, LEFT, Scale, chord_error, cubic, dense, left_out_error, linear
from mdr_dask.models.base import Status


def law(dataset: xr.Dataset, output: str) -> xr.Dataset:
    """Return a dense table of an output and its error over the axes of a grid study, for ``Dataset.interp``.

    The mean over realisations, or its logarithm, is interpolated by monotone cubics (PCHIP) along one axis after the
    other. Each axis is linear or logarithmic. `Scale.of` chooses these scales. An axis of numbers needs at least
    `FEWEST` values; an axis with a single value is removed. An axis of words receives no new values. The error is the
    half width of the 95 % interval of the mean plus two errors of interpolation: that of the cubics, estimated by
    leaving out every second value, and that of linear interpolation in the dense table. Raise FitError if the study is
    no grid, if an axis has too few values, or if a needed case has no value.
    """
    if "case" in dataset.dims:
        raise FitError("expected a grid, got a sampled study, whose cases have no axes")
    mean, half = (array.squeeze() for array in _means(dataset, output))
    scale = Scale.of(mean.to_numpy()[mean.notnull().to_numpy()], spread=True)
    mean, half = _filled(mean, half, scale)
    axes = [str(dim) for dim in mean.dims if _is_numeric(mean, str(dim))]
    if not axes:
        raise FitError(f"expected an axis of at least {FEWEST} numbers, got none")
    for axis in axes:
        if (count := mean.sizes[axis]) < FEWEST:
            raise FitError(f"{axis}: expected at least {FEWEST} values, got {count}; keep one by --select {axis}=VALUE")
    mean, half = (array.transpose(..., *axes) for array in (mean, half))
    grids = dict(zip(axes, dense([mean[axis].to_numpy() for axis in axes], mean.size), strict=True))
    places = {k - len(axes): mean[axis].to_numpy() for k, axis in enumerate(axes)}
    table = scale.of_values(mean.to_numpy())
    error = half.to_numpy() + sum(left_out_error(scale, table, place, k) for k, place in places.items())
    for (k, place), grid in zip(places.items(), grids.values(), strict=True):
        table, error = cubic(place, table, grid, k), linear(place, error, grid, k)
    table = scale.back(table)
    error = error + sum(chord_error(table, grid, k) for k, grid in zip(places, grids.values(), strict=True))
    dense_axes = {axis: (axis, grid, mean[axis].attrs) for axis, grid in grids.items()}
    attributes = dataset[output].attrs
    named = {"units": attributes.get("units", "1"), "long_name": attributes.get("long_name", output)}
    about = {**named, "ancillary_variables": f"{output}_error"}
    beside = {**named, "long_name": f"95 % error of {named['long_name']}: scatter, grid and interpolation"}
    return xr.Dataset(
        {output: (mean.dims, table, about), f"{output}_error": (mean.dims, error, beside)},
        coords={**mean.drop_vars(axes).coords, **dense_axes},
        attrs={**_provenance(dataset), "measured_on": ", ".join(f"{mean.sizes[axis]} {axis}" for axis in axes)},
    )


def _means(dataset: xr.Dataset, output: str) -> tuple[xr.DataArray, xr.DataArray]:
    """Return the mean of an output over the realisations, and the half width of the 95 % interval of the mean.

    If the output does not have the dimension ``realisation``, the output itself and half widths of 0 are returned.
    Where the interval is unknown, the discretisation error replaces the half width; if this error is unknown too, the
    half width is 0. Raise FitError if a case that is needed has no value.
    """
    if "realisation" not in dataset[output].dims:
        return dataset[output], xr.zeros_like(dataset[output])
    kept = [name for name in (output, dataset[output].attrs.get("ancillary_variables")) if name in dataset]
    reduced = aggregate(dataset[kept], ("mean", "interval", "grid_error"))
    mean, ends = reduced[f"{output}_mean"].load(), reduced[f"{output}_interval"].load()
    missing = int(mean.isnull().sum())
    if missing and "status" in dataset:  # cases that an adaptive axis does not need have no value
        missing = int((mean.isnull() & ~(dataset["status"] == Status.NOT_NEEDED).all("realisation")).sum())
    if missing:
        raise FitError(
            f"{output}: {missing} of {mean.size} cases have no value; finish the run, or select a complete part by "
            "--select"
        )
    half = (ends.sel(bound="high", drop=True) - ends.sel(bound="low", drop=True)) / 2
    grid = reduced.get(f"{output}_grid_error")
    return mean, half.fillna(0.0 if grid is None else grid.fillna(0.0)).where(mean.notnull())


def _filled(mean: xr.DataArray, half: xr.DataArray, scale: Scale) -> tuple[xr.DataArray, xr.DataArray]:
    """Interpolate the cases that an adaptive axis left out.

    Along an axis with fewer than `FEWEST` known values, and outside the known values, nothing is interpolated.
    """
    axes = [k for k, dim in enumerate(mean.dims) if _is_numeric(mean, str(dim))]
    table, error = scale.of_values(mean.to_numpy()).copy(), half.to_numpy().copy()
    for axis in axes * 2:  # twice: values interpolated along one axis may allow interpolation along a previous axis
        places = mean[mean.dims[axis]].to_numpy()
        lines, errors = (np.moveaxis(array, axis, -1) for array in (table, error))
        for case in np.ndindex(lines.shape[:-1]):
            known = np.isfinite(lines[case])
            if not known.all() and known.sum() >= FEWEST:
                lines[case], errors[case] = _between(scale, places, lines[case], errors[case])
    return mean.copy(data=scale.back(table)), half.copy(data=error)


def _between(scale: Scale, places: FloatArray, line: FloatArray, error: FloatArray) -> tuple[FloatArray, FloatArray]:
    known = np.isfinite(line)
    filled = cubic(places[known], line[known], places, 0, Scale.of(places))
    # without the factor LEFT, because values are really missing here
    left_out = left_out_error(scale, line[known], places[known], 0) / LEFT
    between = np.interp(places, places[known], error[known] + left_out)
    inside = (places >= places[known][0]) & (places <= places[known][-1])
    return np.where(inside, filled, np.nan), np.where(known, error, between)


def _is_numeric(mean: xr.DataArray, dim: str) -> bool:
    return dim in mean.coords and mean[dim].dtype.kind in "fiu"


def _provenance(dataset: xr.Dataset) -> dict[str, str]:
    from mdr_dask.version import __version__

    kept = {
        name: str(dataset.attrs[name]) for name in ("title", "campaign", "model", "created") if name in dataset.attrs
    }
    return {
        "Conventions": "CF-1.11",
        "source": f"mdr_dask {__version__}",
        **kept,
        "comment": "interpolate linearly, only between the ends of the axes; errors are half widths of 95 % intervals",
    }
