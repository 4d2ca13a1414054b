"""Compare a store with the digests in its records and the copy of its layout, and repair it."""

from __future__ import annotations

import json
import uuid
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Any

import zarr

from mdr_dask.errors import StoreBusyError, StoreError
from mdr_dask.plan import BlockIndex
from mdr_dask.store.files import (
    ASIDE,
    CLAIMS,
    LAYOUT,
    ROOT,
    bytes_of,
    digest,
    group_name,
    listed,
    read_bytes,
    read_many,
    remove,
    set_aside,
    write_stages,
)
from mdr_dask.store.layout import Copy, copy_name, copy_of, read_copy
from mdr_dask.store.ledgers import Blocks
from mdr_dask.store.locks import at_work, exclusive
from mdr_dask.store.records import decoded, folder, lines, name_of
from mdr_dask.store.study import attributes, document, refuse_file, series_names

IGNORED = (".partial", ASIDE, "status/seal.json")  # development versions wrote status/seal.json
#: Folder in a published store with the files that do not belong to the study itself.
PUBLISHED = "published/"
CHECKSUMS = f"{PUBLISHED}checksums.sha256"
#: A file of a published study that earlier versions wrote next to the store's own files.
_CRATE = "ro-crate-metadata.json"

#: Digests of the chunks that each attempt at a block has written, by array, in the order of the attempts.
History = list[Mapping[str, str]]


@dataclass(frozen=True)
class Finding:
    """A file that differs from what was written, or that should not exist.

    Parameters
    ----------
    kind : str
        ``damaged``, ``missing``, ``swapped`` or ``foreign``.
    name : str
        The file.
    what : str
        The fault, for messages.
    """

    kind: str
    name: str
    what: str


@dataclass
class Group:
    """A group of a store during verification: its blocks, and the faults that `repair` removes."""

    blocks: Blocks
    bad_blocks: set[BlockIndex] = field(default_factory=set)
    bad_records: set[str] = field(default_factory=set)
    strangers: list[str] = field(default_factory=list)


@dataclass
class Inspection:
    """What was found in a store.

    Parameters
    ----------
    findings : list of Finding
        All faulty files.
    notes : list of str
        Facts that are not damage, such as an interrupted run or an earlier version.
    groups : list of Group
        The groups of the store.
    copies : list of Copy
        Copies of the layouts of the groups.
    uncopied : dict of str to set of str
        Layout files of each group that has no copy of its layout.
    files, blocks : int
        Number of files, and number of blocks in the ledgers.
    """

    findings: list[Finding] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    groups: list[Group] = field(default_factory=list)
    copies: list[Copy] = field(default_factory=list)
    uncopied: dict[str, set[str]] = field(default_factory=dict)
    files: int = 0
    blocks: int = 0


def verify(url: str) -> Inspection:
    """Read every file of a store and compare it with what was written.

    Raises
    ------
    StoreError
        If there is no store of mdr_dask, or it cannot be read.
    StoreBusyError
        If a run is active in the store.
    """
    refuse_file(url)
    runner, parts = at_work(url)
    if runner or parts:
        who = runner or f"part {', '.join(map(str, parts))}"
        raise StoreBusyError(f"{url}: {who} is running on this store; wait for it, or stop it")
    return _inspect(url)


def repair(url: str) -> tuple[Inspection, Inspection]:
    """Repair a store as far as possible, and return the inspections before and after the repair.

    Metadata and coordinates are written again from their copies. Damaged blocks are removed, so that the next run
    computes them. Records and chunks that do not belong to the study are renamed. Other foreign files are kept.

    Raises
    ------
    StoreError
        If there is no store of mdr_dask, or it cannot be written.
    StoreBusyError
        If a run is active in the store.
    """
    refuse_file(url)
    with exclusive(url):
        found = _inspect(url)
        damaged = {finding.name for finding in found.findings}
        latest = sorted(found.copies, key=lambda copy: copy.age)
        files = {name: content for copy in latest for name, content in copy.files.items() if name in damaged}
        root = {name: files.pop(name) for name in ["zarr.json"] if name in files}
        write_stages(url, [files, root])
        for series, names in found.uncopied.items():
            contents = {name: content for name, content in read_many(url, sorted(names)) if content is not None}
            if not names & damaged and contents.keys() == names:
                write_stages(url, [copy_of(series, contents, {})])
        for group in found.groups:
            for block in sorted(group.bad_blocks):
                remove(url, [group.blocks.chunk(name, block) for name in group.blocks.further])  # the ledger first
            _set_aside_records(url, group)
            set_aside(url, group.strangers)
        return found, _inspect(url)


