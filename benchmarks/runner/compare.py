"""Compare our runner with other programs: processor time, memory, files, and results left after a kill.

python -m benchmarks runner 4000       the same 4000 cases by each program; prints a table

Every program in `ways` computes the same cases with the same function in the same blocks, in its own process tree. The
processor time is that of the whole tree, including start and imports; "above the loop" is the excess over a plain loop
on one core. Memory is the largest sum of proportional set sizes (PSS). Then each program runs again. All its processes
are killed (SIGKILL) when half of the cases are computed, the remaining results are read, and a second run finishes.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from benchmarks.rows import table
from benchmarks.runner.ways import SPEEDS, WAYS

ROOT = Path(__file__).parents[2]
#: Seconds after which a run is stopped.
LIMIT = 400.0
#: A script that starts a program, adopts orphaned processes (PR_SET_CHILD_SUBREAPER), and prints the time of all.
LAUNCHER = """
import ctypes, os, resource, subprocess, sys
ctypes.CDLL(None).prctl(36, 1, 0, 0, 0)
code = subprocess.Popen(sys.argv[1:]).wait()
try:
    while True:
        os.wait()
except ChildProcessError:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime)
sys.exit(code != 0)
"""


@dataclass(frozen=True)
class Trial:
    """The runs of one program in a folder."""

    way: str
    folder: Path
    lines: int

    @property
    def tally(self) -> Path:
        return self.folder.with_suffix(".tally")

    @property
    def computed(self) -> int:
        return self.tally.stat().st_size if self.tally.exists() else 0

    @contextmanager
    def started(self, act: str) -> Iterator[subprocess.Popen[str]]:
        settings = {"PYTHONPATH": str(ROOT), "PEERS_TALLY": str(self.tally)}
        settings |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        module = (sys.executable, "-m", "benchmarks.runner.ways", act, str(self.folder), str(self.lines), self.way)
        self.folder.mkdir(exist_ok=True)
        with self.folder.with_suffix(".text").open("w") as text:
            launched = subprocess.Popen(
                [sys.executable, "-S", "-c", LAUNCHER, *module],
                env={**os.environ, **settings},
                stdout=subprocess.PIPE,
                stderr=text,
                text=True,
            )
            try:
                yield launched
            finally:
                kill_below(launched.pid)
                launched.communicate()

    def watched(self, kill_at: int | None = None) -> tuple[float, float, float]:
        """Run to the end, or kill the run after `kill_at` cases; return processor time, wall time, peak memory (MB)."""
        begun, peak = time.monotonic(), 0
        with self.started("run") as launched:
            while launched.poll() is None:
                peak = max(peak, memory_below(launched.pid))
                if kill_at is not None and self.computed >= kill_at:
                    kill_below(launched.pid)
                if time.monotonic() - begun > LIMIT:
                    raise TimeoutError(f"more than {LIMIT:.0f} s")
                time.sleep(0.01 if kill_at else 0.1)
            wall = time.monotonic() - begun
            printed = launched.stdout.read().split()
        if launched.returncode and kill_at is None:
            raise RuntimeError(self.folder.with_suffix(".text").read_text().splitlines()[-1])
        return float(printed[-1]), wall, peak / 1e6

    def read(self) -> np.ndarray:
        with self.started("read") as launched:
            if launched.wait():
                raise RuntimeError(self.folder.with_suffix(".text").read_text().splitlines()[-1])
        return np.load(self.folder.with_suffix(".read.npy"))


def below(pid: int) -> list[psutil.Process]:
    with suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).children(recursive=True)
    return []


def memory_below(pid: int) -> int:
    total = 0
    for process in below(pid):
        with suppress(psutil.Error):
            total += process.memory_full_info().pss
    return total


def kill_below(pid: int) -> None:
    """Kill all processes below a launcher, and repeat this until none is alive."""
    while alive := [process for process in below(pid) if process.status() != psutil.STATUS_ZOMBIE]:
        for process in alive:
            with suppress(psutil.Error):
                process.send_signal(signal.SIGKILL)


def attempt(act, *arguments):
    """Return the result of a function, or the message of its error."""
    try:
        return act(*arguments)
    except RuntimeError as error:
        return str(error)


def after_a_kill(trial: Trial, expected: np.ndarray) -> tuple[str, str, str]:
    """Kill a run after half of the cases, and run again.

    Return texts on the results left, on the cases computed again, and on whether the final results are the same.
    """
    trial.watched(expected.size // 2)
    before = trial.computed
    left = attempt(trial.read)
    text = left if isinstance(left, str) else f"{np.isfinite(left).sum()} of {before}"
    kept = 0 if isinstance(left, str) else int(np.isfinite(left).sum())
    second = attempt(trial.watched)
    if isinstance(second, str):
        return text, "", second
    again = trial.computed - expected.size
    same = attempt(lambda: np.array_equal(trial.read(), expected))
    return text, f"{again} ({before - kept} not left)", "yes" if same is True else "NO" if same is False else same


def compare(folder: Path, cases: int, names: list[str]) -> Iterator[tuple[str, ...]]:
    """Yield a row of the table for each program."""
    lines = cases // SPEEDS
    loop = Trial("bare loop", folder / "loop", lines)
    bare, wall, memory = loop.watched()
    expected = loop.read()
    yield ("bare loop", f"{bare:.1f} s", "", f"{wall:.1f} s", f"{memory:.0f} MB", "1", f"0 of {cases // 2}", "", "")
    for number, name in enumerate(names):
        trial = Trial(name, folder / f"whole{number}", lines)
        try:
            used, wall, memory = trial.watched()
            files = sum(len(found) for *_, found in os.walk(trial.folder))
            if not np.array_equal(trial.read(), expected):
                raise RuntimeError("has other results")
            killed = after_a_kill(Trial(name, folder / f"killed{number}", lines), expected)
        except (TimeoutError, RuntimeError) as error:
            yield name, str(error), *7 * [""]
            continue
        times = (f"{used:.1f} s", f"{used - bare:+.1f} s", f"{wall:.1f} s")
        yield name, *times, f"{memory:.0f} MB", str(files), *killed


def main(cases: str = "4000", *names: str) -> None:
    """Compare the named programs (default: all)."""
    head = ("way", "processors", "above the loop", "wall", "peak memory", "files")
    head += ("left after the kill", "computed again", "ends with the same numbers")
    with tempfile.TemporaryDirectory() as scratch:
        Trial("bare loop", Path(scratch, "warm"), 2).watched()  # compiles the functions
        rows = compare(Path(scratch), int(cases), list(names or [name for name in WAYS if name != "bare loop"]))
        print(table(head, rows))
