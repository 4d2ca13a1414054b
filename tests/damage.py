"""Harm done to stores: every kind of file, every way to harm it, and what has to come of it."""

from __future__ import annotations

import json
import random
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr
from test_execute import digests

from mdr_dask import execute, store
from mdr_dask.campaign import Replication
from mdr_dask.errors import StoreError
from mdr_dask.execute import Resources

KINDS = {
    "root metadata": "zarr.json",
    "metadata of a group": "far/zarr.json",
    "metadata of an array": "**/height/zarr.json",
    "metadata of the ledger": "**/status/zarr.json",
    "metadata of a coordinate": "**/position/zarr.json",
    "axis": "**/position/c/0",
    "realisations": "**/realisation/c/0",
    "parameter": "**/slope/c",
    "values": "**/height/c/*/*",
    "values with a dimension": "**/trace/c/*/*/*",
    "ledger": "**/status/c/*/*",
    "record": "**/status/records/*.jsonl",
    "loose record": "**/status/records/*.json",
    "record of the layout": "layout.json",
}


def flip(path: Path, draw: random.Random) -> None:
    content = bytearray(path.read_bytes())
    content[draw.randrange(len(content))] ^= 1 << draw.randrange(8)
    path.write_bytes(bytes(content))


def truncate(path: Path, draw: random.Random) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: draw.randrange(1, len(content))])


def swap(path: Path, draw: random.Random) -> None:
    kind = next(pattern for pattern in KINDS.values() if path in _root(path).glob(pattern))
    if path.suffix == ".jsonl":  # their names say nothing
        kind = "**/zarr.json"
    siblings = [other for other in sorted(_root(path).glob(kind)) if other.read_bytes() != path.read_bytes()]
    other = draw.choice(siblings or sorted(_root(path).glob("**/height/zarr.json")))
    mine, theirs = path.read_bytes(), other.read_bytes()
    path.write_bytes(theirs)
    other.write_bytes(mine)


HARMS: dict[str, Callable[[Path, random.Random], None]] = {
    "flip a bit": flip,
    "truncate": truncate,
    "empty": lambda path, _: path.write_bytes(b"") and None,
    "delete": lambda path, _: path.unlink(),
    "swap with a sibling": swap,
}


def _root(path: Path) -> Path:
    return next(folder for folder in path.parents if folder.suffix == ".zarr")


def campaign(toy, series: bool):
    """A study of several blocks: an axis that grew, a further dimension, and failures."""
    first = toy.campaign(
        toy.axis("position", [1.0, 2.0, 3.0, 9.0]),
        outputs=("height", "trace"),
        realisations=Replication(6, 6, {}),
        slope=3.0,
        fail_above=8.0,
    )
    first = replace(first, blocks={"position": 1, "realisation": 4})
    if not series:
        return first
    near = replace(first.series[0], name="near")
    far = replace(near, name="far", axes=(toy.axis("position", [4.0, 5.0]),))
    return replace(first, series=(near, far))


def earlier(study):
    """The study as it was before its axis and its realisations grew."""
    shorter = [replace(s, axes=(replace(s.axes[0], values=s.axes[0].values[:-1]),)) for s in study.series]
    return replace(study, series=tuple(shorter), replication=Replication(3, 3, {}))


def in_order(path: Path) -> tuple[str, str]:
    """Return what to sort files of a store by: the names of those that hold records of many blocks are random."""
    blocks = re.findall(rb'"block": (.*?\])', path.read_bytes()) if path.suffix == ".jsonl" else path.name
    return str(path.parent.relative_to(_root(path))), str(blocks)


def build(toy, url: str, series: bool):
    """Run a study in two steps, the last block again, whose record stays loose; return its campaign."""
    study = campaign(toy, series)
    for step in (earlier(study), study):
        execute.run(step, url, Resources(threads=1), lambda _: None)
    loose = max(Path(url).glob("**/status/records/*.jsonl"), key=in_order)
    line = loose.read_bytes().splitlines()[-1]
    record = json.loads(line)
    name = f"{'.'.join(map(str, record['block']))}-{record['attempt']}.json"
    loose.with_name(name).write_bytes(line)
    loose.write_bytes(b"".join(one + b"\n" for one in loose.read_bytes().splitlines()[:-1]))
    return study


