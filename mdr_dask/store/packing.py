"""A published study: the files of a store that go into its zip, and whether a zip is as it was packed."""

from __future__ import annotations

import hashlib
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

from mdr_dask.errors import StoreError
from mdr_dask.store.files import listed, read_many
from mdr_dask.store.verifying import CHECKSUMS, Finding, Inspection, of_store, verify


def contents(url: str) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of every file of a store, and of nothing that was published or left beside it."""
    for name, content in read_many(url, of_store(listed(url))):
        if content is not None:
            yield name, content


def verify_packed(path: Path) -> Inspection:
    """Read every file of a published study against its checksums, and the store in it as `verify` does.

    Raises
    ------
    StoreError
        If it is no zip that this program wrote.
    """
    try:
        with zipfile.ZipFile(path) as packed, tempfile.TemporaryDirectory() as folder:
            expected = _checksums(path, packed)
            findings = list(_unpack(packed, expected, Path(folder)))
            inspected = verify(folder)
    except (zipfile.BadZipFile, zlib.error, EOFError) as error:
        raise StoreError(f"{path}: expected a zip as 'mdr-dask publish' writes it: {error}") from None
    known = {finding.name for finding in findings}
    inspected.findings[:] = [*findings, *(each for each in inspected.findings if each.name not in known)]
    inspected.files = len(expected) + 1
    return inspected


def _checksums(path: Path, packed: zipfile.ZipFile) -> dict[str, str]:
    if CHECKSUMS not in packed.namelist():
        raise StoreError(f"{path}: a zip without {CHECKSUMS}, expected one that 'mdr-dask publish' wrote")
    lines = packed.read(CHECKSUMS).decode("utf-8", "replace").splitlines()
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines)}


def _unpack(packed: zipfile.ZipFile, expected: dict[str, str], folder: Path) -> Iterator[Finding]:
    """Unpack what is as it was packed, and yield what is not."""
    there = packed.namelist()
    for name in sorted(set(there) - expected.keys() - {CHECKSUMS}):
        yield Finding("foreign", name, "no checksum is known of it")
    for name, digest in expected.items():
        if name not in there:
            yield Finding("missing", name, "packed once")
            continue
        try:
            content = packed.read(name)
        except (zipfile.BadZipFile, zlib.error, EOFError):
            content = b""
        if hashlib.sha256(content).hexdigest() != digest:
            yield Finding("damaged", name, "not what was packed")
        target = folder / name
        if folder in target.resolve().parents:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)
