"""What a store costs: ``python -m benchmarks runner store [BLOCKS]``.

Flushing, per block, as processor time and as time on the wall; and the cheap checks of a store of many blocks, which is
fabricated: one block is computed, and its chunks stand for all.
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

import toy

from mdr_dask import store
from mdr_dask.execute import Resources, run
from mdr_dask.plan import templates
from mdr_dask.store import files
from mdr_dask.store.records import sealed


def study(blocks: int):
    axis = toy.axis("position", np.linspace(1.0, 2.0, blocks).tolist())
    return replace(toy.campaign(axis), blocks={"position": 1})


def timed(what: str, act: Callable[[], object], parts: int = 1) -> None:
    wall, processor = time.perf_counter(), time.process_time()
    act()
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    print(f"{what:40s} {1e3 * wall / parts:10.2f} ms, {1e3 * processor / parts:8.2f} ms of processors", flush=True)


def flushing(folder: Path, blocks: int) -> None:
    flush = files._flush
    for turn in range(2):
        for name, used in (("flushed", flush), ("not flushed", lambda _: None)):
            files._flush = used
            url = str(folder / f"{name}-{turn}.zarr")
            timed(f"a block, {name}", lambda url=url: run(study(blocks), url, Resources(), lambda _: None), blocks)
    files._flush = flush


def fabricate(url: str, blocks: int) -> None:
    run(study(1), f"{url}.one", Resources(), lambda _: None)
    store.lay_out(url, templates(study(blocks), 6))
    line = json.loads(next(Path(f"{url}.one", "status/records").glob("*.jsonl")).read_text())
    del line["digest"]
    for name in ("height", "status"):
        chunk = Path(f"{url}.one", name, "c/0/0").read_bytes()
        for block in range(blocks):
            target = Path(url, name, f"c/{block}")
            target.mkdir(parents=True)
            (target / "0").write_bytes(chunk)
    for first in range(0, blocks, 1000):
        some = [sealed({**line, "block": [block, 0]}) for block in range(first, min(first + 1000, blocks))]
        files.write_bytes(url, f"status/records/{first}.jsonl", b"\n".join(some) + b"\n")


def main(blocks: int) -> None:
    toy.install()
    with tempfile.TemporaryDirectory() as folder:
        flushing(Path(folder), 100)
        url = str(Path(folder, "many.zarr"))
        fabricate(url, blocks)
        timed(f"cheap checks of {blocks} blocks", lambda: store.require_sound(url, [""]))
        timed("a run with nothing to do", lambda: run(study(blocks), url, Resources(), lambda _: None))
        timed("reading the records", lambda: list(store.records(url, "")))
        timed("verify", lambda: store.verify(url))
        shutil.rmtree(url)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
