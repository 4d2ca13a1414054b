"""Messages when a cluster does not start or goes away, and what remains in the store."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from slow_campaign import make, mdr_dask
from test_execute import digests

PYTHON = sys.executable
KEPT = "what is in the store is kept: run the campaign again"

pytestmark = pytest.mark.slow


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, value in make(tmp_path, blocks=60, pause=0.25).items():
        monkeypatch.setenv(name, value)
    return tmp_path


@pytest.fixture
def start():
    """Start processes, which are gone after the test."""
    started = []

    def process(*command, **options):
        options = {"stderr": subprocess.PIPE, "text": True, "start_new_session": True, **options}
        started.append(subprocess.Popen(command, **options))
        return started[-1]

    yield process
    for each in started:
        if each.poll() is None:
            os.killpg(each.pid, signal.SIGKILL)
        each.wait()
        if each.stderr:
            each.stderr.close()


def wait_for(process, pattern):
    """Wait until a process says something on stderr; return what."""
    for line in process.stderr:
        if found := re.search(pattern, line):
            return found[1]
    raise AssertionError(f"no line on stderr matched {pattern}")


def scheduler(start):
    head = start(PYTHON, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-show")
    return head, wait_for(head, r"Scheduler at:\s+(tcp://\S+)")


def worker(start, head, address):
    options = ["--nthreads", "1", "--no-nanny", "--no-dashboard"]
    process = start(PYTHON, "-m", "distributed.cli.dask_worker", address, *options, stderr=subprocess.DEVNULL)
    wait_for(head, "(Register worker)")
    return process


def lines_of(driver, kill):
    """Return what a driver says to its end; something is killed as soon as this driver has results."""
    lines = []
    for line in driver.stderr:
        lines.append(line.strip())
        if "of 120 results" in line and "block done" in events()[-2:]:
            kill()
    assert driver.wait() == 2
    return lines


def events():
    """Return the names of all events of the log."""
    return [json.loads(line)["event"] for line in Path("log.jsonl").read_text().splitlines()]


def kill_in_a_block(process):
    """Kill a worker of which the driver has heard that a block has begun, and not that it is done."""
    while process.poll() is None:
        process.send_signal(signal.SIGSTOP)
        time.sleep(0.5)
        if events()[-1] == "block begun":
            process.kill()
            process.wait()
        else:
            process.send_signal(signal.SIGCONT)
            time.sleep(0.1)


def test_no_worker_and_a_worker_that_dies_and_a_scheduler_that_dies(folder, start):
    head, address = scheduler(start)
    command = ("mdr-dask", "run", "long.yaml", "--scheduler", address, "--log", "log.jsonl")
    alone = mdr_dask(*command[1:], "--patience", "6")
    assert alone.returncode == 2
    waiting = r"^no (worker|answer of the scheduler) yet, waiting for \d s; giving up after 6 s$"
    assert re.search(waiting, alone.stderr, flags=re.M)
    last = rf"no worker for \d+ s; {KEPT}, if necessary with a larger --patience$"
    assert re.search(last, " ".join(alone.stderr.split()))

    first = worker(start, head, address)
    lines = lines_of(start(*command, "--patience", "6"), lambda: kill_in_a_block(first))
    assert any(re.match("all workers are gone, waiting for", line) for line in lines)

    worker(start, head, address)
    lines += lines_of(start(*command), head.kill)
    assert " ".join(lines).endswith(f"the scheduler went away; {KEPT}")
    assert not any(word in line for line in lines for word in ("Traceback", "asyncio", "Error"))

    assert mdr_dask("run", "long.yaml", PAUSE="0").returncode == 0
    assert mdr_dask("run", "long.yaml", "--store", "whole.zarr", PAUSE="0").returncode == 0
    assert digests("long.zarr") == digests("whole.zarr")
    assert {"run begun", "laid out", "block begun", "block done", "worker lost"} <= set(events())
    assert events().count("run interrupted") == 3


def test_a_run_ends_with_one_message_when_the_scheduler_is_stopped(folder, start):
    head, address = scheduler(start)
    worker(start, head, address)
    driver = start("mdr-dask", "run", "long.yaml", "--scheduler", address, "--patience", "10")
    wait_for(driver, r"([1-9]\d*) of 120 results")
    head.send_signal(signal.SIGSTOP)
    lines = driver.stderr.read().splitlines()
    assert driver.wait() == 2
    last = rf"no answer from the scheduler for \d+ s; {KEPT}, if necessary with a larger --patience$"
    assert re.search(last, " ".join(" ".join(lines).split()))
    assert not any(word in line for line in lines for word in ("Traceback", "asyncio", "Error"))
