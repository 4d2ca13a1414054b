"""Worker processes: what dies with them, and what does not."""

import os
import platform
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import dask
import distributed  # noqa: F401  (its defaults must be loaded before a test changes a setting)
import psutil
import pytest
from test_execute import digests, run, values

from mdr_dask import execute, task
from mdr_dask.campaign import Replication, Tolerance
from mdr_dask.errors import ClusterError, StoreError
from mdr_dask.execute import Resources


@pytest.fixture
def workers(toy):
    """A local cluster whose workers know the toy model; a task is suspect as soon as one of them dies with it."""
    arguments = {"n_workers": 1, "threads_per_worker": 1, "dashboard_address": None, "preload": [toy.PRELOAD]}
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        yield Resources(cluster={"class": "distributed.LocalCluster", "arguments": {**arguments, "silence_logs": 50}})


def run_on(resources, campaign, url):
    return execute.run(campaign, url, resources, lambda _: None)


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
    with pytest.raises(StoreError, match=r"study\.zarr: writing height.* failed: "):
        run_on(workers, campaign, url)


def test_a_task_of_another_version_is_refused_before_anything_is_written(toy, url, monkeypatch):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]))
    monkeypatch.setattr(task, "versions", lambda _: ("0.0", 7, None))
    with pytest.raises(ClusterError, match=r"has mdr_dask 0\.0 with toy 7"):
        run(campaign, url)
    assert not digests(url).keys() & {"height/c/0/0", "status/c/0/0"}


def test_a_scheduler_that_does_not_answer_is_named(toy, url, monkeypatch):
    campaign = toy.campaign(toy.axis("position", [1.0]))
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "200 ms"}),
        pytest.raises(ClusterError, match=r"no Dask scheduler answers at 'tcp://127\.0\.0\.1:9'"),
    ):
        run_on(Resources(scheduler="tcp://127.0.0.1:9"), campaign, url)
    with pytest.raises(ClusterError, match="no Dask scheduler answers at 'head:node'"):
        run_on(Resources(scheduler="head:node"), campaign, url)


@pytest.mark.parametrize("name", ["nowhere.Cluster", "distributed.NoCluster", "Cluster", "distributed.LocalCluster"])
def test_a_cluster_that_cannot_be_started_is_named(toy, url, name):
    campaign = toy.campaign(toy.axis("position", [1.0]))
    resources = Resources(cluster={"class": name, "arguments": {"no_such": 1}})
    with pytest.raises(ClusterError, match=f"cannot start '{name}'"):
        run_on(resources, campaign, url)


@pytest.mark.slow
def test_workers_see_relative_paths_and_name_a_store_that_they_do_not_see(toy, tmp_path, workers, monkeypatch):
    """A path by way of this process's own files is another one to a worker."""
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]))
    (tmp_path / "here").mkdir()
    elsewhere = f"import os; os.chdir({str(tmp_path)!r})\n"
    workers.cluster["arguments"]["preload"].append(elsewhere)
    monkeypatch.chdir(tmp_path / "here")
    assert run_on(workers, campaign, "study.zarr").done == 12
    folder = os.open(tmp_path, os.O_RDONLY)
    try:
        url = f"/proc/self/fd/{folder}/unseen.zarr"
        sentence = rf"{url}: not seen from {platform.node()}; the workers need a shared file system or a URL"
        with pytest.raises(StoreError, match=sentence):
            run_on(workers, campaign, url)
    finally:
        os.close(folder)
    assert not list(tmp_path.glob("study.zarr"))


@pytest.mark.slow
def test_a_client_without_the_credentials_is_refused_and_no_page_is_served_to_others(toy, url, workers):
    addresses, pages, answers = [], [], []

    def look(event):
        if event.name == "block begun":
            addresses.append(event.facts["worker"])
            pages.extend(listening_beyond_this_machine())
            answers.extend(answer_to_a_stranger(at) for at in (addresses[-1], addresses[-1].replace("tls", "tcp")))

    execute.run(toy.campaign(toy.axis("position", [1.0])), url, workers, lambda _: None, tell=look)
    assert [address[:16] for address in addresses] == ["tls://127.0.0.1:"]
    assert pages == []
    assert answers == ["refused", "refused"]


def answer_to_a_stranger(address: str) -> str:
    """Return what a client of Dask in a process of its own, without credentials, is told at an address."""
    lines = [
        "from distributed import Client",
        f"try: Client({address!r}, timeout=2)",
        "except (OSError, TypeError, ValueError): print('refused')",
        "else: print('let in')",
    ]
    command = [sys.executable, "-c", "\n".join(lines)]
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, timeout=120).stdout.strip()


def listening_beyond_this_machine() -> list[str]:
    """Return the addresses, other than those of this machine alone, at which this process listens."""
    return [
        str(each.laddr)
        for each in psutil.Process().net_connections("inet")
        if each.status == psutil.CONN_LISTEN and each.laddr.ip not in ("127.0.0.1", "::1")
    ]
