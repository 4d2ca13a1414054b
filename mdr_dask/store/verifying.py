"""Reading all of a store against what was written: what is damaged, missing, swapped or foreign."""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import zarr

from mdr_dask.errors import StoreBusyError, StoreError
from mdr_dask.plan import BlockIndex
from mdr_dask.store.copies import Copy, copy_name, groups_laid_out, read_copy, root_of
from mdr_dask.store.digests import History, allowed, histories
from mdr_dask.store.files import ASIDE, CLAIMS, LAYOUT, bytes_of, group_name, listed, read_bytes, read_many
from mdr_dask.store.layout import group_document
from mdr_dask.store.records import digest, folder, lines, name_of, opened
from mdr_dask.store.runners import at_work
from mdr_dask.store.seals import read_seal, seal_name
from mdr_dask.store.sound import is_root_sound, unsound_files
from mdr_dask.store.study import attributes, document, laying_out_again, refuse_file

IGNORED = (".partial", ASIDE)
#: What lies beside the files of a store that was published: page, campaign and data, and what is said of all.
PUBLISHED = "published/"
CHECKSUMS = f"{PUBLISHED}checksums.sha256"
CRATE = "ro-crate-metadata.json"


@dataclass(frozen=True)
class Finding:
    """Something that is not as it was written.

    Parameters
    ----------
    kind : str
        ``damaged``, ``missing``, ``swapped`` or ``foreign``.
    name : str
        The file.
    what : str
        What is wrong with it.
    """

    kind: str
    name: str
    what: str


@dataclass
class Inspection:
    """What was found in a store.

    Parameters
    ----------
    findings : list of Finding
        Everything that is not as it was written.
    notes : list of str
        What could not be checked, and what is unfinished.
    files, blocks : int
        Number of files looked at, and of blocks that are in the ledger.
    groups : list of Group
        What is known of every group.
    """

    findings: list[Finding] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    files: int = 0
    blocks: int = 0
    groups: list[Group] = field(default_factory=list)


@dataclass
class Group:
    """What is known of a group: name, copy of its layout, bad blocks and records, and the files that belong to it."""

    series: str
    copy: Copy | None
    arrays: Mapping[str, Any]
    attributes: Mapping[str, Any]
    is_laid_out: bool = True
    bad_blocks: set[BlockIndex] = field(default_factory=set)
    bad_records: set[str] = field(default_factory=set)
    bad_documents: list[str] = field(default_factory=list)
    strangers: list[str] = field(default_factory=list)

    @property
    def documents(self) -> dict[str, bytes]:
        """Metadata of the arrays, and of a series those of its group, as the root has them."""
        found = {
            group_name(self.series, f"{name}/zarr.json"): json.dumps(m).encode() for name, m in self.arrays.items()
        }
        if self.series:
            found[f"{self.series}/zarr.json"] = group_document(self.arrays, self.attributes)
        return found

    @property
    def data(self) -> dict[str, int]:
        """Arrays that are written block by block, ``status`` first, and the number of further dimensions of each."""
        dims = len(self.arrays["status"]["shape"])
        found = {
            name: len(array["shape"]) - dims
            for name, array in self.arrays.items()
            if array["chunk_grid"]["configuration"]["chunk_shape"][:dims] == self.chunks
            and array["dimension_names"][:dims] == self.arrays["status"]["dimension_names"]
            and name != "status"
        }
        return {"status": 0, **found}

    @property
    def chunks(self) -> list[int]:
        """Shape of a block."""
        return list(self.arrays["status"]["chunk_grid"]["configuration"]["chunk_shape"])

    @property
    def grid(self) -> tuple[int, ...]:
        """Number of blocks along each dimension."""
        return tuple(math.ceil(n / c) for n, c in zip(self.arrays["status"]["shape"], self.chunks, strict=True))

    def chunk(self, name: str, block: BlockIndex) -> str:
        """Return the name of a chunk of an array."""
        index = (*block, *(0,) * self.data[name])
        return group_name(self.series, f"{name}/c/{'/'.join(map(str, index))}")

    def has(self, block: BlockIndex) -> bool:
        """Say whether a block lies in the grid."""
        return len(block) == len(self.grid) and all(0 <= i < n for i, n in zip(block, self.grid, strict=True))


