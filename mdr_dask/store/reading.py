"""Open a study as labelled arrays."""

from __future__ import annotations

import json
import warnings
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from mdr_dask.errors import StoreError
from mdr_dask.models.numbers import entries_of
from mdr_dask.store.files import group_name, read_json
from mdr_dask.store.integrity import is_safe
from mdr_dask.store.ledgers import require_undamaged
from mdr_dask.store.study import chunks_of, series_names

if TYPE_CHECKING:
    import xarray as xr

#: Groups with more than this number of bytes are read through Dask, because they may not fit into memory. Chosen by
#: trial.
LAZY_BYTES = 2**30


def datasets(url: str) -> dict[str, xr.Dataset]:
    """Open a study for reading, finished or not. Return the groups, indexed by the names of the series.

    In a grid, the values of numeric axes are in ascending order; along the dimension ``case``, the stored order is
    kept. The group of a study without series has the name ``""``, or ``"-"`` if an earlier version of mdr_dask has
    added series to the study. Groups larger than `LAZY_BYTES` contain Dask arrays.
    """
    names = series_names(url)
    require_undamaged(url, names)
    return {name: _open_sorted(url, name) for name in names}


def _open_sorted(url: str, series: str) -> xr.Dataset:
    import xarray as xr

    if not is_safe(read_json(url, group_name(series, "zarr.json")) or {}):
        raise StoreError(f"{url}: {group_name(series, 'zarr.json')} is missing or damaged")
    opened = partial(xr.open_zarr, chunks_of(url), group=group_name(series) or None, consolidated=True, zarr_format=3)
    dataset: xr.Dataset = opened(chunks=None)
    if dataset.nbytes > LAZY_BYTES:
        dataset = opened(chunks={})
    # load the coordinates: otherwise every step of a reduction would read them again
    dataset = dataset.assign_coords({name: each.copy(data=each.to_numpy()) for name, each in dataset.coords.items()})
    for dim in dataset.dims:
        if (
            dim in dataset.indexes
            and dataset[dim].dtype.kind in "fiu"
            and not dataset.indexes[dim].is_monotonic_increasing
        ):
            dataset = dataset.sortby(dim)
    # if the values of an axis are parameter sets, remove the coordinates of single parameters of these sets
    inner = {"_".join(path) for axis in dataset.attrs["axes"] for path in entries_of(axis)}
    order = [*dataset.attrs["outputs"], "status"]
    return dataset[order].drop_vars(inner & dataset.coords.keys())


def with_plain_attributes(dataset: xr.Dataset) -> xr.Dataset:
    """Return a copy of a dataset that can be saved as netCDF, or as a Zarr store that no run can extend.

    Attributes that are neither texts nor numbers are JSON texts in the copy.
    Attributes that are None, and the version of the layout, are left out.
    """
    plain = dataset.copy()
    plain.attrs = {
        name: value if isinstance(value, str | int | float) and not isinstance(value, bool) else json.dumps(value)
        for name, value in dataset.attrs.items()
        if value is not None and name != "mdr_dask_layout"  # so that no run can extend the copy
    }
    return plain


def save(dataset: xr.Dataset, path: Path) -> None:
    """Write a Dataset to ``FILE.zarr`` or ``FILE.nc``. Dask arrays are computed and written chunk by chunk.

    An existing file is replaced. Raise StoreError if the packages for netCDF are not installed.
    """
    plain = with_plain_attributes(dataset)
    if path.suffix == ".nc":
        if not (find_spec("h5netcdf") and find_spec("h5py")):
            raise StoreError(
                f"{path}: netCDF needs h5netcdf and h5py: pip install 'mdr_dask[netcdf]', "
                "or choose a name that ends in .zarr"
            )
        plain.to_netcdf(path, engine="h5netcdf")
        return
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Consolidated metadata is currently not part")
        plain.to_zarr(path, mode="w", consolidated=True)
