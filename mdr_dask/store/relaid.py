"""A store whose metadata are gone, and the copies of them too, is laid out again from its campaign."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping

from mdr_dask.campaign import Campaign
from mdr_dask.errors import StoreError
from mdr_dask.plan import Template, templates
from mdr_dask.store.copies import copy_name, groups_laid_out
from mdr_dask.store.files import group_name, listed, read_bytes, read_json, set_aside
from mdr_dask.store.layout import laid_out_files, lay_out
from mdr_dask.store.study import document

_LEDGER = re.compile(r"(?:[^/]+/)?status/c/.*")


def is_lost(url: str) -> bool:
    """Say whether nothing in a store tells any more how it was laid out."""
    if groups_laid_out(url):
        return False
    try:
        return document(url) is None
    except StoreError:
        return True


def lay_out_again(url: str, campaign: Campaign) -> list[str]:
    """Write metadata and coordinates anew, if they and their copies are gone; return the names of what was lost.

    What is left has to fit: the shape of the ledger, and every coordinate.

    Raises
    ------
    StoreError
        If something does not fit the campaign; nothing is touched.
    """
    if not is_lost(url):
        return []
    layout = _layout(url, campaign)
    for fault in _misfits(url, layout):
        raise StoreError(f"{url}: {fault}; give the campaign that made the store, with its values in the same order")
    of_groups = [name for t in layout for name in (group_name(t.series.name, "zarr.json"), copy_name(t.series.name))]
    lost = list(dict.fromkeys(["zarr.json", *of_groups]))
    set_aside(url, lost)
    lay_out(url, layout)
    return lost


def _layout(url: str, campaign: Campaign) -> tuple[Template, ...]:
    ledgers = {series.name: _ledger(url, series.name) for series in campaign.series}
    known = {name: ledger for name, ledger in ledgers.items() if ledger}
    if not known:
        raise StoreError(f"{url}: no ledger of {campaign.source} here; 'mdr-dask run {campaign.source}' makes one")
    realisations = max(sizes["realisation"] for sizes, _ in known.values())
    return templates(campaign, realisations, {name: chunks for name, (_, chunks) in known.items()})


def _ledger(url: str, series: str) -> tuple[Mapping[str, int], Mapping[str, int]] | None:
    """Return lengths of the dimensions and of blocks, as the metadata of the ledger have them."""
    name = group_name(series, "status/zarr.json")
    held = read_json(url, name)
    if held is None:
        return None
    try:
        dims, chunks = held["dimension_names"], held["chunk_grid"]["configuration"]["chunk_shape"]
        sizes, lengths = (dict(zip(dims, each, strict=True)) for each in (held["shape"], chunks))
        return {"realisation": int(sizes["realisation"]), **sizes}, {dim: int(n) for dim, n in lengths.items()}
    except (KeyError, TypeError, ValueError):
        raise StoreError(f"{url}: {name} is damaged, too: nothing tells how blocks were cut") from None


def _misfits(url: str, layout: Iterable[Template]) -> Iterator[str]:
    """Yield what is in the store and is not as the campaign has it."""
    ledger = set()
    for template in layout:
        series = template.series.name
        for name, content in laid_out_files(template).items():
            file = group_name(series, name)
            held = read_bytes(url, file)
            if held is not None and not _equal(held, content):
                yield f"{file} is not as the campaign has it"
        ledger |= {group_name(series, f"status/c/{'/'.join(map(str, index))}") for index in template.block_indices()}
    for name in listed(url):
        if _LEDGER.fullmatch(name) and name not in ledger:
            yield f"{name} is no block of the campaign"


def _equal(held: bytes, content: bytes) -> bool:
    if held == content:
        return True
    try:
        return bool(json.loads(held) == json.loads(content))
    except ValueError:
        return False