def verify(url: str) -> Inspection:
    """Read every file of a store against the digests that were taken when it was written.

    Raises
    ------
    StoreError
        If there is no store of mdr_dask, or it cannot be read.
    StoreBusyError
        If a run is at work on it.
    """
    refuse_file(url)
    runner, parts = at_work(url)
    if runner or parts:
        who = runner or f"part {', '.join(map(str, parts))}"
        raise StoreBusyError(f"{url}: {who} is running on this store; wait for it, or stop it")
    return inspect(url)


def of_store(names: Iterable[str]) -> Iterator[str]:
    """Yield the names of files that belong to a store, not to a run, a repair, or what was published with it."""
    for name in names:
        if not name.endswith(IGNORED) and not name.startswith((CLAIMS, PUBLISHED)) and name != CRATE:
            yield name


def inspect(url: str) -> Inspection:
    """Read every file of a store at which nobody is at work."""
    found = Inspection()
    present = set(of_store(listed(url)))
    found.files = len(present)
    root = _root(url, found, present)
    for series in sorted({_series_of_copy(name) for name in present if _is_copy(name)} | _series_of_root(root)):
        group = _group(url, series, root, found)
        if group is not None:
            found.groups.append(group)
    copies = [group.copy for group in found.groups if group.copy]
    if copies and root and not is_root_sound(root, copies):
        found.findings.append(Finding("damaged", "zarr.json", "not what was laid out"))
    elif copies and root and len(root["attributes"]["history"]) < len(root_of(copies, {})[1]["history"]):
        found.notes.append("a run was stopped while it laid the study out; the next one goes on")
    known = {"zarr.json"}
    for group in found.groups:
        known |= _check_seal(url, group, found, present)
        known |= _check_layout(url, group, found, present)
        known |= _check_blocks(url, group, found, present)
    for name in sorted(present - known):
        found.findings.append(Finding("foreign", name, "nothing here knows it"))
        for group in found.groups:
            if re.fullmatch(
                rf"({'|'.join(group.data)})/c/.*|status/records/.*", name.removeprefix(_path(group.series))
            ):
                group.strangers.append(name)
                break
    return found


def _path(series: str) -> str:
    return f"{series}/" if series else ""


def _is_copy(name: str) -> bool:
    return name.endswith(copy_name("")) and name.count("/") <= copy_name("").count("/") + 1


def _series_of_copy(name: str) -> str:
    return name.removesuffix(copy_name("")).rstrip("/")


def _root(url: str, found: Inspection, present: set[str]) -> dict[str, Any]:
    """Return the root's metadata as they stand; nothing if they cannot be read at all."""
    content = read_bytes(url, "zarr.json")
    copies = [copy for name in groups_laid_out(url) if (copy := read_copy(url, name))]
    if content is None:
        if not copies:
            attributes(url)  # says what is there instead
        found.findings.append(Finding("missing", "zarr.json", "the metadata of the study"))
        return {}
    try:
        root = json.loads(content)
        if not copies or "mdr_dask_layout" in root["attributes"]:
            attributes(url)
        _series_of_root(root)
    except StoreError:
        if not copies or any(copy.study["mdr_dask_layout"] > LAYOUT for copy in copies):
            raise
        found.findings.append(Finding("damaged", "zarr.json", "not what was laid out"))
        return {}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        if not copies:
            what = f"zarr.json is damaged ({type(error).__name__}), and no copy of it is left"
            raise StoreError(f"{url}: {what}; {laying_out_again(url)}") from None
        found.findings.append(Finding("damaged", "zarr.json", "not readable"))
        return {}
    if root["attributes"].get("mdr_dask_layout") != LAYOUT and not copies:
        found.notes.append("made by an earlier version, without digests: only checksums are read, no swap is seen")
    return dict(root)


def _series_of_root(root: Mapping[str, Any]) -> set[str]:
    if not root:
        return set()
    members = root["consolidated_metadata"]["metadata"]
    named = {name for name, member in members.items() if member["node_type"] == "group"}
    return named | ({""} if "axes" in root["attributes"] else set())


