"""Verify and repair: whatever is harmed is named, and the next run ends with the bytes of an undisturbed one."""

import json
import random
import shutil
from dataclasses import replace
from pathlib import Path

import damage
import numpy as np
import pytest
import xarray as xr
import zarr
from test_execute import run
from test_locks import late_task, small

from mdr_dask import execute, store
from mdr_dask.cli import main
from mdr_dask.errors import StoreError
from mdr_dask.execute import Part, Resources
from mdr_dask.store import locks
from mdr_dask.store.files import with_digest
from mdr_dask.store.integrity import read_record
from mdr_dask.store.records import name_of


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Sound stores to copy, without and with series, and their campaigns."""
    import toy

    folder = tmp_path_factory.mktemp("whole")
    with pytest.MonkeyPatch.context() as patch:
        toy.register(patch)
        paths = {series: folder / f"{series}.zarr" for series in (False, True)}
        return {series: (path, damage.build(toy, str(path), series)) for series, path in paths.items()}


HARMS = [(kind, list(damage.HARMS)[number % len(damage.HARMS)]) for number, kind in enumerate(damage.KINDS)]


OF_SERIES = [("record of the layout", "truncate"), ("root metadata", "empty")]


@pytest.mark.parametrize(
    ("kind", "harm", "series"),
    [
        *((kind, harm, damage.KINDS[kind].startswith("far")) for kind, harm in HARMS),
        *((kind, harm, True) for kind, harm in OF_SERIES),
        ("values", "swap with a sibling", False),
        ("ledger", "swap with a sibling", False),
    ],
)
def test_harm_is_named_and_mended(toy, whole, tmp_path, kind, harm, series):
    draw = random.Random(f"{kind} {harm}")
    assert damage.faults(toy, *whole[series], tmp_path / "harmed.zarr", kind, harm, draw) == []


def test_the_command_lists_what_it_finds_and_mends_it(toy, url, capsys):
    run(small(toy), url)
    assert main(["verify", url]) == 0
    assert f"{url}: 25 files, 2 blocks" in capsys.readouterr().out
    Path(url, "height/c/0/1").unlink()
    Path(url, "notes.txt").write_text("mine")
    assert main(["verify", url, "--json"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert [(found["kind"], found["file"]) for found in document["findings"]] == [
        ("missing", "height/c/0/1"),
        ("foreign", "notes.txt"),
    ]
    assert main(["status", url]) == 2
    assert "height/c/0/1 is missing" in capsys.readouterr().err
    assert main(["verify", url, "--repair"]) == 1
    printed = capsys.readouterr()
    assert "notes.txt" in printed.err
    assert "removed blocks: 1" in printed.out
    assert "--repair" not in printed.out
    Path(url, "notes.txt").unlink()
    assert main(["verify", url]) == 0
    assert run(small(toy), url).done == 4


def test_a_store_at_which_a_run_is_at_work_is_not_verified(url, toy, capsys):
    run(small(toy), url)
    with store.exclusive(url):
        assert main(["verify", url]) == 2
        assert main(["verify", url, "--repair"]) == 2
    assert capsys.readouterr().err.count("running on this store") == 2


def test_a_run_that_was_killed_leaves_nothing_to_find_fault_with(toy, url, monkeypatch):
    late = late_task(toy, url, monkeypatch)
    assert store.verify(url).findings == []
    values = {"height": np.zeros(late.wanted.reshape(2, -1).shape)}
    with locks.acquire(url) as hold, monkeypatch.context() as patch:
        stages = []
        patch.setattr("mdr_dask.store.blocks.write_stages", lambda _, given: stages.extend(given))
        record = {"attempt": 1, "block": list(late.place.index), "messages": []}
        status = np.ones(values["height"].shape, np.int8)
        store.write_block(replace(late.place, lock=hold), 1, values, status, record)
    for stage in stages[:-1]:  # all but the ledger
        store.files.write_stages(url, [stage])
        found = store.verify(url)
        assert found.findings == []
    assert found.notes == ["some blocks were begun and not finished; the next run computes them"]
    assert run(small(toy), url).done == 12


def test_a_store_of_an_earlier_version_cannot_be_verified_but_extended(toy, url, capsys):
    run(small(toy), url)
    older(url)
    assert main(["verify", url]) == 0
    assert "made by version 0.1, without digests" in capsys.readouterr().out
    assert run(small(toy, 9), url).done == 6
    assert store.verify(url).findings == []


@pytest.mark.parametrize("series", [False, True])
def test_zarr_finds_no_unknown_file_without_the_consolidated_metadata(whole, series):
    """A warning would be an error."""
    path, _ = whole[series]
    assert xr.open_zarr(path, group="far" if series else None, consolidated=False).height.size
    xr.open_datatree(path, engine="zarr", consolidated=False)


def older(url: str) -> None:
    """Make a store as version 0.2.0.dev0 left it: no record of the layout, no digests, records apart."""
    Path(url, ".layout/zarr.json").unlink()
    for record in list(store.records(url, "")):
        name = f"{'.'.join(map(str, record['block']))}-{record['attempt']}.json"
        del record["chunks"]
        Path(url, "status/records", name).write_text(json.dumps(record))
    next(Path(url, "status/records").glob("*.jsonl")).unlink()
    root = json.loads(Path(url, "zarr.json").read_text())
    root["attributes"]["mdr_dask_layout"] = 1
    Path(url, "zarr.json").write_text(json.dumps(root))


HOSTILE = {
    "another format": lambda root: root.update(zarr_format=2),
    "a member of another format": lambda root: members(root)["height"].update(
        zarr_format=2, filters=[{"id": "pickle"}]
    ),
    "a codec that runs code": lambda root: members(root)["height"].update(codecs=[{"name": "numcodecs.pickle"}]),
    "a storage transformer": lambda root: members(root)["height"].update(storage_transformers=[{"name": "x"}]),
    "no consolidated metadata": lambda root: root.pop("consolidated_metadata"),
    "a member that is a number": lambda root: members(root).update(height=3),
    "a member outside": lambda root: members(root).update({"../height": members(root)["height"]}),
    "attributes that are a list": lambda root: root.update(attributes=[1]),
}


def members(root):
    return root["consolidated_metadata"]["metadata"]


@pytest.mark.parametrize("kind", HOSTILE)
def test_the_metadata_of_strangers_are_refused_before_anything_is_opened(toy, url, monkeypatch, capsys, kind):
    run(small(toy), url)
    Path(url, ".layout/zarr.json").unlink()  # without it, no digest gives the change away
    root = json.loads(Path(url, "zarr.json").read_text())
    HOSTILE[kind](root)
    Path(url, "zarr.json").write_text(json.dumps(root))

    def opened(*_, **__):
        raise AssertionError("opened")

    for name in ("open_group", "open_array", "open"):
        monkeypatch.setattr(zarr, name, opened)
    monkeypatch.setattr("xarray.open_zarr", opened)
    for command in ("status", "show", "plot", "fit"):
        assert main([command, url]) == 2
        said = capsys.readouterr().err
        assert "mdr-dask verify" in said
        assert len(said.splitlines()) == 1
    with pytest.raises(StoreError, match="verify"):
        run(small(toy), url)


def test_metadata_that_never_end_are_refused(toy, url, capsys):
    run(small(toy), url)
    Path(url, "zarr.json").write_text("[" * 100_000)
    assert main(["status", url]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert store.repair(url)[1].findings == []
    assert main(["status", url]) == 0


def test_a_record_of_the_layout_that_names_files_outside_the_store_touches_none(toy, url):
    run(small(toy), url)
    outside = Path(url).with_name("mine.txt")
    outside.write_text("mine")
    record = read_record(url)
    files = {**record.files, "position/c/../../../mine.txt": ["0"]}
    Path(url, ".layout/zarr.json").write_bytes(replace(record, files=files).content)
    found, _ = store.repair(url)
    assert [(each.kind, each.name) for each in found.findings] == [("damaged", ".layout/zarr.json")]
    assert outside.read_text() == "mine"
    assert run(small(toy), url).kept == 12
    assert store.verify(url).findings == []


def test_blocks_tell_the_kind_of_machine(toy, url):
    run(small(toy), url)
    told = {record["kind"] for record in store.records(url, "")}
    assert len(told) == 1
    assert {"processor", "BLAS", "numpy", "scipy", "numba"} <= set(told.pop().replace(",", "").split())


def record_of(block):
    return with_digest({"attempt": 1, "block": block, "chunks": {"status": "ab"}, "messages": []})


def test_records_of_other_blocks_are_found(toy, url):
    """A record under the name of another block is repaired; one of a block that does not exist belongs to nobody."""
    run(small(toy), url)
    (path,) = Path(url).glob("status/records/*.jsonl")
    path.write_bytes(path.read_bytes().rstrip() + b"\n" + record_of([9, 9]) + b"\n")
    misplaced = name_of("", (0, 0), 1)
    path.with_name(Path(misplaced).name).write_bytes(record_of([1, 0]))
    found = {(each.kind, each.name) for each in store.verify(url).findings}
    assert {("foreign", str(path.relative_to(url))), ("damaged", misplaced)} <= found
    store.repair(url)
    run(small(toy), url)
    assert [each.kind for each in store.verify(url).findings] == ["foreign"]


def test_parts_of_different_campaigns_in_one_store_are_found(toy, tmp_path):
    """A copy of one store over the other, with the metadata of the second campaign."""
    first, second = (toy.campaign(toy.axis("position", range(1, 7)), slope=slope) for slope in (1.0, 2.0))
    urls = [str(tmp_path / name) for name in ("first.zarr", "second.zarr")]
    for number, (campaign, url) in enumerate(zip((first, second), urls, strict=True), start=1):
        execute.run(campaign, url, Resources(threads=1), lambda _: None, part=Part(number, 2))
    shutil.copytree(urls[1], urls[0], dirs_exist_ok=True)
    url = urls[0]
    found = store.verify(url)
    assert {(each.kind, each.what.partition("block")[0]) for each in found.findings} == {
        ("foreign", "contains the record of ")
    }
    with pytest.raises(StoreError, match="has results of another campaign; 'mdr-dask verify"):
        execute.run(second, url, Resources(threads=1), lambda _: None)
    store.repair(url)
    execute.run(second, url, Resources(threads=1), lambda _: None)
    assert store.verify(url).findings == []
    execute.run(second, urls[1], Resources(threads=1), lambda _: None)
    np.testing.assert_array_equal(store.values(url, "", "height"), store.values(urls[1], "", "height"))
