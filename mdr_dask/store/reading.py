"""A study as labelled arrays."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import xarray as xr

from mdr_dask.store.files import attributes, read_json


def datasets(url: str) -> dict[str, xr.Dataset]:
    """Open a study for reading, finished or not.

    Parameters
    ----------
    url : str
        Path or URL of the store.

    Returns
    -------
    dict of str to Dataset
        Every group by series name (``""`` for a study without series), lazily loaded, numeric axes in ascending order.

    Raises
    ------
    StoreError
        If there is no study of mdr_dask at `url`.
    """
    root = attributes(url)
    names = [""] if "axes" in root else _series_names(url)
    return {name: _open_sorted(url, name) for name in names}


def _series_names(url: str) -> list[str]:
    metadata = read_json(url, "zarr.json") or {}
    members = metadata["consolidated_metadata"]["metadata"]
    return [name for name, member in members.items() if member["node_type"] == "group"]


def _open_sorted(url: str, series: str) -> xr.Dataset:
    dataset: xr.Dataset = xr.open_zarr(url, group=series or None, chunks=None, consolidated=True)
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
