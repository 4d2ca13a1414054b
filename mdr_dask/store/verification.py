"""Compare a store with the digests in the records of blocks, and repair the store."""

from __future__ import annotations

import json
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from mdr_dask.errors import StoreBusyError
from mdr_dask.plan import BlockIndex
from mdr_dask.store.files import (
    CLAIMS,
    LAYOUT,
    digest,
    group_name,
    listed,
    read_bytes,
    read_many,
    remove,
    write_bytes,
    write_stages,
)
from mdr_dask.store.identity import block_digests, of_other_campaign
from mdr_dask.store.integrity import RECORD, read_record
from mdr_dask.store.layout import Finding, coordinate_files, group_names, layout_faults, metadata_files
from mdr_dask.store.ledgers import Blocks
from mdr_dask.store.locks import active_runs, exclusive
from mdr_dask.store.records import decoded, folder, lines, name_of
from mdr_dask.store.study import attributes, document, group_of, refuse_file

#: Ending of temporary files, which do not belong to the study.
IGNORED = ".partial"
#: Folder with the files that ``mdr-dask publish`` adds to the files of a study.
PUBLISHED = "published/"
CHECKSUMS = f"{PUBLISHED}checksums.sha256"


@dataclass
class Group:
    """A group of a store during verification: the blocks of the group, and the faults that `repair` removes."""

    blocks: Blocks
    # The digest of the campaign for each block (`mdr_dask.store.identity.block_digests`).
    digests: Callable[[Sequence[Sequence[int]]], str]
    # Digests of the written chunks. The keys are the block, the number of the attempt, and the name of the array.
    attempts: dict[BlockIndex, dict[int, Mapping[str, str]]] = field(default_factory=dict)
    # Blocks with merged records. The ledger must contain these blocks.
    finished: set[BlockIndex] = field(default_factory=set)
    bad_blocks: set[BlockIndex] = field(default_factory=set)
    bad_records: set[str] = field(default_factory=set)
    foreign: list[str] = field(default_factory=list)


@dataclass
class Inspection:
    """The result of the verification of a store."""

    findings: list[Finding] = field(default_factory=list)
    # Messages about events that are no damage, such as an interrupted run.
    notes: list[str] = field(default_factory=list)
    groups: list[Group] = field(default_factory=list)
    # Number of files in the store, and number of blocks that are in the ledgers.
    files: int = 0
    blocks: int = 0


def verify(url: str) -> Inspection:
    """Read every file of a store and compare the file with what was written.

    Raise StoreError if there is no store of mdr_dask or the store cannot be read. Raise StoreBusyError if a run is
    active in the store.
    """
    refuse_file(url)
    if who := ", ".join(active_runs(url)):
        raise StoreBusyError(f"{url}: running on this store: {who}; wait until it ends, or stop it")
    return _inspect(url)


def repair(url: str) -> tuple[Inspection, Inspection]:
    """Repair a store as far as possible, and return the inspections before and after the repair.

    Damaged or missing metadata are written again. Damaged coordinates, damaged records, damaged blocks and blocks of
    another campaign are removed; the next run writes the coordinates and computes the blocks again. Foreign files are
    removed only from the folders of chunks and records. Raise StoreBusyError if a run is active in the store.
    """
    refuse_file(url)
    with exclusive(url):
        found = _inspect(url)
        bad = {finding.name for finding in found.findings}
        record = read_record(url)
        if record is not None and "zarr.json" in bad:
            write_bytes(url, "zarr.json", record.root.encode())
        root = document(url) or {}
        metadata = {name: content for name, content in metadata_files(root).items() if name in bad}
        write_stages(url, [metadata])
        remove(url, [name for name in (RECORD, *coordinate_files(root, bad)) if name in bad])
        for group in found.groups:
            for block in sorted(group.bad_blocks):
                # `further` begins with the ledger: the ledger is removed first
                remove(url, [group.blocks.chunk(name, block) for name in group.blocks.further])
            _remove_records(url, group)
            remove(url, group.foreign)
        return found, _inspect(url)


def of_store(names: Iterable[str]) -> Iterator[str]:
    """Yield the names of files of the study itself. Leave out temporary, lock and ``published/`` files."""
    for name in names:
        if not name.endswith(IGNORED) and not name.startswith((CLAIMS, PUBLISHED)):
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
                group.foreign.append(name)
                break
    return found


