"""Harm done to stores: every kind of file, every way to harm it, and what has to come of it."""

from __future__ import annotations

import json
import random
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

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
    "record of the layout": ".layout/zarr.json",
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


def load(url: str) -> dict[str, xr.Dataset] | None:
    """Read all of a store without this program; None if Zarr refuses it."""
    groups = [str(path.parent.parent.relative_to(url)) for path in sorted(Path(url).glob("**/status/zarr.json"))]
    try:
        return {name: xr.open_zarr(url, group=name.replace(".", "") or None).load() for name in groups}
    except Exception:  # whatever Zarr and its codecs raise
        return None


def same(one: dict[str, xr.Dataset] | None, other: dict[str, xr.Dataset] | None) -> bool:
    if one is None or other is None or one.keys() != other.keys():
        return False
    return all(one[name].equals(other[name]) for name in one)


def names_damage(act: Callable[[], object]) -> bool:
    """Say whether an act ends with an error that names damage."""
    try:
        act()
    except StoreError as error:
        return any(word in str(error) for word in ("damaged", "verify", "checksum", "failed"))
    return False


def faults(toy, sound: Path, study, work: Path, kind: str, harm: str, draw: random.Random) -> list[str]:
    """Harm one file of a copy of a sound store, read it in every way, repair it and run the study again.

    Return what went wrong: damage that was not named, and differences from the sound store in the end.
    """
    shutil.copytree(sound, work)
    url, truth = str(work), load(str(sound))
    HARMS[harm](draw.choice(sorted(work.glob(KINDS[kind]), key=in_order)), draw)
    seen = load(url)
    is_wrong = seen is not None and not same(seen, truth)
    lost_ledger = (kind, harm) == ("ledger", "delete")

    def verify() -> None:
        found = store.verify(url)
        if found.findings or (lost_ledger and found.notes):  # as if a task had been killed
            raise StoreError("damaged")

    def status() -> None:
        groups = store.datasets(url)
        for dataset in groups.values():
            dataset["status"].load()
        store.require_undamaged(url, list(groups))

    def run() -> None:
        execute.run(study, url, Resources(threads=1), lambda _: None)

    found = [] if names_damage(verify) else ["verify is silent"]
    named = {"status": names_damage(status)}
    named["show"] = names_damage(lambda: [found.load() for found in store.datasets(url).values()])
    if lost_ledger:  # status and show count its results as missing
        named = dict.fromkeys(named, True)
    named["run"] = names_damage(run) or not store.verify(url).findings  # a run writes what is missing again
    if is_wrong and not (harm == "swap with a sibling" and kind in ("values", "values with a dimension", "ledger")):
        # a chunk in the place of another one has a good checksum: only `verify` compares digests
        found += [f"{name} is silent" for name, is_named in named.items() if not is_named]
    store.repair(url)
    run()
    if digests(url) != digests(str(sound)) or not same(load(url), truth):
        found.append("other bytes after repair")
    if store.verify(url).findings:
        found.append("not sound after repair")
    return found
