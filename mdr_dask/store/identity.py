"""Compare a campaign with the store to be resumed or extended, and append new values of axes to the stored values."""

from __future__ import annotations

import itertools
import json
import logging
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, reduce
from typing import Annotated, Any

import numpy as np
from pydantic import TypeAdapter

from mdr_dask import models
from mdr_dask.arrays import IntArray
from mdr_dask.campaign import Axis, Campaign, Series
from mdr_dask.campaign.definition import SAME_DIGITS
from mdr_dask.errors import StoreError
from mdr_dask.store.files import absolute, digest
from mdr_dask.store.layout import is_file, of_files, plain_values
from mdr_dask.store.study import attributes, document, series_names

log = logging.getLogger("mdr_dask.store")


@dataclass(frozen=True)
class Stored:
    """A campaign whose axes also have the values that a store already contains."""

    # The campaign to lay out. Each axis has first the stored values, then the new values. The outputs are those of the
    # store.
    campaign: Campaign
    # Chunk lengths of the stored groups, by the names of their series.
    chunks: Mapping[str, Mapping[str, int]]
    # Largest number of realisations of a stored group.
    realisations: int
    # For each stored group and dimension, the positions of the values of the given campaign on the extended axis.
    places: Mapping[str, Mapping[str, IntArray]]


def reconcile(url: str, campaign: Campaign) -> Stored:
    """Compare a campaign with the store to be resumed or extended, and return the campaign to lay out.

    Raise StoreError if another version of the model made the store, or if the store cannot be extended to the campaign.
    In the second case, the message lists all differences.
    """
    attributes(url)  # raises StoreError if this is not a study
    groups = {series.name: _group_attributes(url, series.name) for series in campaign.series}
    held = {name: found for name, found in groups.items() if found is not None}
    differences = _study_differences(url, campaign)
    for series in campaign.series:
        found = _series_differences(series, held[series.name], campaign.outputs) if series.name in held else []
        differences += [f"{series.name}.{line}" if series.name else line for line in found]
    _require_version(url, campaign)
    if differences:
        lines = "\n  ".join(dict.fromkeys(differences))
        raise StoreError(
            f"{url}: made from another campaign; give this one its own store (--store, in Python store=):\n  {lines}"
        )
    extended, places = [], {}
    for series in campaign.series:
        if series.name in held:
            series, places[series.name] = _extend(series, held[series.name])
        extended.append(series)
    outputs = tuple(next(iter(held.values()))["outputs"]) if held else campaign.outputs
    return Stored(
        campaign=replace(campaign, series=tuple(extended), outputs=outputs),
        chunks={name: found["blocks"] for name, found in held.items()},
        realisations=max((found["realisations"] for found in held.values()), default=0),
        places=places,
    )


def _require_version(url: str, campaign: Campaign) -> None:
    """Raise StoreError if another version of the model made the store: results of two versions must not be mixed.

    If the version is the same but the file of a user's model has changed, log a warning.
    """
    held, version = attributes(url), models.load(campaign.model).version
    if held["model"] == campaign.model and held["model_version"] != version:
        program = held.get("versions", {}).get("mdr_dask", "another version")
        raise StoreError(
            f"{url}: made with version {held['model_version']} of the model {campaign.model} (mdr_dask {program}), "
            f"this is version {version}. The store can be read, plotted and verified, but not extended: use the "
            f"version that made it, or compute the study again in another store (--store, in Python store=)"
        )
    source = models.source_digest(campaign.model)
    if source is not None and held.get("model_source") not in (None, source):
        _warn_of_changed_model(absolute(url), campaign.model, version)


@lru_cache(maxsize=16)
def _warn_of_changed_model(url: str, model: str, version: int) -> None:
    """Log a warning that the file of a model has changed, only once for each store."""
    log.warning(
        "%s: the file of the model %s has changed since the store was made, and its version is still %d: increase the "
        "version if the results are different, so that old and new results are not mixed",
        url,
        model,
        version,
    )