def _group(url: str, series: str, root: Mapping[str, Any], found: Inspection) -> Group | None:
    try:
        copy = read_copy(url, series)
    except StoreError:
        found.findings.append(Finding("damaged", copy_name(series), "the copy of the layout"))
        copy = None
    else:
        if copy is None and _attributes(root, series).get("mdr_dask_layout", 1) > 1:
            found.findings.append(Finding("missing", copy_name(series), "the copy of the layout"))
    members = copy.members if copy else root.get("consolidated_metadata", {}).get("metadata", {})
    prefix = _path(series)
    arrays = {
        name.removeprefix(prefix): member
        for name, member in members.items()
        if member["node_type"] == "array" and name.startswith(prefix) and "/" not in name.removeprefix(prefix)
    }
    own = {**copy.study, **copy.own} if copy else _attributes(root, series)
    return Group(series, copy, arrays, own) if "status" in arrays else None


def _attributes(root: Mapping[str, Any], series: str) -> dict[str, Any]:
    if not series:
        return dict(root.get("attributes", {}))
    return dict(root.get("consolidated_metadata", {}).get("metadata", {}).get(series, {}).get("attributes", {}))


def _check_seal(url: str, group: Group, found: Inspection, present: set[str]) -> set[str]:
    """Check that a seal is what was written, whatever it says; return its file."""
    name = seal_name(group.series)
    if name in present and read_seal(url, group.series) is None:
        found.findings.append(Finding("damaged", name, "the seal of what was read before"))
    return {name}


def _check_layout(url: str, group: Group, found: Inspection, present: set[str]) -> set[str]:
    """Check metadata and coordinates; return the files that belong to them."""
    if group.copy is not None:
        contents = {content: name for name, content in group.copy.files.items()}
        for name, fault, content in unsound_files(url, group.copy):
            if content in contents:
                found.findings.append(Finding("swapped", name, f"holds what belongs to {contents[content]}"))
            else:
                what = "laid out once" if content is None else "not what was laid out"
                found.findings.append(Finding(fault, name, what))
        return {*group.copy.files, copy_name(group.series)}
    path = _path(group.series)
    known = {copy_name(group.series), *group.documents}
    for file, expected in group.documents.items():
        content = read_bytes(url, file)
        try:
            same = content is not None and json.loads(content) == json.loads(expected)
        except ValueError:
            same = False
        if not same:
            found.findings.append(Finding("missing" if content is None else "damaged", file, "not what the root says"))
            group.bad_documents.append(file)
    for name in group.arrays:
        if f"{path}{name}/zarr.json" in group.bad_documents:
            known |= {chunk for chunk in present if chunk.startswith(f"{path}{name}/c")}
        elif name not in group.data:
            known |= {chunk for chunk in present if chunk.startswith(f"{path}{name}/c")}
            unread = _reading(url, f"{path}{name}") or _coordinate(url, group, name)
            if unread:
                found.findings.append(Finding("damaged", f"{path}{name}", unread))
                group.is_laid_out = False
    return known


def _reading(url: str, path: str, block: BlockIndex | None = None) -> str | None:
    """Return what Zarr has to say of an array, or of one of its blocks, that cannot be read."""
    try:
        document(url)
        array: Any = zarr.open_group(bytes_of(url), mode="r", use_consolidated=True, zarr_format=3)[path]
        if block is None:
            array[...]
        else:
            array.blocks[block]
    except Exception as error:  # whatever a damaged file makes Zarr and its codecs raise
        return str(error) or type(error).__name__
    return None


def _coordinate(url: str, group: Group, name: str) -> str | None:
    """Compare a coordinate with what the attributes say of it; for a group of which there is no copy."""
    held = zarr.open_array(bytes_of(url), path=f"{_path(group.series)}{name}", mode="r")[...]
    expected = _leaves(json.loads(group.attributes["parameters"]), "")
    expected |= {axis["name"]: axis["labels"] or axis["values"] for axis in group.attributes["axes"]}
    expected["realisation"] = list(range(group.arrays["status"]["shape"][-1]))
    same = name not in expected or np.asarray(held).tolist() == expected[name]
    return None if same else "not what the attributes of its group say"


