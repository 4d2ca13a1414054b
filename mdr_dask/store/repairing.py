"""Mending a store: what was made from the campaign is written anew, what was computed is marked as missing."""

from __future__ import annotations

import uuid

from mdr_dask.campaign import Campaign
from mdr_dask.store.copies import Copy, root_of
from mdr_dask.store.files import read_json, read_many, remove, set_aside, write_stages
from mdr_dask.store.layout import OF_SERIES, group_document
from mdr_dask.store.records import folder, lines, opened
from mdr_dask.store.relaid import lay_out_again
from mdr_dask.store.runners import alone
from mdr_dask.store.seals import seal_name
from mdr_dask.store.sound import unsound_files
from mdr_dask.store.study import refuse_file
from mdr_dask.store.verifying import Finding, Group, Inspection, inspect


def repair(url: str, campaign: Campaign | None = None) -> tuple[Inspection, Inspection]:
    """Mend what can be mended, and return what was found before and after.

    Metadata and coordinates are written anew from their copies, or from the campaign if the copies are gone, too.
    Blocks that are damaged lose their chunks, so that the next run computes them. Records and chunks that do not belong
    are renamed; other foreign files stay.

    Raises
    ------
    StoreError
        If there is no store of mdr_dask, or it cannot be written.
    StoreBusyError
        If a run is at work on it.
    """
    refuse_file(url)
    with alone(url):
        lost = lay_out_again(url, campaign) if campaign else []
        found = inspect(url)
        found.findings[:0] = [Finding("missing", name, "laid out again from the campaign") for name in lost]
        _mend_layout(url, found)
        for group in found.groups:
            for block in sorted(group.bad_blocks):
                remove(url, [group.chunk(name, block) for name in group.data])  # the ledger first
            _set_aside_records(url, group)
            set_aside(url, group.strangers)
            remove(url, [seal_name(group.series)])  # the next run seals what it has looked at
        return found, inspect(url)


def _mend_layout(url: str, found: Inspection) -> None:
    """Write metadata and coordinates anew, the root last; and the copy of a layout that is sound without it."""
    named = {finding.name for finding in found.findings}
    copies = [group.copy for group in found.groups if group.copy]
    for copy in copies:
        write_stages(url, [{name: copy.files[name] for name, _, _ in unsound_files(url, copy)}])
    if copies and "zarr.json" in named:
        kept = {}
        if len(copies) < len(found.groups):
            kept = (read_json(url, "zarr.json") or {}).get("consolidated_metadata", {}).get("metadata", {})
        write_stages(url, [{"zarr.json": group_document(*root_of(copies, kept))}])
    for group in found.groups:
        write_stages(url, [{name: group.documents[name] for name in group.bad_documents}])
        if group.copy is None and group.is_laid_out:
            write_stages(url, [dict([_copy_of(url, group).file()])])


def _copy_of(url: str, group: Group) -> Copy:
    """Take the copy of a layout from the layout itself."""
    path = f"{group.series}/" if group.series else ""
    wanted = [f"{path}{name}/zarr.json" for name in group.arrays]
    wanted += [f"{path}zarr.json"] if path else []
    for name, member in group.arrays.items():
        if name not in group.data:
            wanted += [f"{path}{name}/c{'/0' * len(member['shape'])}"]
    files = {name: content for name, content in read_many(url, wanted) if content is not None}
    own = {name: value for name, value in group.attributes.items() if name in OF_SERIES}
    study = {name: value for name, value in group.attributes.items() if name not in OF_SERIES}
    return Copy(group.series, files, study, own)


def _set_aside_records(url: str, group: Group) -> None:
    """Rename files with records that are damaged or of bad blocks, once the others in them have a file of their own."""
    bad, good = set(group.bad_records), []
    for name, line in lines(url, group.series):
        record = opened(line)
        if record is None or tuple(record["block"]) in group.bad_blocks:
            bad.add(name)
    for name, line in lines(url, group.series):
        record = opened(line)
        if name in bad and name.endswith(".jsonl") and record and tuple(record["block"]) not in group.bad_blocks:
            good.append(line)
    if good:
        together = b"".join(line + b"\n" for line in good)
        write_stages(url, [{f"{folder(group.series)}{uuid.uuid4().hex[:12]}.jsonl": together}])
    set_aside(url, sorted(bad))
