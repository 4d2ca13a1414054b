"""Kill parts of a campaign at random: ``python -m benchmarks kills [PARTS] [KILLS] [SEED]``.

A part that was killed with SIGKILL is started again. Afterwards every chunk is compared with that of an undisturbed
run, and the blocks that were computed twice are counted.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

import toy
from killed_parts import run_with_kills, study

from mdr_dask import store
from mdr_dask.execute import Resources, run
from mdr_dask.store import files

PAUSE, BLOCKS_PER_KILL = 0.05, 12  # PAUSE: seconds that a block sleeps


def chunks(url: str) -> dict[str, bytes | None]:
    """Return the content of all files of a store except metadata and records."""
    return dict(files.read_many(url, [name for name in files.listed(url) if "/c/" in name or name.endswith("/c")]))


def main(parts: str = "8", kills: str = "100", seed: str = "1") -> None:
    """Run a study in parts with a number of kills, and print the differences from an undisturbed run."""
    toy.install()
    blocks, start = BLOCKS_PER_KILL * int(kills), time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        url, whole = (str(Path(folder, name)) for name in ("parts.zarr", "whole.zarr"))
        hit = run_with_kills(url, int(parts), int(kills), blocks, PAUSE, int(seed))
        seconds = time.monotonic() - start
        left = run(study(blocks), url, Resources(threads=1), lambda _: None).done
        run(study(blocks), whole, Resources(threads=1), lambda _: None)
        twice = sum(attempt - 1 for attempt in store.attempts(url, "").values())
        same = chunks(url) == chunks(whole)
        faults = len(store.verify(url).findings)
    print(f"{parts} parts, {blocks} blocks of {PAUSE} s, {seconds:.0f} s: {hit} kills hit a part at work")
    print(f"{left} results left to a plain run, {twice} blocks done twice, {'the same' if same else 'OTHER'} bytes")
    print(f"verify: {faults} faults")