def _leaves(tree: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in tree.items():
        if isinstance(value, Mapping):
            found |= _leaves(value, f"{prefix}{name}_")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            found[prefix + name] = value
    return found


def _check_blocks(url: str, group: Group, found: Inspection, present: set[str]) -> set[str]:
    """Check records and chunks; return the files that belong to blocks."""
    known = _check_records(url, group, found, present)
    history = histories(record for _, record in _records(url, group))
    finished = {tuple(record["block"]) for name, record in _records(url, group) if name.endswith(".jsonl")}
    begun = 0
    owners = {
        (name, chunk): block
        for block, attempts in history.items()
        for chunks in attempts
        for name, chunk in chunks.items()
    }
    for block in itertools.product(*map(range, group.grid)):
        names = {name: group.chunk(name, block) for name in group.data}
        known |= set(names.values())
        if names["status"] not in present:
            begun += block in history
            if block in finished:
                found.findings.append(Finding("missing", names["status"], "the ledger of a block that was done"))
                group.bad_blocks.add(block)
            continue
        found.blocks += 1
        contents = dict(zip(names, (content for _, content in read_many(url, names.values())), strict=True))
        faults = list(_faults(url, group, block, history.get(block, ()), contents, owners))
        if faults:
            group.bad_blocks.add(block)
            found.findings += faults
    if begun > len(group.bad_blocks):
        found.notes.append("some blocks were begun and never finished; the next run computes them")
    return known


def _faults(
    url: str,
    group: Group,
    block: BlockIndex,
    history: History,
    contents: Mapping[str, bytes | None],
    owners: Mapping[tuple[str, str], BlockIndex],
) -> Iterator[Finding]:
    """Yield what is wrong with a block that is in the ledger."""
    if not history:
        yield Finding("missing", name_of(group.series, block, 1), "the record of a block that is done")
        return
    status = digest(contents["status"] or b"")
    for name, content in contents.items():
        file = group.chunk(name, block)
        written = {chunks[name] for chunks in history if name in chunks}
        expected = written if name == "status" else allowed(history, status, name)
        if expected and content is None:
            yield Finding("missing", file, "written once")
        elif content is not None and written and digest(content) not in (expected or written):
            other = owners.get((name, digest(content)))
            if other is not None and other != block:
                yield Finding("swapped", file, f"holds what belongs to {group.chunk(name, other)}")
            elif digest(content) in written:
                yield Finding("damaged", file, "of an earlier attempt")
            else:
                yield Finding("damaged", file, "not what was written")
        elif content is not None and not written and (fault := _reading(url, f"{_path(group.series)}{name}", block)):
            yield Finding("damaged", file, fault)


def _records(url: str, group: Group) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the records of blocks that can be trusted, and the names of their files."""
    for name, line in lines(url, group.series):
        record = opened(line)
        in_place = name.endswith(".jsonl") or name not in group.bad_records  # of many in a file, the others are good
        if record is not None and in_place and group.has(tuple(record["block"])):
            yield name, record


def _check_records(url: str, group: Group, found: Inspection, present: set[str]) -> set[str]:
    """Find records that are damaged, or not in their place; return the files of all."""
    known = set()
    for name, line in lines(url, group.series):
        known.add(name)
        record = opened(line)
        if record is None:
            found.findings.append(Finding("damaged", name, "a record that is not what was written"))
            group.bad_records.add(name)
        elif name.endswith(".json") and name != name_of(group.series, tuple(record["block"]), record["attempt"]):
            found.findings.append(Finding("swapped", name, f"the record of block {record['block']}"))
            group.bad_records.add(name)
        elif not group.has(tuple(record["block"])):
            found.findings.append(Finding("foreign", name, f"the record of block {record['block']}, which is none"))
            group.bad_records.add(name)
    empty = {name for name in present if name.startswith(folder(group.series)) and name.endswith((".json", ".jsonl"))}
    for name in sorted(empty - known):
        found.findings.append(Finding("damaged", name, "an empty record"))
        group.bad_records.add(name)
    return known | empty