def load(opener: Callable[[], dict[str, xr.Dataset]]) -> dict[str, xr.Dataset] | None:
    """Read all of a study; None if that is refused."""
    try:
        return {name: found.load() for name, found in opener().items()}
    except Exception:  # whatever Zarr and its codecs raise
        return None


def plainly(url: str) -> dict[str, xr.Dataset]:
    """Open a study as somebody who does not know this program."""
    groups = [path.parent.parent for path in sorted(Path(url).glob("**/status/zarr.json"))]
    return {
        str(group.relative_to(url)): xr.open_zarr(url, group=str(group.relative_to(url)).replace(".", "") or None)
        for group in groups
    }


def named(act: Callable[[], object]) -> bool:
    """Say whether an act names damage."""
    try:
        with store.readable("here"):
            act()
    except StoreError as error:
        return "damaged" in str(error) or "verify" in str(error) or "checksum" in str(error) or "failed" in str(error)
    return False


@dataclass(frozen=True)
class Trial:
    """What came of one harm."""

    kind: str
    harm: str
    file: str
    changed: bool
    reads_wrongly: bool
    verify: bool
    run: bool
    status: bool
    show: bool
    healed: bool
    sound: bool

    @property
    def faults(self) -> list[str]:
        """What went wrong, or was not told."""
        swapped = self.harm == "swap with a sibling" and self.kind in ("values", "values with a dimension", "ledger")
        looks = {"verify": self.changed}
        if not swapped:  # chunks in each other's place have good checksums: only `verify` compares digests
            looks |= dict.fromkeys(("run", "status", "show"), self.reads_wrongly)
        silent = [f"{look} is silent" for look, due in looks.items() if due and not getattr(self, look)]
        return silent + ["other bytes after repair"] * (not self.healed) + ["not sound after repair"] * (not self.sound)


def try_harm(toy, sound: Path, study, work: Path, kind: str, harm: str, draw: random.Random) -> Trial | None:
    """Harm one file of a copy of a sound store; look with everything there is; repair, run, compare."""
    shutil.rmtree(work, ignore_errors=True)
    shutil.copytree(sound, work)
    url = str(work)
    files = sorted(work.glob(KINDS[kind]), key=in_order)
    if not files:
        return None
    before = {path: path.read_bytes() for path in work.rglob("*") if path.is_file()}
    truth = load(lambda: plainly(url))
    file = draw.choice(files)
    HARMS[harm](file, draw)
    changed = {path: path.read_bytes() for path in work.rglob("*") if path.is_file()} != before
    seen = load(lambda: plainly(url))
    wrongly = seen is not None and not _same(seen, truth)
    try:
        found = store.verify(url)
        unfinished = (kind, harm) == ("ledger", "delete") and found.notes  # as if a task had been killed
        verified = bool(found.findings or unfinished)
    except StoreError:
        verified = True

    def status():
        groups = store.datasets(url)
        for dataset in groups.values():
            dataset["status"].load()
        store.require_sound(url, list(groups))

    result = {
        "verify": verified,
        "status": named(status),
        "show": named(lambda: [found.load() for found in store.datasets(url).values()]),
        "run": named(lambda: execute.run(study, url, Resources(threads=1), lambda _: None)),
    }
    result["run"] = result["run"] or not store.verify(url).findings  # a run writes what is missing again
    if harm == "delete" and kind == "ledger":
        result["status"] = result["show"] = True  # it was shown as missing
    store.repair(url)
    execute.run(study, url, Resources(threads=1), lambda _: None)
    return Trial(
        kind,
        harm,
        str(file.relative_to(work)),
        changed,
        wrongly,
        healed=digests(url) == digests(str(sound)) and _same(load(lambda: plainly(url)), truth),
        sound=not store.verify(url).findings,
        **result,
    )


def _same(one: dict[str, xr.Dataset] | None, other: dict[str, xr.Dataset] | None) -> bool:
    if one is None or other is None or one.keys() != other.keys():
        return False
    return all(_equal(one[name], other[name]) for name in one)


def _equal(one: xr.Dataset, other: xr.Dataset) -> bool:
    if set(one.variables) != set(other.variables):
        return False
    return all(np.array_equal(one[v], other[v], equal_nan=one[v].dtype.kind == "f") for v in one.variables)
