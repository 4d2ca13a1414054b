"""What commands cost at stores of many blocks: ``python -m benchmarks runner scale [BLOCKS...]``.

Blocks hold 100 results each; in one of a hundred blocks a case fails. A store is fabricated: two blocks are computed,
and their chunks stand for all. Every command is a process of its own; its processor time, its time on the wall and its
peak memory are those that the operating system tells. The cheap checks are those of `run` and `status`, timed inside a
process; before the store is sealed they are those of a copy.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from mdr_dask import store
from mdr_dask.campaign import load
from mdr_dask.execute import Resources, run
from mdr_dask.plan import templates
from mdr_dask.store import files
from mdr_dask.store.records import sealed

TESTS = Path(__file__).parents[2] / "tests"
CAMPAIGN = """
name: many
model: toy:MODEL
seed: 1
realisations: {realisations}
parameters: {{position: {{linear: [1 m, {positions} m, {positions}]}}, fail_above: {limit} m}}
store: {{path: {name}.zarr, blocks: {{position: 10, realisation: 10}}}}
"""
#: Starts a command and tells what it took; itself small, since a process begins with the peak memory of its parent.
LAUNCHER = """
import os, subprocess, sys, time
start = time.perf_counter()
process = subprocess.Popen(sys.argv[1:], stdout=sys.stderr)
_, code, used = os.wait4(process.pid, 0)
print(used.ru_utime + used.ru_stime, time.perf_counter() - start, used.ru_maxrss)
sys.exit(os.waitstatus_to_exitcode(code))
"""
COMMANDS = {
    "check": ("check", "many.yaml"),
    "run --dry-run": ("run", "many.yaml", "--dry-run"),
    "run, finished": ("run", "many.yaml", "--quiet"),
    "status": ("status", "many.zarr"),
    "status --failures": ("status", "many.zarr", "--failures"),
}


#: One act inside a process of its own, timed without its start.
ACT = """
import sys, time
from mdr_dask import execute, store
start = time.process_time(), time.perf_counter()
{act}
print(time.process_time() - start[0], time.perf_counter() - start[1], 0)
"""
ACTS = {
    "cheap checks of a copy": "store.require_sound('many.zarr', [''])",
    "sealing it": "store.seal('many.zarr', '')",
    "cheap checks": "store.require_sound('many.zarr', [''])",
}


def write_campaign(folder: Path, name: str, rows: int, columns: int, limit: float) -> Path:
    path = folder / f"{name}.yaml"
    sizes = {"positions": 10 * rows, "realisations": 10 * columns}
    path.write_text(CAMPAIGN.format(name=name, limit=limit, **sizes))
    return path


def fabricate(folder: Path, blocks: int) -> int:
    """Make a campaign and its finished store of about so many blocks; return how many."""
    rows = 100 * math.ceil(math.sqrt(blocks / 10) / 100) if blocks >= 1000 else 10
    columns = max(blocks // rows, 1)
    limit = 10 * rows - 0.5
    patterns = {
        "done": load(write_campaign(folder, "done", 1, 1, limit)),
        "failed": load(write_campaign(folder, "failed", 1, 1, 9.5)),
    }
    lines, chunks = {}, {}
    for name, campaign in patterns.items():
        url = folder / f"{name}.zarr"
        run(campaign, str(url), Resources(), lambda _: None)
        lines[name] = json.loads(next(url.glob("status/records/*.jsonl")).read_text())
        del lines[name]["digest"]
        chunks[name] = {array: (url / array / "c/0/0").read_bytes() for array in ("height", "status")}
    many = load(write_campaign(folder, "many", rows, columns, limit))
    url = folder / "many.zarr"
    store.lay_out(str(url), templates(many, many.replication.at_least))
    records = []
    for row in range(rows):
        name = "failed" if row % 100 == 99 else "done"
        for array in ("height", "status"):
            (url / array / f"c/{row}").mkdir(parents=True)
        for column in range(columns):
            for array, content in chunks[name].items():
                (url / array / f"c/{row}/{column}").write_bytes(content)
            messages = [
                {**told, "place": [told["place"][0] + 10 * row, told["place"][1] + 10 * column]}
                for told in lines[name]["messages"]
            ]
            records.append(sealed({**lines[name], "block": [row, column], "messages": messages}))
    for first in range(0, len(records), 1000):
        files.write_bytes(str(url), f"status/records/{first}.jsonl", b"\n".join(records[first : first + 1000]) + b"\n")
    return rows * columns


def measure(folder: Path, program: tuple[str, ...], launcher: tuple[str, ...] = ()) -> tuple[float, float, float]:
    """Return processor seconds, seconds on the wall and peak memory in MB of a program, as it or its launcher tells."""
    environment = {**os.environ, "PYTHONPATH": str(TESTS)}
    command = [sys.executable, *launcher, *program]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(program)}: {done.stderr}")
    processors, wall, peak = map(float, done.stdout.split()[-3:])
    return processors, wall, peak / 1000


def main(*counts: int) -> None:
    print("| blocks | results | files | what | processors | wall | peak memory |\n|---|---|---|---|---|---|---|")
    for count in counts:
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            blocks = fabricate(folder, count)
            found = sum(len(names) for *_, names in os.walk(folder / "many.zarr"))
            acts = {name: (("-c", ACT.format(act=act)), ()) for name, act in ACTS.items()}
            start = "import sys; from mdr_dask.cli import main; sys.exit(main())"
            program = (sys.executable, "-c", start)
            commands = {name: ((*program, *command), ("-S", "-c", LAUNCHER)) for name, command in COMMANDS.items()}
            for name, (arguments, launcher) in (acts | commands).items():
                if name in commands:
                    measure(folder, arguments, launcher)  # for the caches of the disk
                processors, wall, memory = measure(folder, arguments, launcher)
                peak = f"{memory:.0f} MB" if memory else ""
                sizes = f"{blocks} | {100 * blocks} | {found}"
                print(f"| {sizes} | {name} | {processors:.2f} s | {wall:.2f} s | {peak} |", flush=True)


if __name__ == "__main__":
    sys.path[:0] = [str(TESTS)]
    main(*map(int, sys.argv[1:] or ["1000", "10000", "100000"]))