def _group_attributes(url: str, name: str) -> dict[str, Any] | None:
    metadata = document(url, name)
    if metadata is None or "axes" not in metadata["attributes"]:
        return None
    shape = metadata["consolidated_metadata"]["metadata"]["status"]["shape"]
    return {**metadata["attributes"], "realisations": shape[-1]}


def _study_differences(url: str, campaign: Campaign) -> list[str]:
    root = attributes(url)
    now = {"model": campaign.model, "seed": campaign.seed, "accuracy": campaign.accuracy}
    found = [_difference(key, root[key], value) for key, value in now.items() if root[key] != value]
    names, names_now = series_names(url), [series.name for series in campaign.series]
    if ("axes" in root) != ("" in names_now):
        found.append(
            f"series: {' '.join(names) or 'none'} in the store, {' '.join(names_now) or 'none'} in the campaign"
        )
    return found


def _difference(what: str, stored: Any, now: Any) -> str:
    return f"{what}: {stored!r} in the store, {now!r} in the campaign"


def _series_differences(series: Series, held: Mapping[str, Any], outputs: tuple[str, ...]) -> list[str]:
    axes = {axis.path: axis for axis in series.axes}
    held_axes = {axis["path"]: axis for axis in held["axes"]}
    found = []
    if {path: axis.dim for path, axis in axes.items()} != {path: axis["dim"] for path, axis in held_axes.items()}:
        found.append(_difference("axes", list(held_axes), list(axes)))
    found += [
        f"axis {path}: numbers in the store, names in the campaign"
        for path in axes.keys() & held_axes.keys()
        if axes[path].labels is not None and held_axes[path]["labels"] is None
    ]
    lacking = [name for name in outputs if name not in held["outputs"]]
    if lacking:
        found.append(f"outputs: the store lacks {', '.join(lacking)}; every case would have to be computed again")
    varied = axes.keys() | held_axes.keys()
    before = _fixed(json.loads(held["parameters"]), varied)
    now = _fixed(series.parameters.model_dump(mode="json"), varied)
    for path in sorted(before.keys() | now.keys()):
        if of_files(before.get(path), "sha256") != of_files(now.get(path), "sha256"):
            stored, wanted = (of_files(each.get(path), "name") for each in (before, now))
            # a file of the same name has other contents
            found.append(f"{path}: {wanted} has changed" if stored == wanted else _difference(path, stored, wanted))
    return found


def block_digests(attributes: Mapping[str, Any]) -> Callable[[Sequence[Sequence[int]]], str]:
    """Return a function that gives the digest of the campaign for each block of a group with these attributes.

    The argument of the function is the region of the block: start and stop along each dimension. The digest depends
    on the model and its version, the seed, the accuracy, the lengths of blocks, the fixed parameters, and the values of
    the axes in the block. It does not change if the store is extended.
    """
    axes = attributes["axes"]
    dims = list(dict.fromkeys(axis["dim"] for axis in axes))
    fixed = _fixed(json.loads(attributes["parameters"]), [axis["path"] for axis in axes])
    # a parameter that is None may have been unknown to the version that made the store
    given = {path: value for path, value in fixed.items() if value is not None}
    study = [attributes[key] for key in ("model", "model_version", "seed", "accuracy", "blocks")]
    common = _text(of_files([study, given, [axis["path"] for axis in axes]], "sha256"))

    def of_block(region: Sequence[Sequence[int]]) -> str:
        columns = [axis["values"][slice(*region[dims.index(axis["dim"])])] for axis in axes]
        return digest("".join([common, *(_text(of_files(column, "sha256")) for column in columns)]).encode())

    return of_block


def of_other_campaign(record: Mapping[str, Any], digests: Callable[[Sequence[Sequence[int]]], str]) -> bool:
    """Return whether the record of a block belongs to another campaign.

    Return False for records without a digest of the campaign, as earlier versions of mdr_dask wrote them.
    """
    return "campaign" in record and record["campaign"] != digests(record["region"])


