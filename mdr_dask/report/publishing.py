"""Pack a study for publication: one zip file that is itself a Zarr store."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import zipfile
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import distributions
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import Any

from mdr_dask import store
from mdr_dask.errors import StoreError
from mdr_dask.report.page import page
from mdr_dask.store import CHECKSUMS, PUBLISHED


def publish(url: str, target: Path) -> int:
    """Write a study with its campaign, data files and page to one zip, and return the number of files in the zip.

    StoreError is raised if the store is damaged or in use, if a data file of the campaign has changed since the run or
    is missing, or if two data files would have the same name in the zip.
    """
    found = store.verify(url)
    if found.findings:
        first = found.findings[0]
        raise StoreError(
            f"{url}: number of faulty files: {len(found.findings)} (the first, {first.name}, is {first.kind}); repair "
            f"the store with 'mdr-dask verify --repair {url}' before you publish it"
        )
    held = store.attributes(url)
    campaign, data = _campaign(url, str(held["campaign"]))
    beside = {
        f"{PUBLISHED}{held.get('source') or 'campaign.yaml'}": campaign,
        **{f"{PUBLISHED}{name}": content for name, content in data.items()},
        f"{PUBLISHED}report.html": page([url]).encode(),
        f"{PUBLISHED}environment.txt": _environment().encode(),
    }
    digests: dict[str, str] = {}
    leftover = target.with_name(f"{target.name}.partial")
    try:
        with zipfile.ZipFile(leftover, "w", zipfile.ZIP_DEFLATED) as packed:
            for name, content in chain(store.contents(url), beside.items()):
                packed.writestr(name, content)
                digests[name] = hashlib.sha256(content).hexdigest()
            lines = "".join(f"{digest}  {name}\n" for name, digest in digests.items())
            packed.writestr(CHECKSUMS, lines)
        leftover.replace(target)
    finally:
        leftover.unlink(missing_ok=True)
    return len(digests) + 1


def _campaign(url: str, text: str) -> tuple[bytes, dict[str, bytes]]:
    """Return the text of the campaign, and the contents of the files that it names, indexed by name. For a file outside
    the folder of the campaign, folders are removed from the name, also in the text of the campaign.
    """
    found = {}
    for file in _named_files(url):
        name = PurePosixPath(str(file["name"]).replace("\\", "/"))
        if name.is_absolute() or ".." in name.parts or ":" in name.parts[0]:
            text = text.replace(str(file["name"]), name.name)
            name = PurePosixPath(name.name)
        if str(name) in found:
            raise StoreError(f"{file['name']}: two files of the campaign are called {name} in the zip: rename one")
        found[str(name)] = _read(file)
    return text.encode(), found


def _read(file: Mapping[str, str]) -> bytes:
    """Return the content of a file that a campaign names; raise StoreError if it has since changed or is missing."""
    path = Path(file["path"])
    content = path.read_bytes() if path.is_file() else b""
    if hashlib.sha256(content).hexdigest() != file["sha256"]:
        what = "changed since the study was run" if content else "gone"
        raise StoreError(f"{path}: {what}, but the campaign names it; expected the file with sha256 {file['sha256']}")
    return content


def _named_files(url: str) -> list[dict[str, str]]:
    """Return name, path and digest of each file that a campaign names, as found in the parameters and axes of the
    store.
    """
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
    """Return the installed packages as a requirements file for pip, with Python and platform in comments."""
    lines = [f"# Python {platform.python_version()}, {platform.platform()}, {os.cpu_count()} processors"]
    lines.append(f"# {datetime.now(UTC).isoformat(timespec='seconds')}; versions of each block are in status/records")
    found = {str(one.metadata["Name"]): str(one.version) for one in distributions() if one.metadata["Name"]}
    return "\n".join([*lines, *(f"{name}=={version}" for name, version in sorted(found.items())), ""])