def _check_layout(url: str, found: Inspection, present: set[str]) -> set[str]:
    """Compare metadata and coordinates with the record of the layout; return the names of all files of the layout."""
    record = read_record(url)
    if record is None:
        attributes(url)  # raises StoreError if there is no study
    found.findings += layout_faults(url)
    content = read_bytes(url, "zarr.json") or b""
    if record is not None and any(finding.name == "zarr.json" for finding in found.findings):
        content = record.root.encode()
    root = json.loads(content)
    members = root["consolidated_metadata"]["metadata"]
    for name in ["", *group_names(members)]:
        group = group_of(root, name)
        if group is not None and "status" in group["consolidated_metadata"]["metadata"]:
            found.groups.append(Group(Blocks.of(name, group), block_digests(group["attributes"])))
    if record is None:
        if root["attributes"]["mdr_dask_layout"] < LAYOUT:
            found.notes.append("made by version 0.1, without digests: its files cannot be checked")
        return {RECORD, "zarr.json", *metadata_files(root), *coordinate_files(root, present)}
    if digest(content) in record.files["zarr.json"][:-1]:
        found.notes.append("a run was stopped while it wrote the layout; the next run continues")
    return {RECORD, *record.files}


def _check_records(url: str, group: Group, found: Inspection, present: set[str]) -> set[str]:
    """Find damaged and foreign records, note the digests of good records, and return the names of all record files."""
    series, known = group.blocks.series, set[str]()
    for name, line in lines(url, series):
        known.add(name)
        record, is_merged = decoded(line), name.endswith(".jsonl")
        if record is None:
            finding = Finding("damaged", name, "a record is not what was written")
        elif not is_merged and name != name_of(series, tuple(record["block"]), record["attempt"]):
            finding = Finding("damaged", name, f"contains the record of block {record['block']}")
        elif not group.blocks.has(tuple(record["block"])):
            finding = Finding("foreign", name, f"contains the record of block {record['block']}, which does not exist")
        else:
            block = tuple(record["block"])
            group.attempts.setdefault(block, {})[record["attempt"]] = record.get("chunks", {})
            if of_other_campaign(record, group.digests):
                finding = Finding(
                    "foreign", name, f"contains the record of block {record['block']} of another campaign"
                )
                found.findings.append(finding)
                group.bad_records.add(name)
                group.bad_blocks.add(block)
            if is_merged:  # records are merged only for blocks in the ledger
                group.finished.add(block)
            continue
        found.findings.append(finding)
        group.bad_records.add(name)
    files = {name for name in present if name.startswith(folder(series)) and name.endswith((".json", ".jsonl"))}
    for name in sorted(files - known):
        found.findings.append(Finding("damaged", name, "an empty record"))
        group.bad_records.add(name)
    return files


def _check_blocks(url: str, group: Group, found: Inspection, present: set[str]) -> set[str]:
    """Compare the chunks of blocks with the digests in the records of these blocks.

    Return the names that the files of chunks may have, whether or not the files exist.
    """
    blocks, known = group.blocks, set[str]()
    begun = 0
    for block in blocks.indices:
        names = {blocks.chunk(name, block): name for name in blocks.further}
        known |= names.keys()
        status = blocks.chunk("status", block)
        if status not in present:
            begun += block in group.attempts
            if block in group.finished:
                found.findings.append(Finding("missing", status, "the ledger of a block that was done"))
                group.bad_blocks.add(block)
            continue
        found.blocks += 1
        contents = {names[name]: content for name, content in read_many(url, names)}
        faults = list(_faults(group, block, contents))
        if faults:
            group.bad_blocks.add(block)
            found.findings += faults
    if begun > len(group.bad_blocks):
        found.notes.append("some blocks were begun and not finished; the next run computes them")
    return known


def _faults(group: Group, block: BlockIndex, contents: Mapping[str, bytes | None]) -> Iterator[Finding]:
    history = [chunks for _, chunks in sorted(group.attempts.get(block, {}).items())]
    if not history:
        yield Finding("missing", name_of(group.blocks.series, block, 1), "the record of a block that is done")
        return
    status = digest(contents["status"] or b"")
    for name, content in contents.items():
        file, written = group.blocks.chunk(name, block), {chunks[name] for chunks in history if name in chunks}
        expected = written if name == "status" else _expected(history, status, name)
        if not written:  # records of version 0.1 have no digests
            continue
        if content is None:
            yield from [Finding("missing", file, "a chunk of a block that is done")] if expected else []
        elif digest(content) not in (expected or written):
            is_older = digest(content) in written
            yield Finding("damaged", file, "from an earlier attempt" if is_older else "not what was written")


def _expected(history: Sequence[Mapping[str, str]], status: str, name: str) -> set[str]:
    """Return the digests that the chunk of an array may have. `status` is the digest of the chunk of the ledger.

    One attempt wrote this chunk of the ledger. The chunk of the array comes from the same attempt, or from an earlier
    attempt if this one did not write the array, or from a later attempt that was killed before writing the ledger.
    """
    first = next((i for i, chunks in enumerate(history) if chunks.get("status") == status), len(history))
    found, last = set[str](), set[str]()
    for i, chunks in enumerate(history):
        last = {chunks[name]} if name in chunks else last
        found |= last if i >= first else set()
    return found


def _remove_records(url: str, group: Group) -> None:
    """Remove files with damaged records or records of damaged blocks. First copy the good records to a new file."""
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
    remove(url, sorted(bad))