def of_store(names: Iterable[str]) -> Iterator[str]:
    """Yield the names of files that belong to a study; leave out files of a run, a repair or a publication."""
    for name in names:
        if not name.endswith(IGNORED) and not name.startswith((CLAIMS, PUBLISHED)) and name != _CRATE:
            yield name


def _inspect(url: str) -> Inspection:
    found = Inspection()
    present = set(of_store(listed(url)))
    found.files = len(present)
    known = _check_layout(url, found, present)
    for group in found.groups:
        known |= _check_records(url, group, found, present)
        known |= _check_blocks(url, group, found, present)
    for name in sorted(present - known):
        found.findings.append(Finding("foreign", name, "no part of this study"))
        for group in found.groups:
            series = group.blocks.series
            prefixes = [folder(series), *(group_name(series, f"{array}/c/") for array in group.blocks.further)]
            if name.startswith(tuple(prefixes)):
                group.strangers.append(name)
                break
    return found


def _check_layout(url: str, found: Inspection, present: set[str]) -> set[str]:
    """Compare metadata and coordinates with their copies; return the names of all layout files."""
    suffix, known, documents = copy_name(""), {"zarr.json"}, {}
    series = {
        name.removesuffix(suffix).rstrip("/") for name in present if name.endswith(suffix) and name.count("/") < 3
    }
    try:
        attributes(url)
        series |= {"" if name == ROOT else name for name in series_names(url)}
    except StoreError:
        if not series:
            raise
    for name in sorted(series):
        known.add(copy_name(name))
        copy = _copy(url, name, found)
        if copy is not None:
            documents[name] = json.loads(copy.files[group_name(name, "zarr.json")])
            continue
        documents[name] = _document(url, name) or {}
        layout = documents[name].get("attributes", {}).get("mdr_dask_layout", LAYOUT)
        if layout < LAYOUT:
            found.notes.append("made by version 0.1, without digests: files that were swapped are not found")
        elif copy_name(name) not in present:
            found.findings.append(Finding("missing", copy_name(name), "the copy of the layout"))
        known |= _unverified(url, name, documents[name], found, present)
        data = [group_name(name, f"{array}/c/") for array in documents[name].get("attributes", {}).get("outputs", ())]
        data.append(group_name(name, "status/c/"))
        found.uncopied[name] = {"zarr.json", *(k for k in known if k in present and not k.startswith(tuple(data)))}
        found.uncopied[name] -= {copy_name(each) for each in series}
    for name, metadata in documents.items():
        if "status" in metadata.get("consolidated_metadata", {}).get("metadata", {}):
            found.groups.append(Group(Blocks.of(name, metadata)))
    return known | _compared(url, found)


def _copy(url: str, series: str, found: Inspection) -> Copy | None:
    try:
        copy = read_copy(url, series)
    except StoreError:
        found.findings.append(Finding("damaged", copy_name(series), "the copy of the layout"))
        return None
    found.copies += [copy] if copy else []
    return copy


def _compared(url: str, found: Inspection) -> set[str]:
    """Compare layout files with their copies; return the names of these files."""
    contents = {content: name for copy in found.copies for name, content in copy.files.items()}
    names, root = {name for copy in found.copies for name in copy.files}, read_bytes(url, "zarr.json")
    for name, content in read_many(url, sorted(names)):
        if any(copy.accepts(name, content, root) for copy in found.copies if name in copy.files):
            continue
        if content is None:
            found.findings.append(Finding("missing", name, "part of the layout"))
        elif content in contents:
            found.findings.append(Finding("swapped", name, f"holds what belongs to {contents[content]}"))
        else:
            found.findings.append(Finding("damaged", name, "not what was laid out"))
    if root is not None and any(copy.before.get("zarr.json") == digest(root) for copy in found.copies):
        found.notes.append("a run was stopped while it laid the study out; the next run goes on")
    return names


