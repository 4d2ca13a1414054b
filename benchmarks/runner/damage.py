"""Harm to every kind of file of a store: ``python -m benchmarks runner damage [TRIALS] [SEED]``.

Each trial harms one file of a sound store, looks at it with plain xarray and with every command, repairs, runs again,
and compares the bytes. Told is every trial in which something stayed silent or did not become whole.
"""

from __future__ import annotations

import itertools
import random
import sys
import tempfile
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))

import damage
import toy


def main(trials: int, seed: int) -> None:
    toy.install()
    draw = random.Random(seed)
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        whole = {}
        for series in (False, True):
            path = Path(folder, f"{'series' if series else 'plain'}.zarr")
            whole[series] = path, damage.build(toy, str(path), series)
        pairs = itertools.cycle(itertools.product(damage.KINDS, damage.HARMS))
        for kind, harm in itertools.islice(pairs, trials):
            series = damage.KINDS[kind].startswith("far") or bool(draw.randrange(2))
            trial = damage.try_harm(toy, *whole[series], Path(folder, "harmed.zarr"), kind, harm, draw)
            counts["trials"] += 1
            counts["read wrongly by plain xarray"] += trial.reads_wrongly
            for fault in trial.faults:
                counts[fault] += 1
                print(f"{kind}, {harm}, {trial.file}: {fault}", flush=True)
    for what, count in counts.items():
        print(f"{count:6d} {what}")


if __name__ == "__main__":
    main(*[int(argument) for argument in sys.argv[1:]] or [70], *[1] * (len(sys.argv) < 3))
