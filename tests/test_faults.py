"""What is left behind by every write that fails, and by every write that was the last one."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from test_execute import digests
from zarr.storage import LocalStore

from mdr_dask import execute
from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.errors import StoreError
from mdr_dask.execute import Resources
from mdr_dask.store import files


def run(campaign, url, **options):
    return execute.run(campaign, url, Resources(threads=1), lambda _: None, **options)


class Disk:
    """Counts the files that are written to local stores, and their names; one act fails, or it and all behind it."""

    def __init__(self, monkeypatch) -> None:
        self.writes = 0
        self.fails = lambda number: False
        for act in ("put", "give_name"):
            monkeypatch.setattr(files, act, self.counted(getattr(files, act)))

        async def refused(*_):
            raise AssertionError("only whole stages are expected to be written")

        monkeypatch.setattr(LocalStore, "set", refused)
        monkeypatch.setattr(LocalStore, "set_if_not_exists", refused)

    def counted(self, act):
        def counting(*arguments):
            self.writes += 1
            if self.fails(self.writes):
                raise OSError(28, "No space left on device")
            act(*arguments)

        return counting


@pytest.fixture
def disk(monkeypatch):
    return Disk(monkeypatch)


def small(toy, **options):
    return replace(toy.campaign(toy.axis("position", [1.0, 4.0]), **options), blocks={"realisation": 4, "position": 1})


def grown(toy, **options):
    axes = toy.axis("position", [1.0, 2.0, 4.0])
    return toy.campaign(axes, realisations=Replication(9, 9, {}), **options)


def two_series(campaign, positions=(1.0, 2.0)):
    axes = (replace(campaign.series[0].axes[0], values=tuple(positions)),)
    far = tuple(10.0 * position for position in positions)
    return replace(
        campaign,
        series=(
            replace(campaign.series[0], name="near", axes=axes),
            replace(campaign.series[0], name="far", axes=(replace(axes[0], values=far),)),
        ),
    )


def adaptive(toy):
    axis = toy.axis("noise", [0.01, 0.4])
    return toy.campaign(axis, realisations=Replication(3, 6, {"height": Tolerance(relative=0.05)}))


#: Steps of a study by name, each a list of campaigns run one after the other, the last one with faults.
SCENES = {
    "first layout and blocks": lambda toy: [small(toy)],
    "growth of axes and realisations": lambda toy: [small(toy), grown(toy)],
    "growth of series": lambda toy: [two_series(small(toy), (1.0,)), two_series(small(toy), (1.0, 1.5))],
    "two outputs": lambda toy: [small(toy, outputs=("height", "trace"))],
    "rounds": lambda toy: [adaptive(toy)],
    "retry": lambda toy: [small(toy, fail_above=2.0), small(toy, fail_above=2.0)],
}


#: Scenes of the default run.
QUICK = {"growth of axes and realisations", "retry"}


def look(url: Path | str) -> list[dict[str, int]]:
    """Open a store as a stranger would, group by group, and read all of it; what is shown has one shape."""
    if not Path(url, "zarr.json").exists():
        return []
    tree = xr.open_datatree(url, engine="zarr", consolidated=True)
    assert all("status" in node or not node.variables for node in tree.subtree)
    seen = []
    for path in ("", *tree.children):
        dataset = xr.open_zarr(url, group=path or None, chunks=None, consolidated=True).load()
        if "status" in dataset:
            done = dataset.status.to_numpy() == 1
            assert np.isfinite(dataset.height.to_numpy()[done]).all()
            assert all(np.isfinite(dataset[dim]).all() for dim in dataset.sizes)
        else:
            assert not dataset.variables or path == ""
        seen.append(dict(dataset.sizes))
    return seen


@pytest.mark.parametrize("lasting", [False, True], ids=["one write fails", "the last write before a kill"])
@pytest.mark.parametrize("scene", [pytest.param(s, marks=[pytest.mark.slow] * (s not in QUICK)) for s in SCENES])
def test_after_any_failed_write_a_plain_run_ends_with_the_same_bytes(toy, tmp_path, disk, scene, lasting):
    *before, last = SCENES[scene](toy)
    options = {"retry_failed": scene == "retry"}
    old, whole = tmp_path / "old.zarr", tmp_path / "whole.zarr"
    for campaign in before:
        run(campaign, str(old))
    if before:
        shutil.copytree(old, whole)
    first = disk.writes
    run(last, str(whole), **options)
    expected, count = digests(whole), disk.writes - first
    shapes = look(old) + look(whole)
    assert count > 3
    for broken_write in range(1 + lasting, count + 1, 2):  # each write in one of the two ways
        url = str(tmp_path / "broken.zarr")
        if before:
            shutil.copytree(old, url)
        start = disk.writes + broken_write
        disk.fails = lambda number, start=start: number == start or (lasting and number > start)
        with pytest.raises(StoreError, match=r"\.zarr: writing .* failed: No space left on device"):
            run(last, url, **options)
        disk.fails = lambda number: False
        if scene != "rounds":
            assert all(sizes in shapes for sizes in look(url) if sizes)
        assert not list(tmp_path.glob(".*.runner"))
        run(last, url, **options)
        assert digests(url) == expected
        shutil.rmtree(url)


def test_contents_are_flushed_before_names_are_given_and_names_before_the_ledger_has_its_own(tmp_path, monkeypatch):
    acts = []
    monkeypatch.setattr(files, "flush", lambda path: acts.append(("flushed", path.is_dir())))
    given = files.give_name
    monkeypatch.setattr(files, "give_name", lambda old, new: acts.append(("named", given(old, new) or new.name)))
    files.write_stages(str(tmp_path), [{"values/0": b"1", "values/1": b"2"}, {"ledger": b"3"}])
    named = [("named", "0"), ("named", "1"), ("named", "ledger")]
    first, last = named[:2], named[2:]
    assert acts == [("flushed", False)] * 3 + first + [("flushed", True)] * 2 + last + [("flushed", True)]


@pytest.mark.parametrize("act", ["put", "give_name"])
def test_a_write_that_fails_leaves_no_unnamed_file(act, tmp_path, monkeypatch):
    given, calls = getattr(files, act), []

    def refused(*arguments):
        calls.append(arguments)
        if len(calls) == 2:
            raise OSError("no space left")
        return given(*arguments)

    monkeypatch.setattr(files, act, refused)
    with pytest.raises(StoreError, match="no space left"):
        files.write_stages(str(tmp_path), [{"a/0": b"1", "a/1": b"2", "b": b"3"}])
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == (
        [tmp_path / "a/0"] if act == "give_name" else []
    )
