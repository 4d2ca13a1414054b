"""Parts of a campaign killed at random: ``python -m benchmarks runner kills [PARTS] [KILLS] [SEED]``.

Starts all parts at once, kills one after the other with SIGKILL at random instants and starts it again; then compares
every chunk with those of an undisturbed run, and counts the blocks that were done twice.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

import toy
from killed_parts import run_with_kills, study
from test_execute import digests

from mdr_dask import store
from mdr_dask.execute import Resources, run

#: Seconds that a block sleeps, and blocks for each kill.
PAUSE, BLOCKS_PER_KILL = 0.05, 12


def main(parts: int = 8, kills: int = 100, seed: int = 1) -> None:
    toy.install()
    blocks = BLOCKS_PER_KILL * kills
    with tempfile.TemporaryDirectory() as folder:
        url, whole = (str(Path(folder, name)) for name in ("parts.zarr", "whole.zarr"))
        start = time.monotonic()
        hit = run_with_kills(url, parts, kills, blocks, PAUSE, seed)
        seconds = time.monotonic() - start
        left = run(study(blocks), url, Resources(threads=1), lambda _: None).done
        run(study(blocks), whole, Resources(threads=1), lambda _: None)
        twice = sum(attempt - 1 for attempt in store.attempts(url, "").values())
        same = digests(url) == digests(whole)
    print(f"{parts} parts, {blocks} blocks of {PAUSE} s, {seconds:.0f} s: {hit} kills hit a part at work")
    print(f"{left} results left to a plain run, {twice} blocks done twice, {'the same' if same else 'OTHER'} bytes")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
