"""Cheap checks: that a study is laid out as it was, and that each case in the ledger as done has its chunks."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdr_dask.errors import StoreError
from mdr_dask.plan import BlockIndex
from mdr_dask.store.copies import Copy, copy_name, read_copy, root_of
from mdr_dask.store.digests import allowed, histories
from mdr_dask.store.files import EMPTY, GONE, ROOT, read_many, write_stages
from mdr_dask.store.ledgers import Ledger, done_blocks, read_ledger
from mdr_dask.store.records import digest, records
from mdr_dask.store.seals import Chunks, Seal, read_seal
from mdr_dask.store.study import document

#: A look reads at most so many chunks of values that no seal knows, and so many bytes of them: that is cheap.
FEW, SMALL = 2000, 2**26
#: Bytes that are read at most to seal them, at the end of a run.
SEALED = 2**30
#: Most faults that a message names.
NAMED = 3


@dataclass(frozen=True)
class Look:
    """What a look at a group finds: the stamps of all its chunks, and the ledger.

    Parameters
    ----------
    url : str
        Path or URL of the store.
    held : mapping
        Metadata of the group.
    chunks : Chunks
        Where its chunks lie.
    seal : Seal
        What was known before.
    stamps : mapping of str to int64 array, shape of the grid of blocks
        Of every array, the ledger first.
    ledger : Ledger
        What is in the ledger.
    """

    url: str
    held: Mapping[str, Any]
    chunks: Chunks
    seal: Seal
    stamps: Mapping[str, NDArray[np.int64]]
    ledger: Ledger

    @cached_property
    def status(self) -> NDArray[np.int8]:
        """The ledger as an array."""
        return self.ledger.decoded(self.url, self.held)

    @cached_property
    def unsealed(self) -> dict[str, NDArray[np.bool_]]:
        """Which chunks of each array are there and have not the stamp of the seal."""
        return {name: (stamps > EMPTY) & ~self._same(name) for name, stamps in self.stamps.items()}

    def _same(self, array: str) -> NDArray[np.bool_]:
        return np.asarray(self.stamps[array] == self.seal.known(array, self.chunks.grid))

    @property
    def has_digests(self) -> bool:
        """Whether its records can say what was written; those of version 0.1 wrote no chunks of nothing but nan."""
        return bool(self.held["attributes"]["mdr_dask_layout"] > 1)

    @property
    def is_sealed(self) -> bool:
        """Whether nothing has to be read to know that every chunk is what was written."""
        return not (self.has_digests and any(unsealed.any() for unsealed in self.unsealed.values()))

    def faults(self) -> Iterator[str]:
        """Yield what is wrong with blocks in the ledger: chunks that are gone, empty, or not what was written."""
        if not self.has_digests:
            return
        done = done_blocks(self.status, self.chunks.lengths)
        outputs = list(self.stamps)[1:]
        for array in outputs:
            for block in _blocks(done & (self.stamps[array] <= EMPTY)):
                what = "missing" if self.stamps[array][block] == GONE else "empty"
                yield f"{self.chunks.name(array, block)} is {what}"
        asked = {array: self.unsealed[array] & done for array in outputs}
        if sum(map(np.count_nonzero, asked.values())) > FEW:
            asked = {}
        for array, block, is_sound in self.compared({"status": self.unsealed["status"], **asked}, SMALL):
            if not is_sound:
                yield f"{self.chunks.name(array, block)} is not what was written there"

    def compared(self, asked: Mapping[str, NDArray[np.bool_]], most: int) -> Iterator[tuple[str, BlockIndex, bool]]:
        """Yield array and block of chunks, and whether each is what records tell, until so many bytes were read."""
        if not any(mask.any() for mask in asked.values()):
            return
        history = histories(records(self.url, self.chunks.series))
        ledger = self.ledger.digests
        for array, mask in asked.items():
            blocks = _blocks(mask)
            names = [self.chunks.name(array, block) for block in blocks]
            held = map(ledger.__getitem__, self.ledger.which[mask])
            for block, content in zip(blocks, held if array == "status" else self._read(names, most), strict=False):
                attempts = history.get(block, ())
                if array == "status":
                    expected = {attempt["status"] for attempt in attempts if "status" in attempt}
                else:
                    expected = allowed(attempts, ledger[self.ledger.which[block]], array)
                yield array, block, not expected or content in expected

    def _read(self, names: Iterable[str], most: int) -> Iterator[str]:
        """Yield the digests of files, until so many bytes were read."""
        for _, content in read_many(self.url, names):
            yield digest(content or b"")
            most -= len(content or b"")
            if most < 0:
                return


def _blocks(mask: NDArray[np.bool_]) -> list[BlockIndex]:
    return [tuple(block) for block in np.argwhere(mask).tolist()]


def look(url: str, series: str) -> Look:
    """Look at a group of a study: at the stamp of each chunk, and at the ledger as far as no seal knows it."""
    held = document(url, series) or {}
    chunks = Chunks.of(series, held)
    seal = read_seal(url, series) or Seal.nothing(series, chunks.grid)
    stamps = {array: chunks.stamps(url, array) for array in chunks.further}
    return Look(url, held, chunks, seal, stamps, read_ledger(url, chunks, seal, stamps["status"]))


def seal(url: str, series: str) -> None:
    """Read what no seal knows of a group, if it is not too much, and seal what is as it was written."""
    found = look(url, series)
    if found.is_sealed:
        return
    stamps = {array: np.where(found._same(array), known, 0) for array, known in found.stamps.items()}
    for array, block, is_sound in found.compared(found.unsealed, SEALED):
        if is_sound:
            stamps[array][block] = found.stamps[array][block]
    ledger = found.ledger.only(stamps["status"] != GONE)
    write_stages(url, [dict([Seal(found.seal.series, stamps, ledger.different, ledger.which).file()])])


def require_sound(url: str, series: Sequence[str]) -> bool:
    """Refuse a study that the cheap checks find damaged; return whether all of it is sealed.

    Raises
    ------
    StoreError
        If it is; the first faults are named.
    """
    require_laid_out(url, series)
    looks = [look(url, name) for name in series]
    require_blocks(looks)
    return all(found.is_sealed for found in looks)


def require_blocks(looks: Iterable[Look]) -> None:
    """Refuse a study of which a look has found damage; what changes meanwhile is looked at again.

    Raises
    ------
    StoreError
        If a second look finds it too; the first faults are named.
    """
    for found in looks:
        if any(found.faults()):
            _refuse(found.url, look(found.url, found.chunks.series).faults())


def require_laid_out(url: str, series: Sequence[str]) -> None:
    """Refuse a study whose metadata or coordinates are damaged; what changes meanwhile is looked at again.

    Raises
    ------
    StoreError
        If they are; the first faults are named.
    """
    if any(_unsound(url, series)):
        _refuse(url, _unsound(url, series))


def _refuse(url: str, faults: Iterator[str]) -> None:
    first = list(itertools.islice(faults, NAMED + 1))
    if first:
        more = ", and more" if len(first) > NAMED else ""
        remedy = f"'mdr-dask verify {url}' names all of it, and with --repair mends it"
        raise StoreError(f"{url}: damaged: {'; '.join(first[:NAMED])}{more}; {remedy}")


def _unsound(url: str, series: Sequence[str]) -> Iterator[str]:
    root = document(url) or {}
    copies = []
    for name in series:
        try:
            copy = read_copy(url, name)
        except StoreError:
            yield f"{copy_name(name)} is damaged"
            continue
        if copy is not None:
            copies.append(copy)
            yield from (f"{file} is {what}" for file, what, _ in unsound_files(url, copy))
        elif root.get("attributes", {}).get("mdr_dask_layout", 0) > 1 and has_digests(root, name):
            yield f"{copy_name(name)} is missing"
    if copies and not is_root_sound(root, copies):
        yield "zarr.json is damaged"


def has_digests(root: Mapping[str, Any], series: str) -> bool:
    """Say whether a group was laid out by a version that keeps a copy of its layout."""
    members = root.get("consolidated_metadata", {}).get("metadata", {})
    attributes = root["attributes"] if series in ("", ROOT) else members.get(series, {}).get("attributes", {})
    return bool(attributes.get("mdr_dask_layout", 1) > 1)


def unsound_files(url: str, copy: Copy) -> Iterator[tuple[str, str, bytes | None]]:
    """Yield name, fault and content of every file of a layout that is not as it was made."""
    for name, content in read_many(url, copy.files):
        if not copy.is_sound(name, content):
            yield name, "missing" if content is None else "damaged", content


def is_root_sound(root: Mapping[str, Any], copies: list[Copy]) -> bool:
    """Say whether the root's metadata are those of the copies, or of a layout that was not finished after it."""
    try:
        held = root["consolidated_metadata"]["metadata"]
        members, attributes = root_of(copies, held)
        if len(root["attributes"]["history"]) < len(attributes["history"]):
            return bool(root["attributes"] | {"history": []})
        mine = json.loads(json.dumps(members))
        stated = json.loads(json.dumps(attributes))
        before = {name: value for name, value in stated.items() if name != "comment"}  # as development versions wrote
        same = all(held.get(name) == document for name, document in mine.items())
        return same and root["attributes"] in (stated, before)
    except (KeyError, TypeError, ValueError, AttributeError):
        return False
