"""Selections of a store as a user types them: ``velocity=10 mm/s`` or ``normal_force=1:10``."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    import xarray as xr


def group(datasets: dict[str, xr.Dataset], series: str | None) -> xr.Dataset:
    """Return the group of a series; the only one if none is named."""
    names = ", ".join(datasets)
    if series is None:
        if len(datasets) > 1:
            raise click.UsageError(f"expected --series, one of {names}")
        return next(iter(datasets.values()))
    if series not in datasets:
        raise click.UsageError(f"no series {series!r}; known: {names or 'none, leave --series out'}")
    return datasets[series]


def outputs(dataset: xr.Dataset, names: tuple[str, ...]) -> xr.Dataset:
    """Keep the outputs named; all that have no dimension of their own if none is."""
    known = [str(name) for name in dataset.data_vars if name != "status"]
    for name in names:
        if name not in known:
            raise click.UsageError(f"no output {name!r} in this store{_meant(name, known)}; known: {', '.join(known)}")
    case_dims = set(dataset["status"].dims)
    kept = list(names) or [name for name in known if set(dataset[name].dims) <= case_dims]
    errors = [
        dataset[name].attrs["ancillary_variables"] for name in kept if "ancillary_variables" in dataset[name].attrs
    ]
    return dataset[list(dict.fromkeys([*kept, *errors]))]


def select(dataset: xr.Dataset, selections: tuple[str, ...]) -> xr.Dataset:
    """Apply selections: a value picks the nearest point of an axis, ``a:b`` a range; units as in a campaign file."""
    for text in selections:
        name, equals, wanted = text.partition("=")
        known = [str(coord) for coord in dataset.coords if dataset[coord].ndim == 1]
        if not equals or name not in known:
            raise click.UsageError(
                f"expected --select NAME=VALUE or NAME=A:B with one of {', '.join(known)}, got {text!r}"
                f"{'' if name in known else _meant(name, known)}"
            )
        dataset = _pick(dataset, name, wanted)
    return dataset


def select_all(datasets: dict[str, xr.Dataset], selections: tuple[str, ...]) -> dict[str, xr.Dataset]:
    """Apply selections to every series that varies what is selected; a series that does not stays as it is."""
    for text in selections:
        name = text.partition("=")[0]
        varied = [key for key, data in datasets.items() if name in data.coords and data[name].ndim == 1]
        for key in varied or list(datasets)[:1]:
            datasets = datasets | {key: select(datasets[key], (text,))}
    return datasets


def _pick(dataset: xr.Dataset, name: str, wanted: str) -> xr.Dataset:
    import numpy as np

    axis = dataset[name]
    dim = axis.dims[0]
    if axis.dtype.kind not in "fiu":
        found = [i for i, label in enumerate(axis.to_numpy().tolist()) if label == wanted]
        if not found:
            raise click.UsageError(f"no {name} {wanted!r}; known: {', '.join(map(str, axis.to_numpy().tolist()))}")
        return dataset.isel({dim: found})
    low, colon, high = wanted.partition(":")
    unit = str(axis.attrs.get("units", "1"))
    if not colon:
        return dataset.isel({dim: [int(np.argmin(abs(axis.to_numpy() - _number(low, unit, name))))]})
    least = _number(low, unit, name) if low else -np.inf
    most = _number(high, unit, name) if high else np.inf
    inside = np.flatnonzero((axis.to_numpy() >= least) & (axis.to_numpy() <= most))
    if not inside.size:
        raise click.UsageError(
            f"no {name} from {least:g} to {most:g}; it goes from {axis.to_numpy().min():g} to {axis.to_numpy().max():g}"
        )
    return dataset.isel({dim: inside})


def _number(text: str, unit: str, name: str) -> float:
    from mdr_dask.units import to_si

    try:
        return float(text)
    except ValueError:
        pass
    try:
        return float(to_si(text, unit))
    except ValueError as error:
        raise click.UsageError(f"{name}: {error}") from None


def _meant(name: str, known: list[str]) -> str:
    close = [other for other in known if name in other] or difflib.get_close_matches(name, known, n=1)
    return f" (did you mean {close[0]!r}?)" if close else ""
