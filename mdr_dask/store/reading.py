"""A study as labelled arrays."""

from __future__ import annotations

import json
import warnings
from functools import partial
from pathlib import Path

import xarray as xr

from mdr_dask.store.files import bytes_of, group_name, series_names

#: Reading through Dask is several times slower for small groups, and the only way for those beyond memory.
LAZY_BYTES = 2**30


def datasets(url: str) -> dict[str, xr.Dataset]:
    """Open a study for reading, finished or not.

    Parameters
    ----------
    url : str
        Path or URL of the store.

    Returns
    -------
    dict of str to Dataset
        Every group by series name (``""`` for a study without series, ``"-"`` if series were added to it), numeric
        axes in ascending order. Arrays are loaded when used; those of a group larger than `LAZY_BYTES` are Dask arrays,
        reduced chunk by chunk.

    Raises
    ------
    StoreError
        If there is no study of mdr_dask at `url`.
    """
    return {name: _open_sorted(url, name) for name in series_names(url)}


def _open_sorted(url: str, series: str) -> xr.Dataset:
    opened = partial(xr.open_zarr, bytes_of(url), group=group_name(series) or None, consolidated=True)
    dataset: xr.Dataset = opened(chunks=None)
    if dataset.nbytes > LAZY_BYTES:
        dataset = opened(chunks={})
    for dim in dataset.dims:
        if (
            dim in dataset.indexes
            and dataset[dim].dtype.kind in "fiu"
            and not dataset.indexes[dim].is_monotonic_increasing
        ):
            dataset = dataset.sortby(dim)
    order = [*dataset.attrs["outputs"], "status"]
    return dataset[order]


def save(dataset: xr.Dataset, path: Path) -> None:
    """Write a Dataset to ``FILE.zarr`` or ``FILE.nc``; lists in attrs become text, which is all that netCDF holds."""
    plain = dataset.copy()
    plain.attrs = {
        name: value if isinstance(value, str | int | float) else json.dumps(value)
        for name, value in dataset.attrs.items()
        if value is not None
    }
    if path.suffix == ".nc":
        plain.to_netcdf(path, engine="scipy")
        return
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Consolidated metadata is currently not part")
        plain.to_zarr(path, mode="w", consolidated=True)
