"""Stores of many blocks: what is opened and decoded grows no faster than it must, and nothing is overlooked for it."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import toy
import zarr

from mdr_dask import store
from mdr_dask.cli import main
from mdr_dask.errors import StoreError
from mdr_dask.execute import Resources, run
from mdr_dask.store import ledgers, sound
from mdr_dask.store.records import opened, sealed
from mdr_dask.store.seals import read_seal


@pytest.fixture
def url(tmp_path, monkeypatch):
    """A store of 7 x 3 blocks, the last ones cut, in which one case fails."""
    toy.register(monkeypatch)
    campaign = toy.campaign(toy.axis("position", np.arange(1.0, 14.0).tolist()), fail_above=12.5)
    url = str(tmp_path / "many.zarr")
    run(
        replace(campaign, blocks={"position": 2, "realisation": 2}, replication=toy.Replication(5, 5, {})),
        url,
        Resources(),
        lambda _: None,
    )
    return url


def plain(url):
    return zarr.open_group(url, mode="r")["status"][...]


def test_the_ledger_is_that_of_zarr_and_each_different_chunk_is_decoded_once(url, monkeypatch):
    decoded = []
    whole = ledgers.Ledger.decoded

    def counted(self, *where):
        decoded.append(len(self.different))
        return whole(self, *where)

    monkeypatch.setattr(ledgers.Ledger, "decoded", counted)
    expected = plain(url)
    assert np.array_equal(store.ledger(url, "", (13, 5)), expected)
    assert np.array_equal(store.ledger(url, "", (4, 2)), expected[:4, :2])
    grown = store.ledger(url, "", (15, 6))
    assert np.array_equal(grown[:13, :5], expected)
    assert not grown[13:].any()
    assert not grown[:, 5:].any()
    assert max(decoded) <= 5 < 21  # nothing, whole, cut at the end of an axis, failed


def test_a_ledger_that_lacks_chunks_is_that_of_zarr(url):
    for place in ("0/0", "3/1", "6/2"):
        Path(url, "status/c", place).unlink()
    assert (plain(url) == 0).any()
    assert np.array_equal(store.ledger(url, "", (13, 5)), plain(url))


def test_a_part_of_a_ledger_holds_what_the_whole_holds_there_and_nothing_else():
    whole = ledgers.Ledger((None, b"done", b"cut", b"failed"), np.array([[1, 3, 0], [1, 2, 1]]))
    for bits in range(2**6):
        mask = np.array([bits >> place & 1 for place in range(6)], dtype=bool).reshape(2, 3)
        part = whole.only(mask)
        expected = [
            whole.different[which] if asked else None for which, asked in zip(whole.which.flat, mask.flat, strict=True)
        ]
        assert [part.different[which] for which in part.which.flat] == expected
        assert len(part.different) == len({None, *expected})


def test_status_names_a_chunk_of_the_ledger_that_belongs_elsewhere(url, capsys):
    shutil.copy(Path(url, "status/c/6/0"), Path(url, "status/c/2/1"))
    store.ledger(url, "", (13, 5))
    with pytest.raises(StoreError, match="status/c/2/1 is not what was written there"):
        store.require_sound(url, [""])
    assert main(["status", url]) == 2
    assert "status/c/2/1" in capsys.readouterr().err


def test_a_run_with_nothing_to_do_does_not_count_attempts(url, monkeypatch):
    monkeypatch.setattr(store, "attempts", lambda *_: pytest.fail("read the records of a finished study"))
    campaign = toy.campaign(toy.axis("position", np.arange(1.0, 14.0).tolist()), fail_above=12.5)
    progress = run(replace(campaign, replication=toy.Replication(5, 5, {})), url, Resources(), lambda _: None)
    assert (progress.kept, progress.blocks) == (65, 0)


def test_what_is_sealed_is_not_read_again(url, monkeypatch):
    assert store.look(url, "").is_sealed
    read = []
    for room in (ledgers, sound):
        many = room.read_many
        monkeypatch.setattr(
            room, "read_many", lambda u, names, many=many: many(u, (read.append(n) or n for n in names))
        )
    monkeypatch.setattr(sound, "records", lambda *_: pytest.fail("read the records of a sealed study"))
    assert np.array_equal(store.look(url, "").status, plain(url))
    assert store.require_sound(url, [""])
    assert [name for name in read if name.startswith(("height/c/", "status/c/"))] == []


def swap_names(one, other):
    aside = one.with_name("aside")
    one.rename(aside)
    other.rename(one)
    aside.rename(other)


@pytest.mark.parametrize("sealed", [True, False])
@pytest.mark.parametrize("array", ["height", "status"])
def test_chunks_that_change_their_places_are_named_however_many_there_are(url, array, sealed, monkeypatch):
    monkeypatch.setattr(sound, "FEW", 3)
    if not sealed:
        Path(url, "status/seal.json").unlink()
    swap_names(Path(url, array, "c/2/1"), Path(url, array, "c/6/0"))
    if array == "status" or sealed:  # values of more blocks than a look reads are for `verify`
        with pytest.raises(StoreError, match=f"{array}/c/2/1 is not what was written there"):
            store.require_sound(url, [""])


def test_a_copy_of_a_study_is_read_again_and_sealed_by_the_next_run(url, tmp_path):
    copy = str(tmp_path / "copy.zarr")
    shutil.copytree(url, copy)
    assert not store.look(copy, "").is_sealed
    assert np.array_equal(store.ledger(copy, "", (13, 5)), plain(url))
    campaign = toy.campaign(toy.axis("position", np.arange(1.0, 14.0).tolist()), fail_above=12.5)
    run(replace(campaign, replication=toy.Replication(5, 5, {})), copy, Resources(), lambda _: None)
    assert store.look(copy, "").is_sealed


def test_a_chunk_that_is_not_what_was_written_has_no_stamp_in_the_seal(url):
    Path(url, "status/seal.json").unlink()
    swap_names(Path(url, "height/c/2/1"), Path(url, "height/c/6/0"))
    store.seal(url, "")
    seal, stamps = read_seal(url, ""), store.look(url, "").stamps
    assert np.argwhere(seal.stamps["height"] != stamps["height"]).tolist() == [[2, 1], [6, 0]]
    assert seal.stamps["height"][[2, 6], [1, 0]].tolist() == [0, 0]
    assert np.array_equal(seal.stamps["status"], stamps["status"])


def test_the_seal_of_a_ledger_of_which_nothing_is_as_it_was_written_is_a_seal(url):
    """It knows what the values are, and is not taken for damaged itself."""
    Path(url, "status/seal.json").unlink()
    chunks = [path for path in Path(url, "status/c").rglob("*") if path.is_file()]
    for chunk in chunks:
        chunk.write_bytes(chunk.read_bytes()[::-1])
    store.seal(url, "")
    seal = read_seal(url, "")
    assert (seal.different, np.any(seal.which), np.any(seal.stamps["status"])) == ((None,), False, False)
    assert np.array_equal(seal.stamps["height"], store.look(url, "").stamps["height"])
    damaged = {finding.name for finding in store.verify(url).findings}
    assert damaged == {chunk.relative_to(url).as_posix() for chunk in chunks}


def test_a_seal_that_is_damaged_or_of_another_study_is_no_seal(url):
    seal = Path(url, "status/seal.json")
    content = seal.read_bytes()
    for harm in (b"", content[:-3], content.replace(b'"series": ""', b'"series": "a"'), b"[]\n", b"{}\n"):
        seal.write_bytes(harm)
        assert not store.look(url, "").is_sealed
        assert np.array_equal(store.ledger(url, "", (13, 5)), plain(url))
        assert [(f.kind, f.name) for f in store.verify(url).findings] == [("damaged", "status/seal.json")]


@pytest.mark.parametrize(("old", "new"), [(b'"attempt": 1', b'"attempt": 2'), (b'"digest": "', b'"digest": "0')])
def test_a_record_that_was_changed_is_none(old, new):
    line = sealed({"attempt": 1, "block": [0, 3], "chunks": {"status": "ab"}, "messages": []})
    assert opened(line)["block"] == [0, 3]
    assert opened(json.dumps(json.loads(line), indent=1).encode()) is not None
    assert old in line
    assert opened(line.replace(old, new)) is None
