"""Is this the store of this campaign? What differs is named; what is new extends what is there."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from mdr_dask import models
from mdr_dask.campaign import Axis, Campaign, Series
from mdr_dask.errors import StoreError
from mdr_dask.models.base import DataFile
from mdr_dask.store.files import attributes, read_json
from mdr_dask.store.layout import plain_values


@dataclass(frozen=True)
class Stored:
    """What a store holds already of a campaign that is about to run."""

    campaign: Campaign
    chunks: Mapping[str, Mapping[str, int]]
    realisations: int


def reconcile(url: str, campaign: Campaign) -> Stored:
    """Compare a campaign with the store it wants to go on with.

    Parameters
    ----------
    url : str
        Path or URL of an existing store.
    campaign : Campaign
        The campaign to run.

    Returns
    -------
    Stored
        The campaign with every axis extended to what is stored (stored values first, in their order), the chunk
        lengths of the stored groups and the number of stored realisations.

    Raises
    ------
    StoreError
        If the store was made from another campaign; every difference is named, and nothing was touched.
    """
    root = attributes(url)
    version_now = models.load(campaign.model).version
    differences = [
        f"{what}: {root[key]!r} in the store, {now!r} in the campaign"
        for what, key, now in (
            ("model", "model", campaign.model),
            ("model version", "model_version", version_now),
            ("seed", "seed", campaign.seed),
            ("accuracy", "accuracy", campaign.accuracy),
        )
        if root[key] != now
    ]
    series, chunks, realisations = [], {}, 0
    for wanted in campaign.series:
        held = _group_attributes(url, wanted.name)
        if held is None:
            series.append(wanted)
            continue
        found = _series_differences(wanted, held, campaign)
        differences += [f"{wanted.name}.{line}" if wanted.name else line for line in found]
        if not found:
            series.append(_extend(wanted, held))
        chunks[wanted.name] = held["blocks"]
        realisations = max(realisations, held["realisations"])
    if differences:
        lines = "\n  ".join(differences)
        raise StoreError(f"{url}: made from another campaign; name another store, or remove this one:\n  {lines}")
    return Stored(replace(campaign, series=tuple(series)), chunks, realisations)


def _group_attributes(url: str, name: str) -> dict[str, Any] | None:
    metadata = read_json(url, f"{name}/zarr.json" if name else "zarr.json")
    if metadata is None or "axes" not in metadata["attributes"]:
        return None
    shape = metadata["consolidated_metadata"]["metadata"]["status"]["shape"]
    return {**metadata["attributes"], "realisations": shape[-1]}


def _series_differences(series: Series, held: Mapping[str, Any], campaign: Campaign) -> list[str]:
    axes = [(axis.path, axis.dim) for axis in series.axes]
    held_axes = [(axis["path"], axis["dim"]) for axis in held["axes"]]
    found = []
    if sorted(axes) != sorted(held_axes) or [dim for _, dim in axes] != [dim for _, dim in held_axes]:
        found.append(
            f"axes: {[path for path, _ in held_axes]} in the store, {[path for path, _ in axes]} in the campaign"
        )
    if held["outputs"] != list(campaign.outputs):
        found.append(f"outputs: {held['outputs']} in the store, {list(campaign.outputs)} in the campaign")
    varied = {path for path, _ in axes} | {path for path, _ in held_axes}
    before = _leaves(json.loads(held["parameters"]), "")
    now = _leaves(series.parameters.model_dump(mode="json"), "")
    fixed = [path for path in sorted(before.keys() | now.keys()) if not _below_any(path, varied)]
    return found + [
        f"{path}: {before.get(path)!r} in the store, {now.get(path)!r} in the campaign"
        for path in fixed
        if before.get(path) != now.get(path)
    ]


def _below_any(path: str, axes: set[str]) -> bool:
    return any(path == axis or path.startswith(axis + ".") for axis in axes)


def _leaves(tree: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Flatten parameters to dotted paths; of a named file only the digest counts."""
    found: dict[str, Any] = {}
    for name, value in tree.items():
        if isinstance(value, Mapping) and value.keys() == DataFile.model_fields.keys():
            found[prefix + name] = value["sha256"]
        elif isinstance(value, Mapping):
            found |= _leaves(value, f"{prefix}{name}.")
        else:
            found[prefix + name] = value
    return found


def _extend(series: Series, held: Mapping[str, Any]) -> Series:
    """Put the stored entries of every dimension first and the new ones behind them."""
    stored = {axis["path"]: axis["values"] for axis in held["axes"]}
    extended: dict[str, Axis] = {}
    for dim in series.sizes:
        axes = [axis for axis in series.axes if axis.dim == dim]
        old = list(zip(*(stored[axis.path] for axis in axes), strict=True))
        plain = list(zip(*(plain_values(axis.values) for axis in axes), strict=True))
        new = [position for position, entry in enumerate(plain) if entry not in old]
        for column, axis in enumerate(axes):
            kept = [_restore(axis, entry[column], [entry[column] for entry in plain]) for entry in old]
            values = tuple(kept) + tuple(axis.values[position] for position in new)
            extended[axis.path] = replace(axis, values=values, labels=_extend_labels(axis, values))
    return replace(series, axes=tuple(extended[axis.path] for axis in series.axes))


def _restore(axis: Axis, plain: Any, plain_now: list[Any]) -> Any:
    if not isinstance(plain, Mapping):
        return plain
    if plain not in plain_now:
        raise StoreError(f"axis {axis.path}: the campaign lacks the stored value {plain}; keep it in the file")
    return axis.values[plain_now.index(plain)]


def _extend_labels(axis: Axis, values: tuple[Any, ...]) -> tuple[str, ...] | None:
    if axis.labels is None:
        return None
    known = dict(zip(map(repr, axis.values), axis.labels, strict=True))
    return tuple(known.get(repr(value), str(value)) for value in values)
