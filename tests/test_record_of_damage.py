"""Record of what is said of stores that are damaged: by who verifies, repairs, reads, or runs on."""

import itertools
import json
import random
import re
import shutil
import uuid
from dataclasses import asdict
from pathlib import Path

import damage
import pytest
import record
import test_verify
import zarr
from damage import HARMS, KINDS, in_order

from mdr_dask import execute, store
from mdr_dask.errors import MdrDaskError
from mdr_dask.execute import Resources
from mdr_dask.store.records import name_of, sealed


@pytest.fixture(autouse=True, scope="module")
def names_in_order():
    """Names of files that are random otherwise follow each other: files are read in the order of their names."""
    numbers = itertools.count(1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(uuid, "uuid4", lambda: uuid.UUID(int=next(numbers) << 80))
        yield


@pytest.fixture(scope="module")
def whole(names_in_order, tmp_path_factory):
    """Sound stores to copy, without and with series, and their campaigns."""
    import toy

    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        toy.register(patch)
        paths = {series: folder / f"{series}.zarr" for series in (False, True)}
        return {series: (path, damage.build(toy, str(path), series)) for series, path in paths.items()}


def masked(text, url):
    """Return a text without what differs from run to run."""
    text = re.sub(r"[0-9a-f]{12}\.jsonl", "TOGETHER.jsonl", str(text).replace(url, "STORE"))
    return re.sub(r"(cannot be read: ).*", r"\1...", text)  # in words of zarr


def said(act, url):
    """Return what comes of an act, or why nothing does."""
    try:
        return masked(act(), url)
    except MdrDaskError as error:
        return masked(f"{type(error).__name__}: {error}", url)


def told(inspection):
    found = sorted(f"{each.kind} {each.name}: {each.what}" for each in inspection.findings)
    counted = f"{inspection.files} files, {inspection.blocks} blocks, {len(found)} findings"
    return [counted, *found[:5], *found[5:][-3:], *inspection.notes]


def counts(progress):
    kept = asdict(progress)
    return [kept[name] for name in ("total", "kept", "done", "failed", "not_needed", "blocks", "solves")]


def values(url):
    """Return sums of values, which are read one chunk at a time: the first that is damaged is the one told."""
    with store.readable(url), zarr.config.set({"async.concurrency": 1}):
        return {
            name: (dict(found.sizes), round(float(found["height"].sum()), 6))
            for name, found in store.datasets(url).items()
        }


def scene(url, campaign):
    """Return what is said of a store, in turn, by all who look at it, and what mends it."""
    acts = {
        "names": lambda: (store.exists(url), store.is_study(url), store.series_names(url)),
        "verify": lambda: told(store.verify(url)),
        "sound": lambda: store.require_sound(url, store.series_names(url)),
        "values": lambda: values(url),
        "outlook": lambda: counts(execute.outlook(campaign, url)),
        "repair": lambda: [told(found) for found in store.repair(url)],
        "run": lambda: counts(execute.run(campaign, url, Resources(threads=1), lambda _: None)),
        "in the end": lambda: told(store.verify(url)),
    }
    return {name: said(act, url) for name, act in acts.items()}


def by_text(texts):
    """Return who says what, each text once."""
    found = {}
    for who, text in texts.items():
        found.setdefault(text, []).append(who)
    return [f"{', '.join(who)}: {text}" for text, who in found.items()]


SCENES = [
    (kind, list(HARMS)[-k % len(HARMS)], KINDS[kind].startswith("far") or k % 3 == 1) for k, kind in enumerate(KINDS)
]


def test_record_of_every_kind_of_file_harmed(toy, whole, tmp_path, dataframe_regression):
    found = {}
    for kind, harm, series in SCENES:
        work = tmp_path / f"{kind}.zarr"
        path, campaign = whole[series]
        shutil.copytree(path, work)
        there = sorted(work.glob(KINDS[kind]), key=in_order)
        draw = random.Random(f"{kind} {harm}")
        HARMS[harm](draw.choice(there), draw)
        found[f"{kind}, {harm}, {series}"] = by_text(scene(str(work), campaign))
    record.check(dataframe_regression, found)


def members(root):
    return root["consolidated_metadata"]["metadata"]


def changed(path, change):
    """Change a document of JSON in place."""
    held = json.loads(path.read_text())
    change(held)
    path.write_text(json.dumps(held))


def line(**told):
    return sealed({"attempt": 1, "block": [0, 0], "chunks": {"status": "ab"}, "messages": [], **told})


def last_lines(work):
    """Return a file of records that lie together, and its lines."""
    path = max(work.glob("**/status/records/*.jsonl"), key=in_order)
    return path, path.read_bytes().splitlines(keepends=True)


def add_line(work, content):
    path, lines = last_lines(work)
    path.write_bytes(b"".join([*lines, content, b"\n"]))


def spoil_line(work):
    path, lines = last_lines(work)
    path.write_bytes(b"".join([lines[0].replace(b'"attempt": 1', b'"attempt": 2'), *lines[1:]]))


def with_blocks_of_earlier_attempts(work):
    """A second attempt is told and was not written, as by a killed task; one block holds what none has written."""
    for content in (line(attempt=3, chunks={"height": "cd"}), line(attempt=2, block=[1, 0], chunks={"status": "ef"})):
        name = json.loads(content)
        (work / name_of("", tuple(name["block"]), name["attempt"])).write_bytes(content)


def put(name, content):
    def act(work):
        (work / name).parent.mkdir(parents=True, exist_ok=True)
        (work / name).write_bytes(content)

    return act


def of(name, change):
    return lambda work: changed(work / name, change)


def without(*patterns):
    def act(work):
        for path in [path for pattern in patterns for path in work.glob(pattern)]:
            path.unlink()

    return act


def older(work):
    test_verify.older(str(work))
    without("status/records/*.jsonl")(work)


def both(*acts):
    def act(work):
        for each in acts:
            each(work)

    return act


def swapped(one, other):
    def act(work):
        mine, theirs = (work / one).read_bytes(), (work / other).read_bytes()
        (work / one).write_bytes(theirs)
        (work / other).write_bytes(mine)

    return act


RECORD = "status/records/0.0-1.json"
SPECIAL = {
    "nothing": lambda work: None,
    "foreign files": both(
        *map(put, ("notes.txt", "height/c/9/9", "status/records/x.txt", "far/c/0"), (b"1",) * 4),
        *map(put, (".claims/x", "published/x", "height/c/0/0.partial", "a.aside"), (b"1",) * 4),
    ),
    "a series more": put("more/status/layout.json", b"{}"),
    "an empty record": put(RECORD, b""),
    "a record that is none": put(RECORD, b"[1]"),
    "a record of another block": put("status/records/3.1-1.json", line()),
    "a record of no block": put("status/records/4.0-1.json", line(block=[4, 0])),
    "a record of one dimension": put("status/records/1-1.json", line(block=[1])),
    "a line of no block": lambda work: add_line(work, line(block=[3, 2])),
    "a line that is none": lambda work: add_line(work, b'{"attempt": 1}'),
    "a line spoilt": spoil_line,
    "attempts that were killed": with_blocks_of_earlier_attempts,
    "chunks of another block": swapped("height/c/0/0", "height/c/1/0"),
    "no ledger of a block": without("status/c/0/0"),
    "no ledger and no records of it": without("status/c/*/1", "status/records/*"),
    "no records": without("status/records/*"),
    "no values": without("height/c/1/*"),
    "empty values": both(put("height/c/1/0", b""), put("trace/c/1/0/0", b"")),
    "another title": of("zarr.json", lambda held: held["attributes"].update(title="another")),
    "less history": of("zarr.json", lambda held: held["attributes"]["history"].pop()),
    "more history": of("zarr.json", lambda held: held["attributes"]["history"].append("later")),
    "a comment more": of("zarr.json", lambda held: held["attributes"].update(comment="mine")),
    "no layout told": of("zarr.json", lambda held: held["attributes"].pop("mdr_dask_layout")),
    "a newer layout": of("zarr.json", lambda held: held["attributes"].update(mdr_dask_layout=3)),
    "only claimed": put("zarr.json", json.dumps({"attributes": {"mdr_dask_layout": 2}}).encode()),
    "an array less": of("zarr.json", lambda held: members(held).pop("height")),
    "an array more": of("zarr.json", lambda held: members(held).update(more=members(held)["height"])),
    "no root": without("zarr.json"),
    "no copy": without("status/layout.json"),
    "a copy spoilt": put("status/layout.json", b"{"),
    "no root and no copy": without("zarr.json", "status/layout.json"),
    "a root spoilt and no copy": both(without("status/layout.json"), put("zarr.json", b"[]")),
    "no copy and an array spoilt": both(without("status/layout.json"), put("height/zarr.json", b"{")),
    "no copy and no axis": both(without("status/layout.json", "position/zarr.json")),
    "no copy and another axis": both(without("status/layout.json"), swapped("position/c/0", "multiple/c/0")),
    "no copy and another parameter": both(without("status/layout.json"), swapped("slope/c", "noise/c")),
    "no seal": without("status/seal.json"),
    "a seal spoilt": put("status/seal.json", b"{}"),
    "an earlier version": older,
    "an earlier version spoilt": both(older, put("height/c/0/0", b""), without("trace/c/1/0/0", "status/c/2/0")),
    "an earlier version without records": both(older, without("status/records/*")),
    "an earlier version without an axis": both(older, without("position/zarr.json")),
    "an earlier version of another axis": both(older, swapped("position/c/0", "multiple/c/0")),
    "a folder": lambda work: both(shutil.rmtree, Path.mkdir)(work),
    "a folder with something": lambda work: both(shutil.rmtree, Path.mkdir, put("notes.txt", b""))(work),
    "a file": lambda work: both(shutil.rmtree, Path.touch)(work),
    "nothing at all": shutil.rmtree,
}
SPECIAL_OF_SERIES = {
    "another group": swapped("near/zarr.json", "far/zarr.json"),
    "another axis": swapped("near/position/c/0", "far/position/c/0"),
    "another copy": swapped("near/status/layout.json", "far/status/layout.json"),
    "another seal": swapped("near/status/seal.json", "far/status/seal.json"),
    "values of another series": swapped("near/height/c/0/0", "far/height/c/0/0"),
    "no copy of one": both(without("near/status/layout.json")),
    "no copy of one and no root": both(without("near/status/layout.json", "zarr.json")),
    "no copy of one and another title": both(
        without("near/status/layout.json"), of("zarr.json", lambda held: held["attributes"].update(title="another"))
    ),
    "no copies": without("*/status/layout.json"),
    "no copies and no group": without("*/status/layout.json", "far/zarr.json"),
    "a group less": of("zarr.json", lambda held: members(held).pop("far")),
    "no records of one": without("far/status/records/*"),
}


@pytest.mark.parametrize("series", [False, True])
def test_record_of_special_harms(toy, whole, tmp_path, dataframe_regression, series):
    found = {}
    path, campaign = whole[series]
    for name, harm in (SPECIAL_OF_SERIES if series else SPECIAL).items():
        work = tmp_path / f"{name}.zarr"
        shutil.copytree(path, work)
        harm(work)
        found[name] = by_text(scene(str(work), campaign))
    record.check(dataframe_regression, found)
