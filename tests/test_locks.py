"""Who may write: locks of the operating system, claims where there are none, and tasks of runners that are gone."""

import errno
import fcntl
import json
import logging
import os
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from test_execute import digests, run

from mdr_dask import execute, store
from mdr_dask.campaign import Replication
from mdr_dask.errors import StoreBusyError, StoreError
from mdr_dask.execute import Resources
from mdr_dask.store import Lock, files, locks
from mdr_dask.task import run_block


@pytest.fixture
def bucket(tmp_path):
    """A store in memory: a URL whose server writes conditionally."""
    yield "memory://locks/study.zarr"
    import fsspec

    files.bytes_of.cache_clear()
    fsspec.filesystem("memory").store.clear()


def small(toy, count=6):
    campaign = toy.campaign(toy.axis("position", [1.0, 2.0]), realisations=Replication(count, count, {}))
    return replace(campaign, blocks={"realisation": 4})


def without_locks(monkeypatch, number):
    def refuse(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)


def test_a_file_system_without_locks_is_named_and_a_claim_keeps_others_out(toy, url, monkeypatch, caplog):
    run(small(toy), url + "2")
    without_locks(monkeypatch, errno.ENOLCK)
    assert run(small(toy), url).done == 12
    assert (
        f"no locks on this file system ({os.strerror(errno.ENOLCK)}); the run creates a lock file instead"
        in caplog.text
    )
    assert run(small(toy), url).kept == 12
    with locks.acquire(url), pytest.raises(StoreBusyError, match=rf"process {os.getpid()} on .* is running"):
        run(small(toy), url)
    assert digests(url) == digests(url + "2")
    assert not [path for path in Path(url, ".claims").rglob("*") if path.is_file()]


def test_a_lock_that_fails_otherwise_is_said_to_fail(toy, url, monkeypatch):
    without_locks(monkeypatch, errno.EIO)
    with pytest.raises(StoreError, match=r"locking it failed: Input/output error"):
        run(small(toy), url)


def test_at_a_url_the_second_runner_is_refused_and_the_claim_goes_with_the_first(toy, bucket, caplog):
    with locks.acquire(bucket), pytest.raises(StoreBusyError, match=rf"process {os.getpid()} on .* is running"):
        run(small(toy), bucket)
    assert run(small(toy), bucket).done == 12
    assert files.listed(bucket, files.CLAIMS) == []
    assert caplog.text == ""


def test_of_many_that_want_a_study_at_once_one_gets_it(bucket):
    held, refused, start = [], [], threading.Barrier(8)

    def want():
        start.wait()
        try:
            with locks.acquire(bucket) as hold:
                held.append(hold)
                while len(held) + len(refused) < 8:  # nobody comes late, however busy the machine is
                    time.sleep(0.01)
        except StoreBusyError as error:
            refused.append(str(error))

    threads = [threading.Thread(target=want) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (len(held), len(refused)) == (1, 7)


def test_a_silent_claim_is_taken_over_and_its_owner_writes_nothing_more(toy, bucket, monkeypatch, caplog):
    monkeypatch.setattr(locks, "BEAT", 1.0)
    caplog.set_level(logging.WARNING)
    run(small(toy), bucket)
    gone = {"owner": "a" * 32, "who": "process 1 on node7", "time": time.time() - 3.0}
    files.write_bytes(bucket, ".claims/alone/000004.json", json.dumps(gone).encode())
    with locks.acquire(bucket) as hold:
        assert hold.claim == 5
        assert "heartbeat of process 1 on node7" in caplog.text
        with (
            pytest.raises(StoreBusyError, match="has ended or lost its lock"),
            store.while_locked(bucket, Lock("", "a" * 32, 4)),
        ):
            pass
        time.sleep(2.2)  # longer than anybody may be silent: it is the signs of life that keep it
        with pytest.raises(StoreBusyError, match="is running on this store"), locks.acquire(bucket):
            pass


def test_a_server_that_only_looks_before_it_writes_is_named(toy, bucket, monkeypatch, caplog):
    from fsspec import AbstractFileSystem
    from fsspec.implementations.memory import MemoryFileSystem

    monkeypatch.setattr(MemoryFileSystem, "pipe_file", AbstractFileSystem.pipe_file)
    assert run(small(toy), bucket).done == 12
    assert (
        "two simultaneous runs cannot be prevented here (no conditional writes): start one run at a time" in caplog.text
    )


def late_task(toy, url, monkeypatch):
    """Run a study whose driver is killed while a worker still computes; return that worker's task."""
    begun = []

    def begin(work):
        begun.append(work)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("mdr_dask.execute.executors.run_block", begin)
        with pytest.raises(KeyboardInterrupt):
            execute.run(small(toy), url, Resources(threads=1), lambda _: None)
    return begun[-1]


def test_a_worker_that_outlives_its_driver_writes_nothing(toy, url, monkeypatch):
    late = late_task(toy, url, monkeypatch)
    run(small(toy), url)
    before = digests(url)
    with pytest.raises(StoreBusyError, match="has ended or lost its lock; nothing was written"):
        run_block(late)
    run(small(toy, 9), url)
    grown = digests(url)
    with pytest.raises(StoreError, match=r"nothing was written|a later shape"):
        run_block(late)
    assert digests(url) == grown != before


def test_the_next_runner_waits_for_a_task_in_the_middle_of_writing(url, monkeypatch):
    with locks.acquire(url) as hold:
        path = next(Path(url).parent.glob(".*.runner"))
        survivor = path.read_bytes()
    path.write_bytes(survivor)  # as SIGKILL leaves it
    order = []

    def finish():
        with store.while_locked(url, hold):
            writing.set()
            time.sleep(0.3)
            order.append("written")

    writing = threading.Event()
    thread = threading.Thread(target=finish)
    thread.start()
    writing.wait()
    with locks.acquire(url):
        order.append("next")
    thread.join()
    assert order == ["written", "next"]
    monkeypatch.setattr(locks, "BEAT", 0.05)
    path.write_bytes(survivor)
    with (
        store.while_locked(url, hold),
        pytest.raises(StoreBusyError, match=r"a task of process \d+ on .* is running"),
        locks.acquire(url),
    ):
        pass