def _document(url: str, series: str) -> Mapping[str, Any] | None:
    try:
        return document(url, series)
    except StoreError:
        return None


def _unverified(url: str, series: str, metadata: Mapping[str, Any], found: Inspection, present: set[str]) -> set[str]:
    """Check the metadata and coordinates of a group without a copy of its layout; return the names of their files."""
    members = metadata.get("consolidated_metadata", {}).get("metadata", {})
    known = {group_name(series, "zarr.json")}
    for name, member in members.items():
        if member["node_type"] == "array" and "/" not in name:
            path = group_name(series, name)
            known |= {file for file in present if file.startswith(f"{path}/c")} | {f"{path}/zarr.json"}
            content = read_bytes(url, f"{path}/zarr.json")
            if content is None:
                found.findings.append(Finding("missing", f"{path}/zarr.json", "the metadata of an array"))
            elif _parsed(content) != member:
                found.findings.append(Finding("damaged", f"{path}/zarr.json", "not as in the metadata of the study"))
            elif name not in ("status", *metadata["attributes"]["outputs"]) and (fault := _reading(url, path)):
                found.findings.append(Finding("damaged", path, fault))
    return known


def _parsed(content: bytes) -> Any:
    try:
        return json.loads(content)
    except (ValueError, RecursionError):
        return None


def _reading(url: str, path: str, block: BlockIndex | None = None) -> str | None:
    """Read an array or one of its blocks; return the error of Zarr as text, or None if reading succeeds."""
    try:
        array: Any = zarr.open_group(bytes_of(url), mode="r", use_consolidated=True, zarr_format=3)[path]
        if block is None:
            array[...]
        else:
            array.blocks[block]
    except Exception as error:  # a damaged file may cause any error in Zarr and its codecs
        return str(error) or type(error).__name__
    return None


def _check_records(url: str, group: Group, found: Inspection, present: set[str]) -> set[str]:
    """Find records that are damaged, swapped or foreign; return the names of all record files."""
    series, known = group.blocks.series, set[str]()
    for name, line in lines(url, series):
        known.add(name)
        record = decoded(line)
        if record is None:
            finding = Finding("damaged", name, "a record is not what was written")
        elif name.endswith(".json") and name != name_of(series, tuple(record["block"]), record["attempt"]):
            finding = Finding("swapped", name, f"the record of block {record['block']}")
        elif not group.blocks.has(tuple(record["block"])):
            finding = Finding("foreign", name, f"the record of block {record['block']}, which does not exist")
        else:
            continue
        found.findings.append(finding)
        group.bad_records.add(name)
    files = {name for name in present if name.startswith(folder(series)) and name.endswith((".json", ".jsonl"))}
    for name in sorted(files - known):
        found.findings.append(Finding("damaged", name, "an empty record"))
        group.bad_records.add(name)
    return files


def _check_blocks(url: str, group: Group, found: Inspection, present: set[str]) -> set[str]:
    """Compare the chunks of every block with the digests in its records; return the names of all chunks."""
    blocks, known = group.blocks, set[str]()
    histories, merged = _histories(url, group)
    owners = {
        (name, chunk): block
        for block, history in histories.items()
        for chunks in history
        for name, chunk in chunks.items()
    }
    begun = 0
    for block in blocks.indices:
        names = {blocks.chunk(name, block): name for name in blocks.further}
        known |= names.keys()
        status = blocks.chunk("status", block)
        if status not in present:
            begun += block in histories
            if block in merged:
                found.findings.append(Finding("missing", status, "the ledger of a block that was done"))
                group.bad_blocks.add(block)
            continue
        found.blocks += 1
        contents = {names[name]: content for name, content in read_many(url, names)}
        faults = list(_faults(url, group, block, histories.get(block, []), contents, owners))
        if faults:
            group.bad_blocks.add(block)
            found.findings += faults
    if begun > len(group.bad_blocks):
        found.notes.append("some blocks were begun and not finished; the next run computes them")
    return known


