"""The runner: every result once, the same bytes whatever happens, failures as data."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from mdr_dask import execute, store
from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.errors import StoreError
from mdr_dask.execute import Part, Progress, Resources
from mdr_dask.models.base import Status


def run(campaign, url, **options) -> Progress:
    return execute.run(campaign, url, Resources(threads=2), lambda _: None, **options)


def digests(url: str) -> dict[str, str]:
    """Return the digest of every chunk: all bytes of a store that are not metadata or records."""
    return {
        str(path.relative_to(url)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(Path(url).rglob("*"))
        if path.is_file() and path.suffix not in (".json", ".jsonl")
    }


def values(url: str, output: str = "height") -> xr.DataArray:
    return store.datasets(url)[""][output].load()


def test_a_run_fills_every_cell_with_the_value_of_its_parameters(toy, url):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]), toy.axis("slope", [3.0, 5.0, 7.0]), noise=0.0)
    progress = run(campaign, url)
    assert (progress.done, progress.failed, progress.total) == (36, 0, 36)
    found = values(url)
    expected = found.position * found.slope
    np.testing.assert_array_equal(found, expected.broadcast_like(found).transpose(*found.dims))


def test_plain_xarray_reads_a_store_with_units_and_fixed_parameters(toy, url):
    run(toy.campaign(toy.axis("position", [1.0, 2.0]), noise=0.25), url)
    dataset = xr.open_zarr(url)
    assert dataset.height.dims == ("position", "realisation")
    assert dataset.height.attrs["units"] == dataset.position.attrs["units"] == "m"
    assert float(dataset.noise) == 0.25
    assert dataset.noise.attrs == {"units": "1", "long_name": "standard deviation over realisations"}
    assert dataset.status.attrs["flag_meanings"].split()[Status.DONE] == "done"
    assert dataset.attrs["campaign"] == "text"


def test_series_are_groups_of_one_tree(toy, url):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]), name="near")
    far = replace(campaign.series[0], name="far", axes=(toy.axis("position", [10.0, 20.0, 30.0]),))
    run(replace(campaign, series=(campaign.series[0], far)), url)
    tree = xr.open_datatree(url, engine="zarr")
    assert {name: node.sizes["position"] for name, node in tree.children.items()} == {"near": 2, "far": 3}
    assert xr.open_zarr(url, group="far").height.attrs["units"] == "m"


def test_a_second_run_computes_and_writes_nothing(toy, url):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]))
    run(campaign, url)
    before = {path: path.stat().st_mtime_ns for path in Path(url).rglob("*")}
    toy.COMPUTED.clear()
    progress = run(campaign, url)
    assert (progress.kept, progress.done, toy.COMPUTED) == (12, 0, [])
    assert {path: path.stat().st_mtime_ns for path in Path(url).rglob("*")} == before


@pytest.mark.parametrize("blocks", [{}, {"position": 1}, {"realisation": 4}, {"position": 2, "realisation": 1}])
def test_values_do_not_depend_on_the_blocks(toy, tmp_path, blocks):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0, 4.0]), toy.axis("slope", [1.0, 2.0]))
    urls = [str(tmp_path / name) for name in ("a.zarr", "b.zarr")]
    run(campaign, urls[0])
    run(replace(campaign, blocks=blocks), urls[1])
    assert values(urls[0]).to_numpy().tobytes() == values(urls[1]).to_numpy().tobytes()


def test_an_interrupted_run_goes_on_and_ends_with_the_same_bytes(toy, tmp_path):
    campaign = replace(toy.campaign(toy.axis("position", [1.0, 2.0, 4.0])), blocks={"realisation": 1, "position": 1})
    whole, broken = (str(tmp_path / name) for name in ("whole.zarr", "broken.zarr"))
    run(campaign, whole)

    def interrupt(progress: Progress) -> None:
        if progress.done == 7:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        execute.run(campaign, broken, Resources(threads=1), interrupt)
    there = int((store.ledger(broken, "", (3, 6)) == Status.DONE).sum())
    assert 7 <= there < 18
    toy.COMPUTED.clear()
    progress = run(campaign, broken)
    assert (progress.kept, progress.done, len(toy.COMPUTED)) == (there, 18 - there, 18 - there)
    assert digests(whole) == digests(broken)


def test_failures_are_recorded_counted_and_retried_on_request_only(toy, url):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0, 3.0]), fail_above=2.5)
    assert run(campaign, url).failed == 6
    assert np.isnan(values(url).sel(position=3.0)).all()
    assert np.isfinite(values(url).sel(position=[1.0, 2.0])).all()
    messages = [message for record in store.records(url, "") for message in record["messages"]]
    assert {(m["case"]["position"], m["message"], m["status"]) for m in messages} == {
        (3.0, "position above fail_above", "failed")
    }
    assert run(campaign, url).failed == 0
    before = digests(url)
    toy.COMPUTED.clear()
    assert run(campaign, url, retry_failed=True).failed == 6
    assert {position for position, _ in toy.COMPUTED} == {3.0}
    assert digests(url) == before
    assert set(store.attempts(url, "").values()) == {2}


def test_an_exception_in_a_model_fails_its_own_case_only(toy, url):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0, 3.0]), raise_above=2.5)
    assert run(campaign, url).failed == 6
    clean = toy.campaign(toy.axis("position", [1.0, 2.0]))
    run(clean, url + "2")
    np.testing.assert_array_equal(values(url).sel(position=[1.0, 2.0]), values(url + "2"))
    record = next(store.records(url, ""))
    assert record["messages"][0]["message"] == "RuntimeError: position too high"


def test_more_values_and_more_realisations_extend_a_store(toy, url):
    small = replace(toy.campaign(toy.axis("position", [1.0, 4.0]), toy.axis("slope", [1.0])), blocks={"realisation": 4})
    run(small, url)
    before = values(url)
    large = toy.campaign(
        toy.axis("position", [1.0, 2.0, 4.0]), toy.axis("slope", [0.5, 1.0]), realisations=Replication(9, 9, {})
    )
    toy.COMPUTED.clear()
    progress = run(large, url)
    assert (progress.kept, progress.done, len(toy.COMPUTED)) == (12, 42, 42)
    after = values(url)
    assert list(after.position) == [1.0, 2.0, 4.0]
    np.testing.assert_array_equal(after.reindex_like(before), before)
    run(large, url + "2")
    np.testing.assert_array_equal(after, values(url + "2"))


def test_a_store_of_another_campaign_is_refused_and_untouched(toy, url):
    run(toy.campaign(toy.axis("position", [1.0, 2.0])), url)
    before = digests(url), (Path(url) / "zarr.json").read_bytes()
    other = replace(toy.campaign(toy.axis("position", [1.0, 2.0]), noise=0.75), seed=5)
    with pytest.raises(StoreError, match=r"seed: 1 in the store, 5 .*\n +noise: 0.5 in the store, 0.75"):
        run(other, url)
    with pytest.raises(StoreError, match=r"axes: \['position'\] in the store, \['slope'\] in the campaign"):
        run(toy.campaign(toy.axis("slope", [1.0])), url)
    assert (digests(url), (Path(url) / "zarr.json").read_bytes()) == before


def test_rounds_go_on_for_the_cases_that_need_them(toy, url):
    campaign = toy.campaign(
        toy.axis("position", [1.0, 2.0]),
        toy.axis("noise", [0.01, 0.2]),
        realisations=Replication(5, 400, {"height": Tolerance(relative=0.01)}),
    )
    run(campaign, url)
    dataset = store.datasets(url)[""]
    done = (dataset.status == Status.DONE).sum("realisation")
    assert (done.sel(noise=0.01) == 12).all()  # the fewest from which the scatter is known
    assert (done.sel(noise=0.2) > 50).all()
    height = dataset.height
    error = height.std("realisation", ddof=1) / np.sqrt(height.notnull().sum("realisation"))
    assert (error <= 0.01 * abs(height.mean("realisation"))).all()
    toy.COMPUTED.clear()
    assert run(campaign, url).done == 0
    assert toy.COMPUTED == []
    fixed = replace(campaign, replication=Replication(done.max().item(), done.max().item(), {}))
    run(fixed, url)
    run(fixed, url + "2")
    np.testing.assert_array_equal(values(url)[..., : done.max().item()], values(url + "2"))


@pytest.mark.parametrize("blocks", [{}, {"realisation": 5, "noise": 1}])
def test_rounds_have_the_same_bytes_however_often_they_stop_and_whoever_works(toy, tmp_path, blocks):
    """The number of realisations of a round follows from the rounds before alone."""
    axes = toy.axis("position", [1.0, 2.0]), toy.axis("noise", [0.01, 0.05, 0.2])
    tolerance = {"height": Tolerance(relative=0.02)}
    campaign = replace(toy.campaign(*axes, realisations=Replication(10, 400, tolerance)), blocks=blocks)
    whole, broken, parts = (str(tmp_path / name) for name in ("a.zarr", "b.zarr", "c.zarr"))
    run(campaign, whole)
    stopped = 0
    while True:
        told = iter(blocks)

        def stop(progress, left=told):
            if progress.blocks and next(left, None) is None:
                raise KeyboardInterrupt

        try:
            execute.run(campaign, broken, Resources(threads=1), stop)
            break
        except KeyboardInterrupt:
            stopped += 1
    for _ in range(8):
        for number in (1, 2):
            run(campaign, parts, part=Part(number, 2))
    run(campaign, parts)
    assert stopped > bool(blocks)
    assert digests(whole) == digests(broken) == digests(parts)
    assert run(campaign, whole).done == 0


def test_a_tighter_tolerance_goes_on_where_the_wider_one_stopped(toy, tmp_path):
    def until(relative):
        axes = toy.axis("position", [1.0, 2.0]), toy.axis("noise", [0.01, 0.2])
        replication = Replication(5, 200, {"height": Tolerance(relative=relative)})
        return toy.campaign(*axes, realisations=replication)

    at_once, in_steps = (str(tmp_path / name) for name in ("once.zarr", "steps.zarr"))
    wide = run(until(0.05), in_steps)
    tight = run(until(0.02), in_steps)
    assert tight.done > 0
    assert tight.kept >= wide.done
    assert run(until(0.02), at_once).done == wide.done + tight.done
    assert digests(at_once) == digests(in_steps)


def test_large_groups_are_read_through_dask(toy, url, monkeypatch):
    run(toy.campaign(toy.axis("position", [1.0, 3.0, 2.0])), url)
    expected = store.datasets(url)[""].load()
    monkeypatch.setattr("mdr_dask.store.reading.LAZY_BYTES", 10)
    lazy = store.datasets(url)[""]
    assert all(array.chunks for array in lazy.data_vars.values())
    xr.testing.assert_identical(lazy.compute(), expected)


def test_a_message_stands_where_its_result_does_in_the_ledger(toy, url):
    campaign = toy.campaign(toy.axis("position", [1.0, 3.0]), toy.axis("slope", [1.0, 2.0]), fail_above=2.5)
    run(replace(campaign, blocks={"position": 1, "realisation": 2}), url)
    ledger = store.ledger(url, "", (2, 2, 6))
    places = {tuple(message["place"]) for record in store.records(url, "") for message in record["messages"]}
    assert places == {tuple(place) for place in np.argwhere(ledger == Status.FAILED).tolist()}
    assert len(places) == 12