def _fixed(parameters: Mapping[str, Any], varied: Iterable[str]) -> dict[str, Any]:
    """Flatten nested parameters to dotted paths, without the paths that vary."""
    inside = tuple(f"{axis}." for axis in varied)
    return {path: value for path, value in _leaves(parameters, "").items() if not f"{path}.".startswith(inside)}


def _leaves(tree: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """Flatten nested parameters to dotted paths."""
    found: dict[str, Any] = {}
    for name, value in tree.items():
        if isinstance(value, Mapping) and not is_file(value):
            found |= _leaves(value, f"{prefix}{name}.")
        else:
            found[prefix + name] = value
    return found


def _extend(series: Series, held: Mapping[str, Any]) -> tuple[Series, dict[str, IntArray]]:
    """Append the new values of a series to its stored axes, and return the positions of its values on these axes."""
    places = {}
    axes = []
    for dim in dict.fromkeys(axis["dim"] for axis in held["axes"]):
        stored = [axis for axis in held["axes"] if axis["dim"] == dim]
        by_path = {axis.path: axis for axis in series.axes}
        now = [by_path[axis["path"]] for axis in stored]
        old = _entries([axis["values"] for axis in stored])
        wanted = _entries([plain_values(axis.values) for axis in now])
        behind = itertools.count(len(old))
        places[dim] = np.array([old[entry] if entry in old else next(behind) for entry in wanted], dtype=np.int64)
        axes += [_longer(series, axis, before, places[dim]) for axis, before in zip(now, stored, strict=True)]
    return replace(series, axes=tuple(axes)), places


def _entries(columns: list[list[Any]]) -> dict[tuple[str, int], int]:
    """Return the position of each entry along a dimension. An entry has one value of each axis of this dimension.

    The key of an entry is the text of these values, in which digests replace the names of files, together with the
    number of equal entries before the entry.
    """
    found: dict[tuple[str, int], int] = {}
    seen: Counter[str] = Counter()
    for position, entry in enumerate(zip(*columns, strict=True)):
        text = _text(of_files(list(entry), "sha256"))
        found[text, seen[text]] = position
        seen[text] += 1
    return found


def _text(values: Iterable[Any]) -> str:
    """Return values of axes as text. Numbers outside lists and mappings are rounded to `SAME_DIGITS` digits."""
    return json.dumps([float(f"{x:.{SAME_DIGITS}g}") if isinstance(x, float) else x for x in values], sort_keys=True)


def _longer(series: Series, axis: Axis, stored: Mapping[str, Any], places: IntArray) -> Axis:
    """Return an axis with the stored values, and then the new values of the given axis.

    `places` are the positions of the values of the given axis on the returned axis. If a stored list or mapping is also
    on the given axis, it is taken from there, because its files may have been moved.
    """
    values = [_restore(series, axis.path, plain) for plain in stored["values"]]
    labels = None if stored["labels"] is None else list(stored["labels"])
    for position, (place, value) in enumerate(zip(places, axis.values, strict=True)):
        if place == len(values):
            values.append(value)
            if labels is not None:
                labels.append(axis.labels[position] if axis.labels else str(value))
        elif isinstance(stored["values"][place], Mapping | list):
            values[place] = value
    return replace(
        axis,
        values=tuple(values),
        labels=None if labels is None else tuple(labels),
        unit=None if labels else axis.unit,
    )


def _restore(series: Series, path: str, plain: Any) -> Any:
    """Convert a value of an axis from its stored form to its original form. Lists and mappings are validated."""
    if not isinstance(plain, Mapping | list):
        return plain
    *above, last = path.split(".")
    info = type(reduce(getattr, above, series.parameters)).model_fields[last]
    kind: Any = Annotated[info.annotation, info]
    return TypeAdapter(kind).validate_json(json.dumps(plain))
