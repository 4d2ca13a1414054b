"""Worker processes: what dies with them, and what does not."""

import shutil
from dataclasses import replace
from pathlib import Path

import dask
import distributed  # noqa: F401  (brings its configuration, which the fixture changes)
import numpy as np
import pytest
from test_execute import digests, run, values

from mdr_dask import execute, store, task
from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.errors import ClusterError, StoreError
from mdr_dask.execute import Resources, clusters


@pytest.fixture
def workers(toy):
    """A local cluster whose workers know the toy model; a task is suspect as soon as one of them dies with it."""
    arguments = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None, "preload": [toy.PRELOAD]}
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        yield Resources(cluster={"class": "distributed.LocalCluster", "arguments": {**arguments, "silence_logs": 50}})


def run_on(resources, campaign, url):
    return execute.run(campaign, url, resources, lambda _: None)


TWO = Replication(2, 2, {})


@pytest.mark.slow
def test_only_the_results_that_kill_their_worker_fail(toy, url, workers):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0, 3.0]), realisations=TWO, kill_above=2.5)
    progress = run_on(workers, campaign, url)
    assert (progress.done, progress.failed, progress.not_needed) == (4, 2, 0)
    messages = [message for record in store.records(url, "") for message in record["messages"]]
    assert {(m["case"]["position"], m["realisation"]) for m in messages} == {(3.0, 0), (3.0, 1)}
    assert all(m["message"].startswith("its worker died again and again (1 times)") for m in messages)
    clean = toy.campaign(toy.axis("position", [1.0, 2.0]), realisations=TWO)
    run(clean, url + "2")
    np.testing.assert_array_equal(values(url).sel(position=[1.0, 2.0]), values(url + "2"))


@pytest.mark.slow
def test_a_lost_worker_fails_nothing(toy, url, tmp_path, workers):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]), dies_once=str(tmp_path / "died"))
    progress = run_on(workers, campaign, url)
    assert (progress.done, progress.failed) == (12, 0)
    assert (tmp_path / "died").exists()


@pytest.mark.slow
def test_rounds_on_worker_processes_give_the_bytes_of_threads(toy, url, workers):
    """The workers outlive a round, and with it the shape of the store that they first saw."""
    campaign = toy.campaign(
        toy.axis("position", [1.0, 2.0]),
        toy.axis("noise", [0.01, 0.2]),
        realisations=Replication(5, 40, {"height": Tolerance(relative=0.05)}),
    )
    first = run(campaign, url)
    second = run_on(workers, campaign, url + "2")
    assert first.done == second.done
    assert digests(url) == digests(url + "2")
    assert values(url).sizes["realisation"] > 5


@pytest.mark.slow
def test_a_store_that_cannot_be_written_ends_a_distributed_run_with_one_error(toy, url, workers):
    campaign = replace(toy.campaign(toy.axis("position", [1.0, 2.0])), blocks={"position": 1})
    run(campaign, url)
    blocked = f"{url}/height/c/1"
    shutil.rmtree(f"{url}/status/c/1")
    shutil.rmtree(blocked)
    Path(blocked).touch()
    with pytest.raises(StoreError, match=r"study\.zarr: writing height failed: "):
        run_on(workers, campaign, url)


@pytest.mark.slow
def test_a_worker_of_another_version_is_refused(toy, url, workers, monkeypatch):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]))
    monkeypatch.setattr(execute.cells, "versions", lambda _: ("9.9", 1))
    with pytest.raises(ClusterError, match=r"worker .* has mdr_dask .* with toy 1, this program is mdr_dask 9\.9"):
        run_on(workers, campaign, url)


def test_a_task_of_another_version_is_refused_before_anything_is_written(toy, url, monkeypatch):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]))
    monkeypatch.setattr(task, "versions", lambda _: ("0.0", 7))
    with pytest.raises(ClusterError, match=r"has mdr_dask 0\.0 with toy 7"):
        run(campaign, url)
    assert not digests(url).keys() & {"height/c/0/0", "status/c/0/0"}


def test_a_scheduler_that_does_not_answer_is_named(toy, url, monkeypatch):
    campaign = toy.campaign(toy.axis("position", [1.0]))
    monkeypatch.setattr(clusters, "SCHEDULER_PATIENCE", 0.2)
    with pytest.raises(ClusterError, match=r"no Dask scheduler answers at 'tcp://127\.0\.0\.1:9'"):
        run_on(Resources(scheduler="tcp://127.0.0.1:9"), campaign, url)
    with pytest.raises(ClusterError, match="no Dask scheduler answers at 'head:node'"):
        run_on(Resources(scheduler="head:node"), campaign, url)


@pytest.mark.parametrize("name", ["nowhere.Cluster", "distributed.NoCluster", "Cluster", "distributed.LocalCluster"])
def test_a_cluster_that_cannot_be_started_is_named(toy, url, name):
    campaign = toy.campaign(toy.axis("position", [1.0]))
    resources = Resources(cluster={"class": name, "arguments": {"no_such": 1}})
    with pytest.raises(ClusterError, match=f"cannot start '{name}'"):
        run_on(resources, campaign, url)
