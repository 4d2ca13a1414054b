"""Find the files to pack into the zip of a published study, and verify such a zip."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from mdr_dask.errors import StoreError
from mdr_dask.store.files import listed, read_many
from mdr_dask.store.layout import Finding
from mdr_dask.store.verification import CHECKSUMS, Inspection, of_store, verify


def contents(url: str) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the content of every file of a study, without temporary, lock and ``published/`` files."""
    for name, content in read_many(url, of_store(listed(url))):
        if content is not None:
            yield name, content


def verify_packed(path: Path) -> Inspection:
    """Compare every file in the zip of a study with the checksum of the file, and verify the store in the zip.

    Raise StoreError if the zip cannot be unpacked, has no checksums, or would fill the disk.
    """
    try:
        with zipfile.ZipFile(path) as packed, tempfile.TemporaryDirectory() as folder:
            needed, free = sum(entry.file_size for entry in packed.infolist()), shutil.disk_usage(folder).free
            if needed > free:
                raise StoreError(
                    f"{path}: expected enough disk space to unpack {needed} bytes, got {free} free bytes in {folder}"
                )
            expected = _checksums(path, packed)
            packed.extractall(folder)  # `extractall` never writes outside the folder
            findings = list(_compare(folder, expected))
            try:
                inspected = verify(folder)
            except StoreError as error:
                raise StoreError(str(error).replace(folder, str(path))) from None
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError) as error:
        raise StoreError(f"{path}: expected a zip as 'mdr-dask publish' writes it: {error}") from None
    known = {finding.name for finding in findings}
    inspected.findings[:] = [*findings, *(each for each in inspected.findings if each.name not in known)]
    inspected.files = len(expected) + 1
    return inspected


def _checksums(path: Path, packed: zipfile.ZipFile) -> dict[str, str]:
    """Return the expected checksum of every file in a zip."""
    if CHECKSUMS not in packed.namelist():
        raise StoreError(f"{path}: expected a zip that 'mdr-dask publish' wrote, got one without {CHECKSUMS}")
    lines = packed.read(CHECKSUMS).decode("utf-8", "replace").splitlines()
    found = {name: checksum for checksum, _, name in (line.partition("  ") for line in lines)}
    if not all(name and len(checksum) == 64 for name, checksum in found.items()):
        raise StoreError(f"{path}: {CHECKSUMS} is damaged")
    return found


def _compare(folder: str, expected: Mapping[str, str]) -> Iterator[Finding]:
    """Yield a finding for each foreign, missing or damaged file in the folder of an unpacked study."""
    there = {name: hashlib.sha256(content or b"").hexdigest() for name, content in read_many(folder, listed(folder))}
    for name in sorted(there.keys() - expected.keys() - {CHECKSUMS}):
        yield Finding("foreign", name, "not in the list of checksums")
    for name, checksum in expected.items():
        if name not in there:
            yield Finding("missing", name, "in the list of checksums, but not in the zip")
        elif there[name] != checksum:
            yield Finding("damaged", name, "not what was packed")
