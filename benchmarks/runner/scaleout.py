"""Many workers: ``python -m benchmarks runner scaleout [WORKERS...]``.

A model that sleeps, so that a machine of two cores can stand for many. A scheduler, a process that holds all workers
(each with its own connection on the loopback) and the driver are processes of their own. Efficiency is the time slept
over workers x time on the wall. Processor time of driver and scheduler for each block says where they saturate, however
busy the machine is.
"""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import psutil

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

import toy

from benchmarks.measures import print_table
from mdr_dask.execute import Resources, run
from mdr_dask.models.base import Block, Result

TESTS = Path(__file__).parents[2] / "tests"
#: One in so many blocks takes ten times as long where there are stragglers.
STRAGGLER = 20
#: Seconds between two workers that go away, where workers are lost.
LOSS = 0.5


@dataclass(frozen=True)
class Setting:
    """Workers, seconds a block, and what goes wrong: nothing, stragglers or lost workers."""

    workers: int
    pause: float
    trouble: str = ""

    @property
    def blocks(self) -> int:
        return max(40, 10 * self.workers)

    def seconds(self, number: int) -> float:
        """Return the time that a block sleeps."""
        return 10 * self.pause if self.trouble == "stragglers" and number % STRAGGLER == 0 else self.pause


def install(setting: Setting) -> None:
    """Make a model known that sleeps: so long as the number of its first case says."""

    def sleep(block: Block) -> Result:
        time.sleep(setting.seconds(int(block.column("position")[0])))
        return toy.compute(block)

    toy.install(1e-9)
    module = sys.modules["mdr_dask.models.toy"]
    module.MODEL = replace(toy.MODEL, compute=sleep)


async def hold(address: str, setting: Setting) -> None:
    """Hold workers until this process is ended; where workers are lost, one goes at a time, and another one comes."""
    from distributed import Worker

    install(setting)
    workers = [await Worker(address, nthreads=1, validate=False) for _ in range(setting.workers)]
    while True:
        await asyncio.sleep(LOSS)
        if setting.trouble == "lost workers":
            lost = workers.pop(0)
            await lost.close(timeout=0, executor_wait=False, nanny=False)
            workers.append(await Worker(address, nthreads=1))


@contextmanager
def started(*program: str) -> Iterator[psutil.Process]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent)])}
    process = subprocess.Popen(
        [sys.executable, *program], env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield psutil.Process(process.pid)
    finally:
        process.kill()
        process.wait()


def used(process: psutil.Process) -> float:
    times = process.cpu_times()
    return times.user + times.system


def measure(setting: Setting, folder: Path) -> tuple[str, ...]:
    """Run a study on so many workers; return a row of the table."""
    axis = toy.axis("position", np.arange(float(setting.blocks)).tolist())
    study = replace(toy.campaign(axis, realisations=toy.Replication(1, 1, {})), blocks={"position": 1})
    told = folder / "scheduler.json"
    told.unlink(missing_ok=True)
    url = str(folder / f"{setting.workers}-{setting.pause}-{setting.trouble}.zarr")
    module = ("-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
    with started(*module, "--scheduler-file", str(told)) as scheduler:
        while not told.exists() or not told.read_text():
            time.sleep(0.1)
        address = json.loads(told.read_text())["address"]
        pause, trouble = str(setting.pause), setting.trouble
        with started("-m", "benchmarks.runner.scaleout", "hold", address, str(setting.workers), pause, trouble) as host:
            from distributed import Client

            with Client(address, set_as_default=False) as client:
                client.wait_for_workers(setting.workers)
            before = [used(process) for process in (psutil.Process(), scheduler, host)]
            first: list[tuple[float, int]] = []
            progress = run(
                study, url, Resources(scheduler=address), lambda p: first.append((time.monotonic(), p.blocks))
            )
            after = [used(process) for process in (psutil.Process(), scheduler, host)]
    wall = first[-1][0] - first[0][0]
    slept = sum(setting.seconds(number) for number in range(setting.blocks))
    efficiency = slept / (setting.workers * wall)
    driver, central, worker = (1e3 * (b - a) / progress.blocks for a, b in zip(before, after, strict=True))
    what = (setting.trouble or "none", setting.workers, f"{setting.pause:g} s", progress.blocks, f"{wall:.1f} s")
    return (*map(str, what), f"{efficiency:.0%}", f"{driver:.1f} ms", f"{central:.1f} ms", f"{worker:.1f} ms")


def main(*workers: int) -> None:
    head = ("trouble", "workers", "a block", "blocks", "wall", "efficiency", "driver", "scheduler", "workers, a block")
    memory = Path("/dev/shm")  # a disk that others use would be measured instead
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as scratch:
        folder = Path(scratch)
        install(Setting(1, 0.0))
        settings = [Setting(count, pause) for pause in (0.1, 1.0) for count in workers]
        settings += [
            Setting(count, 0.1, trouble) for trouble in ("stragglers", "lost workers") for count in workers[-2:]
        ]
        rows = []
        for setting in settings:
            rows.append(measure(setting, folder))
            print(*rows[-1], sep=" | ", flush=True)
        print()
        print_table(head, rows)


if __name__ == "__main__":
    if sys.argv[1:2] == ["hold"]:
        address, count, pause, trouble = sys.argv[2:6]
        asyncio.run(hold(address, Setting(int(count), float(pause), trouble)))
    else:
        main(*map(int, sys.argv[1:] or ["1", "4", "16", "64"]))
