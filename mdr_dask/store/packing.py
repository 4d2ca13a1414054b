"""Find the files to pack into the zip of a published study, and verify such a zip."""

from __future__ import annotations

import hashlib
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

from mdr_dask.errors import StoreError
from mdr_dask.store.files import listed, read_many
from mdr_dask.store.layout import Finding
from mdr_dask.store.verification import CHECKSUMS, Inspection, of_store, verify


def contents(url: str) -> Iterator[tuple[str, bytes]]:
    """Yield the name and the content of every file of a store, except files that belong only to a publication."""
    for name, content in read_many(url, of_store(listed(url))):
        if content is not None:
            yield name, content


#: Largest accepted ratio of the size of a file to its size in the zip. Chunks are compressed already, so their ratio is
#: about 1, and that of metadata is about 10.
LARGEST_RATIO = 100
#: `SMALL`: size of a file, in bytes, below which any ratio is accepted. `PIECE`: size, in bytes, of the pieces in which
#: files are read.
SMALL, PIECE = 2**20, 2**20


def verify_packed(path: Path) -> Inspection:
    """Compare every file of a published study with its checksum, and verify the store in it.

    Raises
    ------
    StoreError
        If this program cannot have written the zip, because it is encrypted, uses another compression, or would unpack
        to a huge size.
    """
    try:
        with zipfile.ZipFile(path) as packed, tempfile.TemporaryDirectory() as folder:
            expected = _checksums(path, packed)
            findings = list(_unpack(packed, expected, Path(folder)))
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
    """Check the list of files in a zip, and return the expected checksum of every file."""
    for entry in packed.infolist():
        if entry.flag_bits & 1:
            raise StoreError(f"{path}: {entry.filename!r:.80} is encrypted, expected a zip of 'mdr-dask publish'")
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise StoreError(f"{path}: {entry.filename!r:.80} has an unknown compression ({entry.compress_type})")
        if entry.file_size > max(SMALL, LARGEST_RATIO * entry.compress_size):
            size = f"{entry.compress_size} bytes that unpack to {entry.file_size}"
            raise StoreError(f"{path}: {entry.filename!r:.80} has {size}: no zip of 'mdr-dask publish'")
    if CHECKSUMS not in packed.namelist():
        raise StoreError(f"{path}: a zip without {CHECKSUMS}, expected one that 'mdr-dask publish' wrote")
    lines = packed.read(CHECKSUMS).decode("utf-8", "replace").splitlines()
    found = {name: checksum for checksum, _, name in (line.partition("  ") for line in lines)}
    if not all(name and len(checksum) == 64 for name, checksum in found.items()):
        raise StoreError(f"{path}: {CHECKSUMS} is damaged")
    return found


def _unpack(packed: zipfile.ZipFile, expected: dict[str, str], folder: Path) -> Iterator[Finding]:
    """Unpack the files of the store into a folder, and yield a finding for each foreign, missing or damaged file."""
    there = packed.namelist()
    for name in sorted(set(there) - expected.keys() - {CHECKSUMS}):
        yield Finding("foreign", name, "it has no checksum" if _is_inside(name) else "a place outside the store")
    for name, checksum in expected.items():
        if not _is_inside(name):
            yield Finding("foreign", name, "a place outside the store")
        elif name not in there:
            yield Finding("missing", name, "it has a checksum")
        elif _extract(packed, name, folder / name) != checksum:
            yield Finding("damaged", name, "not what was packed")


def _is_inside(name: str) -> bool:
    parts = name.replace("\\", "/").split("/")
    return not (name.startswith("/") or ":" in parts[0] or ".." in parts)


def _extract(packed: zipfile.ZipFile, name: str, target: Path) -> str:
    """Unpack a file piece by piece, and return its checksum, or an empty text if it cannot be unpacked."""
    checksum = hashlib.sha256()
    target.parent.mkdir(parents=True, exist_ok=True)
    with target.open("wb") as file:
        try:
            with packed.open(name) as content:
                while piece := content.read(PIECE):
                    checksum.update(piece)
                    file.write(piece)
        except (zipfile.BadZipFile, zlib.error, EOFError):
            return ""
    return checksum.hexdigest()
