"""A study packed to be published: one zip that is a Zarr store and an RO-Crate at once."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import zipfile
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from importlib.metadata import distributions
from pathlib import Path, PurePosixPath
from typing import Any

from mdr_dask import store
from mdr_dask.errors import StoreError
from mdr_dask.report.crate import metadata
from mdr_dask.report.page import page
from mdr_dask.report.study import Study, read_study
from mdr_dask.store import CHECKSUMS, CRATE, PUBLISHED

#: What is packed tighter; chunks are compressed already.
TEXTS = (".json", ".jsonl", ".html", ".txt", ".yaml", ".csv", ".sha256")


def publish(url: str, target: Path, licence: str = "") -> int:
    """Write a study with all that belongs to it into one zip, and return the number of its files.

    Parameters
    ----------
    url : str
        Path or URL of the store; nobody may be at work on it, and it has to be sound.
    target : Path
        The zip.
    licence : str
        Address of the licence, or its name in the list of SPDX, such as ``CC-BY-4.0``.

    Raises
    ------
    StoreError
        If the store is damaged, in use, or a file that its campaign names has changed or gone.
    """
    found = store.verify(url)
    if found.findings:
        first = found.findings[0]
        raise StoreError(
            f"{url}: {len(found.findings)} faults, first {first.name} {first.kind}; 'mdr-dask verify --repair {url}'"
        )
    study = read_study(url)
    campaign, data = _campaign(url, study)
    beside = {
        f"{PUBLISHED}{study.source or 'campaign.yaml'}": campaign,
        **{f"{PUBLISHED}{name}": content for name, content in data.items()},
        f"{PUBLISHED}report.html": page([study]).encode(),
        f"{PUBLISHED}environment.txt": _environment().encode(),
    }
    digests: dict[str, str] = {}
    sizes: dict[str, int] = {}
    leftover = target.with_name(f"{target.name}.partial")
    try:
        with zipfile.ZipFile(leftover, "w") as packed:
            for name, content in _all(url, beside):
                _put(packed, name, content)
                digests[name], sizes[name] = hashlib.sha256(content).hexdigest(), len(content)
            described = metadata(study, digests, sizes, licence)
            crate = json.dumps(described, indent=1, ensure_ascii=False).encode()
            _put(packed, CRATE, crate)
            digests[CRATE] = hashlib.sha256(crate).hexdigest()
            lines = "".join(f"{digest}  {name}\n" for name, digest in digests.items())
            _put(packed, CHECKSUMS, lines.encode())
        leftover.replace(target)
    finally:
        leftover.unlink(missing_ok=True)
    return len(digests) + 1


def _all(url: str, beside: Mapping[str, bytes]) -> Iterator[tuple[str, bytes]]:
    yield from store.contents(url)
    yield from beside.items()


def _put(packed: zipfile.ZipFile, name: str, content: bytes) -> None:
    how = zipfile.ZIP_DEFLATED if name.endswith(TEXTS) else zipfile.ZIP_STORED
    packed.writestr(name, content, compress_type=how)


def _campaign(url: str, study: Study) -> tuple[bytes, dict[str, bytes]]:
    """Return the campaign and the files that it names, by names that lie beside it: in the text, too."""
    text, found = study.campaign, {}
    for file in _named_files(url):
        name = PurePosixPath(str(file["name"]).replace("\\", "/"))
        if name.is_absolute() or ".." in name.parts or ":" in name.parts[0]:
            text = text.replace(str(file["name"]), name.name)
            name = PurePosixPath(name.name)
        found[str(name)] = _read(file)
    return text.encode(), found


def _read(file: Mapping[str, str]) -> bytes:
    """Return the content of a file that a campaign names, as it was when the campaign was read."""
    path = Path(file["path"])
    content = path.read_bytes() if path.is_file() else b""
    if hashlib.sha256(content).hexdigest() != file["sha256"]:
        what = "changed since the study was run" if content else "gone"
        raise StoreError(f"{path}: {what}, but the campaign names it; expected the file with sha256 {file['sha256']}")
    return content


def _named_files(url: str) -> list[dict[str, str]]:
    """Return the files that a campaign names: every part of its parameters that has a path and a digest."""
    held: dict[str, dict[str, str]] = {}

    def look(part: Any) -> None:
        if isinstance(part, dict):
            if {"name", "path", "sha256"} == part.keys():
                held[part["name"]] = part
            for each in part.values():
                look(each)
        elif isinstance(part, list):
            for each in part:
                look(each)

    for data in store.datasets(url).values():
        look(json.loads(data.attrs["parameters"]))
        look(data.attrs["axes"])
    return list(held.values())


def _environment() -> str:
    """Return what was installed when the study was published, as pip reads it."""
    lines = [f"# Python {platform.python_version()}, {platform.platform()}, {os.cpu_count()} processors"]
    lines.append(f"# {datetime.now(UTC).isoformat(timespec='seconds')}; what computed each block is in status/records")
    found = {str(one.metadata["Name"]): str(one.version) for one in distributions() if one.metadata["Name"]}
    return "\n".join([*lines, *(f"{name}=={version}" for name, version in sorted(found.items())), ""])
