"""Run the parts of a campaign in separate processes that are killed at random and started again."""

from __future__ import annotations

import multiprocessing
import os
import random
import time
from contextlib import suppress
from dataclasses import replace

import toy

from mdr_dask import execute, models
from mdr_dask.errors import StoreBusyError
from mdr_dask.execute import Part, Resources
from mdr_dask.store import files, locks

#: Processes are forked from a server that has loaded all modules.
PROCESSES = multiprocessing.get_context("forkserver")
PROCESSES.set_forkserver_preload(["toy", "killed_parts", "zarr", "dask", "filelock", "mdr_dask.execute.rounds"])
#: Time between heartbeats in a bucket, s: shorter than the default.
BEAT = 2.0


def study(blocks: int):
    axis = toy.axis("position", [1.0 + number for number in range(blocks)])
    return replace(toy.campaign(axis), blocks={"position": 1})


def run_part(url: str, part: Part, blocks: int, pause: float, server: dict[str, str]) -> None:
    os.environ.update(server)
    toy.install(pause)
    assert "toy" in models.NAMES
    if files.local(url) is None:
        locks.BEAT = BEAT
    while True:
        with suppress(StoreBusyError):
            execute.run(study(blocks), url, Resources(threads=1), lambda _: None, part=part)
            return
        assert files.local(url) is None, "a lock outlives its holder"
        time.sleep(BEAT)  # the lock of the killed part remains until its heartbeat has expired


def run_with_kills(url: str, parts: int, kills: int, blocks: int, pause: float, seed: int = 1) -> int:
    """Start all parts, kill random parts and start them again; return the number of running parts that were killed."""
    chance = random.Random(seed)
    server = {name: value for name, value in os.environ.items() if name.startswith("AWS_")}

    def start(number: int):
        process = PROCESSES.Process(target=run_part, args=(url, Part(number, parts), blocks, pause, server))
        process.start()
        return process

    running = {number: start(number) for number in range(1, parts + 1)}
    hit = 0
    try:
        while hit < kills:
            time.sleep(chance.uniform(0.02, 0.25))
            alive = [number for number, process in running.items() if process.is_alive()]
            if not alive:
                break
            number = chance.choice(alive)
            running[number].kill()
            running[number].join()
            hit += running[number].exitcode == -9
            running[number] = start(number)
        for process in running.values():
            process.join()
        assert {process.exitcode for process in running.values()} == {0}
    finally:
        for process in running.values():
            process.kill()
    return hit