def _histories(url: str, group: Group) -> tuple[dict[BlockIndex, History], set[BlockIndex]]:
    """Return the digests of every block from its intact records, and the blocks that have a merged record.

    Only records of attempts that were written to the ledger are merged, so the ledger must contain these blocks.
    """
    known: dict[tuple[BlockIndex, int], Mapping[str, str]] = {}
    merged = set()
    for name, line in lines(url, group.blocks.series):
        record, is_merged = decoded(line), name.endswith(".jsonl")
        if record is None or not group.blocks.has(tuple(record["block"])):
            continue
        if is_merged or name not in group.bad_records:
            known[tuple(record["block"]), record["attempt"]] = record.get("chunks", {})
            merged |= {tuple(record["block"])} if is_merged else set()
    found: dict[BlockIndex, History] = {}
    for (block, _), chunks in sorted(known.items(), key=itemgetter(0)):
        found.setdefault(block, []).append(chunks)
    return found, merged


def _faults(
    url: str,
    group: Group,
    block: BlockIndex,
    history: History,
    contents: Mapping[str, bytes | None],
    owners: Mapping[tuple[str, str], BlockIndex],
) -> Iterator[Finding]:
    """Yield the faults of a block that is in the ledger."""
    if not history:
        yield Finding("missing", name_of(group.blocks.series, block, 1), "the record of a block that is done")
        return
    status = digest(contents["status"] or b"")
    for name, content in contents.items():
        file, written = group.blocks.chunk(name, block), {chunks[name] for chunks in history if name in chunks}
        expected = written if name == "status" else _expected(history, status, name)
        if not written:  # records of version 0.1 have no digests
            fault = content is not None and _reading(url, group_name(group.blocks.series, name), block)
            if fault:
                yield Finding("damaged", file, fault)
        elif content is None:
            yield from [Finding("missing", file, "a chunk of a block that is done")] if expected else []
        elif digest(content) not in (expected or written):
            other = owners.get((name, digest(content)))
            if other is not None and other != block:
                yield Finding("swapped", file, f"holds what belongs to {group.blocks.chunk(name, other)}")
            else:
                old = digest(content) in written
                yield Finding("damaged", file, "of an earlier attempt" if old else "not what was written")


def _expected(history: History, status: str, name: str) -> set[str]:
    """Return the digests that the chunk of an array may have, given the digest of the ledger of the same block.

    One of these attempts at the block wrote the chunk: the attempt that wrote this ledger; if that attempt did not
    write the array, the last earlier attempt that did; or a later attempt that was killed before it wrote its ledger.
    """
    first = next((i for i, chunks in enumerate(history) if chunks.get("status") == status), len(history))
    found, last = set[str](), set[str]()
    for i, chunks in enumerate(history):
        last = {chunks[name]} if name in chunks else last
        found |= last if i >= first else set()
    return found


def _set_aside_records(url: str, group: Group) -> None:
    """Rename files that contain damaged records, or records of damaged blocks.

    The other records in these files are first copied to a new file.
    """
    series, bad = group.blocks.series, set(group.bad_records)
    found = [(name, line, decoded(line)) for name, line in lines(url, series)]
    bad |= {name for name, _, record in found if record is None or tuple(record["block"]) in group.bad_blocks}
    good = [
        line
        for name, line, record in found
        if name in bad and name.endswith(".jsonl") and record and tuple(record["block"]) not in group.bad_blocks
    ]
    if good:
        write_stages(url, [{f"{folder(series)}{uuid.uuid4().hex[:12]}.jsonl": b"".join(line + b"\n" for line in good)}])
    set_aside(url, sorted(bad))
